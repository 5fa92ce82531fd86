//! Wrong values in a membrane.

use super::report::{Number, Report};
use crate::function::Function;
use crate::model::Scene;
use crate::wall::Shape;

/// Largest distance of the sum of two unit normals from zero at which planes face each other:
/// decimal normals are not exact.
const FACING: f64 = 1e-6;

/// Checks the membrane and its pressures in stages.
pub(super) fn membrane(report: &mut Report, scene: &Scene) {
    for (k, stage) in scene.stages.iter().enumerate() {
        let Some(function) = &stage.membrane_pressure else { continue };
        let path = format!("stages.{k}.membrane_pressure");
        pressure(report, &path, function);
        if scene.membrane.is_none() {
            report.wrong(path, "a pressure in a scene without a membrane", "nothing, or a membrane: add `membrane`");
        }
    }
    let Some(membrane) = &scene.membrane else { return };
    if scene.dimension != 2 {
        let allowed = "nothing: a membrane is around disks; give the side walls of spheres a stress";
        report.wrong("membrane", "a membrane in a scene of dimension 3", allowed);
    }
    pressure(report, "membrane.pressure", &membrane.pressure);
    if let Some(radius) = membrane.disk_radius {
        report.positive("membrane.disk_radius", radius, "m");
    }
    if let Some(between) = &membrane.between {
        plates(report, scene, between);
    }
}

fn pressure(report: &mut Report, path: &str, pressure: &Function) {
    report.function(path, pressure);
    let allowed = "a number ≥ 0 (Pa): a membrane presses on the sample";
    let mut check = |place: String, value: f64| {
        if value < 0.0 {
            report.wrong(place, Number(value), allowed);
        }
    };
    match pressure {
        Function::Constant(value) => check(format!("{path}.constant"), *value),
        Function::Ramp(ramp) => check(format!("{path}.ramp.rate"), ramp.rate),
        Function::Table(rows) => {
            rows.iter().enumerate().for_each(|(k, row)| check(format!("{path}.table.{k}.1"), row[1]));
        }
    }
}

/// Checks the plates between which the surface is free.
fn plates(report: &mut Report, scene: &Scene, between: &[String; 2]) {
    let mut normals = vec![];
    for (side, name) in between.iter().enumerate() {
        let path = format!("membrane.between.{side}");
        match scene.walls.get(name).map(|wall| &wall.shape) {
            None => report.unknown(path, name, "a wall", scene.walls.keys().map(String::as_str).collect()),
            Some(Shape::Plane(plane)) => normals.push(&plane.normal),
            Some(shape) => {
                let found = format!("\"{name}\", a {}", shape.name());
                report.wrong(path, found, "a plane: the membrane ends at flat plates");
            }
        }
    }
    let [first, second] = normals[..] else { return };
    let norm = |v: &[f64]| v.iter().fold(0.0_f64, |length, x| length.hypot(*x));
    let sum: Vec<f64> = first.iter().zip(second).map(|(a, b)| a / norm(first) + b / norm(second)).collect();
    // a wrong normal is reported at its wall
    if norm(&sum) > FACING {
        let [a, b] = between;
        let found = format!("{a} and {b}, whose normals are {first:?} and {second:?}");
        report.wrong("membrane.between", found, "two planes that face each other, with opposite normals");
    }
}
