//! Progress of a run on stderr: a bar, plain lines, or JSON lines.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::output::escaped;

/// How progress is shown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal, else plain lines.
    #[default]
    Auto,
    /// A bar, redrawn in place.
    Bar,
    /// A line every few seconds.
    Plain,
    /// One JSON object per line, every second.
    Json,
    /// Nothing.
    None,
}

/// Progress of a run after a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepProgress {
    /// Steps done.
    pub step: u64,
    /// Simulated time (s).
    pub time: f64,
    /// Simulated time at the end (s).
    pub end: f64,
    /// Relative residual of the last solve.
    pub residual: f64,
    /// Iterations of the last solve.
    pub iterations: u64,
    /// Bonds broken since the start.
    pub broken: usize,
}

/// Progress of a family of runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RunsProgress {
    /// Runs that have ended, those that failed included.
    pub ended: usize,
    /// Runs that failed.
    pub failed: usize,
    /// All runs.
    pub total: usize,
}

/// Shows progress. It reads the clock; no result may depend on the clock.
pub struct Progress {
    sink: Sink,
    /// Least time between two messages.
    interval: Duration,
    began: Instant,
    shown: Option<Instant>,
    phase: String,
    /// End of the first step, in real and in simulated time (s).
    first: Option<(Instant, f64)>,
    /// A step that is not shown yet.
    pending: Option<StepProgress>,
    quiet: bool,
}

enum Sink {
    Bar(ProgressBar),
    Plain(Box<dyn Write + Send>),
    Json(Box<dyn Write + Send>),
    None,
}

/// Number of increments of the bar.
const BAR_LENGTH: u64 = 1000;

impl Progress {
    /// Shows progress on stderr. `quiet` shows no progress and no notes.
    #[must_use]
    pub fn new(mode: ProgressMode, quiet: bool) -> Self {
        let mode = match mode {
            _ if quiet => ProgressMode::None,
            ProgressMode::Auto if std::io::stderr().is_terminal() => ProgressMode::Bar,
            ProgressMode::Auto => ProgressMode::Plain,
            mode => mode,
        };
        let interval = match mode {
            ProgressMode::Bar => Duration::from_millis(100),
            ProgressMode::Json => Duration::from_secs(1),
            _ => Duration::from_secs(3),
        };
        let sink = match mode {
            ProgressMode::Bar => Sink::Bar(bar()),
            ProgressMode::Json => Sink::Json(Box::new(std::io::stderr())),
            ProgressMode::None | ProgressMode::Auto => Sink::None,
            ProgressMode::Plain => Sink::Plain(Box::new(std::io::stderr())),
        };
        Self::with_sink(sink, interval, quiet)
    }

    fn with_sink(sink: Sink, interval: Duration, quiet: bool) -> Self {
        let (began, phase) = (Instant::now(), String::new());
        Self { sink, interval, began, shown: None, phase, first: None, pending: None, quiet }
    }

    /// Reports the progress of a phase of the preparation: its name, and the fraction done (0 to
    /// 1).
    pub fn phase(&mut self, message: &str, fraction: f64) {
        if self.phase == message && !self.due() {
            return;
        }
        self.phase = message.to_string();
        self.shown = Some(Instant::now());
        let fraction = fraction.clamp(0.0, 1.0);
        match &mut self.sink {
            Sink::Bar(bar) => {
                bar.set_position((fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(message.to_string());
            }
            Sink::Plain(out) => line(out, &format!("{message}: {:.0} %", 100.0 * fraction)),
            Sink::Json(out) => json_line(out, &Event::Phase { message, fraction }),
            Sink::None => {}
        }
    }

    /// Reports a step; shown when it is due.
    pub fn step(&mut self, step: &StepProgress) {
        if matches!(self.sink, Sink::None) {
            return;
        }
        self.pending = Some(*step);
        if self.first.is_none() {
            self.first = Some((Instant::now(), step.time));
        }
        if self.due() {
            self.show_step();
        }
    }

    /// Reports the number of bonds broken so far in the current step; shown when due. A step that
    /// breaks thousands of bonds takes long.
    pub fn cascade(&mut self, step: u64, broken: usize) {
        if !self.due() {
            return;
        }
        self.shown = Some(Instant::now());
        let text = format!("step {step} continues: {broken} {} broken in it so far", bonds(broken));
        match &mut self.sink {
            Sink::Bar(bar) => bar.set_message(text),
            Sink::Plain(out) => line(out, &format!("       {text}")),
            Sink::Json(out) => json_line(out, &Event::Cascade { step, broken_in_step: broken }),
            Sink::None => {}
        }
    }

    /// Reports the number of ended runs of a family; shown when due, or if it is the `last` report.
    pub fn runs(&mut self, runs: &RunsProgress, last: bool) {
        if !self.due() && !last {
            return;
        }
        self.shown = Some(Instant::now());
        let elapsed = self.began.elapsed().as_secs_f64();
        let left = (runs.ended > 0).then(|| elapsed * (runs.total - runs.ended) as f64 / runs.ended as f64);
        let fraction = runs.ended as f64 / runs.total.max(1) as f64;
        match &mut self.sink {
            Sink::Bar(bar) => {
                bar.set_position((fraction * BAR_LENGTH as f64) as u64);
                bar.set_message(runs.describe(left));
            }
            Sink::Plain(out) => line(out, &format!("{:3.0} %  {}", 100.0 * fraction, runs.describe(left))),
            Sink::Json(out) => json_line(out, &Event::Runs { runs, elapsed, left }),
            Sink::None => {}
        }
    }

    /// Prints a line that the user should read, in every mode but quiet.
    pub fn note(&mut self, text: &str) {
        match &mut self.sink {
            Sink::Bar(bar) => bar.suspend(|| line(&mut std::io::stderr(), text)),
            Sink::Plain(out) => line(out, text),
            Sink::Json(out) => json_line(out, &Event::Note { message: text }),
            Sink::None if self.quiet => {}
            Sink::None => line(&mut std::io::stderr(), text),
        }
    }

    /// Shows the last step and removes the bar.
    pub fn finish(&mut self) {
        self.show_step();
        if let Sink::Bar(bar) = &self.sink {
            bar.finish_and_clear();
        }
    }

    /// Whether the interval since the last message has passed.
    fn due(&self) -> bool {
        self.shown.unwrap_or(self.began).elapsed() >= self.interval
    }

    fn show_step(&mut self) {
        let Some(step) = self.pending.take() else {
            return;
        };
        self.shown = Some(Instant::now());
        let left = self.time_left(&step);
        match &mut self.sink {
            Sink::Bar(bar) => {
                bar.set_position((step.fraction() * BAR_LENGTH as f64) as u64);
                bar.set_message(step.describe(left));
            }
            Sink::Plain(out) => line(out, &format!("{:3.0} %  {}", 100.0 * step.fraction(), step.describe(left))),
            Sink::Json(out) => {
                json_line(out, &Event::Step { step: &step, elapsed: self.began.elapsed().as_secs_f64(), left });
            }
            Sink::None => {}
        }
    }

    /// Remaining time (s), extrapolated from the mean speed since the first step.
    fn time_left(&self, step: &StepProgress) -> Option<f64> {
        let (start, first) = self.first?;
        let done = step.time - first;
        (done > 0.0).then(|| start.elapsed().as_secs_f64() * ((step.end - step.time) / done).max(0.0))
    }
}

impl StepProgress {
    /// Completed fraction of the simulated time (0 to 1).
    fn fraction(&self) -> f64 {
        if self.end > 0.0 { (self.time / self.end).clamp(0.0, 1.0) } else { 0.0 }
    }

    fn describe(&self, left: Option<f64>) -> String {
        let Self { step, time, end, residual, iterations, broken } = self;
        let bonds = bonds(*broken);
        let left = left.map_or("?".to_string(), duration);
        format!(
            "t {time:.4} of {end} s  step {step}  residual {residual:.1e} ({iterations} iterations)  \
             {broken} {bonds} broken  {left} left"
        )
    }
}

impl RunsProgress {
    fn describe(&self, left: Option<f64>) -> String {
        let Self { ended, failed, total } = self;
        let failed = if *failed == 0 { String::new() } else { format!(", {failed} failed") };
        let left = left.map_or("?".to_string(), duration);
        format!("{ended} of {total} runs{failed}  {left} left")
    }
}

#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    Phase {
        message: &'a str,
        fraction: f64,
    },
    Step {
        #[serde(flatten)]
        step: &'a StepProgress,
        #[serde(rename = "elapsed_s")]
        elapsed: f64,
        #[serde(rename = "left_s")]
        left: Option<f64>,
    },
    Cascade {
        step: u64,
        broken_in_step: usize,
    },
    Runs {
        #[serde(flatten)]
        runs: &'a RunsProgress,
        #[serde(rename = "elapsed_s")]
        elapsed: f64,
        #[serde(rename = "left_s")]
        left: Option<f64>,
    },
    Note {
        message: &'a str,
    },
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(BAR_LENGTH), ProgressDrawTarget::stderr());
    // if the template does not parse, the bar has no numbers; the run continues
    if let Ok(style) = ProgressStyle::with_template("{bar:24} {percent:>3} %  {wide_msg}") {
        bar.set_style(style);
    }
    bar
}

/// Ignores write errors: a closed stderr does not stop a run.
fn line(out: &mut dyn Write, text: &str) {
    let _ = writeln!(out, "{}", escaped(text));
}

fn json_line(out: &mut dyn Write, event: &Event<'_>) {
    if let Ok(text) = serde_json::to_string(event) {
        line(out, &text);
    }
}

fn bonds(count: usize) -> &'static str {
    if count == 1 { "bond" } else { "bonds" }
}

/// A duration (s) in readable units.
fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().expect("lock").extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Shared {
        fn lines(&self) -> Vec<String> {
            let bytes = self.0.lock().expect("lock").clone();
            String::from_utf8(bytes).expect("text").lines().map(String::from).collect()
        }
    }

    fn at(step: u64) -> StepProgress {
        StepProgress { step, time: step as f64 * 0.1, end: 1.0, residual: 8.2e-5, iterations: 12, broken: 1 }
    }

    #[test]
    fn plain_lines_say_where_the_run_stands() {
        let out = Shared::default();
        let mut progress = Progress::with_sink(Sink::Plain(Box::new(out.clone())), Duration::ZERO, false);
        progress.phase("compaction", 0.5);
        progress.step(&at(1));
        progress.note("a note");
        assert_eq!(
            out.lines(),
            [
                "compaction: 50 %",
                " 10 %  t 0.1000 of 1 s  step 1  residual 8.2e-5 (12 iterations)  1 bond broken  ? left",
                "a note",
            ]
        );
        progress.step(&at(2));
        assert!(out.lines()[3].ends_with(" s left"), "{:?}", out.lines());
        progress.cascade(3, 187);
        assert_eq!(out.lines()[4], "       step 3 continues: 187 bonds broken in it so far");
    }

    #[test]
    fn messages_that_are_not_due_are_left_out_but_the_last_is_shown() {
        let out = Shared::default();
        let mut progress = Progress::with_sink(Sink::Plain(Box::new(out.clone())), Duration::from_secs(3600), false);
        progress.phase("compaction", 0.1);
        progress.phase("compaction", 0.2);
        progress.phase("seating", 0.0);
        for step in 1..=10 {
            progress.step(&at(step));
        }
        assert_eq!(out.lines(), ["compaction: 10 %", "seating: 0 %"]);
        progress.finish();
        progress.finish();
        assert_eq!(out.lines().len(), 3);
        assert!(out.lines()[2].starts_with("100 %  t 1.0000"), "{:?}", out.lines());
    }

    #[test]
    fn json_lines_are_json() {
        let out = Shared::default();
        let mut progress = Progress::with_sink(Sink::Json(Box::new(out.clone())), Duration::ZERO, false);
        progress.phase("compaction", 2.0);
        progress.step(&StepProgress { residual: f64::NAN, ..at(1) });
        progress.note("a \"note\"");
        progress.cascade(2, 1);
        let events: Vec<serde_json::Value> =
            out.lines().iter().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        assert_eq!(events[0], serde_json::json!({"event": "phase", "message": "compaction", "fraction": 1.0}));
        assert_eq!((&events[1]["event"], &events[1]["step"]), (&"step".into(), &1.into()));
        assert!(events[1]["residual"].is_null() && events[1]["elapsed_s"].is_number());
        assert_eq!(events[2], serde_json::json!({"event": "note", "message": "a \"note\""}));
        assert_eq!(events[3], serde_json::json!({"event": "cascade", "step": 2, "broken_in_step": 1}));
    }

    #[test]
    fn a_family_of_runs_is_told_in_runs() {
        let out = Shared::default();
        let mut progress = Progress::with_sink(Sink::Plain(Box::new(out.clone())), Duration::from_secs(3600), false);
        progress.runs(&RunsProgress { ended: 0, failed: 0, total: 4 }, false);
        assert_eq!(out.lines(), [""; 0]);
        progress.runs(&RunsProgress { ended: 4, failed: 1, total: 4 }, true);
        assert_eq!(out.lines(), ["100 %  4 of 4 runs, 1 failed  0 s left"]);
    }

    #[test]
    fn quiet_is_no_progress_at_all() {
        let progress = Progress::new(ProgressMode::Json, true);
        assert!(matches!(progress.sink, Sink::None));
        assert!(progress.quiet);
    }

    #[test]
    fn durations_are_short() {
        assert_eq!(duration(0.4), "0 s");
        assert_eq!(duration(125.0), "2 min 05 s");
        assert_eq!(duration(7265.0), "2 h 01 min");
        assert!(duration(f64::INFINITY).ends_with("min"));
        assert_eq!(duration(f64::NAN), "0 s");
    }
}
