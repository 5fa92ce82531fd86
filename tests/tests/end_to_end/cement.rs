//! Stages that cement: bonds that form later than at the start.

use crate::common::{Folder, config, content, number, run, series, wall};
use dem_run::history::{BondStatus, History, NOT_FORMED};
use serde_json::{Value, json};

/// Diameter (m).
const A: f64 = 0.01;
/// Stiffness of a bond (N/m).
const K: f64 = 1e6;

/// Two disks, 1 mm apart, the lower one fixed. A force on the upper one closes the gap, presses
/// with 10 N and from t = 0.4 s on grows upwards by 40 N/s. Bonds form in the second stage, at
/// t = 0.21 s, in the step of a checkpoint.
fn scene(bonds: Value) -> Value {
    let grain = |y: f64| json!({ "center": [0, y], "radius": 0.5 * A });
    let law = json!({ "strength": 5, "shear": 1, "gap_tolerance": 1e-6 });
    let law: serde_json::Map<_, _> =
        [law, bonds].iter().flat_map(|part| part.as_object().expect("fields").clone()).collect();
    json!({
        "dimension": 2, "thickness": 1,
        "sample": { "grains": [grain(0.0), grain(A + 1e-3)] },
        "materials": { "density": 2000, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
        "bonds": law,
        "grains": { "fixed": [0], "loads": [
            { "grain": 1, "force": [0, 1], "time": { "table": [[0, -10], [0.4, -10], [1.4, 30]] } }] },
        "stages": [
            { "name": "consolidate", "duration": 0.21 },
            { "name": "cement", "duration": 1, "cement": true },
        ],
        "time": { "step": 1e-3, "end": 2 }, "output": { "every_steps": 10, "checkpoint_every": 3 }
    })
}

/// Whether each bond is intact in a frame.
fn states(history: &History, frame: usize) -> Vec<bool> {
    history.bond_status(frame).expect("states").iter().map(|status| *status == BondStatus::Intact).collect()
}

#[test]
fn a_bond_that_forms_under_pressure_bears_its_strength_in_tension() {
    let here = Folder::new();
    for bonds in [json!({}), json!({ "stiffness": { "springs": { "normal": K, "tangential": K, "rolling": K } } })] {
        let elastic = bonds.get("stiffness").is_some();
        here.write("scene.json", scene(bonds).to_string());
        let summary = run(&here, "scene.json", &[]);
        assert_eq!((number(&summary["bonds"]), &summary["ending"]), (1.0, &json!("stages")));
        let history = here.history("a.h5");
        let bonds = history.bonds().expect("bonds");
        assert_eq!((bonds.pair.as_slice(), bonds.formed), (&[[0, 1]][..], Some(210)));
        // one solve of the step is enough to bear what the contact bore
        assert!(bonds.rest_gap[0].abs() < 1e-6 * A, "{} m", bonds.rest_gap[0]);
        // a force of 5 N, 15 N above the pressure, at 375 ms after the growth began
        let events = history.ruptures().expect("ruptures");
        assert_eq!(events.len(), 1);
        assert!((events[0].step - 776).abs() <= 1, "step {}", events[0].step);
        assert!((events[0].normal_force / -5.0 - 1.0).abs() < 0.01, "{} N", events[0].normal_force);
        for frame in 0..history.frames() {
            let step = history.steps()[frame];
            let expected: &[bool] = match step {
                ..=210 => &[],
                211..=770 => &[true],
                771..780 => continue,
                _ => &[false],
            };
            // the tip of the cone: tension and shear are one
            let found: Vec<bool> = states(&history, frame);
            assert_eq!(found, expected, "step {step}");
        }
        if elastic {
            // the bond took over 10 N: ½ f²/k, and up to 4 N upwards it is 14 N/k longer
            let energy = series(&history, "elastic_energy", &[]);
            assert_eq!(energy[209], 0.0);
            assert!((energy[210] / (0.5 * 100.0 / K) - 1.0).abs() < 1e-6, "{} J", energy[210]);
            assert!((energy[300] / (0.5 * 100.0 / K) - 1.0).abs() < 1e-6, "{} J", energy[300]);
            let damping = series(&history, "dissipation_damping", &[]);
            assert!(damping[300].abs() < 1e-6 * energy[300], "{} J", damping[300]);
            let height = |step: usize| {
                let frame = history.steps().iter().position(|at| *at == step as i64).expect("a frame");
                history.grain_state(frame).expect("grains").position[3]
            };
            // pulled by 4 N in the middle of the step after t = 0.75 s
            let longer = (height(750) - height(300)) * K;
            assert!((longer / 14.0 - 1.0).abs() < 0.01, "{longer} N");
        }
        let left = series(&history, "energy_remainder", &[]);
        let work = series(&history, "external_work", &[]).into_iter().map(f64::abs).fold(0.0, f64::max);
        assert!(left.iter().all(|left| left.abs() < 1e-9 * work), "{:?} J of {work}", left.last());
        here.dem_post(&["info", "a.h5", "--check"]).succeeds();
        here.dem_post(&["pack", "a.h5", "-o", "packed.h5", "--force"]).succeeds();
        assert_eq!(content(&here.history("packed.h5")), content(&history));
    }
}

/// The upper disk falls by a whole diameter before the bond forms.
#[test]
fn what_breaks_is_shown_where_it_was_bonded() {
    let here = Folder::new();
    let mut falling = scene(json!({}));
    falling["sample"]["grains"][1]["center"] = json!([0, 2.0 * A]);
    here.write("scene.json", falling.to_string());
    run(&here, "scene.json", &[]);
    let why = here.dem_post(&["why", "a.h5", "0", "--json"]).json();
    assert!((number(&why["grains"][1]["centre"][1]) / A - 1.0).abs() < 1e-6, "{why}");
    // a section of one diameter in a box of one by two
    let fabric = here.dem_post(&["fabric", "a.h5", "--json"]).json();
    let density = &fabric["rows"].as_array().expect("rows").last().expect("a frame")["crack_density"];
    assert!((number(&density[3]) * 2.0 * A - 1.0).abs() < 1e-6, "{density}");
    here.dem_post(&["report", "a.h5"]).succeeds();
    let page = String::from_utf8(here.read("a-post/report.html")).expect("text");
    assert!(page.contains("at 50 % of the width and 50 % of the height, between grains 0 and 1"));
}

#[test]
fn a_run_that_is_stopped_before_at_or_after_its_cementing_goes_on_to_the_bit() {
    let here = Folder::new();
    here.write("scene.json", scene(json!({})).to_string());
    run(&here, "scene.json", &[]);
    let whole = content(&here.history("a.h5"));
    for (end, formed) in [("0.115", NOT_FORMED), ("0.21", 210), ("0.315", 210), ("0.9", 210)] {
        run(&here, "scene.json", &["--set", &format!("time.end={end}")]);
        assert_eq!(here.history("a.h5").bonds().expect("bonds").formed, Some(formed), "{end}");
        here.dem_post(&["info", "a.h5", "--check"]).succeeds();
        here.dem_run(&["resume", "a.h5", "--until", "2", "--quiet"]).succeeds();
        assert_eq!(content(&here.history("a.h5")), whole, "stopped at {end}");
    }
}

#[test]
fn a_stage_that_finds_nothing_to_cement_is_named_with_the_remedy() {
    let here = Folder::new();
    here.write("scene.json", scene(json!({})).to_string());
    let parts = ["stages.1.cement", "no two grains are near enough at t = 0.21 s", "gap_tolerance larger"];
    here.dem_run(&["run", "scene.json", "--set", "grains.loads.0.force.1=0"]).fails(2, &parts);
    here.dem_run(&["accuracy", "scene.json"]).fails(2, &["stages.1 cements", "stages.1.cement=false"]);
}

/// A whole test in one scene: cementing moves nothing, and the loop of unloading and reloading
/// comes back to where it began.
#[test]
fn a_sample_is_consolidated_cemented_and_tested_in_stages() {
    let here = Folder::new();
    let summary = run(&here, &config("staged-biaxial.json"), &["--set", "stages.5.duration=0.0078"]);
    assert_eq!((&summary["ending"], &summary["load_wall"]), (&json!("stages"), &json!("top")));
    let history = here.history("a.h5");
    assert_eq!(history.bonds().expect("bonds").formed, Some(200));
    let top = wall(&history, "top");
    let (load, height) =
        (series(&history, "wall_force_at_limit", &[top, 1]), series(&history, "wall_position", &[top, 1]));
    // 200 Pa on 20 mm by 1 m, before and after; the peak is 17 micrometres away
    for k in 190..250 {
        assert!((load[k] / 4.0 - 1.0).abs() < 1e-6, "step {}: {} N", k + 1, load[k]);
        assert!((height[k] - height[190]).abs() < 1e-9, "step {}: {} m", k + 1, height[k]);
    }
    // loaded to step 500; reloaded to the same height, no bond broken since
    let broken = series(&history, "bonds_broken", &[]);
    let back = (640..height.len()).find(|k| height[*k] <= height[499]).expect("it comes back");
    assert!(broken[499] > 0.0 && load[back] < load[499] && load[back] > 0.95 * load[499], "{} N", load[back]);
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
}
