//! Files that come into their place whole: made beside it under another name, then moved there.

use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// Makes a file by `make`, which is given the name of an empty file beside `path`, and moves it to `path`. Where that
/// fails, nothing is left behind and what stood at `path` stands. `failed` tells of what the operating system refused,
/// as in "create".
pub(crate) fn replace<T, E>(
    path: &Path,
    failed: impl Fn(&'static str, Error) -> E,
    make: impl FnOnce(&Path) -> std::result::Result<T, E>,
) -> std::result::Result<T, E> {
    remove_orphans(path);
    let part = partial(path).map_err(|error| failed("create", error))?;
    // HDF5 would not say why a file cannot be created; the operating system does
    std::fs::File::create(&part).map_err(|error| failed("create", error))?;
    let made = make(&part).and_then(|made| {
        std::fs::rename(&part, path).map_err(|error| failed("replace", error))?;
        Ok(made)
    });
    if made.is_err() {
        // the first error is the one to report
        let _ = std::fs::remove_file(&part);
    }
    made
}

/// The name under which a file is made: in the same folder, so that the move is atomic.
fn partial(path: &Path) -> Result<PathBuf> {
    let Some(name) = path.file_name().filter(|_| !path.is_dir()) else {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder, give a file name"));
    };
    Ok(path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id())))
}

/// Removes what processes that were killed left of files that they made beside `path`.
fn remove_orphans(path: &Path) {
    let Some(name) = path.file_name() else { return };
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let found = entry.file_name();
        let process = found
            .to_str()
            .and_then(|found| found.strip_prefix(&format!(".{}.", name.to_string_lossy()))?.strip_suffix(".part"))
            .and_then(|process| rustix::process::Pid::from_raw(process.parse().ok()?));
        let gone = |process| rustix::process::test_kill_process(process) == Err(rustix::io::Errno::SRCH);
        if process.is_some_and(gone) {
            // one that cannot be removed does no harm
            let _ = std::fs::remove_file(entry.path());
        }
    }
}
