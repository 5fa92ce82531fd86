//! The inner problem F(y) = 0 for fixed multipliers: state, Newton direction, line search.

use super::Newton;
use super::corrector::{correct, operator};
use super::guess::Guess;
use super::krylov::gmres;
use crate::solver::stall::Stall;
use crate::solver::rows::{Operator, Rows};
use crate::contact::Padded;

/// GMRES iterations beyond those of a fresh factor that a kept one may cost in all before it is renewed; in space, where
/// fifteen take as long as a factorisation.
const WASTE: usize = 20;
const WASTE_IN_SPACE: usize = 12;
/// Error of a linear solve with the factor alone up to which the next is left to it.
const TRUST: f64 = 1e-3;
/// Linear solves by GMRES after one that the factor alone was trusted with and failed.
const DISTRUST: usize = 100;
/// What a linear solve may leave of F, over what is small enough.
const SMALL: f64 = 0.1;
/// Tolerance of a linear solve: the least and the largest where one may suffice, and where another must follow.
const TIGHT: f64 = 1e-12;
const FAIR: f64 = 1e-3;
const LOOSE: f64 = 1e-2;
/// What a linear solve with a fresh factor may leave before its step is none, and how far F may grow.
const LOST: f64 = 0.1;
const DIVERGED: f64 = 1e6;
/// Most GMRES iterations of one linear solve, and in space with a kept factor.
const MOST_KRYLOV: usize = 80;
const MOST_KEPT_IN_SPACE: usize = 15;

/// State of one solve.
pub(super) struct Iterate {
    pub y: Vec<f64>,
    /// Relative velocities of the contacts at `y`.
    pub velocities: Vec<Padded>,
    /// The corrector's reactions at `y`.
    pub reactions: Vec<Padded>,
    /// F(y), and its norm.
    gradient: Vec<f64>,
    pub norm: f64,
}

impl Iterate {
    /// The state at `y`.
    pub fn at(rows: &Rows, y: Vec<f64>) -> Self {
        let mut gradient: Vec<f64> = y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
        let mut velocities = Vec::with_capacity(rows.list.len());
        let mut reactions = Vec::with_capacity(rows.list.len());
        for row in &rows.list {
            let u = rows.velocity(row, &y);
            let r = correct(row, &u);
            rows.apply(row, &(r * -1.0), &mut gradient);
            velocities.push(u);
            reactions.push(r);
        }
        let norm = norm2(&gradient).sqrt();
        Self { y, velocities, reactions, gradient, norm }
    }

    /// The state at the velocities that the `reactions` give.
    pub fn from_reactions(rows: &Rows, reactions: &[Padded]) -> Self {
        Self::at(rows, rows.given_by(reactions))
    }
}

impl Newton {
    /// Solve the inner problem for fixed multipliers from `state`, in at most `most` iterations and `patience` without
    /// progress; the active set of `guess` is tried first. Returns the iterations made and whether F vanished.
    pub(super) fn inner(
        &mut self,
        rows: &Rows,
        state: &mut Iterate,
        guess: Option<&Guess>,
        patience: u64,
        most: u64,
    ) -> (u64, bool) {
        let mut stall = Stall::after(patience, 0.9);
        for iteration in 0..most {
            let guessed = guess.filter(|_| iteration == 0);
            let target = self.target(rows, state);
            let lost = state.norm > DIVERGED * stall.mark;
            if guessed.is_none() && (state.norm <= target || stall.at(state.norm) || lost) {
                return (iteration, state.norm <= target);
            }
            let Some(direction) = self.direction(rows, state, guessed, target) else { return (iteration + 1, false) };
            let before = direction.norm;
            advance(rows, state, &direction.step, guessed.is_some());
            // a factor that was trusted blindly has to earn it
            let kept = &mut self.kept;
            if kept.trusted && state.norm > (TRUST * before).max(target) {
                kept.trusted = false;
                kept.distrust = DISTRUST;
            }
        }
        (most, state.norm <= self.target(rows, state))
    }

    /// The norm of F that is small enough: a tenth of what either tolerance allows, or what rounding leaves.
    ///
    /// An error of F turns up as a velocity when v is computed from the reactions. Rounding comes from ρ u, where u is a
    /// sum of velocities.
    fn target(&self, rows: &Rows, state: &Iterate) -> f64 {
        let change = distance(&state.y, &rows.free);
        let (mut rounding, mut carried) = (0.0, 0.0);
        for (row, r) in rows.list.iter().zip(&state.reactions) {
            let speed: f64 = (0..2).map(|side| norm2(&state.y[row.at[side]..][..row.count[side]])).sum();
            let soft = row.metric().n;
            rounding += row.size * (speed * row.size / (soft * soft) + r.dot(r));
            carried += row.size * r.dot(r);
        }
        let wanted = (0.1 * self.settings.load_tolerance * change).min(0.1 * self.settings.tolerance * carried.sqrt());
        wanted.max(4.0 * f64::EPSILON * rounding.sqrt())
    }

    /// The Newton direction −J⁻¹ F, by the factor at hand or GMRES on it, renewed if it serves badly.
    fn direction(&mut self, rows: &Rows, state: &Iterate, guess: Option<&Guess>, target: f64) -> Option<Direction> {
        let (mut right, points) = linearise(rows, state, guess);
        right.iter_mut().for_each(|f| *f = -*f);
        let norm = norm2(&right).sqrt();
        let in_space = rows.in_space();
        let tolerance = if in_space && guess.is_none() { LOOSE } else { (SMALL * target / norm).clamp(TIGHT, FAIR) };
        let (most, waste) = if in_space { (MOST_KEPT_IN_SPACE, WASTE_IN_SPACE) } else { (MOST_KRYLOV, WASTE) };
        let kept = &mut self.kept;
        let serves = kept.serves(rows.unknowns);
        if serves && kept.trusted {
            kept.factor.solve(&mut right);
            return Some(Direction { step: right, norm });
        }
        let exact = operators(rows, &points, false);
        for fresh in [!serves, true] {
            if fresh && kept.factor.made >= self.most_made || fresh && !kept.factor.renew(rows, &operators(rows, &points, true)) {
                return None;
            }
            let apply = |x: &[f64], out: &mut [f64]| multiply(rows, &exact, x, out);
            let most = if fresh { MOST_KRYLOV } else { most };
            let (step, report) = gmres(&right, tolerance, most, in_space && !fresh, apply, |x| kept.factor.solve(x));
            if fresh {
                // what even a fresh factor needs is the part that is not symmetric
                (kept.floor, kept.wasted) = (report.iterations, 0);
            }
            kept.wasted += report.iterations.saturating_sub(kept.floor);
            kept.renew = kept.wasted > waste;
            kept.distrust = kept.distrust.saturating_sub(1);
            kept.trusted = kept.distrust == 0 && report.plain <= TRUST;
            if report.residual <= tolerance || fresh && report.residual <= LOST {
                return Some(Direction { step, norm });
            }
        }
        None
    }
}

/// A Newton step, and the norm of F that it is to remove.
struct Direction {
    step: Vec<f64>,
    norm: f64,
}

pub(super) fn norm2(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// ‖a − b‖.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// F, and for each contact the velocity and reaction that its operator A belongs to: those of the state, or with a
/// guess those of the guessed active set, from which F is then extrapolated.
fn linearise(rows: &Rows, state: &Iterate, guess: Option<&Guess>) -> (Vec<f64>, Vec<(Padded, Padded)>) {
    let Some(guess) = guess else {
        let points = state.velocities.iter().copied().zip(state.reactions.iter().copied());
        return (state.gradient.clone(), points.collect());
    };
    let mut gradient: Vec<f64> = state.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
    let mut points = Vec::with_capacity(rows.list.len());
    for (k, (row, u)) in rows.list.iter().zip(&state.velocities).enumerate() {
        let from = guess.velocity(k, row);
        let at = correct(row, &from);
        let mut r = at;
        if let Some(a) = operator(row, &from, &at, false) {
            r += a.times(&(from - *u));
        }
        rows.apply(row, &(r * -1.0), &mut gradient);
        points.push((from, at));
    }
    (gradient, points)
}

/// A of every contact, or its symmetric part for the factor.
fn operators(rows: &Rows, points: &[(Padded, Padded)], symmetric: bool) -> Vec<Option<Operator>> {
    rows.list.iter().zip(points).map(|(row, (u, r))| operator(row, u, r, symmetric)).collect()
}

/// out ← (I + Σ H̃ A H̃ᵀ) x.
fn multiply(rows: &Rows, operators: &[Option<Operator>], x: &[f64], out: &mut [f64]) {
    out.copy_from_slice(x);
    for (row, operator) in rows.list.iter().zip(operators) {
        if let Some(a) = operator {
            rows.apply(row, &a.times(&rows.pulled(row, x)), out);
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
    let convex = rows.list.iter().all(|row| row.associated);
    let full = step(1.0);
    let start = slope(state);
    let good = if convex { slope(&full).abs() <= 0.5 * start.abs() } else { full.norm <= 0.9 * state.norm };
    if whole || good {
        *state = full;
        return;
    }
    if convex {
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
