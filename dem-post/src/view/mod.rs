//! Companions of a history: small files that map its data for viewers.
//!
//! ParaView and VTK read `grains.vtkhdf`, `contacts.vtkhdf` and `bonds.vtkhdf`, MDAnalysis reads `grains.h5md`. They hold
//! links and virtual datasets that lead to the history by a path relative to themselves; almost nothing is copied
//! (`docs/history.md` tells what, and how large it is).

pub use files::write;
pub use report::{Report, read};

mod companion;
mod files;
mod h5md;
mod outline;
pub mod report;
mod vtk;
