//! The settings of the contact solver.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Default of the accepted residual: smaller with bonds, whose rupture is irreversible.
#[must_use]
pub(super) fn default_accept(tolerance: f64, bonds: bool) -> f64 {
    tolerance.max(if bonds { 1e-6 } else { 1e-4 })
}

/// How the contact problem of each time step is solved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// The solver.
    pub kind: SolverKind,
    /// Relative residual at which the solver stops: the tolerance.
    pub tolerance: f64,
    /// Largest relative residual with which a solve is accepted, at least the tolerance; its
    /// velocity error may be a thousand times that, except with `gauss_seidel`, which ignores it.
    /// Default: 1e-6 with bonds and 1e-4 without, or the tolerance if that is larger.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accept: Option<f64>,
    /// Number of times that a step is halved when its solve is not accepted, before the run stops.
    pub max_step_halvings: u32,
}

/// A solver of contact problems.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolverKind {
    /// Methods in a fixed order until one solves the problem: Gauss–Seidel if all contacts are dry;
    /// if there are bonds, or if sweeps miss the tolerance of a problem that is cheap to factorise,
    /// Newton from the active set of the last reactions, then the interior-point method.
    Auto(Newton),
    /// Non-linear Gauss–Seidel: one contact after the other, until none changes.
    GaussSeidel(GaussSeidel),
    /// Semismooth Newton on the augmented Lagrangian, for all contacts at once with a sparse
    /// factorisation, warm-started from the active set of the last step. Where it fails, the
    /// interior-point method.
    Newton(Newton),
    /// The interior-point method in every step.
    Interior(Newton),
}

/// Non-linear Gauss–Seidel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaussSeidel {
    /// How one contact is solved.
    pub local: LocalSolve,
    /// Maximum number of sweeps over all contacts in a solve.
    pub max_sweeps: u64,
    /// Memory of Anderson's acceleration, in sweeps; 0 means plain sweeps. With many bonds, 8 needs
    /// about a tenth of the sweeps.
    pub acceleration: usize,
}

/// Settings of Newton and of the interior-point method, which solve for all contacts at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Newton {
    /// Tolerance of the load error (estimated error of the net forces on the bodies and of elastic
    /// bonds, relative to these forces) and of the velocity error (violation of the contact laws,
    /// relative to the free velocities).
    pub load_tolerance: f64,
    /// Initial reactions of every step.
    pub start: Start,
    /// Ratio of tangential to normal stiffness in the stiff limit.
    pub tangential_stiffness: f64,
    /// Ratio of bending stiffness to normal stiffness times the square of the mean diameter, in the
    /// stiff limit.
    pub rolling_stiffness: f64,
    /// Maximum number of iterations of one of these methods in a solve.
    pub max_iterations: u64,
}

/// Initial reactions of every step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// From zero: gives the minimum-energy reactions, those of springs in the stiff limit.
    StiffLimit,
    /// From the reactions of the last step: they depend on the history of the load.
    LastStep,
}

/// How one contact is solved while the others are fixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LocalSolve {
    /// The exact solution of the local problem.
    Exact,
    /// The bipotential predictor and corrector: one projection on the cone.
    PredictorCorrector,
}

impl Default for Solver {
    fn default() -> Self {
        Self { kind: SolverKind::Auto(Newton::default()), tolerance: 1e-8, accept: None, max_step_halvings: 4 }
    }
}

impl Default for GaussSeidel {
    fn default() -> Self {
        Self { local: LocalSolve::Exact, max_sweeps: 100_000, acceleration: 0 }
    }
}

impl Default for Newton {
    fn default() -> Self {
        // a bar of width and length a: bending stiffness over the normal one is a²/12
        let rolling_stiffness = 1.0 / 12.0;
        Self {
            load_tolerance: 1e-5,
            start: Start::LastStep,
            tangential_stiffness: 1.0,
            rolling_stiffness,
            max_iterations: 300,
        }
    }
}

impl Solver {
    /// Largest relative residual of a solve that is accepted.
    #[must_use]
    pub fn accept(&self) -> f64 {
        self.accept.unwrap_or(self.tolerance)
    }
}
