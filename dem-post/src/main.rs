//! The `dem-post` command.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use dem_post::cli::{Cli, Command, Files};
use dem_post::output::{Folder, PostError, Result, default_folder, print};
use dem_post::{chains, cracks, info, stress_strain};
use dem_run::history::History;
use serde::Serialize;

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
        Command::Info { history } => {
            let report = info::read(&History::open(history)?)?;
            report_on(cli, &report, || report.table(), None)
        }
        Command::Cracks(moments) => {
            let history = History::open(&moments.files.history)?;
            let report = cracks::read(&history)?;
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
        for path in folder.map_or(&[][..], Folder::written) {
            note(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

/// A line on stderr; one that nobody reads is no error.
fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
