//! A series of pictures, one per frame, numbered for viewers and video encoders.
//!
//! All pictures have the same scale, the same part of the plane and the same even number of pixels.
//! Colours and widths that represent a value have the same scale in all pictures. Frames are read,
//! drawn and written one by one, so the memory does not grow with the length of the series.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use dem_drawing::Drawing;
use dem_history::{BondStatus, History, RuptureMode};
use dem_output::command_line::{seconds, whole};
use serde::Serialize;

use crate::analysis::Analysis;
use crate::chains::pictures::{force_legend, links};
use crate::chains::report::{contacts, normal_forces, require_reactions, statistics};
use crate::clock::Clock;
use crate::cracks::{Modes, mode_colour};
use crate::map::{Key, Link, Materials, Panel, Ramp, Sample, Scale, View, draw, draw_view};
use crate::moments;
use crate::options::Files;
use crate::output::{Folder, PostError, Result, facts, in_shell, progress, quantity, short};
use crate::title::Titles;
use crate::velocities::{speeds, usual_speed};

/// Pixels per unit of a drawing.
const PIXELS: f32 = 2.0;
/// Fill and outline of grains.
const GRAIN: [&str; 2] = ["#f0f0f0", "#bdbdbd"];
/// Fill of grains that lost a bond.
const RELEASED: &str = "#ffffff";
/// Width of the lines of bonds and of cracks.
const BOND: f64 = 1.6;
/// Colour of bonds that hold.
const HELD: &str = "#9a9a9a";
const CRACK: f64 = 2.8;

/// Series of numbered pictures, for a viewer or a film.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    /// What to draw.
    #[arg(long, value_enum, default_value_t)]
    draw: Subject,
    /// Draw every N-th frame, and the last.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "times", value_parser = whole::<usize>(1..=u64::MAX))]
    every: usize,
    /// Draw the frames nearest to these times (s), or steps of a run from break to break.
    #[arg(long, value_name = "T,…", value_delimiter = ',', value_parser = seconds)]
    times: Vec<f64>,
}

impl Analysis for Command {
    const NAME: &'static str = "frames";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        read(history, self.draw, self.every, &self.times)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
        report.folder = Some(folder.path().into());
        write(history, report, folder, quiet)
    }
}

/// What the pictures show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// Intact bonds, and broken bonds whose grains are still neighbours.
    #[default]
    Bonds,
    /// Contact forces.
    Forces,
    /// Speeds of the grains.
    Speed,
}

/// The selected frames and their subject.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// What the pictures show.
    pub subject: Subject,
    /// The frames, in order.
    pub frames: Vec<usize>,
    /// Time of the first and of the last, s.
    pub span: [f64; 2],
    /// What their times count.
    #[serde(skip)]
    pub clock: Clock,
    /// The folder of the pictures, once they are written.
    #[serde(skip)]
    pub folder: Option<PathBuf>,
    /// Reference of the scale: the greatest mean force (N) or usual speed (m/s) of all frames.
    pub scale: Option<f64>,
}

/// Chooses the frames: those nearest to `times` (s or steps), or every `every`-th and the last.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history or `every` of zero; [`PostError::Lacking`]
/// for a history without frames, or without the subject of the pictures: bonds, forces or motion.
pub fn read(history: &History, subject: Subject, every: usize, times: &[f64]) -> Result<Report> {
    let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
    if every == 0 {
        return Err(PostError::Usage("--every 0: give 1 or more".into()));
    }
    // it reports wrong times and a history without frames
    let mut frames = moments::chosen(history, times)?;
    if times.is_empty() {
        let last = history.frames() - 1;
        frames = (0..=last).filter(|frame| frame % every == 0 || *frame == last).collect();
    }
    if subject == Subject::Bonds && history.bonds()?.is_empty() {
        return Err(lacking("this scene has no bonds to draw: choose --draw forces or --draw speed"));
    }
    if subject == Subject::Forces {
        require_reactions(history)?;
    }
    let scale = match subject {
        Subject::Bonds => None,
        Subject::Forces => {
            let radius = history.grains()?.radius;
            let mean = |frame| Ok(statistics(&normal_forces(&contacts(history, frame, &radius)?)).mean);
            Some(greatest(&frames, mean)?)
        }
        Subject::Speed => {
            Some(greatest(&frames, |frame| Ok(usual_speed(speeds(&history.grain_state(frame)?, history.dimension()))))?)
        }
    };
    if scale == Some(0.0) {
        let what = if subject == Subject::Forces { "no contact carries a force" } else { "nothing moves" };
        return Err(lacking(&format!("{what} in these frames: choose others with --times, or another --draw")));
    }
    let time = |frame: Option<&usize>| frame.map_or(0.0, |&frame| history.times()[frame]);
    Ok(Report {
        subject,
        span: [time(frames.first()), time(frames.last())],
        frames,
        clock: Clock::of(history),
        folder: None,
        scale,
    })
}

fn greatest(frames: &[usize], value: impl Fn(usize) -> Result<f64>) -> Result<f64> {
    frames.iter().try_fold(0.0, |most, &frame| Ok(value(frame)?.max(most)))
}

impl Report {
    /// The report as a table.
    pub fn table(&self) -> String {
        let subject = self.subject.to_possible_value().map_or_else(String::new, |value| value.get_name().to_string());
        let unit = if self.subject == Subject::Speed { "m/s" } else { "N" };
        // to ffmpeg a percent sign begins a number
        let folder = self.folder.as_deref().unwrap_or(Path::new("")).display().to_string().replace('%', "%%");
        let pictures = in_shell(&Path::new(&folder).join("frame-%05d.png"));
        facts(&[
            ("pictures", self.frames.len().to_string()),
            ("of", subject),
            ("from", self.clock.moment(self.span[0])),
            ("to", self.clock.moment(self.span[1])),
            ("scale made for", quantity(self.scale, unit)),
            ("a film", format!("ffmpeg -framerate 25 -i {pictures} -pix_fmt yuv420p film.mp4")),
        ])
    }
}

/// Writes `frame-00000.png`, `frame-00001.png` and so on; with a bar on a terminal unless `quiet`.
///
/// # Errors
/// [`PostError::Write`], and those of reading the history.
pub fn write(history: &History, report: &Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let titles = Titles::read(history)?;
    let shown = shown(history, report, &titles)?;
    let bar = progress(report.frames.len() as u64, quiet, "{bar:24} {pos} of {len} pictures, {eta} left");
    let names: Vec<String> = (0..report.frames.len()).map(|k| format!("frame-{k:05}.png")).collect();
    folder.announce(&names)?;
    for (name, &frame) in names.iter().zip(&report.frames) {
        let png = drawing(history, report, &shown, frame)?.png_scaled(PIXELS);
        folder.write(name, &png.map_err(|why| PostError::Usage(format!("{name}: {why}")))?)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

/// The drawing of a frame.
pub(crate) fn drawing(history: &History, report: &Report, shown: &Shown, frame: usize) -> Result<Drawing> {
    let (mut panel, legend) = picture(history, report, shown.materials.as_ref(), frame)?;
    panel.caption.insert(0, shown.titles.of(history, frame));
    Ok(draw_view(&shown.sample, shown.view, &[panel], &legend))
}

/// The sample at a frame on a sheet of its own, without a caption and a legend.
pub(crate) fn plain(history: &History, report: &Report, frame: usize) -> Result<Drawing> {
    let (panel, _) = picture(history, report, Materials::read(history)?.as_ref(), frame)?;
    Ok(draw(&Sample::with_depth(history)?, &[Panel { caption: vec![], ..panel }], &[]))
}

/// What all pictures of a series share.
pub(crate) struct Shown<'a> {
    sample: Sample,
    view: View,
    titles: &'a Titles,
    materials: Option<Materials>,
}

/// The part of the plane that shows all frames.
pub(crate) fn shown<'a>(history: &History, report: &Report, titles: &'a Titles) -> Result<Shown<'a>> {
    let sample = Sample::with_depth(history)?;
    let mut view = View::EMPTY;
    for &frame in &report.frames {
        let (grains, walls) = (history.grain_state(frame)?, history.wall_state(frame)?);
        view = view.join(sample.view(std::iter::once((&grains, &walls))));
    }
    Ok(Shown { sample, view, titles, materials: Materials::read(history)? })
}

fn picture(
    history: &History,
    report: &Report,
    materials: Option<&Materials>,
    frame: usize,
) -> Result<(Panel, Vec<Key>)> {
    let grains = history.grain_state(frame)?;
    let radius = history.grains()?.radius;
    let mut panel = Panel {
        walls: history.wall_state(frame)?,
        fills: Materials::fills(materials, radius.len(), GRAIN[0]),
        outline: GRAIN[1],
        grains,
        ..Panel::default()
    };
    let scale = report.scale.unwrap_or(1.0);
    let mut legend = match report.subject {
        Subject::Bonds => bonds(history, frame, &mut panel, materials)?,
        Subject::Forces => {
            let contacts = contacts(history, frame, &radius)?;
            panel.links = links(&contacts, &panel.grains.position, scale, history.dimension());
            if history.dimension() == 3 {
                // in 3D grains would hide the lines
                panel.fills.clear();
            }
            force_legend(history.dimension(), scale)
        }
        Subject::Speed => {
            let scale = Scale { title: "speed (m/s)".into(), low: 0.0, high: scale, ramp: Ramp::Areas };
            let speeds = speeds(&panel.grains, history.dimension());
            panel.fills = speeds.iter().map(|&speed| scale.colour(speed)).collect();
            panel.caption.push(format!("greatest speed {} m/s", short(speeds.iter().copied().fold(0.0, f64::max))));
            vec![Key::Bar(scale)]
        }
    };
    // speeds have the fills of grains, and forces of spheres are drawn without grains
    let shown = report.subject != Subject::Speed && !panel.fills.is_empty();
    legend.extend(materials.iter().filter(|_| shown).flat_map(|materials| materials.keys(GRAIN[1])));
    Ok((panel, legend))
}

/// Colours and names of bonds by their state; in 3D those that hold are not drawn.
pub(crate) fn bond_legend(dimension: usize, twist: bool) -> Vec<(&'static str, String)> {
    let mut keys = vec![];
    if dimension == 2 {
        keys.push((HELD, "bond".into()));
    }
    keys.push((mode_colour(RuptureMode::Tension), "broken in tension".into()));
    keys.push((mode_colour(RuptureMode::Shear), "in shear".into()));
    keys.push((mode_colour(RuptureMode::Rolling), "by rolling".into()));
    if twist {
        keys.push((mode_colour(RuptureMode::Twist), "by twist".into()));
    }
    keys
}

/// A line for each bond, in the colour of its mode of rupture.
fn bonds(history: &History, frame: usize, panel: &mut Panel, materials: Option<&Materials>) -> Result<Vec<Key>> {
    let (d, bonds, status) = (history.dimension(), history.bonds()?, history.bond_status(frame)?);
    let mut modes = Modes::default();
    let centre =
        |panel: &Panel, grain: i32| panel.grains.position[grain as usize * d..(grain as usize + 1) * d].to_vec();
    for (k, (pair, status)) in bonds.pair.iter().zip(&status).enumerate() {
        let Some(mode) = status.mode() else {
            continue;
        };
        modes.add(mode);
        for grain in pair.map(|grain| grain as usize) {
            panel.fills[grain] = materials.map_or(RELEASED.into(), |materials| materials.released(grain));
        }
        let (from, to) = (centre(panel, pair[0]), centre(panel, pair[1]));
        let distance = from.iter().zip(&to).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt();
        // no line across the sample between grains that have moved apart
        if distance < 1.5 * bonds.mean_diameter[k] {
            panel.links.push(Link { from, to, width: CRACK, colour: mode_colour(mode).into() });
        }
    }
    let width = |colour: &str| if colour == HELD { BOND } else { CRACK };
    let keys = bond_legend(d, modes.twist > 0).into_iter();
    let keys = keys.map(|(colour, text)| Key::Line(colour, width(colour), text)).collect();
    // in 3D bonds would hide each other and lie behind grains
    if d == 2 {
        let holding = |&(_, status): &(&[i32; 2], &BondStatus)| *status == BondStatus::Intact;
        let (width, colour) = (BOND, HELD);
        let line = |(pair, _): (&[i32; 2], &BondStatus)| {
            let [from, to] = pair.map(|grain| centre(panel, grain));
            Link { from, to, width, colour: colour.into() }
        };
        let intact: Vec<Link> = bonds.pair.iter().zip(&status).filter(holding).map(line).collect();
        panel.links.splice(0..0, intact);
    }
    panel.caption.push(format!("{} of {} bonds broken", modes.total(), bonds.len()));
    Ok(keys)
}
