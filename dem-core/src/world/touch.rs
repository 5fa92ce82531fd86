//! The contacts of a step, with reactions as forces: as the world keeps them, and as others see
//! them.

use crate::bond::BondStatus;
use crate::contact::Local;
use crate::dim::{Dim, Vect};
use std::num::NonZeroU32;

/// What a contact did in the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TouchStatus {
    /// No reaction.
    Open,
    /// Contact without slip.
    Stick,
    /// Contact that slips; a contact without friction always may.
    Slip,
    /// An intact bond.
    Bonded,
}

/// A contact as the world keeps it from step to step. Its gap, normal and point follow from the
/// places of its bodies at mid-step, and are not kept: a million grains have three million
/// contacts, twice while a step is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kept<D: Dim> {
    pub pair: [u32; 2],
    /// The bond that ties it, counted from one: four bytes, no bond included.
    pub bond_from_one: Option<NonZeroU32>,
    pub status: TouchStatus,
    /// Whether its gap is so wide that the limits of the step look at it; taken as true of bonds.
    pub wide: bool,
    /// Whether it pushed in the step before.
    pub closed: bool,
    /// Whether its bond held in the step before.
    pub held: bool,
    /// What its frame has beside the normal.
    pub tangents: D::Tangents,
    pub reaction: Local<D::Tangent, D::Moment>,
    /// How far its bodies have closed beyond its law since they touched (m), summed over the steps:
    /// the errors of their solves. Of a rigid bond, by how much these have shortened it.
    pub yielded: f64,
}

impl<D: Dim> Kept<D> {
    /// A contact without reaction, tied by this bond or by none, of an ordinary gap.
    pub fn new(pair: [u32; 2], bond: Option<u32>) -> Self {
        Self {
            pair,
            bond_from_one: bond.and_then(|bond| NonZeroU32::new(bond + 1)),
            status: if bond.is_some() { TouchStatus::Bonded } else { TouchStatus::Open },
            wide: bond.is_some(),
            closed: false,
            held: false,
            tangents: D::Tangents::zero(),
            reaction: Local::zero(),
            yielded: 0.0,
        }
    }

    /// Index of the bond that ties the pair, if it holds.
    pub fn bond(&self) -> Option<u32> {
        self.bond_from_one.map(|bond| bond.get() - 1)
    }

    /// Give the bond that ties the pair this index.
    pub fn tie(&mut self, bond: Option<u32>) {
        self.bond_from_one = bond.and_then(|bond| NonZeroU32::new(bond + 1));
    }
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
    /// Index of the bond that ties the pair, if it holds.
    pub bond: Option<u32>,
    /// Reaction of j on i (N), and moment (N m, as rows of the frame; zero without a bond).
    pub reaction: Local<D::Tangent, D::Moment>,
    /// What it did.
    pub status: TouchStatus,
}

/// Number of contacts by what they did.
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
    /// Round of the cascade, from 0.
    pub round: u32,
    /// Contact point (m).
    pub point: D::Vector,
    /// Reaction at rupture (N, N m).
    pub reaction: Local<D::Tangent, D::Moment>,
    /// Elastic energy released (J); zero for a rigid bond.
    pub energy: f64,
}
