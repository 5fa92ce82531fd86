//! `rupture: next_event`: loading from break to break.

use crate::common::{Folder, SMALL, config, number, run, series};
use dem_run::history::RuptureMode;
use serde_json::{Value, json};
use std::collections::BTreeSet;

const NEXT: [&str; 6] = ["--set", "rupture=next_event", "--set", "stop=null", "--set", "output.every_steps=1"];

/// The assignment of a sample that is read from a file.
fn sample_of(here: &Folder, file: &str) -> String {
    format!("sample={{\"file\": {{\"path\": {:?}}}}}", here.path(file))
}

/// Grains of a sample file, one a line, without its header.
fn grains(here: &Folder, file: &str) -> (String, Vec<String>) {
    let text = String::from_utf8(here.read(file)).expect("UTF-8");
    let mut lines = text.lines().filter(|line| !line.starts_with('#')).map(str::to_string);
    (lines.next().expect("a header"), lines.collect())
}

/// Each event of a history as the load of the top wall (N) and the pairs of the bonds that break,
/// with the numbers that `name` gives to the grains.
fn events(here: &Folder, file: &str, name: impl Fn(i32) -> usize) -> Vec<(f64, BTreeSet<[usize; 2]>)> {
    let history = here.history(file);
    let force = history.observable("applied_force").expect("read").expect("walls are driven");
    let walls = force.value.len() / force.step.len();
    let mut events: Vec<_> = force.value.chunks(walls).map(|walls| (walls[walls.len() - 1], BTreeSet::new())).collect();
    for rupture in history.ruptures().expect("ruptures") {
        let mut pair = rupture.pair.map(&name);
        pair.sort_unstable();
        events[rupture.step as usize - 1].1.insert(pair);
    }
    events
}

/// The whole branch, with loads that rise and fall, is the same for three orders of the grains, and
/// its first break is in the step of a stepped run whose load is the first to reach it.
#[test]
fn the_branch_beyond_the_peak_does_not_depend_on_the_order_of_the_contacts() {
    let here = Folder::new();
    let scene = config("compression.json");
    let pack = [&["pack", &scene, "-o", "sample.csv"][..], &SMALL].concat();
    here.dem_run(&pack).succeeds();
    let (header, lines) = grains(&here, "sample.csv");
    let count = lines.len();
    // a stride without a common factor visits every grain
    let orders = [1, 7, 11].map(|stride| (0..count).map(|k| stride * k % count).collect::<Vec<_>>());
    let branches = orders.map(|order| {
        let rows: Vec<&str> = order.iter().map(|k| lines[*k].as_str()).collect();
        here.write("order.csv", format!("{header}\n{}\n", rows.join("\n")));
        let sample = sample_of(&here, "order.csv");
        here.dem_run(&[&["run", &scene, "-o", "run.h5", "--force", "-q", "--set", &sample][..], &NEXT].concat())
            .succeeds();
        here.dem_post(&["info", "--check", "run.h5"]).succeeds();
        // steps count breaks: nothing lasts
        let emission = here.dem_post(&["emission", "run.h5", "--json", "--force"]).json();
        let bursts = emission["events"].as_array().expect("a list");
        assert!(!bursts.is_empty() && bursts.iter().all(|burst| burst["duration"].is_null()), "{emission}");
        for analysis in ["emission", "cracks", "chains", "fabric", "velocities", "compare"] {
            let files = if analysis == "compare" { &["run.h5", "run.h5"][..] } else { &["run.h5"] };
            let told = here.dem_post(&[&[analysis], files, &["--force"]].concat()).succeeds().stdout;
            let seconds = ["time (s)", "first (s)", "t ="].iter().any(|words| told.contains(words));
            assert!(told.contains("step") && !seconds, "{told}");
        }
        let late = ["chains", "run.h5", "--force", "--times", "3,900"];
        here.dem_post(&late).fails(2, &["counts steps, from 0 to"]);
        here.dem_post(&["report", "run.h5", "--force"]).succeeds();
        let page = String::from_utf8(here.read("run-post/report.html")).expect("UTF-8");
        assert!(page.contains("data-step=") && page.contains("over the steps") && !page.contains("over time"));
        assert!(page.contains("First break: step 1") && !page.contains("t = 0."));
        events(&here, "run.h5", |grain| order[grain as usize])
    });
    let [first, others @ ..] = &branches;
    let broken: usize = first.iter().map(|(_, pairs)| pairs.len()).sum();
    assert!(broken >= 5, "{first:?}");
    let loads: Vec<f64> = first.iter().map(|(load, _)| *load).collect();
    assert!(loads.windows(2).any(|w| w[1] < w[0]) && loads.windows(2).any(|w| w[1] > w[0]), "{loads:?}");
    for other in others {
        assert_eq!(first.len(), other.len());
        for (k, (a, b)) in first.iter().zip(other).enumerate() {
            assert_eq!(a.1, b.1, "event {k}");
            assert!((a.0 / b.0 - 1.0).abs() < 1e-4, "event {k}: {} N, {} N", a.0, b.0);
        }
    }

    let sample = sample_of(&here, "sample.csv");
    let rate = "walls.top.force_rate=100";
    let stepped = ["run", &scene, "-o", "stepped.h5", "--json", "-q", "--set", &sample, "--set", rate];
    let summary: Value = here.dem_run(&stepped).json();
    let reached = summary["failure"]["first_break"].as_f64().expect("a load");
    // a step of 1e-4 s adds 0.01 N
    assert!(reached >= loads[0] * (1.0 - 1e-6) && reached <= loads[0] + 0.0101, "{reached} N, {} N", loads[0]);
}

/// A run that is resumed with it begins without loads, where no reactions are left.
#[test]
fn a_stepped_run_goes_on_from_break_to_break() {
    let here = Folder::new();
    let scene = config("compression.json");
    let run = |file: &str, more: &[&str]| {
        here.dem_run(&[&["run", &scene, "-o", file, "-q", "--json"][..], &SMALL, more].concat()).json()
    };
    let stop = ["--set", "stop={\"broken_fraction\": 0.03}"];
    let whole = run("whole.h5", &[&NEXT[..2], &stop].concat());
    run("stepped.h5", &["--set", "time.end=0.01"]);
    let next = ["resume", "stepped.h5", "-q", "--json", "--force", "--until", "1", "--set", "rupture=next_event"];
    let resumed = here.dem_run(&[&next[..], &stop].concat()).json();
    let first = |summary: &Value| summary["failure"]["first_break"].as_f64().expect("a load");
    assert!((first(&resumed) / first(&whole) - 1.0).abs() < 1e-6, "{resumed}");
    assert_eq!(resumed["ending"], "broken_fraction");
}

#[test]
fn a_resumed_run_goes_on_to_the_same_events() {
    let here = Folder::new();
    let scene = config("compression.json");
    let stop = ["--set", "stop={\"broken_fraction\": 0.03}"];
    let run = |file: &str, more: &[&str]| {
        here.dem_run(&[&["run", &scene, "-o", file, "-q"][..], &SMALL, &NEXT, more].concat()).succeeds();
    };
    run("whole.h5", &[]);
    run("parts.h5", &stop);
    here.dem_run(&["resume", "parts.h5", "--set", "stop=null", "-q"]).succeeds();
    let name = |grain: i32| grain as usize;
    assert_eq!(events(&here, "whole.h5", name), events(&here, "parts.h5", name));
}

/// A force on a grain, 100 N/s, breaks a bond of 10 N: at 10 N from break to break, else in the
/// step whose middle is the first beyond.
#[test]
fn the_strength_of_a_pair_is_the_load_of_its_break() {
    let here = Folder::new();
    let scene = config("two-grains.json");
    for (more, load) in [(&[][..], 10.005), (&["--set", "time.step=1e-2"], 10.5), (&NEXT, 10.0)] {
        here.dem_run(&[&["run", &scene, "-o", "run.h5", "--force", "-q"], more].concat()).succeeds();
        let found = here.dem_post(&["strength", "run.h5", "--json", "--force"]).json();
        let strength = found["runs"][0]["strength"].as_f64().expect("a load");
        assert!((strength / load - 1.0).abs() < 1e-6, "{strength} N, not {load} N");
    }
}

/// Their times are those of a ramp that the loads do not follow.
#[test]
fn runs_with_unlike_steps_are_compared_step_by_step() {
    let here = Folder::new();
    here.write("row.json", row(5, 5.0).to_string());
    for (file, step) in [("a.h5", "time.step=1e-3"), ("b.h5", "time.step=4e-4")] {
        here.dem_run(&["run", "row.json", "-o", file, "-q", "--set", step, "--set", "stop=null"]).succeeds();
    }
    let found = here.dem_post(&["compare", "a.h5", "b.h5", "--json"]).json();
    let gaps = found["gaps"].as_array().expect("a list");
    assert_eq!(gaps.len(), here.history("a.h5").frames());
    assert!(gaps.iter().all(|gap| gap["frames"][0] == gap["frames"][1]), "{found}");
    assert_eq!((&found["ends"][0], &found["parting"]), (&found["ends"][1], &Value::Null));
}

/// Where bonds break at the end of a step, its frame still has their contacts.
#[test]
fn a_history_in_which_bonds_break_at_the_end_of_a_step_is_sound() {
    let here = Folder::new();
    let sets = ["--set", "rupture=end_of_step", "--set", "output.every_steps=1"];
    here.dem_run(&[&["run", &config("two-grains.json"), "-o", "run.h5", "-q"][..], &sets].concat()).succeeds();
    here.dem_post(&["info", "--check", "run.h5"]).succeeds();
}

/// A row of touching grains of radius 2 mm along x, the first one fixed, the last one pressed with
/// a constant force (N) and pushed sideways ever harder, without a moment on its bond.
fn row(grains: usize, press: f64) -> Value {
    let last = grains - 1;
    let centers: Vec<Value> =
        (0..grains).map(|k| json!({ "center": [4e-3 * k as f64, 0.0], "radius": 2e-3 })).collect();
    json!({
        "dimension": 2,
        "thickness": 0.01,
        "sample": { "grains": centers },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
        "grains": { "fixed": [0], "loads": [
            { "grain": last, "force": [-press, 0] },
            { "grain": last, "force": [0, 1], "torque": [-2e-3], "time": { "ramp": { "rate": 100 } } },
        ] },
        "rupture": "next_event",
        "time": { "step": 1e-3, "end": 1 },
        "output": { "every_steps": 1 },
        "stop": { "broken_fraction": 1.0 / last as f64 },
    })
}

/// Under five normal forces, one of them a pull, a bond breaks on its cone: in shear at T = μ (N +
/// r_coh). In a row of five grains the bond at the fixed end has an arm of three diameters: it
/// breaks by rolling at 3 a T = ν a (N + r_coh).
#[test]
fn the_failure_envelope_of_a_bond_is_its_cone() {
    let here = Folder::new();
    for (grains, slope, mode) in [(2, 0.3, RuptureMode::Shear), (5, 0.1, RuptureMode::Rolling)] {
        for press in [-8.0, 0.0, 5.0, 20.0, 50.0] {
            here.write("row.json", row(grains, press).to_string());
            here.dem_run(&["run", "row.json", "-o", "row.h5", "--force", "--quiet"]).succeeds();
            let ruptures = here.history("row.h5").ruptures().expect("ruptures");
            let [first] = &ruptures[..] else { panic!("{ruptures:?}") };
            assert_eq!((first.mode, first.bond), (mode, 0));
            assert!((first.normal_force - press).abs() < 1e-6, "{first:?}");
            let expected = slope * (press + 10.0);
            assert!((first.tangential_force.abs() / expected - 1.0).abs() < 1e-6, "{expected} N, {first:?}");
        }
    }
}

/// One loose disk on a floor with friction, bonded to a fixed one: a push along the floor that the
/// bond bears, a load of 20 N on the disk, then a growing push.
///
/// While the load is absent the bond bears the whole push; the contact with the floor takes part
/// of what is added later. Springs of both contacts, with Coulomb's law, give 6.364 N; in one go
/// from zero it would be 9.091 N.
#[test]
fn loads_are_followed_in_their_order() {
    let here = Folder::new();
    let disk = |x: f64| json!({ "center": [x, 2e-3], "radius": 2e-3 });
    let push = json!({ "table": [[0, 0], [1, 6], [2, 6], [102, 106]] });
    let load = json!({ "table": [[0, 0], [1, 0], [2, 20], [3, 20]] });
    let scene = json!({
        "dimension": 2, "thickness": 0.01,
        "sample": { "grains": [disk(0.0), disk(4e-3)] },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.5 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3, "shear": 1000, "rolling": 1000 },
        "walls": { "floor": { "shape": { "plane": { "normal": [0, 1], "place": { "at": [0, 0] } } } } },
        "grains": { "fixed": [0], "loads": [
            { "grain": 1, "force": [1, 0], "time": push }, { "grain": 1, "force": [0, -1], "time": load }] },
        "rupture": "next_event",
        "time": { "step": 1e-2, "end": 102 }, "output": { "every_steps": 1 }, "stop": { "broken_fraction": 1 }
    });
    here.write("scene.json", scene.to_string());
    run(&here, "scene.json", &[]);
    let time = series(&here.history("a.h5"), "load_time", &[])[0];
    let push = 6.0 + (time - 2.0);
    assert!((push / 6.364 - 1.0).abs() < 2e-3, "{push} N");
}

/// A lid presses a ball that is bonded to a smaller, fixed one, 2 mm higher than this one. Its bond
/// breaks by rolling at 2 N (0.125 · 10 N · 8 mm over the arm of 5 mm). Then nothing holds it,
/// whatever `time.step` is.
#[test]
fn gaps_stay_open_whatever_the_step() {
    let here = Folder::new();
    for step in [1e-4, 1.0, 10.0] {
        let scene = json!({
            "dimension": 3,
            "sample": { "grains": [
                { "center": [0, 0, 0], "radius": 3e-3 }, { "center": [8e-3, 0, 0], "radius": 5e-3 }] },
            "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0 } },
            "bonds": { "strength": 10, "gap_tolerance": 1e-3, "shear": 0.5, "rolling": 0.125 },
            "walls": { "lid": { "shape": { "plane": { "normal": [0, 0, -1], "place": "seated" } },
                "force": { "ramp": { "rate": 1 } }, "mass": "sample" } },
            "grains": { "fixed": [0] },
            "rupture": "next_event",
            "time": { "step": step, "end": 100 }, "output": { "every_steps": 1 }
        });
        here.write("scene.json", scene.to_string());
        let summary = run(&here, "scene.json", &[]);
        assert_eq!((&summary["ending"], &summary["steps"]), (&json!("no_equilibrium"), &json!(1)), "{step} s");
        let load = number(&summary["failure"]["first_break"]);
        assert!((load / 2.0 - 1.0).abs() < 1e-6, "{load} N at a step of {step} s");
    }
}

/// A packing of spheres is followed to its end, through loads of zero, at which velocities have no
/// size of their own.
#[test]
fn a_packing_of_spheres_is_followed_until_nothing_balances_it() {
    let here = Folder::new();
    let plane = |up: i32| json!({ "plane": { "normal": [0, 0, up], "place": "seated" } });
    let scene = json!({
        "dimension": 3, "seed": 3,
        "sample": { "random": { "count": 60, "diameter": { "uniform": { "min": 2e-3, "max": 3e-3 } },
            "width": 0.01, "depth": 0.01, "preparation": { "compaction": { "solid_fraction": 0.47 } } } },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 5, "gap_tolerance": 0.01, "shear": 0.4, "rolling": 0.15, "twist": 0.1 },
        "walls": { "bottom": { "shape": plane(1) },
            "top": { "shape": plane(-1), "mass": "sample", "force": { "ramp": { "rate": 1 } } } },
        "rupture": "next_event",
        "time": { "step": 1, "end": 100 }, "output": { "every_steps": 1 }
    });
    here.write("scene.json", scene.to_string());
    let summary = run(&here, "scene.json", &[]);
    assert_eq!((&summary["ending"], &summary["missed_tolerance"]), (&json!("no_equilibrium"), &json!(0)));
    let broken: f64 = summary["broken"].as_array().expect("modes").iter().map(number).sum();
    assert!(broken >= 20.0, "{broken} bonds");
}
