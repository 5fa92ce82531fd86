//! What cohesion does to a sample in compression: the load at failure, and the bonds that are
//! broken at one time.

use crate::common::{Folder, config, run, sets};

/// Largest over least.
fn spread(values: &[f64]) -> f64 {
    let (least, most) = values.iter().fold((f64::INFINITY, 0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    most / least
}

/// Without gravity three cohesions under ramps that are scaled by them are one problem in larger
/// numbers, up to the motion of what came loose.
#[test]
fn the_load_at_failure_is_proportional_to_the_cohesion() {
    let (mut first, mut broken) = (Vec::new(), Vec::new());
    for cohesion in [5.0, 10.0, 20.0] {
        let strength = format!("bonds.strength={cohesion}");
        let rate = format!("walls.top.force_rate={}", 20.0 * cohesion);
        let set = ["--quiet", "--set", &strength, "--set", &rate, "--set", "stop.broken_fraction=0.05"];
        let summary = Folder::new().run_config("compression.json", &set);
        let over_cohesion =
            |name: &str| summary["failure"][name].as_f64().unwrap_or_else(|| panic!("no {name}: {summary}")) / cohesion;
        first.push(over_cohesion("first_break"));
        broken.push(over_cohesion("broken_share"));
    }
    println!("first break over cohesion {first:.4?}, 5 % broken over cohesion {broken:.4?}");
    assert!(spread(&first) < 1.001, "first break over cohesion for 5, 10, 20 N: {first:?}");
    assert!(spread(&broken) < 1.005, "load with 5 % broken over cohesion for 5, 10, 20 N: {broken:?}");
}

/// Figure 6: at one time of one ramp the decohesion is the wider the weaker the bonds are.
#[test]
fn weaker_bonds_have_broken_in_larger_numbers_at_one_time() {
    let broken: Vec<u64> = [5.0, 10.0, 20.0]
        .map(|cohesion| {
            let strength = format!("bonds.strength={cohesion}");
            // one ramp, 60 N at the end; no stop at collapse
            let set = ["--quiet", "--set", &strength, "--set", "time.end=0.3", "--set", "stop=null"];
            let summary = Folder::new().run_config("compression.json", &set);
            summary["broken"].as_array().expect("a number for each mode").iter().filter_map(|n| n.as_u64()).sum()
        })
        .to_vec();
    assert!(broken[0] >= broken[1] && broken[1] >= broken[2] && broken[0] > broken[2], "5, 10, 20 N: {broken:?}");
}

/// Which bond broke in which step and round does not depend on the tolerance, also with gravity,
/// which the packings are made without: loose grains fall there and hit the sample.
#[test]
fn with_gravity_the_same_bonds_break_at_all_tolerances() {
    for (seed, until, least) in [("seed=1", "time.end=0.0115", 12), ("seed=7", "time.end=0.007", 20)] {
        let [coarse, fine] = ["solver.tolerance=1e-8", "solver.tolerance=1e-10"].map(|tolerance| {
            let here = Folder::new();
            let args = sets(&[
                "sample.random.count=100",
                "sample.random.width=0.018",
                "sample.random.preparation.compaction.solid_fraction=0.79",
                "gravity=[0,-9.81]",
                seed,
                until,
                tolerance,
            ]);
            run(&here, &config("compression.json"), &args);
            let ruptures = here.history("a.h5").ruptures().expect("ruptures");
            ruptures.iter().map(|r| (r.step, r.round, r.bond)).collect::<Vec<_>>()
        });
        assert!(fine.len() >= least, "{seed}: {fine:?}");
        assert_eq!(coarse[..least], fine[..least], "{seed}");
    }
}
