//! Cracks: the bonds that broke, when, where and how; the lines they make, how these grow, and what they leave of the
//! sample.
//!
//! What a crack, its path and its front are: [`paths`] and [`front`] in the plane; in space a crack is a surface,
//! [`surfaces`].

pub use files::write;
pub use modes::Modes;
pub use report::{Report, read};

mod files;
pub mod front;
mod longest;
pub mod modes;
pub mod parts;
pub mod paths;
pub mod pictures;
pub mod report;
pub mod surfaces;
pub mod voids;
