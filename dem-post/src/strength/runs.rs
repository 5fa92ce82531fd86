//! The requested runs, and the strength of each.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use dem_history::sweep::{Manifest, State, Store};
use dem_history::{History, HistoryError, WallDrive};
use dem_scene::Load;
use dem_scene::failure::{BROKEN_SHARE, STRAINS};
use serde::Serialize;
use serde_json::Value;

use super::left_out::LeftOut;
use crate::collapse::{Bonding, Collapse, peak};
use crate::output::{PostError, Result, quantity};
use crate::stress_strain;

/// Definition of the strength of a run: the load at …
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// The first break of a bond.
    FirstBreak,
    /// The break with which 5 % of the bonds are broken.
    #[default]
    Broken,
    /// The last step before the strain of the sample exceeds 1e-4.
    Collapse,
    /// The greatest load, if the load falls by 5 % afterwards.
    Peak,
}

impl Measure {
    /// Name of the strength.
    pub fn title(self) -> &'static str {
        match self {
            Self::FirstBreak => "load at the first break",
            Self::Broken => "load with 5 % of bonds broken",
            Self::Collapse => "collapse load (strain 1e-4)",
            Self::Peak => "peak load",
        }
    }
}

/// A run as read from its history.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its file.
    pub path: PathBuf,
    /// Its scene, JSON.
    pub scene: String,
    /// Its strength; for a run that did not fail, the state it reached.
    pub strength: std::result::Result<Strength, String>,
    /// Radii of its grains and its bonds: equal in two runs of the same grains.
    pub grains: (Vec<f64>, Vec<[i32; 2]>),
}

/// The strength of a run, and when it was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strength {
    /// The load, N.
    pub load: f64,
    /// Its time, s.
    pub time: f64,
    /// The greatest load up to this time, N.
    pub greatest_before: f64,
}

/// The manifest of a sweep, with how its runs stand. Where the folder has none, the error asks for
/// the folder of a sweep, or for `other`.
///
/// # Errors
/// [`PostError::Usage`] for a folder without a manifest; [`PostError::Sweep`] for a manifest that
/// cannot be read.
pub fn manifest(store: &Store, other: &str) -> Result<Manifest> {
    let Some(mut manifest) = store.manifest()? else {
        let shown = store.folder().display();
        return Err(PostError::Usage(format!(
            "{shown} holds no manifest.json: give the folder of a `dem-run sweep`, or {other}"
        )));
    };
    store.gather(&mut manifest);
    Ok(manifest)
}

/// The histories that `paths` name: files, and the finished runs in folders of sweeps; and,
/// separately, the unfinished runs and those whose history cannot be read.
///
/// # Errors
/// [`PostError::Usage`] for no path, for a folder without a manifest, and where no run is done;
/// [`PostError::Sweep`] for a manifest that cannot be read.
pub fn histories(paths: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<LeftOut>)> {
    let (mut found, mut left_out) = (vec![], vec![]);
    for path in paths {
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        let store = Store::new(path.clone());
        for run in manifest(&store, "the histories")?.runs {
            if run.state == State::Done {
                let history = path.join(&run.history);
                match History::open(&history) {
                    Ok(_) => found.push(history),
                    Err(error) => left_out.push(LeftOut { run: name(&history), why: unreadable(&history, &error) }),
                }
                continue;
            }
            let why = run.message.as_deref().and_then(|message| message.lines().next()).unwrap_or_default();
            let why = if why.is_empty() { String::new() } else { format!(": {why}") };
            // the history up to a failure or that of a run in progress, else the scene
            let files = [".failed.h5", ".part.h5", ".json"].map(|ending| store.path(&run.id, ending));
            let file = files.iter().find(|file| file.exists()).unwrap_or(&files[2]);
            left_out.push(LeftOut { run: name(file), why: format!("{}{why}", run.state.name()) });
        }
    }
    if found.is_empty() {
        let shown: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        let what = if shown.is_empty() {
            "no runs: give".into()
        } else {
            format!("no run of {} is done: give", shown.join(", "))
        };
        return Err(PostError::Usage(format!("{what} histories, or the folder of a sweep that has been run")));
    }
    Ok((found, left_out))
}

/// Why a finished run of a sweep has no result, and what to do.
pub(crate) fn unreadable(history: &Path, error: &HistoryError) -> String {
    let why = match error {
        HistoryError::Truncated { .. } => "its history is truncated".into(),
        other => other.to_string(),
    };
    format!("{why}; to make it again, delete {} and repeat the sweep", history.display())
}

/// The name of a run in tables.
pub fn name(path: &Path) -> String {
    path.display().to_string()
}

/// Reads the strength of a run; `wall` is the load wall, by default that of the scene.
///
/// # Errors
/// [`PostError::Lacking`] for a run without a load, or without the observables of the measure;
/// those of reading it.
pub fn read(path: &Path, measure: Measure, wall: Option<&str>) -> Result<Found> {
    let history = History::open(path)?;
    let course = Course::read(&history, wall)?;
    let failure = course.failure(&history, measure)?;
    let at = |row: usize| Strength {
        load: course.load[row],
        time: course.time[row],
        greatest_before: course.load[..=row].iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    Ok(Found {
        path: path.into(),
        scene: history.parameters()?.scene,
        strength: failure.map(at),
        grains: (history.grains()?.radius, history.bonds()?.pair),
    })
}

/// The curves of a run, one entry per observed step.
#[derive(Debug, Default)]
pub(crate) struct Course {
    /// Steps.
    pub(crate) step: Vec<i64>,
    /// Times, s.
    pub(crate) time: Vec<f64>,
    /// The load, N, positive in its own sense.
    pub(crate) load: Vec<f64>,
    /// Why the load of a step is not that before anything broke in it; `None` where it is.
    pub(crate) load_after_breaks: Option<String>,
    /// Axial strain fitted to the grains, along the load; empty if not recorded.
    pub(crate) strain: Vec<f64>,
    /// Bonds broken; empty if not recorded.
    broken: Vec<f64>,
    /// Whether the run loads from break to break.
    follows_breaks: bool,
}

impl Course {
    /// Reads the load of the wall `wall`, of the load wall, or, without a driven wall, of the only
    /// force on a grain.
    ///
    /// # Errors
    /// [`PostError::Lacking`] for a run without a load; [`PostError::Usage`] for a wall that is not
    /// driven; those of reading the history.
    pub(crate) fn read(history: &History, wall: Option<&str>) -> Result<Self> {
        let driven = history.walls()?.iter().any(|wall| wall.drive != WallDrive::Fixed);
        match (driven, wall) {
            (false, None) => Self::of_grain(history),
            _ => {
                let found = stress_strain::read(history, wall)?;
                Ok(Self {
                    load_after_breaks: found.load_after_breaks(),
                    step: found.step,
                    time: found.time,
                    load: found.load,
                    strain: found.strain,
                    broken: found.broken,
                    follows_breaks: history.follows_breaks(),
                })
            }
        }
    }

    /// The curves of a scene that is loaded by one force on a grain and has no driven wall.
    fn of_grain(history: &History) -> Result<Self> {
        let scene = serde_json::from_str::<Value>(&history.parameters()?.scene).unwrap_or_default();
        let loads: Vec<Load> = serde_json::from_value(scene["grains"]["loads"].clone()).unwrap_or_default();
        let magnitude = |load: &Load| load.force.iter().flatten().map(|f| f * f).sum::<f64>().sqrt();
        let pulling: Vec<&Load> = loads.iter().filter(|load| magnitude(load) > 0.0).collect();
        let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
        let [load] = pulling.as_slice() else {
            return Err(lacking(
                "its load is that of a driven wall or of one force on a grain, and this scene has neither: give one \
                 of its walls a velocity or a force",
            ));
        };
        let steps = history.observable("bonds_broken")?.filter(|series| !series.step.is_empty());
        let steps = steps.ok_or_else(|| lacking("it has no steps of /observables/bonds_broken"))?;
        let size = magnitude(load);
        let direction: Vec<f64> = load.force.iter().flatten().map(|f| f / size).collect();
        let d = history.dimension();
        let mut strain = vec![];
        if let Some(series) = history.observable("strain")? {
            strain = vec![0.0; series.step.len()];
            for (i, j) in (0..d * d).map(|k| (k / d, k % d)) {
                let weight = direction.get(i).zip(direction.get(j)).map_or(0.0, |(a, b)| a * b);
                let part = series.component(&[i, j]).unwrap_or_default();
                strain.iter_mut().zip(part).for_each(|(sum, part)| *sum += weight * part);
            }
        }
        let times = match history.observable("load_time")? {
            Some(series) => series.value,
            // the loads of a step are those of its middle
            None => steps.step.iter().zip(&steps.time).map(|(n, t)| t * (1.0 - 0.5 / (*n).max(1) as f64)).collect(),
        };
        let load = times.iter().map(|&t| size * load.time.at(t)).collect();
        Ok(Self {
            step: steps.step,
            time: steps.time,
            load,
            strain,
            broken: steps.value,
            load_after_breaks: None,
            follows_breaks: history.follows_breaks(),
        })
    }

    /// The row of the observed steps in which the sample fails by a measure; for a run that did not
    /// fail, the state it reached.
    ///
    /// # Errors
    /// [`PostError::Lacking`] for a run without the observables of the measure; those of reading
    /// it.
    pub(crate) fn failure(&self, history: &History, measure: Measure) -> Result<std::result::Result<usize, String>> {
        let (path, bonds) = (history.path(), history.bonds()?.len());
        if bonds == 0 && matches!(measure, Measure::FirstBreak | Measure::Broken) {
            let what = "it has no bonds: choose --measure collapse or peak".into();
            return Err(PostError::Lacking { path: path.into(), what });
        }
        if measure == Measure::Collapse {
            return self.collapse(path, Bonding::of(history)?);
        }
        let step = self.gives_way(path, measure, bonds)?;
        Ok(step.ok_or_else(|| self.how_far(measure, bonds)))
    }

    /// The row whose end is the state that the sample still bore: that of its failure or, if bonds
    /// broke in that, the one before; `None` if they did in the first. A run that loads from break
    /// to break records the state before each break.
    pub(crate) fn borne(&self, failure: usize) -> Option<usize> {
        if self.follows_breaks {
            return Some(failure);
        }
        let broken = |row: usize| self.broken.get(row).copied().unwrap_or(0.0);
        match failure.checked_sub(1) {
            None => (broken(0) == 0.0).then_some(0),
            Some(before) if broken(failure) > broken(before) => Some(before),
            Some(_) => Some(failure),
        }
    }

    /// The collapse, or the reason why there is none.
    fn collapse(&self, path: &Path, bonds: Bonding) -> Result<std::result::Result<usize, String>> {
        recorded(path, &self.strain, "strain")?;
        let found = Collapse::read(&self.load, &self.strain, &self.broken, STRAINS[0], bonds);
        Ok(match found.step {
            Some(_) if found.early => Err(format!("it has no collapse load: its strain exceeds 1e-4 {}", found.note)),
            Some(at) => Ok(at),
            None if found.note.is_empty() => Err(self.how_far(Measure::Collapse, 0)),
            None => Err(format!("it has no collapse load: {}", found.note)),
        })
    }

    /// The step at which the sample fails by another measure; `None` if it does not.
    fn gives_way(&self, path: &Path, measure: Measure, bonds: usize) -> Result<Option<usize>> {
        if measure == Measure::Peak {
            return Ok(peak(&self.load));
        }
        recorded(path, &self.broken, "bonds_broken")?;
        let share = if measure == Measure::Broken { BROKEN_SHARE * bonds as f64 } else { 0.0 };
        let step = self.broken.iter().position(|&n| n > 0.0 && n >= share);
        Ok(step.filter(|&step| step < self.load.len()))
    }

    /// The state reached by a run that did not fail.
    fn how_far(&self, measure: Measure, bonds: usize) -> String {
        let greatest = quantity(self.load.iter().copied().reduce(f64::max), "N");
        let broken = self.broken.last().copied().unwrap_or(0.0);
        match measure {
            Measure::FirstBreak => format!("no bond has broken by {greatest}"),
            Measure::Broken => format!("{broken} of {bonds} bonds have broken by {greatest}, fewer than 5 %"),
            Measure::Collapse => {
                let strain = self.strain.iter().map(|e| e.abs()).fold(0.0, f64::max);
                format!("its strain reaches {} by {greatest}, less than 1e-4", quantity(Some(strain), ""))
            }
            Measure::Peak => format!("its load never falls by 5 %; it reaches {greatest}"),
        }
    }
}

/// The error of a measure whose observable is not in the history.
fn recorded(path: &Path, values: &[f64], name: &str) -> Result<()> {
    if !values.is_empty() {
        return Ok(());
    }
    Err(PostError::Lacking { path: path.into(), what: format!("it has no steps of /observables/{name}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course() -> Course {
        Course {
            step: (0..6).collect(),
            time: (0..6).map(f64::from).collect(),
            load: vec![0.0, 10.0, 20.0, 30.0, 40.0, 12.0],
            strain: vec![0.0, 0.0, 0.0, -5e-5, -2e-4, -2e-3],
            load_after_breaks: None,
            broken: vec![0.0, 0.0, 1.0, 1.0, 5.0, 9.0],
            follows_breaks: false,
        }
    }

    fn step(measure: Measure, bonds: usize) -> Option<usize> {
        course().gives_way(Path::new("run.h5"), measure, bonds).unwrap()
    }

    #[test]
    fn each_measure_has_its_step() {
        assert_eq!(step(Measure::FirstBreak, 100), Some(2));
        assert_eq!(
            (step(Measure::Broken, 100), step(Measure::Broken, 20), step(Measure::Broken, 200)),
            (Some(4), Some(2), None)
        );
        let collapse = |bonds| course().collapse(Path::new("run.h5"), bonds).unwrap();
        assert_eq!(collapse(Bonding::None), Ok(3));
        let intact = Course { broken: vec![0.0; 6], ..course() };
        let early = intact.collapse(Path::new("run.h5"), Bonding::Rigid { one_piece: false }).unwrap();
        assert!(early.clone().unwrap_err().contains("not all grains are bonded"), "{early:?}");
        assert_eq!(step(Measure::Peak, 100), Some(4));
        assert!(Course::default().collapse(Path::new("a.h5"), Bonding::None).is_err());
    }

    #[test]
    fn what_a_sample_bore_is_before_the_breaks_of_its_failure() {
        // bonds break at rows 2, 4 and 5
        let borne = |at: usize| course().borne(at);
        assert_eq!([0, 1, 2, 3, 4, 5].map(borne), [Some(0), Some(1), Some(1), Some(3), Some(3), Some(4)]);
        let at_once = Course { broken: vec![1.0, 2.0], ..course() };
        assert_eq!(at_once.borne(0), None);
        assert_eq!(Course { broken: vec![], ..course() }.borne(4), Some(4));
    }
}
