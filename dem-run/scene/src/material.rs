//! Materials: density, friction, restitution; several materials, and what holds between two.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::region::Region;

/// Name of the material of grains that belong to no named material.
pub const BASE: &str = "base";

/// Density, friction and restitution of all grains, and further materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Materials {
    /// Density of the grains (kg/m³).
    pub density: f64,
    /// Coefficients of friction.
    pub friction: Friction,
    /// Coefficients of restitution; default: zero.
    #[serde(default)]
    pub restitution: Restitution,
    /// Further materials, beside the one of this object, whose name is `base`. A grain is of the
    /// last of them that has a region which holds its centre; else of the material that the sample
    /// gives it; else of `base`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub named: Vec<NamedMaterial>,
    /// What differs between two materials. For a pair that is not listed the values of `friction`
    /// and `bonds` hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<MaterialPair>,
}

/// A further material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NamedMaterial {
    /// Its name.
    pub name: String,
    /// Density (kg/m³); default: that of `base`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Friction with walls that have no `friction` of their own; default: `friction.grain_wall`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_friction: Option<f64>,
    /// Where it is: every grain whose centre is in one of these regions. Default: where the sample
    /// says so.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<Region>,
}

/// What differs between two materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialPair {
    /// The two materials, in any order; the same name twice: between grains of this material.
    pub between: [String; 2],
    /// Friction of dry contacts; default: `friction.grain_grain`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Properties of the bonds; default: those of `bonds`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bonds: Option<PairBonds>,
}

/// Properties of the bonds between two materials. What is not given is that of `bonds`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PairBonds {
    /// Tensile strength (N); zero means no bonds. Give at most one of this and `stress`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Tensile strength as a stress over the section of a bond (Pa); zero means no bonds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress: Option<f64>,
    /// Coefficient of the shear limit. Default: `shear` of `bonds`, else its `friction`, else the
    /// friction of dry contacts between these materials.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shear: Option<f64>,
    /// Coefficient of the rolling limit, with the same defaults.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rolling: Option<f64>,
    /// Coefficient of the twist limit in 3D; zero: these bonds do not resist twist. Default:
    /// `twist` of `bonds`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub twist: Option<f64>,
    /// Scatter of the strengths; a normal one of deviation zero is none. Default: `scatter` of
    /// `bonds`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Scatter>,
    /// Factor on the stiffness of elastic bonds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_factor: Option<f64>,
}

/// Distribution of the strengths of bonds, relative to `strength` or `stress`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scatter {
    /// Weibull: a share exp(−(s/s₀)^m) of the bonds is stronger than s, with the given strength
    /// as s₀.
    Weibull {
        /// Modulus m, at least 0.1: the larger it is, the smaller the scatter.
        modulus: f64,
    },
    /// Normal with the given strength as mean; values below zero are drawn again, so with a large
    /// deviation the mean is higher (by 3 % with half the strength).
    Normal {
        /// Standard deviation over the mean, at most 0.5.
        deviation: f64,
    },
}

/// Coefficients of friction, for each pair of kinds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Between grains.
    pub grain_grain: f64,
    /// Between grains and walls.
    pub grain_wall: f64,
}

/// Coefficients of normal restitution, for each pair of kinds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Restitution {
    /// Between grains (0 to 1).
    pub grain_grain: f64,
    /// Between grains and walls (0 to 1).
    pub grain_wall: f64,
    /// Approach speed below which restitution is zero (m/s).
    pub threshold_speed: f64,
}

impl Materials {
    /// Names of all materials: `base`, then the named ones. A material is referred to by its place
    /// in this list.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        std::iter::once(BASE).chain(self.named.iter().map(|material| material.name.as_str())).collect()
    }

    /// The named material at a place in the list of names; none for `base`.
    fn named(&self, material: usize) -> Option<&NamedMaterial> {
        self.named.get(material.checked_sub(1)?)
    }

    /// Density of a material (kg/m³).
    #[must_use]
    pub fn density_of(&self, material: usize) -> f64 {
        self.named(material).and_then(|named| named.density).unwrap_or(self.density)
    }

    /// Friction of a material with a wall whose own friction is `wall`.
    #[must_use]
    pub fn wall_friction_of(&self, material: usize, wall: Option<f64>) -> f64 {
        let own = || self.named(material).and_then(|named| named.wall_friction);
        wall.or_else(own).unwrap_or(self.friction.grain_wall)
    }

    /// What is listed for two materials.
    #[must_use]
    pub fn pair(&self, a: usize, b: usize) -> Option<&MaterialPair> {
        let [a, b] = [a, b].map(|material| self.named(material).map_or(BASE, |named| named.name.as_str()));
        self.pairs.iter().find(|pair| {
            let [first, second] = &pair.between;
            (first == a && second == b) || (first == b && second == a)
        })
    }

    /// Properties of bonds that are listed for pairs of materials.
    pub fn pair_bonds(&self) -> impl Iterator<Item = &PairBonds> {
        self.pairs.iter().filter_map(|pair| pair.bonds.as_ref())
    }

    /// Friction of dry contacts between two materials.
    #[must_use]
    pub fn friction_of(&self, a: usize, b: usize) -> f64 {
        self.pair(a, b).and_then(|pair| pair.friction).unwrap_or(self.friction.grain_grain)
    }
}
