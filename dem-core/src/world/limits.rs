//! What a step must not do, however small its residual. Such a step is made in halves, or the run stops.
//!
//! *Bodies too fast for the step* would pass through another between two looks, or be stopped by one that they pass at a
//! distance: contacts are looked for at mid-step only, and their law knows the tangent plane, not the curved surface. Both
//! serve while bodies move little beside their size. The way of each half step is followed here pair by pair, but only where
//! the fastest body goes further than a quarter of the smallest grain: slow scenes pay one look at the velocities.
//!
//! *Contacts that yield.* The residual is relative to all reactions. Where a light grain is pressed between heavy ones, an
//! error that is small beside their weight is a great velocity of the light one.
//!
//! The step asks for none of this where overlaps are pushed out: the speeds of that preparation mean nothing.

use super::assembly::Midpoint;
use super::touch::Kept;
use super::{Touch, World};
use crate::body::Shape;
use crate::bond::failure;
use crate::contact::Law;
use crate::dim::{Dim, Vect};
use crate::problem::{Contact, ContactProblem, Nodes, Visitor};

/// Overlap of a pair, over the smaller radius, that half a step may add.
const DEEP: f64 = 0.5;

/// Distance, over the smaller radius, at which a grain passes another.
const PASSING: f64 = 0.05;

/// Way, over the smaller radius, that the error of a solve may close a contact or stretch a rigid bond in a step.
const YIELDING: f64 = 1e-2;

/// The same where a contact has already given way by half a radius.
const SQUEEZING: f64 = 1e-5;

impl<D: Dim> World<D> {
    /// A pair that goes too deep into one another, or through, within `time` (s) from these places at these velocities; of
    /// all candidates the first.
    pub(super) fn crossing(
        &self,
        place: impl Fn(usize) -> D::Vector,
        velocity: impl Fn(usize) -> D::Vector,
        time: f64,
    ) -> Option<[u32; 2]> {
        let fastest = (0..self.grains.len() + self.walls.len()).map(|k| velocity(k).norm()).fold(0.0, f64::max);
        let smallest = self.grains.radius.iter().copied().fold(f64::INFINITY, f64::min);
        if 2.0 * fastest * time <= DEEP * smallest {
            return None;
        }
        let too_deep = |pair: &&[u32; 2]| {
            let [i, j] = pair.map(|k| k as usize);
            let (surface, radius) = (self.surface(j), self.grains.radius[i]);
            let (offset, way) = (place(i) - place(j), (velocity(i) - velocity(j)) * time);
            let before = surface.gap(offset, radius).0.min(0.0);
            surface.smallest_gap(offset, way, radius) < before - DEEP * self.smaller(**pair)
        };
        self.candidates.pairs.iter().find(too_deep).copied()
    }

    /// Whether a gap (m) is beyond [`DEEP`] or [`PASSING`].
    pub(super) fn is_deep_or_wide(&self, pair: [u32; 2], gap: f64) -> bool {
        let smaller = self.smaller(pair);
        gap < -DEEP * smaller || gap > PASSING * smaller
    }

    /// A pair of grains that pushes though it would pass at a distance: only its tangent plane was in the way.
    pub(super) fn pushes_from_afar(
        &self,
        mid: &Midpoint<D>,
        touches: &[Kept<D>],
        nodes: &Nodes<D>,
        h: f64,
    ) -> Option<[u32; 2]> {
        let far = |kept: &&Kept<D>| {
            if !kept.deep_or_wide || kept.bond().is_some() || kept.reaction.n <= 0.0 {
                return false;
            }
            let t = self.touch(mid, kept);
            let margin = PASSING * self.smaller(t.pair);
            if t.gap <= margin {
                return false;
            }
            let [i, j] = t.pair.map(|k| k as usize);
            let offset = D::normal(&t.frame) * (t.gap + self.grains.radius[i] + self.grains.radius[j]);
            let way = (nodes.all[i].velocity - nodes.all[j].velocity) * h;
            self.surface(j).smallest_gap(offset, way, self.grains.radius[i]) > margin
        };
        touches.iter().filter(|t| (t.pair[1] as usize) < self.grains.len()).find(far).map(|t| t.pair)
    }

    /// The contact of a solution that yields most, if it does so too far, and how far it would in a whole step (–, over the
    /// smaller radius).
    pub(super) fn yielding(
        &self,
        mid: &Midpoint<D>,
        touches: &[Kept<D>],
        problem: &ContactProblem<D>,
    ) -> Option<([u32; 2], f64)> {
        let mut worst = Yielding { world: self, pair: [0; 2], share: 0.0 };
        problem.visit(&mut worst);
        if worst.share > YIELDING {
            return Some((worst.pair, worst.share));
        }
        // little by little is too far in the end
        let pressed = touches.iter().filter(|t| t.deep_or_wide && t.bond().is_none() && t.reaction.n > 0.0);
        let deep = pressed.map(|t| self.touch(mid, t)).filter(|t| t.gap < -DEEP * self.smaller(t.pair));
        let closing = |t: Touch<D>| {
            let [i, j] = t.pair.map(|k| problem.nodes.all[k as usize].velocity);
            (t.pair, -(i - j).dot(&D::normal(&t.frame)) * self.settings.step / self.smaller(t.pair))
        };
        deep.map(closing).find(|(_, share)| *share > SQUEEZING)
    }

    /// The place of a body (m), grains first.
    pub(super) fn place(&self, body: usize) -> D::Vector {
        body.checked_sub(self.grains.len()).map_or_else(|| self.grains.position[body], |wall| self.walls[wall].position)
    }

    /// The surface of a body, grains first.
    fn surface(&self, body: usize) -> Shape<D> {
        match body.checked_sub(self.grains.len()) {
            None => Shape::Round { radius: self.grains.radius[body], inside: false, axis: None },
            Some(wall) => self.walls[wall].shape,
        }
    }

    /// The radius of the smaller body of a pair (m); that of the grain at a plane.
    fn smaller(&self, pair: [u32; 2]) -> f64 {
        let [i, j] = pair.map(|k| k as usize);
        let other = match self.surface(j) {
            Shape::Plane { .. } => f64::INFINITY,
            Shape::Round { radius, .. } => radius,
        };
        self.grains.radius[i].min(other)
    }
}

/// Looks for the contact that yields most.
struct Yielding<'a, D: Dim> {
    world: &'a World<D>,
    pair: [u32; 2],
    share: f64,
}

impl<D: Dim> Visitor<D> for Yielding<'_, D> {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let law = &c.law;
        // what is elastic yields by its spring
        if law.compliance().n > 0.0 {
            return;
        }
        let dry = law.shift() == 0.0;
        let opening = nodes.relative_velocity::<L::T, L::B>(&c.link, law.arms()).n + law.bias();
        let speed = if dry { -opening } else { opening.abs() };
        let share = self.world.settings.step * speed / self.world.smaller(c.link.nodes);
        // a bond at its limit is about to break
        if share > self.share && (dry || failure(&c.r, law.shift(), law.cone()).is_none()) {
            (self.pair, self.share) = (c.link.nodes, share);
        }
    }
}
