//! Writing a history during the run.

use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use hdf5::{Dataset, File};

use dem_output::replace::{replace_synced, sync};

use super::checkpoint::{Checkpoint, Slots};
use super::codes::{BondCode, Coded};
use super::create::{self, BondTables, Column, Commit, ContactTables, Observables, check_length};
use super::ending::Ending;
use super::error::{HistoryError, Result, refused, while_writing};
use super::model::{Bonds, Frame, Layout, RowCounts, Rupture};
use super::reader::History;
use super::rupture::RuptureRow;
use super::schema::{chunk_cache, path};
use super::source::{Source, end_of_file, identity};
use super::table::{Growth, Storage, Table};
use super::visit::{Bytes, Copy, Share, Visit};
use super::{dimensions, lock};

/// Steps of observables, and ruptures, that are held in memory before they are appended.
const BLOCK: usize = 256;

/// An open history. Memory does not grow with the length of the run.
///
/// ```no_run
/// # use dem_history::*;
/// # fn run(layout: &Layout, frame: &Frame, last: &Frame) -> Result<()> {
/// let mut writer = Writer::create("run.h5".as_ref(), layout, false)?;
/// writer.frame(frame)?;
/// writer.observe(1, 1e-4, &[0.0])?; // at every step
/// writer.frame(last)?; // observations become visible with the next frame
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
    bond_tables: Option<BondTables>,
    contacts: ContactTables,
    ruptures: Option<Table>,
    rupture_block: Vec<RuptureRow>,
    observables: Observables,
    commit: Commit,
    ending: Dataset,
    slots: Slots,
    /// Device and inode of the open file: those of `path` differ once another file has its name.
    identity: Option<(u64, u64)>,
    /// The head of the file as of its last complete frame.
    head: Head,
    // declared last: the file closes after every dataset, and the lock is released after that
    file: File,
    lock: Option<std::fs::File>,
}

impl Writer {
    /// Creates the file with all its datasets, ready for the first frame.
    ///
    /// The file is made beside `path` and moved there when it is complete. A failure leaves no file
    /// behind and does not change an old file at `path`.
    ///
    /// # Errors
    /// [`HistoryError::Exists`] where `path` exists and `overwrite` is false;
    /// [`HistoryError::Busy`] while another process writes it; [`HistoryError::Io`] and
    /// [`HistoryError::Write`] where the file cannot be made; [`HistoryError::Shape`] where
    /// `layout` contradicts itself.
    pub fn create(path: &Path, layout: &Layout, overwrite: bool) -> Result<Self> {
        if path.exists() && !overwrite {
            return Err(HistoryError::Exists { path: path.into() });
        }
        Self::begin(path, layout, |_| Ok(()))
    }

    /// Continues `history` in the file at `path`, which may be the file of `history`. Only the rows
    /// `kept` and `checkpoint` are copied. `tell` receives the copied share, from 0 to 1; copying
    /// stops if it returns false.
    ///
    /// # Errors
    /// As [`Writer::create`]; [`HistoryError::Damaged`] where the history does not match `layout`.
    /// The file at `path` is then unchanged.
    pub fn go_on(
        path: &Path,
        layout: &Layout,
        history: &History,
        kept: RowCounts,
        checkpoint: &Checkpoint,
        tell: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Self> {
        // a copy that began now would put the old file back
        let mut source = None;
        Self::begin(path, layout, |writer| {
            source = lock::hold_while_read(history.path())?;
            let mut share = Share::of(writer.bytes(kept)?, tell);
            writer.take_over(history.source(), kept, &mut share)?;
            writer.checkpoint(checkpoint)
        })
    }

    /// Creates the file beside `path`, fills it with `fill`, switches to HDF5's single-writer mode
    /// and moves the file to `path`.
    fn begin(path: &Path, layout: &Layout, fill: impl FnOnce(&mut Self) -> Result<()>) -> Result<Self> {
        lock::refuse_busy(path)?;
        let failed = refused(path);
        replace_synced(path, &failed, |part| {
            let mut writer = Self::build(path, part, layout, false)?;
            fill(&mut writer)?;
            writer.flush()?;
            // from here on no object can be created, and the file is readable at any time
            writer.file.start_swmr().map_err(while_writing(path))?;
            sync(part).map_err(|error| failed("write", error))?;
            writer.lock = Some(lock::hold(part).map_err(|error| failed("lock", error))?);
            writer.keep_head().map_err(|error| failed("read", error))?;
            writer.identity = identity(part);
            Ok(writer)
        })
    }

    /// A file without readers until it is closed: compressed, with checksums, if `packed`.
    pub(super) fn closed_copy(path: &Path, layout: &Layout, packed: bool) -> Result<Self> {
        Self::build(path, path, layout, packed)
    }

    /// Bytes of the rows `kept` of all tables.
    pub(super) fn bytes(&mut self, kept: RowCounts) -> Result<u64> {
        let mut bytes = Bytes::default();
        self.visit(kept, &mut bytes)?;
        Ok(bytes.0)
    }

    /// Creates the file `part` with all datasets of the layout; errors name `path`.
    fn build(path: &Path, part: &Path, layout: &Layout, packed: bool) -> Result<Self> {
        hdf5::silence_errors(true);
        check_layout(layout)?;
        let storage = Storage { single: layout.single, packed };
        Self::fill(path, part, layout, storage).map_err(while_writing(path))
    }

    fn fill(path: &Path, part: &Path, layout: &Layout, storage: Storage) -> hdf5::Result<Self> {
        let (slots, bytes) = chunk_cache(layout.grains.id.len(), layout.dimension);
        let file =
            File::with_options().with_fapl(|fapl| fapl.libver_v110().chunk_cache(slots, bytes, 0.75)).create(part)?;
        create::write_identity(&file, layout)?;
        let grains = create::grains(&file, layout)?;
        let motion = grains.create_group("position")?;
        let frames = Growth::Frames;
        let step = Table::create::<i64>(&motion, "step", "", &[], frames, storage)?;
        let time = Table::create::<f64>(&motion, "time", "s", &[], frames, storage)?;
        let mut frame_columns = create::grain_columns(&grains, &motion, layout, storage)?;
        if !layout.walls.is_empty() {
            frame_columns.extend(create::wall_columns(&file, layout, storage)?);
        }
        let bonded = layout.bonded();
        let bond_tables = if bonded { Some(BondTables::create(&file, &layout.bonds, storage)?) } else { None };
        let contacts = create::contacts(&file, layout, storage)?;
        let ruptures = if bonded {
            let events = file.create_group("events")?;
            Some(Table::create::<RuptureRow>(&events, "rupture", "", &[], Growth::Rows(128), storage)?)
        } else {
            None
        };
        let observables = create::observables(&file, &layout.observables, storage)?;
        let commit = create::commit(&file, bonded, storage)?;
        let ending = create::ending(&file)?;
        let slots = Slots::create(&file, storage)?;
        dimensions::label(&file)?;
        Ok(Self {
            path: path.into(),
            dimension: layout.dimension,
            bonds: layout.bonds.len(),
            step,
            time,
            frame_columns,
            bond_tables,
            contacts,
            ruptures,
            rupture_block: Vec::with_capacity(BLOCK),
            observables,
            commit,
            ending,
            slots,
            identity: None,
            head: Head::default(),
            file,
            lock: None,
        })
    }

    /// Every table, with the number of its rows in `kept`.
    pub(super) fn visit(&mut self, kept: RowCounts, visit: &mut impl Visit) -> Result<()> {
        let frames = kept.frames;
        visit.table::<i64>(&mut self.step, frames)?;
        visit.table::<f64>(&mut self.time, frames)?;
        self.frame_columns.iter_mut().try_for_each(|column| column.visit(frames, visit))?;
        self.bond_tables.iter_mut().try_for_each(|bonds| visit.table::<BondCode>(&mut bonds.status, frames))?;
        self.contacts.visit(frames, kept.contacts, visit)?;
        self.ruptures.iter_mut().try_for_each(|table| visit.table::<RuptureRow>(table, kept.events))?;
        self.observables.visit(kept.steps, visit)?;
        self.commit.visit(frames, visit)
    }

    /// Copies the rows `kept` of `source` into the empty tables.
    pub(super) fn take_over(&mut self, source: &Source, kept: RowCounts, share: &mut Share) -> Result<()> {
        let path = self.path.clone();
        self.visit(kept, &mut Copy { source, to: &path, share })?;
        self.commit.frames.write_scalar(&(kept.frames as u64)).map_err(while_writing(&path))
    }

    /// Writes all buffered rows to the file.
    pub(super) fn flush(&self) -> Result<()> {
        self.file.flush().map_err(while_writing(&self.path))
    }

    /// Records the state from which the run can resume: that of the last frame written.
    ///
    /// # Errors
    /// [`HistoryError::Write`] where the disk refuses.
    pub fn checkpoint(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        let file = &self.file;
        self.slots.write(checkpoint, || file.flush()).map_err(while_writing(&self.path))
    }

    /// Records why the run ended.
    ///
    /// # Errors
    /// [`HistoryError::Write`] where the disk refuses.
    pub fn ending(&mut self, ending: Ending) -> Result<()> {
        self.ending.write_scalar(&ending.code()).map_err(while_writing(&self.path))
    }

    /// The dimension D of the layout.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Frames written so far.
    pub fn frames(&self) -> usize {
        self.step.rows()
    }

    /// Appends a frame and makes all earlier observations and ruptures visible.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where an array does not fit the layout and [`HistoryError::Gone`]
    /// where the file was moved or removed (nothing is written then); [`HistoryError::Write`] where
    /// the disk refuses.
    pub fn frame(&mut self, frame: &Frame) -> Result<()> {
        self.check_frame(frame)?;
        let is_there = || self.lock.as_ref().is_none_or(|file| self.head.is_of(file));
        if self.identity.is_some() && (identity(&self.path) != self.identity || !is_there()) {
            return Err(HistoryError::Gone { path: self.path.clone() });
        }
        self.write_frame(frame).map_err(while_writing(&self.path))?;
        self.keep_head().map_err(|error| refused(&self.path)("read", error))
    }

    /// Records the bonds that a stage formed after the step `bonds.formed`; later frames have them.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where the layout has no place for them, or has bonds already, or
    /// where the arrays differ in length; [`HistoryError::Write`] where the disk refuses.
    pub fn bonds_formed(&mut self, bonds: &Bonds) -> Result<()> {
        check_bonds(bonds)?;
        check_length(path::BONDS, self.bonds, 0)?;
        check_length("bonds/rolling", bonds.rolling.len(), bonds.len())?;
        let (Some(tables), Some(formed)) = (&mut self.bond_tables, bonds.formed) else {
            return Err(HistoryError::Shape { place: path::BONDS.into(), found: bonds.len(), expected: 0 });
        };
        self.bonds = bonds.len();
        let written = tables.fill(bonds, formed).and_then(|()| self.file.flush());
        written.map_err(while_writing(&self.path))
    }

    /// Records a bond that broke; visible with the next frame.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where the layout has no bonds; [`HistoryError::Write`] where the
    /// disk refuses.
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

    /// Records the observables of one step, one after another in the order of the layout; visible
    /// with the next frame.
    ///
    /// # Errors
    /// [`HistoryError::Shape`] where `values` has another length; [`HistoryError::Write`] where the
    /// disk refuses.
    pub fn observe(&mut self, step: i64, time: f64, values: &[f64]) -> Result<()> {
        let observables = &mut self.observables;
        check_length(path::OBSERVABLES, values.len(), observables.width())?;
        observables.push(step, time, values);
        if observables.steps.len() >= BLOCK {
            observables.append().map_err(while_writing(&self.path))?;
        }
        Ok(())
    }

    /// Closes the file; afterwards it opens like any HDF5 file. Observations after the last frame
    /// stay invisible, so write the last state as a frame first.
    ///
    /// # Errors
    /// [`HistoryError::Write`] where the disk refuses.
    pub fn finish(mut self) -> Result<()> {
        let path = self.path.clone();
        let flushed = self.observables.append().and_then(|()| self.append_ruptures()).and_then(|()| self.file.flush());
        if flushed.is_err() {
            self.abandon();
        }
        flushed.map_err(while_writing(&path))
    }

    /// Closes the file after an error and restores the superblock of its last complete frame. Later
    /// writes of HDF5 are then not part of the file; on a full disk they are incomplete.
    pub(super) fn abandon(mut self) {
        let (file, head) = (self.lock.take(), self.head);
        drop(self);
        if let Some(file) = file {
            // the first error is reported already
            let _ = head.put_back(&file);
        }
    }

    fn keep_head(&mut self) -> std::io::Result<()> {
        if let Some(file) = &self.lock {
            self.head = Head::of(file)?;
        }
        Ok(())
    }

    fn check_frame(&self, frame: &Frame) -> Result<()> {
        let contacts = &frame.contacts;
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
        match &mut self.bond_tables {
            Some(bonds) if self.bonds == 0 => bonds.status.append_empty(1)?,
            Some(bonds) => {
                let codes: Vec<BondCode> = frame.bonds.iter().map(|bond| bond.code()).collect();
                bonds.status.append(&codes)?;
            }
            None => {}
        }
        self.contacts.append(frame)?;
        self.observables.append()?;
        self.append_ruptures()?;
        self.commit.rows(self.contacts.pair.rows(), self.observables.step.rows(), self.ruptures.as_ref())?;
        // the data must be on disk before the commit that declares it complete
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

/// The superblock of a file: version 3, as this program writes it, with the address of the file's
/// end.
#[derive(Clone, Copy, Default)]
struct Head(Option<[u8; 48]>);

impl Head {
    fn of(file: &std::fs::File) -> std::io::Result<Self> {
        let mut bytes = [0; 48];
        file.read_exact_at(&mut bytes, 0)?;
        Ok(Self(Some(bytes)))
    }

    /// Whether it is the superblock of this file, which may have grown: another program may have
    /// emptied or overwritten it.
    fn is_of(self, file: &std::fs::File) -> bool {
        let (Some(before), Ok(Self(Some(now)))) = (self.0, Self::of(file)) else { return self.0.is_none() };
        before[..28] == now[..28] && before[36..44] == now[36..44] && end_of_file(&before) <= end_of_file(&now)
    }

    /// Writes the superblock back to a file that ends before the address it names.
    fn put_back(self, file: &std::fs::File) -> std::io::Result<()> {
        match (self.0, Self::of(file)?.0) {
            (Some(good), Some(found)) if file.metadata()?.len() < end_of_file(&found) => file.write_all_at(&good, 0),
            _ => Ok(()),
        }
    }
}

fn check_layout(layout: &Layout) -> Result<()> {
    let grains = &layout.grains;
    let n = grains.id.len();
    check_length("dimension", layout.dimension, layout.dimension.clamp(2, 3))?;
    check_length("particles/grains/id", n, n.max(1))?;
    check_length("particles/grains/radius", grains.radius.len(), n)?;
    check_length("particles/grains/mass", grains.mass.len(), n)?;
    check_length("particles/grains/inertia", grains.inertia.len(), n)?;
    if !grains.material.is_empty() || !layout.materials.is_empty() {
        check_length("particles/grains/material", grains.material.len(), n)?;
        let most = grains.material.iter().max().map_or(0, |most| usize::from(*most) + 1);
        check_length("materials/name", layout.materials.len(), layout.materials.len().max(most))?;
    }
    check_bonds(&layout.bonds)?;
    for observable in &layout.observables {
        check_length(&format!("observables/{}", observable.name), observable.width(), observable.width().max(1))?;
    }
    Ok(())
}

fn check_bonds(bonds: &Bonds) -> Result<()> {
    for (place, column) in [
        ("bonds/rest_gap", &bonds.rest_gap),
        ("bonds/strength", &bonds.strength),
        ("bonds/friction", &bonds.friction),
        ("bonds/mean_diameter", &bonds.mean_diameter),
    ] {
        check_length(place, column.len(), bonds.len())?;
    }
    if !bonds.rolling.is_empty() {
        check_length("bonds/rolling", bonds.rolling.len(), bonds.len())?;
    }
    if let Some(twist) = &bonds.twist {
        check_length("bonds/twist", twist.len(), bonds.len())?;
    }
    Ok(())
}
