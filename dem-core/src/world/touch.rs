//! The contacts of a step, with reactions as forces. `StoredTouch` is a contact as the world stores
//! it, [`Touch`] the same with its geometry, for reading.

use crate::bond::BondStatus;
use crate::contact::Local;
use crate::dim::{Dim, Vect};
use std::num::NonZeroU32;

/// Status of a contact in the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TouchStatus {
    /// No reaction.
    Open,
    /// Contact without slip.
    Stick,
    /// Contact that slips; a frictionless contact with a reaction counts as slipping.
    Slip,
    /// An intact bond.
    Bonded,
}

/// A contact as the world stores it from step to step. Gap, normal and point follow from the
/// positions at mid-step and are not stored: a million grains have three million contacts, stored
/// twice during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StoredTouch<D: Dim> {
    pub pair: [u32; 2],
    /// Index of its bond plus one: four bytes, including the case of no bond.
    pub bond_from_one: Option<NonZeroU32>,
    pub status: TouchStatus,
    /// Whether its gap is so wide that the limits of the step check it; always true for bonds.
    pub wide: bool,
    /// Whether its normal reaction was positive in the previous step.
    pub closed: bool,
    /// The gap that its last positive reaction left (m); zero if it has had none since its bodies
    /// came near each other.
    pub left: f32,
    /// Whether its bond was intact in the previous step.
    pub was_bonded: bool,
    /// The tangents of its frame.
    pub tangents: D::Tangents,
    pub reaction: Local<D::Tangent, D::Moment>,
    /// Closing of its bodies beyond the contact law since they touched (m): solver errors, summed
    /// over the steps. For a rigid bond, its shortening by them.
    pub yielded: f64,
}

impl<D: Dim> StoredTouch<D> {
    /// A contact without reaction, with this bond or none; `wide` is set for a bond only.
    pub fn new(pair: [u32; 2], bond: Option<u32>) -> Self {
        Self {
            pair,
            bond_from_one: from_one(bond),
            status: if bond.is_some() { TouchStatus::Bonded } else { TouchStatus::Open },
            wide: bond.is_some(),
            closed: false,
            left: 0.0,
            was_bonded: false,
            tangents: D::Tangents::zero(),
            reaction: Local::zero(),
            yielded: 0.0,
        }
    }

    /// Index of the intact bond of the pair, if there is one.
    pub fn bond(&self) -> Option<u32> {
        self.bond_from_one.map(|bond| bond.get() - 1)
    }

    /// Set the index of the bond of the pair.
    pub fn tie(&mut self, bond: Option<u32>) {
        self.bond_from_one = from_one(bond);
    }
}

/// The index of a bond, counted from one.
fn from_one(bond: Option<u32>) -> Option<NonZeroU32> {
    bond.and_then(|bond| NonZeroU32::new(bond + 1))
}

/// A contact of one step, with its reaction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch<D: Dim> {
    /// Grain i, and grain or wall j (walls follow the grains).
    pub pair: [u32; 2],
    /// Frame at mid-step; the normal points from j to i.
    pub frame: D::Frame,
    /// Contact point at mid-step (m).
    pub point: D::Vector,
    /// Gap at mid-step (m).
    pub gap: f64,
    /// Index of the intact bond of the pair, if there is one.
    pub bond: Option<u32>,
    /// Reaction of j on i (N), and moment (N m, as rows of the frame; zero without a bond).
    pub reaction: Local<D::Tangent, D::Moment>,
    /// Status.
    pub status: TouchStatus,
}

/// Number of contacts by status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Without reaction.
    pub open: usize,
    /// Sticking.
    pub stick: usize,
    /// Slipping.
    pub slip: usize,
    /// Bonded.
    pub bonded: usize,
}

impl Counts {
    /// Count contacts.
    pub fn of(statuses: impl Iterator<Item = TouchStatus>) -> Self {
        let mut counts = Self::default();
        for status in statuses {
            match status {
                TouchStatus::Open => counts.open += 1,
                TouchStatus::Stick => counts.stick += 1,
                TouchStatus::Slip => counts.slip += 1,
                TouchStatus::Bonded => counts.bonded += 1,
            }
        }
        counts
    }
}

/// A bond that broke in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Break<D: Dim> {
    /// Index of the bond.
    pub bond: u32,
    /// The two grains.
    pub pair: [u32; 2],
    /// How it failed.
    pub mode: BondStatus,
    /// Cascade round, from 0.
    pub round: u32,
    /// Contact point (m).
    pub point: D::Vector,
    /// Reaction at rupture (N, N m), at the limit of the bond.
    pub reaction: Local<D::Tangent, D::Moment>,
    /// Elastic energy released (J); zero for a rigid bond.
    pub energy: f64,
}
