//! Conditions that end a run, or a stage of its loading.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Conditions that end the run before `time.end`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Stop {
    /// Ends the run when a wall has travelled a given distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_travel: Option<WallTravel>,
    /// Ends the run when this fraction of the bonds has broken (above 0, at most 1).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broken_fraction: Option<f64>,
    /// Ends the run when the load of the load wall has been below this share of its peak (above 0,
    /// below 1) in ten consecutive steps. The peak is the greatest load since the first break of a
    /// bond, that step included, so no load before a break counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_drop: Option<f64>,
}

/// A travel of a wall that ends the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallTravel {
    /// Name of a driven wall.
    pub wall: String,
    /// Distance along the wall's direction, as a fraction of the sample's extent along it at the
    /// start of the run, or of the stage.
    pub fraction_of_height: f64,
    /// Start of the measured travel.
    #[serde(default)]
    pub after: TravelFrom,
}

/// Start of the measured travel of a wall.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TravelFrom {
    /// From the start of the run.
    #[default]
    Start,
    /// From the first break of a bond.
    FirstBreak,
}
