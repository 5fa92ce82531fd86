//! A point of the method: reactions, and the two sides of every cone pair.

use super::cones::{Point, dot};

/// A point, or a step of it.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// Reactions without the shift, of all rows.
    pub r: Vec<f64>,
    /// Primal and dual side of all cones.
    pub x: Vec<Point>,
    pub z: Vec<Point>,
}

/// Mean of x·z over all cones.
pub(super) fn gap(at: &State) -> f64 {
    at.x.iter().zip(&at.z).map(|(x, z)| dot(x, z)).sum::<f64>() / at.x.len() as f64
}
