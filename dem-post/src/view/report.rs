//! The possible companions of a history: the report, and how it is read from the history.

use dem_history::History;
use serde::Serialize;

use super::outline::Outline;
use crate::output::{PostError, Result, facts};

/// All companions.
pub(super) const NAMES: [&str; 4] = ["grains.vtkhdf", "contacts.vtkhdf", "bonds.vtkhdf", "grains.h5md"];

/// The companions of a history.
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
    pub(super) outline: Outline,
}

/// One companion.
#[derive(Clone, Debug, Serialize)]
pub struct Mapped {
    /// Its name in the folder.
    pub name: &'static str,
    /// Its content.
    pub shows: String,
    /// Its length, bytes; 0 before it is written.
    pub bytes: u64,
}

/// Finds the data to map; with a bar on a terminal unless `quiet`, here and below.
///
/// # Errors
/// [`PostError::Lacking`] for a history without frames, or one that was never closed and that
/// viewers cannot open; those of reading it.
pub fn read(history: &History, quiet: bool) -> Result<Report> {
    let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
    if history.open_ended() {
        return Err(lacking(
            "it is not closed, and viewers open only closed files: wait for the end of the run; if it was killed, \
             `dem-run resume FILE` continues it, and `dem-post info --repair FILE` closes the file",
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
            format!("{small:.2} MB, in addition to the history of {large:.2} MB, which must stay in its place"),
        ));
        facts(&lines)
    }
}
