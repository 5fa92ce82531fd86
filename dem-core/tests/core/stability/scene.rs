//! One scene with every parameter that can be pushed to its limits.

use crate::common;
use dem_core::body::{Grain, Shape, Wall};
use dem_core::contact::LocalSolve;
use dem_core::dim::{Dim, Vect};
use dem_core::solver::{GaussSeidelSettings, SolverSettings, StagedSettings, Stages};
use dem_core::world::{Restitution, Settings, World};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Gravity on Earth (m/s²).
pub const G: f64 = 9.81;

/// The solver, as a user selects it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    GaussSeidel,
    Newton,
    Auto,
    Interior,
}

/// Sweeps of Gauss–Seidel after which a solve is refused.
pub const SWEEPS: u64 = 100_000;

impl Kind {
    pub const ALL: [Self; 4] = [Self::GaussSeidel, Self::Newton, Self::Auto, Self::Interior];

    pub fn name(self) -> &'static str {
        match self {
            Self::GaussSeidel => "Gauss–Seidel",
            Self::Newton => "Newton",
            Self::Auto => "auto",
            Self::Interior => "interior",
        }
    }

    pub fn settings(self, tolerance: f64, accept: f64) -> SolverSettings {
        let newton = common::newton(tolerance, accept, 1e-5);
        match self {
            Self::GaussSeidel => SolverSettings::GaussSeidel(GaussSeidelSettings {
                local: LocalSolve::Exact,
                tolerance,
                accept,
                max_sweeps: SWEEPS,
                acceleration: 0,
            }),
            Self::Newton => SolverSettings::Staged(newton),
            Self::Auto => SolverSettings::Staged(StagedSettings { stages: Stages::All, ..newton }),
            Self::Interior => SolverSettings::Staged(StagedSettings { stages: Stages::Interior, ..newton }),
        }
    }
}

/// A heap of grains in a box without a lid: a lattice with noise, bonded or not, that falls onto
/// the floor.
#[derive(Clone, Debug)]
pub struct Heap {
    pub kind: Kind,
    /// Grains along each axis.
    pub side: usize,
    /// Radius of the grains (m).
    pub radius: f64,
    /// Density (kg/m³).
    pub density: f64,
    /// Mass of every other layer over that of the first.
    pub mass_ratio: f64,
    /// Radius of one grain on top over that of the others; 1 for none.
    pub size_ratio: f64,
    pub friction: f64,
    /// Strength of the bonds over the weight of a grain on Earth; 0 for none.
    pub cohesion: f64,
    /// Step over √(R/g).
    pub step: f64,
    /// Gravity over that of the Earth.
    pub gravity: f64,
    /// Speed at which the grains are thrown, over √(R g), in random directions.
    pub speed: f64,
    pub restitution: f64,
    pub floor: bool,
    pub seed: u64,
}

impl Default for Heap {
    fn default() -> Self {
        Self {
            kind: Kind::Auto,
            side: 4,
            radius: 1e-2,
            density: common::DENSITY,
            mass_ratio: 1.0,
            size_ratio: 1.0,
            friction: 0.3,
            cohesion: 0.0,
            step: 1.0 / 32.0,
            gravity: 1.0,
            speed: 0.0,
            restitution: 0.0,
            floor: true,
            seed: 1,
        }
    }
}

/// Tolerance and acceptance of the atlas: the defaults of a scene.
pub const TOLERANCE: f64 = 1e-8;

impl Heap {
    pub fn accept(&self) -> f64 {
        if self.cohesion > 0.0 { 1e-6 } else { 1e-4 }
    }

    pub fn world<D: Dim>(&self) -> World<D> {
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let (r, unit) = (self.radius, (self.radius * G).sqrt());
        let mut grains: Vec<Grain<D>> = Vec::new();
        for k in 0..self.side.pow(D::N as u32) {
            let layer = k / self.side.pow(D::N as u32 - 1);
            let mut x = D::Vector::zero();
            let mut v = D::Vector::zero();
            for axis in 0..D::N {
                let cell = (k / self.side.pow(axis as u32)) % self.side;
                let noise = if self.cohesion > 0.0 { 0.0 } else { 0.1 * rng.random::<f64>() };
                x[axis] =
                    r * (1.05 + (2.0 * cell as f64) + 0.1 * cell as f64 * f64::from(self.cohesion == 0.0) + noise);
                v[axis] = self.speed * unit * (2.0 * rng.random::<f64>() - 1.0);
            }
            let mut grain = Grain::at_rest(x, r, self.density);
            grain.velocity = v;
            if layer % 2 == 1 {
                grain.mass *= self.mass_ratio;
                grain.inertia *= self.mass_ratio;
            }
            grains.push(grain);
        }
        if self.size_ratio != 1.0 {
            let big = r * self.size_ratio;
            let mut x = D::Vector::zero();
            for axis in 0..D::N {
                x[axis] = r * (self.side as f64 + 0.05);
            }
            x[D::N - 1] = r * (2.2 * self.side as f64 + 1.0) + big;
            grains.push(Grain::at_rest(x, big, self.density));
        }
        let mut walls = Vec::new();
        if self.floor {
            // a heap with a big grain on top has no side walls
            let sides = if self.size_ratio == 1.0 { 0..D::N } else { D::N - 1..D::N };
            for axis in sides {
                let mut normal = D::Vector::zero();
                normal[axis] = 1.0;
                walls.push(Wall::fixed(Shape::Plane { normal }, D::Vector::zero(), self.friction));
                if axis < D::N - 1 {
                    let mut far = D::Vector::zero();
                    far[axis] = r * (2.3 * self.side as f64);
                    walls.push(Wall::fixed(Shape::Plane { normal: -normal }, far, self.friction));
                }
            }
        }
        let mut gravity = D::Vector::zero();
        gravity[D::N - 1] = -G * self.gravity;
        let weight = self.density * D::volume(r) * G;
        let settings = Settings {
            gravity: (self.gravity > 0.0).then_some(gravity),
            friction: self.friction,
            restitution: (self.restitution > 0.0).then_some(Restitution {
                grain_grain: self.restitution,
                grain_wall: self.restitution,
                threshold_speed: 0.0,
            }),
            solver: self.kind.settings(TOLERANCE, self.accept()),
            max_halvings: 4,
            ..common::settings(self.step * (r / G).sqrt())
        };
        let mut world = common::world(grains, walls, settings);
        if self.cohesion > 0.0 {
            world.form_bonds(0.02, |_| self.cohesion * weight, self.friction);
        }
        world
    }
}
