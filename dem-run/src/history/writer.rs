//! Writing a history while the run goes on.

use std::path::{Path, PathBuf};

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, File, Group};

use super::codes::{BondCode, Coded, ContactCode, WallDriveCode, WallKindCode};
use super::error::{HistoryError, Result, while_writing};
use super::schema::{CREATOR, RuptureRow, SCHEMA_VERSION, path};
use super::table::{Growth, Table, fixed, text, text_attribute};
use super::{Bonds, Frame, Layout, Observable, Rupture, Wall};

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

/// A table of doubles and where a frame keeps its values.
struct Column {
    place: &'static str,
    table: Table,
    take: for<'a> fn(&Frame<'a>) -> &'a [f64],
}

impl Column {
    fn check(&self, frame: &Frame, rows: usize) -> Result<()> {
        check_length(
            self.place,
            (self.take)(frame).len(),
            rows * self.table.width(),
        )
    }

    fn append(&mut self, frame: &Frame) -> hdf5::Result<()> {
        self.table.append((self.take)(frame))
    }
}

struct ContactTables {
    start: Table,
    count: Table,
    pair: Table,
    status: Table,
    bond: Option<Table>,
    columns: Vec<Column>,
}

struct Observables {
    step: Table,
    time: Table,
    values: Vec<Table>,
    steps: Vec<i64>,
    times: Vec<f64>,
    blocks: Vec<Vec<f64>>,
}

struct Commit {
    frames: Dataset,
    contacts: Table,
    steps: Table,
    events: Option<Table>,
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
        let part = partial(path)?;
        let io = |doing| {
            move |source| HistoryError::Io {
                path: path.into(),
                doing,
                source,
            }
        };
        // HDF5 would not say why; the operating system does
        std::fs::File::create(&part).map_err(io("create"))?;
        let made = Self::build(path, &part, layout)
            .map_err(while_writing(path))
            .and_then(|writer| {
                std::fs::rename(&part, path)
                    .map_err(io("replace"))
                    .map(|()| writer)
            });
        if made.is_err() {
            // the first error is the one to report
            let _ = std::fs::remove_file(&part);
        }
        made
    }

    fn build(path: &Path, part: &Path, layout: &Layout) -> hdf5::Result<Self> {
        let file = File::with_options()
            .with_fapl(|fapl| fapl.libver_v110())
            .create(part)?;
        write_identity(&file, layout)?;
        let grains = create_grains(&file, layout)?;
        let motion = grains.create_group("position")?;
        let step = Table::create::<i64>(&motion, "step", "", &[], Growth::Frames)?;
        let time = Table::create::<f64>(&motion, "time", "s", &[], Growth::Frames)?;
        let mut frame_columns = grain_columns(&grains, &motion, layout)?;
        if !layout.walls.is_empty() {
            frame_columns.extend(wall_columns(&file, layout)?);
        }
        let bonded = !layout.bonds.is_empty();
        let bond_status = if bonded {
            Some(create_bonds(&file, &layout.bonds)?)
        } else {
            None
        };
        let contacts = create_contacts(&file, layout)?;
        let ruptures = if bonded {
            let events = file.create_group("events")?;
            Some(Table::create::<RuptureRow>(
                &events,
                "rupture",
                "",
                &[],
                Growth::Rows(128),
            )?)
        } else {
            None
        };
        let observables = create_observables(&file, &layout.observables)?;
        let commit = create_commit(&file, bonded)?;
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
            return Err(HistoryError::Shape {
                place: path::RUPTURE.into(),
                found: 1,
                expected: 0,
            });
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
        let flushed = self
            .observables
            .append()
            .and_then(|()| self.append_ruptures())
            .and_then(|()| self.file.flush());
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
        self.commit.rows(
            self.contacts.pair.rows(),
            self.observables.step.rows(),
            self.ruptures.as_ref(),
        )?;
        // the data must stand on disk before the commit that vouches for it
        self.file.flush()?;
        self.commit
            .frames
            .write_scalar(&(self.step.rows() as u64))?;
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

impl ContactTables {
    fn append(&mut self, frame: &Frame) -> hdf5::Result<()> {
        let contacts = frame.contacts;
        self.start.append(&[self.pair.rows() as u64])?;
        self.count.append(&[contacts.len() as u32])?;
        self.pair.append(contacts.pair.as_flattened())?;
        for column in &mut self.columns {
            column.append(frame)?;
        }
        let codes: Vec<ContactCode> = contacts.status.iter().map(|status| status.code()).collect();
        self.status.append(&codes)?;
        match &mut self.bond {
            Some(bond) => bond.append(&contacts.bond),
            None => Ok(()),
        }
    }
}

impl Observables {
    fn width(&self) -> usize {
        self.values.iter().map(Table::width).sum()
    }

    fn push(&mut self, step: i64, time: f64, mut values: &[f64]) {
        self.steps.push(step);
        self.times.push(time);
        for (table, block) in self.values.iter().zip(&mut self.blocks) {
            let (value, rest) = values.split_at(table.width());
            block.extend(value);
            values = rest;
        }
    }

    fn append(&mut self) -> hdf5::Result<()> {
        self.step.append(&self.steps)?;
        self.time.append(&self.times)?;
        self.steps.clear();
        self.times.clear();
        for (table, block) in self.values.iter_mut().zip(&mut self.blocks) {
            table.append(block)?;
            block.clear();
        }
        Ok(())
    }
}

impl Commit {
    fn rows(&mut self, contacts: usize, steps: usize, events: Option<&Table>) -> hdf5::Result<()> {
        self.contacts.append(&[contacts as u64])?;
        self.steps.append(&[steps as u64])?;
        match (&mut self.events, events) {
            (Some(table), Some(events)) => table.append(&[events.rows() as u64]),
            _ => Ok(()),
        }
    }
}

fn check_length(place: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        Ok(())
    } else {
        Err(HistoryError::Shape {
            place: place.into(),
            found,
            expected,
        })
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
        check_length(
            &format!("observables/{}", observable.name),
            observable.width(),
            observable.width().max(1),
        )?;
    }
    Ok(())
}

/// The name under which the file is made: in the same folder, so that the move is atomic.
fn partial(path: &Path) -> Result<PathBuf> {
    let Some(name) = path.file_name().filter(|_| !path.is_dir()) else {
        let source = std::io::Error::new(
            std::io::ErrorKind::IsADirectory,
            "it is a folder, give a file name",
        );
        return Err(HistoryError::Io {
            path: path.into(),
            doing: "create",
            source,
        });
    };
    Ok(path.with_file_name(format!(
        ".{}.{}.part",
        name.to_string_lossy(),
        std::process::id()
    )))
}

fn write_identity(file: &File, layout: &Layout) -> hdf5::Result<()> {
    let run = &layout.parameters;
    let h5md = file.create_group("h5md")?;
    h5md.new_attr_builder()
        .with_data(&[1i32, 1])
        .create("version")?;
    let author = h5md.create_group("author")?;
    text_attribute(&author, "name", CREATOR)?;
    let creator = h5md.create_group("creator")?;
    text_attribute(&creator, "name", CREATOR)?;
    text_attribute(&creator, "version", &run.version)?;

    let parameters = file.create_group(path::PARAMETERS)?;
    parameters
        .new_attr::<u32>()
        .create("schema_version")?
        .write_scalar(&SCHEMA_VERSION)?;
    parameters
        .new_attr::<u64>()
        .create("seed")?
        .write_scalar(&run.seed)?;
    for (name, value) in [
        ("version", &run.version),
        ("git_revision", &run.git_revision),
        ("build", &run.build),
        ("host", &run.host),
        ("start", &run.start),
    ] {
        text_attribute(&parameters, name, value)?;
    }
    let scene = file
        .new_dataset::<VarLenUnicode>()
        .obj_track_times(false)
        .create(path::SCENE)?;
    scene.write_scalar(&text(&run.scene))
}

fn create_grains(file: &File, layout: &Layout) -> hdf5::Result<Group> {
    let group = file.create_group("particles")?.create_group("grains")?;
    let cell = group.create_group("box")?;
    cell.new_attr::<i32>()
        .create("dimension")?
        .write_scalar(&(layout.dimension as i32))?;
    cell.new_attr_builder()
        .with_data(&vec![text("none"); layout.dimension])
        .create("boundary")?;
    let grains = &layout.grains;
    let n = [grains.id.len()];
    fixed(&group, "id", "", &n, &grains.id)?;
    fixed(&group, "radius", "m", &n, &grains.radius)?;
    fixed(&group, "mass", "kg", &n, &grains.mass)?;
    fixed(&group, "inertia", "kg m2", &n, &grains.inertia)?;
    Ok(group)
}

/// Makes the group of an H5MD element whose steps and times are those of every frame.
fn element(parent: &Group, name: &str) -> hdf5::Result<Group> {
    let group = parent.create_group(name)?;
    link_times(&group)?;
    Ok(group)
}

fn link_times(group: &Group) -> hdf5::Result<()> {
    for name in ["step", "time"] {
        group.link_hard(&format!("/{}/position/{name}", path::GRAINS), name)?;
    }
    Ok(())
}

fn grain_columns(grains: &Group, motion: &Group, layout: &Layout) -> hdf5::Result<Vec<Column>> {
    let (n, d) = (layout.grains.id.len(), layout.dimension);
    let column = |place, group: &Group, unit, row: &[usize], take| -> hdf5::Result<Column> {
        Ok(Column {
            place,
            table: Table::create::<f64>(group, "value", unit, row, Growth::Frames)?,
            take,
        })
    };
    let mut columns = vec![
        column("particles/grains/position", motion, "m", &[n, d], |f| {
            &f.grains.position
        })?,
        column(
            "particles/grains/velocity",
            &element(grains, "velocity")?,
            "m s-1",
            &[n, d],
            |f| &f.grains.velocity,
        )?,
    ];
    if layout.rotation {
        let spins: &[usize] = if d == 2 { &[n] } else { &[n, 3] };
        let spin = element(grains, "angular_velocity")?;
        columns.push(column(
            "particles/grains/angular_velocity",
            &spin,
            "rad s-1",
            spins,
            |f| &f.grains.angular_velocity,
        )?);
        let (name, unit, row): (_, _, &[usize]) = if d == 2 {
            ("angle", "rad", &[n])
        } else {
            ("orientation", "", &[n, 4])
        };
        let group = element(grains, name)?;
        columns.push(column(
            "particles/grains/orientation",
            &group,
            unit,
            row,
            |f| &f.grains.orientation,
        )?);
    }
    Ok(columns)
}

fn wall_columns(file: &File, layout: &Layout) -> hdf5::Result<Vec<Column>> {
    let (walls, d) = (&layout.walls, layout.dimension);
    let (w, group) = (walls.len(), file.create_group(path::WALLS)?);
    let vectors = |take: fn(&Wall) -> &[f64; 3]| -> Vec<f64> {
        walls
            .iter()
            .flat_map(|wall| take(wall)[..d].iter().copied())
            .collect()
    };
    let names: Vec<VarLenUnicode> = walls.iter().map(|wall| text(&wall.name)).collect();
    fixed(&group, "name", "", &[w], &names)?;
    let kinds: Vec<WallKindCode> = walls.iter().map(|wall| wall.kind.code()).collect();
    fixed(&group, "kind", "", &[w], &kinds)?;
    let drives: Vec<WallDriveCode> = walls.iter().map(|wall| wall.drive.code()).collect();
    fixed(&group, "drive", "", &[w], &drives)?;
    fixed(&group, "normal", "", &[w, d], &vectors(|wall| &wall.normal))?;
    fixed(
        &group,
        "direction",
        "",
        &[w, d],
        &vectors(|wall| &wall.direction),
    )?;
    let radii: Vec<f64> = walls.iter().map(|wall| wall.radius).collect();
    fixed(&group, "radius", "m", &[w], &radii)?;

    let column = |place, name, unit, take| -> hdf5::Result<Column> {
        let table = Table::create::<f64>(
            &element(&group, name)?,
            "value",
            unit,
            &[w, d],
            Growth::Frames,
        )?;
        Ok(Column { place, table, take })
    };
    Ok(vec![
        column("walls/position", "position", "m", |f| &f.walls.position)?,
        column("walls/velocity", "velocity", "m s-1", |f| &f.walls.velocity)?,
        column("walls/force", "force", "N", |f| &f.walls.force)?,
    ])
}

fn create_bonds(file: &File, bonds: &Bonds) -> hdf5::Result<Table> {
    let (b, group) = (bonds.len(), file.create_group(path::BONDS)?);
    fixed(&group, "pair", "", &[b, 2], bonds.pair.as_flattened())?;
    fixed(&group, "rest_gap", "m", &[b], &bonds.rest_gap)?;
    fixed(&group, "strength", "N", &[b], &bonds.strength)?;
    fixed(&group, "friction", "", &[b], &bonds.friction)?;
    fixed(&group, "mean_diameter", "m", &[b], &bonds.mean_diameter)?;
    Table::create::<BondCode>(
        &element(&group, "status")?,
        "value",
        "",
        &[b],
        Growth::Frames,
    )
}

fn create_contacts(file: &File, layout: &Layout) -> hdf5::Result<ContactTables> {
    let (d, bonded) = (layout.dimension, !layout.bonds.is_empty());
    let group = file.create_group(path::CONTACTS)?;
    link_times(&group)?;
    // a dense packing has two to three contacts a grain
    let growth = Growth::Rows(16 * 3 * layout.grains.id.len());
    let column = |place, name, unit, row: &[usize], take| -> hdf5::Result<Column> {
        Ok(Column {
            place,
            table: Table::create::<f64>(&group, name, unit, row, growth)?,
            take,
        })
    };
    // a bond has tangential rows whatever its friction
    let tangential = layout.friction || bonded;
    let reaction_rows = if tangential { d } else { 1 };
    let mut columns = vec![
        column("contacts/point", "point", "m", &[d], |f| &f.contacts.point)?,
        column("contacts/normal", "normal", "", &[d], |f| {
            &f.contacts.normal
        })?,
        column(
            "contacts/reaction",
            "reaction",
            "N",
            &[reaction_rows],
            |f| &f.contacts.reaction,
        )?,
        column("contacts/gap", "gap", "m", &[], |f| &f.contacts.gap)?,
    ];
    let reaction = group.dataset("reaction")?;
    text_attribute(&reaction, "frame", "local")?;
    if d == 3 && tangential {
        columns.push(column("contacts/tangent", "tangent", "", &[d], |f| {
            &f.contacts.tangent
        })?);
    }
    if bonded {
        let row: &[usize] = if d == 2 { &[] } else { &[2] };
        columns.push(column("contacts/moment", "moment", "N m", row, |f| {
            &f.contacts.moment
        })?);
    }
    Ok(ContactTables {
        start: Table::create::<u64>(&group, "start", "", &[], Growth::Frames)?,
        count: Table::create::<u32>(&group, "count", "", &[], Growth::Frames)?,
        pair: Table::create::<i32>(&group, "pair", "", &[2], growth)?,
        status: Table::create::<ContactCode>(&group, "status", "", &[], growth)?,
        bond: if bonded {
            Some(Table::create::<i32>(&group, "bond", "", &[], growth)?)
        } else {
            None
        },
        columns,
    })
}

fn create_observables(file: &File, observables: &[Observable]) -> hdf5::Result<Observables> {
    let parent = file.create_group(path::OBSERVABLES)?;
    let growth = Growth::Rows(1024);
    let step = Table::create::<i64>(&parent, "step", "", &[], growth)?;
    let time = Table::create::<f64>(&parent, "time", "s", &[], growth)?;
    let mut values = Vec::with_capacity(observables.len());
    for observable in observables {
        let group = parent.create_group(&observable.name)?;
        for name in ["step", "time"] {
            group.link_hard(&format!("/{}/{name}", path::OBSERVABLES), name)?;
        }
        values.push(Table::create::<f64>(
            &group,
            "value",
            &observable.unit,
            &observable.shape,
            growth,
        )?);
    }
    Ok(Observables {
        step,
        time,
        blocks: vec![Vec::new(); values.len()],
        values,
        steps: vec![],
        times: vec![],
    })
}

fn create_commit(file: &File, bonded: bool) -> hdf5::Result<Commit> {
    let frames = file
        .new_dataset::<u64>()
        .obj_track_times(false)
        .create(path::COMMIT)?;
    frames.write_scalar(&0u64)?;
    let group = file.create_group("commit_rows")?;
    let table = |name| Table::create::<u64>(&group, name, "", &[], Growth::Frames);
    Ok(Commit {
        frames,
        contacts: table("contacts")?,
        steps: table("steps")?,
        events: if bonded { Some(table("events")?) } else { None },
    })
}
