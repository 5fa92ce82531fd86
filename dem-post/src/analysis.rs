//! The trait of analyses, and how their commands run.
//!
//! [`crate::ANALYSES`] lists all of them.

use std::io::Write;

use clap::{ArgMatches, Args};
use dem_output::Print;
use serde::Serialize;

use crate::output::{Folder, PostError, Result, counted, escaped, print};

/// Maximum number of files for which stderr names each file.
const MANY: usize = 24;

/// An analysis as a command of `dem-post`. The type holds its options; its doc comment is its text
/// in `--help`.
pub trait Analysis: Args {
    /// Name of the command.
    const NAME: &'static str;
    /// The input: one history or several.
    type Input;
    /// The result; `--json` prints it.
    type Report: Serialize;

    /// Opens the input.
    ///
    /// # Errors
    /// Those of opening it.
    fn open(&self) -> Result<Self::Input>;

    /// Reads the input into a report; with a progress bar on a terminal unless `quiet`.
    ///
    /// # Errors
    /// [`PostError::Lacking`], [`PostError::Usage`], and those of reading the input.
    fn read(&self, input: &Self::Input, quiet: bool) -> Result<Self::Report>;

    /// The report as text.
    fn table(report: &Self::Report) -> String;

    /// The folder for the files; `None` for an analysis that writes none.
    ///
    /// # Errors
    /// [`PostError::Write`].
    fn folder(&self, _input: &Self::Input) -> Result<Option<Folder>> {
        Ok(None)
    }

    /// Writes tables and drawings into the folder.
    ///
    /// # Errors
    /// [`PostError::Write`], and those of reading the input.
    fn write(&self, _: &Self::Input, _: &mut Self::Report, _: &mut Folder, _quiet: bool) -> Result<()> {
        Ok(())
    }

    /// The error, if any, that sets the exit code after the report has been printed.
    ///
    /// # Errors
    /// [`PostError::Incomplete`] or [`PostError::Unsound`].
    fn verdict(_: &Self::Report) -> Result<()> {
        Ok(())
    }
}

/// An entry of the list of analyses: its functions, without its type.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Name of the command.
    pub name: &'static str,
    /// The command with its options.
    pub command: fn() -> clap::Command,
    /// Runs the command with the options given.
    pub run: fn(&ArgMatches, Shown) -> Result<()>,
}

/// Format of the output.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// As JSON instead of a table.
    pub json: bool,
    /// Without anything on stderr but errors.
    pub quiet: bool,
    /// Size of the figures on paper.
    pub print: Option<Print>,
}

impl Entry {
    /// The entry of an analysis.
    pub const fn of<A: Analysis>() -> Self {
        Self { name: A::NAME, command: || A::augment_args(clap::Command::new(A::NAME)), run: run::<A> }
    }
}

fn run<A: Analysis>(options: &ArgMatches, shown: Shown) -> Result<()> {
    let options = A::from_arg_matches(options).unwrap_or_else(|error| error.exit());
    let input = options.open()?;
    let mut report = options.read(&input, shown.quiet)?;
    let mut folder = options.folder(&input)?;
    if let Some(folder) = &mut folder {
        shown.print.into_iter().for_each(|print| folder.print_at(print));
        options.write(&input, &mut report, folder, shown.quiet)?;
        folder.finish()?;
    }
    if shown.json {
        let json = serde_json::to_string_pretty(&report).map_err(|error| PostError::Usage(error.to_string()))?;
        print(&(json + "\n"))?;
    } else {
        print(&A::table(&report))?;
    }
    if let Some(folder) = folder.filter(|_| !shown.quiet) {
        name_files(&folder);
    }
    A::verdict(&report)
}

/// Names the files that were written, on stderr.
fn name_files(folder: &Folder) {
    if folder.removed() > 0 {
        note(&format!("removed {} of the history to which the folder belonged", counted(folder.removed(), "file")));
    }
    for (name, points) in folder.small() {
        note(&format!(
            "warning: {name}: letters of {points:.1} pt: choose fewer moments with --times, or a larger --width"
        ));
    }
    // for a long series stderr names only the first and the last file
    let written = folder.written();
    for (k, path) in written.iter().enumerate() {
        if written.len() <= MANY || k == 0 || k + 1 == written.len() {
            note(&format!("wrote {}", path.display()));
        } else if k == 1 {
            note(&format!("… {} more", written.len() - 2));
        }
    }
}

/// Prints a line on stderr; a closed stderr is no error.
pub fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", escaped(line));
}
