//! Errors of the commands: their messages and exit codes.

use crate::fclib::FclibError;
use crate::history::HistoryError;
use crate::history::sweep::SweepError;
use crate::output::{WriteError, size};
use crate::prepare::PrepareError;
use crate::scene::SceneError;
use crate::signals::INTERRUPTED;
use std::error::Error;
use std::io::ErrorKind;
use std::path::PathBuf;

/// The cause of a failure, from the operating system, a library or this program.
pub type Cause = Box<dyn Error + Send + Sync>;

/// An error of a command.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scene is wrong, or cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The sample cannot be prepared: all its errors.
    #[error("{}", .0.join("\n"))]
    Sample(Vec<String>),
    /// A contact problem was not solved within its limits.
    #[error(transparent)]
    NoConvergence(#[from] NoConvergence),
    /// A file or folder that cannot be read, written or made.
    #[error("{} {doing}: {source}", .path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What failed, as in "cannot be read".
        doing: &'static str,
        /// Why.
        source: Cause,
    },
    /// A file that a scene names cannot be opened.
    #[error("{field}: {} cannot be read: {source}", .path.display())]
    SceneFile {
        /// The field that names it.
        field: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The content of a file cannot be read.
    #[error("{}: {what} cannot be read: {source}", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The expected content, as in "the sweep".
        what: &'static str,
        /// Why.
        source: Cause,
    },
    /// A file or folder that the command cannot use: it is in the place of a result, or is
    /// incomplete.
    #[error("{} {state}: {remedy}", .path.display())]
    Unfit {
        /// The file or folder.
        path: PathBuf,
        /// Its state, as in "is a folder".
        state: &'static str,
        /// What to do.
        remedy: String,
    },
    /// A result would overwrite an input.
    #[error("{option} {} would overwrite what the {reader} reads: name another file", .path.display())]
    Overwrites {
        /// The option that names the result.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// What reads the file: "command" or "run".
        reader: &'static str,
    },
    /// A name of a result with which the HDF5 library and `dem-post` cannot open it.
    #[error("{} is not UTF-8: name another with {option}", .path.display())]
    NotUnicode {
        /// The file or folder.
        path: PathBuf,
        /// The option that names it.
        option: String,
    },
    /// There is less memory than the run needs.
    #[error(
        "{grains} grains need about {} of memory, but {} are free: use fewer grains, or another machine; \
         --ignore-memory runs the scene anyway", size(*.needed), size(*.free))]
    Memory {
        /// Number of grains.
        grains: usize,
        /// Memory that the run needs (bytes).
        needed: u64,
        /// Memory that is free (bytes).
        free: u64,
    },
    /// There is less disk space than a run needs to resume.
    #[error(
        "resuming {} needs {} of disk space in its folder, but {} are free: free some space first",
        .path.display(), size(*.needed), size(*.free))]
    Disk {
        /// The history.
        path: PathBuf,
        /// Disk space for its copy (bytes).
        needed: u64,
        /// Free disk space (bytes).
        free: u64,
    },
    /// The operating system refused an operation other than one on a file.
    #[error("{what}: {source}")]
    System {
        /// What failed, as in "cannot watch the parent process".
        what: String,
        /// Why.
        source: Cause,
    },
    /// Invalid input or output.
    #[error("{0}")]
    InputOutput(String),
    /// The history cannot be read or written.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// A contact problem cannot be read or written.
    #[error(transparent)]
    Problem(#[from] FclibError),
    /// The requested item does not exist.
    #[error("{0}")]
    Usage(String),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A result cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A result cannot be written as a table.
    #[error(transparent)]
    Table(#[from] csv::Error),
    /// A file in the folder of a sweep cannot be read or written.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// Runs of a sweep failed.
    #[error("{message}")]
    Runs {
        /// The largest of their exit codes.
        code: u8,
        /// Number of failed runs, and the remedy.
        message: String,
    },
    /// Ctrl-C or SIGTERM, and the state of the results.
    #[error("interrupted: {0}")]
    Interrupted(&'static str),
}

/// A contact problem that was not solved within its limits.
#[derive(Debug, thiserror::Error)]
pub enum NoConvergence {
    /// In a step of the packing of a random sample.
    #[error("the sample was not packed: {0}")]
    Packing(String),
    /// In a step of a run.
    #[error("{error}\nthe history is complete up to there{remedy}")]
    Step {
        /// What happened, and when.
        error: String,
        /// The remedy; empty, or with a leading semicolon.
        remedy: String,
    },
    /// In a step before the requested step of an export.
    #[error("{error}\nstep {step} was not reached; step {last} is the last that can be exported")]
    Export {
        /// What happened, and when.
        error: String,
        /// The requested step.
        step: u64,
        /// The step that was not solved.
        last: u64,
    },
    /// Of a limit load.
    #[error("the limit load was not found: the programme was not solved to an error of 1e-7")]
    Limit,
    /// In a file.
    #[error("{}: {why}", .path.display())]
    Problem {
        /// The file.
        path: PathBuf,
        /// The accuracy reached, and the proven verdict on the problem's feasibility.
        why: String,
    },
}

impl From<PrepareError> for RunError {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Interrupted => Self::Interrupted("the sample was not packed"),
            PrepareError::Step(step) => NoConvergence::Packing(step.to_string()).into(),
            other => Self::Sample(vec![other.to_string()]),
        }
    }
}

impl RunError {
    /// The exit code of the command: 2 wrong scene, 3 no convergence, 4 input/output, 130
    /// interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(SceneError::Read { source, .. }) if source.kind() != ErrorKind::InvalidData => 4,
            Self::Scene(_) | Self::Sample(_) | Self::Usage(_) | Self::NotUnicode { .. } => 2,
            Self::NoConvergence(_) => 3,
            Self::File { .. } | Self::SceneFile { .. } | Self::Content { .. } | Self::Unfit { .. } => 4,
            Self::Overwrites { .. } | Self::Memory { .. } | Self::Disk { .. } | Self::System { .. } => 4,
            Self::InputOutput(_) | Self::History(_) | Self::Problem(_) | Self::Write(_) => 4,
            Self::Json(_) | Self::Table(_) | Self::Sweep(_) => 4,
            Self::Runs { code, .. } => *code,
            Self::Interrupted(_) => INTERRUPTED,
        }
    }
}
