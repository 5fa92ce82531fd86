//! Ctrl-C and SIGTERM in the middle of a run.

use crate::common::{Folder, PATIENCE, config, program};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Start a run in a folder and wait for a line on its stderr that has this part.
fn start(here: &Folder, args: &[&str], part: &str) -> (Child, impl Iterator<Item = String> + use<>) {
    let mut command = Command::new(program("dem-run"));
    command.arg("run").args(args).current_dir(here.path(""));
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("start");
    let mut lines = BufReader::new(child.stderr.take().expect("stderr")).lines().map(|line| line.expect("UTF-8"));
    assert!(lines.any(|line| line.contains(part)), "the run ended without {part:?}");
    (child, lines)
}

/// `kill` of the shell: the program of that name is not on every machine.
fn send(signal: &str, child: &Child) {
    let status = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status();
    assert!(status.expect("sh").success());
}

/// The exit code; a run that hangs fails its test.
fn end(mut child: Child) -> Option<i32> {
    let patience = Instant::now() + PATIENCE;
    while Instant::now() < patience {
        if let Some(status) = child.try_wait().expect("status") {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().expect("kill");
    panic!("the run goes on {PATIENCE:?} after the signal");
}

#[test]
fn an_interrupted_run_closes_its_history_after_the_last_state() {
    // ten million steps: it ends by the signal only
    let scene = config("column.json");
    let long =
        [&scene, "-o", "long.h5", "--progress", "json", "--set", "time.end=1e4", "--set", "output.every_steps=1000"];
    for signal in ["INT", "TERM"] {
        let here = Folder::new();
        let (child, lines) = start(&here, &long, "\"step\"");
        send(signal, &child);
        assert_eq!(end(child), Some(130), "{signal}");
        let told: Vec<String> = lines.collect();
        assert!(told.iter().any(|line| line.contains("interrupted")), "{told:?}");
        assert_eq!(here.names(), ["long.h5"]);

        let history = here.history("long.h5");
        assert!(!history.open_ended(), "{signal}: the history was not closed");
        // the last frame is the last step, whether or not a frame was due there
        let sweeps = history.observable("solver_iterations").expect("read").expect("observable");
        assert!(history.steps().len() > 1 && sweeps.step.len() > 1);
        assert_eq!(history.steps().last(), sweeps.step.last(), "{signal}");
        history.grain_state(history.frames() - 1).expect("the last state");
        let told = here.dem_post(&["info", "long.h5"]).succeeds();
        assert!(told.stdout.contains("interrupted"), "{}", told.stdout);
        here.dem_post(&["chains", "long.h5"]).succeeds();
    }
}

#[test]
fn an_interruption_while_the_sample_is_packed_leaves_nothing() {
    let here = Folder::new();
    let (child, _lines) = start(&here, &[&config("compression.json")], "packing the sample");
    send("TERM", &child);
    assert_eq!(end(child), Some(130));
    assert_eq!(here.names(), [""; 0]);
}
