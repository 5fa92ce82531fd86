//! Copies of a history that take its place: compressed, to be kept, or plain, of a file whose run was killed.

use std::path::Path;

use dem_history::{self as history, CopyAs, History};
use serde::Serialize;

use crate::output::{Result, facts, progress};

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The copy.
    pub file: String,
    /// Its frames, all that were complete.
    pub frames: usize,
    /// Length of the history before, bytes.
    pub before: u64,
    /// Length of the copy, bytes.
    pub after: u64,
}

impl Report {
    /// The report for people.
    pub fn table(&self) -> String {
        let megabytes = |bytes: u64| format!("{:.1} MB", bytes as f64 / 1e6);
        let share = 100.0 * self.after as f64 / self.before.max(1) as f64;
        facts(&[
            ("file", self.file.clone()),
            ("frames", format!("{}, the same to the bit", self.frames)),
            ("before", megabytes(self.before)),
            ("after", format!("{}, {share:.0} %", megabytes(self.after))),
        ])
    }
}

/// Copies `history` to `path`, its own place too, with a bar unless `quiet`.
///
/// # Errors
/// A history that is being written or damaged, a disk without room; `path` is then as it was.
pub fn write(history: &History, path: &Path, how: CopyAs, quiet: bool) -> Result<Report> {
    const STEPS: u64 = 1000;
    let bar = progress(STEPS, quiet, "{msg} {bar:40} {percent} %  {eta} left");
    bar.set_message(if how == CopyAs::Packed { "packing" } else { "copying" });
    let mut tell = |done: f64| {
        bar.set_position((done * STEPS as f64) as u64);
        true
    };
    let after = history::copy(history, path, how, &mut tell)?;
    bar.finish_and_clear();
    Ok(Report { file: path.display().to_string(), frames: history.frames(), before: history.length(), after })
}
