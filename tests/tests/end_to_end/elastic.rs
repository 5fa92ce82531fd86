//! Bonds with a stiffness, from the scene to the history.

use crate::common::{Folder, SMALL, config, number, observable, run};
use dem_run::history::History;
use serde_json::{Value, json};

const SPRINGS: &str = r#"bonds.stiffness={"springs": {"normal": 1e7, "tangential": 5e6, "rolling": 5}}"#;
const YOUNG: &str = r#"bonds.stiffness={"young": {"modulus": 1e9, "poisson_ratio": 0.2}}"#;

fn values(history: &History, name: &str) -> Vec<f64> {
    observable(history, name).value
}

#[test]
fn an_elastic_sample_yields_breaks_and_balances_its_books() {
    for stiffness in [SPRINGS, YOUNG] {
        let here = Folder::new();
        let scene = config("compression.json");
        let args = [&["run", &scene, "-o", "a.h5"], &SMALL[..], &["--set", stiffness]].concat();
        let told = here.dem_run(&args).succeeds().stdout;
        // a rigid sample that strains before its first bond breaks is not solved; this one yields
        assert!(told.contains("first break") && !told.contains("solver error, not strain"), "{told}");
        assert!(!told.contains("bond remainder"), "{told}");

        let history = here.history("a.h5");
        assert!(history.observable("bond_remainder").expect("read").is_none());
        let names = ["elastic_energy", "dissipation_damping", "fracture_energy"];
        let [elastic, damping, fracture] = names.map(|name| values(&history, name));
        let names = ["kinetic_energy", "external_work", "dissipation_impact", "dissipation_friction"];
        let [kinetic, work, impact, friction] = names.map(|name| values(&history, name));
        let last = work.len() - 1;
        let most = work.iter().fold(0.0, |most: f64, w| most.max(w.abs()));
        for k in 0..=last {
            // the sample starts at rest
            let found = kinetic[k] + elastic[k] + damping[k] + fracture[k] + impact[k] + friction[k];
            assert!((work[k] - found).abs() <= 1e-9 * most, "row {k}: {found} J of {} J", work[k]);
        }
        assert!(elastic.iter().all(|e| *e >= 0.0) && fracture.windows(2).all(|w| w[1] >= w[0]));
        let broken = values(&history, "bonds_broken");
        assert!(broken[last] > 10.0 && fracture[last] > 0.0 && damping[last] > 0.0);
        // energy is set free where bonds break, and nowhere else
        for k in 1..=last {
            assert_eq!(fracture[k] > fracture[k - 1], broken[k] > broken[k - 1], "row {k}");
        }
    }
}

#[test]
fn a_pair_yields_by_its_spring() {
    let here = Folder::new();
    here.run_config("two-grains.json", &["-o", "a.h5", "--set", SPRINGS]);
    let history = here.history("a.h5");
    let ruptures = history.ruptures().expect("ruptures");
    let [rupture] = ruptures[..] else { panic!("{} ruptures", ruptures.len()) };
    // 100 N/s up to 10 N: at 0.1 s, with ½ f²/k in the spring
    assert!((rupture.time - 0.1).abs() < 2.01e-4, "{} s", rupture.time);
    let fracture = *values(&history, "fracture_energy").last().expect("steps");
    assert!((fracture / (0.5 * 10.0 * 10.0 / 1e7) - 1.0).abs() < 5e-3, "{fracture} J");
}

#[test]
fn wrong_stiffnesses_are_refused_with_their_place_and_the_remedy() {
    for (set, parts) in [
        (
            r#"bonds.stiffness={"springs": {"normal": 0, "tangential": 5e6, "rolling": -5}}"#,
            &["bonds.stiffness.springs.normal", "> 0 (N/m)", "bonds.stiffness.springs.rolling", "-5", "> 0 (N m/rad)"]
                [..],
        ),
        (r#"bonds.stiffness={"young": {"modulus": -1, "poisson_ratio": 0.2}}"#, &["young.modulus", "> 0 (Pa)"]),
        (
            r#"bonds.stiffness={"young": {"modulus": 1e9, "poisson_ratio": 0.7}}"#,
            &["bonds.stiffness.young.poisson_ratio", "0.7", "above -1, at most 0.5"],
        ),
        (r#"bonds.stiffness={"young": {"modulus": 1e9}}"#, &["young.poisson_ratio", "required"]),
        (r#"bonds.stiffness={"youngs": {"modulus": 1e9}}"#, &["bonds.stiffness.youngs", "nearest  young"]),
        ("bonds.stiffness=1e9", &["bonds.stiffness"]),
    ] {
        let here = Folder::new();
        here.dem_run(&["run", &config("two-grains.json"), "--set", set]).fails(2, parts);
        assert_eq!(here.names(), [""; 0], "{set}");
    }
}

#[test]
fn accuracy_calls_no_strain_of_elastic_bonds_false() {
    let here = Folder::new();
    let scene = config("compression.json");
    let more = ["--solvers", "newton", "--tolerances", "1e-5", "--steps", "1", "--orders", "1"];
    let args = [&["accuracy", &scene], &SMALL[..], &["--set", YOUNG], &more].concat();
    let told = here.dem_run(&args).succeeds().stdout;
    assert!(told.contains("contact order") && !told.contains("starting reactions"), "{told}");
    assert!(!told.contains("keeps its shape") && !told.contains("solver error, not strain"), "{told}");
}

#[test]
fn columns_of_springs_have_their_modulus() {
    // two columns of 20 disks of diameter d and thickness t, each contact a spring k: the stress is
    // F/(2 d t), the strain F/(2 k d), so that E = k/t; nothing moves sideways
    let here = Folder::new();
    let scene = r#"{
        "dimension": 2, "thickness": 0.5,
        "sample": { "lattice": { "square": { "diameter": 4e-3, "rows": 20, "columns": 2 } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
        "bonds": {
            "strength": 10, "gap_tolerance": 1e-6,
            "stiffness": { "springs": { "normal": 1e7, "tangential": 5e6, "rolling": 5 } }
        },
        "walls": {
            "bottom": { "shape": { "plane": { "normal": [0, 1], "place": "seated" } } },
            "top": { "shape": { "plane": { "normal": [0, -1], "place": "seated" } }, "mass": "sample", "force_rate": 20 }
        },
        "time": { "step": 1e-4, "end": 0.2 },
        "output": { "every_steps": 100 }
    }"#;
    here.write("a.json", scene);
    here.dem_run(&["run", "a.json"]).succeeds();
    let found = here.dem_post(&["stress-strain", "a.h5", "--json"]).json();
    let value = |name: &str| found["elastic"][name]["value"].as_f64().expect("a number");
    assert!((value("young_modulus") / 2e7 - 1.0).abs() < 1e-3, "{found}");
    assert!(value("poisson_ratio").abs() < 1e-6, "{found}");
}

/// A lattice pulled slowly apart between two grips: the net impulses on its grains are far smaller
/// than the forces in it, and once torn it bears forces as small as round-off. All steps meet their
/// tolerances with few factorisations, and the forces are as accurate as the load error says.
#[test]
fn a_slow_test_meets_its_load_tolerance_to_the_end() {
    let here = Folder::new();
    let plane = |sign: i32| json!({ "plane": { "normal": [0, sign], "place": "seated" } });
    let scene = json!({
        "dimension": 2, "thickness": 0.01,
        "sample": { "lattice": { "hexagonal": { "columns": 6, "rows": 6, "diameter": 0.004 } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3, "scatter": { "weibull": { "modulus": 3 } },
            "stiffness": { "springs": { "normal": 1e6, "tangential": 5e5, "rolling": 1 } } },
        "walls": {
            "bottom": { "shape": plane(1), "grip": 1e-4 },
            "top": { "shape": plane(-1), "grip": 1e-4, "direction": [0, 1], "velocity": { "constant": 1e-5 } },
        },
        "time": { "step": 0.01, "end": 4 }, "output": { "every_steps": 100 }
    });
    here.write("torn.json", scene.to_string());
    let summary = run(&here, "torn.json", &[]);
    assert_eq!(summary["ending"], json!("time"));
    let history = here.history("a.h5");
    let broken = values(&history, "bonds_broken");
    assert!(broken.last().is_some_and(|broken| *broken > 10.0), "{:?}", broken.last());
    let greatest = |name: &str| values(&history, name).into_iter().fold(0.0, f64::max);
    assert!(greatest("solver_load_error") <= 1e-5 && greatest("solver_residual") <= 1e-8);
    let made: f64 = values(&history, "solver_factorisations").iter().sum();
    assert!(made < 4.0 * broken.len() as f64, "{made} factorisations");
    let load = values(&history, "wall_force");
    let exact = ["--set", "solver.tolerance=1e-12", "--set", "solver.kind.auto.load_tolerance=1e-9"];
    run(&here, "torn.json", &[&exact[..], &["--set", "time.end=1"]].concat());
    let limit = values(&here.history("a.h5"), "wall_force");
    let most = limit.iter().fold(0.0, |most: f64, force| most.max(force.abs()));
    assert!(most > 10.0, "{most} N");
    for (found, exact) in load.iter().zip(&limit) {
        assert!((found - exact).abs() <= 1e-5 * most, "{found} N, not {exact} N");
    }
}

/// A block of 2 × 2 × 4 balls between smooth plates that face along an oblique direction has the
/// curve and the modulus of an upright one; inside a cylinder its section is the cylinder's.
#[test]
fn a_specimen_is_measured_along_its_load() {
    let here = Folder::new();
    let (r, k) = (2e-3, 1e6);
    let measured = |turn: f64, cylinder: bool| {
        let turned = |[x, y, z]: [f64; 3]| [turn.cos() * x + turn.sin() * z, y, turn.cos() * z - turn.sin() * x];
        let places = (0..16).map(|n| [n % 2, n / 2 % 2, n / 4].map(|n| 2.0 * r * f64::from(n)));
        let grains: Vec<Value> = places.map(|x| json!({ "center": turned(x), "radius": r })).collect();
        let plate = |up: f64| json!({ "plane": { "normal": turned([0.0, 0.0, up]), "place": "seated" } });
        let mut walls = json!({
            "bottom": { "shape": plate(1.0), "friction": 0 },
            "top": { "shape": plate(-1.0), "friction": 0, "mass": "sample", "force": { "ramp": { "rate": 1000 } } },
        });
        if cylinder {
            walls["side"] = json!({ "friction": 0, "shape": { "cylinder": {
                "center": [r, r, 0], "axis": [0, 0, 1], "radius": 5e-3, "inside": true } } });
        }
        let scene = json!({
            "dimension": 3, "sample": { "grains": grains }, "walls": walls, "load_wall": "top",
            "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
            "bonds": { "strength": 1000, "gap_tolerance": 1e-6, "shear": 0.5, "rolling": 0.2,
                "stiffness": { "springs": { "normal": k, "tangential": 0.5 * k, "rolling": 1 } } },
            "time": { "step": 1e-3, "end": 0.05 }, "output": { "every_steps": 10 }
        });
        here.write("scene.json", scene.to_string());
        run(&here, "scene.json", &[]);
        here.dem_post(&["stress-strain", "a.h5", "--force", "--json"]).json()
    };
    let upright = measured(0.0, false);
    assert!((number(&upright["height"]) / 0.016 - 1.0).abs() < 1e-9);
    // four columns of springs in a section of 8 mm by 8 mm
    let modulus = k / (2.0 * r);
    assert!((number(&upright["elastic"]["young_modulus"]["value"]) / modulus - 1.0).abs() < 0.01, "{upright}");
    let oblique = measured(0.5, false);
    for of in [&["height"][..], &["area"], &["final_strain"], &["elastic", "young_modulus", "value"]] {
        let value = |found: &Value| number(of.iter().fold(found, |found, key| &found[*key]));
        assert!((value(&oblique) / value(&upright) - 1.0).abs() < 1e-4, "{of:?}: {oblique}");
    }
    let round = measured(0.0, true);
    let [section, all] = [std::f64::consts::PI * 25e-6, 64e-6];
    assert!((number(&round["area"]) / section - 1.0).abs() < 1e-9, "{round}");
    let young =
        number(&round["elastic"]["young_modulus"]["value"]) / number(&upright["elastic"]["young_modulus"]["value"]);
    assert!((young * section / all - 1.0).abs() < 0.01, "{round}");
}
