//! The initial reactions of a run: the warm start of its first step.

use super::World;
use super::motion::Midpoint;
use super::touch::StoredTouch;
use crate::body::{direction, separation};
use crate::bond::{Bond, BondStatus};
use crate::contact::Local;
use crate::dim::{Dim, Vect};

impl<D: Dim> World<D> {
    /// Start the next step from these reactions of the intact bonds (N, moments N m, in the
    /// contact's frame), and from zero at the other contacts.
    ///
    /// A start is the first iterate of a solver, not a load, and a solver may ignore it. In a rigid
    /// sample the reactions are not unique: different starts lead to different solutions.
    pub fn start_from(&mut self, mut reaction: impl FnMut(&Bond) -> Local<D::Tangent, D::Moment>) {
        self.stored.clear();
        self.mid = Midpoint::of(&self.grains, &self.walls);
        for (k, bond) in self.bonds.iter().enumerate().filter(|(_, b)| b.status == BondStatus::Intact) {
            let [i, j] = bond.pair.map(|k| k as usize);
            let apart = separation::<D>(self.grains.position[i], self.grains.position[j]);
            let frame = D::frame(direction::<D>(apart, apart.norm()));
            self.stored.push(StoredTouch {
                tangents: D::tangents(&frame),
                reaction: reaction(bond),
                ..StoredTouch::new(bond.pair, Some(k as u32))
            });
        }
    }
}
