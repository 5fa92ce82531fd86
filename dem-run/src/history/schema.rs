//! Names, versions and chunk sizes of the layout; the layout itself stands in the module's documentation.

use hdf5::H5Type;
use hdf5::types::TypeDescriptor;

use std::ops::Range;

use super::codes::{Coded, ModeCode};
use super::error::{Result, while_reading};
use super::observed::{FALSE_ACCELERATION, LOAD_ERROR};
use super::source::Source;
use super::{Layout, Rupture, RuptureMode};

/// Version of the layout. It grows with every change that an older reader would misread. 2: bonds
/// break in twist, too. 3: a rupture has its twisting moment apart from the bending moment. 4: the
/// load error is that of the solver alone, not a number where no solve reports one, beside the
/// false acceleration; observables may be enumerations.
pub const SCHEMA_VERSION: u32 = 4;

/// The version of a file of this layout: 3 where it is a copy of a history from before version 4,
/// which keeps the load error as it was, without a false acceleration beside it.
pub(super) fn schema_version(layout: &Layout) -> u32 {
    let observes = |name: &str| layout.observables.iter().any(|observable| observable.name == name);
    if observes(LOAD_ERROR) && !observes(FALSE_ACCELERATION) { 3 } else { SCHEMA_VERSION }
}

/// The program's name as `/h5md/creator` records it.
pub(super) const CREATOR: &str = "dem-run";

/// Paths in the file.
pub(super) mod path {
    pub const CHECKPOINT: &str = "checkpoint";
    pub const COMMIT: &str = "commit";
    pub const COMMIT_CONTACTS: &str = "commit_rows/contacts";
    pub const COMMIT_EVENTS: &str = "commit_rows/events";
    pub const COMMIT_STEPS: &str = "commit_rows/steps";
    pub const GRAINS: &str = "particles/grains";
    pub const WALLS: &str = "walls";
    pub const CONTACTS: &str = "contacts";
    pub const BONDS: &str = "bonds";
    pub const RUPTURE: &str = "events/rupture";
    pub const OBSERVABLES: &str = "observables";
    pub const PARAMETERS: &str = "parameters";
    pub const SCENE: &str = "parameters/scene";
}

/// Bytes across one row of a chunk, about 500 doubles.
const CHUNK_ROW: usize = 4000;
/// Bytes of a chunk, about 16 such rows.
const CHUNK: usize = 16 * CHUNK_ROW;

/// The chunk of a dataset that grows by whole frames: `[rows, first extents of one frame…]`.
///
/// A frame of a large sample is split so that 16 frames fill a chunk; a small sample puts more frames in one.
pub(super) fn frame_chunk(item: usize, row: &[usize]) -> Vec<usize> {
    let inner: usize = row.iter().skip(1).product::<usize>().max(1);
    let across = row.first().map_or(1, |&n| n.min((CHUNK_ROW / (inner * item)).max(1)));
    let rows = (CHUNK / (across * inner * item)).clamp(16, 256);
    let mut chunk = vec![rows];
    chunk.extend(row);
    if let Some(first) = chunk.get_mut(1) {
        *first = across;
    }
    chunk
}

/// The chunk of a dataset that grows by about `rows` rows every 16 frames.
pub(super) fn row_chunk(rows: usize, item: usize, row: &[usize]) -> Vec<usize> {
    let width: usize = row.iter().product::<usize>().max(1) * item;
    let mut chunk = vec![rows.clamp(64, (4 * CHUNK / width).max(64))];
    chunk.extend(row);
    chunk
}

/// Slots and bytes of the cache of chunks that each dataset of a file has, for `grains` grains: the chunks that a frame is
/// appended to, or every frame would evict and reload partly filled ones. No more, for every append and every flush goes
/// through all that is cached. (It is a setting of the file: single-writer mode forgets those of datasets.)
pub(super) fn chunk_cache(grains: usize, dimension: usize) -> (usize, usize) {
    // positions, or in space quaternions, are the widest
    let chunk = frame_chunk(8, &[grains, if dimension == 2 { 2 } else { 4 }]);
    let band = grains.div_ceil(chunk[1]);
    let bytes = 8 * band * chunk.iter().product::<usize>();
    (2 * band + 1, bytes.max(8 * CHUNK))
}

/// A rupture as the file holds it: scalars only (pandas refuses arrays), the padding a member of its own (its bytes
/// would otherwise be whatever the memory held, and two runs would differ).
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
    /// The rows `range` of the dataset, with the shape of one; those of older versions lack the column of twist, and in
    /// version 1 its mode.
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
            return Err(source.damaged(place, "its members are others"));
        }
        let (row, old) = source.read::<OldRuptureRow>(place, range)?;
        Ok((row, old.into_iter().map(Self::from).collect()))
    }

    /// Whether two rows are alike to the bit.
    pub(super) fn same(&self, other: &Self) -> bool {
        let reals = |r: &Self| [r.time, r.x, r.y, r.z, r.rn, r.rt, r.m, r.twist, r.energy].map(f64::to_bits);
        let integers = |r: &Self| [r.round, r.bond, r.i, r.j, r.pad];
        (self.step, reals(self), integers(self), self.mode) == (other.step, reals(other), integers(other), other.mode)
    }

    /// The event, `None` if its mode is no known one.
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
