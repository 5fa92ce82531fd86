//! Checks of the output files, before any work is done.

use std::path::Path;

use crate::error::RunError;
use crate::history::refuse_busy;
use crate::output::replace::{folder, followed};
use crate::run::RunOptions;
use crate::scene::Scene;

/// Rejects an output that is the input, with or without `--force`.
pub(crate) fn not_itself(read: &Path, written: &Path) -> Result<(), RunError> {
    if !same_file(read, written) {
        return Ok(());
    }
    Err(RunError::Overwrites { option: "-o", path: written.into(), reader: "command" })
}

fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Rejects outputs that the run reads, and two outputs in one file, with or without `--force`.
pub(crate) fn apart(path: &Path, scene: &Scene, options: &RunOptions) -> Result<(), RunError> {
    let mut read = vec![path];
    read.extend(scene.files().map(|(file, _)| file.as_path()));
    for (written, option) in [(Some(&options.output), "-o"), (options.write_sample.as_ref(), "--write-sample")] {
        let Some(written) = written else { continue };
        if read.iter().any(|read| same_file(read, written)) {
            return Err(RunError::Overwrites { option, path: written.clone(), reader: "run" });
        }
    }
    if options.write_sample.as_deref().map(followed) == Some(followed(&options.output)) {
        let message = "-o and --write-sample name the same file: give two different names".into();
        return Err(RunError::InputOutput(message));
    }
    Ok(())
}

/// Rejects a name with which the HDF5 library and `dem-post` cannot open the file.
pub(crate) fn unicode(path: &Path, option: &str) -> Result<(), RunError> {
    if path.to_str().is_some() {
        return Ok(());
    }
    Err(RunError::NotUnicode { path: path.into(), option: option.into() })
}

/// Rejects a file that exists or is being written, or whose folder is missing or not writable.
pub(crate) fn writable(path: &Path, option: &str, overwrite: bool) -> Result<(), RunError> {
    let unfit = |state, remedy| Err(RunError::Unfit { path: path.into(), state, remedy });
    unicode(path, option)?;
    if path.is_dir() {
        return unfit("is a folder", format!("name a file with {option}"));
    }
    // a history is renamed to its final name, which would replace a device such as /dev/null by a
    // file
    if path.exists() && !path.is_file() {
        return unfit("is not a regular file", format!("name another with {option}"));
    }
    if path.exists() && !overwrite {
        return unfit("exists", format!("--force overwrites it, {option} names another"));
    }
    refuse_busy(path)?;
    let folder = folder(path);
    let refused =
        |why: String| Err(RunError::File { path: path.into(), doing: "cannot be written", source: why.into() });
    if !folder.is_dir() {
        return refused(format!("there is no folder {}; create it first", folder.display()));
    }
    match tempfile::tempfile_in(&folder) {
        Ok(_) => Ok(()),
        Err(why) => refused(format!("no file can be created in {}: {why}", folder.display())),
    }
}

/// Rejects a file in the place of a folder.
pub(crate) fn folder_or_new(path: &Path) -> Result<(), RunError> {
    if !path.exists() || path.is_dir() {
        return Ok(());
    }
    Err(RunError::Unfit { path: path.into(), state: "is a file", remedy: "name a folder with -o DIR".into() })
}
