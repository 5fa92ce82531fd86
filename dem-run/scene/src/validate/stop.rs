//! Wrong values in the conditions that end a run or a stage.

use super::report::{Number, Report};
use crate::function::Function;
use crate::model::Scene;
use crate::stop::{Stop, TravelFrom};
use crate::wall::{Drive, Wall};

/// The drives that a wall of this name has while a condition is looked at.
pub(super) type Drives<'a> = dyn Fn(&str, &Wall) -> Vec<Drive> + 'a;

/// Checks that `name`, found at `path`, is the name of a wall with one of these drives.
pub(super) fn driven_wall(report: &mut Report, scene: &Scene, path: &str, name: &str, drives: &Drives) {
    match scene.walls.get(name) {
        None => report.unknown(path, name, "a wall", scene.walls.keys().map(String::as_str).collect()),
        Some(wall) if drives(name, wall).is_empty() => {
            report.wrong(path, format!("\"{name}\", which is fixed"), "a wall that is driven");
        }
        Some(_) => {}
    }
}

/// Checks the stop conditions at `path`, of the run or of a stage.
pub(super) fn check(report: &mut Report, scene: &Scene, path: &str, stop: &Stop, drives: &Drives) {
    let bonds_needed = "bonds in the scene: it has none";
    if let Some(travel) = &stop.wall_travel {
        let wall = format!("{path}.wall_travel.wall");
        driven_wall(report, scene, &wall, &travel.wall, drives);
        let held = [Drive::Velocity(Function::Constant(0.0))];
        if scene.walls.get(&travel.wall).is_some_and(|wall| drives(&travel.wall, wall) == held) {
            report.wrong(wall, format!("\"{}\", which is held", travel.wall), "a wall that moves");
        }
        report.positive(format!("{path}.wall_travel.fraction_of_height"), travel.fraction_of_height, "no unit");
        if travel.after == TravelFrom::FirstBreak && scene.bonds.is_none() {
            report.wrong(format!("{path}.wall_travel.after"), "first_break", bonds_needed);
        }
    }
    if let Some(fraction) = stop.broken_fraction {
        let allowed = "a number above 0, at most 1";
        report.range(format!("{path}.broken_fraction"), fraction, fraction > 0.0 && fraction <= 1.0, allowed);
        if scene.bonds.is_none() {
            report.wrong(format!("{path}.broken_fraction"), Number(fraction), bonds_needed);
        }
    }
    if let Some(share) = stop.load_drop {
        load_drop(report, scene, &format!("{path}.load_drop"), share, drives);
    }
}

fn load_drop(report: &mut Report, scene: &Scene, path: &str, share: f64, drives: &Drives) {
    report.range(path, share, share > 0.0 && share < 1.0, "a number above 0 and below 1");
    if scene.bonds.is_none() {
        report.wrong(
            path,
            Number(share),
            "bonds in the scene: it has none, and the peak is sought after a first break",
        );
    }
    let Some(name) = scene.load_wall() else {
        let allowed = match scene.load_unknown() {
            Some(names) => format!("a load_wall in the scene: one of {names}"),
            None => "a wall with a velocity in the scene, whose load it is".to_string(),
        };
        report.wrong(path, Number(share), allowed);
        return;
    };
    if !drives(name, &scene.walls[name]).iter().any(|drive| matches!(drive, Drive::Velocity(_))) {
        let found = format!("{share:?}, and the load of walls.{name} is prescribed");
        report.wrong(path, found, "a load wall that is driven by a velocity: a prescribed load does not drop");
    }
}
