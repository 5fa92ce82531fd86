//! Legends of charts.

use crate::canvas::{Anchor, Canvas};

/// Distance between the rows of a legend.
pub(crate) const ROW: f64 = 19.0;

/// Style of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Joined points.
    Line,
    /// Points joined by a thin line, for scattered values.
    Thin,
    /// A value that holds until the next point.
    Steps,
    /// Joined points, each with a dot.
    Marked,
    /// Dots alone.
    Points,
    /// Error bars around a mean; see [`Bars`](crate::Bars).
    Bars,
    /// A dashed level in the legend.
    Level,
}

/// A name of a legend, its colour and style.
pub(crate) type Named = (String, &'static str, Style);

fn width(legend: &[Named]) -> f64 {
    legend.iter().map(|(text, ..)| 50.0 + 7.8 * text.chars().count() as f64).sum()
}

/// A legend beside the letter of a chart of width `room`, in as many rows as necessary.
pub(crate) fn rows(legend: &[Named], room: f64) -> Vec<&[Named]> {
    let mut rows = vec![];
    let mut rest = legend;
    while !rest.is_empty() {
        let fits = (1..=rest.len()).take_while(|n| width(&rest[..*n]) <= 0.86 * room).last().unwrap_or(1);
        let (row, left) = rest.split_at(fits);
        rows.push(row);
        rest = left;
    }
    rows
}

/// The names of the curves in one row around `middle`.
pub(crate) fn draw(canvas: &mut Canvas, legend: &[Named], middle: (f64, f64)) {
    let (mut x, y) = (middle.0 - 0.5 * width(legend), middle.1);
    for entry in legend {
        let (text, colour, style) = entry;
        match style {
            Style::Level => {
                for dash in [0.0, 7.0, 14.0, 21.0] {
                    canvas.line((x + dash, y), (x + dash + 4.0, y), colour, 1.4);
                }
            }
            Style::Points => {}
            Style::Bars => {
                canvas.line((x + 13.0, y - 6.5), (x + 13.0, y + 6.5), colour, 1.4);
                for end in [-6.5, 6.5] {
                    canvas.line((x + 9.0, y + end), (x + 17.0, y + end), colour, 1.4);
                }
            }
            _ => canvas.line((x, y), (x + 26.0, y), colour, 2.2),
        }
        if matches!(style, Style::Marked | Style::Points | Style::Bars) {
            canvas.disk((x + 13.0, y), 3.5, colour, colour, 0.5);
        }
        canvas.text((x + 33.0, y + 5.0), text, 14, Anchor::Start);
        x += width(std::slice::from_ref(entry));
    }
}
