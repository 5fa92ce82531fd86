//! Scenes, sample preparation, the run loop and the history.

pub mod scene;
