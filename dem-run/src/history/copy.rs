//! Rows from one history to another, table by table: to go on with a run in a file that holds only what is complete, and
//! to pack a file. Memory does not grow with the length of the history.

use std::ops::Range;
use std::path::Path;

use hdf5::H5Type;

use crate::replace::replace;

use super::codes::{BondCode, ContactCode, RouteCode};
use super::error::{HistoryError, Result, refused, while_writing};
use super::lock;
use super::reader::History;
use super::schema::RuptureRow;
use super::source::Source;
use super::table::Table;
use super::writer::Writer;

/// Complete rows of each kind of table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Frames.
    pub frames: usize,
    /// Contacts of all frames.
    pub contacts: usize,
    /// Steps of observables.
    pub steps: usize,
    /// Events.
    pub events: usize,
}

/// What a table may hold, and whether two values of it are the same to the bit.
pub(super) trait Stored: H5Type + Sized {
    fn same(&self, other: &Self) -> bool;

    /// Rows `range` of a dataset, with the shape of one row.
    fn read(source: &Source, place: &str, range: Range<usize>) -> Result<(Vec<usize>, Vec<Self>)> {
        source.read(place, range)
    }
}

macro_rules! stored {
    ($($kind:ty: $same:expr),+) => {
        $(impl Stored for $kind {
            fn same(&self, other: &Self) -> bool {
                let same: fn(&$kind, &$kind) -> bool = $same;
                same(self, other)
            }
        })+
    };
}

stored!(
    f64: |a, b| a.to_bits() == b.to_bits(),
    i64: |a, b| a == b,
    u64: |a, b| a == b,
    i32: |a, b| a == b,
    u32: |a, b| a == b,
    BondCode: |a, b| a == b,
    ContactCode: |a, b| a == b,
    RouteCode: |a, b| a == b
);

impl Stored for RuptureRow {
    fn same(&self, other: &Self) -> bool {
        self.same(other)
    }

    fn read(source: &Source, place: &str, range: Range<usize>) -> Result<(Vec<usize>, Vec<Self>)> {
        RuptureRow::read(source, place, range)
    }
}

/// Something that is done to every table of a history.
pub(super) trait Visit {
    /// `rows` of the table are complete in the history that is read.
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()>;
}

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 23;

/// What is read of a table.
#[derive(Clone)]
struct Extract {
    place: String,
    row: Vec<usize>,
    row_bytes: usize,
    rows: usize,
}

impl Extract {
    fn of(table: &Table, rows: usize) -> Self {
        Self { place: table.place(), row: table.row().to_vec(), row_bytes: table.row_bytes(), rows }
    }

    /// Ranges of rows that are read one after the other.
    fn ranges(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (rows, step) = (self.rows, (BLOCK / self.row_bytes.max(1)).max(1));
        (0..rows).step_by(step).map(move |start| start..rows.min(start + step))
    }

    fn read<T: Stored>(&self, source: &Source, range: Range<usize>) -> Result<Vec<T>> {
        let (row, values) = T::read(source, &self.place, range)?;
        if row == self.row {
            return Ok(values);
        }
        Err(source.damaged(&self.place, &format!("its rows are {row:?}, not {:?}", self.row)))
    }
}

/// Progress over the bytes of all tables: told how much is done, from 0 to 1; false ends the work.
pub(super) struct Share<'a> {
    done: u64,
    all: u64,
    tell: &'a mut dyn FnMut(f64) -> bool,
}

impl<'a> Share<'a> {
    pub fn of(all: u64, tell: &'a mut dyn FnMut(f64) -> bool) -> Self {
        Self { done: 0, all, tell }
    }

    fn add(&mut self, bytes: usize) -> Result<()> {
        self.done += bytes as u64;
        let done = (self.done as f64 / self.all.max(1) as f64).min(1.0);
        if (self.tell)(done) { Ok(()) } else { Err(HistoryError::Interrupted) }
    }
}

/// Appends the rows of `source`.
pub(super) struct Copy<'a, 'b> {
    pub source: &'a Source,
    pub to: &'a Path,
    pub share: &'a mut Share<'b>,
}

impl Visit for Copy<'_, '_> {
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()> {
        let extract = Extract::of(table, rows);
        for range in extract.ranges() {
            let bytes = range.len() * extract.row_bytes;
            let values = extract.read::<T>(self.source, range)?;
            table.append(&values).map_err(while_writing(self.to))?;
            self.share.add(bytes)?;
        }
        Ok(())
    }
}

type Check = dyn FnOnce(&Source, &Source, &mut Share) -> Result<()>;

/// Gathers what compares the rows of two files to the bit, once the copy is closed.
#[derive(Default)]
struct Comparison {
    tables: Vec<Box<Check>>,
}

impl Visit for Comparison {
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()> {
        let extract = Extract::of(table, rows);
        self.tables.push(Box::new(move |source, copy, share| {
            for range in extract.ranges() {
                let bytes = range.len() * extract.row_bytes;
                let (a, b) = (extract.read::<T>(source, range.clone())?, extract.read::<T>(copy, range)?);
                if !a.iter().zip(&b).all(|(a, b)| a.same(b)) {
                    return Err(copy.damaged(&extract.place, DIFFERS));
                }
                share.add(bytes)?;
            }
            Ok(())
        }));
        Ok(())
    }
}

const DIFFERS: &str = "the copy differs from the original";

/// What a copy is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CopyAs {
    /// To be kept: compressed, with checksums.
    Packed,
    /// To be opened by anything, as a run that ended leaves it.
    Plain,
}

/// Writes a copy of all complete rows of `history` to `path`, which it replaces (the history itself too), and compares it
/// with the original to the bit before it takes its place. `tell` hears how much is done, from 0 to 1, and ends the work
/// by false. Returns the length of the copy, bytes.
///
/// # Errors
/// [`HistoryError::Busy`] where the history, or what stands at `path`, is being written, and what reading and writing may fail of; `path` is then
/// as it was.
pub fn copy(history: &History, path: &Path, how: CopyAs, tell: &mut dyn FnMut(f64) -> bool) -> Result<u64> {
    lock::refuse_busy(history.path())?;
    lock::refuse_busy(path)?;
    replace(path, refused(path), |part| copy_to(history, part, how, tell))
}

fn copy_to(history: &History, part: &Path, how: CopyAs, tell: &mut dyn FnMut(f64) -> bool) -> Result<u64> {
    let (layout, kept) = (history.layout()?, history.complete()?);
    let checkpoint = history.checkpoint()?;
    let mut writer = Writer::closed_copy(part, &layout, how == CopyAs::Packed)?;
    let mut comparison = Comparison::default();
    // read to be written, and to be compared
    let mut share = Share::of(2 * writer.bytes(kept)?, tell);
    writer.take_over(history.source(), kept, &mut share)?;
    if let Some(checkpoint) = &checkpoint {
        writer.checkpoint(checkpoint)?;
    }
    writer.visit(kept, &mut comparison)?;
    writer.finish()?;
    let copy = History::open(part)?;
    let same = copy.layout()? == layout && copy.complete()? == kept && copy.checkpoint()? == checkpoint;
    if !same {
        return Err(copy.source().damaged("", DIFFERS));
    }
    comparison.tables.into_iter().try_for_each(|check| check(history.source(), copy.source(), &mut share))?;
    Ok(copy.length())
}

/// Counts the bytes of all tables.
#[derive(Default)]
pub(super) struct Bytes(pub u64);

impl Visit for Bytes {
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()> {
        self.0 += (table.row_bytes() * rows) as u64;
        Ok(())
    }
}
