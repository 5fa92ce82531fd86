//! Sweeps: every run a history, killed and gone on with, with runs that fail, and refused where
//! they are wrong.

use crate::common::{Folder, PATIENCE, SMALL, config, content, program};
use serde_json::{Value, json};
use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

/// Write a sweep of a scene in `configs/` to `sweep.json`.
fn write(here: &Folder, scene: &str, set: Value, vary: Value) {
    let sweep = json!({ "title": "A study", "scene": config(scene), "set": set, "vary": vary });
    here.write("sweep.json", sweep.to_string());
}

/// Two grains pulled apart with these strengths, some tenths of a second each.
fn strengths(here: &Folder, strengths: &[u64]) {
    write(here, "two-grains.json", json!({ "time.step": 2e-5 }), json!([{ "bonds.strength": strengths }]));
}

/// A column whose second run of three does not converge.
fn failing(here: &Folder) {
    let kind = |sweeps: u64| json!({ "gauss_seidel": { "max_sweeps": sweeps } });
    let set =
        json!({ "solver.max_step_halvings": 0, "solver.tolerance": 1e-4, "solver.accept": 1e-4, "time.end": 0.01 });
    write(here, "column.json", set, json!([{ "solver.kind": [kind(10_000), kind(3), kind(20_000)] }]));
}

/// The manifest as JSON.
fn manifest(here: &Folder, folder: &str) -> Value {
    serde_json::from_slice(&here.read(&format!("{folder}/manifest.json"))).expect("manifest.json")
}

/// The state of every run in the manifest.
fn states(here: &Folder, folder: &str) -> Vec<String> {
    let manifest = manifest(here, folder);
    let runs = manifest["runs"].as_array().expect("runs").iter();
    runs.map(|run| run["state"].as_str().expect("state").to_string()).collect()
}

/// The files of the runs with this ending, sorted.
fn files(here: &Folder, folder: &str, ending: &str) -> Vec<String> {
    let entries = fs::read_dir(here.path(folder).join("runs")).into_iter().flatten();
    let names = entries.map(|entry| entry.expect("entry").file_name().into_string().expect("UTF-8"));
    let mut names: Vec<String> = names.filter(|name| name.ends_with(ending)).collect();
    names.sort();
    names
}

/// When a run was recorded and its history written.
fn written(here: &Folder, folder: &str, id: &str) -> [SystemTime; 2] {
    [".state.json", ".h5"].map(|ending| {
        let path = here.path(folder).join("runs").join(format!("{id}{ending}"));
        path.metadata().and_then(|data| data.modified()).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    })
}

fn start(here: &Folder, args: &[&str]) -> Child {
    let mut command = Command::new(program("dem-run"));
    command.arg("sweep").args(args).current_dir(here.path("")).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("start")
}

/// Whether a process has been started with a path in this folder.
#[cfg(target_os = "linux")]
fn runs_in(here: &Folder) -> bool {
    let folder = here.path("").canonicalize().expect("folder");
    let processes = fs::read_dir("/proc").expect("/proc").filter_map(Result::ok);
    // one that has just ended has no such entries any more; the paths on its command line start in
    // its folder
    processes.map(|process| process.path()).any(|process| {
        let is_run = fs::read(process.join("cmdline")).is_ok_and(|line| line.windows(7).any(|part| part == b"part.h5"));
        is_run && fs::read_link(process.join("cwd")).is_ok_and(|cwd| cwd == folder)
    })
}

/// Wait until something is so, or fail.
fn wait_until(what: &str, mut so: impl FnMut() -> bool) {
    let patience = Instant::now() + PATIENCE;
    while !so() {
        assert!(Instant::now() < patience, "not after {PATIENCE:?}: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn every_run_of_a_sweep_is_the_run_of_its_scene() {
    let here = Folder::new();
    let set = json!({ "title": "a sweep" });
    write(
        &here,
        "two-grains.json",
        set,
        json!([{ "bonds.strength": [5, 10], "time.end": [0.06, 0.11] }, { "seed": { "from": 3, "count": 2 } }]),
    );
    let told = here.dem_run(&["sweep", "sweep.json", "--json", "--quiet"]).json();
    assert_eq!(states(&here, "sweep-sweep"), ["done"; 4]);
    assert_eq!(told["runs"], manifest(&here, "sweep-sweep")["runs"]);
    assert_eq!(manifest(&here, "sweep-sweep")["title"], "A study");
    assert_eq!(told["runs"][3]["values"], json!({ "bonds.strength": 10, "seed": 4, "time.end": 0.11 }));
    assert!(told["runs"][3]["cpu_time"].as_f64().is_some_and(|time| time > 0.0));
    assert_eq!(files(&here, "sweep-sweep", ".h5"), ["0001.h5", "0002.h5", "0003.h5", "0004.h5"]);
    assert!(!here.path("sweep-sweep/packings").exists(), "no sample is random");

    here.run_config("two-grains.json", &["-o", "alone.h5", "--set", "bonds.strength=10", "--set", "time.end=0.11"]);
    let alone = content(&here.history("alone.h5"));
    assert_eq!(content(&here.history("sweep-sweep/runs/0003.h5")), alone);
    assert_ne!(content(&here.history("sweep-sweep/runs/0001.h5")), alone);

    let table = String::from_utf8(here.read("sweep-sweep/runs.csv")).expect("UTF-8");
    let lines: Vec<&str> = table.lines().collect();
    assert!(lines[0].starts_with("id,bonds.strength,time.end,seed,state,ending,steps,"), "{}", lines[0]);
    assert!(lines[4].starts_with("0004,10,0.11,4,done,broken_fraction,1001,"), "{}", lines[4]);

    // nothing is left to do
    let before = written(&here, "sweep-sweep", "0002");
    here.dem_run(&["sweep", "sweep.json"]).succeeds();
    assert_eq!(written(&here, "sweep-sweep", "0002"), before);
    // a history that is lost is made again
    fs::remove_file(here.path("sweep-sweep/runs/0003.h5")).expect("remove");
    here.dem_run(&["sweep", "sweep.json", "-q"]).succeeds();
    assert_eq!(content(&here.history("sweep-sweep/runs/0003.h5")), alone);
    assert_eq!(written(&here, "sweep-sweep", "0002"), before);
}

#[test]
fn a_sweep_that_was_killed_ends_as_one_that_was_not() {
    let here = Folder::new();
    strengths(&here, &[6, 7, 8, 9, 10, 11]);
    let mut child = start(&here, &["sweep.json", "-o", "killed", "--jobs", "1"]);
    // two runs are done and the third has begun
    wait_until("a third run", || {
        files(&here, "killed", ".state.json").len() == 2 && files(&here, "killed", ".part.h5") == ["0003.part.h5"]
    });
    #[cfg(target_os = "linux")]
    assert!(runs_in(&here));
    child.kill().expect("kill");
    child.wait().expect("wait");
    #[cfg(target_os = "linux")]
    wait_until("its run has ended as well", || !runs_in(&here));
    assert_eq!(files(&here, "killed", ".state.json"), ["0001.state.json", "0002.state.json"]);
    let before = [written(&here, "killed", "0001"), written(&here, "killed", "0002")];
    let status = here.dem_run(&["sweep", "sweep.json", "-o", "killed", "--status", "--json"]).json();
    assert_eq!((&status["runs"][1]["state"], &status["runs"][5]["state"]), (&"done".into(), &"left".into()));

    here.dem_run(&["sweep", "sweep.json", "-o", "killed"]).succeeds();
    assert_eq!(states(&here, "killed"), ["done"; 6]);
    assert_eq!([written(&here, "killed", "0001"), written(&here, "killed", "0002")], before, "done, and done again");
    assert_eq!(files(&here, "killed", ".part.h5"), [""; 0]);

    here.dem_run(&["sweep", "sweep.json", "-o", "whole", "-q"]).succeeds();
    for id in 1..=6 {
        let of = |folder: &str| content(&here.history(&format!("{folder}/runs/{id:04}.h5")));
        assert!(of("killed") == of("whole"), "run {id} differs");
    }
}

#[test]
fn an_interrupted_sweep_ends_its_runs_and_keeps_what_is_done() {
    let here = Folder::new();
    // the second takes hours: it ends by the signal only
    let vary = json!([{ "time.step": [1e-4, 1e-9], "bonds.strength": [5, 10] }]);
    write(&here, "two-grains.json", json!({ "output.every_steps": 1000 }), vary);
    let mut child = start(&here, &["sweep.json", "--jobs", "2"]);
    wait_until("one is done, one runs", || {
        files(&here, "sweep-sweep", ".state.json") == ["0001.state.json"]
            && files(&here, "sweep-sweep", ".part.h5") == ["0002.part.h5"]
    });
    let status = here.dem_run(&["sweep", "sweep.json", "--status", "--json"]).json();
    assert_eq!((&status["runs"][0]["state"], &status["runs"][1]["state"]), (&"done".into(), &"running".into()));
    let signal = format!("kill -TERM {}", child.id());
    assert!(Command::new("sh").args(["-c", &signal]).status().expect("sh").success());
    assert_eq!(child.wait().expect("wait").code(), Some(130));
    assert_eq!(states(&here, "sweep-sweep"), ["done", "left"]);
    assert_eq!(files(&here, "sweep-sweep", ".h5"), ["0001.h5"]);
}

#[test]
fn a_run_that_fails_does_not_end_the_others() {
    let here = Folder::new();
    failing(&here);
    let outcome = here.dem_run(&["sweep", "sweep.json"]).fails(3, &["1 of 3 runs failed", "--retry"]);
    assert!(outcome.stdout.contains("0002  solver.kind = {\"gauss_seidel\":{\"max_sweeps\":3}}: no convergence at t"));
    assert_eq!(states(&here, "sweep-sweep"), ["done", "failed", "done"]);
    assert_eq!(files(&here, "sweep-sweep", ".h5"), ["0001.h5", "0002.failed.h5", "0003.h5"]);
    let table = String::from_utf8(here.read("sweep-sweep/runs.csv")).expect("text");
    assert!(table.contains("runs/0002.failed.h5") && !table.contains("runs/0002.h5"), "{table}");
    assert_eq!(
        here.dem_post(&["info", "sweep-sweep/runs/0002.failed.h5", "--json"]).json()["ending"],
        "no_convergence"
    );

    // it would fail again: it is left alone unless asked for
    let record = || here.path("sweep-sweep/runs/0002.state.json").metadata().and_then(|m| m.modified()).expect("time");
    let before = record();
    here.dem_run(&["sweep", "sweep.json", "-q"]).fails(3, &["1 of 3"]);
    assert_eq!(record(), before);
    here.dem_run(&["sweep", "sweep.json", "-q", "--retry"]).fails(3, &["1 of 3"]);
    assert!(record() > before);
}

#[test]
fn a_run_that_could_not_write_is_run_again() {
    let here = Folder::new();
    strengths(&here, &[1, 2]);
    // no history can be made where a folder stands
    fs::create_dir_all(here.path("sweep-sweep/runs/0002.part.h5")).expect("folder");
    here.dem_run(&["sweep", "sweep.json", "--force"]).fails(4, &["1 of 2 runs failed"]);
    assert_eq!(states(&here, "sweep-sweep"), ["done", "failed"]);
    let message = &manifest(&here, "sweep-sweep")["runs"][1]["message"];
    assert!(message.as_str().is_some_and(|text| text.contains("is a folder")), "{message}");
    fs::remove_dir_all(here.path("sweep-sweep/runs/0002.part.h5")).expect("remove");
    here.dem_run(&["sweep", "sweep.json"]).succeeds();
    assert_eq!(states(&here, "sweep-sweep"), ["done"; 2]);
}

#[test]
fn a_changed_sweep_keeps_what_it_still_gives_and_asks_before_it_drops_the_rest() {
    let here = Folder::new();
    strengths(&here, &[1, 2]);
    here.dem_run(&["sweep", "sweep.json", "-q"]).succeeds();
    let before = written(&here, "sweep-sweep", "0002");
    // more values, wherever they stand: the others keep their numbers
    strengths(&here, &[3, 1, 2]);
    here.dem_run(&["sweep", "sweep.json", "-q"]).succeeds();
    assert_eq!(written(&here, "sweep-sweep", "0002"), before);
    assert_eq!(manifest(&here, "sweep-sweep")["runs"][2]["values"], json!({ "bonds.strength": 3 }));

    let set = json!({ "time.step": 2e-5, "materials.density": 2600 });
    write(&here, "two-grains.json", set, json!([{ "bonds.strength": [1, 2] }]));
    let parts = [
        "0001 (bonds.strength = 1): materials.density was 2500.0, is 2600.0",
        "0003 (bonds.strength = 3): no longer in the sweep",
        "--force",
        "-o DIR",
    ];
    here.dem_run(&["sweep", "sweep.json"]).fails(4, &parts);
    assert_eq!(written(&here, "sweep-sweep", "0002"), before);
    here.dem_run(&["sweep", "sweep.json", "-q", "--force"]).succeeds();
    assert_ne!(written(&here, "sweep-sweep", "0002"), before);
    assert_eq!(files(&here, "sweep-sweep", ".h5"), ["0001.h5", "0002.h5"]);
}

#[test]
fn tasks_of_a_scheduler_carry_out_one_run_each() {
    let here = Folder::new();
    failing(&here);
    let told = here.dem_run(&["sweep", "sweep.json", "-o", "a b", "--prepare"]).succeeds().stdout;
    assert!(told.contains("sbatch 'a b/slurm.sh'") && told.contains("left     3"), "{told}");
    assert_eq!(files(&here, "a b", ""), [""; 0]);
    let slurm = String::from_utf8(here.read("a b/slurm.sh")).expect("UTF-8");
    assert!(slurm.contains("#SBATCH --array=1-3\n"), "{slurm}");
    assert!(String::from_utf8(here.read("a b/Snakefile")).expect("UTF-8").contains("rule all:"));
    let task = slurm.lines().find_map(|line| line.strip_prefix("exec ")).expect("the task");
    let run = |number: u64| {
        let number = number.to_string();
        Command::new("sh").args(["-c", task]).env("SLURM_ARRAY_TASK_ID", number).output().expect("sh").status.code()
    };
    let plan = here.read("a b/manifest.json");
    assert_eq!((run(3), run(2), run(4)), (Some(0), Some(3), Some(2)));
    assert_eq!(here.read("a b/manifest.json"), plan, "a task writes nothing that others write");
    assert_eq!(files(&here, "a b", ".state.json"), ["0002.state.json", "0003.state.json"]);
    let status = here.dem_run(&["sweep", "sweep.json", "-o", "a b", "--status"]).succeeds().stdout;
    assert!(["done     1", "failed   1", "left     1"].iter().all(|part| status.contains(part)), "{status}");
    assert_eq!(states(&here, "a b"), ["left", "failed", "done"]);

    strengths(&here, &[1, 2]);
    let parts = ["run 0001", "no longer in sweep.json", "--prepare"];
    here.dem_run(&["sweep", "sweep.json", "-o", "a b", "--run", "1"]).fails(4, &parts);
    here.dem_run(&["sweep", "sweep.json", "-o", "none", "--run", "1"]).fails(4, &["no manifest.json", "--prepare"]);
}

#[test]
fn wrong_sweeps_are_refused_before_anything_is_written() {
    for (sweep, code, parts) in [
        ("{", 2, &["sweep.json, line 1"][..]),
        ("[]", 2, &["sweep.json is wrong at one place", "the sweep"]),
        (r#"{ "scene": "S" }"#, 2, &["vary", "this field is required"]),
        (r#"{ "dimension": 2, "sample": "S" }"#, 2, &["the sweep", "a scene", "`dem-run run`"]),
        (r#"{ "scene": "none.json", "vary": [{"seed": [1]}] }"#, 4, &["sweep.json names a scene", "none.json"]),
        (
            r#"{ "scene": "S", "vary": [{"bonds.strenght": [1]}] }"#,
            2,
            &["vary.0.bonds.strenght", "nearest  bonds.strength"],
        ),
        (r#"{ "scene": "S", "vary": [{"bonds.strength": []}] }"#, 2, &["vary.0.bonds.strength", "at least one value"]),
        (
            r#"{ "scene": "S", "vary": [{"bonds.strength": [1, 2], "seed": [1]}] }"#,
            2,
            &["vary.0", "the same number of values"],
        ),
        (
            r#"{ "scene": "S", "vary": [{"bonds.strength": [1, -1]}, {"time.step": [0, 1e-4]}] }"#,
            2,
            &["wrong at 2 places", "vary.0.bonds.strength.1", "vary.1.time.step.0 (line 1", "> 0 (s)"],
        ),
    ] {
        let here = Folder::new();
        here.write("sweep.json", sweep.replace("\"S\"", &format!("{:?}", config("two-grains.json"))));
        here.dem_run(&["sweep", "sweep.json"]).fails(code, parts);
        here.dem_run(&["sweep", "sweep.json", "--prepare"]).fails(code, parts);
        assert_eq!(here.names(), ["sweep.json"]);
    }
}

#[test]
fn the_sweeps_of_the_paper_s_questions_are_right() {
    let here = Folder::new();
    for (name, runs) in [
        ("sweep-biaxial.json", 25),
        ("sweep-triaxial.json", 9),
        ("sweep-brazilian.json", 20),
        ("sweep-cohesion.json", 30),
        ("sweep-cohesion-fixed-ramp.json", 30),
        ("sweep-rate.json", 12),
        ("sweep-size.json", 12),
        ("sweep-friction.json", 15),
        ("sweep-scatter.json", 160),
    ] {
        let check = here.dem_run(&["sweep", &config(name), "--check", "--json"]).json();
        assert_eq!(check["runs"].as_array().map(Vec::len), Some(runs), "{name}");
    }
    assert_eq!(here.names(), [""; 0]);
}

#[test]
fn the_strength_of_a_sweep_is_proportional_to_the_cohesion_in_each_sample() {
    let here = Folder::new();
    let small: serde_json::Map<String, Value> = SMALL
        .iter()
        .filter_map(|set| set.split_once('='))
        .filter(|(path, _)| *path != "walls.top.force_rate")
        .map(|(path, value)| (path.to_string(), serde_json::from_str(value).expect("JSON")))
        .collect();
    let vary = json!([{ "bonds.strength": [5, 10, 20], "walls.top.force_rate": [50, 100, 200] }, { "seed": [1, 2] }]);
    write(&here, "compression.json", Value::Object(small), vary);
    here.dem_run(&["sweep", "sweep.json", "-o", "out", "--quiet"]).succeeds();
    for measure in ["broken", "first-break"] {
        let found = here.dem_post(&["strength", "out", "-o", measure, "--measure", measure, "--json"]).json();
        assert_eq!(found["field"], "bonds.strength");
        assert_eq!(found["along"], json!(["walls.top.force_rate"]));
        let samples = found["samples"].as_array().expect("samples");
        assert_eq!(samples.len(), 2);
        for sample in samples {
            let number = |pointer: &str| sample.pointer(pointer).and_then(Value::as_f64).expect("a number");
            assert_eq!(number("/runs"), 3.0);
            assert!(number("/ratio_deviation") <= 0.005, "{sample}");
            assert!(number("/line/r_squared") > 0.999, "{sample}");
        }
        assert_ne!(samples[0]["ratio"], samples[1]["ratio"], "the samples are two");
        assert!(here.path(measure).join("strength.png").exists());
    }
    // runs of other scenes are not one field's doing
    here.run_config("two-grains.json", &["-o", "other.h5", "--quiet"]);
    here.dem_post(&["strength", "out/runs/0001.h5", "other.h5"]).fails(2, &["several fields differ", "--against"]);
}
