//! From metres to the sheet.

/// Lines of a wall's hatching: their distance and length. Panels have room for it around the
/// sample.
pub(super) const HATCH: f64 = 7.0;
/// Length of the arrow at a driven wall; panels with one have room for it.
pub(super) const ARROW: f64 = 26.0;

/// From metres to units of the drawing, for one panel.
pub(super) struct Frame {
    pub low: [f64; 2],
    pub scale: f64,
    /// Upper left corner and size on the sheet.
    pub corner: (f64, f64),
    pub size: (f64, f64),
}

impl Frame {
    pub fn at(&self, point: [f64; 2]) -> (f64, f64) {
        let x = self.corner.0 + (point[0] - self.low[0]) * self.scale;
        let y = self.corner.1 + self.size.1 - (point[1] - self.low[1]) * self.scale;
        (x, y)
    }

    pub fn shows(&self, (x, y): (f64, f64), margin: f64) -> bool {
        let (right, bottom) = (self.corner.0 + self.size.0, self.corner.1 + self.size.1);
        (self.corner.0 - margin..=right + margin).contains(&x)
            && (self.corner.1 - margin..=bottom + margin).contains(&y)
    }
}
