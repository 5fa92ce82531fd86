//! Options common to several commands.

use std::path::PathBuf;

use clap::Args;
use dem_history::History;
use dem_output::command_line::seconds;

use crate::output::{Folder, Result, Source, WriteError, default_folder, source};

/// A history and the folder for what is made of it.
#[derive(Debug, Args)]
pub struct Files {
    /// The history.
    #[arg(value_name = "FILE.h5")]
    pub history: PathBuf,
    /// Folder for the results, created if missing [default: FILE-post, for `frames` FILE-frames, in
    /// the current folder].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Overwrite a results folder of another history: its results are removed.
    #[arg(long)]
    pub force: bool,
}

/// Several runs and the folder for what is made of them.
#[derive(Debug, Args)]
pub struct Runs {
    /// Histories, or the folder of a sweep.
    #[arg(value_name = "RUNS", required = true)]
    pub runs: Vec<PathBuf>,
    /// Folder for the results, created if missing [default: RUNS-strength, for `envelope`
    /// RUNS-envelope, in the current folder].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Overwrite a results folder of other histories: their results are removed.
    #[arg(long)]
    pub force: bool,
}

/// Files, and the moments to draw.
#[derive(Debug, Args)]
pub struct Moments {
    /// The files.
    #[command(flatten)]
    pub files: Files,
    /// Times of the maps (s), or steps of a run from break to break, as in 0.1,0.15 [default: first
    /// break, 5 % broken, end].
    #[arg(long, value_name = "T,…", value_delimiter = ',', value_parser = seconds)]
    pub times: Vec<f64>,
}

/// The load wall.
#[derive(Debug, Args)]
pub struct LoadWall {
    /// Name of the load wall [default: that of the scene, else the only driven wall].
    #[arg(long, value_name = "NAME")]
    wall: Option<String>,
}

impl LoadWall {
    /// The requested wall.
    pub fn name(&self) -> Option<&str> {
        self.wall.as_deref()
    }
}

/// The results folder `path`, as [`Folder::of`].
///
/// # Errors
/// [`crate::output::PostError::Write`], also where `path` is a file.
pub(crate) fn results(path: PathBuf, command: &str, sources: Vec<Source>, force: bool) -> Result<Folder> {
    if path.is_file() {
        return Err(WriteError { path, why: "it is a file, not a folder: choose another with -o".into() }.into());
    }
    Ok(Folder::of(path, command, sources, force)?)
}

impl Runs {
    /// The folder for the results of the command `command`: the requested one, or that named after
    /// the first run and the command.
    ///
    /// # Errors
    /// [`crate::output::PostError::Write`] for a folder that cannot be created, or that belongs to
    /// other histories.
    pub fn folder(&self, command: &str) -> Result<Option<Folder>> {
        let path = self.output.clone().unwrap_or_else(|| default_folder(&self.runs[0], &format!("-{command}")));
        let sources = self.runs.iter().map(|run| Source::new(run, None)).collect();
        Ok(Some(results(path, command, sources, self.force)?))
    }
}

impl Files {
    /// Opens the history.
    ///
    /// # Errors
    /// Those of [`History::open`].
    pub fn open(&self) -> Result<History> {
        Ok(History::open(&self.history)?)
    }

    /// The folder for the results of the command `command`: the requested one, or the default of
    /// the history.
    ///
    /// # Errors
    /// [`crate::output::PostError::Write`] for a folder that cannot be created, or that belongs to
    /// another history.
    pub fn folder(&self, history: &History, command: &str) -> Result<Option<Folder>> {
        // commands that write a file a frame have a folder of their own
        let suffix = match command {
            "frames" => "-frames",
            "view vtp" => "-vtp",
            _ => "-post",
        };
        let path = self.output.clone().unwrap_or_else(|| default_folder(&self.history, suffix));
        Ok(Some(results(path, command, vec![source(history)?], self.force)?))
    }
}
