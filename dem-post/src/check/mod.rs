//! Whether a history is what its layout promises: `dem-post info --check`.
//!
//! First every dataset by its name, type, shape and unit, then what stands in them, block by block, so that memory does
//! not grow with the file. Nothing is believed that the checks before did not find: a dataset of another shape is named
//! once and not read.

mod content;
mod schema;

use std::collections::BTreeMap;
use std::ops::Range;

use dem_history::History;
use hdf5::{Dataset, File, H5Type, Hyperslab, OpenMode, SliceOrIndex};
use indicatif::ProgressBar;
use serde::Serialize;

use crate::output::{PostError, Result, WriteError, facts, progress};

/// Violations that are told of one place; the others are counted.
const MANY: usize = 10;
/// Numbers that are read at once.
const BLOCK: usize = 1 << 20;

/// What was checked, and what is wrong.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The file.
    pub file: String,
    /// Number of frames.
    pub frames: usize,
    /// Datasets that were found as promised.
    pub datasets: usize,
    /// Numbers that were read.
    pub numbers: u64,
    /// What is wrong, at most ten of each place.
    pub violations: Vec<Violation>,
    /// What is wrong beyond that, by place.
    pub more: BTreeMap<String, usize>,
}

/// Something that should not be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Violation {
    /// The dataset, group or attribute.
    pub place: String,
    /// The row of it, counted from 0; for series and contacts over time, of the whole dataset.
    pub row: Option<usize>,
    /// What is wrong.
    pub what: String,
}

/// A history under examination.
struct Checker {
    file: File,
    sizes: Sizes,
    /// Whether a whole checkpoint stands in it.
    resumable: bool,
    report: Report,
    /// Datasets of the type and shape that the layout promises, with the rows that are complete and the numbers in each.
    sound: BTreeMap<String, [usize; 2]>,
    told: BTreeMap<String, usize>,
    bar: ProgressBar,
}

/// The letters of the layout.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    /// Dimension D, grains N, walls W, bonds B, frames T.
    d: usize,
    n: usize,
    w: usize,
    b: usize,
    t: usize,
    /// Complete rows of contacts M, ruptures E and observed steps S.
    m: usize,
    e: usize,
    s: usize,
}

/// Checks a history; with a bar on a terminal unless `quiet`.
///
/// # Errors
/// [`PostError::Write`] where the file cannot be opened once more. What is wrong in the file is told in the report.
pub fn read(history: &History, quiet: bool) -> Result<Report> {
    let mode = if history.open_ended() { OpenMode::ReadSWMR } else { OpenMode::Read };
    let file = File::open_as(history.path(), mode)
        .map_err(|error| WriteError { path: history.path().into(), why: error.to_string() })?;
    let report = Report { file: history.path().display().to_string(), frames: history.frames(), ..Report::default() };
    let sizes = Sizes { d: history.dimension(), t: history.frames(), ..Sizes::default() };
    let bar = progress(0, quiet, "{bar:24} {percent} % checked, {eta} left");
    let resumable = history.checkpoint().is_ok_and(|checkpoint| checkpoint.is_some());
    let mut checker = Checker { file, sizes, resumable, report, sound: BTreeMap::new(), told: BTreeMap::new(), bar };
    schema::check(&mut checker);
    let numbers: usize = checker.sound.values().map(|[rows, width]| rows * width).sum();
    checker.bar.set_length(numbers as u64);
    content::check(&mut checker);
    checker.bar.finish_and_clear();
    checker.report.datasets = checker.sound.len();
    checker.report.more = checker.told.into_iter().filter(|(_, n)| *n > MANY).map(|(p, n)| (p, n - MANY)).collect();
    Ok(checker.report)
}

impl Report {
    /// The number of violations.
    pub fn count(&self) -> usize {
        self.violations.len() + self.more.values().sum::<usize>()
    }

    /// The report as lines.
    pub fn table(&self) -> String {
        let sound = if self.count() == 0 { "yes".into() } else { format!("no, {} violations", self.count()) };
        let mut text = facts(&[
            ("file", self.file.clone()),
            ("checked", format!("{} datasets, {} frames, {} numbers", self.datasets, self.frames, self.numbers)),
            ("sound", sound),
        ]);
        for violation in &self.violations {
            let row = violation.row.map_or_else(String::new, |row| format!(" row {row}"));
            text += &format!("/{}{row}: {}\n", violation.place, violation.what);
        }
        for (place, count) in &self.more {
            text += &format!("/{place}: {count} more\n");
        }
        text
    }

    /// Whether the history is sound.
    ///
    /// # Errors
    /// [`PostError::Unsound`] if it is not.
    pub fn verdict(&self) -> Result<()> {
        match self.count() {
            0 => Ok(()),
            count => Err(PostError::Unsound(format!(
                "{} is not sound: {count} violations of its layout. Copy it again, or run the scene again",
                self.file
            ))),
        }
    }
}

impl Checker {
    fn wrong(&mut self, place: &str, row: Option<usize>, what: impl Into<String>) {
        let told = self.told.entry(place.into()).or_default();
        *told += 1;
        if *told <= MANY {
            self.report.violations.push(Violation { place: place.into(), row, what: what.into() });
        }
    }

    fn has(&self, place: &str) -> bool {
        // HDF5 asks of every group on the way
        let parts: Vec<&str> = place.split('/').collect();
        (1..=parts.len()).all(|k| self.file.link_exists(&parts[..k].join("/")))
    }

    fn dataset(&self, place: &str) -> Option<Dataset> {
        if self.has(place) { self.file.dataset(place).ok() } else { None }
    }

    fn is_sound(&self, places: &[&str]) -> bool {
        places.iter().all(|place| self.sound.contains_key(*place))
    }

    /// Rows `range` of a sound dataset; what cannot be read is a violation.
    fn rows<T: H5Type>(&mut self, place: &str, range: Range<usize>) -> Option<Vec<T>> {
        if !self.sound.contains_key(place) || range.is_empty() {
            return Some(vec![]).filter(|_| self.sound.contains_key(place));
        }
        let dataset = self.dataset(place)?;
        let mut slices = vec![range.clone()];
        slices.extend(dataset.shape().iter().skip(1).map(|&n| 0..n));
        let slices: Vec<_> = slices.into_iter().map(SliceOrIndex::from).collect();
        match dataset.read_slice::<T, _, ndarray::IxDyn>(Hyperslab::from(slices)) {
            Ok(values) => {
                self.report.numbers += values.len() as u64;
                self.bar.inc(values.len() as u64);
                Some(values.into_raw_vec_and_offset().0)
            }
            Err(error) => {
                self.wrong(place, Some(range.start), format!("cannot be read ({error})"));
                self.sound.remove(place);
                None
            }
        }
    }

    /// Hands the complete rows of a sound dataset to `see`, block by block, with the number of the first row.
    fn blocks<T: H5Type>(&mut self, place: &str, mut see: impl FnMut(&mut Self, usize, &[T])) {
        let Some(&[rows, width]) = self.sound.get(place) else { return };
        let step = (BLOCK / width.max(1)).max(1);
        for start in (0..rows).step_by(step) {
            let Some(values) = self.rows::<T>(place, start..rows.min(start + step)) else { return };
            see(self, start, &values);
        }
    }
}
