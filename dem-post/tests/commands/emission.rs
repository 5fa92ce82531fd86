//! `dem-post emission` on ruptures that are known.

use super::*;

/// A history of elastic or rigid bonds in which bond k of a chain breaks at step `steps[k]`.
fn chain(steps: &[i64], energy: f64) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let count = steps.len() + 1;
    let mut l = layout(2);
    l.observables.clear();
    l.walls.clear();
    l.grains = grains(count, 1e-3);
    let bonds = steps.len();
    l.bonds = Bonds {
        pair: (0..bonds as i32).map(|k| [k, k + 1]).collect(),
        rest_gap: vec![0.0; bonds],
        strength: vec![10.0; bonds],
        friction: vec![0.3; bonds],
        rolling: vec![],
        twist: None,
        mean_diameter: vec![2e-3; bonds],
        formed: None,
    };
    let mut writer = Writer::create(&path, &l, false).unwrap();
    let frame = |step: i64| Frame {
        step,
        time: step as f64 * 1e-3,
        grains: GrainState {
            position: (0..count).flat_map(|k| [2e-3 * k as f64, 0.0]).collect(),
            velocity: vec![0.0; 2 * count],
            ..GrainState::default()
        },
        bonds: steps.iter().map(|&at| if at > step { BondStatus::Intact } else { BondStatus::Tension }).collect(),
        ..Frame::default()
    };
    writer.frame(&frame(0)).unwrap();
    let mut order: Vec<usize> = (0..bonds).collect();
    order.sort_by_key(|&bond| steps[bond]);
    for bond in order {
        let (step, pair) = (steps[bond], l.bonds.pair[bond]);
        let place = [2e-3 * bond as f64, 0.0, 0.0];
        let own = rupture(step, step as f64 * 1e-3, bond, pair, RuptureMode::Tension);
        writer.rupture(&Rupture { point: place, energy, ..own }).unwrap();
    }
    let last = steps.iter().max().unwrap() + 1;
    writer.frame(&frame(last)).unwrap();
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn events_have_their_bonds_energies_and_magnitudes() {
    // three bonds in a row in steps 5 to 7, and one far away in step 6
    let (_folder, path) = chain(&[5, 6, 7, 90, 91, 92, 93, 6], 4e-3);
    let found = json(&dem_post(&path, &["emission", "--json"]));
    let events = found["events"].as_array().unwrap();
    let of = |name: &str| events.iter().map(|e| e[name].as_f64().unwrap()).collect::<Vec<_>>();
    assert_eq!((of("step"), of("bonds")), (vec![5.0, 6.0, 90.0], vec![3.0, 1.0, 4.0]));
    assert_eq!(of("rounds"), [3.0, 1.0, 4.0]);
    let near = |found: f64, known: f64| assert!((found - known).abs() < 1e-12, "{found} is not {known}");
    near(of("duration")[0], 2e-3);
    near(of("energy")[0], 1.2e-2);
    near(of("magnitude")[0], 1.2e-2f64.log10() * 2.0 / 3.0);
    near(of("radius")[0], 2e-3 * (2.0f64 / 3.0).sqrt());
    near(events[0]["place"][0].as_f64().unwrap(), 2e-3);
    // no driven wall: no load, and the reason
    assert!(events[0]["load"].is_null() && found["load_note"].as_str().unwrap().contains("driven wall"));
    // three events are too few for a b-value
    assert!(found["b_value"].is_null() && found["b_note"].as_str().unwrap().contains("fewer than 10"), "{found}");

    // with the steps and the bonds between them all is one event
    let wide = json(&dem_post(&path, &["emission", "--json", "--steps", "90", "--reach", "4", "--magnitude", "size"]));
    assert_eq!((wide["events"].as_array().unwrap().len(), &wide["magnitude"]), (1, &"size".into()));
    near(wide["events"][0]["magnitude"].as_f64().unwrap(), 8f64.log10());
    let single = json(&dem_post(&path, &["emission", "--json", "--steps", "0", "--reach", "0"]));
    assert_eq!(single["events"].as_array().unwrap().len(), 8);
}

#[test]
fn a_catalogue_of_sizes_has_its_b_value() {
    // runs of n bonds, each at one step, with an intact stretch of time between them
    let sizes = [1, 1, 2, 1, 1, 5, 1, 3, 1, 1, 2, 1];
    let steps: Vec<i64> = sizes.iter().enumerate().flat_map(|(k, &n)| vec![10 * k as i64 + 1; n]).collect();
    let (_folder, path) = chain(&steps, 0.0);
    let found = json(&dem_post(&path, &["emission", "--json"]));
    assert_eq!((&found["magnitude"], &found["completeness"]), (&"size".into(), &0.0.into()));
    let law = &found["b_value"];
    let b = law["b"].as_f64().unwrap();
    // the likelihood of all twelve, −α Σ ln n − 12 ln ζ(α), has its maximum there
    let logs: f64 = sizes.iter().map(|&n| (n as f64).ln()).sum();
    let likelihood = |alpha: f64| {
        let many: f64 = 1e5;
        let head: f64 = (1..100_000).rev().map(|n| f64::from(n).powf(-alpha)).sum();
        let zeta = head + many.powf(1.0 - alpha) / (alpha - 1.0) + 0.5 * many.powf(-alpha);
        -alpha * logs - 12.0 * zeta.ln()
    };
    let [below, at, above] = [-1e-3, 0.0, 1e-3].map(|off| likelihood(1.0 + b + off));
    assert!(below < at && above < at, "{below} {at} {above}: {b}");
    assert_eq!(law["events"], 12);
    let csv = |name: &str| std::fs::read_to_string(path.with_file_name("run-post").join(name)).unwrap();
    assert_eq!(csv("emission-events.csv").lines().count(), 13);
    let table = csv("emission-magnitudes.csv");
    assert!(table.lines().nth(1).unwrap().starts_with("0,8,12,12"), "{table}");
    assert!(csv("emission-b-values.csv").lines().nth(1).unwrap().starts_with("0,12,"));
}

#[test]
fn wrong_options_of_emission_are_refused() {
    let (_folder, path) = chain(&[5, 6], 0.0);
    refused(&dem_post(&path, &["emission", "--magnitude", "energy"]), 2, &["run.h5", "rigid", "--magnitude size"]);
    for bin in ["0", "-1", "nan", "inf"] {
        refused(&dem_post(&path, &["emission", &format!("--bin={bin}")]), 2, &["--bin", "0.1"]);
    }
    refused(&dem_post(&path, &["emission", "--completeness", "nan"]), 2, &["--completeness"]);
    refused(&dem_post(&path, &["emission", "--wall", "top"]), 2, &["driven wall"]);
    let mut loose = layout(2);
    loose.bonds = Bonds::default();
    let (_folder, path) = sample(&loose);
    refused(&dem_post(&path, &["emission"]), 2, &["run.h5", "bonds.gap_tolerance"]);
}

#[test]
fn the_load_of_an_event_is_that_of_its_step() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["emission", "--json"]));
    let events = found["events"].as_array().unwrap();
    // one newton a step
    let loads: Vec<f64> = events.iter().map(|e| e["load"].as_f64().unwrap()).collect();
    assert_eq!(loads, [30.0, 60.0]);
    let text = String::from_utf8(dem_post(&path, &["emission"]).stdout).unwrap();
    assert!(
        text.contains("steps apart: at most 1; bonds between: at most 1") && text.contains("rigid bonds"),
        "{text}"
    );
}

#[test]
fn an_event_has_no_load_that_its_breaks_have_reduced() {
    // a wall that is moved, without its force before the breaks of a step
    let mut moved = layout(2);
    moved.walls[1].drive = WallDrive::Velocity;
    let (_folder, path) = sample(&moved);
    let found = json(&dem_post(&path, &["emission", "--json"]));
    assert_eq!(found["events"].as_array().unwrap().len(), 2);
    assert!(found["events"].as_array().unwrap().iter().all(|event| event["load"].is_null()), "{found}");
    assert!(found["load_note"].as_str().unwrap().contains("no wall_force_at_limit of wall top"), "{found}");
}
