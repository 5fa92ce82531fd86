//! The discrete element model of cohesive granular material, solved implicitly by non-smooth contact dynamics.
//!
//! The model is that of M. Guessasma and J. Fortin, *Modélisation d'un milieu discret cohésif par l'approche
//! dynamique des contacts*, Giens 2011 (hal-00592916): rigid disks and spheres, Signorini–Coulomb contact written as
//! de Saxcé's bipotential, bonds that carry tension, shear and a rolling moment and break for good.
//!
//! SI units throughout. Reactions are impulses (N s) inside a step, forces (N) in everything that is reported.
#![forbid(unsafe_code)]

pub mod body;
pub mod bond;
pub mod contact;
pub mod detection;
pub mod dim;
mod linear;
pub mod problem;
pub mod saved;
pub mod solver;
pub mod world;
