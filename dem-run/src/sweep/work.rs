//! Carries out runs, each in its own process, several at a time.
//!
//! Processes, not threads: a run that runs out of memory or crashes in the HDF5 library does not
//! end the others, and each run has separate threads, processor time and signals.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::plan::PlannedRun;
use crate::error::RunError;
use crate::history::sweep::{Outcome, State, Store};
use crate::output::replace::move_to;
use crate::progress::{Progress, RunsProgress};
use crate::signals::Interrupt;

/// Interval between two checks for ended processes.
const PAUSE: Duration = Duration::from_millis(10);

/// Interval between two updates of the manifest during the runs.
const GATHERING: Duration = Duration::from_secs(2);

/// A run to be carried out.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// Its number.
    pub id: &'a str,
    /// Its scene and values.
    pub run: &'a PlannedRun,
}

/// Carries runs out in their order, `at_a_time` at the same time, until all have ended, the sweep
/// is interrupted, or a file cannot be written.
///
/// `gather` is called every few seconds if runs have ended.
///
/// # Errors
/// A file that cannot be written, or a process that cannot be started. A failed run is not an
/// error.
pub fn carry_out(
    store: &Store,
    jobs: &[Job<'_>],
    at_a_time: usize,
    interrupt: &Interrupt,
    progress: &mut Progress,
    gather: &mut dyn FnMut() -> Result<(), RunError>,
) -> Result<(), RunError> {
    let crew =
        Crew { store, jobs, interrupt, next: AtomicUsize::new(0), ended: Mutex::default(), error: Mutex::default() };
    let total = jobs.len();
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..at_a_time.clamp(1, total.max(1))).map(|_| scope.spawn(|| crew.work())).collect();
        let (mut gathered, mut known) = (Instant::now(), 0);
        while !workers.iter().all(|worker| worker.is_finished()) {
            let (ended, failed) = *lock(&crew.ended);
            progress.runs(&RunsProgress { ended, failed, total }, false);
            if ended > known && gathered.elapsed() >= GATHERING {
                (gathered, known) = (Instant::now(), ended);
                if let Err(error) = gather() {
                    crew.stop(error);
                }
            }
            std::thread::sleep(PAUSE);
        }
    });
    let (ended, failed) = *lock(&crew.ended);
    progress.runs(&RunsProgress { ended, failed, total }, true);
    progress.finish();
    lock(&crew.error).take().map_or(Ok(()), Err)
}

/// Data shared by the workers.
struct Crew<'a> {
    store: &'a Store,
    jobs: &'a [Job<'a>],
    interrupt: &'a Interrupt,
    next: AtomicUsize,
    /// Runs that have ended, and of these the failed ones.
    ended: Mutex<(usize, usize)>,
    /// The error that stops all runs.
    error: Mutex<Option<RunError>>,
}

/// Ignores poisoning: the guarded data are consistent after every statement.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Crew<'_> {
    fn stopped(&self) -> bool {
        self.interrupt.requested() || lock(&self.error).is_some()
    }

    fn stop(&self, error: RunError) {
        lock(&self.error).get_or_insert(error);
    }

    fn work(&self) {
        while !self.stopped() {
            let Some(job) = self.jobs.get(self.next.fetch_add(1, Ordering::Relaxed)) else { return };
            match self.one(job) {
                Ok(Some(state)) => {
                    let mut ended = lock(&self.ended);
                    ended.0 += 1;
                    ended.1 += usize::from(state == State::Failed);
                }
                Ok(None) => {}
                Err(error) => self.stop(error),
            }
        }
    }

    /// Carries out one run; returns none if it was interrupted, or if another process carries it
    /// out.
    fn one(&self, job: &Job<'_>) -> Result<Option<State>, RunError> {
        let (store, Job { id, run }) = (self.store, *job);
        let Some(mut scene) = store.claim(id)? else { return Ok(None) };
        // another process may have completed the run since it was planned
        let before = store.outcome(id).filter(|outcome| outcome.digest == run.digest);
        if before.is_some_and(|outcome| outcome.state == State::Done) && store.is_complete(id) {
            return Ok(Some(State::Done));
        }
        let failed = |doing: &str, error: std::io::Error| {
            let what = format!("run {id} cannot be {doing}");
            RunError::System { what, source: error.into() }
        };
        write_scene(&mut scene, run).map_err(|e| failed("written", e))?;
        let began = Instant::now();
        let mut child = start(store, id).map_err(|e| failed("started", e))?;
        let status = self.wait(&mut child).map_err(|e| failed("waited for", e))?;
        let mut summary = String::new();
        if let Some(mut stdout) = child.stdout.take() {
            // output that is not text is not a summary
            let _ = stdout.read_to_string(&mut summary);
        }
        let part = store.path(id, ".part.h5");
        if self.stopped() && !status.success() {
            let _ = fs::remove_file(&part);
            let _ = fs::remove_file(store.path(id, ".log"));
            return Ok(None);
        }
        let outcome = outcome(store, job, status, &summary, began.elapsed());
        let history = store.path(id, outcome.state.ending());
        // a run that failed before its first frame has no history
        if outcome.state == State::Done || part.is_file() {
            move_to(&part, &history).map_err(|e| failed("put in its place", e))?;
        }
        if outcome.state == State::Done {
            let _ = fs::remove_file(store.path(id, ".failed.h5"));
        }
        // last, so that a recorded run has all its files
        store.record(id, &outcome)?;
        Ok(Some(outcome.state))
    }

    /// Waits for a run to end, and terminates it if all runs must stop.
    fn wait(&self, child: &mut Child) -> std::io::Result<ExitStatus> {
        let mut asked = false;
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status);
            }
            if self.stopped() && !asked {
                asked = true;
                terminate(child);
            }
            std::thread::sleep(PAUSE);
        }
    }
}

/// Writes the scene of a run to the start of its file.
fn write_scene(file: &mut File, run: &PlannedRun) -> std::io::Result<()> {
    let mut scene = run.scene.clone();
    for path in scene.files_mut() {
        // the scene file is in another folder
        *path = std::path::absolute(&*path)?;
    }
    file.set_len(0)?;
    file.write_all(scene.to_json()?.as_bytes())?;
    file.write_all(b"\n")
}

/// Path of this program, valid even if its file was replaced after the start: all runs of a sweep
/// use the same version.
fn this_program() -> std::io::Result<PathBuf> {
    let running = Path::new("/proc/self/exe");
    if cfg!(target_os = "linux") && running.exists() { Ok(running.into()) } else { std::env::current_exe() }
}

/// Starts `dem-run run` with one thread and stderr in a file.
fn start(store: &Store, id: &str) -> std::io::Result<Child> {
    let mut command = Command::new(this_program()?);
    command.arg("run").arg(store.path(id, ".json")).arg("-o").arg(store.path(id, ".part.h5"));
    command.arg("--packings").arg(store.packings());
    command.args(["--force", "--threads", "1", "--quiet", "--json", "--end-with-parent"]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(File::create(store.path(id, ".log"))?);
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        // only the sweep receives Ctrl-C; it terminates its runs
        command.process_group(0);
    }
    command.spawn()
}

/// Sends SIGTERM to a process.
fn terminate(child: &mut Child) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process};
        // fails only if the process has just ended
        let _ = kill_process(Pid::from_child(child), Signal::TERM);
    }
    #[cfg(not(unix))]
    let _ = child.kill();
}

/// The outcome of a run, from its exit code and its output.
fn outcome(store: &Store, job: &Job<'_>, status: ExitStatus, summary: &str, wall_time: Duration) -> Outcome {
    let log = store.path(job.id, ".log");
    let said = fs::read_to_string(&log).unwrap_or_default();
    if said.trim().is_empty() {
        let _ = fs::remove_file(&log);
    }
    let mut summary: Option<serde_json::Value> = serde_json::from_str(summary).ok();
    // exit code 0 without a summary counts as a failure
    let done = status.success() && summary.is_some();
    let state = if done { State::Done } else { State::Failed };
    // the history is moved there when the run has ended
    if let Some(history) = summary.as_mut().and_then(|summary| summary.get_mut("history")) {
        *history = store.path(job.id, state.ending()).to_string_lossy().into();
    }
    let why = match said.trim().trim_start_matches("error: ") {
        "" => format!("the run ended with {status} and no message"),
        said if status.code().is_none() => format!("the run ended with {status}: {said}"),
        said => said.to_string(),
    };
    Outcome {
        digest: job.run.digest.clone(),
        state,
        exit_code: status.code(),
        message: (!done).then_some(why),
        wall_time: wall_time.as_secs_f64(),
        summary,
    }
}
