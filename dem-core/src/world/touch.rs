//! A contact as the world keeps it from step to step: pair, frame, gap and reaction as a force.

use crate::bond::BondStatus;
use crate::contact::Local;
use crate::dim::Dim;

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
    /// Count a list of contacts.
    pub fn of<D: Dim>(touches: &[Touch<D>]) -> Self {
        let mut counts = Self::default();
        for touch in touches {
            match touch.status {
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
