//! Atomic replacement of files: a file is made under a temporary name in the same folder, then
//! renamed. A reader, also after a crash of the system, finds either the old content or the new
//! one.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// Makes a file with `make`, whose argument is the path of an empty file beside `path`, and moves
/// it to `path` once its content is on the disk. On failure the temporary file is removed and the
/// old file at `path` stays. `failed` makes the error of a refused system call; its first argument
/// names the call, as in "create".
pub fn replace<T, E>(
    path: &Path,
    failed: impl Fn(&'static str, Error) -> E,
    make: impl FnOnce(&Path) -> std::result::Result<T, E>,
) -> std::result::Result<T, E> {
    replace_synced(path, &failed, |part| {
        let made = make(part)?;
        sync(part).map_err(|error| failed("write", error))?;
        Ok(made)
    })
}

/// As [`replace`], for a file that `make` itself synchronises. A process loses its lock on a file
/// when it closes any descriptor of that file, so a locked file must not be opened again to be
/// synchronised.
pub fn replace_synced<T, E>(
    path: &Path,
    failed: impl Fn(&'static str, Error) -> E,
    make: impl FnOnce(&Path) -> std::result::Result<T, E>,
) -> std::result::Result<T, E> {
    let path = &followed(path);
    remove_orphans(folder_of(path), path.file_name());
    let part = partial(path).map_err(|error| failed("create", error))?;
    // HDF5 would not say why a file cannot be created; the operating system does
    File::create(&part).map_err(|error| failed("create", error))?;
    let made = make(&part).and_then(|made| {
        rename(&part, path).map_err(|error| failed("replace", error))?;
        Ok(made)
    });
    if made.is_err() {
        // the first error is the one to report
        let _ = fs::remove_file(&part);
    }
    made
}

/// Writes a file under a temporary name and moves it to `path`. Temporary files of killed processes
/// stay; [`remove_orphans`] removes them.
///
/// # Errors
/// Those of the operating system; the old file at `path` then stays.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    let path = &followed(path);
    let part = partial(path)?;
    fs::write(&part, content).and_then(|()| move_to(&part, path)).inspect_err(|_| {
        let _ = fs::remove_file(&part);
    })
}

/// Moves a complete file to `path` in the same folder, once its content is on the disk.
///
/// # Errors
/// Those of the operating system.
pub fn move_to(part: &Path, path: &Path) -> Result<()> {
    sync(part)?;
    rename(part, path)
}

/// Waits until the content of a file is on the disk.
///
/// # Errors
/// Those of the operating system.
pub fn sync(path: &Path) -> Result<()> {
    File::open(path)?.sync_all()
}

fn rename(part: &Path, path: &Path) -> Result<()> {
    fs::rename(part, path)?;
    // not every file system can sync a folder; the file is complete under one of its two names
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Most links that are followed from one to the next, as in Linux.
const MOST_LINKS: usize = 40;

/// The file at `path`; where that is a symbolic link, the file that it names, also one that does
/// not exist yet.
#[must_use]
pub fn followed(path: &Path) -> PathBuf {
    if !path.is_symlink() {
        return path.into();
    }
    let mut named = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let Ok(to) = fs::read_link(&named) else { break };
        named = folder_of(&named).join(to);
    }
    fs::canonicalize(&named).unwrap_or(named)
}

/// The folder of the file that is written where `path` is: that of the file which a link names.
#[must_use]
pub fn folder(path: &Path) -> PathBuf {
    folder_of(&followed(path)).into()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The temporary name of a file: in the same folder, so that the move is atomic.
fn partial(path: &Path) -> Result<PathBuf> {
    let Some(name) = path.file_name().filter(|_| !path.is_dir()) else {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder: give a file name"));
    };
    Ok(path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id())))
}

/// Removes temporary files of killed processes from a folder: those of the file `name`, or all.
pub fn remove_orphans(folder: &Path, name: Option<&OsStr>) {
    let name = name.map(OsStr::to_string_lossy);
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let found = entry.file_name();
        let process = found
            .to_str()
            .and_then(|found| found.strip_prefix('.')?.strip_suffix(".part")?.rsplit_once('.'))
            .filter(|(of, _)| name.as_ref().is_none_or(|name| name == of))
            .and_then(|(_, process)| rustix::process::Pid::from_raw(process.parse().ok()?));
        let gone = |process| rustix::process::test_kill_process(process) == Err(rustix::io::Errno::SRCH);
        if process.is_some_and(gone) {
            // an orphan that cannot be removed is harmless
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write(&path, b"old").unwrap();
        let failed = replace(
            &path,
            |_, error| error,
            |part| {
                fs::write(part, "half").unwrap();
                assert_eq!(fs::read(&path).unwrap(), b"old");
                Err::<(), _>(Error::other("no room"))
            },
        );
        assert_eq!(failed.unwrap_err().to_string(), "no room");
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"old".to_vec(), vec!["a.csv".into()]));
        write(&path, b"new").unwrap();
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"new".to_vec(), vec!["a.csv".into()]));
        assert_eq!(write(folder.path(), b"").unwrap_err().kind(), ErrorKind::IsADirectory);
    }

    #[test]
    fn a_link_stays_and_the_file_that_it_names_is_written() {
        let [here, there] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let (link, file) = (here.path().join("a.csv"), there.path().join("b.csv"));
        std::os::unix::fs::symlink(&file, &link).unwrap();
        // the first write makes the file
        for content in [b"old", b"new"] {
            write(&link, content).unwrap();
            assert!(link.is_symlink() && fs::read(&file).unwrap() == content);
        }
        replace(&link, |_, error| error, |part| fs::write(part, "whole")).unwrap();
        assert!(link.is_symlink() && fs::read(&file).unwrap() == b"whole");
        assert_eq!((names(here.path()), names(there.path())), (vec!["a.csv".into()], vec!["b.csv".into()]));
    }

    #[test]
    fn a_name_that_cannot_be_taken_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let taken = replace(
            &path,
            |doing, error| format!("{doing}: {error}"),
            |part| {
                fs::create_dir(&path).unwrap();
                fs::write(part, "whole").map_err(|error| error.to_string())
            },
        );
        assert!(taken.unwrap_err().starts_with("replace: "));
        assert_eq!(names(folder.path()), ["a.csv"]);
    }

    #[test]
    fn what_killed_processes_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let (dead, alive) = (child.id(), std::process::id());
        let orphans = [format!(".a.csv.{dead}.part"), format!(".b.csv.{dead}.part")];
        let kept = [format!(".a.csv.{alive}.part"), "a.part".into(), ".a.csv.part".into()];
        orphans.iter().chain(&kept).for_each(|name| fs::write(folder.path().join(name), "x").unwrap());
        remove_orphans(folder.path(), Some(OsStr::new("a.csv")));
        assert!(!names(folder.path()).contains(&orphans[0]) && names(folder.path()).contains(&orphans[1]));
        remove_orphans(folder.path(), None);
        assert!(!names(folder.path()).contains(&orphans[1]));
        assert!(kept.iter().all(|name| names(folder.path()).contains(name)));
    }
}
