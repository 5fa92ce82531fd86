//! Ctrl-C and SIGTERM: the first ends the command after the current step, the second at once.

use std::ffi::c_int;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a run that was interrupted.
pub const INTERRUPTED: u8 = 130;

/// A request to end the run, shared by all clones.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Whether the end of the run has been requested.
    #[must_use]
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Requests the end of the run; returns whether it had been requested before.
    pub fn request(&self) -> bool {
        self.0.swap(true, Ordering::Relaxed)
    }
}

/// Handles Ctrl-C, SIGTERM and SIGHUP from now on.
///
/// # Errors
/// The system refuses, or the process already has a handler.
pub fn install() -> Result<Interrupt, ctrlc::Error> {
    let interrupt = Interrupt::default();
    let shared = interrupt.clone();
    ctrlc::set_handler(move || {
        if shared.request() {
            exit_at_once();
        }
        // if stderr is closed, eprintln! would panic and end this thread, so that a second signal
        // has no effect
        let _ = writeln!(std::io::stderr(), "\nending after the current step; press Ctrl-C again to end immediately");
    })?;
    Ok(interrupt)
}

/// Interrupts this process when its parent ends (Linux only).
///
/// # Errors
/// The system refuses.
pub fn end_with_parent() -> std::io::Result<()> {
    #[cfg(target_os = "linux")]
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
    Ok(())
}

unsafe extern "C" {
    /// Ends the process without exit handlers (ISO C `_Exit`, POSIX `_exit`).
    safe fn _exit(status: c_int) -> !;
}

/// The handler has its own thread, and the run may be inside the HDF5 library. Exit handlers would
/// close that library during a call, so none is run.
fn exit_at_once() -> ! {
    _exit(c_int::from(INTERRUPTED))
}

#[cfg(all(test, unix))]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn a_request_is_seen_by_all_clones() {
        let interrupt = Interrupt::default();
        let clone = interrupt.clone();
        assert!(!clone.requested());
        assert!(!interrupt.request());
        assert!(clone.requested());
        assert!(clone.request());
    }

    /// The process that the test below interrupts; not a test itself.
    #[test]
    #[ignore = "run by the_second_signal_ends_the_process"]
    fn interrupted_process() {
        let interrupt = install().expect("handler");
        println!("\nready");
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(20) {
            if interrupt.requested() {
                println!("asked to end");
                std::thread::sleep(Duration::from_secs(20));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn the_second_signal_ends_the_process() {
        for signal in ["-TERM", "-INT"] {
            let mut child = Command::new(std::env::current_exe().expect("this program"))
                .args(["signals::tests::interrupted_process", "--exact", "--ignored", "--nocapture"])
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .expect("start");
            let mut lines = BufReader::new(child.stdout.take().expect("stdout")).lines();
            let mut wait_for = |word: &str| lines.any(|line| line.expect("line").contains(word));
            let send = |id: u32| {
                // the shell's built-in `kill`: not every machine has the program
                let status = Command::new("sh").args(["-c", &format!("kill {signal} {id}")]).status();
                assert!(status.expect("sh").success());
            };
            assert!(wait_for("ready"));
            send(child.id());
            assert!(wait_for("asked to end"));
            assert!(child.try_wait().expect("status").is_none(), "ended by the first signal");
            send(child.id());
            assert_eq!(child.wait().expect("status").code(), Some(i32::from(INTERRUPTED)));
        }
    }
}
