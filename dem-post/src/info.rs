//! A summary of a history, in about twenty lines.

use std::path::{Path, PathBuf};

use clap::Args;
use dem_history::{CopyAs, Ending, History, Parameters, RuptureMode, Series, Wall, WallDrive};
use serde::Serialize;

use crate::analysis::Analysis;
use crate::clock::Clock;
use crate::cracks::Modes;
use crate::extent::range;
use crate::output::{Result, escaped, facts, in_shell, number, quantity};
use crate::section::{Maps, OnPage, Section};
use crate::{check, pack, stress_strain};

/// Print the content of a history in about twenty lines; --check verifies the file, --repair closes
/// it after a kill.
#[derive(Debug, Args)]
pub struct Command {
    /// The history.
    #[arg(value_name = "FILE.h5")]
    history: PathBuf,
    /// Read everything and report each violation of the layout: types, shapes, units, order,
    /// numbers that are not finite, bonds and their ruptures. The exit code is 4 if there is a
    /// violation.
    #[arg(long)]
    check: bool,
    /// Repair the file of a killed run so that any program opens it: its complete frames are
    /// copied, and the copy replaces the file. `dem-run resume` does the same and continues the
    /// run.
    #[arg(long, conflicts_with = "check")]
    repair: bool,
}

/// The report of the command.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Answer {
    /// What the history holds.
    Contents(Box<Report>),
    /// Whether it is sound: `--check`.
    Check(check::Report),
    /// The copy that replaced it: `--repair`.
    Repair(pack::Report),
    /// That it needs no repair: `--repair` of a history that was closed.
    Closed {
        /// The history.
        file: String,
        /// Always false.
        repaired: bool,
    },
}

impl Analysis for Command {
    const NAME: &'static str = "info";
    type Input = History;
    type Report = Answer;

    fn open(&self) -> Result<History> {
        Ok(if self.check { History::open_as_is(&self.history)? } else { History::open(&self.history)? })
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Answer> {
        Ok(if self.repair && !history.open_ended() {
            Answer::Closed { file: history.path().display().to_string(), repaired: false }
        } else if self.repair {
            Answer::Repair(pack::write(history, &self.history, CopyAs::Plain, quiet)?)
        } else if self.check {
            Answer::Check(check::read(history, quiet)?)
        } else {
            Answer::Contents(Box::new(read(history)?))
        })
    }

    fn table(answer: &Answer) -> String {
        match answer {
            Answer::Contents(report) => report.table(),
            Answer::Check(report) => report.table(),
            Answer::Repair(report) => report.table(),
            Answer::Closed { file, .. } => {
                format!("nothing to repair: {} is closed; --check verifies it", escaped(file))
            }
        }
    }

    fn verdict(answer: &Answer) -> Result<()> {
        if let Answer::Check(report) = answer { report.verdict() } else { Ok(()) }
    }
}

/// What a history holds.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The file.
    pub file: String,
    /// Its length, bytes.
    pub bytes: u64,
    /// Whether it was never closed.
    pub open_ended: bool,
    /// Why the run ended, as in the summary of `dem-run`; `None` if it has not ended, was killed,
    /// or the program did not record it.
    pub ending: Option<Ending>,
    /// Program, build, host and start of the run.
    pub origin: String,
    /// Last steps of earlier scenes: where `resume --force` changed the scene.
    pub scene_changed_after: Vec<i64>,
    /// Dimension.
    pub dimension: usize,
    /// Seed.
    pub seed: u64,
    /// Number of grains.
    pub grains: usize,
    /// Least and greatest diameter, m.
    pub diameters: [f64; 2],
    /// Mass of all grains, kg.
    pub mass: f64,
    /// The walls: name, shape and drive.
    pub walls: Vec<[String; 3]>,
    /// The wall that loads the sample; `None` where no wall is driven, or where several are driven
    /// and the scene does not name the load wall.
    pub load_wall: Option<String>,
    /// How many walls are driven.
    #[serde(skip)]
    pub driven: usize,
    /// Bonds at the start.
    pub bonds: usize,
    /// Least and greatest cohesion, N.
    pub cohesion: Option<[f64; 2]>,
    /// Bonds that broke.
    pub broken: Modes,
    /// Number of frames.
    pub frames: usize,
    /// First and last step and time (s) of the frames.
    pub first: Option<(i64, f64)>,
    /// See `first`.
    pub last: Option<(i64, f64)>,
    /// Number of observed steps.
    pub observed: usize,
    /// Whether frames hold the reactions of the contacts.
    pub reactions: bool,
    /// Contacts at the last frame.
    pub contacts: Option<usize>,
    /// Greatest residual, and the time at which it occurred (s).
    pub worst_residual: Option<(f64, f64)>,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
    /// Mean and greatest number of iterations.
    pub iterations: Option<[f64; 2]>,
    /// Greatest penetration, m.
    pub penetration: Option<f64>,
    /// Work from outside, J.
    pub external_work: Option<f64>,
    /// Kinetic energy at the end, J.
    pub kinetic_energy: Option<f64>,
    /// Energy dissipated by friction, J.
    pub friction: Option<f64>,
    /// Remainder of the energy balance, J.
    pub energy_remainder: Option<f64>,
    /// Names of all observables.
    pub observables: Vec<String>,
}

/// Reads the summary of a history.
///
/// # Errors
/// Those of reading it.
pub fn read(history: &History) -> Result<Report> {
    let (parameters, grains, bonds) = (history.parameters()?, history.grains()?, history.bonds()?);
    let revision = if parameters.git_revision.is_empty() { "unknown" } else { &parameters.git_revision };
    let mut broken = Modes::default();
    history.ruptures()?.iter().for_each(|rupture| broken.add(rupture.mode));
    let listed = history.walls()?;
    let (driven, load_wall) = stress_strain::load_wall(&listed, &parameters.scene);
    let frames = history.frames();
    let moment = |frame: usize| (history.steps()[frame], history.times()[frame]);
    let mut report = Report {
        file: history.path().display().to_string(),
        bytes: history.length(),
        open_ended: history.open_ended(),
        ending: Some(history.ending()?).filter(|ending| *ending != Ending::Open),
        origin: format!(
            "dem-run {} (git {revision}, {}) on {}, {}",
            parameters.version, parameters.build, parameters.host, parameters.start
        ),
        scene_changed_after: changes(&parameters),
        dimension: history.dimension(),
        seed: parameters.seed,
        grains: grains.radius.len(),
        diameters: range(grains.radius.iter().copied()).map(|r| 2.0 * r),
        mass: grains.mass.iter().sum(),
        walls: walls(&listed),
        load_wall: load_wall.map(String::from),
        driven: driven.len(),
        bonds: bonds.len(),
        cohesion: (!bonds.is_empty()).then(|| range(bonds.strength.iter().copied())),
        broken,
        frames,
        clock: Clock::of(history),
        first: (frames > 0).then(|| moment(0)),
        last: (frames > 0).then(|| moment(frames - 1)),
        observed: history.observed_steps(),
        contacts: if frames > 0 { Some(history.contacts(frames - 1)?.len()) } else { None },
        reactions: history.has_reactions(),
        observables: history.observable_names()?,
        ..Report::default()
    };
    report.read_observables(history)?;
    Ok(report)
}

/// Name, shape and drive of each wall.
fn walls(walls: &[Wall]) -> Vec<[String; 3]> {
    let drive = |drive| match drive {
        WallDrive::Fixed => "fixed",
        WallDrive::Velocity => "driven by a velocity",
        WallDrive::Force => "driven by a force",
    };
    walls.iter().map(|wall| [wall.name.clone(), wall.kind.label().to_lowercase(), drive(wall.drive).into()]).collect()
}

impl OnPage for Report {
    const ID: &'static str = "run";
    const TITLE: &'static str = "Run";

    fn section(&self, _: &History, _: &Maps) -> Result<Section> {
        let facts = self.facts().into_iter().map(|(name, value)| (name.to_string(), value)).collect();
        Ok(Section { facts, ..Section::of::<Self>() })
    }
}

/// The last steps of the scenes before the present one.
fn changes(parameters: &Parameters) -> Vec<i64> {
    let list: Vec<serde_json::Value> = serde_json::from_str(&parameters.earlier_scenes).unwrap_or_default();
    list.iter().filter_map(|earlier| earlier["last_step"].as_i64()).collect()
}

impl Report {
    fn read_observables(&mut self, history: &History) -> Result<()> {
        let last = |name: &str| -> Result<Option<f64>> {
            Ok(history.observable(name)?.and_then(|series| series.value.last().copied()))
        };
        let greatest = |series: Series| -> Option<(f64, f64)> {
            series.value.into_iter().zip(series.time).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        self.worst_residual = history.observable("solver_residual")?.and_then(greatest);
        self.penetration = history.observable("penetration")?.and_then(greatest).map(|(depth, _)| depth);
        self.iterations = history.observable("solver_iterations")?.and_then(|series| {
            let mean = series.value.iter().sum::<f64>() / series.value.len() as f64;
            greatest(series).map(|(most, _)| [mean, most])
        });
        self.external_work = last("external_work")?;
        self.kinetic_energy = last("kinetic_energy")?;
        self.friction = last("dissipation_friction")?;
        self.energy_remainder = last("energy_remainder")?;
        Ok(())
    }

    /// The report as lines.
    pub fn table(&self) -> String {
        let mut lines = self.facts();
        let hints = [
            ("cracks", self.bonds > 0),
            ("emission", self.bonds > 0),
            ("chains", self.reactions),
            ("velocities", true),
            ("fabric", true),
            ("stress-strain", self.driven > 0),
            ("frames", self.bonds > 0),
            ("film", self.bonds > 0),
            ("report", true),
        ];
        let hints: Vec<&str> = hints.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect();
        lines.push(("look further", format!("dem-post {} {}", hints.join("|"), in_shell(Path::new(&self.file)))));
        facts(&lines)
    }

    /// Names and values, in order.
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let state = if self.open_ended { "not closed: the run is in progress or was stopped" } else { "closed" };
        let [least, most] = self.diameters.map(|d| number(1e3 * d));
        let mut lines = vec![
            ("file", format!("{} ({:.1} MB, {state})", self.file, self.bytes as f64 / 1e6)),
            ("written by", self.origin.clone()),
            ("dimension, seed", format!("{}, {}", self.dimension, self.seed)),
            ("grains", format!("{}, diameters {least} to {most} mm, {} kg in all", self.grains, number(self.mass))),
        ];
        if !self.scene_changed_after.is_empty() {
            let steps: Vec<String> = self.scene_changed_after.iter().map(ToString::to_string).collect();
            lines.push(("scene changed", format!("after step {} (/parameters/earlier_scenes)", steps.join(", "))));
        }
        if self.walls.is_empty() {
            lines.push(("walls", "none".into()));
        }
        for [name, kind, drive] in &self.walls {
            let load = if self.driven > 1 && self.load_wall.as_ref() == Some(name) { ", the load wall" } else { "" };
            lines.push(("wall", format!("{name}: {kind}, {drive}{load}")));
        }
        lines.push(("bonds", self.bond_line()));
        lines.push(("time", self.time_line()));
        lines.extend(self.ending.map(|ending| ("ended", ending.reason().into())));
        lines.extend([("observed", format!("{} steps of {}", self.observed, self.observables.join(", ")))]);
        lines.extend(self.measure_lines());
        lines
    }

    /// The measured values, one per line.
    fn measure_lines(&self) -> Vec<(&'static str, String)> {
        vec![
            ("contacts", self.contacts.map_or_else(|| "–".into(), |n| format!("{n} at the last frame"))),
            (
                "worst residual",
                self.worst_residual
                    .map_or_else(|| "–".into(), |(r, t)| format!("{} at {}", number(r), self.clock.moment(t))),
            ),
            (
                "iterations",
                self.iterations
                    .map_or_else(|| "–".into(), |[mean, most]| format!("{mean:.1} a step, at most {most:.0}")),
            ),
            ("worst penetration", quantity(self.penetration, "m")),
            ("work from outside", quantity(self.external_work, "J")),
            ("kinetic energy", quantity(self.kinetic_energy, "J")),
            ("lost to friction", quantity(self.friction, "J")),
            ("energy left over", quantity(self.energy_remainder, "J")),
        ]
    }

    fn bond_line(&self) -> String {
        let Some([least, most]) = self.cohesion else {
            return "none".into();
        };
        let range = if least == most { number(least) } else { format!("{} to {}", number(least), number(most)) };
        let Modes { tension, shear, rolling, twist } = self.broken;
        let [t, s, r, w] = [RuptureMode::Tension, RuptureMode::Shear, RuptureMode::Rolling, RuptureMode::Twist];
        let modes = [(tension, t), (shear, s), (rolling, r), (twist, w)].into_iter();
        let told = modes.filter(|(number, mode)| *number > 0 || *mode != RuptureMode::Twist);
        let told: Vec<String> = told.map(|(number, mode)| format!("{number} {}", mode.label())).collect();
        format!("{}, cohesion {range} N; {} broken: {}", self.bonds, self.broken.total(), told.join(", "))
    }

    fn time_line(&self) -> String {
        match (self.first, self.last) {
            (Some(first), Some(last)) => {
                let times = format!("{} to {} s, ", number(first.1), number(last.1));
                let times = if self.clock.step().is_some() { "" } else { &times };
                format!("{times}steps {} to {}, {} frames", first.0, last.0, self.frames)
            }
            _ => "no frame".into(),
        }
    }
}
