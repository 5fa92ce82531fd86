//! Tolerances of the interior-point method, and its result.

use crate::contact::{Padded, Reached};

/// Tolerances, selection and iteration limit.
#[derive(Clone, Copy, Debug)]
pub struct Aims {
    /// Residual (–).
    pub tolerance: f64,
    /// Load error and velocity error (–).
    pub load_tolerance: f64,
    /// Whether the minimum-energy reactions in the metric are required.
    pub least: bool,
    /// Whether the reactions may be far larger than those that stop the bodies.
    pub far: bool,
    /// Most iterations.
    pub most: u64,
}

impl Aims {
    /// The larger of residual and velocity error, relative to their tolerances (–). Zero if the
    /// residual is zero: then both are round-off.
    pub fn missed(&self, residual: f64, velocity_error: f64) -> f64 {
        match residual {
            0.0 => 0.0,
            _ if residual.is_nan() || velocity_error.is_nan() => f64::INFINITY,
            _ => (velocity_error / self.load_tolerance).max(residual / self.tolerance),
        }
    }
}

/// The best point of the path.
#[derive(Clone, Debug)]
pub struct Found {
    /// Reactions without the shift, in the unit of the rows.
    pub reactions: Vec<Padded>,
    /// For each contact, the part of its limit that the minimum-energy reaction has reached; empty
    /// if these reactions are not required.
    pub reached: Vec<Option<Reached>>,
    /// Their residual (–), and their load error (–): the relative change of the reactions in the
    /// last iteration.
    pub residual: f64,
    pub load_error: f64,
    /// Their velocity error (–), see [`crate::problem::residual::velocity_error`].
    pub velocity_error: f64,
    /// Iterations made.
    pub iterations: u64,
}

impl Found {
    /// See [`Aims::missed`]; the load error counts as the velocity error does.
    pub fn missed(&self, aims: Aims) -> f64 {
        aims.missed(self.residual, self.velocity_error.max(self.load_error))
    }
}
