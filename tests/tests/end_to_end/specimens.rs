//! Specimens that are cut and split: the Brazilian test in the plane, and a small cylinder through
//! every view.

use crate::common::{Folder, sets};

#[test]
fn a_disk_breaks_first_at_its_loaded_diameter_and_at_a_load_in_proportion_to_the_cohesion() {
    let here = Folder::new();
    let mut steps = vec![];
    for strength in [10, 30] {
        // the ramp is ten times as fast as the scene's: before the first break nothing moves
        let [strength_set, rate] =
            [format!("bonds.strength={strength}"), format!("walls.top.force_rate={}", 200 * strength)];
        let set = ["--set", &strength_set, "--set", &rate, "--set", "time.end=0.0185", "-o", "disk.h5", "--force"];
        here.run_config("brazilian-2d.json", &set);
        let history = here.history("disk.h5");
        let first = &history.ruptures().expect("ruptures")[0];
        let (places, radii) =
            (history.grain_state(0).expect("grains").position, history.grains().expect("grains").radius);
        let ends = |side: f64| {
            let reach = places.chunks(2).zip(&radii).map(|(x, r)| side * x[0] + r);
            side * reach.fold(f64::NEG_INFINITY, f64::max)
        };
        let middle = 0.5 * (ends(1.0) + ends(-1.0));
        assert!((first.point[0] - middle).abs() < 0.1 * 0.041, "{} m off the diameter", first.point[0] - middle);
        steps.push(first.step);
    }
    // of a ramp that is scaled by the cohesion
    assert_eq!(steps[0], steps[1], "steps of the first break");
}

#[test]
fn a_cylinder_of_spheres_breaks_and_its_cracks_are_surfaces() {
    let here = Folder::new();
    let small = sets(&[
        "sample.random.count=120",
        "sample.random.width=0.012",
        "sample.random.preparation.compaction.solid_fraction=0.4",
        "walls.top.force_rate=2000",
        "time.step=1e-4",
        "time.end=0.03",
    ]);
    let summary = here.run_config("cylinder-compression.json", &[&["-o", "cylinder.h5"], &small[..]].concat());
    assert!(summary["bonds"].as_u64().expect("bonds") > 200, "{summary}");
    let found = here.dem_post(&["cracks", "cylinder.h5", "-o", "views", "--json"]).json();
    let surfaces = found["surfaces"].as_array().expect("surfaces");
    assert!(!surfaces.is_empty() && found["cracks"].as_array().expect("lines").is_empty(), "{found}");
    let bonds: u64 = surfaces.iter().map(|crack| crack["bonds"].as_u64().expect("bonds")).sum();
    assert_eq!(bonds, found["events"].as_array().expect("events").len() as u64);
    let facets = String::from_utf8(here.read("views/crack-facets.vtk")).expect("text");
    assert!(facets.starts_with("# vtk DataFile Version 3.0\n") && facets.contains("\nPOLYGONS "), "{facets}");
    for name in [
        "cracks.csv",
        "crack-facets.csv",
        "crack-growth.csv",
        "cracks.png",
        "cracks-along-x.png",
        "decohesion-inside.png",
    ] {
        assert!(here.path("views").join(name).exists(), "{name}");
    }
    // the legend says what the colours show
    let legend = |text: &str| String::from_utf8(here.read("views/cracks.svg")).expect("text").contains(text);
    assert!(legend("broken at t (s)"));
    here.dem_post(&["cracks", "cylinder.h5", "-o", "views", "--colour", "rank"]).succeeds();
    assert!(legend("rank of the break") && !legend("broken at t"));
    here.dem_post(&["report", "cylinder.h5", "-o", "views"]).succeeds();
    here.dem_post(&["view", "cylinder.h5", "-o", "views"]).succeeds();
}
