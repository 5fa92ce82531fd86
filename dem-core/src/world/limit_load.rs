//! The limit load of a world where it stands.

use super::World;
use super::assembly::{Brought, CLOSED};
use super::motion::{Midpoint, Motion, Turn};
use crate::body::Drive;
use crate::contact::Local;
use crate::dim::{Dim, Vect};
use crate::solver::limit_load::{LimitLoad, limit_load};
use std::sync::Arc;

/// Velocities (m/s, rad/s) of all bodies, grains first.
type Velocities<D> = Arc<[(<D as Dim>::Vector, <D as Dim>::Spin)]>;

impl<D: Dim> World<D> {
    /// The largest factor λ for which reactions that no contact law excludes balance the loads of
    /// the time `from` (s) and λ times what they grow by until the time `to` (s): weight, loads on
    /// grains and forces on walls, with the bodies at their places. Walls without a force drive are
    /// supports.
    ///
    /// All intact bonds take part, and all other pairs whose gap is at most 1e-6 of the smaller
    /// radius. The world does not change.
    pub fn limit_load(&mut self, from: f64, to: f64) -> LimitLoad {
        let (start, end) = (self.velocities_given_at(from), self.velocities_given_at(to));
        let growth = start.iter().zip(end.iter()).map(|((v, w), (u, x))| (*u - *v, *x - *w)).collect();
        let mid = Midpoint::of(&self.grains, &self.walls);
        let still: Vec<_> = start.iter().map(|_| (D::Vector::zero(), D::Spin::zero())).collect();
        let at_rest = Motion { before: still.clone(), free: still.into() };
        let mut touches = self.detect(&mid, &at_rest, 1.0);
        touches.retain(|stored| {
            let gap = self.geometry(&mid, stored.pair).0;
            stored.bond().is_some() || gap <= CLOSED * self.smaller(stored.pair)
        });
        let (carried, turns) = (vec![Local::zero(); self.bonds.len()], vec![Turn::default(); self.bonds.len()]);
        let motion = Motion { before: at_rest.before, free: start };
        let (problem, _) = self.assemble(&mid, &touches, &motion, &Brought { carried, turns }, 0.0, 1.0);
        limit_load(&problem, growth)
    }

    /// The velocities that the loads of a time (s) give to bodies at rest in a step of 1 s.
    fn velocities_given_at(&self, time: f64) -> Velocities<D> {
        let forces = self.external_forces_at(time).into_iter().enumerate();
        let grains = forces.map(|(k, (force, torque))| {
            let (inverse_mass, inverse_inertia) = self.grains.inverse(k);
            (force * inverse_mass, torque * inverse_inertia)
        });
        let walls = self.walls.iter().map(|wall| match &wall.drive {
            Drive::Force { direction, mass, force } => (*direction * (force(time) / mass), D::Spin::zero()),
            Drive::Fixed | Drive::Velocity { .. } => (D::Vector::zero(), D::Spin::zero()),
        });
        grains.chain(walls).collect()
    }
}
