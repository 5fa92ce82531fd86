//! Reading a history, one frame or one observable at a time.

use std::fs;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, File, H5Type, OpenMode};

use super::codes::{BondCode, BondStatus, Coded, ContactCode, WallDriveCode, WallKindCode};
use super::error::{HistoryError, Result, reason, while_reading};
use super::schema::{CREATOR, RuptureRow, SCHEMA_VERSION, path};
use super::table::rows;
use super::{Bonds, ContactRows, GrainState, Grains, Parameters, Rupture, Wall, WallState};

/// Deflate cannot shrink anything further than this, so no honest dataset is larger than this many file lengths.
const GREATEST_COMPRESSION: u64 = 1032;

/// An open history, read-only. Only complete frames are seen; a file that a run still writes, or that a killed run left,
/// opens as well and shows what was complete when it was opened.
pub struct History {
    path: PathBuf,
    file: File,
    /// Length of the file when it was opened, bytes.
    length: u64,
    dimension: usize,
    /// Numbers of grains and walls.
    grains: usize,
    walls: usize,
    steps: Vec<i64>,
    times: Vec<f64>,
    /// Complete rows of ruptures and of observables.
    events: usize,
    observed: usize,
    open_ended: bool,
}

/// One observable over the whole run.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its unit, empty for a number.
    pub unit: String,
    /// The shape of one value.
    pub shape: Vec<usize>,
    /// Steps, S.
    pub step: Vec<i64>,
    /// Times, s, S.
    pub time: Vec<f64>,
    /// Values, S × shape, row by row.
    pub value: Vec<f64>,
}

impl Series {
    /// Component `index` of every value, as `[1, 1]` of a tensor or `[]` of a scalar; `None` outside the shape.
    pub fn component(&self, index: &[usize]) -> Option<Vec<f64>> {
        if index.len() != self.shape.len() || index.iter().zip(&self.shape).any(|(i, n)| i >= n) {
            return None;
        }
        let offset = index
            .iter()
            .zip(&self.shape)
            .fold(0, |offset, (i, n)| offset * n + i);
        let width = self.shape.iter().product();
        Some(
            self.value
                .chunks_exact(width)
                .map(|value| value[offset])
                .collect(),
        )
    }
}

impl History {
    /// Opens a history and checks that it is one.
    ///
    /// # Errors
    /// [`HistoryError::Missing`], [`HistoryError::Io`], [`HistoryError::NotHdf5`], [`HistoryError::Truncated`],
    /// [`HistoryError::Foreign`], [`HistoryError::Newer`] or [`HistoryError::Damaged`], as the file deserves.
    pub fn open(path: &Path) -> Result<Self> {
        hdf5::silence_errors(true);
        let (length, open_ended) = check_superblock(path)?;
        let file = open_file(path, open_ended)?;
        check_identity(path, &file)?;
        let mut history = Self {
            path: path.into(),
            file,
            length,
            dimension: 0,
            grains: 0,
            walls: 0,
            steps: vec![],
            times: vec![],
            events: 0,
            observed: 0,
            open_ended,
        };
        history.read_commit()?;
        Ok(history)
    }

    fn read_commit(&mut self) -> Result<()> {
        // first the commit: what is read after it is at least as new
        let frames = self.scalar::<u64>(path::COMMIT)? as usize;
        self.dimension =
            self.attribute::<i32>(&format!("{}/box", path::GRAINS), "dimension")? as usize;
        if !(2..=3).contains(&self.dimension) {
            return Err(self.damaged("particles/grains/box", "the dimension is neither 2 nor 3"));
        }
        self.grains = self.count(&format!("{}/id", path::GRAINS))?;
        self.walls = if self.has(path::WALLS) {
            self.count(&format!("{}/name", path::WALLS))?
        } else {
            0
        };
        self.steps = self
            .read(&format!("{}/position/step", path::GRAINS), 0..frames)?
            .1;
        self.times = self
            .read(&format!("{}/position/time", path::GRAINS), 0..frames)?
            .1;
        let last = frames.saturating_sub(1)..frames;
        let complete = |place: &str| -> Result<usize> {
            Ok(self
                .read::<u64>(place, last.clone())?
                .1
                .first()
                .map_or(0, |&rows| rows as usize))
        };
        let observed = complete(path::COMMIT_STEPS)?;
        let events = if self.has(path::RUPTURE) {
            complete(path::COMMIT_EVENTS)?
        } else {
            0
        };
        (self.observed, self.events) = (observed, events);
        Ok(())
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file, bytes.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Whether the file was never closed: its run still goes on, or was killed.
    pub fn open_ended(&self) -> bool {
        self.open_ended
    }

    /// Dimension D.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of complete frames T.
    pub fn frames(&self) -> usize {
        self.times.len()
    }

    /// Step of each frame, T.
    pub fn steps(&self) -> &[i64] {
        &self.steps
    }

    /// Time of each frame, s, T.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The frame nearest to `time` (s); `None` for a history without frames.
    pub fn frame_at(&self, time: f64) -> Option<usize> {
        let distance = |frame: &usize| (self.times[*frame] - time).abs();
        (0..self.frames()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Number of rows of observables S.
    pub fn observed_steps(&self) -> usize {
        self.observed
    }

    /// Where the run comes from.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn parameters(&self) -> Result<Parameters> {
        let text = |name| {
            Ok::<_, HistoryError>(
                self.attribute::<VarLenUnicode>(path::PARAMETERS, name)?
                    .to_string(),
            )
        };
        Ok(Parameters {
            scene: self.scalar::<VarLenUnicode>(path::SCENE)?.to_string(),
            seed: self.attribute(path::PARAMETERS, "seed")?,
            version: text("version")?,
            git_revision: text("git_revision")?,
            build: text("build")?,
            host: text("host")?,
            start: text("start")?,
        })
    }

    /// What does not change about the grains.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn grains(&self) -> Result<Grains> {
        let id: Vec<i32> = self.whole(&format!("{}/id", path::GRAINS), 1)?;
        let column = |name: &str| self.column(&format!("{}/{name}", path::GRAINS), self.grains);
        Ok(Grains {
            radius: column("radius")?,
            mass: column("mass")?,
            inertia: column("inertia")?,
            id,
        })
    }

    /// The walls; empty for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn walls(&self) -> Result<Vec<Wall>> {
        if !self.has(path::WALLS) {
            return Ok(vec![]);
        }
        let place = |name: &str| format!("{}/{name}", path::WALLS);
        let names: Vec<VarLenUnicode> = self.whole(&place("name"), 1)?;
        let (w, d) = (self.walls, self.dimension);
        let kinds = self.coded(
            &place("kind"),
            self.whole::<WallKindCode>(&place("kind"), 1)?,
            w,
        )?;
        let drives = self.coded(
            &place("drive"),
            self.whole::<WallDriveCode>(&place("drive"), 1)?,
            w,
        )?;
        let normals = self.column(&place("normal"), w * d)?;
        let directions = self.column(&place("direction"), w * d)?;
        let radii = self.column(&place("radius"), w)?;
        let vector = |values: &[f64], k: usize| {
            let mut vector = [0.0; 3];
            vector[..d].copy_from_slice(&values[k * d..(k + 1) * d]);
            vector
        };
        let wall = |k: usize| Wall {
            name: names[k].to_string(),
            kind: kinds[k],
            normal: vector(&normals, k),
            radius: radii[k],
            drive: drives[k],
            direction: vector(&directions, k),
        };
        Ok((0..w).map(wall).collect())
    }

    /// The bonds as they were formed; empty for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn bonds(&self) -> Result<Bonds> {
        if !self.has(path::BONDS) {
            return Ok(Bonds::default());
        }
        let place = |name: &str| format!("{}/{name}", path::BONDS);
        let pair = pairs(&self.whole::<i32>(&place("pair"), 2)?);
        if pair
            .as_flattened()
            .iter()
            .any(|grain| !(0..self.grains as i32).contains(grain))
        {
            return Err(self.damaged(&place("pair"), "a bond names a grain that is not there"));
        }
        let column = |name: &str| self.column(&place(name), pair.len());
        Ok(Bonds {
            rest_gap: column("rest_gap")?,
            strength: column("strength")?,
            friction: column("friction")?,
            mean_diameter: column("mean_diameter")?,
            pair,
        })
    }

    /// The grains at frame `frame`.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn grain_state(&self, frame: usize) -> Result<GrainState> {
        let orientation = if self.dimension == 2 {
            "angle"
        } else {
            "orientation"
        };
        let (n, d) = (self.grains, self.dimension);
        let column = |name: &str, width| {
            self.frame_values(frame, &format!("{}/{name}", path::GRAINS), n * width)
        };
        Ok(GrainState {
            position: column("position", d)?,
            velocity: column("velocity", d)?,
            angular_velocity: column("angular_velocity", if d == 2 { 1 } else { 3 })?,
            orientation: column(orientation, if d == 2 { 1 } else { 4 })?,
        })
    }

    /// The walls at frame `frame`; empty arrays for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn wall_state(&self, frame: usize) -> Result<WallState> {
        let column = |name: &str| {
            self.frame_values(
                frame,
                &format!("{}/{name}", path::WALLS),
                self.walls * self.dimension,
            )
        };
        Ok(WallState {
            position: column("position")?,
            velocity: column("velocity")?,
            force: column("force")?,
        })
    }

    /// The state of each bond at frame `frame`; empty for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn bond_status(&self, frame: usize) -> Result<Vec<BondStatus>> {
        self.check_frame(frame)?;
        let place = format!("{}/status/value", path::BONDS);
        if !self.has(path::BONDS) {
            return Ok(vec![]);
        }
        let (_, codes) = self.read::<BondCode>(&place, frame..frame + 1)?;
        let count = codes.len();
        self.coded(&place, codes, count)
    }

    /// The contacts at frame `frame`.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn contacts(&self, frame: usize) -> Result<ContactRows> {
        self.check_frame(frame)?;
        let range = self.contact_rows(frame)?;
        let place = |name: &str| format!("{}/{name}", path::CONTACTS);
        // a column that the scene lacks is empty; the others have rows of one of the lengths allowed
        let column = |name: &str, widths: &[usize]| -> Result<Vec<f64>> {
            if !self.has(&place(name)) {
                return Ok(vec![]);
            }
            let (row, values) = self.read::<f64>(&place(name), range.clone())?;
            if !widths.contains(&row.iter().product()) {
                return Err(self.damaged(&place(name), "its rows have another length"));
            }
            Ok(values)
        };
        let d = self.dimension;
        let codes = self.read::<ContactCode>(&place("status"), range.clone())?.1;
        let bond = if self.has(&place("bond")) {
            self.read(&place("bond"), range.clone())?.1
        } else {
            vec![]
        };
        Ok(ContactRows {
            pair: self.contact_pairs(range.clone())?,
            point: column("point", &[d])?,
            normal: column("normal", &[d])?,
            tangent: column("tangent", &[d])?,
            reaction: column("reaction", &[1, d])?,
            moment: column("moment", &[d - 1])?,
            gap: column("gap", &[1])?,
            status: self.coded(&place("status"), codes, range.len())?,
            bond,
        })
    }

    /// Every bond that broke, in order; empty for a scene without bonds.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn ruptures(&self) -> Result<Vec<Rupture>> {
        if !self.has(path::RUPTURE) {
            return Ok(vec![]);
        }
        let found = self
            .dataset(path::RUPTURE)?
            .dtype()
            .and_then(|dtype| dtype.to_descriptor());
        if found.map_err(while_reading(&self.path, path::RUPTURE))? != RuptureRow::type_descriptor()
        {
            return Err(self.damaged(path::RUPTURE, "its members are others"));
        }
        let (_, events) = self.read::<RuptureRow>(path::RUPTURE, 0..self.events)?;
        let known: Option<Vec<Rupture>> = events.iter().map(RuptureRow::event).collect();
        known.ok_or_else(|| self.damaged(path::RUPTURE, "a mode that is none"))
    }

    /// The names of what was observed, sorted.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn observable_names(&self) -> Result<Vec<String>> {
        let group = self
            .file
            .group(path::OBSERVABLES)
            .map_err(while_reading(&self.path, path::OBSERVABLES))?;
        let names = group
            .member_names()
            .map_err(while_reading(&self.path, path::OBSERVABLES))?;
        Ok(names
            .into_iter()
            .filter(|name| group.link_exists(&format!("{name}/value")))
            .collect())
    }

    /// One observable over the whole run, `None` if it was not recorded.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn observable(&self, name: &str) -> Result<Option<Series>> {
        let place = format!("{}/{name}/value", path::OBSERVABLES);
        if name.contains('/')
            || !self.has(&format!("{}/{name}", path::OBSERVABLES))
            || !self.has(&place)
        {
            return Ok(None);
        }
        let (shape, value) = self.read(&place, 0..self.observed)?;
        let unit = match self.dataset(&place)?.attr("unit") {
            Ok(unit) => unit
                .read_scalar::<VarLenUnicode>()
                .map_err(while_reading(&self.path, &place))?
                .to_string(),
            Err(_) => String::new(),
        };
        let step = self
            .read(&format!("{}/step", path::OBSERVABLES), 0..self.observed)?
            .1;
        let time = self
            .read(&format!("{}/time", path::OBSERVABLES), 0..self.observed)?
            .1;
        Ok(Some(Series {
            unit,
            shape,
            step,
            time,
            value,
        }))
    }
}

/// The small parts that the methods above are made of.
impl History {
    fn damaged(&self, place: &str, why: &str) -> HistoryError {
        HistoryError::Damaged {
            path: self.path.clone(),
            place: place.into(),
            why: why.into(),
        }
    }

    fn check_frame(&self, frame: usize) -> Result<()> {
        if frame < self.frames() {
            return Ok(());
        }
        Err(HistoryError::NoFrame {
            path: self.path.clone(),
            frame,
            frames: self.frames(),
        })
    }

    fn has(&self, place: &str) -> bool {
        self.file.link_exists(place)
    }

    fn dataset(&self, place: &str) -> Result<Dataset> {
        self.file
            .dataset(place)
            .map_err(while_reading(&self.path, place))
    }

    /// Rows `range` of a dataset, with the shape of one row.
    fn read<T: H5Type>(&self, place: &str, range: Range<usize>) -> Result<(Vec<usize>, Vec<T>)> {
        let dataset = self.dataset(place)?;
        let shape = dataset
            .get_shape()
            .map_err(while_reading(&self.path, place))?;
        let Some((&count, row)) = shape.split_first() else {
            return Err(self.damaged(place, "it is a single value"));
        };
        if count < range.end {
            return Err(self.damaged(
                place,
                &format!("it has {count} rows, and {} are promised", range.end),
            ));
        }
        // a forged shape must not ask for more memory than the file can fill
        let bytes = row
            .iter()
            .fold((range.len() * size_of::<T>()) as u64, |b, &n| {
                b.saturating_mul(n as u64)
            });
        if bytes > self.length.saturating_mul(GREATEST_COMPRESSION) {
            return Err(self.damaged(place, "it claims to be larger than the file"));
        }
        let selection = rows(range.start, range.end, row);
        let values = dataset
            .read_slice::<T, _, ndarray::IxDyn>(selection)
            .map_err(while_reading(&self.path, place))?;
        Ok((row.to_vec(), values.into_raw_vec_and_offset().0))
    }

    /// A whole dataset whose rows have `width` numbers.
    fn whole<T: H5Type>(&self, place: &str, width: usize) -> Result<Vec<T>> {
        let (row, values) = self.read(place, 0..self.count(place)?)?;
        if row.iter().product::<usize>() != width {
            return Err(self.damaged(place, "its rows have another length"));
        }
        Ok(values)
    }

    /// A whole dataset of doubles that must have `expected` numbers.
    fn column(&self, place: &str, expected: usize) -> Result<Vec<f64>> {
        let values = self.read::<f64>(place, 0..self.count(place)?)?.1;
        if values.len() != expected {
            return Err(self.damaged(
                place,
                &format!("it has {} values instead of {expected}", values.len()),
            ));
        }
        Ok(values)
    }

    /// What H5MD element `place` holds at one frame, `expected` numbers; empty if it is absent.
    fn frame_values(&self, frame: usize, place: &str, expected: usize) -> Result<Vec<f64>> {
        self.check_frame(frame)?;
        if expected == 0 || !self.has(place) {
            return Ok(vec![]);
        }
        let (_, values) = self.read(&format!("{place}/value"), frame..frame + 1)?;
        if values.len() != expected {
            return Err(self.damaged(
                place,
                &format!("it has {} values instead of {expected}", values.len()),
            ));
        }
        Ok(values)
    }

    fn scalar<T: H5Type>(&self, place: &str) -> Result<T> {
        self.dataset(place)?
            .read_scalar()
            .map_err(while_reading(&self.path, place))
    }

    fn attribute<T: H5Type>(&self, place: &str, name: &str) -> Result<T> {
        let read = self
            .file
            .group(place)
            .and_then(|group| group.attr(name)?.read_scalar());
        read.map_err(while_reading(&self.path, &format!("{place}@{name}")))
    }

    fn coded<C: Coded>(&self, place: &str, codes: Vec<C::Code>, expected: usize) -> Result<Vec<C>> {
        let known: Option<Vec<C>> = codes.into_iter().map(C::from_code).collect();
        match known {
            Some(values) if values.len() == expected => Ok(values),
            Some(_) => Err(self.damaged(place, "it has another length")),
            None => Err(self.damaged(place, "a value that names nothing")),
        }
    }

    /// The number of rows of a dataset.
    fn count(&self, place: &str) -> Result<usize> {
        let shape = self
            .dataset(place)?
            .get_shape()
            .map_err(while_reading(&self.path, place))?;
        Ok(shape.first().copied().unwrap_or(0))
    }

    /// The rows of `/contacts` that belong to `frame`.
    fn contact_rows(&self, frame: usize) -> Result<Range<usize>> {
        let number = |place: &str| -> Result<u64> {
            let (_, values) = self.read::<u64>(place, frame..frame + 1)?;
            values
                .first()
                .copied()
                .ok_or_else(|| self.damaged(place, "its rows are empty"))
        };
        let count = format!("{}/count", path::CONTACTS);
        let (start, rows) = (
            number(&format!("{}/start", path::CONTACTS))?,
            number(&count)?,
        );
        match start.checked_add(rows) {
            Some(end) if end <= number(path::COMMIT_CONTACTS)? => Ok(start as usize..end as usize),
            _ => Err(self.damaged(&count, "it points beyond the complete rows")),
        }
    }

    /// Pairs of contacts, whose grains and walls must all be there.
    fn contact_pairs(&self, range: Range<usize>) -> Result<Vec<[i32; 2]>> {
        let place = format!("{}/pair", path::CONTACTS);
        let (row, flat) = self.read::<i32>(&place, range)?;
        let (grains, walls) = (self.grains as i32, self.walls as i32);
        let pairs = pairs(&flat);
        let known = |&[i, j]: &[i32; 2]| (0..grains).contains(&i) && (-walls..grains).contains(&j);
        if row != [2] || !pairs.iter().all(known) {
            return Err(self.damaged(&place, "a contact names a body that is not there"));
        }
        Ok(pairs)
    }
}

fn pairs(flat: &[i32]) -> Vec<[i32; 2]> {
    flat.as_chunks().0.to_vec()
}

/// Length of the file, and whether it is marked as still being written; refuses what is no HDF5 and what is cut short.
///
/// HDF5 itself reads zeros beyond the end of a file that was never closed, so the end is checked here.
fn check_superblock(path: &Path) -> Result<(u64, bool)> {
    let io = |source| HistoryError::Io {
        path: path.into(),
        doing: "read",
        source,
    };
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => HistoryError::Missing { path: path.into() },
        _ => io(error),
    })?;
    if metadata.is_dir() {
        return Err(io(std::io::Error::new(
            std::io::ErrorKind::IsADirectory,
            "it is a folder, give the .h5 file",
        )));
    }
    let mut head = Vec::new();
    fs::File::open(path)
        .and_then(|file| file.take(48).read_to_end(&mut head))
        .map_err(io)?;
    const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
    let found = metadata.len();
    if !head.starts_with(&SIGNATURE[..head.len().min(8)]) || head.is_empty() {
        return Err(HistoryError::NotHdf5 { path: path.into() });
    }
    if head.len() < 48 {
        return Err(HistoryError::Truncated {
            path: path.into(),
            found,
            expected: 48,
        });
    }
    // only version 3 is ours; HDF5 judges the others
    let (version, sizes, flags) = (head[8], head[9], head[11]);
    if version != 3 || sizes != 8 {
        return Ok((found, false));
    }
    let expected = u64::from_le_bytes(head[28..36].try_into().unwrap_or_default());
    if found < expected {
        return Err(HistoryError::Truncated {
            path: path.into(),
            found,
            expected,
        });
    }
    Ok((found, flags != 0))
}

fn open_file(path: &Path, open_ended: bool) -> Result<File> {
    let mode = if open_ended {
        OpenMode::ReadSWMR
    } else {
        OpenMode::Read
    };
    File::open_as(path, mode).map_err(|error| {
        let why = reason(&error);
        if error.contains_minor(hdf5::MinorErrorCode::NotHdf5) {
            return HistoryError::NotHdf5 { path: path.into() };
        }
        HistoryError::Damaged {
            path: path.into(),
            place: String::new(),
            why,
        }
    })
}

fn check_identity(path: &Path, file: &File) -> Result<()> {
    let foreign = |why: String| HistoryError::Foreign {
        path: path.into(),
        why,
    };
    let group = |name: &str| {
        if file.link_exists(name) {
            file.group(name).ok()
        } else {
            None
        }
    };
    let creator = group("h5md")
        .filter(|h5md| h5md.link_exists("creator"))
        .and_then(|h5md| {
            h5md.group("creator")
                .ok()?
                .attr("name")
                .ok()?
                .read_scalar::<VarLenUnicode>()
                .ok()
        });
    let version = group(path::PARAMETERS).and_then(|parameters| {
        parameters
            .attr("schema_version")
            .ok()?
            .read_scalar::<u32>()
            .ok()
    });
    match (creator, version) {
        (Some(name), _) if name.as_str() != CREATOR => {
            Err(foreign(format!("it was written by {name:?}")))
        }
        (Some(_), Some(found)) if found > SCHEMA_VERSION => Err(HistoryError::Newer {
            path: path.into(),
            found,
            known: SCHEMA_VERSION,
        }),
        (Some(_), Some(_)) => Ok(()),
        _ => Err(foreign(
            "it has no /h5md/creator or no /parameters schema_version".into(),
        )),
    }
}
