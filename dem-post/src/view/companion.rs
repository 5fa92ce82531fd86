//! An HDF5 file that maps data of a history by virtual datasets and external links with a relative
//! path.

use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use dem_history::HistoryError;
use hdf5::types::FixedAscii;
use hdf5::{Dataset, File, Group, H5Type, Hyperslab, SliceOrIndex};
use ndarray::{ArrayViewD, ShapeError};

/// In a virtual dataset, this name means the file that contains the dataset.
const ITSELF: &str = ".";

/// A companion while it is written.
pub(super) struct Companion<'a> {
    pub file: File,
    history: &'a File,
    /// Path of the history, relative to the companion.
    link: String,
}

/// One part of a virtual dataset: elements of a source and their destination, both in the order of
/// their rows.
pub(super) struct Piece {
    /// A dataset of the history, or of the companion if `in_companion`.
    pub place: &'static str,
    pub in_companion: bool,
    pub from: Vec<SliceOrIndex>,
    pub to: Vec<SliceOrIndex>,
}

/// The shape of an array for a viewer: rows of `width` numbers, of which the columns `filled` are
/// mapped and the others are zero. A width of one makes a list.
pub(super) struct Rows {
    pub count: usize,
    pub width: usize,
    pub filled: Range<usize>,
}

impl Rows {
    pub fn scalars(count: usize) -> Self {
        Self { count, width: 1, filled: 0..1 }
    }

    /// Vectors of `d` components, padded to three.
    pub fn vectors(count: usize, d: usize) -> Self {
        Self { count, width: 3, filled: 0..d }
    }
}

impl<'a> Companion<'a> {
    /// Makes the file at `path`.
    pub fn create(path: &Path, history: &'a File, link: &str) -> hdf5::Result<Self> {
        // the oldest format with virtual datasets
        let file = File::with_options().with_fapl(|fapl| fapl.libver_v110()).create(path)?;
        Ok(Self { file, history, link: link.into() })
    }

    /// Whether the history has this dataset.
    pub fn has(&self, place: &str) -> bool {
        self.history.link_exists(place)
    }

    /// The shape of a dataset of the history.
    pub fn shape(&self, place: &str) -> hdf5::Result<Vec<usize>> {
        Ok(self.history.dataset(place)?.shape())
    }

    /// A link to a whole dataset of the history.
    pub fn link(&self, group: &Group, name: &str, place: &str) -> hdf5::Result<()> {
        group.link_external(&self.link, place, name)
    }

    /// A link to the first `rows` rows of a series; to the whole series if it has no more.
    ///
    /// Without the history a link is an error; a virtual dataset would read as zeros.
    pub fn series<T: H5Type>(&self, group: &Group, name: &str, place: &'static str, rows: usize) -> hdf5::Result<()> {
        // VTK writes out of bounds if there are more times than steps
        if self.shape(place)? == [rows] {
            return self.link(group, name, place);
        }
        self.array::<T>(group, name, place, first(&[rows]), &Rows::scalars(rows))
    }

    /// A dataset of shape `shape` made of `pieces`; elements outside them are zero.
    pub fn map<T: H5Type>(&self, group: &Group, name: &str, shape: &[usize], pieces: &[Piece]) -> hdf5::Result<()> {
        let mut builder = group.new_dataset::<T>().shape(shape);
        for piece in pieces {
            let (source, file) = if piece.in_companion { (&self.file, ITSELF) } else { (self.history, &*self.link) };
            let extents = source.dataset(piece.place)?.shape();
            let [from, to] = [&piece.from, &piece.to].map(|slices| Hyperslab::from(slices.clone()));
            // HDF5 would replace %b in this name by a number
            let file = file.replace('%', "%%");
            builder = builder.virtual_map(file, format!("/{}", piece.place), extents, from, shape, to);
        }
        builder.create(name)?;
        Ok(())
    }

    /// An array of the elements `from` of a dataset of the history.
    pub fn array<T: H5Type>(
        &self,
        group: &Group,
        name: &str,
        place: &'static str,
        from: Vec<SliceOrIndex>,
        rows: &Rows,
    ) -> hdf5::Result<()> {
        let axes = if rows.width == 1 { 1 } else { 2 };
        let to = [span(0..rows.count), span(rows.filled.clone())][..axes].to_vec();
        self.map::<T>(group, name, &[rows.count, rows.width][..axes], &[Piece { place, in_companion: false, from, to }])
    }

    /// Writes an array out.
    pub fn write<T: H5Type>(&self, group: &Group, name: &str, shape: &[usize], values: &[T]) -> hdf5::Result<()> {
        let view = ArrayViewD::from_shape(shape, values).map_err(wrong_shape)?;
        group.new_dataset_builder().with_data(view).create(name)?;
        Ok(())
    }
}

/// What can go wrong: the history cannot be read, or the companion not written.
#[derive(Debug)]
pub(super) enum Fault {
    Reading(HistoryError),
    Writing(hdf5::Error),
}

impl From<HistoryError> for Fault {
    fn from(error: HistoryError) -> Self {
        Self::Reading(error)
    }
}

impl From<hdf5::Error> for Fault {
    fn from(error: hdf5::Error) -> Self {
        Self::Writing(error)
    }
}

/// The HDF5 error for an array whose length does not match its shape.
pub(super) fn wrong_shape(error: ShapeError) -> hdf5::Error {
    hdf5::Error::Internal(error.to_string())
}

/// Elements `range` of an axis.
pub(super) fn span(range: Range<usize>) -> SliceOrIndex {
    SliceOrIndex::SliceCount { start: range.start, step: 1, count: range.len(), block: 1 }
}

/// The first elements of all axes.
pub(super) fn first(extents: &[usize]) -> Vec<SliceOrIndex> {
    extents.iter().map(|&n| span(0..n)).collect()
}

/// `count` blocks of `block` elements, the first at `start`, `step` apart.
pub(super) fn blocks(start: usize, step: usize, count: usize, block: usize) -> SliceOrIndex {
    SliceOrIndex::SliceCount { start, step, count, block }
}

/// Appends to a list that grows.
pub(super) fn append<T: H5Type>(list: &Dataset, values: &[T]) -> hdf5::Result<()> {
    let start = list.size();
    list.resize([start + values.len()])?;
    list.write_slice(values, Hyperslab::from(vec![span(start..start + values.len())]))
}

/// Gives a group a text attribute of fixed length, the only kind that every VTK reads.
pub(super) fn label(group: &Group, name: &str, text: &str) -> hdf5::Result<()> {
    let text = FixedAscii::<8>::from_ascii(text).map_err(|error| hdf5::Error::Internal(error.to_string()))?;
    group.new_attr::<FixedAscii<8>>().create(name)?.write_scalar(&text)
}

/// Path of `file` relative to `folder`. Both must be absolute.
pub(super) fn relative(folder: &Path, file: &Path) -> PathBuf {
    let (from, to): (Vec<Component>, Vec<Component>) = (folder.components().collect(), file.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    from[common..].iter().map(|_| Component::ParentDir).chain(to[common..].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_from_the_folder_to_the_file() {
        for (folder, file, expected) in [
            ("/a/b", "/a/b/c.h5", "c.h5"),
            ("/a/b/post", "/a/b/c.h5", "../c.h5"),
            ("/a/x/y", "/a/b/c.h5", "../../b/c.h5"),
        ] {
            assert_eq!(relative(Path::new(folder), Path::new(file)), Path::new(expected));
        }
    }
}
