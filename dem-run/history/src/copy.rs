//! A copy of a history: packed, or in the form of a finished run. The memory does not grow with the
//! length of the history.

use std::path::Path;

use dem_output::replace::replace;

use super::error::{HistoryError, Result, refused};
use super::lock;
use super::model::RowCounts;
use super::reader::History;
use super::source::Source;
use super::table::Table;
use super::visit::{Extract, Share, Stored, Visit};
use super::writer::Writer;

type Check = dyn FnOnce(&Source, &Source, &mut Share) -> Result<()>;

/// Collects the bitwise comparisons of the rows of two files; they run once the copy is closed.
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

/// Purpose of a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CopyAs {
    /// For archiving: compressed, with checksums.
    Packed,
    /// For any HDF5 program: uncompressed, as the history of a finished run.
    Plain,
}

/// Writes a copy of all complete rows of `history` to `path`. The copy is compared with the
/// original bit by bit before it replaces the file at `path`, which may be the history itself.
/// `tell` receives the completed share, from 0 to 1; copying stops if it returns false. Returns the
/// length of the copy, bytes.
///
/// # Errors
/// [`HistoryError::Busy`](super::HistoryError::Busy) while another process writes the history or
/// the file at `path`, and those of reading and writing; the file at `path` is then unchanged.
pub fn copy(history: &History, path: &Path, how: CopyAs, tell: &mut dyn FnMut(f64) -> bool) -> Result<u64> {
    lock::refuse_busy(path)?;
    // a run that is resumed meanwhile would be lost
    let _lock = lock::hold_while_read(history.path())?;
    if !history.source().is_still_there() {
        return Err(HistoryError::Gone { path: history.path().into() });
    }
    replace(path, refused(path), |part| copy_to(history, part, how, tell))
}

fn copy_to(history: &History, part: &Path, how: CopyAs, tell: &mut dyn FnMut(f64) -> bool) -> Result<u64> {
    let (layout, complete) = (history.layout()?, history.complete()?);
    let (checkpoint, ending) = (history.checkpoint()?, history.ending()?);
    let mut kept = complete;
    // a run resumes from its checkpoint, also from one beyond the last frame
    if let Some(state) = &checkpoint
        && let Some(rows) = history.complete_to(state.step)?
    {
        kept = RowCounts { steps: kept.steps.max(rows.steps), events: kept.events.max(rows.events), ..kept };
    }
    let mut writer = Writer::closed_copy(part, &layout, how == CopyAs::Packed)?;
    let mut comparison = Comparison::default();
    // read twice: for writing and for the comparison
    let mut share = Share::of(2 * writer.bytes(kept)?, tell);
    writer.take_over(history.source(), kept, &mut share)?;
    if let Some(checkpoint) = &checkpoint {
        writer.checkpoint(checkpoint)?;
    }
    writer.ending(ending)?;
    writer.visit(kept, &mut comparison)?;
    writer.finish()?;
    let copy = History::open(part)?;
    let same = copy.layout()? == layout
        && copy.complete()? == complete
        && copy.checkpoint()? == checkpoint
        && copy.ending()? == ending;
    if !same {
        return Err(copy.source().damaged("", DIFFERS));
    }
    comparison.tables.into_iter().try_for_each(|check| check(history.source(), copy.source(), &mut share))?;
    Ok(copy.length())
}
