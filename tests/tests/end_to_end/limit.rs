//! `dem-run limit`: the bound on the first break, and what it answers where there is none.

use crate::common::{Folder, SMALL, config, sets};
use serde_json::Value;

fn limit(scene: &str, assignments: &[&str]) -> Value {
    Folder::new().dem_run(&[&["limit", &config(scene), "--json"], &sets(assignments)[..]].concat()).json()
}

fn close(value: &Value, expected: f64) {
    let value = value.as_f64().expect("a number");
    assert!((value / expected - 1.0).abs() < 1e-8, "{value} instead of {expected}");
}

#[test]
fn two_grains_have_the_limits_that_they_break_at() {
    // the load grows by 100 N/s for 0.15 s: limits of 10 N in tension, 3 N in shear
    let pulled = limit("two-grains.json", &[]);
    assert_eq!(pulled["outcome"], "limit");
    close(&pulled["factor"], 10.0 / 15.0);
    close(&pulled["loads"][0]["limit"], 10.0);
    close(&pulled["time"], 0.1);
    let shorn = limit("two-grains.json", &["grains.loads.0.force=[0, 1]"]);
    close(&shorn["time"], 0.03);
    let pressed = limit("two-grains.json", &["grains.loads.0.force=[-1, 0]"]);
    assert_eq!((&pressed["outcome"], pressed["factor"].as_f64()), (&"unbounded".into(), None));
    let heavy = limit("two-grains.json", &["gravity=[1e6, 0]"]);
    assert_eq!(heavy["outcome"], "never_borne");
    // without a support the smallest load moves both
    let loose = limit("two-grains.json", &["grains.fixed=[]"]);
    assert_eq!((&loose["outcome"], loose["factor"].as_f64()), (&"limit".into(), Some(0.0)));
    assert_eq!((&loose["loads"][0]["limit"], &loose["time"]), (&Value::Null, &Value::Null), "{loose}");
    // its weight of 314 N pulls at the bond of 10 N, and the load pushes
    let held = limit("two-grains.json", &["gravity=[1e6, 0]", "grains.loads.0.force=[-100, 0]"]);
    assert_eq!(held["outcome"], "broken_at_start");
    let weight = 1e6 * 2500.0 * 0.01 * std::f64::consts::PI * 4e-6;
    close(&held["least_factor"], (weight - 10.0) / 1500.0);
}

#[test]
fn a_strip_in_the_grip_of_its_platens_bears_no_more_than_its_limit() {
    // its run has a peak of 41.5 N
    let found = limit("direct-tension.json", &[]);
    let load = found["loads"][0]["limit"].as_f64().expect("a load");
    assert!(load > 41.5, "{found}");
    let stronger = limit("direct-tension.json", &["bonds.stress=2e4"]);
    assert!((stronger["loads"][0]["limit"].as_f64().expect("a load") / load - 2.0).abs() < 1e-7, "{stronger}");
}

#[test]
fn compression_breaks_first_below_its_limit_at_any_cohesion() {
    let small: Vec<&str> = SMALL.iter().copied().filter(|arg| *arg != "--set").collect();
    let mut per_cohesion = vec![];
    for strength in ["bonds.strength=10", "bonds.strength=20"] {
        let assignments = [&small[..], &[strength]].concat();
        let found = limit("compression.json", &assignments);
        assert_eq!(found["outcome"], "limit", "{found}");
        let load = found["loads"][0]["limit"].as_f64().expect("a load");
        let here = Folder::new();
        // a limit load is that of the scene, however it is solved
        let args = [&["-o", "a.h5", "--set", "solver.tolerance=1e-7"], &sets(&assignments)[..]].concat();
        let first = here.run_config("compression.json", &args);
        here.write("limit.json", found.to_string());
        let page = here.dem_post(&["report", "a.h5", "--limit", "limit.json", "--json", "--quiet"]).json();
        assert_eq!(page["limit_load"]["load"].as_f64(), Some(load));
        let first = first["failure"]["first_break"].as_f64().unwrap_or_else(|| panic!("{first}"));
        assert!(first <= load + 100.0 * 1e-4, "first break at {first} N, limit {load} N");
        per_cohesion.push(load);
    }
    assert!((per_cohesion[1] / per_cohesion[0] - 2.0).abs() < 1e-7, "{per_cohesion:?}");
}

#[test]
fn a_wall_with_a_velocity_is_pressed_by_a_force_and_a_scene_without_loads_is_refused() {
    // a row of 11 disks on two round supports, pressed in the middle: half the load bends the bonds
    // beside the middle at an arm of 4.5 diameters; friction 0.3, no friction of the walls
    let grains: Vec<String> =
        (0..11).map(|k| format!(r#"{{"center": [{}, 0], "radius": 2e-3}}"#, 4e-3 * f64::from(k))).collect();
    let sample = format!(r#"sample={{"grains": [{}]}}"#, grains.join(", "));
    let circle =
        |x: f64, y: f64| format!(r#""shape": {{"circle": {{"center": [{x}, {y}], "radius": 2e-3}}}}, "friction": 0"#);
    let walls = format!(
        r#"walls={{"left": {{{}}}, "right": {{{}}}, "press": {{{}, "velocity": {{"constant": -1}}, "direction": [0, 1]}}}}"#,
        circle(0.0, -4e-3),
        circle(0.04, -4e-3),
        circle(0.02, 4e-3)
    );
    let bent = limit("two-grains.json", &[&sample, &walls, "grains=null"]);
    assert_eq!((&bent["outcome"], &bent["loads"][0]["load"]), (&"limit".into(), &"walls.press".into()), "{bent}");
    // the wall moves against its direction, and so does its force
    let load = bent["loads"][0]["limit"].as_f64().expect("a load");
    assert!((-load / (2.0 * 0.3 * 10.0 / 4.5) - 1.0).abs() < 1e-8, "{load}");

    let here = Folder::new();
    let still = here.dem_run(&["limit", &config("two-grains.json"), "--set", "grains.loads=[]"]);
    still.fails(2, &["no load of the scene grows", "force_rate"]);
    assert_eq!(here.names(), [""; 0]);
}

/// Cemented spheres under a lid that moves by 1e-4 of `rate` in its first step.
fn under_a_slow_lid(seed: u32, width: f64, solid_fraction: f64, rate: f64) -> String {
    format!(
        r#"{{ "dimension": 3, "seed": {seed},
            "sample": {{ "random": {{ "count": 20, "width": {width}, "depth": {width},
                "diameter": {{ "uniform": {{ "min": 0.002, "max": 0.0035 }} }},
                "preparation": {{ "compaction": {{ "solid_fraction": {solid_fraction} }} }} }} }},
            "materials": {{ "density": 2500, "friction": {{ "grain_grain": 0.3, "grain_wall": 0.2 }} }},
            "bonds": {{ "strength": 10, "gap_tolerance": 1e-3 }},
            "walls": {{
                "bottom": {{ "shape": {{ "plane": {{ "normal": [0, 0, 1], "place": "seated" }} }} }},
                "top": {{ "shape": {{ "plane": {{ "normal": [0, 0, -1], "place": "seated" }} }},
                    "velocity": {{ "ramp": {{ "rate": {rate} }} }} }} }},
            "time": {{ "step": 1e-4, "end": 2e-4 }}, "output": {{ "every_steps": 1 }} }}"#
    )
}

/// Reactions that break rigid bonds are 1e7 times those that stop the grains under a slow lid. The
/// first break is the same at each velocity, or the run stops and says why.
#[test]
fn a_lid_that_moves_too_slowly_for_rigid_bonds_is_told() {
    let here = Folder::new();
    for (name, rate) in [("fast.json", 1.0), ("slow.json", 1e-2), ("slower.json", 1e-4)] {
        here.write(name, under_a_slow_lid(1, 0.008, 0.38, rate));
    }
    here.write("any.json", under_a_slow_lid(7506, 0.01, 0.42, 1e-4));
    let first = |scene: &str| {
        let told = here.dem_run(&["run", scene, "-o", "a.h5", "--force", "--quiet", "--json"]).json();
        told["failure"]["first_break"].as_f64().expect("a first break")
    };
    let (fast, slow) = (first("fast.json"), first("slow.json"));
    assert!((slow / fast - 1.0).abs() < 0.01, "{fast} and {slow}");
    let limit = here.dem_run(&["limit", "slower.json", "--json"]).json()["loads"][0]["limit"].as_f64().expect("a load");
    assert!(fast < limit * 1.001, "{fast} above {limit}");
    let bound = format!("rigid bonds bear up to {limit:.1} N of wall top");
    let run = |scene: &str| here.dem_run(&["run", scene, "-o", "b.h5", "--force", "--quiet"]);
    run("slower.json").fails(3, &["velocity error", &bound, "force_rate", "bonds.stiffness"]);
    run("any.json").fails(3, &["reactions within all limits bear any force of wall top", "may have no solution"]);
}
