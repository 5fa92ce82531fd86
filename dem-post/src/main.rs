//! The `dem-post` command.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use dem_post::cli::{Cli, Command, Files};
use dem_post::output::{Folder, PostError, Result, default_folder, print};
use dem_post::{chains, check, compare, cracks, frames, info, pack, report, strength, stress_strain, velocities, view};
use dem_run::history::{CopyAs, History, HistoryError};
use serde::Serialize;

/// Files beyond which not all are named.
const MANY: usize = 24;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            note(&format!("dem-post: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Command::Info { history, repair: true, .. } => {
            let report = pack::write(&History::open(history)?, history, CopyAs::Plain, cli.quiet)?;
            report_on(cli, &report, || report.table(), None)
        }
        Command::Info { history, check: true, .. } => {
            let found = check::read(&History::open(history)?, cli.quiet)?;
            report_on(cli, &found, || found.table(), None)?;
            found.verdict()
        }
        Command::Info { history, .. } => {
            let report = info::read(&History::open(history)?)?;
            report_on(cli, &report, || report.table(), None)
        }
        Command::Cracks(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = cracks::read(&history, cli.quiet)?;
            let mut folder = folder(&moments.files)?;
            cracks::write(&history, &report, &moments.times, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Chains(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = chains::read(&history, &moments.times)?;
            let mut folder = folder(&moments.files)?;
            chains::write(&history, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Velocities(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = velocities::read(&history, &moments.times)?;
            let mut folder = folder(&moments.files)?;
            velocities::write(&history, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Frames { files, draw, every, times } => {
            let history = History::open(&files.history)?;
            let report = frames::read(&history, *draw, *every, times)?;
            let path = files.output.clone().unwrap_or_else(|| default_folder(&files.history, "-frames"));
            let mut folder = Folder::create(path)?;
            frames::write(&history, &report, &mut folder, cli.quiet)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Compare { a, b, tolerance, output } => {
            let first = History::open(a)?;
            let report = compare::read(&first, &History::open(b)?, *tolerance)?;
            let mut folder = Folder::create(output.clone().unwrap_or_else(|| default_folder(a, "-compare")))?;
            compare::write(&first, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Report { moments, wall } => {
            let history = History::open(&moments.files.history)?;
            let found = report::read(&history, &moments.times, wall.as_deref(), cli.quiet)?;
            let mut folder = folder(&moments.files)?;
            report::write(&history, &found, &mut folder)?;
            report_on(cli, &found, || found.table(), Some(&folder))
        }
        Command::Strength { runs, against, measure, wall, output } => {
            let options = strength::Options { against: against.clone(), measure: *measure, wall: wall.clone() };
            let found = strength::read(runs, &options)?;
            let path = output.clone().unwrap_or_else(|| default_folder(&runs[0], "-strength"));
            let mut folder = Folder::create(path)?;
            strength::write(&found, &mut folder)?;
            report_on(cli, &found, || found.table(), Some(&folder))?;
            found.complete()
        }
        Command::View(files) => {
            let history = History::open(&files.history)?;
            let mut report = view::read(&history, cli.quiet)?;
            let mut folder = folder(files)?;
            view::write(&history, &mut report, &mut folder, cli.quiet)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Pack { history, output, force } => {
            let to = output.as_ref().unwrap_or(history);
            if output.is_some() && to.exists() && !force {
                return Err(HistoryError::Exists { path: to.clone() }.into());
            }
            let report = pack::write(&History::open(history)?, to, CopyAs::Packed, cli.quiet)?;
            report_on(cli, &report, || report.table(), None)
        }
        Command::StressStrain { files, wall } => {
            let history = History::open(&files.history)?;
            let report = stress_strain::read(&history, wall.as_deref())?;
            let mut folder = folder(files)?;
            stress_strain::write(&report, &mut folder)?;
            report_on(cli, &report.summary, || report.table(), Some(&folder))
        }
    }
}

/// The folder for the results of an analysis.
fn folder(files: &Files) -> Result<Folder> {
    let path = files.output.clone().unwrap_or_else(|| default_folder(&files.history, "-post"));
    Ok(Folder::create(path)?)
}

/// Results on stdout, as a table or as JSON; the files that were written on stderr.
fn report_on(cli: &Cli, report: &impl Serialize, table: impl Fn() -> String, folder: Option<&Folder>) -> Result<()> {
    if cli.json {
        let json = serde_json::to_string_pretty(report).map_err(|error| PostError::Usage(error.to_string()))?;
        print(&(json + "\n"))?;
    } else {
        print(&table())?;
    }
    if !cli.quiet {
        let written = folder.map_or(&[][..], Folder::written);
        // of a long series the first and the last say enough
        for (k, path) in written.iter().enumerate() {
            if written.len() <= MANY || k == 0 || k + 1 == written.len() {
                note(&format!("wrote {}", path.display()));
            } else if k == 1 {
                note(&format!("… {} more", written.len() - 2));
            }
        }
    }
    Ok(())
}

/// A line on stderr; one that nobody reads is no error.
fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
