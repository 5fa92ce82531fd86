//! Scenes, sample preparation, the run loop and the history.

pub mod build;
pub mod collapse;
pub mod history;
pub mod prepare;
pub mod run;
pub mod scene;
