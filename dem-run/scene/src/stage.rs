//! Stages of loading: what drives the walls, one stage after the other.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::function::Function;
use super::stop::Stop;
use super::wall::Drive;

/// A stage of loading. It ends after its `duration`, or earlier by a condition of `until`; the next
/// stage begins with the step after that, and the run ends with the last stage, or at `time.end`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Name of the stage.
    pub name: String,
    /// Longest duration (s), rounded to whole steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// Conditions that end the stage. The travel of a wall is measured from the beginning of the
    /// stage, or, with `after`: `first_break`, from the first break of a bond in the run if that
    /// comes later. The peak of the load is that of the stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<Stop>,
    /// Whether the bonds of `bonds` form at the beginning of this stage, between the grains that
    /// are near enough then, instead of at the start of the run. A bond takes over the force of
    /// its contact.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cement: bool,
    /// Drives of walls from the beginning of the stage on, by the name of the wall. A wall that is
    /// not named keeps its drive.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub walls: BTreeMap<String, StageDrive>,
    /// Pressure of the membrane from the beginning of the stage on (Pa); its times count from
    /// there. Default: it goes on as before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub membrane_pressure: Option<Function>,
}

/// The drive of a wall in a stage: one function, whose times count from the beginning of the stage,
/// or none, which holds the wall in its place. Its direction and mass are those of the wall.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StageDrive {
    /// Velocity along the direction (m/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Function>,
    /// Force along the direction (N).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<Function>,
    /// Stress along the normal (Pa), as `stress` of a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress: Option<Function>,
}

impl Stage {
    /// Number of time steps of length `step` (s) in its duration, at least one; none without a
    /// duration.
    #[must_use]
    pub fn steps(&self, step: f64) -> Option<u64> {
        self.duration.map(|duration| (duration / step).round().max(1.0) as u64)
    }
}

impl StageDrive {
    /// How the wall moves. A wall that is held has a velocity of zero, so it has a load.
    #[must_use]
    pub fn drive(&self) -> Drive {
        match (&self.velocity, &self.force, &self.stress) {
            (Some(velocity), ..) => Drive::Velocity(velocity.clone()),
            (None, Some(force), _) => Drive::Force(force.clone()),
            (None, None, Some(stress)) => Drive::Stress(stress.clone()),
            (None, None, None) => Drive::Velocity(Function::Constant(0.0)),
        }
    }
}
