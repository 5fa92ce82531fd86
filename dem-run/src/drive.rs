//! The drive of a wall: from a scene to the world.

use crate::scene::{self, WallMass};
use dem_core::body::{Drive, Schedule, Wall};
use dem_core::dim::Dim;
use std::sync::Arc;

/// Gives a wall of the scene a drive along `direction`, whose times count from `start` (s).
/// `masses` are those of the grains (kg).
pub(crate) fn set_drive<D: Dim>(
    built: &mut Wall<D>,
    wall: &scene::Wall,
    drive: scene::Drive,
    direction: D::Vector,
    masses: &[f64],
    start: f64,
) {
    let schedule = |function: scene::Function| -> Schedule { Arc::new(move |t| function.at(t - start)) };
    built.per_area = matches!(drive, scene::Drive::Stress(_));
    built.drive = match drive {
        scene::Drive::Fixed => Drive::Fixed,
        scene::Drive::Velocity(speed) => Drive::Velocity { direction, speed: schedule(speed) },
        scene::Drive::Force(force) | scene::Drive::Stress(force) => {
            let mass = match wall.mass {
                Some(WallMass::Kg(mass)) => mass,
                _ => masses.iter().sum(),
            };
            Drive::Force { direction, mass, force: schedule(force) }
        }
    };
}
