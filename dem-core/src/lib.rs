//! The discrete element model of cohesive granular material, solved implicitly by non-smooth
//! contact dynamics.
//!
//! The model is that of M. Guessasma and J. Fortin, *Modélisation d'un milieu discret cohésif par
//! l'approche dynamique des contacts*, Giens 2011 (hal-00592916): rigid disks and spheres,
//! Signorini–Coulomb contact written as de Saxcé's bipotential, bonds that carry tension, shear and
//! a rolling moment and do not re-form once broken.
//!
//! SI units throughout. Reactions are impulses (N s) inside a step, forces (N) in every output.
//!
//! A disk falls on a floor and stays there:
//!
//! ```
//! use dem_core::prelude::*;
//!
//! // centre (m), radius (m), density times thickness (kg/m²)
//! let disk = Grain::at_rest([0.0, 0.11].into(), 0.01, 25.0);
//! let plane = Shape::Plane { normal: [0.0, 1.0].into() };
//! let floor = Wall::fixed(plane, [0.0, 0.0].into(), 0.5);
//! let gravity = Some([0.0, -9.81].into());
//! let settings = Settings { step: 1e-3, gravity, ..Settings::default() };
//! let grains = [disk].into_iter().collect();
//! let mut world = World::<D2>::new(grains, vec![floor], vec![], settings);
//! for _ in 0..300 {
//!     world.step()?;
//! }
//! assert!((world.grains.position[0][1] - 0.01).abs() < 1e-9);
//! # Ok::<(), StepError>(())
//! ```
//!
//! Read on at [`world::World::step`]: the time step, from top to bottom. `examples/` has a falling
//! disk with its energy over time, a bond pulled until it breaks, a user-defined contact law and a
//! user-defined solver.
#![forbid(unsafe_code)]

pub mod body;
pub mod bond;
pub mod contact;
pub mod detection;
pub mod dim;
mod linear;
pub mod plate;
pub mod problem;
pub mod saved;
pub mod solver;
mod threads;
pub mod world;

/// The types needed to build a world and to step it.
pub mod prelude {
    pub use crate::body::{Drive, Grain, Grains, Load, Schedule, Shape, Wall};
    pub use crate::bond::{Bond, BondStatus, Bonds, Rupture, Stiffness};
    pub use crate::contact::BondFlow;
    pub use crate::dim::{D2, D3, D3Twist, Dim, Vect};
    pub use crate::plate::Plate;
    pub use crate::solver::{GaussSeidelSettings, SolverSettings, StagedSettings};
    pub use crate::world::{MaterialFriction, Restitution, Settings, StepError, StepReport, World};
}
