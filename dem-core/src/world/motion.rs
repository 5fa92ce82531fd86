//! Positions and velocities of the bodies in a step before its contacts are known.

use crate::body::{Grains, Wall};
use crate::dim::{Dim, Vect};
use std::sync::Arc;

/// Positions at mid-step (m), at which contacts are detected.
#[derive(Clone)]
pub(super) struct Midpoint<D: Dim> {
    pub grains: Vec<D::Vector>,
    pub walls: Vec<D::Vector>,
}

impl<D: Dim> Midpoint<D> {
    /// The current positions.
    pub fn of(grains: &Grains<D>, walls: &[Wall<D>]) -> Self {
        Self { grains: grains.position.clone(), walls: walls.iter().map(|w| w.position).collect() }
    }

    /// Position of a body (m), grains first.
    pub fn place(&self, body: usize) -> D::Vector {
        body.checked_sub(self.grains.len()).map_or_else(|| self.grains[body], |wall| self.walls[wall])
    }
}

/// Node velocities before the step (m/s, rad/s) and their free values, grains first.
pub(super) struct Motion<D: Dim> {
    pub before: Vec<(D::Vector, D::Spin)>,
    pub free: Arc<[(D::Vector, D::Spin)]>,
}

/// Correction of a turning bond in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn<D: Dim> {
    /// Velocity that the law of the bond adds to its relative velocity (m/s).
    pub bias: D::Vector,
    /// Displacement of the bond at mid-step beyond that known to its law, less the hidden one of
    /// steps of this length (m): zero if all steps had one length.
    pub owed: D::Vector,
}

impl<D: Dim> Default for Turn<D> {
    fn default() -> Self {
        Self { bias: D::Vector::zero(), owed: D::Vector::zero() }
    }
}
