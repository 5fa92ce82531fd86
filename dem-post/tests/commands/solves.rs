//! What histories record of the solves of their steps.

use super::check::{damaged, put};
use super::*;
use dem_post::output::Folder;
use dem_post::{check, report};
use hdf5::H5Type;
use hdf5::types::{EnumMember, EnumType, IntSize, TypeDescriptor};

/// A code of a route, as stored in the file.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Route(u8);

// Sound: the type is transparent over the integer that is the enum's base type.
unsafe impl H5Type for Route {
    fn type_descriptor() -> TypeDescriptor {
        let members = SolverRoute::ALL.iter().zip(0..);
        let members = members.map(|(route, value)| EnumMember { name: route.label().into(), value }).collect();
        TypeDescriptor::Enum(EnumType { size: IntSize::U1, signed: false, members })
    }
}

/// A sample with these observables in four steps.
fn observed(observables: Vec<Observable>, rows: [&[f64]; 4]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let l = Layout { observables, walls: vec![], ..layout(2) };
    let mut writer = Writer::create(&path, &l, false).unwrap();
    for (step, row) in (1..).zip(rows) {
        writer.observe(step, step as f64 * 1e-3, row).unwrap();
    }
    frame(&mut writer, &l, COURSE, 0, 4e-3);
    writer.finish().unwrap();
    (folder, path)
}

/// Load errors with one step that has none, routes and false accelerations.
fn solved() -> (tempfile::TempDir, PathBuf) {
    let real = |name: &str| Observable::new(name, "", &[]);
    let observables = vec![real(LOAD_ERROR), Observable::route(), real(FALSE_ACCELERATION)];
    observed(observables, [&[1e-6, 0.0, 0.5], &[3e-6, 2.0, 0.5], &[f64::NAN, 3.0, 0.75], &[2e-6, 2.0, 0.25]])
}

/// The solver's figures of a report, as JSON, and its page. No process is started: it would inherit
/// the locks of files that other tests have open.
fn reported(path: &Path) -> (serde_json::Value, String) {
    let history = History::open(path).unwrap();
    let found = report::read(&history, &[], None, None, true).unwrap();
    let folder = path.with_file_name("run-post");
    report::write(&history, &found, &mut Folder::create(folder.clone()).unwrap()).unwrap();
    (serde_json::to_value(found.accuracy).unwrap(), std::fs::read_to_string(folder.join("report.html")).unwrap())
}

fn checked(path: &Path) -> serde_json::Value {
    serde_json::to_value(check::read(&History::open(path).unwrap(), true).unwrap()).unwrap()
}

#[test]
fn a_report_tells_methods_load_errors_and_false_accelerations_apart() {
    let (_folder, path) = solved();
    let (found, page) = reported(&path);
    assert_eq!(found["routes"], serde_json::json!([1, 0, 2, 1]));
    assert_eq!(found["load_error"]["worst"], 3e-6);
    assert_eq!(found["load_error"]["median"], 2e-6);
    assert_eq!(found["false_acceleration"]["worst"], 0.75);
    for part in ["1 EXTRAPOLATION, 2 INTERIOR_POINT, 1 SWEEPS", "Load error", "False acceleration"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("false acceleration where none was reported"));
}

/// Histories older than version 4 have one observable for both.
#[test]
fn a_report_says_what_the_load_error_of_an_older_history_is() {
    let (_folder, path) = observed(vec![Observable::new(LOAD_ERROR, "", &[])], [&[0.5], &[1e-6], &[1e-6], &[1e-6]]);
    let (found, page) = reported(&path);
    assert_eq!(found["load_error"]["worst"], 0.5);
    assert!(found["false_acceleration"].is_null() && found["routes"].is_null());
    assert!(page.contains("Load error; false acceleration where none was reported"));
}

#[test]
fn a_check_knows_routes_and_load_errors() {
    let (_folder, path) = solved();
    assert_eq!(checked(&path)["violations"], serde_json::json!([]));
    for (place, row, words, value) in [
        ("observables/solver_route/value", 2, "unknown code 9", None),
        ("observables/solver_load_error/value", 1, "inf", Some(f64::INFINITY)),
        ("observables/false_acceleration/value", 1, "NaN", Some(f64::NAN)),
    ] {
        let copy = path.with_file_name("copy.h5");
        std::fs::copy(&path, &copy).unwrap();
        let copy = damaged(&copy, |file| match value {
            Some(value) => put(file, place, &[row], value),
            None => put(file, place, &[row], Route(9)),
        });
        let found = checked(&copy);
        let violation = &found["violations"][0];
        assert_eq!((&violation["place"], &violation["row"]), (&place.into(), &row.into()), "{found:#}");
        assert!(violation["what"].as_str().unwrap().contains(words), "{found:#}");
    }
}
