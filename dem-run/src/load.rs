//! The load of a driven wall.

use dem_core::body::{Drive, Wall};
use dem_core::dim::{Dim, Vect};

/// The load of a driven wall in the last step (N): the prescribed force, or for a prescribed
/// velocity the force of the wall on the grains before any bond broke in that step.
pub(crate) fn load<D: Dim>(wall: &Wall<D>) -> f64 {
    match wall.drive {
        Drive::Fixed => 0.0,
        Drive::Velocity { direction, .. } => -direction.dot(&wall.reaction_at_limit),
        Drive::Force { .. } => wall.applied,
    }
}

/// The direction of a driven wall.
pub(crate) fn drive_direction<D: Dim>(wall: &Wall<D>) -> Option<D::Vector> {
    match wall.drive {
        Drive::Fixed => None,
        Drive::Velocity { direction, .. } | Drive::Force { direction, .. } => Some(direction),
    }
}
