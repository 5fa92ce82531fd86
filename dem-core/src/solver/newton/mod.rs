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
//! GMRES and renewed when that needs too many iterations. Where the active set runs in circles an interior-point method,
//! and in space convex problems of growing penalty, do without a guess of it; where those fail Gauss–Seidel takes over.
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
mod guess;
mod held;
mod inner;
mod interior;
mod krylov;
mod order;
mod rows;
mod solvable;

use super::gauss_seidel::MEMORY;
use super::{ContactSolver, GaussSeidelSettings, SolveReport, SolveStatus, Work};
use crate::contact::{Local, LocalSolve, Padded};
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::problem::assembled::Assembled;
use crate::saved::{Mismatch, Reader, Saved};
use factor::Factor;
use guess::{Guess, Slips};
use inner::{Iterate, distance, norm2};
use interior::{Bending, Rays, Twisting};
use rows::Rows;
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
/// Newton iterations of one inner problem before it is given up: those in which F shrinks by less than a tenth, fewer in space
/// where each is dear, and all of them.
const PATIENCE: u64 = 8;
const PATIENCE_IN_SPACE: u64 = 4;
const MOST_INNER: u64 = 30;
/// How often the penalty may be lowered a hundredfold in one solve.
const MOST_SOFTENED: u32 = 4;
/// Sweeps that look for the active set: at every step, from zero reactions, and where Newton stalls.
const SWEEPS: usize = 5;
const COLD_SWEEPS: usize = 100;
const STALL_SWEEPS: usize = 50;
/// Most sweeps of Gauss–Seidel where it is tried first, and where nothing else is left.
const FIRST_SWEEPS: u64 = 2_000;
const MOST_SWEEPS: u64 = 200_000;
/// Iterations of the interior-point method that mostly dry contacts take.
const PATH: f64 = 100.0;
/// Most solves for which something that failed is not tried again.
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
    /// How far contacts slipped in the last solve.
    slips: Slips,
    /// Dry contacts in the last solve.
    dry: usize,
    /// Factorisations before this solve.
    made_before: u64,
    /// Rest of the guess of the active set.
    rest: Rest,
    /// Rest of paths that hold the term of dry friction, as those do where nearly nothing slips.
    quiet: Rest,
    /// Whether held terms led nowhere in this solve.
    astray: bool,
}

/// Solves for which something that failed is not tried: steps that are alike fail alike.
#[derive(Clone, Copy)]
struct Rest {
    left: u64,
    next: u64,
}

impl Rest {
    const NONE: Self = Self { left: 0, next: 0 };

    /// Whether it is time to try again; else one solve of it passes.
    fn is_over(&mut self) -> bool {
        let over = self.left == 0;
        self.left = self.left.saturating_sub(1);
        over
    }

    /// It failed: one failure is forgiven, after the next it rests for one solve, then for twice as many each time.
    fn lengthen(&mut self) {
        self.left = self.next;
        self.next = (2 * self.next).clamp(1, LONGEST_REST);
    }

    /// Whether it did not fail the last time.
    fn served(&self) -> bool {
        self.next == 0
    }

    /// It served.
    fn forget(&mut self) {
        *self = Self::NONE;
    }
}

/// The changes of proximal rounds.
struct Shrinking {
    last: f64,
}

impl Default for Shrinking {
    fn default() -> Self {
        Self { last: 1.0 }
    }
}

impl Shrinking {
    /// Enter the next change: the error that is left, for rounds that shorten it by c leave c/(1 − c) of the last change.
    fn error(&mut self, change: f64) -> f64 {
        let shrinkage = (change / self.last).min(0.5);
        self.last = change;
        change * shrinkage / (1.0 - shrinkage)
    }
}

/// Whether a quantity that should shrink no longer does.
struct Stall {
    mark: f64,
    since: u64,
    patience: u64,
    share: f64,
}

impl Stall {
    /// To less than this share of what it was in so many values.
    fn after(patience: u64, share: f64) -> Self {
        Self { mark: f64::INFINITY, since: 0, patience, share }
    }

    /// Enter the next value: whether it has not shrunk for too long, or is no number.
    fn at(&mut self, value: f64) -> bool {
        self.since += 1;
        if value < self.share * self.mark {
            (self.mark, self.since) = (value, 0);
        }
        self.since >= self.patience || !value.is_finite()
    }
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
            factor: Factor::default(),
            renew: true,
            trusted: false,
            distrust: 0,
            floor: 0,
            wasted: 0,
            slips: Slips::default(),
            dry: 0,
            made_before: 0,
            rest: Rest::NONE,
            quiet: Rest::NONE,
            astray: false,
        }
    }

    /// Gauss–Seidel from the impulses at hand, that aims at this residual. It cannot tell its load error.
    fn swept(
        &self,
        problem: &mut impl Solvable,
        rows: &Rows,
        aim: f64,
        iterations: u64,
        max_sweeps: u64,
    ) -> SolveReport {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        problem.forget_what_is_not_finite();
        let settings = GaussSeidelSettings {
            local: LocalSolve::Exact,
            tolerance: aim,
            accept,
            max_sweeps,
            // where contacts slip the acceleration takes more sweeps than it saves
            acceleration: if rows.mostly_dry() { 0 } else { MEMORY },
        };
        let swept = problem.gauss_seidel(settings);
        let status = SolveStatus::of(swept.residual, tolerance, accept);
        SolveReport { status, work: swept.work + self.work(iterations), ..swept }
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
        Work { sweeps: 0, newton, factorisations: self.factor.made - self.made_before }
    }

    /// Proximal rounds at the largest penalty, each begun with the active set of `guess`; none if an inner problem is
    /// not solved, where `held` not by way of held terms either: the problem then holds the reactions of the last one
    /// that was.
    fn rounds(
        &mut self,
        problem: &mut impl Solvable,
        rows: &mut Rows,
        guess: &mut Guess,
        held: bool,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        // held terms, or a path, have led to what knows how far it is beyond its limits
        let led = !guess.beyond.is_empty();
        if !led {
            guess.beyond = self.slips.in_rows(rows);
        }
        let patience = if rows.in_space() { PATIENCE_IN_SPACE } else { PATIENCE };
        let mut first = true;
        let mut shrinking = Shrinking::default();
        let (mut last_error, mut softened, mut made_in_all) = (f64::INFINITY, 0, 0);
        loop {
            // the kept factor is one of contacts that slip
            self.renew |= guess.sticks;
            let mut state = Iterate::from_reactions(rows, &guess.reactions);
            let (mut made, mut solved) = self.inner(rows, &mut state, Some(guess), patience, MOST_INNER);
            if !solved && std::mem::take(&mut guess.sticks) {
                // or it does slip
                state = Iterate::from_reactions(rows, &guess.reactions);
                let (more, now) = self.inner(rows, &mut state, Some(guess), patience, MOST_INNER);
                (made, solved) = (made + more, now);
            }
            *iterations += made.max(1);
            if !solved && made > 1 && last_error <= self.settings.tolerance {
                // what the round before left is good enough, and this was to tell its load error: the velocities show it
                let begun = rows.given_by(&guess.reactions);
                let load_error = distance(&begun, &state.y) / distance(&begun, &rows.free);
                let report = self.report(*iterations, last_error, load_error);
                if report.status == SolveStatus::Converged {
                    return Some(report);
                }
            }
            if !solved && held {
                let begun = Guess::of(std::mem::take(&mut guess.reactions));
                *guess = self.by_held_terms(rows, begun, held::NEAR, iterations)?;
                state = Iterate::from_reactions(rows, &guess.reactions);
                (made, solved) = self.inner(rows, &mut state, Some(guess), patience, MOST_INNER);
                *iterations += made;
            }
            if !solved {
                return None;
            }
            if std::mem::take(&mut first) {
                self.slips = Slips::of(rows, &state);
            }
            problem.write_back(&state.reactions);
            let load_error = shrinking.error(load_change(rows, &state.reactions));
            let error = problem.residual();
            rows.move_multipliers(&state.reactions);
            // what crept in one round hardly slips in the next
            *guess = if held && led { Guess::at_rest(state.reactions) } else { Guess::of(state.reactions) };
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

    /// Solve a problem with its matrix, from the reactions that it holds.
    pub fn solve_assembled(&mut self, problem: &mut Assembled) -> SolveReport {
        self.iterate(problem)
    }

    fn iterate(&mut self, problem: &mut impl Solvable) -> SolveReport {
        problem.velocities_from_reactions();
        self.made_before = self.factor.made;
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
                return report;
            }
            self.rest.lengthen();
        }
        if rows.mostly_dry()
            && let Some(swept) = self.swept_first(problem, &rows, cold, iterations)
        {
            return swept;
        }
        if let Some(report) = self.come_from_afar(problem, &rows, &mut iterations) {
            return report;
        }
        self.swept(problem, &rows, self.settings.accept, iterations, MOST_SWEEPS)
    }

    /// What sweeps over mostly dry contacts come to, if that is accepted: some, and as many more as cost less than half a path.
    /// From no reactions, where a sweep carries a load by one contact, only what meets the tolerance.
    fn swept_first(
        &self,
        problem: &mut impl Solvable,
        rows: &Rows,
        cold: bool,
        iterations: u64,
    ) -> Option<SolveReport> {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        if cold {
            let swept = self.swept(problem, rows, tolerance, iterations, FIRST_SWEEPS);
            return (swept.status == SolveStatus::Converged).then_some(swept);
        }
        // half the way from what is accepted to the tolerance: beyond that sweeps converge slowly
        let swept = self.swept(problem, rows, (tolerance * accept).sqrt(), iterations, FIRST_SWEEPS);
        if swept.status != SolveStatus::Failed {
            return Some(swept);
        }
        // the residual of contacts that slip falls as one over the number of sweeps
        let enough = swept.work.sweeps as f64 * swept.residual / accept;
        if enough > 0.5 * PATH * sweeps_for_an_iteration(rows) {
            return None;
        }
        let more = self.swept(problem, rows, accept, iterations, (2.0 * enough) as u64);
        let work = Work { sweeps: swept.work.sweeps + more.work.sweeps, ..more.work };
        (more.status != SolveStatus::Failed).then_some(SolveReport { work, ..more })
    }

    /// Rounds at the largest penalty, from the active set of the reactions that the problem brought along, bettered by
    /// some sweeps in the plane; none if they run in circles. In space sweeps that have not converged spoil the
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
            self.renew = true;
            guess = guess.and_then(|guess| self.by_held_terms(&started, guess, held::ABOUT, iterations));
        }
        let report = guess.and_then(|mut guess| self.rounds(problem, &mut started, &mut guess, held, iterations));
        self.renew |= report.is_none();
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
            let (reached, residual) = (problem.swept(0), problem.residual());
            let report = self.penalised(problem, rows, reached.clone(), iterations);
            if report.is_some() || problem.residual() <= residual {
                return report;
            }
            // less was left before: some sweeps may do from there
            let left = problem.swept(0);
            problem.write_back(&reached);
            let swept = self.swept(problem, rows, self.settings.accept, *iterations, FIRST_SWEEPS);
            if swept.status == SolveStatus::Failed {
                problem.write_back(&left);
                return None;
            }
            Some(swept)
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
        to.flag(self.renew);
        to.flag(self.trusted);
        for count in [self.distrust, self.floor, self.wasted] {
            to.count(count);
        }
        for rest in [self.rest, self.quiet] {
            to.count(rest.left as usize);
            to.count(rest.next as usize);
        }
        to.count(self.dry);
        self.slips.save(to);
        self.factor.save(to);
    }

    /// Take up what [`Newton::save_state`] wrote.
    pub(super) fn restore_state(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        (self.renew, self.trusted) = (from.flag()?, from.flag()?);
        for count in [&mut self.distrust, &mut self.floor, &mut self.wasted] {
            *count = from.count()?;
        }
        for rest in [&mut self.rest, &mut self.quiet] {
            *rest = Rest { left: from.count()? as u64, next: from.count()? as u64 };
        }
        self.dry = from.count()?;
        self.slips = Slips::restored(from)?;
        self.factor = Factor::restored(from)?;
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
        self.iterate(problem)
    }

    fn save(&self, to: &mut Saved) {
        self.save_state(to);
    }

    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        self.restore_state(from)
    }
}

/// How many sweeps over all contacts cost as much as one iteration of the interior-point method. Fitted to 600 to 43,000 contacts of
/// disks (70 to 470 sweeps) and to 2,000 and 14,000 of spheres (150, 700): no clock is looked at.
fn sweeps_for_an_iteration(rows: &Rows) -> f64 {
    let contacts = rows.list.len() as f64;
    if rows.in_space() { 0.4 * contacts.powf(0.8) } else { 6.0 * contacts.powf(0.4) }
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
