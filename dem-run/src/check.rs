//! What a run of a scene will be: grains, walls, steps, frames and the size of its history, without
//! preparing the sample.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use crate::output::number;
use crate::run::RunError;
use crate::scene::{Drive, Lattice, Precision, Sample, Scene, Shape};

/// What a run of a scene will be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What the scene shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Dimension of space.
    pub dimension: u8,
    /// Number of grains.
    pub grains: usize,
    /// Where they come from.
    pub sample: &'static str,
    /// Whether there are bonds.
    pub bonds: bool,
    /// The walls.
    pub walls: Vec<CheckedWall>,
    /// Number of steps to the end.
    pub steps: u64,
    /// Time step (s).
    pub step: f64,
    /// End of the run (s).
    pub end: f64,
    /// Number of frames to the end.
    pub frames: u64,
    /// Number of steps from frame to frame.
    pub steps_per_frame: u64,
    /// Size of the history, roughly (bytes).
    pub file_bytes: u64,
    /// Free space where the history would stand by default (bytes), if known.
    pub free_bytes: Option<u64>,
}

/// A wall.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CheckedWall {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: &'static str,
    /// How it is driven.
    pub drive: &'static str,
}

impl Check {
    /// What a run of `scene` will be, its history in the current folder.
    ///
    /// # Errors
    /// [`RunError::InputOutput`]: a sample file that cannot be read.
    pub fn new(scene: &Scene) -> Result<Self, RunError> {
        let grains = match &scene.sample {
            Sample::File(file) => count_rows(&file.path)?,
            // before the cut
            Sample::Random(random) => random.count,
            sample => sample.count().unwrap_or_default(),
        };
        let walls = scene.walls.iter().map(|(name, wall)| CheckedWall {
            name: name.clone(),
            shape: shape_name(&wall.shape),
            drive: match wall.drive() {
                Drive::Fixed => "fixed",
                Drive::Velocity(_) => "velocity",
                Drive::Force(_) => "force",
            },
        });
        Ok(Self {
            title: scene.title.clone(),
            dimension: scene.dimension,
            grains,
            sample: sample_name(&scene.sample),
            bonds: has_bonds(scene),
            walls: walls.collect(),
            steps: scene.time.steps(),
            step: scene.time.step,
            end: scene.time.end,
            frames: scene.frames(),
            steps_per_frame: scene.steps_per_frame(),
            file_bytes: expected_bytes(scene, grains),
            free_bytes: free_space(Path::new(".")),
        })
    }

    /// Whether the history will not fit.
    #[must_use]
    pub fn disk_is_too_small(&self) -> bool {
        self.free_bytes.is_some_and(|free| free < self.file_bytes)
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(title) = &self.title {
            writeln!(f, "title      {title}")?;
        }
        writeln!(f, "dimension  {}", self.dimension)?;
        writeln!(f, "grains     {} ({})", self.grains, self.sample)?;
        writeln!(f, "bonds      {}", if self.bonds { "yes" } else { "none" })?;
        let walls: Vec<String> =
            self.walls.iter().map(|wall| format!("{} ({}, {})", wall.name, wall.shape, wall.drive)).collect();
        writeln!(f, "walls      {}", if walls.is_empty() { "none".to_string() } else { walls.join(", ") })?;
        let last = self.steps as f64 * self.step;
        let beyond =
            if last > self.end * (1.0 + 1e-9) { format!("; the last ends at {}", number(last)) } else { String::new() };
        writeln!(f, "steps      {} of {} s, to {} s{beyond}", self.steps, self.step, self.end)?;
        writeln!(f, "frames     {}, one every {} steps", self.frames, self.steps_per_frame)?;
        writeln!(f, "file       about {}", size(self.file_bytes))?;
        write!(f, "free disk  {}", self.free_bytes.map_or("unknown".to_string(), size))
    }
}

fn sample_name(sample: &Sample) -> &'static str {
    match sample {
        Sample::Random(random) if random.cut.is_some() => "random packing before its cut",
        Sample::Random(_) => "random packing",
        Sample::Lattice(Lattice::Hexagonal { .. }) => "hexagonal lattice",
        Sample::Lattice(Lattice::Square { .. }) => "square lattice",
        Sample::Lattice(Lattice::Cubic { .. }) => "cubic lattice",
        Sample::File(_) => "from a file",
        Sample::Grains(_) => "listed",
    }
}

fn shape_name(shape: &Shape) -> &'static str {
    match shape {
        Shape::Plane(_) => "plane",
        Shape::Circle(_) => "circle",
        Shape::Sphere(_) => "sphere",
        Shape::Cylinder(_) => "cylinder",
    }
}

fn has_bonds(scene: &Scene) -> bool {
    scene.bonds.as_ref().is_some_and(|bonds| bonds.cohesion(scene.dimension, 1.0, 1.0) > 0.0)
}

/// Number of grains in a sample file: its lines after the header.
fn count_rows(path: &Path) -> Result<usize, RunError> {
    let unreadable = |error| RunError::InputOutput(format!("{}: the sample cannot be read: {error}", path.display()));
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).flexible(true).from_path(path).map_err(unreadable)?;
    let mut count = 0;
    let mut record = csv::ByteRecord::new();
    while reader.read_byte_record(&mut record).map_err(unreadable)? {
        count += 1;
    }
    Ok(count)
}

/// Size of the history of `grains` grains (bytes): the layout of `dem_run::history` row by row, with
/// a typical number of contacts. Compare with a real file before relying on it to better than a half.
fn expected_bytes(scene: &Scene, grains: usize) -> u64 {
    const NUMBER: f64 = 8.0;
    /// Scalars that are written at every step, with their step and time.
    const PER_STEP: f64 = 40.0 * NUMBER;
    /// Groups, attributes, the scene, and the first chunk of every dataset.
    const FIXED: f64 = 512e3;
    let real = if scene.output.precision == Precision::Single { 4.0 } else { NUMBER };
    let (d, spins, angles, tangents) = if scene.dimension == 2 { (2.0, 1.0, 1.0, 0.0) } else { (3.0, 3.0, 4.0, 3.0) };
    let contacts_per_grain = match scene.sample {
        Sample::Lattice(Lattice::Square { .. }) => 2.0,
        _ if scene.dimension == 2 => 2.2,
        _ => 3.5,
    };
    let contacts = contacts_per_grain * grains as f64;
    let bonds = if has_bonds(scene) { contacts } else { 0.0 };
    // position, velocity, angular velocity, angle
    let grain_rows = grains as f64 * real * (2.0 * d + spins + angles);
    // point, normal, tangent, reaction, moment, gap; the pair, the status and the bond
    let moments = if bonds > 0.0 { spins } else { 0.0 };
    let forces = if scene.output.reactions { d + tangents + moments } else { 0.0 };
    let contact_rows = contacts * (real * (2.0 * d + forces + 1.0) + 2.0 * 4.0 + 1.0 + 4.0);
    let wall_rows = scene.walls.len() as f64 * real * 3.0 * d;
    let frames = scene.frames() as f64 * (grain_rows + contact_rows + wall_rows + bonds);
    (FIXED + frames + scene.time.steps() as f64 * PER_STEP) as u64
}

/// Free space for the user on the disk of `folder` (bytes), if the system tells.
#[cfg(unix)]
pub(crate) fn free_space(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    disk.f_bavail.checked_mul(disk.f_frsize)
}

#[cfg(not(unix))]
pub(crate) fn free_space(_folder: &Path) -> Option<u64> {
    None
}

/// A size as a person reads it.
pub(crate) fn size(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load;

    fn config(name: &str, sets: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs").join(name);
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        load(&path, &sets).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn the_compression_run_is_told() {
        let check = Check::new(&config("compression.json", &[])).expect("check");
        assert_eq!((check.grains, check.steps, check.frames, check.bonds), (430, 5000, 501, true));
        let top = CheckedWall { name: "top".into(), shape: "plane", drive: "force" };
        assert_eq!(check.walls[1], top);
        // 501 frames of 430 grains and about 950 contacts
        assert!((30e6..90e6).contains(&(check.file_bytes as f64)), "{}", check.file_bytes);
        assert!(check.free_bytes.is_some_and(|free| free > 0));
        let text = check.to_string();
        for part in ["grains     430 (random packing)", "top (plane, force)", "5000 of 0.0001 s", "501, one every 10"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn no_strength_is_no_bonds() {
        assert!(!Check::new(&config("compression.json", &["bonds.strength=0"])).expect("check").bonds);
        assert!(!Check::new(&config("column.json", &[])).expect("check").bonds);
    }

    #[test]
    fn a_full_disk_is_noticed() {
        let check = Check::new(&config("column.json", &[])).expect("check");
        assert!(!Check { free_bytes: None, ..check.clone() }.disk_is_too_small());
        assert!(Check { free_bytes: Some(10), ..check }.disk_is_too_small());
    }

    #[test]
    fn the_grains_of_a_sample_file_are_counted() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sample.csv");
        let mut scene = config("column.json", &["sample={\"file\": {\"path\": \"sample.csv\"}}"]);
        let Sample::File(file) = &mut scene.sample else { panic!("not a file") };
        file.path = path.clone();
        let missing = Check::new(&scene).expect_err("no file");
        assert_eq!(missing.exit_code(), 4);
        assert!(missing.to_string().contains("sample.csv"), "{missing}");
        std::fs::write(&path, "x,y,radius\n# two grains\n0,0,1\n2,0,1\n").expect("write");
        assert_eq!(Check::new(&scene).expect("check").grains, 2);
    }

    #[test]
    fn sizes_are_short() {
        assert_eq!(
            (size(5_000), size(63_400_000), size(2_500_000_000)),
            ("5 kB".into(), "63.4 MB".into(), "2.5 GB".into())
        );
    }
}
