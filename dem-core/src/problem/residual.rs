//! One measure of error for all solvers: the natural map, relative to the reactions and the load.
//!
//! residual = √Σ‖r̂ − P_K(r̂ − ũ/D)‖² / max(√Σ‖r‖², ‖h F_ext‖), with D one scalar per contact, the largest diagonal
//! entry of its Delassus block. The cohesion's shift is not in the denominator: on a strongly bonded sample it would
//! hide the load. The value is zero when both numerator and denominator vanish.

use super::{Contact, ContactProblem, Nodes, Visitor};
use crate::contact::Law;
use crate::dim::Dim;

struct Sums {
    map: f64,
    reaction: f64,
}

impl<D: Dim> Visitor<D> for Sums {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let u = nodes.relative_velocity(&c.link, c.law.arm());
        let map = c.law.natural_map(c.r, u);
        self.map += map.dot(&map);
        self.reaction += c.r.dot(&c.r);
    }
}

/// The residual of the impulses and node velocities that the problem now holds (–). Not a number stays not a number.
pub fn residual<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let mut sums = Sums { map: 0.0, reaction: 0.0 };
    problem.visit(&mut sums);
    let scale = sums.reaction.sqrt().max(problem.applied);
    if sums.map == 0.0 { 0.0 } else { sums.map.sqrt() / scale }
}
