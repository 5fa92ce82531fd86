//! Packings that are made once: `dem-run pack`, and what the runs of a sweep share.

use crate::common::{Folder, SMALL, config, content};
use serde_json::{Value, json};
use std::fs;

/// The scene of [`SMALL`] as the values of a sweep, which ends after a few steps.
fn small() -> Value {
    let values = SMALL.iter().filter_map(|set| set.split_once('='));
    let values = values.chain([("time.end", "0.02")]);
    values.map(|(path, value)| (path.to_string(), serde_json::from_str::<Value>(value).expect("JSON"))).collect()
}

/// The files in a folder, sorted, with their content.
fn files(here: &Folder, folder: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(here.path(folder)).expect("folder").map(|entry| entry.expect("entry"));
    let content = |entry: &fs::DirEntry| fs::read(entry.path()).expect("a file");
    let mut files: Vec<_> =
        entries.map(|entry| (entry.file_name().into_string().expect("UTF-8"), content(&entry))).collect();
    files.sort();
    files
}

#[test]
fn a_sweep_packs_each_sample_once_and_its_histories_are_those_of_runs_alone() {
    let here = Folder::new();
    let vary = json!([{ "seed": [1, 2] }, { "bonds.strength": [5, 10, 20] }]);
    let sweep = json!({ "scene": config("compression.json"), "set": small(), "vary": vary });
    here.write("sweep.json", sweep.to_string());
    // three runs of a sample begin together: two of them wait
    let told = here.dem_run(&["sweep", "sweep.json", "-o", "out", "--jobs", "3", "--json", "-q"]).json();
    let packings = files(&here, "out/packings");
    assert_eq!(packings.len(), 2, "{:?}", packings.iter().map(|(name, _)| name).collect::<Vec<_>>());

    // the time of a packing is in the run that made it
    let time = |id: u64| -> f64 {
        let state: Value = serde_json::from_slice(&here.read(&format!("out/runs/{id:04}.state.json"))).expect("JSON");
        state["summary"]["preparation_time"].as_f64().expect("a time")
    };
    let mut times: Vec<f64> = (1..=6).map(time).collect();
    times.sort_by(f64::total_cmp);
    assert!(times[4] > 3.0 * times[3], "two runs of six packed: {times:?}");

    let alone: Vec<_> = (1..=6)
        .map(|id| {
            let scene = format!("out/runs/{id:04}.json");
            here.dem_run(&["run", &scene, "-o", "alone.h5", "--force", "-q"]).succeeds();
            let alone = here.history("alone.h5");
            let shared = here.history(&format!("out/runs/{id:04}.h5"));
            let fraction =
                |history: &dem_run::history::History| history.parameters().expect("parameters").solid_fraction;
            assert_eq!(fraction(&shared).map(f64::to_bits), fraction(&alone).map(f64::to_bits));
            let content = [&shared, &alone].map(content);
            assert!(content[0] == content[1], "run {id} differs: {}", told["runs"][id - 1]["values"]);
            content[0].clone()
        })
        .collect();
    assert!(alone[0] != alone[3], "two samples");

    // a damaged packing is made again, another is left as it is
    let (damaged, whole) = &packings[0];
    here.write(&format!("out/packings/{damaged}"), &whole[..whole.len() - 3]);
    for id in [1, 4] {
        fs::remove_file(here.path(&format!("out/runs/{id:04}.h5"))).expect("remove");
    }
    here.dem_run(&["sweep", "sweep.json", "-o", "out", "-q"]).succeeds();
    assert_eq!(files(&here, "out/packings"), packings);
    for id in [1, 4] {
        assert!(content(&here.history(&format!("out/runs/{id:04}.h5"))) == alone[id - 1], "run {id} differs");
    }
}

#[test]
fn a_packed_sample_is_that_of_the_run() {
    let here = Folder::new();
    let small = [&SMALL[..], &["--set", "time.end=0.02"]].concat();
    let scene = config("compression.json");
    let told = here.dem_run(&[&["pack", &scene, "--json", "-q"], &small[..]].concat()).json();
    let run = here.run_config("compression.json", &[&small[..], &["-o", "a.h5", "--write-sample", "a.csv"]].concat());
    assert_eq!(here.read("compression-sample.csv"), here.read("a.csv"));
    assert_eq!((&told["grains"], &told["solid_fraction"]), (&run["grains"], &run["solid_fraction"]));
    assert_eq!(told["sample"], "compression-sample.csv");

    // the command that it prints runs the scene with the sample, to the bit
    here.dem_run(&[&["pack", &scene, "-q"], &small[..]].concat()).fails(4, &["exists", "--force", "-o FILE.csv"]);
    let said = here.dem_run(&[&["pack", &scene, "-q", "-o", "b.csv"], &small[..]].concat()).succeeds().stdout;
    let command = said.lines().last().expect("a command").trim();
    let sets = command.split(" --set ").skip(1).flat_map(|set| ["--set", set.trim_matches('\'')]);
    here.run_config("compression.json", &["-o", "b.h5"].into_iter().chain(sets).collect::<Vec<_>>());
    assert!(content(&here.history("b.h5")) == content(&here.history("a.h5")));
}

#[test]
fn only_random_samples_are_packed() {
    let here = Folder::new();
    here.dem_run(&["pack", &config("column.json")]).fails(2, &["sample: ", "column.json", "sample.random", "lattice"]);
    let dense = "sample.random.preparation.compaction.solid_fraction=0.95";
    here.dem_run(&[&["pack", &config("compression.json")], &SMALL[..], &["--set", dense]].concat())
        .fails(2, &["sample.random.preparation", "0.95", "lower solid_fraction"]);
    here.dem_run(&["pack", &config("compression.json"), "-o", "no/where.csv"]).fails(4, &["no/where.csv", "create it"]);
    assert_eq!(here.names(), [""; 0]);
}
