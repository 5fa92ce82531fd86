//! One scene with and without each feature: hexagonal rows of disks, or close-packed layers of
//! spheres, that rest on a floor.

use super::{down, floor, grain, settings, world};
use dem_core::body::Grain;
use dem_core::bond::Stiffness;
use dem_core::contact::LocalSolve;
use dem_core::dim::{D2, Dim};
use dem_core::solver::{GaussSeidelSettings, SolverSettings};
use dem_core::world::{Restitution, World};

/// What the scene has beyond grains, weight and a floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Nothing: contacts without friction.
    None,
    /// Friction.
    Friction,
    /// Friction and restitution.
    Restitution,
    /// Rigid bonds.
    Bonds,
    /// Elastic bonds.
    ElasticBonds,
}

pub const FEATURES: [(&str, Feature); 5] = [
    ("frictionless", Feature::None),
    ("dry", Feature::Friction),
    ("restitution", Feature::Restitution),
    ("bonded", Feature::Bonds),
    ("elastic", Feature::ElasticBonds),
];

const RADIUS: f64 = 2e-3;

/// `rows` rows of `columns` disks, every other one a disk shorter, with its disks between those
/// below. A step makes `sweeps` sweeps, whatever residual they reach.
pub fn rows_of_disks(rows: usize, columns: usize, feature: Feature, sweeps: u64) -> World<D2> {
    let r = RADIUS;
    let mut disks = Vec::new();
    for row in 0..rows {
        let shift = if row % 2 == 0 { 0.0 } else { r };
        for column in 0..columns - row % 2 {
            disks.push(grain(&[2.0 * r * column as f64 + shift, r + 3f64.sqrt() * r * row as f64], r));
        }
    }
    resting(disks, feature, sweeps)
}

/// The same of spheres, in a dimension of three: `layers` layers of `columns` × `columns`.
pub fn layers_of_spheres<D: Dim>(layers: usize, columns: usize, feature: Feature, sweeps: u64) -> World<D> {
    let r = RADIUS;
    let mut spheres = Vec::new();
    for layer in 0..layers {
        let (shift, count) = if layer % 2 == 0 { (0.0, columns) } else { (r, columns - 1) };
        let height = r + 2f64.sqrt() * r * layer as f64;
        for k in 0..count * count {
            let [x, y] = [k % count, k / count].map(|c| 2.0 * r * c as f64 + shift);
            spheres.push(grain(&[x, y, height], r));
        }
    }
    resting(spheres, feature, sweeps)
}

fn resting<D: Dim>(grains: Vec<Grain<D>>, feature: Feature, sweeps: u64) -> World<D> {
    let mut set = settings(1e-4);
    set.gravity = down::<D>(9.81);
    set.friction = if feature == Feature::None { 0.0 } else { 0.3 };
    set.restitution = (feature == Feature::Restitution).then_some(Restitution {
        grain_grain: 0.5,
        grain_wall: 0.5,
        threshold_speed: 0.01,
    });
    set.solver = SolverSettings::GaussSeidel(GaussSeidelSettings {
        local: LocalSolve::Exact,
        tolerance: 0.0,
        accept: f64::INFINITY,
        max_sweeps: sweeps,
        acceleration: 0,
    });
    let mut w = world(grains, vec![floor(set.friction)], set);
    if matches!(feature, Feature::Bonds | Feature::ElasticBonds) {
        w.form_bonds(1e-6, |_| 100.0, 0.3);
        w.limit_twist(0.1);
    }
    if feature == Feature::ElasticBonds {
        w.make_bonds_elastic(|d| Stiffness {
            normal: 1e8,
            tangential: 1e8,
            rolling: 1e8 * d * d / 12.0,
            twist: 1e8 * d * d / 16.0,
        });
    }
    w
}
