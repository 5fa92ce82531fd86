//! Reading a problem. Whatever a file claims is checked before it is believed.

use std::path::{Path, PathBuf};

use dem_core::problem::assembled::{Assembled, AssemblyError, BlockMatrix, ContactRows, Parts};
use hdf5::types::{FixedAscii, VarLenUnicode};
use hdf5::{File, H5Type};

use super::{FclibError, Problem};
use crate::history::reason;

/// Deflate cannot shrink anything further than this, so no honest dataset is larger than this many file lengths.
const GREATEST_COMPRESSION: u64 = 1032;

/// An open file, its name, and its length in bytes.
struct Source {
    path: PathBuf,
    file: File,
    length: u64,
}

impl Problem {
    /// Reads a local problem of FCLIB, whatever way its matrix is stored.
    ///
    /// # Errors
    /// [`FclibError`], which names the dataset that is missing or wrong.
    pub fn read(path: &Path) -> Result<Self, FclibError> {
        hdf5::silence_errors(true);
        let source = Source::open(path)?;
        let assembled = source.assembled()?;
        let rows = assembled.r.len();
        let reactions = |group: &str| match source.has(group) {
            true => source.finite(&format!("{group}/r"), rows).map(Some),
            false => Ok(None),
        };
        let (guess, solution) = (reactions("guesses/1")?, reactions("solution")?);
        let mut problem = Self {
            title: source.text("fclib_local/info/title"),
            description: source.text("fclib_local/info/description"),
            math_info: source.text("fclib_local/info/math_info"),
            assembled,
            solution,
        };
        if let Some(guess) = guess {
            problem.assembled.r = guess;
        }
        Ok(problem)
    }
}

impl Source {
    fn open(path: &Path) -> Result<Self, FclibError> {
        let io = |source| FclibError::Io { path: path.into(), doing: "read", source };
        let metadata = std::fs::metadata(path).map_err(io)?;
        if metadata.is_dir() {
            return Err(io(std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a folder, give a file")));
        }
        std::fs::File::open(path).map_err(io)?;
        let unopened = |error| FclibError::NotHdf5 { path: path.into(), why: reason(&error) };
        let file = File::open(path).map_err(unopened)?;
        let source = Self { path: path.into(), file, length: metadata.len() };
        if source.has("fclib_local") {
            return Ok(source);
        }
        let why = match () {
            () if source.has("fclib_global") || source.has("fclib_global_rolling") => {
                "it holds a global problem, with M and H instead of W"
            }
            () if source.has("h5md") => "it is a history: `dem-run export` takes a problem out of it",
            () => "it has no group /fclib_local",
        };
        Err(FclibError::Foreign { path: path.into(), why: why.into() })
    }

    fn wrong(&self, place: &str, why: impl Into<String>) -> FclibError {
        FclibError::Wrong { path: self.path.clone(), place: place.into(), why: why.into() }
    }

    /// Whether there is such a link; each group on the way must be there, too.
    fn has(&self, place: &str) -> bool {
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
        // a forged shape must not ask for more memory than the file can fill
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

    fn finite(&self, place: &str, expected: usize) -> Result<Vec<f64>, FclibError> {
        let values: Vec<f64> = self.counted(place, expected)?;
        match values.iter().position(|x| !x.is_finite()) {
            None => Ok(values),
            Some(at) => Err(self.wrong(place, format!("it is {} at index {at}, it must be finite", values[at]))),
        }
    }

    fn integer(&self, place: &str) -> Result<i64, FclibError> {
        Ok(self.counted(place, 1)?[0])
    }

    /// A number of rows, columns or entries.
    fn count(&self, place: &str) -> Result<usize, FclibError> {
        let found = self.integer(place)?;
        usize::try_from(found).map_err(|_| self.wrong(place, format!("it is {found}, it must not be below zero")))
    }

    /// Indices from 0 to `limit`, exclusive.
    fn indices(&self, place: &str, expected: usize, limit: usize) -> Result<Vec<usize>, FclibError> {
        let found: Vec<i64> = self.counted(place, expected)?;
        let index = |(at, index): (usize, &i64)| match usize::try_from(*index) {
            Ok(index) if index < limit => Ok(index),
            _ => Err(self.wrong(place, format!("it is {index} at index {at}, it must be from 0 to {}", limit - 1))),
        };
        found.iter().enumerate().map(index).collect()
    }

    /// A text; empty where there is none. It is shown and decides nothing.
    fn text(&self, place: &str) -> String {
        let dataset = if self.has(place) { self.file.dataset(place).ok() } else { None };
        let read = |dataset: hdf5::Dataset| match dataset.read_scalar::<FixedAscii<1024>>() {
            Ok(text) => Some(text.to_string()),
            Err(_) => dataset.read_scalar::<VarLenUnicode>().ok().map(|text| text.to_string()),
        };
        dataset.and_then(read).unwrap_or_default()
    }

    fn assembled(&self) -> Result<Assembled, FclibError> {
        for place in ["fclib_local/V", "fclib_local/R"] {
            if self.has(place) {
                return Err(self.wrong(place, "equality constraints are not read; eliminate them from the problem"));
            }
        }
        let rolling = self.has("fclib_local/vectors/mu_r");
        let dimension = self.integer("fclib_local/spacedim")?;
        let rows = match (dimension, rolling) {
            (2, false) => ContactRows { tangents: 1, moments: 0 },
            (3, false) => ContactRows { tangents: 2, moments: 0 },
            (3, true) => ContactRows { tangents: 1, moments: 1 },
            (5, true) => ContactRows { tangents: 2, moments: 2 },
            (6, true) => ContactRows { tangents: 2, moments: 3 },
            (5 | 6, false) => {
                let why = format!("it is missing, and spacedim is {dimension}");
                return Err(self.wrong("fclib_local/vectors/mu_r", why));
            }
            _ => {
                let allowed = if rolling { "3, 5 or 6, as there is a mu_r" } else { "2 or 3, or with mu_r 3, 5 or 6" };
                return Err(self.wrong("fclib_local/spacedim", format!("it is {dimension}, it must be {allowed}")));
            }
        };
        // q before the matrix: a forged m must not ask for memory
        let total = self.order(rows.count())?;
        let q = self.finite("fclib_local/vectors/q", total)?;
        let matrix = self.matrix(total, rows.count())?;
        let contacts = total / rows.count();
        let ours = self.has("cohesive_dem");
        let coefficients = |place: &str| self.finite(place, contacts);
        let parts = Parts {
            rows,
            matrix,
            q,
            mu: coefficients("fclib_local/vectors/mu")?,
            nu: if rolling { coefficients("fclib_local/vectors/mu_r")? } else { vec![0.0; contacts] },
            xi: if rows.moments > rows.tangents {
                coefficients("fclib_local/vectors/mu_t")?
            } else {
                vec![0.0; contacts]
            },
            associated: if ours {
                self.indices("cohesive_dem/associated", contacts, 2)?.into_iter().map(|flag| flag == 1).collect()
            } else {
                vec![false; contacts]
            },
            shift: if ours { coefficients("cohesive_dem/shift")? } else { vec![0.0; contacts] },
            applied: if ours { self.finite("cohesive_dem/applied", 1)?[0] } else { 0.0 },
        };
        Assembled::new(parts).map_err(|error| {
            let place = match &error {
                AssemblyError::Length { array, .. } | AssemblyError::Value { array, .. } => match *array {
                    "shift" | "applied" | "associated" => format!("cohesive_dem/{array}"),
                    "mu" | "mu_r" | "mu_t" | "q" => format!("fclib_local/vectors/{array}"),
                    _ => "fclib_local/W/x".into(),
                },
                AssemblyError::Asymmetric { .. } => "fclib_local/W".into(),
            };
            self.wrong(&place, error.to_string())
        })
    }

    /// The number of rows of W, of which each contact has `size`.
    fn order(&self, size: usize) -> Result<usize, FclibError> {
        let at = |name: &str| format!("fclib_local/W/{name}");
        let (m, n) = (self.count(&at("m"))?, self.count(&at("n"))?);
        if m != n {
            return Err(self.wrong(&at("n"), format!("it is {n}, and m is {m}: W must be square")));
        }
        if m == 0 || m % size != 0 {
            let why = format!("it is {m}, it must be a multiple of {size} above zero: {size} rows a contact");
            return Err(self.wrong(&at("m"), why));
        }
        Ok(m)
    }

    /// The matrix W of `m` rows, in blocks of `size`.
    fn matrix(&self, m: usize, size: usize) -> Result<BlockMatrix, FclibError> {
        let at = |name: &str| format!("fclib_local/W/{name}");
        let nz = self.integer(&at("nz"))?;
        let entries: Vec<(usize, usize, f64)> = match nz {
            -1 | -2 => {
                let starts = self.starts(&at("p"), m)?;
                let stored = starts[m];
                let (index, x) = (self.leading::<i64>(&at("i"), stored)?, self.leading::<f64>(&at("x"), stored)?);
                let line = (0..m).flat_map(|line| std::iter::repeat_n(line, starts[line + 1] - starts[line]));
                let place = |(at_entry, (line, index)): (usize, (usize, i64))| match usize::try_from(index) {
                    Ok(other) if other < m && nz == -1 => Ok((other, line, x[at_entry])),
                    Ok(other) if other < m => Ok((line, other, x[at_entry])),
                    _ => Err(self.wrong(&at("i"), format!("it is {index} at index {at_entry}, and W has {m} rows"))),
                };
                line.zip(index).enumerate().map(place).collect::<Result<_, _>>()?
            }
            _ => {
                let count = usize::try_from(nz).map_err(|_| {
                    let meaning = "−1 (by columns), −2 (by rows), or the number of triplets";
                    self.wrong(&at("nz"), format!("it is {nz}, it must be {meaning}"))
                })?;
                let (i, p) = (self.indices(&at("i"), count, m)?, self.indices(&at("p"), count, m)?);
                // nzmax may leave room behind the last triplet
                let x = self.leading::<f64>(&at("x"), count)?;
                i.into_iter().zip(p).zip(x).map(|((i, p), x)| (i, p, x)).collect()
            }
        };
        Ok(BlockMatrix::from_entries(m / size, size, &entries))
    }

    /// The first `count` values of a dataset that may be longer.
    fn leading<T: H5Type>(&self, place: &str, count: usize) -> Result<Vec<T>, FclibError> {
        let mut values = self.values(place)?;
        if values.len() < count {
            return Err(self.wrong(place, format!("it has {} values, and {count} are promised", values.len())));
        }
        values.truncate(count);
        Ok(values)
    }

    /// Where each row or column starts: from zero, never falling.
    fn starts(&self, place: &str, lines: usize) -> Result<Vec<usize>, FclibError> {
        let starts = self.indices(place, lines + 1, usize::MAX)?;
        if starts[0] != 0 || starts.windows(2).any(|pair| pair[0] > pair[1]) {
            return Err(self.wrong(place, "it must start at 0 and never fall"));
        }
        Ok(starts)
    }
}
