//! How exact the geometry of a scene is: lengths and angles below which a difference means nothing.

/// Overlap, in radii, that still counts as touching: decimal coordinates are not exact.
pub(crate) const TOUCHING: f64 = 1e-6;
/// Overlap of two rigid grains, over the smaller radius, up to which it may be an error of where they came from: soft
/// grains of other programs overlap.
pub(crate) const DEEPEST: f64 = 0.1;
/// Overlap of two grains, over the smaller radius, that a table of few decimals brings: no word about it.
pub(crate) const ROUNDED: f64 = 1e-3;
/// Sine or cosine of an angle below which two directions are along or across each other: directions in decimals are not
/// exact.
pub(crate) const PARALLEL: f64 = 1e-6;
