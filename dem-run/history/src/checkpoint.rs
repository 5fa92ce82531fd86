//! The state from which a run resumes, in two slots: while one is written, the other stays
//! complete.

use hdf5::{Dataset, File, Group};
use sha2::{Digest, Sha256};

use super::error::Result;
use super::schema::path;
use super::source::Source;
use super::table::{Growth, Storage, Table};

/// The numbers of a state (`dem_core::saved::Saved`), and its step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// Steps made.
    pub step: i64,
    /// Reals.
    pub reals: Vec<f64>,
    /// Counts.
    pub counts: Vec<u64>,
}

impl Checkpoint {
    /// Its row in the index. The step is counted from 1, so that 0 is an empty slot.
    fn row(&self) -> [u64; 4] {
        let mut digest = Sha256::new();
        digest.update(self.step.to_le_bytes());
        self.reals.iter().for_each(|x| digest.update(x.to_le_bytes()));
        self.counts.iter().for_each(|n| digest.update(n.to_le_bytes()));
        let digest = digest.finalize();
        let sum = digest.iter().take(8).fold(0, |sum, byte| sum << 8 | u64::from(*byte));
        [self.step as u64 + 1, self.reals.len() as u64, self.counts.len() as u64, sum]
    }
}

/// Names of the reals and the counts of each slot.
const SLOTS: [[&str; 2]; 2] = [["reals_0", "counts_0"], ["reals_1", "counts_1"]];
/// Numbers in a chunk of a slot.
const CHUNK: usize = 1 << 14;

/// Where checkpoints are written.
pub(super) struct Slots {
    index: Dataset,
    tables: Vec<[Table; 2]>,
    next: usize,
}

impl Slots {
    pub fn create(file: &File, storage: Storage) -> hdf5::Result<Self> {
        let group = file.create_group(path::CHECKPOINT)?;
        let index = group.new_dataset::<u64>().shape([2, 4]).obj_track_times(false).create("index")?;
        index.write_raw(&[0u64; 8])?;
        let growth = Growth::Rows(CHUNK);
        let slot = |group: &Group, [reals, counts]: [&str; 2]| -> hdf5::Result<[Table; 2]> {
            Ok([
                Table::create::<f64>(group, reals, "", &[], growth, storage)?,
                Table::create::<u64>(group, counts, "", &[], growth, storage)?,
            ])
        };
        let tables = SLOTS.into_iter().map(|names| slot(&group, names)).collect::<hdf5::Result<_>>()?;
        Ok(Self { index, tables, next: 0 })
    }

    /// Overwrites the older of the two checkpoints. `flush` writes the numbers to the file before
    /// the index refers to them.
    pub fn write(&mut self, checkpoint: &Checkpoint, flush: impl FnOnce() -> hdf5::Result<()>) -> hdf5::Result<()> {
        let slot = self.next;
        self.tables[slot][0].overwrite(&checkpoint.reals)?;
        self.tables[slot][1].overwrite(&checkpoint.counts)?;
        flush()?;
        self.index.write_slice(&checkpoint.row()[..], (slot, 0..4))?;
        self.index.flush()?;
        self.next = 1 - slot;
        Ok(())
    }
}

/// The newest complete checkpoint whose step is `recorded`, if any.
pub(super) fn newest(source: &Source, recorded: impl Fn(i64) -> Result<bool>) -> Result<Option<Checkpoint>> {
    let place = |name: &str| format!("{}/{name}", path::CHECKPOINT);
    if !source.has(path::CHECKPOINT) {
        return Ok(None);
    }
    let index: Vec<u64> = source.whole(&place("index"), 4)?;
    let mut rows: Vec<(&[u64], [&str; 2])> = index.chunks_exact(4).zip(SLOTS).collect();
    rows.sort_by_key(|(row, _)| std::cmp::Reverse(row[0]));
    for (row, [reals, counts]) in rows {
        let Some(step) = row[0].checked_sub(1).and_then(|step| i64::try_from(step).ok()) else { continue };
        if !recorded(step)? {
            continue;
        }
        let read = || -> Result<Checkpoint> {
            Ok(Checkpoint {
                step,
                reals: source.read(&place(reals), 0..row[1] as usize)?.1,
                counts: source.read(&place(counts), 0..row[2] as usize)?.1,
            })
        };
        // a slot that cannot be read is incomplete
        if let Some(checkpoint) = read().ok().filter(|c| c.row() == row) {
            return Ok(Some(checkpoint));
        }
    }
    Ok(None)
}
