//! The main job: the compression of 430 grains, and the four views of it.

use crate::common::{Folder, Outcome, SMALL};
use dem_run::history::History;
use serde_json::Value;

/// The files of each view, without the folder.
const VIEWS: [(&str, &[&str]); 7] = [
    ("info", &[]),
    (
        "cracks",
        &[
            "ruptures.csv",
            "broken.csv",
            "broken.svg",
            "broken.png",
            "fragments.csv",
            "fragments.svg",
            "fragments.png",
            "fragment-list.csv",
            "fragment-map.svg",
            "fragment-map.png",
            "decohesion.svg",
            "decohesion.png",
            "cracks.csv",
            "cracks.svg",
            "cracks.png",
            "crack-segments.csv",
            "crack-growth.csv",
            "crack-front.csv",
            "crack-front.svg",
            "crack-front.png",
        ],
    ),
    (
        "emission",
        &[
            "emission-events.csv",
            "emission-magnitudes.csv",
            "emission-b-values.csv",
            "emission.svg",
            "emission.png",
            "emission-magnitudes.svg",
            "emission-magnitudes.png",
        ],
    ),
    (
        "chains",
        &[
            "forces.csv",
            "chains.svg",
            "chains.png",
            "distribution.csv",
            "distribution.svg",
            "distribution.png",
            "force-chains.csv",
            "force-chains.svg",
            "force-chains.png",
            "force-chain-lengths.csv",
            "force-chain-lengths.svg",
            "force-chain-lengths.png",
        ],
    ),
    ("fabric", &["fabric.csv", "fabric.svg", "fabric.png", "fabric-stress.svg", "fabric-stress.png"]),
    ("velocities", &["velocities.csv", "velocities.svg", "velocities.png"]),
    (
        "stress-strain",
        &[
            "stress-strain.csv",
            "stress-strain.svg",
            "stress-strain.png",
            "force-displacement.svg",
            "force-displacement.png",
        ],
    ),
];

fn total(broken: &Value) -> u64 {
    match broken {
        Value::Array(modes) => modes.iter().filter_map(Value::as_u64).sum(),
        Value::Object(modes) => modes.values().filter_map(Value::as_u64).sum(),
        _ => panic!("numbers of broken bonds by mode: {broken}"),
    }
}

#[test]
fn the_compression_breaks_its_sample_and_the_views_show_it() {
    let here = Folder::new();
    let summary = here.run_config("compression.json", &[]);
    let bonds = summary["bonds"].as_u64().expect("bonds");
    let broken = total(&summary["broken"]);
    assert!(20 * broken >= bonds, "{broken} of {bonds} bonds broke");
    assert_eq!(summary["grains"], 430);
    assert!(summary["solid_fraction"].as_f64().expect("solid fraction") >= 0.82);
    residuals_are_those_of_the_history(&here, &summary);
    assert!(summary["cpu_time"].as_f64().expect("CPU time") > 0.0);
    assert_eq!(here.names(), ["compression.h5"]);

    for (view, files) in VIEWS {
        // the view `info` writes no files
        let folder = if files.is_empty() { &[][..] } else { &["-o", view] };
        let json = here.dem_post(&[&[view, "compression.h5", "--json"], folder].concat()).json();
        assert!(json.is_object(), "{view}: {json}");
        if let Some(told) = json.get("broken") {
            assert_eq!(total(told), broken, "{view}");
        }
        let Outcome { stdout, .. } = here.dem_post(&[&[view, "compression.h5", "--quiet"], folder].concat()).succeeds();
        assert!(stdout.lines().count() >= 4, "{view}: {stdout}");
        for file in files {
            check_file(&format!("{view}/{file}"), &here.read(&format!("{view}/{file}")));
        }
        let mut written: Vec<_> = files.to_vec();
        written.sort_unstable();
        assert_eq!(names_in(&here, view), written, "{view}");
    }
}

/// The summary's worst residual is that of the recorded steps; none of them missed the tolerance
/// before the first bond broke.
fn residuals_are_those_of_the_history(here: &Folder, summary: &Value) {
    let history = History::open(&here.path("compression.h5")).expect("a history");
    let residual = history.observable("solver_residual").expect("read").expect("an observable");
    let first = history.ruptures().expect("ruptures").first().expect("a rupture").step;
    let tolerance = summary["tolerance"].as_f64().expect("tolerance");
    assert_eq!(summary["steps"], residual.value.len());
    let worst = residual.value.iter().copied().fold(0.0, f64::max);
    assert_eq!(summary["worst_residual"].as_f64().expect("residual"), worst);
    let missed = residual.value.iter().filter(|r| **r > tolerance).count();
    assert_eq!(summary["missed_tolerance"], missed);
    let before: Vec<f64> =
        residual.value.iter().zip(&residual.step).filter(|(_, s)| **s < first).map(|(r, _)| *r).collect();
    assert!(before.len() > 1000, "the first bond breaks in step {first}");
    assert!(before.iter().all(|r| *r <= tolerance), "{:e}", before.iter().copied().fold(0.0, f64::max));
}

/// The names in a folder, sorted; none where it does not exist.
fn names_in(here: &Folder, folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(here.path(folder)).into_iter().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("entry").file_name().into_string().expect("UTF-8")).collect();
    // the record of whose results these are
    names.retain(|name| name != ".dem-post.json");
    names.sort();
    names
}

/// A file is what its name says, and holds something.
fn check_file(name: &str, content: &[u8]) {
    match name.rsplit('.').next() {
        Some("png") => {
            assert!(content.starts_with(b"\x89PNG\r\n\x1a\n"), "{name}");
            // the last chunk of every PNG
            assert!(content.len() > 5_000 && content[content.len() - 8..].starts_with(b"IEND"), "{name}");
        }
        Some("svg") => {
            let text = std::str::from_utf8(content).expect("UTF-8").trim();
            assert!(text.starts_with("<svg") && text.ends_with("</svg>"), "{name}");
            assert!(text.matches('<').count() > 20, "{name}");
        }
        _ => {
            let text = std::str::from_utf8(content).expect("UTF-8");
            let columns: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
            assert!(columns.len() > 1 && columns[0] > 1, "{name}");
            assert!(columns.iter().all(|n| *n == columns[0]), "{name}");
        }
    }
}

#[test]
fn views_go_to_a_folder_named_after_the_history() {
    let here = Folder::new();
    here.run_config("compression.json", &[&SMALL[..], &["-o", "small.h5", "--quiet"]].concat());
    let Outcome { stderr, .. } = here.dem_post(&["cracks", "small.h5"]).succeeds();
    assert!(stderr.contains("wrote small-post/ruptures.csv"), "{stderr}");
    assert_eq!(here.names(), ["small-post", "small.h5"]);
}

#[test]
fn the_summary_names_the_commands_that_look_at_it() {
    let here = Folder::new();
    let scene = crate::common::config("compression.json");
    let Outcome { stdout, stderr, .. } = here.dem_run(&[&["run", &scene], &SMALL[..]].concat()).succeeds();
    assert!(stdout.contains("CPU time"), "{stdout}");
    assert!(stderr.contains("packing the sample"), "{stderr}");
    let commands: Vec<&str> = stdout.lines().filter_map(|line| line.strip_prefix("  dem-post ")).collect();
    assert_eq!(commands.len(), 5, "{stdout}");
    for command in commands {
        here.dem_post(&command.split(' ').collect::<Vec<_>>()).succeeds();
    }
}
