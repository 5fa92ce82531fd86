//! Scenes from text to error message. Each case changes one thing in a scene that is right.

mod membrane;
mod stages;
mod structure;
mod values;

use std::path::{Path, PathBuf};

use super::*;

/// A scene in 2D that is right, with something in every part.
const FLAT: &str = r#"{
  // two grains between two walls
  "dimension": 2,
  "thickness": 0.01,
  "sample": { "grains": [
    { "center": [0, 0], "radius": 1e-3, "velocity": [0, 1], "spin": [2] },
    { "center": [2e-3, 0], "radius": 1e-3 }
  ] },
  "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
  "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
  "grains": { "fixed": [0], "loads": [{ "grain": 1, "force": [1, 0] }] },
  "walls": {
    "bottom": { "shape": { "plane": { "normal": [0, 1], "place": { "at": [0, -1] } } } },
    "roller": { "shape": { "circle": { "center": [0, 9], "radius": 1 } },
                "velocity": { "constant": -1 }, "direction": [0, 1] },
    "top": { "shape": { "plane": { "normal": [0, -1], "place": "seated" } },
             "mass": "sample", "force_rate": 200 }
  },
  "gravity": [0, -9.81],
  "time": { "step": 1e-4, "end": 0.5 },
  "solver": { "tolerance": 1e-4, "accept": 1e-4 },
  "output": { "every_steps": 10 },
  "stop": { "wall_travel": { "wall": "top", "fraction_of_height": 0.05, "after": "first_break" } }
}"#;

/// A scene in 3D that is right.
const SOLID: &str = r#"{
  "dimension": 3,
  "sample": { "random": { "count": 10, "diameter": { "constant": 1e-3 }, "width": 0.01, "depth": 0.01,
              "preparation": { "deposition": { "solid_fraction": 0.5 } } } },
  "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
  "walls": { "drum": { "shape": { "cylinder": { "center": [0, 0, 0], "axis": [0, 1, 0], "radius": 1, "inside": true } } } },
  "time": { "step": 1e-4, "end": 0.5 },
  "output": { "interval": 0.01 }
}"#;

fn read(text: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    from_text("test", text, &sets)
}

/// The only problem of a scene.
fn only(result: Result<Scene, SceneError>) -> Problem {
    let error = result.expect_err("the scene is right");
    let [problem] = error.problems() else { panic!("not one problem: {error}") };
    problem.clone()
}

fn configs() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let entries = std::fs::read_dir(folder).expect("configs");
    entries
        .map(|entry| entry.expect("entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        // sweeps are no scenes
        .filter(|path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("sweep-")))
        .collect()
}

#[test]
fn the_scenes_of_the_tests_are_right() {
    read(FLAT, &[]).expect("FLAT");
    read(SOLID, &[]).expect("SOLID");
}

#[test]
fn all_scenes_in_configs_are_right() {
    let configs = configs();
    assert!(configs.len() >= 4, "{configs:?}");
    for path in configs {
        load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn the_compression_scene_says_what_the_experiment_is() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/compression.json");
    let sets = ["bonds.strength=5".to_string(), "walls.top.force_rate=100".to_string()];
    let scene = load(&path, &sets).expect("the scene is right");
    assert_eq!(scene.sample.count(), Some(430));
    assert_eq!((scene.time.steps(), scene.steps_per_frame(), scene.frames()), (5000, 10, 501));
    assert_eq!((scene.solver.tolerance, scene.solver.accept()), (1e-8, 1e-6));
    assert_eq!(scene.bonds.as_ref().expect("bonds").cohesion(2, 3e-3, 0.01), 5.0);
    assert_eq!(scene.walls["bottom"].drive(), Drive::Fixed);
    let Drive::Force(force) = scene.walls["top"].drive() else { panic!("the top wall is not loaded") };
    assert_eq!(force.at(0.25), 25.0);
}

#[test]
fn a_scene_and_its_json_are_the_same_to_the_bit() {
    // a quarter of all numbers lose their last bit without serde_json's float_roundtrip
    let mut scene = read(FLAT, &[]).expect("FLAT");
    let mut x = 0.1_f64;
    for _ in 0..1000 {
        x = (x * 1.37 + 0.001) % 1.0;
        scene.time.step = x * 1e-7;
        let again = read(&scene.to_json().expect("json"), &[]).expect("the same scene");
        assert_eq!(again.time.step.to_bits(), scene.time.step.to_bits());
        assert_eq!(again, scene);
    }
    for path in configs() {
        let scene = load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(read(&scene.to_json().expect("json"), &[]).expect("the same scene"), scene);
    }
}

#[test]
fn what_is_absent_has_its_default() {
    let scene = read(SOLID, &[]).expect("SOLID");
    assert_eq!((scene.seed, scene.thickness(), scene.gravity.as_ref()), (1, 1.0, None));
    assert_eq!(scene.materials.restitution, Restitution { grain_grain: 0.0, grain_wall: 0.0, threshold_speed: 0.0 });
    let solver = Solver { accept: Some(1e-4), ..Solver::default() };
    assert_eq!(scene.solver, solver);
    assert_eq!(scene.rupture, Rupture::Cascade);
    assert_eq!(scene.steps_per_frame(), 100);
    let scene = read(FLAT, &[]).expect("FLAT");
    assert_eq!(scene.grains.expect("grains").loads[0].time, Function::Constant(1.0));
    let bonds = scene.bonds.expect("bonds");
    assert_eq!((bonds.flow, bonds.friction), (Flow::Associated, None));
}

#[test]
fn a_missing_file_and_one_that_is_not_text_are_told_apart() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.json");
    let missing = load(&path, &[]).expect_err("no file");
    assert!(matches!(missing, SceneError::Read { .. }), "{missing}");
    assert!(missing.to_string().contains("scene.json"), "{missing}");
    assert!(!missing.to_string().contains("did you mean"), "{missing}");
    // a name that is nearly that of a scene beside it
    for name in ["compresion.json", "compression"] {
        std::fs::write(folder.path().join("compression.json"), "{}").expect("write");
        std::fs::write(folder.path().join("compresion.h5"), "").expect("write");
        let wrong = load(&folder.path().join(name), &[]).expect_err("no file").to_string();
        let path = folder.path().join("compression.json").display().to_string();
        assert!(wrong.ends_with(&format!("; did you mean {path}?")), "{wrong}");
    }
    std::fs::write(&path, [0xff, 0xfe, 0x00]).expect("write");
    let binary = load(&path, &[]).expect_err("not text");
    assert!(binary.to_string().contains("line 1 is not UTF-8 text from column 1 on"), "{binary}");
    std::fs::write(&path, b"{\n  \"title\": \"\xc2\xb5 caf\xe9\"").expect("write");
    let latin = load(&path, &[]).expect_err("Latin-1");
    assert!(latin.to_string().contains("line 2 is not UTF-8 text from column 18 on"), "{latin}");
    // neither is a sweep a scene
    std::fs::write(&path, r#"{ "scene": "a.json", "vary": [{ "seed": [1] }] }"#).expect("write");
    let sweep = load(&path, &["seed=2".into()]).expect_err("a sweep");
    assert_eq!((sweep.problems().len(), sweep.problems()[0].path.as_str()), (1, ""));
    assert!(sweep.to_string().contains("`dem-run sweep`"), "{sweep}");
}

#[test]
fn a_sample_file_is_sought_beside_the_scene() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.json");
    std::fs::write(&path, FLAT).expect("write");
    let sets = [r#"sample={"file": {"path": "sample.csv"}}"#.to_string()];
    let scene = load(&path, &sets).expect("the scene is right");
    let Sample::File(file) = scene.sample else { panic!("not a file") };
    assert_eq!(file.path, folder.path().join("sample.csv"));
}
