//! Semismooth Newton on the augmented Lagrangian, in the velocities, with one sparse Cholesky factor.
//!
//! For multipliers r̂ (N s) and a penalty ρ the inner problem is
//!
//! F(v) = M (v − v_f) − H (P(r̂ − ρ (Hᵀv + b)) − s n) = 0,
//!
//! for associated laws the gradient of a convex function of v. Its derivative M + H A Hᵀ is sparse, and symmetric but
//! for the slipping dry contacts. The outer iteration is r̂ ← P(r̂ − ρ (Hᵀv + b)), a proximal step of size ρ on the
//! reactions; with a large ρ two or three suffice, and nearly always the active set of the last step still holds, so
//! each costs one linear solve. The Cholesky factor of the symmetric part is kept over steps as the preconditioner of
//! GMRES and renewed when that needs too many iterations. Where the active set runs in circles the solution is
//! approached through convex problems of growing penalty, and where that fails Gauss–Seidel takes over.
//!
//! Started from zero reactions the first proximal step is the stiff limit: the reactions of least Σ r²/ρ among all
//! that balance the load, the ones that elastic contacts with stiffnesses in the ratio of ρ would give.
//!
//! Sources: Hestenes 1969 and Powell 1969 (augmented Lagrangian); Alart & Curnier 1991; Qi & Sun 1993 (semismooth
//! Newton); Olsen & Kamrin, arXiv 1805.07437 (the stiff limit).

mod approach;
mod assembled;
mod corrector;
mod factor;
mod inner;
mod krylov;
mod rows;
mod solvable;

use super::gauss_seidel::MEMORY;
use super::{ContactSolver, GaussSeidelSettings, SolveReport, SolveStatus, Work};
use crate::contact::{Local, LocalSolve};
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::problem::assembled::Assembled;
use factor::Factor;
use inner::{Iterate, norm2};
use rows::{Padded, Rows};
use solvable::Solvable;

pub use rows::StiffnessRatio;

/// Where the reactions start from in every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// From zero: the stiff limit, one answer where rigidity leaves many.
    #[default]
    StiffLimit,
    /// From the reactions of the last step: they keep their history.
    LastStep,
}

/// Settings of [`Newton`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonSettings {
    /// Residual that the solver aims at (–).
    pub tolerance: f64,
    /// Largest residual that is accepted (–), at least `tolerance`.
    pub accept: f64,
    /// Load error that the solver aims at (–).
    pub load_tolerance: f64,
    /// Where the reactions start from.
    pub start: Start,
    /// Stiffness of the rows in the metric of the stiff limit.
    pub stiffness: StiffnessRatio,
    /// Most Newton iterations in one solve.
    pub max_iterations: u64,
}

/// Penalty at the start, over the inverse of the mean normal entry of W.
const KAPPA: f64 = 1e9;
/// Newton iterations of one inner problem before the state is smoothed by sweeps.
const PATIENCE: u64 = 8;
/// How often the penalty may be lowered a hundredfold in one solve.
const MOST_SOFTENED: u32 = 4;
/// Sweeps that look for the active set: at every step, from zero reactions, and where Newton stalls.
const SWEEPS: usize = 5;
const COLD_SWEEPS: usize = 100;
const STALL_SWEEPS: usize = 50;
/// Most sweeps of Gauss–Seidel where it takes over.
const MOST_SWEEPS: u64 = 40_000;
/// What a problem counts that no guess of the active set solved, less one for each that was solved so, and the count
/// above which Gauss–Seidel is tried before the approach from afar.
const HARD: u32 = 4;
const MOST_HARD: u32 = 16;
/// Most solves that are left to Gauss–Seidel before Newton is tried again.
const LONGEST_REST: u64 = 64;

/// Augmented-Lagrangian semismooth Newton.
pub struct Newton {
    settings: NewtonSettings,
    factor: Factor,
    /// Whether the factor must be made anew.
    renew: bool,
    /// Whether the factor alone gave the last direction well enough.
    trusted: bool,
    /// Linear solves before it can be trusted again.
    distrust: usize,
    /// GMRES iterations with a fresh factor, and those beyond it since.
    floor: usize,
    wasted: usize,
    /// Factorisations before this solve.
    made_before: u64,
    /// Solves that are left to Gauss–Seidel, and how many after the next failure.
    rest: u64,
    next_rest: u64,
    /// How hard the last problems were.
    hard: u32,
}

impl Newton {
    /// A solver with these settings.
    pub fn new(settings: NewtonSettings) -> Self {
        Self {
            settings,
            factor: Factor::default(),
            renew: true,
            trusted: false,
            distrust: 0,
            floor: 0,
            wasted: 0,
            made_before: 0,
            rest: 0,
            next_rest: 1,
            hard: 0,
        }
    }

    /// Gauss–Seidel from the impulses at hand, up to what is accepted. It cannot tell its load error.
    fn swept_to_the_end(&self, problem: &mut impl Solvable, iterations: u64) -> SolveReport {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        problem.forget_what_is_not_finite();
        let settings = GaussSeidelSettings {
            local: LocalSolve::Exact,
            tolerance: accept,
            accept,
            max_sweeps: MOST_SWEEPS,
            acceleration: MEMORY,
        };
        let swept = problem.gauss_seidel(settings);
        let status =
            if swept.residual <= tolerance { swept.status } else { swept.status.at_best(SolveStatus::Accepted) };
        SolveReport { status, work: swept.work + self.work(iterations), ..swept }
    }

    fn report(&self, iterations: u64, residual: f64, load_error: f64) -> SolveReport {
        // a residual of zero is rounding, and rounding is all that still changes
        let settled = load_error <= self.settings.load_tolerance || residual == 0.0;
        let status = if residual <= self.settings.tolerance && settled {
            SolveStatus::Converged
        } else if residual <= self.settings.accept {
            SolveStatus::Accepted
        } else {
            SolveStatus::Failed
        };
        SolveReport { status, work: self.work(iterations), residual, load_error: Some(load_error) }
    }

    /// The work of this solve so far.
    fn work(&self, newton: u64) -> Work {
        Work { sweeps: 0, newton, factorisations: self.factor.made - self.made_before }
    }

    /// Proximal rounds at the largest penalty, each begun with the active set of `guess`; none if an inner problem is
    /// not solved: the problem then holds the reactions of the last one that was.
    fn rounds(
        &mut self,
        problem: &mut impl Solvable,
        rows: &mut Rows,
        guess: &mut Vec<Padded>,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let (mut last_error, mut last_change, mut softened, mut made_in_all) = (f64::INFINITY, 1.0, 0, 0);
        loop {
            let mut state = Iterate::from_reactions(rows, guess);
            let (made, solved) = self.inner(rows, &mut state, Some(guess), PATIENCE);
            *iterations += made.max(1);
            if !solved {
                return None;
            }
            problem.write_back(&state.reactions);
            problem.velocities_from_reactions();
            // rounds that shorten the error by c leave c/(1 − c) of the last change
            let change = load_change(rows, &state);
            let shrinkage = (change / last_change).min(0.5);
            let load_error = change * shrinkage / (1.0 - shrinkage);
            last_change = change;
            let error = problem.residual();
            rows.list.iter_mut().zip(&state.reactions).for_each(|(row, r)| row.multiplier = *r);
            *guess = state.reactions;
            let report = self.report(*iterations, error, load_error);
            if report.status == SolveStatus::Converged {
                return Some(report);
            }
            made_in_all += made;
            let stuck = softened == MOST_SOFTENED && error > 0.5 * last_error;
            if stuck || made_in_all >= self.settings.max_iterations {
                return (report.status == SolveStatus::Accepted).then_some(report);
            }
            if error > 0.5 * last_error && softened < MOST_SOFTENED {
                // what moves fast is rounded by ρ u: a smaller ρ hears less of it, and takes more rounds
                rows.soften(100.0);
                softened += 1;
            }
            last_error = error;
        }
    }
}

impl<D: Dim> ContactSolver<D> for Newton {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        self.iterate(problem)
    }
}

impl Newton {
    /// Solve a problem with its matrix, from the reactions that it holds.
    pub fn solve_assembled(&mut self, problem: &mut Assembled) -> SolveReport {
        self.iterate(problem)
    }

    fn iterate(&mut self, problem: &mut impl Solvable) -> SolveReport {
        problem.velocities_from_reactions();
        self.made_before = self.factor.made;
        let resting = self.rest > 0;
        if resting {
            self.rest -= 1;
            let swept = self.swept_to_the_end(problem, 0);
            if swept.status != SolveStatus::Failed {
                return swept;
            }
        }
        let rows = problem.rows(KAPPA, self.settings.stiffness);
        if rows.unknowns == 0 || rows.list.is_empty() {
            return self.report(0, problem.residual(), 0.0);
        }
        let mut iterations = 0;
        if let Some(report) = self.try_guesses(problem, &rows, &mut iterations) {
            self.next_rest = 1;
            self.hard = self.hard.saturating_sub(1);
            return report;
        }
        self.hard = (self.hard + HARD).min(2 * MOST_HARD);
        if self.hard > MOST_HARD && !resting {
            // steps that are alike fail alike, and sweeps are the cheaper way then
            let swept = self.swept_to_the_end(problem, iterations);
            if swept.status != SolveStatus::Failed {
                self.rest_longer();
                return swept;
            }
        }
        if let Some(report) = self.come_from_afar(problem, &rows, &mut iterations) {
            return report;
        }
        self.rest_longer();
        self.swept_to_the_end(problem, iterations)
    }

    /// Leave the next solves to Gauss–Seidel, twice as many as after the last failure.
    fn rest_longer(&mut self) {
        self.rest = self.next_rest;
        self.next_rest = (2 * self.next_rest).min(LONGEST_REST);
    }

    /// Rounds at the largest penalty, from one active set after the other; none if all run in circles.
    fn try_guesses(&mut self, problem: &mut impl Solvable, rows: &Rows, iterations: &mut u64) -> Option<SolveReport> {
        // the reactions that the problem brought along, bettered by some sweeps, show which contacts are active
        let cold = rows.list.iter().all(|row| row.multiplier.n == 0.0);
        let mut guess = problem.swept(if cold { COLD_SWEEPS } else { SWEEPS });
        for sweeps in [STALL_SWEEPS, COLD_SWEEPS, 0] {
            let report = self.rounds(problem, &mut self.started(rows), &mut guess, iterations);
            if report.is_some() || sweeps == 0 {
                return report;
            }
            // the active set runs in circles: sweeps from here show another, or those from nothing
            self.renew = true;
            if sweeps == COLD_SWEEPS {
                problem.forget_reactions();
            }
            guess = problem.swept(sweeps);
        }
        None
    }

    /// The solution that is approached from afar: as the stiff limit if its active set gives that, else bettered from
    /// where it is.
    fn come_from_afar(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let found = self.approach(problem, rows, iterations)?;
        let mut guess = found.reactions.clone();
        if let Some(report) = self.rounds(problem, &mut self.started(rows), &mut guess, iterations) {
            return Some(report);
        }
        let mut rows = rows.clone();
        rows.list.iter_mut().zip(&found.reactions).for_each(|(row, r)| row.multiplier = *r);
        guess.clone_from(&found.reactions);
        let report = self.rounds(problem, &mut rows, &mut guess, iterations);
        Some(report.unwrap_or_else(|| {
            problem.write_back(&found.reactions);
            problem.velocities_from_reactions();
            self.report(*iterations, problem.residual(), found.load_error)
        }))
    }

    /// The rows with the multipliers that the reactions start from.
    fn started(&self, rows: &Rows) -> Rows {
        let mut rows = rows.clone();
        if self.settings.start == Start::StiffLimit {
            rows.list.iter_mut().for_each(|row| row.multiplier = Local::zero());
        }
        rows
    }
}

/// How much the net impulses on the bodies changed in the last proximal step, over themselves: with a contraction far
/// below one, the load error of the step before.
fn load_change(rows: &Rows, state: &Iterate) -> f64 {
    let mut change = vec![0.0; rows.unknowns];
    let mut total = vec![0.0; rows.unknowns];
    for (row, r) in rows.list.iter().zip(&state.reactions) {
        rows.apply(row, &(*r - row.multiplier), &mut change);
        rows.apply(row, r, &mut total);
    }
    let (change, total) = (norm2(&change).sqrt(), norm2(&total).sqrt());
    if change == 0.0 { 0.0 } else { change / total }
}
