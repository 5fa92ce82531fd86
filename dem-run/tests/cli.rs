//! The command line: exit codes, what goes to stdout and what to stderr.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

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
