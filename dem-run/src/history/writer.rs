//! Writing a history while the run goes on.

use std::path::{Path, PathBuf};

use hdf5::File;

use super::codes::{BondCode, Coded};
use super::create::{self, Column, Commit, ContactTables, Observables, check_length};
use super::error::{HistoryError, Result, while_writing};
use super::schema::{RuptureRow, path};
use super::table::{Growth, Table};
use super::{Frame, Layout, Rupture};

/// Steps of observables, and ruptures, that are held in memory before they are appended.
const BLOCK: usize = 256;

/// An open history. Memory does not grow with the length of the run.
///
/// ```no_run
/// # use dem_run::history::*;
/// # fn run(layout: &Layout, frame: &Frame, last: &Frame) -> Result<()> {
/// let mut writer = Writer::create("run.h5".as_ref(), layout, false)?;
/// writer.frame(frame)?;
/// writer.observe(1, 1e-4, &[0.0])?; // at every step
/// writer.frame(last)?; // what was observed becomes visible with the next frame
/// writer.finish()
/// # }
/// ```
pub struct Writer {
    path: PathBuf,
    dimension: usize,
    bonds: usize,
    step: Table,
    time: Table,
    frame_columns: Vec<Column>,
    bond_status: Option<Table>,
    contacts: ContactTables,
    ruptures: Option<Table>,
    rupture_block: Vec<RuptureRow>,
    observables: Observables,
    commit: Commit,
    // last, so that it closes after every dataset
    file: File,
}

impl Writer {
    /// Creates the file with everything that it will hold, ready for the first frame.
    ///
    /// The file is made beside `path` and moved there when it is complete, so that a failure leaves nothing behind and
    /// does not harm a file that stood there.
    ///
    /// # Errors
    /// [`HistoryError::Exists`] where `path` stands and `overwrite` is false; [`HistoryError::Io`] and
    /// [`HistoryError::Write`] where the file cannot be made; [`HistoryError::Shape`] where `layout` contradicts itself.
    pub fn create(path: &Path, layout: &Layout, overwrite: bool) -> Result<Self> {
        hdf5::silence_errors(true);
        check_layout(layout)?;
        if path.exists() && !overwrite {
            return Err(HistoryError::Exists { path: path.into() });
        }
        let io = |doing| move |source| HistoryError::Io { path: path.into(), doing, source };
        let part = partial(path).map_err(io("create"))?;
        // HDF5 would not say why; the operating system does
        std::fs::File::create(&part).map_err(io("create"))?;
        let made = Self::build(path, &part, layout)
            .map_err(while_writing(path))
            .and_then(|writer| std::fs::rename(&part, path).map_err(io("replace")).map(|()| writer));
        if made.is_err() {
            // the first error is the one to report
            let _ = std::fs::remove_file(&part);
        }
        made
    }

    fn build(path: &Path, part: &Path, layout: &Layout) -> hdf5::Result<Self> {
        let file = File::with_options().with_fapl(|fapl| fapl.libver_v110()).create(part)?;
        create::write_identity(&file, layout)?;
        let grains = create::grains(&file, layout)?;
        let motion = grains.create_group("position")?;
        let step = Table::create::<i64>(&motion, "step", "", &[], Growth::Frames)?;
        let time = Table::create::<f64>(&motion, "time", "s", &[], Growth::Frames)?;
        let mut frame_columns = create::grain_columns(&grains, &motion, layout)?;
        if !layout.walls.is_empty() {
            frame_columns.extend(create::wall_columns(&file, layout)?);
        }
        let bonded = !layout.bonds.is_empty();
        let bond_status = if bonded { Some(create::bonds(&file, &layout.bonds)?) } else { None };
        let contacts = create::contacts(&file, layout)?;
        let ruptures = if bonded {
            let events = file.create_group("events")?;
            Some(Table::create::<RuptureRow>(&events, "rupture", "", &[], Growth::Rows(128))?)
        } else {
            None
        };
        let observables = create::observables(&file, &layout.observables)?;
        let commit = create::commit(&file, bonded)?;
        file.flush()?;
        // from here on no object can be created, and the file is readable at any time
        file.start_swmr()?;
        Ok(Self {
            path: path.into(),
            dimension: layout.dimension,
            bonds: layout.bonds.len(),
            step,
            time,
            frame_columns,
            bond_status,
            contacts,
            ruptures,
            rupture_block: Vec::with_capacity(BLOCK),
            observables,
            commit,
            file,
        })
    }

    /// The dimension D of the layout.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Frames written so far.
    pub fn frames(&self) -> usize {
        self.step.rows()
    }

    /// Appends a frame, and with it makes everything visible that was observed and that broke before.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where an array does not fit the layout (nothing is written then);
    /// [`HistoryError::Write`] where the disk refuses.
    pub fn frame(&mut self, frame: &Frame) -> Result<()> {
        self.check_frame(frame)?;
        self.write_frame(frame).map_err(while_writing(&self.path))
    }

    /// Records a bond that broke; visible with the next frame.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where the layout has no bonds; [`HistoryError::Write`] where the disk refuses.
    pub fn rupture(&mut self, rupture: &Rupture) -> Result<()> {
        if self.ruptures.is_none() {
            return Err(HistoryError::Shape { place: path::RUPTURE.into(), found: 1, expected: 0 });
        }
        self.rupture_block.push(rupture.into());
        if self.rupture_block.len() >= BLOCK {
            self.append_ruptures().map_err(while_writing(&self.path))?;
        }
        Ok(())
    }

    /// Records the observables of one step, one after another in the order of the layout; visible with the next frame.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where `values` has another length; [`HistoryError::Write`] where the disk refuses.
    pub fn observe(&mut self, step: i64, time: f64, values: &[f64]) -> Result<()> {
        let observables = &mut self.observables;
        check_length(path::OBSERVABLES, values.len(), observables.width())?;
        observables.push(step, time, values);
        if observables.steps.len() >= BLOCK {
            observables.append().map_err(while_writing(&self.path))?;
        }
        Ok(())
    }

    /// Closes the file; afterwards it opens like any HDF5 file. What was observed after the last frame stays out of
    /// sight, so write the last state as a frame first.
    ///
    /// # Errors
    /// [`HistoryError::Write`] where the disk refuses.
    pub fn finish(mut self) -> Result<()> {
        let path = self.path.clone();
        let flushed = self.observables.append().and_then(|()| self.append_ruptures()).and_then(|()| self.file.flush());
        flushed.map_err(while_writing(&path))
    }

    fn check_frame(&self, frame: &Frame) -> Result<()> {
        let contacts = frame.contacts;
        let m = contacts.len();
        for column in &self.frame_columns {
            column.check(frame, 1)?;
        }
        for column in &self.contacts.columns {
            column.check(frame, m)?;
        }
        check_length("contacts/status", contacts.status.len(), m)?;
        if self.contacts.bond.is_some() {
            check_length("contacts/bond", contacts.bond.len(), m)?;
        }
        check_length("bonds/status", frame.bonds.len(), self.bonds)
    }

    fn write_frame(&mut self, frame: &Frame) -> hdf5::Result<()> {
        self.step.append(&[frame.step])?;
        self.time.append(&[frame.time])?;
        for column in &mut self.frame_columns {
            column.append(frame)?;
        }
        if let Some(status) = &mut self.bond_status {
            let codes: Vec<BondCode> = frame.bonds.iter().map(|bond| bond.code()).collect();
            status.append(&codes)?;
        }
        self.contacts.append(frame)?;
        self.observables.append()?;
        self.append_ruptures()?;
        self.commit.rows(self.contacts.pair.rows(), self.observables.step.rows(), self.ruptures.as_ref())?;
        // the data must stand on disk before the commit that vouches for it
        self.file.flush()?;
        self.commit.frames.write_scalar(&(self.step.rows() as u64))?;
        self.commit.frames.flush()
    }

    fn append_ruptures(&mut self) -> hdf5::Result<()> {
        if let Some(table) = &mut self.ruptures {
            table.append(&self.rupture_block)?;
            self.rupture_block.clear();
        }
        Ok(())
    }
}

fn check_layout(layout: &Layout) -> Result<()> {
    let (grains, bonds) = (&layout.grains, &layout.bonds);
    let n = grains.id.len();
    check_length("dimension", layout.dimension, layout.dimension.clamp(2, 3))?;
    check_length("particles/grains/id", n, n.max(1))?;
    check_length("particles/grains/radius", grains.radius.len(), n)?;
    check_length("particles/grains/mass", grains.mass.len(), n)?;
    check_length("particles/grains/inertia", grains.inertia.len(), n)?;
    for (place, column) in [
        ("bonds/rest_gap", &bonds.rest_gap),
        ("bonds/strength", &bonds.strength),
        ("bonds/friction", &bonds.friction),
        ("bonds/mean_diameter", &bonds.mean_diameter),
    ] {
        check_length(place, column.len(), bonds.len())?;
    }
    for observable in &layout.observables {
        check_length(&format!("observables/{}", observable.name), observable.width(), observable.width().max(1))?;
    }
    Ok(())
}

/// The name under which a file is made: in the same folder, so that the move is atomic.
pub(crate) fn partial(path: &Path) -> std::io::Result<PathBuf> {
    let Some(name) = path.file_name().filter(|_| !path.is_dir()) else {
        return Err(std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a folder, give a file name"));
    };
    Ok(path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id())))
}
