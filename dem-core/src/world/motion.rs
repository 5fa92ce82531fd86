//! Where the bodies are and how they move in a step, before its contacts are known.

use crate::body::{Grains, Wall};
use crate::dim::Dim;
use std::sync::Arc;

/// The configuration at mid-step, where contacts are looked for (m).
#[derive(Clone)]
pub(super) struct Midpoint<D: Dim> {
    pub grains: Vec<D::Vector>,
    pub walls: Vec<D::Vector>,
}

impl<D: Dim> Midpoint<D> {
    /// Where the bodies are now.
    pub fn of(grains: &Grains<D>, walls: &[Wall<D>]) -> Self {
        Self { grains: grains.position.clone(), walls: walls.iter().map(|w| w.position).collect() }
    }

    /// The place of a body (m), grains first.
    pub fn place(&self, body: usize) -> D::Vector {
        body.checked_sub(self.grains.len()).map_or_else(|| self.grains[body], |wall| self.walls[wall])
    }
}

/// Node velocities before the step (m/s, rad/s) and their free values, grains first.
pub(super) struct Motion<D: Dim> {
    pub before: Vec<(D::Vector, D::Spin)>,
    pub free: Arc<[(D::Vector, D::Spin)]>,
}

/// What a bond is given back in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Turn {
    /// What is added to the normal velocity of the bond before its law (m/s).
    pub bias: f64,
    /// By how much the bond is longer at mid-step than its law knows, beside the hidden length of
    /// steps of this length (m): zero where all steps were of one length.
    pub owed: f64,
}
