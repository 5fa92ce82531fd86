//! The `dem-post` command.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use dem_history::{CopyAs, History, HistoryError};
use dem_post::cli::{Cli, Command, Files};
use dem_post::output::{Folder, PostError, Result, Source, default_folder, escaped, print, source};
use dem_post::{chains, check, compare, cracks, frames, info, pack, report, strength, stress_strain, velocities, view};
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
            let found = check::read(&History::open_as_is(history)?, cli.quiet)?;
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
            let mut folder = folder(&history, &moments.files, "cracks")?;
            cracks::write(&history, &report, &moments.times, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Chains(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = chains::read(&history, &moments.times)?;
            let mut folder = folder(&history, &moments.files, "chains")?;
            chains::write(&history, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Velocities(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = velocities::read(&history, &moments.times)?;
            let mut folder = folder(&history, &moments.files, "velocities")?;
            velocities::write(&history, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Frames { files, draw, every, times } => {
            let history = History::open(&files.history)?;
            let report = frames::read(&history, *draw, *every, times)?;
            let mut folder = folder(&history, files, "frames")?;
            frames::write(&history, &report, &mut folder, cli.quiet)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Compare { a, b, tolerance, output, force } => {
            let (first, second) = (History::open(a)?, History::open(b)?);
            let report = compare::read(&first, &second, *tolerance)?;
            let path = output.clone().unwrap_or_else(|| default_folder(a, "-compare"));
            let mut folder = Folder::of(path, "compare", vec![source(&first)?, source(&second)?], *force)?;
            compare::write(&first, &report, &mut folder)?;
            report_on(cli, &report, || report.table(), Some(&folder))
        }
        Command::Report { moments, wall } => {
            let history = History::open(&moments.files.history)?;
            let found = report::read(&history, &moments.times, wall.as_deref(), cli.quiet)?;
            let mut folder = folder(&history, &moments.files, "report")?;
            report::write(&history, &found, &mut folder)?;
            report_on(cli, &found, || found.table(), Some(&folder))
        }
        Command::Strength { runs, against, measure, wall, output, force } => {
            let options = strength::Options { against: against.clone(), measure: *measure, wall: wall.clone() };
            let found = strength::read(runs, &options)?;
            let path = output.clone().unwrap_or_else(|| default_folder(&runs[0], "-strength"));
            let sources = runs.iter().map(|run| Source::new(run, None)).collect();
            let mut folder = Folder::of(path, "strength", sources, *force)?;
            strength::write(&found, &mut folder)?;
            report_on(cli, &found, || found.table(), Some(&folder))?;
            found.complete()
        }
        Command::View(files) => {
            let history = History::open(&files.history)?;
            let mut report = view::read(&history, cli.quiet)?;
            let mut folder = folder(&history, files, "view")?;
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
            let mut folder = folder(&history, files, "stress-strain")?;
            stress_strain::write(&report, &mut folder)?;
            report_on(cli, &report.summary, || report.table(), Some(&folder))
        }
    }
}

/// The folder for the results of an analysis of `history`.
fn folder(history: &History, files: &Files, command: &str) -> Result<Folder> {
    let suffix = if command == "frames" { "-frames" } else { "-post" };
    let path = files.output.clone().unwrap_or_else(|| default_folder(&files.history, suffix));
    Ok(Folder::of(path, command, vec![source(history)?], files.force)?)
}

/// Results on stdout, as a table or as JSON; the files that were written on stderr.
fn report_on(cli: &Cli, report: &impl Serialize, table: impl Fn() -> String, folder: Option<&Folder>) -> Result<()> {
    folder.map_or(Ok(()), Folder::finish)?;
    if cli.json {
        let json = serde_json::to_string_pretty(report).map_err(|error| PostError::Usage(error.to_string()))?;
        print(&(json + "\n"))?;
    } else {
        print(&table())?;
    }
    if !cli.quiet {
        let (written, removed) = folder.map_or((&[][..], 0), |folder| (folder.written(), folder.removed()));
        if removed > 0 {
            note(&format!("removed {removed} files of the history that the folder belonged to"));
        }
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
    let _ = writeln!(std::io::stderr(), "{}", escaped(line));
}
