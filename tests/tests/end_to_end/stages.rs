//! Staged loading: the same bits as one table, loops that close, stages that end by a condition.

use crate::common::{self, Folder, series};
use dem_run::history::History;
use serde_json::{Value, json};

/// A bonded lattice of elastic bonds under a lid. The time step is a power of two, so the times of
/// stages are exact.
fn scene(top: Value, stages: Value) -> Value {
    let plane = |sign: i32| json!({ "plane": { "normal": [0, sign], "place": "seated" } });
    let mut lid = json!({ "shape": plane(-1), "friction": 0 });
    lid.as_object_mut().expect("a wall").extend(top.as_object().expect("drives").clone());
    json!({
        "dimension": 2, "thickness": 1,
        "sample": { "lattice": { "hexagonal": { "diameter": 0.01, "rows": 4, "columns": 4 } } },
        "materials": { "density": 2000, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
        "bonds": { "strength": 1e6, "gap_tolerance": 1e-6,
            "stiffness": { "young": { "modulus": 1e7, "poisson_ratio": 0.2 } } },
        "walls": { "floor": { "shape": plane(1) }, "lid": lid },
        "stages": stages,
        "time": { "step": 0.0009765625, "end": 1 }, "output": { "every_steps": 16 }
    })
}

fn run(here: &Folder, scene: &Value, args: &[&str]) -> (Value, History) {
    here.write("scene.json", scene.to_string());
    (common::run(here, "scene.json", args), here.history("a.h5"))
}

/// Position, forces and stress, step by step. The lid is the second wall.
fn course(history: &History) -> Vec<Vec<f64>> {
    [("wall_position", &[1, 1][..]), ("wall_force", &[1, 1]), ("applied_force", &[1]), ("stress", &[1, 1])]
        .map(|(name, index)| series(history, name, index))
        .to_vec()
}

/// Load, unload and load again, with a rest under each greatest load: in stages, or as one table.
fn loop_of_loads() -> (Value, Value) {
    let stage = |name: &str, duration: f64, from: i32, to: i32| {
        let drive = json!({ "force": { "table": [[0, from], [duration, to]] } });
        json!({ "name": name, "duration": duration, "walls": { "lid": drive } })
    };
    let stages = json!([
        stage("load", 0.25, 0, 1000),
        stage("rest", 0.0625, 1000, 1000),
        stage("unload", 0.25, 1000, 100),
        stage("reload", 0.25, 100, 1000),
        stage("rest again", 0.0625, 1000, 1000),
    ]);
    let table = json!([[0, 0], [0.25, 1000], [0.3125, 1000], [0.5625, 100], [0.8125, 1000], [0.875, 1000]]);
    let whole = json!({ "mass": "sample", "force": { "table": table } });
    (scene(json!({ "mass": "sample" }), stages), scene(whole, json!([])))
}

#[test]
fn stages_are_the_same_loads_as_one_table_to_the_bit_and_a_loop_closes() {
    let here = Folder::new();
    let (staged, whole) = loop_of_loads();
    let (summary, history) = run(&here, &staged, &[]);
    assert_eq!(
        (&summary["ending"], &summary["steps"], &summary["load_wall"]),
        (&json!("stages"), &json!(896), &json!("lid"))
    );
    let in_stages = course(&history);
    let (summary, history) = run(&here, &whole, &["--set", "time.end=0.875"]);
    assert_eq!(summary["ending"], "time");
    assert_eq!(in_stages, course(&history));

    // an elastic sample: the same height under the same force
    let height = &in_stages[0];
    let start = history.wall_state(0).expect("walls").position[3];
    let down = |step: usize| start - height[step - 1];
    assert!((down(576) / down(320) - 0.1).abs() < 1e-2, "{} m and {} m", down(576), down(320));
    assert!((down(896) / down(320) - 1.0).abs() < 1e-6, "{} m and {} m", down(896), down(320));

    // stopped in the second stage, it goes on to the bit
    let (_, history) = run(&here, &staged, &["--set", "time.end=0.375"]);
    assert_eq!(course(&history)[0].len(), 384);
    here.dem_run(&["resume", "a.h5", "--until", "1", "--quiet"]).succeeds();
    assert_eq!(course(&here.history("a.h5")), in_stages);
    let again = here.dem_run(&["resume", "a.h5", "--until", "2"]).succeeds().stdout;
    assert!(again.contains("nothing to do: the run ended at t = 0.875 s"), "{again}");
}

#[test]
fn a_stage_ends_by_its_condition_and_the_next_one_takes_the_wall() {
    let here = Folder::new();
    let travel = |share: f64| json!({ "wall_travel": { "wall": "lid", "fraction_of_height": share } });
    let stages = json!([
        { "name": "consolidate", "duration": 0.125, "walls": { "lid": { "stress": { "ramp": { "rate": 80000 } } } } },
        { "name": "compress", "duration": 0.5, "until": travel(0.001),
            "walls": { "lid": { "velocity": { "constant": 0.001 } } } },
        { "name": "hold", "duration": 0.0625, "walls": { "lid": {} } },
    ]);
    let (summary, history) = run(&here, &scene(json!({ "mass": "sample" }), stages), &[]);
    assert_eq!(summary["ending"], "stages");
    // the wall loses its kinetic energy to its drive where a velocity follows the stress
    let [left, work] = ["energy_remainder", "external_work"].map(|name| summary[name].as_f64().expect("J"));
    assert!(left.abs() < 1e-12 * work, "{left} J of {work} J");
    let (height, force) = (series(&history, "wall_position", &[1, 1]), series(&history, "applied_force", &[1]));
    // 10 kPa at the end of the first stage, less half a step, on 40 mm times 1 m; the sample
    // hardly widens
    let stress = 80000.0 * (128.0 - 0.5) * 0.0009765625;
    assert!((force[127] / (stress * 0.04) - 1.0).abs() < 1e-3, "{} N", force[127]);
    // the travel is measured from there
    let extent = 0.01 * (1.0 + 3.0 * 0.75_f64.sqrt());
    // the last step of the second stage; the extent has shrunk a little by then
    let end = height.len() - 1 - 64;
    let way = height[127] - height[end];
    assert!((way - 0.001 * extent).abs() < 1e-6, "{way} m");
    // half the last step's velocity is left for the step after
    assert!(height[end..].iter().skip(1).all(|y| (y - height[end + 1]).abs() < 1e-15), "it is held");
    assert!(height[end - 1] - height[end] > 0.9e-6, "it moved by 1 mm/s until then");
    assert!(force[end + 10] > 0.9 * force[end], "it bears its load: {} N of {} N", force[end + 10], force[end]);
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    here.dem_post(&["stress-strain", "a.h5", "--quiet"]).succeeds();
    // the state of a step is that of the run
    here.dem_run(&["export", "a.h5", "--step", "200", "-o", "problem.hdf5", "--quiet"]).succeeds();
}

#[test]
fn stages_that_cannot_be_are_named() {
    let here = Folder::new();
    let check = |stages: Value, parts: &[&str]| {
        here.write("scene.json", scene(json!({ "mass": "sample" }), stages).to_string());
        here.dem_run(&["check", "scene.json"]).fails(2, parts);
    };
    let push = json!({ "lid": { "force": { "constant": 1 } } });
    check(json!([{ "name": "load", "walls": push }]), &["stages.0", "stage \"load\" without an end", "a duration (s)"]);
    check(json!([{ "name": "load", "until": {}, "walls": push }]), &["stages.0.until", "no condition"]);
    let wrong = json!({ "lit": { "force": { "constant": 1 } }, "lid": push["lid"] });
    check(json!([{ "name": "load", "duration": 1, "walls": wrong }]), &["stages.0.walls.lit", "nearest  lid"]);
    let both = json!({ "lid": { "force": { "constant": 1 }, "velocity": { "constant": 1 } } });
    check(json!([{ "name": "load", "duration": 1, "walls": both }]), &["stages.0.walls.lid", "one drive at most"]);
    let one = json!({ "name": "load", "duration": 0.7, "walls": push });
    check(json!([one, one]), &["stages.1.name", "\"load\" a second time"]);
    let more = json!({ "name": "more", "duration": 0.7 });
    here.write("scene.json", scene(json!({ "mass": "sample" }), json!([one, more])).to_string());
    let warned = here.dem_run(&["check", "scene.json"]).succeeds().stderr;
    assert!(warned.contains("ends at 1 s, before its stages, which last 1.4 s"), "{warned}");
    check(json!([{ "name": "load", "duration": 0 , "walls": push }]), &["stages.0.duration", "at least the time step"]);
    let slow = json!({ "lid": { "velocity": { "constant": 1 } } });
    check(
        json!([{ "name": "load", "duration": 1, "walls": slow }]),
        &["walls.lid.mass", "only a wall that is driven by a force"],
    );
}
