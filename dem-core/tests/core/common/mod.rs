//! Small worlds that the tests of this folder share.
#![allow(dead_code)]

pub mod family;

use dem_core::body::{Drive, Grain, Grains, Load, Shape, Wall};
use dem_core::bond::Rupture;
use dem_core::contact::{BondFlow, LocalSolve};
use dem_core::dim::{D2, Dim, Vect};
use dem_core::solver::{GaussSeidelSettings, SolverSettings, StagedSettings, Stages, Start, StiffnessRatio};
use dem_core::world::{Settings, World};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

pub const DENSITY: f64 = 2500.0;

pub fn solver(tolerance: f64) -> SolverSettings {
    SolverSettings::GaussSeidel(GaussSeidelSettings {
        local: LocalSolve::Exact,
        tolerance,
        accept: tolerance,
        max_sweeps: 1_000_000,
        acceleration: 0,
    })
}

/// Newton from the stiff limit, with the default settings of a scene except for the tolerances.
pub fn newton(tolerance: f64, accept: f64, load_tolerance: f64) -> StagedSettings {
    StagedSettings {
        stages: Stages::Newton,
        tolerance,
        accept,
        load_tolerance,
        start: Start::StiffLimit,
        stiffness: StiffnessRatio { tangential: 1.0, rolling: 1.0 / 12.0 },
        max_iterations: 300,
    }
}

pub fn settings<D: Dim>(step: f64) -> Settings<D> {
    Settings {
        step,
        gravity: None,
        friction: 0.3,
        restitution: None,
        bond_flow: BondFlow::Associated,
        rupture: Rupture::Cascade,
        solver: solver(1e-12),
        max_halvings: 0,
        thickness: 1.0,
        expel_overlaps: false,
        ..Settings::default()
    }
}

pub fn grain<D: Dim>(position: &[f64], radius: f64) -> Grain<D> {
    Grain::at_rest(D::Vector::from_slice(position), radius, DENSITY)
}

pub fn world<D: Dim>(grains: Vec<Grain<D>>, walls: Vec<Wall<D>>, settings: Settings<D>) -> World<D> {
    World::new(grains.into_iter().collect(), walls, Vec::new(), settings)
}

/// The place of cell `k` of a grid with `side` cells along each axis; `at` is the coordinate of a
/// cell from its number along an axis.
pub fn cell<D: Dim>(k: usize, side: usize, at: impl FnMut(usize) -> f64) -> Vec<f64> {
    (0..D::N).map(|axis| k / side.pow(axis as u32) % side).map(at).collect()
}

/// A floor through the origin, normal to the last axis.
pub fn floor<D: Dim>(friction: f64) -> Wall<D> {
    let mut normal = D::Vector::zero();
    normal[D::N - 1] = 1.0;
    Wall::fixed(Shape::Plane { normal }, D::Vector::zero(), friction)
}

/// Gravity (m/s²) along the last axis.
pub fn down<D: Dim>(g: f64) -> Option<D::Vector> {
    let mut v = D::Vector::zero();
    v[D::N - 1] = -g;
    Some(v)
}

pub fn run<D: Dim>(world: &mut World<D>, steps: usize) {
    for _ in 0..steps {
        world.step().expect("an accepted step");
    }
}

/// Two bonded disks of radius 1 mm along x, the first held fixed, the second under a growing force
/// and torque: `force` (N) and `torque` (N m) are rates per second. The bond has strength `r_coh`.
pub fn bonded_pair(r_coh: f64, force: [f64; 2], torque: f64) -> World<D2> {
    let mut fixed = grain::<D2>(&[0.0, 0.0], 1e-3);
    fixed.fixed = true;
    let list: Grains<D2> = [fixed, grain(&[2e-3, 0.0], 1e-3)].into_iter().collect();
    let load = Load { grain: 1, force: force.into(), torque: [torque].into(), factor: Arc::new(|t| t) };
    let mut world = World::new(list, Vec::new(), vec![load], settings(1e-4));
    world.form_bonds(1e-6, |_| r_coh, 0.3);
    world
}

pub fn force_driven<D: Dim>(normal: D::Vector, position: D::Vector, mass: f64, force: f64) -> Wall<D> {
    let mut wall = Wall::fixed(Shape::Plane { normal }, position, 0.2);
    wall.drive = Drive::Force { direction: normal, mass, force: Arc::new(move |_| force) };
    wall
}

/// A box of grains with random radii and velocities, pressed from above: with bonds, or dry.
pub fn pressed<D: Dim>(seed: u64, side: usize, friction: f64, bonds: Option<BondFlow>) -> World<D> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut grains = Vec::new();
    for k in 0..side.pow(D::N as u32) {
        let x = cell::<D>(k, side, |c| 0.01 + 0.02 * c as f64);
        let mut g = grain::<D>(&x, 0.01 * (0.98 + 0.02 * rng.random::<f64>()));
        g.velocity[0] = 0.05 * (rng.random::<f64>() - 0.5);
        grains.push(g);
    }
    let mut set = settings(1e-3);
    set.gravity = down::<D>(9.81);
    set.friction = friction;
    set.bond_flow = bonds.unwrap_or_default();
    let mut down = D::Vector::zero();
    down[D::N - 1] = -1.0;
    let mut lid = force_driven::<D>(down, down * (-0.02 * side as f64), 2.0, 300.0);
    lid.friction = friction;
    let mut w = world(grains, vec![floor(friction), lid], set);
    if bonds.is_some() {
        w.form_bonds(0.03, |_| 20.0, 0.3);
        w.limit_twist(0.02);
    }
    w
}
