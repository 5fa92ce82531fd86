//! The results of a sweep: a text summary, and a table for programs.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::Value;

use super::plan::describe;
use crate::error::RunError;
use crate::history::sweep::{Entry, Manifest, State, Store};
use crate::output::number;
use crate::scene::failure::STRAINS;

/// Columns of the table from the summary of a run: name, and path in the summary.
const MEASURED: [(&str, &str); 15] = [
    ("ending", "/ending"),
    ("steps", "/steps"),
    ("time", "/time"),
    ("grains", "/grains"),
    ("solid_fraction", "/solid_fraction"),
    ("bonds", "/bonds"),
    ("first_break", "/failure/first_break"),
    ("collapse_1e-4", "/failure/collapse/0"),
    ("collapse_1e-3", "/failure/collapse/1"),
    ("broken_5_percent", "/failure/broken_share"),
    ("load_wall", "/load_wall"),
    ("peak_load", "/peak_load"),
    ("peak_displacement", "/peak_displacement"),
    ("worst_residual", "/worst_residual"),
    ("missed_tolerance", "/missed_tolerance"),
];

/// Updates the states in the manifest and writes manifest and table of runs.
///
/// # Errors
/// A file cannot be written.
pub fn write(store: &Store, manifest: &mut Manifest) -> Result<(), RunError> {
    store.gather(manifest);
    store.write_manifest(manifest)?;
    let table = table(manifest, &|id| store.outcome(id)?.summary)?;
    Ok(store.write("runs.csv", &table)?)
}

/// `runs.csv`: a row for each run; missing values are empty.
///
/// # Errors
/// None known: the table is made in memory.
fn table(manifest: &Manifest, summary: &dyn Fn(&str) -> Option<Value>) -> Result<Vec<u8>, RunError> {
    let mut writer = csv::Writer::from_writer(vec![]);
    let fields = manifest.fields.iter().map(String::as_str);
    let measured = MEASURED.iter().map(|(name, _)| *name);
    let head = ["id"].into_iter().chain(fields).chain(["state"]).chain(measured);
    let tail = ["broken", "wall_time", "cpu_time", "history", "message"];
    writer.write_record(head.chain(tail))?;
    for run in &manifest.runs {
        let mut summary = if run.state == State::Left { None } else { summary(&run.id) }.unwrap_or_default();
        for k in 0..STRAINS.len() {
            // strain before any bond broke is no collapse
            if summary["failure"]["early"][k] == true {
                summary["failure"]["collapse"][k] = Value::Null;
            }
        }
        let broken = summary["broken"].as_array().map(|modes| modes.iter().filter_map(Value::as_u64).sum::<u64>());
        let time = |time: Option<f64>| time.map_or(String::new(), |time| time.to_string());
        let mut row = vec![run.id.clone()];
        row.extend(manifest.fields.iter().map(|field| run.values.get(field).map_or(String::new(), plain)));
        row.push(run.state.name().into());
        row.extend(MEASURED.iter().map(|(_, place)| summary.pointer(place).map_or(String::new(), plain)));
        row.extend([broken.map_or(String::new(), |n| n.to_string()), time(run.wall_time), time(run.cpu_time)]);
        row.extend([run.history.clone(), run.message.clone().unwrap_or_default()]);
        writer.write_record(row)?;
    }
    writer.into_inner().map_err(|error| csv::Error::from(error.into_error()).into())
}

/// A value as a cell: a text without its quotes, nothing for null.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// Progress of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    /// Its folder.
    pub folder: PathBuf,
    /// All its runs.
    #[serde(flatten)]
    pub manifest: Manifest,
}

impl Standing {
    /// Number of runs in a state.
    #[must_use]
    pub fn count(&self, state: State) -> usize {
        self.with(state).count()
    }

    fn with(&self, state: State) -> impl Iterator<Item = &Entry> {
        self.manifest.runs.iter().filter(move |run| run.state == state)
    }
}

/// Maximum number of failed runs that are reported individually.
const MOST_TOLD: usize = 20;

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Manifest { sweep, scene, runs, .. } = &self.manifest;
        writeln!(f, "sweep    {sweep}: {} runs of {scene}", runs.len())?;
        for state in [State::Done, State::Failed, State::Running, State::Left] {
            let count = self.count(state);
            if count > 0 || state == State::Done {
                writeln!(f, "{:<7}  {count}", state.name())?;
            }
        }
        let cpu_time: f64 = runs.iter().filter_map(|run| run.cpu_time).sum();
        writeln!(f, "CPU time {} s", number(cpu_time))?;
        writeln!(f, "table    {}", self.folder.join("runs.csv").display())?;
        write!(f, "runs     {}", self.folder.join("runs").display())?;
        let failed = self.count(State::Failed);
        if failed == 0 {
            return Ok(());
        }
        write!(f, "\n\nfailed")?;
        for run in self.with(State::Failed).take(MOST_TOLD) {
            let why = run.message.as_deref().unwrap_or_default().lines().next().unwrap_or_default();
            write!(f, "\n  {}  {}: {why}", run.id, describe(&run.values))?;
        }
        if failed > MOST_TOLD {
            write!(f, "\n… and {} more: see runs.csv", failed - MOST_TOLD)?;
        }
        Ok(())
    }
}
