//! Preview of a run: grains and their sizes, walls and their drives, steps, frames, the size of the
//! history and the memory. The world is built by the code of a run; random samples are not packed.

use std::fmt;
use std::path::Path;

use dem_core::body::Grains;
use dem_core::dim::{Dim, Vect};
use serde::Serialize;

use crate::build::{Built, build, walls};
use crate::cost;
use crate::error::RunError;
use crate::estimate::duration;
use crate::in_dimension;
use crate::memory;
use crate::output::{number, size};
use crate::prepare;
use crate::sample_file;
use crate::scene::{Drive, Function, Lattice, Precision, Ramp, RandomSample, Sample, Scene, Wall};
use crate::warnings;

/// Mean diameter (m) from which `check` asks whether millimetres were meant.
const BOULDER: f64 = 0.5;
/// Density (kg/m³) below which `check` asks whether g/cm³ were meant: no solid grain is so light,
/// and none has so many g/cm³.
const LIGHT: f64 = 25.0;

/// Preview of a run of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Title of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Dimension of space.
    pub dimension: u8,
    /// Number of grains.
    pub grains: usize,
    /// Source of the grains.
    pub sample: &'static str,
    /// Sizes of the grains and of the sample; none if the memory does not suffice to compute them.
    #[serde(flatten)]
    pub sizes: Option<Sizes>,
    /// Whether there are bonds.
    pub bonds: bool,
    /// The walls.
    pub walls: Vec<CheckedWall>,
    /// Pressure of the membrane over time, if there is one, with those of later stages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub membrane: Option<String>,
    /// Number of steps to the end.
    pub steps: u64,
    /// Time step (s).
    pub step: f64,
    /// End of the run (s).
    pub end: f64,
    /// End of the last step (s).
    pub last_step_ends: f64,
    /// Number of frames to the end.
    pub frames: u64,
    /// Number of steps from frame to frame.
    pub steps_per_frame: u64,
    /// Least and greatest processor time of all steps (s) if nothing breaks, without the
    /// preparation: in a collapse steps take longer.
    pub unbroken_cpu_time: [f64; 2],
    /// Memory that a run takes, roughly (bytes).
    pub memory_bytes: u64,
    /// Memory that is free (bytes), if known.
    pub free_memory_bytes: Option<u64>,
    /// Size of the history, roughly (bytes).
    pub file_bytes: u64,
    /// Free disk space at the default place of the history (bytes), if known.
    pub free_bytes: Option<u64>,
    /// Warnings about probable mistakes in the scene, and about too little disk space or memory.
    pub warnings: Vec<String>,
}

/// Sizes of the grains and of the sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sizes {
    /// Smallest, mean and largest diameter of the grains (m).
    pub diameters: [f64; 3],
    /// Lowest corner of the box around the sample (m).
    pub box_from: Vec<f64>,
    /// Highest corner of the box around the sample (m). For a random sample: at the requested solid
    /// fraction, before a cut.
    pub box_to: Vec<f64>,
    /// Mass of all grains (kg); unknown for a random sample of several materials, which is not
    /// packed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Number of grains of each material, by name; empty if there is one material, or if the sample
    /// is not packed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<(String, usize)>,
}

/// A wall.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CheckedWall {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: &'static str,
    /// How it is driven at the start.
    pub drive: &'static str,
    /// Force, stress or velocity over time, if the wall is driven, with the drives of later stages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub course: Option<String>,
}

impl Check {
    /// Preview of a run of `scene`, with the history in the current folder.
    ///
    /// # Errors
    /// For a sample that is not random, the errors of a run before its first step:
    /// [`RunError::SceneFile`], [`RunError::File`], [`RunError::Sample`].
    pub fn new(scene: &Scene) -> Result<Self, RunError> {
        let grains = count(scene)?;
        let (memory_bytes, free_memory_bytes) = (memory::expected(scene, grains), memory::free());
        let enough = free_memory_bytes.is_none_or(|free| memory_bytes <= free);
        let (sizes, warnings) = in_dimension!(scene, D => look::<D>(scene, enough)?);
        let end = scene.time.end;
        let walls = scene.walls.iter().map(|(name, wall)| {
            let (drive, course) = course(scene, name, wall);
            CheckedWall { name: name.clone(), shape: wall.shape.name(), drive, course }
        });
        let mut check = Self {
            title: scene.title.clone(),
            dimension: scene.dimension,
            grains,
            sample: sample_name(&scene.sample),
            sizes,
            bonds: scene.has_bonds(),
            walls: walls.collect(),
            membrane: membrane(scene),
            steps: scene.steps(),
            step: scene.time.step,
            end,
            last_step_ends: scene.steps() as f64 * scene.time.step,
            frames: scene.frames(),
            steps_per_frame: scene.steps_per_frame(),
            unbroken_cpu_time: cost::unbroken(scene, grains),
            memory_bytes,
            free_memory_bytes,
            file_bytes: expected_bytes(scene, grains),
            free_bytes: free_space(Path::new(".")),
            warnings,
        };
        if let Some(mean) = check.sizes.as_ref().map(|sizes| sizes.diameters[1]).filter(|mean| *mean >= BOULDER) {
            let told =
                format!("the mean diameter of the grains is {} m: if you meant mm, write 1e-3 for each", number(mean));
            check.warnings.push(format!("sample: {told}"));
        }
        let density = scene.materials.density;
        if density < LIGHT {
            let told =
                format!("{} kg/m³ is lighter than any grain: if you meant g/cm³, write 1e3 for each", number(density));
            check.warnings.push(format!("materials.density: {told}"));
        }
        if !enough {
            check.warnings.push("the run needs more memory than is free: use fewer grains, or another machine".into());
        }
        if check.disk_is_too_small() {
            check.warnings.push("the history will not fit on the disk of the current folder".into());
        }
        Ok(check)
    }

    /// Whether the history exceeds the free disk space.
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
        if let Some(Sizes { diameters: [min, mean, max], box_from, box_to, mass, materials }) = &self.sizes {
            writeln!(f, "diameters  {} to {} m, mean {} m", number(*min), number(*max), number(*mean))?;
            let sides: Vec<String> = box_from.iter().zip(box_to).map(|(from, to)| number(to - from)).collect();
            let corner: Vec<String> = box_from.iter().map(|x| number(*x)).collect();
            writeln!(f, "box        {} m, from ({}) m", sides.join(" × "), corner.join(", "))?;
            if let Some(mass) = mass {
                writeln!(f, "mass       {} kg", number(*mass))?;
            }
            if !materials.is_empty() {
                let shares: Vec<String> = materials.iter().map(|(name, count)| format!("{name} {count}")).collect();
                writeln!(f, "materials  {} grains", shares.join(", "))?;
            }
        }
        writeln!(f, "bonds      {}", if self.bonds { "yes" } else { "none" })?;
        let walls: Vec<String> =
            self.walls.iter().map(|wall| format!("{} ({}, {})", wall.name, wall.shape, wall.drive)).collect();
        writeln!(f, "walls      {}", if walls.is_empty() { "none".to_string() } else { walls.join(", ") })?;
        for (wall, course) in self.walls.iter().filter_map(|wall| Some((wall, wall.course.as_ref()?))) {
            writeln!(f, "drive      {}: {} {course}", wall.name, wall.drive)?;
        }
        if let Some(course) = &self.membrane {
            writeln!(f, "membrane   pressure {course}")?;
        }
        let (step, end, last) = (self.step, self.end, number(self.last_step_ends));
        let early = if (self.last_step_ends - end).abs() > 1e-9 * end {
            format!("; the last ends at {last}")
        } else {
            String::new()
        };
        writeln!(f, "steps      {} of {step} s, to {end} s{early}", self.steps)?;
        writeln!(f, "frames     {}, one every {} steps", self.frames, self.steps_per_frame)?;
        let [low, high] = self.unbroken_cpu_time.map(duration);
        let beyond = match (self.bonds, self.sample.starts_with("random")) {
            (true, true) => " if nothing breaks; a collapse and the packing come on top",
            (true, false) => " if nothing breaks; a collapse comes on top",
            (false, true) => "; the packing comes on top",
            (false, false) => "",
        };
        writeln!(f, "time       {low} to {high} of CPU for all steps{beyond}")?;
        let known = |free: Option<u64>| free.map_or("unknown".to_string(), size);
        writeln!(f, "memory     about {}; free {}", size(self.memory_bytes), known(self.free_memory_bytes))?;
        writeln!(f, "file       about {}", size(self.file_bytes))?;
        write!(f, "free disk  {}", known(self.free_bytes))
    }
}

/// Number of grains of a scene, before a cut.
///
/// # Errors
/// [`RunError::SceneFile`], [`RunError::File`]: a sample file that cannot be read.
pub(crate) fn count(scene: &Scene) -> Result<usize, RunError> {
    match &scene.sample {
        Sample::File(file) => sample_file::count(&file.path),
        Sample::Random(random) => Ok(random.count),
        sample => Ok(sample.count().unwrap_or_default()),
    }
}

/// The sizes of a scene, and warnings.
fn look<D: Dim>(scene: &Scene, enough_memory: bool) -> Result<(Option<Sizes>, Vec<String>), RunError> {
    let sizes = match &scene.sample {
        Sample::Random(random) if enough_memory => Some(random_sizes::<D>(scene, random)),
        _ if enough_memory => {
            let Built { world, warnings, .. } = build::<D>(scene, None, &mut |_| true)?;
            let grains = &world.grains;
            let (low, high) = grains.bounds();
            let corners = [low, high].map(|x| x.as_slice().to_vec());
            let count = |k: usize| (0..grains.len()).filter(|grain| grains.material_of(*grain) == k).count();
            let names = scene.materials.names().into_iter().enumerate();
            let materials = match grains.material.is_empty() {
                true => vec![],
                false => names.map(|(k, name)| (name.to_string(), count(k))).collect(),
            };
            let sizes = Sizes::of(&grains.radius, corners, Some(grains.mass.iter().sum()));
            return Ok((Some(Sizes { materials, ..sizes }), warnings));
        }
        _ => None,
    };
    let nowhere = Grains::<D>::from_iter([]);
    let mut told = warnings::of_scene(scene);
    told.extend(warnings::of_walls(scene, &walls(scene, &nowhere), None));
    Ok((sizes, told))
}

fn random_sizes<D: Dim>(scene: &Scene, random: &RandomSample) -> Sizes {
    let radii = prepare::radii(random, scene.seed);
    let corners = [vec![0.0; D::N], prepare::sides::<D>(random, &radii)];
    let volume: f64 = radii.iter().map(|r| D::volume(*r)).sum();
    let mass = volume * scene.materials.density * scene.thickness();
    Sizes::of(&radii, corners, scene.materials.named.is_empty().then_some(mass))
}

impl Sizes {
    fn of(radii: &[f64], [box_from, box_to]: [Vec<f64>; 2], mass: Option<f64>) -> Self {
        let (low, high) = radii.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), r| (low.min(*r), high.max(*r)));
        let mean = radii.iter().sum::<f64>() / radii.len() as f64;
        Self { diameters: [low, mean, high].map(|r| 2.0 * r), box_from, box_to, mass, materials: vec![] }
    }
}

/// How a wall is driven at the start, and its drive over time in words, if it is driven. Where
/// stages drive it, no time is printed at which a drive ends: a condition may end its stage.
fn course(scene: &Scene, name: &str, wall: &Wall) -> (&'static str, Option<String>) {
    let first = scene.first_drive(name, wall);
    let Some((drive, function, unit)) = parts(&first) else { return ("fixed", None) };
    let begins = over_time(function, unit);
    if scene.stage_drives(name).next().is_some() {
        let staged =
            scene.stages.iter().skip(1).filter_map(|stage| Some((&stage.name, stage.walls.get(name)?.drive())));
        let later = staged.filter_map(|(stage, drive)| {
            let (drive, function, unit) = parts(&drive)?;
            Some(format!("; from stage {stage} on: {drive} {}", over_time(function, unit)))
        });
        return (drive, Some(begins + &later.collect::<String>()));
    }
    let course = match function {
        Function::Constant(_) => format!("{begins} at all times"),
        _ => format!("{begins}: {} {unit} at {} s", number(function.at(scene.time.end)), scene.time.end),
    };
    (drive, Some(course))
}

/// The pressure of the membrane over time in words.
fn membrane(scene: &Scene) -> Option<String> {
    let begins = scene.first_pressure()?;
    let later = scene.stages.iter().skip(1).filter_map(|stage| {
        let pressure = over_time(stage.membrane_pressure.as_ref()?, "Pa");
        Some(format!("; from stage {} on: {pressure}", stage.name))
    });
    Some(over_time(begins, "Pa") + &later.collect::<String>())
}

/// The name of a drive, its function of time and its unit; none for a fixed wall.
fn parts(drive: &Drive) -> Option<(&'static str, &Function, &'static str)> {
    match drive {
        Drive::Fixed => None,
        Drive::Velocity(velocity) => Some(("velocity", velocity, "m/s")),
        Drive::Force(force) => Some(("force", force, "N")),
        Drive::Stress(stress) => Some(("stress", stress, "Pa")),
    }
}

/// A function of time in words.
fn over_time(function: &Function, unit: &str) -> String {
    match function {
        Function::Constant(value) => format!("{} {unit}", number(*value)),
        Function::Ramp(Ramp { rate, start }) => {
            let until = if *start > 0.0 { format!("until {start} s, then ") } else { String::new() };
            format!("0 {unit} {until}growing by {} {unit} a second", number(*rate))
        }
        Function::Table(rows) => {
            let values = rows.iter().map(|row| row[1]);
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
            format!("from {} to {} {unit}, by a table of {} rows", number(low), number(high), rows.len())
        }
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

/// Estimated size of the history of `grains` grains (bytes), from the rows of `dem_run::history`
/// and a typical number of contacts. The error may be 50 %.
fn expected_bytes(scene: &Scene, grains: usize) -> u64 {
    const NUMBER: f64 = 8.0;
    /// Scalars that are written at every step, with their step and time.
    const PER_STEP: f64 = 40.0 * NUMBER;
    /// Groups, attributes, the scene, and the first chunk of every dataset.
    const FIXED: f64 = 512e3;
    let real = if scene.output.precision == Precision::Single { 4.0 } else { NUMBER };
    let (d, spins, angles, tangents) = if scene.dimension == 2 { (2.0, 1.0, 1.0, 0.0) } else { (3.0, 3.0, 4.0, 3.0) };
    let contacts = memory::contacts_per_grain(scene) * grains as f64;
    let bonds = if scene.has_bonds() { contacts } else { 0.0 };
    // position, velocity, angular velocity, angle
    let grain_rows = grains as f64 * real * (2.0 * d + spins + angles);
    // point, normal, tangent, reaction, moment, gap; the pair, the status and the bond
    let moments = if bonds > 0.0 { spins } else { 0.0 };
    let forces = if scene.output.reactions { d + tangents + moments } else { 0.0 };
    let contact_rows = contacts * (real * (2.0 * d + forces + 1.0) + 2.0 * 4.0 + 1.0 + 4.0);
    let wall_rows = scene.walls.len() as f64 * real * 3.0 * d;
    let frames = scene.frames() as f64 * (grain_rows + contact_rows + wall_rows + bonds);
    (FIXED + frames + scene.steps() as f64 * PER_STEP) as u64
}

/// Free space for the user on the disk of `folder` (bytes), if the system reports it.
#[cfg(unix)]
pub(crate) fn free_space(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    disk.f_bavail.checked_mul(disk.f_frsize)
}

#[cfg(not(unix))]
pub(crate) fn free_space(_folder: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::scene::load;
    use dem_core::dim::D2;

    pub(crate) fn config(name: &str, sets: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs").join(name);
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        load(&path, &sets).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn the_compression_run_is_told() {
        let check = Check::new(&config("compression.json", &[])).expect("check");
        assert_eq!((check.grains, check.steps, check.frames, check.bonds), (430, 5000, 501, true));
        let course = "0 N growing by 200 N a second: 100 N at 0.5 s".to_string();
        let top = CheckedWall { name: "top".into(), shape: "plane", drive: "force", course: Some(course) };
        assert_eq!(check.walls[1], top);
        // 501 frames of 430 grains and about 950 contacts
        assert!((30e6..90e6).contains(&(check.file_bytes as f64)), "{}", check.file_bytes);
        assert!(check.free_bytes.is_some_and(|free| free > 0));
        let text = check.to_string();
        for part in [
            "grains     430 (random packing)",
            "top (plane, force)",
            "5000 of 0.0001 s",
            "501, one every 10",
            "time       1.4 s to 24 s of CPU for all steps if nothing breaks; a collapse and the packing come on top",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn millimetres_given_as_metres_are_told() {
        let size = "sample.random.diameter={\"uniform\": {\"min\": 1, \"max\": 4}}";
        let check = Check::new(&config("compression.json", &[size, "sample.random.width=38"])).expect("check");
        let told: Vec<_> = check.warnings.iter().filter(|word| word.contains("mm")).collect();
        assert!(told.len() == 1 && told[0].contains("mean diameter of the grains is 2.5"), "{:?}", check.warnings);
        let check = Check::new(&config("compression.json", &[])).expect("check");
        assert!(check.warnings.is_empty(), "{:?}", check.warnings);
    }

    #[test]
    fn grams_given_as_kilograms_are_told() {
        let check = Check::new(&config("compression.json", &["materials.density=2.65"])).expect("check");
        assert!(matches!(check.warnings.as_slice(), [only] if only.contains("g/cm³")), "{:?}", check.warnings);
    }

    /// The normal of a plane says where the grains are, so the sample need not be packed.
    #[test]
    fn a_confinement_that_pulls_is_told_before_the_sample_is_packed() {
        let pull = "walls.left.stress={\"table\": [[0, 0], [0.01, -500]]}";
        let check = Check::new(&config("biaxial.json", &[pull])).expect("check");
        let told: Vec<_> = check.warnings.iter().filter(|word| word.contains("pulls it away")).collect();
        assert!(told.len() == 1 && told[0].starts_with("walls.left: its stress, -500 Pa"), "{:?}", check.warnings);
        assert_eq!(Check::new(&config("biaxial.json", &[])).expect("check").warnings, Vec::<String>::new());
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
    fn a_wall_has_the_drives_of_its_stages_one_after_the_other() {
        let stages = r#"stages=[
            {"name": "rest", "duration": 0.1, "walls": {"top": {"force": {"constant": 5}}}},
            {"name": "press", "until": {"broken_fraction": 0.5}, "walls": {"top": {"velocity": {"constant": 1e-3}}}},
            {"name": "tilt", "duration": 0.1, "walls": {"bottom": {"velocity": {"ramp": {"rate": 2}}}}}]"#;
        let check = Check::new(&config("compression.json", &[stages])).expect("check");
        let courses: Vec<_> =
            check.walls.iter().map(|wall| (wall.drive, wall.course.as_deref().unwrap_or(""))).collect();
        let bottom = "0 m/s; from stage tilt on: velocity 0 m/s growing by 2 m/s a second";
        let top = "5 N; from stage press on: velocity 0.001 m/s";
        assert_eq!(courses, [("velocity", bottom), ("force", top)]);
    }

    #[test]
    fn the_last_stage_ends_a_run_before_its_time() {
        let check = Check::new(&config("staged-biaxial.json", &[])).expect("check");
        // 0.02 + 0.005 + 0.015 + 0.01 + 0.0125 + 0.02 s
        assert_eq!((check.steps, check.frames), (825, 84));
        let text = check.to_string();
        assert!(text.contains("steps      825 of 0.0001 s, to 0.2 s; the last ends at 0.0825\n"), "{text}");
    }

    /// The floor holds both grains, so no bond joins them, whatever the gap.
    #[test]
    fn grains_that_a_wall_holds_have_no_bond_in_a_check_as_in_a_run() {
        let floor = r#"walls={"floor": {"shape": {"plane": {"normal": [0, 1], "place": "seated"}}, "grip": 1e-3}}"#;
        let absent = r#"bonds.absent=[{"ball": {"center": [2e-3, 0], "radius": 1e-3}}]"#;
        Check::new(&config("two-grains.json", &[absent])).expect("a bond through the region");
        let scene = config("two-grains.json", &[floor, absent]);
        let told = Check::new(&scene).expect_err("no bond through the region").to_string();
        assert!(told.contains("bonds.absent.0.ball: no bond would pass through it"), "{told}");
        let Err(run) = build::<D2>(&scene, None, &mut |_| true) else { panic!("a run accepts it") };
        assert_eq!(told, run.to_string());
    }

    fn with_sample(table: &str) -> Result<Check, RunError> {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sample.csv");
        if !table.is_empty() {
            std::fs::write(&path, table).expect("write");
        }
        let mut scene = config("column.json", &["sample={\"file\": {\"path\": \"sample.csv\"}}"]);
        let Sample::File(file) = &mut scene.sample else { panic!("not a file") };
        file.path = path;
        Check::new(&scene)
    }

    #[test]
    fn the_grains_of_a_sample_file_are_measured() {
        let missing = with_sample("").expect_err("no file");
        assert_eq!(missing.exit_code(), 4);
        assert!(missing.to_string().contains("sample.csv"), "{missing}");
        let check = with_sample("x,y,radius\n# two grains\n0,1,1\n2.5,1,0.5\n").expect("check");
        let sizes = check.sizes.clone().expect("sizes");
        assert_eq!((check.grains, sizes.diameters), (2, [1.0, 1.5, 2.0]));
        assert_eq!((sizes.box_from, sizes.box_to), (vec![-1.0, 0.0], vec![3.0, 2.0]));
        let text = check.to_string();
        for part in ["diameters  1 to 2 m, mean 1.5 m", "box        4 × 2 m, from (-1, 0) m", "mass       "] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn what_a_run_would_refuse_is_told_at_once() {
        for (table, parts) in [
            ("x,y,radius\n0,1,nan\n0,3,-1\n", &["line 2: radius is", "line 3: radius is -1"][..]),
            ("x;y;radius\n0;0;1\n", &["line 1: the header is x;y;radius", "between commas"]),
            ("x,y,radius\n", &["there are no grains"]),
            (
                "x,y,radius\n0,1,1\n1,1,1\n5,1,1\n5,2,1\n",
                &["grains 0 and 1 overlap by 1", "grains 2 and 3 overlap by 1"],
            ),
            (
                "x,y,radius\n0,1,1\n1e7,1,1\n",
                &[
                    "grain 1 is 1.000e7 m from the origin",
                    "its radius is 1 m: contacts would",
                    "move the sample to the origin",
                ],
            ),
            // the wall also overlaps grains
            ("x,y,radius\n0,1,1\n1,1,1\n0,9,1\n", &["grains 0 and 1 overlap"]),
        ] {
            let error = with_sample(table).expect_err(table);
            assert_eq!(error.exit_code(), 2);
            for part in parts {
                assert!(error.to_string().contains(part), "{part} in\n{error}");
            }
        }
        let shallow = with_sample("x,y,radius\n0,1,1\n1.98,1,1\n").expect("a little overlap").warnings;
        assert!(shallow[0].contains("one pair of grains overlaps, most of all 0 and 1, by 2.000e-2 m"), "{shallow:?}");
    }
}
