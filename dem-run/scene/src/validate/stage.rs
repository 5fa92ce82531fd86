//! Wrong values in the stages of loading.

use super::report::Report;
use super::stop;
use crate::model::Scene;
use crate::stage::StageDrive;
use crate::stop::Stop;
use crate::wall::{Drive, Wall};

/// Reports wrong values of the stages.
pub(super) fn check(report: &mut Report, scene: &Scene) {
    for (k, stage) in scene.stages.iter().enumerate() {
        let path = format!("stages.{k}");
        if scene.stages[..k].iter().any(|other| other.name == stage.name) {
            report.wrong(format!("{path}.name"), format!("\"{}\" a second time", stage.name), "a name of its own");
        }
        match (stage.duration, &stage.until) {
            (None, None) => {
                let found = format!("stage \"{}\" without an end", stage.name);
                report.wrong(&path, found, "a duration (s), or a condition: until");
            }
            (None, Some(until)) if *until == Stop::default() => {
                report.wrong(format!("{path}.until"), "no condition", "a condition of stop, or a duration (s)");
            }
            _ => {}
        }
        if let Some(duration) = stage.duration {
            let least = scene.time.step;
            let allowed = format!("a finite number, at least the time step ({least:?} s)");
            report.range(format!("{path}.duration"), duration, duration >= least, allowed);
        }
        if let Some(until) = &stage.until {
            let drives = |name: &str, wall: &Wall| -> Vec<Drive> {
                let drive = scene.drive_in_stage(k, name, wall);
                if drive == Drive::Fixed { vec![] } else { vec![drive] }
            };
            stop::check(report, scene, &format!("{path}.until"), until, &drives);
        }
        if stage.cement {
            cement(report, scene, k, &format!("{path}.cement"));
        }
        for (name, drive) in &stage.walls {
            stage_drive(report, scene, &format!("{path}.walls.{name}"), name, drive);
        }
    }
}

/// Bonds form once, in a stage as at the start.
fn cement(report: &mut Report, scene: &Scene, stage: usize, path: &str) {
    let mut refuse = |found: &str, allowed: &str| report.wrong(path, found, allowed);
    if stage == 0 {
        refuse("the first stage cements", "nothing: bonds form at the start of the run");
    } else if let Some(first) = scene.cement_stage().filter(|first| *first < stage) {
        let allowed = format!("one stage that cements, now {first}: bonds form once");
        refuse("a second stage that cements", &allowed);
    }
    if !scene.has_bonds() {
        refuse("a stage that cements, in a scene without bonds", "bonds with a strength: add `bonds`");
    }
    if scene.bonds.as_ref().is_some_and(|bonds| bonds.list.is_some()) {
        refuse(
            "a stage that cements, with bonds.list",
            "bonds by gap_tolerance: the places of grains change until then",
        );
    }
}

fn stage_drive(report: &mut Report, scene: &Scene, path: &str, name: &str, drive: &StageDrive) {
    let Some(wall) = scene.walls.get(name) else {
        report.unknown(path, name, "a wall", scene.walls.keys().map(String::as_str).collect());
        return;
    };
    let functions = [("velocity", &drive.velocity), ("force", &drive.force), ("stress", &drive.stress)];
    let given: Vec<&str> = functions.iter().filter(|(_, f)| f.is_some()).map(|(name, _)| *name).collect();
    if given.len() > 1 {
        report.wrong(path, given.join(" and "), "one drive at most: velocity, force or stress");
    }
    for (name, function) in functions {
        if let Some(function) = function {
            report.function(&format!("{path}.{name}"), function);
        }
    }
    if wall.slide.is_some() {
        report.wrong(path, "a wall with a slide", "nothing: a wall that slides keeps its drive");
    }
}
