//! Criteria for the failure of a sample, and the splitting strength of a disk (Brazilian test).

use std::f64::consts::PI;
use std::fmt;

use dem_output::number;
use petgraph::unionfind::UnionFind;
use serde::Serialize;

use crate::model::Scene;
use crate::sample::{Cut, Sample, Section};
use crate::wall::Shape;

/// Axial strains (–) at which the collapse load is reported.
pub const STRAINS: [f64; 2] = [1e-4, 1e-3];
/// Share of broken bonds (–) at which the load is reported.
pub const BROKEN_SHARE: f64 = 0.05;

/// By which share of its greatest value a load must fall, for that to be a strength (–).
pub const PEAK_DROP: f64 = 0.05;

/// Whether bonds join all of `grains` grains to one piece. If so, and the bonds are rigid, no grain
/// moves relative to another until a bond breaks.
#[must_use]
pub fn in_one_piece(grains: usize, bonds: impl Iterator<Item = [u32; 2]>) -> bool {
    let mut pieces = UnionFind::<u32>::new(grains);
    bonds.filter(|[i, j]| pieces.union(*i, *j)).count() + 1 == grains
}

/// Least extent of a disk over its diameter. Its boundary consists of grains, so that a coarse one
/// is smaller than its circle.
const ROUND: f64 = 0.8;

/// A disk, or a cylinder, split between two plates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Diameter D (m).
    pub diameter: f64,
    /// Length t along its axis (m).
    pub length: f64,
}

impl Disk {
    /// The disk of a scene in which the wall `wall` loads it across its axis against another plane
    /// wall, in 2D also between plates; none for another test. The diameter is from the scene. The
    /// length is the thickness in 2D; in 3D it is the initial extent of the sample along the axis
    /// (`extents`, m). None also for a packing too small for its cut, which leaves flats.
    #[must_use]
    pub fn of(scene: &Scene, wall: &str, extents: &[f64]) -> Option<Self> {
        let Sample::Random(random) = &scene.sample else { return None };
        let (diameter, axis) = match (random.cut, random.section, scene.dimension) {
            (Some(Cut::Circle(diameter)), _, 2) => (diameter, None),
            (Some(Cut::Circle(diameter)), _, _) => (diameter, Some(1)),
            (None, Section::Circle, 3) => (random.width, Some(2)),
            _ => return None,
        };
        let load = scene.walls.get(wall).filter(|found| !scene.drives(wall, found).is_empty())?;
        let normal = |shape| normal(shape, scene.dimension);
        let (normal, across) = (normal(&load.shape)?, only_axis(load.drive_direction()?)?);
        let faces = |shape: &Shape| {
            self::normal(shape, scene.dimension)
                .is_some_and(|n| only_axis(n) == Some(across) && n[across] * normal[across] < 0.0)
        };
        if only_axis(normal) != Some(across) || axis == Some(across) || !scene.walls.values().any(|w| faces(&w.shape)) {
            return None;
        }
        let mut sides = extents.iter().take(scene.dimension.into()).enumerate().filter(|(k, _)| Some(*k) != axis);
        if sides.any(|(_, extent)| *extent < ROUND * diameter) {
            return None;
        }
        let length = axis.map_or(Some(scene.thickness()), |axis| extents.get(axis).copied())?;
        Some(Self { diameter, length })
    }

    /// Tensile stress 2P/(πDt) across the loaded diameter of an elastic disk (Pa) under the load P
    /// (N).
    #[must_use]
    pub fn stress(&self, load: f64) -> f64 {
        2.0 * load / (PI * self.diameter * self.length)
    }
}

fn normal(shape: &Shape, dimension: u8) -> Option<&[f64]> {
    match shape {
        Shape::Plane(plane) => Some(&plane.normal),
        // in 3D a plate may be shorter than the cylinder
        Shape::Plate(plate) if dimension == 2 => Some(&plate.normal),
        _ => None,
    }
}

/// The axis parallel to a vector, if any.
fn only_axis(vector: &[f64]) -> Option<usize> {
    let axis = vector.iter().position(|x| *x != 0.0)?;
    vector[axis + 1..].iter().all(|x| *x == 0.0).then_some(axis)
}

/// Tensile stress 2P/(πDt) across the loaded diameter of a disk (Pa).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Splitting {
    /// Diameter D (m).
    pub diameter: f64,
    /// Length t (m).
    pub length: f64,
    /// Stress at the collapse load of the strain 1e-4 (Pa); none if no bond had broken by then.
    pub collapse: Option<f64>,
    /// Stress at the greatest load (Pa), if the load fell by [`PEAK_DROP`] afterwards.
    pub peak: Option<f64>,
}

impl Splitting {
    /// The splitting strength of a disk, from its collapse load and the greatest load before a fall
    /// (N).
    #[must_use]
    pub fn of(disk: Disk, collapse: Option<f64>, peak: Option<f64>) -> Self {
        let stress = |load: f64| disk.stress(load);
        let Disk { diameter, length } = disk;
        Self { diameter, length, collapse: collapse.map(stress), peak: peak.map(stress) }
    }
}

impl fmt::Display for Splitting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |stress: Option<f64>, what: &str| Some(format!("{} Pa {what}", number(stress?)));
        let told = [at(self.collapse, "at collapse (strain 1e-4)"), at(self.peak, "at the peak load")];
        let told: Vec<String> = told.into_iter().flatten().collect();
        let told = if told.is_empty() { "none".into() } else { told.join(", ") };
        write!(f, "{told}: 2P/(πDt), D = {} m, t = {} m", number(self.diameter), number(self.length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_has_no_loose_grain() {
        assert!(in_one_piece(3, [[0, 1], [1, 2], [0, 2]].into_iter()));
        assert!(!in_one_piece(4, [[0, 1], [1, 2], [0, 2]].into_iter()));
        assert!(!in_one_piece(4, [[0, 1], [2, 3]].into_iter()));
        assert!(in_one_piece(1, [].into_iter()));
    }

    fn disk(config: &str, set: &[&str]) -> Option<Disk> {
        let path = format!("{}/../../configs/{config}", env!("CARGO_MANIFEST_DIR"));
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        let scene = crate::load(path.as_ref(), &set).expect("scene");
        let extents = if scene.dimension == 2 { &[0.04, 0.039][..] } else { &[0.04, 0.015, 0.039] };
        Disk::of(&scene, "top", extents)
    }

    #[test]
    fn only_a_disk_that_is_loaded_across_its_axis_splits() {
        assert_eq!(disk("brazilian-2d.json", &[]), Some(Disk { diameter: 0.041, length: 1.0 }));
        assert_eq!(disk("brazilian-3d.json", &[]), Some(Disk { diameter: 0.041, length: 0.015 }));
        // loaded along the axis, or not cut
        let along = r#"walls.top.shape.plane.normal=[0, -1, 0]"#;
        assert_eq!(disk("brazilian-3d.json", &[along, "walls.bottom.shape.plane.normal=[0, 1, 0]"]), None);
        assert_eq!(disk("brazilian-2d.json", &["sample.random.cut=null"]), None);
        // a circle that cuts off next to nothing
        assert_eq!(disk("brazilian-2d.json", &[r#"sample.random.cut={"circle": 0.06}"#]), None);
        assert_eq!(disk("brazilian-2d.json", &["walls.bottom.shape.plane.normal=[1, 0]"]), None);
        assert_eq!(disk("cylinder-compression.json", &[]), None);
        assert_eq!(disk("compression.json", &[]), None);
        // 2P/(πDt)
        let stress = Disk { diameter: 0.5, length: 2.0 }.stress(PI);
        assert!((stress - 2.0).abs() < 1e-15, "{stress} Pa");
    }
}
