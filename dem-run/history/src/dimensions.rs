//! Names of the axes of datasets, as HDF5 dimension scales: h5py, xarray and netCDF read them.
//!
//! A scale is a dataset with the attributes CLASS and NAME. A dataset that it labels refers to it
//! in DIMENSION_LIST, and the scale refers back in REFERENCE_LIST (HDF5 Dimension Scale
//! Specification). The times of the frames and of the steps are scales. The other axes have scales
//! without values at the top of the file, where netCDF finds them from each group; their NAME says
//! that they are no variables. Nothing is written to them during the run.

use std::collections::BTreeMap;

use hdf5::globals::H5T_C_S1;
use hdf5::types::{FixedAscii, VarLenArray};
use hdf5::{Dataset, Datatype, Extent, File, H5Type, ObjectReference1, SimpleExtents};
use hdf5_sys::h5t::{H5Tcopy, H5Tset_size};

use super::schema::path;
use super::wall::WallColumn;

/// The scales of frames and of observed steps.
const FRAMES: &str = "particles/grains/position/time";
const STEPS: &str = "observables/time";
/// The NAME of a scale that is no variable, as netCDF has it, without the length that follows.
const NO_VARIABLE: &str = "This is a netCDF dimension but not a netCDF variable.";

/// The axes of each dataset. One with fewer axes has the first of them.
const AXES: &[(&str, &[&str])] = &[
    ("particles/grains/position/step", &[FRAMES]),
    ("particles/grains/position/value", &[FRAMES, "grain", "axis"]),
    ("particles/grains/velocity/value", &[FRAMES, "grain", "axis"]),
    ("particles/grains/angular_velocity/value", &[FRAMES, "grain", "axis"]),
    ("particles/grains/angle/value", &[FRAMES, "grain"]),
    ("particles/grains/orientation/value", &[FRAMES, "grain", "quaternion"]),
    ("particles/grains/id", &["grain"]),
    ("particles/grains/radius", &["grain"]),
    ("particles/grains/mass", &["grain"]),
    ("particles/grains/inertia", &["grain"]),
    ("particles/grains/material", &["grain"]),
    ("materials/name", &["material"]),
    ("walls/name", &["wall"]),
    ("walls/kind", &["wall"]),
    ("walls/drive", &["wall"]),
    ("walls/position/value", &[FRAMES, "wall", "axis"]),
    ("walls/velocity/value", &[FRAMES, "wall", "axis"]),
    ("walls/force/value", &[FRAMES, "wall", "axis"]),
    ("contacts/start", &[FRAMES]),
    ("contacts/count", &[FRAMES]),
    ("contacts/pair", &["contact", "body"]),
    ("contacts/point", &["contact", "axis"]),
    ("contacts/normal", &["contact", "axis"]),
    ("contacts/tangent", &["contact", "axis"]),
    ("contacts/reaction", &["contact", "force_component"]),
    ("contacts/moment", &["contact", "moment_component"]),
    ("contacts/gap", &["contact"]),
    ("contacts/status", &["contact"]),
    ("contacts/bond", &["contact"]),
    ("bonds/pair", &["bond", "body"]),
    ("bonds/rest_gap", &["bond"]),
    ("bonds/strength", &["bond"]),
    ("bonds/friction", &["bond"]),
    ("bonds/rolling", &["bond"]),
    ("bonds/twist", &["bond"]),
    ("bonds/mean_diameter", &["bond"]),
    ("bonds/status/value", &[FRAMES, "bond"]),
    ("bonds/formed", &["stage"]),
    ("observables/step", &[STEPS]),
];

/// The axes of the value of an observable, beside that of the steps; none where it is unknown.
fn axes_of(observable: &str) -> &'static [&'static str] {
    match observable {
        "momentum" => &["axis"],
        "angular_momentum" => &["spin_axis"],
        "stress" | "strain" => &["axis", "other_axis"],
        "wall_position" | "wall_force" | "wall_force_at_limit" => &["wall", "axis"],
        "applied_force" | "wall_load" => &["wall"],
        _ => &[],
    }
}

/// A dataset, and which of its axes a scale labels.
#[derive(Clone, Copy, H5Type)]
#[repr(C, packed)]
struct Labelled {
    dataset: ObjectReference1,
    dimension: i32,
}

/// Names the axes of all datasets of a file.
pub(super) fn label(file: &File) -> hdf5::Result<()> {
    let mut scales = BTreeMap::new();
    for (place, axes) in AXES {
        if file.link_exists(place) {
            attach(file, &mut scales, place, axes)?;
        }
    }
    if file.link_exists(path::WALLS) {
        for column in WallColumn::ALL {
            let place = format!("{}/{}", path::WALLS, column.name);
            if file.link_exists(&place) {
                attach(file, &mut scales, &place, &["wall", "axis"])?;
            }
        }
    }
    for group in file.group(path::OBSERVABLES)?.groups()? {
        let place = group.name().trim_start_matches('/').to_string();
        let axes = axes_of(place.rsplit('/').next().unwrap_or_default());
        let value = format!("{place}/value");
        // one without a name has none: readers reject a dataset of which some axes have names
        if file.dataset(&value)?.ndim() == 1 + axes.len() {
            attach(file, &mut scales, &value, &[&[STEPS], axes].concat())?;
        }
    }
    for (name, labelled) in &scales {
        let scale = file.dataset(name)?;
        let text = match *name {
            FRAMES | STEPS => "time".into(),
            _ => format!("{NO_VARIABLE}{:>10}", scale.size()),
        };
        terminated(&scale, "CLASS", "DIMENSION_SCALE")?;
        terminated(&scale, "NAME", &text)?;
        scale.new_attr_builder().with_data(labelled).create("REFERENCE_LIST")?;
    }
    Ok(())
}

/// Labels the axes of a dataset; makes the scales that do not exist yet.
fn attach(
    file: &File,
    scales: &mut BTreeMap<&'static str, Vec<Labelled>>,
    place: &str,
    axes: &[&'static str],
) -> hdf5::Result<()> {
    let dataset = file.dataset(place)?;
    let itself = file.reference::<ObjectReference1>(place)?;
    let mut list: Vec<VarLenArray<ObjectReference1>> = vec![];
    for (dimension, (length, name)) in dataset.shape().into_iter().zip(axes).enumerate() {
        if !scales.contains_key(name) && *name != FRAMES && *name != STEPS {
            // bonds of a stage have no length yet, also in a copy that begins with them
            let grows = *name == "bond" && file.link_exists(path::FORMED);
            create(file, name, if grows { 0 } else { length })?;
        }
        list.push([file.reference(name)?].into());
        scales.entry(name).or_default().push(Labelled { dataset: itself, dimension: dimension as i32 });
    }
    dataset.new_attr_builder().with_data(&list).create("DIMENSION_LIST")?;
    Ok(())
}

/// Makes a scale without values. It takes no room: HDF5 stores values when they are written.
fn create(file: &File, name: &str, length: usize) -> hdf5::Result<()> {
    let builder = file.new_dataset::<u8>();
    if length == 0 {
        // an axis that grows, as that of the contacts: readers take its length from the datasets
        let extent = SimpleExtents::from(vec![Extent::resizable(0)]);
        builder.shape(extent).chunk(4096).obj_track_times(false).create(name)?;
    } else {
        builder.shape(length).obj_track_times(false).create(name)?;
    }
    Ok(())
}

/// Gives a scale a text attribute that ends with NUL: HDF5 accepts no other kind of text here, and
/// the types of texts that the crate `hdf5` makes end otherwise.
fn terminated(scale: &Dataset, name: &str, text: &str) -> hdf5::Result<()> {
    // Sound: both calls get a type that exists, and the copy has no other owner than the result.
    let kind: Datatype = hdf5::sync::sync(|| unsafe {
        let copy = H5Tcopy(*H5T_C_S1);
        H5Tset_size(copy, text.len() + 1);
        hdf5::from_id(copy)
    })?;
    let text = FixedAscii::<80>::from_ascii(text).map_err(|error| hdf5::Error::Internal(error.to_string()))?;
    scale.new_attr_builder().empty_as(kind).create(name)?.write_scalar(&text)
}
