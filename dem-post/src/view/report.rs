//! The possible files of a history for viewers: the report, and how it is read from the history.

use dem_history::History;
use serde::Serialize;

use super::Format;
use super::outline::Outline;
use crate::output::{PostError, Result, facts};

/// The companions of a history in each format: grains, contacts and bonds; for MDAnalysis.
pub(super) const NAMES: [&str; 4] = ["grains.vtkhdf", "contacts.vtkhdf", "bonds.vtkhdf", "grains.h5md"];
const LISTS: [&str; 3] = ["grains.pvd", "contacts.pvd", "bonds.pvd"];
const DUMPS: [&str; 3] = ["grains.dump", "contacts.dump", "bonds.dump"];

impl Format {
    /// The files of grains, contacts and bonds.
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Vtkhdf => [NAMES[0], NAMES[1], NAMES[2]],
            Self::Vtp => LISTS,
            Self::Lammps => DUMPS,
        }
    }
}

/// The files of a history for viewers.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The history.
    pub file: String,
    /// Its length, bytes.
    pub bytes: u64,
    /// Number of frames.
    pub frames: usize,
    /// The files, in the order in which they are written; of a format with a file a frame, the
    /// lists of the files.
    pub companions: Vec<Mapped>,
    /// Their format.
    #[serde(skip)]
    pub(super) format: Format,
    /// Numbers of each kind and frame.
    #[serde(skip)]
    pub(super) outline: Outline,
}

/// One file.
#[derive(Clone, Debug, Serialize)]
pub struct Mapped {
    /// Its name in the folder.
    pub name: &'static str,
    /// Its content.
    pub shows: String,
    /// Its length, with the files that it lists, bytes; 0 before it is written.
    pub bytes: u64,
}

/// Finds the data to map; with a bar on a terminal unless `quiet`, here and below.
///
/// # Errors
/// [`PostError::Lacking`] for a history without frames, and for companions of one that was never
/// closed and that viewers cannot open; those of reading it.
pub fn read(history: &History, format: Format, quiet: bool) -> Result<Report> {
    let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
    if history.open_ended() && format == Format::Vtkhdf {
        return Err(lacking(
            "it is not closed, and viewers open only closed files: wait for the end of the run; if it was killed, \
             `dem-run resume FILE` continues it, and `dem-post info --repair FILE` closes the file; --format vtp and lammps need no closed file",
        ));
    }
    if history.frames() == 0 {
        return Err(lacking("it has no frame to view"));
    }
    let outline = Outline::read(history, quiet)?;
    let names = format.names();
    let mut companions =
        vec![(names[0], format!("{} grains as points: radius, mass, velocities, angles", outline.grains))];
    if outline.rows > 0 {
        let most = outline.counts.iter().max().unwrap_or(&0);
        let what = if format == Format::Lammps { "pairs, without those with walls" } else { "lines" };
        companions.push((names[1], format!("up to {most} contacts as {what}: forces, gap, status")));
    }
    if outline.bonds > 0 {
        let what = if format == Format::Lammps { "pairs while they hold: strength" } else { "lines: status, strength" };
        companions.push((names[2], format!("{} bonds as {what}", outline.bonds)));
    }
    if format == Format::Vtkhdf {
        companions.push((NAMES[3], "positions and velocities of the grains for MDAnalysis".into()));
    }
    let companions = companions.into_iter().map(|(name, shows)| Mapped { name, shows, bytes: 0 }).collect();
    let file = history.path().display().to_string();
    Ok(Report { file, bytes: history.length(), frames: outline.frames, companions, format, outline })
}

impl Report {
    /// The report as lines.
    pub fn table(&self) -> String {
        let sum: u64 = self.companions.iter().map(|companion| companion.bytes).sum();
        let mut lines = vec![("frames", self.frames.to_string())];
        lines.extend(self.companions.iter().map(|companion| (companion.name, companion.shows.clone())));
        if self.outline.rows == 0 {
            lines.push((self.format.names()[1], "not made: no frame has a contact".into()));
        }
        if self.outline.bonds == 0 {
            lines.push((self.format.names()[2], "not made: this scene has no bonds".into()));
        }
        let [small, large] = [sum, self.bytes].map(|bytes| bytes as f64 / 1e6);
        let beside = match self.format {
            Format::Vtkhdf => format!("in addition to the history of {large:.2} MB, which must stay in its place"),
            _ => format!("copies of the history of {large:.2} MB"),
        };
        lines.push(("length", format!("{small:.2} MB, {beside}")));
        facts(&lines)
    }
}
