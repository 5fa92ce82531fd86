//! Wrong scenes and wrong use of `dem-run`: exit code, place and remedy, and no file left behind.

use crate::common::{Folder, Outcome, SMALL, config, program};
use std::process::Command;

/// Run a scene of `configs/` with one assignment that is wrong; nothing must be left.
fn refused(scene: &str, set: &str, code: i32, parts: &[&str]) {
    let here = Folder::new();
    here.dem_run(&["run", &config(scene), "--set", set]).fails(code, parts);
    assert_eq!(here.names(), [""; 0], "{set}");
}

#[test]
fn wrong_values_are_refused_with_their_place_and_the_remedy() {
    for (scene, set, parts) in [
        ("column.json", "time.stepp=1e-3", &["time.stepp", "nearest  time.step"][..]),
        ("column.json", "material.density=1", &["material", "nearest  materials"]),
        ("compression.json", "bonds.strenght=5", &["bonds.strenght", "nearest  bonds.strength"]),
        ("column.json", "time.step=\"short\"", &["time.step", "found    string \"short\"", "a number"]),
        ("column.json", "dimension=[2]", &["dimension", "found    an array", "allowed"]),
        ("column.json", "solver.kind=newton", &["solver.kind", "the name alone", "{ \"newton\": { … } }"]),
        ("compression.json", "walls.top.velocity=0.1", &["found    0.1\n", "the kinds are constant, ramp"]),
        ("compression.json", "bonds.stiffness=true", &["found    true\n", "the kinds are springs, young"]),
        ("two-grains.json", "bonds.twist=0.1", &["bonds.twist", "dimension 2", "disks do not twist"]),
        ("bent-arm.json", "bonds.twist=0", &["bonds.twist", "> 0", "do not resist twist"]),
        (
            "bent-arm.json",
            r#"bonds.stiffness={"springs": {"normal": 1e6, "tangential": 1e6, "rolling": 1}}"#,
            &["bonds.stiffness.springs.twist", "found    nothing", "as bonds resist twist"],
        ),
        ("two-grains.json", "sample.grains.1.radius=-2e-3", &["sample.grains.1.radius", "-0.002", "> 0 (m)"]),
        ("column.json", "time.step=NaN", &["time.step", "NaN", "a number"]),
        ("column.json", "time.step=Infinity", &["time.step", "Infinity", "a number"]),
        ("column.json", "time.step=1e999", &["time.step", "1e999", "a finite number"]),
        ("column.json", "gravity=[0, -1e999]", &["gravity", "-1e999", "a finite number"]),
        ("column.json", "time.step=0", &["time.step", "> 0 (s)"]),
        ("column.json", "materials.friction.grain_grain=-0.1", &["materials.friction.grain_grain", "-0.1", "≥ 0"]),
        ("two-grains.json", "sample.grains.1.center=[0, 0]", &["sample.grains.1.center", "the centre of grain 0"]),
        // nearly: the direction between them would be noise
        ("two-grains.json", "sample.grains.1.center=[1e-12, 0]", &["grains 0 and 1 coincide", "move one"]),
        ("two-grains.json", "sample.grains.1.center=[1e-3, 0]", &["grains 0 and 1 overlap by 3.000e-3 m", "move one"]),
        ("two-grains.json", "time.step=1", &["time.step", "at most time.end (0.15 s)"]),
        (
            "column.json",
            "walls.bottom.shape.plane.place={\"at\": [0, 1e-3]}",
            &["walls.bottom", "overlaps grain 0 by 1.000e-3 m", "\"place\": \"seated\""],
        ),
        ("two-grains.json", "grains.fixed=[7]", &["grains.fixed.0", "found    7", "from 0 to 1"]),
    ] {
        refused(scene, set, 2, parts);
    }
}

#[test]
fn texts_that_are_no_scene_are_refused_at_their_line() {
    for (text, code, parts) in [
        (&b""[..], 2, &["line 1", "empty"][..]),
        (b"{ \"dimension\": 2,\n  \"seed\" 1 }", 2, &["line 2, column 10", "colon"]),
        (b"{ \"dimension\": 2,\n  \"seed\": NaN }", 2, &["line 2", "NaN", "write a finite number"]),
        (b"{ \"dimension\": 2, \"dimension\": 2 }", 2, &["dimension", "a second time", "each name once"]),
        (b"{}", 2, &["dimension"]),
        (b"[]", 2, &["the scene"]),
        (b"{ \"scene\": \"a.json\", \"vary\": [] }", 2, &["the scene", "a sweep", "`dem-run sweep`"]),
        // a history is not a scene
        (b"\x89HDF\r\n\x1a\n\0\0", 2, &["scene.json", "cannot be read", "an HDF5 file", "dem-run resume"]),
        (
            b"{ \"dimension\": 2,\n  \"title\": \"caf\xe9\" }",
            2,
            &["scene.json", "line 2 is not UTF-8 text from column 16 on", "save the file as UTF-8"],
        ),
    ] {
        let here = Folder::new();
        here.write("scene.json", text);
        here.dem_run(&["run", "scene.json"]).fails(code, parts);
        assert_eq!(here.names(), ["scene.json"]);
    }
}

#[test]
fn files_that_cannot_be_read_or_written_are_exit_4() {
    let here = Folder::new();
    let column = config("column.json");
    here.write("column.h5", "precious");
    for (args, parts) in [
        (&["run", "missing.json"][..], &["missing.json", "cannot be read"][..]),
        (&["run", "."], &["cannot be read", "a folder"]),
        (&["run", "/dev/zero"], &["/dev/zero", "not a regular file"]),
        (
            &["check", &column, "--set", r#"sample={"file": {"path": "/dev/zero"}}"#],
            &["/dev/zero", "not a regular file"],
        ),
        (&["run", &column], &["column.h5", "exists", "--force", "-o"]),
        (&["run", &column, "-o", "no/where.h5"], &["no/where.h5", "no folder no", "create it"]),
        (&["run", &column, "-o", "b.h5", "--write-sample", "no/where.csv"], &["no/where.csv", "create it"]),
        (&["run", &column, "-o", "b.h5", "--write-sample", "column.h5"], &["column.h5", "--force"]),
        (
            &["run", &column, "-o", "b.h5", "--set", r#"sample={"file": {"path": "none.csv"}}"#],
            &["sample.file.path", "none.csv", "cannot be read"],
        ),
    ] {
        here.dem_run(args).fails(4, parts);
        assert_eq!(here.names(), ["column.h5"], "{args:?}");
        assert_eq!(here.read("column.h5"), b"precious", "{args:?}");
    }
}

#[test]
fn even_by_force_a_run_writes_over_nothing_that_it_reads() {
    let here = Folder::new();
    here.write("scene.json", std::fs::read(config("column.json")).expect("scene"));
    here.write("sample.csv", "x,y,radius\n0,2e-3,2e-3\n");
    let path = here.path("sample.csv");
    let set = format!("sample={{\"file\": {{\"path\": {path:?}}}}}");
    let run = ["run", "scene.json", "--force", "--set", &set];
    for (args, part) in [
        (&["-o", "./scene.json"][..], "would overwrite what the run reads"),
        (&["-o", "sample.csv"], "would overwrite what the run reads"),
        (&["-o", "a.h5", "--write-sample", "sample.csv"], "would overwrite what the run reads"),
        (&["-o", "a.h5", "--write-sample", "scene.json"], "would overwrite what the run reads"),
        (&["-o", "a.h5", "--write-sample", "a.h5"], "two different names"),
    ] {
        here.dem_run(&[&run[..], args].concat()).fails(4, &[part]);
        assert_eq!(here.names(), ["sample.csv", "scene.json"]);
    }
    assert_eq!(here.read("sample.csv"), b"x,y,radius\n0,2e-3,2e-3\n");
}

#[test]
fn even_by_force_a_run_replaces_nothing_but_files() {
    use std::os::unix::fs::FileTypeExt;
    let here = Folder::new();
    let _listener = std::os::unix::net::UnixListener::bind(here.path("socket")).expect("socket");
    for option in ["-o", "--write-sample"] {
        let args = ["run", &config("column.json"), "--force", option, "socket"];
        here.dem_run(&args).fails(4, &["socket", "not a regular file", option]);
        assert_eq!(here.names(), ["socket"]);
    }
    assert!(std::fs::metadata(here.path("socket")).expect("socket").file_type().is_socket());
}

#[test]
fn force_replaces_a_file() {
    let here = Folder::new();
    here.write("column.h5", "old");
    here.run_config("column.json", &["--force"]);
    assert_eq!(here.history("column.h5").steps().last(), Some(&100));
}

#[test]
fn a_sample_file_is_refused_at_its_line() {
    for (table, parts) in [
        ("x,y,radius\n0,0,1e-3\n0,nan,1e-3\n", &["sample.csv, line 3", "y", "finite number"][..]),
        ("x,y,radius\n0,0,-1e-3\n", &["sample.csv, line 2", "radius is -0.001", "above zero"]),
        ("x,y,radius\n0,0\n", &["sample.csv, line 2"]),
        ("x,y,r\n0,0,1e-3\n", &["sample.csv, line 1", "x,y,radius"]),
        ("x,y,radius\n", &["sample.csv", "no grains"]),
        ("x,y,radius\n0,0,1e-3\n0,0,1e-3\n", &["grains 0 and 1 coincide"]),
        ("x;y;radius\n0;0;1e-3\n", &["sample.csv, line 1", "x,y,radius and, if needed, material, between commas"]),
        ("x,y,radius\n0,1,1\n0,1,-2\nzero,1,1\n", &["line 3: radius is -2", "line 4: x is \"zero\""]),
        ("x,y,radius\n0,1,1\n1,1,1\n9,1,1\n9,2,1\n", &["grains 0 and 1 overlap by 1.000e0 m", "grains 2 and 3"]),
    ] {
        let here = Folder::new();
        here.write("sample.csv", table);
        let path = here.path("sample.csv");
        let set = format!("sample={{\"file\": {{\"path\": {path:?}}}}}");
        for command in ["run", "check"] {
            here.dem_run(&[command, &config("column.json"), "--set", &set]).fails(2, parts);
            assert_eq!(here.names(), ["sample.csv"]);
        }
        let told = here.dem_run(&["check", &config("column.json"), "--set", &set, "--json"]).stdout;
        let told: serde_json::Value = serde_json::from_str(&told).expect("JSON");
        assert!(told["problems"][0]["message"].as_str().is_some_and(|text| text.contains(parts[0])), "{told}");
    }
}

#[test]
fn a_packing_looser_than_asked_is_refused() {
    let here = Folder::new();
    let dense = ["--set", "sample.random.preparation.compaction.solid_fraction=0.95"];
    let scene = config("compression.json");
    here.dem_run(&[&["run", &scene], &SMALL[..], &dense].concat())
        .fails(2, &["sample.random.preparation", "solid fraction of 0.", "asks for 0.95", "lower solid_fraction"]);
    assert_eq!(here.names(), [""; 0]);
}

#[test]
fn a_run_that_does_not_converge_is_exit_3_and_keeps_its_history() {
    let scene = config("compression.json");
    // a sweep finds the answer only while there is no force: at the first step, or until the force
    // comes
    let late = "walls.top.force={\"ramp\": {\"rate\": 100, \"start\": 5e-3}}";
    for (force, steps) in [("walls.top.force_rate=100", 0), (late, 50)] {
        let here = Folder::new();
        let mut limits = vec!["--set", "solver.kind.gauss_seidel.max_sweeps=1", "--set", "solver.max_step_halvings=0"];
        if steps > 0 {
            limits.extend(["--set", "walls.top.force_rate=null"]);
        }
        limits.extend(["--set", force, "-o", "a.h5"]);
        let outcome = here
            .dem_run(&[&["run", &scene], &SMALL[..], &limits].concat())
            .fails(3, &["no convergence at t =", "residual", "are furthest from their contact law", "max_sweeps"]);
        assert!(outcome.stdout.contains("a step was not solved"), "{}", outcome.stdout);
        assert_eq!(here.names(), ["a.h5"]);
        let history = here.history("a.h5");
        assert!(!history.open_ended());
        assert_eq!((history.steps().last(), history.observed_steps()), (Some(&(steps as i64)), steps));
        here.dem_post(&["info", "a.h5"]).succeeds();
    }
}

#[test]
fn what_check_finds_is_json_where_that_is_asked_for() {
    let here = Folder::new();
    here.write("comma.json", "{ \"dimension\": 2,\n  \"seed\" 1 }");
    let outcome = here.dem_run(&["check", "comma.json", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    assert_eq!((&found["problems"][0]["line"], &found["problems"][0]["column"]), (&2.into(), &10.into()), "{found}");
    outcome.fails(2, &["line 2, column 10"]);
}

#[test]
fn check_tells_where_the_last_step_ends() {
    let here = Folder::new();
    let scene = config("two-grains.json");
    let told = here.dem_run(&["check", &scene, "--set", "time.step=0.1"]).succeeds().stdout;
    assert!(told.contains("1 of 0.1 s, to 0.15 s; the last ends at 0.1\n"), "{told}");
    assert!(!here.dem_run(&["check", &scene]).succeeds().stdout.contains("the last ends"));
}

#[test]
fn bonds_that_were_not_formed_are_told() {
    let here = Folder::new();
    let far = ["--set", "sample.grains.1.center=[5e-3, 0]", "--quiet", "-o", "far.h5"];
    let told = here.dem_run(&[&["run", &config("two-grains.json")], &far[..]].concat()).succeeds().stdout;
    assert!(told.contains("no two grains are within bonds.gap_tolerance, 0.001 mean diameters"), "{told}");
    here.dem_post(&["cracks", "far.h5"]).fails(2, &["none was formed", "bonds.gap_tolerance"]);
    let none = here.dem_run(&["run", &config("column.json"), "--set", "time.end=1e-3", "--quiet"]).succeeds().stdout;
    assert!(!none.contains("bonds  "), "{none}");
}

#[test]
fn a_run_without_a_step_claims_nothing() {
    let here = Folder::new();
    let weak = ["--set", "solver.kind={\"gauss_seidel\": {\"max_sweeps\": 3}}", "--quiet"];
    let outcome = here.dem_run(&[&["run", &config("column.json")], &weak[..]].concat());
    for claim in ["nothing to solve", "worst residual", "dem-post chains"] {
        assert!(!outcome.stdout.contains(claim), "{}", outcome.stdout);
    }
    outcome.fails(3, &["no convergence at t = 0"]);
}

#[test]
fn a_pipe_is_not_waited_for() {
    let here = Folder::new();
    assert!(Command::new("mkfifo").arg(here.path("pipe")).status().expect("mkfifo").success());
    here.write("sweep.json", r#"{ "scene": "pipe", "vary": [{ "seed": [1, 2] }] }"#);
    for args in [["check", "pipe"], ["run", "pipe"], ["sweep", "pipe"], ["sweep", "sweep.json"]] {
        here.dem_run(&args).fails(4, &["pipe", "not a regular file", "to a file first"]);
    }
}

#[test]
fn a_scene_has_an_end() {
    let here = Folder::new();
    // a hole takes no room on the disk
    std::fs::File::create(here.path("big.json")).and_then(|file| file.set_len(1 << 40)).expect("a hole");
    here.dem_run(&["check", "big.json"]).fails(4, &["big.json", "more than 256 MiB", "sample.file"]);
    let set = format!("sample={{\"file\": {{\"path\": {:?}}}}}", here.path("big.csv"));
    here.write("big.csv", "1".repeat(1 << 20));
    here.dem_run(&["check", &config("column.json"), "--set", &set]).fails(2, &["it has more than 4096 bytes"]);
}

#[test]
fn a_scene_too_large_for_the_memory_is_refused() {
    let here = Folder::new();
    let sets = r#"--set 'sample={"lattice": {"square": {"diameter": 1e-3, "rows": 3000, "columns": 3000}}}'"#;
    let within_of = |command: &str, scene: &str| {
        let line = format!("ulimit -v 1000000; exec {:?} {command} {:?} {sets}", program("dem-run"), config(scene));
        Command::new("sh").args(["-c", &line]).current_dir(here.path("")).output().expect("sh")
    };
    let within = |command: &str| within_of(command, "column.json");
    let told = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    for (command, scene) in [("limit", "compression.json"), ("accuracy", "column.json")] {
        let refused = within_of(command, scene);
        assert_eq!(refused.status.code(), Some(4), "{command}");
        let error = told(refused.stderr);
        assert!(error.contains("9000000 grains need about") && error.contains("--ignore-memory"), "{command}: {error}");
    }
    let run = within("run");
    assert_eq!(run.status.code(), Some(4));
    let error = told(run.stderr);
    for part in
        ["9000000 grains need about 18.0 GB of memory", "1.0 GB are free", "use fewer grains", "--ignore-memory"]
    {
        assert!(error.contains(part), "{part} is not in\n{error}");
    }
    assert_eq!(here.names(), [""; 0]);
    let check = within("check");
    assert_eq!(check.status.code(), Some(0));
    assert!(told(check.stdout).contains("memory     about 18.0 GB; free 1.0 GB"));
    assert!(told(check.stderr).contains("needs more memory than is free"));
}

#[test]
fn a_name_that_is_not_utf_8_is_refused_at_once() {
    use std::os::unix::ffi::OsStrExt;
    let here = Folder::new();
    let name = std::ffi::OsStr::from_bytes(b"a\xff.h5");
    for command in ["run", "sweep"] {
        let output = Command::new(program("dem-run"))
            .args([command, &config("compression.json"), "-o"])
            .arg(name)
            .current_dir(here.path(""))
            .output()
            .expect("start");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("is not UTF-8: name another with -o") && !told.contains("packing"), "{told}");
        assert_eq!(std::fs::read_dir(here.path("")).expect("folder").count(), 0);
    }
}

#[test]
fn control_characters_do_not_reach_the_terminal() {
    let here = Folder::new();
    let scene = config("two-grains.json");
    here.write("a\u{1b}[31m.json", "{");
    let name = "a\u{1b}[31m.h5";
    for args in [
        &["check", &scene, "--set", r#"title="\u001b[31mred\u0007""#][..],
        &["run", &scene, "-o", name],
        &["run", &scene, "-o", name],
        &["check", "a\u{1b}[31m.json"],
        &["check", &scene, "--threads[31m\u{1b}"],
        &["check", &scene, "--set", "title\u{1b}[31m=1"],
    ] {
        let Outcome { stdout, stderr, .. } = here.dem_run(args);
        let raw = |text: &str| text.chars().any(|c| c.is_control() && c != '\n');
        assert!(!raw(&stdout) && !raw(&stderr), "{args:?}: {stdout:?} {stderr:?}");
        assert!((stdout + &stderr).contains("[31m"), "{args:?}");
    }
}

#[test]
fn a_wall_that_carries_nothing_is_told_before_and_after() {
    let here = Folder::new();
    let box_of_shear = r#"{ "dimension": 2,
        "sample": { "lattice": { "hexagonal": { "diameter": 2e-3, "rows": 4, "columns": 6 } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.3 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
        "walls": { "bottom": { "shape": { "plane": { "normal": [0, 1], "place": "seated" } } },
                   "top": { "shape": { "plane": { "normal": [0, -1], "place": "seated" } },
                            "direction": [1, 0], "velocity": { "constant": 0.01 } } },
        "time": { "step": 1e-4, "end": 1e-2 }, "output": { "every_steps": 10 } }"#;
    here.write("box.json", box_of_shear);
    let before = "warning: walls.top: it is driven along its own surface";
    let after = "warning: walls.top: no force ever acted on this driven wall";
    let check = here.dem_run(&["check", "box.json"]).succeeds();
    assert!(check.stderr.contains(before), "{}", check.stderr);
    let run = here.dem_run(&["run", "box.json"]).succeeds();
    assert!(run.stderr.contains(before) && run.stderr.contains(after), "{}", run.stderr);
    let pressed = here.dem_run(&["run", "box.json", "--force", "--set", "walls.top.direction=[0, -1]"]);
    assert!(!pressed.stderr.contains("warning"), "{}", pressed.stderr);
    assert_eq!(here.dem_run(&["run", "box.json", "--force", "--quiet"]).succeeds().stderr, "");
}

#[test]
fn the_history_of_a_failed_run_is_named_where_there_is_one() {
    let here = Folder::new();
    let sweep = serde_json::json!({
        "scene": config("compression.json"),
        "set": { "sample.random.count": 60, "sample.random.width": 0.014 },
        "vary": [{ "sample.random.preparation.compaction.solid_fraction": [0.95] }],
    });
    here.write("sweep.json", sweep.to_string());
    let told = here.dem_run(&["sweep", "sweep.json"]).fails(2, &["1 of 1 runs failed", "see runs/NNNN.log"]).stderr;
    assert!(!told.contains("failed.h5"), "{told}");
}

#[test]
fn a_run_does_not_go_beyond_its_end() {
    let here = Folder::new();
    let sets = ["--set", "time.step=3e-3", "--set", "time.end=0.1", "--set", "output.every_steps=1"];
    let outcome = here.dem_run(&[&["run", &config("incline.json"), "--json", "-o", "a.h5"], &sets[..]].concat());
    assert!(outcome.stderr.contains("time.end: 0.1 s is not a multiple of time.step, 0.003 s"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("0.099 s and 0.102 s are multiples"), "{}", outcome.stderr);
    assert_eq!(here.history("a.h5").steps().last(), Some(&33));
}
