//! Extrapolated steps, without a linear solve. While a sample at rest is loaded at a constant rate
//! and no contact changes its status, the reactions grow by the same increment in each step. The
//! increment between two consecutive solves is added again. The step is accepted if the residual is
//! well below its tolerance, the balance of momentum is as good as after the last solve, and no
//! bond is at its limit.
//!
//! Laws and balance do not determine how the contacts of a rigid network share the load. A contact
//! that sticks shows a change of status: its reaction leaves the cone. An open or slipping contact
//! does not, so its margin to closing or sticking is extrapolated with the reactions. At intervals
//! a solve is compared with the extrapolation.

use super::backoff::Backoff;
use super::rows::{Row, Rows, mass_unit};
use crate::contact::Padded;
use crate::dim::{Dim, Moments, Vect};
use crate::problem::residual::{elastic_error, residual, velocity_error};
use crate::problem::{ContactProblem, KINDS};
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::{INVISIBLE, extrapolation as tuning};

/// Reactions and their growth.
#[derive(Clone, Default)]
pub(super) struct Extrapolation {
    /// Numbers of contacts of each kind.
    shape: [usize; KINDS],
    /// Reactions of a solve, and their increment in each step since (N s).
    base: Vec<f64>,
    rate: Vec<f64>,
    /// The same for the [margins](margins) of the contacts.
    margins: Vec<f64>,
    margin_rate: Vec<f64>,
    /// Steps since that solve.
    steps: u64,
    /// Extrapolated steps allowed between two solves (none until a solve confirms constant growth),
    /// and the steps left of them.
    most: u64,
    left: u64,
    /// Momentum that the solve left, relative to the net impulses of the contacts (–).
    moves: f64,
    /// Whether the last step was extrapolated. The reactions of the next solve then include the
    /// momentum that it left, and say nothing about the growth.
    last_extrapolated: bool,
    /// Back-off after failed extrapolations.
    backoff: Backoff,
}

impl Extrapolation {
    /// Set the reactions of a problem to the extrapolated ones if these solve it; returns their
    /// residual and load error. Else the reactions remain unchanged.
    pub fn predict<D: Dim>(
        &mut self,
        problem: &mut ContactProblem<D>,
        tolerance: f64,
        load_tolerance: f64,
    ) -> Option<(f64, f64)> {
        if self.left == 0 || self.shape != problem.lengths() {
            return None;
        }
        if !self.backoff.is_over() {
            self.backoff.count_down();
            return None;
        }
        let brought = problem.reactions();
        problem.set_reactions(&self.grown(&self.base, &self.rate));
        problem.velocities_from_reactions();
        let (residual, moves, elastic_error) = (residual(problem), motion(problem), elastic_error(problem));
        // at most twice the momentum that the solve before left
        let allowed = load_tolerance.min((2.0 * self.moves).max(tuning::SHARE * load_tolerance));
        let holds = residual <= tuning::SHARE * tolerance
            && moves <= allowed
            && elastic_error <= load_tolerance
            && velocity_error(problem) <= load_tolerance
            && self.keeps_status();
        if holds && !problem.is_at_limit() {
            (self.steps, self.left, self.last_extrapolated) = (self.steps + 1, self.left - 1, true);
            self.backoff.forget();
            return Some((residual, moves.max(elastic_error)));
        }
        problem.set_reactions(&brought);
        self.left = 0;
        self.backoff.lengthen();
        None
    }

    /// Compare a solution, and the [margins](margins) of its contacts, with the extrapolation, and
    /// update the growth.
    pub fn learn<D: Dim>(&mut self, problem: &ContactProblem<D>, margins: &[f64], load_tolerance: f64) {
        let unit = mass_unit(&problem.nodes);
        let (solution, margins) = (problem.reactions(), margins.iter().map(|m| m * unit).collect::<Vec<_>>());
        if self.shape != problem.lengths() || self.base.is_empty() {
            let (rate, margin_rate) = (vec![0.0; solution.len()], vec![0.0; margins.len()]);
            let (shape, backoff) = (problem.lengths(), self.backoff);
            *self = Self { shape, base: solution, rate, margins, margin_rate, backoff, ..Self::default() };
            return;
        }
        if std::mem::take(&mut self.last_extrapolated) {
            self.steps += 1;
            self.left = 0;
            return;
        }
        let (mut off, mut grown, mut size) = (0.0, 0.0, 0.0);
        for ((now, base), predicted) in solution.iter().zip(&self.base).zip(self.grown(&self.base, &self.rate)) {
            off += (now - predicted) * (now - predicted);
            grown += (now - base) * (now - base);
            size += now * now;
        }
        self.moves = motion(problem);
        let same_limits = margins.iter().zip(&self.margins).all(|(now, base)| now.is_finite() == base.is_finite());
        let even = off <= (tuning::SAME * tuning::SAME * grown).max(INVISIBLE * INVISIBLE * size)
            && self.moves <= load_tolerance
            && same_limits;
        self.most = if even { (2 * self.most).clamp(tuning::FIRST, tuning::MOST) } else { 0 };
        let steps = (self.steps + 1) as f64;
        let finite = |change: f64| if change.is_finite() { change } else { 0.0 };
        let rate =
            |now: &[f64], base: &[f64]| now.iter().zip(base).map(|(now, base)| finite((now - base) / steps)).collect();
        (self.rate, self.margin_rate) = (rate(&solution, &self.base), rate(&margins, &self.margins));
        (self.base, self.margins, self.steps, self.left) = (solution, margins, 0, self.most);
    }

    /// Forget the growth; the back-off remains.
    pub fn forget(&mut self) {
        *self = Self { backoff: self.backoff, ..Self::default() };
    }

    /// `base` extrapolated at this rate to the next step.
    fn grown(&self, base: &[f64], rate: &[f64]) -> Vec<f64> {
        let steps = (self.steps + 1) as f64;
        base.iter().zip(rate).map(|(base, rate)| base + steps * rate).collect()
    }

    /// Whether each open or slipping contact keeps its status in the next step.
    fn keeps_status(&self) -> bool {
        let size = self.base.iter().map(|r| r * r).sum::<f64>().sqrt();
        self.grown(&self.margins, &self.margin_rate).into_iter().all(|margin| margin >= -INVISIBLE * size)
    }

    pub fn save(&self, to: &mut Saved) {
        self.shape.iter().for_each(|n| to.count(*n));
        [self.steps, self.most, self.left].iter().for_each(|n| to.count(*n as usize));
        to.flag(self.last_extrapolated);
        self.backoff.save(to);
        to.real(self.moves);
        for (base, rate) in [(&self.base, &self.rate), (&self.margins, &self.margin_rate)] {
            to.count(base.len());
            to.reals.extend_from_slice(base);
            to.reals.extend_from_slice(rate);
        }
    }

    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut shape = [0; KINDS];
        for count in &mut shape {
            *count = from.count()?;
        }
        let [steps, most, left] = [from.count()?, from.count()?, from.count()?].map(|n| n as u64);
        if most > tuning::MOST || left > most || steps > tuning::MOST + 1 {
            return Err(Mismatch);
        }
        let (last_extrapolated, backoff, moves) = (from.flag()?, Backoff::restored(from)?, from.real()?);
        let mut pair = || {
            let n = from.number_of()?;
            Ok((from.reals(n)?.to_vec(), from.reals(n)?.to_vec()))
        };
        let ((base, rate), (margins, margin_rate)) = (pair()?, pair()?);
        Ok(Self { shape, base, rate, margins, margin_rate, steps, most, left, moves, last_extrapolated, backoff })
    }
}

/// The margin of each contact to another status at these velocities, as a reaction (N s over the
/// unit of mass): the reaction that closes an open contact or makes a slipping one stick. Infinite
/// for a sticking contact.
pub(super) fn margins(rows: &Rows, velocities: &[Padded], reactions: &[Padded]) -> Vec<f64> {
    // a row group with a limit of zero never sticks
    let beyond = |norm: f64, weight: f64, limit: f64| match norm / weight - limit {
        beyond if beyond > 0.0 && limit > 0.0 => beyond,
        _ => f64::INFINITY,
    };
    let margin = |((row, u), r): ((&Row, &Padded), &Padded)| {
        let (q, w, limit) = (row.form(u), row.metric(), r.n + row.shift);
        if limit <= 0.0 {
            return q.n / w.n - row.shift;
        }
        let slip = beyond(q.t.norm(), w.t, row.cone.mu * limit);
        let bend = beyond(q.m.bending(), w.m, row.cone.nu * limit);
        slip.min(bend).min(beyond(q.m.twist(), w.w, row.cone.xi * limit))
    };
    rows.list.iter().zip(velocities).zip(reactions).map(margin).collect()
}

/// Momentum that remains, relative to the net impulses of the contacts, both divided by the square
/// roots of the masses: the load error of a sample at rest (–).
fn motion<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let (mut left, mut taken) = (0.0, 0.0);
    let slides = |k: usize| problem.nodes.slides.get(k).copied().unwrap_or(D::Vector::zero());
    for (k, (node, (velocity, spin))) in problem.nodes.all.iter().zip(problem.free.iter()).enumerate() {
        let over = |inverse: f64, x: f64| if inverse > 0.0 { x / inverse } else { 0.0 };
        let (m, i) = (node.inverse_mass, node.inverse_inertia);
        let given = k.checked_sub(problem.nodes.grains).map_or(D::Vector::zero(), slides);
        let moving = node.velocity - given;
        left += over(m, moving.dot(&moving)) + over(i, node.spin.dot(&node.spin));
        let (v, w) = (node.velocity - *velocity, node.spin - *spin);
        taken += over(m, v.dot(&v)) + over(i, w.dot(&w));
    }
    if left == 0.0 { 0.0 } else { (left / taken).sqrt() }
}
