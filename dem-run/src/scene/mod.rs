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

mod error;
mod function;
mod model;
mod parse;
mod sample;
pub mod schema;
mod set;
mod solver;
mod suggest;
mod validate;
mod wall;

#[cfg(test)]
mod tests;

use std::path::Path;

pub use error::{Origin, Problem, SceneError};
pub use function::{Function, Ramp};
pub use model::{
    Bonds, Flow, Friction, Grains, Load, Materials, Output, Restitution, Rupture, Scene, Springs, Stiffness, Stop,
    Time, TravelFrom, WallTravel, Young,
};
pub use sample::{
    Compaction, Deposition, Diameters, GrainSpec, Lattice, Preparation, RandomSample, Sample, SampleFile, UniformRange,
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
    let unreadable = |source| SceneError::Read { path: path.to_path_buf(), source };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let text = String::from_utf8(bytes)
        .map_err(|error| unreadable(std::io::Error::new(std::io::ErrorKind::InvalidData, error)))?;
    let mut scene = from_text(&path.display().to_string(), &text, assignments)?;
    if let (Sample::File(file), Some(folder)) = (&mut scene.sample, path.parent()) {
        file.path = folder.join(&file.path);
    }
    Ok(scene)
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
    let mut scene: Scene = document.decode().map_err(|problem| document.wrong(vec![problem]))?;
    let accept = solver::default_accept(scene.solver.tolerance, scene.bonds.is_some());
    scene.solver.accept.get_or_insert(accept);
    let problems = document.merge_non_finite(validate(&scene));
    if problems.is_empty() { Ok(scene) } else { Err(document.wrong(problems)) }
}
