//! The run of a scene: prepare, step, record, sum up.

use crate::bonds;
use crate::build::{build, rebuild};
use crate::check;
use crate::clock::cpu_time;
use crate::collapse::Failure;
use crate::course::Course;
use crate::error::{NoConvergence, RunError};
use crate::history::{Checkpoint, Ending};
use crate::in_dimension;
use crate::memory;
use crate::output::{number, print_result};
use crate::progress::{Progress, ProgressMode, StepProgress};
use crate::record::Recorder;
use crate::sample_file;
use crate::scene::failure::{Disk, Splitting};
use crate::scene::{Drive as SceneDrive, Rupture, Scene, SolverKind};
use crate::signals::{self, Interrupt};
use crate::summary::{Summary, WallLoads};
use crate::warnings;
use dem_core::body::{Drive, Wall};
use dem_core::bond::BondStatus;
use dem_core::dim::{Dim, Vect};
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::solver::certificate::Verdict;
use dem_core::solver::limit_load::LimitLoad;
use dem_core::world::{StepError, StepReport, World};
use std::path::{Path, PathBuf};

/// How a scene is run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunOptions {
    /// The history to write.
    pub output: PathBuf,
    /// Whether files that exist are overwritten.
    pub overwrite: bool,
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether the summary on stdout is JSON.
    pub json: bool,
    /// CSV file to which the prepared sample is written, if any.
    pub write_sample: Option<PathBuf>,
    /// Folder of packings that this run shares with others, if any.
    pub packings: Option<PathBuf>,
    /// Whether a scene runs although it needs more memory than is free.
    pub ignore_memory: bool,
}

/// Execution of a command. No result depends on it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Execution {
    /// Number of threads; if absent, as many as the machine has.
    pub threads: Option<usize>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Whether stderr shows only errors.
    pub quiet: bool,
}

impl Execution {
    /// The progress display for these options.
    #[must_use]
    pub fn show(&self) -> Progress {
        Progress::new(self.progress, self.quiet)
    }

    /// Starts the global thread pool.
    pub(crate) fn start_threads(&self) -> Result<(), RunError> {
        let Some(threads) = self.threads else { return Ok(()) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|error| RunError::System { what: format!("cannot start {threads} threads"), source: error.into() })
    }
}

/// Runs a scene, writes its history and prints its summary.
///
/// # Errors
/// [`RunError`]. After an error, the history is complete up to its last frame.
pub fn run(scene: &Scene, options: &RunOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    in_dimension!(scene, D => run_in::<D>(scene, options, &interrupt))
}

/// Installs the handlers of Ctrl-C and SIGTERM.
pub(crate) fn handle_signals() -> Result<Interrupt, RunError> {
    signals::install().map_err(|error| RunError::System { what: "cannot handle Ctrl-C".into(), source: error.into() })
}

pub(crate) fn run_in<D: Dim>(scene: &Scene, options: &RunOptions, interrupt: &Interrupt) -> Result<(), RunError> {
    if !options.ignore_memory {
        memory::refuse_too_large(scene, check::count(scene)?)?;
    }
    let mut progress = options.execution.show();
    let built = build::<D>(scene, options.packings.as_deref(), &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?;
    for warning in &built.warnings {
        progress.note(&format!("warning: {warning}"));
    }
    if let Some(path) = &options.write_sample {
        let grains = &built.world.grains;
        let balls = grains.position.iter().copied().zip(grains.radius.iter().copied());
        sample_file::write::<D>(balls, (&grains.material, &scene.materials.names()), path)?;
    }
    let recorder = Recorder::create(&options.output, options.overwrite, scene, &built)?;
    let course = Course::new(scene, &built.world);
    let idle = may_be_idle(scene, &built.world);
    let state = RunState { world: built.world, course };
    let solid_fraction = built.solid_fraction;
    let mut run = Run { scene, state, recorder, solid_fraction, preparation_time: Some(cpu_time()), idle };
    let outcome = run.begin().and_then(|()| run.step_on(interrupt, &mut progress));
    run.conclude(&options.output, outcome, options.json, progress)
}

/// The variables of a run that change with each step.
pub(crate) struct RunState<D: Dim> {
    pub world: World<D>,
    pub course: Course<D>,
}

/// Version number of the data that [`RunState::save`] writes.
const FORM: usize = 12;

impl<D: Dim> RunState<D> {
    /// The state as numbers, without the processor time: two runs of a scene write identical files.
    fn save(&self) -> Checkpoint {
        let mut to = Saved::default();
        to.count(FORM);
        self.world.save(&mut to);
        self.course.save(&mut to);
        Checkpoint { step: self.world.steps as i64, reals: to.reals, counts: to.counts }
    }

    /// The state that [`RunState::save`] wrote.
    pub fn restored(scene: &Scene, checkpoint: &Checkpoint) -> Result<Self, Mismatch> {
        let mut from = Reader::new(&checkpoint.reals, &checkpoint.counts);
        if from.count()? != FORM {
            return Err(Mismatch);
        }
        let mut world = rebuild::<D>(scene, &mut from)?;
        let course = Course::restored(scene, &mut world, &mut from)?;
        from.end()?;
        Ok(Self { world, course })
    }
}

/// A run between its first and its last step.
pub(crate) struct Run<'a, D: Dim> {
    pub scene: &'a Scene,
    pub state: RunState<D>,
    pub recorder: Recorder<D>,
    /// Solid fraction that the sample was packed to (–).
    pub solid_fraction: Option<f64>,
    /// Processor time until the first step (s); none after it was resumed.
    pub preparation_time: Option<f64>,
    /// Driven walls on which no force has acted yet, by index.
    pub idle: Vec<usize>,
}

/// Driven walls that are reported at the end if no force ever acted on them: all except those that
/// move away from the grains.
fn may_be_idle<D: Dim>(scene: &Scene, world: &World<D>) -> Vec<usize> {
    let driven = |wall: &Wall<D>| !matches!(wall.drive, Drive::Fixed);
    let walls = scene.walls.keys().zip(&world.walls).enumerate();
    // a wall that stages drive may come back
    let leaves = |name: &str, wall: &Wall<D>| {
        scene.stage_drives(name).next().is_none() && warnings::leaves(wall, scene.time.end, &world.grains)
    };
    let told = walls.filter(|(_, (name, wall))| driven(wall) && !leaves(name, wall));
    told.map(|(k, _)| k).collect()
}

impl<D: Dim> Run<'_, D> {
    /// Record the state at time zero.
    fn begin(&mut self) -> Result<(), RunError> {
        self.record(true, true)
    }

    /// Makes steps until the end time, a stop condition, an interruption or a failure ends the run.
    pub fn step_on(&mut self, interrupt: &Interrupt, progress: &mut Progress) -> Result<Ending, RunError> {
        let steps = self.scene.time.steps();
        while self.state.world.steps < steps {
            let step = self.state.world.steps + 1;
            let report = match self.state.world.step_watched(&mut |broken| progress.cascade(step, broken)) {
                Ok(report) => report,
                Err(error @ StepError::Unbalanced { .. }) => {
                    progress.note(&error.message(&|body| self.name(body)));
                    return Ok(Ending::NoEquilibrium);
                }
                Err(error) => return self.failed(error),
            };
            let RunState { world, course, .. } = &mut self.state;
            self.recorder.step(world, &report)?;
            course.count(world, &report);
            self.idle.retain(|wall| world.walls[*wall].reaction.norm() == 0.0);
            progress.step(&self.standing(&report));
            let [frame, checkpoint] = self.due();
            if frame {
                self.record(true, checkpoint)?;
            }
            let RunState { world, course, .. } = &mut self.state;
            let ending = course.advance(self.scene, world)?;
            if course.cemented(self.scene) == Some(world.steps) {
                self.recorder.bonds_formed(self.scene, world)?;
            }
            if let Some(ending) = ending {
                return Ok(ending);
            }
            if interrupt.requested() {
                return Ok(Ending::Interrupted);
            }
        }
        Ok(Ending::Time)
    }

    /// Whether the state is due as a frame, and whether it is due as a checkpoint.
    fn due(&self) -> [bool; 2] {
        let (steps, every) = (self.state.world.steps, self.scene.steps_per_frame());
        [every, every * self.scene.output.checkpoint_every].map(|every| steps.is_multiple_of(every))
    }

    /// Record the state as a frame, as a checkpoint, or as both.
    fn record(&mut self, frame: bool, checkpoint: bool) -> Result<(), RunError> {
        let checkpoint = checkpoint.then(|| self.state.save());
        Ok(self.recorder.record(&self.state.world, frame, checkpoint)?)
    }

    fn failed(&mut self, error: StepError) -> Result<Ending, RunError> {
        self.state.course.rejected += u64::from(matches!(error, StepError::NotAccepted { .. }));
        let remedy = self.against_rigid_bonds(&error).unwrap_or_else(|| self.remedy(&error));
        Err(NoConvergence::Step { error: error.message(&|body| self.name(body)), remedy }.into())
    }

    /// Where a solve failed although a solution may exist and one wall moves by a velocity against
    /// rigid bonds: what they bear of it, if that is the likely cause, and the remedies.
    fn against_rigid_bonds(&mut self, error: &StepError) -> Option<String> {
        let of_a_solve = matches!(error, StepError::NotAccepted { .. } | StepError::Yielded { .. });
        if !of_a_solve || self.squeezed(error).is_some() {
            return None;
        }
        let world = &mut self.state.world;
        if !world.bonds.iter().any(|bond| bond.status == BondStatus::Intact && bond.stiffness.is_none()) {
            return None;
        }
        let mut moving = (0..world.walls.len()).filter_map(|wall| Some((wall, world.motion_of_drive(wall)?)));
        let (Some((wall, velocity)), None) = (moving.next(), moving.next()) else { return None };
        let (mass, speed) = (world.grains.mass.iter().sum::<f64>(), velocity.norm());
        let limit = world.limit_of_force(wall, velocity * (1.0 / speed));
        let name = self.name((self.state.world.grains.len() + wall) as u32);
        match limit {
            LimitLoad::Unbounded => Some(format!(
                "; reactions within all limits bear any force of {name} (`dem-run limit`): the sample cannot fail under it, and \
                 its motion may have no solution"
            )),
            LimitLoad::Factor { lower: force, .. } => {
                // the reactions at the limit, relative to those of the motion alone
                let ratio = force * self.scene.time.step / (mass * speed);
                (ratio * self.scene.solver.accept() >= 1.0).then(|| {
                    format!(
                        "; rigid bonds bear up to {} N of {name}, {ratio:.0e} times what its motion needs without them: drive \
                         it by a force (force_rate), move it faster, or give the bonds a stiffness (bonds.stiffness)",
                        number(force)
                    )
                })
            }
            LimitLoad::NeverBalanced
            | LimitLoad::Unsupported { .. }
            | LimitLoad::BrokenAtStart { .. }
            | LimitLoad::Undecided => None,
        }
    }

    /// Possible remedies for an error, with the fields of the scene.
    fn remedy(&self, error: &StepError) -> String {
        let newton = !matches!(self.scene.solver.kind, SolverKind::GaussSeidel(_));
        let grains = self.state.world.grains.len();
        if let Some(bodies) = self.squeezed(error) {
            let wall =
                |body: &u32| (*body as usize).checked_sub(grains).and_then(|wall| self.scene.walls.iter().nth(wall));
            let driven = bodies.iter().filter_map(wall).filter(|(_, wall)| wall.velocity.is_some());
            let places: Vec<String> = driven.map(|(name, _)| format!("walls.{name}")).collect();
            let walls = places.join(", ");
            return match places.is_empty() {
                true => "; leave room between the bodies".into(),
                false => {
                    format!("; let a force drive {walls} instead of a velocity, end that motion earlier, or leave room")
                }
            };
        }
        let help = match error {
            // the length of a step changes nothing
            StepError::NotAccepted { .. } if self.scene.rupture == Rupture::NextEvent => {
                "; another solver.kind.auto.start (\"stiff_limit\") or a larger solver.accept may help"
            }
            StepError::NotAccepted { .. } if newton => "; a smaller time.step or a larger solver.accept may help",
            StepError::NotAccepted { .. } => {
                "; a smaller time.step, more max_sweeps or a larger solver.accept may help"
            }
            StepError::NotFinite { .. } => "; a smaller time.step may help",
            StepError::NoSurface { .. } => {
                "; end the run before (stop, time.end), or give a larger membrane.disk_radius"
            }
            StepError::Yielded { .. } => "; a smaller solver.tolerance or time.step may help",
            // the message about too fast a step includes the remedy
            _ => "",
        };
        help.into()
    }

    /// The bodies that no motion satisfies.
    fn squeezed<'e>(&self, error: &'e StepError) -> Option<&'e Vec<u32>> {
        match (error, error.verdict()) {
            (_, Some(Verdict::NoSolution(bodies))) => Some(bodies),
            (StepError::Yielded { violation, .. }, _) => violation.jammed.as_ref(),
            _ => None,
        }
    }

    /// Name of a body in messages: the number of a grain, or the scene's name of a wall.
    fn name(&self, body: u32) -> String {
        self.scene.body_name(self.state.world.grains.len(), body as usize)
    }

    fn standing(&self, report: &StepReport<D>) -> StepProgress {
        StepProgress {
            step: self.state.world.steps,
            time: self.state.world.time,
            counts_steps: self.scene.rupture == Rupture::NextEvent,
            end: self.scene.steps() as f64 * self.scene.time.step,
            residual: report.residual,
            iterations: report.work.iterations(),
            broken: self.state.course.broken(),
            bonds: self.state.world.bonds.len(),
            load: self.state.course.load(&self.state.world),
            strain: self.state.course.strain(),
            stop: self.state.course.stop_progress(&self.state.world),
            bonded: self.scene.has_bonds(),
            may_end_early: self.scene.stop.as_ref().is_some_and(|stop| stop.load_drop.is_some())
                || self.scene.stages.iter().any(|stage| stage.until.is_some())
                || self.scene.rupture == Rupture::NextEvent,
        }
    }

    /// Write the last state, close the history at `path` and print the summary.
    pub fn conclude(
        mut self,
        path: &Path,
        outcome: Result<Ending, RunError>,
        json: bool,
        mut progress: Progress,
    ) -> Result<(), RunError> {
        progress.finish();
        // without a step, idle walls are not reported
        let idle = self.idle.iter().filter(|_| self.state.world.steps > 0);
        for wall in idle.filter_map(|wall| self.scene.walls.keys().nth(*wall)) {
            progress.note(&format!(
                "warning: walls.{wall}: no force ever acted on this driven wall: it touched no grain, or slid along grains \
                 without pressure; check its position and its direction"
            ));
        }
        let (ending, end) = match outcome {
            Ok(Ending::Interrupted) => {
                let way = "the history is complete up to there; `dem-run resume` continues the run";
                (Ending::Interrupted, Err(RunError::Interrupted(way)))
            }
            Ok(ending) => (ending, Ok(())),
            Err(error @ RunError::NoConvergence(_)) => (Ending::NoConvergence, Err(error)),
            Err(error) => return Err(error),
        };
        // due frames and checkpoints are already recorded
        let [framed, kept] = self.due();
        self.record(!framed, !kept)?;
        let cpu_time = self.recorder.cpu_time();
        self.recorder.finish(ending)?;
        let times = (cpu_time, self.preparation_time);
        let summary = self.state.summary(self.scene, self.solid_fraction, path, ending, times);
        let printed = print_result(&summary, json);
        // an error of the run takes precedence over an error in printing the summary
        end.and(printed.map_err(RunError::from))
    }
}

impl<D: Dim> RunState<D> {
    fn summary(
        &self,
        scene: &Scene,
        solid_fraction: Option<f64>,
        history: &Path,
        ending: Ending,
        (cpu_time, preparation_time): (f64, Option<f64>),
    ) -> Summary {
        let (world, course) = (&self.world, &self.course);
        let elastic = world.bonds.iter().any(|b| b.stiffness.is_some());
        let names: Vec<&String> = scene.walls.keys().collect();
        let loads = course.driven.iter().map(|driven| {
            let drives = scene.drives(names[driven.wall], &scene.walls[names[driven.wall]]);
            let moves = drives.iter().any(|drive| matches!(drive, SceneDrive::Velocity(_)));
            let may_fall = moves || scene.rupture == Rupture::NextEvent;
            WallLoads::of(names[driven.wall], may_fall, elastic, &driven.collapse)
        });
        let driven_walls: Vec<WallLoads> = loads.collect();
        let chosen = course.load_wall.map(|at| &driven_walls[at]);
        let disk = chosen.and_then(|loads| Disk::of(scene, &loads.wall, &course.extents));
        Summary {
            history: history.to_path_buf(),
            ending,
            steps: world.steps,
            has_reactions: scene.output.reactions && world.touches().any(|t| t.reaction.n != 0.0),
            time: world.time,
            load_time: (scene.rupture == Rupture::NextEvent).then_some(world.load_time),
            grains: world.grains.len(),
            solid_fraction,
            bonds: world.bonds.len(),
            no_bonds: bonds::why_none(scene).filter(|_| world.bonds.is_empty()),
            elastic,
            broken: course.broken,
            twists: scene.twists(),
            one_piece: course.one_piece,
            load_wall: chosen.map(|loads| loads.wall.clone()),
            failure: chosen.map_or_else(Failure::default, |loads| loads.failure),
            peak_load: chosen.and_then(|loads| loads.peak_load),
            peak_displacement: chosen.and_then(|loads| loads.peak_displacement),
            splitting: chosen.zip(disk).map(|(loads, disk)| {
                let collapse = loads.failure.collapse[0].filter(|_| !loads.failure.early[0]);
                Splitting::of(disk, collapse, loads.peak_load.filter(|_| loads.fallen))
            }),
            driven_walls,
            tolerance: scene.solver.tolerance,
            worst_residual: course.worst_residual,
            load_tolerance: world.settings.solver.load_tolerance(),
            worst_load_error: course.worst_load_error,
            work: course.work,
            solved_steps: course.solved_steps,
            missed_tolerance: course.missed_tolerance,
            missed_load_tolerance: course.missed_load_tolerance,
            rejected: course.rejected,
            penetration: course.penetration,
            bond_elongation: course.bond_elongation,
            mean_diameter: 2.0 * world.grains.radius.iter().sum::<f64>() / world.grains.len() as f64,
            external_work: world.ledger.external_work,
            energy_remainder: world.ledger.remainder,
            bond_remainder: world.ledger.bonds,
            cpu_time,
            preparation_time,
        }
    }
}
