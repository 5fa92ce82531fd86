//! What a history holds, as plain data.

use super::codes::{BondStatus, ContactStatus, RuptureMode};
use super::schema::ROUTE;
use super::wall::Wall;

/// The layout of a history: everything known before the first step. Each field states its length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Dimension D: 2 or 3.
    pub dimension: usize,
    /// Whether angles and angular velocities are recorded.
    pub rotation: bool,
    /// Whether contacts carry tangential reactions; with bonds they always do.
    pub friction: bool,
    /// Whether bonds carry twisting moments, 3D only.
    pub twist: bool,
    /// Whether reactions and moments are left out.
    pub without_reactions: bool,
    /// Whether the values of frames are stored in single precision.
    pub single: bool,
    /// The grains, N ≥ 1.
    pub grains: Grains,
    /// The walls, W; empty for a scene without any.
    pub walls: Vec<Wall>,
    /// The bonds, B; empty for a scene without any.
    pub bonds: Bonds,
    /// Names of the materials; empty if there is one.
    pub materials: Vec<String>,
    /// The observables recorded at every step.
    pub observables: Vec<Observable>,
    /// Provenance of the run.
    pub parameters: Parameters,
}

impl Layout {
    /// Whether there are bonds, now or after a stage that forms them.
    pub fn bonded(&self) -> bool {
        self.bonds.formed.is_some() || !self.bonds.is_empty()
    }
}

/// The constant properties of the grains; each array has N entries, unless it says otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grains {
    /// Names of the grains.
    pub id: Vec<i32>,
    /// Radii, m.
    pub radius: Vec<f64>,
    /// Masses, kg.
    pub mass: Vec<f64>,
    /// Moments of inertia about the centre, kg m².
    pub inertia: Vec<f64>,
    /// Materials, as places in the list of their names; empty if there is one material.
    pub material: Vec<u8>,
}

/// The bonds as they were formed; each array has B entries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bonds {
    /// The two grains, as indices.
    pub pair: Vec<[i32; 2]>,
    /// Gap at rest g₀, m.
    pub rest_gap: Vec<f64>,
    /// Cohesion r_coh, N.
    pub strength: Vec<f64>,
    /// Coefficient of the shear limit μ, and of the rolling limit where `rolling` is empty.
    pub friction: Vec<f64>,
    /// Coefficient of the rolling limit ν; empty if ν = μ for all bonds.
    pub rolling: Vec<f64>,
    /// Coefficient of the twist limit ξ; none if that of the scene holds for all bonds.
    pub twist: Option<Vec<f64>>,
    /// Mean diameter a_moy, m.
    pub mean_diameter: Vec<f64>,
    /// The step after which a stage formed them, or [`NOT_FORMED`]; none if they are there from the
    /// start.
    pub formed: Option<i64>,
}

/// In place of a step: no stage has formed the bonds yet.
pub const NOT_FORMED: i64 = -1;

impl Bonds {
    /// The number of bonds B.
    pub fn len(&self) -> usize {
        self.pair.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.pair.is_empty()
    }
}

/// Type of the values of an observable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ValueKind {
    /// Real numbers.
    #[default]
    Real,
    /// Codes of [`SolverRoute`](super::SolverRoute).
    Route,
}

/// A quantity that is recorded at every step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Observable {
    /// Its name: the group under `/observables`.
    pub name: String,
    /// Its unit, as in "J"; empty for a number.
    pub unit: String,
    /// The shape of one value: empty for a scalar, `[D, D]` for a tensor.
    pub shape: Vec<usize>,
    /// Type of its values.
    pub kind: ValueKind,
}

impl Observable {
    /// An observable of real numbers with this name, unit and shape.
    pub fn new(name: &str, unit: &str, shape: &[usize]) -> Self {
        Self { name: name.into(), unit: unit.into(), shape: shape.into(), kind: ValueKind::Real }
    }

    /// The method that solved each step, as [`SolverRoute::number`](super::SolverRoute::number)
    /// codes it.
    pub fn route() -> Self {
        Self { kind: ValueKind::Route, ..Self::new(ROUTE, "", &[]) }
    }

    /// Numbers in one value.
    pub fn width(&self) -> usize {
        self.shape.iter().product()
    }
}

/// Provenance of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    /// The scene as it was run, JSON.
    pub scene: String,
    /// The scenes before it, where `resume --force` changed it: a JSON list of `last_step`, the
    /// last step of such a scene, and `scene`; empty where it never changed.
    pub earlier_scenes: String,
    /// The seed of every random choice.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// Git revision of the program, empty if unknown.
    pub git_revision: String,
    /// How the program was built, as in "release, rustc 1.95".
    pub build: String,
    /// The host that ran it.
    pub host: String,
    /// Start time, ISO 8601.
    pub start: String,
    /// Solid fraction to which the sample was packed (–); none for a sample that was not packed.
    pub solid_fraction: Option<f64>,
}

/// One frame to be written. An array of a quantity that the layout lacks is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Number of the step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// The grains.
    pub grains: GrainState,
    /// The walls.
    pub walls: WallState,
    /// The contacts.
    pub contacts: ContactRows,
    /// The state of each bond, B.
    pub bonds: Vec<BondStatus>,
}

/// The motion of the grains at one frame, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrainState {
    /// Centres, m, N × D.
    pub position: Vec<f64>,
    /// Velocities, m/s, N × D.
    pub velocity: Vec<f64>,
    /// Angular velocities, rad/s: N in 2D, N × 3 in 3D; empty without rotation.
    pub angular_velocity: Vec<f64>,
    /// In 2D angles, rad, N; in 3D quaternions w x y z, N × 4; empty without rotation.
    pub orientation: Vec<f64>,
}

/// The motion of the walls at one frame, row by row, each W × D.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WallState {
    /// A point of the plane, or the centre, m.
    pub position: Vec<f64>,
    /// Velocities, m/s.
    pub velocity: Vec<f64>,
    /// Forces of the grains on the wall, N.
    pub force: Vec<f64>,
}

/// The contacts of one frame, row by row; m rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactRows {
    /// Grains i and j as indices; j < 0 is wall −1−j.
    pub pair: Vec<[i32; 2]>,
    /// Points of contact, m, m × D.
    pub point: Vec<f64>,
    /// Unit normals from j to i, m × D.
    pub normal: Vec<f64>,
    /// First tangents, m × 3; empty without tangential reactions, and in 2D,
    /// where the tangent is (−n_y, n_x).
    pub tangent: Vec<f64>,
    /// Reactions of j on i in the local frame (n, t…), N, m × D; m × 1 with neither friction nor
    /// bonds; empty where they were not recorded.
    pub reaction: Vec<f64>,
    /// Moments of j on i, N m; shape m in 2D, m × 2 in 3D; empty without bonds.
    pub moment: Vec<f64>,
    /// Gaps, m, negative where bodies overlap.
    pub gap: Vec<f64>,
    /// Status of each contact.
    pub status: Vec<ContactStatus>,
    /// The bond of each contact, −1 for none; empty without bonds.
    pub bond: Vec<i32>,
}

impl ContactRows {
    /// The number of contacts m.
    pub fn len(&self) -> usize {
        self.pair.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.pair.is_empty()
    }

    /// Rows of the reaction of one contact: 1 without friction, else D.
    pub fn reaction_rows(&self) -> usize {
        if self.is_empty() { 0 } else { self.reaction.len() / self.len() }
    }

    /// Normal force of contact `c`, N; positive in compression.
    pub fn normal_force(&self, c: usize) -> f64 {
        self.reaction[c * self.reaction_rows()]
    }

    /// Magnitude of the tangential force of contact `c`, N.
    pub fn tangential_force(&self, c: usize) -> f64 {
        let rows = self.reaction_rows();
        self.reaction[c * rows + 1..(c + 1) * rows].iter().map(|r| r * r).sum::<f64>().sqrt()
    }
}

/// A bond that broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rupture {
    /// Number of the step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Point of contact, m; z = 0 in 2D.
    pub point: [f64; 3],
    /// Normal force at rupture, N; positive in compression.
    pub normal_force: f64,
    /// Magnitude of the tangential force at rupture, N.
    pub tangential_force: f64,
    /// Magnitude of the bending moment at rupture, N m; in histories older than version 3, norm of
    /// all moments.
    pub moment: f64,
    /// Magnitude of the twisting moment at rupture, N m; NaN in histories older than version 3.
    pub twist: f64,
    /// Elastic energy released, J; 0 for a rigid bond.
    pub energy: f64,
    /// Round of the cascade within the step, from 0.
    pub round: i32,
    /// The bond.
    pub bond: i32,
    /// Its grains.
    pub pair: [i32; 2],
    /// How it broke.
    pub mode: RuptureMode,
}

/// Complete rows of each kind of table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowCounts {
    /// Frames.
    pub frames: usize,
    /// Contacts of all frames.
    pub contacts: usize,
    /// Steps of observables.
    pub steps: usize,
    /// Events.
    pub events: usize,
}
