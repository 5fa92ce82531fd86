//! Ranges of numbers, volumes of grains, and the box around all grains.

use std::f64::consts::PI;

use dem_history::{History, NOT_FORMED};

use crate::output::Result;

/// The least and the greatest of some numbers; infinite, the least above the greatest, without any.
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Area of a disk (m², 2D) or volume of a sphere (m³, 3D) of this radius (m).
pub fn volume(dimension: usize, radius: f64) -> f64 {
    if dimension == 2 { PI * radius * radius } else { 4.0 / 3.0 * PI * radius.powi(3) }
}

/// The box around all grains at the first frame, m: its ends along each axis.
///
/// # Errors
/// Those of reading the history; it must have a frame.
pub fn first_box(history: &History) -> Result<Vec<[f64; 2]>> {
    Ok(box_around(&history.grains()?.radius, &history.grain_state(0)?.position, history.dimension()))
}

/// The frame with the grains as they were bonded: the first one, or the first one after a stage has
/// formed the bonds (the last, where none was recorded since).
///
/// # Errors
/// Those of reading the history.
pub fn bonded_frame(history: &History) -> Result<usize> {
    let formed = history.bonds_formed()?.unwrap_or(NOT_FORMED);
    let found = history.steps().partition_point(|&step| step < formed);
    Ok(found.min(history.frames().saturating_sub(1)))
}

/// The box around grains of these radii at these positions, D numbers each, m: its ends along each
/// axis.
pub fn box_around(radius: &[f64], position: &[f64], dimension: usize) -> Vec<[f64; 2]> {
    (0..dimension).map(|axis| ends_along(radius, position, dimension, |x| x[axis])).collect()
}

/// How far grains of these radii at these positions, D numbers each, reach along a direction, m;
/// `place` is the component of a position along it.
pub fn ends_along(radius: &[f64], position: &[f64], dimension: usize, place: impl Fn(&[f64]) -> f64) -> [f64; 2] {
    let reach = |sign: f64| range(radius.iter().zip(position.chunks(dimension)).map(|(r, x)| place(x) + sign * r));
    [reach(-1.0)[0], reach(1.0)[1]]
}
