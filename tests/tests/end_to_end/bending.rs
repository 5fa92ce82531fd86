//! The beam in three-point bending: where the force goes, where the crack starts and how it runs
//! (Guessasma & Fortin 2011, figures 10 and 11), asserted on numbers.

use crate::common::{Folder, sets, wall};
use dem_run::history::{History, Rupture};

/// Diameter of the disks, middle of the beam and height of its upper face (m).
const DIAMETER: f64 = 4e-3;
const MIDDLE: f64 = 0.42;
const HEIGHT: f64 = 0.0698;
/// The loader and the two supports.
const POINTS: [[f64; 2]; 3] = [[MIDDLE, HEIGHT], [0.058, 0.0], [0.782, 0.0]];

/// Mean vertical force of the contacts within three diameters of each point, over its mean in the
/// whole beam. Bending loads every contact along the beam; what goes from the loader to the
/// supports is vertical.
fn concentration(history: &History, frame: usize) -> [f64; 3] {
    let contacts = history.contacts(frame).expect("contacts");
    let vertical = |c: usize| {
        let ([rn, rt], normal) = ([contacts.reaction[2 * c], contacts.reaction[2 * c + 1]], &contacts.normal[2 * c..]);
        (rn * normal[1] + rt * normal[0]).abs()
    };
    let mean = |contacts: &[usize]| contacts.iter().map(|c| vertical(*c)).sum::<f64>() / contacts.len() as f64;
    let all: Vec<usize> = (0..contacts.len()).collect();
    POINTS.map(|point| {
        let near = |c: &usize| {
            let x = &contacts.point[2 * c..2 * c + 2];
            (x[0] - point[0]).hypot(x[1] - point[1]) <= 3.0 * DIAMETER
        };
        let near: Vec<usize> = all.iter().copied().filter(near).collect();
        assert!(near.len() > 10, "{} contacts near {point:?}", near.len());
        mean(&near) / mean(&all)
    })
}

/// Force of the supports upwards on the beam (N).
fn support(history: &History, frame: usize) -> f64 {
    let force = history.wall_state(frame).expect("state").force;
    let vertical = |name| -force[2 * wall(history, name) + 1];
    vertical("left") + vertical("right")
}

#[test]
fn an_elastic_beam_cracks_from_its_lower_face_up_the_middle() {
    let here = Folder::new();
    here.run_config("bending-elastic.json", &["-o", "a.h5", "--quiet", "--set", "time.end=0.168"]);
    let history = here.history("a.h5");
    let ruptures: Vec<Rupture> = history.ruptures().expect("ruptures");
    assert!(ruptures.len() > 100, "{} ruptures", ruptures.len());

    // the first bond that breaks is the one at the lower face under the load
    let first = &ruptures[0];
    assert!((first.point[0] - MIDDLE).abs() < 0.5 * DIAMETER && first.point[1] < DIAMETER, "{:?}", first.point);
    assert!((ruptures[1].step, ruptures[1].round) != (first.step, first.round), "it broke alone");

    // the crack stays in the middle, and each tenth of its breaks lies above the tenth before
    let spread = ruptures.iter().map(|r| (r.point[0] - MIDDLE).abs()).fold(0.0, f64::max);
    assert!(spread < 0.5 * HEIGHT, "{spread} m from the middle");
    let tenth = ruptures.len() / 10;
    let heights: Vec<f64> =
        ruptures.chunks_exact(tenth).map(|part| part.iter().map(|r| r.point[1]).sum::<f64>() / tenth as f64).collect();
    assert!(heights[..9].windows(2).all(|h| h[1] > h[0]), "{heights:?}");
    let top = ruptures.iter().map(|r| r.point[1]).fold(0.0, f64::max);
    assert!(top > 0.9 * HEIGHT, "up to {top} m");

    // the force concentrates at the loader and the supports, and the supports bear all of the load
    let before = history.frame_at(first.time - 2e-3).expect("a frame");
    let concentrated = concentration(&history, before);
    assert!(concentrated.iter().all(|c| *c > 3.0), "{concentrated:?}");
    let load = 1000.0 * history.times()[before];
    let borne = support(&history, before);
    assert!((borne / load - 1.0).abs() < 0.01, "{borne} N of {load} N");
    // after rupture the halves fly apart, and nothing rests on the supports
    let after = history.frames() - 1;
    let borne = support(&history, after);
    assert!(borne < 0.1 * load, "{borne} N after rupture");
    let concentrated = concentration(&history, after);
    assert!(concentrated[1..].iter().all(|c| *c < 0.5), "{concentrated:?} after rupture");
}

#[test]
fn a_rigid_beam_under_a_slow_force_breaks_first_at_its_lower_face() {
    let here = Folder::new();
    let set = ["-o", "a.h5", "--quiet", "--set", "time.end=0.13"];
    let summary = here.run_config("bending-force.json", &set);
    let history = here.history("a.h5");
    let ruptures = history.ruptures().expect("ruptures");
    let load = summary["failure"]["first_break"].as_f64().expect("a first break");
    assert!((load - 125.75).abs() < 0.05, "{load} N");
    let first: Vec<&Rupture> = ruptures.iter().take_while(|r| r.step == ruptures[0].step).collect();
    for rupture in &first {
        let [x, y, _] = rupture.point;
        assert!((x - MIDDLE).abs() < 2.0 * DIAMETER && y < DIAMETER, "{:?}", rupture.point);
    }
    // the scene is symmetric, and so is what breaks
    let sum: f64 = first.iter().map(|r| r.point[0] - MIDDLE).sum();
    assert!(first.len() == 4 && sum.abs() < 1e-9, "{first:?}");
    let concentrated = concentration(&history, history.frame_at(0.12).expect("a frame"));
    assert!(concentrated.iter().all(|c| *c > 3.0), "{concentrated:?}");
    // every step before it was solved, nearly all with the factor of another
    let before = |name: &str| {
        let all = history.observable(name).expect("read").expect("an observable").value;
        all[..first[0].step as usize - 1].to_vec()
    };
    let largest = |name: &str| before(name).into_iter().fold(0.0, f64::max);
    assert!(largest("solver_residual") <= 1e-8, "{:e}", largest("solver_residual"));
    assert!(largest("solver_load_error") <= 1e-4, "{:e}", largest("solver_load_error"));
    let factorisations = before("solver_factorisations");
    let made: f64 = factorisations.iter().sum();
    assert!(made <= 0.2 * factorisations.len() as f64, "{made} in {} steps", factorisations.len());
}

/// A sixth of the shipped scene: the whole of it takes minutes to pack.
#[test]
fn a_polydisperse_beam_cracks_upwards_through_its_middle() {
    let here = Folder::new();
    let sixth = sets(&[
        "sample.random.count=700",
        "sample.random.width=0.44",
        "walls.left.shape.circle.center=[0.03, -0.1]",
        "walls.right.shape.circle.center=[0.41, -0.1]",
        "walls.loader.shape.circle.center=[0.22, 0.3]",
        "time.end=0.04",
    ]);
    let summary = here.run_config("bending-polydisperse.json", &[&["-o", "a.h5", "--quiet"], &sixth[..]].concat());
    assert_eq!((&summary["rejected"], &summary["missed_tolerance"]), (&0.into(), &0.into()), "{summary}");
    let history = here.history("a.h5");
    let grains = history.grain_state(0).expect("grains");
    let height = grains.position.iter().skip(1).step_by(2).copied().fold(0.0, f64::max);
    let ruptures = history.ruptures().expect("ruptures");
    assert!(ruptures.len() >= 4, "{ruptures:?}");
    assert!(ruptures.iter().all(|r| (r.point[0] - 0.22).abs() < 0.5 * height), "{ruptures:?}");
    // step by step it climbs, from the lower half to the upper face
    let steps = ruptures.chunk_by(|a, b| a.step == b.step);
    let tops: Vec<f64> = steps.map(|step| step.iter().map(|r| r.point[1]).fold(0.0, f64::max)).collect();
    assert!(tops.is_sorted() && tops[0] < 0.5 * height && tops[tops.len() - 1] > 0.9 * height, "{tops:?} of {height}");
}
