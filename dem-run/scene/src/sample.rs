//! The grains that a scene starts with: random, on a lattice, from a file, or listed in place.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the grains come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sample {
    /// Grains of random size at random places, packed before the run starts.
    Random(RandomSample),
    /// Equal grains on a regular lattice, touching.
    Lattice(Lattice),
    /// Grains read from a table.
    File(SampleFile),
    /// Grains listed one by one, for small scenes.
    Grains(Vec<GrainSpec>),
}

/// A random packing in a box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RandomSample {
    /// Number of grains.
    pub count: usize,
    /// Distribution of the diameters (m).
    pub diameter: Diameters,
    /// Cross-section of the box seen from above, in 3D only.
    #[serde(default, skip_serializing_if = "Section::is_rectangle")]
    pub section: Section,
    /// Width of the box along x, or the diameter of a circular section (m).
    pub width: f64,
    /// Depth of the box along y (m), in 3D with a rectangular section only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<f64>,
    /// Preparation of the packing.
    pub preparation: Preparation,
    /// Shape that is cut out of the packing; default: the whole packing is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<Cut>,
}

/// A shape cut out of a packing: only the grains inside it are kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// A circle of this diameter (m) around the centre of the packing, in the plane of x and the
    /// vertical axis: a disk in 2D, a cylinder along y in 3D. Grains that cross it are left out. If
    /// it is higher than the packing, the sample has flats where floor and lid were.
    Circle(f64),
}

/// Cross-section of a box seen from above.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// `width` by `depth`.
    #[default]
    Rectangle,
    /// A circle of diameter `width`: the box is a cylinder with its axis through x = y = `width` /
    /// 2.
    Circle,
}

impl Section {
    fn is_rectangle(&self) -> bool {
        *self == Self::Rectangle
    }
}

/// A distribution of diameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diameters {
    /// All grains have this diameter (m).
    Constant(f64),
    /// Uniform between two diameters.
    Uniform(UniformRange),
    /// Pairs `[diameter in m, weight]`: each grain has one of these diameters, with a probability
    /// proportional to its weight.
    Table(Vec<[f64; 2]>),
}

impl Diameters {
    /// The largest diameter that the distribution can give (m).
    #[must_use]
    pub fn max(&self) -> f64 {
        match self {
            Self::Constant(diameter) => *diameter,
            Self::Uniform(range) => range.max,
            Self::Table(rows) => rows.iter().filter(|row| row[1] > 0.0).map(|row| row[0]).fold(0.0, f64::max),
        }
    }
}

/// The two ends of a uniform distribution.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UniformRange {
    /// Smallest diameter (m).
    pub min: f64,
    /// Largest diameter (m).
    pub max: f64,
}

/// Preparation of a random packing. Both ways are frictionless, so that the packing is dense.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preparation {
    /// Compaction between walls.
    Compaction(Compaction),
    /// Deposition under gravity.
    Deposition(Deposition),
}

/// Compaction between walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compaction {
    /// Minimum solid fraction to reach: volume of the grains over volume of the box (0 to 1).
    pub solid_fraction: f64,
}

/// Deposition under gravity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deposition {
    /// Minimum solid fraction to reach: volume of the grains over volume of the box (0 to 1).
    pub solid_fraction: f64,
}

/// Equal grains on a regular lattice, each touching its neighbours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Lattice {
    /// Close packed: rows of `columns` and `columns` − 1 grains alternate; in 3D in layers, of
    /// which every second begins with the shorter row.
    Hexagonal {
        /// Diameter of the grains (m).
        diameter: f64,
        /// Number of rows, along y.
        rows: usize,
        /// Number of grains in the first row, along x.
        columns: usize,
        /// Number of layers, along z, in 3D only.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        layers: Option<usize>,
    },
    /// 2D: `rows` rows of `columns` disks.
    Square {
        /// Diameter of the disks (m).
        diameter: f64,
        /// Number of rows, along y.
        rows: usize,
        /// Number of disks in a row, along x.
        columns: usize,
    },
    /// 3D: spheres along x, y and z.
    Cubic {
        /// Diameter of the spheres (m).
        diameter: f64,
        /// Number of spheres along x, y and z.
        counts: [usize; 3],
    },
}

impl Lattice {
    /// Diameter of the grains (m).
    #[must_use]
    pub fn diameter(&self) -> f64 {
        match self {
            Self::Hexagonal { diameter, .. } | Self::Square { diameter, .. } | Self::Cubic { diameter, .. } => {
                *diameter
            }
        }
    }

    /// Number of grains; `None` where it overflows.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        match self {
            // every second row is one grain shorter, and of every second layer the first row is
            Self::Hexagonal { rows, columns, layers, .. } => {
                let layers = layers.unwrap_or(1);
                let short = (rows / 2).checked_mul(layers)?.checked_add((rows % 2).checked_mul(layers / 2)?)?;
                rows.checked_mul(*columns)?.checked_mul(layers)?.checked_sub(short)
            }
            Self::Square { rows, columns, .. } => rows.checked_mul(*columns),
            Self::Cubic { counts, .. } => counts[0].checked_mul(counts[1])?.checked_mul(counts[2]),
        }
    }
}

/// A table of grains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleFile {
    /// CSV file with the header `x,y,radius` (2D) or `x,y,z,radius` (3D), all in m. A relative path
    /// starts from the folder of the scene. Lines that begin with `#` are comments. A further
    /// column `material` holds names of `materials.named`, or `base`.
    pub path: PathBuf,
}

/// One grain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrainSpec {
    /// Centre: one number for each dimension (m).
    pub center: Vec<f64>,
    /// Radius (m).
    pub radius: f64,
    /// Initial velocity: one number for each dimension (m/s); default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vec<f64>>,
    /// Initial angular velocity: `[w]` in 2D, counter-clockwise, `[wx, wy, wz]` in 3D (rad/s);
    /// default: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spin: Option<Vec<f64>>,
    /// Name of its material, one of `materials.named`; default: `base`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Density instead of the material's (kg/m³).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Mass instead of density times volume (kg).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Moment of inertia about the centre instead of mR²/2 (disk) or 2mR²/5 (sphere) (kg m²).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<f64>,
}

impl Sample {
    /// Number of grains, where it is known before the sample is prepared.
    #[must_use]
    pub fn count(&self) -> Option<usize> {
        match self {
            // how many a cut leaves is known when the packing is made
            Self::Random(random) => random.cut.is_none().then_some(random.count),
            Self::Lattice(lattice) => lattice.count(),
            Self::File(_) => None,
            Self::Grains(grains) => Some(grains.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_rows_of_210_and_209_disks_are_4190() {
        let hexagonal = |rows, columns, layers| Lattice::Hexagonal { diameter: 4e-3, rows, columns, layers }.count();
        assert_eq!(hexagonal(20, 210, None), Some(4190));
        assert_eq!(hexagonal(3, 1, None), Some(2));
        assert_eq!(hexagonal(3, 4, Some(2)), Some(11 + 10));
    }

    #[test]
    fn other_lattices_count_their_grains_and_overflow_is_none() {
        assert_eq!(Lattice::Square { diameter: 1.0, rows: 50, columns: 1 }.count(), Some(50));
        assert_eq!(Lattice::Cubic { diameter: 1.0, counts: [2, 3, 4] }.count(), Some(24));
        assert_eq!(Lattice::Cubic { diameter: 1.0, counts: [usize::MAX, 3, 4] }.count(), None);
    }

    #[test]
    fn the_largest_diameter_ignores_weights_of_zero() {
        assert_eq!(Diameters::Table(vec![[1e-3, 1.0], [9e-3, 0.0]]).max(), 1e-3);
        assert_eq!(Diameters::Uniform(UniformRange { min: 1.0, max: 2.0 }).max(), 2.0);
    }
}
