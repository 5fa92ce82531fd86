//! Scenes, sample preparation, the run loop and the history.

pub mod accuracy;
mod arguments;
pub mod build;
pub mod check;
pub mod cli;
pub mod clock;
pub mod collapse;
pub mod course;
mod destination;
mod dimension;
pub mod error;
pub mod estimate;
pub mod export;
pub mod fclib;
pub mod memory;
pub mod pack;
pub mod packings;
pub mod prepare;
pub mod progress;
pub mod record;
pub mod resume;
pub mod run;
pub mod sample_file;
pub mod signals;
pub mod solve;
pub mod summary;
pub mod sweep;
mod tolerances;
mod warnings;

pub use dem_drawing as plot;
pub use dem_history as history;
pub use dem_output as output;
pub use dem_output::row;
pub use dem_scene as scene;
