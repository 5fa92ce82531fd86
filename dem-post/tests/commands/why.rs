//! `dem-post why`: a bond whose load is known in every frame, and bonds that are not there.

use super::*;

/// Strength 10 N, μ = 0.3, ν = 0.2, a = 4 mm.
fn two_grains(dimension: usize) -> Layout {
    let scene = r#"{"bonds": {"twist": 0.5}}"#;
    Layout {
        dimension,
        friction: true,
        twist: dimension == 3,
        grains: grains(2, 2e-3),
        bonds: Bonds {
            pair: vec![[0, 1]],
            rest_gap: vec![0.0],
            strength: vec![10.0],
            friction: vec![0.3],
            rolling: vec![0.2],
            twist: None,
            mean_diameter: vec![4e-3],
            formed: None,
        },
        parameters: Parameters { scene: scene.into(), ..Parameters::default() },
        ..Layout::default()
    }
}

/// A frame under the normal force `normal` and the other forces and moments `rest`; without them
/// the bond is broken.
fn bonded_frame(l: &Layout, step: i64, load: Option<(f64, &[f64], &[f64])>) -> Frame {
    let d = l.dimension;
    let along_x = |x: f64| [&[x][..], &vec![0.0; d - 1]].concat();
    let contacts = load.map_or_else(ContactRows::default, |(normal, tangential, moment)| ContactRows {
        // the pair of a contact may be the other way round
        pair: vec![[1, 0]],
        point: along_x(2e-3),
        normal: along_x(1.0),
        tangent: if d == 3 && !l.without_reactions { vec![0.0, 1.0, 0.0] } else { vec![] },
        reaction: if l.without_reactions { vec![] } else { [&[normal], tangential].concat() },
        moment: if l.without_reactions { vec![] } else { moment.to_vec() },
        gap: vec![0.0],
        status: vec![ContactStatus::Bonded],
        bond: vec![0],
    });
    let broken = load.is_none() && step > 0;
    Frame {
        step,
        time: 1e-3 * step as f64,
        grains: GrainState {
            position: [along_x(0.0), along_x(4e-3)].concat(),
            velocity: vec![0.0; 2 * d],
            ..GrainState::default()
        },
        contacts,
        bonds: vec![if broken { BondStatus::Rolling } else { BondStatus::Intact }],
        ..Frame::default()
    }
}

/// Frames at steps 0, 1, 2 and 5; the bond breaks by its rolling moment at step 4, or holds.
fn history(l: &Layout, breaks: bool) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let mut writer = Writer::create(&path, l, false).unwrap();
    writer.frame(&bonded_frame(l, 0, None)).unwrap();
    let plane = l.dimension == 2;
    // pressed, and then under −5 N, where the limits are 1.5 N, 4e-3 N m and 1e-2 N m
    let pressed: (&[f64], &[f64]) = if plane { (&[3.0], &[0.0]) } else { (&[3.0, 0.0], &[0.0; 3]) };
    let pulled: (&[f64], &[f64]) = if plane { (&[-0.3], &[-3e-3]) } else { (&[0.18, -0.24], &[1.8e-3, 2.4e-3, -2e-3]) };
    writer.frame(&bonded_frame(l, 1, Some((10.0, pressed.0, pressed.1)))).unwrap();
    writer.frame(&bonded_frame(l, 2, Some((-5.0, pulled.0, pulled.1)))).unwrap();
    let event = Rupture {
        point: [2e-3, 0.0, 0.0],
        normal_force: -5.0,
        tangential_force: 0.75,
        moment: 4e-3,
        twist: if l.dimension == 3 { 5e-3 } else { 0.0 },
        ..rupture(4, 4e-3, 0, [0, 1], RuptureMode::Rolling)
    };
    if breaks {
        writer.rupture(&event).unwrap();
        writer.frame(&bonded_frame(l, 5, None)).unwrap();
    } else {
        let moment = if plane { &[0.0][..] } else { &[0.0; 3] };
        writer.frame(&bonded_frame(l, 5, Some((1.0, &[0.0; 2][..l.dimension - 1], moment)))).unwrap();
    }
    writer.finish().unwrap();
    (folder, path)
}

/// Mode and utilisation of each part, without the last digits.
fn parts(found: &serde_json::Value) -> Vec<(String, Option<f64>)> {
    let part = |part: &serde_json::Value| {
        let ratio = part["utilisation"].as_f64().map(|ratio| (1e9 * ratio).round() / 1e9);
        (part["mode"].as_str().unwrap().to_string(), ratio)
    };
    found.as_array().unwrap().iter().map(part).collect()
}

#[test]
fn a_bond_that_broke_shows_its_load_and_how_it_came_to_it() {
    for dimension in [2, 3] {
        let (_folder, path) = history(&two_grains(dimension), true);
        let output = dem_post(&path, &["why", "1,0", "--json"]);
        let found = json(&output);
        let broken = &found["broken"];
        assert_eq!((&found["bond"], &broken["step"], &broken["round"]), (&0.into(), &4.into(), &0.into()));
        assert_eq!((&broken["mode"], &broken["time"]), (&"ROLLING".into(), &4e-3.into()));
        let expected = [("TENSION", 0.5), ("SHEAR", 0.5), ("ROLLING", 1.0), ("TWIST", 0.5)];
        let expected =
            |n: usize| expected[..n].iter().map(|(mode, u)| (mode.to_string(), Some(*u))).collect::<Vec<_>>();
        assert_eq!(parts(&broken["parts"]), expected(dimension + 1));
        assert_eq!(broken["parts"][1]["limit"], 1.5);
        assert!(broken["load"].is_null() && broken["load_note"].as_str().unwrap().contains("no wall is driven"));
        // the first frame holds no forces, the last no bond
        let frames = found["frames"].as_array().unwrap();
        assert_eq!(frames.iter().map(|frame| frame["step"].as_i64().unwrap()).collect::<Vec<_>>(), [1, 2]);
        let second = [("TENSION", 0.5), ("SHEAR", 0.2), ("ROLLING", 0.75), ("TWIST", 0.2)];
        let second: Vec<_> = second[..dimension + 1].iter().map(|(mode, u)| (mode.to_string(), Some(*u))).collect();
        assert_eq!(parts(&frames[1]["parts"]), second);
        assert_eq!(frames[1]["greatest"]["mode"], "ROLLING");
        // pressed: nothing in tension, half of the limit in shear
        assert_eq!(parts(&frames[0]["parts"])[..2], [("TENSION".into(), Some(0.0)), ("SHEAR".into(), Some(0.5))]);
        assert_eq!(names(&path.with_file_name("run-post")), ["why-0.csv", "why-0.png", "why-0.svg"]);
        let table = std::fs::read_to_string(path.with_file_name("run-post").join("why-0.csv")).unwrap();
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!((rows.len(), rows[3].contains(",rupture,"), rows[3].ends_with(",ROLLING")), (4, true, true));
        let text = String::from_utf8(dem_post(&path, &["why", "0"]).stdout).unwrap();
        for words in [
            "0, of grains 0 and 1",
            "broke in ROLLING at 0.004 s, step 4, round 0",
            "-5 N (tension), limit 10 N: utilisation 0.5",
            "0.004 N m, limit 0.004 N m: utilisation 1",
            "no bond broke in an earlier round",
            "at most 0.75 (ROLLING) at 0.002 s",
        ] {
            assert!(text.contains(words), "{words:?} is not in\n{text}");
        }
    }
}

#[test]
fn a_bond_that_holds_shows_how_near_it_came() {
    let (_folder, path) = history(&two_grains(2), false);
    let found = json(&dem_post(&path, &["why", "0", "--json"]));
    assert!(found["broken"].is_null());
    let text = String::from_utf8(dem_post(&path, &["why", "0"]).stdout).unwrap();
    for words in [
        "intact at 0.005 s, step 5",
        "at most 0.75 (ROLLING) at 0.002 s, step 2; 3 frames",
        "0 in the last frame, 0.005 s",
    ] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
}

#[test]
fn what_broke_before_and_the_load_are_those_of_the_run() {
    let (_folder, path) = sample(&layout(2));
    let found = json(&dem_post(&path, &["why", "1", "--json", "-o", "here"]));
    let broken = &found["broken"];
    assert_eq!((&broken["before"], &broken["same_step"]), (&1.into(), &serde_json::json!([0, 0, 0])));
    assert_eq!(broken["load"], serde_json::json!({"wall": "top", "load": 60.0}));
    let [last, nearest] = ["last_before", "nearest_before"].map(|name| &broken[name]);
    assert_eq!((last, &last["bond"], &last["distance"]), (nearest, &0.into(), &0.0.into()));
    // no row of a contact names this bond
    assert!(found["frames_note"].as_str().unwrap().contains("no frame holds its forces"));
    assert_eq!(names(&path.with_file_name("here")), ["why-1.csv"]);
    // another bond has files of its own
    json(&dem_post(&path, &["why", "0", "--json", "-o", "here"]));
    assert!(names(&path.with_file_name("here")).contains(&"why-1.csv".into()));
    refused(&dem_post(&path, &["why", "1", "--wall", "bottom"]), 2, &["--wall bottom", "top"]);
}

#[test]
fn what_a_history_lacks_is_said_and_not_guessed() {
    let lacks = |l: &Layout| {
        let (_folder, path) = history(l, true);
        String::from_utf8(dem_post(&path, &["why", "0"]).stdout).unwrap()
    };
    let forceless = Layout { without_reactions: true, ..two_grains(3) };
    assert!(lacks(&forceless).contains("not known: no forces in the frames: the scene has output.reactions = false"));
    // the scene does not hold the coefficient of twist, and the moments have three components
    let mut unknown = two_grains(3);
    unknown.parameters.scene = "{}".into();
    let text = lacks(&unknown);
    for words in ["ξ is not recorded", "the coefficient is not recorded", "lacks a force or a coefficient"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    // a wall that is moved, without its force before the breaks of a step
    let mut moved = layout(2);
    moved.walls[1].drive = WallDrive::Velocity;
    let (_folder, path) = sample(&moved);
    let text = String::from_utf8(dem_post(&path, &["why", "0"]).stdout).unwrap();
    assert!(text.contains("not known: the history has no wall_force_at_limit of wall top"), "{text}");
}

#[test]
fn a_bond_with_a_coefficient_of_twist_of_its_own_is_judged_by_it() {
    let own = |twist: f64| {
        let mut l = two_grains(3);
        l.bonds.twist = Some(vec![twist]);
        let (_folder, path) = history(&l, true);
        json(&dem_post(&path, &["why", "0", "--json"]))
    };
    let limit = |found: &serde_json::Value| {
        let parts = found["broken"]["parts"].as_array().unwrap().iter();
        parts.filter(|part| part["mode"] == "TWIST").find_map(|part| part["limit"].as_f64())
    };
    let (scene, half, free) = (own(0.5), own(0.25), own(0.0));
    assert_eq!(
        (&scene["twist"], &half["twist"], &free["twist"]),
        (&0.5.into(), &0.25.into(), &serde_json::Value::Null)
    );
    assert!((limit(&half).unwrap() / limit(&scene).unwrap() - 0.5).abs() < 1e-12);
    // a bond that does not resist twist has no part of that mode
    assert_eq!(limit(&free), None);
}

#[test]
fn bonds_that_are_not_there_are_named() {
    let (folder, path) = sample(&layout(2));
    refused(&dem_post(&path, &["why", "4"]), 2, &["run.h5", "no bond 4", "0 to 3", "dem-post cracks"]);
    refused(&dem_post(&path, &["why", "0,2"]), 2, &["0 and 2 have no bond", "1 (bond 0), 3 (bond 3)", "grain 2 has"]);
    refused(&dem_post(&path, &["why", "0,9"]), 2, &["no grain 9", "0 to 3"]);
    refused(&dem_post(&path, &["why", "top"]), 2, &["BOND", "two grains"]);
    refused(&dem_post(&path, &["why"]), 2, &["BOND"]);
    let loose = Layout { bonds: Bonds::default(), ..layout(2) };
    write(&folder.path().join("loose.h5"), &loose);
    refused(&dem_post(&folder.path().join("loose.h5"), &["why", "0"]), 2, &["loose.h5", "no bonds", "add `bonds`"]);
    refused(&dem_post(&folder.path().join("none.h5"), &["why", "0"]), 4, &["none.h5", "does not exist"]);
    assert!(!folder.path().join("run-post").exists() && !folder.path().join("loose-post").exists());
}
