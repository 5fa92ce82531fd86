//! One measure of error for all solvers: the natural map, relative to the reactions and the load.
//!
//! residual = √Σ‖r̂ − P_K(r̂ − ũ/D)‖² / max(√Σ‖r‖², ‖h F_ext‖), with D one scalar per contact, the largest diagonal
//! entry of its Delassus block. The cohesion's shift is not in the denominator: on a strongly bonded sample it would
//! hide the load. A natural map that is as small as the rounding of the velocities behind it is zero: grains that part
//! leave reactions so small that their ratio to the map says nothing.

use super::{Contact, ContactProblem, Nodes, Visitor};
use crate::contact::Law;
use crate::dim::{Dim, Vect};

/// Relative rounding of the natural map that counts as zero.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

#[derive(Default)]
struct Sums {
    map: f64,
    reaction: f64,
    /// Impulses that would stop the bodies of each contact: what the map is rounded against.
    motion: f64,
}

impl<D: Dim> Visitor<D> for Sums {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let u = nodes.relative_velocity(&c.link, c.law.arm());
        let map = c.law.natural_map(c.r, u);
        self.map += map.dot(&map);
        self.reaction += c.r.dot(&c.r);
        let gamma = c.law.gamma();
        for (node, lever) in c.link.nodes.iter().zip(c.link.lever) {
            let node = &nodes.all[*node as usize];
            let speed = node.velocity.dot(&node.velocity) + lever * lever * node.spin.dot(&node.spin);
            self.motion += gamma * gamma * speed;
        }
    }
}

/// The residual of the impulses and node velocities that the problem now holds (–). Not a number stays not a number.
pub fn residual<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    let mut sums = Sums::default();
    problem.visit(&mut sums);
    let scale = sums.reaction.sqrt().max(problem.applied);
    relative(sums.map.sqrt(), sums.motion.sqrt(), scale)
}

/// The norm of the natural map over `scale`; zero where it is the rounding of summands of norm `rounded`.
pub(super) fn relative(map: f64, rounded: f64, scale: f64) -> f64 {
    if map <= ROUNDING * rounded { 0.0 } else { map / scale }
}
