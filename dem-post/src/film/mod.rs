//! A film of the run in one file: the sample beside its load curve and its broken bonds, with marks
//! at the moment shown.
//!
//! The file is an animated PNG, which browsers and most viewers play; where ffmpeg is installed, a
//! WebM is made of it. Half of the film is shared out evenly over the simulated time, the other
//! half over the broken bonds, so that it is slow where bonds break. Pictures are drawn and written
//! one by one.

use std::path::Path;
use std::process::{Command as Process, Stdio};

use clap::Args;
use dem_drawing::{Chart, Drawing, Style, colour};
use dem_history::History;
use dem_output::Print;
use dem_output::command_line::whole;
use serde::Serialize;

use crate::analysis::{Analysis, note};
use crate::clock::Clock;
use crate::cracks::report::total_over_time;
use crate::frames::{self, Subject};
use crate::options::{Files, LoadWall};
use crate::output::{Folder, PostError, Result, WriteError, facts, progress, quantity};
use crate::stress_strain;
use crate::title::Titles;
use pace::Shown;
use picture::{Animation, Picture};

pub(crate) mod pace;
mod picture;

/// Pictures a second, at most.
const RATE: u16 = 15;
/// Seconds for which the last picture stays.
const LAST: u16 = 2;
/// Pixels per unit of a drawing.
const PIXELS: f32 = 1.25;
/// Size of a chart in units of the drawing, without its margins.
const CHART: (f64, f64) = (340.0, 250.0);

/// Film of the run in one file, slow where bonds break: the sample beside its load curve.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    load_wall: LoadWall,
    /// What to draw.
    #[arg(long, value_enum, default_value_t)]
    draw: Subject,
    /// Length of the film (s); its last picture stays for 2 s of it.
    #[arg(long, value_name = "N", default_value_t = 14, value_parser = whole::<u16>(3..=600))]
    seconds: u16,
}

/// The pictures of a film.
#[derive(Debug, Serialize)]
pub struct Report {
    /// What the pictures show.
    pub subject: Subject,
    /// The frames that are shown, in order, and for how long.
    pub pictures: Vec<Shown>,
    /// Time of the first and of the last, s.
    pub span: [f64; 2],
    /// Length of the film, s.
    pub length: f64,
    /// Whether there is a WebM.
    pub webm: bool,
    /// How the pictures are drawn.
    #[serde(skip)]
    frames: frames::Report,
    #[serde(skip)]
    curves: Curves,
}

/// What the charts beside the sample show.
#[derive(Debug, Default)]
struct Curves {
    /// Load curve, if a wall is driven: the load (N) at each step over the displacement (mm), or
    /// over the broken bonds where the load follows the breaks.
    load: Vec<(f64, f64)>,
    /// Number of broken bonds over time (s), if there are bonds.
    broken: Vec<(f64, f64)>,
    /// Kinetic energy (J) over time (s), if there is neither.
    energy: Vec<(f64, f64)>,
    /// Time of each observed step (s).
    times: Vec<f64>,
    /// What the times count.
    clock: Clock,
    /// The titles of frames, with the same load.
    titles: Titles,
}

impl Analysis for Command {
    const NAME: &'static str = "film";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        read(history, self.draw, self.load_wall.name(), self.seconds)
    }

    fn table(report: &Report) -> String {
        facts(&[
            ("pictures", report.pictures.len().to_string()),
            ("from", report.frames.clock.moment(report.span[0])),
            ("to", report.frames.clock.moment(report.span[1])),
            ("length", quantity(Some(report.length), "s")),
            ("WebM", if report.webm { "film.webm" } else { "none: it takes ffmpeg" }.into()),
        ])
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
        write(history, report, folder, quiet)
    }
}

/// Chooses the pictures of a film of `seconds`, and reads the curves beside them; `wall` is the
/// load wall, if it is not that of the scene.
///
/// # Errors
/// Those of [`frames::read`], and [`PostError::Usage`] of [`stress_strain::read`].
pub fn read(history: &History, subject: Subject, wall: Option<&str>, seconds: u16) -> Result<Report> {
    let frames = frames::read(history, subject, 1, &[])?;
    let times: Vec<f64> = frames.frames.iter().map(|&frame| history.times()[frame]).collect();
    let ruptures: Vec<f64> = history.ruptures()?.iter().map(|rupture| rupture.time).collect();
    let curves = Curves::read(history, wall, &ruptures)?;
    let pictures = pace::pictures(&times, &ruptures, usize::from(RATE) * usize::from(seconds - LAST));
    let ticks: usize = pictures.iter().map(|shown| shown.ticks).sum();
    let length = ticks as f64 / f64::from(RATE) + f64::from(LAST);
    Ok(Report { subject, pictures, span: frames.span, length, webm: false, frames, curves })
}

/// Writes `film.png`, and `film.webm` where there is ffmpeg; with a bar on a terminal unless
/// `quiet`.
///
/// # Errors
/// [`PostError::Write`], and those of reading the history.
pub fn write(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let print = folder.print();
    folder.make("film.png", |path| animate(history, report, path, (print, quiet)))?;
    let png = folder.path().join("film.png");
    let made = folder.make("film.webm", |path| webm(&png, path));
    report.webm = made.is_ok();
    if let Err(NoWebm::Failed(error)) = made
        && !quiet
    {
        note(&format!("warning: film.webm was not made: {}", error.why));
    }
    Ok(())
}

/// Why there is no WebM.
enum NoWebm {
    /// There is no ffmpeg.
    NoProgram,
    /// ffmpeg failed, or the file cannot be written.
    Failed(WriteError),
}

impl From<WriteError> for NoWebm {
    fn from(error: WriteError) -> Self {
        Self::Failed(error)
    }
}

/// Draws and writes the animated PNG, as wide as `print` asks for.
fn animate(history: &History, report: &Report, path: &Path, (print, quiet): (Option<Print>, bool)) -> Result<()> {
    let failed = |why: String| PostError::Write(WriteError { path: path.into(), why });
    let bar = progress(report.pictures.len() as u64, quiet, "{bar:24} {pos} of {len} pictures, {eta} left");
    let view = frames::shown(history, &report.frames, &report.curves.titles)?;
    let mut animation: Option<Animation> = None;
    for (k, shown) in report.pictures.iter().enumerate() {
        let frame = report.frames.frames[shown.frame];
        let sample = frames::drawing(history, &report.frames, &view, frame)?;
        let charts = report.curves.charts(history.times()[frame]);
        let picture = Picture::beside(&sample, &charts, scale(&sample, &charts, print)).map_err(failed)?;
        let last = if k + 1 == report.pictures.len() { RATE * LAST } else { 0 };
        let ticks = u16::try_from(shown.ticks).unwrap_or(u16::MAX).saturating_add(last);
        let animation = match &mut animation {
            Some(animation) => animation,
            None => animation.insert(Animation::create(path, &picture, report.pictures.len()).map_err(failed)?),
        };
        animation.add(picture, (ticks, RATE)).map_err(failed)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    animation.map_or(Ok(()), Animation::finish).map_err(failed)
}

/// Pixels per unit of a drawing with charts beside it.
fn scale(sample: &Drawing, charts: &[Drawing], print: Option<Print>) -> f32 {
    let widest = charts.iter().map(|chart| chart.size().0).fold(0.0, f64::max);
    print.map_or(PIXELS, |print| (print.width * print.dots / (sample.size().0 + widest)) as f32)
}

/// Makes a WebM of an animated PNG with ffmpeg.
fn webm(png: &Path, webm: &Path) -> std::result::Result<(), NoWebm> {
    let failed = |why: String| NoWebm::Failed(WriteError { path: "film.webm".into(), why });
    let mut ffmpeg = Process::new("ffmpeg");
    ffmpeg.args(["-nostdin", "-loglevel", "error", "-y", "-f", "apng", "-i"]).arg(png);
    // a constant rate, which keeps the last picture for its time, and an even number of pixels, as
    // the encoder wants
    let filter = format!("fps={RATE},crop=trunc(iw/2)*2:trunc(ih/2)*2:0:0");
    ffmpeg.args(["-vf", &filter, "-pix_fmt", "yuv420p"]);
    ffmpeg.args(["-c:v", "libvpx-vp9", "-b:v", "0", "-crf", "33", "-f", "webm"]).arg(webm).stdin(Stdio::null());
    match ffmpeg.output() {
        Ok(done) if done.status.success() => Ok(()),
        Ok(done) => Err(failed(format!("ffmpeg: {}", String::from_utf8_lossy(&done.stderr).trim()))),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(NoWebm::NoProgram),
        Err(error) => Err(failed(format!("ffmpeg: {error}"))),
    }
}

impl Curves {
    /// Reads the curves; `ruptures` are the times at which bonds broke (s), in order.
    fn read(history: &History, wall: Option<&str>, ruptures: &[f64]) -> Result<Self> {
        let mut curves = Self { clock: Clock::of(history), ..Self::default() };
        match stress_strain::read(history, wall) {
            Ok(load) => {
                let (over, unit) =
                    if curves.clock.step().is_some() { (&load.broken, 1.0) } else { (&load.displacement, 1e3) };
                curves.load = over.iter().map(|x| unit * x).zip(load.load.iter().copied()).collect();
                curves.titles = Titles::with(&load);
                curves.times = load.time;
            }
            // no wall is driven, or its force and position were not observed
            Err(PostError::Lacking { .. }) => {}
            Err(error) => return Err(error),
        }
        if !history.bonds()?.is_empty() {
            curves.broken = total_over_time(history, ruptures);
        } else if curves.load.is_empty()
            && let Some(energy) = history.observable("kinetic_energy")?
        {
            curves.energy = energy.time.iter().copied().zip(energy.value.iter().copied()).collect();
        }
        Ok(curves)
    }

    /// The charts, with marks at a time (s).
    fn charts(&self, time: f64) -> Vec<Drawing> {
        let mut charts = vec![];
        if !self.load.is_empty() {
            let follows_breaks = self.clock.step().is_some();
            let over = if follows_breaks { "broken bonds" } else { "displacement of the wall (mm)" };
            let mut chart = Chart::new(over, "load (N)");
            (chart.pad_x, chart.x_is_count) = (true, follows_breaks);
            chart = chart.curve("load", colour::BLUE, Style::Line, self.load.clone());
            // the last step that is done by then
            let step = self.times.partition_point(|other| *other <= time * (1.0 + 1e-12));
            let now = self.load.get(step.saturating_sub(1)).copied().into_iter().collect();
            charts.push(chart.curve("now", colour::VERMILLION, Style::Points, now));
        }
        for (title, points) in [("broken bonds", &self.broken), ("kinetic energy (J)", &self.energy)] {
            if points.is_empty() {
                continue;
            }
            let mut chart = self.clock.chart(title);
            let steps = title == "broken bonds";
            chart.y_is_count = steps;
            chart.moments.push(time);
            let style = if steps { Style::Steps } else { Style::Thin };
            charts.push(chart.curve(title, colour::BLUE, style, points.clone()));
        }
        charts.into_iter().map(|chart| Chart::draw_sized(vec![chart], CHART)).collect()
    }
}
