//! The errors of a history, each with its remedy.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// An error of reading or writing a history. Its message names the file, what is wrong and what to
/// do.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The output file exists and overwriting was not requested.
    #[error(
        "{} exists already: pass --force to replace it, or -o FILE to write elsewhere", .path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// There is no such file.
    #[error("{} does not exist: check the path, or make the file with `dem-run run SCENE -o {}`",
        .path.display(), .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}{}", .path.display(), remedy(doing, source))]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as in "read".
        doing: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is of another format.
    #[error("{} is not an HDF5 file: give the .h5 file that `dem-run run` wrote", .path.display())]
    NotHdf5 {
        /// The file.
        path: PathBuf,
    },
    /// The end of the file is missing.
    #[error(
        "{} is truncated: it holds {found} bytes, and HDF5 recorded at least {expected}. \
         Copy it again, or run the scene again", .path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        found: u64,
        /// The least length that it should have, bytes.
        expected: u64,
    },
    /// An HDF5 file that this program did not write.
    #[error("{} is an HDF5 file, but not a history of dem-run ({why}): give the .h5 file that `dem-run run` wrote",
        .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The evidence.
        why: String,
    },
    /// Written by a newer program.
    #[error("{} has schema version {found}, and this program reads up to {known}: use a newer version of this program",
        .path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its schema version.
        found: u32,
        /// The newest version known to this program.
        known: u32,
    },
    /// The content of the file violates its schema.
    #[error("{} is damaged at /{place} ({why}): `dem-post info --check` lists all that is wrong with it; copy it again, \
        or run the scene again", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The dataset or group.
        place: String,
        /// What is wrong with it.
        why: String,
    },
    /// A frame that does not exist in the file.
    #[error("{} has no frame {frame}: it holds frames 0 to {}", .path.display(), .frames.saturating_sub(1))]
    NoFrame {
        /// The file.
        path: PathBuf,
        /// The frame asked for.
        frame: usize,
        /// The number of frames in the file.
        frames: usize,
    },
    /// The file being written was moved or removed.
    #[error("{} has been moved, deleted or replaced while it was being written", .path.display())]
    Gone {
        /// The file.
        path: PathBuf,
    },
    /// Another process writes the file.
    #[error("{} is in use by process {process}: wait until it ends, or stop it", .path.display())]
    Busy {
        /// The file.
        path: PathBuf,
        /// The process.
        process: i32,
    },
    /// Another program has the file open for writing (HDF5's own lock).
    #[error("{} is open for writing in another program (h5py, a viewer): close it there, or read a copy", .path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
    /// The caller ended the work.
    #[error("interrupted")]
    Interrupted,
    /// HDF5 could not write.
    #[error("cannot write {} ({why}): is the disk full, or the folder gone?", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// HDF5's reason.
        why: String,
    },
    /// The caller handed over arrays that do not fit the layout: an error in the program, not in
    /// the file.
    #[error("history: {place} has {found} values where the layout requires {expected}")]
    Shape {
        /// The array.
        place: String,
        /// Its length.
        found: usize,
        /// The length that fits.
        expected: usize,
    },
}

/// The result of reading or writing a history.
pub type Result<T> = std::result::Result<T, HistoryError>;

/// HDF5's error as one short line.
pub fn reason(error: &hdf5::Error) -> String {
    let text = match error.stack() {
        // the innermost record is the cause; the outermost only names the failed call
        Some(stack) => stack.last().map_or_else(|| "unknown HDF5 error".into(), |frame| frame.desc().to_string()),
        None => error.to_string(),
    };
    // HDF5's text about a failed system call includes the time and the address of the buffer
    let system = text.split_once("error message = '").and_then(|(_, rest)| rest.split_once('\''));
    system.map_or_else(|| text.clone(), |(message, _)| message.into())
}

/// What is wrong at `place` of the file at `path`.
pub(super) fn damaged(path: &Path, place: &str, why: impl Into<String>) -> HistoryError {
    HistoryError::Damaged { path: path.into(), place: place.into(), why: why.into() }
}

/// Turns an error of the system call `doing`, as in "create", into [`HistoryError::Io`].
pub(super) fn refused(path: &Path) -> impl Fn(&'static str, std::io::Error) -> HistoryError + '_ {
    move |doing, source| HistoryError::Io { path: path.into(), doing, source }
}

/// What to do where the system refused to create a file.
fn remedy(doing: &str, source: &std::io::Error) -> &'static str {
    match source.kind() {
        ErrorKind::NotFound if doing == "create" => ": create its folder first",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem if doing == "create" => {
            ": a new file is made in its folder, which must be writable: name another with -o, or copy the history"
        }
        _ => "",
    }
}

/// Turns HDF5's errors while writing into [`HistoryError::Write`].
pub(super) fn while_writing(path: &Path) -> impl Fn(hdf5::Error) -> HistoryError + '_ {
    move |error| HistoryError::Write { path: path.into(), why: reason(&error) }
}

/// Turns HDF5's errors while reading `place` into [`HistoryError::Damaged`].
pub(super) fn while_reading(path: &Path, place: &str) -> impl Fn(hdf5::Error) -> HistoryError {
    let (path, place) = (path.to_path_buf(), place.to_string());
    move |error| HistoryError::Damaged { path: path.clone(), place: place.clone(), why: reason(&error) }
}
