//! `dem-run accuracy` on a small sample: its figures, its files, and what it refuses.

use crate::common::{Folder, config, number, program};
use serde_json::Value;
use std::process::{Command, Stdio};

/// The compression scene with 40 grains, which fails within a thousand steps.
const TINY: [&str; 8] = [
    "--set",
    "sample.random.count=40",
    "--set",
    "sample.random.width=0.011",
    "--set",
    "sample.random.preparation.compaction.solid_fraction=0.7",
    "--set",
    "walls.top.force_rate=200",
];

fn measure(here: &Folder, args: &[&str]) -> Value {
    let scene = config("compression.json");
    here.dem_run(&[&["accuracy", &scene, "--json", "--quiet"], &TINY[..], args].concat()).json()
}

/// Everything but the clock.
fn without_clock(value: &Value) -> Value {
    match value {
        Value::Object(map) => {
            // the shares of the profile follow from CPU times
            let timeless = map.iter().filter(|(name, _)| !["cpu_time", "shares"].contains(&name.as_str()));
            timeless.map(|(name, value)| (name.clone(), without_clock(value))).collect()
        }
        Value::Array(list) => list.iter().map(without_clock).collect(),
        other => other.clone(),
    }
}

/// A CSV file as its head and its rows.
fn table(here: &Folder, name: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let text = String::from_utf8(here.read(name)).expect("UTF-8");
    let cells = |line: &str| line.split(',').map(String::from).collect::<Vec<String>>();
    let mut lines = text.lines().map(cells);
    (lines.next().expect("a head"), lines.collect())
}

#[test]
fn a_scene_s_accuracy_is_measured_twice_alike() {
    let here = Folder::new();
    let args = ["--solvers", "gauss-seidel,newton", "--tolerances", "1e-5,1e-3", "--steps", "1", "--orders", "1"];
    let report = measure(&here, &args);

    // coarse before fine, whatever order was asked for
    let runs = report["runs"].as_array().expect("runs");
    let ways: Vec<(&str, f64)> =
        runs.iter().map(|run| (run["solver"].as_str().expect("name"), number(&run["tolerance"]))).collect();
    assert_eq!(ways, [("gauss-seidel", 1e-3), ("gauss-seidel", 1e-5), ("newton", 1e-3), ("newton", 1e-5)]);

    // a tighter tolerance costs more sweeps, and has the smaller residual, false acceleration and
    // false strain
    let of = |k: usize, name: &str| number(&runs[k][name]);
    for name in ["worst_residual", "median_residual", "false_acceleration", "false_strain"] {
        assert!(of(1, name) < 0.3 * of(0, name), "{name}: {} and {}", of(0, name), of(1, name));
    }
    assert!(of(1, "iterations") > of(0, "iterations"));
    assert!(of(1, "worst_residual") <= 1e-5 || of(1, "missed_tolerance") > 0.0);
    // the sample is rigid: Newton strains it by next to nothing
    assert!(of(3, "false_strain") < 1e-3 * of(1, "false_strain"));

    // the limit load of the sample is that of `dem-run limit`, and no run breaks a bond above it
    let scene = config("compression.json");
    let mut limit = here.dem_run(&[&["limit", &scene, "--json", "--quiet"][..], &TINY].concat()).json();
    limit.as_object_mut().expect("an object").remove("scene");
    assert_eq!(report["limit"], limit);
    let load = number(&limit["loads"][0]["limit"]);
    for run in runs {
        // a step of 1e-4 s adds 0.02 N
        assert!(number(&run["first_break"]["load"]) <= load + 0.02, "{load} N, {run}");
    }

    let reference = report["reference"].as_u64().expect("a reference") as usize;
    assert_eq!(reference, 3, "the lowest tolerance and the lowest median residual");
    assert_eq!(of(reference, "jaccard"), 1.0);
    assert_eq!(number(&runs[reference]["collapse_deviation"][0]), 0.0);
    for run in runs {
        assert!((0.0..=1.0).contains(&number(&run["jaccard"])), "{run}");
        assert!(number(&run["first_break"]["load"]) > 0.0 && !run["broken"].as_array().expect("bonds").is_empty());
    }

    // every spread has the run of the table and one more; a least value is not above the greatest
    let spreads = report["indeterminacy"]["spreads"].as_array().expect("spreads");
    assert_eq!(spreads.len(), 4);
    for spread in spreads {
        assert_eq!(number(&spread["runs"]) + number(&spread["failed"]), 2.0);
        assert!(number(&spread["first_break"]["min"]) <= number(&spread["first_break"]["max"]));
    }

    // CSV and JSON say the same
    let (head, rows) = table(&here, "compression-accuracy/work-precision.csv");
    assert_eq!(rows.len(), runs.len());
    let column = |name: &str| head.iter().position(|h| h == name).unwrap_or_else(|| panic!("no column {name}"));
    for (run, row) in runs.iter().zip(&rows) {
        assert_eq!(row.len(), head.len());
        let value = |name: &str| row[column(name)].parse::<f64>().expect("a number");
        for (name, json) in [
            ("tolerance", &run["tolerance"]),
            ("iterations", &run["iterations"]),
            ("worst_residual", &run["worst_residual"]),
            ("cpu_s", &run["cpu_time"]),
            ("jaccard", &run["jaccard"]),
            ("first_break_N", &run["first_break"]["load"]),
            ("collapse_1e4_N", &run["failure"]["collapse"][0]),
        ] {
            assert_eq!(value(name), number(json), "{name}");
        }
        assert_eq!(value("bonds_broken") as usize, run["broken"].as_array().expect("bonds").len());
    }
    let (_, rows) = table(&here, "compression-accuracy/indeterminacy.csv");
    assert_eq!(rows.len(), report["indeterminacy"]["runs"].as_array().expect("runs").len());
    let problems = report["profile"]["step"].as_array().expect("problems").len();
    assert!((10..=50).contains(&problems), "{problems} problems");
    assert_eq!(table(&here, "compression-accuracy/profile.csv").1.len(), 2 * problems);
    let names = Folder::names(&here);
    assert_eq!(names, ["compression-accuracy"]);
    for picture in ["work-precision", "profile"] {
        assert!(here.read(&format!("compression-accuracy/{picture}.svg")).starts_with(b"<svg"));
        assert!(here.read(&format!("compression-accuracy/{picture}.png")).starts_with(b"\x89PNG"));
    }

    // results are not overwritten unasked; asked, they come out the same for any number of threads
    let scene = config("compression.json");
    here.dem_run(&["accuracy", &scene]).fails(4, &["compression-accuracy", "--force", "-o"]);
    let again = measure(&here, &[&args[..], &["--force", "--threads", "1"]].concat());
    assert_eq!(without_clock(&again), without_clock(&report));
}

/// A cylinder of 60 spheres: Newton keeps it rigid, and finds one first break whatever the order of
/// the contacts and the start.
#[test]
fn spheres_are_measured_as_disks_are() {
    let here = Folder::new();
    let scene = config("cylinder-compression.json");
    let small = [
        "--set",
        "sample.random.count=60",
        "--set",
        "sample.random.width=0.012",
        "--set",
        "sample.random.preparation.compaction.solid_fraction=0.5",
        "--set",
        "walls.top.force_rate=20000",
        "--set",
        "time.step=1e-4",
        "--set",
        "time.end=0.1",
        "--set",
        "output.every_steps=10",
    ];
    let args = ["--solvers", "gauss-seidel,newton", "--tolerances", "1e-8", "--steps", "1", "--orders", "1"];
    let command = [&["accuracy", &scene, "--json", "--quiet"], &small[..], &args].concat();
    let report = here.dem_run(&command).json();

    let runs = report["runs"].as_array().expect("runs");
    let [swept, newton] = runs.as_slice() else { panic!("{} runs", runs.len()) };
    for run in runs {
        assert_eq!(run["first_break"]["place"].as_array().expect("a place").len(), 3);
        assert!(number(&run["failure"]["collapse"][0]) >= number(&run["first_break"]["load"]), "{run}");
    }
    assert!(number(&newton["false_strain"]) <= 1e-7, "{newton}");
    assert!(number(&newton["false_strain"]) < 1e-2 * number(&swept["false_strain"]), "{swept}");

    let spreads = report["indeterminacy"]["spreads"].as_array().expect("spreads");
    // reactions that a run starts from are a history that it keeps
    let of_newton = |spread: &&Value| spread["solver"] == "newton" && spread["varied"] == "order";
    for spread in spreads.iter().filter(of_newton) {
        assert_eq!(spread["first_break"]["min"], spread["first_break"]["max"], "{spread}");
        assert_eq!(number(&spread["first_bonds"]), 1.0, "{spread}");
    }
    for solver in report["profile"]["solvers"].as_array().expect("solvers") {
        let costs = solver["costs"].as_array().expect("costs");
        assert!(!costs.is_empty() && costs.iter().all(|cost| cost["solved"] == true), "{}", solver["solver"]);
    }
}

#[test]
fn a_run_that_does_not_converge_is_a_row() {
    let here = Folder::new();
    let args = ["--set", "solver.kind.gauss_seidel.max_sweeps=100", "--set", "solver.max_step_halvings=0"];
    let more =
        ["--set", "solver.accept=1e-4", "--solvers", "gauss-seidel", "--tolerances", "1e-2,1e-6", "--steps", "1"];
    let report = measure(&here, &[&args[..], &more, &["--orders", "0"]].concat());
    assert_eq!(report["runs"][1]["ended"], "no_convergence");
    assert!(report["runs"][1]["error"].as_str().is_some_and(|why| why.contains("no convergence")), "{report}");
    assert_eq!(report["reference"], 0);
    assert!(report["indeterminacy"].is_null());
}

#[test]
fn a_scene_without_bonds_has_no_failure() {
    let here = Folder::new();
    let scene = config("column.json");
    let outcome = here.dem_run(&["accuracy", &scene, "--tolerances", "1e-4", "--steps", "1", "--until", "0.01"]);
    let told = outcome.succeeds().stdout;
    assert!(told.contains("Work and precision") && told.contains("Performance profile"), "{told}");
    assert!(!told.contains("Jaccard") && !told.contains("1st break"), "{told}");
}

#[test]
fn wrong_options_are_told() {
    let here = Folder::new();
    let scene = config("column.json");
    here.dem_run(&["accuracy", &scene, "--solvers", "newtn"]).fails(2, &["newtn", "gauss-seidel, newton, interior"]);
    here.dem_run(&["accuracy", &scene, "--tolerances", "0"]).fails(2, &["--tolerances", "above zero"]);
    here.dem_run(&["accuracy", &scene, "--steps", "1,x"]).fails(2, &["--steps", "above zero"]);
    here.write("taken", "");
    here.dem_run(&["accuracy", &scene, "-o", "taken"]).fails(4, &["taken", "-o DIR"]);
    assert_eq!(here.names(), ["taken"]);
}

#[test]
fn an_interruption_leaves_what_was_measured() {
    let here = Folder::new();
    let mut command = Command::new(program("dem-run"));
    // the second run would take ten million steps
    let args = ["--tolerances", "1e-2", "--steps", "1e5,1", "--until", "1e5", "--solvers", "gauss-seidel"];
    command.arg("accuracy").arg(config("incline.json")).args(args).args(["--set", "time.step=0.01"]);
    command.args(["--progress", "plain"]).current_dir(here.path(""));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("start");
    let stderr = child.stderr.take().expect("stderr");
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(stderr)).map(|line| line.expect("UTF-8"));
    assert!(lines.any(|line| line.contains("run 2 of 2")), "the command ended before its second run");
    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status();
    assert!(kill.expect("sh").success());
    let told: Vec<String> = lines.collect();
    assert_eq!(child.wait().expect("status").code(), Some(130), "{told:?}");
    assert!(told.iter().any(|line| line.contains("interrupted")), "{told:?}");
    let report: Value = serde_json::from_slice(&here.read("incline-accuracy/accuracy.json")).expect("JSON");
    assert_eq!((&report["interrupted"], report["runs"].as_array().map(Vec::len)), (&true.into(), Some(1)));
}

#[test]
fn loading_to_the_next_event_is_compared_with_solvers_that_know_it() {
    let here = Folder::new();
    let scene = config("compression.json");
    let sets = [&TINY[..], &["--set", "rupture=next_event", "--orders", "0", "--tolerances", "1e-6", "--steps", "1"]];
    let accuracy =
        |more: &[&str]| here.dem_run(&[&["accuracy", &scene, "--json", "--quiet"], &sets.concat()[..], more].concat());
    accuracy(&[]).fails(2, &["Gauss–Seidel", "next_event", "--solvers auto,newton"]);
    let report = accuracy(&["--solvers", "auto,newton"]).json();
    let runs = report["runs"].as_array().expect("runs");
    assert!(runs.iter().all(|run| number(&run["steps"]) > 0.0 && number(&run["jaccard"]) == 1.0), "{runs:?}");
}
