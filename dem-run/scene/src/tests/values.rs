//! Wrong values: each is found at its place, and all of them at once.

use super::*;

/// One assignment to [`FLAT`], and the only place that is then wrong.
const FLAT_CASES: &[(&str, &str)] = &[
    ("dimension=4", "dimension"),
    ("dimension=1", "dimension"),
    ("thickness=0", "thickness"),
    // the sample
    ("sample={\"grains\": []}", "sample.grains"),
    ("sample.grains.1.radius=-1e-3", "sample.grains.1.radius"),
    ("sample.grains.1.radius=0", "sample.grains.1.radius"),
    ("sample.grains.1.radius=1e-200", "sample.grains.1.radius"),
    ("sample.grains.1.center=[0, 0]", "sample.grains.1.center"),
    ("sample.grains.1.center=[-0.0, 0]", "sample.grains.1.center"),
    ("sample.grains.1.center=[0, 0, 1]", "sample.grains.1.center"),
    ("sample.grains.1.velocity=[0]", "sample.grains.1.velocity"),
    ("sample.grains.1.spin=[0, 0, 1]", "sample.grains.1.spin"),
    ("sample.grains.1.mass=0", "sample.grains.1.mass"),
    ("sample.grains.1.inertia=-1", "sample.grains.1.inertia"),
    ("sample.grains.1.density=0", "sample.grains.1.density"),
    // materials
    ("materials.density=0", "materials.density"),
    ("materials.friction.grain_grain=-0.1", "materials.friction.grain_grain"),
    ("materials.friction.grain_wall=-0.1", "materials.friction.grain_wall"),
    ("materials.restitution.grain_grain=1.1", "materials.restitution.grain_grain"),
    ("materials.restitution.grain_wall=-0.1", "materials.restitution.grain_wall"),
    ("materials.restitution.threshold_speed=-1", "materials.restitution.threshold_speed"),
    // bonds
    ("bonds.strength=-1", "bonds.strength"),
    ("bonds.strength=null", "bonds"),
    ("bonds.stress=1", "bonds"),
    ("bonds.gap_tolerance=-1e-3", "bonds.gap_tolerance"),
    ("bonds.friction=-1", "bonds.friction"),
    ("bonds.shear=-1", "bonds.shear"),
    ("bonds.rolling=-1", "bonds.rolling"),
    (r#"bonds.scatter={"weibull": {"modulus": 0}}"#, "bonds.scatter.weibull.modulus"),
    (r#"bonds.scatter={"normal": {"deviation": 0.6}}"#, "bonds.scatter.normal.deviation"),
    // loads
    ("grains.fixed=[2]", "grains.fixed.0"),
    ("grains.fixed=[1, 1]", "grains.fixed.1"),
    ("grains.loads.0.grain=2", "grains.loads.0.grain"),
    ("grains.loads.0.force=[1]", "grains.loads.0.force"),
    ("grains.loads.0.force=null", "grains.loads.0"),
    ("grains.loads.0.torque=[1, 2, 3]", "grains.loads.0.torque"),
    ("grains.loads.0.time={\"table\": []}", "grains.loads.0.time.table"),
    ("grains.loads.0.time={\"table\": [[0, 1], [0, 2]]}", "grains.loads.0.time.table.1.0"),
    // materials and regions
    ("materials.named=[{\"name\": \"base\"}]", "materials.named.0.name"),
    ("materials.named=[{\"name\": \"a b\"}]", "materials.named.0.name"),
    ("materials.named=[{\"name\": \"a\"}, {\"name\": \"a\"}]", "materials.named.1.name"),
    ("materials.named=[{\"name\": \"a\", \"density\": 0}]", "materials.named.0.density"),
    ("materials.named=[{\"name\": \"a\", \"wall_friction\": -1}]", "materials.named.0.wall_friction"),
    (
        "materials.named=[{\"name\": \"a\", \"regions\": [{\"ball\": {\"center\": [0, 0], \"radius\": 0}}]}]",
        "materials.named.0.regions.0.ball.radius",
    ),
    (
        "materials.named=[{\"name\": \"a\", \"regions\": [{\"box\": {\"from\": [0, 1], \"to\": [1, 0]}}]}]",
        "materials.named.0.regions.0.box.to.1",
    ),
    (
        "materials.named=[{\"name\": \"a\", \"regions\": [{\"half_space\": {\"point\": [0, 1], \"normal\": [0, 0]}}]}]",
        "materials.named.0.regions.0.half_space.normal",
    ),
    ("materials.pairs=[{\"between\": [\"base\", \"stone\"], \"friction\": 0.1}]", "materials.pairs.0.between.1"),
    ("materials.pairs=[{\"between\": [\"base\", \"base\"]}]", "materials.pairs.0"),
    ("materials.pairs=[{\"between\": [\"base\", \"base\"], \"friction\": -0.1}]", "materials.pairs.0.friction"),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"bonds\": {\"shear\": -0.1}}]",
        "materials.pairs.0.bonds.shear",
    ),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"bonds\": {\"twist\": 0.1}}]",
        "materials.pairs.0.bonds.twist",
    ),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"bonds\": {\"scatter\": {\"weibull\": {\"modulus\": 0}}}}]",
        "materials.pairs.0.bonds.scatter.weibull.modulus",
    ),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"bonds\": {\"strength\": 1, \"stress\": 1}}]",
        "materials.pairs.0.bonds",
    ),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"bonds\": {\"stiffness_factor\": 2}}]",
        "materials.pairs.0.bonds.stiffness_factor",
    ),
    (
        "materials.pairs=[{\"between\": [\"base\", \"base\"], \"friction\": 0}, {\"between\": [\"base\", \"base\"], \"friction\": 0}]",
        "materials.pairs.1.between",
    ),
    ("sample.grains.1.material=stone", "sample.grains.1.material"),
    ("bonds.absent=[{\"ball\": {\"center\": [0], \"radius\": 1}}]", "bonds.absent.0.ball.center"),
    ("bonds.list=\"\"", "bonds.list"),
    // walls
    ("walls.bottom.shape.plane.normal=[0, 0]", "walls.bottom.shape.plane.normal"),
    ("walls.bottom.shape.plane.normal=[0, 1, 0]", "walls.bottom.shape.plane.normal"),
    ("walls.bottom.shape.plane.place.at=[0]", "walls.bottom.shape.plane.place.at"),
    ("walls.bottom.friction=-1", "walls.bottom.friction"),
    ("walls.bottom.mass=sample", "walls.bottom.mass"),
    ("walls.bottom.direction=[0, 1]", "walls.bottom.direction"),
    ("walls.roller.shape.circle.radius=0", "walls.roller.shape.circle.radius"),
    ("walls.roller.shape.circle.center=[0, 0, 0]", "walls.roller.shape.circle.center"),
    ("walls.roller.shape={\"sphere\": {\"center\": [0, 0], \"radius\": 1}}", "walls.roller.shape.sphere"),
    ("walls.roller.direction=null", "walls.roller.direction"),
    (
        r#"walls.bottom.shape={"plate": {"normal": [0, 0], "center": [0, 0], "size": [1]}}"#,
        "walls.bottom.shape.plate.normal",
    ),
    (
        r#"walls.bottom.shape={"plate": {"normal": [0, 1], "center": [0], "size": [1]}}"#,
        "walls.bottom.shape.plate.center",
    ),
    (
        r#"walls.bottom.shape={"plate": {"normal": [0, 1], "center": [0, 0], "size": [0]}}"#,
        "walls.bottom.shape.plate.size.0",
    ),
    (
        r#"walls.bottom.shape={"plate": {"normal": [0, 1], "center": [0, 0], "size": [1, 1]}}"#,
        "walls.bottom.shape.plate.size",
    ),
    (
        r#"walls.bottom.shape={"plate": {"normal": [0, 1], "center": [0, 0], "size": [1], "side": [1, 0]}}"#,
        "walls.bottom.shape.plate.side",
    ),
    ("walls.roller.direction=[0, 0]", "walls.roller.direction"),
    ("walls.roller.mass={\"kg\": 1}", "walls.roller.mass"),
    ("walls.top.mass=null", "walls.top.mass"),
    ("walls.top.mass={\"kg\": 0}", "walls.top.mass.kg"),
    ("walls.top.force={\"constant\": 1}", "walls.top"),
    ("walls.top.stress={\"constant\": 1}", "walls.top"),
    ("walls.top.grip=1e-3", "walls.top.grip"),
    ("walls.bottom.grip=0", "walls.bottom.grip"),
    ("walls.roller.stress={\"constant\": 1}", "walls.roller"),
    (r#"walls.top.slide={"direction": [1, 1], "velocity": {"constant": 1}}"#, "walls.top.slide.direction"),
    (r#"walls.top.slide={"direction": [0, 0], "velocity": {"constant": 1}}"#, "walls.top.slide.direction"),
    (r#"walls.top.slide={"direction": [1, 0], "velocity": {"table": []}}"#, "walls.top.slide.velocity.table"),
    (r#"walls.bottom.slide={"direction": [1, 0], "velocity": {"constant": 1}}"#, "walls.bottom.slide"),
    (r#"walls.roller.slide={"direction": [1, 0], "velocity": {"constant": 1}}"#, "walls.roller.slide"),
    // time, output, solver
    ("time.step=0", "time.step"),
    ("time.step=-1e-4", "time.step"),
    ("time.step=1e-300", "time.step"),
    ("time.step=1e-20", "time.step"),
    ("time.end=1e61", "time.end"),
    ("gravity=[0, -1e61]", "gravity.1"),
    ("time.end=0", "time.end"),
    ("output.every_steps=0", "output.every_steps"),
    ("output.interval=1", "output"),
    ("output={\"interval\": 1e-5}", "output.interval"),
    ("output={}", "output"),
    ("solver.tolerance=0", "solver.tolerance"),
    ("solver.tolerance=1e-3", "solver.accept"),
    ("solver.accept=1e-5", "solver.accept"),
    ("solver.max_step_halvings=31", "solver.max_step_halvings"),
    ("solver.kind.gauss_seidel.max_sweeps=0", "solver.kind.gauss_seidel.max_sweeps"),
    // stop
    ("load_wall=tpo", "load_wall"),
    ("load_wall=bottom", "load_wall"),
    ("stop.wall_travel.wall=tpo", "stop.wall_travel.wall"),
    ("stop.wall_travel.wall=bottom", "stop.wall_travel.wall"),
    ("stop.wall_travel.fraction_of_height=0", "stop.wall_travel.fraction_of_height"),
    ("stop.broken_fraction=0", "stop.broken_fraction"),
    ("stop.broken_fraction=1.5", "stop.broken_fraction"),
    ("bonds=null", "stop.wall_travel.after"),
    // the load of `top` is prescribed, and a scene may not say which wall loads the sample
    ("stop.load_drop=0.5", "stop.load_drop"),
    ("stop={\"load_drop\": 0.5}", "stop.load_drop"),
];

/// The same for [`SOLID`].
const SOLID_CASES: &[(&str, &str)] = &[
    ("thickness=1", "thickness"),
    ("gravity=[0, 1]", "gravity"),
    ("sample.random.count=0", "sample.random.count"),
    ("sample.random.count=1000000000", "sample.random.count"),
    ("sample.random.depth=null", "sample.random.depth"),
    ("sample.random.width=-1", "sample.random.width"),
    ("sample.random.width=1e-4", "sample.random.width"),
    ("sample.random.diameter.constant=0", "sample.random.diameter.constant"),
    ("sample.random.diameter={\"uniform\": {\"min\": 2e-3, \"max\": 1e-3}}", "sample.random.diameter.uniform.max"),
    ("sample.random.diameter={\"uniform\": {\"min\": 0, \"max\": 1e-3}}", "sample.random.diameter.uniform.min"),
    ("sample.random.diameter={\"table\": []}", "sample.random.diameter.table"),
    ("sample.random.diameter={\"table\": [[1e-3, 0]]}", "sample.random.diameter.table"),
    ("sample.random.diameter={\"table\": [[1e-3, 1], [-1e-3, 1]]}", "sample.random.diameter.table.1.0"),
    ("sample.random.diameter={\"table\": [[1e-3, 1], [1e-3, -1]]}", "sample.random.diameter.table.1.1"),
    ("sample.random.preparation.deposition.solid_fraction=1", "sample.random.preparation.deposition.solid_fraction"),
    (
        "sample={\"lattice\": {\"hexagonal\": {\"diameter\": 1, \"rows\": 1, \"columns\": 1}}}",
        "sample.lattice.hexagonal.layers",
    ),
    ("sample={\"lattice\": {\"square\": {\"diameter\": 1, \"rows\": 1, \"columns\": 1}}}", "sample.lattice.square"),
    ("sample.random.cut={\"circle\": 0}", "sample.random.cut.circle"),
    ("materials.named=[{\"name\": \"a\"}]", "materials.named.0.regions"),
    ("sample={\"lattice\": {\"cubic\": {\"diameter\": -1, \"counts\": [1, 1, 1]}}}", "sample.lattice.cubic.diameter"),
    ("sample={\"lattice\": {\"cubic\": {\"diameter\": 1, \"counts\": [1, 0, 1]}}}", "sample.lattice.cubic.counts.1"),
    (
        "sample={\"lattice\": {\"cubic\": {\"diameter\": 1, \"counts\": [10000000, 100000000, 100000000]}}}",
        "sample.lattice.cubic",
    ),
    ("sample={\"file\": {\"path\": \"\"}}", "sample.file.path"),
    ("walls.drum.shape.cylinder.axis=[0, 0, 0]", "walls.drum.shape.cylinder.axis"),
    (
        r#"walls.drum.shape={"plate": {"normal": [0, 0, 1], "center": [0, 0, 0], "size": [1, 1]}}"#,
        "walls.drum.shape.plate.side",
    ),
    (
        r#"walls.drum.shape={"plate": {"normal": [0, 0, 1], "center": [0, 0, 0], "size": [1, 1], "side": [0, 1, 1e-3]}}"#,
        "walls.drum.shape.plate.side",
    ),
    (
        r#"walls.drum.shape={"plate": {"normal": [0, 0, 1], "center": [0, 0, 0], "size": [1], "side": [0, 1, 0]}}"#,
        "walls.drum.shape.plate.size",
    ),
    ("walls.drum.shape={\"circle\": {\"center\": [0, 0, 0], \"radius\": 1}}", "walls.drum.shape.circle"),
    ("walls={\"a.b\": {\"shape\": {\"plane\": {\"normal\": [0, 0, 1], \"place\": \"seated\"}}}}", "walls.a.b"),
];

/// Twist by pair: the coefficient is checked, and springs resist twist where some pair does.
#[test]
fn twist_by_pair_is_twist() {
    let bonds = r#"bonds={"strength": 1, "gap_tolerance": 0.1}"#;
    let pair =
        |twist: &str| format!(r#"materials.pairs=[{{"between": ["base", "base"], "bonds": {{"twist": {twist}}}}}]"#);
    assert!(read(SOLID, &[bonds, &pair("0.1")]).is_ok_and(|scene| scene.twists() && scene.twists_by_pair()));
    assert!(read(SOLID, &[bonds, &pair("0")]).is_ok_and(|scene| !scene.twists() && !scene.twists_by_pair()));
    assert!(read(SOLID, &[bonds, "bonds.twist=1"]).is_ok_and(|scene| scene.twists() && !scene.twists_by_pair()));
    assert_eq!(only(read(SOLID, &[bonds, &pair("-1")])).path, "materials.pairs.0.bonds.twist");
    let springs = r#"bonds.stiffness={"springs": {"normal": 1, "tangential": 1, "rolling": 1}}"#;
    assert_eq!(only(read(SOLID, &[bonds, springs, &pair("0.1")])).path, "bonds.stiffness.springs.twist");
    read(SOLID, &[bonds, springs, "bonds.stiffness.springs.twist=1", &pair("0.1")]).expect("springs that twist");
}

fn check(text: &str, cases: &[(&str, &str)]) {
    for (set, path) in cases {
        let error = read(text, &[set]).expect_err(set);
        let paths: Vec<&str> = error.problems().iter().map(|problem| problem.path.as_str()).collect();
        // a change of dimension makes other places wrong too, but only it is told
        assert_eq!(paths, [*path], "{set}: {error}");
    }
}

#[test]
fn every_wrong_value_in_2d_is_found_at_its_place() {
    check(FLAT, FLAT_CASES);
}

#[test]
fn every_wrong_value_in_3d_is_found_at_its_place() {
    check(SOLID, SOLID_CASES);
}

#[test]
fn limits_themselves_are_right() {
    for set in [
        "bonds.strength=0",
        "bonds.gap_tolerance=0",
        "materials.friction.grain_grain=0",
        "materials.restitution.grain_wall=1",
        "output={\"interval\": 1e-4}",
        "solver.max_step_halvings=0",
        "stop.broken_fraction=1",
        "walls.top.force_rate=-200",
        "grains.fixed=[0, 1]",
    ] {
        read(FLAT, &[set]).unwrap_or_else(|error| panic!("{set}: {error}"));
    }
    read(SOLID, &["sample.random.width=1e-3", "sample.random.count=1"]).expect("a box as wide as a grain");
}

#[test]
fn all_wrong_values_are_told_at_once_with_their_lines() {
    let text = FLAT
        .replace("\"step\": 1e-4", "\"step\": 0")
        .replace("\"grain_grain\": 0.3", "\"grain_grain\": -0.3")
        .replace("\"radius\": 1e-3, \"velocity\"", "\"radius\": -1e-3, \"velocity\"")
        .replace("\"wall\": \"top\"", "\"wall\": \"tap\"");
    let error = read(&text, &[]).expect_err("four wrong values");
    let seen: Vec<(&str, &str, Option<Origin>)> =
        error.problems().iter().map(|p| (p.path.as_str(), p.found.as_str(), p.origin.clone())).collect();
    let at = |line, column| Some(Origin::Text { line, column });
    assert_eq!(
        seen,
        [
            ("sample.grains.0.radius", "-0.001", at(6, 35)),
            ("materials.friction.grain_grain", "-0.3", at(9, 64)),
            ("time.step", "0.0", at(20, 21)),
            ("stop.wall_travel.wall", "\"tap\"", at(23, 38)),
        ]
    );
    assert_eq!(error.problems()[3].nearest.as_deref(), Some("top"));
    assert!(error.problems().iter().all(|problem| !problem.allowed.is_empty()));
}

#[test]
fn a_drop_of_the_load_needs_bonds_a_share_and_a_load_that_can_drop() {
    let rolls = "load_wall=roller";
    read(FLAT, &[rolls, "stop={\"load_drop\": 0.5}"]).expect("a load wall with a velocity");
    for share in ["0", "1", "-0.5"] {
        let problem = only(read(FLAT, &[rolls, &format!("stop={{\"load_drop\": {share}}}")]));
        assert_eq!(problem.path, "stop.load_drop", "{problem}");
    }
    let problem = only(read(FLAT, &["bonds=null", rolls, "stop={\"load_drop\": 0.5}"]));
    assert!(problem.allowed.contains("bonds in the scene"), "{problem}");
    let problem = only(read(FLAT, &["stop={\"load_drop\": 0.5}"]));
    assert!(problem.allowed.contains("a load_wall in the scene: one of roller, top"), "{problem}");
    let problem = only(read(FLAT, &["load_wall=top", "stop={\"load_drop\": 0.5}"]));
    assert!(problem.found.contains("walls.top") && problem.allowed.contains("velocity"), "{problem}");
}

/// [`FLAT`] with a lid that is driven by a stress.
fn stressed(sets: &[&str]) -> Result<Scene, SceneError> {
    let lid = ["walls.top.force_rate=null", r#"walls.top.stress={"constant": 1e5}"#];
    read(FLAT, &[&lid, sets].concat())
}

#[test]
fn a_stress_needs_a_plane_along_an_axis_a_mass_and_no_other_direction() {
    let scene =
        stressed(&[r#"walls.top.slide={"direction": [-2, 0], "velocity": {"constant": 1}}"#, "walls.bottom.grip=1"]);
    let Drive::Stress(stress) = scene.expect("right").walls["top"].drive() else { panic!("no stress") };
    assert_eq!(stress.at(1.0), 1e5);
    for (set, path) in [
        ("walls.top.shape.plane.normal=[0.1, -1]", "walls.top.shape.plane.normal"),
        ("walls.top.direction=[0, -1]", "walls.top.direction"),
        ("walls.top.mass=null", "walls.top.mass"),
        ("walls.top.mass={\"kg\": 0}", "walls.top.mass.kg"),
        ("walls.top.grip=1e-3", "walls.top.grip"),
        (r#"walls.top.shape={"circle": {"center": [0, 9], "radius": 1}}"#, "walls.top.stress"),
    ] {
        let error = stressed(&[set]).expect_err(set);
        let paths: Vec<&str> = error.problems().iter().map(|problem| problem.path.as_str()).collect();
        assert!(paths.contains(&path), "{set}: {error}");
    }
}

#[test]
fn a_plate_is_driven_and_stressed_along_its_normal() {
    let plate = |normal: &str| {
        format!(
            r#"walls.top.shape={{"plate": {{"normal": {normal}, "center": [0, 9], "size": [0.5], "seated": true}}}}"#
        )
    };
    let scene = stressed(&[&plate("[0, -1]")]).expect("right");
    assert_eq!(scene.walls["top"].drive_direction(), Some(&[0.0, -1.0][..]));
    assert_eq!(only(stressed(&[&plate("[0.1, -1]")])).path, "walls.top.shape.plate.normal");
    // what a plate covers of a round section is not known
    let block = |axis: &str| {
        let plate = r#"{"normal": [0, 0, -1], "center": [0, 0, 9], "size": [1, 1], "side": [1, 0, 0]}"#;
        let tube = format!(r#"{{"center": [0, 0, 0], "axis": {axis}, "radius": 9, "inside": true}}"#);
        let walls = format!(
            r#"walls={{"top": {{"shape": {{"plate": {plate}}}, "mass": "sample", "stress": {{"constant": 1}}}}, "tube": {{"shape": {{"cylinder": {tube}}}}}}}"#
        );
        read(SOLID, &[&walls])
    };
    assert!(block("[1, 0, 0]").is_ok());
    let problem = only(block("[0, 0, 2]"));
    assert!(problem.path == "walls.top.stress" && problem.found.contains("walls.tube"), "{problem}");
}

#[test]
fn coincident_centres_name_the_other_grain() {
    let problem = only(read(FLAT, &["sample.grains.1.center=[0, 0]"]));
    assert!(problem.found.contains("grain 0"), "{problem}");
}

#[test]
fn nan_and_infinity_are_found_in_a_scene_that_was_made_in_code() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut scene = read(FLAT, &[]).expect("FLAT");
        scene.time.step = bad;
        scene.materials.density = bad;
        scene.gravity = Some(vec![0.0, bad]);
        scene.solver.tolerance = bad;
        scene.materials.restitution.grain_grain = bad;
        let wall = scene.walls.get_mut("bottom").expect("a wall");
        wall.shape = Shape::Plane(Plane { normal: vec![bad, 1.0], place: Place::Seated });
        let problems = validate(&scene);
        let paths: Vec<&str> = problems.iter().map(|problem| problem.path.as_str()).collect();
        for path in [
            "materials.density",
            "materials.restitution.grain_grain",
            "walls.bottom.shape.plane.normal.0",
            "gravity.1",
            "time.step",
            "solver.tolerance",
        ] {
            assert!(paths.contains(&path), "{bad}: {path} not in {paths:?}");
        }
    }
}

#[test]
fn loading_to_the_next_event_needs_loads_and_rigid_bonds() {
    let next = |more: &[&str]| {
        let sets: Vec<&str> = ["rupture=next_event", "bonds.strength=5"].iter().chain(more).copied().collect();
        read(FLAT, &sets)
    };
    assert!(next(&["walls.roller.velocity=null", "walls.roller.direction=null"]).is_ok());
    let path = |more: &[&str]| {
        let all: Vec<&str> =
            ["walls.roller.velocity=null", "walls.roller.direction=null"].iter().chain(more).copied().collect();
        only(next(&all)).path
    };
    assert_eq!(path(&["walls.roller.velocity=1"]), "walls.roller.velocity");
    assert_eq!(path(&["bonds.stiffness={young: {modulus: 1e9, poisson_ratio: 0.2}}"]), "bonds.stiffness");
    assert_eq!(path(&["solver.kind.gauss_seidel.max_sweeps=7"]), "solver.kind");
}
