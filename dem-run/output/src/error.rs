//! A result that cannot be written.

use std::path::PathBuf;

/// A result that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {why}", .path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// The reason.
    pub why: String,
}

/// The result of writing.
pub type Result<T> = std::result::Result<T, WriteError>;
