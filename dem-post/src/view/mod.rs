//! Companions of a history: small files that map its data for viewers.
//!
//! ParaView and VTK read `grains.vtkhdf`, `contacts.vtkhdf` and `bonds.vtkhdf`, MDAnalysis reads `grains.h5md`. They hold
//! links and virtual datasets that lead to the history by a path relative to themselves; almost nothing is copied
//! (`docs/history.md` tells what, and how large it is).

mod companion;
mod h5md;
mod vtk;

use std::path::Path;

use dem_history::History;
use serde::Serialize;

use crate::output::{Folder, PostError, Result, WriteError, facts, progress};
use companion::{Companion, Fault, relative};

/// All that a history may have.
const NAMES: [&str; 4] = ["grains.vtkhdf", "contacts.vtkhdf", "bonds.vtkhdf", "grains.h5md"];

/// What is mapped.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The history.
    pub file: String,
    /// Its length, bytes.
    pub bytes: u64,
    /// Number of frames.
    pub frames: usize,
    /// The companions, in the order in which they are written.
    pub companions: Vec<Mapped>,
    /// Numbers of each kind and frame.
    #[serde(skip)]
    outline: Outline,
}

/// One companion.
#[derive(Clone, Debug, Serialize)]
pub struct Mapped {
    /// Its name in the folder.
    pub name: &'static str,
    /// What it shows.
    pub shows: String,
    /// Its length, bytes; 0 before it is written.
    pub bytes: u64,
}

/// How much of each there is.
#[derive(Clone, Debug, Default)]
struct Outline {
    dimension: usize,
    frames: usize,
    grains: usize,
    bonds: usize,
    /// Contacts in all frames.
    rows: usize,
    /// First row and number of the contacts of each frame, and how many of them are with walls.
    starts: Vec<i64>,
    counts: Vec<i64>,
    at_walls: Vec<i64>,
}

impl Outline {
    fn read(history: &History, quiet: bool) -> Result<Self> {
        let mut outline = Self {
            dimension: history.dimension(),
            frames: history.frames(),
            grains: history.grains()?.id.len(),
            bonds: history.bonds()?.len(),
            ..Self::default()
        };
        let bar = progress(history.frames() as u64, quiet, "{bar:24} {percent} % of the pairs read, {eta} left");
        for frame in 0..history.frames() {
            bar.inc(1);
            let rows = history.contact_rows(frame)?;
            let at_walls = history.contact_pairs(frame)?.iter().filter(|[_, j]| *j < 0).count();
            outline.starts.push(rows.start as i64);
            outline.counts.push(rows.len() as i64);
            outline.at_walls.push(at_walls as i64);
            outline.rows = outline.rows.max(rows.end);
        }
        bar.finish_and_clear();
        Ok(outline)
    }

    /// Where each frame begins if all have `length` rows.
    fn every(&self, length: usize) -> Vec<i64> {
        (0..self.frames).map(|frame| (frame * length) as i64).collect()
    }
}

/// Reads what there is to map; with a bar on a terminal unless `quiet`, here and below.
///
/// # Errors
/// [`PostError::Lacking`] for a history without frames, or one that was never closed and that viewers cannot open; those
/// of reading it.
pub fn read(history: &History, quiet: bool) -> Result<Report> {
    let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
    if history.open_ended() {
        return Err(lacking(
            "it was never closed, and viewers open closed files only: wait for the end of the run, or, if it was \
             killed, `dem-run resume FILE` goes on with it, and `dem-post info --repair FILE` closes it",
        ));
    }
    if history.frames() == 0 {
        return Err(lacking("it has no frame to view"));
    }
    let outline = Outline::read(history, quiet)?;
    let mut companions =
        vec![(NAMES[0], format!("{} grains as points: radius, mass, velocities, angles", outline.grains))];
    if outline.rows > 0 {
        let most = outline.counts.iter().max().unwrap_or(&0);
        companions.push((NAMES[1], format!("up to {most} contacts as lines: forces, gap, status")));
    }
    if outline.bonds > 0 {
        companions.push((NAMES[2], format!("{} bonds as lines: status, strength", outline.bonds)));
    }
    companions.push((NAMES[3], "positions and velocities of the grains for MDAnalysis".into()));
    let companions = companions.into_iter().map(|(name, shows)| Mapped { name, shows, bytes: 0 }).collect();
    let file = history.path().display().to_string();
    Ok(Report { file, bytes: history.length(), frames: outline.frames, companions, outline })
}

impl Report {
    /// The report as lines.
    pub fn table(&self) -> String {
        let sum: u64 = self.companions.iter().map(|companion| companion.bytes).sum();
        let mut lines = vec![("frames", self.frames.to_string())];
        lines.extend(self.companions.iter().map(|companion| (companion.name, companion.shows.clone())));
        if self.outline.rows == 0 {
            lines.push((NAMES[1], "not made: no frame has a contact".into()));
        }
        if self.outline.bonds == 0 {
            lines.push((NAMES[2], "not made: this scene has no bonds".into()));
        }
        let [small, large] = [sum, self.bytes].map(|bytes| bytes as f64 / 1e6);
        lines.push((
            "length",
            format!("{small:.2} MB, beside {large:.2} MB of the history, which must stay where it is"),
        ));
        facts(&lines)
    }
}

/// Writes the companions into `folder`, and their lengths into the report.
///
/// # Errors
/// [`PostError::Write`], [`PostError::Usage`] for a history that has the name of a companion, and those of reading it.
pub fn write(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let absolute = |path: &Path| path.canonicalize().map_err(|error| failed(path, &error));
    let source = absolute(history.path())?;
    let home = absolute(folder.path())?;
    let link = relative(&home, &source);
    let link = link.to_str().ok_or_else(|| failed(&source, &"its path is no Unicode text"))?;
    if NAMES.iter().any(|name| home.join(name) == source) {
        return Err(PostError::Usage(format!("{} would be overwritten: choose another folder with -o", report.file)));
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
