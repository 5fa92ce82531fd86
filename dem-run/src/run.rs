//! The run of a scene: prepare, step, record, sum up.

use crate::build::{Built, build, write_sample};
use crate::collapse::Collapse;
use crate::fclib::FclibError;
use crate::history::HistoryError;
use crate::progress::{Progress, ProgressMode, StepProgress};
use crate::record::{Recorder, applied_force};
use crate::scene::{Scene, SceneError, TravelFrom};
use crate::signals::{self, INTERRUPTED, Interrupt};
use crate::summary::{Ending, Summary};
use dem_core::body::{Drive, Wall};
use dem_core::bond::BondStatus;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::SolveStatus;
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
    /// Ctrl-C or SIGTERM.
    #[error("interrupted: the history is complete up to the last frame")]
    Interrupted,
}

impl RunError {
    /// The exit code of the command: 2 wrong scene, 3 no convergence, 4 input/output, 130 interrupted.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(SceneError::Read { .. }) | Self::InputOutput(_) | Self::History(_) | Self::Problem(_) => 4,
            Self::Scene(_) | Self::Sample(_) | Self::Usage(_) => 2,
            Self::NoConvergence(_) => 3,
            Self::Interrupted => INTERRUPTED,
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
    collapse: Collapse,
    /// The wall whose force loads the sample: the first that is driven.
    driven: Option<usize>,
    stop: Option<TravelStop<D>>,
    broken: [usize; 3],
    worst_residual: f64,
    sweeps: u64,
    missed_tolerance: u64,
    rejected: u64,
    penetration: f64,
    framed: bool,
}

/// The travel of a wall that ends a run.
struct TravelStop<D: Dim> {
    wall: usize,
    direction: D::Vector,
    distance: f64,
    from: Option<D::Vector>,
}

impl<'a, D: Dim> Run<'a, D> {
    fn new(scene: &'a Scene, built: Built<D>, recorder: Recorder<D>) -> Self {
        let world = built.world;
        let driven = world.walls.iter().position(|w| drive_direction(w).is_some());
        let stop = travel_stop(scene, &world);
        Self {
            scene,
            world,
            recorder,
            solid_fraction: built.solid_fraction,
            collapse: Collapse::default(),
            driven,
            stop,
            broken: [0; 3],
            worst_residual: 0.0,
            sweeps: 0,
            missed_tolerance: 0,
            rejected: 0,
            penetration: 0.0,
            framed: false,
        }
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
            self.count(&report);
            progress.step(&self.standing(&report));
            self.framed = self.world.steps.is_multiple_of(every);
            if self.framed {
                self.recorder.frame(&self.world)?;
            }
            if let Some(ending) = self.ending(interrupt) {
                return Ok(ending);
            }
        }
        Ok(Ending::Time)
    }

    fn failed(&mut self, error: StepError) -> Result<Ending, RunError> {
        Err(RunError::NoConvergence(format!(
            "{error}\nthe history is complete up to there; a smaller time.step, more max_sweeps or a larger solver.accept may help"
        )))
    }

    /// Enter a step in the counts of the summary.
    fn count(&mut self, report: &StepReport<D>) {
        for failed in &report.breaks {
            let mode = match failed.mode {
                BondStatus::Shear => 1,
                BondStatus::Rolling => 2,
                _ => 0,
            };
            self.broken[mode] += 1;
        }
        self.worst_residual = self.worst_residual.max(report.residual);
        self.sweeps += report.iterations;
        self.missed_tolerance += u64::from(report.status == SolveStatus::Accepted);
        self.rejected += u64::from(report.rejected);
        self.penetration = self.penetration.max(report.penetration);
        if let Some(wall) = self.driven {
            let wall = &self.world.walls[wall];
            let strain = axial(&self.world.strain(), drive_direction(wall).unwrap_or(D::Vector::zero()));
            self.collapse.push(applied_force(wall), strain, self.broken.iter().sum(), self.world.bonds.len());
        }
    }

    fn standing(&self, report: &StepReport<D>) -> StepProgress {
        StepProgress {
            step: self.world.steps,
            time: self.world.time,
            end: self.scene.time.end,
            residual: report.residual,
            sweeps: report.iterations,
            broken: self.broken.iter().sum(),
        }
    }

    /// Whether the run ends here, and why.
    fn ending(&mut self, interrupt: &Interrupt) -> Option<Ending> {
        let broken: usize = self.broken.iter().sum();
        if let Some(stop) = &mut self.stop {
            let position = self.world.walls[stop.wall].position;
            if stop.from.is_none() && broken > 0 {
                stop.from = Some(position);
            }
            if stop.from.is_some_and(|from| (position - from).dot(&stop.direction).abs() >= stop.distance) {
                return Some(Ending::WallTravel);
            }
        }
        let limit = self.scene.stop.as_ref().and_then(|s| s.broken_fraction);
        if limit
            .is_some_and(|limit| !self.world.bonds.is_empty() && broken as f64 >= limit * self.world.bonds.len() as f64)
        {
            return Some(Ending::BrokenFraction);
        }
        interrupt.requested().then_some(Ending::Interrupted)
    }

    /// Write the last state, close the history and sum up. The second value is what the command ends with.
    fn close(
        mut self,
        history: &Path,
        outcome: Result<Ending, RunError>,
    ) -> Result<(Summary, Result<(), RunError>), RunError> {
        let (ending, end) = match outcome {
            Ok(Ending::Interrupted) => (Ending::Interrupted, Err(RunError::Interrupted)),
            Ok(ending) => (ending, Ok(())),
            Err(error @ RunError::NoConvergence(_)) => (Ending::NoConvergence, Err(error)),
            Err(error) => return Err(error),
        };
        if !self.framed && self.world.steps > 0 {
            self.recorder.frame(&self.world)?;
        }
        self.recorder.finish()?;
        let world = &self.world;
        let summary = Summary {
            history: history.to_path_buf(),
            ending,
            steps: world.steps,
            driven: self.driven.is_some(),
            time: world.time,
            grains: world.grains.len(),
            solid_fraction: self.solid_fraction,
            bonds: world.bonds.len(),
            broken: self.broken,
            failure: self.collapse.failure,
            tolerance: self.scene.solver.tolerance,
            worst_residual: self.worst_residual,
            sweeps: self.sweeps,
            missed_tolerance: self.missed_tolerance,
            rejected: self.rejected,
            penetration: self.penetration,
            mean_diameter: 2.0 * world.grains.radius.iter().sum::<f64>() / world.grains.len() as f64,
            external_work: world.ledger.external_work,
            energy_remainder: world.ledger.remainder,
            bond_remainder: world.ledger.bonds,
            cpu_time: cpu_time(),
        };
        Ok((summary, end))
    }
}

fn drive_direction<D: Dim>(wall: &Wall<D>) -> Option<D::Vector> {
    match wall.drive {
        Drive::Fixed => None,
        Drive::Velocity { direction, .. } | Drive::Force { direction, .. } => Some(direction),
    }
}

/// d·E d: the strain along a unit direction d.
fn axial<V: Vect>(strain: &[f64], d: V) -> f64 {
    let row = |r: usize| (0..V::LEN).map(|c| strain[r * V::LEN + c] * d[c]).sum::<f64>();
    (0..V::LEN).map(|r| d[r] * row(r)).sum()
}

fn travel_stop<D: Dim>(scene: &Scene, world: &World<D>) -> Option<TravelStop<D>> {
    let travel = scene.stop.as_ref()?.wall_travel.as_ref()?;
    let wall = scene.walls.keys().position(|name| *name == travel.wall)?;
    let direction = drive_direction(&world.walls[wall])?;
    let along = |sign: f64| {
        let reach = |(x, r): (&D::Vector, &f64)| sign * x.dot(&direction) + r;
        world.grains.position.iter().zip(&world.grains.radius).map(reach).fold(f64::NEG_INFINITY, f64::max)
    };
    let from = (travel.after == TravelFrom::Start).then(|| world.walls[wall].position);
    Some(TravelStop { wall, direction, distance: travel.fraction_of_height * (along(1.0) + along(-1.0)), from })
}

/// Processor time of the program so far (s).
pub fn cpu_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
