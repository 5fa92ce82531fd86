//! Scenes, sample preparation, the run loop and the history.

pub mod check;
pub mod cli;
pub mod progress;
pub mod run;
pub mod scene;
pub mod signals;
