//! Progress of a run on stderr: a bar, plain lines, or JSON lines.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::estimate::{Estimate, Left, Outlook, Sample, duration};
use crate::output::{escaped, number, short};
use crate::scene::failure::{BROKEN_SHARE, STRAINS};
use crate::stop::{StopProgress, TRAVEL};

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
    /// Whether it counts steps (`rupture: next_event`).
    #[serde(skip)]
    pub counts_steps: bool,
    /// Simulated time at the end (s).
    pub end: f64,
    /// Relative residual of the last solve.
    pub residual: f64,
    /// Iterations of the last solve.
    pub iterations: u64,
    /// Bonds broken since the start.
    pub broken: usize,
    /// Bonds at the start.
    pub bonds: usize,
    /// Load of the load wall (N), if the scene has one.
    pub load: Option<f64>,
    /// Strain of the sample along its direction (–).
    pub strain: Option<f64>,
    /// How far the stop condition is, if the scene has one.
    pub stop: Option<StopProgress>,
    /// Whether a condition of which [`Self::stop`] says nothing may end the run before its end.
    #[serde(skip)]
    pub may_end_early: bool,
    /// Whether the sample has bonds, or a stage will form them.
    #[serde(skip)]
    pub bonded: bool,
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
    /// End of the first step.
    first: Option<Instant>,
    estimate: Estimate,
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
        Self {
            sink,
            interval,
            began,
            shown: None,
            phase,
            first: None,
            estimate: Estimate::default(),
            pending: None,
            quiet,
        }
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
            Sink::Json(out) => {
                let elapsed = self.began.elapsed().as_secs_f64();
                json_line(out, &Event::Phase { message, fraction, elapsed });
            }
            Sink::None => {}
        }
    }

    /// Reports a step; shown when it is due.
    pub fn step(&mut self, step: &StepProgress) {
        if matches!(self.sink, Sink::None) {
            return;
        }
        self.pending = Some(*step);
        self.first.get_or_insert_with(Instant::now);
        let sample = self.sample(step);
        self.estimate.push(sample);
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
            Sink::Json(out) => {
                let elapsed = self.began.elapsed().as_secs_f64();
                json_line(out, &Event::Cascade { step, broken_in_step: broken, elapsed });
            }
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
        let left = self.estimate.left(self.sample(&step), step.outlook());
        match &mut self.sink {
            Sink::Bar(bar) => {
                bar.set_position((step.fraction() * BAR_LENGTH as f64) as u64);
                bar.set_message(step.describe(left));
            }
            Sink::Plain(out) => line(out, &format!("{:3.0} %  {}", 100.0 * step.fraction(), step.describe(left))),
            Sink::Json(out) => {
                let (elapsed, seconds) = (self.began.elapsed().as_secs_f64(), left.map(Left::seconds));
                json_line(out, &Event::Step { step: &step, elapsed, left: seconds, left_is: left.map(Left::name) });
            }
            Sink::None => {}
        }
    }

    /// Where the run stands now.
    fn sample(&self, step: &StepProgress) -> Sample {
        let elapsed = self.first.map_or(0.0, |first| first.elapsed().as_secs_f64());
        let travel = step.stop.filter(|stop| stop.condition == TRAVEL);
        Sample { elapsed, time: step.time, stop: travel.map(|stop| stop.reached) }
    }
}

impl StepProgress {
    /// Completed fraction (0 to 1) of the simulated time, or of the stop condition where it is
    /// nearer.
    fn fraction(&self) -> f64 {
        let time = if self.end > 0.0 { (self.time / self.end).clamp(0.0, 1.0) } else { 0.0 };
        self.stop.map_or(time, |stop| stop.reached.max(time))
    }

    /// What determines the time left. Bonds break in avalanches: their share is not extrapolated.
    fn outlook(&self) -> Outlook {
        let by_bonds = self.stop.is_some_and(|stop| stop.condition != TRAVEL);
        let strained = self.strain.is_some_and(|strain| strain.abs() > STRAINS[0]);
        let failed = self.broken > 0 && (strained || self.broken as f64 >= BROKEN_SHARE * self.bonds as f64);
        Outlook { end: self.end, bonded: self.bonded, failed, open: self.may_end_early || by_bonds }
    }

    /// The most important first: a terminal cuts the rest.
    fn describe(&self, left: Option<Left>) -> String {
        let Self { step, time, end, residual, iterations, broken, bonds, load, strain, stop, .. } = self;
        let parts = [
            load.map(|load| format!("{} N", short(load))),
            strain.map(|strain| format!("strain {strain:.1e}")),
            match (*bonds, *broken) {
                (0, _) => None,
                (bonds, 0) => Some(format!("{bonds} bonds")),
                (bonds, broken) => Some(format!("{broken} of {bonds} broken")),
            },
            Some(left.map_or("? left".to_string(), |left| left.to_string())),
            stop.map(|stop| format!("stop: {} {:.0} %", stop.condition, 100.0 * stop.reached)),
            (!self.counts_steps).then(|| format!("t {time:.4} of {} s", number(*end))),
            Some(format!("step {step}  residual {residual:.1e} ({iterations} iterations)")),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join("  ")
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
        #[serde(rename = "elapsed_s")]
        elapsed: f64,
    },
    Step {
        #[serde(flatten)]
        step: &'a StepProgress,
        #[serde(rename = "elapsed_s")]
        elapsed: f64,
        #[serde(rename = "left_s")]
        left: Option<f64>,
        left_is: Option<&'static str>,
    },
    Cascade {
        step: u64,
        broken_in_step: usize,
        #[serde(rename = "elapsed_s")]
        elapsed: f64,
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
    // of 80 columns 68 are left for the message
    if let Ok(style) = ProgressStyle::with_template("{bar:4} {percent:>3} %  {wide_msg}") {
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
        let stop = Some(StopProgress { condition: "travel", reached: 0.04 * step as f64 });
        StepProgress {
            step,
            time: step as f64 * 0.1,
            counts_steps: false,
            end: 1.0,
            residual: 8.2e-5,
            iterations: 12,
            broken: 1,
            bonds: 20,
            load: Some(57.1923),
            strain: Some(4.12e-4),
            stop,
            may_end_early: false,
            bonded: true,
        }
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
                " 10 %  57.2 N  strain 4.1e-4  1 of 20 broken  ? left  stop: travel 4 %  t 0.1000 of 1 s  step 1  \
                 residual 8.2e-5 (12 iterations)",
                "a note",
            ]
        );
        progress.step(&at(2));
        assert!(out.lines()[3].contains(" s left  stop: travel 8 %"), "{:?}", out.lines());
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
        assert!(out.lines()[2].contains(" t 1.0000"), "{:?}", out.lines());
    }

    #[test]
    fn the_message_fits_a_terminal_of_80_columns_up_to_the_time_left() {
        let large =
            StepProgress { load: Some(-1.2345e9), strain: Some(-4.1e-12), broken: 54_321, bonds: 654_321, ..at(1) };
        let unbroken = StepProgress { broken: 0, ..large };
        for (step, left) in [
            (large, Left::About(2900.0)),
            (large, Left::AtMost(3599.0)),
            (large, Left::Even(3599.0)),
            (unbroken, Left::IfHolds(3599.0)),
        ] {
            let (told, left) = (step.describe(Some(left)), left.to_string());
            let end = told.find(&left).expect("the time left") + left.len();
            let most = told[..end].chars().count();
            assert!(most <= 68, "{most}: {told}");
        }
    }

    #[test]
    fn a_sample_has_failed_by_its_strain_or_its_broken_bonds() {
        let failed = |broken, strain| StepProgress { broken, strain, bonds: 1000, ..at(1) }.outlook().failed;
        assert_eq!([failed(0, Some(1e-2)), failed(49, Some(-1e-5)), failed(49, None)], [false; 3]);
        assert_eq!([failed(1, Some(-2e-4)), failed(50, Some(0.0)), failed(50, None)], [true; 3]);
    }

    #[test]
    fn what_a_scene_lacks_is_not_told() {
        let falling = StepProgress { bonds: 0, broken: 0, load: None, strain: None, stop: None, ..at(2) };
        assert!(falling.describe(None).starts_with("? left  t 0.2000 of 1 s"), "{}", falling.describe(None));
        // the stop condition counts where it is nearer than the end
        let near = StopProgress { condition: "broken", reached: 0.9 };
        assert_eq!((at(2).fraction(), StepProgress { stop: Some(near), ..at(2) }.fraction()), (0.2, 0.9));
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
        let phase = serde_json::json!({"event": "phase", "message": "compaction", "fraction": 1.0});
        assert!(phase.as_object().is_some_and(|phase| phase.iter().all(|(name, value)| events[0][name] == *value)));
        assert!(events[0]["elapsed_s"].is_number());
        assert_eq!((&events[1]["event"], &events[1]["step"]), (&"step".into(), &1.into()));
        assert!(events[1]["residual"].is_null() && events[1]["elapsed_s"].is_number());
        assert_eq!(events[2], serde_json::json!({"event": "note", "message": "a \"note\""}));
        assert_eq!((&events[3]["event"], &events[3]["broken_in_step"]), (&"cascade".into(), &1.into()));
        assert!(events[3]["elapsed_s"].is_number() && events[1]["left_is"].is_null());
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
}
