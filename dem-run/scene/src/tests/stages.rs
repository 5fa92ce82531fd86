//! Stages of loading.

use super::*;

/// [`FLAT`] with stages.
fn staged(stages: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let stages = format!("stages={stages}");
    read(FLAT, &[&[stages.as_str()][..], sets].concat())
}

#[test]
fn a_wall_has_the_drive_of_its_stage_and_is_held_before() {
    let stages = r#"[{"name": "wait", "duration": 0.1}, {"name": "go", "until": {"broken_fraction": 0.5},
        "walls": {"bottom": {"velocity": {"constant": 1}}, "top": {}}}]"#;
    let scene = staged(stages, &[]).expect("right");
    let held = Drive::Velocity(Function::Constant(0.0));
    assert_eq!(scene.first_drive("bottom", &scene.walls["bottom"]), held);
    assert_eq!(scene.drives("bottom", &scene.walls["bottom"]), [Drive::Velocity(Function::Constant(1.0))]);
    assert_eq!(scene.drives("top", &scene.walls["top"])[1], held);
    assert_eq!(scene.driven_walls(), ["bottom", "roller", "top"]);
    // the load of `top` may drop, since it is held in a stage
    staged(stages, &["stop={\"load_drop\": 0.5}", "load_wall=top"]).expect("a load that can drop");
    assert_eq!(read(&scene.to_json().expect("json"), &[]).expect("the same scene"), scene);
}

#[test]
fn what_a_stage_asks_of_a_wall_is_checked_at_the_wall() {
    let stage = |walls: &str| format!(r#"[{{"name": "a", "duration": 0.1, "walls": {walls}}}]"#);
    for (walls, sets, path) in [
        (r#"{"bottom": {"force": {"constant": 1}}}"#, &[][..], "walls.bottom.mass"),
        (r#"{"roller": {"stress": {"constant": 1}}}"#, &["walls.roller.mass=sample"], "walls.roller.stress"),
        (
            r#"{"roller": {"force": {"constant": 1}}}"#,
            &["walls.roller.mass=sample", "walls.roller.grip=1"],
            "walls.roller.grip",
        ),
        (r#"{"bottom": {"velocity": {"table": []}}}"#, &[], "stages.0.walls.bottom.velocity.table"),
        (
            r#"{"top": {}}"#,
            &[r#"walls.top.slide={"direction": [1, 0], "velocity": {"constant": 1}}"#],
            "stages.0.walls.top",
        ),
    ] {
        let error = staged(&stage(walls), sets).expect_err(walls);
        let paths: Vec<&str> = error.problems().iter().map(|problem| problem.path.as_str()).collect();
        assert!(paths.contains(&path), "{walls}: {error}");
    }
}

#[test]
fn a_condition_of_a_stage_asks_for_the_drive_of_that_stage() {
    let of = |second: &str, until: &str| {
        format!(
            r#"[{{"name": "a", "duration": 0.1, "walls": {{"top": {{"velocity": {{"constant": 1}}}}}}}},
                {{"name": "b", "walls": {{"top": {second}}}, "until": {until}}}]"#
        )
    };
    let travel = r#"{"wall_travel": {"wall": "top", "fraction_of_height": 0.1}}"#;
    let moves = r#"{"velocity": {"constant": 1}}"#;
    let pushed = r#"{"force": {"constant": 1}}"#;
    let sets = ["load_wall=top", "walls.top.mass=sample"];
    for (drive, until) in
        [(moves, travel), (pushed, travel), (moves, r#"{"load_drop": 0.5}"#), ("{}", r#"{"load_drop": 0.5}"#)]
    {
        staged(&of(drive, until), &sets).unwrap_or_else(|error| panic!("{drive} {until}: {error}"));
    }
    for (drive, until, path, found) in [
        ("{}", travel, "stages.1.until.wall_travel.wall", "\"top\", which is held"),
        (pushed, r#"{"load_drop": 0.5}"#, "stages.1.until.load_drop", "the load of walls.top is prescribed"),
    ] {
        let problem = only(staged(&of(drive, until), &sets));
        assert_eq!(problem.path, path);
        assert!(problem.found.contains(found), "{}", problem.found);
    }
}

#[test]
fn a_run_has_no_more_steps_than_its_stages() {
    let steps = |stages: &str, end: &str| {
        let scene = staged(stages, &["time.step=0.01", end, "output={\"every_steps\": 4}"]).expect("right");
        (scene.steps(), scene.frames())
    };
    let two = r#"[{"name": "a", "duration": 0.1}, {"name": "b", "duration": 0.014}]"#;
    // 10 steps and one: durations are rounded
    assert_eq!(steps(two, "time.end=1"), (11, 4));
    assert_eq!(steps(two, "time.end=0.05"), (5, 3));
    assert_eq!(steps("[]", "time.end=0.2"), (20, 6));
    let open = r#"[{"name": "a", "duration": 0.1}, {"name": "b", "until": {"broken_fraction": 0.5}}]"#;
    assert_eq!(steps(open, "time.end=0.2"), (20, 6));
}

#[test]
fn bonds_form_once_at_the_start_or_in_one_later_stage() {
    let stages = |cement: [bool; 3]| {
        let stage = |(k, cement): (usize, &bool)| format!(r#"{{"name": "{k}", "duration": 0.1, "cement": {cement}}}"#);
        format!("[{}]", cement.iter().enumerate().map(stage).collect::<Vec<_>>().join(", "))
    };
    let scene = staged(&stages([false, true, false]), &[]).expect("right");
    assert_eq!(scene.cement_stage(), Some(1));
    assert_eq!(read(&scene.to_json().expect("json"), &[]).expect("the same scene"), scene);
    assert_eq!(staged(&stages([false; 3]), &[]).expect("right").cement_stage(), None);
    for (cement, sets, path, remedy) in [
        ([true, false, false], &[][..], "stages.0.cement", "bonds form at the start of the run"),
        ([false, true, true], &[], "stages.2.cement", "one stage that cements, now 1"),
        ([false, true, false], &["bonds.strength=0", "stop=null"], "stages.1.cement", "add `bonds`"),
        ([false, true, false], &["bonds=null", "stop=null"], "stages.1.cement", "add `bonds`"),
        ([false, true, false], &["bonds.list=a.csv"], "stages.1.cement", "bonds by gap_tolerance"),
    ] {
        let problem = only(staged(&stages(cement), sets));
        assert_eq!(problem.path, path);
        assert!(problem.allowed.contains(remedy), "{}", problem.allowed);
    }
}

#[test]
fn nothing_slides_and_no_stage_begins_from_break_to_break() {
    let still = ["walls.roller.velocity=null", "walls.roller.direction=null", "rupture=next_event", "solver={}"];
    let slide = r#"walls.top.slide={"direction": [1, 0], "velocity": {"constant": 1}}"#;
    let stages = r#"stages=[{"name": "a", "duration": 0.1, "walls": {"top": {"force": {"constant": 1}}}}]"#;
    for (set, path) in [(slide, "walls.top.slide"), (stages, "stages")] {
        assert_eq!(only(read(FLAT, &[&still[..], &[set]].concat())).path, path);
    }
}
