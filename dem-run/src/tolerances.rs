//! Tolerances of the geometry of a scene.

/// Overlap, in radii, that still counts as touching: decimal coordinates are not exact.
pub(crate) const TOUCHING: f64 = 1e-6;
/// Largest overlap of two rigid grains that is accepted, over the smaller radius. Samples from
/// other programs, with soft grains, overlap.
pub(crate) const DEEPEST: f64 = 0.1;
/// Overlap of two grains, over the smaller radius, above which there is a warning. Tables with few
/// decimals overlap by less.
pub(crate) const ROUNDED: f64 = 1e-3;
/// Sine or cosine of an angle below which two directions are along or across each other: directions
/// in decimals are not exact.
pub(crate) const PARALLEL: f64 = 1e-6;
