//! Boxes in the plane of a drawing.

/// Lower and upper corner of a box, m.
pub(super) type Box2 = [[f64; 2]; 2];

/// The empty box.
pub(super) const EMPTY: Box2 = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];

/// The unbounded box.
pub(super) const EVERYWHERE: Box2 = [[f64::NEG_INFINITY; 2], [f64::INFINITY; 2]];

pub(super) fn around(centre: [f64; 2], radius: f64) -> Box2 {
    [centre.map(|x| x - radius), centre.map(|x| x + radius)]
}

pub(super) fn union([l, h]: Box2, [low, high]: Box2) -> Box2 {
    [[l[0].min(low[0]), l[1].min(low[1])], [h[0].max(high[0]), h[1].max(high[1])]]
}
