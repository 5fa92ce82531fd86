//! A flexible membrane: a pressure on the free surface of a sample in 2D.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::function::Function;

/// A pressure on the free surface of the sample in 2D, as a fluid exerts it through a flexible
/// membrane. The grains of the surface are those that a disk touches which rolls on the sample from
/// outside. Two consecutive ones carry the pressure on the line between their centres, one half
/// each; those next to a plate also that on the perpendicular to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Pressure (Pa), a function of time that is nowhere negative.
    pub pressure: Function,
    /// Names of two walls, planes that face each other: the surface is free on both sides between
    /// them. Default: it goes all around the sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<[String; 2]>,
    /// Radius of the disk (m): it does not enter gaps narrower than itself. Default: 1.5 times the
    /// mean radius of the grains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disk_radius: Option<f64>,
}
