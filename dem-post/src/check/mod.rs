//! Check of a history against its layout: `dem-post info --check`.
//!
//! First every dataset is checked by name, type, shape and unit, then its content, block by block,
//! so that memory does not grow with the file. Later checks use only datasets that earlier checks
//! found sound: a dataset of another shape is reported once and not read.

use std::collections::BTreeMap;

use dem_history::History;

use crate::output::{Result, progress};
use checker::{Checker, MANY, Sizes};
pub use report::Report;

mod checker;
mod content;
pub mod report;
mod schema;

/// Checks a history; with a bar on a terminal unless `quiet`.
///
/// # Errors
/// Those of opening the file once more. Violations in the file are listed in the report.
pub fn read(history: &History, quiet: bool) -> Result<Report> {
    let file = history.reopened()?;
    let report = Report { file: history.path().display().to_string(), frames: history.frames(), ..Report::default() };
    let sizes = Sizes { d: history.dimension(), t: history.frames(), ..Sizes::default() };
    let bar = progress(0, quiet, "{bar:24} {percent} % checked, {eta} left");
    let resumable = history.checkpoint().is_ok_and(|checkpoint| checkpoint.is_some());
    let mut checker = Checker { file, sizes, resumable, report, sound: BTreeMap::new(), told: BTreeMap::new(), bar };
    schema::check(&mut checker);
    let numbers: usize = checker.sound.values().map(|[rows, width]| rows * width).sum();
    checker.bar.set_length(numbers as u64);
    content::check(&mut checker);
    checker.bar.finish_and_clear();
    checker.report.datasets = checker.sound.len();
    checker.report.more = checker.told.into_iter().filter(|(_, n)| *n > MANY).map(|(p, n)| (p, n - MANY)).collect();
    Ok(checker.report)
}
