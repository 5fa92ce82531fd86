//! Resumes a run from its history. The results are bitwise identical to those of an uninterrupted
//! run.

use crate::check::free_space;
use crate::error::RunError;
use crate::history::{Checkpoint, Ending, History, HistoryError, Parameters, RowCounts, refuse_busy};
use crate::in_dimension;
use crate::output::replace::folder;
use crate::output::{number, print_json, print_line};
use crate::record::{Beginning, Recorder};
use crate::run::{Execution, Run, RunOptions, RunState, handle_signals, run_in};
use crate::scene::{self, Scene, differences};
use crate::signals::Interrupt;
use dem_core::dim::Dim;
use std::path::{Path, PathBuf};

/// Options of `dem-run resume`.
#[derive(Debug, Clone, PartialEq)]
pub struct ResumeOptions {
    /// The history to resume.
    pub history: PathBuf,
    /// A later end of the run (s).
    pub until: Option<f64>,
    /// A scene that may differ from that of the history.
    pub scene: Option<PathBuf>,
    /// Values set in the scene, as in `time.end=1`.
    pub set: Vec<String>,
    /// Whether a different scene is accepted.
    pub force: bool,
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether the summary on stdout is JSON.
    pub json: bool,
}

/// Fields that may change: the steps already made do not depend on them.
const FREE: [&str; 5] = ["title", "$schema", "time.end", "stop", "load_wall"];
/// Fields that may change with `--force`: the run then differs from a run of either scene alone.
const OPEN: [&str; 8] = [
    "solver",
    "gravity",
    "rupture",
    "materials.friction",
    "materials.restitution",
    "grains.loads",
    "membrane.pressure",
    "bonds.flow",
];
/// Fields of a wall that may change with `--force`.
const OPEN_WALL: [&str; 6] = ["force", "force_rate", "velocity", "stress", "slide", "friction"];

/// Resumes a run, writes its history and prints its summary.
///
/// # Errors
/// [`RunError`]. The old history is kept until the new one is complete up to the checkpoint.
pub fn resume(options: &ResumeOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    let history = History::open(&options.history)?;
    refuse_busy(&options.history)?;
    let (scene, changed) = scene_of(&history, options)?;
    in_dimension!(scene, D => resume_in::<D>(&scene, changed, &history, options, &interrupt))
}

/// The scene of the resumed run, and whether `--force` changed it.
fn scene_of(history: &History, options: &ResumeOptions) -> Result<(Scene, bool), RunError> {
    let shown = options.history.display();
    let stored = history.parameters()?.scene;
    let mut sets = options.set.clone();
    sets.extend(options.until.map(|end| format!("time.end={end}")));
    let before = scene::from_text(&format!("the scene in {shown}"), &stored, &[])?;
    let scene = match &options.scene {
        Some(path) => scene::load(path, &sets)?,
        None => scene::from_text(&format!("the scene in {shown}"), &stored, &sets)?,
    };
    let (mut refused, mut forced) = (vec![], vec![]);
    for difference in differences(&before.to_json().unwrap_or_default(), &scene.to_json().unwrap_or_default()) {
        let path = difference.path.as_str();
        let wall = path.strip_prefix("walls.").and_then(|rest| rest.split_once('.')).map(|(_, field)| field);
        if FREE.iter().any(|field| is_in(path, field)) {
            continue;
        }
        let open = OPEN.iter().any(|field| is_in(path, field))
            || wall.is_some_and(|field| OPEN_WALL.iter().any(|open| is_in(field, open)));
        let told = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".into());
        let line = format!("\n  {path}: {} in the history, {} now", told(&difference.a), told(&difference.b));
        if open { forced.push(line) } else { refused.push(line) }
    }
    if !refused.is_empty() {
        let lines = refused.concat();
        return Err(RunError::Usage(format!(
            "the scene in {shown} differs in fields that cannot change during a run:{lines}\nrun the scene anew, \
             with another history"
        )));
    }
    if !forced.is_empty() && !options.force {
        let lines = forced.concat();
        return Err(RunError::Usage(format!(
            "the scene in {shown} differs:{lines}\n--force resumes the run with the new scene"
        )));
    }
    Ok((scene, !forced.is_empty()))
}

/// What the new file tells of the run: a scene that was changed stands beside the new one.
fn origin(history: &History, scene: &Scene, changed: bool, last_step: i64) -> Result<Parameters, RunError> {
    let before = history.parameters()?;
    let mut earlier_scenes = before.earlier_scenes.clone();
    if changed {
        let mut list: Vec<serde_json::Value> = serde_json::from_str(&earlier_scenes).unwrap_or_default();
        let old: serde_json::Value = serde_json::from_str(&before.scene).unwrap_or_default();
        list.push(serde_json::json!({ "last_step": last_step, "scene": old }));
        earlier_scenes = serde_json::Value::Array(list).to_string();
    }
    Ok(Parameters { scene: scene.to_json().unwrap_or_default(), earlier_scenes, ..before })
}

/// Whether `path` is `field` or a part of it.
fn is_in(path: &str, field: &str) -> bool {
    path.strip_prefix(field).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn resume_in<D: Dim>(
    scene: &Scene,
    changed: bool,
    history: &History,
    options: &ResumeOptions,
    interrupt: &Interrupt,
) -> Result<(), RunError> {
    let path = &options.history;
    let shown = path.display();
    let Some(checkpoint) = history.checkpoint()? else {
        if history.frames() as u64 <= 1 {
            // killed before its first checkpoint: the run restarts from time zero, without loss
            return run_in::<D>(scene, &anew(options), interrupt);
        }
        return Err(no_state(path));
    };
    let mut state = RunState::<D>::restored(scene, &checkpoint)
        .map_err(|mismatch| RunError::InputOutput(format!("{shown}: {mismatch}; run the scene again")))?;
    if let Some(until) = options.until.filter(|_| scene.time.steps() < state.world.steps) {
        return Err(RunError::Usage(format!(
            "--until {until} s is before the last state of {shown}, at {} s: resume the run to a later time",
            number(state.world.time)
        )));
    }
    let ending = match state.world.steps >= scene.time.steps() {
        true => Some(Ending::Time),
        false => state.course.advance(scene, &mut state.world)?,
    };
    if let Some(ending) = ending {
        let time = state.world.time;
        if options.json {
            return Ok(print_json(&serde_json::json!({ "history": path, "time": time, "steps_made": 0 }))?);
        }
        let ended = match scene.rupture {
            scene::Rupture::NextEvent => format!("after {} steps", state.world.steps),
            _ => format!("at t = {} s", number(time)),
        };
        let further = match ending {
            Ending::WallTravel | Ending::BrokenFraction | Ending::LoadDrop => {
                "--set stop=null resumes it beyond the stop"
            }
            Ending::Stages => {
                "its last stage ended, and stages cannot change during a run: run the scene anew with another one"
            }
            _ => "--until T resumes it to a later end",
        };
        return Ok(print_line(&format!("nothing to do: the run ended {ended}; {further}"))?);
    }
    let beginning = Beginning {
        kept: kept(history, scene, &checkpoint)?,
        origin: origin(history, scene, changed, checkpoint.step)?,
        checkpoint: &checkpoint,
    };
    let solid_fraction = history.parameters()?.solid_fraction;
    refuse_full_disk(history)?;
    let mut progress = options.execution.show();
    let mut tell = |done| {
        progress.phase("copying the history", done);
        !interrupt.requested()
    };
    let cemented = state.course.cemented(scene);
    let recorder = Recorder::go_on(history, beginning, scene, &state.world, cemented, &mut tell);
    let recorder = recorder.map_err(|error| match error {
        HistoryError::Interrupted => RunError::Interrupted("the history is unchanged"),
        error => error.into(),
    })?;
    // idle walls are not reported: the earlier forces on the walls are unknown
    let mut run = Run { scene, state, recorder, solid_fraction, preparation_time: None, idle: vec![] };
    let outcome = run.step_on(interrupt, &mut progress);
    run.conclude(path, outcome, options.json, progress)
}

fn no_state(path: &Path) -> RunError {
    RunError::Unfit {
        path: path.into(),
        state: "holds no complete state to resume from",
        remedy: "it is damaged, or of an older version; run the scene again".into(),
    }
}

/// Options of a run that restarts from time zero and replaces its history.
fn anew(options: &ResumeOptions) -> RunOptions {
    RunOptions {
        output: options.history.clone(),
        overwrite: true,
        execution: options.execution,
        json: options.json,
        write_sample: None,
        packings: None,
        ignore_memory: true,
    }
}

/// The rows of a history that are kept when the run resumes from `checkpoint`: the frames that were
/// due by then. If the run ended between two due frames, its last frame is dropped, because an
/// uninterrupted run would not have it; the steps before it are kept.
fn kept(history: &History, scene: &Scene, checkpoint: &Checkpoint) -> Result<RowCounts, RunError> {
    let every = scene.steps_per_frame() as i64;
    let due = history.steps().iter().take_while(|step| **step <= checkpoint.step && **step % every == 0).count();
    let contacts = history.complete_at(due)?.contacts;
    let all = history.complete_to(checkpoint.step)?.ok_or_else(|| no_state(history.path()))?;
    Ok(RowCounts { frames: due, contacts, ..all })
}

/// Rejects a disk without space for the new history: it is written beside the old one before it
/// replaces it.
fn refuse_full_disk(history: &History) -> Result<(), RunError> {
    let needed = history.length();
    match free_space(&folder(history.path())) {
        Some(free) if free < needed => Err(RunError::Disk { path: history.path().into(), needed, free }),
        _ => Ok(()),
    }
}
