//! What each run of a sweep did.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use dem_drawing::thinned;
use dem_history::History;
use dem_history::sweep::{Entry, Manifest, State, Store};
use serde::Serialize;
use serde_json::Value;

use crate::output::{PostError, Result, progress};
use crate::report::solver;
use crate::strength::Measure;
use crate::strength::runs::{Course, unreadable};

/// Points of the curves of all runs together, and the least number for a run.
const POINTS: usize = 12_000;
const LEAST_POINTS: usize = 60;

/// A run.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// Its number, as in the manifest.
    pub id: String,
    /// The values of the varied fields.
    pub values: BTreeMap<String, Value>,
    /// Its state.
    pub state: State,
    /// Why it ended, as in its summary; `None` for a run that is not done.
    pub ending: Option<String>,
    /// Why it failed, in a line.
    pub message: Option<String>,
    /// Exit code of a run that failed.
    pub exit_code: Option<i32>,
    /// Its history; of a failed run, that up to the failure.
    pub history: Option<PathBuf>,
    /// Load at the first break, N.
    pub first_break: Option<f64>,
    /// Load with 5 % of the bonds broken, N.
    pub broken_5_percent: Option<f64>,
    /// Collapse load, N; `None` where the strain is solver error.
    pub collapse: Option<f64>,
    /// Time of the collapse, s.
    #[serde(skip)]
    pub collapse_time: Option<f64>,
    /// Peak load, N.
    pub peak: Option<f64>,
    /// Greatest load, N.
    pub greatest_load: Option<f64>,
    /// Bonds broken at its end.
    pub bonds_broken: Option<usize>,
    /// Bonds.
    pub bonds: usize,
    /// Steps, and those whose residual missed the tolerance.
    pub steps: usize,
    /// See `steps`.
    pub missed_tolerance: Option<usize>,
    /// Processor time, s.
    pub cpu_time: Option<f64>,
    /// Why its load is not known.
    pub no_load: Option<String>,
    /// Its scene, JSON; empty without a history.
    #[serde(skip)]
    pub scene: String,
    /// Load (N) over the magnitude of the axial strain of the grains; empty where not recorded.
    #[serde(skip)]
    pub curve: Vec<(f64, f64)>,
}

/// Reads the runs of a sweep; with a bar on a terminal unless `quiet`.
///
/// # Errors
/// As [`super::report::read`].
pub fn read(store: &Store, manifest: &Manifest, wall: Option<&str>, quiet: bool) -> Result<Vec<Run>> {
    let bar = progress(manifest.runs.len() as u64, quiet, "{bar:24} {pos} of {len} runs, {eta} left");
    let points = (POINTS / manifest.runs.len().max(1)).max(LEAST_POINTS);
    let read = |entry: &Entry| {
        let run = run(store, entry, wall, points);
        bar.inc(1);
        run
    };
    let runs = manifest.runs.iter().map(read).collect();
    bar.finish_and_clear();
    runs
}

/// A run; its curve has at most `points` points.
fn run(store: &Store, entry: &Entry, wall: Option<&str>, points: usize) -> Result<Run> {
    let outcome = store.outcome(&entry.id).filter(|outcome| outcome.digest == entry.digest);
    let summary = outcome.as_ref().and_then(|outcome| outcome.summary.as_ref());
    let message = entry.message.as_deref().and_then(|message| message.lines().next());
    let mut run = Run {
        id: entry.id.clone(),
        values: entry.values.clone(),
        state: entry.state,
        ending: summary.and_then(|summary| summary["ending"].as_str()).map(String::from),
        message: message.map(String::from),
        exit_code: outcome.as_ref().and_then(|outcome| outcome.exit_code).filter(|_| entry.state == State::Failed),
        history: None,
        first_break: None,
        broken_5_percent: None,
        collapse: None,
        collapse_time: None,
        peak: None,
        greatest_load: None,
        bonds_broken: None,
        bonds: 0,
        steps: 0,
        missed_tolerance: None,
        cpu_time: entry.cpu_time,
        no_load: None,
        scene: String::new(),
        curve: vec![],
    };
    let path = match entry.state {
        State::Done | State::Failed => store.folder().join(&entry.history),
        State::Left | State::Running => return Ok(run),
    };
    match History::open(&path) {
        Ok(history) => run.read(&history, &path, wall, points)?,
        // a run may fail before its first frame
        Err(_) if entry.state == State::Failed => {}
        Err(error) => {
            (run.state, run.ending, run.message) = (State::Failed, None, Some(unreadable(&path, &error)));
        }
    }
    Ok(run)
}

impl Run {
    fn read(&mut self, history: &History, path: &Path, wall: Option<&str>, points: usize) -> Result<()> {
        let accuracy = solver::read(history)?;
        self.history = Some(path.into());
        self.scene = history.parameters()?.scene;
        (self.bonds, self.steps) = (history.bonds()?.len(), accuracy.steps);
        self.missed_tolerance = accuracy.missed;
        self.cpu_time = self.cpu_time.or(accuracy.cpu_time);
        self.bonds_broken = (self.bonds > 0).then_some(history.ruptures()?.len());
        let course = match Course::read(history, wall) {
            Ok(course) => course,
            Err(PostError::Lacking { what, .. }) => {
                self.no_load = Some(what);
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        // the row of the failure by a measure
        let at = |measure| match course.failure(history, measure) {
            Ok(found) => Ok(found.ok()),
            Err(PostError::Lacking { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        let load = |row: Option<usize>| row.and_then(|row| course.load.get(row)).copied();
        self.first_break = load(at(Measure::FirstBreak)?);
        self.broken_5_percent = load(at(Measure::Broken)?);
        let collapse = at(Measure::Collapse)?;
        (self.collapse, self.collapse_time) = (load(collapse), collapse.map(|row| course.time[row]));
        self.peak = load(at(Measure::Peak)?);
        self.greatest_load = course.load.iter().copied().reduce(f64::max);
        let curve: Vec<(f64, f64)> =
            course.strain.iter().map(|strain| strain.abs()).zip(course.load.iter().copied()).collect();
        self.curve = thinned(&curve, points).into_iter().map(|k| curve[k]).collect();
        Ok(())
    }
}

/// The values of a field: by size if all are numbers, else in the order of the runs.
pub fn values<'a>(runs: &[&'a Run], field: &str) -> Vec<&'a Value> {
    let mut found: Vec<&Value> = vec![];
    for value in runs.iter().filter_map(|run| run.values.get(field)) {
        if !found.iter().any(|other| same(other, value)) {
            found.push(value);
        }
    }
    if found.iter().all(|value| value.is_number()) {
        found.sort_by(|a, b| a.as_f64().unwrap_or(0.0).total_cmp(&b.as_f64().unwrap_or(0.0)));
    }
    found
}

/// Whether two values are the same: 1 and 1.0 are.
pub fn same(a: &Value, b: &Value) -> bool {
    a == b || a.as_f64().zip(b.as_f64()).is_some_and(|(a, b)| a == b)
}
