//! Files that are no history, given to every command of `dem-post`: exit 4, what is wrong, the
//! remedy, nothing written.

use crate::common::{Folder, SMALL};

const VIEWS: [&str; 10] =
    ["info", "cracks", "emission", "chains", "velocities", "fabric", "frames", "film", "stress-strain", "report"];

/// Every view refuses the file `a.h5` in this folder.
fn refused(here: &Folder, parts: &[&str]) {
    VIEWS.iter().for_each(|view| refused_by(view, here, 4, parts));
}

fn refused_by(view: &str, here: &Folder, code: i32, parts: &[&str]) {
    let before = here.names();
    let outcome = here.dem_post(&[view, "a.h5"]).fails(code, &[&["a.h5"], parts].concat());
    assert_eq!(outcome.stdout, "", "{view}");
    assert_eq!(here.names(), before, "{view}");
}

#[test]
fn a_missing_file_and_a_folder() {
    let here = Folder::new();
    refused(&here, &["does not exist", "dem-run run"]);
    std::fs::create_dir(here.path("a.h5")).expect("folder");
    for view in VIEWS {
        // a folder may be a sweep
        match view {
            "report" => refused_by(view, &here, 2, &["holds no manifest.json", "dem-run sweep", "or a history"]),
            _ => refused_by(view, &here, 4, &["folder", "give the .h5 file"]),
        }
    }
}

#[test]
fn a_text_an_empty_file_and_a_picture() {
    let here = Folder::new();
    for content in [&b"step,time\n0,0\n"[..], b"", b"\x89PNG\r\n\x1a\n"] {
        here.write("a.h5", content);
        refused(&here, &["not an HDF5 file", "give the .h5 file"]);
    }
}

#[test]
fn an_hdf5_file_of_another_program() {
    let here = Folder::new();
    for dataset in ["commit", "temperature"] {
        let file = hdf5::File::create(here.path("a.h5")).expect("create");
        file.new_dataset::<u64>().create(dataset).expect("dataset");
        file.close().expect("close");
        refused(&here, &["not a history of dem-run", "give the .h5 file"]);
    }
}

#[test]
fn a_truncated_history_at_any_length() {
    let here = Folder::new();
    here.run_config("compression.json", &[&SMALL[..], &["-o", "whole.h5", "--quiet"]].concat());
    let whole = here.read("whole.h5");
    // near the start, where the first headers are, through the middle, and the last byte
    let mut cuts = vec![8, 16, 47, 48, 96, 511, 512, 1024, 2048, 4096, whole.len() - 4096, whole.len() - 1];
    cuts.extend((1..12).map(|k| k * whole.len() / 12));
    for cut in cuts {
        here.write("a.h5", &whole[..cut]);
        for view in VIEWS {
            let outcome = here.dem_post(&[view, "a.h5"]).fails(4, &["a.h5"]);
            let named = ["truncated", "not an HDF5 file", "damaged"].iter().any(|word| outcome.stderr.contains(word));
            assert!(named, "cut at {cut}: {}", outcome.stderr);
            assert_eq!(here.names(), ["a.h5", "whole.h5"], "cut at {cut}");
        }
    }
}

#[test]
fn what_a_history_lacks_is_named_with_the_remedy() {
    let here = Folder::new();
    here.run_config("incline.json", &[]);
    here.dem_post(&["cracks", "incline.h5"]).fails(2, &["incline.h5", "need bonds", "add `bonds`"]);
    here.dem_post(&["stress-strain", "incline.h5"]).fails(2, &["incline.h5", "driven wall", "velocity or a force"]);
    assert_eq!(here.names(), ["incline.h5"]);
    here.dem_post(&["fly", "incline.h5"]).fails(2, &["fly"]);
    here.dem_post(&["info"]).fails(2, &["FILE.h5"]);
    here.dem_post(&["chains", "incline.h5", "--times", "soon"]).fails(2, &["soon"]);
}

#[test]
fn a_folder_for_results_that_is_a_file() {
    let here = Folder::new();
    here.run_config("column.json", &[]);
    here.write("taken", "precious");
    here.dem_post(&["chains", "column.h5", "-o", "taken"]).fails(4, &["taken"]);
    assert_eq!(here.read("taken"), b"precious");
}
