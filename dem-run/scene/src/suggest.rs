//! The valid name nearest to a wrong one.

/// The name in `names` nearest to `wrong`, if it is near enough.
///
/// The limit is a third of the letters, but at least two edits for names of four letters and more.
/// Names that differ only in case and in `-` for `_` are always near enough. The first name wins a
/// tie.
pub(super) fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let wrong = plain(wrong);
    // a very long word is no misprint of a name, and the cost of the distance is quadratic
    if wrong.len() > 64 {
        return None;
    }
    names
        .into_iter()
        .map(|name| (distance(&wrong, &plain(name)), name))
        .filter(|(edits, name)| *edits <= allowance(name.chars().count()))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, name)| name.to_string())
}

/// Edits within which a name of `length` letters is recognised.
fn allowance(length: usize) -> usize {
    if length < 4 { 1 } else { (length / 3).max(2) }
}

/// Lower case, `-` and blanks as `_`.
fn plain(name: &str) -> Vec<char> {
    name.chars().flat_map(char::to_lowercase).map(|c| if c == '-' || c == ' ' { '_' } else { c }).collect()
}

/// Number of insertions, deletions, substitutions and swaps of neighbours from `a` to `b`
/// (Damerau–Levenshtein, each piece edited once).
fn distance(a: &[char], b: &[char]) -> usize {
    // rows i − 2, i − 1 and i of the table
    let mut before: Vec<usize> = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let substituted = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = substituted.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edits(a: &str, b: &str) -> usize {
        distance(&plain(a), &plain(b))
    }

    #[test]
    fn distances_count_edits_and_swaps() {
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("strength", "strength"), 0);
        assert_eq!(edits("strenght", "strength"), 1);
        assert_eq!(edits("kitten", "sitting"), 3);
        assert_eq!(edits("Grain-Grain", "grain_grain"), 0);
    }

    #[test]
    fn a_misprint_finds_its_name_and_a_stranger_none() {
        let names = ["strength", "stress", "gap_tolerance"];
        assert_eq!(nearest("strenght", names).as_deref(), Some("strength"));
        assert_eq!(nearest("gaptol", ["gap_tolerance"]), None);
        assert_eq!(nearest("colour", names), None);
        assert_eq!(nearest("gap-tolerance", names).as_deref(), Some("gap_tolerance"));
        assert_eq!(nearest(&"x".repeat(10_000), names), None);
    }
}
