//! Force chains: the network of contact forces, how the forces are distributed, and the lines of grains that carry most.
//!
//! **Network.** A force here is the normal component r_n of a contact, positive in compression. ⟨f⟩ is the mean of |r_n| over the
//! contacts that carry a force; the strong network is the contacts with |r_n| > ⟨f⟩.
//!
//! **Chains** are lines of at least three grains: [`quasilinear`] says which.

pub use files::write;
pub use report::{Report, read};

mod files;
pub mod pictures;
pub mod quasilinear;
pub mod report;
pub mod stress;
