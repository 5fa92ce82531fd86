//! Scenes, sample preparation, the run loop and the history.

pub mod accuracy;
pub mod build;
pub mod check;
pub mod cli;
pub mod collapse;
pub mod course;
mod destination;
pub mod export;
pub mod fclib;
pub mod history;
pub mod memory;
pub mod output;
mod owner;
pub mod plot;
pub mod prepare;
pub mod progress;
pub mod record;
mod replace;
pub mod resume;
pub mod run;
pub mod sample_file;
pub mod scene;
pub mod signals;
pub mod solve;
pub mod summary;
pub mod sweep;
mod warnings;
