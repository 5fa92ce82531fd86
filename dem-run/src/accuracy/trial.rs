//! One run of the command: time steps of a scene without a history, and the results.

use crate::build::{Built, settings};
use crate::clock::thread_time;
use crate::collapse::{Collapse, Failure};
use crate::course::Course;
use crate::history::Ending;
use crate::scene::{GaussSeidel, Newton, Scene, SolverKind};
use dem_core::body::{Grain, Grains, Load, Wall};
use dem_core::bond::{Bond, Bonds};
use dem_core::contact::Local;
use dem_core::dim::{Dim, Vect};
use dem_core::problem::ContactProblem;
use dem_core::world::{Membrane, StepError, StepReport, World};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Serialize, Serializer};

/// Largest random starting reaction of a bond, over its strength (–).
const START_SHARE: f64 = 0.1;

/// A solver by its name; its other settings are those of the scene where the scene has the same
/// solver, else the defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum SolverName {
    /// Methods in a fixed order until one solves the problem.
    Auto,
    /// Non-linear Gauss–Seidel.
    #[value(alias = "gauss_seidel")]
    GaussSeidel,
    /// Semismooth Newton, then the interior-point method.
    Newton,
    /// The interior-point method.
    Interior,
}

impl SolverName {
    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::GaussSeidel => "gauss-seidel",
            Self::Newton => "newton",
            Self::Interior => "interior",
        }
    }

    fn kind(self, scene: &SolverKind) -> SolverKind {
        let newton = match scene {
            SolverKind::Auto(newton) | SolverKind::Newton(newton) | SolverKind::Interior(newton) => newton.clone(),
            SolverKind::GaussSeidel(_) => Newton::default(),
        };
        match (self, scene) {
            (Self::Auto, _) => SolverKind::Auto(newton),
            (Self::Newton, _) => SolverKind::Newton(newton),
            (Self::Interior, _) => SolverKind::Interior(newton),
            (Self::GaussSeidel, SolverKind::GaussSeidel(_)) => scene.clone(),
            (Self::GaussSeidel, _) => SolverKind::GaussSeidel(GaussSeidel::default()),
        }
    }
}

/// Solver settings of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Way {
    /// The solver.
    pub solver: SolverName,
    /// Its tolerance (–).
    pub tolerance: f64,
    /// Time step over that of the scene (–).
    pub step_factor: f64,
}

impl Way {
    /// The scene with these settings. A step that misses the tolerance is accepted if the scene
    /// accepts its residual.
    #[must_use]
    pub fn scene(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        let accept = scene.solver.accept().max(self.tolerance);
        scene.solver.kind = self.solver.kind(&scene.solver.kind);
        scene.solver.tolerance = self.tolerance;
        scene.solver.accept = Some(accept);
        scene.time.step *= self.step_factor;
        scene
    }
}

/// A variation on which the results of a run should not depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Nothing.
    AsGiven,
    /// The order of the grains, and so of the contacts, from this seed.
    Order(u64),
    /// The starting reactions of the bonds, from this seed.
    Start(u64),
}

/// The prepared sample, common to all runs.
pub struct Sample<D: Dim> {
    /// Solid fraction of a random sample (–).
    pub solid_fraction: Option<f64>,
    /// The bonds, all intact.
    pub bonds: Bonds,
    /// The grains.
    pub grains: Grains<D>,
    walls: Vec<Wall<D>>,
    loads: Vec<Load<D>>,
    membrane: Option<Membrane<D>>,
}

impl<D: Dim> Sample<D> {
    /// The sample of a world at time zero.
    #[must_use]
    pub fn of(built: Built<D>) -> Self {
        let World { grains, walls, loads, bonds, membrane, .. } = built.world;
        Self { solid_fraction: built.solid_fraction, bonds, grains, walls, loads, membrane }
    }

    /// Whether the bonds have a stiffness.
    #[must_use]
    pub fn elastic(&self) -> bool {
        self.bonds.iter().any(|bond| bond.stiffness.is_some())
    }

    /// A world at time zero, and for each of its bonds the number of that bond in the sample.
    pub(super) fn world(&self, scene: &Scene, variant: Variant) -> (World<D>, Vec<u32>) {
        let mut world = World::new(self.grains.clone(), self.walls.clone(), self.loads.clone(), settings(scene));
        let mut numbers: Vec<u32> = (0..self.bonds.len() as u32).collect();
        world.bonds.clone_from(&self.bonds);
        world.membrane.clone_from(&self.membrane);
        match variant {
            Variant::AsGiven => {}
            Variant::Order(seed) => (world, numbers) = self.reordered(scene, seed),
            Variant::Start(seed) => start_anywhere(&mut world, seed),
        }
        (world, numbers)
    }

    /// A world as in [`Self::world`], with its grains in another order.
    fn reordered(&self, scene: &Scene, seed: u64) -> (World<D>, Vec<u32>) {
        let mut order: Vec<usize> = (0..self.grains.len()).collect();
        order.shuffle(&mut Pcg64::seed_from_u64(seed));
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, old)| place[*old] = new);
        let grains = order.iter().map(|old| self.grain(*old)).collect();
        let loads = self.loads.iter().map(|load| Load { grain: place[load.grain], ..load.clone() }).collect();
        let moved = |bond: &Bond| {
            let mut pair = bond.pair.map(|k| place[k as usize] as u32);
            pair.sort_unstable();
            Bond { pair, ..*bond }
        };
        let mut bonds: Vec<(Bond, u32)> = self.bonds.iter().map(moved).zip(0..).collect();
        bonds.sort_unstable_by_key(|(bond, _)| bond.pair);
        let mut world = World::new(grains, self.walls.clone(), loads, settings(scene));
        let (bonds, numbers): (Vec<_>, Vec<_>) = bonds.into_iter().unzip();
        world.bonds = bonds.into();
        world.membrane = self.membrane.as_ref().map(Membrane::unfound);
        (world, numbers)
    }

    fn grain(&self, k: usize) -> Grain<D> {
        let g = &self.grains;
        Grain {
            position: g.position[k],
            velocity: g.velocity[k],
            spin: g.spin[k],
            radius: g.radius[k],
            mass: g.mass[k],
            inertia: g.inertia[k],
            fixed: g.fixed[k],
        }
    }
}

/// Sets random starting reactions of the bonds, up to [`START_SHARE`] of the strength of each.
fn start_anywhere<D: Dim>(world: &mut World<D>, seed: u64) {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut upto = |limit: f64| START_SHARE * limit * (2.0 * random.random::<f64>() - 1.0);
    world.start_from(|bond| {
        let (shear, arm) = (bond.shear.min(bond.rolling) * bond.strength, bond.mean_diameter);
        let mut start = Local::<D::Tangent, D::Moment>::zero();
        start.n = upto(bond.strength);
        for k in 0..D::Tangent::LEN {
            start.t[k] = upto(shear);
            start.m[k] = upto(shear * arm);
        }
        for k in D::Tangent::LEN..D::Moment::LEN {
            start.m[k] = upto(bond.twist * bond.strength * arm);
        }
        start
    });
}

/// A contact problem of a step of a run.
pub struct Posed<D: Dim> {
    /// Number of steps made before.
    pub step: u64,
    /// Time (s).
    pub time: f64,
    /// The problem, with the reactions of the last step as a start.
    pub problem: ContactProblem<D>,
}

/// A limited number of contact problems, sampled from a run at equal intervals of steps. When the
/// limit is exceeded, every second problem is dropped and the interval doubles.
struct Problems<D: Dim> {
    list: Vec<Posed<D>>,
    most: usize,
    every: u64,
}

impl<D: Dim> Problems<D> {
    fn look(&mut self, world: &mut World<D>) {
        if self.most == 0 || !world.steps.is_multiple_of(self.every) {
            return;
        }
        let problem = world.contact_problem();
        if problem.is_empty() {
            return;
        }
        self.list.push(Posed { step: world.steps, time: world.time, problem });
        if self.list.len() > self.most {
            self.every *= 2;
            self.list.retain(|posed| posed.step.is_multiple_of(self.every));
        }
    }
}

/// What ended a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The strain is above 1e-3 and 5 % of the bonds are broken: all reported loads are known.
    Collapsed,
    /// An ending of the scene.
    Scene(Ending),
    /// A step was not solved, or wrongly: the message.
    Failed(String),
}

impl End {
    /// Short name.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Collapsed => "collapse".into(),
            Self::Scene(Ending::NoConvergence) | Self::Failed(_) => "NO CONVERGENCE".into(),
            Self::Scene(ending) => ending.label().to_lowercase().replace('_', " "),
        }
    }
}

impl Serialize for End {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name().to_lowercase().replace(' ', "_"))
    }
}

/// The first bond that broke.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstBreak {
    /// Load (N), if the scene has a load wall.
    pub load: Option<f64>,
    /// Time at the end of the step (s).
    pub time: f64,
    /// Step, counted from 1.
    pub step: u64,
    /// Number of the bond. Of several in one step, the first of the first cascade round.
    pub bond: u32,
    /// Its two grains.
    pub pair: [u32; 2],
    /// Position of the bond (m).
    pub place: Vec<f64>,
}

/// The results of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Why the run ended.
    pub ended: End,
    /// Why a step was not solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Simulated time (s).
    pub time: f64,
    /// Steps made.
    pub steps: u64,
    /// CPU time of the steps (s).
    pub cpu_time: f64,
    /// Iterations of all solves: sweeps, or Newton iterations.
    pub iterations: u64,
    /// Largest residual of a solve (–).
    pub worst_residual: f64,
    /// Median over the steps of the largest residual in each (–).
    pub median_residual: f64,
    /// Largest false acceleration of a step before the first break (–), see
    /// [`StepReport::false_acceleration`].
    pub false_acceleration: f64,
    /// Largest component of the sample's strain before the first break (–), which is entirely
    /// false; none without bonds or with elastic bonds.
    pub false_strain: Option<f64>,
    /// Accepted steps that missed the tolerance.
    pub missed_tolerance: u64,
    /// Solves that were not accepted: their steps were halved.
    pub rejected: u64,
    /// Deepest overlap (m).
    pub penetration: f64,
    /// Remainder of the energy balance (J).
    pub energy_remainder: f64,
    /// Energy lost in intact bonds (J).
    pub bond_remainder: f64,
    /// The first break.
    pub first_break: Option<FirstBreak>,
    /// Loads of the load wall at failure (N).
    pub failure: Failure,
    /// Numbers of the broken bonds, sorted.
    pub broken: Vec<u32>,
}

/// A run to be carried out.
pub struct Trial<'a, D: Dim> {
    /// The sample.
    pub sample: &'a Sample<D>,
    /// The scene, with the solver settings of the run.
    pub scene: &'a Scene,
    /// What is varied.
    pub variant: Variant,
    /// Whether the run continues to the scene's end.
    pub whole: bool,
    /// Maximum number of contact problems sampled from the run.
    pub problems: usize,
}

impl<D: Dim> Trial<'_, D> {
    /// Carries out the run. `watch` receives the completed share of the simulated time; if it
    /// returns false, the run stops and the result is none.
    pub fn run(&self, watch: &dyn Fn(f64) -> bool) -> Option<(Outcome, Vec<Posed<D>>)> {
        let (mut world, numbers) = self.sample.world(self.scene, self.variant);
        let mut state = Followed::new(self.scene, &world);
        let mut problems = Problems { list: vec![], most: self.problems, every: 1 };
        let steps = self.scene.steps();
        let ended = loop {
            if world.steps >= steps {
                break End::Scene(Ending::Time);
            }
            if !watch(world.steps as f64 / steps as f64) {
                return None;
            }
            problems.look(&mut world);
            let began = thread_time();
            let step = world.step();
            state.cpu_time += thread_time() - began;
            match step {
                Ok(report) => state.follow(&world, &report),
                Err(StepError::Unbalanced { .. }) => break End::Scene(Ending::NoEquilibrium),
                Err(error) => {
                    let name = |body: u32| self.scene.body_name(world.grains.len(), body as usize);
                    break End::Failed(error.message(&name));
                }
            }
            if state.blown_up(&world) {
                break End::Failed(format!(
                    "the energy of the motion far exceeds the energy supplied at t = {:.6e} s: solves were accepted that are wrong",
                    world.time
                ));
            }
            match state.course.advance(self.scene, &mut world) {
                Ok(None) => {}
                Ok(Some(ending)) => break End::Scene(ending),
                Err(error) => break End::Failed(error.to_string()),
            }
            let failed = |loads: &Collapse| loads.passed[1] && loads.failure.broken_share.is_some();
            if !self.whole && state.course.loads().is_some_and(failed) {
                break End::Collapsed;
            }
        };
        Some((state.outcome(ended, &world, &numbers, &self.sample.bonds), problems.list))
    }
}

/// Results of a run in progress.
struct Followed<D: Dim> {
    course: Course<D>,
    /// Kinetic energy at the start (J).
    kinetic: f64,
    cpu_time: f64,
    residuals: Vec<f64>,
    false_acceleration: f64,
    strain: f64,
    first: Option<FirstBreak>,
}

impl<D: Dim> Followed<D> {
    fn new(scene: &Scene, world: &World<D>) -> Self {
        let course = Course::new(scene, world);
        let kinetic = world.ledger.kinetic;
        Self { course, kinetic, cpu_time: 0.0, residuals: vec![], false_acceleration: 0.0, strain: 0.0, first: None }
    }

    /// Adds a step.
    fn follow(&mut self, world: &World<D>, report: &StepReport<D>) {
        self.course.count(world, report);
        self.residuals.push(report.residual);
        if self.first.is_some() {
            return;
        }
        if let Some(failed) = report.breaks.first() {
            self.first = Some(FirstBreak {
                load: self.course.load(world),
                time: report.time,
                step: world.steps,
                bond: failed.bond,
                pair: failed.pair,
                place: failed.point.as_slice().to_vec(),
            });
            return;
        }
        self.false_acceleration = self.false_acceleration.max(report.false_acceleration);
        self.strain = world.strain().iter().fold(self.strain, |worst, e| worst.max(e.abs()));
    }

    /// Whether the kinetic energy exceeds both ten times the energy input and the kinetic energy of
    /// grains that move by their radius in a step. Such a run is meaningless, and its contact
    /// detection would compare all pairs of grains.
    fn blown_up(&self, world: &World<D>) -> bool {
        let (ledger, g) = (&world.ledger, &world.grains);
        let fast = g.mass.iter().zip(&g.radius).map(|(m, r)| 0.5 * m * (r / world.settings.step).powi(2)).sum::<f64>();
        ledger.kinetic > (10.0 * (ledger.external_work.abs() + self.kinetic)).max(fast)
    }

    /// The outcome, with the sample's numbers of bonds and grains.
    fn outcome(mut self, ended: End, world: &World<D>, numbers: &[u32], bonds: &[Bond]) -> Outcome {
        if let Some(first) = &mut self.first {
            first.bond = numbers[first.bond as usize];
            first.pair = bonds[first.bond as usize].pair;
        }
        let holds = |k: usize| world.bonds[k].status == dem_core::bond::BondStatus::Intact;
        let mut broken: Vec<u32> = (0..numbers.len()).filter(|k| !holds(*k)).map(|k| numbers[k]).collect();
        broken.sort_unstable();
        self.residuals.sort_unstable_by(f64::total_cmp);
        Outcome {
            error: if let End::Failed(why) = &ended { Some(why.clone()) } else { None },
            ended,
            time: world.time,
            steps: world.steps,
            cpu_time: self.cpu_time,
            iterations: self.course.work.iterations(),
            worst_residual: self.course.worst_residual,
            median_residual: self.residuals.get(self.residuals.len() / 2).copied().unwrap_or(0.0),
            false_acceleration: self.false_acceleration,
            false_strain: (!bonds.is_empty() && bonds.iter().all(|b| b.stiffness.is_none())).then_some(self.strain),
            missed_tolerance: self.course.missed_tolerance,
            rejected: self.course.rejected,
            penetration: self.course.penetration,
            energy_remainder: world.ledger.remainder,
            bond_remainder: world.ledger.bonds,
            first_break: self.first,
            failure: self.course.loads().map_or_else(Failure::default, |loads| loads.failure),
            broken,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::build;
    use crate::scene::from_text;
    use dem_core::dim::D2;
    use dem_core::world::Break;

    /// Nine cemented disks on a lattice, one of which is pulled.
    const SCENE: &str = r#"{
        "dimension": 2, "sample": { "lattice": { "square": { "diameter": 1e-3, "rows": 3, "columns": 3 } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
        "grains": { "fixed": [0], "loads": [{ "grain": 8, "force": [1, 0] }] },
        "time": { "step": 1e-4, "end": 1e-3 }, "output": { "every_steps": 1 }
    }"#;

    fn sample() -> (Scene, Sample<D2>) {
        let scene = from_text("scene", SCENE, &[]).expect("scene");
        let built = build::<D2>(&scene, None, &mut |_| true).expect("world");
        (scene, Sample::of(built))
    }

    #[test]
    fn another_order_is_the_same_sample() {
        let (scene, sample) = sample();
        let (world, numbers) = sample.world(&scene, Variant::Order(3));
        assert_ne!(world.grains.position, sample.grains.position);
        let middle = |grains: &Grains<D2>, pair: [u32; 2]| {
            let [i, j] = pair.map(|k| grains.position[k as usize]);
            (i + j) * 0.5
        };
        for (bond, number) in world.bonds.iter().zip(&numbers) {
            let same = &sample.bonds[*number as usize];
            assert_eq!(middle(&world.grains, bond.pair), middle(&sample.grains, same.pair));
        }
        assert!(world.bonds.windows(2).all(|two| two[0].pair < two[1].pair));
        let place = |grains: &Grains<D2>, k: usize| grains.position[k];
        assert_eq!(place(&world.grains, world.loads[0].grain), place(&sample.grains, 8));
        let fixed = world.grains.fixed.iter().position(|fixed| *fixed).expect("a fixed grain");
        assert_eq!(place(&world.grains, fixed), place(&sample.grains, 0));
    }

    /// The first breaks of a run: step, cascade round, the sample's number of the bond, mode.
    fn first_breaks(
        scene: &Scene,
        sample: &Sample<D2>,
        variant: Variant,
        count: usize,
    ) -> Vec<(u64, u32, u32, String)> {
        let (mut world, numbers) = sample.world(scene, variant);
        let mut list = Vec::new();
        while list.len() < count {
            let report = world.step().expect("an accepted step");
            let of = |b: &Break<D2>| (world.steps, b.round, numbers[b.bond as usize], format!("{:?}", b.mode));
            list.extend(report.breaks.iter().map(of));
        }
        list.sort();
        list.truncate(count);
        list
    }

    /// Compares the first breaks of `compression` with these settings to those of ten variants.
    fn breaks_are_the_same(settings: &[&str], variant: fn(u64) -> Variant) {
        let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/compression.json"));
        // ten times the scene's loading rate: a tenth of the steps
        let settings = [&["walls.top.force_rate=2000"], settings].concat();
        let settings: Vec<String> = settings.into_iter().map(String::from).collect();
        let scene = crate::scene::load(path, &settings).expect("scene");
        let sample = Sample::of(build::<D2>(&scene, None, &mut |_| true).expect("world"));
        let as_given = first_breaks(&scene, &sample, Variant::AsGiven, 20);
        for seed in 1..=10 {
            assert_eq!(first_breaks(&scene, &sample, variant(seed), 20), as_given, "{:?}", variant(seed));
        }
    }

    #[test]
    fn the_first_breaks_depend_on_no_order() {
        breaks_are_the_same(&[], Variant::Order);
    }

    #[test]
    fn the_first_breaks_from_zero_depend_on_no_start() {
        breaks_are_the_same(&[r#"solver.kind={"auto":{"start":"stiff_limit"}}"#], Variant::Start);
    }

    #[test]
    fn a_start_reaches_the_first_problem() {
        let (scene, sample) = sample();
        let (mut as_given, _) = sample.world(&scene, Variant::AsGiven);
        let (mut world, _) = sample.world(&scene, Variant::Start(1));
        assert!(as_given.contact_problem().bonded.iter().all(|contact| contact.r.n == 0.0));
        let started = world.contact_problem();
        let limit = START_SHARE * 10.0 * scene.time.step;
        assert!(started.bonded.iter().all(|contact| contact.r.n != 0.0 && contact.r.n.abs() <= limit));
    }
}
