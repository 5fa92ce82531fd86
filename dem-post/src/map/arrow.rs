//! Arrows.

use dem_drawing::{Canvas, colour};

/// An arrow with an open head proportional to its length.
pub(super) fn draw_arrow(canvas: &mut Canvas, from: (f64, f64), to: (f64, f64)) {
    let (x, y) = (to.0 - from.0, to.1 - from.1);
    let length = x.hypot(y);
    // shorter than a pixel shows no direction
    if length < 1.0 {
        return;
    }
    let head = (0.35 * length).min(6.0) / length;
    let back = |side: f64| (to.0 - head * (x - 0.5 * side * y), to.1 - head * (y + 0.5 * side * x));
    // a white rim keeps it visible on dark grains
    for (colour, width) in [("#ffffff", 3.0), (colour::BLACK, 1.2)] {
        for (from, to) in [(from, to), (to, back(-1.0)), (to, back(1.0))] {
            canvas.line(from, to, colour, width);
        }
    }
}
