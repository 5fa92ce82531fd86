//! The folder of a sweep: the planned runs and the outcome of each.
//!
//! ```text
//! manifest.json        every run: its values, its digest, its state when it was last gathered
//! runs.csv             the same as a table, with the numbers of each run's summary
//! runs/0001.json       the scene of a run; locked while it is being run
//! runs/0001.h5         its complete history
//! runs/0001.part.h5    its history while it is written
//! runs/0001.failed.h5  its history up to the failure
//! runs/0001.state.json its outcome
//! packings/            random samples, each packed once for all runs that have it
//! ```
//!
//! The state files alone record outcomes. Each has one writer, the process that holds the lock of
//! the run. The manifest and the table are compiled from the state files, so simultaneous tasks
//! never write the same file.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use dem_output::{lock, replace};

use crate::reader::History;

/// A file in the folder of a sweep that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The file is not a manifest, or has another format.
    #[error("{}: the manifest cannot be read: {why}", .path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The operating system refused.
    #[error("{} {doing}: {source}", .path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What failed, as in "cannot be written".
        doing: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A state cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// The result of reading or writing in the folder of a sweep.
pub type Result<T> = std::result::Result<T, SweepError>;

/// The format of the manifest.
const FORMAT: u32 = 1;

/// Every run of a sweep, planned and done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Format of this file.
    pub format: u32,
    /// Version of the program.
    pub program: String,
    /// The sweep file's name.
    pub sweep: String,
    /// The sweep's title, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// The base scene's name.
    pub scene: String,
    /// Fields that are varied, in the order of the sweep.
    pub fields: Vec<String>,
    /// The runs.
    pub runs: Vec<Entry>,
}

/// A run in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Its number with zeros in front, as 0003: the name of its files.
    pub id: String,
    /// Its values.
    pub values: BTreeMap<String, Value>,
    /// Digest of its scene.
    pub digest: String,
    /// Path of its history relative to the folder of the sweep, where it will be once the run is
    /// done; of a failed run, that up to the failure, empty where there is none.
    pub history: String,
    /// State of the run.
    pub state: State,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// Duration by the clock (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_time: Option<f64>,
    /// Processor time (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_time: Option<f64>,
}

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Not started.
    Left,
    /// Running.
    Running,
    /// Its history is complete.
    Done,
    /// It ended with an error.
    Failed,
}

impl State {
    /// The ending of the history of such a run.
    #[must_use]
    pub fn ending(self) -> &'static str {
        if self == Self::Failed { ".failed.h5" } else { ".h5" }
    }

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
        }
    }
}

/// Outcome of a run: the content of its state file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The scene that was run.
    pub digest: String,
    /// Done or failed.
    pub state: State,
    /// Exit code of the run; none if a signal ended it.
    pub exit_code: Option<i32>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// Duration by the clock (s).
    pub wall_time: f64,
    /// The summary that the run printed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub summary: Option<Value>,
}

impl Outcome {
    /// Whether a retry would fail again: no convergence, or a sample that cannot be made.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.state == State::Failed && matches!(self.exit_code, Some(2 | 3))
    }

    /// Processor time (s), where there is a summary.
    #[must_use]
    pub fn cpu_time(&self) -> Option<f64> {
        self.summary.as_ref()?.get("cpu_time")?.as_f64()
    }
}

/// The folder of a sweep.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// The folder, which need not exist yet.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// Its path.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The path of a file of a run, by its ending.
    #[must_use]
    pub fn path(&self, id: &str, ending: &str) -> PathBuf {
        self.folder.join("runs").join(format!("{id}{ending}"))
    }

    /// The folder of the packings that the runs share; there only if a run has a random sample.
    #[must_use]
    pub fn packings(&self) -> PathBuf {
        self.folder.join("packings")
    }

    /// The manifest, if there is one.
    ///
    /// # Errors
    /// The manifest cannot be read, or another program wrote it.
    pub fn manifest(&self) -> Result<Option<Manifest>> {
        let path = self.folder.join("manifest.json");
        let failed = |why: String| SweepError::Manifest { path: path.clone(), why };
        match fs::read(&path) {
            Ok(bytes) => {
                let manifest: Manifest = serde_json::from_slice(&bytes).map_err(|e| failed(e.to_string()))?;
                match manifest.format {
                    FORMAT => Ok(Some(manifest)),
                    other => Err(failed(format!("its format is {other}, but this program reads {FORMAT}"))),
                }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(error.to_string())),
        }
    }

    /// Outcome of a run; none if the run has not ended or its state file cannot be read.
    #[must_use]
    pub fn outcome(&self, id: &str) -> Option<Outcome> {
        serde_json::from_slice(&fs::read(self.path(id, ".state.json")).ok()?).ok()
    }

    /// Writes the outcome of a run.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record(&self, id: &str, outcome: &Outcome) -> Result<()> {
        write_json(&self.path(id, ".state.json"), outcome)
    }

    /// Whether the history of a run exists and is complete.
    #[must_use]
    pub fn is_complete(&self, id: &str) -> bool {
        History::open(&self.path(id, ".h5")).is_ok_and(|history| history.frames() > 0 && !history.open_ended())
    }

    /// The lock of a run; none while another process holds it. The lock is released when its
    /// process ends, also by a crash.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn claim(&self, id: &str) -> Result<Option<File>> {
        let path = self.path(id, ".json");
        let failed = |source| SweepError::File { path: path.clone(), doing: "cannot be locked", source };
        let file = lock::open(&path).map_err(failed)?;
        // `gather` takes a shared lock for a moment; on a file system without locks the scheduler
        // must start each run only once
        for _ in 0..10 {
            if lock::try_lock(&file).map_err(failed)? {
                return Ok(Some(file));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(None)
    }

    fn is_claimed(&self, id: &str) -> bool {
        let file = File::open(self.path(id, ".json"));
        file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Updates the states in the manifest.
    pub fn gather(&self, manifest: &mut Manifest) {
        for run in &mut manifest.runs {
            let outcome = self.outcome(&run.id).filter(|outcome| outcome.digest == run.digest);
            run.state = match &outcome {
                // a failed run may be on its second attempt
                None | Some(Outcome { state: State::Failed, .. }) if self.is_claimed(&run.id) => State::Running,
                None => State::Left,
                Some(outcome) => outcome.state,
            };
            run.history = match run.state {
                State::Failed if !self.path(&run.id, ".failed.h5").exists() => String::new(),
                state => history(&run.id, state),
            };
            run.wall_time = outcome.as_ref().map(|outcome| outcome.wall_time);
            run.cpu_time = outcome.as_ref().and_then(Outcome::cpu_time);
            run.message = outcome.and_then(|outcome| outcome.message);
        }
    }

    /// Writes the manifest.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<()> {
        write_json(&self.folder.join("manifest.json"), manifest)
    }

    /// Writes a file in the folder atomically: a reader, also after a crash, finds the old content
    /// or the new one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        write(&self.folder.join(name), content)
    }

    /// Creates the folder and its subfolder `runs`.
    ///
    /// # Errors
    /// They cannot be created.
    pub fn create(&self) -> Result<()> {
        let runs = self.folder.join("runs");
        fs::create_dir_all(&runs).map_err(|source| SweepError::File { path: runs, doing: "cannot be created", source })
    }

    /// Deletes all files of a run.
    pub fn delete(&self, id: &str) {
        for ending in [".state.json", ".h5", ".failed.h5", ".part.h5", ".log", ".json"] {
            // most of them do not exist
            let _ = fs::remove_file(self.path(id, ending));
        }
    }
}

impl Manifest {
    /// A manifest without runs.
    #[must_use]
    pub fn new(sweep: &Path, scene: &Path, fields: Vec<String>) -> Self {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let program = format!("dem-run {}", env!("CARGO_PKG_VERSION"));
        Self { format: FORMAT, program, sweep: name(sweep), scene: name(scene), title: None, fields, runs: vec![] }
    }

    /// The run of this number, with or without zeros in front.
    #[must_use]
    pub fn run(&self, id: &str) -> Option<&Entry> {
        let number = |id: &str| id.parse::<u64>().ok();
        self.runs.iter().find(|run| run.id == id || (number(id).is_some() && number(&run.id) == number(id)))
    }
}

impl Entry {
    /// A run not yet started.
    #[must_use]
    pub fn new(id: String, values: BTreeMap<String, Value>, digest: String) -> Self {
        let history = history(&id, State::Left);
        Self { id, values, digest, history, state: State::Left, message: None, wall_time: None, cpu_time: None }
    }
}

/// Path of the history of a run relative to the folder of the sweep.
fn history(id: &str, state: State) -> String {
    format!("runs/{id}{}", state.ending())
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    write(path, format!("{}\n", serde_json::to_string_pretty(value)?).as_bytes())
}

fn write(path: &Path, content: &[u8]) -> Result<()> {
    let failed = |source| SweepError::File { path: path.into(), doing: "cannot be written", source };
    replace::write(path, content).map_err(failed)
}
