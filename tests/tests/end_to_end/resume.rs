//! Runs that end before their time and go on: what was recorded stays, and the end is that of a run
//! without a stop.

use crate::common::{Endless, Folder, SMALL, config, content, problems, program};
use dem_run::history::History;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use std::process::{Command, Stdio};
use std::time::Duration;

/// That two histories hold the same to the bit, but for the processor time, and come from the same
/// scene.
fn same(a: &History, b: &History) {
    let [one, other] = [a, b].map(|history| history.parameters().expect("parameters").scene);
    assert_eq!(one, other);
    for (one, other) in content(a).iter().zip(&content(b)) {
        assert!(one == other, "{one:.400}\n{other:.400}");
    }
    assert_eq!(content(a).len(), content(b).len());
}

/// The small compression, with frames and checkpoints so often that a kill hits any place of the
/// writer.
fn scene() -> Vec<String> {
    let mut args = vec![config("compression.json")];
    args.extend(SMALL.iter().map(ToString::to_string));
    args.extend(["--set", "output.every_steps=5", "--set", "output.checkpoint_every=7"].map(String::from));
    args
}

fn run(here: &Folder, file: &str, more: &[&str]) {
    let args: Vec<String> =
        ["run".to_string()].into_iter().chain(scene()).chain(["-o", file].map(String::from)).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).chain(more.iter().copied()).collect();
    here.dem_run(&args).succeeds();
}

/// What a kill left, and what became of it.
struct Killed {
    frames: usize,
    /// Frames that were beyond the last checkpoint.
    beyond: usize,
}

/// Starts the scene, or goes on with it, and kills the process when its file has so many `bytes`;
/// false if it ended before.
fn kill(here: &Folder, file: &str, bytes: u64) -> bool {
    let resumed = here.path(file).exists();
    let mut command = Command::new(program("dem-run"));
    match resumed {
        true => command.args(["resume", file]),
        false => command.arg("run").args(scene()).args(["-o", file]),
    };
    let command = command.current_dir(here.path("")).arg("--quiet").stdout(Stdio::null());
    let mut child = command.spawn().expect("start");
    let written = || std::fs::metadata(here.path(file)).map_or(0, |file| file.len());
    let mut runs = || child.try_wait().expect("status").is_none();
    while written() < bytes && runs() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let running = runs();
    child.kill().expect("kill");
    child.wait().expect("end");
    running
}

/// Kills a run, and what goes on with it, at `moments` random moments; it then goes on to its end.
/// The kills that hit.
fn killed(here: &Folder, whole: &History, file: &str, seed: u64, moments: usize) -> Vec<Killed> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut hits = vec![];
    for _ in 0..moments {
        let hit = kill(here, file, rng.random_range(0..whole.length()));
        if !here.path(file).exists() {
            // not even begun: the sample was being packed
            continue;
        }
        // it opens, and holds every frame that was complete
        let history = here.history(file);
        assert_eq!(history.steps(), &whole.steps()[..history.frames()]);
        for frame in 0..history.frames() {
            assert_eq!(history.grain_state(frame).expect("grains"), whole.grain_state(frame).expect("grains"));
            assert_eq!(history.contacts(frame).expect("contacts"), whole.contacts(frame).expect("contacts"));
        }
        let checkpoint = history.checkpoint().expect("checkpoint").map_or(0, |c| c.step);
        if hit {
            let beyond = history.steps().iter().filter(|step| **step > checkpoint).count();
            hits.push(Killed { frames: history.frames(), beyond });
        }
    }
    if !here.path(file).exists() {
        run(here, file, &["--quiet"]);
    }
    here.dem_run(&["resume", file, "--quiet"]).succeeds();
    same(whole, &here.history(file));
    // what a kill left while a file was made beside is gone
    let left: Vec<String> = here.names().into_iter().filter(|name| name.ends_with(".part")).collect();
    assert!(left.iter().all(|name| !name.contains(file)), "{left:?}");
    hits
}

/// The scene run without a stop.
fn whole(here: &Folder) -> History {
    run(here, "whole.h5", &[]);
    here.history("whole.h5")
}

#[test]
fn a_killed_run_goes_on_as_if_it_had_never_stopped() {
    let here = Folder::new();
    let whole = whole(&here);
    let mut hits = 0;
    for file in ["a.h5", "b.h5", "c.h5"] {
        hits += killed(&here, &whole, file, file.len() as u64 + u64::from(file.as_bytes()[0]), 4).len();
    }
    assert!(hits > 0, "no kill hit a run");
}

/// The long form, which docs/history.md names.
#[test]
#[ignore = "takes minutes: 200 kills"]
fn two_hundred_kills_lose_nothing() {
    let here = Folder::new();
    let whole = whole(&here);
    let mut hits = vec![];
    for round in 0.. {
        let file = format!("{round}.h5");
        hits.extend(killed(&here, &whole, &file, round, 5));
        std::fs::remove_file(here.path(&file)).unwrap_or_default();
        if hits.len() >= 200 {
            break;
        }
    }
    let most = hits.iter().map(|hit| hit.beyond).max().unwrap_or(0);
    let (low, high) = (hits.iter().map(|h| h.frames).min(), hits.iter().map(|h| h.frames).max());
    println!(
        "{} kills, after {low:?} to {high:?} of {} frames; every file opened with all of them,",
        hits.len(),
        whole.frames()
    );
    println!("went on from at most {most} frames before, and ended as the run without a stop, to the bit");
}

#[test]
fn an_interrupted_run_goes_on_from_its_last_step() {
    let here = Folder::new();
    let whole = whole(&here);
    let mut command = Command::new(program("dem-run"));
    command.arg("run").args(scene()).args(["-o", "a.h5", "--quiet"]).current_dir(here.path("")).stdout(Stdio::null());
    let mut child = command.stderr(Stdio::null()).spawn().expect("start");
    // once a few frames stand
    while !here.path("a.h5").exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(60));
    Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().expect("sh");
    assert_eq!(child.wait().expect("end").code(), Some(130));
    let history = here.history("a.h5");
    // nothing is computed twice: the last state is a checkpoint
    let last = history.steps().last().copied();
    assert_eq!(history.checkpoint().expect("read").map(|c| c.step), last);
    assert!(last < whole.steps().last().copied());
    drop(history);
    here.dem_run(&["resume", "a.h5", "--quiet"]).succeeds();
    same(&whole, &here.history("a.h5"));
    assert_eq!(here.history("a.h5").ending().expect("read"), whole.ending().expect("read"));
    // and again: there is nothing to do
    let before = here.read("a.h5");
    let told = here.dem_run(&["resume", "a.h5", "--quiet"]).succeeds();
    assert!(told.stdout.contains("nothing to do"), "{}", told.stdout);
    let told = here.dem_run(&["resume", "a.h5", "--quiet", "--json"]).json();
    assert_eq!(told["steps_made"], 0);
    assert_eq!(here.read("a.h5"), before);
}

/// A run to `end` (s), in `short.h5`, that goes on to `later` gives the same as one in one piece.
fn goes_on(here: &Folder, end: &str, later: &str) {
    run(here, "long.h5", &["--set", &format!("time.end={later}"), "--quiet"]);
    run(here, "short.h5", &["--set", &format!("time.end={end}"), "--quiet"]);
    here.dem_run(&["resume", "short.h5", "--until", later, "--quiet"]).succeeds();
    same(&here.history("long.h5"), &here.history("short.h5"));
}

#[test]
fn a_finished_run_goes_on_to_a_later_end() {
    let here = Folder::new();
    // the first end lies between two frames
    goes_on(&here, "0.0403", "0.08");
    // the summary counts the whole run
    let summary = here.dem_run(&["resume", "short.h5", "--until", "0.09", "--json", "--quiet"]).json();
    assert_eq!(summary["steps"], 900);
    assert_eq!(summary["grains"], 60);
    assert!(summary["solid_fraction"].as_f64().expect("a fraction") > 0.5);
}

/// A state between two frames, of a run that ended or was interrupted there, is no frame of the
/// resumed run. One that is killed before its next checkpoint goes on from that state.
#[test]
fn a_resumed_run_that_is_killed_loses_nothing() {
    use std::os::unix::fs::MetadataExt;
    let here = Folder::new();
    run(&here, "long.h5", &["--set", "time.end=0.08", "--quiet"]);
    run(&here, "short.h5", &["--set", "time.end=0.0403", "--quiet"]);
    let inode = |file: &str| std::fs::metadata(here.path(file)).map_or(0, |file| file.ino());
    let mut beyond = 0;
    for (k, wait) in [0, 0, 1, 3, 6, 12].into_iter().enumerate() {
        let file = format!("{k}.h5");
        std::fs::copy(here.path("short.h5"), here.path(&file)).expect("copy");
        let before = inode(&file);
        let mut command = Command::new(program("dem-run"));
        command.args(["resume", &file, "--until", "0.08", "--quiet"]).current_dir(here.path(""));
        let mut child = command.stdout(Stdio::null()).spawn().expect("start");
        while inode(&file) == before && child.try_wait().expect("status").is_none() {
            std::thread::sleep(Duration::from_micros(100));
        }
        std::thread::sleep(Duration::from_millis(wait));
        child.kill().expect("kill");
        child.wait().expect("end");
        let history = here.history(&file);
        let state = history.checkpoint().expect("read").expect("a checkpoint").step;
        beyond += usize::from(state == 403);
        drop(history);
        // a copy keeps it
        here.dem_post(&["pack", &file, "-o", &format!("packed-{file}"), "--quiet"]).succeeds();
        for file in [file.clone(), format!("packed-{file}")] {
            here.dem_run(&["resume", &file, "--until", "0.08", "--quiet"]).succeeds();
            same(&here.history("long.h5"), &here.history(&file));
        }
    }
    assert!(beyond > 0, "no kill came before the next checkpoint");
}

/// The new history replaces the old one, in which texts have other places.
#[test]
fn the_text_of_the_scene_may_become_longer() {
    let here = Folder::new();
    goes_on(&here, "0.02", "0.0205");
}

#[test]
fn a_run_goes_on_with_the_observables_that_its_history_has() {
    let here = Folder::new();
    run(&here, "a.h5", &["--set", "time.end=0.02", "--quiet"]);
    // as a program wrote it that did not measure this yet
    let file = hdf5::File::open_rw(here.path("a.h5")).expect("open");
    file.unlink("observables/substeps").expect("unlink");
    drop(file);
    here.dem_run(&["resume", "a.h5", "--until", "0.03", "--quiet"]).succeeds();
    let back = ["resume", "a.h5", "--until", "0.02", "--quiet"];
    here.dem_run(&back).fails(2, &["--until 0.02 s", "before the last state"]);
    let history = here.history("a.h5");
    assert!(history.observable("substeps").expect("read").is_none());
    let residual = history.observable("solver_residual").expect("read").expect("an observable");
    assert_eq!(residual.value.len(), 300);
}

#[test]
fn other_scenes_are_refused_with_what_differs() {
    let here = Folder::new();
    run(&here, "a.h5", &["--set", "time.end=0.02", "--quiet"]);
    let before = here.read("a.h5");
    let resume = |set: &str, more: &[&str]| {
        here.dem_run(&[&["resume", "a.h5", "--until", "0.03", "--set", set, "--quiet"], more].concat())
    };
    resume("bonds.strength=5", &[]).fails(2, &["bonds.strength", "10", "5", "cannot change"]);
    resume("bonds.strength=5", &["--force"]).fails(2, &["bonds.strength", "cannot change"]);
    resume("walls.top.force_rate=200", &[]).fails(2, &["walls.top.force_rate", "--force"]);
    resume("time.step=5e-5", &["--force"]).fails(2, &["time.step", "cannot change"]);
    resume("output.every_steps=7", &["--force"]).fails(2, &["output.every_steps"]);
    resume("solver.tolerance=0", &[]).fails(2, &["solver.tolerance"]);
    assert_eq!(here.read("a.h5"), before);
    resume("solver.tolerance=1e-7", &["--force"]).succeeds();
    assert_eq!(here.history("a.h5").steps().last(), Some(&300));
    // the scene before stays beside the new one, also when the run goes on with the new one
    here.dem_run(&["resume", "a.h5", "--until", "0.04", "--quiet"]).succeeds();
    let run = here.history("a.h5").parameters().expect("parameters");
    let scene: Value = serde_json::from_str(&run.scene).expect("JSON");
    let earlier: Value = serde_json::from_str(&run.earlier_scenes).expect("JSON");
    assert_eq!(scene["solver"]["tolerance"], 1e-7);
    assert_eq!((earlier.as_array().map(Vec::len), &earlier[0]["last_step"]), (Some(1), &json!(200)));
    assert_ne!(earlier[0]["scene"]["solver"]["tolerance"], 1e-7);
    assert_eq!(here.dem_post(&["info", "a.h5", "--json"]).json()["scene_changed_after"], json!([200]));
    here.dem_post(&["info", "a.h5", "--check"]).succeeds();
    let told = here.dem_post(&["info", "a.h5"]).succeeds();
    assert!(told.stdout.contains("after step 200"), "{}", told.stdout);
}

#[test]
fn files_that_cannot_go_on_are_left_as_they_are() {
    let here = Folder::new();
    run(&here, "a.h5", &["--set", "time.end=0.02", "--quiet"]);
    let whole = here.read("a.h5");
    let resume = |file: &str| here.dem_run(&["resume", file, "--until", "0.03", "--quiet"]);
    resume("none.h5").fails(4, &["none.h5"]);
    here.write("text.h5", "x,y,radius\n");
    resume("text.h5").fails(4, &["text.h5", "not an HDF5 file"]);
    std::fs::copy(problems().join("pressed.hdf5"), here.path("foreign.h5")).expect("copy");
    resume("foreign.h5").fails(4, &["foreign.h5", "not a history"]);
    let mut rng = Pcg64::seed_from_u64(5);
    for _ in 0..200 {
        let cut = rng.random_range(0..whole.len());
        here.write("cut.h5", &whole[..cut]);
        let outcome = resume("cut.h5");
        assert_eq!(outcome.code, Some(4), "cut at {cut}: {}", outcome.stderr);
        assert!(!outcome.stderr.contains("panicked"), "{}", outcome.stderr);
        assert_eq!(here.read("cut.h5"), &whole[..cut], "cut at {cut}");
    }
    // a byte that is another one: an error, or a result; never a panic, and never an end that hangs
    for _ in 0..40 {
        let mut wrong = whole.clone();
        let place = rng.random_range(0..wrong.len());
        wrong[place] ^= 1 << rng.random_range(0..8);
        here.write("wrong.h5", &wrong);
        let outcome = resume("wrong.h5");
        assert!(matches!(outcome.code, Some(0 | 2 | 3 | 4)), "byte {place}: {:?} {}", outcome.code, outcome.stderr);
        if outcome.code != Some(0) {
            assert_eq!(here.read("wrong.h5"), wrong, "byte {place}");
        }
    }
}

#[test]
fn a_history_that_is_being_written_is_refused() {
    let here = Folder::new();
    let endless = Endless::start(&here, "a.h5", 0);
    let words = ["a.h5", "in use by process", &endless.id().to_string()];
    here.dem_run(&["resume", "a.h5"]).fails(4, &words);
    // nor does another run take its place
    let scene = config("two-grains.json");
    here.dem_run(&["run", &scene, "-o", "a.h5", "--force"]).fails(4, &words);
    here.run_config("two-grains.json", &["-o", "b.h5", "--quiet"]);
    here.dem_post(&["pack", "b.h5", "-o", "a.h5", "--force"]).fails(4, &words);
    assert!(here.history("a.h5").writer().expect("a lock").is_some());
}

#[test]
fn a_full_disk_leaves_a_history_that_is_good_up_to_its_last_frame() {
    let here = Folder::new();
    run(&here, "whole.h5", &[]);
    let whole = here.history("whole.h5");
    // the system's limit on the size of a file stands in for the end of a disk
    let limit = whole.length() / 1024 / 2;
    let args = scene().join("' '");
    let command = format!(
        "trap '' XFSZ; ulimit -f {limit}; exec '{}' run '{args}' -o a.h5 --quiet",
        program("dem-run").display()
    );
    let output = Command::new("bash").args(["-c", &command]).current_dir(here.path("")).output().expect("bash");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("a.h5") && told.contains("disk full"), "{told}");
    let history = here.history("a.h5");
    assert!(history.frames() > 10 && history.frames() < whole.frames(), "{}", history.frames());
    let last = history.frames() - 1;
    assert_eq!(history.contacts(last).expect("contacts"), whole.contacts(last).expect("contacts"));
    drop(history);
    // and with room on the disk it goes on
    here.dem_run(&["resume", "a.h5", "--quiet"]).succeeds();
    same(&whole, &here.history("a.h5"));
}

#[test]
fn a_history_that_disappears_ends_the_run() {
    let here = Folder::new();
    let endless = Endless::start(&here, "a.h5", 0);
    std::fs::remove_file(here.path("a.h5")).expect("remove");
    let output = endless.end();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("moved, deleted or replaced"), "{told}");
}

#[test]
fn a_frame_holds_what_the_scene_asks_for() {
    let here = Folder::new();
    run(&here, "double.h5", &["--set", "time.end=0.02", "--quiet"]);
    run(&here, "single.h5", &["--set", "time.end=0.02", "--quiet", "--set", "output.precision=single"]);
    let less = ["--set", "time.end=0.02", "--quiet", "--set", "output.reactions=false"];
    run(&here, "less.h5", &less);
    let [double, single, less] = ["double.h5", "single.h5", "less.h5"].map(|name| here.history(name));
    let last = double.frames() - 1;
    let (a, b) = (double.grain_state(last).expect("grains"), single.grain_state(last).expect("grains"));
    assert!(a.position.iter().zip(&b.position).all(|(a, b)| (*a as f32) as f64 == *b));
    assert!(a.position != b.position);
    // what is observed does not depend on what is stored
    let load = |h: &History| h.observable("applied_force").expect("read").expect("observable");
    assert_eq!(load(&double), load(&single));
    assert_eq!(load(&double), load(&less));
    let contacts = less.contacts(last).expect("contacts");
    assert!(!contacts.is_empty() && contacts.reaction.is_empty() && contacts.moment.is_empty());
    assert_eq!(contacts.gap, double.contacts(last).expect("contacts").gap);
    here.dem_post(&["chains", "less.h5"]).fails(2, &["reactions", "output.reactions=true"]);
    for name in ["single.h5", "less.h5"] {
        for view in ["cracks", "stress-strain", "view"] {
            here.dem_post(&[view, name]).succeeds();
        }
        here.dem_post(&["info", name, "--check"]).succeeds();
    }
    here.dem_post(&["chains", "single.h5"]).succeeds();
    // each goes on in its own way
    for name in ["single.h5", "less.h5"] {
        here.dem_run(&["resume", name, "--until", "0.03", "--quiet"]).succeeds();
        assert_eq!(here.history(name).steps().last(), Some(&300));
    }
}

#[test]
fn a_run_that_was_killed_before_its_first_checkpoint_begins_anew() {
    let here = Folder::new();
    run(&here, "whole.h5", &["--set", "time.end=0.02", "--quiet"]);
    std::fs::copy(here.path("whole.h5"), here.path("a.h5")).expect("copy");
    let file = hdf5::File::open_rw(here.path("a.h5")).expect("open");
    file.dataset("checkpoint/index").expect("index").write_raw(&[0u64; 8]).expect("write");
    drop(file);
    // of one that has gone on for long, nothing is thrown away
    let before = here.read("a.h5");
    here.dem_run(&["resume", "a.h5", "--quiet"]).fails(4, &["no complete state", "damaged"]);
    assert_eq!(here.read("a.h5"), before);
    // a file each: HDF5's lock on one that was read here may live on in a program that another test
    // started meanwhile
    for (frames, name) in [(0u64, "b.h5"), (1, "c.h5")] {
        std::fs::write(here.path(name), &before).expect("write");
        let file = hdf5::File::open_rw(here.path(name)).expect("open");
        file.dataset("commit").expect("commit").write_scalar(&frames).expect("write");
        drop(file);
        here.dem_run(&["resume", name, "--quiet"]).succeeds();
        same(&here.history("whole.h5"), &here.history(name));
    }
}
