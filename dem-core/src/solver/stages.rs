//! The default solver: its stages are tried in order, the cheapest first, until one solves the
//! problem.
//!
//! | stage | what it does | when it is tried |
//! |---|---|---|
//! | [`Route::Extrapolation`] | adds the constant increment of the last steps to the reactions | bonds, while a sample at rest is loaded at a constant rate |
//! | [`Route::Sweeps`] | Gauss–Seidel from the last reactions | all contacts are dry |
//! | [`Route::ActiveSet`] | Newton from the active set of the last reactions | bonds, or a cheap problem |
//! | [`Route::InteriorPoint`] | follows the central path through its folds, with Coulomb's law exact | as Newton |
//! | [`Route::Sweeps`] | Gauss–Seidel from the best point of the path | the path missed the tolerance |
//!
//! A dry problem is cheap if a factorisation takes few operations for each contact
//! ([`tuning::CHEAP`]). One that is not is swept on to the accepted residual, and goes to Newton
//! and the path only where that fails.
//!
//! A solve that misses the tolerance is accepted up to [`StagedSettings::accept`] and refused
//! beyond. No stage depends on elapsed time, and only the extrapolation has a back-off. A solve
//! depends on its problem, the last reactions, Newton's cached factors and the growth known to the
//! extrapolation.

use super::assembled::Visited;
use super::extrapolation::Extrapolation;
use super::graph::Graph;
use super::history::history;
use super::interior::{Aims, Found, Interior};
use super::newton::Newton;
use super::rows::{Row, Rows, StiffnessRatio};
use super::solvable::Solvable;
use super::{ContactSolver, GaussSeidelSettings, SolveReport, SolveStatus, Work};
use crate::contact::{LocalSolve, Padded};
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::problem::assembled::Assembled;
use crate::problem::residual::{false_motion, velocity_error};
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::{KAPPA, defaults, stages as tuning};

/// The method that found a solution. A step with several solves reports the last of their routes in
/// this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Route {
    /// Extrapolation of the reactions of earlier steps.
    Extrapolation,
    /// Newton from the active set of the last step.
    ActiveSet,
    /// The interior-point method.
    InteriorPoint,
    /// Sweeps of Gauss–Seidel.
    Sweeps,
}

/// The reactions from which every step starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Zero: the stiff limit.
    StiffLimit,
    /// The reactions of the last step, which keep their history.
    LastStep,
}

/// Which stages are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stages {
    /// All of them.
    All,
    /// All but the sweeps over dry contacts.
    Newton,
    /// The interior-point method, then sweeps from its best point.
    Interior,
}

/// How far the direct solvers go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effort {
    /// Newton, and a short path.
    Short,
    /// Newton, two paths if necessary, and sweeps.
    Full,
}

/// Settings of [`Staged`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StagedSettings {
    /// Which stages are tried.
    pub stages: Stages,
    /// Target residual (–).
    pub tolerance: f64,
    /// Largest residual that is accepted (–), at least `tolerance`.
    pub accept: f64,
    /// Target load error and velocity error (–).
    pub load_tolerance: f64,
    /// The reactions from which a step starts.
    pub start: Start,
    /// Stiffness of the rows in the metric of the stiff limit.
    pub stiffness: StiffnessRatio,
    /// Most iterations in one solve, of Newton and of the interior-point method.
    pub max_iterations: u64,
}

impl Default for StagedSettings {
    /// All stages; tolerances of 10⁻⁸ for the residual and of 10⁻⁵ for load and velocity error;
    /// residuals up to 10⁻⁶ accepted.
    fn default() -> Self {
        Self {
            stages: Stages::All,
            tolerance: defaults::TOLERANCE,
            accept: defaults::ACCEPT,
            load_tolerance: defaults::LOAD_TOLERANCE,
            start: Start::LastStep,
            stiffness: StiffnessRatio::default(),
            max_iterations: defaults::MAX_ITERATIONS,
        }
    }
}

impl StagedSettings {
    /// Report of a solve with this residual, load error and velocity error.
    pub(super) fn report(&self, work: Work, residual: f64, load_error: f64, velocity_error: f64) -> SolveReport {
        let status = match self.status(residual, velocity_error) {
            // with a residual of zero only round-off still changes
            SolveStatus::Converged if load_error > self.load_tolerance && residual != 0.0 => SolveStatus::Accepted,
            status => status,
        };
        SolveReport { status, route: Route::ActiveSet, work, residual, load_error: Some(load_error) }
    }

    /// The status of a solution with this residual and velocity error.
    fn status(&self, residual: f64, velocity_error: f64) -> SolveStatus {
        if self.aims(false).missed(residual, velocity_error) <= 1.0 {
            SolveStatus::Converged
        } else if self.accepts(residual, velocity_error) {
            SolveStatus::Accepted
        } else {
            SolveStatus::Failed
        }
    }

    /// Whether a residual is at most `accept`, and a velocity error in the same proportion: the
    /// residual alone is small beside any large reactions, whatever the velocities.
    fn accepts(&self, residual: f64, velocity_error: f64) -> bool {
        let velocity = self.accept * (defaults::LOAD_TOLERANCE / defaults::TOLERANCE);
        residual <= self.accept && velocity_error <= velocity.max(self.load_tolerance)
    }

    /// The report of a solve of `problem`, accepted also where its residual is at most `accept` and
    /// its false motion within the load tolerance: where a step asks for next to no velocities, no
    /// velocity error can be small.
    fn accepted_by_motion<D: Dim>(&self, report: SolveReport, problem: &ContactProblem<D>) -> SolveReport {
        let missed = report.status == SolveStatus::Failed && report.residual <= self.accept;
        if missed && false_motion(problem) <= self.load_tolerance {
            SolveReport { status: SolveStatus::Accepted, ..report }
        } else {
            report
        }
    }

    /// Tolerances and iteration limit of the interior-point method.
    fn aims(&self, least: bool) -> Aims {
        let Self { tolerance, load_tolerance, max_iterations, .. } = *self;
        Aims { tolerance, load_tolerance, least, far: false, most: max_iterations }
    }
}

/// The solver in stages.
pub struct Staged {
    settings: StagedSettings,
    extrapolation: Extrapolation,
    newton: Newton,
    interior: Interior,
}

impl Staged {
    /// A solver with these settings.
    pub fn new(settings: StagedSettings) -> Self {
        Self {
            settings,
            extrapolation: Extrapolation::default(),
            newton: Newton::new(settings),
            interior: Interior::default(),
        }
    }

    /// Solve a problem given by its matrix, from the reactions that it holds.
    pub fn solve_assembled(&mut self, problem: &mut Assembled) -> SolveReport {
        self.newton.margins.clear();
        self.directly(&mut Visited::new(problem))
    }

    /// Newton, then the interior-point method, then sweeps from its best point.
    fn directly(&mut self, problem: &mut impl Solvable) -> SolveReport {
        problem.velocities_from_reactions();
        let rows = problem.rows(KAPPA, self.settings.stiffness);
        // solved already, for example zero reactions of bodies that fly apart, or no body can move
        let residual = problem.residual();
        if residual == 0.0 || rows.list.iter().all(|row| row.normal == 0.0) {
            return self.settings.report(Work::default(), residual, 0.0, 0.0);
        }
        self.with_effort(Effort::Full, problem, &rows)
    }

    /// Newton, then the interior-point method, with the rows of the problem.
    fn with_effort(&mut self, effort: Effort, problem: &mut impl Solvable, rows: &Rows) -> SolveReport {
        let made = self.newton.made() + self.interior.made;
        let report = match self.by_the_active_set(problem, rows) {
            Ok(report) => report,
            Err(before) => self.along_the_path(problem, rows, effort, before),
        };
        let factorisations = self.newton.made() + self.interior.made - made;
        SolveReport { work: Work { factorisations, ..report.work }, ..report }
    }

    /// Result of Newton's method, or its iterations if it misses the tolerance.
    fn by_the_active_set(&mut self, problem: &mut impl Solvable, rows: &Rows) -> Result<SolveReport, u64> {
        let mut iterations = 0;
        if self.settings.stages == Stages::Interior || problem.matrix().is_some() {
            return Err(iterations);
        }
        let mut anchored = rows.clone();
        anchored.move_multipliers(&self.anchor(rows));
        let report = self.newton.solve(problem, &mut anchored, is_cold(rows), &mut iterations);
        report.filter(|report| report.status == SolveStatus::Converged).ok_or(iterations)
    }

    /// Result of the interior-point method, or with full effort of sweeps from its best point.
    fn along_the_path(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        effort: Effort,
        mut newton: u64,
    ) -> SolveReport {
        // margins that Newton left belong to other reactions
        self.newton.margins.clear();
        let begun = multipliers(rows);
        let anchor = match self.settings.start {
            Start::LastStep if problem.matrix().is_none() => {
                history(rows, &mut self.newton.graph, &mut self.interior.made)
            }
            _ => self.anchor(rows),
        };
        let start = (!is_cold(rows)).then_some(&begun[..]);
        // rigid bonds break by the load that they bear and need minimum-energy reactions; elastic
        // bonds have unique reactions, and dry contacts need only reactions that balance
        let least = problem.matrix().is_none() && rows.list.iter().any(Row::is_rigid_bond);
        let mut aims = self.settings.aims(least);
        let nothing_acts = rows.nothing_acts();
        if effort == Effort::Short || nothing_acts {
            aims.most = aims.most.min(tuning::MOST_SHORT);
        }
        let graph = &mut self.newton.graph;
        let mut best = self.interior.solve(problem, rows, graph, &anchor, start, aims);
        newton += best.as_ref().map_or(0, |found| found.iterations);
        let accepted =
            |found: &Found| self.settings.accepts(found.residual, found.velocity_error.max(found.load_error));
        let refused = !best.as_ref().is_some_and(accepted);
        if refused && nothing_acts {
            // all measures are relative to reactions that may vanish; zero ones balance exactly
            problem.write_back(&vec![Padded::zero(); rows.list.len()]);
            if problem.residual() == 0.0 {
                let work = Work { sweeps: 0, newton, factorisations: 0 };
                return SolveReport { route: Route::InteriorPoint, ..self.settings.report(work, 0.0, 0.0, 0.0) };
            }
        }
        if refused && effort == Effort::Full {
            // another path, from a far cold start to any reactions that balance
            let any = Aims { least: false, far: true, ..aims };
            let other = self.interior.solve(problem, rows, graph, &anchor, None, any);
            newton += other.as_ref().map_or(0, |found| found.iterations);
            best = best.into_iter().chain(other).min_by(|a, b| a.missed(aims).total_cmp(&b.missed(aims)));
        }
        let residual = best.as_ref().map_or(f64::INFINITY, |found| found.residual);
        let by_the_path = |problem: &mut _, sweeps| {
            let (load_error, velocity_error) =
                best.as_ref().map_or((1.0, 1.0), |found| (found.load_error, found.velocity_error));
            if let Some(found) = &best {
                Solvable::write_back(problem, &found.reactions);
                Solvable::set_reached(problem, &found.reached);
            }
            let work = Work { sweeps, newton, factorisations: 0 };
            let report = self.settings.report(work, residual, load_error, velocity_error);
            SolveReport { route: Route::InteriorPoint, ..report }
        };
        if residual <= self.settings.tolerance || effort == Effort::Short {
            return by_the_path(problem, 0);
        }
        best.iter().for_each(|found| problem.write_back(&found.reactions));
        problem.forget_what_is_not_finite();
        let most = (tuning::LAST_VISITS / rows.list.len() as u64).clamp(tuning::FINE_SWEEPS, tuning::COARSE_SWEEPS);
        let (swept, missed) = self.sweep(problem, most);
        if best.as_ref().is_some_and(|found| found.missed(aims) <= missed) {
            return by_the_path(problem, swept.work.sweeps);
        }
        SolveReport { work: Work { newton, ..swept.work }, ..swept }
    }

    /// The anchor, from which the energy of the minimum-energy reactions is measured.
    fn anchor(&self, rows: &Rows) -> Vec<Padded> {
        match self.settings.start {
            Start::StiffLimit => vec![Padded::zero(); rows.list.len()],
            Start::LastStep => multipliers(rows),
        }
    }

    /// Settings of Gauss–Seidel for this target residual.
    fn sweeps(&self, tolerance: f64, max_sweeps: u64) -> GaussSeidelSettings {
        let (local, accept) = (LocalSolve::Exact, self.settings.accept);
        GaussSeidelSettings { local, tolerance, accept, max_sweeps, acceleration: 0 }
    }

    /// Sweeps over dry contacts to the tolerances. Where they miss them, the direct solvers if
    /// these are cheap, else sweeps to the accepted residual.
    fn dry<D: Dim>(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        let (fine, _) = self.sweep(problem, tuning::FINE_SWEEPS);
        if fine.status == SolveStatus::Converged {
            return fine;
        }
        let mut work = fine.work;
        if let Some(rows) = self.cheap(problem) {
            let swept = problem.clone();
            let report = self.with_effort(Effort::Short, problem, &rows);
            work = work + report.work;
            if report.status == SolveStatus::Converged {
                return SolveReport { work, ..report };
            }
            *problem = swept;
        }
        if fine.status == SolveStatus::Failed {
            let coarse = self.coarse_sweeps(problem);
            return SolveReport { work: work + coarse.work, ..coarse };
        }
        SolveReport { work, ..fine }
    }

    /// The rows of a dry problem if the direct solvers take about as long as the sweeps that missed
    /// the tolerances, by the operations of a factorisation.
    fn cheap<D: Dim>(&mut self, problem: &ContactProblem<D>) -> Option<Rows> {
        if problem.len() > tuning::MOST_FACTORISED {
            return None;
        }
        let rows = problem.rows(KAPPA, self.settings.stiffness);
        let graph = Graph::of(&rows, &mut self.newton.graph)?;
        (graph.tree.operations() <= tuning::CHEAP * problem.len() as f64).then_some(rows)
    }

    /// Sweeps to the tolerances of the residual, of the velocity error and of the elastic error.
    /// Returns also by which factor these are missed.
    fn sweep(&self, problem: &mut impl Solvable, most: u64) -> (SolveReport, f64) {
        let StagedSettings { tolerance, .. } = self.settings;
        let (mut aim, mut work) = (tolerance, Work::default());
        loop {
            let swept = problem.gauss_seidel(self.sweeps(aim, most - work.sweeps));
            work = work + swept.work;
            let velocity_error = problem.velocity_error().max(swept.load_error.unwrap_or(0.0));
            let missed = self.settings.aims(false).missed(swept.residual, velocity_error);
            // sweeps stop on the residual alone: lower its target to reduce the velocity error
            if missed > 1.0 && swept.residual <= aim && work.sweeps < most {
                aim = swept.residual / missed;
                continue;
            }
            let status = self.settings.status(swept.residual, velocity_error);
            return (SolveReport { status, work, ..swept }, missed);
        }
    }

    /// Sweeps over dry contacts to the accepted residual.
    fn coarse_sweeps<D: Dim>(&self, problem: &mut ContactProblem<D>) -> SolveReport {
        let accept = self.settings.accept;
        let coarse = problem.gauss_seidel(self.sweeps(accept, tuning::COARSE_SWEEPS));
        SolveReport { status: self.settings.status(coarse.residual, problem.velocity_error()), ..coarse }
    }
}

/// The multipliers of all contacts: the reactions that the problem holds.
fn multipliers(rows: &Rows) -> Vec<Padded> {
    rows.list.iter().map(|row| row.multiplier).collect()
}

/// Whether all contacts are without a bond.
fn is_dry<D: Dim>(problem: &ContactProblem<D>) -> bool {
    problem.bonded.is_empty() && problem.elastic.is_empty()
}

/// Whether all normal reactions are zero: a cold start.
fn is_cold(rows: &Rows) -> bool {
    rows.list.iter().all(|row| row.multiplier.n == 0.0)
}

impl<D: Dim> ContactSolver<D> for Staged {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        let StagedSettings { tolerance, load_tolerance, stages, .. } = self.settings;
        let mut before = Work::default();
        if stages == Stages::All && is_dry(problem) {
            let swept = self.dry(problem);
            if swept.status != SolveStatus::Failed {
                return swept;
            }
            before = swept.work;
        }
        if stages != Stages::Interior
            && let Some((residual, load_error)) = self.extrapolation.predict(problem, tolerance, load_tolerance)
        {
            let (status, route) = (SolveStatus::Converged, Route::Extrapolation);
            return SolveReport { status, route, work: before, residual, load_error: Some(load_error) };
        }
        self.newton.margins.clear();
        let report = self.directly(problem);
        let report = self.settings.accepted_by_motion(report, problem);
        match report.status {
            SolveStatus::Converged if self.newton.margins.len() == problem.len() => {
                self.extrapolation.learn(problem, &self.newton.margins, load_tolerance);
            }
            _ => self.extrapolation.forget(),
        }
        SolveReport { work: before + report.work, ..report }
    }

    /// Skips the sweeps over dry contacts; with bonds the tolerances are smaller.
    fn solve_finer(&mut self, problem: &mut ContactProblem<D>, found: SolveReport, excess: f64) -> Option<SolveReport> {
        if is_dry(problem) {
            let swept = self.settings.stages == Stages::All && found.status == SolveStatus::Accepted;
            return swept.then(|| {
                let report = self.directly(problem);
                self.settings.accepted_by_motion(report, problem)
            });
        }
        let settings = self.settings;
        if found.residual == 0.0 {
            // round-off
            return None;
        }
        // displacements are in proportion to both errors
        let smaller = |tolerance: f64| 0.5 * tolerance / excess;
        let (tolerance, load_tolerance) = (smaller(found.residual), smaller(settings.load_tolerance));
        let coarse = problem.clone();
        let report = Self::new(StagedSettings { tolerance, load_tolerance, ..settings }).directly(problem);
        self.extrapolation.forget();
        let is_smaller = report.residual < found.residual;
        if !is_smaller {
            *problem = coarse;
            return None;
        }
        let velocity_error = velocity_error(problem);
        let reported = settings.report(report.work, report.residual, report.load_error.unwrap_or(0.0), velocity_error);
        let report = SolveReport { route: report.route, load_error: report.load_error, ..reported };
        Some(settings.accepted_by_motion(report, problem))
    }

    fn snapshot(&self) -> Box<dyn ContactSolver<D>> {
        let Self { settings, extrapolation, newton, .. } = self;
        // the interior-point method keeps only buffers
        let interior = Interior::default();
        Box::new(Self { settings: *settings, extrapolation: extrapolation.clone(), newton: newton.clone(), interior })
    }

    fn save(&self, to: &mut Saved) {
        self.extrapolation.save(to);
        self.newton.save(to);
    }

    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        self.extrapolation = Extrapolation::restored(from)?;
        self.newton.restore(from)
    }
}
