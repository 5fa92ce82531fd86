//! Contact laws: the cone of the reactions, and the laws on it.

pub mod cone;
pub mod law;

pub use cone::{Cone, Local, Weights};
pub(crate) use cone::{PADDED, Padded};
pub use law::{Arms, Block, BondFlow, Bonded, Coulomb, Elastic, Frictionless, Law, LocalSolve, Reached};
