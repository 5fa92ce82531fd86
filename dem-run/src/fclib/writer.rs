//! Writes a problem in the form that FCLIB's own library writes and reads.

use std::path::Path;

use hdf5::types::FixedAscii;
use hdf5::{File, Group, H5Type};

use super::{FclibError, Problem};
use crate::history::reason;
use crate::output::replace::replace;

impl Problem {
    /// Writes the problem, its reactions as the first guess if they are not all zero, and its
    /// solution if there is one.
    ///
    /// The file is written beside `path` and renamed to `path` when complete.
    ///
    /// # Errors
    /// [`FclibError::Io`] and [`FclibError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), FclibError> {
        hdf5::silence_errors(true);
        let failed = |doing, source| FclibError::Io { path: path.into(), doing, source };
        replace(path, failed, |part| {
            self.fill(part).map_err(|error| FclibError::Write { path: path.into(), why: reason(&error) })
        })
    }

    fn fill(&self, path: &Path) -> hdf5::Result<()> {
        let file = File::create(path)?;
        let parts = self.assembled.parts();
        let local = file.create_group("fclib_local")?;
        integer(&local, "spacedim", parts.rows.count())?;
        self.matrix(&local.create_group("W")?)?;
        let vectors = local.create_group("vectors")?;
        dataset(&vectors, "q", &parts.q)?;
        dataset(&vectors, "mu", &parts.mu)?;
        if parts.rows.moments > 0 {
            dataset(&vectors, "mu_r", &parts.nu)?;
        }
        if parts.rows.moments > parts.rows.tangents {
            dataset(&vectors, "mu_t", &parts.xi)?;
        }
        let info = local.create_group("info")?;
        text::<128>(&info, "title", &self.title)?;
        text::<1024>(&info, "description", &self.description)?;
        text::<256>(&info, "math_info", &self.math_info)?;
        if self.assembled.r.iter().any(|r| *r != 0.0) {
            let guesses = file.create_group("guesses")?;
            integer(&guesses, "number_of_guesses", 1)?;
            self.reactions(&guesses.create_group("1")?, &self.assembled.r)?;
        }
        if let Some(solution) = &self.solution {
            self.reactions(&file.create_group("solution")?, solution)?;
        }
        let ours = file.create_group("cohesive_dem")?;
        let associated: Vec<i32> = parts.associated.iter().map(|flag| i32::from(*flag)).collect();
        dataset(&ours, "associated", &associated)?;
        dataset(&ours, "shift", &parts.shift)?;
        dataset(&ours, "applied", &[parts.applied])?;
        file.flush()
    }

    /// Writes W by columns, the storage that every reader supports.
    fn matrix(&self, group: &Group) -> hdf5::Result<()> {
        let mut entries = self.assembled.parts().matrix.entries();
        entries.sort_by_key(|(row, column, _)| (*column, *row));
        let lines = self.assembled.r.len();
        let mut starts = vec![0; lines + 1];
        for (_, column, _) in &entries {
            starts[column + 1] += 1;
        }
        for line in 0..lines {
            starts[line + 1] += starts[line];
        }
        integer(group, "nzmax", entries.len())?;
        integer(group, "m", lines)?;
        integer(group, "n", lines)?;
        dataset(group, "nz", &[-1i32])?;
        dataset(group, "p", &integers(starts)?)?;
        dataset(group, "i", &integers(entries.iter().map(|entry| entry.0))?)?;
        dataset(group, "x", &entries.iter().map(|entry| entry.2).collect::<Vec<_>>())
    }

    fn reactions(&self, group: &Group, r: &[f64]) -> hdf5::Result<()> {
        let mut at = self.assembled.clone();
        at.r = r.to_vec();
        dataset(group, "u", &at.velocities())?;
        dataset(group, "r", r)
    }
}

/// Integers of 32 bits, the only ones that the format has.
fn integers(values: impl IntoIterator<Item = usize>) -> hdf5::Result<Vec<i32>> {
    let narrow = |value| i32::try_from(value).map_err(|_| hdf5::Error::from(format!("{value} exceeds 32 bits")));
    values.into_iter().map(narrow).collect()
}

fn dataset<T: H5Type>(group: &Group, name: &str, values: &[T]) -> hdf5::Result<()> {
    group.new_dataset_builder().with_data(values).obj_track_times(false).create(name).map(drop)
}

fn integer(group: &Group, name: &str, value: usize) -> hdf5::Result<()> {
    dataset(group, name, &integers([value])?)
}

/// Writes an ASCII text of fixed length, truncated if too long: FCLIB's library reads no other
/// kind.
fn text<const N: usize>(group: &Group, name: &str, value: &str) -> hdf5::Result<()> {
    let ascii = |c: char| if c.is_ascii() && c != '\0' { c as u8 } else { b'?' };
    // one byte is reserved for the terminating zero of C
    let bytes: Vec<u8> = value.chars().map(ascii).take(N - 1).collect();
    let fixed = FixedAscii::<N>::from_ascii(&bytes).map_err(|error| hdf5::Error::from(error.to_string()))?;
    group.new_dataset::<FixedAscii<N>>().obj_track_times(false).create(name)?.write_scalar(&fixed)
}
