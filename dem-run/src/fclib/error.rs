//! Why a problem cannot be read or written.

use std::path::PathBuf;

/// An error in reading or writing a problem. Its message names the file, the dataset and the error.
#[derive(Debug, thiserror::Error)]
pub enum FclibError {
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operation, as in "read".
        doing: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is of another format, or its end is missing.
    #[error("{} cannot be opened as HDF5 ({why}): give a problem in FCLIB's format, as `dem-run export` writes it",
        .path.display())]
    NotHdf5 {
        /// The file.
        path: PathBuf,
        /// HDF5's reason.
        why: String,
    },
    /// An HDF5 file without a problem.
    #[error("{} holds no problem of FCLIB ({why}): give a file with the group /fclib_local, as `dem-run export` writes \
             it, or /fclib_global", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What the file contains instead.
        why: String,
    },
    /// A dataset is missing, or has an invalid value.
    #[error("{}, /{place}: {why}", .path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// The dataset or group.
        place: String,
        /// The error.
        why: String,
    },
    /// HDF5 could not write.
    #[error("cannot write {} ({why}): is the disk full, or the folder gone?", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// HDF5's reason.
        why: String,
    },
}
