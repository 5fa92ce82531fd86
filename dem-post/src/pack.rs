//! Copies that replace a history: compressed for archiving, or plain to repair the file of a killed
//! run.

use std::path::{Path, PathBuf};

use clap::Args;
use dem_history::{self as history, CopyAs, History, HistoryError};
use serde::Serialize;

use crate::analysis::Analysis;
use crate::output::{Result, facts, progress};

/// Compress a history: a copy with checksums replaces it, after a check that both are equal bit for
/// bit.
#[derive(Debug, Args)]
pub struct Command {
    /// The history.
    #[arg(value_name = "FILE.h5")]
    history: PathBuf,
    /// Write the copy to this file and leave the history unchanged.
    #[arg(short, long, value_name = "PACKED.h5")]
    output: Option<PathBuf>,
    /// Overwrite an existing PACKED.h5.
    #[arg(long)]
    force: bool,
}

impl Analysis for Command {
    const NAME: &'static str = "pack";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        if let Some(path) = self.output.as_ref().filter(|path| path.exists() && !self.force) {
            return Err(HistoryError::Exists { path: path.clone() }.into());
        }
        Ok(History::open(&self.history)?)
    }

    /// Makes the copy; there is nothing else to write.
    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        write(history, self.output.as_ref().unwrap_or(&self.history), CopyAs::Packed, quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }
}

/// The copy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The copy.
    pub file: String,
    /// Its frames: all complete frames of the history.
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
            ("frames", format!("{}, equal bit for bit", self.frames)),
            ("before", megabytes(self.before)),
            ("after", format!("{}, {share:.0} %", megabytes(self.after))),
        ])
    }
}

/// Copies `history` to `path`, which may be its own, with a bar unless `quiet`.
///
/// # Errors
/// The history is being written or is damaged, or the disk is full; the file at `path` is then
/// unchanged.
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
