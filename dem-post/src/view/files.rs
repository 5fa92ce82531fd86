//! What `dem-post view` writes.

use std::path::Path;

use dem_history::History;

use super::companion::{Companion, Fault, relative};
use super::outline::Outline;
use super::report::{NAMES, Report};
use super::{Format, dump, h5md, vtk, vtp};
use crate::output::{Folder, PostError, Result, WriteError, progress};

/// Writes the files into `folder`, and their lengths into the report.
///
/// # Errors
/// [`PostError::Write`], [`PostError::Usage`] for a history that has the name of a companion, and
/// those of reading it.
pub fn write(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    match report.format {
        Format::Vtkhdf => companions(history, report, folder, quiet),
        Format::Vtp => vtp::write(history, report, folder, quiet),
        Format::Lammps => dump::write(history, report, folder, quiet),
    }
}

fn companions(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let absolute = |path: &Path| path.canonicalize().map_err(|error| failed(path, &error));
    let source = absolute(history.path())?;
    let home = absolute(folder.path())?;
    let link = relative(&home, &source);
    let link = link.to_str().ok_or_else(|| failed(&source, &"its path is not Unicode text"))?;
    if NAMES.iter().any(|name| home.join(name) == source) {
        return Err(PostError::Usage(format!(
            "{} would be overwritten: choose another folder with -o DIR",
            report.file
        )));
    }
    let file = hdf5::File::open(&source).map_err(|error| failed(&source, &error))?;
    for companion in &mut report.companions {
        companion.bytes = folder.make(companion.name, |path| {
            make(companion.name, path, &file, link, history, &report.outline, quiet)?;
            length(path)
        })?;
    }
    Ok(())
}

fn make(
    name: &str,
    path: &Path,
    file: &hdf5::File,
    link: &str,
    history: &History,
    outline: &Outline,
    quiet: bool,
) -> Result<()> {
    let write = || -> std::result::Result<(), Fault> {
        let companion = Companion::create(path, file, link)?;
        match name {
            "grains.vtkhdf" => vtk::grains(&companion, outline)?,
            "contacts.vtkhdf" => {
                let bar = progress(
                    history.frames() as u64,
                    quiet,
                    "{bar:24} {percent} % of the contacts written, {eta} left",
                );
                let made = vtk::contacts(&companion, history, outline, &bar);
                bar.finish_and_clear();
                made?;
            }
            "bonds.vtkhdf" => vtk::bonds(&companion, outline)?,
            _ => h5md::trajectory(&companion, outline)?,
        }
        Ok(companion.file.flush()?)
    };
    write().map_err(|fault| match fault {
        Fault::Reading(error) => error.into(),
        Fault::Writing(error) => failed(path, &error),
    })
}

fn length(path: &Path) -> Result<u64> {
    Ok(std::fs::metadata(path).map_err(|error| failed(path, &error))?.len())
}

fn failed(path: &Path, why: &dyn std::fmt::Display) -> PostError {
    WriteError { path: path.into(), why: why.to_string() }.into()
}
