//! Companions in VTK's HDF5 format, as poly data over time: grains as points, contacts and bonds as
//! lines.
//!
//! VTK expects all frames of an array one after the other and, for each frame, the index of its
//! first element. Positions of shape [T,N,D] are such an array of T N points, and the pairs of a
//! frame are lines between them.

use dem_history::History;
use hdf5::{Group, H5Type, Hyperslab, SliceOrIndex};
use indicatif::ProgressBar;
use ndarray::ArrayView3;

use super::companion::{Companion, Fault, Piece, Rows, append, blocks, first, label, span, wrong_shape};
use super::outline::Outline;

pub(super) const POSITION: &str = "particles/grains/position/value";
pub(super) const VELOCITY: &str = "particles/grains/velocity/value";
pub(super) const RADIUS: &str = "particles/grains/radius";
const TIME: &str = "particles/grains/position/time";
/// Names of the datasets of the lines of contacts and of the points on walls.
const LINES: &str = "lines";
const PLACES: &str = "wall_points";
/// Chunk size, in numbers, of lists of unknown length.
const CHUNK: usize = 1 << 14;

/// The groups of cells of poly data; a companion uses one of them.
const CELLS: [&str; 4] = ["Vertices", "Lines", "Strips", "Polygons"];

/// `/VTKHDF` while it is written.
struct Poly<'a> {
    companion: &'a Companion<'a>,
    root: Group,
    steps: Group,
    frames: usize,
}

impl<'a> Poly<'a> {
    /// The frames with their times; frame k has `counts[k]` points from `offsets[k]` on.
    fn create(companion: &'a Companion<'a>, counts: &[i64], offsets: &[i64]) -> hdf5::Result<Self> {
        let frames = counts.len();
        let root = companion.file.create_group("VTKHDF")?;
        root.new_attr_builder().with_data(&[2i64, 0]).create("Version")?;
        label(&root, "Type", "PolyData")?;
        let steps = root.create_group("Steps")?;
        steps.new_attr::<i64>().create("NSteps")?.write_scalar(&(frames as i64))?;
        companion.series::<f64>(&steps, "Values", TIME, frames)?;
        let parts: Vec<i64> = (0..frames as i64).collect();
        companion.write(&steps, "PartOffsets", &[frames], &parts)?;
        companion.write(&steps, "NumberOfParts", &[frames], &vec![1i64; frames])?;
        companion.write(&steps, "PointOffsets", &[frames], offsets)?;
        companion.write(&root, "NumberOfPoints", &[frames], counts)?;
        Ok(Self { companion, root, steps, frames })
    }

    /// Cells of `size` points each: frame k has `counts[k]`, and `Connectivity` lists their points
    /// from `offsets[k]` on. Returns the group for `Connectivity`.
    fn cells(&self, kind: &str, size: usize, counts: &[i64], offsets: &[i64]) -> hdf5::Result<Group> {
        let frames = [self.frames];
        for name in CELLS.iter().filter(|name| **name != kind) {
            let group = self.root.create_group(name)?;
            self.companion.write::<i32>(&group, "Connectivity", &[0], &[])?;
            self.companion.write(&group, "Offsets", &[1], &[0i32])?;
            for count in ["NumberOfCells", "NumberOfConnectivityIds"] {
                self.companion.write(&group, count, &frames, &vec![0i64; self.frames])?;
            }
        }
        let group = self.root.create_group(kind)?;
        let most = counts.iter().copied().max().unwrap_or(0) as i32;
        let starts: Vec<i32> = (0..=most).map(|cell| cell * size as i32).collect();
        let ids: Vec<i64> = counts.iter().map(|count| count * size as i64).collect();
        self.companion.write(&group, "Offsets", &[starts.len()], &starts)?;
        self.companion.write(&group, "NumberOfCells", &frames, counts)?;
        self.companion.write(&group, "NumberOfConnectivityIds", &frames, &ids)?;
        // one column per kind of cell; all frames share the starts of the cells
        let column = CELLS.iter().position(|name| *name == kind).unwrap_or(0);
        let mut table = vec![0i64; self.frames * CELLS.len()];
        self.companion.write(&self.steps, "CellOffsets", &[self.frames, CELLS.len()], &table)?;
        table.iter_mut().skip(column).step_by(CELLS.len()).zip(offsets).for_each(|(to, from)| *to = *from);
        self.companion.write(&self.steps, "ConnectivityIdOffsets", &[self.frames, CELLS.len()], &table)?;
        Ok(group)
    }

    /// The group of the data of points ("Point") or cells ("Cell"), ready for arrays.
    fn data(&self, of: &str, offsets: &[i64]) -> hdf5::Result<Data<'_>> {
        let values = self.root.create_group(&format!("{of}Data"))?;
        let starts = self.steps.create_group(&format!("{of}DataOffsets"))?;
        Ok(Data { companion: self.companion, values, starts, offsets: offsets.into() })
    }
}

/// Arrays of points or cells; those that change begin at `offsets[k]` at frame k. Arrays that the
/// history lacks are omitted.
struct Data<'a> {
    companion: &'a Companion<'a>,
    values: Group,
    starts: Group,
    offsets: Vec<i64>,
}

impl Data<'_> {
    /// An array that is constant over the frames.
    fn still(&self, name: &str, place: &str) -> hdf5::Result<()> {
        if !self.companion.has(place) {
            return Ok(());
        }
        self.companion.link(&self.values, name, place)?;
        self.companion.write(&self.starts, name, &[self.offsets.len()], &vec![0i64; self.offsets.len()])
    }

    /// An array with values at each frame.
    fn moving<T: H5Type>(
        &self,
        name: &str,
        place: &'static str,
        from: Vec<SliceOrIndex>,
        rows: &Rows,
    ) -> hdf5::Result<()> {
        if !self.companion.has(place) {
            return Ok(());
        }
        self.companion.array::<T>(&self.values, name, place, from, rows)?;
        self.companion.write(&self.starts, name, &[self.offsets.len()], &self.offsets)
    }
}

/// The grains as points.
pub(super) fn grains(companion: &Companion, o: &Outline) -> hdf5::Result<()> {
    let (t, n, d) = (o.frames, o.grains, o.dimension);
    let offsets = o.every(n);
    let poly = Poly::create(companion, &vec![n as i64; t], &offsets)?;
    companion.array::<f64>(&poly.root, "Points", POSITION, first(&[t, n, d]), &Rows::vectors(t * n, d))?;
    let cells = poly.cells("Vertices", 1, &vec![n as i64; t], &vec![0; t])?;
    let points: Vec<i32> = (0..n as i32).collect();
    companion.write(&cells, "Connectivity", &[n], &points)?;

    let data = poly.data("Point", &offsets)?;
    for (name, place) in [("id", "particles/grains/id"), ("radius", RADIUS), ("mass", "particles/grains/mass")] {
        data.still(name, place)?;
    }
    data.still("material", "particles/grains/material")?;
    data.moving::<f64>("velocity", VELOCITY, first(&[t, n, d]), &Rows::vectors(t * n, d))?;
    // in 2D a grain turns about z
    let (spin, axes) = if d == 2 { (first(&[t, n]), 2..3) } else { (first(&[t, n, 3]), 0..3) };
    let place = "particles/grains/angular_velocity/value";
    data.moving::<f64>("angular_velocity", place, spin, &Rows { count: t * n, width: 3, filled: axes })?;
    data.moving::<f64>("angle", "particles/grains/angle/value", first(&[t, n]), &Rows::scalars(t * n))?;
    let quaternions = Rows { count: t * n, width: 4, filled: 0..4 };
    data.moving::<f64>("orientation", "particles/grains/orientation/value", first(&[t, n, 4]), &quaternions)
}

/// The bonds as lines between the centres of their grains.
pub(super) fn bonds(companion: &Companion, o: &Outline) -> hdf5::Result<()> {
    let (t, n, b, d) = (o.frames, o.grains, o.bonds, o.dimension);
    let poly = Poly::create(companion, &vec![n as i64; t], &o.every(n))?;
    companion.array::<f64>(&poly.root, "Points", POSITION, first(&[t, n, d]), &Rows::vectors(t * n, d))?;
    let cells = poly.cells("Lines", 2, &vec![b as i64; t], &vec![0; t])?;
    companion.array::<i32>(&cells, "Connectivity", "bonds/pair", first(&[b, 2]), &Rows::scalars(2 * b))?;

    let data = poly.data("Cell", &o.every(b))?;
    // HDF5 converts the enum to a number that VTK can read
    data.moving::<u8>("status", "bonds/status/value", first(&[t, b]), &Rows::scalars(t * b))?;
    data.still("strength", "bonds/strength")?;
    data.still("friction", "bonds/friction")?;
    data.still("rest_gap", "bonds/rest_gap")?;
    data.still("mean_diameter", "bonds/mean_diameter")
}

/// The contacts as lines between the centres of two grains, or from a grain's centre to its point
/// of contact with a wall.
///
/// The points of a frame are the grains, which are mapped, followed by the points on walls, which
/// must be written. Every frame has room for the greatest number of points on walls of any frame,
/// so that one mapping applies to all frames. The pairs must also be written, once for consecutive
/// frames with equal pairs.
pub(super) fn contacts(companion: &Companion, history: &History, o: &Outline, bar: &ProgressBar) -> Result<(), Fault> {
    let (n, d) = (o.grains, o.dimension);
    let room = o.at_walls.iter().copied().max().unwrap_or(0) as usize;
    let counts: Vec<i64> = o.at_walls.iter().map(|&at_walls| n as i64 + at_walls).collect();
    let poly = Poly::create(companion, &counts, &o.every(n + room))?;
    let offsets = write_lines(companion, history, o, room, bar)?;
    let cells = poly.cells("Lines", 2, &o.counts, &offsets)?;
    companion.file.relink(LINES, &format!("{}/Connectivity", cells.name()))?;
    points(&poly, o, room)?;

    let data = poly.data("Cell", &o.starts)?;
    let (m, scalars) = (o.rows, Rows::scalars(o.rows));
    // reactions are optional in a history
    let rows = if companion.has("contacts/reaction") { companion.shape("contacts/reaction")?[1] } else { 0 };
    data.moving::<f64>("normal_force", "contacts/reaction", vec![span(0..m), span(0..1)], &scalars)?;
    if rows > 1 {
        // in 2D along (−n_y, n_x), in 3D along t1 and t2
        let along = Rows { count: m, width: rows - 1, filled: 0..rows - 1 };
        data.moving::<f64>("tangential_force", "contacts/reaction", vec![span(0..m), span(1..rows)], &along)?;
    }
    // along t1 and t2, and along n where bonds resist twist
    let twists = || companion.shape("contacts/moment").is_ok_and(|shape| shape.get(1) == Some(&3));
    let (moment, along) = match d {
        2 => (first(&[m]), 1),
        _ if companion.has("contacts/moment") && twists() => (first(&[m, 3]), 3),
        _ => (first(&[m, 2]), 2),
    };
    data.moving::<f64>("moment", "contacts/moment", moment, &Rows { count: m, width: along, filled: 0..along })?;
    for (name, place) in [("point", "contacts/point"), ("normal", "contacts/normal"), ("tangent", "contacts/tangent")] {
        data.moving::<f64>(name, place, first(&[m, d]), &Rows::vectors(m, d))?;
    }
    data.moving::<f64>("gap", "contacts/gap", first(&[m]), &scalars)?;
    data.moving::<u8>("status", "contacts/status", first(&[m]), &scalars)?;
    Ok(data.moving::<i32>("bond", "contacts/bond", first(&[m]), &scalars)?)
}

/// Writes the lines and the points on walls; returns the first line of each frame.
fn write_lines(
    companion: &Companion,
    history: &History,
    o: &Outline,
    room: usize,
    bar: &ProgressBar,
) -> Result<Vec<i64>, Fault> {
    let list = companion.file.new_dataset::<i32>().shape(0..).chunk(CHUNK).create(LINES)?;
    let places = companion.file.new_dataset::<f64>().shape([o.frames, room, o.dimension]).create(PLACES)?;
    let (mut offsets, mut last, mut start) = (vec![], vec![], 0);
    for frame in 0..o.frames {
        bar.inc(1);
        let (lines, at_walls) = lines(&history.contact_pairs(frame)?, &history.contact_points(frame)?, o);
        if lines != last {
            start = list.size() as i64;
            append(&list, &lines)?;
            last = lines;
        }
        offsets.push(start);
        if !at_walls.is_empty() {
            let rows = at_walls.len() / o.dimension;
            let view = ArrayView3::from_shape([1, rows, o.dimension], &at_walls).map_err(wrong_shape)?;
            places.write_slice(
                view,
                Hyperslab::from(vec![span(frame..frame + 1), span(0..rows), span(0..o.dimension)]),
            )?;
        }
    }
    Ok(offsets)
}

/// The lines of one frame as pairs of points, and the points on walls, which follow the grains.
fn lines(pairs: &[[i32; 2]], points: &[f64], o: &Outline) -> (Vec<i32>, Vec<f64>) {
    let (mut lines, mut at_walls) = (Vec::with_capacity(2 * pairs.len()), vec![]);
    for (&[i, j], point) in pairs.iter().zip(points.chunks_exact(o.dimension)) {
        if j >= 0 {
            lines.extend([i, j]);
        } else {
            lines.extend([i, (o.grains + at_walls.len() / o.dimension) as i32]);
            at_walls.extend(point);
        }
    }
    (lines, at_walls)
}

/// Maps the points of all frames: the grains, followed by the points on walls.
fn points(poly: &Poly, o: &Outline, room: usize) -> hdf5::Result<()> {
    let (t, n, d) = (o.frames, o.grains, o.dimension);
    let each = |start, block| vec![blocks(start, n + room, t, block), span(0..d)];
    let mut pieces = vec![Piece { place: POSITION, in_companion: false, from: first(&[t, n, d]), to: each(0, n) }];
    if room > 0 {
        pieces.push(Piece { place: PLACES, in_companion: true, from: first(&[t, room, d]), to: each(n, room) });
    }
    poly.companion.map::<f64>(&poly.root, "Points", &[t * (n + room), 3], &pieces)
}
