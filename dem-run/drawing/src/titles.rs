//! Titles of the axes of charts.

use kuva::render::render::Primitive;

/// Size of their letters in units of a drawing.
pub(crate) const SIZE: u32 = 15;
/// Distance of two lines.
const LINE: f64 = 18.0;
/// Height of the letter of a chart, above its vertical title.
const LETTER: f64 = 24.0;
/// Mean width of a letter over its size, at most.
const EM: f64 = 0.53;

/// Height of charts with room for their vertical titles below the letters of the charts; `above`
/// and `below` are the margins of their areas.
pub(crate) fn height<'a>(titles: impl Iterator<Item = &'a str>, above: f64, below: f64) -> f64 {
    let longest = titles.map(length).fold(0.0, f64::max);
    // a title stands at the middle of the area
    (longest + (2.0 * LETTER + below - above).max(above - below)).ceil()
}

/// Length of a title of an axis, at most, in units of a drawing.
fn length(title: &str) -> f64 {
    EM * f64::from(SIZE) * title.chars().count() as f64
}

/// Breaks horizontal titles that are longer than a chart of width `width` into two lines, and moves
/// those that would end beyond it.
pub(crate) fn wrap(elements: &mut Vec<Primitive>, titles: &[String], width: f64) {
    let is_title = |text: &str| titles.iter().any(|title| title == text);
    let mut out = Vec::with_capacity(elements.len());
    for element in elements.drain(..) {
        let Primitive::Text { x, y, content, size: SIZE, anchor, rotate: None, bold, color } = element else {
            out.push(element);
            continue;
        };
        let lines = if is_title(&content) && length(&content) > width { halves(&content) } else { vec![content] };
        let count = lines.len();
        for (k, content) in lines.into_iter().enumerate() {
            let half = 0.5 * length(&content);
            // the last line stays where the title was
            let y = y - LINE * (count - 1 - k) as f64;
            let x = if is_title(&content) || count > 1 { x.min(width - half).max(half) } else { x };
            out.push(Primitive::Text { x, y, content, size: SIZE, anchor, rotate: None, bold, color: color.clone() });
        }
    }
    *elements = out;
}

/// A text broken at the space nearest to its middle; whole without one.
fn halves(text: &str) -> Vec<String> {
    let middle = text.len() / 2;
    let space = text.match_indices(' ').map(|(at, _)| at).min_by_key(|at| at.abs_diff(middle));
    space.map_or_else(|| vec![text.into()], |at| vec![text[..at].into(), text[at + 1..].into()])
}

#[cfg(test)]
mod tests {
    use crate::{Chart, Style, colour};

    #[test]
    fn titles_longer_than_a_small_chart_are_whole() {
        let [x, y] =
            ["magnitude of the axial strain, from the grains", "difference of the two stresses of the walls (kPa)"];
        let chart = Chart::new(x, y).curve("", colour::BLUE, Style::Line, vec![(0.0, 0.0), (1.0, 1.0)]);
        let drawing = Chart::draw_sized(vec![chart], (280.0, 200.0));
        let svg = drawing.svg();
        assert!(svg.contains(">magnitude of the axial<") && svg.contains(">strain, from the grains<"), "{svg}");
        // the vertical title needs 49 letters of 8 units
        assert!(svg.contains(&format!(">{y}<")) && drawing.size().1 > 390.0, "{:?}", drawing.size());
    }
}
