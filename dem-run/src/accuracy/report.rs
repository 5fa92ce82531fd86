//! The results of the command, as written to `accuracy.json`.

use super::options::AccuracyOptions;
use super::profile::Profile;
use super::spread::{Spread, Varied, jaccard};
use super::trial::{Outcome, Sample, SolverName, Way};
use crate::limit::Limit;
use crate::scene::Scene;
use crate::scene::failure::in_one_piece;
use dem_core::dim::Dim;
use serde::Serialize;

/// The requested values, without repetitions, coarse before fine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Asked {
    /// Solvers.
    pub solvers: Vec<SolverName>,
    /// Tolerances (–), falling.
    pub tolerances: Vec<f64>,
    /// Time steps over that of the scene (–), falling.
    pub steps: Vec<f64>,
    /// Number of contact orders, and of starting reactions, for each solver.
    pub orders: u64,
    /// Whether runs continue to the scene's end.
    pub whole: bool,
    /// End of the scene's time (s).
    pub end: f64,
    /// Largest accepted residual of a step that misses the tolerance, if larger than the tolerance
    /// (–).
    pub accept: f64,
}

impl Asked {
    /// The options in order.
    #[must_use]
    pub fn of(scene: &Scene, options: &AccuracyOptions) -> Self {
        let falling = |list: &[f64]| {
            let mut list = list.to_vec();
            list.sort_unstable_by(|a, b| b.total_cmp(a));
            list.dedup();
            list
        };
        let mut solvers = vec![];
        for solver in &options.solvers {
            if !solvers.contains(solver) {
                solvers.push(*solver);
            }
        }
        Self {
            solvers,
            tolerances: falling(&options.tolerances),
            steps: falling(&options.steps),
            orders: options.orders,
            whole: options.whole,
            end: scene.time.end,
            accept: scene.solver.accept(),
        }
    }

    /// All ways to run the scene, in the order of the tables.
    #[must_use]
    pub fn ways(&self) -> Vec<Way> {
        let mut ways = vec![];
        for &solver in &self.solvers {
            for &step_factor in &self.steps {
                ways.extend(self.tolerances.iter().map(|&tolerance| Way { solver, tolerance, step_factor }));
            }
        }
        ways
    }

    /// The lowest tolerance (–).
    #[must_use]
    pub fn finest_tolerance(&self) -> f64 {
        self.tolerances.last().copied().unwrap_or_default()
    }

    /// Whether both tolerance and time step are the finest, whatever the solver.
    #[must_use]
    pub fn is_finest(&self, way: &Way) -> bool {
        way.tolerance == self.finest_tolerance() && Some(&way.step_factor) == self.steps.last()
    }
}

/// A row of the work–precision table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// How it was solved.
    #[serde(flatten)]
    pub way: Way,
    /// Time step (s).
    pub step: f64,
    /// What came out.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Jaccard index of its broken bonds and those of the reference (–).
    pub jaccard: Option<f64>,
    /// Collapse loads over those of the reference, less 1 (–).
    pub collapse_deviation: [Option<f64>; 2],
    /// Load at the first break over that of the reference, less 1 (–).
    pub first_break_deviation: Option<f64>,
}

impl Row {
    /// A row without comparison to the reference.
    #[must_use]
    pub fn new(way: Way, step: f64, outcome: Outcome) -> Self {
        Self { way, step, outcome, jaccard: None, collapse_deviation: [None; 2], first_break_deviation: None }
    }

    /// Force at the first break (N).
    #[must_use]
    pub fn first_break(&self) -> Option<f64> {
        self.outcome.first_break.as_ref()?.load
    }
}

/// Runs with variations on which the results should not depend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Indeterminacy {
    /// Tolerance of all these runs (–).
    pub tolerance: f64,
    /// Time step over that of the scene (–).
    pub step_factor: f64,
    /// Spreads of the results.
    pub spreads: Vec<Spread>,
    /// The runs, without the one of the work–precision table.
    pub runs: Vec<VariedRun>,
}

/// A run with a variation on which its results should not depend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariedRun {
    /// The solver.
    pub solver: SolverName,
    /// What is varied.
    pub varied: Varied,
    /// Seed of the random generator.
    pub number: u64,
    /// What came out.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// The limit load of the sample, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum LimitLoad {
    /// What was found.
    Found(Limit),
    /// Why it is not known.
    Missing {
        /// The reason.
        reason: String,
    },
}

impl From<Result<Limit, String>> for LimitLoad {
    fn from(found: Result<Limit, String>) -> Self {
        found.map_or_else(|reason| Self::Missing { reason }, Self::Found)
    }
}

/// Everything that was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Title of the scene.
    pub title: Option<String>,
    /// Grains of the sample.
    pub grains: usize,
    /// Bonds of the sample.
    pub bonds: usize,
    /// Whether they are elastic.
    pub elastic: bool,
    /// Solid fraction of a random sample (–).
    pub solid_fraction: Option<f64>,
    /// Whether all grains are bonded into one piece.
    pub one_piece: bool,
    /// Whether a wall is driven: then there are loads.
    pub driven: bool,
    /// The wall whose loads are reported, if a wall is driven.
    pub load_wall: Option<String>,
    /// Time step of the scene (s).
    pub step: f64,
    /// The requested values.
    pub asked: Asked,
    /// Whether the command was interrupted, so that the report is incomplete.
    pub interrupted: bool,
    /// Index of the reference run; none if no run was completed.
    pub reference: Option<usize>,
    /// The limit load; none for a sample without bonds.
    pub limit: Option<LimitLoad>,
    /// The work–precision table.
    pub runs: Vec<Row>,
    /// The indeterminacy, if measured.
    pub indeterminacy: Option<Indeterminacy>,
    /// The performance profiles, if measured.
    pub profile: Option<Profile>,
    /// The scene, as it was read.
    pub scene: serde_json::Value,
}

impl Report {
    /// A report without measurements.
    #[must_use]
    pub fn new<D: Dim>(scene: &Scene, asked: &Asked, sample: &Sample<D>) -> Self {
        Self {
            title: scene.title.clone(),
            grains: sample.grains.len(),
            bonds: sample.bonds.len(),
            elastic: sample.elastic(),
            solid_fraction: sample.solid_fraction,
            one_piece: in_one_piece(sample.grains.len(), sample.bonds.iter().map(|bond| bond.pair)),
            driven: !scene.driven_walls().is_empty(),
            load_wall: scene.load_wall().map(String::from),
            step: scene.time.step,
            asked: asked.clone(),
            interrupted: false,
            reference: None,
            limit: None,
            runs: vec![],
            indeterminacy: None,
            profile: None,
            scene: serde_json::to_value(scene).unwrap_or_default(),
        }
    }

    /// Chooses the reference and compares all runs with it.
    ///
    /// The reference is the completed run with the lowest tolerance, then the shortest step, then
    /// the lowest median residual.
    pub fn compare(&mut self) {
        let key = |row: &Row| [row.way.tolerance, row.way.step_factor, row.outcome.median_residual];
        let finer = |a: &usize, b: &usize| {
            let (a, b) = (key(&self.runs[*a]), key(&self.runs[*b]));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
        };
        let made = |outcome: &Outcome| outcome.error.is_none() && outcome.steps > 0;
        let ended = (0..self.runs.len()).filter(|k| made(&self.runs[*k].outcome));
        self.reference = ended.min_by(finer);
        let Some(reference) = self.reference.map(|k| self.runs[k].clone()) else { return };
        let deviation = |a: Option<f64>, b: Option<f64>| Some(a? / b.filter(|b| *b != 0.0)? - 1.0);
        for row in &mut self.runs {
            let (own, best) = (&row.outcome, &reference.outcome);
            row.jaccard = (self.bonds > 0).then(|| jaccard(&own.broken, &best.broken));
            row.first_break_deviation = deviation(row.first_break(), reference.first_break());
            row.collapse_deviation = [0, 1].map(|k| deviation(own.failure.collapse[k], best.failure.collapse[k]));
        }
    }
}
