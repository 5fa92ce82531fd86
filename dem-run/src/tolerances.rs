//! Tolerances of the geometry of a scene.

/// Distance, in radii, that counts as zero in tests of contact: decimal coordinates are not exact.
pub(crate) const TOUCHING: f64 = 1e-6;
/// Largest accepted overlap of two rigid grains, over the smaller radius. Samples from other
/// programs with soft grains have overlaps.
pub(crate) const DEEPEST: f64 = 0.1;
/// Overlap of two grains, over the smaller radius, above which a warning is printed. Overlaps from
/// tables with few decimals are smaller.
pub(crate) const ROUNDED: f64 = 1e-3;
/// Sine (cosine) of an angle below which two directions count as parallel (perpendicular): decimal
/// directions are not exact.
pub(crate) const PARALLEL: f64 = 1e-6;
/// Round-off of the position of a grain, over its radius, above which touching grains may count as
/// apart: the gap up to which a contact is closed.
pub(crate) const HIDDEN: f64 = 1e-9;
