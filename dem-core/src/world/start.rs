//! The reactions that a run starts from.

use super::{Touch, TouchStatus, World};
use crate::body::direction;
use crate::bond::{Bond, BondStatus};
use crate::contact::Local;
use crate::dim::{Dim, Vect};

impl<D: Dim> World<D> {
    /// Start the next step from these reactions (N, moments N m, in the contact's frame) of the intact bonds, and from
    /// none at the other contacts.
    ///
    /// A start is where a solver begins, not a load: what the solver makes of it is up to the solver. In a rigid sample,
    /// whose reactions are not unique, different starts lead to different reactions that are all solutions.
    pub fn start_from(&mut self, mut reaction: impl FnMut(&Bond) -> Local<D::Tangent, D::Moment>) {
        self.touches.clear();
        for (k, bond) in self.bonds.iter().enumerate().filter(|(_, b)| b.status == BondStatus::Intact) {
            let [i, j] = bond.pair.map(|k| k as usize);
            let apart = self.grains.position[i] - self.grains.position[j];
            let distance = apart.norm();
            let normal = direction::<D>(apart, distance);
            let (radius, gap) = (self.grains.radius[i], distance - bond.mean_diameter);
            self.touches.push(Touch {
                pair: bond.pair,
                frame: D::frame(normal),
                point: self.grains.position[i] - normal * (radius + 0.5 * gap),
                gap,
                bond: Some(k as u32),
                reaction: reaction(bond),
                status: TouchStatus::Bonded,
            });
        }
    }
}
