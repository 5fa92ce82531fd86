//! The reactions that a run starts from.

use super::World;
use super::motion::Midpoint;
use super::touch::Kept;
use crate::body::{direction, separation};
use crate::bond::{Bond, BondStatus};
use crate::contact::Local;
use crate::dim::{Dim, Vect};

impl<D: Dim> World<D> {
    /// Start the next step from these reactions (N, moments N m, in the contact's frame) of the
    /// intact bonds, and from none at the other contacts.
    ///
    /// A start is where a solver begins, not a load: what the solver makes of it is up to the
    /// solver. In a rigid sample, whose reactions are not unique, different starts lead to
    /// different reactions that are all solutions.
    pub fn start_from(&mut self, mut reaction: impl FnMut(&Bond) -> Local<D::Tangent, D::Moment>) {
        self.kept.clear();
        self.mid = Midpoint::of(&self.grains, &self.walls);
        for (k, bond) in self.bonds.iter().enumerate().filter(|(_, b)| b.status == BondStatus::Intact) {
            let [i, j] = bond.pair.map(|k| k as usize);
            let apart = separation::<D>(self.grains.position[i], self.grains.position[j]);
            let frame = D::frame(direction::<D>(apart, apart.norm()));
            self.kept.push(Kept {
                tangents: D::tangents(&frame),
                reaction: reaction(bond),
                ..Kept::new(bond.pair, Some(k as u32))
            });
        }
    }
}
