//! Wrong values in the materials, and in regions.

use super::report::{Number, Report};
use crate::material::{BASE, MaterialPair, PairBonds, Scatter};
use crate::model::Scene;
use crate::region::Region;
use crate::sample::Sample;

/// Maximum number of named materials: histories number all materials by one byte.
const MOST: usize = 254;

/// Checks `materials`, and the materials of listed grains.
pub(super) fn materials(report: &mut Report, scene: &Scene) {
    let materials = &scene.materials;
    report.positive("materials.density", materials.density, "kg/m³");
    report.non_negative("materials.friction.grain_grain", materials.friction.grain_grain, "no unit");
    report.non_negative("materials.friction.grain_wall", materials.friction.grain_wall, "no unit");
    report.fraction("materials.restitution.grain_grain", materials.restitution.grain_grain);
    report.fraction("materials.restitution.grain_wall", materials.restitution.grain_wall);
    report.non_negative("materials.restitution.threshold_speed", materials.restitution.threshold_speed, "m/s");
    named(report, scene);
    for (k, pair) in materials.pairs.iter().enumerate() {
        self::pair(report, scene, k, pair);
    }
    if let Sample::Grains(grains) = &scene.sample {
        for (k, grain) in grains.iter().enumerate() {
            if let Some(name) = &grain.material {
                known(report, scene, format!("sample.grains.{k}.material"), name);
            }
        }
    }
}

fn named(report: &mut Report, scene: &Scene) {
    let named = &scene.materials.named;
    if named.len() > MOST {
        report.wrong("materials.named", format!("{} materials", named.len()), format!("at most {MOST}"));
    }
    for (k, material) in named.iter().enumerate() {
        let path = format!("materials.named.{k}");
        let (name, place) = (&material.name, format!("{path}.name"));
        if report.name(&place, name) {
            let shown = format!("the name \"{name}\"");
            if name == BASE {
                report.wrong(place, shown, "another name: base is the material of materials.density");
            } else if named[..k].iter().any(|other| other.name == *name) {
                report.wrong(place, format!("{shown} a second time"), "a name of its own");
            }
        }
        if let Some(density) = material.density {
            report.positive(format!("{path}.density"), density, "kg/m³");
        }
        if let Some(friction) = material.wall_friction {
            report.non_negative(format!("{path}.wall_friction"), friction, "no unit");
        }
        for (r, region) in material.regions.iter().enumerate() {
            self::region(report, &format!("{path}.regions.{r}"), region);
        }
        if material.regions.is_empty() && matches!(scene.sample, Sample::Random(_) | Sample::Lattice(_)) {
            let allowed = "at least one region: in a packing or a lattice only regions say where a material is";
            report.wrong(format!("{path}.regions"), "no region", allowed);
        }
    }
}

/// Checks that `name` is the name of a material.
fn known(report: &mut Report, scene: &Scene, path: String, name: &str) {
    let names = scene.materials.names();
    if !names.contains(&name) {
        report.unknown(path, name, "a material", names);
    }
}

fn pair(report: &mut Report, scene: &Scene, k: usize, pair: &MaterialPair) {
    let path = format!("materials.pairs.{k}");
    for (side, name) in pair.between.iter().enumerate() {
        known(report, scene, format!("{path}.between.{side}"), name);
    }
    let sorted = |pair: &MaterialPair| {
        let mut names = pair.between.clone();
        names.sort();
        names
    };
    let [a, b] = &pair.between;
    if scene.materials.pairs[..k].iter().any(|other| sorted(other) == sorted(pair)) {
        report.wrong(format!("{path}.between"), format!("{a} and {b} a second time"), "each pair once");
    }
    if pair.friction.is_none() && pair.bonds.is_none() {
        report.wrong(&path, "neither friction nor bonds", "at least one of them");
    }
    if let Some(friction) = pair.friction {
        report.non_negative(format!("{path}.friction"), friction, "no unit");
    }
    if let Some(bonds) = &pair.bonds {
        pair_bonds(report, scene, &format!("{path}.bonds"), bonds);
    }
}

fn pair_bonds(report: &mut Report, scene: &Scene, path: &str, bonds: &PairBonds) {
    let Some(all) = &scene.bonds else {
        report.wrong(path, "bonds", "nothing, or a scene with bonds: it has none");
        return;
    };
    if let (Some(strength), Some(stress)) = (bonds.strength, bonds.stress) {
        report.wrong(path, format!("strength {strength:?} N and stress {stress:?} Pa"), "one of them");
    }
    report.bond_strength(path, bonds.strength, bonds.stress);
    report.bond_coefficients(path, &[("shear", bonds.shear), ("rolling", bonds.rolling)]);
    if let Some(twist) = bonds.twist {
        report.non_negative(format!("{path}.twist"), twist, "no unit; zero: these bonds do not resist twist");
        no_twist_of_disks(report, &format!("{path}.twist"), scene.dimension);
    }
    if let Some(scatter) = bonds.scatter {
        self::scatter(report, &format!("{path}.scatter"), scatter);
    }
    if let Some(factor) = bonds.stiffness_factor {
        let place = format!("{path}.stiffness_factor");
        match all.stiffness {
            Some(_) => report.positive(place, factor, "no unit"),
            None => report.wrong(place, Number(factor), "nothing: without bonds.stiffness bonds are rigid"),
        }
    }
}

/// Reports a coefficient of twist in 2D.
pub(super) fn no_twist_of_disks(report: &mut Report, path: &str, dimension: u8) {
    if dimension == 2 {
        report.wrong(path, "a value in a scene of dimension 2", "no value: disks do not twist");
    }
}

/// Checks the distribution of strengths at `path`.
pub(super) fn scatter(report: &mut Report, path: &str, scatter: Scatter) {
    match scatter {
        Scatter::Weibull { modulus } => {
            // below, strengths differ by more than 1e15
            let allowed = "a finite number, at least 0.1";
            report.range(format!("{path}.weibull.modulus"), modulus, modulus >= 0.1, allowed);
        }
        Scatter::Normal { deviation } => {
            let allowed = "a number from 0 to 0.5: above, many drawn strengths would be negative";
            report.range(
                format!("{path}.normal.deviation"),
                deviation,
                (0.0..=0.5).contains(&deviation),
                allowed.to_string(),
            );
        }
    }
}

/// Checks a region.
pub(super) fn region(report: &mut Report, path: &str, region: &Region) {
    let path = format!("{path}.{}", region.name());
    match region {
        Region::HalfSpace(half) => {
            report.vector(&format!("{path}.point"), &half.point);
            report.direction(&format!("{path}.normal"), &half.normal);
        }
        Region::Box(cuboid) => {
            report.vector(&format!("{path}.from"), &cuboid.from);
            report.vector(&format!("{path}.to"), &cuboid.to);
            for (axis, (from, to)) in cuboid.from.iter().zip(&cuboid.to).enumerate() {
                if from > to {
                    report.wrong(
                        format!("{path}.to.{axis}"),
                        Number(*to),
                        format!("at least that of `from`, {from:?} m"),
                    );
                }
            }
        }
        Region::Ball(ball) => {
            report.vector(&format!("{path}.center"), &ball.center);
            report.positive(format!("{path}.radius"), ball.radius, "m");
        }
    }
}
