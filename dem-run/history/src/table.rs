//! A dataset that grows by rows, and the small helpers that make and fill HDF5 objects.

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, Extent, Group, H5Type, Hyperslab, Location, SimpleExtents, SliceOrIndex};
use ndarray::ArrayViewD;

use super::schema::{frame_chunk, row_chunk};

/// How a table is chunked.
#[derive(Clone, Copy)]
pub(super) enum Growth {
    /// One row per frame.
    Frames,
    /// One row per frame, of one value for each bond: longer once a stage forms the bonds.
    Bonds,
    /// Many rows per frame; this many in a chunk.
    Rows(usize),
}

/// How tables are stored.
#[derive(Clone, Copy, Default)]
pub(super) struct Storage {
    /// Reals of frames in single precision.
    pub single: bool,
    /// Compressed, with checksums; for complete files.
    pub packed: bool,
}

/// A dataset whose first extent grows; `row` is the shape of the others.
pub(super) struct Table {
    dataset: Dataset,
    rows: usize,
    row: Vec<usize>,
}

/// Level of compression: higher levels take longer and save little.
const DEFLATE: u8 = 4;

impl Table {
    /// Creates an empty table of rows of shape `row`; `unit` is empty for plain numbers.
    pub fn create<T: H5Type>(
        group: &Group,
        name: &str,
        unit: &str,
        row: &[usize],
        growth: Growth,
        storage: Storage,
    ) -> hdf5::Result<Self> {
        let item = size_of::<T>();
        let chunk = match growth {
            Growth::Frames => frame_chunk(item, row),
            // their number is not known yet
            Growth::Bonds => vec![16, 512],
            Growth::Rows(rows) => row_chunk(rows, item, row),
        };
        let mut extents = vec![Extent::resizable(0)];
        let extent = if matches!(growth, Growth::Bonds) { Extent::resizable } else { Extent::fixed };
        extents.extend(row.iter().map(|&n| extent(n)));
        let builder = group.new_dataset::<T>();
        let builder = if storage.packed { builder.shuffle().deflate(DEFLATE).fletcher32() } else { builder };
        let dataset = builder.shape(SimpleExtents::from(extents)).chunk(chunk).obj_track_times(false).create(name)?;
        set_unit(&dataset, unit)?;
        Ok(Self { dataset, rows: 0, row: row.to_vec() })
    }

    /// Makes the rows of a table of bonds `width` long; the new values of earlier rows are zero.
    pub fn widen(&mut self, width: usize) -> hdf5::Result<()> {
        self.row = vec![width];
        self.dataset.resize(self.shape(self.rows))
    }

    /// Appends rows without values, of a table of bonds that have not formed.
    pub fn append_empty(&mut self, count: usize) -> hdf5::Result<()> {
        self.rows += count;
        self.dataset.resize(self.shape(self.rows))
    }

    /// A table of reals, in the precision of frames.
    pub fn reals(
        group: &Group,
        name: &str,
        unit: &str,
        row: &[usize],
        growth: Growth,
        storage: Storage,
    ) -> hdf5::Result<Self> {
        match storage.single {
            true => Self::create::<f32>(group, name, unit, row, growth, storage),
            false => Self::create::<f64>(group, name, unit, row, growth, storage),
        }
    }

    /// Its path in the file.
    pub fn place(&self) -> String {
        self.dataset.name().trim_start_matches('/').into()
    }

    /// Shape of one row.
    pub fn row(&self) -> &[usize] {
        &self.row
    }

    /// Bytes of one row in the file.
    pub fn row_bytes(&self) -> usize {
        self.width() * self.dataset.dtype().map_or(8, |dtype| dtype.size())
    }

    /// Overwrites the first rows with `values`; adds rows where needed.
    pub fn overwrite<T: H5Type>(&mut self, values: &[T]) -> hdf5::Result<()> {
        let count = values.len() / self.width();
        if count > self.rows {
            self.dataset.resize(self.shape(count))?;
            self.rows = count;
        }
        if count == 0 { Ok(()) } else { self.put(values, 0) }
    }

    /// Numbers in one row.
    pub fn width(&self) -> usize {
        self.row.iter().product()
    }

    /// Rows so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Appends whole rows.
    pub fn append<T: H5Type>(&mut self, values: &[T]) -> hdf5::Result<()> {
        let more = values.len() / self.width();
        if more == 0 {
            return Ok(());
        }
        let start = self.rows;
        self.dataset.resize(self.shape(start + more))?;
        self.put(values, start)?;
        self.rows = start + more;
        Ok(())
    }

    fn shape(&self, rows: usize) -> Vec<usize> {
        std::iter::once(rows).chain(self.row.iter().copied()).collect()
    }

    fn put<T: H5Type>(&self, values: &[T], start: usize) -> hdf5::Result<()> {
        let count = values.len() / self.width();
        let view = ArrayViewD::from_shape(self.shape(count), values)
            .map_err(|error| hdf5::Error::Internal(error.to_string()))?;
        self.dataset.write_slice(view, rows(start, start + count, &self.row))
    }
}

/// Selects rows `start..end`, each of shape `row`.
pub(super) fn rows(start: usize, end: usize, row: &[usize]) -> Hyperslab {
    let slices: Vec<SliceOrIndex> =
        std::iter::once(start..end).chain(row.iter().map(|&n| 0..n)).map(SliceOrIndex::from).collect();
    Hyperslab::from(slices)
}

/// Creates a fixed dataset of shape `shape` with its values.
pub(super) fn fixed<T: H5Type>(
    group: &Group,
    name: &str,
    unit: &str,
    shape: &[usize],
    values: &[T],
) -> hdf5::Result<()> {
    let view =
        ArrayViewD::from_shape(shape.to_vec(), values).map_err(|error| hdf5::Error::Internal(error.to_string()))?;
    let dataset = group.new_dataset_builder().with_data(view).obj_track_times(false).create(name)?;
    set_unit(&dataset, unit)
}

/// Text as HDF5 stores it; a NUL, which HDF5 cannot hold, becomes a blank.
pub(super) fn text(value: &str) -> VarLenUnicode {
    value.replace('\0', " ").parse().unwrap_or_default()
}

/// Gives `location` a text attribute.
pub(super) fn text_attribute(location: &Location, name: &str, value: &str) -> hdf5::Result<()> {
    location.new_attr::<VarLenUnicode>().create(name)?.write_scalar(&text(value))
}

fn set_unit(dataset: &Dataset, unit: &str) -> hdf5::Result<()> {
    if unit.is_empty() { Ok(()) } else { text_attribute(dataset, "unit", unit) }
}
