//! Semismooth Newton on the augmented Lagrangian, in the velocities, with a sparse Cholesky factor that is kept.
//!
//! For multipliers r̂ (N s) and a penalty ρ the inner problem is
//!
//! F(v) = M (v − v_f) − H (P(r̂ − ρ (Hᵀv + b)) − s n) = 0,
//!
//! for associated laws the gradient of a convex function of v. Its derivative M + H A Hᵀ is sparse, and symmetric but
//! for the slipping dry contacts. The outer iteration is r̂ ← P(r̂ − ρ (Hᵀv + b)), a proximal step of size ρ on the
//! reactions; with a large ρ two or three suffice, and nearly always the active set of the last step still holds, so
//! each costs one linear solve. The Cholesky factor of the symmetric part is kept over steps as the preconditioner of
//! GMRES and renewed when that needs too many iterations. Where the active set runs in circles an interior-point method,
//! and in space convex problems of growing penalty, do without a guess of it; where those fail Gauss–Seidel takes over.
//!
//! Started from zero reactions the first proximal step is the stiff limit: the reactions of least Σ r²/ρ among all
//! that balance the load, the ones that elastic contacts with stiffnesses in the ratio of ρ would give.
//!
//! Sources: Hestenes 1969 and Powell 1969 (augmented Lagrangian); Alart & Curnier 1991; Qi & Sun 1993 (semismooth
//! Newton); Olsen & Kamrin, arXiv 1805.07437 (the stiff limit).

mod approach;

mod corrector;
mod factor;
mod guess;
mod held;
mod inner;
mod interior;
mod kept;
mod krylov;
mod order;
mod patience;
mod predictor;
mod rounds;

mod sweeps;

use super::{ContactSolver, SolveReport, SolveStatus, Work};
use crate::contact::{Local, Padded};
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::problem::assembled::Assembled;
use crate::saved::{Mismatch, Reader, Saved};
use guess::{Guess, Slips};
use inner::norm2;
use interior::{Bending, Rays, Twisting};
use kept::Kept;
use patience::Rest;
use predictor::Predictor;
use super::rows::Rows;
use super::solvable::Solvable;

use super::rows::StiffnessRatio;

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
/// Sweeps that look for the active set: at every step, from zero reactions, and where Newton stalls.
const SWEEPS: usize = 5;
const COLD_SWEEPS: usize = 100;
const STALL_SWEEPS: usize = 50;

/// Augmented-Lagrangian semismooth Newton.
pub struct Newton {
    settings: NewtonSettings,
    /// The factor of first proximal rounds and of all that leads to them, and in space one of later rounds from a guess: what
    /// crept in the first hardly slips in those, and neither factor serves the other.
    kept: [Kept; 2],
    /// Whether a later round is solved.
    later: bool,
    /// How far contacts slipped in the last solve.
    slips: Slips,
    /// Dry contacts in the last solve.
    dry: usize,
    /// Factorisations before this solve, and sweeps in it that were to bring an answer.
    made_before: u64,
    sweeps: u64,
    /// Rest of the guess of the active set.
    rest: Rest,
    /// Rest of paths that hold the term of dry friction, as those do where nearly nothing slips.
    quiet: Rest,
    /// Whether held terms led nowhere in this solve.
    astray: bool,
    /// What quiet steps add to the reactions, and how far contacts are from another status in the first round of this solve.
    predictor: Predictor,
    margins: Vec<f64>,
    interior: crate::solver::interior::Interior,
    made_ip: u64,
}

/// What was found without a guess of the active set.
struct Found {
    /// Reactions without the shift.
    reactions: Vec<Padded>,
    /// Their residual and load error (–).
    residual: f64,
    load_error: f64,
}

impl Newton {
    /// A solver with these settings.
    pub fn new(settings: NewtonSettings) -> Self {
        Self {
            settings,
            kept: Default::default(),
            later: false,
            slips: Slips::default(),
            dry: 0,
            made_before: 0,
            sweeps: 0,
            rest: Rest::default(),
            quiet: Rest::default(),
            astray: false,
            predictor: Predictor::default(),
            margins: Vec::new(),
            interior: Default::default(),
            made_ip: 0,
        }
    }

    fn report(&self, iterations: u64, residual: f64, load_error: f64) -> SolveReport {
        // a residual of zero is rounding, and rounding is all that still changes
        let settled = load_error <= self.settings.load_tolerance || residual == 0.0;
        let status = match SolveStatus::of(residual, self.settings.tolerance, self.settings.accept) {
            SolveStatus::Converged if !settled => SolveStatus::Accepted,
            status => status,
        };
        SolveReport { status, work: self.work(iterations), residual, load_error: Some(load_error) }
    }

    /// The work of this solve so far.
    fn work(&self, newton: u64) -> Work {
        Work { sweeps: self.sweeps, newton, factorisations: self.made() - self.made_before }
    }

    /// Factorisations so far.
    fn made(&self) -> u64 {
        self.made_ip + self.kept.iter().map(|kept| kept.factor.made).sum::<u64>()
    }

    /// The factor in use.
    fn kept(&mut self) -> &mut Kept {
        &mut self.kept[usize::from(self.later)]
    }

    /// Solve a problem with its matrix, from the reactions that it holds.
    pub fn solve_assembled(&mut self, problem: &mut Assembled) -> SolveReport {
        self.iterate(problem)
    }

    fn iterate(&mut self, problem: &mut impl Solvable) -> SolveReport {
        if std::env::var("IPONLY").is_ok() {
            let rows = problem.rows(KAPPA, self.settings.stiffness);
            let begun = self.started(&rows);
            let found = self.interior.solve(problem, &begun, None, self.settings.tolerance, 60).unwrap();
            return self.report(found.iterations, found.residual, found.change);
        }
        problem.velocities_from_reactions();
        self.made_before = self.made();
        self.sweeps = 0;
        self.astray = false;
        let rows = problem.rows(KAPPA, self.settings.stiffness);
        if rows.unknowns == 0 || rows.list.is_empty() {
            return self.report(0, problem.residual(), 0.0);
        }
        let mut iterations = 0;
        let changed = rows.dry() != std::mem::replace(&mut self.dry, rows.dry());
        let cold = rows.list.iter().all(|row| row.multiplier.n == 0.0);
        // which dry contacts slip shows late
        if !(cold && rows.mostly_dry()) && self.rest.is_over() {
            if let Some(report) = self.try_guess(problem, &rows, cold, changed, &mut iterations) {
                self.rest.forget();
                self.quiet.forget();
                return report;
            }
            self.rest.lengthen();
        }
        if std::env::var("NEWIP").is_err() {
        // since a guess served a path that held the term of dry friction did not: much slips fast
        let comes_apart = rows.in_space() && !self.quiet.served();
        if (rows.mostly_dry() || comes_apart)
            && let Some(swept) = self.swept_first(problem, &rows, cold, iterations)
        {
            return swept;
        }
        }
        if std::env::var("NEWIP").is_ok() {
            let begun = self.started(&rows);
            let start: Vec<Padded> = rows.list.iter().map(|row| row.multiplier).collect();
            let warm = (!cold).then_some(&start[..]);
            let before = self.interior.made;
            let found = self.interior.solve(problem, &begun, warm, self.settings.tolerance, 60);
            self.made_ip += self.interior.made - before;
            if let Some(found) = found {
                iterations += found.iterations;
                if found.residual <= self.settings.accept {
                    return self.report(iterations, found.residual, found.change);
                }
                if std::env::var("IPM").is_ok() { eprintln!("interior failed {:.2e} after {}", found.residual, found.iterations); }
            }
        }
        if let Some(report) = self.come_from_afar(problem, &rows, &mut iterations) {
            return report;
        }
        self.swept_last(problem, &rows, iterations)
    }

    /// Rounds at the largest penalty, from the active set of the reactions that the problem brought along, bettered by
    /// some sweeps in the plane, or as it was where those mislead; none if they run in circles. In space sweeps that have not converged spoil the
    /// directions of slip; where the last guess served, held terms help, at once where bonds have broken since.
    fn try_guess(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        cold: bool,
        changed: bool,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let sweeps = match rows.in_space() {
            _ if cold => COLD_SWEEPS,
            true => 0,
            false => SWEEPS,
        };
        let (mut started, mut guess) = (self.started(rows), Some(Guess::of(problem.swept(sweeps))));
        let held = rows.in_space() && !rows.mostly_dry() && self.rest.served();
        if held && changed && !cold {
            // more has changed than the iterations of one solve can make good
            self.kept().renew = true;
            guess = guess.and_then(|guess| self.by_held_terms(&started, guess, held::ABOUT, iterations));
        }
        let mut report = guess.and_then(|mut guess| self.rounds(problem, &mut started, &mut guess, held, iterations));
        self.kept().renew |= report.is_none();
        if report.is_none() && !rows.in_space() && !cold && !changed && self.rest.served() {
            // sweeps that have not converged may let slip what sticks: the active set of the last solve, as it was
            let mut last = Guess::of(rows.list.iter().map(|row| row.multiplier).collect());
            report = self.rounds(problem, &mut self.started(rows), &mut last, false, iterations);
            self.kept().renew |= report.is_none();
        }
        // that they led nowhere from no reactions tells nothing
        self.astray &= !cold;
        report
    }

    /// The solution that is found without a guess.
    fn come_from_afar(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let started = self.started(rows);
        let swept = problem.swept(STALL_SWEEPS);
        if !rows.in_space() {
            return self.through_the_middle::<Rays>(problem, &started, &swept, iterations);
        }
        let report = if rows.twist() {
            self.through_the_middle::<Twisting>(problem, &started, &swept, iterations)
        } else {
            self.through_the_middle::<Bending>(problem, &started, &swept, iterations)
        };
        report.or_else(|| {
            problem.forget_what_is_not_finite();
            let reached = problem.swept(0);
            let swept = self.swept_on(problem, rows, *iterations);
            swept.or_else(|| self.penalised(problem, rows, reached, iterations))
        })
    }

    /// What the approach from afar finds.
    fn penalised(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        start: Vec<Padded>,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let found = self.approach(problem, rows, start, iterations)?;
        let mut guess = Guess::of(found.reactions.clone());
        if !rows.mostly_dry()
            && let Some(report) = self.rounds(problem, &mut self.started(rows), &mut guess, false, iterations)
        {
            return Some(report);
        }
        self.taken(problem, found, *iterations)
    }

    /// The reactions that were found as they are, if they are accepted.
    fn taken(&self, problem: &mut impl Solvable, found: Found, iterations: u64) -> Option<SolveReport> {
        problem.write_back(&found.reactions);
        let report = self.report(iterations, problem.residual(), found.load_error);
        (report.status != SolveStatus::Failed).then_some(report)
    }

    /// Write what is kept from one solve to the next.
    pub(super) fn save_state(&self, to: &mut Saved) {
        [self.rest, self.quiet].iter().for_each(|rest| rest.save(to));
        to.count(self.dry);
        self.slips.save(to);
        self.predictor.save(to);
        self.kept.iter().for_each(|kept| kept.save(to));
    }

    /// Take up what [`Newton::save_state`] wrote.
    pub(super) fn restore_state(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        (self.rest, self.quiet) = (Rest::restored(from)?, Rest::restored(from)?);
        self.dry = from.count()?;
        self.slips = Slips::restored(from)?;
        self.predictor = Predictor::restored(from)?;
        self.kept = [Kept::restored(from)?, Kept::restored(from)?];
        Ok(())
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

impl<D: Dim> ContactSolver<D> for Newton {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        let NewtonSettings { tolerance, load_tolerance, .. } = self.settings;
        if let Some((residual, load_error)) = self.predictor.predict(problem, tolerance, load_tolerance) {
            let status = SolveStatus::Converged;
            return SolveReport { status, work: Work::default(), residual, load_error: Some(load_error) };
        }
        self.margins.clear();
        let report = self.iterate(problem);
        match report.status {
            SolveStatus::Converged if self.margins.len() == problem.len() => {
                self.predictor.learn(problem, &self.margins, load_tolerance);
            }
            _ => self.predictor.forget(),
        }
        report
    }

    fn save(&self, to: &mut Saved) {
        self.save_state(to);
    }

    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        self.restore_state(from)
    }
}

/// How much the net impulses on the bodies changed in the proximal step to these reactions: with a contraction far below
/// one, the load error of the step before.
fn load_change(rows: &Rows, reactions: &[Padded]) -> f64 {
    let multipliers: Vec<Padded> = rows.list.iter().map(|row| row.multiplier).collect();
    net_change(rows, &multipliers, reactions)
}

/// By how much two sets of reactions differ, over the second.
fn relative_change(from: &[Padded], to: &[Padded]) -> f64 {
    let (mut change, mut total) = (0.0, 0.0);
    for (from, to) in from.iter().zip(to) {
        let by = *to - *from;
        change += by.dot(&by);
        total += to.dot(to);
    }
    if change == 0.0 { 0.0 } else { (change / total).sqrt() }
}

/// By how much the net impulses on the bodies differ between two sets of reactions, over those of the second.
fn net_change(rows: &Rows, from: &[Padded], to: &[Padded]) -> f64 {
    let mut change = vec![0.0; rows.unknowns];
    let mut total = vec![0.0; rows.unknowns];
    for ((row, from), to) in rows.list.iter().zip(from).zip(to) {
        rows.apply(row, &(*to - *from), &mut change);
        rows.apply(row, to, &mut total);
    }
    let (change, total) = (norm2(&change).sqrt(), norm2(&total).sqrt());
    if change == 0.0 { 0.0 } else { change / total }
}
