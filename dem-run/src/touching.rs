//! Walls that need grains at the start: those driven by a stress, and those that hold grains.

use crate::output::number;
use crate::scene::Scene;
use crate::tolerances::ROUNDED;
use dem_core::body::{Grains, Shape, Wall};
use dem_core::dim::Dim;

/// The field of a scene by which a wall is seated against the sample.
pub(crate) fn seating<D: Dim>(wall: &Wall<D>) -> &'static str {
    match wall.shape {
        Shape::Plate(_) => "\"seated\": true",
        Shape::Plane { .. } | Shape::Round { .. } => "\"place\": \"seated\"",
    }
}

/// Messages about walls that need grains and have none.
pub(crate) fn apart<D: Dim>(scene: &Scene, walls: &[Wall<D>], grains: &Grains<D>) -> Vec<String> {
    let mut wrong = vec![];
    let needy = |wall: &Wall<D>| wall.per_area || wall.grip.is_some();
    for (name, wall) in scene.walls.keys().zip(walls).filter(|(_, wall)| needy(wall)) {
        let gap = |(x, r): (&D::Vector, &f64)| (wall.shape.gap(*x - wall.position, *r).0, *r);
        let Some((gap, radius)) =
            grains.position.iter().zip(&grains.radius).map(gap).min_by(|a, b| a.0.total_cmp(&b.0))
        else {
            continue;
        };
        if wall.per_area && gap > ROUNDED * radius {
            wrong.push(format!(
                "walls.{name}.stress: the wall touches nothing at the start, so there is no section to load: its nearest \
                 grain is {} m away; seat it ({}), or turn its normal towards the sample",
                number(gap),
                seating(wall)
            ));
        }
        if let Some(grip) = wall.grip.filter(|grip| gap > *grip) {
            wrong.push(format!(
                "walls.{name}.grip: no grain is within {grip:?} m of the wall, the nearest is {} m away; seat the wall \
                 ({}), or enlarge the grip",
                number(gap),
                seating(wall)
            ));
        }
    }
    wrong
}
