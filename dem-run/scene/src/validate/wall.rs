//! Wrong values in a wall.

use super::report::Report;
use crate::wall::{Drive, Place, Shape, Wall, WallMass};

/// Checks the wall `name`.
pub(super) fn wall(report: &mut Report, name: &str, wall: &Wall) {
    let path = format!("walls.{name}");
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        report.wrong(&path, format!("the name \"{name}\""), "a name of letters, digits, _ and -");
    }
    shape(report, &format!("{path}.shape"), &wall.shape);
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
            report.wrong(direction, "nothing", "a vector: only a plane has a direction of its own, its normal");
        }
        _ => {}
    }
}

fn shape(report: &mut Report, path: &str, shape: &Shape) {
    let (name, dimension) = match shape {
        Shape::Plane(plane) => {
            report.direction(&format!("{path}.plane.normal"), &plane.normal);
            if let Place::At(point) = &plane.place {
                report.vector(&format!("{path}.plane.place.at"), point);
            }
            return;
        }
        Shape::Circle(_) => ("circle", 2),
        Shape::Sphere(_) => ("sphere", 3),
        Shape::Cylinder(_) => ("cylinder", 3),
    };
    let path = format!("{path}.{name}");
    if dimension != report.dimension {
        let allowed = if dimension == 2 { "plane, sphere or cylinder" } else { "plane or circle" };
        report.wrong(&path, format!("a {name} in {} dimensions", report.dimension), allowed);
        return;
    }
    let (center, radius) = match shape {
        Shape::Circle(circle) => (&circle.center, circle.radius),
        Shape::Sphere(sphere) => (&sphere.center, sphere.radius),
        Shape::Cylinder(cylinder) => {
            report.direction(&format!("{path}.axis"), &cylinder.axis);
            (&cylinder.center, cylinder.radius)
        }
        Shape::Plane(_) => return,
    };
    report.vector(&format!("{path}.center"), center);
    report.positive(format!("{path}.radius"), radius, "m");
    let inside = matches!(shape, Shape::Circle(c) if c.inside) || matches!(shape, Shape::Sphere(s) if s.inside);
    match shape.seat() {
        Some(_) if inside => report.wrong(format!("{path}.seated"), "a direction", "nothing: the grains are inside"),
        Some((direction, _)) => report.direction(&format!("{path}.seated"), direction),
        None => {}
    }
}
