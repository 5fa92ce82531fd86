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
//! GMRES and renewed when that needs too many iterations.
//!
//! Started from zero reactions the first proximal step is the stiff limit: the reactions of least Σ r²/ρ among all
//! that balance the load, the ones that elastic contacts with stiffnesses in the ratio of ρ would give.
//!
//! Sources: Hestenes 1969 and Powell 1969 (augmented Lagrangian); Alart & Curnier 1991; Qi & Sun 1993 (semismooth
//! Newton); Olsen & Kamrin, arXiv 1805.07437 (the stiff limit).

mod assembled;
mod corrector;
mod factor;
mod krylov;
mod rows;
mod solvable;

use super::{ContactSolver, GaussSeidelSettings, SolveReport, SolveStatus};
use crate::contact::{Local, LocalSolve};
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::problem::assembled::Assembled;
use corrector::{act, correct, operator};
use factor::Factor;
use krylov::gmres;
use rows::{Operator, Padded, Row, Rows};
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
/// GMRES iterations after which the factor is renewed.
const TIRED: usize = 5;
/// Most GMRES iterations of one linear solve.
const MOST_KRYLOV: usize = 80;
/// Newton iterations of one inner problem before the state is smoothed by sweeps.
const PATIENCE: u64 = 8;
/// How often the penalty may be lowered tenfold in one solve.
const MOST_SOFTENED: u32 = 4;
/// Sweeps that look for the active set: at every step, from zero reactions, and where Newton stalls.
const SWEEPS: usize = 5;
const COLD_SWEEPS: usize = 100;
const STALL_SWEEPS: usize = 50;
/// Stalls after which Gauss–Seidel takes over, and the most sweeps that it makes.
const MOST_STALLS: u64 = 3;
const MOST_SWEEPS: u64 = 100_000;

/// Augmented-Lagrangian semismooth Newton.
pub struct Newton {
    settings: NewtonSettings,
    factor: Factor,
    renew: bool,
}

/// State of one solve.
struct Iterate {
    y: Vec<f64>,
    velocities: Vec<Padded>,
    reactions: Vec<Padded>,
    /// F(y), and its norm.
    gradient: Vec<f64>,
    norm: f64,
}

impl Newton {
    /// A solver with these settings.
    pub fn new(settings: NewtonSettings) -> Self {
        Self { settings, factor: Factor::default(), renew: true }
    }

    /// Solve the inner problem for fixed multipliers from `state`. `guess` are reactions whose active set is tried
    /// first. Returns the iterations made and whether F vanished.
    fn inner(&mut self, rows: &Rows, state: &mut Iterate, guess: Option<&[Padded]>) -> (u64, bool) {
        for iteration in 0..PATIENCE {
            let guessed = guess.filter(|_| iteration == 0);
            let target = self.target(rows, state);
            if guessed.is_none() && state.norm <= target {
                return (iteration, true);
            }
            let Some(direction) = self.direction(rows, state, guessed, target) else { return (iteration + 1, false) };
            advance(rows, state, &direction, guessed.is_some());
            if !state.norm.is_finite() {
                return (iteration + 1, false);
            }
        }
        (PATIENCE, state.norm <= self.target(rows, state))
    }

    /// The norm of F that is small enough: a tenth of what either tolerance allows, or what rounding leaves.
    ///
    /// An error of F turns up as a velocity when v is computed from the reactions. Rounding comes from ρ u, where u is a
    /// sum of velocities, and from the shift that is added and taken away.
    fn target(&self, rows: &Rows, state: &Iterate) -> f64 {
        let change: f64 = state.y.iter().zip(&rows.free).map(|(y, f)| (y - f) * (y - f)).sum();
        let (mut rounding, mut carried) = (0.0, 0.0);
        for (row, r) in rows.list.iter().zip(&state.reactions) {
            let width = row.count[0] + row.count[1];
            let speed: f64 = (0..2).map(|side| norm2(&state.y[row.at[side]..][..row.count[side]])).sum();
            let h = norm2(&rows.coefficients[row.start..][..width]);
            let own = Local { n: r.n - row.shift, ..*r };
            rounding += h * (speed * h / (row.weights.n * row.weights.n) + r.dot(r));
            carried += h * own.dot(&own);
        }
        let wanted =
            (0.1 * self.settings.load_tolerance * change.sqrt()).min(0.1 * self.settings.tolerance * carried.sqrt());
        wanted.max(4.0 * f64::EPSILON * rounding.sqrt())
    }

    /// The Newton direction −J⁻¹ F, by GMRES on the factor at hand, renewed if it serves badly.
    fn direction(&mut self, rows: &Rows, state: &Iterate, guess: Option<&[Padded]>, target: f64) -> Option<Vec<f64>> {
        let (mut right, operators) = linearise(rows, state, guess);
        right.iter_mut().for_each(|f| *f = -*f);
        let tolerance = (0.1 * target / norm2(&right).sqrt()).clamp(1e-12, 1e-3);
        for fresh in [false, true] {
            if fresh || self.renew || !self.factor.serves(rows.unknowns) {
                let symmetric = symmetric_operators(rows, state, guess);
                if !self.factor.renew(rows, &symmetric) {
                    return None;
                }
                self.renew = false;
            }
            let apply = |x: &[f64], out: &mut [f64]| multiply(rows, &operators, x, out);
            let (direction, report) = gmres(&right, tolerance, MOST_KRYLOV, apply, |x| self.factor.solve(x));
            self.renew = report.iterations > TIRED;
            if report.residual <= tolerance || fresh {
                return Some(direction);
            }
        }
        None
    }

    /// Gauss–Seidel from the impulses at hand. It cannot tell its load error.
    fn swept_to_the_end(&self, problem: &mut impl Solvable, iterations: u64) -> SolveReport {
        let NewtonSettings { tolerance, accept, .. } = self.settings;
        problem.forget_what_is_not_finite();
        let settings = GaussSeidelSettings {
            local: LocalSolve::Exact,
            tolerance: tolerance.max(accept),
            accept,
            max_sweeps: MOST_SWEEPS,
        };
        let swept = problem.gauss_seidel(settings);
        let status =
            if swept.residual <= tolerance { swept.status } else { swept.status.at_best(SolveStatus::Accepted) };
        SolveReport { status, iterations: iterations + swept.iterations, ..swept }
    }

    fn report(&self, iterations: u64, residual: f64, load_error: f64) -> SolveReport {
        let status = if residual <= self.settings.tolerance && load_error <= self.settings.load_tolerance {
            SolveStatus::Converged
        } else if residual <= self.settings.accept {
            SolveStatus::Accepted
        } else {
            SolveStatus::Failed
        };
        SolveReport { status, iterations, residual, load_error: Some(load_error) }
    }
}

fn norm2(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// H̃ (r̂ − s n), times `sign`, added to `out`.
fn add_reactions(rows: &Rows, reactions: &[Padded], sign: f64, out: &mut [f64]) {
    for (row, r) in rows.list.iter().zip(reactions) {
        let r = Local { n: r.n - row.shift, ..*r };
        rows.apply(row, &(r * sign), out);
    }
}

impl Iterate {
    fn at(rows: &Rows, y: Vec<f64>) -> Self {
        let velocities: Vec<Padded> = rows.list.iter().map(|row| rows.velocity(row, &y)).collect();
        let reactions: Vec<Padded> = rows.list.iter().zip(&velocities).map(|(row, u)| correct(row, u)).collect();
        let mut gradient: Vec<f64> = y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
        add_reactions(rows, &reactions, -1.0, &mut gradient);
        let norm = norm2(&gradient).sqrt();
        Self { y, velocities, reactions, gradient, norm }
    }
}

/// The velocity at which the corrector gives the guessed reaction.
fn guessed_velocity(row: &Row, guess: &Padded) -> Padded {
    let (w, r) = (&row.weights, row.multiplier);
    Local { n: (r.n - guess.n) * w.n, t: (r.t - guess.t) * w.t, m: (r.m - guess.m) * w.m }
}

/// F and A at the state; with a guess, both from the active set of the guessed reactions.
fn linearise(rows: &Rows, state: &Iterate, guess: Option<&[Padded]>) -> (Vec<f64>, Vec<Option<Operator>>) {
    let Some(guess) = guess else {
        let at = rows.list.iter().zip(&state.velocities).zip(&state.reactions);
        return (state.gradient.clone(), at.map(|((row, u), r)| operator(row, u, r, false)).collect());
    };
    let mut gradient: Vec<f64> = state.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
    let mut operators = Vec::with_capacity(rows.list.len());
    let mut reactions = Vec::with_capacity(rows.list.len());
    for ((row, u), guess) in rows.list.iter().zip(&state.velocities).zip(guess) {
        let from = guessed_velocity(row, guess);
        let r = correct(row, &from);
        let a = operator(row, &from, &r, false);
        reactions.push(a.as_ref().map_or(r, |a| r + act(a, &(from - *u))));
        operators.push(a);
    }
    add_reactions(rows, &reactions, -1.0, &mut gradient);
    (gradient, operators)
}

/// The symmetric parts, for the factor.
fn symmetric_operators(rows: &Rows, state: &Iterate, guess: Option<&[Padded]>) -> Vec<Option<Operator>> {
    let mut operators = Vec::with_capacity(rows.list.len());
    for (k, row) in rows.list.iter().enumerate() {
        let (u, r) = match guess {
            None => (state.velocities[k], state.reactions[k]),
            Some(guess) => {
                let u = guessed_velocity(row, &guess[k]);
                (u, correct(row, &u))
            }
        };
        operators.push(operator(row, &u, &r, true));
    }
    operators
}

/// out ← (I + Σ H̃ A H̃ᵀ) x.
fn multiply(rows: &Rows, operators: &[Option<Operator>], x: &[f64], out: &mut [f64]) {
    out.copy_from_slice(x);
    for (row, operator) in rows.list.iter().zip(operators) {
        if let Some(a) = operator {
            rows.apply(row, &act(a, &rows.pulled(row, x)), out);
        }
    }
}

/// Move along the direction: the whole step where F shrinks enough or a guess is taken up, else the best of a few
/// shorter ones.
fn advance(rows: &Rows, state: &mut Iterate, direction: &[f64], whole: bool) {
    let step = |length: f64| {
        let y = state.y.iter().zip(direction).map(|(y, d)| y + length * d).collect();
        Iterate::at(rows, y)
    };
    let slope = |at: &Iterate| at.gradient.iter().zip(direction).map(|(f, d)| f * d).sum::<f64>();
    let associated = rows.list.iter().all(|r| r.associated);
    let full = step(1.0);
    let start = slope(state);
    let good = if associated { slope(&full).abs() <= 0.5 * start.abs() } else { full.norm <= 0.9 * state.norm };
    if whole || good {
        *state = full;
        return;
    }
    if associated {
        // F·d grows along d: the minimum of the convex function is where it vanishes
        *state = root(step, slope, start, full);
        return;
    }
    let mut best = full;
    let mut length = 1.0;
    for _ in 0..6 {
        length *= 0.5;
        let next = step(length);
        if next.norm < best.norm {
            best = next;
        }
    }
    *state = best;
}

/// Where the slope vanishes, between 0 (slope `start` < 0) and a step that may have to be prolonged: regula falsi with
/// the Illinois rule.
fn root(step: impl Fn(f64) -> Iterate, slope: impl Fn(&Iterate) -> f64, start: f64, full: Iterate) -> Iterate {
    let (mut low, mut low_slope) = (0.0, start);
    let mut high = 1.0;
    let mut found = full;
    let mut high_slope = slope(&found);
    for _ in 0..10 {
        if high_slope >= 0.0 {
            break;
        }
        (low, low_slope) = (high, high_slope);
        high *= 2.0;
        found = step(high);
        high_slope = slope(&found);
    }
    for _ in 0..20 {
        if high_slope <= 0.0 {
            break;
        }
        let length = (low * high_slope - high * low_slope) / (high_slope - low_slope);
        let next = step(length);
        let s = slope(&next);
        found = next;
        if s.abs() <= 0.1 * start.abs() {
            break;
        }
        if s < 0.0 {
            (low, low_slope) = (length, s);
            high_slope *= 0.5;
        } else {
            (high, high_slope) = (length, s);
            low_slope *= 0.5;
        }
    }
    found
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
        let mut rows = problem.rows(KAPPA, self.settings.stiffness);
        if rows.unknowns == 0 || rows.list.is_empty() {
            return self.report(0, problem.residual(), 0.0);
        }
        // the reactions that the problem brought along, bettered by some sweeps, show which contacts are active
        let cold = rows.list.iter().all(|row| row.multiplier.n == row.shift);
        let mut guess = problem.swept(&rows, if cold { COLD_SWEEPS } else { SWEEPS });
        if self.settings.start == Start::StiffLimit {
            rows.list.iter_mut().for_each(|row| row.multiplier = Local { n: row.shift, ..Local::zero() });
        }
        let mut y = rows.free.clone();
        add_reactions(&rows, &guess, 1.0, &mut y);
        let mut state = Iterate::at(&rows, y);
        let (mut guessed, mut stalls) = (true, 0);
        let (mut last_error, mut softened) = (f64::INFINITY, 0);
        let (mut iterations, mut error, mut load_error) = (0, f64::INFINITY, f64::INFINITY);
        while iterations < self.settings.max_iterations {
            let (made, solved) = self.inner(&rows, &mut state, guessed.then_some(&guess[..]));
            iterations += made.max(1);
            guessed = false;
            problem.write_back(&state.reactions, &rows);
            if !solved {
                // the active set runs in circles: sweeps from here show another, or have to do the work alone
                self.renew = true;
                stalls += 1;
                if stalls > MOST_STALLS {
                    return self.swept_to_the_end(problem, iterations);
                }
                guess = problem.swept(&rows, STALL_SWEEPS);
                guessed = true;
                continue;
            }
            load_error = load_change(&rows, &state);
            rows.list.iter_mut().zip(&state.reactions).for_each(|(row, r)| row.multiplier = *r);
            problem.velocities_from_reactions();
            error = problem.residual();
            if error <= self.settings.tolerance && load_error <= self.settings.load_tolerance {
                break;
            }
            if error > 0.5 * last_error && softened < MOST_SOFTENED {
                // what moves fast is rounded by ρ u: a smaller ρ hears less of it, and takes more rounds
                rows.soften(10.0);
                softened += 1;
            }
            last_error = error;
            state = Iterate::at(&rows, state.y);
        }
        self.report(iterations, error, load_error)
    }
}

/// How much the net impulses on the bodies changed in the last proximal step, over themselves: with a contraction far
/// below one, the load error of the step before.
fn load_change(rows: &Rows, state: &Iterate) -> f64 {
    let mut change = vec![0.0; rows.unknowns];
    let mut total = vec![0.0; rows.unknowns];
    for (row, r) in rows.list.iter().zip(&state.reactions) {
        rows.apply(row, &(*r - row.multiplier), &mut change);
        rows.apply(row, &Local { n: r.n - row.shift, ..*r }, &mut total);
    }
    let (change, total) = (norm2(&change).sqrt(), norm2(&total).sqrt());
    if change == 0.0 { 0.0 } else { change / total }
}
