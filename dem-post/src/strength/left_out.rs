//! Runs without a result, in an analysis of several: because they did not fail or are not done.

use serde::Serialize;

use crate::output::{PostError, Result};

/// Maximum number of them that a table names.
const NAMED: usize = 12;
/// Maximum number of them that an error names.
const IN_ERROR: usize = 3;

/// A run without a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Its file.
    pub run: String,
    /// The reason.
    pub why: String,
}

impl LeftOut {
    fn line(&self) -> String {
        format!("{}: {}", self.run, self.why)
    }
}

/// The error where no run has a `load`, the name of that at failure.
pub(crate) fn none_failed(left_out: &[LeftOut], load: &str) -> PostError {
    let runs: Vec<String> = left_out.iter().take(IN_ERROR).map(LeftOut::line).collect();
    let runs = runs.join("; ");
    PostError::Usage(format!("no run has a {load}; choose another --measure, or load further; {runs}"))
}

/// Whether every run has a result, as `done` runs have.
///
/// # Errors
/// [`PostError::Incomplete`] where runs were left out.
pub(crate) fn complete(left_out: &[LeftOut], done: usize) -> Result<()> {
    let Some(first) = left_out.first() else { return Ok(()) };
    let (out, all) = (left_out.len(), left_out.len() + done);
    let such = first.line();
    Err(PostError::Incomplete(format!(
        "{out} of {all} runs are left out, such as {such}; the results are those of the others"
    )))
}

/// The number of runs with a result, and of those left out.
pub(crate) fn counted(done: usize, left_out: &[LeftOut]) -> String {
    let left = if left_out.is_empty() { String::new() } else { format!(", {} left out", left_out.len()) };
    format!("{done}{left}")
}

/// The lines below the tables: the runs left out, all of which `file` lists, and the notes; empty
/// without either.
pub(crate) fn remarks(left_out: &[LeftOut], file: &str, notes: &[String]) -> String {
    let named = left_out.iter().take(NAMED).map(|out| format!("left out: {}", out.line()));
    let more = left_out.len().saturating_sub(NAMED);
    let more = (more > 0).then(|| format!("left out: … and {more} more in {file}"));
    let lines: Vec<String> = named.chain(more).chain(notes.iter().map(|note| format!("note: {note}"))).collect();
    if lines.is_empty() { String::new() } else { format!("\n{}\n", lines.join("\n")) }
}
