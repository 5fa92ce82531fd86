//! What cohesion does to a sample in compression: the load at failure, and the bonds that are
//! broken at one time.

use crate::common::Folder;

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
