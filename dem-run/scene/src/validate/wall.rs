//! Wrong values in a wall.

use super::report::Report;
use crate::wall::{Drive, Wall, WallMass};

/// Checks the wall `name`.
pub(super) fn wall(report: &mut Report, name: &str, wall: &Wall) {
    let path = format!("walls.{name}");
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        report.wrong(&path, format!("the name \"{name}\""), "a name of letters, digits, _ and -");
    }
    wall.shape.check(report, &format!("{path}.shape"));
    if let Some(friction) = wall.friction {
        report.non_negative(format!("{path}.friction"), friction, "no unit");
    }
    let drives = [
        ("velocity", wall.velocity.is_some()),
        ("force", wall.force.is_some()),
        ("force_rate", wall.force_rate.is_some()),
    ];
    let given: Vec<&str> = drives.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
    if given.len() > 1 {
        report.wrong(&path, given.join(" and "), "one drive at most: velocity, force or force_rate");
    }
    for (name, function) in [("velocity", &wall.velocity), ("force", &wall.force)] {
        if let Some(function) = function {
            report.function(&format!("{path}.{name}"), function);
        }
    }
    if let Some(rate) = wall.force_rate {
        report.finite(format!("{path}.force_rate"), rate);
    }
    mass_and_direction(report, &path, wall);
}

fn mass_and_direction(report: &mut Report, path: &str, wall: &Wall) {
    let drive = wall.drive();
    let mass = format!("{path}.mass");
    match (&wall.mass, &drive) {
        (None, Drive::Force(_)) => {
            report.wrong(mass, "nothing", "\"sample\" or {\"kg\": …}, needed by a wall that is driven by a force");
        }
        (Some(_), Drive::Fixed | Drive::Velocity(_)) => {
            report.wrong(mass, "a mass", "nothing: only a wall that is driven by a force has a mass");
        }
        (Some(WallMass::Kg(kg)), Drive::Force(_)) => report.positive(format!("{mass}.kg"), *kg, "kg"),
        _ => {}
    }
    let direction = format!("{path}.direction");
    match (&wall.direction, &drive) {
        (Some(vector), Drive::Fixed) => {
            report.wrong(direction, format!("{vector:?}"), "nothing: a fixed wall has no direction");
        }
        (Some(vector), _) => report.direction(&direction, vector),
        (None, Drive::Velocity(_) | Drive::Force(_)) if wall.drive_direction().is_none() => {
            report.wrong(direction, "nothing", "a vector: only a plane has a default direction, its normal");
        }
        _ => {}
    }
}
