//! The commands on small histories whose answers are known.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dem_history::*;

mod check;
mod compare;
mod damage;
mod elastic;
mod emission;
mod envelope;
mod fabric;
mod film;
mod folders;
mod report;
mod report_sweep;
mod solves;
mod view;
mod why;

/// Length of a run, and when its bonds 0 and 1 break, in steps.
#[derive(Clone, Copy)]
struct Course {
    steps: i64,
    breaks: [i64; 2],
}

const COURSE: Course = Course { steps: 100, breaks: [30, 60] };

/// Grains of one radius (m) and of unit mass and inertia.
fn grains(count: usize, radius: f64) -> Grains {
    Grains {
        id: (0..count as i32).collect(),
        radius: vec![radius; count],
        mass: vec![1.0; count],
        inertia: vec![1.0; count],
        material: vec![],
    }
}

/// A square of four bonded grains of radius 1 mm between two walls.
fn layout(dimension: usize) -> Layout {
    let wall = |name: &str, sign: f64, drive| Wall {
        name: name.into(),
        kind: WallKind::Plane,
        normal: [0.0, sign, 0.0],
        radius: 0.0,
        drive,
        direction: if drive == WallDrive::Fixed { [0.0; 3] } else { [0.0, sign, 0.0] },
        ..Wall::default()
    };
    let d = dimension;
    Layout {
        dimension,
        friction: true,
        grains: grains(4, 1e-3),
        walls: vec![wall("bottom", 1.0, WallDrive::Fixed), wall("top", -1.0, WallDrive::Force)],
        bonds: Bonds {
            pair: vec![[0, 1], [1, 2], [2, 3], [3, 0]],
            rest_gap: vec![0.0; 4],
            strength: vec![10.0; 4],
            friction: vec![0.3; 4],
            rolling: vec![],
            twist: None,
            mean_diameter: vec![2e-3; 4],
            formed: None,
        },
        observables: vec![
            Observable::new("wall_position", "m", &[2, d]),
            Observable::new("wall_force", "N", &[2, d]),
            Observable::new("applied_force", "N", &[2]),
            Observable::new("strain", "", &[d, d]),
            Observable::new("stress", "Pa", &[d, d]),
            Observable::new("bonds_broken", "", &[]),
        ],
        parameters: Parameters { scene: "{\"thickness\": 0.5}".into(), ..Parameters::default() },
        ..Layout::default()
    }
}

/// Puts a 2D vector or a diagonal tensor into `d` dimensions.
fn vector(d: usize, y: f64) -> Vec<f64> {
    let mut v = vec![0.0; d];
    v[1] = y;
    v
}

fn tensor(d: usize, yy: f64) -> Vec<f64> {
    let mut t = vec![0.0; d * d];
    t[d + 1] = yy;
    t
}

/// Load 1 N a step up to 100 N; the sample shortens by 1e-3 of its height in each step from step 41
/// on; bond 0 breaks at step 30 and bond 1 at step 60.
fn write(path: &Path, l: &Layout) {
    write_course(path, l, COURSE);
}

fn write_course(path: &Path, l: &Layout, course: Course) {
    let [first, second] = course.breaks;
    let (d, walled, bonded) = (l.dimension, !l.walls.is_empty(), !l.bonds.is_empty());
    let mut writer = Writer::create(path, l, false).unwrap();
    for step in 0..=course.steps {
        let (time, load) = (step as f64 * 1e-3, step as f64);
        let strain = -1e-3 * (step - 40).max(0) as f64;
        let top = 4e-3 * (1.0 + strain);
        for (at, bond, mode) in [(first, 0, RuptureMode::Shear), (second, 1, RuptureMode::Tension)] {
            if step == at && bonded {
                writer.rupture(&rupture(step, time, bond, l.bonds.pair[bond], mode)).unwrap();
            }
        }
        let broken = f64::from(u8::from(step >= first) + u8::from(step >= second));
        let values = [
            vector(d, 0.0),
            vector(d, top),
            vector(d, -load),
            vector(d, load),
            vec![0.0, load],
            tensor(d, strain),
            tensor(d, load / 2e-3),
            vec![broken],
        ];
        if !l.observables.is_empty() {
            writer.observe(step, time, &values.concat()).unwrap();
        }
        if step % 10 == 0 {
            frame(&mut writer, l, course, step, top);
        }
    }
    assert!(walled || l.observables.is_empty());
    writer.finish().unwrap();
}

fn rupture(step: i64, time: f64, bond: usize, pair: [i32; 2], mode: RuptureMode) -> Rupture {
    Rupture {
        step,
        time,
        point: [1e-3, 2e-3, 0.0],
        normal_force: -1.0,
        tangential_force: 3.0,
        moment: 0.0,
        twist: 0.0,
        energy: 0.0,
        round: 0,
        bond: bond as i32,
        pair,
        mode,
    }
}

fn frame(writer: &mut Writer, l: &Layout, course: Course, step: i64, top: f64) {
    let (d, w, load) = (l.dimension, l.walls.len(), step as f64);
    let centre = |x: f64, y: f64| if d == 2 { vec![x, y] } else { vec![x, y, 0.0] };
    let places = [centre(1e-3, 1e-3), centre(3e-3, 1e-3), centre(3e-3, top - 1e-3), centre(1e-3, top - 1e-3)];
    let still = |count: usize| vec![0.0; count * d];
    let mut pair = vec![[3, 0], [2, 1]];
    if w > 0 {
        pair.extend([[0, -1], [3, -2]]);
    }
    let m = pair.len();
    let mut reaction = still(m);
    for c in 0..m {
        reaction[c * d] = if c == 0 { load } else { -0.5 * load };
    }
    let bonded = !l.bonds.is_empty();
    let contacts = ContactRows {
        point: (0..m * d).map(|k| 1e-3 * k as f64 + 1e-6 * load).collect(),
        normal: vector(d, 1.0).repeat(m),
        tangent: if d == 3 { [1.0, 0.0, 0.0].repeat(m) } else { vec![] },
        reaction,
        moment: if bonded { vec![0.0; m * (d - 1 + usize::from(l.twist))] } else { vec![] },
        gap: vec![0.0; m],
        status: vec![ContactStatus::Stick; m],
        bond: if bonded { vec![-1; m] } else { vec![] },
        pair,
    };
    let mut bonds = vec![BondStatus::Intact; l.bonds.len()];
    let [first, second] = course.breaks;
    for (at, bond, status) in [(first, 0, BondStatus::Shear), (second, 1, BondStatus::Tension)] {
        if bonded && step >= at {
            bonds[bond] = status;
        }
    }
    // the upper two move down at 3 m/s
    let velocity = [still(2), vector(d, -3.0), vector(d, -3.0)].concat();
    let turns = |width: usize| (0..if l.rotation { 4 * width } else { 0 }).map(|k| load + k as f64).collect();
    let (angular_velocity, orientation) = (turns(if d == 2 { 1 } else { 3 }), turns(if d == 2 { 1 } else { 4 }));
    let grains = GrainState { position: places.concat(), velocity, angular_velocity, orientation };
    let position = if w > 0 { [vector(d, 0.0), vector(d, top)].concat() } else { vec![] };
    let walls = WallState { position, velocity: still(w), force: still(w) };
    let time = step as f64 * 1e-3;
    writer.frame(&Frame { step, time, grains, walls, contacts, bonds }).unwrap();
}

fn sample(l: &Layout) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    write(&path, l);
    (folder, path)
}

/// Runs `dem-post` in the folder of the history.
fn dem_post(history: &Path, arguments: &[&str]) -> Output {
    let (folder, name) = (history.parent().unwrap(), history.file_name().unwrap());
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    command.current_dir(folder).arg(arguments[0]).arg(name).args(&arguments[1..]).output().unwrap()
}

/// The names of the results in a folder, in order, without the record of their sources.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| name != ".dem-post.json");
    names.sort();
    names
}

fn json(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refused(output: &Output, code: i32, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "{message:?} lacks {word:?}");
    }
}

#[test]
fn every_command_writes_what_it_promises() {
    for dimension in [2, 3] {
        let (folder, path) = sample(&layout(dimension));
        for (command, files) in [
            ("cracks", &["ruptures.csv", "broken.csv", "fragments.csv", "broken", "fragments", "decohesion"][..]),
            ("emission", &["emission-events.csv", "emission-magnitudes.csv", "emission", "emission-magnitudes"]),
            ("chains", &["forces.csv", "distribution.csv", "chains", "distribution", "force-chains"]),
            ("velocities", &["velocities.csv", "velocities"]),
            ("fabric", &["fabric.csv", "fabric", "fabric-stress"]),
            ("stress-strain", &["stress-strain.csv", "force-displacement", "stress-strain"]),
        ] {
            let output = dem_post(&path, &[command]);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            assert!(!output.stdout.is_empty());
            let read = |name: String| std::fs::read(folder.path().join("run-post").join(name)).unwrap();
            for file in files {
                if file.ends_with(".csv") {
                    assert!(read(file.to_string()).iter().filter(|&&b| b == b'\n').count() > 1, "{file}");
                } else {
                    assert!(read(format!("{file}.png")).starts_with(b"\x89PNG"));
                    assert!(String::from_utf8(read(format!("{file}.svg"))).unwrap().starts_with("<svg"));
                }
            }
        }
        let lines = dem_post(&path, &["info"]).stdout.iter().filter(|&&b| b == b'\n').count();
        assert!((15..=22).contains(&lines), "{lines} lines");
    }
}

#[test]
fn collapse_is_read_off_the_curve() {
    let (_folder, path) = sample(&layout(2));
    let output = dem_post(&path, &["stress-strain", "--json", "--quiet", "-o", "here"]);
    assert!(output.stderr.is_empty());
    let found = json(&output);
    let number = |name: &str| found[name].as_f64().unwrap();
    // the strain first exceeds 1e-4 at step 41, and 1e-3 at step 42
    assert_eq!((number("collapse_load"), number("collapse_load_1e3")), (40.0, 41.0));
    assert_eq!(number("collapse_over_cohesion"), 4.0);
    // 5 % of four bonds have broken with the first
    assert_eq!(number("load_at_5_percent_broken"), 30.0);
    assert!(found["peak_load"].is_null());
    assert!((number("height") - 4e-3).abs() < 1e-12);
    assert!((number("area") - 4e-3 * 0.5).abs() < 1e-12);
    // 60 steps of 4e-6 m, under 41 to 100 N
    assert!((number("work") - 60.0 * 4e-6 * 70.5).abs() < 1e-12, "{}", number("work"));
    assert!((number("final_strain") - 0.06).abs() < 1e-12);
    assert!(path.with_file_name("here").join("stress-strain.csv").exists());
}

#[test]
fn a_collapse_before_any_break_is_the_solver_s() {
    let (_folder, path) = sample(&layout(2));
    let collapse = |path: &Path| {
        let found = json(&dem_post(path, &["stress-strain", "--json"]));
        (found["first_break"].as_f64(), found["collapse_early"].clone(), dem_post(path, &["stress-strain"]).stdout)
    };
    let own = |text: &[u8]| String::from_utf8_lossy(text).matches("before any bond broke").count();
    let (first, early, text) = collapse(&path);
    assert_eq!((first, early, own(&text)), (Some(30.0), serde_json::json!([false, false]), 0));

    // its strain exceeds 1e-4 at step 41, and 1e-3 at step 42
    let late = |elastic: bool, breaks: [i64; 2]| {
        let path = path.with_file_name("late.h5");
        std::fs::remove_file(&path).ok();
        let mut l = layout(2);
        if elastic {
            l.parameters.scene = r#"{"thickness": 0.5, "bonds": {"stiffness": {"young": {}}}}"#.into();
        }
        write_course(&path, &l, Course { breaks, ..COURSE });
        collapse(&path)
    };
    let (first, early, text) = late(false, [42, 60]);
    assert_eq!((first, early, own(&text)), (Some(42.0), serde_json::json!([true, false]), 1));
    let level = |name: &str| std::fs::read_to_string(path.with_file_name("late-post").join(name)).unwrap();
    assert!(!level("force-displacement.svg").contains("at strain"));
    // elastic bonds yield before they break: that is no collapse
    let (_, early, text) = late(true, [50, 60]);
    assert_eq!(early, serde_json::json!([false, false]));
    assert_eq!(String::from_utf8_lossy(&text).matches("none: the sample strained elastically").count(), 2);
    assert!(!level("force-displacement.svg").contains("at strain"));
}

#[test]
fn a_wall_that_moves_needs_no_prescribed_force() {
    let mut moved = layout(2);
    moved.walls[1].drive = WallDrive::Velocity;
    let (_folder, path) = sample(&moved);
    let found = json(&dem_post(&path, &["stress-strain", "--json"]));
    assert_eq!(found["collapse_load"], 40.0);
    assert!(found["final_displacement"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_wall_that_moves_loads_with_the_force_before_the_breaks_of_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let mut l = layout(2);
    l.walls[1].drive = WallDrive::Velocity;
    l.observables.push(Observable::new("wall_force_at_limit", "N", &[2, 2]));
    let mut writer = Writer::create(&path, &l, false).unwrap();
    frame(&mut writer, &l, COURSE, 0, 4e-3);
    // the bond breaks in step 3 at 30 N, and 1 N remains
    for (step, acted, left, broken) in [(1, 10.0, 10.0, 0.0), (2, 20.0, 20.0, 0.0), (3, 30.0, 1.0, 1.0)] {
        let top = 4e-3 - 1e-6 * step as f64;
        let (zeros, still) = ([0.0; 4], [0.0, 0.0]);
        let (force, applied) = ([0.0, -left, 0.0, left], [0.0, left]);
        let row = [&[0.0, 0.0, 0.0, top], &force[..], &applied, &zeros, &zeros, &[broken], &still, &[0.0, acted]];
        writer.observe(step, step as f64 * 1e-3, &row.concat()).unwrap();
    }
    frame(&mut writer, &l, COURSE, 3, 4e-3 - 3e-6);
    writer.finish().unwrap();
    let found = json(&dem_post(&path, &["stress-strain", "--json"]));
    assert_eq!((&found["first_break"], &found["load_at_5_percent_broken"]), (&30.0.into(), &30.0.into()));
    assert_eq!(found["greatest_load"], 30.0);
    // the work is that of the force at the end of the step
    assert!((found["work"].as_f64().unwrap() - 31e-6).abs() < 1e-12, "{}", found["work"]);
}

/// 10 N are prescribed in steps 1 and 2, a velocity in step 3, in which a bond breaks.
#[test]
fn the_load_of_a_wall_is_that_of_the_drive_of_each_step() {
    for first in [WallDrive::Force, WallDrive::Velocity] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.h5");
        let mut l = layout(2);
        l.walls[1].drive = first;
        l.observables.push(Observable::new("wall_force_at_limit", "N", &[2, 2]));
        l.observables.push(Observable::new("wall_load", "N", &[2]));
        let mut writer = Writer::create(&path, &l, false).unwrap();
        frame(&mut writer, &l, COURSE, 0, 4e-3);
        for (step, load, applied, left, limit) in
            [(1, 10.0, 10.0, 8.0, 8.0), (2, 10.0, 10.0, 9.0, 9.0), (3, 30.0, 1.0, 1.0, 30.0)]
        {
            let top = 4e-3 - 1e-6 * step as f64;
            let broken = if step == 3 { 1.0 } else { 0.0 };
            let (walls, tensors) = ([0.0, 0.0, 0.0, top, 0.0, -left, 0.0, left, 0.0, applied], [0.0; 8]);
            let row = [&walls[..], &tensors, &[broken, 0.0, 0.0, 0.0, limit, 0.0, load]].concat();
            writer.observe(step, step as f64 * 1e-3, &row).unwrap();
        }
        frame(&mut writer, &l, COURSE, 3, 4e-3 - 3e-6);
        writer.finish().unwrap();
        let found = json(&dem_post(&path, &["stress-strain", "--json"]));
        assert_eq!((&found["first_break"], &found["greatest_load"]), (&30.0.into(), &30.0.into()), "{first:?}");
        // the work is that of the driving force: 10 N, 10 N, and 1 N at the end of step 3
        assert!((found["work"].as_f64().unwrap() - 21e-6).abs() < 1e-12, "{first:?}: {}", found["work"]);
        assert!(dem_post(&path, &["stress-strain"]).status.success());
        let csv = std::fs::read_to_string(path.with_file_name("run-post").join("stress-strain.csv")).unwrap();
        let loads: Vec<f64> = csv.lines().filter_map(|line| line.split(',').nth(3)?.parse().ok()).collect();
        assert_eq!(loads, [10.0, 10.0, 30.0], "{first:?}");
    }
}

#[test]
fn the_load_wall_is_the_one_asked_for_or_that_of_the_scene() {
    let scene = |more: &str| {
        let mut l = layout(2);
        l.walls[0] = Wall { drive: WallDrive::Force, direction: [0.0, 1.0, 0.0], ..l.walls[0].clone() };
        l.parameters.scene = format!("{{\"thickness\": 0.5{more}}}");
        sample(&l)
    };
    let wall = |path: &Path, arguments: &[&str]| {
        json(&dem_post(path, &[&["stress-strain", "--json"], arguments].concat()))["wall"].clone()
    };
    let (_folder, path) = scene("");
    for command in ["stress-strain", "report", "strength"] {
        refused(&dem_post(&path, &[command]), 2, &["several walls are driven", "--wall: bottom, top"]);
    }
    assert!(!path.with_file_name("run-post").exists());
    assert_eq!(wall(&path, &["--wall", "top"]), "top");
    assert!(dem_post(&path, &["report", "--wall", "top"]).status.success());
    let travel = r#", "stop": {"wall_travel": {"wall": "top"}}"#;
    let (_folder, path) = scene(travel);
    assert_eq!((wall(&path, &[]), wall(&path, &["--wall", "bottom"])), ("top".into(), "bottom".into()));
    let (_folder, path) = scene(&format!("{travel}, \"load_wall\": \"bottom\""));
    assert_eq!(wall(&path, &[]), "bottom");
    assert_eq!(json(&dem_post(&path, &["info", "--json"]))["load_wall"], "bottom");
}

#[test]
fn cracks_count_bonds_and_pieces() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["cracks", "--json", "--times", "0.03,0.1"]));
    assert_eq!(found["broken"], serde_json::json!({"tension": 1, "shear": 1, "rolling": 0, "twist": 0}));
    assert_eq!(found["first_break"], 0.03);
    // two bonds of a ring leave two pieces: 1 alone, and 2–3–0
    let last = found["fragments"].as_array().unwrap().last().unwrap();
    assert_eq!((&last["count"], &last["largest"]), (&2.into(), &3.into()));
    assert_eq!(last["largest_mass_fraction"], 0.75);
}

#[test]
fn chains_tell_compression_from_tension() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["chains", "--json", "--times", "0.1"]));
    let network = &found["networks"][0];
    assert_eq!((&network["contacts"], &network["in_tension"], &network["strong"]), (&4.into(), &3.into(), &1.into()));
    assert_eq!(network["mean"], 62.5);
}

#[test]
fn what_a_scene_lacks_is_named() {
    let mut loose = layout(2);
    loose.bonds = Bonds::default();
    let (_folder, path) = sample(&loose);
    refused(&dem_post(&path, &["cracks"]), 2, &["run.h5", "bonds"]);
    let free = Layout { walls: vec![], observables: vec![], ..layout(2) };
    let (folder, path) = sample(&free);
    refused(&dem_post(&path, &["stress-strain"]), 2, &["driven wall"]);
    refused(&dem_post(&path, &["chains", "--times", "0"]), 2, &["no contact carries a normal force"]);
    // no temporary files remain
    assert!(!folder.path().join("run-post").exists());
    let unobserved = Layout { observables: vec![], ..layout(2) };
    let (_folder, path) = sample(&unobserved);
    refused(&dem_post(&path, &["stress-strain"]), 2, &["wall_position"]);
    assert!(dem_post(&path, &["cracks"]).status.success());
    assert!(dem_post(&path, &["info"]).status.success());
}

#[test]
fn wrong_arguments_are_refused() {
    let (_folder, path) = sample(&layout(2));
    for times in ["7", "-1"] {
        let times = format!("--times={times}");
        refused(&dem_post(&path, &["cracks", &times]), 2, &["--times", "0 s to 0.1 s"]);
    }
    refused(&dem_post(&path, &["cracks", "--times=nan"]), 2, &["--times", "a time in s"]);
    refused(&dem_post(&path, &["stress-strain", "--wall", "bottom"]), 2, &["top"]);
    refused(&dem_post(&path, &["cracks", "--tims", "1"]), 2, &["--times"]);
}

#[test]
fn wrong_files_are_refused() {
    let (folder, path) = sample(&layout(2));
    let bytes = std::fs::read(&path).unwrap();
    let file = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    let foreign = folder.path().join("foreign.h5");
    hdf5::File::create(&foreign).unwrap();
    for command in [
        "info",
        "cracks",
        "emission",
        "chains",
        "velocities",
        "fabric",
        "frames",
        "film",
        "report",
        "stress-strain",
        "view",
    ] {
        refused(&dem_post(&folder.path().join("none.h5"), &[command]), 4, &["none.h5", "does not exist"]);
        refused(&dem_post(&file("text.h5", b"x,y\n"), &[command]), 4, &["text.h5", "not an HDF5 file"]);
        refused(&dem_post(&file("cut.h5", &bytes[..bytes.len() / 2]), &[command]), 4, &["cut.h5", "truncated"]);
        refused(&dem_post(&foreign, &[command]), 4, &["foreign.h5", "not a history"]);
    }
    let output = file("taken", b"");
    refused(&dem_post(&path, &["cracks", "-o", output.to_str().unwrap()]), 4, &["taken"]);
}

#[test]
fn cracks_are_lines_with_ends_and_fronts() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["cracks", "--json"]));
    // neighbouring bonds of a ring share the void in its middle: one crack of two facets of one
    // diameter, at right angles
    let cracks = found["cracks"].as_array().unwrap();
    assert_eq!(cracks.len(), 1);
    let number = |name: &str| cracks[0][name].as_f64().unwrap();
    assert_eq!((number("bonds"), number("path_bonds"), number("first"), number("last")), (2.0, 2.0, 0.03, 0.06));
    assert!((number("path_length") - 4e-3).abs() < 1e-12);
    assert!((number("tortuosity") - 2f64.sqrt()).abs() < 1e-9);
    let fronts = found["fronts"].as_array().unwrap();
    assert_eq!((fronts.len(), fronts[0]["front_speed"].is_null()), (2, true));
    // from the first break on the crack only grows
    assert!(fronts[1]["front"].as_f64() >= fronts[0]["front"].as_f64());
    for file in ["cracks.csv", "crack-segments.csv", "crack-front.csv", "cracks.png", "crack-front.svg"] {
        assert!(path.with_file_name("run-post").join(file).exists(), "{file}");
    }
    // in 3D ruptures are listed, and no lines
    let (_folder, path) = sample(&layout(3));
    let found = json(&dem_post(&path, &["cracks", "--json"]));
    assert_eq!((found["broken"]["shear"].as_u64(), found["cracks"].as_array().unwrap().len()), (Some(1), 0));
}

#[test]
fn velocities_are_those_of_the_frame() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["velocities", "--json", "--times", "0.05"]));
    let field = &found["fields"][0];
    assert_eq!((&field["mean_speed"], &field["greatest_speed"]), (&1.5.into(), &3.0.into()));
    // ½ · 2 kg · 9 m²/s²
    assert_eq!((&field["kinetic_energy"], &field["drift"]), (&9.0.into(), &serde_json::json!([0.0, -1.5])));
}

#[test]
fn frames_are_numbered_and_alike() {
    let (_folder, path) = sample(&layout(2));
    // the header of a PNG holds its size
    let size = |path: PathBuf| {
        let png = std::fs::read(path).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
        [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
    };
    for subject in ["bonds", "forces", "speed"] {
        let output = dem_post(&path, &["frames", "--draw", subject, "--every", "4", "-o", subject, "--quiet"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stderr.is_empty());
        let folder = path.with_file_name(subject);
        // frames 0, 4, 8 of eleven, and the last
        assert_eq!(names(&folder).len(), 4);
        let sizes: Vec<_> = (0..4).map(|k| size(folder.join(format!("frame-{k:05}.png")))).collect();
        assert!(sizes.iter().all(|size| *size == sizes[0] && size[0] % 2 == 0 && size[1] % 2 == 0), "{sizes:?}");
    }
    // a shorter series removes the pictures of the longer one
    let pictures = || names(&path.with_file_name("speed")).len();
    assert_eq!(pictures(), 4);
    let shorter = dem_post(&path, &["frames", "--draw", "speed", "--times", "0.05", "-o", "speed", "--quiet"]);
    assert_eq!((shorter.status.code(), pictures()), (Some(0), 1));
    refused(&dem_post(&path, &["frames", "--every", "0"]), 2, &["--every"]);
    refused(&dem_post(&path, &["frames", "--every", "2", "--times", "0.1"]), 2, &["--times"]);
    let mut loose = layout(2);
    loose.bonds = Bonds::default();
    let (_folder, path) = sample(&loose);
    refused(&dem_post(&path, &["frames"]), 2, &["no bonds", "--draw forces"]);
}

#[test]
fn figures_have_the_width_that_was_asked_for() {
    let (folder, path) = sample(&layout(2));
    let read = |file: &str| std::fs::read(folder.path().join("run-post").join(file)).unwrap();
    let output = dem_post(&path, &["stress-strain", "--width", "85mm", "--dpi", "300"]);
    assert!(output.status.success() && !String::from_utf8_lossy(&output.stderr).contains("letters"));
    for file in ["force-displacement", "stress-strain"] {
        let svg = String::from_utf8(read(&format!("{file}.svg"))).unwrap();
        assert!(svg.contains("width=\"85.000mm\""), "{}", &svg[..200]);
        let png = read(&format!("{file}.png"));
        let pixels = u32::from_be_bytes(png[16..20].try_into().unwrap());
        assert!(pixels.abs_diff(1004) <= 2, "{pixels} pixels are not 85 mm at 300 dpi");
    }
    // three panels beside each other: smaller letters are told, in one panel they are large enough
    let told = |options: &[&str]| {
        let output = dem_post(&path, &[&["velocities", "--width", "85mm"], options].concat());
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).contains("warning: velocities: letters of ")
    };
    assert!(told(&[]) && !told(&["--times", "0.05"]));
    refused(&dem_post(&path, &["chains", "--width", "5cm"]), 2, &["--width", "85mm"]);
    refused(&dem_post(&path, &["chains", "--width", "3mm"]), 2, &["40mm to 2000mm"]);
}
