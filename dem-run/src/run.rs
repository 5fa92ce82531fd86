//! The run of a scene: prepare, step, record, sum up.

use crate::build::{Built, build, write_sample};
use crate::course::Course;
use crate::fclib::FclibError;
use crate::history::HistoryError;
use crate::output::WriteError;
use crate::progress::{Progress, ProgressMode, StepProgress};
use crate::record::Recorder;
use crate::scene::{Scene, SceneError};
use crate::signals::{self, INTERRUPTED, Interrupt};
use crate::summary::{Ending, Summary};
use dem_core::dim::{D2, D3, Dim};
use dem_core::world::{StepError, StepReport, World};
use std::io::Write;
use std::path::{Path, PathBuf};

/// How a scene is run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunOptions {
    /// The history to write.
    pub output: PathBuf,
    /// Whether files that exist are overwritten.
    pub overwrite: bool,
    /// Number of threads; as many as the machine has where it is absent. The result does not depend on it.
    pub threads: Option<usize>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Whether stderr stays silent but for errors.
    pub quiet: bool,
    /// Whether the summary on stdout is JSON.
    pub json: bool,
    /// Where the prepared sample is written as CSV, if at all.
    pub write_sample: Option<PathBuf>,
}

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scene is wrong, or cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The sample cannot be made as the scene asks.
    #[error("{0}")]
    Sample(String),
    /// A contact problem was not solved within the limits of the scene.
    #[error("{0}")]
    NoConvergence(String),
    /// A file cannot be read or written.
    #[error("{0}")]
    InputOutput(String),
    /// The history cannot be written.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// A contact problem cannot be read or written.
    #[error(transparent)]
    Problem(#[from] FclibError),
    /// What was asked for is not there.
    #[error("{0}")]
    Usage(String),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Ctrl-C or SIGTERM, and what that leaves.
    #[error("interrupted: {0}")]
    Interrupted(&'static str),
}

impl RunError {
    /// The exit code of the command: 2 wrong scene, 3 no convergence, 4 input/output, 130 interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(SceneError::Read { .. }) | Self::InputOutput(_) | Self::History(_) => 4,
            Self::Write(_) | Self::Problem(_) => 4,
            Self::Scene(_) | Self::Sample(_) | Self::Usage(_) => 2,
            Self::NoConvergence(_) => 3,
            Self::Interrupted(_) => INTERRUPTED,
        }
    }
}

/// Runs a scene, prints its summary, and leaves its history.
///
/// # Errors
/// [`RunError`]; a history that was begun is complete up to its last frame.
pub fn run(scene: &Scene, options: &RunOptions) -> Result<(), RunError> {
    let interrupt = signals::install().map_err(|e| RunError::InputOutput(format!("no handler for Ctrl-C: {e}")))?;
    start_threads(options.threads)?;
    match scene.dimension {
        2 => run_in::<D2>(scene, options, &interrupt),
        _ => run_in::<D3>(scene, options, &interrupt),
    }
}

/// Starts this many threads, or leaves it to the machine.
pub(crate) fn start_threads(threads: Option<usize>) -> Result<(), RunError> {
    let Some(threads) = threads else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    pool.map_err(|e| RunError::InputOutput(format!("{threads} threads cannot be started: {e}")))
}

fn run_in<D: Dim>(scene: &Scene, options: &RunOptions, interrupt: &Interrupt) -> Result<(), RunError> {
    let mut progress = Progress::new(options.progress, options.quiet);
    let built = build::<D>(scene, &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?;
    if let Some(path) = &options.write_sample {
        write_sample(&built.world.grains, path)
            .map_err(|e| RunError::InputOutput(format!("{} cannot be written: {e}", path.display())))?;
    }
    let names: Vec<String> = scene.walls.keys().cloned().collect();
    let recorder = Recorder::create(&options.output, options.overwrite, scene, &names, &built.world)?;
    let mut run = Run::new(scene, built, recorder);
    let outcome = run.step_on(interrupt, &mut progress);
    progress.finish();
    let (summary, outcome) = run.close(&options.output, outcome)?;
    let shown = if options.json { format!("{:#}", serde_json::json!(summary)) } else { summary.to_string() };
    // a reader that has seen enough is no error
    let _ = writeln!(std::io::stdout(), "{shown}");
    outcome
}

/// A run between its first and its last step.
struct Run<'a, D: Dim> {
    scene: &'a Scene,
    world: World<D>,
    recorder: Recorder<D>,
    solid_fraction: Option<f64>,
    course: Course<D>,
    framed: bool,
}

impl<'a, D: Dim> Run<'a, D> {
    fn new(scene: &'a Scene, built: Built<D>, recorder: Recorder<D>) -> Self {
        let world = built.world;
        let course = Course::new(scene, &world);
        Self { scene, world, recorder, solid_fraction: built.solid_fraction, course, framed: false }
    }

    /// Step until the time, a stop condition, an interruption or a failure ends the run.
    fn step_on(&mut self, interrupt: &Interrupt, progress: &mut Progress) -> Result<Ending, RunError> {
        self.recorder.frame(&self.world)?;
        let (steps, every) = (self.scene.time.steps(), self.scene.steps_per_frame());
        while self.world.steps < steps {
            let report = match self.world.step() {
                Ok(report) => report,
                Err(error) => return self.failed(error),
            };
            self.recorder.step(&self.world, &report)?;
            self.course.count(&self.world, &report);
            progress.step(&self.standing(&report));
            self.framed = self.world.steps.is_multiple_of(every);
            if self.framed {
                self.recorder.frame(&self.world)?;
            }
            if let Some(ending) = self.course.ending(&self.world) {
                return Ok(ending);
            }
            if interrupt.requested() {
                return Ok(Ending::Interrupted);
            }
        }
        Ok(Ending::Time)
    }

    fn failed(&mut self, error: StepError) -> Result<Ending, RunError> {
        Err(RunError::NoConvergence(format!(
            "{error}\nthe history is complete up to there; a smaller time.step, more max_sweeps or a larger solver.accept may help"
        )))
    }

    fn standing(&self, report: &StepReport<D>) -> StepProgress {
        StepProgress {
            step: self.world.steps,
            time: self.world.time,
            end: self.scene.time.end,
            residual: report.residual,
            iterations: report.work.iterations(),
            broken: self.course.broken(),
        }
    }

    /// Write the last state, close the history and sum up. The second value is what the command ends with.
    fn close(
        mut self,
        history: &Path,
        outcome: Result<Ending, RunError>,
    ) -> Result<(Summary, Result<(), RunError>), RunError> {
        let (ending, end) = match outcome {
            Ok(Ending::Interrupted) => {
                (Ending::Interrupted, Err(RunError::Interrupted("the history is complete up to the last frame")))
            }
            Ok(ending) => (ending, Ok(())),
            Err(error @ RunError::NoConvergence(_)) => (Ending::NoConvergence, Err(error)),
            Err(error) => return Err(error),
        };
        if !self.framed && self.world.steps > 0 {
            self.recorder.frame(&self.world)?;
        }
        self.recorder.finish()?;
        let (world, course) = (&self.world, &self.course);
        let summary = Summary {
            history: history.to_path_buf(),
            ending,
            steps: world.steps,
            driven: course.driven.is_some(),
            time: world.time,
            grains: world.grains.len(),
            solid_fraction: self.solid_fraction,
            bonds: world.bonds.len(),
            elastic: world.bonds.iter().any(|b| b.stiffness.is_some()),
            broken: course.broken,
            failure: course.collapse.failure,
            tolerance: self.scene.solver.tolerance,
            worst_residual: course.worst_residual,
            work: course.work,
            missed_tolerance: course.missed_tolerance,
            rejected: course.rejected,
            penetration: course.penetration,
            mean_diameter: 2.0 * world.grains.radius.iter().sum::<f64>() / world.grains.len() as f64,
            external_work: world.ledger.external_work,
            energy_remainder: world.ledger.remainder,
            bond_remainder: world.ledger.bonds,
            cpu_time: cpu_time(),
        };
        Ok((summary, end))
    }
}

/// Processor time of the program so far (s).
pub fn cpu_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
