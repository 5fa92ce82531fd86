//! Steps without a linear solve: while a sample at rest is loaded evenly and no contact changes its status, each step adds the same to
//! the reactions. What two solves on end have added is added again, and taken where the contact laws and the balance hold better
//! than the tolerances ask and no bond is at its limit.
//!
//! Laws and balance do not tell how the contacts of a rigid network share the load. So the next solve is compared with what was
//! predicted: where it is the same more steps may follow, else none.

use crate::bond::failure;
use crate::contact::{Law, Local};
use crate::dim::{Dim, Vect};
use crate::problem::residual::residual;
use crate::problem::{ContactProblem, Group};
use crate::saved::{Mismatch, Reader, Saved};

/// Steps that are predicted on end: at first, and at most.
const FIRST: u64 = 4;
const MOST: u64 = 32;
/// Share of the tolerances that a prediction may take, and how much more momentum it may leave than the solve before it.
const SHARE: f64 = 1e-3;
const MORE: f64 = 2.0;
/// By how much a solve may differ from what was predicted: over what the reactions have grown by, and over the reactions.
const SAME: f64 = 1e-6;
const ROUNDING: f64 = 1e-12;

/// How the reactions grow.
#[derive(Default)]
pub(super) struct Predictor {
    /// Numbers of contacts of each kind.
    shape: [usize; 4],
    /// Reactions of a solve, and what each step since has added to them (N s).
    base: Vec<f64>,
    rate: Vec<f64>,
    /// Steps since.
    steps: u64,
    /// Steps that may be predicted between solves, none while the growth is not known to be even, and those that are left.
    most: u64,
    left: u64,
    /// Load error of the last solve (–).
    load_error: f64,
    /// Whether the last step was predicted: what it left of momentum is in the reactions of the next solve, which tell nothing of
    /// the growth.
    kicked: bool,
}

impl Predictor {
    /// Set the reactions of a problem to what is predicted, if that solves it: its residual and load error. Else the problem is
    /// left as it was.
    pub fn predict<D: Dim>(
        &mut self,
        problem: &mut ContactProblem<D>,
        tolerance: f64,
        load_tolerance: f64,
    ) -> Option<(f64, f64)> {
        if self.left == 0 || self.shape != shape(problem) {
            return None;
        }
        let brought = reactions(problem);
        write(problem, &self.predicted());
        let (residual, load_error) = (residual(problem), motion(problem));
        let allowed = load_tolerance.min((MORE * self.load_error).max(SHARE * load_tolerance));
        let holds = residual <= SHARE * tolerance && load_error <= allowed;
        if holds && !at_limit(&problem.bonded) && !at_limit(&problem.elastic) {
            (self.steps, self.left, self.kicked) = (self.steps + 1, self.left - 1, true);
            return Some((residual, load_error));
        }
        write(problem, &brought);
        self.left = 0;
        None
    }

    /// Compare a solution with what was predicted.
    pub fn learn<D: Dim>(&mut self, problem: &ContactProblem<D>) {
        if std::mem::replace(&mut self.shape, shape(problem)) != self.shape || self.base.is_empty() {
            let base = reactions(problem);
            *self = Self { shape: self.shape, rate: vec![0.0; base.len()], base, ..Self::default() };
            return;
        }
        if std::mem::take(&mut self.kicked) {
            self.steps += 1;
            self.left = 0;
            return;
        }
        let (solution, predicted) = (reactions(problem), self.predicted());
        let (mut off, mut grown, mut size) = (0.0, 0.0, 0.0);
        for ((now, base), predicted) in solution.iter().zip(&self.base).zip(&predicted) {
            off += (now - predicted) * (now - predicted);
            grown += (now - base) * (now - base);
            size += now * now;
        }
        let even = off <= (SAME * SAME * grown).max(ROUNDING * ROUNDING * size);
        self.most = if even { (2 * self.most).clamp(FIRST, MOST) } else { 0 };
        let steps = (self.steps + 1) as f64;
        self.rate = solution.iter().zip(&self.base).map(|(now, base)| (now - base) / steps).collect();
        (self.base, self.steps, self.left) = (solution, 0, self.most);
        self.load_error = motion(problem);
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The reactions of the next step.
    fn predicted(&self) -> Vec<f64> {
        let steps = (self.steps + 1) as f64;
        self.base.iter().zip(&self.rate).map(|(base, rate)| base + steps * rate).collect()
    }

    pub fn save(&self, to: &mut Saved) {
        self.shape.iter().for_each(|n| to.count(*n));
        [self.steps, self.most, self.left].iter().for_each(|n| to.count(*n as usize));
        to.flag(self.kicked);
        to.real(self.load_error);
        to.count(self.base.len());
        to.reals.extend_from_slice(&self.base);
        to.reals.extend_from_slice(&self.rate);
    }

    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut counts = [0; 7];
        for count in &mut counts {
            *count = from.count()?;
        }
        let [a, b, c, d, steps, most, left] = counts;
        let (kicked, load_error, n) = (from.flag()?, from.real()?, from.number_of()?);
        let (base, rate) = (from.reals(n)?.to_vec(), from.reals(n)?.to_vec());
        let [steps, most, left] = [steps, most, left].map(|n| n as u64);
        Ok(Self { shape: [a, b, c, d], base, rate, steps, most, left, load_error, kicked })
    }
}

fn shape<D: Dim>(problem: &ContactProblem<D>) -> [usize; 4] {
    [problem.bonded.len(), problem.elastic.len(), problem.dry.len(), problem.frictionless.len()]
}

/// All reactions, row by row.
fn reactions<D: Dim>(problem: &ContactProblem<D>) -> Vec<f64> {
    fn group<D: Dim, L: Law>(group: &Group<D, L>, to: &mut Vec<f64>) {
        for Local { n, t, m } in group.iter().map(|c| c.r) {
            to.push(n);
            to.extend_from_slice(t.as_slice());
            to.extend_from_slice(m.as_slice());
        }
    }
    let mut all = Vec::new();
    group(&problem.bonded, &mut all);
    group(&problem.elastic, &mut all);
    group(&problem.dry, &mut all);
    group(&problem.frictionless, &mut all);
    all
}

/// Set all reactions, and the velocities that they give.
fn write<D: Dim>(problem: &mut ContactProblem<D>, all: &[f64]) {
    fn group<D: Dim, L: Law>(group: &mut Group<D, L>, from: &mut impl Iterator<Item = f64>) {
        let mut next = || from.next().unwrap_or_default();
        for c in group {
            c.r.n = next();
            (0..L::T::LEN).for_each(|k| c.r.t[k] = next());
            (0..L::B::LEN).for_each(|k| c.r.m[k] = next());
        }
    }
    let mut from = all.iter().copied();
    group(&mut problem.bonded, &mut from);
    group(&mut problem.elastic, &mut from);
    group(&mut problem.dry, &mut from);
    group(&mut problem.frictionless, &mut from);
    problem.velocities_from_reactions();
}

/// Whether one of these bonds is at its limit.
fn at_limit<D: Dim, L: Law<T = D::Tangent, B = D::Moment>>(group: &Group<D, L>) -> bool {
    group.iter().any(|c| failure(&c.r, c.law.shift(), c.law.cone()).is_some())
}

/// Momentum that is left over what the contacts have taken, both over the roots of the masses: the load error of a sample at rest (–).
fn motion<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let (mut left, mut taken) = (0.0, 0.0);
    for (node, (velocity, spin)) in problem.nodes.all.iter().zip(problem.free.iter()) {
        let over = |inverse: f64, x: f64| if inverse > 0.0 { x / inverse } else { 0.0 };
        let (m, i) = (node.inverse_mass, node.inverse_inertia);
        left += over(m, node.velocity.dot(&node.velocity)) + over(i, node.spin.dot(&node.spin));
        let (v, w) = (node.velocity - *velocity, node.spin - *spin);
        taken += over(m, v.dot(&v)) + over(i, w.dot(&w));
    }
    if left == 0.0 { 0.0 } else { (left / taken).sqrt() }
}
