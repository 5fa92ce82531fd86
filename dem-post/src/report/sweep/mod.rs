//! A sweep on one page: how its runs ended, strength and failure envelope, the curves of all runs
//! on one chart, and a picture of each run.
//!
//! What a run did is read from its history: of a failed run, from that up to the failure.

use super::page::{self, Page};
use crate::output::{Folder, Result};
pub use report::{Options, Report, Sweep, read};

mod pictures;
pub mod report;
pub mod runs;
mod sections;
mod table;

/// Writes `report.html`.
///
/// # Errors
/// [`crate::output::PostError::Write`], and those of reading histories.
pub fn write(sweep: &Sweep, report: &Report, folder: &mut Folder) -> Result<()> {
    let sections = sections::all(report, folder.path())?;
    let name = || sweep.store.folder().file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let first = report.runs.iter().find(|run| !run.scene.is_empty());
    let page = Page {
        step: None,
        title: sweep.manifest.title.clone().unwrap_or_else(name),
        sections,
        scene: first.map_or_else(String::new, |run| page::pretty(&run.scene)),
        scene_of: first.map_or_else(|| "No run has one yet.".into(), |run| format!("That of run {}.", run.id)),
    };
    Ok(folder.write("report.html", page.render()?.as_bytes())?)
}
