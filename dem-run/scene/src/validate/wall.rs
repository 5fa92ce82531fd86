//! Wrong values in a wall.

use super::report::Report;
use crate::wall::{Drive, Shape, Slide, Wall, WallMass};

/// Largest cosine of the angle between a slide and a drive that counts as a right angle: decimal
/// directions are not exact.
const PERPENDICULAR: f64 = 1e-6;

/// Checks the wall `name`; `staged` are the drives that stages give it.
pub(super) fn wall(report: &mut Report, name: &str, wall: &Wall, staged: &[Drive]) {
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
        stress(report, &path, wall);
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
fn stress(report: &mut Report, path: &str, wall: &Wall) {
    match &wall.shape {
        Shape::Plane(plane) if plane.normal.iter().filter(|x| **x != 0.0).count() > 1 => {
            let allowed = "a vector along one axis: the section of the sample is known only there";
            report.wrong(format!("{path}.shape.plane.normal"), format!("{:?}", plane.normal), allowed);
        }
        Shape::Plane(_) => {}
        shape => report.wrong(format!("{path}.stress"), format!("a {}", shape.name()), "a plane"),
    }
    if let Some(direction) = &wall.direction {
        let allowed = "nothing: a stress acts along the normal of its plane";
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
    let norm = |v: &[f64]| v.iter().fold(0.0_f64, |length, x| length.hypot(*x));
    let along: f64 = drive.iter().zip(direction).map(|(a, b)| (a / norm(drive)) * (b / norm(direction))).sum();
    if report.problems.len() == before && along.abs() > PERPENDICULAR {
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
            report.wrong(direction, "nothing", "a vector: only a plane has a default direction, its normal");
        }
        None => {}
    }
}
