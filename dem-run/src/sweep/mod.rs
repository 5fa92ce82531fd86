//! `dem-run sweep`: one scene with many values; each run has its own process and history.
//!
//! ```text
//! sweep file ──plan──▶ scenes, all checked ──reconcile──▶ remaining runs
//!            ──work──▶ histories and states ──report──▶ manifest, table
//! ```

mod cluster;
pub mod model;
pub mod plan;
mod reconcile;
mod report;
mod work;

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::check::Check;
use crate::destination::folder_or_new;
use crate::error::RunError;
use crate::history::sweep::{Manifest, State, Store};
use crate::output::{facts, in_shell, print_line, print_result, size};
use crate::run::{Execution, handle_signals};
use plan::{Plan, describe};
use reconcile::reconcile;
use report::Standing;
use work::{Job, carry_out};

/// Options of `dem-run sweep`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepOptions {
    /// The sweep file.
    pub sweep: PathBuf,
    /// The folder for the results.
    pub folder: PathBuf,
    /// The action.
    pub mode: Mode,
    /// Number of simultaneous runs; if absent, as many as the machine has processors.
    pub jobs: Option<usize>,
    /// Whether runs that failed reproducibly are repeated.
    pub retry: bool,
    /// Whether results that are no longer part of the sweep may be discarded.
    pub overwrite: bool,
    /// How the command is carried out; each run has one thread.
    pub execution: Execution,
    /// Whether stdout is JSON.
    pub json: bool,
}

/// Action on a sweep.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Mode {
    /// All remaining runs are carried out.
    All,
    /// The sweep is checked, and nothing is written.
    Check,
    /// The manifest is written, and the files for other schedulers.
    Prepare,
    /// The states of the runs are gathered and printed.
    Status,
    /// One run is carried out, by its number.
    One(String),
}

/// Carries a sweep out, or one of its parts.
///
/// # Errors
/// [`RunError`]: a wrong sweep or scene, results that would be overwritten, files that cannot be
/// written, an interruption, [`RunError::Runs`] if runs failed. Earlier results are kept.
pub fn sweep(options: &SweepOptions) -> Result<(), RunError> {
    let store = Store::new(options.folder.clone());
    folder_or_new(store.folder())?;
    if options.mode == Mode::Status {
        return status(&store, options);
    }
    let plan = Plan::read(&options.sweep)?;
    match &options.mode {
        Mode::Check => Ok(print_result(&Checked::new(&plan, options)?, options.json)?),
        Mode::One(id) => one(&store, &plan, id, options),
        mode => {
            let mut manifest = reconcile(&store, &plan, options.overwrite)?;
            store.create()?;
            report::write(&store, &mut manifest)?;
            if *mode == Mode::Prepare {
                prepare(&store, manifest, options)
            } else {
                all(&store, &plan, manifest, options)
            }
        }
    }
}

/// Carries out all remaining runs.
fn all(store: &Store, plan: &Plan, mut manifest: Manifest, options: &SweepOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    let mut progress = options.execution.show();
    let runs = manifest.runs.clone();
    let left = |id: &str, digest: &str| match store.outcome(id).filter(|outcome| outcome.digest == digest) {
        Some(outcome) if outcome.state == State::Done => !store.is_complete(id),
        Some(outcome) => options.retry || !outcome.is_final(),
        None => true,
    };
    let jobs: Vec<Job<'_>> = (runs.iter())
        .filter(|run| left(&run.id, &run.digest))
        .filter_map(|run| Some(Job { id: &run.id, run: plan.run(&run.digest)? }))
        .collect();
    if jobs.len() < runs.len() && !options.execution.quiet {
        progress.note(&format!("{} of {} runs are left", jobs.len(), runs.len()));
    }
    let at_a_time = options.jobs.or_else(|| std::thread::available_parallelism().ok().map(usize::from)).unwrap_or(1);
    let carried = match jobs.is_empty() {
        true => Ok(()),
        false => {
            carry_out(store, &jobs, at_a_time, &interrupt, &mut progress, &mut || report::write(store, &mut manifest))
        }
    };
    // completed runs are reported, also after an error
    let written = report::write(store, &mut manifest);
    let failed = failures(store, &manifest);
    let standing = Standing { folder: options.folder.clone(), manifest };
    let printed = print_result(&standing, options.json);
    carried.and(written)?;
    if interrupt.requested() {
        return Err(RunError::Interrupted("finished runs are kept; the same command does the others"));
    }
    printed?;
    failed
}

/// Carries out one run of a prepared sweep; writes only the files of this run.
fn one(store: &Store, plan: &Plan, id: &str, options: &SweepOptions) -> Result<(), RunError> {
    let (sweep, folder) = (options.sweep.display(), store.folder().display());
    let Some(manifest) = store.manifest()? else {
        return Err(without_manifest(store, format!("dem-run sweep {sweep} -o {folder} --prepare makes it")));
    };
    let Some(entry) = manifest.run(id) else {
        let last = manifest.runs.last().map_or("none", |run| &run.id);
        return Err(RunError::Usage(format!("there is no run {id} in {folder}: the last is {last}")));
    };
    let Some(run) = plan.run(&entry.digest) else {
        let what = format!("run {} ({}) of {folder} is no longer in {sweep}", entry.id, describe(&entry.values));
        return Err(RunError::InputOutput(format!(
            "{what}: the sweep or its scene has changed since --prepare; repeat --prepare"
        )));
    };
    let interrupt = handle_signals()?;
    let job = Job { id: &entry.id, run };
    carry_out(store, &[job], 1, &interrupt, &mut options.execution.show(), &mut || Ok(()))?;
    if interrupt.requested() {
        return Err(RunError::Interrupted("the run is not done"));
    }
    match store.outcome(&entry.id).filter(|outcome| outcome.digest == entry.digest) {
        None => Err(RunError::InputOutput(format!("run {} is being run by another process", entry.id))),
        Some(outcome) if outcome.state == State::Failed => {
            let why = outcome.message.clone().unwrap_or_default();
            Err(RunError::Runs { code: exit_code(outcome.exit_code), message: format!("run {}: {why}", entry.id) })
        }
        Some(outcome) => match outcome.summary.filter(|_| options.json) {
            Some(summary) => Ok(crate::output::print_json(&summary)?),
            None => Ok(print_line(&format!("run {} is done: {folder}/{}", entry.id, entry.history))?),
        },
    }
}

/// Writes the files for other schedulers.
fn prepare(store: &Store, manifest: Manifest, options: &SweepOptions) -> Result<(), RunError> {
    let left = manifest.runs.iter().filter(|run| run.state != State::Done).count();
    if left > 0 {
        cluster::write(store, &options.sweep, &manifest)?;
    }
    let (folder, sweep) = (in_shell(store.folder()), in_shell(&options.sweep));
    let [slurm, snakefile] = ["slurm.sh", "Snakefile"].map(|name| in_shell(&store.folder().join(name)));
    let standing = Standing { folder: options.folder.clone(), manifest };
    if options.json || left == 0 {
        return Ok(print_result(&standing, options.json)?);
    }
    Ok(print_line(&format!(
        "{standing}\n\nrun it with one of\n  sbatch {slurm}\n  snakemake -s {snakefile} --cores 8 \
         --keep-going\n  dem-run sweep {sweep} -o {folder}\nprint its status with\n  dem-run sweep {sweep} -o {folder} \
         --status"
    ))?)
}

/// Gathers the states of all runs and prints them.
fn status(store: &Store, options: &SweepOptions) -> Result<(), RunError> {
    let Some(mut manifest) = store.manifest()? else {
        return Err(without_manifest(store, "the sweep was never started there".into()));
    };
    report::write(store, &mut manifest)?;
    Ok(print_result(&Standing { folder: options.folder.clone(), manifest }, options.json)?)
}

fn without_manifest(store: &Store, remedy: String) -> RunError {
    RunError::Unfit { path: store.folder().into(), state: "holds no manifest.json", remedy }
}

/// The exit code of the sweep for that of a failed run: 2 wrong scene, 3 no convergence, 4 all
/// others.
fn exit_code(code: Option<i32>) -> u8 {
    match code {
        Some(2) => 2,
        Some(3) => 3,
        _ => 4,
    }
}

/// The common error of all failed runs, with the largest of their exit codes, and of those that
/// other processes make.
fn failures(store: &Store, manifest: &Manifest) -> Result<(), RunError> {
    let runs = manifest.runs.len();
    let elsewhere = manifest.runs.iter().filter(|run| run.state == State::Running).count();
    let others = format!(
        "{elsewhere} of {runs} runs are being run by another process, for which this command does not wait: repeat it \
         when that has ended"
    );
    let failed: Vec<_> = manifest.runs.iter().filter(|run| run.state == State::Failed).collect();
    let code = failed.iter().map(|run| exit_code(store.outcome(&run.id).and_then(|outcome| outcome.exit_code))).max();
    let Some(code) = code else {
        return if elsewhere == 0 { Ok(()) } else { Err(RunError::Runs { code: 4, message: others }) };
    };
    let left = failed.iter().filter(|run| store.path(&run.id, ".failed.h5").is_file()).count();
    let left = match left {
        0 => "none had started its history; see runs/NNNN.log".to_string(),
        all if all == failed.len() => "their histories up to the failure are runs/NNNN.failed.h5".to_string(),
        some => format!("the histories of {some} of them up to the failure are runs/NNNN.failed.h5"),
    };
    let others = if elsewhere == 0 { String::new() } else { format!("\n{others}") };
    let message = format!("{} of {runs} runs failed; {left}; --retry runs them again{others}", failed.len());
    Err(RunError::Runs { code, message })
}

/// Preview of a sweep.
#[derive(Debug, Serialize)]
struct Checked {
    sweep: PathBuf,
    scene: PathBuf,
    runs: Vec<std::collections::BTreeMap<String, serde_json::Value>>,
    /// Steps of all runs.
    steps: u64,
    /// Size of all histories, roughly (bytes).
    file_bytes: u64,
    free_bytes: Option<u64>,
}

impl Checked {
    fn new(plan: &Plan, options: &SweepOptions) -> Result<Self, RunError> {
        let (mut steps, mut file_bytes, mut free_bytes) = (0, 0u64, None);
        for run in &plan.runs {
            let check = Check::new(&run.scene)?;
            steps += check.steps;
            file_bytes = file_bytes.saturating_add(check.file_bytes);
            free_bytes = check.free_bytes;
        }
        let runs = plan.runs.iter().map(|run| run.values.clone()).collect();
        Ok(Self { sweep: options.sweep.clone(), scene: plan.scene.clone(), runs, steps, file_bytes, free_bytes })
    }
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let run = |values: Option<&_>| values.map_or(String::new(), describe);
        let text = facts(&[
            ("scene", self.scene.display().to_string()),
            ("runs", self.runs.len().to_string()),
            ("the first", run(self.runs.first())),
            ("the last", run(self.runs.last())),
            ("steps", format!("{} in all, unless stop conditions end runs earlier", self.steps)),
            ("files", format!("about {} in all", size(self.file_bytes))),
            ("free disk", self.free_bytes.map_or("unknown".into(), size)),
        ]);
        f.write_str(text.trim_end())
    }
}
