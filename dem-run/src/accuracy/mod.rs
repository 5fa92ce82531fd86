//! `dem-run accuracy`: dependence of the results of a scene on solver, tolerance, time step,
//! contact order and starting reactions.
//!
//! One sample is run with several solvers, tolerances and time steps, and each run is compared with
//! the finest of them ([`report`]). Then contact orders and starting reactions are varied
//! ([`spread`]). Last, every solver solves the contact problems of the finest run ([`profile`]).

mod options;
mod pictures;
pub mod profile;
pub mod report;
pub mod spread;
mod tables;
pub mod trial;

pub use options::AccuracyOptions;

use crate::build::build;
use crate::check;
use crate::error::RunError;
use crate::in_dimension;
use crate::limit::{Limit, Loads};
use crate::memory;
use crate::output::Folder;
use crate::progress::Progress;
use crate::run::handle_signals;
use crate::scene::{Rupture, Scene};
use crate::signals::Interrupt;
use dem_core::dim::Dim;
use profile::Profile;
use rayon::prelude::*;
use report::{Asked, Indeterminacy, Report, Row, VariedRun};
use spread::{Spread, Varied};
use std::sync::{Mutex, PoisonError};
use trial::{Outcome, Posed, Sample, SolverName, Trial, Variant, Way};

/// Maximum number of contact problems sampled from a run for the profile.
const MOST_PROBLEMS: usize = 50;
/// Maximum number of grains of a sample whose limit load is computed.
const MOST_LIMITED: usize = 5000;

/// Measures the accuracy of a scene, prints the tables, and writes tables and pictures.
///
/// # Errors
/// [`RunError`], for example for a scene that drives several walls and names no load wall.
/// Measurements made before an interruption are written. A run that does not converge is a row of
/// the table, not an error.
pub fn accuracy(scene: &Scene, options: &AccuracyOptions) -> Result<(), RunError> {
    if let Some(names) = scene.load_unknown() {
        return Err(RunError::Usage(format!(
            "several walls are driven, {names}: name the one that loads the sample as load_wall in the scene, or with \
             --set load_wall=NAME"
        )));
    }
    if scene.rupture == Rupture::NextEvent && options.solvers.contains(&SolverName::GaussSeidel) {
        return Err(RunError::Usage(
            "Gauss–Seidel does not solve rupture next_event: name other solvers, as in `--solvers auto,newton`".into(),
        ));
    }
    if let Some(stage) = scene.cement_stage() {
        return Err(RunError::Usage(format!(
            "stages.{stage} cements, and accuracy compares runs whose bonds form at the start: `--set \
             stages.{stage}.cement=false`"
        )));
    }
    if !options.ignore_memory {
        memory::refuse_too_large(scene, check::count(scene)?)?;
    }
    let interrupt = handle_signals()?;
    let mut folder = Folder::create(options.folder.clone())?;
    let report = in_dimension!(scene, D => measure::<D>(scene, options, &interrupt)?);
    let json = serde_json::to_string_pretty(&report)? + "\n";
    folder.write("accuracy.json", json.as_bytes())?;
    tables::write(&report, &mut folder)?;
    pictures::draw(&report, &mut folder)?;
    crate::output::print(&if options.json { json } else { tables::text(&report) })?;
    if !options.execution.quiet {
        use std::io::Write;
        let mut stderr = std::io::stderr();
        folder.written().iter().for_each(|path| drop(writeln!(stderr, "wrote {}", path.display())));
    }
    if report.interrupted { Err(RunError::Interrupted("the measurements so far are written")) } else { Ok(()) }
}

fn measure<D: Dim>(scene: &Scene, options: &AccuracyOptions, interrupt: &Interrupt) -> Result<Report, RunError> {
    let mut progress = options.execution.show();
    let built = build::<D>(scene, None, &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?;
    let sample = Sample::of(built);
    let asked = Asked::of(scene, options);
    let kinds = if sample.bonds.is_empty() { 0 } else { Varied::of(sample.elastic()).len() };
    let varied = asked.solvers.len() * kinds * options.orders as usize;
    let meter = Meter::new(progress, interrupt, asked.ways().len() + varied + 1);
    let measuring = Measuring { scene, sample: &sample, asked: &asked, meter: &meter };
    let mut report = Report::new(scene, &asked, &sample);
    if !sample.bonds.is_empty() && !interrupt.requested() {
        meter.tell(0, "limit load", 0.0);
        report.limit = Some(limit_of(scene, &sample).into());
    }
    let posed = measuring.runs(&mut report);
    if varied > 0 && !interrupt.requested() {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(options.execution.threads.unwrap_or(0)).build();
        let threads =
            threads.map_err(|error| RunError::System { what: "cannot start threads".into(), source: error.into() })?;
        report.indeterminacy = Some(threads.install(|| measuring.indeterminacy(&report.runs)));
    }
    if !interrupt.requested() {
        report.profile = measuring.profile(&posed);
    }
    report.interrupted = interrupt.requested();
    meter.finish();
    Ok(report)
}

/// The limit load of the sample, or why there is none.
fn limit_of<D: Dim>(scene: &Scene, sample: &Sample<D>) -> Result<Limit, String> {
    let grains = sample.grains.len();
    if grains > MOST_LIMITED {
        return Err(format!("not computed for more than {MOST_LIMITED} grains, here {grains}: see dem-run limit"));
    }
    let loads = Loads::of(scene).map_err(|error| error.to_string())?;
    let (mut world, _) = sample.world(scene, Variant::AsGiven);
    loads.limit(scene, &mut world).map_err(|error| error.to_string())
}

/// One progress bar over all runs, and the check for an interruption.
struct Meter<'a> {
    progress: Mutex<Progress>,
    interrupt: &'a Interrupt,
    /// Completed share of each run (0 to 1).
    shares: Mutex<Vec<f64>>,
}

impl<'a> Meter<'a> {
    fn new(progress: Progress, interrupt: &'a Interrupt, runs: usize) -> Self {
        Self { progress: Mutex::new(progress), interrupt, shares: Mutex::new(vec![0.0; runs]) }
    }

    /// Reports the completed share of run `k`; `label` names the kind of run. Returns false if the
    /// run must stop.
    fn tell(&self, k: usize, label: &str, share: f64) -> bool {
        let done = {
            let mut shares = self.shares.lock().unwrap_or_else(PoisonError::into_inner);
            shares[k] = share;
            shares.iter().sum::<f64>() / shares.len() as f64
        };
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).phase(label, done);
        !self.interrupt.requested()
    }

    fn finish(&self) {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
    }
}

/// Input of all measurements.
struct Measuring<'a, D: Dim> {
    scene: &'a Scene,
    sample: &'a Sample<D>,
    asked: &'a Asked,
    meter: &'a Meter<'a>,
}

impl<D: Dim> Measuring<'_, D> {
    /// Runs the scene in every way, adds the rows, and returns the contact problems of the
    /// reference.
    ///
    /// The runs are sequential, because their CPU times are reported.
    fn runs(&self, report: &mut Report) -> Vec<Posed<D>> {
        let ways = self.asked.ways();
        let mut posed = vec![];
        for (k, way) in ways.iter().enumerate() {
            let Way { solver, tolerance, .. } = *way;
            let scene = way.scene(self.scene);
            let label =
                format!("run {} of {}: {}, {tolerance:e}, {:e} s", k + 1, ways.len(), solver.name(), scene.time.step);
            let problems = if self.asked.is_finest(way) { MOST_PROBLEMS } else { 0 };
            let trial = Trial {
                sample: self.sample,
                scene: &scene,
                variant: Variant::AsGiven,
                whole: self.asked.whole,
                problems,
            };
            let Some((outcome, problems)) = trial.run(&|share| self.meter.tell(k, &label, share)) else { break };
            report.runs.push(Row::new(*way, scene.time.step, outcome));
            self.meter.tell(k, &label, 1.0);
            posed.push(problems);
        }
        report.compare();
        // if no finest run was completed, the problems of another run are used
        let full = |k: &usize| !posed[*k].is_empty();
        let from = report.reference.filter(full).or_else(|| (0..posed.len()).find(full));
        from.map_or(vec![], |k| posed.swap_remove(k))
    }

    /// Runs the sample with every solver, in other contact orders and from other starting
    /// reactions, at the finest tolerance and the longest step. The results should depend on
    /// neither order nor start.
    ///
    /// The runs are parallel; the order of the results is fixed.
    fn indeterminacy(&self, rows: &[Row]) -> Indeterminacy {
        let asked = self.asked;
        let kinds = Varied::of(self.sample.elastic());
        let way = |solver| Way { solver, tolerance: asked.finest_tolerance(), step_factor: asked.steps[0] };
        let list: Vec<(SolverName, Varied, u64)> = (asked.solvers.iter())
            .flat_map(|s| kinds.iter().map(|v| (*s, *v)))
            .flat_map(|(s, v)| (1..=asked.orders).map(move |n| (s, v, n)))
            .collect();
        let first = asked.ways().len();
        let run = |(k, &(solver, varied, number)): (usize, &(SolverName, Varied, u64))| {
            let scene = way(solver).scene(self.scene);
            let variant = if varied == Varied::Order { Variant::Order(number) } else { Variant::Start(number) };
            let trial = Trial { sample: self.sample, scene: &scene, variant, whole: asked.whole, problems: 0 };
            let tell = |share: f64| self.meter.tell(first + k, "indeterminacy", share);
            let (outcome, _) = trial.run(&tell)?;
            tell(1.0);
            Some(VariedRun { solver, varied, number, outcome })
        };
        let runs: Vec<VariedRun> = list.par_iter().enumerate().filter_map(run).collect();
        let spread = |solver, varied| {
            let as_given = rows.iter().find(|row| row.way == way(solver)).map(|row| &row.outcome);
            let others = runs.iter().filter(|run| run.solver == solver && run.varied == varied).map(|run| &run.outcome);
            Spread::of(solver, varied, &as_given.into_iter().chain(others).collect::<Vec<&Outcome>>())
        };
        let spreads = (asked.solvers.iter()).flat_map(|s| kinds.iter().map(|varied| spread(*s, *varied))).collect();
        Indeterminacy { tolerance: asked.finest_tolerance(), step_factor: asked.steps[0], spreads, runs }
    }

    /// Solves the problems of the reference with every solver.
    fn profile(&self, posed: &[Posed<D>]) -> Option<Profile> {
        if posed.is_empty() {
            return None;
        }
        let asked = self.asked;
        let way = Way { solver: asked.solvers[0], tolerance: asked.finest_tolerance(), step_factor: 1.0 };
        let last = self.meter.shares.lock().unwrap_or_else(PoisonError::into_inner).len() - 1;
        let tell = |share: f64| self.meter.tell(last, "performance profile", share);
        Profile::measure(posed, self.scene, &asked.solvers, &way, &tell)
    }
}
