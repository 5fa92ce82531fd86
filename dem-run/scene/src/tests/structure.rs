//! Syntax, names, types, and `--set`.

use super::*;

fn syntax(text: &str) -> (usize, usize, String) {
    match read(text, &[]).expect_err("the syntax is right") {
        SceneError::Syntax { line, column, message, .. } => (line, column, message),
        other => panic!("not a syntax error: {other}"),
    }
}

#[test]
fn comments_are_allowed_and_no_other_liberty() {
    read(&FLAT.replace("\"dimension\"", "/* block\n comment */ \"dimension\""), &[]).expect("comments");
    read(&format!("\u{feff}{FLAT}"), &[]).expect("a byte order mark");
    for (text, part) in [
        ("{\"a\": 1,}", "Trailing commas"),
        ("{'a': 1}", "double quotes"),
        ("{a: 1}", "double quotes"),
        ("{\"a\": 0x10}", "Hexadecimal"),
        ("{\"a\": +1}", "Unary plus"),
        ("{\"a\": .5}", "0.5"),
        ("{\"a\": NaN}", "finite"),
        ("{\"a\": -Infinity}", "finite"),
        ("{\"a\": 1 \"b\": 2}", "comma"),
        ("{\"a\": 01}", "comma"),
        ("{\"a\": \"\\x41\"}", "escape"),
        ("{} {}", "more than one"),
        ("{\"a\": ", "value"),
        ("", "empty"),
        ("// nothing", "empty"),
    ] {
        let (_, _, message) = syntax(text);
        assert!(message.contains(part), "{text}: {message}");
    }
    assert!(syntax(&"[".repeat(100_000)).2.contains("nesting"));
}

#[test]
fn a_syntax_error_shows_its_line_with_a_mark() {
    let error = read("{\n  \"dimension\": 2,\n  \"seed\": 'one'\n}", &[]).expect_err("single quotes");
    assert_eq!(
        error.to_string(),
        "test, line 3, column 11: Single-quoted strings are not allowed: write \"double quotes\"\n    \"seed\": 'one'\n            ^"
    );
}

#[test]
fn a_name_that_is_given_twice_is_refused_wherever_it_stands() {
    let text = FLAT
        .replace("\"gravity\"", "\"thickness\": 0.02, \"gravity\"")
        .replace("\"step\": 1e-4", "\"step\": 1e-4, \"step\": 1e-5");
    let error = read(&text, &[]).expect_err("names twice");
    let paths: Vec<&str> = error.problems().iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(paths, ["thickness", "time.step"]);
    assert!(error.problems()[0].found.contains("line 4"), "{error}");
}

/// What of [`FLAT`] is replaced by what; where, and the nearest name.
const UNKNOWN_NAMES: &[(&str, &str, &str, Option<&str>)] = &[
    ("\"gravity\"", "\"gravty\"", "gravty", Some("gravity")),
    ("\"gap_tolerance\"", "\"gap-tolerance\"", "bonds.gap-tolerance", Some("gap_tolerance")),
    ("\"force_rate\"", "\"forse_rate\"", "walls.top.forse_rate", Some("force_rate")),
    ("\"plane\": { \"normal\": [0, -1]", "\"plain\": { \"normal\": [0, -1]", "walls.top.shape.plain", Some("plane")),
    ("\"seated\"", "\"seatd\"", "walls.top.shape.plane.place.seatd", Some("seated")),
    ("\"first_break\"", "\"first-break\"", "stop.wall_travel.after.first-break", Some("first_break")),
    ("\"spin\"", "\"colour\"", "sample.grains.0.colour", None),
    ("\"center\": [0, 9]", "\"centre\": [0, 9]", "walls.roller.shape.circle.centre", Some("center")),
    ("\"thickness\"", "\"$scheme\"", "$scheme", Some("$schema")),
];

#[test]
fn an_unknown_name_gets_the_nearest_one_and_its_line() {
    for (from, to, path, nearest) in UNKNOWN_NAMES.iter().copied() {
        assert!(FLAT.contains(from), "{from}");
        let problem = only(read(&FLAT.replacen(from, to, 1), &[]));
        assert_eq!((problem.path.as_str(), problem.nearest.as_deref()), (path, nearest), "{problem}");
        assert!(problem.found.contains("unknown name"), "{problem}");
        assert!(matches!(problem.origin, Some(Origin::Text { line: 2.., .. })), "{problem}");
    }
}

#[test]
fn an_unknown_name_says_which_names_there_are() {
    let problem = only(read(&FLAT.replace("\"end\"", "\"stop\""), &[]));
    assert_eq!(problem.to_string().lines().nth(2), Some("      allowed  step, end"));
    assert_eq!(problem.origin, Some(Origin::Text { line: 20, column: 35 }));
}

/// What of [`FLAT`] is replaced by what; where, what was found, and what is allowed.
const WRONG_TYPES: &[(&str, &str, &str, &str, &str)] = &[
    ("\"density\": 2500", "\"density\": \"heavy\"", "materials.density", "string \"heavy\"", "a number"),
    ("\"dimension\": 2", "\"dimension\": -2", "dimension", "-2", "a whole number, at least 0"),
    ("\"dimension\": 2", "\"dimension\": 2.5", "dimension", "2.5", "a whole number, at least 0"),
    ("\"fixed\": [0]", "\"fixed\": 0", "grains.fixed", "0", "an array"),
    ("[0, -9.81]", "[0, true]", "gravity.1", "true", "a number"),
    ("{ \"step\": 1e-4, \"end\": 0.5 }", "7", "time", "7", "an object"),
    ("{ \"constant\": -1 }", "-1", "walls.roller.velocity", "-1", "by its name"),
    ("{ \"constant\": -1 }", "{ \"ramp\": 1 }", "walls.roller.velocity.ramp", "1", "an object"),
    ("{ \"constant\": -1 }", "{ \"table\": [[1, 2], [3]] }", "walls.roller.velocity.table.1", "1", "2 values"),
    ("{ \"constant\": -1 }", "{ \"constant\": -1, \"table\": [] }", "walls.roller.velocity", "an object", "one name"),
    ("\"every_steps\": 10", "\"every_steps\": null", "output", "neither", "exactly one"),
];

#[test]
fn a_wrong_type_says_what_stood_there_and_what_is_allowed() {
    for (from, to, path, found, allowed) in WRONG_TYPES.iter().copied() {
        assert!(FLAT.contains(from), "{from}");
        let problem = only(read(&FLAT.replacen(from, to, 1), &[]));
        assert_eq!(problem.path, path, "{problem}");
        assert!(problem.found.contains(found), "{problem}");
        assert!(problem.allowed.contains(allowed), "{problem}");
    }
    assert_eq!(only(read("[]", &[])).path, "");
    assert_eq!(only(read("2", &[])).allowed, "an object { … }");
    let file = only(read(FLAT, &["sample={\"file\": \"beam.csv\"}"]));
    assert_eq!((&*file.path, &*file.allowed), ("sample.file", "an object { \"path\": … }"));
}

#[test]
fn what_is_missing_is_named() {
    for (from, path) in [
        ("\"density\": 2500, ", "materials.density"),
        (", \"gap_tolerance\": 1e-3", "bonds.gap_tolerance"),
        ("\"dimension\": 2,", "dimension"),
        (", \"place\": \"seated\"", "walls.top.shape.plane.place"),
    ] {
        let problem = only(read(&FLAT.replacen(from, "", 1), &[]));
        assert_eq!((problem.path.as_str(), problem.found.as_str()), (path, "nothing"), "{problem}");
        assert!(problem.allowed.starts_with("this field is required: "), "{problem}");
    }
}

#[test]
fn all_that_is_missing_is_named_at_once() {
    let missing = |text: &str| -> Vec<String> {
        let error = read(text, &[]).expect_err("fields are missing");
        assert!(error.problems().iter().all(|problem| problem.found == "nothing"), "{error}");
        error.problems().iter().map(|problem| problem.path.clone()).collect()
    };
    assert_eq!(missing("{}"), ["dimension", "sample", "materials", "time", "output"]);
    // in every part of a scene that is otherwise right
    let text = FLAT
        .replace("\"density\": 2500, ", "")
        .replace(", \"gap_tolerance\": 1e-3", "")
        .replace("\"center\": [2e-3, 0], ", "")
        .replace(", \"place\": \"seated\"", "")
        .replace("\"step\": 1e-4, ", "");
    let mut paths = missing(&text);
    paths.sort_unstable();
    assert_eq!(
        paths,
        [
            "bonds.gap_tolerance",
            "materials.density",
            "sample.grains.1.center",
            "time.step",
            "walls.top.shape.plane.place"
        ]
    );
    let density = read(&text, &[]).expect_err("fields are missing").to_string();
    assert!(density.contains("this field is required: Density of the grains (kg/m³)"), "{density}");
}

#[test]
fn a_wall_is_added_as_a_whole() {
    let wall = r#"walls.left={"shape": {"plane": {"normal": [1, 0], "place": {"at": [-1, 0]}}}}"#;
    let scene = read(FLAT, &[wall, "walls.left.velocity={\"constant\": 1e-3}"]).expect("a wall more");
    assert_eq!(scene.walls.keys().collect::<Vec<_>>(), ["bottom", "left", "roller", "top"]);
    assert!(scene.walls["left"].velocity.is_some());
    // the first wall of a scene
    let rest = "\"time\": { \"step\": 1e-4, \"end\": 0.5 }, \"output\": { \"every_steps\": 10 }";
    let text = FLAT[..FLAT.find("\"walls\"").expect("walls")].to_string() + rest + "}";
    assert_eq!(read(&text, &[wall]).expect("a wall").walls.len(), 1);
    for set in ["walls.left=1", "walls.left.force_rate=5"] {
        let problem = only(read(&text, &[set]));
        assert_eq!(problem.path, "walls.left");
        assert_eq!(problem.allowed, "a new name with an object: walls.left={ … }");
    }
    let problem = only(read(FLAT, &["walls.left=1"]));
    assert_eq!(problem.allowed, "below walls: bottom, roller, top, or a new name with an object: walls.left={ … }");
    assert_eq!(only(read(FLAT, &["walls.left={}"])).path, "walls.left.shape");
}

#[test]
fn numbers_that_overflow_are_wrong_values_like_others() {
    let text = FLAT
        .replace("\"density\": 2500", "\"density\": 1e999")
        .replace("-9.81", "-1e400")
        .replace("\"grain_wall\": 0.2", "\"grain_wall\": -0.2");
    let error = read(&text, &[]).expect_err("overflow");
    let seen: Vec<(&str, &str)> = error.problems().iter().map(|p| (p.path.as_str(), p.found.as_str())).collect();
    assert_eq!(
        seen,
        [("gravity.1", "-1e400"), ("materials.density", "1e999"), ("materials.friction.grain_wall", "-0.2")]
    );
    assert!(matches!(error.problems()[0].origin, Some(Origin::Text { .. })));
    // where a whole number is expected, and in an assignment
    assert_eq!(only(read(&FLAT.replace("\"dimension\": 2", "\"dimension\": 1e999"), &[])).found, "1e999");
    assert_eq!(only(read(FLAT, &["gravity=[0, 1e999]"])).path, "gravity.1");
    // and one that is set right is right
    read(&FLAT.replace("\"density\": 2500", "\"density\": 1e999"), &["materials.density=2500"]).expect("right");
}

/// Assignments to all kinds of places in [`FLAT`].
const EVERYWHERE: &[&str] = &[
    "bonds.strength=5",
    "walls.top.force_rate=1e2",
    "sample.grains.0.radius=5e-4",
    "materials.restitution.grain_grain=0.5",
    "rupture=end_of_step",
    "solver.kind.gauss_seidel.local=predictor_corrector",
    "solver.kind.gauss_seidel.max_sweeps=7",
    "stop.broken_fraction=0.5",
    "walls.roller.velocity={\"ramp\": {\"rate\": 2}}",
    "grains.loads.0.force.1=3",
    "gravity=null",
    "title=a few words",
];

#[test]
fn assignments_reach_every_part_of_a_scene() {
    let scene = read(FLAT, EVERYWHERE).expect("all paths exist");
    assert_eq!(scene.bonds.as_ref().and_then(|bonds| bonds.strength), Some(5.0));
    assert_eq!(scene.walls["top"].force_rate, Some(100.0));
    assert_eq!(scene.walls["roller"].velocity, Some(Function::Ramp(Ramp { rate: 2.0, start: 0.0 })));
    assert_eq!((scene.materials.restitution.grain_grain, scene.materials.restitution.grain_wall), (0.5, 0.0));
    assert_eq!(scene.rupture, Rupture::EndOfStep);
    let local = LocalSolve::PredictorCorrector;
    assert_eq!(scene.solver.kind, SolverKind::GaussSeidel(GaussSeidel { local, max_sweeps: 7, acceleration: 0 }));
    assert_eq!(scene.grains.as_ref().and_then(|grains| grains.loads[0].force.clone()), Some(vec![1.0, 3.0]));
    assert_eq!((scene.gravity, scene.title.as_deref()), (None, Some("a few words")));
    let Sample::Grains(grains) = &scene.sample else { panic!("not grains") };
    assert_eq!((grains[0].radius, grains[1].radius), (5e-4, 1e-3));
}

#[test]
fn a_later_assignment_sees_an_earlier_one() {
    let sets = ["walls.top.mass={\"kg\": 1}", "walls.top.mass.kg=2"];
    assert_eq!(read(FLAT, &sets).expect("right").walls["top"].mass, Some(WallMass::Kg(2.0)));
}

#[test]
fn an_assignment_to_a_path_that_does_not_exist_is_refused() {
    for (set, path, nearest) in [
        ("bonds.strenght=5", "bonds.strenght", Some("bonds.strength")),
        ("walls.topp.force_rate=5", "walls.topp", Some("walls.top")),
        ("walls.top.forcerate=5", "walls.top.forcerate", Some("walls.top.force_rate")),
        (
            "materials.restitution.grain_grains=5",
            "materials.restitution.grain_grains",
            Some("materials.restitution.grain_grain"),
        ),
        ("nonsense=1", "nonsense", None),
        ("", "", None),
        ("time.step.x=1", "time.step.x", None),
        ("sample.grains.2.radius=1", "sample.grains.2", None),
        ("sample.grains.one.radius=1", "sample.grains.one", None),
        ("gravity.2=1", "gravity.2", None),
        ("=1", "", None),
        ("bonds..strength=1", "bonds.", None),
        // other kinds than those that the scene has
        ("sample.random.count=5", "sample.random", None),
        ("walls.top.mass.kg=5", "walls.top.mass.kg", None),
        ("walls.bottom.shape.circle.radius=5", "walls.bottom.shape.circle", None),
    ] {
        let problem = only(read(FLAT, &[set]));
        assert_eq!((problem.path.as_str(), problem.nearest.as_deref()), (path, nearest), "{set}: {problem}");
        assert_eq!(problem.origin, Some(Origin::Set(set.to_string())), "{set}");
    }
}

#[test]
fn all_wrong_assignments_are_told_at_once() {
    let error = read(FLAT, &["bonds.strenght=5", "bonds.strength=5", "gravty=1", "bonds.strength"]).expect_err("wrong");
    assert_eq!(error.problems().len(), 3, "{error}");
    assert!(error.problems()[2].allowed.contains("path=value"), "{error}");
}

#[test]
fn the_value_of_an_assignment_is_json_or_a_bare_word() {
    for set in ["time.step=1e-4x", "time.step=", "gravity=[0,", "time={\"step\": 1, \"step\": 2}", "time.step='1'"] {
        assert!(only(read(FLAT, &[set])).allowed.contains("JSON"), "{set}");
    }
    // a bare word is a text, which a number is not
    assert!(only(read(FLAT, &["time.step=nan"])).found.contains("nan"));
}

#[test]
fn a_wrong_value_that_was_set_names_its_assignment() {
    let problem = only(read(FLAT, &["time={\"step\": -1, \"end\": 1}"]));
    assert_eq!(problem.path, "time.step");
    assert_eq!(problem.origin, Some(Origin::Set("time={\"step\": -1, \"end\": 1}".into())));
}
