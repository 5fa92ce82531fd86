//! What sweeps of Gauss–Seidel do for Newton: over mostly dry contacts before a path is followed, from where one ends, and where
//! nothing else is left.
//!
//! The residual of contacts that slip falls as one over the number of sweeps: some tell how many will do.

use crate::solver::rows::Rows;
use crate::solver::solvable::Solvable;
use super::{Newton, NewtonSettings};
use crate::contact::LocalSolve;
use crate::solver::gauss_seidel::MEMORY;
use crate::solver::{GaussSeidelSettings, SolveReport, SolveStatus};

/// Most sweeps where they come first, and where nothing else is left.
const FIRST: u64 = 2_000;
const LAST: u64 = 200_000;
/// Sweeps that settle what single contacts disagree about where a path ends.
const SETTLING: usize = 10;
/// How many iterations of a path more sweeps may cost: before one is followed, which mostly dry contacts take a hundred of, where
/// one ends, and before the approach from afar.
const BEFORE: f64 = 50.0;
const BETWEEN: f64 = 25.0;
const AFTER: f64 = 100.0;

impl Newton {
    /// What sweeps over contacts that slip come to before a path is followed, if that is accepted. From no reactions, where a sweep
    /// carries a load by one contact, only what meets the tolerance.
    pub(super) fn swept_first(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        cold: bool,
        iterations: u64,
    ) -> Option<SolveReport> {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        if cold {
            let swept = self.swept(problem, tolerance, FIRST, 0, iterations);
            return (swept.status == SolveStatus::Converged).then_some(swept);
        }
        // half the way from what is accepted to the tolerance: beyond that sweeps converge slowly
        let (aim, most) = ((tolerance * accept).sqrt(), BEFORE * sweeps_for_an_iteration(rows));
        let swept = self.as_many_as_will_do(problem, aim, FIRST, most, iterations);
        (swept.status != SolveStatus::Failed).then_some(swept)
    }

    /// The residual that some sweeps leave from where a path ends. `more` may follow: as many as bring what is accepted, if they cost
    /// less than another path. They move the net impulses, so none do where only what meets the tolerance is accepted.
    pub(super) fn settle(&mut self, problem: &mut impl Solvable, rows: &Rows, more: bool) -> f64 {
        problem.forget_what_is_not_finite();
        problem.swept(SETTLING);
        self.sweeps += SETTLING as u64;
        if !more || self.settings.accept <= self.settings.tolerance {
            return problem.residual();
        }
        let most = BETWEEN * sweeps_for_an_iteration(rows);
        self.as_many_as_will_do(problem, self.settings.accept, (0.1 * most) as u64, most, 0).residual
    }

    /// What sweeps over contacts of which some are dry come to from the best that paths have found, if that is accepted.
    pub(super) fn swept_on(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        iterations: u64,
    ) -> Option<SolveReport> {
        if rows.dry() == 0 {
            return None;
        }
        let most = AFTER * sweeps_for_an_iteration(rows);
        let swept = self.as_many_as_will_do(problem, self.settings.accept, FIRST, most, iterations);
        (swept.status != SolveStatus::Failed).then_some(swept)
    }

    /// What sweeps come to where nothing else is left.
    pub(super) fn swept_last(&mut self, problem: &mut impl Solvable, rows: &Rows, iterations: u64) -> SolveReport {
        // where contacts slip the acceleration takes more sweeps than it saves
        let acceleration = if rows.mostly_dry() { 0 } else { MEMORY };
        self.swept(problem, self.settings.accept, LAST, acceleration, iterations)
    }

    /// Some sweeps with this aim, and as many more as what is accepted asks for, if that is no more than `most`.
    fn as_many_as_will_do(
        &mut self,
        problem: &mut impl Solvable,
        aim: f64,
        some: u64,
        most: f64,
        iterations: u64,
    ) -> SolveReport {
        let (before, accept) = (self.sweeps, self.settings.accept);
        let swept = self.swept(problem, aim, some, 0, iterations);
        let enough = (self.sweeps - before) as f64 * swept.residual / accept;
        if swept.status == SolveStatus::Failed && enough <= most {
            return self.swept(problem, accept, (2.0 * enough) as u64, 0, iterations);
        }
        swept
    }

    /// Gauss–Seidel from the impulses at hand, that aims at this residual. It cannot tell its load error.
    fn swept(
        &mut self,
        problem: &mut impl Solvable,
        aim: f64,
        max_sweeps: u64,
        acceleration: usize,
        iterations: u64,
    ) -> SolveReport {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        problem.forget_what_is_not_finite();
        let settings =
            GaussSeidelSettings { local: LocalSolve::Exact, tolerance: aim, accept, max_sweeps, acceleration };
        let swept = problem.gauss_seidel(settings);
        self.sweeps += swept.work.sweeps;
        let status = SolveStatus::of(swept.residual, tolerance, accept);
        SolveReport { status, work: self.work(iterations), ..swept }
    }
}

/// How many sweeps over all contacts cost as much as one iteration of the interior-point method. Fitted to 600 to 43,000 contacts of
/// disks (70 to 470 sweeps) and to 2,000 and 14,000 of spheres (150, 700): no clock is looked at.
fn sweeps_for_an_iteration(rows: &Rows) -> f64 {
    let contacts = rows.list.len() as f64;
    if rows.in_space() { 0.4 * contacts.powf(0.8) } else { 6.0 * contacts.powf(0.4) }
}
