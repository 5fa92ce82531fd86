//! Scenes: what is simulated, as a JSON text with comments, in SI units.
//!
//! A text becomes a scene in four steps, each in its own file:
//!
//! ```text
//! text ──parse──▶ JSON tree ──set──▶ JSON tree ──decode──▶ Scene ──validate──▶ Scene
//!       syntax,              --set            unknown names,      wrong values,
//!       duplicate keys       assignments      wrong types         all at once
//! ```
//!
//! The types of the model are plain numbers, so that a scene can be written back as JSON
//! ([`Scene::to_json`]) and described as a JSON Schema ([`schema::json_schema`]). What they
//! mean in the simulation is decided where the sample is built.

mod difference;
mod error;
mod function;
mod model;
pub(crate) mod parse;
mod sample;
pub mod schema;
mod set;
mod solver;
mod suggest;
mod validate;
mod wall;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

pub use difference::{Difference, differences};
pub(crate) use error::shorten;
pub use error::{Origin, Problem, SceneError};
pub use function::{Function, Ramp};
pub use model::{
    Bonds, Flow, Friction, Grains, Load, Materials, Output, Precision, Restitution, Rupture, Scene, Springs, Stiffness,
    Stop, Time, TravelFrom, WallTravel, Young, choose_load_wall,
};
pub use sample::{
    Compaction, Cut, Deposition, Diameters, GrainSpec, Lattice, Preparation, RandomSample, Sample, SampleFile, Section,
    UniformRange,
};
pub use solver::{GaussSeidel, LocalSolve, Newton, Solver, SolverKind, Start};
pub use validate::validate;
pub use wall::{Circle, Cylinder, Drive, Place, Plane, Shape, Sphere, Wall, WallMass};

/// Reads the scene in the file `path`, applies the `--set` assignments and validates the result.
///
/// A sample file named by the scene is sought beside the scene; the path in the scene that
/// comes back is already joined to the scene's folder.
///
/// # Errors
/// [`SceneError`]: an unreadable file, wrong syntax, wrong structure, or all wrong values.
pub fn load(path: &Path, assignments: &[String]) -> Result<Scene, SceneError> {
    let mut document = parse::parse(&path.display().to_string(), &read(path)?)?;
    set::apply(&mut document, assignments).map_err(|problems| document.wrong(problems))?;
    let mut scene = finish(&document).map_err(|problems| document.wrong(problems))?;
    join_sample(&mut scene, path);
    Ok(scene)
}

/// The text of a file.
fn read(path: &Path) -> Result<String, SceneError> {
    let unreadable = |source| SceneError::Read { path: path.to_path_buf(), source };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    String::from_utf8(bytes).map_err(|error| unreadable(std::io::Error::new(std::io::ErrorKind::InvalidData, error)))
}

/// A sample file is sought beside the scene.
fn join_sample(scene: &mut Scene, path: &Path) {
    if let (Sample::File(file), Some(folder)) = (&mut scene.sample, path.parent()) {
        file.path = folder.join(&file.path);
    }
}

/// Reads a scene from `text`, applies the `--set` assignments and validates the result.
///
/// `name` stands in the error messages for the place that the text comes from. Paths inside
/// the scene stay as they are written.
///
/// # Errors
/// [`SceneError`]: wrong syntax, wrong structure, or all wrong values.
pub fn from_text(name: &str, text: &str, assignments: &[String]) -> Result<Scene, SceneError> {
    let mut document = parse::parse(name, text)?;
    set::apply(&mut document, assignments).map_err(|problems| document.wrong(problems))?;
    finish(&document).map_err(|problems| document.wrong(problems))
}

/// The scene that a tree describes, or all that is wrong with it.
fn finish(document: &parse::Document) -> Result<Scene, Vec<Problem>> {
    let mut scene: Scene = document.decode().map_err(|problem| vec![problem])?;
    let accept = solver::default_accept(scene.solver.tolerance, scene.bonds.is_some());
    scene.solver.accept.get_or_insert(accept);
    let problems = document.merge_non_finite(validate(&scene));
    if problems.is_empty() { Ok(scene) } else { Err(problems) }
}

/// A scene whose values are yet to be varied.
#[derive(Debug)]
pub(crate) struct Base {
    path: PathBuf,
    document: parse::Document,
}

/// A value that a sweep puts in a scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Change {
    /// Where in the scene.
    pub path: String,
    /// What.
    pub value: serde_json::Value,
    /// The place in the sweep that says so.
    pub place: String,
}

impl Base {
    /// Reads the text; it need not be a right scene before its values are put in.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let document = parse::parse(&path.display().to_string(), &read(path)?)?;
        Ok(Self { path: path.to_path_buf(), document })
    }

    /// The scene with these values.
    ///
    /// # Errors
    /// All that is wrong with it, with the place that it was written: in the sweep or in the scene.
    pub fn with(&self, changes: &[Change]) -> Result<Scene, Vec<Problem>> {
        let mut document = self.document.clone();
        for Change { path, value, place } in changes {
            set::put(&mut document, path, value.clone(), place)
                .map_err(|problem| vec![problem.with_origin(Origin::Sweep(place.as_str().into()))])?;
        }
        let located = |problem: Problem| match document.origin(&problem.path) {
            Some(origin) => problem.with_origin(origin),
            None => problem,
        };
        let mut scene =
            finish(&document).map_err(|problems| problems.into_iter().map(located).collect::<Vec<Problem>>())?;
        join_sample(&mut scene, &self.path);
        Ok(scene)
    }
}
