//! Packed histories: smaller, and the same in every analysis.

use crate::common::{Endless, Folder, SMALL};

#[test]
fn analyses_of_a_packed_history_are_the_same_to_the_byte() {
    let here = Folder::new();
    here.run_config("compression.json", &[&SMALL[..], &["-o", "a.h5", "--quiet"]].concat());
    let results = |name: &str| {
        for view in ["cracks", "chains", "velocities", "stress-strain"] {
            here.dem_post(&[view, "a.h5", "-o", &format!("{name}/{view}")]).succeeds();
        }
        let mut files: Vec<_> = ["cracks", "chains", "velocities", "stress-strain"]
            .iter()
            .flat_map(|view| std::fs::read_dir(here.path(&format!("{name}/{view}"))).expect("folder"))
            .map(|entry| entry.expect("entry").path())
            .collect();
        files.sort();
        files.iter().map(|file| std::fs::read(file).expect("read")).collect::<Vec<_>>()
    };
    let before = results("before");
    let report = here.dem_post(&["pack", "a.h5", "--json"]).json();
    let share = report["after"].as_f64().expect("bytes") / report["before"].as_f64().expect("bytes");
    assert!(share <= 0.75, "{share}");
    assert!(before == results("after"), "the analyses differ");
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    // and a run goes on from it
    here.dem_run(&["resume", "a.h5", "--set", "stop=null", "--until", "0.22", "--quiet"]).succeeds();
    assert_eq!(here.history("a.h5").steps().last(), Some(&2200));
    assert!(here.names().iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn a_copy_goes_where_it_is_sent() {
    let here = Folder::new();
    here.run_config("two-grains.json", &["-o", "a.h5", "--quiet"]);
    let before = here.read("a.h5");
    here.dem_post(&["pack", "a.h5", "-o", "b.h5"]).succeeds();
    assert_eq!(here.read("a.h5"), before);
    here.dem_post(&["pack", "a.h5", "-o", "b.h5"]).fails(4, &["b.h5", "exists"]);
    here.dem_post(&["pack", "a.h5", "-o", "b.h5", "--force"]).succeeds();
    here.dem_post(&["pack", "none.h5"]).fails(4, &["none.h5"]);
}

#[test]
fn the_file_of_a_killed_run_is_made_whole() {
    let here = Folder::new();
    let endless = Endless::start(&here, "a.h5", 3);
    // not while it is being written
    here.dem_post(&["pack", "a.h5"]).fails(4, &["in use by process"]);
    here.dem_post(&["info", "a.h5", "--repair"]).fails(4, &["in use by process"]);
    drop(endless);
    let frames = here.history("a.h5").frames();
    assert!(here.history("a.h5").open_ended());
    here.dem_post(&["info", "a.h5", "--repair"]).succeeds();
    assert!(!here.history("a.h5").open_ended());
    assert_eq!(here.history("a.h5").frames(), frames);
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    here.dem_post(&["view", "a.h5"]).succeeds();
    // a packed file stays packed
    here.dem_post(&["pack", "a.h5"]).succeeds();
    let before = here.read("a.h5");
    let told = here.dem_post(&["info", "a.h5", "--repair"]).succeeds();
    assert!(told.stdout.starts_with("nothing to repair"), "{}", told.stdout);
    assert_eq!(here.read("a.h5"), before);
}
