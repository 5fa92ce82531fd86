//! Ruptures as the file stores them, in this version and in older ones.

use std::ops::Range;

use hdf5::H5Type;
use hdf5::types::TypeDescriptor;

use super::codes::{Coded, ModeCode, RuptureMode};
use super::error::{Result, while_reading};
use super::model::Rupture;
use super::source::Source;

/// A rupture as the file stores it: scalars only, because pandas rejects arrays. The padding is an
/// explicit member; otherwise its bytes would be undefined, and the files of two equal runs would
/// differ.
#[derive(Clone, Copy, Debug, H5Type)]
#[repr(C)]
pub(super) struct RuptureRow {
    step: i64,
    time: f64,
    x: f64,
    y: f64,
    z: f64,
    rn: f64,
    rt: f64,
    m: f64,
    twist: f64,
    energy: f64,
    round: i32,
    bond: i32,
    i: i32,
    j: i32,
    mode: ModeCode,
    pad: i32,
}

/// The same in histories of versions 1 and 2: `m` is the norm of all moments.
#[derive(Clone, Copy, Debug, H5Type)]
#[repr(C)]
struct OldRuptureRow {
    step: i64,
    time: f64,
    x: f64,
    y: f64,
    z: f64,
    rn: f64,
    rt: f64,
    m: f64,
    energy: f64,
    round: i32,
    bond: i32,
    i: i32,
    j: i32,
    mode: ModeCode,
    pad: i32,
}

impl From<OldRuptureRow> for RuptureRow {
    fn from(old: OldRuptureRow) -> Self {
        let OldRuptureRow { step, time, x, y, z, rn, rt, m, energy, round, bond, i, j, mode, pad } = old;
        Self { step, time, x, y, z, rn, rt, m, twist: f64::NAN, energy, round, bond, i, j, mode, pad }
    }
}

impl From<&Rupture> for RuptureRow {
    fn from(r: &Rupture) -> Self {
        let ([x, y, z], [i, j]) = (r.point, r.pair);
        Self {
            step: r.step,
            time: r.time,
            x,
            y,
            z,
            rn: r.normal_force,
            rt: r.tangential_force,
            m: r.moment,
            twist: r.twist,
            energy: r.energy,
            round: r.round,
            bond: r.bond,
            i,
            j,
            mode: r.mode.code(),
            pad: 0,
        }
    }
}

impl RuptureRow {
    /// The step of the rupture.
    pub fn step(&self) -> i64 {
        self.step
    }

    /// The rows `range` of the dataset, with the shape of one row. Versions 1 and 2 lack the column
    /// `twist`; version 1 also lacks the mode TWIST.
    pub(super) fn read(source: &Source, place: &str, range: Range<usize>) -> Result<(Vec<usize>, Vec<Self>)> {
        let found = source.dataset(place)?.dtype().and_then(|dtype| dtype.to_descriptor());
        let found = found.map_err(while_reading(&source.path, place))?;
        let (second, mut first) = (OldRuptureRow::type_descriptor(), OldRuptureRow::type_descriptor());
        if let TypeDescriptor::Compound(row) = &mut first
            && let Some(TypeDescriptor::Enum(modes)) =
                row.fields.iter_mut().find(|f| f.name == "mode").map(|f| &mut f.ty)
        {
            modes.members.retain(|mode| mode.name != RuptureMode::Twist.label());
        }
        if found == Self::type_descriptor() {
            return source.read(place, range);
        }
        if ![first, second].contains(&found) {
            return Err(source.damaged(place, "its members differ from the layout"));
        }
        let (row, old) = source.read::<OldRuptureRow>(place, range)?;
        Ok((row, old.into_iter().map(Self::from).collect()))
    }

    /// Whether two rows are equal bit by bit.
    pub(super) fn same(&self, other: &Self) -> bool {
        let reals = |r: &Self| [r.time, r.x, r.y, r.z, r.rn, r.rt, r.m, r.twist, r.energy].map(f64::to_bits);
        let integers = |r: &Self| [r.round, r.bond, r.i, r.j, r.pad];
        (self.step, reals(self), integers(self), self.mode) == (other.step, reals(other), integers(other), other.mode)
    }

    /// The event; `None` if its mode is unknown.
    pub(super) fn event(&self) -> Option<Rupture> {
        Some(Rupture {
            step: self.step,
            time: self.time,
            point: [self.x, self.y, self.z],
            normal_force: self.rn,
            tangential_force: self.rt,
            moment: self.m,
            twist: self.twist,
            energy: self.energy,
            round: self.round,
            bond: self.bond,
            pair: [self.i, self.j],
            mode: RuptureMode::from_code(self.mode)?,
        })
    }
}
