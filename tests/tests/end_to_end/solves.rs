//! What a run says of its solves: method, residual, load error and cost, in its history and its
//! summary.

use crate::common::{Folder, SMALL, config, number, observable, run};
use dem_run::history::{History, SolverRoute};
use serde_json::{Value, json};

fn values(history: &History, name: &str) -> Vec<f64> {
    observable(history, name).value
}

fn count(values: &[f64], holds: impl Fn(f64) -> bool) -> u64 {
    values.iter().filter(|value| holds(**value)).count() as u64
}

/// The summary counts what the history records, and prints its averages over the solved steps.
#[test]
fn a_summary_counts_the_solves_of_its_history() {
    let here = Folder::new();
    let scene = config("compression.json");
    let args = |name| [&["run", &scene, "-o", name, "--quiet"], &SMALL[..]].concat();
    let summary = here.dem_run(&[&args("a.h5")[..], &["--json"]].concat()).json();
    let text = here.dem_run(&args("b.h5")).succeeds().stdout;

    let history = here.history("a.h5");
    let [routes, residuals, errors] =
        ["solver_route", "solver_residual", "solver_load_error"].map(|name| values(&history, name));
    let solved = count(&routes, |route| route != SolverRoute::Extrapolation.number());
    let steps = routes.len() as u64;
    assert!(0 < solved && solved < steps, "{solved} of {steps}");
    assert_eq!(summary["solved_steps"], solved);
    let [tolerance, load_tolerance] =
        ["tolerance", "load_tolerance"].map(|name| summary[name].as_f64().expect("a tolerance"));
    assert_eq!(summary["missed_tolerance"], count(&residuals, |residual| residual > tolerance));
    assert_eq!(summary["missed_load_tolerance"], count(&errors, |error| error > load_tolerance));
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert_eq!(summary["worst_load_error"].as_f64(), Some(worst));

    // an extrapolated step takes no iteration
    for (route, iterations) in routes.iter().zip(values(&history, "solver_iterations")) {
        assert!(*route != SolverRoute::Extrapolation.number() || iterations == 0.0);
    }
    let newton = summary["work"]["newton_iterations"].as_f64().expect("a count") / solved as f64;
    for part in [
        format!("\nsolver           {newton:.2} Newton iterations, "),
        format!(" a solved step ({solved} of {steps})\n"),
        format!("\nload error       worst {worst:.2e} (tolerance 1e-5), "),
    ] {
        assert!(text.contains(&part), "{part:?} is not in {text}");
    }
}

/// Gauss–Seidel reports no load error, and its steps have a false acceleration all the same.
#[test]
fn gauss_seidel_reports_no_load_error() {
    let here = Folder::new();
    let sets = ["--set", "solver.kind={\"gauss_seidel\":{}}", "--set", "time.end=0.002"];
    let summary = here.run_config("column.json", &[&["-o", "a.h5"], &sets[..]].concat());
    assert_eq!((&summary["worst_load_error"], &summary["load_tolerance"]), (&Value::Null, &Value::Null));
    assert_eq!((&summary["solved_steps"], &summary["missed_load_tolerance"]), (&summary["steps"], &0.into()));
    let history = here.history("a.h5");
    assert!(values(&history, "solver_load_error").iter().all(|error| error.is_nan()));
    assert!(values(&history, "solver_route").iter().all(|route| *route == SolverRoute::Sweeps.number()));
    assert!(values(&history, "false_acceleration").iter().any(|error| *error > 0.0));
    // what is no number there is sound, and the report leaves it out
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    let report = here.dem_post(&["report", "a.h5", "--json"]).json();
    assert_eq!(report["accuracy"]["load_error"], Value::Null);
    assert_eq!(report["accuracy"]["routes"], serde_json::json!([0, 0, 0, summary["steps"]]));
}

/// Bonds without rolling strength carry no moment, so none may share the load in the reactions from
/// which a path measures: the first bond breaks at the load that Newton finds.
#[test]
fn grains_joined_by_pins_break_at_one_load_with_every_solver() {
    let here = Folder::new();
    let scene = config("compression.json");
    let pins = ["--set", "bonds.rolling=0", "--set", "time.step=1e-3", "--set", "stop={\"broken_fraction\": 0.01}"];
    for seed in ["seed=2", "seed=4"] {
        let first_break = |kind: &str| {
            let own = ["run", &scene, "-o", "pins.h5", "--force", "-q", "--json", "--set", seed, "--set", kind];
            let summary = here.dem_run(&[&own[..], &SMALL, &pins].concat()).json();
            summary["failure"]["first_break"].as_f64().expect("a load")
        };
        let [path, stages] = ["solver.kind={\"interior\": {}}", "solver.kind={\"auto\": {}}"].map(first_break);
        assert_eq!(path, stages, "{seed}");
    }
}

/// Two bonded grains turn slowly, and a third one leaves them: their bond bears 3.93 N of 37 kN.
/// Beside such a strength round-off ends the central path, and no point beyond it tells at which
/// limit a bond is.
#[test]
fn a_pair_that_a_grain_leaves_does_not_break() {
    let here = Folder::new();
    let scene = serde_json::json!({
        "dimension": 2,
        "sample": { "grains": [
            { "center": [0, 0], "radius": 0.5, "velocity": [0, 0], "spin": [0.1] },
            { "center": [-1, 0], "radius": 0.5, "velocity": [0, -0.1], "spin": [0.1] },
            { "center": [1, 0], "radius": 0.5, "velocity": [0.2, 0.7] }
        ] },
        "materials": { "density": 1000, "friction": { "grain_grain": 0.2, "grain_wall": 0.3 } },
        "bonds": { "strength": 37000, "gap_tolerance": 1e-3, "shear": 0.5, "rolling": 0.3, "list": "pair.csv" },
        "time": { "step": 1e-3, "end": 3e-3 },
        "output": { "every_steps": 1 }
    });
    here.write("pair.csv", "i,j\n0,1\n");
    here.write("pair.json", scene.to_string());
    for kind in ["auto", "newton", "interior"] {
        let summary = run(&here, "pair.json", &["--set", &format!("solver.kind={{\"{kind}\": {{}}}}")]);
        assert_eq!(summary["broken"], serde_json::json!([0, 0, 0, 0]), "{kind}");
    }
}

/// A beam breaks under the impact of the first step, and in the second one hardly any velocity has
/// to change. Reactions that balance each other have a round-off above such velocities, which is
/// none of the motion: the step counts as one that missed its tolerances, and the run goes on.
#[test]
fn a_step_that_asks_for_hardly_any_velocity_is_accepted() {
    let here = Folder::new();
    let diameter = 4e-3;
    let (rows, columns) = (12.0, 40.0);
    let top = diameter * (1.0 + (rows - 1.0) * f64::sqrt(0.75));
    let wall = |x: f64, y: f64| serde_json::json!({ "circle": { "center": [x, y], "radius": 0.01 } });
    let scene = serde_json::json!({
        "dimension": 2,
        "thickness": 1,
        "sample": { "lattice": { "hexagonal": { "diameter": diameter, "rows": rows as u64, "columns": columns as u64 } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 100, "gap_tolerance": 1e-6 },
        "walls": {
            "left": { "shape": wall(3.0 * diameter, -0.01) },
            "right": { "shape": wall((columns - 2.5) * diameter, -0.01) },
            "loader": {
                "shape": wall(0.5 * columns * diameter, top + 0.01),
                "direction": [0, -1],
                "velocity": { "constant": 0.01 }
            }
        },
        "rupture": "end_of_step",
        "time": { "step": 1e-4, "end": 3e-4 },
        "output": { "every_steps": 1 }
    });
    here.write("impact.json", scene.to_string());
    let summary = run(&here, "impact.json", &[]);
    assert_eq!(summary["steps"], 3);
    assert!(number(&summary["worst_residual"]) <= 1e-8);
    assert!(summary["missed_load_tolerance"].as_u64() >= Some(1), "{}", summary["missed_load_tolerance"]);
}

/// Two gripped plates pull 60 bonded balls apart. Fragments then move as wholes, and no contact has
/// to change its velocity: what round-off leaves is nothing beside the motion of the plates.
#[test]
fn a_specimen_that_has_parted_moves_on() {
    let here = Folder::new();
    let plane = |up: i32| json!({ "plane": { "normal": [0, 0, up], "place": "seated" } });
    let scene = json!({
        "dimension": 3, "seed": 1,
        "sample": { "random": { "count": 60, "diameter": { "uniform": { "min": 2e-3, "max": 3e-3 } },
            "width": 0.0095, "depth": 0.0095, "preparation": { "compaction": { "solid_fraction": 0.45 } } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 5, "gap_tolerance": 0.01, "shear": 0.4, "rolling": 0.15, "twist": 0.1 },
        "walls": {
            "bottom": { "shape": plane(1), "grip": 2e-4 },
            "top": { "shape": plane(-1), "grip": 2e-4, "velocity": { "constant": -0.01 } } },
        "time": { "step": 1e-4, "end": 5e-3 }, "output": { "every_steps": 1 }
    });
    here.write("scene.json", scene.to_string());
    let summary = run(&here, "scene.json", &[]);
    assert_eq!((&summary["ending"], &summary["steps"]), (&json!("time"), &json!(50)), "{summary}");
    assert!(number(&summary["worst_residual"]) <= 1e-8);
}

/// Bonded disks between rough walls, pressed and then released: friction keeps reactions in them,
/// beside which nothing acts. Load and velocity errors were relative to that nothing.
#[test]
fn a_sample_that_is_unloaded_rests() {
    let here = Folder::new();
    let plane = |x: i32, y: i32| json!({ "shape": { "plane": { "normal": [x, y], "place": "seated" } } });
    for (name, last) in [("zero", 0.0), ("lifted", -20.0)] {
        let mut top = plane(0, -1);
        top["mass"] = json!("sample");
        top["force"] = json!({ "table": [[0, 0], [0.003, 20], [0.005, 0], [0.007, last]] });
        let scene = json!({
            "dimension": 2, "thickness": 1,
            "sample": { "lattice": { "square": { "columns": 4, "rows": 1, "diameter": 0.003 } } },
            "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.3 } },
            "bonds": { "strength": 100, "gap_tolerance": 0.01 },
            "walls": { "bottom": plane(0, 1), "left": plane(1, 0), "right": plane(-1, 0), "top": top },
            "time": { "step": 1e-4, "end": 0.01 }, "output": { "every_steps": 1 }
        });
        here.write(&format!("{name}.json"), scene.to_string());
        let summary = run(&here, &format!("{name}.json"), &[]);
        assert_eq!((&summary["ending"], &summary["steps"]), (&json!("time"), &json!(100)), "{summary}");
        assert!(
            number(&summary["worst_residual"]) <= 1e-8 && number(&summary["worst_load_error"]) <= 1e-5,
            "{summary}"
        );
        assert_eq!((&summary["missed_tolerance"], &summary["rejected"]), (&json!(0), &json!(0)), "{summary}");
    }
}
