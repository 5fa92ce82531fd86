//! Strength against a field, on small histories whose strengths are known.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dem_history::*;
use serde_json::{Value, json};

/// Two bonded grains: the load grows by 0.5 N a step, and the bond breaks under the given load.
struct Run {
    cohesion: f64,
    seed: u64,
    /// Load under which the bond breaks, N.
    breaks_at: f64,
    /// Whether a wall is driven; else a grain is pulled.
    driven: bool,
    /// Further fields of the scene.
    scene: Value,
}

impl Run {
    fn new(cohesion: f64, seed: u64, breaks_at: f64) -> Self {
        Self { cohesion, seed, breaks_at, driven: true, scene: json!({}) }
    }

    /// The scene stored in the history.
    fn text(&self) -> String {
        let mut scene = json!({ "seed": self.seed, "thickness": 0.5, "bonds": { "strength": self.cohesion } });
        scene.as_object_mut().unwrap().extend(self.scene.as_object().unwrap().clone());
        scene.to_string()
    }

    fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        let drive = if self.driven { WallDrive::Force } else { WallDrive::Fixed };
        let direction = if self.driven { [0.0, -1.0, 0.0] } else { [0.0; 3] };
        let normal = [0.0, -1.0, 0.0];
        let wall = Wall { name: "top".into(), normal, drive, direction, ..Wall::default() };
        let layout = Layout {
            dimension: 2,
            friction: true,
            grains: Grains {
                id: vec![0, 1],
                radius: vec![1e-3; 2],
                mass: vec![1.0; 2],
                inertia: vec![1.0; 2],
                material: vec![],
            },
            walls: vec![wall],
            bonds: Bonds {
                pair: vec![[0, 1]],
                rest_gap: vec![0.0],
                strength: vec![self.cohesion],
                friction: vec![0.3],
                rolling: vec![],
                twist: None,
                mean_diameter: vec![2e-3],
                formed: None,
            },
            observables: vec![
                Observable::new("wall_position", "m", &[1, 2]),
                Observable::new("applied_force", "N", &[1]),
                Observable::new("strain", "", &[2, 2]),
                Observable::new("bonds_broken", "", &[]),
            ],
            parameters: Parameters { scene: self.text(), seed: self.seed, ..Parameters::default() },
            ..Layout::default()
        };
        let mut writer = Writer::create(&path, &layout, false).unwrap();
        for step in 0..=60 {
            let load = 0.5 * step as f64;
            let broken = load >= self.breaks_at;
            // it fails a step after the break
            let strain = -1e-2 * (load - self.breaks_at).max(0.0);
            let row = [0.0, 4e-3 * (1.0 + strain), load, 0.0, 0.0, 0.0, strain, f64::from(u8::from(broken))];
            writer.observe(step, step as f64 * 1e-3, &row).unwrap();
            let position = vec![0.0, 1e-3, 0.0, 3e-3];
            let grains = GrainState { position, velocity: vec![0.0; 4], ..GrainState::default() };
            let still = vec![0.0; 2];
            let walls = WallState { position: vec![0.0, 4e-3], velocity: still.clone(), force: still };
            let bonds = vec![if broken { BondStatus::Tension } else { BondStatus::Intact }];
            let contacts = ContactRows::default();
            let time = step as f64 * 1e-3;
            writer.frame(&Frame { step, time, grains, walls, contacts, bonds }).unwrap();
        }
        writer.finish().unwrap();
        path
    }
}

/// Runs at 5, 10 and 20 N of the given seeds, whose bonds break under `load(cohesion, seed)`.
fn grid(folder: &Path, seeds: &[u64], load: impl Fn(f64, u64) -> f64) {
    for cohesion in [5.0, 10.0, 20.0] {
        for &seed in seeds {
            Run::new(cohesion, seed, load(cohesion, seed)).write(folder, &format!("{cohesion}-{seed}.h5"));
        }
    }
}

fn strength(folder: &Path, arguments: &[&str]) -> Output {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.retain(|name| name.to_string_lossy().ends_with(".h5"));
    files.sort();
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    command.current_dir(folder).arg("strength").args(files).args(arguments).output().unwrap()
}

fn json_of(output: &Output, code: i32) -> Value {
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refused(output: &Output, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "{message:?} lacks {word:?}");
    }
}

fn close(value: &Value, expected: f64) {
    let found = value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    assert!((found - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{found} is not {expected}");
}

#[test]
fn the_force_at_the_first_break_is_the_strength() {
    for driven in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        // the same loads in the scene, for a grain that is pulled: those of the middle of each step
        let table = [[0.0, 0.125], [0.06, 15.125]];
        let pull = json!({ "loads": [{ "grain": 1, "force": [0, -2], "time": { "table": table } }] });
        for cohesion in [5.0, 10.0, 20.0] {
            let scene = if driven { json!({}) } else { json!({ "grains": pull }) };
            let run = Run { driven, scene, ..Run::new(cohesion, 1, cohesion) };
            run.write(folder.path(), &format!("{cohesion}.h5"));
        }
        for measure in ["first-break", "broken", "collapse"] {
            let found = json_of(&strength(folder.path(), &["--measure", measure, "--json", "--quiet"]), 0);
            assert_eq!((&found["field"], &found["unit"]), (&json!("bonds.strength"), &json!("N")));
            close(&found["line"]["slope"]["value"], 1.0);
            close(&found["line"]["r_squared"], 1.0);
            assert!(found["line"]["intercept"]["value"].as_f64().unwrap().abs() < 1e-12);
            close(&found["samples"][0]["ratio"], 1.0);
            assert!(found["samples"][0]["ratio_deviation"].as_f64().unwrap() < 1e-12);
            // one sample shows no scatter
            assert!(found["over_samples"]["slope"]["deviation"].is_null());
            assert!(found["notes"][0].as_str().unwrap().contains("only one sample"), "{}", found["notes"]);
        }
    }
}

#[test]
fn samples_have_lines_and_their_slopes_an_interval() {
    let folder = tempfile::tempdir().unwrap();
    // slopes 0.8, 1.0 and 1.2, and an intercept of 1 N
    grid(folder.path(), &[1, 2, 3], |cohesion, seed| (3 + seed) as f64 * cohesion / 5.0 + 1.0);
    let output = strength(folder.path(), &["--measure", "first-break", "--json", "-o", "out"]);
    let found = json_of(&output, 0);
    for (k, slope) in [0.8, 1.0, 1.2].into_iter().enumerate() {
        assert_eq!(found["samples"][k]["sample"], format!("seed {}", k + 1));
        close(&found["samples"][k]["line"]["slope"]["value"], slope);
        assert_eq!(found["samples"][k]["same_grains"], true);
    }
    let over = &found["over_samples"];
    close(&over["slope"]["mean"], 1.0);
    close(&over["slope"]["deviation"], 0.2);
    // t with two degrees of freedom is 4.302652730
    let high = over["slope"]["interval"][1].as_f64().unwrap();
    assert!((high - (1.0 + 4.302_652_730 * 0.2 / 3f64.sqrt())).abs() < 1e-8, "{high}");
    close(&over["intercept"]["mean"], 1.0);
    // 17, 21 and 25 N at 20 N
    let last = &found["values"][2];
    assert_eq!(
        (&last["value"], &last["strength"]["count"], &last["range"]),
        (&json!(20.0), &json!(3), &json!([17.0, 25.0]))
    );
    close(&last["strength"]["deviation"], 4.0);
    // (5, 9, 17) N over (5, 10, 20) N are 1, 0.9, 0.85, of mean 0.91667
    close(&found["samples"][0]["ratio"], 2.75 / 3.0);
    close(&found["samples"][0]["ratio_deviation"], 3.0 / 2.75 - 1.0);
    let lines = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap().lines().count();
    assert_eq!([lines("strength.csv"), lines("strength-values.csv"), lines("strength-samples.csv")], [10, 4, 4]);
    assert!(std::fs::read(folder.path().join("out/strength.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(std::fs::read_to_string(folder.path().join("out/strength.svg")).unwrap().contains("y = 1 x + 1"));
    let table = String::from_utf8(strength(folder.path(), &["--quiet"]).stdout).unwrap();
    for part in ["bonds.strength (N), 3 values", "3, by seed", "slope over samples", "y = 1 x + 1"] {
        assert!(table.contains(part), "{table} lacks {part}");
    }
    // each sample lies on its own line: R² of all runs is below 1 only because samples differ
    let line = table.lines().find(|line| line.contains("R²")).unwrap();
    assert!(
        line.contains("over all runs, with the scatter of samples; 1 at least in each sample's own line"),
        "{line}"
    );
    assert!(!line.contains(" 1 over all runs"), "{line}");
}

#[test]
fn a_run_that_holds_is_listed_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    grid(folder.path(), &[1, 2], |cohesion, seed| if seed == 2 && cohesion == 20.0 { 99.0 } else { cohesion });
    let output = strength(folder.path(), &["--json", "--quiet"]);
    let found = json_of(&output, 1);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("1 of 6 runs are left out") && message.contains("20-2.h5"), "{message}");
    assert_eq!((found["runs"].as_array().unwrap().len(), &found["left_out"][0]["run"]), (5, &json!("20-2.h5")));
    assert!(found["left_out"][0]["why"].as_str().unwrap().contains("0 of 1 bonds have broken by 30 N"));
    let table = String::from_utf8(strength(folder.path(), &[]).stdout).unwrap();
    assert!(table.contains("left out: 20-2.h5"), "{table}");
    // no load falls: there is no peak at all
    refused(&strength(folder.path(), &["--measure", "peak"]), &["no run has a peak load", "--measure", "30 N"]);
}

#[test]
fn what_one_value_cannot_tell_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for seed in [1, 2] {
        Run::new(5.0, seed, 4.0 + seed as f64).write(folder.path(), &format!("{seed}.h5"));
    }
    let found = json_of(&strength(folder.path(), &["--json"]), 0);
    assert!(found["line"].is_null() && found["over_samples"]["slope"].is_null());
    assert_eq!(found["values"][0]["strength"]["mean"], 5.5);
    assert!(found["notes"][0].as_str().unwrap().contains("only one value of bonds.strength"));
    let output = strength(folder.path(), &[]);
    assert!(output.status.success() && !String::from_utf8_lossy(&output.stdout).contains("NaN"));
    assert!(!std::fs::read_to_string(folder.path().join("1-strength/strength.svg")).unwrap().contains("NaN"));
}

#[test]
fn wrong_runs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    refused(&strength(here, &[]), &["RUNS"]);
    std::fs::create_dir(here.join("empty")).unwrap();
    refused(&strength(here, &["empty"]), &["empty holds no manifest.json", "dem-run sweep"]);
    Run::new(5.0, 1, 5.0).write(here, "a.h5");
    Run { scene: json!({ "thickness": 0.25 }), ..Run::new(10.0, 1, 10.0) }.write(here, "b.h5");
    refused(&strength(here, &[]), &["several fields differ", "bonds.strength, thickness", "--against"]);
    Run { scene: json!({ "thickness": 0.25 }), ..Run::new(5.0, 1, 5.0) }.write(here, "c.h5");
    refused(&strength(here, &["--against", "bonds.strength"]), &["different scenes", "differ in thickness"]);
    refused(
        &strength(here, &["--against", "bonds.strenght"]),
        &["bonds.strenght", "nothing", "bonds.strength, thickness"],
    );
    refused(&strength(here, &["--wall", "left"]), &["--wall left", "top"]);
    let idle = tempfile::tempdir().unwrap();
    Run { driven: false, ..Run::new(5.0, 1, 5.0) }.write(idle.path(), "idle.h5");
    refused(&strength(idle.path(), &[]), &["idle.h5", "driven wall"]);
    let twice = tempfile::tempdir().unwrap();
    Run::new(5.0, 1, 5.0).write(twice.path(), "a.h5");
    refused(&strength(twice.path(), &["a.h5"]), &["a.h5 and a.h5", "same scene"]);
    assert!(!here.join("a-strength").exists() && !idle.path().join("idle-strength").exists());
}

#[test]
fn a_sweep_names_its_runs() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("sweep/runs");
    std::fs::create_dir_all(&runs).unwrap();
    let mut entries = vec![];
    for (k, cohesion) in [5.0, 10.0, 20.0].into_iter().enumerate() {
        let id = format!("{:04}", k + 1);
        let failed = cohesion == 20.0;
        Run::new(cohesion, 1, cohesion).write(&runs, &format!("{id}{}", if failed { ".failed.h5" } else { ".h5" }));
        let state = if failed { "failed" } else { "done" };
        let outcome =
            json!({ "digest": id, "state": state, "exit_code": 3, "wall_time": 1.0, "message": "no convergence" });
        std::fs::write(runs.join(format!("{id}.state.json")), outcome.to_string()).unwrap();
        // the states are those of the runs' own files, which are newer than the manifest
        let history = format!("runs/{id}.h5");
        entries.push(json!({ "id": id, "values": { "bonds.strength": cohesion }, "digest": id, "history": history, "state": "left" }));
    }
    let manifest = json!({ "format": 1, "program": "", "sweep": "s.json", "scene": "a.json", "fields": ["bonds.strength"], "runs": entries });
    std::fs::write(folder.path().join("sweep/manifest.json"), manifest.to_string()).unwrap();
    let found = json_of(&strength(folder.path(), &["sweep", "--json"]), 1);
    assert_eq!(found["runs"].as_array().unwrap().len(), 2);
    assert_eq!(found["left_out"][0], json!({ "run": "sweep/runs/0003.failed.h5", "why": "failed: no convergence" }));
    assert!(folder.path().join("sweep-strength/strength.csv").exists());
    // a truncated history does not take the results of the others with it
    let cut = std::fs::OpenOptions::new().write(true).open(runs.join("0002.h5")).unwrap();
    cut.set_len(cut.metadata().unwrap().len() / 2).unwrap();
    let found = json_of(&strength(folder.path(), &["sweep", "--json", "--force"]), 1);
    assert_eq!(found["runs"].as_array().unwrap().len(), 1);
    let why = found["left_out"][0]["why"].as_str().unwrap();
    assert!(why.contains("truncated") && why.contains("delete sweep/runs/0002.h5"), "{why}");
    std::fs::write(folder.path().join("sweep/manifest.json"), "{}").unwrap();
    let output = strength(folder.path(), &["sweep"]);
    assert_eq!(output.status.code(), Some(4), "{}", String::from_utf8_lossy(&output.stderr));
}
