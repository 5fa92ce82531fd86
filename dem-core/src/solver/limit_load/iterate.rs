//! Points of the homogeneous embedding, and the residuals there.

use super::programme::{Programme, sum};
use crate::solver::interior::cones::{Point, moved};

/// A point of the embedding, or a step: reactions r̂ and factor λ, velocities y of a mechanism,
/// cone pairs s and z, and the scale τ with its dual κ.
#[derive(Clone)]
pub(super) struct Iterate {
    pub r: Vec<f64>,
    pub lambda: f64,
    pub y: Vec<f64>,
    pub s: Vec<Point>,
    pub z: Vec<Point>,
    pub tau: f64,
    pub kappa: f64,
}

/// Residuals at a point.
pub(super) struct Residual {
    pub x: Vec<f64>,
    pub lambda: f64,
    pub y: Vec<f64>,
    pub z: Vec<Point>,
    pub tau: f64,
}

impl Programme {
    /// The residuals at a point.
    pub fn residual(&self, at: &Iterate) -> Residual {
        let (pulled, of_cones) = (self.pulled(&at.y), self.sites.velocity(&at.z));
        let pushed = self.pushed(&at.r);
        let balance = pushed.iter().zip(&self.load).zip(&self.b);
        let own = self.sites.change(&at.r);
        Residual {
            x: pulled.iter().zip(&of_cones).map(|(y, z)| y - z).collect(),
            lambda: sum(&self.load, &at.y) + self.sense * at.tau,
            y: balance.map(|((h, f), b)| b * at.tau - h - f * at.lambda).collect(),
            z: at.s.iter().zip(&own).map(|(s, own)| moved(s, -1.0, own)).collect(),
            tau: at.kappa + self.sense * at.lambda + sum(&self.b, &at.y),
        }
    }
}
