//! Wrong values in a wall.

use super::report::Report;
use crate::model::Scene;
use crate::stage::StageDrive;
use crate::wall::{Cylinder, Drive, PERPENDICULAR, Shape, Slide, Wall, WallMass, cosine};

/// Checks the wall `name`.
pub(super) fn wall(report: &mut Report, scene: &Scene, name: &str, wall: &Wall) {
    // the drives that stages give it
    let staged = &scene.stage_drives(name).map(StageDrive::drive).collect::<Vec<_>>();
    let path = format!("walls.{name}");
    report.name(&path, name);
    wall.shape.check(report, &format!("{path}.shape"));
    if let Some(friction) = wall.friction {
        report.non_negative(format!("{path}.friction"), friction, "no unit");
    }
    let drives = [
        ("velocity", wall.velocity.is_some()),
        ("force", wall.force.is_some()),
        ("force_rate", wall.force_rate.is_some()),
        ("stress", wall.stress.is_some()),
    ];
    let given: Vec<&str> = drives.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
    if given.len() > 1 {
        report.wrong(&path, given.join(" and "), "one drive at most: velocity, force, force_rate or stress");
    }
    for (name, function) in [("velocity", &wall.velocity), ("force", &wall.force), ("stress", &wall.stress)] {
        if let Some(function) = function {
            report.function(&format!("{path}.{name}"), function);
        }
    }
    if let Some(rate) = wall.force_rate {
        report.finite(format!("{path}.force_rate"), rate);
    }
    mass_and_direction(report, &path, wall, staged);
    let stressed = staged.iter().any(|drive| matches!(drive, Drive::Stress(_)));
    if given.len() < 2 && (wall.stress.is_some() || stressed) {
        stress(report, scene, &path, wall);
    }
    if let Some(slide) = &wall.slide {
        self::slide(report, &path, wall, slide);
    }
    if let Some(grip) = wall.grip {
        report.positive(format!("{path}.grip"), grip, "m");
        if staged.iter().chain([&wall.drive()]).any(pushed) {
            let allowed = "nothing for a wall that is driven by a force or a stress: drive it by a velocity, or fix it";
            report.wrong(format!("{path}.grip"), format!("{grip:?}"), allowed);
        }
    }
}

/// Checks the shape and the direction of a wall that is driven by a stress.
fn stress(report: &mut Report, scene: &Scene, path: &str, wall: &Wall) {
    let mut along_an_axis = |place: &str, vector: &[f64]| {
        if vector.iter().filter(|x| **x != 0.0).count() > 1 {
            let allowed = "a vector along one axis: the section of the sample is known only there";
            report.wrong(format!("{path}.shape.{place}"), format!("{vector:?}"), allowed);
        }
    };
    match &wall.shape {
        Shape::Plane(plane) => along_an_axis("plane.normal", &plane.normal),
        Shape::Plate(plate) => {
            along_an_axis("plate.normal", &plate.normal);
            plate.side.iter().for_each(|side| along_an_axis("plate.side", side));
            let around = scene.walls.iter().find(|(_, wall)| match &wall.shape {
                Shape::Cylinder(Cylinder { axis, inside, .. }) => *inside && cosine(axis, &plate.normal).abs() > 0.5,
                _ => false,
            });
            if let Some((name, _)) = around {
                let found = format!("a plate inside the cylinder walls.{name}");
                report.wrong(format!("{path}.stress"), found, "a plane, or a plate with a force");
            }
        }
        shape => report.wrong(format!("{path}.stress"), format!("a {}", shape.name()), "a plane or a plate"),
    }
    if let Some(direction) = &wall.direction {
        let allowed = "nothing: a stress acts along the normal of its wall";
        report.wrong(format!("{path}.direction"), format!("{direction:?}"), allowed);
    }
}

fn slide(report: &mut Report, path: &str, wall: &Wall, slide: &Slide) {
    let Slide { direction, velocity } = slide;
    let before = report.problems.len();
    let place = format!("{path}.slide.direction");
    report.direction(&place, direction);
    report.function(&format!("{path}.slide.velocity"), velocity);
    if !pushed(&wall.drive()) {
        let allowed = "a wall that is driven by force, force_rate or stress; another wall moves along its surface by \
                       velocity with a direction";
        report.wrong(format!("{path}.slide"), "a motion across no force", allowed);
        return;
    }
    let Some(drive) = wall.drive_direction().filter(|drive| drive.len() == direction.len()) else { return };
    if report.problems.len() == before && cosine(drive, direction).abs() > PERPENDICULAR {
        report.wrong(place, format!("{direction:?}"), format!("a vector perpendicular to the drive, {drive:?}"));
    }
}

/// Whether a wall is driven by a force or a stress.
fn pushed(drive: &Drive) -> bool {
    matches!(drive, Drive::Force(_) | Drive::Stress(_))
}

fn mass_and_direction(report: &mut Report, path: &str, wall: &Wall, staged: &[Drive]) {
    let own = wall.drive();
    let drives = || staged.iter().chain([&own]);
    let (by_force, by_stress) = (drives().any(pushed), drives().any(|drive| matches!(drive, Drive::Stress(_))));
    let mass = format!("{path}.mass");
    match &wall.mass {
        None if by_force => {
            report.wrong(mass, "nothing", "\"sample\" or {\"kg\": …}, needed by a wall that is driven by a force");
        }
        Some(_) if !by_force => {
            report.wrong(mass, "a mass", "nothing: only a wall that is driven by a force has a mass");
        }
        Some(WallMass::Kg(kg)) => report.positive(format!("{mass}.kg"), *kg, "kg"),
        _ => {}
    }
    let direction = format!("{path}.direction");
    let driven = drives().any(|drive| *drive != Drive::Fixed);
    match &wall.direction {
        Some(vector) if !driven => {
            report.wrong(direction, format!("{vector:?}"), "nothing: a fixed wall has no direction");
        }
        // named by the check of the stress
        Some(_) if by_stress => {}
        Some(vector) => report.direction(&direction, vector),
        None if driven && !by_stress && wall.drive_direction().is_none() => {
            report.wrong(direction, "nothing", "a vector: only a plane or a plate has a default direction, its normal");
        }
        None => {}
    }
}
