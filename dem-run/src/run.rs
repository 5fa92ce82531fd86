//! The run of a scene.

use std::path::PathBuf;

use crate::progress::ProgressMode;
use crate::scene::{Scene, SceneError};
use crate::signals::INTERRUPTED;

/// How a scene is run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunOptions {
    /// The history to write.
    pub output: PathBuf,
    /// Whether files that exist are overwritten.
    pub overwrite: bool,
    /// Number of threads; as many as the machine has where it is absent. The result does not depend on it.
    pub threads: Option<usize>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Whether stderr stays silent but for errors.
    pub quiet: bool,
    /// Whether the summary on stdout is JSON.
    pub json: bool,
    /// Where the prepared sample is written as CSV, if at all.
    pub write_sample: Option<PathBuf>,
}

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scene is wrong, or cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A contact problem was not solved within the limits of the scene.
    #[error("{0}")]
    NoConvergence(String),
    /// A file cannot be read or written.
    #[error("{0}")]
    InputOutput(String),
    /// Ctrl-C or SIGTERM.
    #[error("interrupted: the history is complete up to the last frame")]
    Interrupted,
}

impl RunError {
    /// The exit code of the command: 2 wrong scene, 3 no convergence, 4 input/output, 130 interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(SceneError::Read { .. }) | Self::InputOutput(_) => 4,
            Self::Scene(_) => 2,
            Self::NoConvergence(_) => 3,
            Self::Interrupted => INTERRUPTED,
        }
    }
}

/// Runs a scene.
///
/// # Errors
/// [`RunError`]; a history that was begun is complete up to its last frame.
pub fn run(_scene: &Scene, _options: &RunOptions) -> Result<(), RunError> {
    Err(RunError::InputOutput("runs are not there yet".into()))
}
