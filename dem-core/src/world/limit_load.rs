//! The limit load of a world where it stands.

use super::World;
use super::assembly::{Brought, CLOSED};
use super::motion::{Midpoint, Motion, Turn};
use super::touch::StoredTouch;
use crate::body::Drive;
use crate::contact::{Law, Local};
use crate::dim::{Dim, Vect};
use crate::problem::{Contact, VisitorMut};
use crate::solver::limit_load::{LimitLoad, limit_load};
use petgraph::unionfind::UnionFind;
use std::sync::Arc;

/// Velocities (m/s, rad/s) of all bodies, grains first.
type Velocities<D> = Arc<[(<D as Dim>::Vector, <D as Dim>::Spin)]>;

impl<D: Dim> World<D> {
    /// The largest factor λ for which reactions that no contact law excludes balance the loads of
    /// the time `from` (s) and λ times what they grow by until the time `to` (s): weight, loads on
    /// grains, forces on walls and the pressure of a membrane, with the bodies at their places.
    /// Walls without a force drive are supports. Grains that a wall holds are part of it.
    ///
    /// All intact bonds take part, and all other pairs whose gap is at most 1e-6 of the smaller
    /// radius. The world does not change.
    pub fn limit_load(&mut self, from: f64, to: f64) -> LimitLoad {
        self.limit(|world| {
            let start = world.velocities_given(true, |value| value(from));
            // without the weight, whose rounding would be a load
            let growth = world.velocities_given(false, |value| value(to) - value(from));
            (start, growth)
        })
    }

    /// The largest force (N) of a wall along a unit direction, in place of its drive and with the
    /// other loads that act now. See [`World::limit_load`].
    ///
    /// # Panics
    /// If there is no such wall.
    pub fn limit_of_force(&mut self, wall: usize, direction: D::Vector) -> LimitLoad {
        let (time, still) = (self.time, (D::Vector::zero(), D::Spin::zero()));
        let mass: f64 = self.grains.mass.iter().sum();
        let pushed = Drive::Force { direction, mass, force: Arc::new(|_| 0.0) };
        let drive = std::mem::replace(&mut self.walls[wall].drive, pushed);
        let found = self.limit(|world| {
            let start = world.velocities_given(true, |value| value(time));
            let mut growth = vec![still; start.len()];
            growth[world.grains.len() + wall].0 = direction * (1.0 / mass);
            (start, growth.into())
        });
        self.walls[wall].drive = drive;
        found
    }

    /// The velocity (m/s) that a wall's drive prescribes for the next step, if it does and if this
    /// is not zero.
    pub fn motion_of_drive(&self, wall: usize) -> Option<D::Vector> {
        let Drive::Velocity { direction, speed } = &self.walls[wall].drive else { return None };
        let velocity = *direction * speed(self.time + self.settings.step);
        (velocity.norm() > 0.0).then_some(velocity)
    }

    /// The limit under the velocities that `given` returns: those of the loads at the start, and
    /// those of their growth.
    fn limit(&mut self, given: impl FnOnce(&Self) -> (Velocities<D>, Velocities<D>)) -> LimitLoad {
        let mid = Midpoint::of(&self.grains, &self.walls);
        self.measure_sections(&mid);
        // where it has no surface, the last one remains
        self.follow_surface(&mid).unwrap_or_default();
        let (start, growth) = given(self);
        let still: Vec<_> = start.iter().map(|_| (D::Vector::zero(), D::Spin::zero())).collect();
        let at_rest = Motion { before: still.clone(), free: still.into() };
        let mut touches = self.detect(&mid, &at_rest, 1.0);
        touches.retain(|stored| {
            let gap = self.geometry(&mid, stored.pair).0;
            let [first, second] = self.walls_of(stored.pair);
            let apart = first.is_none() || first != second;
            apart && (stored.bond().is_some() || gap <= CLOSED * self.smaller(stored.pair))
        });
        if self.settings.gravity.is_some() {
            let grains = self.unsupported(&touches);
            if !grains.is_empty() {
                return LimitLoad::Unsupported { grains };
            }
        }
        let (carried, turns) = (vec![Local::zero(); self.bonds.len()], vec![Turn::default(); self.bonds.len()]);
        let motion = Motion { before: at_rest.before, free: start };
        let brought = Brought { carried, turns, strengthened: 1.0 };
        let (mut problem, _) = self.assemble(&mid, &touches, &motion, &brought, 0.0, 1.0);
        problem.visit_mut(&mut OntoWalls { held: &self.held, grains: self.grains.len() });
        limit_load(&problem, growth)
    }

    /// The grains that no chain of contacts joins with a wall or a fixed grain.
    fn unsupported(&self, touches: &[StoredTouch<D>]) -> Vec<u32> {
        let grains = self.grains.len();
        // the last node stands for all supports
        let mut joined = UnionFind::<usize>::new(grains + 1);
        for [a, b] in touches.iter().map(|touch| touch.pair.map(|body| body as usize)) {
            joined.union(a, b.min(grains));
        }
        (0..grains).filter(|grain| self.grains.fixed[*grain]).for_each(|grain| {
            joined.union(grain, grains);
        });
        (0..grains).filter(|grain| !joined.equiv(*grain, grains)).map(|grain| grain as u32).collect()
    }

    /// The velocities that loads give to bodies at rest in a step of 1 s; `of` makes the factor of
    /// a load from its function of time.
    fn velocities_given(&self, weight: bool, of: impl Fn(&dyn Fn(f64) -> f64) -> f64) -> Velocities<D> {
        let still = (D::Vector::zero(), D::Spin::zero());
        let mut given = vec![still; self.grains.len()];
        if let (Some(gravity), true) = (self.settings.gravity, weight) {
            let free = given.iter_mut().zip(&self.grains.fixed).filter(|(_, fixed)| !**fixed);
            free.for_each(|((v, _), _)| *v = gravity);
        }
        for load in &self.loads {
            let (inverse_mass, inverse_inertia) = self.grains.inverse(load.grain);
            let factor = of(&*load.factor);
            given[load.grain].0 += load.force * (factor * inverse_mass);
            given[load.grain].1 += load.torque * (factor * inverse_inertia);
        }
        if let Some(membrane) = &self.membrane {
            for (grain, force) in self.membrane_forces(of(&*membrane.pressure)) {
                given[grain].0 += force * self.grains.inverse(grain).0;
            }
        }
        given.extend(self.walls.iter().map(|wall| match &wall.drive {
            Drive::Force { direction, mass, .. } => {
                (*direction * (of(&|time| wall.applied_force(time)) / mass), D::Spin::zero())
            }
            Drive::Fixed | Drive::Velocity { .. } => still,
        }));
        given.into()
    }
}

/// Puts walls in the place of the grains that they hold. A wall does not turn: where on it a
/// reaction acts does not matter.
struct OntoWalls<'a> {
    held: &'a [Option<u32>],
    grains: usize,
}

impl<D: Dim> VisitorMut<D> for OntoWalls<'_> {
    fn visit<L: Law>(&mut self, contact: &mut Contact<D, L>) {
        for node in &mut contact.link.nodes {
            if let Some(Some(wall)) = self.held.get(*node as usize) {
                *node = self.grains as u32 + wall;
            }
        }
    }
}
