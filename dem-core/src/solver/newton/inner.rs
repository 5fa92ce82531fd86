//! The inner problem F(y) = 0 for fixed multipliers: state, Newton direction, line search.

use super::corrector::{correct, operator};
use super::guess::guessed_velocity;
use super::{Newton, StagedSettings};
use crate::contact::Padded;
use crate::solver::graph::Graph;
use crate::solver::rows::{Operator, Rows};
use crate::solver::tuning::{INVISIBLE, PATIENCE, PROGRESS, ROUND_OFF, SHARE, extrapolation, newton as tuning};

/// An iterate of the inner problem.
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
    /// Solve the inner problem for fixed multipliers from `state`; the first iteration uses the
    /// active set of `guess`. With `warm`, the first proximal iteration of a warm start, Newton
    /// gives up if this active set leaves much of F. Returns the iterations made and whether ‖F‖
    /// reached its target.
    pub(super) fn inner(&mut self, rows: &Rows, state: &mut Iterate, guess: &[Padded], warm: bool) -> (u64, bool) {
        // at least the load: in a solution that of the reactions
        let load = distance(&state.y, &rows.free).hypot(rows.elastic(&state.reactions).sqrt());
        let much = (tuning::LEFT_BY_GUESS * state.norm).max(load);
        let (mut least, mut since) = (f64::INFINITY, 0);
        for iteration in 0..tuning::MOST_ITERATIONS {
            let guessed = (iteration == 0).then_some(guess);
            let target = self.target(rows, state);
            if guessed.is_none() {
                let wrong = warm && iteration == 1 && state.norm > much;
                (least, since) = if state.norm < PROGRESS * least { (state.norm, 0) } else { (least, since + 1) };
                if state.norm <= target || wrong || !state.norm.is_finite() || since >= PATIENCE {
                    return (iteration, state.norm <= target);
                }
            }
            let Some(direction) = self.direction(rows, state, guessed, target) else { return (iteration + 1, false) };
            advance(rows, state, &direction, guessed.is_some());
        }
        (tuning::MOST_ITERATIONS, state.norm <= self.target(rows, state))
    }

    /// Target of ‖F‖: a tenth of what the stricter tolerance allows, but at least its round-off.
    ///
    /// An error of F becomes an error of velocity when v is computed from the reactions, which must
    /// also be small beside the velocities at which elastic bonds deform. Round-off comes from ρ u,
    /// where u is a sum of velocities.
    fn target(&self, rows: &Rows, state: &Iterate) -> f64 {
        let change = distance(&state.y, &rows.free);
        let (mut rounding, mut carried) = (0.0, 0.0);
        for (row, r) in rows.list.iter().zip(&state.reactions) {
            let speed: f64 = (0..2).map(|side| norm2(&state.y[row.at[side]..][..row.count[side]])).sum();
            let soft = row.metric().n;
            rounding += row.size * (speed * row.size / (soft * soft) + r.dot(r));
            carried += row.size * r.dot(r);
        }
        // iterations with kept factors are cheap, and the extrapolation learns the growth from them
        let share = if self.is_first_guess { SHARE * extrapolation::SHARE } else { SHARE };
        let StagedSettings { tolerance, load_tolerance, .. } = self.settings;
        let wanted = share * (load_tolerance * change).min(tolerance * carried.sqrt());
        let wanted = wanted.min(SHARE * load_tolerance * rows.deforming(&state.reactions));
        wanted.max(ROUND_OFF * rounding.sqrt())
    }

    /// The Newton direction −J⁻¹ F: with the cached factors if a few refinements make it accurate
    /// enough, else with new ones.
    fn direction(&mut self, rows: &Rows, state: &Iterate, guess: Option<&[Padded]>, target: f64) -> Option<Vec<f64>> {
        let (mut right, points) = linearise(rows, state, guess);
        right.iter_mut().for_each(|f| *f = -*f);
        let norm = norm2(&right).sqrt();
        let least =
            (SHARE * target / norm).clamp(INVISIBLE, if guess.is_none() { tuning::LOOSE } else { tuning::FAIR });
        let exact = operators(rows, &points);
        for fresh in [!self.factor.fits(rows.unknowns), true] {
            if fresh {
                let graph = Graph::of(rows, &mut self.graph)?;
                if self.factor.made >= self.most_made || !self.factor.renew(rows, &exact, graph) {
                    return None;
                }
            }
            let (mut step, mut left, mut last) = (vec![0.0; right.len()], right.clone(), 1.0);
            for _ in 0..tuning::MOST_REFINED {
                self.factor.solve(&mut left);
                step.iter_mut().zip(&left).for_each(|(x, d)| *x += d);
                multiply(rows, &exact, &step, &mut left);
                left.iter_mut().zip(&right).for_each(|(l, r)| *l = r - *l);
                let share = norm2(&left).sqrt() / norm;
                if share <= least || fresh && share <= SHARE && share > 0.5 * last {
                    return Some(step);
                }
                // the factors are too old
                if share > 0.5 * last || !share.is_finite() {
                    break;
                }
                last = share;
            }
            if fresh && last <= SHARE {
                return Some(step);
            }
        }
        None
    }
}

pub(super) fn norm2(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// ‖a − b‖.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// F, and for each contact the velocity and reaction at which its operator A is evaluated. With a
/// guess these are those of the guessed active set, from which F is extrapolated; else those of the
/// state.
fn linearise(rows: &Rows, state: &Iterate, guess: Option<&[Padded]>) -> (Vec<f64>, Vec<(Padded, Padded)>) {
    let Some(guess) = guess else {
        let points = state.velocities.iter().copied().zip(state.reactions.iter().copied());
        return (state.gradient.clone(), points.collect());
    };
    let mut gradient: Vec<f64> = state.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
    let mut points = Vec::with_capacity(rows.list.len());
    for ((row, u), guess) in rows.list.iter().zip(&state.velocities).zip(guess) {
        let from = guessed_velocity(row, guess);
        let at = correct(row, &from);
        let mut r = at;
        if let Some(a) = operator(row, &from, &at) {
            r += a.times(&(from - *u));
        }
        rows.apply(row, &(r * -1.0), &mut gradient);
        points.push((from, at));
    }
    (gradient, points)
}

/// A of every contact.
fn operators(rows: &Rows, points: &[(Padded, Padded)]) -> Vec<Option<Operator>> {
    rows.list.iter().zip(points).map(|(row, (u, r))| operator(row, u, r)).collect()
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

/// Line search: the full step if F shrinks enough or `whole` is set (a guess is adopted). Else the
/// root of the slope if all laws are associated, or the best of the step and a few shorter ones.
fn advance(rows: &Rows, state: &mut Iterate, direction: &[f64], whole: bool) {
    let step = |length: f64| {
        let y = state.y.iter().zip(direction).map(|(y, d)| y + length * d).collect();
        Iterate::at(rows, y)
    };
    let slope = |at: &Iterate| at.gradient.iter().zip(direction).map(|(f, d)| f * d).sum::<f64>();
    let convex = rows.list.iter().all(|row| row.associated);
    let full = step(1.0);
    let start = slope(state);
    let good = if convex { slope(&full).abs() <= 0.5 * start.abs() } else { full.norm <= PROGRESS * state.norm };
    if whole || good {
        *state = full;
        return;
    }
    if convex {
        // F·d grows along d and vanishes at the minimum of the convex function
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

/// The iterate at which the slope vanishes, by regula falsi with the Illinois rule. The slope at 0
/// is `start` < 0; the full step is doubled first while its slope is negative.
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
        if s.abs() <= tuning::FLAT * start.abs() {
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
