//! The tables of a history: what each holds, how it is created and how it grows.

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, File, Group};

use super::codes::{BondCode, Coded, ContactCode, RouteCode, SolverRoute};
use super::ending::{Ending, EndingCode};
use super::error::{HistoryError, Result};
use super::model::{Bonds, Frame, Layout, Observable, ValueKind};
use super::schema::{CREATOR, FALSE_ACCELERATION, LOAD_ERROR, path};
use super::table::{Growth, Storage, Table, fixed, text, text_attribute};
use super::visit::Visit;
use super::wall::{WallColumn, WallDriveCode, WallKindCode};
use crate::SCHEMA_VERSION;

/// A table of doubles and where a frame keeps its values.
pub(super) struct Column {
    place: &'static str,
    table: Table,
    take: for<'a> fn(&'a Frame) -> &'a [f64],
}

impl Column {
    pub fn check(&self, frame: &Frame, rows: usize) -> Result<()> {
        check_length(self.place, (self.take)(frame).len(), rows * self.table.width())
    }

    pub fn append(&mut self, frame: &Frame) -> hdf5::Result<()> {
        self.table.append((self.take)(frame))
    }

    pub fn visit(&mut self, rows: usize, visit: &mut impl Visit) -> Result<()> {
        visit.table::<f64>(&mut self.table, rows)
    }
}

pub(super) struct ContactTables {
    start: Table,
    count: Table,
    pub pair: Table,
    status: Table,
    pub bond: Option<Table>,
    pub columns: Vec<Column>,
}

pub(super) struct Observables {
    pub step: Table,
    time: Table,
    values: Vec<Values>,
    pub steps: Vec<i64>,
    times: Vec<f64>,
}

/// The table of one observable, and the values not yet appended to it.
struct Values {
    table: Table,
    kind: ValueKind,
    block: Vec<f64>,
}

impl Values {
    fn append(&mut self) -> hdf5::Result<()> {
        match self.kind {
            ValueKind::Real => self.table.append(&self.block)?,
            ValueKind::Route => {
                let routes = self.block.iter().map(|number| SolverRoute::of_number(*number).map(SolverRoute::code));
                let codes: Option<Vec<RouteCode>> = routes.collect();
                self.table.append(&codes.ok_or("an observed route is none")?)?;
            }
        }
        self.block.clear();
        Ok(())
    }

    fn visit(&mut self, rows: usize, visit: &mut impl Visit) -> Result<()> {
        match self.kind {
            ValueKind::Real => visit.table::<f64>(&mut self.table, rows),
            ValueKind::Route => visit.table::<RouteCode>(&mut self.table, rows),
        }
    }
}

pub(super) struct Commit {
    pub frames: Dataset,
    contacts: Table,
    steps: Table,
    events: Option<Table>,
}

impl ContactTables {
    pub fn append(&mut self, frame: &Frame) -> hdf5::Result<()> {
        let contacts = &frame.contacts;
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

    pub fn visit(&mut self, frames: usize, rows: usize, visit: &mut impl Visit) -> Result<()> {
        visit.table::<u64>(&mut self.start, frames)?;
        visit.table::<u32>(&mut self.count, frames)?;
        visit.table::<i32>(&mut self.pair, rows)?;
        self.columns.iter_mut().try_for_each(|column| column.visit(rows, visit))?;
        visit.table::<ContactCode>(&mut self.status, rows)?;
        self.bond.iter_mut().try_for_each(|bond| visit.table::<i32>(bond, rows))
    }
}

impl Observables {
    pub fn width(&self) -> usize {
        self.values.iter().map(|values| values.table.width()).sum()
    }

    pub fn push(&mut self, step: i64, time: f64, mut values: &[f64]) {
        self.steps.push(step);
        self.times.push(time);
        for Values { table, block, .. } in &mut self.values {
            let (value, rest) = values.split_at(table.width());
            block.extend(value);
            values = rest;
        }
    }

    pub fn append(&mut self) -> hdf5::Result<()> {
        self.step.append(&self.steps)?;
        self.time.append(&self.times)?;
        self.steps.clear();
        self.times.clear();
        self.values.iter_mut().try_for_each(Values::append)
    }

    pub fn visit(&mut self, rows: usize, visit: &mut impl Visit) -> Result<()> {
        visit.table::<i64>(&mut self.step, rows)?;
        visit.table::<f64>(&mut self.time, rows)?;
        self.values.iter_mut().try_for_each(|values| values.visit(rows, visit))
    }
}

impl Commit {
    pub fn rows(&mut self, contacts: usize, steps: usize, events: Option<&Table>) -> hdf5::Result<()> {
        self.contacts.append(&[contacts as u64])?;
        self.steps.append(&[steps as u64])?;
        match (&mut self.events, events) {
            (Some(table), Some(events)) => table.append(&[events.rows() as u64]),
            _ => Ok(()),
        }
    }

    pub fn visit(&mut self, frames: usize, visit: &mut impl Visit) -> Result<()> {
        visit.table::<u64>(&mut self.contacts, frames)?;
        visit.table::<u64>(&mut self.steps, frames)?;
        self.events.iter_mut().try_for_each(|table| visit.table::<u64>(table, frames))
    }
}

pub(super) fn check_length(place: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(HistoryError::Shape { place: place.into(), found, expected }) }
}

/// The version of a file of this layout. A copy of a history older than version 4 has version 3:
/// its load error is unchanged, and it has no separate false acceleration.
fn schema_version(layout: &Layout) -> u32 {
    let observes = |name: &str| layout.observables.iter().any(|observable| observable.name == name);
    if observes(LOAD_ERROR) && !observes(FALSE_ACCELERATION) { 3 } else { SCHEMA_VERSION }
}

pub(super) fn write_identity(file: &File, layout: &Layout) -> hdf5::Result<()> {
    let run = &layout.parameters;
    let h5md = file.create_group("h5md")?;
    h5md.new_attr_builder().with_data(&[1i32, 1]).create("version")?;
    let author = h5md.create_group("author")?;
    text_attribute(&author, "name", CREATOR)?;
    let creator = h5md.create_group("creator")?;
    text_attribute(&creator, "name", CREATOR)?;
    text_attribute(&creator, "version", &run.version)?;

    let parameters = file.create_group(path::PARAMETERS)?;
    parameters.new_attr::<u32>().create("schema_version")?.write_scalar(&schema_version(layout))?;
    parameters.new_attr::<u64>().create("seed")?.write_scalar(&run.seed)?;
    for (name, value) in [
        ("version", &run.version),
        ("git_revision", &run.git_revision),
        ("build", &run.build),
        ("host", &run.host),
        ("start", &run.start),
    ] {
        text_attribute(&parameters, name, value)?;
    }
    if let Some(fraction) = run.solid_fraction {
        parameters.new_attr::<f64>().create("solid_fraction")?.write_scalar(&fraction)?;
    }
    let write = |place: &str, value: &str| {
        file.new_dataset::<VarLenUnicode>().obj_track_times(false).create(place)?.write_scalar(&text(value))
    };
    write(path::SCENE, &run.scene)?;
    if run.earlier_scenes.is_empty() { Ok(()) } else { write(path::EARLIER_SCENES, &run.earlier_scenes) }
}

pub(super) fn grains(file: &File, layout: &Layout) -> hdf5::Result<Group> {
    let group = file.create_group("particles")?.create_group("grains")?;
    let cell = group.create_group("box")?;
    cell.new_attr::<i32>().create("dimension")?.write_scalar(&(layout.dimension as i32))?;
    cell.new_attr_builder().with_data(&vec![text("none"); layout.dimension]).create("boundary")?;
    let grains = &layout.grains;
    let n = [grains.id.len()];
    fixed(&group, "id", "", &n, &grains.id)?;
    fixed(&group, "radius", "m", &n, &grains.radius)?;
    fixed(&group, "mass", "kg", &n, &grains.mass)?;
    fixed(&group, "inertia", "kg m2", &n, &grains.inertia)?;
    if !grains.material.is_empty() {
        fixed(&group, "material", "", &n, &grains.material)?;
        let names: Vec<VarLenUnicode> = layout.materials.iter().map(|name| text(name)).collect();
        fixed(&file.create_group("materials")?, "name", "", &[names.len()], &names)?;
    }
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

pub(super) fn grain_columns(
    grains: &Group,
    motion: &Group,
    layout: &Layout,
    storage: Storage,
) -> hdf5::Result<Vec<Column>> {
    let (n, d) = (layout.grains.id.len(), layout.dimension);
    let column = |place, group: &Group, unit, row: &[usize], take| -> hdf5::Result<Column> {
        Ok(Column { place, table: Table::reals(group, "value", unit, row, Growth::Frames, storage)?, take })
    };
    let mut columns = vec![
        column("particles/grains/position", motion, "m", &[n, d], |f| &f.grains.position)?,
        column("particles/grains/velocity", &element(grains, "velocity")?, "m s-1", &[n, d], |f| &f.grains.velocity)?,
    ];
    if layout.rotation {
        let spins: &[usize] = if d == 2 { &[n] } else { &[n, 3] };
        let spin = element(grains, "angular_velocity")?;
        columns.push(column("particles/grains/angular_velocity", &spin, "rad s-1", spins, |f| {
            &f.grains.angular_velocity
        })?);
        let (name, unit, row): (_, _, &[usize]) =
            if d == 2 { ("angle", "rad", &[n]) } else { ("orientation", "", &[n, 4]) };
        let group = element(grains, name)?;
        columns.push(column("particles/grains/orientation", &group, unit, row, |f| &f.grains.orientation)?);
    }
    Ok(columns)
}

pub(super) fn wall_columns(file: &File, layout: &Layout, storage: Storage) -> hdf5::Result<Vec<Column>> {
    let (w, d, group) = (layout.walls.len(), layout.dimension, file.create_group(path::WALLS)?);
    let names: Vec<VarLenUnicode> = layout.walls.iter().map(|wall| text(&wall.name)).collect();
    fixed(&group, "name", "", &[w], &names)?;
    let kinds: Vec<WallKindCode> = layout.walls.iter().map(|wall| wall.kind.code()).collect();
    fixed(&group, "kind", "", &[w], &kinds)?;
    let drives: Vec<WallDriveCode> = layout.walls.iter().map(|wall| wall.drive.code()).collect();
    fixed(&group, "drive", "", &[w], &drives)?;
    for constant in WallColumn::ALL {
        let shape = [vec![w], constant.row(d)].concat();
        let values = constant.values(&layout.walls, d);
        if constant.always || values.iter().any(|value| *value != 0.0) {
            fixed(&group, constant.name, constant.unit, &shape, &values)?;
        }
    }
    let column = |place, name, unit, take| -> hdf5::Result<Column> {
        let table = Table::reals(&element(&group, name)?, "value", unit, &[w, d], Growth::Frames, storage)?;
        Ok(Column { place, table, take })
    };
    Ok(vec![
        column("walls/position", "position", "m", |f| &f.walls.position)?,
        column("walls/velocity", "velocity", "m s-1", |f| &f.walls.velocity)?,
        column("walls/force", "force", "N", |f| &f.walls.force)?,
    ])
}

/// What a history holds of its bonds.
pub(super) struct BondTables {
    /// The state of each bond, frame by frame.
    pub status: Table,
    /// Properties of bonds that a stage forms.
    later: Option<LaterBonds>,
}

/// The properties of bonds that a stage forms: empty until then.
struct LaterBonds {
    pair: Table,
    /// In the order of [`columns`].
    columns: Vec<Table>,
    formed: Table,
}

/// Columns of the properties of bonds: name, unit, values.
fn columns(bonds: &Bonds) -> Vec<(&'static str, &'static str, &[f64])> {
    let mut columns: Vec<(&str, &str, &[f64])> = vec![
        ("rest_gap", "m", &bonds.rest_gap),
        ("strength", "N", &bonds.strength),
        ("friction", "", &bonds.friction),
        ("rolling", "", &bonds.rolling),
        ("mean_diameter", "m", &bonds.mean_diameter),
    ];
    columns.extend(bonds.twist.as_ref().map(|twist| ("twist", "", twist.as_slice())));
    columns
}

impl BondTables {
    pub fn create(file: &File, bonds: &Bonds, storage: Storage) -> hdf5::Result<Self> {
        let (b, group) = (bonds.len(), file.create_group(path::BONDS)?);
        let mut later = None;
        if bonds.formed.is_some() {
            let growth = Growth::Rows(512);
            let pair = Table::create::<i32>(&group, "pair", "", &[2], growth, storage)?;
            let column = |(name, unit, _)| Table::create::<f64>(&group, name, unit, &[], growth, storage);
            let columns = columns(bonds).into_iter().map(column).collect::<hdf5::Result<_>>()?;
            let formed = Table::create::<i64>(&group, "formed", "", &[], Growth::Rows(1), storage)?;
            later = Some(LaterBonds { pair, columns, formed });
        } else {
            fixed(&group, "pair", "", &[b, 2], bonds.pair.as_flattened())?;
            for (name, unit, values) in columns(bonds) {
                // without it, the two limits of each bond have one coefficient
                if name != "rolling" || !values.is_empty() {
                    fixed(&group, name, unit, &[b], values)?;
                }
            }
        }
        let growth = if later.is_some() { Growth::Bonds } else { Growth::Frames };
        let status = Table::create::<BondCode>(&element(&group, "status")?, "value", "", &[b], growth, storage)?;
        let mut tables = Self { status, later };
        if let Some(formed) = bonds.formed {
            tables.fill(bonds, formed)?;
        }
        Ok(tables)
    }

    /// Writes the bonds that formed after the step `formed`.
    pub fn fill(&mut self, bonds: &Bonds, formed: i64) -> hdf5::Result<()> {
        let Some(later) = &mut self.later else { return Err("bonds that form later have no place".into()) };
        later.pair.append(bonds.pair.as_flattened())?;
        for (table, (_, _, values)) in later.columns.iter_mut().zip(columns(bonds)) {
            table.append(values)?;
        }
        self.status.widen(bonds.len())?;
        later.formed.overwrite(&[formed])
    }
}

pub(super) fn contacts(file: &File, layout: &Layout, storage: Storage) -> hdf5::Result<ContactTables> {
    let (d, bonded) = (layout.dimension, layout.bonded());
    let group = file.create_group(path::CONTACTS)?;
    link_times(&group)?;
    // a dense packing has two to three contacts a grain
    let growth = Growth::Rows(16 * 3 * layout.grains.id.len());
    let column = |place, name, unit, row: &[usize], take| -> hdf5::Result<Column> {
        Ok(Column { place, table: Table::reals(&group, name, unit, row, growth, storage)?, take })
    };
    // a bond has tangential rows, also without friction
    let tangential = layout.friction || bonded;
    let reaction_rows = if tangential { d } else { 1 };
    let mut columns = vec![
        column("contacts/point", "point", "m", &[d], |f| &f.contacts.point)?,
        column("contacts/normal", "normal", "", &[d], |f| &f.contacts.normal)?,
        column("contacts/gap", "gap", "m", &[], |f| &f.contacts.gap)?,
    ];
    if !layout.without_reactions {
        columns.push(column("contacts/reaction", "reaction", "N", &[reaction_rows], |f| &f.contacts.reaction)?);
        let reaction = group.dataset("reaction")?;
        text_attribute(&reaction, "frame", "local")?;
        if d == 3 && tangential {
            columns.push(column("contacts/tangent", "tangent", "", &[d], |f| &f.contacts.tangent)?);
        }
        if bonded {
            let row: &[usize] = if d == 2 { &[] } else { &[2 + usize::from(layout.twist)] };
            columns.push(column("contacts/moment", "moment", "N m", row, |f| &f.contacts.moment)?);
        }
    }
    let frames = Growth::Frames;
    Ok(ContactTables {
        start: Table::create::<u64>(&group, "start", "", &[], frames, storage)?,
        count: Table::create::<u32>(&group, "count", "", &[], frames, storage)?,
        pair: Table::create::<i32>(&group, "pair", "", &[2], growth, storage)?,
        status: Table::create::<ContactCode>(&group, "status", "", &[], growth, storage)?,
        bond: if bonded { Some(Table::create::<i32>(&group, "bond", "", &[], growth, storage)?) } else { None },
        columns,
    })
}

pub(super) fn observables(file: &File, observables: &[Observable], storage: Storage) -> hdf5::Result<Observables> {
    let parent = file.create_group(path::OBSERVABLES)?;
    let growth = Growth::Rows(1024);
    let step = Table::create::<i64>(&parent, "step", "", &[], growth, storage)?;
    let time = Table::create::<f64>(&parent, "time", "s", &[], growth, storage)?;
    let mut values = Vec::with_capacity(observables.len());
    for observable in observables {
        let group = parent.create_group(&observable.name)?;
        for name in ["step", "time"] {
            group.link_hard(&format!("/{}/{name}", path::OBSERVABLES), name)?;
        }
        let (unit, shape) = (&observable.unit, &observable.shape);
        let table = match observable.kind {
            ValueKind::Real => Table::create::<f64>(&group, "value", unit, shape, growth, storage)?,
            ValueKind::Route => Table::create::<RouteCode>(&group, "value", unit, shape, growth, storage)?,
        };
        values.push(Values { table, kind: observable.kind, block: Vec::new() });
    }
    Ok(Observables { step, time, values, steps: vec![], times: vec![] })
}

pub(super) fn commit(file: &File, bonded: bool, storage: Storage) -> hdf5::Result<Commit> {
    let frames = file.new_dataset::<u64>().obj_track_times(false).create(path::COMMIT)?;
    frames.write_scalar(&0u64)?;
    let group = file.create_group("commit_rows")?;
    let table = |name| Table::create::<u64>(&group, name, "", &[], Growth::Frames, storage);
    Ok(Commit {
        frames,
        contacts: table("contacts")?,
        steps: table("steps")?,
        events: if bonded { Some(table("events")?) } else { None },
    })
}

pub(super) fn ending(file: &File) -> hdf5::Result<Dataset> {
    let dataset = file.new_dataset::<EndingCode>().obj_track_times(false).create(path::ENDING)?;
    dataset.write_scalar(&Ending::Open.code())?;
    Ok(dataset)
}
