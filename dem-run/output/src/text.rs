//! Readable tables and numbers, cells of CSV files.

use std::borrow::Cow;
use std::fmt::Display;

/// Most members of a list that a message shows.
const LISTED: usize = 8;

/// A row of a CSV file from numbers and words.
#[macro_export]
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$($crate::Cell::text(&$cell)),*] };
}

/// A value as a cell of a CSV file.
pub trait Cell {
    /// Its text; for a number as [`shortest`].
    fn text(&self) -> String;
}

impl Cell for f64 {
    fn text(&self) -> String {
        shortest(*self)
    }
}

macro_rules! as_displayed {
    ($($kind:ty),*) => { $(impl Cell for $kind { fn text(&self) -> String { self.to_string() } })* };
}
as_displayed!(bool, u8, u32, u64, usize, i32, i64, str, String, Cow<'_, str>);

impl<T: Cell + ?Sized> Cell for &T {
    fn text(&self) -> String {
        T::text(self)
    }
}

/// A table of text with right-aligned numbers.
#[derive(Default)]
pub struct Text {
    rows: Vec<Vec<String>>,
}

impl Text {
    /// A table with a header.
    pub fn new(head: &[&str]) -> Self {
        Self { rows: vec![head.iter().map(ToString::to_string).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The table as lines: the first column aligned left, the others right.
    pub fn lines(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cell = |row: &[String], c: usize| row.get(c).cloned().unwrap_or_default();
        let width = |c: usize| self.rows.iter().map(|row| cell(row, c).chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let line = |row: &Vec<String>| {
            let mut line = String::new();
            for (c, &width) in widths.iter().enumerate() {
                let text = cell(row, c);
                match c {
                    0 => line += &format!("{text:<width$}"),
                    _ => line += &format!("  {text:>width$}"),
                }
            }
            line.trim_end().to_string() + "\n"
        };
        self.rows.iter().map(line).collect()
    }
}

/// A list of names and values, one a line.
pub fn facts(facts: &[(&str, String)]) -> String {
    let width = facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    facts.iter().map(|(name, value)| format!("{name:<width$}  {value}\n")).collect()
}

/// The first of a list, and the number of the others.
pub fn listed(all: &[impl ToString]) -> String {
    let first: Vec<String> = all.iter().take(LISTED).map(ToString::to_string).collect();
    let more = all.len() - first.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", first.join(", "))
}

/// Bytes in hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A number of things in words: `1 bond`, `2 bonds`.
pub fn counted(number: usize, word: &str) -> String {
    format!("{number} {word}{}", if number == 1 { "" } else { "s" })
}

/// A readable number: four digits, and a power of ten for very large or small values.
pub fn number(value: f64) -> String {
    digits(value, 4)
}

/// A number for captions: three digits.
pub fn short(value: f64) -> String {
    digits(value, 3)
}

fn digits(value: f64, digits: i32) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&magnitude) {
        return format!("{value:.*e}", digits as usize - 1);
    }
    let decimals = (digits - 1 - magnitude.log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A number without its round-off: up to ten digits, without zeros at the end.
pub fn plain(value: f64) -> String {
    shortest(format!("{value:.9e}").parse().unwrap_or(value))
}

/// A number with its unit, or a dash for no number.
pub fn quantity(value: Option<impl Into<f64>>, unit: &str) -> String {
    value.map_or_else(|| "–".into(), |value| with_unit(number(value.into()), unit))
}

fn with_unit(number: impl Display, unit: &str) -> String {
    if unit.is_empty() { number.to_string() } else { format!("{number} {unit}") }
}

/// An optional number as a cell of a CSV file, as [`shortest`]; empty for none.
pub fn cell(value: Option<f64>) -> String {
    value.map_or_else(String::new, shortest)
}

/// The fewest digits from which the same number is read, with a power of ten for very large or
/// small values.
pub fn shortest(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 || (1e-4..1e16).contains(&magnitude) { value.to_string() } else { format!("{value:e}") }
}

/// A readable file size.
#[must_use]
pub fn size(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_right() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (15.975, "15.97"),
            (-0.25, "-0.25"),
            (123456.0, "123456"),
            (1.5e-5, "1.500e-5"),
            (0.001234, "0.001234"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn round_off_is_not_printed() {
        for (value, text) in
            [(0.47440000000000004, "0.4744"), (0.1 + 0.2, "0.3"), (1.0, "1"), (0.123456789, "0.123456789")]
        {
            assert_eq!(plain(value), text);
        }
    }

    #[test]
    fn cells_are_read_back_to_the_bit() {
        for (value, text) in [
            (0.1, "0.1"),
            (-0.0, "-0"),
            (23.369999999999997, "23.369999999999997"),
            (0.00000000012533300262912866, "1.2533300262912866e-10"),
            (1e16, "1e16"),
            (-5e-324, "-5e-324"),
        ] {
            assert_eq!(shortest(value), text);
            assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()));
        }
        assert_eq!((cell(None), cell(Some(2.0))), (String::new(), "2".into()));
    }

    #[test]
    fn sizes_are_short() {
        assert_eq!(
            (size(5_000), size(63_400_000), size(2_500_000_000)),
            ("5 kB".into(), "63.4 MB".into(), "2.5 GB".into())
        );
    }

    #[test]
    fn a_table_is_aligned() {
        let mut text = Text::new(&["mode", "bonds"]);
        text.row(vec!["TENSION".into(), "7".into()]);
        assert_eq!(text.lines(), "mode     bonds\nTENSION      7\n");
    }
}
