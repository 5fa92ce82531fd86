//! Locks between processes, which the system releases when a process ends, also by a crash.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Result};
use std::path::Path;

/// Opens the file that is locked, and creates it if it is missing.
///
/// # Errors
/// Those of the operating system.
pub fn open(path: &Path) -> Result<File> {
    OpenOptions::new().write(true).create(true).truncate(false).open(path)
}

/// Locks the file; false while another process holds it. On a file system without locks, as on some
/// clusters, every process gets it.
///
/// # Errors
/// Those of the operating system.
pub fn try_lock(file: &File) -> Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => Ok(true),
        Err(TryLockError::Error(error)) => Err(error),
    }
}
