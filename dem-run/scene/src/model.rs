//! The model of a scene: everything but the sample, the walls and the solver, which have their own
//! files.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::function::Function;
use super::material::{Materials, PairBonds, Scatter};
use super::membrane::Membrane;
use super::region::Region;
use super::sample::Sample;
use super::solver::Solver;
use super::stage::{Stage, StageDrive};
use super::stop::Stop;
use super::wall::{Drive, Wall};

/// A scene: what is simulated, in SI units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// JSON Schema for editors, as printed by `dem-run schema`.
    #[serde(default, rename = "$schema", skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Title of the scene, one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Dimension of space: 2 (disks) or 3 (spheres).
    pub dimension: u8,
    /// Seed of all random numbers of the preparation.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Thickness of the disks in 2D (m); default: 1 m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
    /// The grains.
    pub sample: Sample,
    /// Density, friction and restitution, and further materials.
    pub materials: Materials,
    /// Cohesive bonds between grains; default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bonds: Option<Bonds>,
    /// Grains that are held fixed or loaded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grains: Option<Grains>,
    /// Walls, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub walls: BTreeMap<String, Wall>,
    /// A flexible membrane in 2D: a pressure on the free surface of the sample; default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub membrane: Option<Membrane>,
    /// Name of the driven wall whose force is the load of the sample, as reported at the first
    /// break, at the collapse and at the peak. Default: the wall of `stop.wall_travel`, else the
    /// only driven wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_wall: Option<String>,
    /// Gravity: one number for each dimension (m/s²); default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Vec<f64>>,
    /// Time step and end of the run.
    pub time: Time,
    /// The contact solver.
    #[serde(default)]
    pub solver: Solver,
    /// How bonds break within a step.
    #[serde(default)]
    pub rupture: Rupture,
    /// How often the history is written.
    pub output: Output,
    /// Stages of loading, one after the other; default: none. The run ends with the last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// Conditions that end the run before `time.end`; default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
}

/// Cohesive bonds, formed once, at the start or by a stage with `cement`, between all grains closer
/// than `gap_tolerance`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bonds {
    /// Tensile strength of every bond (N); zero means no bonds. Give either this or `stress`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Tensile strength as a stress over the section of a bond (Pa); zero means no bonds. Give
    /// either this or `strength`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<f64>,
    /// Two grains are bonded if their gap is at most this fraction of their mean diameter.
    pub gap_tolerance: f64,
    /// Friction of intact bonds, for shear and rolling; default: the friction between grains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Coefficient of the shear limit: an intact bond bears tangential forces up to this times (r_n
    /// + r_coh); default: `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear: Option<f64>,
    /// Coefficient of the rolling limit: an intact bond bears bending moments up to this times the
    /// mean diameter times (r_n + r_coh); default: `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling: Option<f64>,
    /// Coefficient of the twist limit in 3D: an intact bond bears twisting moments up to this times
    /// the mean diameter times (r_n + r_coh). Without it, bonds do not resist twist.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twist: Option<f64>,
    /// Scatter of the strengths from bond to bond, drawn with `seed`. Without it, all bonds of one
    /// size are equally strong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Scatter>,
    /// Flow of an intact bond at its limit.
    #[serde(default)]
    pub flow: Flow,
    /// Stiffness of elastic bonds. Without it, bonds are rigid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<Stiffness>,
    /// Regions without bonds, as notches and joints: no bond forms between two grains if the line
    /// between their centres meets one of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub absent: Vec<Region>,
    /// CSV file of the bonds, instead of one between all grains closer than `gap_tolerance`: a
    /// header `i,j` (two grains, counted from 0), to which `strength` (N), `shear` and `rolling`
    /// may be added, in any order; an empty cell leaves the value to the scene. `scatter` does not
    /// change listed strengths. A listed pair with a larger gap than `gap_tolerance` is an error. A
    /// relative path starts from the folder of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub list: Option<PathBuf>,
}

/// Stiffness of elastic bonds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stiffness {
    /// The same springs in every bond.
    Springs(Springs),
    /// Bars whose length and width are the mean diameter of the pair. In 2D their section is
    /// rectangular, width times thickness; in 3D it is round.
    Young(Young),
}

/// Springs of a bond.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Springs {
    /// Along the normal (N/m).
    pub normal: f64,
    /// Across the normal (N/m).
    pub tangential: f64,
    /// In bending (N m/rad).
    pub rolling: f64,
    /// In twist (N m/rad), for bonds that resist twist.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twist: Option<f64>,
}

/// Material of a bond.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Young {
    /// Young's modulus (Pa).
    pub modulus: f64,
    /// Poisson's ratio, above −1 and at most 0.5.
    pub poisson_ratio: f64,
}

/// Flow of an intact bond at its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Flow {
    /// Without the shift μ‖u_t‖: a convex problem. The bond breaks at its limit in either case.
    #[default]
    Associated,
    /// With the shift μ‖u_t‖, as between dry grains.
    Bipotential,
}

/// Grains that are held fixed or loaded. Grains are counted from 0, in the order of the sample.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Grains {
    /// Numbers of the grains that are held fixed.
    pub fixed: Vec<usize>,
    /// Forces and torques on grains.
    pub loads: Vec<Load>,
}

/// A force and a torque on one grain, at its centre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Number of the grain.
    pub grain: usize,
    /// Force: one number for each dimension (N); default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<Vec<f64>>,
    /// Torque: `[t]` in 2D, counter-clockwise, `[tx, ty, tz]` in 3D (N m); default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque: Option<Vec<f64>>,
    /// Factor on force and torque, a function of time; default: 1.
    #[serde(default = "one")]
    pub time: Function,
}

/// Time step and end of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Time step (s).
    pub step: f64,
    /// End of the run (s). If it is not a multiple of `step`, the last step ends before it.
    pub end: f64,
}

/// How bonds break within a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rupture {
    /// All bonds at their limit break and the step is solved again, until no bond breaks.
    #[default]
    Cascade,
    /// As `cascade`, but in each round only the bond whose grains separate fastest breaks.
    CascadeWorst,
    /// Bonds at their limit break at the end of the step.
    EndOfStep,
    /// Quasi-static loading from break to break: each step raises or lowers the load to the value
    /// at which the next bond breaks, in equilibrium. The load functions are followed up to
    /// `time.end`.
    NextEvent,
}

/// What the history holds, and how often it is written; give either `every_steps` or `interval`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Number of steps between frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_steps: Option<u64>,
    /// Time between frames (s), rounded to whole steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<f64>,
    /// Whether frames hold the reactions and moments of the contacts.
    pub reactions: bool,
    /// Precision of the numbers in frames. Observables and events are always double.
    pub precision: Precision,
    /// Number of frames between checkpoints. A killed run resumes from its last checkpoint. The
    /// last state of a run that ends is always a checkpoint.
    pub checkpoint_every: u64,
}

impl Default for Output {
    fn default() -> Self {
        Self { every_steps: None, interval: None, reactions: true, precision: Precision::Double, checkpoint_every: 10 }
    }
}

/// Precision of stored numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 16 digits.
    #[default]
    Double,
    /// 7 digits, half the size.
    Single,
}

fn default_seed() -> u64 {
    1
}

fn one() -> Function {
    Function::Constant(1.0)
}

/// The wall that loads the sample: the first of `named` that is among the `driven` ones, else the
/// only driven one. `named` are the scene's `load_wall` and the wall of its `stop.wall_travel`.
#[must_use]
pub fn choose_load_wall<'a>(named: [Option<&str>; 2], driven: &[&'a str]) -> Option<&'a str> {
    let find = |name: &str| driven.iter().copied().find(|other| *other == name);
    let only = if let [only] = driven { Some(*only) } else { None };
    named.into_iter().flatten().find_map(find).or(only)
}

impl Scene {
    /// Index of a wall, by name.
    #[must_use]
    pub fn wall_index(&self, name: &str) -> Option<usize> {
        self.walls.keys().position(|other| other == name)
    }

    /// Name of body `body` of a sample of this many grains; walls follow the grains.
    #[must_use]
    pub fn body_name(&self, grains: usize, body: usize) -> String {
        match body.checked_sub(grains) {
            None => format!("grain {body}"),
            Some(wall) => {
                self.walls.keys().nth(wall).map_or_else(|| format!("wall {wall}"), |name| format!("wall {name}"))
            }
        }
    }

    /// Names of the driven walls, in order.
    #[must_use]
    pub fn driven_walls(&self) -> Vec<&str> {
        let driven = self.walls.iter().filter(|(name, wall)| !self.drives(name, wall).is_empty());
        driven.map(|(name, _)| name.as_str()).collect()
    }

    /// The stage at whose beginning the bonds form; none if they form at the start of the run.
    #[must_use]
    pub fn cement_stage(&self) -> Option<usize> {
        self.stages.iter().position(|stage| stage.cement)
    }

    /// The drives that the stages give a wall, in order.
    pub fn stage_drives<'a>(&'a self, wall: &'a str) -> impl Iterator<Item = &'a StageDrive> {
        self.stages.iter().filter_map(move |stage| stage.walls.get(wall))
    }

    /// All drives of a wall: its own and those of the stages.
    #[must_use]
    pub fn drives(&self, name: &str, wall: &Wall) -> Vec<Drive> {
        let stages = self.stage_drives(name).map(StageDrive::drive);
        [wall.drive()].into_iter().chain(stages).filter(|drive| *drive != Drive::Fixed).collect()
    }

    /// The drive of a wall at the start of the run: that of the first stage where it has one. A
    /// wall that only later stages drive is held until then.
    #[must_use]
    pub fn first_drive(&self, name: &str, wall: &Wall) -> Drive {
        self.drive_in_stage(0, name, wall)
    }

    /// The drive of a wall in a stage, by number: the last that it or an earlier stage gives it. A
    /// wall that only later stages drive is held until then.
    pub(crate) fn drive_in_stage(&self, stage: usize, name: &str, wall: &Wall) -> Drive {
        let last = self.stages.iter().take(stage + 1).rev().find_map(|stage| stage.walls.get(name));
        match (last, wall.drive()) {
            (Some(last), _) => last.drive(),
            (None, Drive::Fixed) if self.stage_drives(name).next().is_some() => StageDrive::default().drive(),
            (None, own) => own,
        }
    }

    /// The pressure of the membrane at the start of the run: that of the first stage where it has
    /// one.
    #[must_use]
    pub fn first_pressure(&self) -> Option<&Function> {
        let own = &self.membrane.as_ref()?.pressure;
        Some(self.stages.first().and_then(|stage| stage.membrane_pressure.as_ref()).unwrap_or(own))
    }

    /// Times at which a force, a stress, the membrane's pressure or the factor of a load turns, in
    /// increasing order (s).
    #[must_use]
    pub fn load_knots(&self) -> Vec<f64> {
        let walls = self.walls.values().flat_map(|wall| wall.force.iter().chain(&wall.stress));
        let pressures = self.membrane.iter().map(|membrane| &membrane.pressure);
        let factors = self.grains.iter().flat_map(|grains| &grains.loads).map(|load| &load.time);
        let mut knots: Vec<f64> = walls.chain(pressures).chain(factors).flat_map(Function::knots).collect();
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        knots
    }

    /// The wall that loads the sample ([`choose_load_wall`]); none where no wall is driven, or
    /// where several are and the scene does not say which.
    #[must_use]
    pub fn load_wall(&self) -> Option<&str> {
        let travels = self.stop.as_ref().and_then(|stop| stop.wall_travel.as_ref()).map(|travel| travel.wall.as_str());
        choose_load_wall([self.load_wall.as_deref(), travels], &self.driven_walls())
    }

    /// Names of the driven walls where there are several and the scene does not say which loads the
    /// sample: then no result can say what the load is.
    #[must_use]
    pub fn load_unknown(&self) -> Option<String> {
        let driven = self.driven_walls();
        (driven.len() > 1 && self.load_wall().is_none()).then(|| driven.join(", "))
    }

    /// Thickness of the disks (m): 1 where the scene is silent, and in 3D, where it has no meaning.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        self.thickness.unwrap_or(1.0)
    }

    /// Whether there are bonds that resist twist.
    #[must_use]
    pub fn twists(&self) -> bool {
        let resists = |twist: Option<f64>| twist.is_some_and(|twist| twist > 0.0);
        let of_pairs = || self.materials.pair_bonds().any(|pair| resists(pair.twist));
        self.bonds.as_ref().is_some_and(|bonds| bonds.twist.is_some() || of_pairs())
    }

    /// Whether the resistance to twist may differ from bond to bond.
    #[must_use]
    pub fn twists_by_pair(&self) -> bool {
        self.twists() && self.materials.pair_bonds().any(|pair| pair.twist.is_some())
    }

    /// Whether some bond can bear a load.
    #[must_use]
    pub fn has_bonds(&self) -> bool {
        let bears = |limit: Option<f64>| limit.is_some_and(|limit| limit > 0.0);
        self.bonds.as_ref().is_some_and(|bonds| {
            let of_pairs = self.materials.pair_bonds().any(|pair| bears(pair.strength.or(pair.stress)));
            bears(bonds.strength.or(bonds.stress)) || of_pairs || bonds.list.is_some()
        })
    }

    /// Paths of the files that the scene reads.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let sample = match &mut self.sample {
            Sample::File(file) => Some(&mut file.path),
            _ => None,
        };
        sample.into_iter().chain(self.bonds.as_mut().and_then(|bonds| bonds.list.as_mut()))
    }

    /// The same, to be read, each with what it holds.
    pub fn files(&self) -> impl Iterator<Item = (&PathBuf, &'static str)> {
        let sample = match &self.sample {
            Sample::File(file) => Some((&file.path, "the sample")),
            _ => None,
        };
        let list = self.bonds.as_ref().and_then(|bonds| bonds.list.as_ref());
        sample.into_iter().chain(list.map(|path| (path, "the list of bonds")))
    }

    /// Number of components of a spin or a torque: 1 in 2D, 3 in 3D.
    #[must_use]
    pub fn spin_components(&self) -> usize {
        if self.dimension == 2 { 1 } else { 3 }
    }

    /// Number of steps from frame to frame.
    #[must_use]
    pub fn steps_per_frame(&self) -> u64 {
        match (self.output.every_steps, self.output.interval) {
            (Some(steps), _) => steps.max(1),
            (None, Some(interval)) => (interval / self.time.step).round().max(1.0) as u64,
            (None, None) => 1,
        }
    }

    /// Largest number of steps of a run: to `time.end`, or to the end of the last stage if all
    /// stages have a duration. A condition may end the run earlier.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let stages = self.stages.iter().map(|stage| stage.steps(self.time.step));
        let stages = stages.reduce(|sum, steps| Some(sum?.saturating_add(steps?))).flatten();
        stages.unwrap_or(u64::MAX).min(self.time.steps())
    }

    /// Number of frames of a run to the end: the initial state, one every
    /// [`Scene::steps_per_frame`], and the last.
    #[must_use]
    pub fn frames(&self) -> u64 {
        1 + self.steps().div_ceil(self.steps_per_frame())
    }

    /// The scene as JSON, from which [`super::from_text`] reads the same scene, bit for bit.
    ///
    /// # Errors
    /// The path of a sample file that is not Unicode, which JSON cannot hold.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

impl Time {
    /// Number of steps to the end: `end / step`, rounded down unless it is whole to rounding.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let ratio = self.end / self.step;
        if self.is_multiple() { ratio.round() as u64 } else { ratio.floor() as u64 }
    }

    /// Whether the end is a multiple of the step, to rounding.
    #[must_use]
    pub fn is_multiple(&self) -> bool {
        let ratio = self.end / self.step;
        (ratio - ratio.round()).abs() <= 1e-9 * ratio.round()
    }

    /// End of the last step (s).
    #[must_use]
    pub fn last(&self) -> f64 {
        self.steps() as f64 * self.step
    }
}

impl Bonds {
    /// Tensile strength r_coh (N) of the bond between two grains of mean diameter `mean_diameter`
    /// (m): the force given, or σ·a·t in 2D, σ·π·a²/4 in 3D, t the `thickness` (m).
    #[must_use]
    pub fn cohesion(&self, dimension: u8, mean_diameter: f64, thickness: f64) -> f64 {
        cohesion((self.strength, self.stress), dimension, mean_diameter, thickness)
    }

    /// The same of a bond between two materials, whose properties `pair` may replace its own.
    #[must_use]
    pub fn cohesion_of(&self, pair: Option<&PairBonds>, dimension: u8, mean_diameter: f64, thickness: f64) -> f64 {
        let of_pair = pair.map(|pair| (pair.strength, pair.stress)).filter(|given| *given != (None, None));
        cohesion(of_pair.unwrap_or((self.strength, self.stress)), dimension, mean_diameter, thickness)
    }
}

/// Tensile strength (N) of a bond from a strength or a stress.
fn cohesion(limit: (Option<f64>, Option<f64>), dimension: u8, mean_diameter: f64, thickness: f64) -> f64 {
    match limit {
        (Some(strength), _) => strength,
        (None, Some(stress)) if dimension == 2 => stress * mean_diameter * thickness,
        (None, Some(stress)) => stress * std::f64::consts::PI * mean_diameter * mean_diameter / 4.0,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_wall_is_named_or_that_of_the_travel_or_the_only_driven_one() {
        let driven = ["left", "top"];
        assert_eq!(choose_load_wall([Some("top"), Some("left")], &driven), Some("top"));
        assert_eq!(choose_load_wall([None, Some("left")], &driven), Some("left"));
        assert_eq!(choose_load_wall([None, None], &driven), None);
        // a wall that is not driven loads nothing
        assert_eq!(choose_load_wall([Some("floor"), None], &["top"]), Some("top"));
        assert_eq!(choose_load_wall([None, None], &[]), None);
    }

    #[test]
    fn steps_are_whole_where_the_ratio_is_whole_to_rounding() {
        assert_eq!(Time { step: 1e-4, end: 0.5 }.steps(), 5000);
        assert_eq!(Time { step: 0.1, end: 0.3 }.steps(), 3);
        assert_eq!(Time { step: 0.1, end: 0.31 }.steps(), 3);
        assert_eq!(Time { step: 0.1, end: 0.39 }.steps(), 3);
        // it was 34, to 0.102 s
        assert_eq!(Time { step: 3e-3, end: 0.1 }.steps(), 33);
        assert!(Time { step: 0.1, end: 0.3 }.is_multiple() && !Time { step: 3e-3, end: 0.1 }.is_multiple());
        assert_eq!(Time { step: 0.1, end: 0.0 }.steps(), 0);
    }

    #[test]
    fn a_stress_acts_on_the_section_of_the_bond() {
        let bonds = Bonds {
            strength: None,
            stress: Some(1e6),
            gap_tolerance: 1e-3,
            friction: None,
            shear: None,
            rolling: None,
            scatter: None,
            twist: None,
            flow: Flow::Associated,
            stiffness: None,
            absent: vec![],
            list: None,
        };
        assert!((bonds.cohesion(2, 4e-3, 0.01) - 40.0).abs() < 1e-12);
        assert!((bonds.cohesion(3, 4e-3, 0.01) - 4.0 * std::f64::consts::PI).abs() < 1e-12);
        assert_eq!(Bonds { strength: Some(5.0), stress: None, ..bonds }.cohesion(2, 4e-3, 0.01), 5.0);
    }
}
