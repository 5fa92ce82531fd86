//! The command line: exit codes, what goes to stdout and what to stderr.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dem_history::{History, WallDrive};
use serde_json::Value;

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs").join(name)
}

/// Runs the command in `folder`: exit code, stdout, stderr.
fn dem_run(folder: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-run"));
    let Output { status, stdout, stderr } = command.args(args).current_dir(folder).output().expect("start");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (status.code(), text(stdout), text(stderr))
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("folder")
}

#[test]
fn check_tells_what_a_run_will_be() {
    let scene = config("compression.json");
    let scene = scene.to_str().expect("UTF-8");
    let (code, stdout, stderr) = dem_run(folder().path(), &["check", scene]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    for part in ["430 (random packing)", "steps      5000", "frames     501", "free disk"] {
        assert!(stdout.contains(part), "{part} in\n{stdout}");
    }
    let (code, stdout, _) = dem_run(folder().path(), &["check", scene, "--json", "--set", "time.end=0.1"]);
    let check: Value = serde_json::from_str(&stdout).expect("JSON");
    assert_eq!((code, &check["steps"], &check["grains"]), (Some(0), &1000.into(), &430.into()));
}

#[test]
fn a_wrong_scene_is_exit_2_and_names_every_place() {
    let scene = config("compression.json");
    let scene = scene.to_str().expect("UTF-8");
    let wrong = ["--set", "time.step=0", "--set", "materials.friction.grain_grain=-1"];
    for command in ["check", "run"] {
        let (code, stdout, stderr) = dem_run(folder().path(), &[&[command, scene], &wrong[..]].concat());
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{stderr}");
        for part in ["compression.json", "time.step (--set time.step=0)", "materials.friction.grain_grain", "≥ 0"] {
            assert!(stderr.contains(part), "{part} in\n{stderr}");
        }
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
    let (code, stdout, _) = dem_run(folder().path(), &[&["check", "--json", scene], &wrong[..]].concat());
    let report: Value = serde_json::from_str(&stdout).expect("JSON");
    assert_eq!((code, report["problems"].as_array().map(Vec::len)), (Some(2), Some(2)));
    assert_eq!(report["problems"][1]["path"], "time.step");
}

/// A disk between a floor and a lid that a given velocity moves.
#[test]
fn a_step_without_a_solution_is_exit_3_and_names_what_is_squeezed_and_the_remedy() {
    let folder = folder();
    let scene = r#"{"dimension": 2, "thickness": 0.01, "time": {"step": 1e-4, "end": 1e-2}, "output": {"every_steps": 10},
        "sample": {"grains": [{"center": [0, 1e-3], "radius": 1e-3}]},
        "materials": {"density": 2500, "friction": {"grain_grain": 0.3, "grain_wall": 0.2}},
        "walls": {"base": {"shape": {"plane": {"normal": [0, 1], "place": {"at": [0, 0]}}}},
            "lid": {"shape": {"plane": {"normal": [0, -1], "place": {"at": [0, 2e-3]}}}, "velocity": {"constant": 0.01}}}}"#;
    std::fs::write(folder.path().join("lid.json"), scene).expect("a file");
    for kind in ["newton", "interior", "gauss_seidel"] {
        let kind = format!("solver.kind={{\"{kind}\":{{}}}}");
        let (code, _, stderr) =
            dem_run(folder.path(), &["run", "lid.json", "--output", "lid.h5", "--force", "--set", &kind]);
        assert_eq!(code, Some(3), "{stderr}");
        for part in ["no motion satisfies grain 0, wall base and wall lid at t = 0", "let a force drive walls.lid"] {
            assert!(stderr.contains(part), "{part} in\n{stderr}");
        }
    }
    let (code, _, stderr) = dem_run(folder.path(), &["export", "lid.h5", "--step", "1", "--output", "lid.hdf5"]);
    assert_eq!(code, Some(0), "{stderr}");
    for solver in ["interior", "gauss-seidel"] {
        let (code, _, stderr) = dem_run(folder.path(), &["solve", "lid.hdf5", "--solver", solver]);
        assert_eq!(code, Some(3), "{stderr}");
        assert!(stderr.contains("no velocities satisfy the laws of contacts 0, 1:"), "{stderr}");
    }
}

#[test]
fn wrong_usage_is_exit_2() {
    let scene = config("column.json");
    let scene = scene.to_str().expect("UTF-8");
    for args in [
        &["fly"][..],
        &[],
        &["run"],
        &["run", scene, "--threads", "0"],
        &["run", scene, "--progress", "loud"],
        &["check", scene, "--set"],
        &["check", scene, "--set", "bonds.strength"],
    ] {
        let (code, stdout, stderr) = dem_run(folder().path(), args);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{args:?}: {stderr}");
    }
}

#[test]
fn files_that_are_missing_or_in_the_way_are_exit_4() {
    let here = folder();
    let scene = config("column.json");
    let scene = scene.to_str().expect("UTF-8");
    std::fs::write(here.path().join("column.h5"), "precious").expect("write");
    std::fs::write(here.path().join("sample.csv"), "precious").expect("write");
    for (args, part) in [
        (&["check", "missing.json"][..], "missing.json"),
        (&["run", "missing.json"], "missing.json"),
        (&["run", scene], "--force"),
        (&["run", scene, "-o", "no/such/a.h5"], "no/such"),
        (&["run", scene, "-o", "."], "folder"),
        (&["run", scene, "-o", "b.h5", "--write-sample", "sample.csv"], "--write-sample"),
    ] {
        let (code, stdout, stderr) = dem_run(here.path(), args);
        assert_eq!((code, stdout.as_str()), (Some(4), ""), "{args:?}: {stderr}");
        assert!(stderr.contains(part), "{args:?}: {stderr}");
    }
    assert_eq!(std::fs::read(here.path().join("column.h5")).expect("read"), b"precious");
    assert!(!here.path().join("b.h5").exists());
}

#[test]
fn schema_prints_a_json_schema_of_scenes() {
    let (code, stdout, stderr) = dem_run(folder().path(), &["schema"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let schema: Value = serde_json::from_str(&stdout).expect("JSON");
    assert!(schema["$schema"].as_str().is_some_and(|url| url.contains("json-schema.org")));
    assert_eq!(schema["title"], "Scene");
    // the copy that the scenes in configs name
    let copy = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scene.schema.json");
    let copy = std::fs::read_to_string(copy).expect("docs/scene.schema.json");
    assert!(copy == stdout, "docs/scene.schema.json is old: dem-run schema > docs/scene.schema.json");
    let (code, page, _) = dem_run(folder().path(), &["schema", "--markdown"]);
    let copy = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes.md");
    assert!(code == Some(0) && copy.exists(), "docs/scenes.md");
    let copy = std::fs::read_to_string(copy).expect("docs/scenes.md");
    assert!(copy == page, "docs/scenes.md is old: dem-run schema --markdown > docs/scenes.md");
    assert!(schema["properties"]["thickness"]["description"].as_str().is_some_and(|text| text.contains("(m)")));
}

#[test]
fn schema_prints_a_json_schema_of_sweeps() {
    let (code, stdout, stderr) = dem_run(folder().path(), &["schema", "--sweep"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let copy = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/sweep.schema.json");
    let copy = std::fs::read_to_string(copy).expect("docs/sweep.schema.json");
    assert!(copy == stdout, "docs/sweep.schema.json is old: dem-run schema --sweep > docs/sweep.schema.json");
}

#[test]
fn every_command_shows_an_example() {
    for command in ["run", "pack", "check", "schema", "sweep", ""] {
        let args: Vec<&str> = [command, "--help"].into_iter().filter(|arg| !arg.is_empty()).collect();
        let (code, stdout, _) = dem_run(folder().path(), &args);
        assert_eq!(code, Some(0));
        assert!(stdout.contains("Example"), "{args:?}");
    }
}

#[test]
fn grains_that_touch_and_are_all_fixed_form_no_bond_and_the_summary_says_why() {
    let folder = folder();
    let scene = config("two-grains.json");
    let scene = scene.to_str().expect("UTF-8");
    let run = |set: &str| dem_run(folder.path(), &["run", scene, "--quiet", "--force", "-o", "a.h5", "--set", set]).1;
    let near = run("grains.fixed=[0, 1]");
    let why = "bonds            none, although the scene has bonds: no two grains are within bonds.gap_tolerance, 0.001 \
               mean diameters, except pairs that form no bond: both grains fixed";
    assert!(near.contains(why), "{near}");
    let far = run("sample.grains.1.center=[5e-3, 0]");
    assert!(far.contains(why), "{far}");
}

/// A lid on a column of three grains: at rest, then under a force, held, and under a stress.
const STAGED: &str = r#"{"dimension": 2, "thickness": 0.01, "gravity": [0.3, -9.81],
    "time": {"step": 1e-3, "end": 0.1}, "output": {"every_steps": 1},
    "sample": {"grains": [{"center": [0, 0], "radius": 1e-3}, {"center": [0, 2e-3], "radius": 1e-3},
        {"center": [0, 4e-3], "radius": 1e-3}]},
    "materials": {"density": 2500, "friction": {"grain_grain": 0.3, "grain_wall": 0.2}},
    "bonds": {"strength": 1e-3, "gap_tolerance": 1e-3},
    "walls": {"base": {"shape": {"plane": {"normal": [0, 1], "place": "seated"}}},
        "lid": {"shape": {"plane": {"normal": [0, -1], "place": "seated"}}, "mass": "sample",
            "velocity": {"constant": 1e-9}}},
    "stages": [{"name": "rest", "duration": 0.01},
        {"name": "press", "duration": 0.02, "walls": {"lid": {"force": {"constant": 1}}}},
        {"name": "hold", "duration": 0.02, "walls": {"lid": {}}},
        {"name": "confine", "duration": 0.02, "walls": {"lid": {"stress": {"constant": 1e4}}}}]}"#;

/// Resumed after a change of drive, in a stage with a force.
#[test]
fn a_resumed_run_with_stages_has_the_history_of_an_uninterrupted_one() {
    let folder = folder();
    std::fs::write(folder.path().join("scene.json"), STAGED).expect("a file");
    let made = |args: &[&str]| {
        let (code, _, stderr) = dem_run(folder.path(), args);
        assert_eq!(code, Some(0), "{stderr}");
    };
    made(&["run", "scene.json", "--quiet", "-o", "whole.h5"]);
    made(&["run", "scene.json", "--quiet", "-o", "parts.h5", "--set", "time.end=0.015"]);
    made(&["resume", "parts.h5", "--quiet", "--until", "0.1"]);
    let [whole, parts] = ["whole.h5", "parts.h5"].map(|name| History::open(&folder.path().join(name)).expect("open"));
    let walls = whole.walls().expect("walls");
    assert_eq!((walls[0].drive, walls[1].drive), (WallDrive::Fixed, WallDrive::Velocity));
    assert_eq!(parts.walls().expect("walls"), walls);
    let names = whole.observable_names().expect("names");
    assert_eq!(parts.observable_names().expect("names"), names);
    for name in names.iter().filter(|name| *name != "cpu_time") {
        let [a, b] = [&whole, &parts].map(|history| history.observable(name).expect("read").expect("recorded").value);
        assert_eq!(
            a.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            b.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        );
    }
}

/// The load is the prescribed force in stages that prescribe one, else the force before the breaks.
#[test]
fn the_load_of_each_step_is_recorded_where_the_drive_of_a_wall_changes() {
    let folder = folder();
    std::fs::write(folder.path().join("scene.json"), STAGED).expect("a file");
    let run = |set: &str| {
        let path = folder.path().join("a.h5");
        let (code, _, stderr) =
            dem_run(folder.path(), &["run", "scene.json", "--quiet", "--force", "-o", "a.h5", "--set", set]);
        assert_eq!(code, Some(0), "{stderr}");
        History::open(&path).expect("open")
    };
    let history = run("time.end=0.1");
    let of_lid = |name: &str, index: &[usize]| {
        history.observable(name).expect("read").expect("recorded").component(index).expect("of the lid")
    };
    let (load, applied) = (of_lid("wall_load", &[1]), of_lid("applied_force", &[1]));
    let limit = of_lid("wall_force_at_limit", &[1, 1]);
    for (k, load) in load.iter().enumerate() {
        let forced = (10..30).contains(&k) || (50..70).contains(&k);
        assert_eq!(*load, if forced { applied[k] } else { limit[k] }, "step {}", k + 1);
    }
    assert_eq!((load.len(), load[10..30].iter().all(|load| *load == 1.0)), (70, true));
    // one kind of drive: `applied_force` and `wall_force_at_limit` are enough
    let same = run(r#"stages=[{"name": "press", "duration": 0.01, "walls": {"lid": {"force": {"constant": 1}}}}]"#);
    assert!(same.observable("wall_load").expect("read").is_none());
}
