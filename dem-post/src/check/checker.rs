//! A history under examination: reading of its datasets and record of the violations.

use std::collections::BTreeMap;
use std::ops::Range;

use hdf5::{Dataset, File, H5Type, Hyperslab, SliceOrIndex};
use indicatif::ProgressBar;

use super::report::{Report, Violation};

/// Maximum number of violations listed per place; the others are counted.
pub(super) const MANY: usize = 10;
/// Numbers read at once.
const BLOCK: usize = 1 << 20;

/// A history under examination.
pub(super) struct Checker {
    pub file: File,
    pub sizes: Sizes,
    /// Whether it holds a complete checkpoint.
    pub resumable: bool,
    pub report: Report,
    /// Datasets with the type and shape of the layout, with the number of complete rows and of
    /// numbers per row.
    pub sound: BTreeMap<String, [usize; 2]>,
    pub told: BTreeMap<String, usize>,
    pub bar: ProgressBar,
}

/// The letters of the layout.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sizes {
    /// Dimension D, grains N, walls W, bonds B, frames T.
    pub d: usize,
    pub n: usize,
    pub w: usize,
    pub b: usize,
    pub t: usize,
    /// Materials, where there are several.
    pub k: usize,
    /// Complete rows of contacts M, ruptures E and observed steps S.
    pub m: usize,
    pub e: usize,
    pub s: usize,
}

impl Checker {
    pub fn wrong(&mut self, place: &str, row: Option<usize>, what: impl Into<String>) {
        let told = self.told.entry(place.into()).or_default();
        *told += 1;
        if *told <= MANY {
            self.report.violations.push(Violation { place: place.into(), row, what: what.into() });
        }
    }

    pub fn has(&self, place: &str) -> bool {
        // HDF5 needs every group of the path to exist
        let parts: Vec<&str> = place.split('/').collect();
        (1..=parts.len()).all(|k| self.file.link_exists(&parts[..k].join("/")))
    }

    pub fn dataset(&self, place: &str) -> Option<Dataset> {
        if self.has(place) { self.file.dataset(place).ok() } else { None }
    }

    pub fn is_sound(&self, places: &[&str]) -> bool {
        places.iter().all(|place| self.sound.contains_key(*place))
    }

    /// Rows `range` of a sound dataset; a failure to read is a violation.
    pub fn rows<T: H5Type>(&mut self, place: &str, range: Range<usize>) -> Option<Vec<T>> {
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

    /// Passes the complete rows of a sound dataset to `see`, block by block, with the index of the
    /// first row.
    pub fn blocks<T: H5Type>(&mut self, place: &str, mut see: impl FnMut(&mut Self, usize, &[T])) {
        let Some(&[rows, width]) = self.sound.get(place) else { return };
        let step = (BLOCK / width.max(1)).max(1);
        for start in (0..rows).step_by(step) {
            let Some(values) = self.rows::<T>(place, start..rows.min(start + step)) else { return };
            see(self, start, &values);
        }
    }
}
