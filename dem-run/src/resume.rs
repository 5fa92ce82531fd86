//! A run that continues from its history. Its results have the same bits as those of a run without
//! interruption.

use crate::check::free_space;
use crate::error::RunError;
use crate::history::{Checkpoint, History, HistoryError, Kept, refuse_busy};
use crate::in_dimension;
use crate::output::{number, print_json, print_line};
use crate::record::Recorder;
use crate::run::{Execution, Run, RunOptions, State, handle_signals, run_in};
use crate::scene::{self, Scene, differences};
use crate::signals::Interrupt;
use dem_core::dim::Dim;
use std::path::{Path, PathBuf};

/// How a run is resumed.
#[derive(Debug, Clone, PartialEq)]
pub struct ResumeOptions {
    /// The history to go on with.
    pub history: PathBuf,
    /// A later end of the run (s).
    pub until: Option<f64>,
    /// A scene that may differ from the one in the history, and values to put in it.
    pub scene: Option<PathBuf>,
    /// Values to put in the scene, as in `time.end=1`.
    pub set: Vec<String>,
    /// Whether a scene that differs is taken.
    pub force: bool,
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether the summary on stdout is JSON.
    pub json: bool,
}

/// Fields that may change: the steps already made do not depend on them.
const FREE: [&str; 5] = ["title", "$schema", "time.end", "stop", "load_wall"];
/// Fields that may change with `--force`: the run then differs from a run of either scene alone.
const OPEN: [&str; 7] =
    ["solver", "gravity", "rupture", "materials.friction", "materials.restitution", "grains.loads", "bonds.flow"];
/// Fields of a wall, likewise.
const OPEN_WALL: [&str; 4] = ["force", "force_rate", "velocity", "friction"];

/// Goes on with a run, prints its summary, and leaves its history.
///
/// # Errors
/// [`RunError`]; the old history stays until the new one is complete up to the checkpoint.
pub fn resume(options: &ResumeOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    let history = History::open(&options.history)?;
    refuse_busy(&options.history)?;
    let scene = scene_of(&history, options)?;
    in_dimension!(scene, D => resume_in::<D>(&scene, &history, options, &interrupt))
}

/// The scene that the run goes on with.
fn scene_of(history: &History, options: &ResumeOptions) -> Result<Scene, RunError> {
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
            "{shown} is of another scene, and a run that has begun cannot change:{lines}\nrun the scene anew, to another file"
        )));
    }
    if !forced.is_empty() && !options.force {
        let lines = forced.concat();
        return Err(RunError::Usage(format!(
            "{shown} is of another scene:{lines}\n--force goes on with the scene as it is now"
        )));
    }
    Ok(scene)
}

/// Whether a path is that of a field or lies within it.
fn is_in(path: &str, field: &str) -> bool {
    path.strip_prefix(field).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn resume_in<D: Dim>(
    scene: &Scene,
    history: &History,
    options: &ResumeOptions,
    interrupt: &Interrupt,
) -> Result<(), RunError> {
    let path = &options.history;
    let shown = path.display();
    let Some(checkpoint) = history.checkpoint()? else {
        if history.frames() as u64 <= 1 {
            // killed before its first checkpoint: the run begins anew, and nothing is lost
            return run_in::<D>(scene, &anew(options), interrupt);
        }
        return Err(RunError::Unfit {
            path: path.clone(),
            state: "holds no whole state to go on from",
            remedy: "it is damaged, or of an older version; run the scene again".into(),
        });
    };
    let mut state = State::<D>::restored(scene, &checkpoint)
        .map_err(|mismatch| RunError::InputOutput(format!("{shown}: {mismatch}; run the scene again")))?;
    if state.world.steps >= scene.time.steps() || state.course.ending(&state.world).is_some() {
        let time = state.world.time;
        if options.json {
            return Ok(print_json(&serde_json::json!({ "history": path, "time": time, "steps_made": 0 }))?);
        }
        return Ok(print_line(&format!(
            "nothing to do: the run ended at t = {} s; --until T goes on to a later end, --set stop=null beyond a stop",
            number(time)
        ))?);
    }
    let kept = kept(history, scene, &checkpoint)?;
    let cpu_time = history.observable("cpu_time")?.map_or(vec![], |series| series.value);
    let cpu_before = kept.steps.checked_sub(1).and_then(|last| cpu_time.get(last)).copied().unwrap_or(0.0);
    refuse_full_disk(history)?;
    let mut progress = options.execution.show();
    let mut tell = |done| {
        progress.phase("copying the history", done);
        !interrupt.requested()
    };
    let recorder = Recorder::go_on(history, kept, &checkpoint, scene, &state.world, cpu_before, &mut tell);
    let recorder = recorder.map_err(|error| match error {
        HistoryError::Interrupted => RunError::Interrupted("the history is as it was"),
        error => error.into(),
    })?;
    // what acted on the walls before is not looked at again
    let mut run = Run { scene, state, recorder, solid_fraction: history.parameters()?.solid_fraction, idle: vec![] };
    let outcome = run.step_on(interrupt, &mut progress);
    run.conclude(path, outcome, options.json, progress)
}

/// How a run is begun anew in the place of its history.
fn anew(options: &ResumeOptions) -> RunOptions {
    RunOptions {
        output: options.history.clone(),
        overwrite: true,
        execution: options.execution,
        json: options.json,
        write_sample: None,
        ignore_memory: true,
    }
}

/// The rows of a history that are kept when the run continues from `checkpoint`: the frames that
/// were due by then. The last frame of a run that ended between two due frames is dropped, because
/// a run without interruption would not have it; the steps before it are kept.
fn kept(history: &History, scene: &Scene, checkpoint: &Checkpoint) -> Result<Kept, RunError> {
    let every = scene.steps_per_frame() as i64;
    let reached = history.steps().iter().take_while(|step| **step <= checkpoint.step).count();
    let due = history.steps()[..reached].iter().take_while(|step| **step % every == 0).count();
    let (all, frames) = (history.complete_at(reached)?, history.complete_at(due)?);
    Ok(Kept { frames: due, contacts: frames.contacts, ..all })
}

/// The new history stands beside the old one before it takes its place.
fn refuse_full_disk(history: &History) -> Result<(), RunError> {
    let folder = history.path().parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let needed = history.length();
    match free_space(folder) {
        Some(free) if free < needed => Err(RunError::Disk { path: history.path().into(), needed, free }),
        _ => Ok(()),
    }
}
