//! Velocity field: speeds and directions of the grains, at some moments.
//!
//! The colour of a grain shows its speed relative to v, the 99th percentile of the speeds in the
//! panel. Each panel has its own v: speeds grow by orders of magnitude in a collapse, and one scale
//! would leave all but one panel dark. Arrows show the mean velocity of the grains in each square
//! of a grid, so that a large sample stays legible. An arrow begins at the mean of the centres; the
//! longest arrow of a panel is as long as a square is wide. So compare grains within one panel by
//! colours and arrows, and panels by their captions.

use clap::Args;
use dem_history::{GrainState, History};
use serde::Serialize;

use crate::analysis::Analysis;
use crate::clock::Clock;
use crate::extent::range;
use crate::map::{Arrow, Key, Panel, Ramp, Sample, Scale, draw};
use crate::moments;
use crate::options::Moments;
use crate::output::{Folder, Result, Text, number, short};
use crate::section::{Maps, OnPage, Section, map_figure};
use crate::title::Titles;
use dem_drawing::{Drawing, colour};
use dem_output::row;

/// Squares of the grid along the longer side of the sample.
const SQUARES: f64 = 18.0;
/// Share of the speeds that the colour scale covers, so that one ejected grain does not set the
/// scale.
const COVERED: f64 = 0.99;
/// A sample is at rest if its grains, at their speed, would move by less than this share of their
/// diameter in the whole run: the rest is round-off.
const AT_REST: f64 = 1e-8;
/// Fill of grains at rest.
const RESTS: &str = "#f0f0f0";

/// Velocities of the grains as maps and a table.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    moments: Moments,
}

impl Analysis for Command {
    const NAME: &'static str = "velocities";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.moments.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        read(history, &self.moments.times)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.moments.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(history, report, folder)
    }
}

/// The motion of the grains at one moment.
#[derive(Clone, Debug, Serialize)]
pub struct Field {
    /// The frame.
    pub frame: usize,
    /// Its step.
    pub step: i64,
    /// Its time, s.
    pub time: f64,
    /// Mean speed of the grains, m/s.
    pub mean_speed: f64,
    /// Root of the mean square of the speeds, m/s.
    pub rms_speed: f64,
    /// Greatest speed, m/s.
    pub greatest_speed: f64,
    /// The grain with the greatest speed.
    pub fastest: usize,
    /// Velocity of the centre of mass, m/s, D numbers.
    pub drift: Vec<f64>,
    /// Translational kinetic energy, J.
    pub kinetic_energy: f64,
    /// The speeds, m/s.
    #[serde(skip)]
    pub speed: Vec<f64>,
    /// The grains.
    #[serde(skip)]
    pub state: GrainState,
}

/// The motion at the chosen moments.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// One entry for each moment.
    pub fields: Vec<Field>,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
}

/// Reads the motion at the frames nearest to `times` (s or steps), or at chosen ones.
///
/// # Errors
/// [`crate::output::PostError::Usage`] for times outside the history.
pub fn read(history: &History, times: &[f64]) -> Result<Report> {
    let mass = history.grains()?.mass;
    let mut fields = vec![];
    for frame in moments::chosen(history, times)? {
        let state = history.grain_state(frame)?;
        fields.push(field(frame, (history.steps()[frame], history.times()[frame]), state, &mass, history.dimension()));
    }
    Ok(Report { fields, clock: Clock::of(history) })
}

fn field(frame: usize, (step, time): (i64, f64), state: GrainState, mass: &[f64], d: usize) -> Field {
    let speed = speeds(&state, d);
    let n = speed.len() as f64;
    let fastest = (0..speed.len()).max_by(|&a, &b| speed[a].total_cmp(&speed[b]).then(b.cmp(&a))).unwrap_or(0);
    let total: f64 = mass.iter().sum();
    let momentum = |k: usize| mass.iter().zip(state.velocity.chunks(d)).map(|(m, v)| m * v[k]).sum::<f64>();
    Field {
        frame,
        step,
        time,
        mean_speed: speed.iter().sum::<f64>() / n,
        rms_speed: (speed.iter().map(|v| v * v).sum::<f64>() / n).sqrt(),
        greatest_speed: speed.get(fastest).copied().unwrap_or(0.0),
        fastest,
        drift: (0..d).map(|k| momentum(k) / total).collect(),
        kinetic_energy: 0.5 * mass.iter().zip(&speed).map(|(m, v)| m * v * v).sum::<f64>(),
        speed,
        state,
    }
}

/// Speed of each grain, m/s.
pub fn speeds(state: &GrainState, d: usize) -> Vec<f64> {
    state.velocity.chunks(d).map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt()).collect()
}

/// The 99th percentile of the speeds (m/s); 0 without grains.
pub fn usual_speed(mut speeds: Vec<f64>) -> f64 {
    speeds.sort_by(f64::total_cmp);
    let place = (COVERED * speeds.len() as f64).ceil() as usize;
    speeds.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}

impl Report {
    /// The report as a table.
    pub fn table(&self) -> String {
        let mut table = Text::new(&[
            self.clock.title(),
            "mean speed (m/s)",
            "rms speed (m/s)",
            "max speed (m/s)",
            "grain",
            "drift (m/s)",
            "energy of translation (J)",
        ]);
        for field in &self.fields {
            let drift: Vec<String> = field.drift.iter().map(|v| short(*v)).collect();
            table.row(vec![
                number(self.clock.value(field.time)),
                number(field.mean_speed),
                number(field.rms_speed),
                number(field.greatest_speed),
                field.fastest.to_string(),
                format!("({})", drift.join(", ")),
                number(field.kinetic_energy),
            ]);
        }
        table.lines()
    }
}

/// Writes `velocities.csv`, and as a drawing `velocities`.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(history: &History, report: &Report, folder: &mut Folder) -> Result<()> {
    let d = history.dimension();
    let axes =
        |name: &str, unit: &str| ["x", "y", "z"][..d].iter().map(|a| format!("{name}{a}_{unit}")).collect::<Vec<_>>();
    let head = [
        vec!["step".into(), "time_s".into(), "grain".into()],
        axes("", "m"),
        axes("v", "m_per_s"),
        vec!["speed_m_per_s".into()],
    ]
    .concat();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let rows = report.fields.iter().flat_map(|field| {
        (0..field.speed.len()).map(move |grain| {
            let part =
                |all: &[f64]| all[grain * d..(grain + 1) * d].iter().map(ToString::to_string).collect::<Vec<_>>();
            let (position, velocity) = (part(&field.state.position), part(&field.state.velocity));
            [row![field.step, field.time, grain], position, velocity, row![field.speed[grain]]].concat()
        })
    });
    folder.table("velocities", &head, rows)?;
    Ok(folder.draw("velocities", &map(history, report, &Titles::read(history)?)?)?)
}

/// The map of the velocities.
///
/// # Errors
/// Those of reading the history.
pub fn map(history: &History, report: &Report, titles: &Titles) -> Result<Drawing> {
    let scale = |title: &str, high: f64| Scale { title: title.into(), low: 0.0, high, ramp: Ramp::Areas };
    // in 3D the arrow of a square would be a mean over all depths
    let flat = history.dimension() == 2;
    let radius = history.grains()?.radius;
    let diameter = 2.0 * radius.iter().sum::<f64>() / radius.len() as f64;
    let duration = history.times().last().zip(history.times().first()).map_or(0.0, |(last, first)| last - first);
    let mut moving = false;
    let mut panels = vec![];
    for field in &report.fields {
        let usual = scale("", usual_speed(field.speed.clone()));
        let rests = usual.high * duration < AT_REST * diameter;
        moving |= !rests;
        let told = if rests {
            "at rest".into()
        } else {
            format!("v₉₉ = {} m/s, mean {} m/s", short(usual.high), short(field.mean_speed))
        };
        panels.push(Panel {
            caption: vec![titles.of(history, field.frame), told],
            grains: field.state.clone(),
            walls: history.wall_state(field.frame)?,
            fills: field.speed.iter().map(|&speed| if rests { RESTS.into() } else { usual.colour(speed) }).collect(),
            outline: colour::GREY,
            arrows: if flat && !rests { arrows(&field.state) } else { vec![] },
            ..Panel::default()
        });
    }
    let mut legend = if moving { vec![Key::Bar(scale("speed over v₉₉", 1.0))] } else { vec![] };
    if flat && moving {
        legend.push(Key::Arrow("mean velocity in a square".into()));
    }
    Ok(draw(&Sample::with_depth(history)?, &panels, &legend))
}

impl OnPage for Report {
    const ID: &'static str = "velocities";
    const TITLE: &'static str = "Velocities";

    fn section(&self, history: &History, maps: &Maps) -> Result<Section> {
        let mut figures = vec![];
        for field in &self.fields {
            let one = Self { fields: vec![field.clone()], ..*self };
            let at = self.clock.at(field.time);
            let alt = format!("Grains coloured by their speed at {at}, with arrows of the mean velocity.");
            figures.push(map_figure(&map(history, &one, &maps.titles)?, &alt, &format!("Velocities at {at}."))?);
        }
        Ok(Section { figures, ..Section::of::<Self>() })
    }
}

/// Arrows of the mean velocities of disks in the squares of a grid; the longest is as long as a
/// square is wide.
fn arrows(state: &GrainState) -> Vec<Arrow> {
    let ends = [0, 1].map(|k| range(state.position.chunks(2).map(|x| x[k])));
    let side = ends.iter().map(|[low, high]| high - low).fold(0.0, f64::max) / SQUARES;
    if side <= 0.0 || !side.is_finite() {
        return vec![];
    }
    let square = |grain: &usize| [0, 1].map(|k| ((state.position[2 * grain + k] - ends[k][0]) / side) as i64);
    let mut grains: Vec<usize> = (0..state.position.len() / 2).collect();
    grains.sort_by_key(square);
    let mean = |group: &[usize], all: &[f64]| {
        [0, 1].map(|k| group.iter().map(|&grain| all[2 * grain + k]).sum::<f64>() / group.len() as f64)
    };
    let means: Vec<[[f64; 2]; 2]> = grains
        .chunk_by(|a, b| square(a) == square(b))
        .map(|group| [mean(group, &state.position), mean(group, &state.velocity)])
        .collect();
    let longest = means.iter().map(|[_, v]| v[0].hypot(v[1])).fold(0.0, f64::max);
    if longest == 0.0 {
        return vec![];
    }
    let arrow = |[from, v]: [[f64; 2]; 2]| Arrow {
        from: from.to_vec(),
        to: [0, 1].map(|k| from[k] + v[k] * side / longest).to_vec(),
    };
    means.into_iter().map(arrow).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of grains that turns about the origin at 2 rad/s.
    fn turning() -> GrainState {
        let x = [-3.0, -1.0, 1.0, 3.0];
        GrainState {
            position: x.iter().flat_map(|x| [*x, 0.0]).collect(),
            velocity: x.iter().flat_map(|x| [0.0, 2.0 * x]).collect(),
            ..GrainState::default()
        }
    }

    #[test]
    fn a_turning_row_has_the_speeds_of_a_rigid_body() {
        let field = field(0, (0, 0.0), turning(), &[1.0, 3.0, 3.0, 1.0], 2);
        assert_eq!(field.speed, [6.0, 2.0, 2.0, 6.0]);
        assert_eq!((field.mean_speed, field.greatest_speed, field.fastest), (4.0, 6.0, 0));
        assert_eq!((field.rms_speed, field.drift), (20f64.sqrt(), vec![0.0, 0.0]));
        // ½ ω² Σ m x² = ½ · 4 · (9 + 3 + 3 + 9)
        assert_eq!(field.kinetic_energy, 48.0);
    }

    #[test]
    fn the_longest_arrow_is_one_square_long() {
        let arrows = arrows(&turning());
        assert_eq!(arrows.len(), 4);
        let rise: Vec<f64> = arrows.iter().map(|a| a.to[1] - a.from[1]).collect();
        let side = 6.0 / SQUARES;
        for (rise, expected) in rise.iter().zip([-side, -side / 3.0, side / 3.0, side]) {
            assert!((rise - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn grains_at_rest_have_no_arrows() {
        let still = GrainState { velocity: vec![0.0; 8], ..turning() };
        assert!(arrows(&still).is_empty());
        assert!(arrows(&GrainState::default()).is_empty());
    }

    #[test]
    fn one_fast_grain_does_not_set_the_scale() {
        let mut speeds = vec![1.0; 199];
        speeds.push(50.0);
        assert_eq!(usual_speed(speeds), 1.0);
        assert_eq!(usual_speed(vec![]), 0.0);
    }
}
