//! The companion for MDAnalysis: H5MD with positions of three components.

use hdf5::types::VarLenUnicode;
use hdf5::{Group, Location};

use super::companion::{Companion, Piece, first};
use super::outline::Outline;
use super::vtk::{POSITION, RADIUS, VELOCITY};

const STEP: &str = "particles/grains/position/step";
const TIME: &str = "particles/grains/position/time";

/// The motion of the grains, as the group `trajectory`, and their constant properties.
///
/// MDAnalysis has no unit metre and rejects unknown units. So lengths have no attribute `unit`, and
/// the user must disable the conversion of units.
pub(super) fn trajectory(companion: &Companion, o: &Outline) -> hdf5::Result<()> {
    let h5md = companion.file.create_group("h5md")?;
    h5md.new_attr_builder().with_data(&[1i32, 1]).create("version")?;
    let author = h5md.create_group("author")?;
    text(&author, "name", "dem-post")?;
    let creator = h5md.create_group("creator")?;
    text(&creator, "name", "dem-post")?;
    text(&creator, "version", env!("CARGO_PKG_VERSION"))?;

    let grains = companion.file.create_group("particles")?.create_group("trajectory")?;
    let cell = grains.create_group("box")?;
    cell.new_attr::<i32>().create("dimension")?.write_scalar(&3)?;
    cell.new_attr_builder().with_data(&vec![unicode("none"); 3]).create("boundary")?;
    element(companion, &grains, "position", POSITION, o)?;
    element(companion, &grains, "velocity", VELOCITY, o)?;
    let velocity = grains.dataset("velocity/value")?;
    text(&velocity, "unit", "m s-1")?;
    for (name, place) in [("id", "particles/grains/id"), ("radius", RADIUS), ("mass", "particles/grains/mass")] {
        companion.link(&grains, name, place)?;
    }
    Ok(())
}

/// Vectors of all frames with their steps and times.
fn element(companion: &Companion, grains: &Group, name: &str, place: &'static str, o: &Outline) -> hdf5::Result<()> {
    let (t, n, d) = (o.frames, o.grains, o.dimension);
    let group = grains.create_group(name)?;
    companion.series::<i64>(&group, "step", STEP, t)?;
    companion.series::<f64>(&group, "time", TIME, t)?;
    let vectors = first(&[t, n, d]);
    companion.map::<f64>(
        &group,
        "value",
        &[t, n, 3],
        &[Piece { place, in_companion: false, from: vectors.clone(), to: vectors }],
    )
}

fn text(location: &Location, name: &str, value: &str) -> hdf5::Result<()> {
    location.new_attr::<VarLenUnicode>().create(name)?.write_scalar(&unicode(value))
}

fn unicode(value: &str) -> VarLenUnicode {
    value.parse().unwrap_or_default()
}
