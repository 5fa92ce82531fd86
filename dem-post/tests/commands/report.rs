//! The page of `dem-post report`.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::*;

/// Reads the page of a history.
fn page(path: &Path, options: &[&str]) -> String {
    let output = dem_post(path, &[&["report"], options].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let folder = format!("{}-post", path.file_stem().unwrap().to_str().unwrap());
    std::fs::read_to_string(path.with_file_name(folder).join("report.html")).unwrap()
}

/// Checks that every element is closed, in order, and that no attribute is open.
pub(super) fn well_formed(page: &str) {
    let mut open: Vec<&str> = vec![];
    let mut rest = page.strip_prefix("<!doctype html>").expect("a document type");
    while let Some((_, tail)) = rest.split_once('<') {
        let mut quoted = false;
        let end = tail.char_indices().find(|(_, letter)| {
            quoted ^= *letter == '"';
            *letter == '>' && !quoted
        });
        let (tag, after) = tail.split_at(end.expect("the end of a tag").0);
        rest = &after[1..];
        let name = tag.split([' ', '\n']).next().unwrap();
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "…{}", &rest[..rest.len().min(80)]);
        } else if !["meta", "img", "input", "br", "link"].contains(&name) {
            assert!(name.chars().all(|letter| letter.is_ascii_alphanumeric()) && !name.is_empty(), "<{tag}>");
            open.push(name);
            // the content of these is no markup
            if ["script", "style"].contains(&name) {
                rest = &rest[rest.find(&format!("</{name}")).expect("its end")..];
            }
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

/// The JSON of the first script with this beginning.
fn data(page: &str, tag: &str) -> Value {
    let script = page.split(tag).nth(1).expect(tag).split("</script>").next().unwrap();
    serde_json::from_str(script).unwrap()
}

pub(super) fn bytes(value: &Value) -> Vec<u8> {
    STANDARD.decode(value.as_str().unwrap()).unwrap()
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn the_page_begins_with_the_result() {
    let (_folder, path) = sample(&layout(2));
    let page = page(&path, &[]);
    let result = page.split("<section id=\"result\">").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(page.find("id=\"result\"") < page.find("id=\"load\""));
    for said in [
        "Under wall top, the first bond broke at 30 N (t = 0.03 s, in shear) and the sample collapsed at 40 N (strain 10⁻⁴).",
        "2 of 4 bonds broke: 1 in tension and 1 in shear;",
        "between grains 0 and 1. 2 fragments at the end, 1 of them single grains; the heaviest has 75.0 % of the mass.",
        "First break: t = 0.03 s, load 30 N.",
        "Collapse: t = 0.04 s, load 40 N.",
        "End: t = 0.1 s, load 100 N.",
    ] {
        assert!(result.contains(said), "{said}");
    }
    // times that were asked for take the place of the chosen ones
    let (_folder, path) = sample(&layout(2));
    let asked = self::page(&path, &["--times", "0.02,0.07"]);
    assert!(
        asked.contains("<figcaption>t = 0.02 s, load 20 N.") && asked.contains("<figcaption>t = 0.07 s, load 70 N.")
    );
    // what did not happen is not told
    let unbonded = Layout { bonds: Bonds::default(), ..layout(2) };
    let (_folder, path) = sample(&unbonded);
    let page = self::page(&path, &[]);
    assert!(page.contains("Under wall top, the sample collapsed at 40 N") && page.contains("4 grains without bonds"));
    assert!(!page.contains("broke at") && !page.contains("<section id=\"emission\">"));
}

#[test]
fn titles_of_maps_have_the_load_of_the_wall_that_is_asked_for() {
    let mut both = layout(2);
    (both.walls[0].drive, both.walls[0].direction) = (WallDrive::Force, [0.0, 1.0, 0.0]);
    // at the end 100 N on the upper wall, and none on the lower one
    both.parameters.scene = "{\"thickness\": 0.5, \"load_wall\": \"top\"}".into();
    for (options, title) in [(&[][..], "t = 0.1 s, F = 100 N"), (&["--wall", "bottom"], "t = 0.1 s, F = 0 N")] {
        let (_folder, path) = sample(&both);
        let page = page(&path, options);
        let addresses = page.split("src=\"data:image/svg+xml;base64,").skip(1);
        let decode = |address: &str| STANDARD.decode(address.split('"').next().unwrap()).unwrap();
        let drawings: Vec<String> = addresses.map(|address| String::from_utf8(decode(address)).unwrap()).collect();
        let last: Vec<&String> = drawings.iter().filter(|svg| svg.contains("t = 0.1 s, ")).collect();
        // result, lost bonds, forces, chains, velocities
        assert_eq!(last.len(), 5);
        assert!(last.iter().all(|svg| svg.contains(title)), "{title}");
    }
}

#[test]
fn the_slider_has_the_positions_of_the_history() {
    for d in [2, 3] {
        let l = layout(d);
        let (_folder, path) = sample(&l);
        let page = page(&path, &[]);
        let found = data(&page, "<script type=\"application/json\" id=\"moments\">");
        let history = History::open(&path).unwrap();
        let steps: Vec<i64> = found["step"].as_array().unwrap().iter().map(|step| step.as_i64().unwrap()).collect();
        // all eleven frames fit
        assert_eq!(steps, history.steps());
        assert_eq!(floats(&found["time"]), history.times());
        assert_eq!(page.split("type=\"range\" min=\"0\" max=\"").nth(1).unwrap().split('"').next(), Some("10"));
        let (low, high) = (floats(&found["low"]), floats(&found["high"]));
        let places: Vec<f64> = bytes(&found["position"])
            .chunks(2)
            .map(|pair| f64::from(u16::from_le_bytes([pair[0], pair[1]])) / 65535.0)
            .collect();
        assert_eq!(places.len(), 11 * 4 * d);
        for (frame, places) in places.chunks(4 * d).enumerate() {
            let position = history.grain_state(frame).unwrap().position;
            for (k, (share, x)) in places.iter().zip(position).enumerate() {
                let (low, high) = (low[k % d], high[k % d]);
                let off = low + share * (high - low) - x;
                assert!(off.abs() <= 0.501 * (high - low) / 65535.0, "frame {frame}, number {k}: {off:e}");
                // a range that is fine enough for grains of 1 mm
                assert!((high - low) / 65535.0 < 1e-6 && *share > 0.0 && *share < 1.0);
            }
        }
        let wide = |name: &str| -> Vec<u32> {
            let numbers = bytes(&found[name]);
            numbers.chunks(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        };
        assert_eq!(wide("pair"), l.bonds.pair.iter().flatten().map(|grain| *grain as u32).collect::<Vec<_>>());
        // bonds 0 and 1 are broken from the frames of steps 30 and 60 on, in shear and in tension
        assert_eq!((bytes(&found["broke"]), bytes(&found["mode"])[..2].to_vec()), (vec![3, 6, 255, 255], vec![1, 0]));
        assert_eq!(floats(&found["broken"]), [0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2].map(f64::from));
        assert_eq!(floats(&found["load"]), steps.iter().map(|step| *step as f64).collect::<Vec<_>>());
        // the walls: two ends in 2D, four corners in 3D; the upper one moves down
        let walls = found["walls"].as_array().unwrap();
        assert_eq!((walls[0]["driven"].as_bool(), walls[1]["driven"].as_bool()), (Some(false), Some(true)));
        let points = floats(&walls[1]["points"]);
        let heights: Vec<f64> = points.chunks(d).map(|point| point[1]).collect();
        let corners = if d == 2 { 2 } else { 4 };
        for (frame, heights) in heights.chunks(corners).enumerate() {
            let top = history.wall_state(frame).unwrap().position[d + 1];
            assert!(heights.iter().all(|y| (y - top).abs() < 1e-8), "{heights:?}, {top}");
        }
        assert_eq!(found["eye"].is_null(), d == 2);
    }
}

#[test]
fn materials_have_colours_and_names() {
    let mut l = layout(2);
    l.materials = ["base", "mortar"].map(String::from).to_vec();
    l.grains.material = vec![0, 0, 1, 1];
    let (_folder, path) = sample(&l);
    let several = page(&path, &[]);
    let found = data(&several, "<script type=\"application/json\" id=\"moments\">");
    assert_eq!(bytes(&found["material"]), [0, 0, 1, 1]);
    assert!(several.contains("<i style=\"background:var(--grain-1)\"></i>mortar"));
    let result = several.split("<section id=\"result\">").nth(1).unwrap().split("</section>").next().unwrap();
    let source = result.split("src=\"data:image/svg+xml;base64,").nth(1).unwrap().split('"').next().unwrap();
    let svg = String::from_utf8(STANDARD.decode(source).unwrap()).unwrap();
    // at the first break grains 0 and 1 have lost a bond: grains 2 and 3, and the legend
    assert_eq!((svg.matches("#b9dcf2").count(), svg.contains(">mortar<")), (3, true), "{svg}");
    // one material needs neither
    let (_folder, path) = sample(&layout(2));
    let one = page(&path, &[]);
    assert!(
        data(&one, "<script type=\"application/json\" id=\"moments\">")["material"] == "" && !one.contains("</i>base")
    );
}

#[test]
fn a_history_of_one_frame_has_a_page_without_a_slider() {
    let l = layout(2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    write_course(&path, &l, Course { steps: 5, breaks: [30, 60] });
    let page = page(&path, &[]);
    assert!(!page.contains("id=\"moments\"") && page.contains("None of the 4 bonds broke."));
    well_formed(&page);
}

#[test]
fn a_report_needs_nothing_but_itself() {
    let mut named = layout(2);
    named.walls[1].name = "top</script><b>".into();
    named.parameters.scene = "{\"title\": \"<b>Press & \\\"pull\\\"\", \"thickness\": 0.5}".into();
    let unbonded = Layout { bonds: Bonds::default(), ..layout(2) };
    let bare = Layout { walls: vec![], observables: vec![], ..layout(2) };
    for (l, sections) in [
        (
            &named,
            &[
                "result",
                "load",
                "cracks",
                "emission",
                "chains",
                "velocities",
                "fabric",
                "energy",
                "accuracy",
                "run",
                "scene",
            ][..],
        ),
        (&unbonded, &["run", "load", "chains", "scene"]),
        (&bare, &["run", "cracks", "velocities", "scene"]),
        (&layout(3), &["run", "cracks", "chains", "velocities", "scene"]),
    ] {
        let (_folder, path) = sample(l);
        let page = page(&path, &[]);
        for section in sections {
            assert!(page.contains(&format!("<section id=\"{section}\">")), "{section}");
        }
        // every address is inside the page
        let addresses = |attribute: &str| -> Vec<String> {
            let parts = page.split(attribute).skip(1);
            parts.map(|rest| rest.split('"').next().unwrap().chars().take(30).collect()).collect()
        };
        let pictures = addresses(" src=\"");
        assert!(
            !pictures.is_empty() && pictures.iter().all(|address| address.starts_with("data:image/")),
            "{pictures:?}"
        );
        assert!(addresses(" href=\"").iter().all(|address| address.starts_with('#')));
        for outside in ["http:", "https:", "url(", "@import", "<script src", "<link", "<iframe"] {
            assert!(!page.contains(outside), "{outside}");
        }
        // a picture has a description, and the title of a scene is text
        assert_eq!(addresses(" alt=\"").iter().filter(|alt| !alt.is_empty()).count(), pictures.len());
        assert!(!page.contains("<b>"));
        well_formed(&page);
    }
    let (_folder, path) = sample(&unbonded);
    let page = page(&path, &[]);
    // an empty section gives the reason
    let section = page.split("<section id=\"cracks\">").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(section.contains("None: ") && section.contains("bonds"), "{section}");
}

/// The file that `dem-run limit --json` would print for a scene, with this limit of the upper wall.
fn limit_file(folder: &Path, limit: Option<f64>, outcome: &str, scene: &Value) -> PathBuf {
    let path = folder.join("limit.json");
    let loads = [json!({ "load": "grains.loads.0", "limit": 1.0 }), json!({ "load": "walls.top", "limit": limit })];
    let file = json!({ "outcome": outcome, "loads": loads, "grains": 4, "bonds": 4, "scene": scene });
    std::fs::write(&path, file.to_string()).unwrap();
    path
}

#[test]
fn a_limit_load_is_a_line_in_the_load_and_a_sentence() {
    let mut l = layout(2);
    l.parameters.scene = json!({ "thickness": 0.5, "time": { "step": 1, "end": 3 } }).to_string();
    let (folder, path) = sample(&l);
    let scene = json!({ "thickness": 0.5, "title": "another", "solver": { "tolerance": 1e-9 }, "time": { "step": 2, "end": 3.0 } });
    let limit = |load: f64| limit_file(folder.path(), Some(load), "limit", &scene);
    // 30 N at the first break, 100 N at the end; the load of a wall that pulls is negative
    for (load, shown) in [(120.0, true), (-120.0, true), (60.0, true), (550.0, false)] {
        limit(load);
        let page = page(&path, &["--limit", "limit.json"]);
        let load = f64::abs(load);
        let said = format!(
            "The limit load, an upper bound of that of the first break, is {load} N: the first bond broke at {} % of it.",
            dem_output::short(3000.0 / load)
        );
        assert!(page.contains(&said), "{said}");
        let caption = page.split("<figcaption>").find(|text| text.starts_with("Load of wall top over time")).unwrap();
        assert_eq!(caption.starts_with("Load of wall top over time, with the limit load."), shown);
        assert_eq!(caption.contains("; the limit load, 550 N, is beyond the axis."), !shown);
        let chart = page.split("alt=\"Load of wall top over time").next().unwrap();
        let source = chart.rsplit("src=\"data:image/svg+xml;base64,").next().unwrap().split('"').next().unwrap();
        let svg = String::from_utf8(STANDARD.decode(source).unwrap()).unwrap();
        assert_eq!(svg.contains(&format!("limit load: {load} N")), shown);
        if shown {
            // the axis holds the level
            let chart = data(
                &page[page.find("alt=\"Load of wall top over time").unwrap()..],
                "<script type=\"application/json\">",
            );
            assert!(chart["y"][1].as_f64().unwrap() > load.max(100.0) * 0.999);
        }
    }
    for (outcome, said) in
        [("unbounded", "some reactions bear any load"), ("broken_at_start", "the constant loads alone")]
    {
        limit_file(folder.path(), None, outcome, &scene);
        assert!(page(&path, &["--limit", "limit.json"]).contains(said), "{outcome}");
    }
}

#[test]
fn the_limit_load_of_another_scene_is_refused() {
    let (folder, path) = sample(&layout(2));
    let report = || dem_post(&path, &["report", "--limit", "limit.json"]);
    limit_file(folder.path(), Some(50.0), "limit", &json!({ "thickness": 0.6 }));
    refused(&report(), 2, &["limit.json", "another scene: thickness is 0.6 there and 0.5 in the run", "dem-run limit"]);
    limit_file(folder.path(), Some(50.0), "limit", &json!({ "thickness": 0.5, "seed": 2, "timer": 1 }));
    refused(&report(), 2, &["seed is 2 there and absent in the run"]);
    // without the scene, as older programs print it
    std::fs::write(folder.path().join("limit.json"), r#"{"outcome": "limit", "loads": []}"#).unwrap();
    refused(&report(), 2, &["limit.json", "missing field `scene`", "dem-run limit"]);
    std::fs::write(
        folder.path().join("limit.json"),
        r#"{"outcome": "limit", "loads": [{"load": "walls.left"}], "scene": {"thickness": 0.5}}"#,
    )
    .unwrap();
    refused(&report(), 2, &["no load of the load wall, walls.top, but of walls.left"]);
    refused(&dem_post(&path, &["report", "--limit", "missing.json"]), 2, &["missing.json", "cannot be read"]);
    let (folder, path) = sample(&Layout { walls: vec![], observables: vec![], ..layout(2) });
    limit_file(folder.path(), Some(50.0), "limit", &json!({ "thickness": 0.5 }));
    refused(&dem_post(&path, &["report", "--limit", "limit.json"]), 2, &["no load wall"]);
}

#[test]
fn a_single_sphere_is_drawn() {
    let (_folder, path) = fabric::lattice(3, 1);
    for command in ["velocities", "report"] {
        let output = dem_post(&path, &[command]);
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let table = dem_post(&path, &["velocities", "-o", "other"]);
    assert!(String::from_utf8_lossy(&table.stdout).contains("energy of translation (J)"));
}
