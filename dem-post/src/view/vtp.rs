//! Poly data in VTK's XML format, one file a frame, with a list of the files and their times: for
//! ParaView before 5.13 and VTK before 9.4, which do not read the companions in HDF5.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_history::{Bonds, ContactRows, GrainState, Grains, History};

use super::outline::Outline;
use super::report::Report;
use crate::output::{Folder, Result, progress};

/// A file while it is written: the arrays of its points and of its cells, in XML.
struct Poly {
    points: String,
    point_data: String,
    cell_data: String,
    cells: Vec<i64>,
    /// Points of each cell.
    size: usize,
    count: usize,
}

/// Writes the files of all frames and, for each kind, its list.
///
/// # Errors
/// [`crate::output::PostError::Write`], and those of reading the history.
pub(super) fn write(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let constant = Constant { grains: history.grains()?, bonds: history.bonds()? };
    let frames = history.frames();
    let bar = progress(frames as u64, quiet, "{bar:24} {pos} of {len} frames, {eta} left");
    let kinds: Vec<&str> = report.companions.iter().map(|companion| kind(companion.name)).collect();
    let names: Vec<String> = (0..frames).flat_map(|frame| kinds.iter().map(move |kind| file(kind, frame))).collect();
    folder.announce(&names)?;
    for frame in 0..frames {
        let state = history.grain_state(frame)?;
        for companion in &mut report.companions {
            let poly = match companion.name {
                "grains.pvd" => grains(&constant, &state, history.dimension()),
                "contacts.pvd" => contacts(history, frame, &state, &report.outline)?,
                _ => bonds(history, &constant, frame, &state)?,
            };
            let text = poly.xml(history.times()[frame]);
            folder.write(&file(kind(companion.name), frame), text.as_bytes())?;
            companion.bytes += text.len() as u64;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    // last: a list names only files that exist
    for companion in &mut report.companions {
        let list = list(kind(companion.name), history.times());
        folder.write(companion.name, list.as_bytes())?;
        companion.bytes += list.len() as u64;
    }
    Ok(())
}

fn kind(list: &str) -> &str {
    list.trim_end_matches(".pvd")
}

fn file(kind: &str, frame: usize) -> String {
    format!("{kind}-{frame:05}.vtp")
}

fn list(kind: &str, times: &[f64]) -> String {
    let mut text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n".to_string();
    for (frame, time) in times.iter().enumerate() {
        let _ = writeln!(text, "<DataSet timestep=\"{time:e}\" part=\"0\" file=\"{}\"/>", file(kind, frame));
    }
    text + "</Collection>\n</VTKFile>\n"
}

/// What does not change over the frames.
struct Constant {
    grains: Grains,
    bonds: Bonds,
}

fn grains(constant: &Constant, state: &GrainState, d: usize) -> Poly {
    let Grains { id, radius, mass, material, .. } = &constant.grains;
    let mut poly = Poly::new(&padded(&state.position, d), (0..radius.len() as i64).collect(), 1);
    let data = &mut poly.point_data;
    integers(data, "id", id);
    reals(data, "radius", 1, radius);
    reals(data, "mass", 1, mass);
    if !material.is_empty() {
        integers(data, "material", &material.iter().map(|&material| material.into()).collect::<Vec<i32>>());
    }
    reals(data, "velocity", 3, &padded(&state.velocity, d));
    if !state.angular_velocity.is_empty() {
        // in 2D a grain turns about z
        let about_z = || state.angular_velocity.iter().flat_map(|&spin| [0.0, 0.0, spin]).collect();
        let spins: Vec<f64> = if d == 2 { about_z() } else { state.angular_velocity.clone() };
        reals(data, "angular_velocity", 3, &spins);
        let (name, width) = if d == 2 { ("angle", 1) } else { ("orientation", 4) };
        reals(data, name, width, &state.orientation);
    }
    poly
}

fn bonds(history: &History, constant: &Constant, frame: usize, state: &GrainState) -> Result<Poly> {
    let (bonds, status) = (&constant.bonds, history.bond_status(frame)?);
    // none before a stage forms them
    let count = status.len();
    let lines = bonds.pair[..count].as_flattened().iter().map(|&grain| grain.into()).collect();
    let mut poly = Poly::new(&padded(&state.position, history.dimension()), lines, 2);
    let data = &mut poly.cell_data;
    integers(data, "status", &status.iter().map(|status| *status as i32).collect::<Vec<_>>());
    for (name, values) in [
        ("strength", &bonds.strength),
        ("friction", &bonds.friction),
        ("rest_gap", &bonds.rest_gap),
        ("mean_diameter", &bonds.mean_diameter),
    ] {
        reals(data, name, 1, &values[..count]);
    }
    Ok(poly)
}

/// Lines between the centres of two grains, or from a grain's centre to its point of contact with
/// a wall. The points are the grains, followed by the points on walls.
fn contacts(history: &History, frame: usize, state: &GrainState, outline: &Outline) -> Result<Poly> {
    let (mut points, d) = (state.position.clone(), history.dimension());
    let contacts = history.contacts(frame)?;
    let mut lines = Vec::with_capacity(2 * contacts.len());
    for (&[i, j], point) in contacts.pair.iter().zip(contacts.point.chunks_exact(d)) {
        lines.push(i.into());
        if j >= 0 {
            lines.push(j.into());
        } else {
            lines.push((points.len() / d) as i64);
            points.extend(point);
        }
    }
    let mut poly = Poly::new(&padded(&points, d), lines, 2);
    let data = &mut poly.cell_data;
    let ContactRows { pair, point, normal, tangent, reaction, moment, gap, status, bond } = &contacts;
    if history.has_reactions() {
        let (m, rows) = (pair.len(), outline.reaction_rows);
        reals(data, "normal_force", 1, &(0..m).map(|c| contacts.normal_force(c)).collect::<Vec<_>>());
        if rows > 1 {
            let along: Vec<f64> = reaction.chunks_exact(rows).flat_map(|row| row[1..].to_vec()).collect();
            reals(data, "tangential_force", rows - 1, &along);
        }
    }
    if outline.moment_rows > 0 {
        reals(data, "moment", outline.moment_rows, moment);
    }
    reals(data, "point", 3, &padded(point, d));
    reals(data, "normal", 3, &padded(normal, d));
    if outline.tangents {
        reals(data, "tangent", 3, tangent);
    }
    reals(data, "gap", 1, gap);
    integers(data, "status", &status.iter().map(|status| *status as i32).collect::<Vec<_>>());
    if outline.bonds > 0 {
        integers(data, "bond", bond);
    }
    Ok(poly)
}

impl Poly {
    /// Points (three numbers each), and the points that the cells of `size` points join.
    fn new(points: &[f64], cells: Vec<i64>, size: usize) -> Self {
        let mut text = String::new();
        reals(&mut text, "Points", 3, points);
        let [point_data, cell_data] = [const { String::new() }; 2];
        Self { points: text, point_data, cell_data, cells, size, count: points.len() / 3 }
    }

    fn xml(&self, time: f64) -> String {
        let Self { points, point_data, cell_data, cells, size, count } = self;
        let number = cells.len() / size;
        let (kind, [verts, lines]) = if *size == 1 { ("Verts", [number, 0]) } else { ("Lines", [0, number]) };
        let mut joined = String::new();
        let ends: Vec<u8> = (1..=number).flat_map(|cell| ((cell * size) as i64).to_le_bytes()).collect();
        let ids: Vec<u8> = cells.iter().flat_map(|id| id.to_le_bytes()).collect();
        array(&mut joined, "Int64", "connectivity", 1, &ids);
        array(&mut joined, "Int64", "offsets", 1, &ends);
        format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
             <PolyData>\n\
             <FieldData>\n\
             <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time:e}</DataArray>\n\
             </FieldData>\n\
             <Piece NumberOfPoints=\"{count}\" NumberOfVerts=\"{verts}\" NumberOfLines=\"{lines}\" \
             NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n\
             <PointData>\n{point_data}</PointData>\n\
             <CellData>\n{cell_data}</CellData>\n\
             <Points>\n{points}</Points>\n\
             <{kind}>\n{joined}</{kind}>\n\
             </Piece>\n</PolyData>\n</VTKFile>\n"
        )
    }
}

/// Rows of `d` numbers padded to three.
fn padded(values: &[f64], d: usize) -> Vec<f64> {
    values.chunks_exact(d).flat_map(|row| (0..3).map(|k| row.get(k).copied().unwrap_or(0.0))).collect()
}

fn reals(text: &mut String, name: &str, width: usize, values: &[f64]) {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    array(text, "Float64", name, width, &bytes);
}

fn integers(text: &mut String, name: &str, values: &[i32]) {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    array(text, "Int32", name, 1, &bytes);
}

/// An array in Base64: its length in bytes, followed by its numbers.
fn array(text: &mut String, kind: &str, name: &str, width: usize, bytes: &[u8]) {
    let with_length = [&(bytes.len() as u64).to_le_bytes(), bytes].concat();
    let _ = writeln!(
        text,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{width}\" format=\"binary\">{}</DataArray>",
        STANDARD.encode(with_length)
    );
}
