//! The load that a run reports: of the right wall, of the right moment, and in the terms of its
//! test.

use crate::common::{Folder, config, number, run, series, sets, wall};
use dem_run::history::History;
use serde_json::{Value, json};

/// A biaxial test: a ramp on the lid, 8 N on either side. `sides` are the names of the side walls.
fn biaxial(here: &Folder, sides: [&str; 2]) {
    let plane = |normal: [i32; 2]| json!({ "plane": { "normal": normal, "place": "seated" } });
    let side = |sign: i32| json!({ "shape": plane([sign, 0]), "mass": "sample", "force": { "constant": 8 } });
    let ramp = json!({ "ramp": { "rate": 300, "start": 0.02 } });
    let walls = json!({
        "bottom": { "shape": plane([0, 1]) },
        "top": { "shape": plane([0, -1]), "mass": "sample", "force": ramp },
        sides[0]: side(1), sides[1]: side(-1),
    });
    let scene = json!({
        "dimension": 2, "seed": 3, "walls": walls,
        "sample": { "random": { "count": 60, "diameter": { "uniform": { "min": 1e-3, "max": 2e-3 } }, "width": 0.009,
            "preparation": { "compaction": { "solid_fraction": 0.76 } } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
        "time": { "step": 1e-4, "end": 0.16 }, "output": { "every_steps": 20 },
        "stop": { "wall_travel": { "wall": "top", "fraction_of_height": 0.001, "after": "first_break" } }
    });
    here.write("biaxial.json", scene.to_string());
}

fn text(here: &Folder, scene: &str, args: &[&str]) -> String {
    here.dem_run(&[&["run", scene, "-o", "a.h5", "--force", "--quiet"], args].concat()).succeeds().stdout
}

/// A load as it is printed.
fn newtons(load: f64) -> String {
    format!("{} N", dem_run::output::number(load))
}

/// The loads of a wall that a force drives, read off its history.
fn loads_of(history: &History, name: &str, axis: usize) -> [f64; 4] {
    let load = series(history, "applied_force", &[wall(history, name)]);
    let (broken, strain) = (series(history, "bonds_broken", &[]), series(history, "strain", &[axis, axis]));
    let bonds = history.bonds().expect("bonds").len() as f64;
    let first = |at: &dyn Fn(usize) -> bool| (0..load.len()).find(|k| at(*k)).expect("a step");
    [
        load[first(&|k| broken[k] > 0.0)],
        load[first(&|k| strain[k].abs() > 1e-4) - 1],
        load[first(&|k| strain[k].abs() > 1e-3) - 1],
        load[first(&|k| broken[k] >= 0.05 * bonds)],
    ]
}

fn loads_in(failure: &Value) -> [f64; 4] {
    let collapse = &failure["collapse"];
    [&failure["first_break"], &collapse[0], &collapse[1], &failure["broken_share"]].map(number)
}

#[test]
fn a_biaxial_test_reports_the_load_of_its_lid_whatever_the_walls_are_called() {
    let here = Folder::new();
    let mut loads: Vec<[f64; 4]> = vec![];
    for sides in [["left", "right"], ["zleft", "zright"], ["a", "b"]] {
        biaxial(&here, sides);
        let summary = run(&here, "biaxial.json", &[]);
        assert_eq!(summary["load_wall"], "top");
        let found = loads_in(&summary["failure"]);
        assert_eq!(found, loads_of(&here.history("a.h5"), "top", 1));
        // before, the first driven wall by name: 8 N four times for left and right, and for a and b
        assert!(found.iter().all(|load| *load > 16.0), "{found:?} with {sides:?}");
        loads.push(found);
        assert_eq!((&summary["peak_load"], &summary["splitting"]), (&Value::Null, &Value::Null));
        let post = here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet", "--force"]).json();
        assert_eq!((&post["wall"], number(&post["first_break"])), (&json!("top"), found[0]));
        assert_eq!(number(&post["collapse_load"]), found[1]);
    }
    let same = |other: &[f64; 4]| other.iter().zip(loads[0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-9);
    assert!(loads.iter().all(same), "{loads:?}");
    let told = text(&here, "biaxial.json", &[]);
    let [first, collapse, _, five] = loads[2].map(newtons);
    for line in [
        format!("\nfirst break      {first} (wall top)\n"),
        format!("\ncollapse load    {collapse} (strain 1e-4; wall top)\n"),
        format!("\n5 % broken       {five} (wall top)\n"),
    ] {
        assert!(told.contains(&line), "{line:?} is not in\n{told}");
    }
}

#[test]
fn where_the_load_wall_is_unknown_every_driven_wall_is_listed_and_what_needs_one_refuses() {
    let here = Folder::new();
    biaxial(&here, ["left", "right"]);
    let open = ["--set", "stop=null"];
    let summary = run(&here, "biaxial.json", &open);
    assert_eq!(summary["load_wall"], Value::Null);
    assert_eq!(summary["failure"]["first_break"], Value::Null);
    let history = here.history("a.h5");
    for (k, (wall, axis)) in [("left", 0), ("right", 0), ("top", 1)].into_iter().enumerate() {
        let listed = &summary["driven_walls"][k];
        assert_eq!(listed["wall"], wall);
        assert_eq!(loads_in(&listed["failure"]), loads_of(&history, wall, axis));
    }
    let told = text(&here, "biaxial.json", &open);
    assert!(!told.contains("\nfirst break") && !told.contains("\ncollapse load"), "{told}");
    let first = newtons(loads_of(&history, "top", 1)[0]);
    let line = format!("\nwall top         first break {first}; collapse ");
    for part in ["\nload wall        none: name one of left, right, top", &line] {
        assert!(told.contains(part), "{part:?} is not in\n{told}");
    }

    let names = "left, right, top";
    let refused = [&["accuracy", "biaxial.json"], &open[..]].concat();
    here.dem_run(&refused).fails(2, &["several walls are driven", names, "--set load_wall=NAME"]);
    here.write("sweep.json", r#"{ "scene": "biaxial.json", "set": { "stop": null }, "vary": [{ "seed": [3, 4] }] }"#);
    here.dem_run(&["sweep", "sweep.json", "--check"]).fails(2, &["several driven walls", names, "\"load_wall\""]);
    for command in ["stress-strain", "report", "strength"] {
        here.dem_post(&[command, "a.h5"]).fails(2, &["a.h5: several walls are driven", "--wall", names]);
        let asked = [command, "a.h5", "--wall", "top", "--quiet"];
        let told = here.dem_post(&asked).succeeds().stdout;
        assert!(
            command != "stress-strain" || told.contains(&format!("first break                    {first}\n")),
            "{told}"
        );
        here.dem_post(&[command, "a.h5", "--wall", "bottom"]).fails(2, &["--wall bottom", names]);
    }
    let page = String::from_utf8(here.read("a-post/report.html")).expect("UTF-8");
    assert!(page.contains("<section id=\"load\">") && page.contains(&first), "the page has no load");

    // the scene may say so, and what reads its history follows it
    let named = [&open[..], &["--set", "load_wall=left"]].concat();
    assert_eq!(loads_in(&run(&here, "biaxial.json", &named)["failure"]), [8.0; 4]);
    let post = here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet", "--force"]).json();
    assert_eq!((&post["wall"], number(&post["first_break"])), (&json!("left"), 8.0));
    here.dem_run(&["check", "biaxial.json", "--set", "load_wall=tpo"])
        .fails(2, &["load_wall", "\"tpo\"", "nearest  top"]);
    here.dem_run(&["check", "biaxial.json", "--set", "load_wall=bottom"]).fails(2, &["\"bottom\", which is fixed"]);
}

#[test]
fn accuracy_and_sweeps_take_the_load_wall() {
    let here = Folder::new();
    biaxial(&here, ["left", "right"]);
    let args = ["--solvers", "auto", "--tolerances", "1e-8", "--steps", "1", "--orders", "0", "--json", "--quiet"];
    // the scene's own end comes later
    let far = ["--set", "stop.wall_travel.fraction_of_height=0.02"];
    let report = here.dem_run(&[&["accuracy", "biaxial.json"], &far[..], &args[..]].concat()).json();
    assert_eq!((&report["load_wall"], &report["runs"][0]["ended"]), (&json!("top"), &json!("collapse")));
    let run = &report["runs"][0];
    assert_eq!(number(&run["first_break"]["load"]), number(&run["failure"]["first_break"]));
    // before, 8 N each, and the run ended by the strain along that wall
    let expected = loads_in(&self::run(&here, "biaxial.json", &[])["failure"]);
    assert_eq!(loads_in(&run["failure"]), expected);

    here.write("sweep.json", r#"{ "scene": "biaxial.json", "vary": [{ "bonds.strength": [10] }] }"#);
    here.dem_run(&["sweep", "sweep.json", "-o", "runs", "--quiet"]).succeeds();
    let table = String::from_utf8(here.read("runs/runs.csv")).expect("UTF-8");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let cell = |name: &str| rows[1][rows[0].iter().position(|head| *head == name).expect("a column")];
    assert_eq!(cell("load_wall"), "top");
    assert_eq!(cell("first_break").parse::<f64>().expect("a number"), expected[0], "{table}");
}

/// Two grains; a wall pushes one aside at a velocity that grows, until the elastic bond breaks.
const PUSHED: &str = r#"{ "dimension": 2, "thickness": 0.01,
    "sample": { "grains": [{ "center": [0, 0], "radius": 0.002 }, { "center": [0.004, 0], "radius": 0.002 }] },
    "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
    "bonds": { "strength": 10, "gap_tolerance": 0.001,
        "stiffness": { "springs": { "normal": 1e6, "tangential": 1e6, "rolling": 10 } } },
    "grains": { "fixed": [0] },
    "walls": { "push": { "shape": { "plane": { "normal": [0, 1], "place": { "at": [0, -0.002] } } },
        "velocity": { "ramp": { "rate": 0.001 } } } },
    "time": { "step": 1e-4, "end": 0.2 }, "output": { "every_steps": 1 }, "stop": { "broken_fraction": 1 } }"#;

#[test]
fn the_load_of_a_wall_that_moves_is_the_force_that_broke_the_bond() {
    let here = Folder::new();
    here.write("pushed.json", PUSHED);
    let summary = run(&here, "pushed.json", &[]);
    let history = here.history("a.h5");
    let (acted, left) = (series(&history, "wall_force_at_limit", &[0, 1]), series(&history, "wall_force", &[0, 1]));
    let last = acted.len() - 1;
    assert_eq!(acted[..last], left[..last], "nothing broke before");
    let load = number(&summary["failure"]["first_break"]);
    assert_eq!(load, -acted[last]);
    // before, what was left after the break: 1.406e-5 N
    assert!((load - 3.190).abs() < 1e-3, "{load} N");
    assert!(-left[last] < 1e-3 * load, "{} N after the break", -left[last]);
    assert_eq!(number(&summary["failure"]["broken_share"]), load);
    let elongations = series(&history, "bond_elongation", &[]);
    assert_eq!(number(&summary["bond_elongation"]), elongations.into_iter().fold(0.0, f64::max));
    assert_eq!(number(&summary["peak_load"]), load);
    let way = series(&history, "wall_position", &[0, 1])[last] - history.wall_state(0).expect("walls").position[1];
    assert_eq!(number(&summary["peak_displacement"]), way);
    let post = here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet"]).json();
    assert_eq!(number(&post["first_break"]), load);
    let told = text(&here, "pushed.json", &[]);
    assert!(told.contains("\nfirst break      3.19 N (wall push)\n"), "{told}");
    assert!(told.contains("at the end of the run (wall push)\n"), "{told}");
}

/// An elastic beam of three rows on two supports; a round loader comes down at a constant velocity.
const BEAM: &str = r#"{ "dimension": 2, "thickness": 1,
    "sample": { "lattice": { "hexagonal": { "diameter": 4e-3, "rows": 3, "columns": 20 } } },
    "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
    "bonds": { "strength": 100, "gap_tolerance": 1e-3,
        "stiffness": { "young": { "modulus": 1e8, "poisson_ratio": 0.2 } } },
    "walls": {
        "left": { "shape": { "circle": { "center": [0.006, -0.01], "radius": 0.01 } } },
        "right": { "shape": { "circle": { "center": [0.074, -0.01], "radius": 0.01 } } },
        "loader": { "shape": { "circle": { "center": [0.04, 0.03], "radius": 0.01, "seated": [0, -1] } },
            "direction": [0, -1], "velocity": { "constant": 0.01 } } },
    "time": { "step": 1e-4, "end": 0.05 }, "output": { "every_steps": 5 } }"#;

#[test]
fn bending_reports_the_peak_and_its_deflection_and_no_collapse_of_zero() {
    let here = Folder::new();
    here.write("beam.json", BEAM);
    let summary = run(&here, "beam.json", &[]);
    let history = here.history("a.h5");
    let loader = wall(&history, "loader");
    let load: Vec<f64> = series(&history, "wall_force_at_limit", &[loader, 1]);
    let top = (0..load.len()).rev().max_by(|a, b| load[*a].abs().total_cmp(&load[*b].abs())).expect("steps");
    assert_eq!(number(&summary["peak_load"]), load[top]);
    let start = history.wall_state(0).expect("walls").position[2 * loader + 1];
    assert_eq!(number(&summary["peak_displacement"]), start - series(&history, "wall_position", &[loader, 1])[top]);
    let told = text(&here, "beam.json", &[]);
    assert!(told.contains("\npeak load        ") && told.contains(" (wall loader)\n"), "{told}");
    assert!(!told.contains("collapse load    0 N") && !told.contains("collapse load    -0 N"), "{told}");
    assert!(summary["failure"]["collapse"][0].is_null(), "{summary}");

    let post = here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet"]).json();
    for name in ["area", "collapse_load", "collapse_over_cohesion"] {
        assert!(post[name].is_null(), "{name}: {}", post[name]);
    }
    let told = here.dem_post(&["stress-strain", "a.h5", "--quiet"]).succeeds().stdout;
    assert!(!told.contains("section") && told.contains(" N at a displacement of "), "{told}");
    let table = String::from_utf8(here.read("a-post/stress-strain.csv")).expect("UTF-8");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows[0][5], rows[0][6]), ("wall_strain", "wall_stress_Pa"));
    assert!(rows[1..].iter().all(|row| row[5].is_empty() && row[6].is_empty()), "a round loader has no section");
}

#[test]
fn a_disk_between_plates_has_its_splitting_strength() {
    let here = Folder::new();
    let args = sets(&[
        "sample.random.count=150",
        "sample.random.width=0.02",
        "sample.random.preparation.compaction.solid_fraction=0.78",
        "sample.random.cut.circle=0.018",
        "thickness=0.5",
        "stop.wall_travel.fraction_of_height=0.002",
    ]);
    let scene = config("brazilian-2d.json");
    let summary = run(&here, &scene, &args);
    let splitting = &summary["splitting"];
    assert_eq!((number(&splitting["diameter"]), number(&splitting["length"])), (0.018, 0.5));
    let load = number(&summary["failure"]["collapse"][0]);
    let stress = 2.0 * load / (std::f64::consts::PI * 0.018 * 0.5);
    assert!(load > 1.0 && (number(&splitting["collapse"]) / stress - 1.0).abs() < 1e-14, "{splitting}");
    let post = here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet"]).json();
    assert_eq!(&post["splitting"]["collapse"], &splitting["collapse"]);
    let told = text(&here, &scene, &args);
    assert!(told.contains("\nsplitting        ") && told.contains("Pa at collapse (strain 1e-4): 2P/(πDt)"), "{told}");
    // the same sample, not cut: no disk
    let whole = [&args[..], &["--set", "sample.random.cut=null", "--set", "time.end=0.001"]].concat();
    assert_eq!(run(&here, &scene, &whole)["splitting"], Value::Null);
}

/// A rigid pair under a constant force, and beside it a loose grain that flies.
const LOOSE: &str = r#"{ "dimension": 2, "thickness": 1,
    "sample": { "grains": [{ "center": [0, 1e-3], "radius": 1e-3 }, { "center": [2e-3, 1e-3], "radius": 1e-3 },
        { "center": [6e-3, 4e-4], "radius": 3e-4, "velocity": [0, 2e-4] }] },
    "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
    "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
    "walls": { "bottom": { "shape": { "plane": { "normal": [0, 1], "place": { "at": [0, 0] } } } },
        "top": { "shape": { "plane": { "normal": [0, -1], "place": { "at": [0, 2e-3] } } }, "mass": { "kg": 1 },
            "force": { "constant": 5 } } },
    "time": { "step": 1e-4, "end": 0.02 }, "output": { "every_steps": 5 } }"#;

#[test]
fn a_strain_is_the_solver_s_only_where_nothing_is_loose() {
    let here = Folder::new();
    here.write("loose.json", LOOSE);
    let told = text(&here, "loose.json", &[]);
    let line =
        "collapse load    5 N (strain 1e-4, before any bond broke: not all grains are bonded to one piece; wall top)";
    assert!(told.contains(line) && !told.contains("solver error, not strain"), "{told}");
    let told = here.dem_post(&["stress-strain", "a.h5", "--quiet"]).succeeds().stdout;
    assert!(told.contains("not all grains are bonded") && !told.contains("solver error, not strain"), "{told}");
}

#[test]
fn the_work_of_the_walls_is_that_of_the_energy_balance() {
    let here = Folder::new();
    biaxial(&here, ["left", "right"]);
    run(&here, "biaxial.json", &[]);
    let history = here.history("a.h5");
    let total = *series(&history, "external_work", &[]).last().expect("steps");
    let work = |wall: &str| {
        let args = ["stress-strain", "a.h5", "--json", "--quiet", "--wall", wall];
        number(&here.dem_post(&args).json()["work"])
    };
    let sum: f64 = ["left", "right", "top"].map(work).iter().sum();
    // a wall's places have an absolute error of rounding; by trapezoids it was off by 1e-3
    assert!((sum / total - 1.0).abs() < 1e-9, "{sum} J and {total} J");
}
