//! `dem-post compare` on runs that are equal, part, or cannot be compared.

use super::*;

#[test]
fn equal_runs_do_not_part() {
    let (folder, path) = sample(&layout(2));
    let other = folder.path().join("other.h5");
    write(&other, &layout(2));
    let found = json(&dem_post(&path, &["compare", "other.h5", "--json"]));
    assert!(found["first_difference"].is_null() && found["parting"].is_null());
    assert_eq!((&found["broken"], &found["gaps"].as_array().unwrap().len()), (&serde_json::json!([2, 0, 0]), &11));
}

#[test]
fn runs_part_where_one_gives_way_more() {
    let (folder, path) = sample(&layout(2));
    let mut wider = layout(2);
    // other names of the bonds, another scene; the motion is the same
    wider.bonds.pair.reverse();
    wider.parameters.scene = "{\"thickness\": 0.25}".into();
    write(&folder.path().join("other.h5"), &wider);
    let output = dem_post(&path, &["compare", "other.h5", "--json", "-o", "here"]);
    let found = json(&output);
    assert_eq!(found["scene"], serde_json::json!([{"path": "thickness", "a": "0.5", "b": "0.25"}]));
    assert_eq!(found["same_sample"], false);
    // bonds 0 and 1 are those of grains 0–1 and 1–2 there, of 3–0 and 2–3 here
    assert_eq!(found["broken"], serde_json::json!([0, 2, 2]));
    assert_eq!((&found["parting"]["alike"], &found["parting"]["b"]["grains"]), (&0.into(), &serde_json::json!([0, 3])));
    for file in ["scene.csv", "distance.csv", "bonds.csv", "distance.png", "broken.png", "bonds.png", "load.png"] {
        assert!(folder.path().join("here").join(file).exists(), "{file}");
    }
}

#[test]
fn breaks_after_the_end_of_the_shorter_run_are_not_compared() {
    let (_folder, path) = sample(&layout(2));
    write_course(&path.with_file_name("short.h5"), &layout(2), Course { steps: 50, ..COURSE });
    let found = json(&dem_post(&path, &["compare", "short.h5", "--json"]));
    assert_eq!(found["ends"], serde_json::json!([0.1, 0.05]));
    assert_eq!(found["broken"], serde_json::json!([1, 0, 0]));
    assert!(found["parting"].is_null(), "{found}");
    let text = dem_post(&path, &["compare", "short.h5"]).stdout;
    assert!(String::from_utf8_lossy(&text).contains("0.05 s, the end of B"));
}

#[test]
fn runs_that_cannot_be_compared_are_refused() {
    let (folder, path) = sample(&layout(2));
    write(&folder.path().join("space.h5"), &layout(3));
    refused(&dem_post(&path, &["compare", "space.h5"]), 2, &["space.h5", "2D", "3D"]);
    refused(&dem_post(&path, &["compare", "run.h5", "--tolerance=-1"]), 2, &["--tolerance"]);
    refused(&dem_post(&path, &["compare", "none.h5"]), 4, &["none.h5", "does not exist"]);
    assert!(!folder.path().join("run-compare").exists());
}
