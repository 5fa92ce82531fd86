//! Finds all wrong values of a scene.
//!
//! Only the scene itself is checked here. Whether a wall overlaps the sample is checked once the
//! sample exists.

mod material;
mod membrane;
pub(crate) mod report;
mod sample;
mod stage;
mod stop;
mod wall;

use std::collections::HashMap;

use super::error::Problem;
use super::model::{Bonds, Load, Rupture, Scene, Stiffness};
use super::solver::SolverKind;
pub use report::{LARGEST, LEAST, MAX_GRAINS};
use report::{Number, Report};

/// Maximum number of steps, far below the largest integer that a double represents exactly.
const MAX_STEPS: f64 = 1e12;

/// All wrong values of a scene, in its order; empty if the scene is valid.
#[must_use]
pub fn validate(scene: &Scene) -> Vec<Problem> {
    let mut report = Report { dimension: usize::from(scene.dimension), problems: vec![] };
    if !matches!(scene.dimension, 2 | 3) {
        report.wrong("dimension", scene.dimension, "2 (disks) or 3 (spheres)");
        // lengths of vectors cannot be checked
        return report.problems;
    }
    match (scene.dimension, scene.thickness) {
        (3, Some(thickness)) => report.wrong("thickness", Number(thickness), "nothing: spheres have no thickness"),
        (_, Some(thickness)) => report.positive("thickness", thickness, "m"),
        (_, None) => {}
    }
    sample::sample(&mut report, scene);
    material::materials(&mut report, scene);
    if let Some(bonds) = &scene.bonds {
        self::bonds(&mut report, scene, bonds);
    }
    grains(&mut report, scene);
    for (name, wall) in &scene.walls {
        wall::wall(&mut report, scene, name, wall);
    }
    membrane::membrane(&mut report, scene);
    let drives: &stop::Drives = &|name, wall| scene.drives(name, wall);
    if let Some(name) = &scene.load_wall {
        stop::driven_wall(&mut report, scene, "load_wall", name, drives);
    }
    if let Some(gravity) = &scene.gravity {
        report.vector("gravity", gravity);
    }
    time_and_output(&mut report, scene);
    solver(&mut report, scene);
    rupture(&mut report, scene);
    if let Some(stop) = &scene.stop {
        stop::check(&mut report, scene, "stop", stop, drives);
    }
    stage::check(&mut report, scene);
    report.problems
}

fn bonds(report: &mut Report, scene: &Scene, bonds: &Bonds) {
    match (bonds.strength, bonds.stress) {
        (Some(strength), Some(stress)) => {
            let found = format!("strength {strength:?} N and stress {stress:?} Pa");
            report.wrong("bonds", found, "one of them; `--set bonds.stress=null` removes a value");
        }
        (None, None) => {
            report.wrong("bonds", "neither strength nor stress", "one of them: strength (N) or stress (Pa)")
        }
        _ => {}
    }
    report.bond_strength("bonds", bonds.strength, bonds.stress);
    report.non_negative("bonds.gap_tolerance", bonds.gap_tolerance, "a fraction of the mean diameter");
    let coefficients = [("friction", bonds.friction), ("shear", bonds.shear), ("rolling", bonds.rolling)];
    report.bond_coefficients("bonds", &coefficients);
    for (k, region) in bonds.absent.iter().enumerate() {
        material::region(report, &format!("bonds.absent.{k}"), region);
    }
    if let Some(list) = &bonds.list {
        if list.as_os_str().is_empty() {
            report.wrong("bonds.list", "an empty path", "the path of a CSV file");
        }
        if !bonds.absent.is_empty() {
            let allowed = "nothing: bonds.list names all bonds";
            report.wrong("bonds.absent", format!("{} regions", bonds.absent.len()), allowed);
        }
    }
    if let Some(scatter) = bonds.scatter {
        material::scatter(report, "bonds.scatter", scatter);
    }
    if let Some(twist) = bonds.twist {
        report.positive("bonds.twist", twist, "no unit; without it bonds do not resist twist");
        material::no_twist_of_disks(report, "bonds.twist", scene.dimension);
    }
    match &bonds.stiffness {
        Some(Stiffness::Springs(springs)) => {
            let path = |name: &str| format!("bonds.stiffness.springs.{name}");
            report.positive(path("normal"), springs.normal, "N/m");
            report.positive(path("tangential"), springs.tangential, "N/m");
            report.positive(path("rolling"), springs.rolling, "N m/rad");
            match (scene.twists(), springs.twist) {
                (true, Some(twist)) => report.positive(path("twist"), twist, "N m/rad"),
                (false, None) => {}
                (true, None) => report.wrong(path("twist"), "nothing", "a stiffness (N m/rad), as bonds resist twist"),
                (false, Some(_)) => report.wrong(
                    path("twist"),
                    "a value",
                    "no value, or a value of bonds.twist: these bonds do not resist twist",
                ),
            }
        }
        Some(Stiffness::Young(young)) => {
            report.positive("bonds.stiffness.young.modulus", young.modulus, "Pa");
            let (path, ratio) = ("bonds.stiffness.young.poisson_ratio", young.poisson_ratio);
            report.range(path, ratio, ratio > -1.0 && ratio <= 0.5, "a number above -1, at most 0.5".to_string());
        }
        None => {}
    }
}

fn grains(report: &mut Report, scene: &Scene) {
    let Some(grains) = &scene.grains else { return };
    // the number of grains of a file or a cut sample is known only once it is made
    let count = scene.sample.count();
    let exists = |report: &mut Report, path: String, grain: usize| {
        if let Some(count) = count.filter(|count| grain >= *count && *count > 0) {
            report.wrong(path, grain, format!("the number of a grain, from 0 to {}", count - 1));
        }
    };
    let mut first = HashMap::new();
    for (k, grain) in grains.fixed.iter().enumerate() {
        let path = format!("grains.fixed.{k}");
        if first.insert(*grain, k).is_some() {
            report.wrong(&path, format!("{grain} a second time"), "each grain once");
        }
        exists(report, path, *grain);
    }
    for (k, load) in grains.loads.iter().enumerate() {
        exists(report, format!("grains.loads.{k}.grain"), load.grain);
        self::load(report, &format!("grains.loads.{k}"), load);
    }
}

fn load(report: &mut Report, path: &str, load: &Load) {
    if load.force.is_none() && load.torque.is_none() {
        report.wrong(path, "neither force nor torque", "at least one of them");
    }
    if let Some(force) = &load.force {
        report.vector(&format!("{path}.force"), force);
    }
    if let Some(torque) = &load.torque {
        report.spin(&format!("{path}.torque"), torque);
    }
    report.function(&format!("{path}.time"), &load.time);
}

fn time_and_output(report: &mut Report, scene: &Scene) {
    let time = &scene.time;
    let before = report.problems.len();
    report.positive("time.step", time.step, "s");
    report.positive("time.end", time.end, "s");
    let steps = time.end / time.step;
    if report.problems.len() == before && time.step > time.end {
        report.wrong("time.step", format!("{:?}", time.step), format!("at most time.end ({:?} s)", time.end));
    }
    if report.problems.len() == before && steps > MAX_STEPS {
        let found = format!("{:?}, which makes {steps:.1e} steps", time.step);
        report.wrong("time.step", found, format!("at most {MAX_STEPS:.0e} steps to time.end"));
    }
    if scene.output.checkpoint_every == 0 {
        report.wrong("output.checkpoint_every", 0, "a whole number of frames, at least 1");
    }
    match (scene.output.every_steps, scene.output.interval) {
        (Some(0), None) => report.wrong("output.every_steps", 0, "a whole number of steps, at least 1"),
        (None, Some(interval)) => {
            let allowed = format!("a finite number, at least the time step ({:?} s)", time.step);
            report.range("output.interval", interval, interval > 0.0 && interval >= time.step, allowed);
        }
        (Some(_), Some(_)) => report.wrong("output", "every_steps and interval", "exactly one of them"),
        (None, None) => report.wrong("output", "neither every_steps nor interval", "exactly one of them"),
        (Some(_), None) => {}
    }
}

fn solver(report: &mut Report, scene: &Scene) {
    let solver = &scene.solver;
    report.positive("solver.tolerance", solver.tolerance, "no unit");
    if let Some(accept) = solver.accept {
        report.positive("solver.accept", accept, "no unit");
        if accept < solver.tolerance {
            report.wrong("solver.accept", Number(accept), format!("at least solver.tolerance, {:?}", solver.tolerance));
        }
    }
    if solver.max_step_halvings > 30 {
        report.wrong("solver.max_step_halvings", solver.max_step_halvings, "a whole number from 0 to 30");
    }
    let limit = match &solver.kind {
        SolverKind::GaussSeidel(gs) => ("solver.kind.gauss_seidel.max_sweeps".to_string(), gs.max_sweeps),
        SolverKind::Newton(newton) | SolverKind::Interior(newton) | SolverKind::Auto(newton) => {
            let kind = match solver.kind {
                SolverKind::Auto(_) => "auto",
                SolverKind::Interior(_) => "interior",
                _ => "newton",
            };
            let path = |name: &str| format!("solver.kind.{kind}.{name}");
            report.positive(path("load_tolerance"), newton.load_tolerance, "no unit");
            report.positive(path("tangential_stiffness"), newton.tangential_stiffness, "no unit");
            report.positive(path("rolling_stiffness"), newton.rolling_stiffness, "no unit");
            (path("max_iterations"), newton.max_iterations)
        }
    };
    if limit.1 == 0 {
        report.wrong(limit.0, 0, "a whole number, at least 1");
    }
}

/// Loading to the next event follows prescribed loads of rigid bonds.
fn rupture(report: &mut Report, scene: &Scene) {
    if scene.rupture != Rupture::NextEvent {
        return;
    }
    match &scene.bonds {
        None => report.wrong("rupture", "next_event in a scene without bonds", "bonds in the scene, or another rule"),
        Some(bonds) if bonds.stiffness.is_some() => {
            report.wrong("bonds.stiffness", "a stiffness, with rupture next_event", "no value, or rupture cascade");
        }
        Some(_) => {}
    }
    for (name, _) in scene.walls.iter().filter(|(_, wall)| wall.velocity.is_some()) {
        let found = "a velocity, with rupture next_event";
        report.wrong(format!("walls.{name}.velocity"), found, "force or force_rate in its place, or rupture cascade");
    }
    for (name, _) in scene.walls.iter().filter(|(_, wall)| wall.slide.is_some()) {
        let found = "a slide, with rupture next_event";
        report.wrong(format!("walls.{name}.slide"), found, "no slide, or rupture cascade: nothing moves");
    }
    if !scene.stages.is_empty() {
        report.wrong("stages", "stages, with rupture next_event", "one course of loads, or rupture cascade");
    }
    if matches!(scene.solver.kind, SolverKind::GaussSeidel(_)) {
        report.wrong("solver.kind", "gauss_seidel, with rupture next_event", "auto, newton or interior");
    }
}
