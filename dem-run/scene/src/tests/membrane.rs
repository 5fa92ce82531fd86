//! Membranes.

use super::*;

fn with(membrane: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let membrane = format!("membrane={membrane}");
    read(FLAT, &[&[membrane.as_str()][..], sets].concat())
}

#[test]
fn a_membrane_has_a_pressure_and_may_have_plates_and_a_disk() {
    for membrane in [
        r#"{"pressure": {"constant": 0}}"#,
        r#"{"pressure": {"ramp": {"rate": 5}}, "disk_radius": 2e-3}"#,
        r#"{"pressure": {"table": [[0, 0], [0.1, 500]]}, "between": ["bottom", "top"]}"#,
        r#"{"pressure": {"constant": 1}, "between": ["top", "bottom"]}"#,
    ] {
        let scene = with(membrane, &[]).expect(membrane);
        assert_eq!(read(&scene.to_json().expect("json"), &[]).expect("the same scene"), scene);
    }
    assert_eq!(read(FLAT, &[]).expect("FLAT").membrane, None);
}

#[test]
fn a_wrong_membrane_is_named_with_the_remedy() {
    for (membrane, path, remedy) in [
        (r#"{"pressure": {"constant": -1}}"#, "membrane.pressure.constant", "a number ≥ 0 (Pa)"),
        (r#"{"pressure": {"ramp": {"rate": -1}}}"#, "membrane.pressure.ramp.rate", "a number ≥ 0 (Pa)"),
        (r#"{"pressure": {"table": [[0, 1], [1, -1]]}}"#, "membrane.pressure.table.1.1", "a number ≥ 0 (Pa)"),
        (r#"{"pressure": {"table": []}}"#, "membrane.pressure.table", "at least one pair"),
        (r#"{"pressure": {"constant": 1}, "disk_radius": 0}"#, "membrane.disk_radius", "> 0 (m)"),
        (r#"{"pressure": {"constant": 1}, "between": ["bottom", "tup"]}"#, "membrane.between.1", "bottom, roller, top"),
        (r#"{"pressure": {"constant": 1}, "between": ["bottom", "roller"]}"#, "membrane.between.1", "a plane"),
        (r#"{"pressure": {"constant": 1}, "between": ["top", "top"]}"#, "membrane.between", "face each other"),
    ] {
        let problem = only(with(membrane, &[]));
        assert_eq!(problem.path, path);
        assert!(problem.allowed.contains(remedy), "{}", problem.allowed);
    }
    let oblique = only(with(
        r#"{"pressure": {"constant": 1}, "between": ["bottom", "top"]}"#,
        &["walls.top.shape.plane.normal=[0.01, -1]"],
    ));
    assert_eq!(oblique.path, "membrane.between");
    let solid = only(read(SOLID, &[r#"membrane={"pressure": {"constant": 1}}"#]));
    assert_eq!(solid.path, "membrane");
    assert!(solid.allowed.contains("give the side walls of spheres a stress"), "{}", solid.allowed);
}

#[test]
fn a_stage_changes_the_pressure_of_a_membrane_that_the_scene_has() {
    let stages = r#"stages=[{"name": "a", "duration": 0.1, "membrane_pressure": {"constant": 3}},
        {"name": "b", "duration": 0.1, "membrane_pressure": {"constant": 5}}]"#;
    let scene = with(r#"{"pressure": {"constant": 1}}"#, &[stages]).expect("right");
    assert_eq!(scene.first_pressure(), Some(&Function::Constant(3.0)));
    assert_eq!(read(&scene.to_json().expect("json"), &[]).expect("the same scene"), scene);
    let without = with(r#"{"pressure": {"constant": 1}}"#, &[]).expect("right");
    assert_eq!(without.first_pressure(), Some(&Function::Constant(1.0)));

    let error = read(FLAT, &[stages]).expect_err("no membrane");
    let paths: Vec<&str> = error.problems().iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(paths, ["stages.0.membrane_pressure", "stages.1.membrane_pressure"]);
    let negative = stages.replace('5', "-5");
    let problem = only(with(r#"{"pressure": {"constant": 1}}"#, &[&negative]));
    assert_eq!(problem.path, "stages.1.membrane_pressure.constant");
}
