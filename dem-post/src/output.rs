//! What an analysis can fail of, with its exit code; tables, files and numbers are those of [`dem_run::output`].

use std::path::PathBuf;

use dem_run::history::HistoryError;

pub use dem_run::output::{Folder, Text, WriteError, cell, default_folder, facts, number, print, quantity, short};

/// What can go wrong in an analysis.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The history cannot be read.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// The history is sound, but its scene has not what the analysis is about.
    #[error("{}: {what}", .path.display())]
    Lacking {
        /// The history.
        path: PathBuf,
        /// What is lacking, and what to do.
        what: String,
    },
    /// An argument that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl PostError {
    /// The exit code that stands for this error: 2 for wrong usage or scene, 4 for input and output.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Lacking { .. } | Self::Usage(_) => 2,
            Self::History(_) | Self::Write(_) => 4,
        }
    }
}

/// The result of an analysis.
pub type Result<T> = std::result::Result<T, PostError>;
