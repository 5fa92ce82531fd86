//! The lock of the process that writes a history: a record lock of the system (POSIX `fcntl`). The
//! system releases it when the process ends, also by a crash. It is independent of HDF5's own locks
//! between readers and writers.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::Path;

use rustix::fs::{FlockOperation, fcntl_lock};
use rustix::process::{Flock, FlockType, fcntl_getlk};

use super::error::{HistoryError, Result, refused};

/// Locks the file at `path` until the value is dropped. Until then the process must not open and
/// close the file a second time: closing would release the lock.
pub(super) fn hold(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).write(true).open(path)?;
    match fcntl_lock(&file, FlockOperation::NonBlockingLockExclusive) {
        // a file system without locks: the run continues without one
        Ok(()) | Err(rustix::io::Errno::NOLCK | rustix::io::Errno::NOTSUP | rustix::io::Errno::INVAL) => Ok(file),
        Err(error) => Err(error.into()),
    }
}

/// Locks a history that is read, so that no run resumes it until the value is dropped; without a
/// lock where the file may not be written.
///
/// # Errors
/// [`HistoryError::Busy`]; [`HistoryError::Io`] where the file cannot be read.
pub(super) fn hold_while_read(path: &Path) -> Result<Option<File>> {
    refuse_busy(path)?;
    match hold(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem) => Ok(None),
        Err(_) => refuse_busy(path).map(|()| None),
    }
}

/// Rejects the file at `path`, if it exists, while another process writes it.
///
/// # Errors
/// [`HistoryError::Busy`]; [`HistoryError::Io`] where the file cannot be read.
pub fn refuse_busy(path: &Path) -> Result<()> {
    if !path.is_file() {
        return Ok(());
    }
    match holder(path).map_err(|error| refused(path)("read", error))? {
        Some(process) => Err(HistoryError::Busy { path: path.into(), process }),
        None => Ok(()),
    }
}

/// The process that holds the lock of the file at `path`, if any.
pub(super) fn holder(path: &Path) -> io::Result<Option<i32>> {
    let file = File::open(path)?;
    let found = fcntl_getlk(&file, &Flock::from(FlockType::WriteLock)).unwrap_or(None);
    Ok(found.map(|lock| lock.pid.map_or(0, |pid| pid.as_raw_nonzero().get())))
}
