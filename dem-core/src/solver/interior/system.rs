//! The linear system of an iteration at a point.

use super::cones::{Point, moved, product, reach};
use super::coupling::Coupling;
use super::local::{Scaled, solve, yield_to};
use super::sites::Sites;
use super::state::State;
use crate::linear::Factors;

/// One linear system and the point that it belongs to.
pub(super) struct System<'a> {
    pub sites: &'a Sites,
    pub coupling: &'a Coupling<'a>,
    pub at: &'a State,
    /// Right side of the velocity equations, −ℓ: the change of the contacts' velocities that z
    /// requires.
    pub right: Vec<f64>,
    /// W r at the point.
    pub velocity: Vec<f64>,
    /// Its pairs as they are linearised.
    pub pairs: Vec<Scaled>,
    pub compliance: &'a [f64],
    pub inverses: &'a [f64],
    pub factors: &'a Factors,
    /// Sign of the determinant: it changes where the path folds.
    pub sign: f64,
}

impl System<'_> {
    /// The products of these pairs, in the scaling of the point.
    pub fn products(&self, x: &[Point], z: &[Point]) -> Vec<Point> {
        let all = x.iter().zip(z).zip(&self.pairs);
        all.map(|((x, z), Scaled { scaling, .. })| product(&scaling.x(x), &scaling.z(z))).collect()
    }

    /// The step that changes x ∘ z by `by`, to first order.
    pub fn step(&self, by: &[Point], refined: bool) -> State {
        let mut step = self.solved(&self.right, by);
        if refined {
            self.refine(&mut step, by);
        }
        step
    }

    /// Refine a step once, which reduces its round-off. Returns what this adds to it.
    pub fn refine(&self, step: &mut State, by: &[Point]) -> State {
        let (left, missing) = self.left(by, step);
        let more = self.solved(&left, &missing);
        step.r.iter_mut().zip(&more.r).for_each(|(r, d)| *r += d);
        step.z.iter_mut().zip(&more.z).for_each(|(z, d)| *z = moved(z, 1.0, d));
        step.x = self.sites.change(&step.r);
        more
    }

    pub fn solved(&self, right: &[f64], by: &[Point]) -> State {
        let mut step = solve(self.sites, &self.pairs, self.inverses, right, by);
        let yielded = self.coupling.yielded(self.sites, &step.r, self.factors);
        yield_to(self.sites, self.inverses, &yielded, &mut step);
        step.x = self.sites.change(&step.r);
        step
    }

    /// The residuals of the equations after a step.
    fn left(&self, by: &[Point], step: &State) -> (Vec<f64>, Vec<Point>) {
        let moving = self.coupling.velocity(self.sites, &step.r);
        let opened = self.sites.velocity(&step.z);
        let left = (0..self.sites.rows).map(|k| self.right[k] - moving[k] - self.compliance[k] * step.r[k] + opened[k]);
        let missing = |c: usize| {
            let Scaled { scaling, x, z } = &self.pairs[c];
            let (a, b) = (product(z, &scaling.x(&step.x[c])), product(x, &scaling.z(&step.z[c])));
            [by[c][0] - a[0] - b[0], by[c][1] - a[1] - b[1], by[c][2] - a[2] - b[2]]
        };
        (left.collect(), (0..by.len()).map(missing).collect())
    }

    /// Relative size of a change of the reactions, in the norm of r·(W + C) r (–).
    pub fn change(&self, change: &[f64]) -> f64 {
        let load = |r: &[f64], moving: &[f64]| {
            let each = r.iter().zip(moving).zip(&self.sites.compliance);
            each.map(|((r, u), c)| r * (u + c * r)).sum::<f64>().abs()
        };
        let moving = self.coupling.velocity(self.sites, change);
        (load(change, &moving) / load(&self.at.r, &self.velocity).max(f64::MIN_POSITIVE)).sqrt()
    }

    /// The longest multiple of a step that stays inside all cones.
    pub fn longest(&self, step: &State) -> f64 {
        let ends = self.at.x.iter().zip(&step.x).chain(self.at.z.iter().zip(&step.z)).map(|(x, d)| reach(x, d));
        ends.fold(f64::INFINITY, f64::min)
    }
}
