//! Loads of laboratory tests: walls by stress, shear under a normal load, glued platens, the end at
//! a drop of the load; and the shipped scenes that use them.

use crate::common::{Folder, config, number, run, series, sets, wall};
use serde_json::json;

/// The side walls press with their stress on the present distance of lid and floor, at the middle
/// of each step, and grow farther apart; a greater stress makes a stronger sample.
#[test]
fn the_side_walls_of_a_biaxial_test_hold_their_stress() {
    let here = Folder::new();
    let mut peaks = vec![];
    for stress in [0.0, 250.0, 500.0] {
        let table = format!("[[0, 0], [0.01, {stress}]]");
        let sets = ["left", "right"].map(|side| format!("walls.{side}.stress.table={table}"));
        let summary = run(&here, &config("biaxial.json"), &["--set", &sets[0], "--set", &sets[1]]);
        assert_eq!((&summary["ending"], &summary["load_wall"]), (&json!("load_drop"), &json!("top")));
        peaks.push(number(&summary["peak_load"]).abs());
        let history = here.history("a.h5");
        let [left, right, top, bottom] = ["left", "right", "top", "bottom"].map(|name| wall(&history, name));
        let height: Vec<f64> = series(&history, "wall_position", &[top, 1])
            .iter()
            .zip(series(&history, "wall_position", &[bottom, 1]))
            .map(|(top, bottom)| top - bottom)
            .collect();
        for side in [left, right] {
            let force = series(&history, "applied_force", &[side]);
            for k in 200..force.len() {
                let section = 0.5 * (height[k - 1] + height[k]);
                assert!((force[k] - stress * section).abs() <= 1e-6 * stress * section, "step {k}: {} N", force[k]);
            }
        }
        let width = |k: usize| {
            series(&history, "wall_position", &[right, 0])[k] - series(&history, "wall_position", &[left, 0])[k]
        };
        assert!(width(height.len() - 1) > width(100), "the sample does not swell");
    }
    assert!(peaks[0] < peaks[1] && peaks[1] < peaks[2], "{peaks:?} N");
}

/// A cemented block between a floor of μ = 0.4 and a rough lid that presses with a stress and
/// slides: the block slides on the floor, and the lid is held back by μσA.
#[test]
fn a_block_under_a_lid_that_slides_is_held_back_by_the_friction_of_its_floor() {
    let here = Folder::new();
    let plane = |sign: i32| json!({ "plane": { "normal": [0, sign], "place": "seated" } });
    let scene = json!({
        "dimension": 2, "thickness": 0.5,
        "sample": { "lattice": { "square": { "diameter": 0.01, "rows": 2, "columns": 10 } } },
        "materials": { "density": 2000, "friction": { "grain_grain": 0.3, "grain_wall": 0.4 } },
        "bonds": { "strength": 1e6, "gap_tolerance": 1e-6 },
        "walls": {
            "floor": { "shape": plane(1) },
            "lid": { "shape": plane(-1), "friction": 1, "mass": "sample", "stress": { "constant": 2e4 },
                "slide": { "direction": [1, 0], "velocity": { "ramp": { "rate": 0.01 } } } },
        },
        "time": { "step": 1e-3, "end": 0.2 }, "output": { "every_steps": 50 }
    });
    here.write("box.json", scene.to_string());
    let summary = run(&here, "box.json", &[]);
    let history = here.history("a.h5");
    let (lid, floor) = (wall(&history, "lid"), wall(&history, "floor"));
    // ten disks wide, half a metre thick
    let normal = 2e4 * 0.1 * 0.5;
    let (on_lid, on_floor) = (series(&history, "wall_force", &[lid, 0]), series(&history, "wall_force", &[floor, 0]));
    for k in 0..on_floor.len() {
        assert!((on_floor[k] / (0.4 * normal) - 1.0).abs() < 1e-6, "{} N on the floor", on_floor[k]);
        // the block of 20 disks is accelerated too
        let inertia = 20.0 * std::f64::consts::PI * 25e-6 * 1000.0 * 0.01;
        assert!(((-on_lid[k] - inertia) / (0.4 * normal) - 1.0).abs() < 1e-6, "{} N on the lid", on_lid[k]);
    }
    let way = *series(&history, "wall_position", &[lid, 0]).last().expect("a step");
    assert!((way / (0.5 * 0.01 * 0.2 * 0.2) - 1.0).abs() < 1e-9, "{way} m");
    // the lid does the work of its stress and of its slide; nothing else acts on the block
    let outside = *series(&history, "external_work", &[]).last().expect("a step");
    let work = number(&here.dem_post(&["stress-strain", "a.h5", "--json", "--quiet"]).json()["work"]);
    assert!(outside > 0.0 && (work / outside - 1.0).abs() < 1e-9, "{work} J by the lid, {outside} J in all");
    assert_eq!(number(&summary["broken"][0]) + number(&summary["broken"][1]), 0.0);
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
}

/// The load of the platen is that of the specimen; its drop ends the run, and a run that was
/// stopped goes on to the bit.
#[test]
fn a_specimen_between_glued_platens_is_torn_apart() {
    let here = Folder::new();
    let summary = run(&here, &config("direct-tension.json"), &[]);
    assert_eq!((&summary["ending"], &summary["load_wall"]), (&json!("load_drop"), &json!("top")));
    let history = here.history("a.h5");
    let (top, bottom) = (wall(&history, "top"), wall(&history, "bottom"));
    let load = series(&history, "wall_force_at_limit", &[top, 1]);
    let way = series(&history, "wall_position", &[top, 1]);
    // tension: the specimen pulls the upper platen down, the lower one up; what differs is inertia
    let peak = load.iter().copied().fold(0.0, f64::min);
    assert_eq!(number(&summary["peak_load"]), -peak);
    let at = load.iter().position(|f| *f == peak).expect("the peak");
    let below = series(&history, "wall_force_at_limit", &[bottom, 1])[at];
    assert!((below / -peak - 1.0).abs() < 0.05, "{below} N below, {peak} N above");
    // in proportion to the displacement before the first break
    let broken = series(&history, "bonds_broken", &[]);
    let first = broken.iter().position(|broken| *broken > 0.0).expect("a break");
    let start = history.wall_state(0).expect("walls").position[2 * top + 1];
    let stiffness = |k: usize| load[k] / (way[k] - start);
    assert!((stiffness(first - 1) / stiffness(2 * first / 3) - 1.0).abs() < 0.05, "not elastic");
    // ten steps below a fifth of the peak, the last ten alone
    let low = |k: usize| load[k].abs() < 0.2 * -peak;
    let last = load.len();
    assert!((last - 10..last).all(low) && !low(last - 11), "{:?}", &load[last - 12..]);
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();

    let whole = series(&history, "wall_force", &[top, 1]);
    run(&here, &config("direct-tension.json"), &["--set", "time.end=0.02"]);
    here.dem_run(&["resume", "a.h5", "--until", "0.4", "--quiet"]).succeeds();
    assert_eq!(series(&here.history("a.h5"), "wall_force", &[top, 1]), whole);
}

#[test]
fn a_cemented_layer_in_a_shear_box_has_a_peak_and_a_residual_strength() {
    let here = Folder::new();
    let summary = run(&here, &config("shear-box.json"), &[]);
    assert_eq!(summary["ending"], "time");
    let history = here.history("a.h5");
    let lid = wall(&history, "lid");
    let shear: Vec<f64> = series(&history, "wall_force", &[lid, 0]).iter().map(|f| -f).collect();
    let peak = shear.iter().copied().fold(0.0, f64::max);
    let last = &shear[shear.len() - 100..];
    let residual = last.iter().sum::<f64>() / last.len() as f64;
    assert!(residual > 0.0 && residual < 0.7 * peak, "peak {peak} N, residual {residual} N");
}

/// The four side plates of a triaxial cell press with their stress on the section at the middle of
/// each step: what the other walls leave free.
#[test]
fn the_side_plates_of_a_triaxial_test_hold_their_stress() {
    let here = Folder::new();
    let small = sets(&[
        "sample.random.count=80",
        "sample.random.width=0.009",
        "sample.random.depth=0.009",
        "sample.random.preparation.compaction.solid_fraction=0.45",
        "time.end=0.02",
    ]);
    let summary = run(&here, &config("triaxial.json"), &small);
    assert_eq!((number(&summary["grains"]), &summary["load_wall"]), (80.0, &json!("top")));
    let history = here.history("a.h5");
    let h = 1e-4;
    // positions at mid-step, from those of the steps: x + v h/2, before and after
    let middle = |name: &str, axis: usize| {
        let index = wall(&history, name);
        let (mut at, mut speed) = (history.wall_state(0).expect("walls").position[3 * index + axis], 0.0);
        let half = |place: &f64| {
            let middle = at + 0.5 * h * speed;
            speed = 2.0 * (place - middle) / h;
            at = *place;
            middle
        };
        series(&history, "wall_position", &[index, axis]).iter().map(half).collect::<Vec<f64>>()
    };
    let gap = |walls: [&str; 2], axis: usize| -> Vec<f64> {
        middle(walls[0], axis).iter().zip(middle(walls[1], axis)).map(|(high, low)| high - low).collect()
    };
    let (wide, deep, high) = (gap(["right", "left"], 0), gap(["back", "front"], 1), gap(["top", "bottom"], 2));
    for (name, across) in [("left", &deep), ("right", &deep), ("front", &wide), ("back", &wide)] {
        let force = series(&history, "applied_force", &[wall(&history, name)]);
        for k in 100..force.len() {
            let expected = 50e3 * across[k] * high[k];
            assert!((force[k] / expected - 1.0).abs() < 1e-6, "{name}, step {k}: {} N, not {expected} N", force[k]);
        }
    }
    let (first, last) = (wide[100] * deep[100], wide[199] * deep[199]);
    assert!(high[199] < high[100] && last != first, "the block has the section that it had");
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
}

#[test]
fn the_crack_of_a_notched_beam_starts_at_its_notch_and_a_deeper_notch_weakens_it() {
    let here = Folder::new();
    let mut peaks = vec![];
    for depth in [3e-3, 6e-3, 9e-3] {
        let set = format!("bonds.absent.0.box.to=[0.04, {depth}]");
        let summary = run(&here, &config("notched-beam.json"), &["--set", &set]);
        assert_eq!(summary["ending"], "load_drop");
        peaks.push(number(&summary["peak_load"]));
        // within two diameters of the tip, in a beam forty long
        let first = &here.history("a.h5").ruptures().expect("ruptures")[0];
        let [x, y, _] = first.point;
        assert!((x - 0.04).abs() < 4e-3 && (y - depth).abs() < 4e-3, "{depth} m: first break at {x}, {y} m");
    }
    assert!(peaks[0] > peaks[1] && peaks[1] > peaks[2], "{peaks:?} N");
}

#[test]
fn a_layer_is_pulled_off_at_a_weak_interface_and_breaks_itself_at_a_strong_one() {
    let here = Folder::new();
    // shares of the broken bonds that lie between the two materials
    let [weak, strong] = [2.5e3, 2e4].map(|stress| {
        let set = format!("materials.pairs.1.bonds.stress={stress}");
        run(&here, &config("pull-off.json"), &["--set", &set]);
        let history = here.history("a.h5");
        assert_eq!(history.materials().expect("materials"), ["base", "mortar"]);
        let material = history.grains().expect("grains").material;
        let broken = history.ruptures().expect("ruptures");
        let across = broken.iter().filter(|event| {
            let [i, j] = event.pair.map(|grain| material[grain as usize]);
            i != j
        });
        (across.count(), broken.len())
    });
    assert!(weak.0 == weak.1 && weak.1 > 10, "weak: {weak:?}");
    assert!(2 * strong.0 < strong.1, "strong: {strong:?}");
}

#[test]
fn scattered_strengths_lower_the_load_of_the_first_break_and_it_is_proportional_to_them() {
    let here = Folder::new();
    let small = [
        "sample.random.count=60",
        "sample.random.width=0.011",
        "sample.random.preparation.compaction.solid_fraction=0.7",
    ];
    let first = |set| {
        let summary = run(&here, &config("uniaxial-scatter.json"), &sets(&[&small[..], &[set]].concat()));
        number(&summary["failure"]["first_break"])
    };
    let (whole, scattered, doubled) = (first("bonds.scatter=null"), first("seed=1"), first("bonds.strength=20"));
    assert!(scattered < 0.9 * whole, "{scattered} N with scatter, {whole} N without");
    assert!((doubled / scattered - 2.0).abs() < 1e-4, "{doubled} N against {scattered} N");
}

#[test]
fn walls_that_need_grains_and_have_none_are_named_with_the_remedy() {
    let here = Folder::new();
    let biaxial = config("biaxial.json");
    let lattice = r#"sample={"lattice": {"square": {"diameter": 0.002, "rows": 3, "columns": 3}}}"#;
    let away = "walls.left.shape.plane.place={\"at\": [-0.01, 0]}";
    let parts = ["walls.left.stress", "touches nothing at the start", "\"place\": \"seated\""];
    here.dem_run(&["check", &biaxial, "--set", lattice, "--set", away]).fails(2, &parts);
    let tension = config("direct-tension.json");
    let high = "walls.top.shape.plane.place={\"at\": [0, 1]}";
    let parts = ["walls.top.grip", "no grain is within 0.003 m", "enlarge the grip"];
    here.dem_run(&["check", &tension, "--set", lattice, "--set", high]).fails(2, &parts);
}

#[test]
fn a_new_scene_is_one_that_is_shipped() {
    let here = Folder::new();
    let list = here.dem_run(&["new"]).succeeds().stdout;
    assert!(list.contains("direct-tension") && list.contains("dem-run new NAME"), "{list}");
    here.dem_run(&["new", "two-grains"]).succeeds();
    here.dem_run(&["check", "two-grains.json"]).succeeds();
    let text = String::from_utf8(here.read("two-grains.json")).expect("UTF-8");
    assert!(text.starts_with("// Two cemented grains") && !text.contains("schema.json"), "{text}");
    here.dem_run(&["new", "two-grains"]).fails(4, &["two-grains.json exists", "--force"]);
    here.dem_run(&["new", "biaxial", "-o", "mine.json"]).succeeds();
    assert_eq!(here.names(), ["mine.json", "two-grains.json"]);
    here.dem_run(&["new", "biaxal"]).fails(2, &["\"biaxal\"", "biaxial"]);
}
