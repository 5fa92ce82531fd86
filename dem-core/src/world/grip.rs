//! Grains that walls hold.

use crate::body::{Grains, Wall};
use crate::dim::{Dim, Vect};

/// The wall that holds each grain, if any; an empty list if no wall holds a grain. Grains that are
/// held move with their wall: they count as fixed, at its velocity.
pub(super) fn hold<D: Dim>(grains: &mut Grains<D>, walls: &[Wall<D>]) -> Vec<Option<u32>> {
    let mut held = Vec::new();
    for (w, wall) in walls.iter().enumerate() {
        let Some(depth) = wall.grip else { continue };
        held.resize(grains.len(), None);
        for k in 0..grains.len() {
            let gap = wall.shape.gap(grains.position[k] - wall.position, grains.radius[k]).0;
            if gap <= depth && !grains.fixed[k] {
                held[k] = Some(w as u32);
                grains.fixed[k] = true;
                (grains.velocity[k], grains.spin[k]) = (wall.velocity, D::Spin::zero());
            }
        }
    }
    held
}
