//! The report of a sweep, and how it is read from its folder.

use std::path::{Path, PathBuf};

use dem_history::sweep::{Manifest, State, Store};
use serde::Serialize;

use super::runs::{self, Run};
use super::table::run_rows;
use crate::options::results;
use crate::output::{Folder, PostError, Result, Source, Text, counted, default_folder, facts, quantity};
use crate::strength::runs::manifest;
use crate::strength::scenes::varied;
use crate::{envelope, strength};

/// A sweep: its folder, and its runs as they stand.
pub struct Sweep {
    /// Its folder.
    pub store: Store,
    /// Its runs.
    pub manifest: Manifest,
}

/// Options of the analysis.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What counts as the strength, and over which field.
    pub strength: strength::Options,
    /// Whether a progress bar is left out.
    pub quiet: bool,
}

/// Content of the page.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The file of the sweep.
    pub sweep: String,
    /// Its base scene.
    pub scene: String,
    /// The fields that are varied.
    pub fields: Vec<String>,
    /// The runs.
    pub runs: Vec<Run>,
    /// The strength over a field; `None` where `no_strength` gives the reason.
    pub strength: Option<strength::Report>,
    /// Why there is no strength over a field.
    pub no_strength: Option<String>,
    /// The failure envelope; `None` unless the runs differ only in the loads of walls.
    pub envelope: Option<envelope::Report>,
}

impl Sweep {
    /// Reads the manifest of a sweep, and how its runs stand.
    ///
    /// # Errors
    /// [`PostError::Usage`] for a folder without a manifest; [`PostError::Sweep`] for a manifest
    /// that cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let store = Store::new(folder.into());
        let manifest = manifest(&store, "a history")?;
        Ok(Self { store, manifest })
    }

    /// The folder for the page: the requested one, or that named after the sweep.
    ///
    /// # Errors
    /// [`PostError::Write`].
    pub fn folder(&self, output: Option<&Path>, force: bool) -> Result<Folder> {
        let folder = self.store.folder();
        let path = output.map_or_else(|| default_folder(folder, "-report"), PathBuf::from);
        results(path, "report", vec![Source::new(folder, None)], force)
    }
}

/// Reads the content of the page.
///
/// # Errors
/// [`PostError::Usage`] for a wall that is not driven, and where several walls are driven and none
/// is chosen; those of reading histories.
pub fn read(sweep: &Sweep, options: &Options) -> Result<Report> {
    let Sweep { store, manifest } = sweep;
    let runs = runs::read(store, manifest, options.strength.wall.as_deref(), options.quiet)?;
    let folder = [store.folder().to_path_buf()];
    let (strength, no_strength) = match strength::read(&folder, &options.strength) {
        Ok(found) => (Some(found), None),
        Err(PostError::Usage(why)) => (None, Some(why)),
        Err(PostError::Lacking { path, what }) => (None, Some(format!("{}: {what}", path.display()))),
        Err(error) => return Err(error),
    };
    Ok(Report {
        sweep: manifest.sweep.clone(),
        scene: manifest.scene.clone(),
        fields: manifest.fields.clone(),
        envelope: envelope_of(&runs, &folder, &options.strength)?,
        runs,
        strength,
        no_strength,
    })
}

/// The envelope of runs that differ only in the loads of walls, if their circles have one: a line
/// through circles of different materials would mean nothing.
fn envelope_of(runs: &[Run], folder: &[PathBuf], options: &strength::Options) -> Result<Option<envelope::Report>> {
    let done = runs.iter().filter(|run| run.state == State::Done);
    let scenes: Vec<(String, String)> = done.map(|run| (run.id.clone(), run.scene.clone())).collect();
    let loads = |name: &String| name.split('.').any(|part| part == "walls");
    if scenes.is_empty() || !varied(&scenes)?.iter().all(loads) {
        return Ok(None);
    }
    match envelope::read(folder, options.measure, options.wall.as_deref()) {
        Ok(found) => Ok(Some(found).filter(|found| found.envelope.is_some())),
        // the section on the strength gives the reason
        Err(PostError::Usage(_) | PostError::Lacking { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

impl Report {
    /// Number of runs in a state.
    pub fn count(&self, state: State) -> usize {
        self.runs.iter().filter(|run| run.state == state).count()
    }

    /// The page in a few lines, and the runs as a table.
    pub fn table(&self) -> String {
        let states = [State::Done, State::Failed, State::Running, State::Left].map(|state| (self.count(state), state));
        let states = states.iter().filter(|(count, _)| *count > 0);
        let states: Vec<String> = states.map(|(count, state)| format!("{count} {}", state.name())).collect();
        let mut lines = vec![
            ("sweep", format!("{}: {} of {}", self.sweep, counted(self.runs.len(), "run"), self.scene)),
            ("runs", states.join(", ")),
            ("processor time", quantity(Some(self.cpu_time()), "s")),
        ];
        if let Some((strength, line)) = self.strength.as_ref().and_then(|s| s.line.as_ref().map(|line| (s, line))) {
            lines.push((strength.measure.title(), format!("{} over {}", strength.equation(line), strength.field)));
        }
        lines.extend(self.no_strength.iter().map(|why| ("no strength", why.clone())));
        let (head, rows) = run_rows(&self.fields, &self.runs);
        let mut table = Text::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        rows.into_iter().for_each(|row| table.row(row));
        facts(&lines) + "\n" + &table.lines()
    }

    /// Processor time of all runs, s.
    fn cpu_time(&self) -> f64 {
        self.runs.iter().filter_map(|run| run.cpu_time).sum()
    }
}
