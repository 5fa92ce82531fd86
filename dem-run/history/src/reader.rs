//! Reading a history, one frame or one observable at a time.

use std::cell::OnceCell;
use std::ops::Range;
use std::path::Path;

use hdf5::types::VarLenUnicode;

use super::checkpoint::Checkpoint;
use super::codes::{Coded, ContactCode};
use super::ending::{Ending, EndingCode};
use super::error::{HistoryError, Result, refused, while_reading};
use super::model::{ContactRows, GrainState, Grains, Layout, Parameters, RowCounts, Rupture, WallState};
use super::observed::{self, Series};
use super::rupture::RuptureRow;
use super::schema::path;
use super::sound::{self, Surroundings};
use super::source::{self, Source};
use super::wall::{Wall, WallColumn, WallDriveCode, WallKindCode};
use super::{checkpoint, lock};

mod bonds;

/// An open history, read-only. Only complete frames are visible. The file of a running or killed
/// run opens as well and shows the frames that were complete at opening.
pub struct History {
    source: Source,
    dimension: usize,
    /// Numbers of grains and walls.
    grains: usize,
    walls: usize,
    steps: Vec<i64>,
    times: Vec<f64>,
    /// Complete rows of ruptures and of observables.
    events: usize,
    observed: usize,
    /// Admissible positions of grains, computed on first use.
    surroundings: OnceCell<Surroundings>,
}

impl History {
    /// Opens a history and checks that it is one.
    ///
    /// # Errors
    /// [`HistoryError::Missing`], [`HistoryError::Io`], [`HistoryError::NotHdf5`],
    /// [`HistoryError::Truncated`], [`HistoryError::Foreign`], [`HistoryError::Newer`] or
    /// [`HistoryError::Damaged`], depending on the file.
    pub fn open(path: &Path) -> Result<Self> {
        let history = Self::open_as_is(path)?;
        let place = |name: &str| format!("{}/position/{name}", path::GRAINS);
        sound::growing(&history.source.path, &place("step"), &history.steps)?;
        sound::reals(&history.source.path, &place("time"), 0, 1, &history.times)?;
        sound::growing(&history.source.path, &place("time"), &history.times)?;
        Ok(history)
    }

    /// As [`History::open`], but accepts frames out of order: for the check of a file.
    ///
    /// # Errors
    /// As [`History::open`].
    pub fn open_as_is(path: &Path) -> Result<Self> {
        hdf5::silence_errors(true);
        let mut history = Self {
            source: Source::open(path)?,
            dimension: 0,
            grains: 0,
            walls: 0,
            steps: vec![],
            times: vec![],
            events: 0,
            observed: 0,
            surroundings: OnceCell::new(),
        };
        history.read_commit()?;
        Ok(history)
    }

    fn read_commit(&mut self) -> Result<()> {
        // the commit is read first: data read later are at least as new
        let frames = self.source.scalar::<u64>(path::COMMIT)? as usize;
        self.dimension = self.source.attribute::<i32>(&format!("{}/box", path::GRAINS), "dimension")? as usize;
        if !(2..=3).contains(&self.dimension) {
            return Err(self.source.damaged("particles/grains/box", "the dimension is neither 2 nor 3"));
        }
        self.grains = self.source.count(&format!("{}/id", path::GRAINS))?;
        self.walls =
            if self.source.has(path::WALLS) { self.source.count(&format!("{}/name", path::WALLS))? } else { 0 };
        self.steps = self.source.read(&format!("{}/position/step", path::GRAINS), 0..frames)?.1;
        self.times = self.source.read(&format!("{}/position/time", path::GRAINS), 0..frames)?.1;
        let complete = self.complete_at(frames)?;
        (self.observed, self.events) = (complete.steps, complete.events);
        Ok(())
    }

    /// The file, opened once more for direct reads.
    ///
    /// # Errors
    /// As [`History::open`].
    pub fn reopened(&self) -> Result<hdf5::File> {
        source::open_file(&self.source.path, self.source.open_ended)
    }

    /// Rows that are complete.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn complete(&self) -> Result<RowCounts> {
        self.complete_at(self.frames())
    }

    /// Rows that were complete at the commit of `frames` frames.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn complete_at(&self, frames: usize) -> Result<RowCounts> {
        let rows = |place: &str| -> Result<usize> {
            let last = frames.saturating_sub(1)..frames;
            Ok(self.source.read::<u64>(place, last)?.1.first().map_or(0, |&rows| rows as usize))
        };
        let bonded = self.source.has(path::RUPTURE);
        Ok(RowCounts {
            frames,
            contacts: rows(path::COMMIT_CONTACTS)?,
            steps: rows(path::COMMIT_STEPS)?,
            events: if bonded { rows(path::COMMIT_EVENTS)? } else { 0 },
        })
    }

    /// Rows up to a step: the frames, and what the file holds of later steps; none if steps are
    /// missing. A state beyond the last frame is that of a run that was interrupted between two
    /// frames and resumed.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn complete_to(&self, step: i64) -> Result<Option<RowCounts>> {
        let frames = self.steps.iter().take_while(|of_frame| **of_frame <= step).count();
        let mut rows = self.complete_at(frames)?;
        let of_frame = self.steps[..frames].last().copied().unwrap_or(0);
        if of_frame >= step {
            return Ok(Some(rows));
        }
        let place = format!("{}/step", path::OBSERVABLES);
        let end = rows.steps.saturating_add((step - of_frame) as usize);
        if self.source.count(&place)? < end {
            return Ok(None);
        }
        let later: Vec<i64> = self.source.read(&place, rows.steps..end)?.1;
        if !later.into_iter().eq(of_frame + 1..=step) {
            return Ok(None);
        }
        rows.steps = end;
        if self.source.has(path::RUPTURE) {
            let later = rows.events..self.source.count(path::RUPTURE)?.max(rows.events);
            let steps = RuptureRow::read(&self.source, path::RUPTURE, later)?.1;
            rows.events += steps.iter().take_while(|row| (of_frame + 1..=step).contains(&row.step())).count();
        }
        Ok(Some(rows))
    }

    /// The newest checkpoint; none in a file of a version without checkpoints, or of a run killed
    /// before its first checkpoint.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn checkpoint(&self) -> Result<Option<Checkpoint>> {
        checkpoint::newest(&self.source, |step| Ok(self.complete_to(step)?.is_some()))
    }

    /// Whether the run ended, and why; [`Ending::Open`] also in a file of a program that did not
    /// record it.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn ending(&self) -> Result<Ending> {
        if !self.source.has(path::ENDING) {
            return Ok(Ending::Open);
        }
        let code = self.source.scalar::<EndingCode>(path::ENDING)?;
        Ending::from_code(code).ok_or_else(|| self.source.damaged(path::ENDING, "an unknown value"))
    }

    /// The process that writes the file, if any.
    ///
    /// # Errors
    /// [`HistoryError::Io`].
    pub fn writer(&self) -> Result<Option<i32>> {
        let path = &self.source.path;
        lock::holder(path).map_err(|error| refused(path)("read", error))
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    /// What the history holds; observables in the order of their names.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn layout(&self) -> Result<Layout> {
        let contacts = |name: &str| format!("{}/{name}", path::CONTACTS);
        let width = |place: &str| -> Result<usize> { Ok(self.source.read::<f64>(place, 0..0)?.0.iter().product()) };
        let without_reactions = !self.source.has(&contacts("reaction"));
        let position = self.source.dataset(&format!("{}/position/value", path::GRAINS))?;
        let size = position.dtype().map_err(while_reading(self.path(), path::GRAINS))?.size();
        Ok(Layout {
            dimension: self.dimension,
            rotation: self.source.has(&format!("{}/angular_velocity", path::GRAINS)),
            friction: !without_reactions && width(&contacts("reaction"))? > 1,
            twist: self.source.has(&contacts("moment")) && width(&contacts("moment"))? > 2,
            without_reactions,
            single: size == 4,
            grains: self.grains()?,
            walls: self.walls()?,
            bonds: self.bonds()?,
            materials: self.materials()?,
            observables: observed::observables(&self.source)?,
            parameters: self.parameters()?,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// Length of the file, bytes.
    pub fn length(&self) -> u64 {
        self.source.length
    }

    /// Whether the file was never closed: its run continues or was killed.
    pub fn open_ended(&self) -> bool {
        self.source.open_ended
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

    /// Whether the reactions of the contacts were recorded.
    pub fn has_reactions(&self) -> bool {
        self.source.has(&format!("{}/reaction", path::CONTACTS))
    }

    /// Provenance of the run.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn parameters(&self) -> Result<Parameters> {
        let text =
            |name| Ok::<_, HistoryError>(self.source.attribute::<VarLenUnicode>(path::PARAMETERS, name)?.to_string());
        Ok(Parameters {
            scene: self.source.texts(path::SCENE)?.concat(),
            earlier_scenes: match self.source.has(path::EARLIER_SCENES) {
                true => self.source.texts(path::EARLIER_SCENES)?.concat(),
                false => String::new(),
            },
            seed: self.source.attribute(path::PARAMETERS, "seed")?,
            version: text("version")?,
            git_revision: text("git_revision")?,
            build: text("build")?,
            host: text("host")?,
            start: text("start")?,
            solid_fraction: self.source.optional_attribute(path::PARAMETERS, "solid_fraction")?,
        })
    }

    /// The constant properties of the grains.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn grains(&self) -> Result<Grains> {
        let id: Vec<i32> = self.source.whole(&format!("{}/id", path::GRAINS), 1)?;
        let place = |name: &str| format!("{}/{name}", path::GRAINS);
        let column = |name: &str| self.source.column(&place(name), self.grains);
        let grains = Grains {
            radius: column("radius")?,
            mass: column("mass")?,
            inertia: column("inertia")?,
            material: self.material(&place("material"))?,
            id,
        };
        if grains.id.is_empty() {
            return Err(self.source.damaged(&place("id"), "there is no grain"));
        }
        sound::radii(&self.source.path, &place("radius"), &grains.radius)?;
        sound::positive(&self.source.path, &place("mass"), &grains.mass)?;
        Ok(grains)
    }

    /// Materials of the grains, read from `place`; empty if there is one material.
    fn material(&self, place: &str) -> Result<Vec<u8>> {
        if !self.source.has(place) {
            return Ok(vec![]);
        }
        let material: Vec<u8> = self.source.whole(place, 1)?;
        let names = self.materials()?.len();
        if material.len() != self.grains {
            return Err(self.source.damaged(place, "it does not have one material for each grain"));
        }
        match material.iter().position(|own| usize::from(*own) >= names) {
            None => Ok(material),
            Some(grain) => Err(sound::row(&self.source.path, place, grain, "a material without a name")),
        }
    }

    /// Names of the materials; empty if there is one.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn materials(&self) -> Result<Vec<String>> {
        if self.source.has(path::MATERIALS) { self.source.texts(path::MATERIALS) } else { Ok(vec![]) }
    }

    /// The walls; empty for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn walls(&self) -> Result<Vec<Wall>> {
        if !self.source.has(path::WALLS) {
            return Ok(vec![]);
        }
        let place = |name: &str| format!("{}/{name}", path::WALLS);
        let names = self.source.texts(&place("name"))?;
        if names.len() != self.walls {
            return Err(self.source.damaged(&place("name"), "it is not a list of names"));
        }
        let (w, d) = (self.walls, self.dimension);
        let kinds = self.source.coded(&place("kind"), self.source.whole::<WallKindCode>(&place("kind"), 1)?, w)?;
        let drives = self.source.coded(&place("drive"), self.source.whole::<WallDriveCode>(&place("drive"), 1)?, w)?;
        let wall = |((name, kind), drive)| Wall::unmeasured(name, kind, drive);
        let mut walls: Vec<Wall> = names.into_iter().zip(kinds).zip(drives).map(wall).collect();
        for column in WallColumn::ALL {
            if column.always || self.source.has(&place(column.name)) {
                column.set(&mut walls, d, &self.source.column(&place(column.name), w * column.width(d))?);
            }
        }
        Ok(walls)
    }

    /// The grains at frame `frame`.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn grain_state(&self, frame: usize) -> Result<GrainState> {
        let orientation = if self.dimension == 2 { "angle" } else { "orientation" };
        let (n, d) = (self.grains, self.dimension);
        let column = |name: &str, width| self.frame_values(frame, &format!("{}/{name}", path::GRAINS), n * width);
        let position = column("position", d)?;
        let surroundings = self.surroundings()?;
        if let Some(grain) = position.chunks(d).position(|centre| !surroundings.hold(centre)) {
            let centre = &position[grain * d..(grain + 1) * d];
            let why = format!("grain {grain} is at {centre:?} m, far beyond a million sizes of the sample");
            return Err(sound::row(&self.source.path, &format!("{}/position/value", path::GRAINS), frame, why));
        }
        Ok(GrainState {
            position,
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
        let column =
            |name: &str| self.frame_values(frame, &format!("{}/{name}", path::WALLS), self.walls * self.dimension);
        Ok(WallState { position: column("position")?, velocity: column("velocity")?, force: column("force")? })
    }

    /// The rows of `/contacts` that belong to frame `frame`.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn contact_rows(&self, frame: usize) -> Result<Range<usize>> {
        self.check_frame(frame)?;
        let number = |place: &str| -> Result<u64> {
            let (_, values) = self.source.read::<u64>(place, frame..frame + 1)?;
            values.first().copied().ok_or_else(|| self.source.damaged(place, "its rows are empty"))
        };
        let count = format!("{}/count", path::CONTACTS);
        let (start, rows) = (number(&format!("{}/start", path::CONTACTS))?, number(&count)?);
        // frames follow each other without gaps
        let complete = self.source.read::<u64>(path::COMMIT_CONTACTS, frame.saturating_sub(1)..frame + 1)?.1;
        let (before, end) = (if frame == 0 { 0 } else { complete[0] }, complete[complete.len() - 1]);
        if start != before || start.checked_add(rows) != Some(end) {
            let why = format!("{rows} rows from row {start}, but rows {before} to {end} belong to the frame");
            return Err(sound::row(&self.source.path, &count, frame, why));
        }
        Ok(start as usize..end as usize)
    }

    /// The bodies of the contacts at frame `frame`: grains i and j as indices; j < 0 is wall −1−j.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn contact_pairs(&self, frame: usize) -> Result<Vec<[i32; 2]>> {
        self.pairs_in(self.contact_rows(frame)?)
    }

    /// The points of the contacts at frame `frame`, m, m × D.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn contact_points(&self, frame: usize) -> Result<Vec<f64>> {
        self.reals_in(self.contact_rows(frame)?, "point", &[self.dimension])
    }

    /// The contacts at frame `frame`.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`], [`HistoryError::Damaged`].
    pub fn contacts(&self, frame: usize) -> Result<ContactRows> {
        self.contacts_in(self.contact_rows(frame)?)
    }

    /// The contacts in the rows `range` of `/contacts`, a part of [`History::contact_rows`].
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn contacts_in(&self, range: Range<usize>) -> Result<ContactRows> {
        let place = |name: &str| format!("{}/{name}", path::CONTACTS);
        let column = |name: &str, widths: &[usize]| self.reals_in(range.clone(), name, widths);
        let d = self.dimension;
        let codes = self.source.read::<ContactCode>(&place("status"), range.clone())?.1;
        let bond = self.bonds_in(range.clone())?;
        let required = ["point", "normal", "gap"].iter().find(|name| !self.source.has(&place(name)));
        let tangential = d == 3 && self.has_reactions() && self.source.read::<f64>(&place("reaction"), 0..0)?.0 == [3];
        let required = required.or((tangential && !self.source.has(&place("tangent"))).then_some(&"tangent"));
        if let Some(missing) = required {
            return Err(self.source.damaged(&place(missing), "it is missing"));
        }
        Ok(ContactRows {
            pair: self.pairs_in(range.clone())?,
            point: column("point", &[d])?,
            normal: column("normal", &[d])?,
            tangent: column("tangent", &[d])?,
            reaction: column("reaction", &[1, d])?,
            moment: column("moment", if d == 2 { &[1] } else { &[2, 3] })?,
            gap: column("gap", &[1])?,
            status: self.source.coded(&place("status"), codes, range.len())?,
            bond,
        })
    }

    /// The names of the observables, sorted.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn observable_names(&self) -> Result<Vec<String>> {
        observed::names(&self.source)
    }

    /// One observable over the whole run, `None` if it was not recorded.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn observable(&self, name: &str) -> Result<Option<Series>> {
        observed::series(&self.source, name, 0..self.observed_steps())
    }

    /// The value of a scalar observable in one row, after the last frame too; none if it was not
    /// recorded.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn observed_in(&self, name: &str, row: usize) -> Result<Option<f64>> {
        Ok(observed::series(&self.source, name, row..row + 1)?.and_then(|series| series.value.first().copied()))
    }

    /// Whether the time counts breaks: the run loads from break to break (`rupture: next_event`).
    pub fn follows_breaks(&self) -> bool {
        self.source.has("observables/load_time")
    }

    /// Every bond that broke, in order; empty for a scene without bonds.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`].
    pub fn ruptures(&self) -> Result<Vec<Rupture>> {
        if !self.source.has(path::RUPTURE) {
            return Ok(vec![]);
        }
        let (_, events) = RuptureRow::read(&self.source, path::RUPTURE, 0..self.events)?;
        let event = |(k, row): (usize, &RuptureRow)| {
            row.event().ok_or_else(|| sound::row(&self.source.path, path::RUPTURE, k, "an unknown mode"))
        };
        let known: Vec<Rupture> = events.iter().enumerate().map(event).collect::<Result<_>>()?;
        let (counts, last) = ([self.bonds()?.len(), self.grains], self.steps.last().copied().unwrap_or(i64::MAX));
        sound::ruptures(&self.source.path, path::RUPTURE, &known, counts, last)?;
        Ok(known)
    }
}

/// Helpers of the methods above.
impl History {
    fn check_frame(&self, frame: usize) -> Result<()> {
        if frame < self.frames() {
            return Ok(());
        }
        Err(HistoryError::NoFrame { path: self.source.path.clone(), frame, frames: self.frames() })
    }

    /// Admissible positions of grains, computed from the first frame.
    fn surroundings(&self) -> Result<&Surroundings> {
        if let Some(known) = self.surroundings.get() {
            return Ok(known);
        }
        let (radius, d) = (self.grains()?.radius, self.dimension);
        let first = self.frame_values(0, &format!("{}/position", path::GRAINS), self.grains * d)?;
        Ok(self.surroundings.get_or_init(|| Surroundings::of(&radius, &first, d)))
    }

    /// The values of the H5MD element `place` at one frame, `expected` numbers; none for rotations
    /// that were not recorded.
    fn frame_values(&self, frame: usize, place: &str, expected: usize) -> Result<Vec<f64>> {
        self.check_frame(frame)?;
        let turning = ["angular_velocity", "angle", "orientation"].iter().any(|name| place.ends_with(name));
        if expected == 0 || (turning && !self.source.has(place)) {
            return Ok(vec![]);
        }
        let place = format!("{place}/value");
        let (_, values) = self.source.read(&place, frame..frame + 1)?;
        if values.len() != expected {
            return Err(self.source.damaged(&place, &format!("it has {} values instead of {expected}", values.len())));
        }
        sound::reals(&self.source.path, &place, frame, expected, &values)?;
        Ok(values)
    }

    /// A column of the contacts; the length of a row is one of `widths`. Empty if the scene has no
    /// such column.
    fn reals_in(&self, range: Range<usize>, name: &str, widths: &[usize]) -> Result<Vec<f64>> {
        let place = format!("{}/{name}", path::CONTACTS);
        if !self.source.has(&place) {
            return Ok(vec![]);
        }
        let (row, values) = self.source.read::<f64>(&place, range.clone())?;
        if !widths.contains(&row.iter().product()) {
            return Err(self.source.damaged(&place, "its rows have a different length"));
        }
        sound::reals(&self.source.path, &place, range.start, row.iter().product(), &values)?;
        Ok(values)
    }

    /// Pairs of contacts; all their grains and walls must exist.
    fn pairs_in(&self, range: Range<usize>) -> Result<Vec<[i32; 2]>> {
        let place = format!("{}/pair", path::CONTACTS);
        let (row, flat) = self.source.read::<i32>(&place, range.clone())?;
        if row != [2] {
            return Err(self.source.damaged(&place, "its rows have a different length"));
        }
        let (grains, walls) = (self.grains as i32, self.walls as i32);
        let pairs = pairs(&flat);
        let known = |&[i, j]: &[i32; 2]| (0..grains).contains(&i) && (-walls..grains).contains(&j);
        match pairs.iter().position(|pair| !known(pair)) {
            Some(k) => {
                let [i, j] = pairs[k];
                let why = format!("{i}, {j} are not a pair of bodies: there are {grains} grains and {walls} walls");
                Err(sound::row(&self.source.path, &place, range.start + k, why))
            }
            None => Ok(pairs),
        }
    }
}

fn pairs(flat: &[i32]) -> Vec<[i32; 2]> {
    flat.as_chunks().0.to_vec()
}
