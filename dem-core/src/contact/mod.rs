//! Contacts: the cone, the laws on it, and the kinematics that ties a contact to its two nodes.

pub mod cone;
pub mod law;

pub use cone::{Cone, Local, Weights};
pub(crate) use cone::{PADDED, Padded};
pub use law::{Arms, Block, BondFlow, Bonded, Coulomb, Elastic, Frictionless, Law, LocalSolve};
