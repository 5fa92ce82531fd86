//! `dem-run limit`: the largest load that the sample can bear before a bond must break.

use std::fmt;
use std::io::Write;

use dem_core::body::Drive;
use dem_core::dim::Dim;
use dem_core::solver::limit_load::{ACCURACY, LimitLoad};
use dem_core::world::World;
use serde::Serialize;

use crate::build::build;
use crate::check;
use crate::error::{NoConvergence, RunError};
use crate::in_dimension;
use crate::memory;
use crate::output::{counted, facts, listed, number, print_result};
use crate::run::{Execution, handle_signals};
use crate::scene::{self, Function, Scene, SolverKind};
use crate::signals::Interrupt;

/// Options of `dem-run limit`.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitOptions {
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether the result on stdout is JSON.
    pub json: bool,
    /// Whether a scene is run although it needs more memory than is free.
    pub ignore_memory: bool,
}

/// What the largest load is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// There is one.
    Limit,
    /// Some reactions bear any load.
    Unbounded,
    /// The constant loads break a bond before any other load acts; together with the growing loads
    /// they are borne from some factor on.
    BrokenAtStart,
    /// The same, whatever the factor.
    NeverBorne,
}

/// A load that grows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GrowingLoad {
    /// `walls.NAME` or `grains.loads.K`.
    pub load: String,
    /// At the start and at the end of the run (N along the wall's direction; the factor of a load
    /// on a grain). Of a wall driven by a velocity: 0 and 1 N, or −1 N if it moves backwards.
    pub from: f64,
    /// At the end of the run.
    pub to: f64,
    /// At the limit, if there is one and its factor is not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

/// The limit load of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// What it is.
    pub outcome: Outcome,
    /// Largest factor on the growth of the loads from t = 0 to the end of the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factor: Option<f64>,
    /// Difference between the factor that the reactions found bear and the one that a mechanism
    /// found proves to be the largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factor_error: Option<f64>,
    /// Time at which the loads of a run reach the limit (s), if they grow at constant rates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Grains with weight that no chain of contacts joins with a support.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unsupported: Vec<u32>,
    /// Least factor that is borne, if the constant loads alone are not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_factor: Option<f64>,
    /// The largest part of the growth that is borne, if the loads at t = 0 alone are not; none if
    /// any larger part is borne.
    pub most_factor: Option<f64>,
    /// The loads that grow.
    pub loads: Vec<GrowingLoad>,
    /// Number of grains.
    pub grains: usize,
    /// Number of bonds.
    pub bonds: usize,
}

/// Computes the limit load of a scene and prints it.
///
/// # Errors
/// [`RunError`]: a sample that cannot be prepared, a scene without a load that grows, a programme
/// that was not solved.
pub fn limit(scene: &Scene, options: &LimitOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    in_dimension!(scene, D => limit_in::<D>(scene, options, &interrupt))
}

/// A load that grows: its name, values at the start and the end, and whether it grows at a constant
/// rate.
type Growth = (String, f64, f64, bool);

fn limit_in<D: Dim>(scene: &Scene, options: &LimitOptions, interrupt: &Interrupt) -> Result<(), RunError> {
    let loads = Loads::of(scene)?;
    if !options.ignore_memory {
        // the programme factorises a matrix over all bodies, whatever the solver of the scene
        let mut factorised = scene.clone();
        factorised.solver.kind = SolverKind::Interior(Default::default());
        memory::refuse_too_large(&factorised, check::count(scene)?)?;
    }
    let mut progress = options.execution.show();
    let mut world = build::<D>(scene, None, &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?
    .world;
    progress.finish();
    let bent = loads.growing.iter().find(|(_, _, _, straight)| !straight);
    if let (Some((load, ..)), false) = (bent, options.execution.quiet) {
        let text = "does not grow at a constant rate: the loads between its values at t = 0 and time.end are taken on a \
                    straight line";
        let _ = writeln!(std::io::stderr(), "warning: {load} {text}");
    }
    let limit = loads.limit(scene, &mut world)?;
    Ok(print_result(&OfScene { limit, scene: serde_json::to_value(scene)? }, options.json)?)
}

/// A limit load with its scene, so that a reader can compare it with that of a run.
#[derive(Serialize)]
struct OfScene {
    #[serde(flatten)]
    limit: Limit,
    scene: serde_json::Value,
}

impl fmt::Display for OfScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.limit.fmt(f)
    }
}

/// The loads of a scene that grow.
pub(crate) struct Loads<'a> {
    growing: Vec<Growth>,
    /// The wall whose force is taken if no load grows: its index and its name.
    pushed: Option<(usize, &'a str)>,
}

impl<'a> Loads<'a> {
    /// The loads of a scene that grow.
    ///
    /// # Errors
    /// [`RunError::Usage`]: the scene has stages, a stress that grows, or no load.
    pub fn of(scene: &'a Scene) -> Result<Self, RunError> {
        refuse_stages_and_growing_stresses(scene)?;
        let growing = growing(scene);
        let pushed = if growing.is_empty() { Some(pushed(scene)?) } else { None };
        Ok(Self { growing, pushed })
    }

    /// The limit load of the world of that scene.
    ///
    /// # Errors
    /// [`NoConvergence::Limit`].
    pub fn limit<D: Dim>(mut self, scene: &Scene, world: &mut World<D>) -> Result<Limit, RunError> {
        // in a run a velocity drives a pushed wall: no force reaches the limit at some time
        let steady = self.pushed.is_none() && self.growing.iter().all(|(_, _, _, straight)| *straight);
        let found = match self.pushed.and_then(|(wall, name)| Some((wall, name, push(scene, world, wall)?))) {
            Some((wall, name, (sign, direction))) => {
                self.growing.push((format!("walls.{name}"), 0.0, sign, true));
                world.limit_of_force(wall, direction)
            }
            None => world.limit_load(0.0, scene.time.end),
        };
        describe(scene, world, (self.growing, steady), found)
    }
}

/// A limit load is that of one course of forces; a stress may only confine.
fn refuse_stages_and_growing_stresses(scene: &Scene) -> Result<(), RunError> {
    if !scene.stages.is_empty() {
        let text = "the scene has stages, and the limit load is that of one course of loads: `--set stages=[]`, with the \
                    drives of one stage at its walls";
        return Err(RunError::Usage(text.into()));
    }
    let end = scene.time.end;
    let grows = scene.walls.iter().find(|(_, wall)| match wall.drive() {
        scene::Drive::Stress(stress) => stress.at(0.0) != stress.at(end),
        _ => false,
    });
    let refusal = |(name, _)| {
        Err(RunError::Usage(format!("walls.{name}.stress grows: give a force in its place, or a constant stress")))
    };
    grows.map_or(Ok(()), refusal)
}

/// The loads of a scene that grow.
fn growing(scene: &Scene) -> Vec<Growth> {
    let end = scene.time.end;
    let of = |name: String, function: &Function| (name, function.at(0.0), function.at(end), straight(function, end));
    let walls = scene.walls.iter().filter_map(|(name, wall)| match wall.drive() {
        scene::Drive::Force(force) => Some(of(format!("walls.{name}"), &force)),
        scene::Drive::Fixed | scene::Drive::Velocity(_) | scene::Drive::Stress(_) => None,
    });
    let loads = scene.grains.iter().flat_map(|grains| &grains.loads).enumerate();
    let loads = loads.map(|(k, load)| of(format!("grains.loads.{k}"), &load.time));
    let membrane = scene.membrane.iter().map(|membrane| of("membrane".into(), &membrane.pressure));
    walls.chain(loads).chain(membrane).filter(|(_, from, to, _)| from != to).collect()
}

/// Whether a function of time is linear from 0 to `end`.
fn straight(function: &Function, end: f64) -> bool {
    let times: Vec<f64> = match function {
        Function::Constant(_) => vec![],
        Function::Ramp(ramp) => vec![ramp.start],
        Function::Table(rows) => rows.iter().map(|row| row[0]).collect(),
    };
    let (first, last) = (function.at(0.0), function.at(end));
    let off = |t: f64| (function.at(t) - first - (last - first) * t / end).abs();
    times.into_iter().filter(|t| (0.0..=end).contains(t)).all(|t| off(t) <= 1e-12 * (first.abs() + last.abs()))
}

/// The wall whose force is taken where no load grows: the load wall, if a velocity drives it. Its
/// index and its name.
///
/// # Errors
/// [`RunError::Usage`]: there is none.
fn pushed(scene: &Scene) -> Result<(usize, &str), RunError> {
    let load_wall = scene.load_wall();
    let moves = |wall: &scene::Wall| matches!(wall.drive(), scene::Drive::Velocity(_));
    let mut walls = scene.walls.iter().enumerate();
    let found = walls.find(|(_, (name, wall))| load_wall == Some(name.as_str()) && moves(wall));
    found.map(|(place, (name, _))| (place, name.as_str())).ok_or_else(|| {
        RunError::Usage(
            "no load of the scene grows between t = 0 and time.end: give a wall a force_rate, or a load on a grain or the \
             pressure of a membrane a ramp; of a wall that is driven by a velocity the force is taken, if it is the only \
             driven wall or the load_wall"
                .into(),
        )
    })
}

/// The way that a wall driven by a velocity moves: the sign of its last speed, and the unit
/// direction of that way.
fn push<D: Dim>(scene: &Scene, world: &World<D>, wall: usize) -> Option<(f64, D::Vector)> {
    let Drive::Velocity { direction, speed } = &world.walls[wall].drive else { return None };
    let sign = if speed(scene.time.end) < 0.0 { -1.0 } else { 1.0 };
    Some((sign, *direction * sign))
}

/// The limit load found. `steady`: the loads of a run grow at constant rates.
fn describe<D: Dim>(
    scene: &Scene,
    world: &World<D>,
    (growing, steady): (Vec<Growth>, bool),
    found: LimitLoad,
) -> Result<Limit, RunError> {
    let unsupported = match &found {
        LimitLoad::Unsupported { grains } => grains.clone(),
        _ => Vec::new(),
    };
    let (outcome, factor, factor_error, [least_factor, most_factor]) = match found {
        LimitLoad::Factor { lower, upper } => {
            (Outcome::Limit, Some(0.5 * (lower + upper)), Some((upper - lower).abs()), [None; 2])
        }
        LimitLoad::Unbounded => (Outcome::Unbounded, None, None, [None; 2]),
        LimitLoad::NeverBalanced | LimitLoad::Unsupported { .. } => (Outcome::NeverBorne, None, None, [None; 2]),
        LimitLoad::BrokenAtStart { least, most } => (Outcome::BrokenAtStart, None, None, [Some(least), most]),
        LimitLoad::Undecided => return Err(NoConvergence::Limit.into()),
    };
    let factor = factor.map(|factor| if factor.abs() < ACCURACY { 0.0 } else { factor });
    // a body that the smallest load moves may come to rest where more is borne
    let bound = factor.filter(|factor| *factor != 0.0);
    let loads = growing.into_iter().map(|(load, from, to, _)| GrowingLoad {
        load,
        from,
        to,
        limit: bound.map(|factor| from + factor * (to - from)),
    });
    Ok(Limit {
        outcome,
        factor,
        factor_error,
        time: bound.filter(|_| steady).map(|factor| factor * scene.time.end),
        unsupported,
        least_factor,
        most_factor,
        loads: loads.collect(),
        grains: world.grains.len(),
        bonds: world.bonds.len(),
    })
}

impl Limit {
    /// The outcome in words.
    pub(crate) fn in_words(&self) -> String {
        match (self.outcome, self.factor, self.least_factor) {
            (Outcome::Limit, Some(0.0), _) => {
                "0 of the growth: the smallest load moves a body, and where it comes to rest may bear more; is there a grain \
                 or a wall without support?"
                    .into()
            }
            (Outcome::Limit, Some(factor), _) => format!("{} of the growth", number(factor)),
            (Outcome::BrokenAtStart, _, Some(least)) => {
                let more = self.most_factor.map_or_else(|| "and more".into(), |most| format!("to {}", number(most)));
                let least = number(least);
                format!("the loads at t = 0 alone break a bond; with {least} of the growth {more} they are borne")
            }
            (Outcome::Unbounded, ..) => "none: reactions within all limits bear any load".into(),
            _ if !self.unsupported.is_empty() => format!(
                "the weight moves grains that no chain of contacts joins with a support, by number: {}; leave them out of \
                 the sample: `dem-run pack` writes it, a line for each grain from 0 on, and --json lists them all",
                listed(&self.unsupported)
            ),
            _ => {
                "the loads at t = 0 break a bond or move a body, whatever the growing load; is there a grain or a wall \
                  without support?"
                    .into()
            }
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = |load: &GrowingLoad| match load.load.as_str() {
            "membrane" => " Pa",
            name if name.starts_with("walls.") => " N",
            _ => " times its force and torque",
        };
        let mut lines = vec![("sample", format!("{}, {}", counted(self.grains, "grain"), counted(self.bonds, "bond")))];
        for load in &self.loads {
            let unit = unit(load);
            lines.push(("growing load", format!("{}, {} to {}{unit}", load.load, number(load.from), number(load.to))));
        }
        lines.push(("limit", self.in_words()));
        let error = self.factor.filter(|factor| *factor != 0.0).and(self.factor_error);
        lines.extend(error.map(|error| ("  known within", format!("{} of the growth", number(error)))));
        for load in &self.loads {
            if let Some(limit) = load.limit {
                lines.push(("limit load", format!("{}, {}{}", load.load, number(limit), unit(load))));
            }
        }
        let late = if self.factor > Some(1.0) { ", after the end of the run" } else { "" };
        lines.extend(self.time.map(|time| ("reached at", format!("{} s{late}", number(time)))));
        write!(f, "{}", facts(&lines).trim_end())
    }
}
