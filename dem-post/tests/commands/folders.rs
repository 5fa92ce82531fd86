//! Results folders belong to one history.

use super::*;

/// Histories of two runs under one name in two folders, A and B; B has other grains.
fn two() -> (tempfile::TempDir, [PathBuf; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["A", "B"].map(|name| folder.path().join(name).join("0001.h5"));
    for (path, start) in paths.iter().zip(["2026-01-01T00:00:00Z", "2026-01-02T00:00:00Z"]) {
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        write(path, &begun(start));
    }
    (folder, paths)
}

fn begun(start: &str) -> Layout {
    let l = layout(2);
    Layout { parameters: Parameters { start: start.into(), ..l.parameters }, ..l }
}

/// Runs `dem-post` in `folder`.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dem-post")).current_dir(folder).args(arguments).output().unwrap()
}

fn succeeds(output: &Output) -> String {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{message}");
    message
}

fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names(folder).into_iter().map(|name| (name.clone(), std::fs::read(folder.join(name)).unwrap())).collect()
}

#[test]
fn results_of_two_runs_do_not_mix() {
    let (here, _paths) = two();
    let here = here.path();
    let post = here.join("0001-post");
    succeeds(&run(here, &["cracks", "A/0001.h5"]));
    let before = content(&post);
    for command in ["stress-strain", "cracks", "chains", "velocities", "report", "view"] {
        refused(&run(here, &[command, "B/0001.h5"]), 4, &["0001-post", "A/0001.h5", "B/0001.h5", "-o", "--force"]);
    }
    assert!(content(&post) == before, "something was written");
    // results of the same run share a folder, and a second call replaces its own files
    succeeds(&run(here, &["stress-strain", "A/0001.h5"]));
    succeeds(&run(here, &["cracks", "A/0001.h5"]));
    assert!(
        content(&post).iter().filter(|(name, _)| !name.starts_with("stress") && !name.starts_with("force")).eq(&before)
    );
    // the other run needs another folder
    succeeds(&run(here, &["stress-strain", "B/0001.h5", "-o", "other"]));
    assert!(post.join("cracks.csv").exists() && here.join("other/stress-strain.csv").exists());
}

#[test]
fn a_folder_is_taken_over_by_force_and_nothing_else_is_lost() {
    let (here, _paths) = two();
    let here = here.path();
    let post = here.join("0001-post");
    succeeds(&run(here, &["cracks", "A/0001.h5"]));
    let results = names(&post).len();
    std::fs::write(post.join("notes.txt"), "mine").unwrap();
    std::fs::create_dir(post.join("drafts")).unwrap();
    let message = succeeds(&run(here, &["stress-strain", "B/0001.h5", "--force"]));
    assert!(message.contains(&format!("removed {results} files")), "{message}");
    let left = names(&post);
    assert!(
        left.contains(&"notes.txt".into()) && left.contains(&"drafts".into()) && !left.contains(&"cracks.csv".into())
    );
    refused(&run(here, &["cracks", "A/0001.h5"]), 4, &["A/0001.h5", "B/0001.h5"]);
    succeeds(&run(here, &["velocities", "B/0001.h5"]));
}

#[test]
fn another_run_in_the_place_of_a_history_is_another_history() {
    let (here, paths) = two();
    let here = here.path();
    succeeds(&run(here, &["cracks", "A/0001.h5"]));
    std::fs::copy(&paths[1], &paths[0]).unwrap();
    refused(&run(here, &["stress-strain", "A/0001.h5"]), 4, &["an earlier run in", "made anew", "--force"]);
    succeeds(&run(here, &["stress-strain", "A/0001.h5", "--force"]));
    assert!(!here.join("0001-post/cracks.csv").exists());
}

#[test]
fn a_history_stays_the_same_while_it_grows_is_packed_or_moves() {
    let (here, paths) = two();
    let here = here.path();
    let mut longer = begun("2026-01-01T00:00:00Z");
    // a resumed run may have a different end
    longer.parameters.scene = "{\"thickness\": 0.5, \"time\": {\"end\": 2}}".into();
    write_course(&here.join("longer.h5"), &longer, Course { steps: 120, ..COURSE });
    succeeds(&run(here, &["cracks", "A/0001.h5"]));
    std::fs::rename(here.join("longer.h5"), &paths[0]).unwrap();
    succeeds(&run(here, &["pack", "A/0001.h5"]));
    succeeds(&run(here, &["chains", "A/0001.h5"]));
    std::fs::rename(&paths[0], here.join("0001.h5")).unwrap();
    succeeds(&run(here, &["velocities", "0001.h5"]));
    // a copy beside it is another history
    std::fs::copy(here.join("0001.h5"), &paths[0]).unwrap();
    refused(&run(here, &["velocities", "A/0001.h5"]), 4, &["0001.h5"]);
}

#[test]
fn what_dem_post_did_not_write_is_not_replaced() {
    let (here, _paths) = two();
    let here = here.path();
    std::fs::create_dir(here.join("mine")).unwrap();
    std::fs::write(here.join("mine/forces.csv"), "mine").unwrap();
    refused(&run(here, &["chains", "A/0001.h5", "-o", "mine"]), 4, &["mine/forces.csv", "--force"]);
    assert_eq!(std::fs::read(here.join("mine/forces.csv")).unwrap(), b"mine");
    // other files stay beside it
    succeeds(&run(here, &["velocities", "A/0001.h5", "-o", "mine"]));
    succeeds(&run(here, &["chains", "A/0001.h5", "-o", "mine", "--force"]));
    assert_ne!(std::fs::read(here.join("mine/forces.csv")).unwrap(), b"mine");
    std::fs::write(here.join("mine/.dem-post.json"), "{").unwrap();
    refused(&run(here, &["chains", "A/0001.h5", "-o", "mine"]), 4, &[".dem-post.json", "--force"]);
}

#[test]
fn comparisons_and_strengths_have_folders_of_their_own() {
    let (here, _paths) = two();
    let here = here.path();
    let twice = |arguments: &[&str]| (0..2).for_each(|_| drop(succeeds(&run(here, arguments))));
    twice(&["compare", "A/0001.h5", "B/0001.h5"]);
    refused(&run(here, &["compare", "B/0001.h5", "A/0001.h5"]), 4, &["0001-compare", "A/0001.h5", "B/0001.h5"]);
    refused(&run(here, &["cracks", "A/0001.h5", "-o", "0001-compare"]), 4, &["0001-compare"]);
    succeeds(&run(here, &["compare", "B/0001.h5", "A/0001.h5", "--force"]));
    twice(&["frames", "A/0001.h5", "--every", "5"]);
    refused(&run(here, &["frames", "B/0001.h5"]), 4, &["0001-frames"]);
}

#[test]
fn a_folder_holds_no_half_file() {
    let (here, _paths) = two();
    let here = here.path();
    succeeds(&run(here, &["report", "A/0001.h5"]));
    let page = std::fs::read(here.join("0001-post/report.html")).unwrap();
    // a folder has the name of the next picture
    std::fs::create_dir(here.join("0001-post/chains.png")).unwrap();
    refused(&run(here, &["chains", "A/0001.h5"]), 4, &["chains.png"]);
    assert!(names(&here.join("0001-post")).iter().all(|name| !name.ends_with(".part")));
    assert_eq!(std::fs::read(here.join("0001-post/report.html")).unwrap(), page);
}

#[test]
fn control_characters_never_reach_the_terminal() {
    let mut odd = layout(2);
    odd.walls[1].name = "top\u{1b}[2J\u{7}\u{9b}31m".into();
    odd.parameters.host = "h\u{1b}]0;x\u{7}".into();
    odd.parameters.scene = "{\"title\": \"a\\u001b[31m\", \"thickness\": 0.5}".into();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run\u{1b}[1m.h5");
    write(&path, &odd);
    let mut other = layout(2);
    other.parameters.scene = "{\"title\": \"b\\u001b[31m\", \"thickness\": 0.5}".into();
    write(&folder.path().join("other.h5"), &other);
    for arguments in [
        &["info"][..],
        &["info", "--check"],
        &["info", "--json"],
        &["cracks"],
        &["stress-strain"],
        &["stress-strain", "--json"],
        &["stress-strain", "--wall", "b\u{1b}[0m"],
        &["compare", "other.h5"],
        &["compare", "no\u{1b}.h5"],
        &["report"],
        &["view", "-o", "run\u{1b}[1m.h5"],
    ] {
        let output = dem_post(&path, arguments);
        let shown = [output.stdout, output.stderr].concat();
        let shown = String::from_utf8(shown).unwrap();
        assert!(!shown.contains(|c: char| c.is_control() && c != '\n'), "{arguments:?}: {shown:?}");
        assert!(shown.contains("\\u001b"), "{arguments:?}: {shown}");
    }
    let found = json(&dem_post(&path, &["stress-strain", "--json"]));
    assert_eq!(found["wall"], odd.walls[1].name.as_str());
}

#[test]
fn a_file_that_another_program_writes_is_not_called_damaged() {
    let (_folder, path) = sample(&layout(2));
    // the lock that HDF5 takes on a file open for writing
    let held = std::fs::File::open(&path).unwrap();
    held.lock().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    command.env("HDF5_USE_FILE_LOCKING", "TRUE").arg("info").arg(&path);
    refused(&command.output().unwrap(), 4, &["open for writing in another program", "close it there"]);
    held.unlock().unwrap();
    assert!(command.output().unwrap().status.success());
}

#[test]
fn a_file_is_no_folder_for_results() {
    let (here, _paths) = two();
    std::fs::write(here.path().join("a.json"), "{}").unwrap();
    for arguments in
        [&["cracks", "A/0001.h5", "-o", "a.json"][..], &["compare", "A/0001.h5", "B/0001.h5", "-o", "a.json"]]
    {
        refused(&run(here.path(), arguments), 4, &["cannot write a.json", "it is a file, not a folder"]);
    }
}
