//! The errors of an analysis with their exit codes; tables, files and numbers are those of
//! [`dem_output`].

use std::path::PathBuf;

use dem_history::sweep::SweepError;
use dem_history::{History, HistoryError};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

pub use dem_output::{
    Folder, Source, Text, WriteError, cell, counted, default_folder, escaped, facts, in_shell, number, plain, print,
    quantity, short,
};

/// The errors of an analysis.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The history cannot be read.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// The history is sound, but lacks what the analysis needs.
    #[error("{}: {what}", .path.display())]
    Lacking {
        /// The history.
        path: PathBuf,
        /// The missing data, and what to do.
        what: String,
    },
    /// An invalid argument.
    #[error("{0}")]
    Usage(String),
    /// The manifest of a sweep cannot be read.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// Some of the requested runs have no result.
    #[error("{0}")]
    Incomplete(String),
    /// The history violates its layout.
    #[error("{0}")]
    Unsound(String),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl PostError {
    /// The exit code of this error: 1 for incomplete results, 2 for wrong usage or scene, 4 for
    /// input and output.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Incomplete(_) => 1,
            Self::Lacking { .. } | Self::Usage(_) => 2,
            Self::History(_) | Self::Sweep(_) | Self::Unsound(_) | Self::Write(_) => 4,
        }
    }
}

/// A bar on a terminal unless `quiet`; elsewhere indicatif hides it. The template is indicatif's.
pub(crate) fn progress(length: u64, quiet: bool, template: &str) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    // a template that does not parse gives a bar without numbers, not an error
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// A history as the source of results: its path, and the properties of its run that do not change
/// while the run continues or when the history is packed.
///
/// # Errors
/// Those of reading it.
pub fn source(history: &History) -> Result<Source> {
    let p = history.parameters()?;
    let revision = if p.git_revision.is_empty() { "unknown" } else { &p.git_revision };
    let run = format!(
        "started {} on {}, seed {}, with dem-run {} (git {revision}, {})",
        p.start, p.host, p.seed, p.version, p.build
    );
    Ok(Source::new(history.path(), Some(run)))
}

/// The result of an analysis.
pub type Result<T> = std::result::Result<T, PostError>;
