//! Scenes: the input of a simulation, a JSON text with comments, in SI units.
//!
//! A text becomes a scene in four steps, each in its own file:
//!
//! ```text
//! text ──parse──▶ JSON tree ──set──▶ JSON tree ──decode──▶ Scene ──validate──▶ Scene
//!       syntax,              --set            unknown names,      wrong values,
//!       duplicate keys       assignments      wrong types         all at once
//! ```
//!
//! The types of the model are plain data, so that a scene can be written back as JSON
//! ([`Scene::to_json`]) and described as a JSON Schema ([`schema::json_schema`]). The code that
//! builds the sample interprets them.

mod difference;
mod error;
pub mod failure;
mod function;
mod material;
mod membrane;
mod model;
pub mod page;
pub mod parse;
mod region;
mod sample;
pub mod schema;
mod set;
mod solver;
mod stage;
mod stop;
mod suggest;
mod validate;
mod wall;

#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

pub use difference::{Difference, differences};
pub use error::shorten;
pub use error::{Origin, Problem, SceneError};
pub use function::{Function, Ramp};
pub use material::{BASE, Friction, MaterialPair, Materials, NamedMaterial, PairBonds, Restitution, Scatter};
pub use membrane::Membrane;
pub use model::{
    Bonds, Flow, Grains, Load, Output, Precision, Rupture, Scene, Springs, Stiffness, Time, Young, choose_load_wall,
};
pub use region::Region;
pub use sample::{
    Compaction, Cut, Deposition, Diameters, GrainSpec, Lattice, Preparation, RandomSample, Sample, SampleFile, Section,
    UniformRange,
};
pub use solver::{GaussSeidel, LocalSolve, Newton, Solver, SolverKind, Start};
pub use stage::{Stage, StageDrive};
pub use stop::{Stop, TravelFrom, WallTravel};
pub use validate::validate;
pub use validate::{LARGEST, LEAST, MAX_GRAINS};
pub use wall::*;

/// Reads the scene in the file `path`, applies the `--set` assignments and validates the result.
///
/// The paths of a sample file and of a list of bonds are relative to the scene file; in the
/// returned scene they are already joined to the scene's folder.
///
/// # Errors
/// [`SceneError`]: an unreadable file, wrong syntax, wrong structure, or all wrong values.
pub fn load(path: &Path, assignments: &[String]) -> Result<Scene, SceneError> {
    let mut document = read_scene(path)?;
    set::apply(&mut document, assignments).map_err(|problems| document.wrong(problems))?;
    let mut scene = finish(&mut document).map_err(|problems| document.wrong(problems))?;
    join_files(&mut scene, path);
    Ok(scene)
}

/// Largest text of a scene or a sweep (bytes): about seven million grains in a list.
pub const MAX_TEXT: u64 = 256 << 20;

fn read(path: &Path) -> Result<String, SceneError> {
    text(path).map_err(|source| SceneError::Read {
        nearest: if source.kind() == io::ErrorKind::NotFound { nearest_file(path) } else { None },
        path: path.to_path_buf(),
        source,
    })
}

/// The JSON file beside `path` whose name is nearest to that of `path`, if it is near enough.
fn nearest_file(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let files = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let names = files.filter_map(|file| file.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".json")).collect();
    names.sort_unstable();
    let nearest = suggest::nearest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(folder.map_or_else(|| PathBuf::from(&nearest), |folder| folder.join(&nearest)))
}

/// The tree of the scene in the file `path`; a sweep is refused.
fn read_scene(path: &Path) -> Result<parse::Document, SceneError> {
    let document = parse::parse(&path.display().to_string(), &read(path)?)?;
    if document.has("vary") && !document.has("dimension") {
        let found = "a sweep: the name of a scene, and fields to vary";
        return Err(document.wrong(vec![Problem::new("", found, "a scene; run a sweep with `dem-run sweep`")]));
    }
    Ok(document)
}

/// The text of a scene or a sweep: a regular file of at most [`MAX_TEXT`]. A file with other
/// content is an error of the kind [`io::ErrorKind::InvalidData`].
pub fn text(path: &Path) -> io::Result<String> {
    let too_long = || io::Error::other(format!("it has more than {} MiB: {MANY_GRAINS}", MAX_TEXT >> 20));
    let file = open_regular(path)?;
    if file.metadata()?.len() > MAX_TEXT {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    // the reported length of some files, as in /proc, is not that of their content
    file.take(MAX_TEXT + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_TEXT {
        return Err(too_long());
    }
    if bytes.starts_with(b"\x89HDF\r\n\x1a\n") {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "it is an HDF5 file: `dem-run resume` resumes the run of a history, `dem-post` reads it",
        ));
    }
    String::from_utf8(bytes).map_err(|error| {
        // valid up to here
        let before = String::from_utf8_lossy(&error.as_bytes()[..error.utf8_error().valid_up_to()]);
        let line = 1 + before.matches('\n').count();
        let column = 1 + before.chars().rev().take_while(|c| *c != '\n').count();
        let told = format!("line {line} is not UTF-8 text from column {column} on: save the file as UTF-8");
        io::Error::new(io::ErrorKind::InvalidData, told)
    })
}

const MANY_GRAINS: &str = "list its grains in a CSV file (sample.file)";

/// Opens a regular file. Opening a pipe would wait for its writer, and a device has no end.
pub fn open_regular(path: &Path) -> io::Result<File> {
    match std::fs::metadata(path)?.file_type() {
        kind if kind.is_file() => File::open(path),
        kind if kind.is_dir() => Err(io::Error::other("it is a folder: name a file in it")),
        _ => Err(io::Error::other("it is not a regular file: save the output of a pipe or a device to a file first")),
    }
}

/// Resolves the paths of the files of a scene relative to the scene file.
fn join_files(scene: &mut Scene, path: &Path) {
    if let Some(folder) = path.parent() {
        scene.files_mut().for_each(|file| *file = folder.join(&*file));
    }
}

/// Reads a scene from `text`, applies the `--set` assignments and validates the result.
///
/// `name` is the source of the text in error messages. Paths in the scene are not changed.
///
/// # Errors
/// [`SceneError`]: wrong syntax, wrong structure, or all wrong values.
pub fn from_text(name: &str, text: &str, assignments: &[String]) -> Result<Scene, SceneError> {
    let mut document = parse::parse(name, text)?;
    set::apply(&mut document, assignments).map_err(|problems| document.wrong(problems))?;
    finish(&mut document).map_err(|problems| document.wrong(problems))
}

/// The scene that a tree describes, or all its problems.
///
/// The tree is dropped: for millions of grains it is larger than all later data.
fn finish(document: &mut parse::Document) -> Result<Scene, Vec<Problem>> {
    let mut scene: Scene = document.decode().map_err(|problem| with_all_missing(problem, &document.root))?;
    document.root.take();
    let accept = solver::default_accept(scene.solver.tolerance, scene.bonds.is_some());
    scene.solver.accept.get_or_insert(accept);
    let problems = document.merge_non_finite(validate(&scene));
    if problems.is_empty() { Ok(scene) } else { Err(problems) }
}

/// The problem alone, or all required fields that `root` lacks if it is one of them.
fn with_all_missing(problem: Problem, root: &serde_json::Value) -> Vec<Problem> {
    if problem.allowed != parse::REQUIRED {
        return vec![problem];
    }
    let missing = schema::missing(root);
    if missing.iter().any(|other| other.path == problem.path) { missing } else { vec![problem] }
}

/// The base scene of a sweep, before its values are varied.
#[derive(Debug)]
pub struct Base {
    path: PathBuf,
    document: parse::Document,
}

/// A value that a sweep puts in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Its path in the scene.
    pub path: String,
    /// The value.
    pub value: serde_json::Value,
    /// Its place in the sweep.
    pub place: String,
}

impl Base {
    /// Reads the text; the scene may be invalid until the values are set.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Ok(Self { path: path.to_path_buf(), document: read_scene(path)? })
    }

    /// The scene with these values.
    ///
    /// # Errors
    /// All its problems, each with its place in the sweep or in the scene.
    pub fn with(&self, changes: &[Change]) -> Result<Scene, Vec<Problem>> {
        let mut document = self.document.clone();
        for Change { path, value, place } in changes {
            set::put(&mut document, path, value.clone(), place)
                .map_err(|problem| vec![problem.with_origin(Origin::Sweep(place.as_str().into()))])?;
        }
        let mut scene = finish(&mut document).map_err(|problems| document.located(problems))?;
        join_files(&mut scene, &self.path);
        Ok(scene)
    }
}
