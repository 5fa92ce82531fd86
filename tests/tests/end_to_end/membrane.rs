//! A membrane in a scene: pressures in stages, a run that goes on, surfaces that cannot be found.

use crate::common::{self, Folder, series};
use dem_run::history::History;
use serde_json::{Value, json};

/// A bonded lattice of 4 × 6 disks of 10 mm between two fixed plates under a membrane.
fn scene(membrane: Value, stages: Value) -> Value {
    let plate = |sign: i32| json!({ "shape": { "plane": { "normal": [0, sign], "place": "seated" } }, "friction": 0 });
    json!({
        "dimension": 2, "thickness": 0.5,
        "sample": { "lattice": { "square": { "diameter": 0.01, "rows": 6, "columns": 4 } } },
        "materials": { "density": 2000, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
        "bonds": { "strength": 1e6, "gap_tolerance": 1e-6,
            "stiffness": { "young": { "modulus": 1e7, "poisson_ratio": 0.2 } } },
        "walls": { "floor": plate(1), "lid": plate(-1) },
        "membrane": membrane,
        "stages": stages,
        "time": { "step": 0.0009765625, "end": 0.25 }, "output": { "every_steps": 16, "checkpoint_every": 4 }
    })
}

/// Pressure, area, lateral stress and work, step by step.
fn course(history: &History) -> [Vec<f64>; 4] {
    [("membrane_pressure", &[][..]), ("membrane_area", &[]), ("stress", &[0, 0]), ("external_work", &[])]
        .map(|(name, index)| series(history, name, index))
}

fn run(here: &Folder, scene: &Value) -> [Vec<f64>; 4] {
    here.write("scene.json", scene.to_string());
    common::run(here, "scene.json", &[]);
    course(&here.history("a.h5"))
}

#[test]
fn a_pressure_in_stages_is_the_same_as_one_table_and_squeezes_an_elastic_block() {
    let here = Folder::new();
    let plates = ["floor", "lid"];
    let table = json!({ "table": [[0, 0], [0.125, 4000], [0.25, 1000]] });
    let whole = run(&here, &scene(json!({ "pressure": table, "between": plates }), json!([])));
    let stage = |name: &str, from: i32, to: i32| json!({ "name": name, "duration": 0.125, "membrane_pressure": { "table": [[0, from], [0.125, to]] } });
    let stages = json!([stage("press", 0, 4000), stage("release", 4000, 1000)]);
    let staged = scene(json!({ "pressure": { "constant": 7 }, "between": plates }), stages);
    assert_eq!(run(&here, &staged), whole);

    let [pressure, area, stress, work] = whole;
    assert_eq!(pressure.len(), 256);
    // the pressure is the lateral stress
    for step in [60, 128, 200, 255] {
        assert!((stress[step] / pressure[step] - 1.0).abs() < 0.02, "{} at {}", stress[step], pressure[step]);
    }
    // each of six rows is three bonds of stiffness E t in series, under p times its pitch of t
    let squeezed = area[0] - area[127];
    let expected = 6.0 * 0.01 * 3.0 * pressure[127] * 0.01 / 1e7;
    assert!((squeezed / expected - 1.0).abs() < 0.02, "{squeezed} m² and {expected} m²");
    // ½ p ΔA t, which a step of the ramp at rest stores
    let stored = 0.5 * pressure[127] * squeezed * 0.5;
    assert!((work[127] / stored - 1.0).abs() < 0.02, "{} J and {stored} J", work[127]);

    // from the checkpoint after the 192nd step, in the second stage
    here.dem_run(&["run", "scene.json", "-o", "b.h5", "--set", "time.end=0.2", "--quiet"]).succeeds();
    here.dem_run(&["resume", "b.h5", "--until", "0.25", "--quiet"]).succeeds();
    assert_eq!(course(&here.history("b.h5")), course(&here.history("a.h5")));
}

#[test]
fn a_surface_that_cannot_be_found_is_named_before_the_run() {
    let here = Folder::new();
    let refused = |membrane: Value, parts: &[&str]| {
        here.write("scene.json", scene(membrane, json!([])).to_string());
        here.dem_run(&["run", "scene.json", "-o", "c.h5"]).fails(2, parts);
    };
    refused(
        json!({ "pressure": { "constant": 1 }, "between": ["floor", "lid"], "disk_radius": 0.04 }),
        &["membrane: ", "between wall floor and wall lid", "radius 4.0", "or does not fit", "membrane.disk_radius"],
    );
    refused(json!({ "pressure": { "constant": -1 } }), &["membrane.pressure.constant", "a number ≥ 0 (Pa)"]);
}
