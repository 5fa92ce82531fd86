//! Datasets of an open file. All sizes and indices in a file are checked before use.

use std::path::{Path, PathBuf};

use hdf5::types::{FixedAscii, VarLenUnicode};
use hdf5::{File, H5Type};

use super::FclibError;
use crate::history::reason;

/// Largest compression ratio of deflate, and so the largest size of a dataset over that of its
/// file.
const GREATEST_COMPRESSION: u64 = 1032;

/// An entry of a matrix: row, column, value.
pub(super) type Entry = (usize, usize, f64);

/// An open file, its name, and its length in bytes.
pub(super) struct Source {
    path: PathBuf,
    file: File,
    length: u64,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self, FclibError> {
        let io = |source| FclibError::Io { path: path.into(), doing: "read", source };
        let metadata = std::fs::metadata(path).map_err(io)?;
        if metadata.is_dir() {
            return Err(io(std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a folder: give a file")));
        }
        std::fs::File::open(path).map_err(io)?;
        let unopened = |error| FclibError::NotHdf5 { path: path.into(), why: reason(&error) };
        let file = File::open(path).map_err(unopened)?;
        Ok(Self { path: path.into(), file, length: metadata.len() })
    }

    /// The error that the file has no problem.
    pub fn foreign(&self, why: &str) -> FclibError {
        FclibError::Foreign { path: self.path.clone(), why: why.into() }
    }

    pub fn wrong(&self, place: &str, why: impl Into<String>) -> FclibError {
        FclibError::Wrong { path: self.path.clone(), place: place.into(), why: why.into() }
    }

    /// Whether the link exists, with every group on its path.
    pub fn has(&self, place: &str) -> bool {
        let ends = place.match_indices('/').map(|(end, _)| end).chain([place.len()]);
        ends.into_iter().all(|end| self.file.link_exists(&place[..end]))
    }

    /// All values of a dataset.
    fn values<T: H5Type>(&self, place: &str) -> Result<Vec<T>, FclibError> {
        if !self.has(place) {
            return Err(self.wrong(place, "it is missing"));
        }
        let unreadable = |error| self.wrong(place, format!("it cannot be read ({})", reason(&error)));
        let dataset = self.file.dataset(place).map_err(unreadable)?;
        // a forged shape must not allocate more memory than the file can fill
        if dataset.size() as u64 > self.length.saturating_mul(GREATEST_COMPRESSION) {
            return Err(self.wrong(place, "it claims to be larger than the file"));
        }
        dataset.read_raw().map_err(unreadable)
    }

    fn counted<T: H5Type>(&self, place: &str, expected: usize) -> Result<Vec<T>, FclibError> {
        let values = self.values(place)?;
        match values.len() == expected {
            true => Ok(values),
            false => Err(self.wrong(place, format!("it has {} values instead of {expected}", values.len()))),
        }
    }

    /// A dataset of `expected` finite numbers.
    pub fn finite(&self, place: &str, expected: usize) -> Result<Vec<f64>, FclibError> {
        let values: Vec<f64> = self.counted(place, expected)?;
        match values.iter().position(|x| !x.is_finite()) {
            None => Ok(values),
            Some(at) => Err(self.wrong(place, format!("it is {} at index {at}, it must be finite", values[at]))),
        }
    }

    /// The value of a dataset with a single integer.
    pub fn integer(&self, place: &str) -> Result<i64, FclibError> {
        Ok(self.counted(place, 1)?[0])
    }

    /// A number of rows, columns or entries.
    fn count(&self, place: &str) -> Result<usize, FclibError> {
        let found = self.integer(place)?;
        usize::try_from(found).map_err(|_| self.wrong(place, format!("it is {found}, it must not be below zero")))
    }

    /// Indices from 0 to `limit`, exclusive.
    pub fn indices(&self, place: &str, expected: usize, limit: usize) -> Result<Vec<usize>, FclibError> {
        self.within(place, self.counted(place, expected)?, limit)
    }

    /// These values of a dataset as indices from 0 to `limit`, exclusive.
    fn within(&self, place: &str, found: Vec<i64>, limit: usize) -> Result<Vec<usize>, FclibError> {
        let index = |(at, index): (usize, i64)| match usize::try_from(index) {
            Ok(index) if index < limit => Ok(index),
            _ => {
                let most = limit.saturating_sub(1);
                Err(self.wrong(place, format!("it is {index} at index {at}, it must be from 0 to {most}")))
            }
        };
        found.into_iter().enumerate().map(index).collect()
    }

    /// A text, empty if absent; only for display.
    pub fn text(&self, place: &str) -> String {
        let dataset = if self.has(place) { self.file.dataset(place).ok() } else { None };
        let read = |dataset: hdf5::Dataset| match dataset.read_scalar::<FixedAscii<1024>>() {
            Ok(text) => Some(text.to_string()),
            Err(_) => dataset.read_scalar::<VarLenUnicode>().ok().map(|text| text.to_string()),
        };
        dataset.and_then(read).unwrap_or_default()
    }

    /// The number of rows and of columns of a sparse matrix.
    pub fn shape(&self, matrix: &str) -> Result<(usize, usize), FclibError> {
        Ok((self.count(&format!("{matrix}/m"))?, self.count(&format!("{matrix}/n"))?))
    }

    /// The number of rows of a square matrix.
    pub fn order(&self, matrix: &str) -> Result<usize, FclibError> {
        let (m, n) = self.shape(matrix)?;
        match m == n {
            true => Ok(m),
            false => {
                let name = matrix.rsplit('/').next().unwrap_or(matrix);
                Err(self.wrong(&format!("{matrix}/n"), format!("it is {n}, but m is {m}: {name} must be square")))
            }
        }
    }

    /// The entries of a sparse matrix of `m` rows and `n` columns, with any storage; the values are
    /// not checked to be finite.
    pub fn entries(&self, matrix: &str, m: usize, n: usize) -> Result<Vec<Entry>, FclibError> {
        let at = |name: &str| format!("{matrix}/{name}");
        let nz = self.integer(&at("nz"))?;
        if let -1 | -2 = nz {
            let (lines, others) = if nz == -1 { (n, m) } else { (m, n) };
            let starts = self.starts(&at("p"), lines)?;
            let stored = starts[lines];
            let index = self.within(&at("i"), self.leading(&at("i"), stored)?, others)?;
            let x = self.leading::<f64>(&at("x"), stored)?;
            let line = (0..lines).flat_map(|line| std::iter::repeat_n(line, starts[line + 1] - starts[line]));
            let entry = |((line, index), x)| if nz == -1 { (index, line, x) } else { (line, index, x) };
            return Ok(line.zip(index).zip(x).map(entry).collect());
        }
        let count = usize::try_from(nz).map_err(|_| {
            let meaning = "−1 (by columns), −2 (by rows), or the number of triplets";
            self.wrong(&at("nz"), format!("it is {nz}, it must be {meaning}"))
        })?;
        let (i, p) = (self.indices(&at("i"), count, m)?, self.indices(&at("p"), count, n)?);
        // with nzmax > nz, the dataset is longer than the number of triplets
        let x = self.leading::<f64>(&at("x"), count)?;
        Ok(i.into_iter().zip(p).zip(x).map(|((i, p), x)| (i, p, x)).collect())
    }

    /// The first `count` values of a dataset that may be longer.
    fn leading<T: H5Type>(&self, place: &str, count: usize) -> Result<Vec<T>, FclibError> {
        let mut values = self.values(place)?;
        if values.len() < count {
            return Err(self.wrong(place, format!("it has {} values, but {count} are required", values.len())));
        }
        values.truncate(count);
        Ok(values)
    }

    /// The start of each row or column: from zero, non-decreasing.
    fn starts(&self, place: &str, lines: usize) -> Result<Vec<usize>, FclibError> {
        let starts = self.indices(place, lines + 1, usize::MAX)?;
        if starts[0] != 0 || starts.windows(2).any(|pair| pair[0] > pair[1]) {
            return Err(self.wrong(place, "it must start at 0 and never decrease"));
        }
        Ok(starts)
    }
}
