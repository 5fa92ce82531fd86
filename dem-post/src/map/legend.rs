//! The scale bar and the legend below a map.

use super::arrow::draw_arrow;
use super::scale::Scale;
use crate::output::short;
use dem_drawing::{Anchor, Canvas, colour};

/// Length of a colour bar, and the number of its strips.
const BAR: f64 = 150.0;
const STRIPS: usize = 50;
/// Width of a character.
const LETTER: f64 = 8.2;

/// An entry of the legend.
pub enum Key {
    /// A disk of this fill and outline.
    Disk(&'static str, &'static str, String),
    /// A line of this colour and width.
    Line(&'static str, f64, String),
    /// A colour bar with its least and greatest value.
    Bar(Scale),
    /// An arrow.
    Arrow(String),
}

/// A scale bar of a round length that begins at a point; at most a third of the panel wide.
pub(super) fn scale_bar(canvas: &mut Canvas, (x, y): (f64, f64), scale: f64, width: f64) {
    // beside a narrow panel the sheet has free space
    let longest = (width / 3.0).max(BAR / 2.0) / scale;
    let power = 10f64.powf(longest.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|l| *l <= longest).unwrap_or(power);
    let (from, to) = (x, x + length * scale);
    canvas.line((from, y), (to, y), colour::BLACK, 2.0);
    for end in [from, to] {
        canvas.line((end, y - 4.0), (end, y + 4.0), colour::BLACK, 1.2);
    }
    canvas.text((to + 8.0, y + 5.0), &metres(length), 14, Anchor::Start);
}

/// A round length with a suitable unit.
fn metres(length: f64) -> String {
    let (value, unit) = match length {
        l if l < 1e-3 => (l * 1e6, "µm"),
        l if l < 1.0 => (l * 1e3, "mm"),
        l => (l, "m"),
    };
    format!("{value:.0} {unit}")
}

/// Width of an entry of the legend, from the number of its characters.
pub(super) fn key_width(key: &Key) -> f64 {
    let letters = |text: &str| LETTER * text.chars().count() as f64;
    match key {
        Key::Disk(_, _, text) | Key::Line(_, _, text) | Key::Arrow(text) => 46.0 + letters(text),
        Key::Bar(scale) => {
            46.0 + letters(&scale.title) + BAR + letters(&short(scale.low)) + letters(&short(scale.high))
        }
    }
}

/// The legend in rows that fit `width`.
pub(super) fn legend_rows(legend: &[Key], width: f64) -> Vec<Vec<&Key>> {
    let mut rows: Vec<Vec<&Key>> = vec![];
    let mut used = f64::INFINITY;
    for key in legend {
        used += key_width(key);
        if used > width {
            rows.push(vec![]);
            used = key_width(key);
        }
        if let Some(row) = rows.last_mut() {
            row.push(key);
        }
    }
    rows
}

pub(super) fn draw_legend(canvas: &mut Canvas, row: &[&Key], (middle, y): (f64, f64)) {
    let total: f64 = row.iter().map(|key| key_width(key)).sum();
    let mut x = middle - 0.5 * total;
    for key in row {
        let text = match key {
            Key::Bar(scale) => {
                draw_bar(canvas, scale, (x + 8.0, y));
                x += key_width(key);
                continue;
            }
            Key::Arrow(text) => {
                draw_arrow(canvas, (x + 4.0, y), (x + 28.0, y));
                text
            }
            Key::Disk(fill, outline, text) => {
                canvas.disk((x + 17.0, y), 7.0, fill, outline, 1.0);
                text
            }
            Key::Line(colour, width, text) => {
                canvas.line((x + 4.0, y), (x + 28.0, y), colour, *width);
                text
            }
        };
        canvas.text((x + 34.0, y + 5.0), text, 14, Anchor::Start);
        x += key_width(key);
    }
}

/// The title, the least value, the colours and the greatest value, from left to right.
fn draw_bar(canvas: &mut Canvas, scale: &Scale, (x, y): (f64, f64)) {
    let letters = |text: &str| LETTER * text.chars().count() as f64;
    canvas.text((x, y + 5.0), &scale.title, 14, Anchor::Start);
    let from = x + letters(&scale.title) + letters(&short(scale.low)) + 10.0;
    canvas.text((from - 6.0, y + 5.0), &short(scale.low), 14, Anchor::End);
    let strip = BAR / STRIPS as f64;
    for k in 0..STRIPS {
        let value = scale.low + (scale.high - scale.low) * (k as f64 + 0.5) / STRIPS as f64;
        // strips overlap, so that no seam is visible between them
        canvas.rectangle((from + k as f64 * strip, y - 7.0), (strip + 0.5, 14.0), &scale.colour(value));
    }
    canvas.text((from + BAR + 8.0, y + 5.0), &short(scale.high), 14, Anchor::Start);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_round() {
        for (length, text) in [(1e-2, "10 mm"), (5e-4, "500 µm"), (2.0, "2 m")] {
            assert_eq!(metres(length), text);
        }
    }

    #[test]
    fn a_legend_breaks_into_rows_that_fit() {
        let key = || Key::Line(colour::BLUE, 1.0, "twenty characters ...".into());
        let legend = [key(), key(), key()];
        let rows = legend_rows(&legend, 2.0 * key_width(&legend[0]) + 1.0);
        assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
    }
}
