//! The residual of a contact problem, one measure for all solvers: the natural map, relative to the
//! reactions and the load.
//!
//! residual = √Σ‖r̂ − P_K(r̂ − ũ/D)‖² / max(√Σ‖r‖², ‖h F_ext‖), with D one scalar per contact, the
//! largest diagonal entry of its Delassus block. The cohesive shift is not in the denominator: in a
//! strongly bonded sample it would mask the load. A natural map within the round-off of its
//! velocities counts as zero: separating grains leave reactions so small that their ratio to the
//! map is meaningless.
//!
//! The residual is relative to all reactions. Where a body of mass m carries bodies of mass M, the
//! error of its velocity is the residual times M/m. The *velocity error* measures that, and the
//! solvers of [`crate::solver::Staged`] stop on both.

use super::{Contact, ContactProblem, Group, GroupVisitor, Nodes, Visitor};
use crate::contact::{Law, Weights};
use crate::dim::{Dim, Vect};
use rayon::prelude::*;

/// Relative round-off up to which the natural map counts as zero.
pub(super) const ROUNDING: f64 = 64.0 * f64::EPSILON;

#[derive(Default)]
struct Sums {
    map: f64,
    reaction: f64,
    /// Impulses that would stop the bodies of each contact: the scale of the map's round-off.
    motion: f64,
}

/// Number of contacts summed in sequence; chunks of this size are summed in parallel.
const CHUNK: usize = 32_768;

impl<D: Dim> GroupVisitor<D> for Sums {
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, group: &Group<D, L>) {
        if group.len() <= CHUNK {
            group.iter().for_each(|c| self.add(nodes, c));
            return;
        }
        let sum = |chunk: &[Contact<D, L>]| {
            let mut part = Self::default();
            chunk.iter().for_each(|c| part.add(nodes, c));
            part
        };
        let parts: Vec<Self> = group.par_chunks(CHUNK).map(sum).collect();
        for part in parts {
            self.map += part.map;
            self.reaction += part.reaction;
            self.motion += part.motion;
        }
    }
}

impl Sums {
    #[inline(always)]
    fn add<D: Dim, L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let u = nodes.relative_velocity(&c.link, c.law.arms());
        let map = c.law.natural_map(c.r, u);
        self.map += map.dot(&map);
        self.reaction += c.r.dot(&c.r);
        let gamma = c.law.gamma();
        self.motion += gamma * gamma * speeds(nodes, c);
    }
}

/// Squares of the velocities of the bodies of a contact at its point, summed.
#[inline(always)]
fn speeds<D: Dim, L: Law>(nodes: &Nodes<D>, c: &Contact<D, L>) -> f64 {
    let speed = |(node, lever): (&u32, f64)| {
        let node = &nodes.all[*node as usize];
        node.velocity.dot(&node.velocity) + lever * lever * node.spin.dot(&node.spin)
    };
    c.link.nodes.iter().zip(c.law.arms().lever).map(speed).sum()
}

/// The residual of the impulses and node velocities that the problem now holds (–). NaN propagates.
pub fn residual<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let mut sums = Sums::default();
    problem.visit_groups(&mut sums);
    let scale = sums.reaction.sqrt().max(problem.applied);
    relative(sums.map.sqrt(), sums.motion.sqrt(), scale)
}

/// The norm of the natural map over `scale`; zero if it is within the round-off of summands of norm
/// `rounded`.
pub(super) fn relative(map: f64, rounded: f64, scale: f64) -> f64 {
    if map <= ROUNDING * rounded { 0.0 } else { map / scale }
}

/// The velocity error of the impulses and node velocities that the problem now holds (–): the
/// largest natural map of a contact as a velocity, D ‖map‖, over the largest relative velocity
/// without reactions of the contacts that must change theirs: of bonds, and of dry contacts that
/// would close. Where there are none, that of all contacts. Zero in statics.
pub fn velocity_error<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    if problem.is_static {
        return 0.0;
    }
    let Largest { map, asked, free, .. } = Largest::of(problem);
    match map {
        0.0 => 0.0,
        _ if asked > 0.0 => map / asked,
        _ => map / free,
    }
}

/// The largest natural map of a contact as a velocity (m/s): how wrong the motion is.
pub fn wrong_velocity<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    Largest::of(problem).map
}

/// The false motion of the impulses and node velocities that the problem now holds (–): the largest
/// natural map of a contact as a velocity, over the largest relative velocity of any contact. Where
/// a step asks no contact to change its velocity, as between fragments that drift apart, the
/// velocity error relates the round-off of strong reactions to velocities near zero; this tells how
/// wrong the motion is.
pub fn false_motion<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let Largest { map, moving, .. } = Largest::of(problem);
    if map == 0.0 { 0.0 } else { map / moving }
}

/// The elastic error of the impulses and node velocities that the problem now holds (–): that by
/// which elastic bonds violate their law, as impulses C⁻¹ D map, relative to their impulses, both
/// in the norm of r·C r. Zero without elastic bonds, and within the round-off of the velocities.
///
/// Where bonds are stiff for the step, C ≪ D, neither the residual nor the velocity error shows how
/// they share a load: both are relative to the velocities that the load would give free bodies.
pub fn elastic_error<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let mut elastic = Elastic::default();
    problem.visit(&mut elastic);
    relative(elastic.wrong.sqrt(), elastic.rounded.sqrt(), elastic.size.sqrt())
}

/// Sums over elastic bonds: r·C r of the impulses that their velocities lack, of their impulses,
/// and of those that the velocities of their bodies would give.
#[derive(Default)]
struct Elastic {
    wrong: f64,
    size: f64,
    rounded: f64,
}

impl<D: Dim> Visitor<D> for Elastic {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let (law, soft) = (&c.law, c.law.compliance());
        if soft.n == 0.0 {
            return;
        }
        let inverse = |soft: f64| if soft > 0.0 { 1.0 / soft } else { 0.0 };
        let stiff = Weights { n: inverse(soft.n), t: inverse(soft.t), m: inverse(soft.m), w: inverse(soft.w) };
        let map = law.natural_map(c.r, nodes.relative_velocity(&c.link, law.arms())) * (1.0 / law.gamma());
        self.wrong += stiff.times(&map).dot(&map);
        self.size += soft.times(&c.r).dot(&c.r);
        self.rounded += stiff.n * speeds(nodes, c);
    }
}

/// The nodes of the contact with the largest velocity error.
pub fn furthest_from_law<D: Dim>(problem: &ContactProblem<D>) -> [u32; 2] {
    Largest::of(problem).pair
}

/// Largest velocities over all contacts (m/s): `map` of the natural map, at the contact between the
/// nodes `pair`; `moving` of the contacts; `free` without reactions; `asked` the same of the
/// contacts that must change it: beside the gap of one that stays open, over a short step, any
/// other velocity vanishes.
struct Largest<'a, D: Dim> {
    problem: &'a ContactProblem<D>,
    map: f64,
    pair: [u32; 2],
    moving: f64,
    asked: f64,
    free: f64,
}

impl<'a, D: Dim> Largest<'a, D> {
    fn of(problem: &'a ContactProblem<D>) -> Self {
        let mut largest = Self { problem, map: 0.0, pair: [0; 2], moving: 0.0, asked: 0.0, free: 0.0 };
        problem.visit(&mut largest);
        largest
    }
}

impl<D: Dim> Visitor<D> for Largest<'_, D> {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let (law, arms) = (&c.law, c.law.arms());
        let relative = nodes.relative_velocity(&c.link, arms);
        self.moving = self.moving.max(relative.dot(&relative).sqrt());
        let map = law.natural_map(c.r, relative);
        let [i, j] = c.link.nodes.map(|k| self.problem.free[k as usize]);
        let free =
            c.link.relative_velocity::<L::T, L::B>(arms, i, j) + law.bias() - law.compliance().times(&law.carried());
        let speed = map.dot(&map).sqrt() / law.gamma();
        if speed > self.map {
            (self.map, self.pair) = (speed, c.link.nodes);
        }
        let speed = free.dot(&free).sqrt();
        self.free = self.free.max(speed);
        if law.breaks() || free.n < 0.0 {
            self.asked = self.asked.max(speed);
        }
    }
}
