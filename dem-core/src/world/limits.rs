//! Limits that every step must respect, however small its residual. A step that violates one is
//! made in halves, or the run stops.
//!
//! *Bodies too fast for the step* would pass through another body between two detections, or be
//! stopped by a body that they pass at a distance: contacts are detected at mid-step only, and
//! their law knows the tangent plane, not the curved surface. Both suffice while displacements are
//! small beside the bodies. The path of each half step is checked pair by pair, but only if the
//! fastest body moves further than a quarter of the smallest radius: slow scenes pay one pass over
//! the velocities.
//!
//! *Contacts that yield.* The residual is relative to all reactions. For a light grain pressed
//! between heavy ones, an error that is small beside their weight is a large velocity of the light
//! grain. If no velocities satisfy the contact laws, as between two walls that close on a grain,
//! reactions grow until any error is small beside them. Velocities are therefore measured too: in
//! each step, and summed over the run for each pair, since errors of one sign add up. Slip and
//! rolling of a rigid bond below its limit count in each step only.
//!
//! With `expel_overlaps` the step skips these checks: the speeds of sample preparation have no
//! physical meaning.

use super::World;
use super::assembly::Places;
use super::motion::Midpoint;
use super::report::Violation;
use super::touch::StoredTouch;
use crate::body::{Drive, Shape, separation};
use crate::bond::{Bond, BondStatus};
use crate::contact::{Cone, Law, Local};
use crate::dim::{Dim, Moments, Vect};
use crate::problem::residual::false_motion;
use crate::problem::{Contact, ContactProblem, Nodes, Visitor};
use crate::solver::SolveReport;
use crate::solver::certificate::{Verdict, verdict};

/// Overlap, over the smaller radius, that half a step may add to a pair.
const DEEP: f64 = 0.5;

/// Distance, over the smaller radius, beyond which a grain passes another without contact.
const PASSING: f64 = 0.05;

/// Displacement beyond the contact law, over the smaller radius, that a solve may leave in a step:
/// closing of a dry contact, or any displacement in a rigid bond.
const YIELDING: f64 = 1e-4;

/// The same, along the normal, summed over the run.
const YIELDED: f64 = 1e-3;

/// Load error (–) of a solve above which the reactions of rigid bonds are not known.
const LOAD_ERROR: f64 = 1e-3;

/// Largest solver tolerance (`FINE`) and largest accepted residual (`ACCEPTED`) for which
/// `YIELDING`, `YIELDED` and `LOAD_ERROR` apply unchanged; coarser values loosen them in
/// proportion.
const FINE: f64 = 1e-6;
const ACCEPTED: f64 = 1e-4;

/// Share of the closing power of the free velocities, as left by the reactions, from which bodies
/// count as jammed: 1 where reactions only balance each other, 0 in a solution.
const UNOPPOSED: f64 = 0.5;

/// Share of the largest reaction from which a wall counts as carrying it.
const CARRIES: f64 = 1e-3;

impl<D: Dim> World<D> {
    /// The first candidate pair that would overlap too deeply, or pass through each other, within
    /// `time` (s) from these positions at these velocities.
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
            let offset = separation::<D>(place(i), place(j));
            let way = (velocity(i) - velocity(j)) * time;
            let before = surface.gap(offset, radius).0.min(0.0);
            surface.smallest_gap(offset, way, radius) < before - DEEP * self.smaller(**pair)
        };
        self.candidates.pairs.iter().find(too_deep).copied()
    }

    /// Whether a gap (m) is beyond [`PASSING`].
    pub(super) fn is_wide(&self, pair: [u32; 2], gap: f64) -> bool {
        gap > PASSING * self.smaller(pair)
    }

    /// A grain with a reaction from another, or from the edge of a plate, although they would pass
    /// at a distance: only the tangent plane stopped them.
    pub(super) fn pushes_at_a_distance(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        nodes: &Nodes<D>,
        h: f64,
    ) -> Option<[u32; 2]> {
        let far = |stored: &&StoredTouch<D>| {
            if !stored.wide || stored.bond().is_some() || stored.reaction.n <= 0.0 {
                return false;
            }
            let plate = match (stored.pair[1] as usize).checked_sub(self.grains.len()) {
                None => false,
                Some(wall) if matches!(self.walls[wall].shape, Shape::Plate(_)) => true,
                Some(_) => return false,
            };
            let t = self.touch(mid, stored);
            let margin = PASSING * self.smaller(t.pair);
            if t.gap <= margin {
                return false;
            }
            let [i, j] = t.pair.map(|k| k as usize);
            let offset = match plate {
                false => D::normal(&t.frame) * (t.gap + self.grains.radius[i] + self.grains.radius[j]),
                true => separation::<D>(mid.place(i), mid.place(j)),
            };
            let way = (nodes.all[i].velocity - nodes.all[j].velocity) * h;
            self.surface(j).smallest_gap(offset, way, self.grains.radius[i]) > margin
        };
        touches.iter().find(far).map(|t| t.pair)
    }

    /// The pair that moves furthest beyond its law in a solution whose residual is small enough, if
    /// too far; displacements are those of a whole step of the scene.
    pub(super) fn yielding_of(&self, solve: SolveReport, problem: &ContactProblem<D>) -> Option<Violation> {
        let is_small = solve.residual <= self.settings.solver.accept();
        if !is_small {
            return None;
        }
        let mut worst = Yielding { world: self, pair: [0; 2], share: 0.0 };
        problem.visit(&mut worst);
        let Yielding { pair, share, .. } = worst;
        (share > YIELDING * self.looseness()).then(|| Violation {
            pair,
            share,
            accumulated: false,
            jammed: self.jammed(problem),
            verdict: Verdict::Undecided,
        })
    }

    /// By which factor a violation in one step exceeds what is allowed.
    pub(super) fn excess_of(&self, violation: &Violation) -> f64 {
        violation.share / (YIELDING * self.looseness())
    }

    /// Add the displacement of each contact beyond its law to the sum over the previous steps;
    /// returns the pair with the largest sum, if too large.
    pub(super) fn accumulate(
        &self,
        touches: &mut [StoredTouch<D>],
        problem: &ContactProblem<D>,
        places: &Places,
        h: f64,
    ) -> Option<Violation> {
        let mut worst = Accumulating { world: self, touches, places: places.all(), h, pair: [0; 2], share: 0.0 };
        problem.visit(&mut worst);
        let Accumulating { pair, share, .. } = worst;
        (share > YIELDED * self.looseness()).then(|| Violation {
            pair,
            share,
            accumulated: true,
            jammed: self.jammed(problem),
            verdict: Verdict::Undecided,
        })
    }

    /// The load error of a solve (–) if it is too large: that of reactions that still grow, as
    /// where no motion satisfies rigid bonds. The deformation of elastic bonds bounds their
    /// reactions. Beside a motion that is right, only reactions that balance each other can be
    /// wrong.
    pub(super) fn large_load_error(&self, solve: SolveReport, problem: &ContactProblem<D>) -> Option<f64> {
        let rigid = |bond: &Bond| bond.status == BondStatus::Intact && bond.stiffness.is_none();
        let aim = self.settings.solver.load_tolerance().unwrap_or(0.0);
        let most = aim.max(LOAD_ERROR * self.looseness());
        let error = solve.load_error_beyond_rounding().filter(|error| *error > most)?;
        let moves_wrongly = || false_motion(problem) > aim && !self.rests(problem);
        (self.bonds.iter().any(rigid) && moves_wrongly()).then_some(error)
    }

    /// Factor by which the tolerances of the solver loosen these limits.
    fn looseness(&self) -> f64 {
        let solver = &self.settings.solver;
        (solver.tolerance() / FINE).max(solver.accept() / ACCEPTED).max(1.0)
    }

    /// The verdict on an unsolved problem, with bodies in place of contacts.
    pub(super) fn verdict(&self, problem: &ContactProblem<D>) -> Verdict<u32> {
        verdict(problem).map(|contacts| {
            let mut pairs = Pairs(Vec::with_capacity(problem.len()));
            problem.visit(&mut pairs);
            let mut bodies: Vec<u32> = contacts.into_iter().flat_map(|c| pairs.0[c]).collect();
            bodies.sort_unstable();
            bodies.dedup();
            bodies
        })
    }

    /// The walls that carry the reactions, if the reactions only balance each other, as where a
    /// driven wall closes on a grain. In a solution the reactions take as much power from the
    /// bodies as the free velocities would put into closing contacts. The test does not prove that
    /// no solution exists; [`World::verdict`] can.
    fn jammed(&self, problem: &ContactProblem<D>) -> Option<Vec<u32>> {
        let mut powers = Powers { problem, asked: 0.0, left: 0.0, largest: 0.0 };
        problem.visit(&mut powers);
        let Powers { asked, left, largest, .. } = powers;
        if asked <= 0.0 || left < UNOPPOSED * asked {
            return None;
        }
        let mut carrying = Carrying { first: problem.nodes.grains as u32, least: CARRIES * largest, walls: Vec::new() };
        problem.visit(&mut carrying);
        carrying.walls.sort_unstable();
        carrying.walls.dedup();
        // if no wall is driven, rest satisfies the laws
        let driven = |wall: &u32| {
            let node = *wall as usize;
            matches!(self.walls[node - problem.nodes.grains].drive, Drive::Velocity { .. })
                && problem.free[node].0.norm() > 0.0
        };
        carrying.walls.iter().any(driven).then_some(carrying.walls)
    }

    /// Position of a body (m), grains first.
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

    /// The radius of the smaller body of a pair (m); at a plane or a plate, that of the grain.
    pub(super) fn smaller(&self, pair: [u32; 2]) -> f64 {
        let [i, j] = pair.map(|k| k as usize);
        let size = match j.checked_sub(self.grains.len()) {
            None => self.grains.radius[j],
            Some(wall) => self.walls[wall].shape.size(),
        };
        self.grains.radius[i].min(size)
    }
}

/// Velocity of a contact beyond its law (m/s; rotations times the mean diameter): the closing speed
/// as a negative normal velocity, and for a rigid bond the velocity of all rows that it holds.
/// `None` where the law sets no bound: an elastic bond deforms, and a bond at its limit flows and
/// is about to break.
#[inline(always)] // callers need some rows only
fn beyond_law<D: Dim, L: Law>(nodes: &Nodes<D>, c: &Contact<D, L>) -> Option<Local<L::T, L::B>> {
    let law = &c.law;
    if law.compliance().n > 0.0 || c.failure().is_some() {
        return None;
    }
    let u = nodes.relative_velocity::<L::T, L::B>(&c.link, law.arms()) + law.bias();
    let Cone { mu, nu, xi } = law.cone();
    let held = |limit: f64| if law.breaks() && limit > 0.0 { 1.0 } else { 0.0 };
    Some(Local { n: u.n, t: u.t * held(mu), m: u.m.scaled(held(nu), held(xi)) })
}

/// Adds up displacements beyond the contact laws, and finds the largest sum.
struct Accumulating<'a, D: Dim, P> {
    world: &'a World<D>,
    touches: &'a mut [StoredTouch<D>],
    places: P,
    h: f64,
    pair: [u32; 2],
    share: f64,
}

impl<D: Dim, P: Iterator<Item = usize>> Visitor<D> for Accumulating<'_, D, P> {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let Some(place) = self.places.next() else { return };
        let Some(beyond) = beyond_law(nodes, c) else { return };
        let stored = &mut self.touches[place];
        let sum = stored.yielded - self.h * beyond.n;
        // a dry contact may open
        stored.yielded = if stored.bond().is_some() { sum } else { sum.max(0.0) };
        let share = stored.yielded.abs() / self.world.smaller(stored.pair);
        if share > self.share {
            (self.pair, self.share) = (stored.pair, share);
        }
    }
}

/// Finds the contact that yields most.
struct Yielding<'a, D: Dim> {
    world: &'a World<D>,
    pair: [u32; 2],
    share: f64,
}

impl<D: Dim> Visitor<D> for Yielding<'_, D> {
    #[inline(always)]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let Some(beyond) = beyond_law(nodes, c) else { return };
        let speed = match c.law.breaks() {
            true => beyond.n.abs().max(beyond.t.norm()).max(beyond.m.bending()).max(beyond.m.twist()),
            false => -beyond.n,
        };
        let share = self.world.settings.step * speed / self.world.smaller(c.link.nodes);
        if share > self.share {
            (self.pair, self.share) = (c.link.nodes, share);
        }
    }
}

/// Lists the bodies of each contact.
struct Pairs(Vec<[u32; 2]>);

impl<D: Dim> Visitor<D> for Pairs {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
        self.0.push(c.link.nodes);
    }
}

/// Sums the power of the reactions of a solution against the free velocities, `asked`, and against
/// the velocities of the solution, `left` (N s times m/s).
struct Powers<'a, D: Dim> {
    problem: &'a ContactProblem<D>,
    asked: f64,
    left: f64,
    largest: f64,
}

impl<D: Dim> Visitor<D> for Powers<'_, D> {
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let arms = c.law.arms();
        let [i, j] = c.link.nodes.map(|k| self.problem.free[k as usize]);
        let free = c.link.relative_velocity::<L::T, L::B>(arms, i, j);
        let after = nodes.relative_velocity::<L::T, L::B>(&c.link, arms);
        let bias = c.r.dot(&c.law.bias());
        self.asked -= c.r.dot(&free) + bias;
        self.left -= c.r.dot(&after) + bias;
        self.largest = self.largest.max(c.r.n.abs());
    }
}

/// Lists the walls that carry a reaction of at least `least`.
struct Carrying {
    first: u32,
    least: f64,
    walls: Vec<u32>,
}

impl<D: Dim> Visitor<D> for Carrying {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
        if c.link.nodes[1] >= self.first && c.r.n >= self.least {
            self.walls.push(c.link.nodes[1]);
        }
    }
}
