//! Operations on every table of a history, one after the other: counting and copying rows.

use std::ops::Range;
use std::path::Path;

use hdf5::H5Type;

use super::codes::{BondCode, ContactCode, RouteCode};
use super::error::{HistoryError, Result, while_writing};
use super::rupture::RuptureRow;
use super::source::Source;
use super::table::Table;

/// Types of table values, with bitwise comparison.
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

/// An operation on every table of a history.
pub(super) trait Visit {
    /// `rows` of the table are complete in the source history.
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()>;
}

/// Bytes read at a time.
const BLOCK: usize = 1 << 23;

/// The part of a table to read.
#[derive(Clone)]
pub(super) struct Extract {
    pub place: String,
    row: Vec<usize>,
    pub row_bytes: usize,
    rows: usize,
}

impl Extract {
    pub fn of(table: &Table, rows: usize) -> Self {
        Self { place: table.place(), row: table.row().to_vec(), row_bytes: table.row_bytes(), rows }
    }

    /// Ranges of rows, read in turn.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        // rows without values: the bonds have not formed
        let rows = if self.row_bytes == 0 { 0 } else { self.rows };
        let step = (BLOCK / self.row_bytes.max(1)).max(1);
        (0..rows).step_by(step).map(move |start| start..rows.min(start + step))
    }

    pub fn read<T: Stored>(&self, source: &Source, range: Range<usize>) -> Result<Vec<T>> {
        let (row, values) = T::read(source, &self.place, range)?;
        if row == self.row {
            return Ok(values);
        }
        Err(source.damaged(&self.place, &format!("its rows are {row:?}, not {:?}", self.row)))
    }
}

/// Progress over the bytes of all tables: `tell` receives the completed share, from 0 to 1; the
/// operation stops if it returns false.
pub(super) struct Share<'a> {
    done: u64,
    all: u64,
    tell: &'a mut dyn FnMut(f64) -> bool,
}

impl<'a> Share<'a> {
    pub fn of(all: u64, tell: &'a mut dyn FnMut(f64) -> bool) -> Self {
        Self { done: 0, all, tell }
    }

    pub fn add(&mut self, bytes: usize) -> Result<()> {
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
        if table.width() == 0 {
            return table.append_empty(rows).map_err(while_writing(self.to));
        }
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

/// Counts the bytes of all tables.
#[derive(Default)]
pub(super) struct Bytes(pub u64);

impl Visit for Bytes {
    fn table<T: Stored>(&mut self, table: &mut Table, rows: usize) -> Result<()> {
        self.0 += (table.row_bytes() * rows) as u64;
        Ok(())
    }
}
