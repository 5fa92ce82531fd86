//! Wrong values in the sample.

use std::collections::HashMap;

use super::report::{MAX_GRAINS, Number, Report};
use crate::model::Scene;
use crate::sample::{Cut, Diameters, GrainSpec, Lattice, Preparation, RandomSample, Sample, Section};

/// Checks `sample`.
pub(super) fn sample(report: &mut Report, scene: &Scene) {
    match &scene.sample {
        Sample::Random(random) => random_sample(report, random),
        Sample::Lattice(lattice) => self::lattice(report, lattice),
        Sample::File(file) => {
            if file.path.as_os_str().is_empty() {
                report.wrong("sample.file.path", "an empty path", "the path of a CSV file");
            }
        }
        Sample::Grains(grains) => {
            if grains.is_empty() {
                report.wrong("sample.grains", "no grains", "at least one grain");
            }
            let mut centers = HashMap::new();
            for (k, grain) in grains.iter().enumerate() {
                self::grain(report, k, grain);
                // adding zero turns −0 into 0, so that both are one place
                let key: Vec<u64> = grain.center.iter().map(|x| (x + 0.0).to_bits()).collect();
                if let Some(first) = centers.insert(key, k) {
                    let found = format!("{:?}, which is also the centre of grain {first}", grain.center);
                    report.wrong(format!("sample.grains.{k}.center"), found, "a centre of its own for each grain");
                }
            }
        }
    }
}

fn random_sample(report: &mut Report, random: &RandomSample) {
    report.count("sample.random.count", random.count);
    diameters(report, &random.diameter);
    report.positive("sample.random.width", random.width, "m");
    match (report.dimension, random.section, random.depth) {
        (2, section, depth) => {
            report.absent("sample.random.depth", depth, "a box in 2D has a width only");
            if section == Section::Circle {
                report.wrong("sample.random.section", "circle", "rectangle: a box in 2D has a width only");
            }
        }
        (_, Section::Circle, depth) => report.absent("sample.random.depth", depth, "a circle has a width only"),
        (_, Section::Rectangle, Some(depth)) => report.positive("sample.random.depth", depth, "m"),
        (_, Section::Rectangle, None) => {
            report.wrong("sample.random.depth", "nothing", "a finite number > 0 (m), needed in 3D");
        }
    }
    let largest = random.diameter.max();
    for (path, size) in [("sample.random.width", Some(random.width)), ("sample.random.depth", random.depth)] {
        if let Some(size) = size.filter(|size| *size > 0.0 && *size < largest && largest.is_finite()) {
            report.wrong(path, Number(size), format!("at least the diameter of the largest grain, {largest:?} m"));
        }
    }
    let (path, fraction) = match &random.preparation {
        Preparation::Compaction(compaction) => ("compaction", compaction.solid_fraction),
        Preparation::Deposition(deposition) => ("deposition", deposition.solid_fraction),
    };
    let path = format!("sample.random.preparation.{path}.solid_fraction");
    report.range(path, fraction, fraction > 0.0 && fraction < 1.0, "a number above 0 and below 1");
    if let Some(Cut::Circle(diameter)) = random.cut {
        report.positive("sample.random.cut.circle", diameter, "m");
        if random.section == Section::Circle {
            report.wrong("sample.random.cut", "circle, together with section: circle", "a cut through a box, or none");
        }
    }
}

fn diameters(report: &mut Report, diameters: &Diameters) {
    let path = "sample.random.diameter";
    match diameters {
        Diameters::Constant(diameter) => report.positive(format!("{path}.constant"), *diameter, "m"),
        Diameters::Uniform(range) => {
            report.positive(format!("{path}.uniform.min"), range.min, "m");
            report.positive(format!("{path}.uniform.max"), range.max, "m");
            if range.min > range.max {
                let allowed = format!("at least the smallest diameter, {:?} m", range.min);
                report.wrong(format!("{path}.uniform.max"), Number(range.max), allowed);
            }
        }
        Diameters::Table(rows) => {
            for (k, row) in rows.iter().enumerate() {
                report.positive(format!("{path}.table.{k}.0"), row[0], "m");
                report.non_negative(format!("{path}.table.{k}.1"), row[1], "a weight");
            }
            if !rows.iter().any(|row| row[1] > 0.0) {
                report.wrong(format!("{path}.table"), "no weight above 0", "at least one pair [diameter, weight > 0]");
            }
        }
    }
}

fn lattice(report: &mut Report, lattice: &Lattice) {
    let name = match lattice {
        Lattice::Hexagonal { .. } => "hexagonal",
        Lattice::Square { .. } => "square",
        Lattice::Cubic { .. } => "cubic",
    };
    let path = format!("sample.lattice.{name}");
    match (lattice, report.dimension) {
        (Lattice::Cubic { .. }, 2) => {
            report.wrong(&path, "a cubic lattice in 2D", "hexagonal or square, or dimension 3")
        }
        (Lattice::Square { .. }, 3) => {
            report.wrong(&path, "a square lattice in 3D", "cubic or hexagonal, or dimension 2");
        }
        (Lattice::Hexagonal { layers: Some(layers), .. }, 2) => {
            report.wrong(format!("{path}.layers"), layers, "nothing: a lattice in 2D has rows and columns only");
        }
        (Lattice::Hexagonal { layers: None, .. }, 3) => {
            report.wrong(format!("{path}.layers"), "nothing", "the number of layers along z, needed in 3D");
        }
        (Lattice::Hexagonal { layers: Some(layers), .. }, _) => report.count(&format!("{path}.layers"), *layers),
        _ => {}
    }
    report.positive(format!("{path}.diameter"), lattice.diameter(), "m");
    match lattice {
        Lattice::Hexagonal { rows, columns, .. } | Lattice::Square { rows, columns, .. } => {
            report.count(&format!("{path}.rows"), *rows);
            report.count(&format!("{path}.columns"), *columns);
        }
        Lattice::Cubic { counts, .. } => {
            for (k, count) in counts.iter().enumerate() {
                report.count(&format!("{path}.counts.{k}"), *count);
            }
        }
    }
    if lattice.count().is_none_or(|count| count > MAX_GRAINS) {
        report.wrong(path, "more grains than can be counted", format!("at most {MAX_GRAINS} grains"));
    }
}

fn grain(report: &mut Report, index: usize, grain: &GrainSpec) {
    let path = format!("sample.grains.{index}");
    report.vector(&format!("{path}.center"), &grain.center);
    report.positive(format!("{path}.radius"), grain.radius, "m");
    if let Some(velocity) = &grain.velocity {
        report.vector(&format!("{path}.velocity"), velocity);
    }
    if let Some(spin) = &grain.spin {
        report.spin(&format!("{path}.spin"), spin);
    }
    for (name, value, unit) in
        [("density", grain.density, "kg/m³"), ("mass", grain.mass, "kg"), ("inertia", grain.inertia, "kg m²")]
    {
        if let Some(value) = value {
            report.positive(format!("{path}.{name}"), value, unit);
        }
    }
    if let (Some(density), Some(mass)) = (grain.density, grain.mass) {
        let found = format!("{density:?}, together with a mass of {mass:?} kg");
        report.wrong(format!("{path}.density"), found, "either density or mass");
    }
}
