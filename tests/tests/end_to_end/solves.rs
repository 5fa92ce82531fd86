//! What a run says of its solves: method, residual, load error and cost, in its history and its
//! summary.

use crate::common::{Folder, SMALL, config, observable};
use dem_run::history::{History, SolverRoute};
use serde_json::Value;

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
