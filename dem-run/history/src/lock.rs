//! Which process writes a history. The lock is a record lock of the system (POSIX `fcntl`): it ends
//! with its process, however that ends, and is independent of the locks of HDF5 between readers and
//! writers.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;

use rustix::fs::{FlockOperation, fcntl_lock};
use rustix::process::{Flock, FlockType, fcntl_getlk};

use super::error::{HistoryError, Result, refused};

/// Locks the file at `path` until the value is dropped. A process must not open it a second time
/// and close it again meanwhile: that would end the lock.
pub(super) fn hold(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).write(true).open(path)?;
    match fcntl_lock(&file, FlockOperation::NonBlockingLockExclusive) {
        // a file system without locks: the run must not fail for that
        Ok(()) | Err(rustix::io::Errno::NOLCK | rustix::io::Errno::NOTSUP | rustix::io::Errno::INVAL) => Ok(file),
        Err(error) => Err(error.into()),
    }
}

/// Refuses the file at `path`, if there is one, while another process writes it.
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

/// The process that holds the lock of the file at `path`, if one does.
pub(super) fn holder(path: &Path) -> io::Result<Option<i32>> {
    let file = File::open(path)?;
    let found = fcntl_getlk(&file, &Flock::from(FlockType::WriteLock)).unwrap_or(None);
    Ok(found.map(|lock| lock.pid.map_or(0, |pid| pid.as_raw_nonzero().get())))
}
