//! An open HDF5 file that is a history, and the checked reads on which the reader is built.

use std::fs;
use std::io::Read;
use std::ops::Range;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, File, H5Type, OpenMode};

use super::codes::Coded;
use super::error::{HistoryError, Result, damaged, reason, refused, while_reading};
use super::schema::{CREATOR, path};
use super::sound;
use super::table::rows;
use super::texts::Texts;
use crate::SCHEMA_VERSION;

/// Largest compression ratio of deflate: no dataset can be larger than this many file lengths.
const GREATEST_COMPRESSION: u64 = 1032;

/// How often HDF5 reads metadata whose checksum is wrong, in a file that may be written meanwhile.
/// It waits 1 ns before the second attempt and doubles the wait each time: 0.1 s in all. With its
/// default of 100 a damaged file that was never closed is waited for without end.
const READ_ATTEMPTS: u32 = 27;

/// The file, with its length in bytes and whether it was never closed.
pub(super) struct Source {
    pub path: PathBuf,
    pub file: File,
    pub length: u64,
    pub open_ended: bool,
    texts: Texts,
    identity: Option<(u64, u64)>,
}

impl Source {
    /// Opens a file and checks that it is a history that this program can read.
    pub fn open(path: &Path) -> Result<Self> {
        let identity = identity(path);
        let (length, open_ended) = check_superblock(path)?;
        let texts = Texts::find(path).map_err(|error| refused(path)("read", error))?;
        let texts = texts.map_err(|why| damaged(path, "", why))?;
        let file = open_file(path, open_ended)?;
        check_identity(path, &file)?;
        Ok(Self { path: path.into(), file, length, open_ended, texts, identity })
    }

    /// Whether the path still names the file that was opened.
    pub fn is_still_there(&self) -> bool {
        identity(&self.path) == self.identity
    }

    pub fn damaged(&self, place: &str, why: &str) -> HistoryError {
        damaged(&self.path, place, why)
    }

    pub fn has(&self, place: &str) -> bool {
        self.file.link_exists(place)
    }

    pub fn dataset(&self, place: &str) -> Result<Dataset> {
        self.file.dataset(place).map_err(while_reading(&self.path, place))
    }

    /// Rows `range` of a dataset, with the shape of one row.
    pub fn read<T: H5Type>(&self, place: &str, range: Range<usize>) -> Result<(Vec<usize>, Vec<T>)> {
        let dataset = self.dataset(place)?;
        let shape = dataset.get_shape().map_err(while_reading(&self.path, place))?;
        let Some((&count, row)) = shape.split_first() else {
            return Err(self.damaged(place, "it is a single value"));
        };
        if count < range.end {
            return Err(self.damaged(place, &format!("it has {count} rows, but {} are required", range.end)));
        }
        // a forged shape must not allocate more memory than the file can fill
        let bytes = row.iter().fold(range.len() as u64, |b, &n| b.saturating_mul(n as u64));
        let bytes = bytes.saturating_mul(size_of::<T>() as u64);
        if bytes > self.length.saturating_mul(GREATEST_COMPRESSION) {
            return Err(self.damaged(place, "it claims to be larger than the file"));
        }
        let selection = rows(range.start, range.end, row);
        let values = dataset.read_slice::<T, _, ndarray::IxDyn>(selection).map_err(while_reading(&self.path, place))?;
        Ok((row.to_vec(), values.into_raw_vec_and_offset().0))
    }

    /// A whole dataset whose rows have `width` numbers.
    pub fn whole<T: H5Type>(&self, place: &str, width: usize) -> Result<Vec<T>> {
        let (row, values) = self.read(place, 0..self.count(place)?)?;
        if row.iter().product::<usize>() != width {
            return Err(self.damaged(place, "its rows have a different length"));
        }
        Ok(values)
    }

    /// A whole dataset of doubles that must have `expected` numbers.
    pub fn column(&self, place: &str, expected: usize) -> Result<Vec<f64>> {
        let (row, values) = self.read::<f64>(place, 0..self.count(place)?)?;
        if values.len() != expected {
            return Err(self.damaged(place, &format!("it has {} values instead of {expected}", values.len())));
        }
        sound::reals(&self.path, place, 0, row.iter().product(), &values)?;
        Ok(values)
    }

    /// A dataset of texts, whole.
    pub fn texts(&self, place: &str) -> Result<Vec<String>> {
        let dataset = self.dataset(place)?;
        if let Some(offset) = dataset.offset() {
            let held = self.texts.hold(offset, dataset.size().min(self.length as usize));
            if !held.map_err(|error| refused(&self.path)("read", error))? {
                return Err(self.damaged(place, "it refers to a text that does not exist"));
            }
        }
        let texts = dataset.read_raw::<VarLenUnicode>().map_err(while_reading(&self.path, place))?;
        Ok(texts.iter().map(ToString::to_string).collect())
    }

    pub fn scalar<T: H5Type>(&self, place: &str) -> Result<T> {
        self.dataset(place)?.read_scalar().map_err(while_reading(&self.path, place))
    }

    pub fn attribute<T: H5Type>(&self, place: &str, name: &str) -> Result<T> {
        let read = self.file.group(place).and_then(|group| group.attr(name)?.read_scalar());
        read.map_err(while_reading(&self.path, &format!("{place}@{name}")))
    }

    /// An optional attribute.
    pub fn optional_attribute<T: H5Type>(&self, place: &str, name: &str) -> Result<Option<T>> {
        let names = self.file.group(place).and_then(|group| group.attr_names());
        match names.map_err(while_reading(&self.path, place))?.iter().any(|found| found == name) {
            true => self.attribute(place, name).map(Some),
            false => Ok(None),
        }
    }

    pub fn coded<C: Coded>(&self, place: &str, codes: Vec<C::Code>, expected: usize) -> Result<Vec<C>> {
        let known: Option<Vec<C>> = codes.into_iter().map(C::from_code).collect();
        match known {
            Some(values) if values.len() == expected => Ok(values),
            Some(_) => Err(self.damaged(place, "it has a different length")),
            None => Err(self.damaged(place, "an unknown value")),
        }
    }

    /// The number of rows of a dataset.
    pub fn count(&self, place: &str) -> Result<usize> {
        let shape = self.dataset(place)?.get_shape().map_err(while_reading(&self.path, place))?;
        Ok(shape.first().copied().unwrap_or(0))
    }
}

/// Device and inode of the file at `path`.
pub(super) fn identity(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().map(|file| (file.dev(), file.ino()))
}

/// Length of the file, and whether it is marked as still being written. Rejects files that are not
/// HDF5 and truncated files.
///
/// HDF5 itself reads zeros beyond the end of a file that was never closed, so this function checks
/// the end.
fn check_superblock(path: &Path) -> Result<(u64, bool)> {
    let io = |error| refused(path)("read", error);
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => HistoryError::Missing { path: path.into() },
        _ => io(error),
    })?;
    if !metadata.is_dir() && !metadata.is_file() {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is no regular file")));
    }
    if metadata.is_dir() {
        return Err(io(std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a folder: give the .h5 file")));
    }
    let mut head = Vec::new();
    fs::File::open(path).and_then(|file| file.take(48).read_to_end(&mut head)).map_err(io)?;
    const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
    let found = metadata.len();
    if !head.starts_with(&SIGNATURE[..head.len().min(8)]) || head.is_empty() {
        return Err(HistoryError::NotHdf5 { path: path.into() });
    }
    if head.len() < 48 {
        return Err(HistoryError::Truncated { path: path.into(), found, expected: 48 });
    }
    // this program writes only version 3; HDF5 checks the others
    let (version, sizes, flags) = (head[8], head[9], head[11]);
    if version != 3 || sizes != 8 {
        return Ok((found, false));
    }
    let expected = end_of_file(&head);
    if found < expected {
        return Err(HistoryError::Truncated { path: path.into(), found, expected });
    }
    Ok((found, flags != 0))
}

/// The end of the file that a superblock of version 3 names (bytes).
pub(super) fn end_of_file(superblock: &[u8]) -> u64 {
    u64::from_le_bytes(superblock[28..36].try_into().unwrap_or_default())
}

/// Opens a history that may be open-ended: one that is being written, or was never closed.
pub(super) fn open_file(path: &Path, open_ended: bool) -> Result<File> {
    let mode = if open_ended { OpenMode::ReadSWMR } else { OpenMode::Read };
    let opened = File::with_options().with_fapl(|fapl| fapl.metadata_read_attempts(READ_ATTEMPTS)).open_as(path, mode);
    opened.map_err(|error| {
        let path = path.into();
        if error.contains_minor(hdf5::MinorErrorCode::NotHdf5) {
            return HistoryError::NotHdf5 { path };
        }
        if error.contains_minor(hdf5::MinorErrorCode::CantLockFile) {
            return HistoryError::Locked { path };
        }
        HistoryError::Damaged { path, place: String::new(), why: reason(&error) }
    })
}

fn check_identity(path: &Path, file: &File) -> Result<()> {
    let foreign = |why: String| HistoryError::Foreign { path: path.into(), why };
    let group = |name: &str| {
        if file.link_exists(name) { file.group(name).ok() } else { None }
    };
    let creator = group("h5md")
        .filter(|h5md| h5md.link_exists("creator"))
        .and_then(|h5md| h5md.group("creator").ok()?.attr("name").ok()?.read_scalar::<VarLenUnicode>().ok());
    let version = group(path::PARAMETERS)
        .and_then(|parameters| parameters.attr("schema_version").ok()?.read_scalar::<u32>().ok());
    match (creator, version) {
        (Some(name), _) if name.as_str() != CREATOR => Err(foreign(format!("it was written by {name:?}"))),
        (Some(_), Some(found)) if found > SCHEMA_VERSION => {
            Err(HistoryError::Newer { path: path.into(), found, known: SCHEMA_VERSION })
        }
        (Some(_), Some(_)) => Ok(()),
        _ => Err(foreign("it has no /h5md/creator or no /parameters schema_version".into())),
    }
}
