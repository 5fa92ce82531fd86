//! Plates: walls of finite extent, from the scene to the pictures.

use crate::common::{Folder, config, run, series, sets, wall};
use serde_json::{Value, json};

/// Five grains of radius 0.5 in a row on a floor, under a plate.
fn row(plate: &Value, drive: &Value) -> Value {
    let mut lid = json!({ "shape": { "plate": plate } });
    lid.as_object_mut().expect("an object").extend(drive.as_object().expect("an object").clone());
    let grains: Vec<Value> =
        [0.5, 0.5, 0.4, 0.5, 0.5].iter().enumerate().map(|(k, r)| json!({ "center": [k, r], "radius": r })).collect();
    json!({
        "dimension": 2, "sample": { "grains": grains },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "walls": { "floor": { "shape": { "plane": { "normal": [0, 1], "place": { "at": [0, 0] } } } }, "lid": lid },
        "time": { "step": 1e-3, "end": 0.02 }, "output": { "every_steps": 1 }
    })
}

/// A seated plate stops at the first grain that it meets: with a face, or with an end, where the
/// centre of the grain is R away from the end.
#[test]
fn a_seated_plate_stops_at_the_first_grain_below_it() {
    let here = Folder::new();
    // middle, length, height where it stops
    for (middle, length, expected) in [
        (2.0, 9.0, 1.0),
        // only the lower grain in the middle is below it, and its ends pass the others
        (2.0, 0.2, 0.8),
        // an end 0.3 beside the centre of the second grain
        (1.8, 1.0, 0.5 + (0.25f64 - 0.09).sqrt()),
    ] {
        let plate = json!({ "normal": [0, -2], "center": [middle, 7], "size": [length], "seated": true });
        here.write("row.json", row(&plate, &json!({})).to_string());
        run(&here, "row.json", &[]);
        let history = here.history("a.h5");
        let found = series(&history, "wall_position", &[wall(&history, "lid"), 1])[0];
        assert!((found - expected).abs() < 1e-12, "{found} m, not {expected} m");
    }
}

/// The stress of a plate acts on the part of the sample that it covers, and `info --check` accepts
/// its history.
#[test]
fn a_plate_under_a_stress_presses_on_what_it_covers() {
    let here = Folder::new();
    let drive = json!({ "mass": "sample", "stress": { "constant": 1e4 } });
    // the sample reaches from −0.5 to 4.5
    for (middle, length, covered) in [(2.0, 9.0, 5.0), (0.5, 1.5, 1.5), (0.0, 2.0, 1.5)] {
        let plate = json!({ "normal": [0, -1], "center": [middle, 7], "size": [length], "seated": true });
        here.write("row.json", row(&plate, &drive).to_string());
        run(&here, "row.json", &[]);
        let history = here.history("a.h5");
        for force in series(&history, "applied_force", &[wall(&history, "lid")]) {
            assert!((force / (1e4 * covered) - 1.0).abs() < 1e-12, "{force} N");
        }
    }
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
}

#[test]
fn plates_in_the_wrong_place_are_refused_with_the_remedy() {
    let at = |x: f64, y: f64| json!({ "normal": [0, -1], "center": [x, y], "size": [0.5] });
    let mut seated = at(20.0, 7.0);
    seated["seated"] = json!(true);
    let stress = json!({ "mass": "sample", "stress": { "constant": 1e4 } });
    for (plate, drive, parts) in [
        (at(1.0, 0.95), json!({}), ["walls.lid", "overlaps grain 1 by 5.000e-2 m", "give a plate \"seated\": true"]),
        (seated, json!({}), ["walls.lid", "meets no grain along its direction", "move its centre"]),
        (at(1.0, 2.0), stress, ["walls.lid.stress", "1 m away", "\"seated\": true"]),
    ] {
        let here = Folder::new();
        here.write("row.json", row(&plate, &drive).to_string());
        here.dem_run(&["run", "row.json"]).fails(2, &parts);
    }
}

/// Only grains below the punch or at its ends touch it, and together they bear its force.
#[test]
fn the_punch_loads_only_the_grains_that_it_covers() {
    let here = Folder::new();
    let summary = run(&here, &config("punch.json"), &sets(&["time.end=0.02", "output.every_steps=20"]));
    assert_eq!(summary["broken"], json!([0, 0, 0, 0]));
    let history = here.history("a.h5");
    let (punch, frame) = (wall(&history, "punch"), history.frames() - 1);
    let (grains, state) = (history.grains().expect("grains"), history.grain_state(frame).expect("grains"));
    let (middle, half) = (history.wall_state(frame).expect("walls").position[2 * punch], 0.006);
    let rows = history.contacts(frame).expect("contacts");
    let (mut borne, mut touching) = (0.0, 0);
    for (k, [i, j]) in rows.pair.iter().enumerate() {
        // normal and tangential force
        if *j != -1 - punch as i32 || rows.reaction[2 * k] == 0.0 {
            continue;
        }
        touching += 1;
        borne += rows.normal[2 * k + 1] * rows.reaction[2 * k] + rows.normal[2 * k] * rows.reaction[2 * k + 1];
        let beside = (state.position[2 * *i as usize] - middle).abs() - half;
        assert!(beside < grains.radius[*i as usize], "grain {i} is {beside} m beside the punch");
    }
    let force = *series(&history, "applied_force", &[punch]).last().expect("a step");
    assert!(touching > 1 && (-borne / force - 1.0).abs() < 1e-9, "{borne} N of {force} N on {touching} grains");
    here.dem_post(&["chains", "a.h5", "-o", "out"]).succeeds();
    here.dem_post(&["report", "a.h5", "-o", "out"]).succeeds();
    here.dem_post(&["view", "a.h5", "-o", "out"]).succeeds();
}

/// Spheres fall through the opening between two rectangles, and one stays on each.
#[test]
fn spheres_fall_between_two_rectangles() {
    let here = Folder::new();
    let grains: Vec<Value> =
        [-0.03, 0.0, 0.03].iter().map(|x| json!({ "center": [x, 0, 0.02], "radius": 0.01 })).collect();
    let shelf = |x: f64| {
        let plate = json!({ "normal": [0, 0, 1], "center": [x, 0, 0], "size": [0.06, 0.04], "side": [1, 0, 0] });
        json!({ "shape": { "plate": plate } })
    };
    let scene = json!({
        "dimension": 3, "sample": { "grains": grains },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "walls": { "left": shelf(-0.042), "right": shelf(0.042) }, "gravity": [0, 0, -9.81],
        "time": { "step": 5e-4, "end": 0.2 }, "output": { "every_steps": 20 }
    });
    here.write("shelves.json", scene.to_string());
    run(&here, "shelves.json", &[]);
    let history = here.history("a.h5");
    let height = history.grain_state(history.frames() - 1).expect("grains").position;
    for (k, expected) in [(0, 0.01), (1, 0.02 - 0.5 * 9.81 * 0.04), (2, 0.01)] {
        assert!((height[3 * k + 2] - expected).abs() < 1e-8, "{} m", height[3 * k + 2]);
    }
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    here.dem_post(&["velocities", "a.h5", "-o", "out"]).succeeds();
}
