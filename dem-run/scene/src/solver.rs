//! The settings of the contact solver.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Residual that is accepted where the scene does not say: bonds break for good, and want the
/// better one.
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
    /// Relative residual that the solver aims at.
    pub tolerance: f64,
    /// Largest relative residual of a solve that is accepted, at least the tolerance; where it is
    /// absent 1e-6 with bonds and 1e-4 without, or the tolerance if that is larger.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accept: Option<f64>,
    /// How many times a step whose solve was not accepted is cut in half before the run stops.
    pub max_step_halvings: u32,
}

/// A solver of contact problems.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolverKind {
    /// One method after the other, until one solves the problem: Gauss–Seidel where all contacts
    /// are dry, Newton from the active set of the last step where there are bonds, the
    /// interior-point method.
    Auto(Newton),
    /// Non-linear Gauss–Seidel: one contact after the other, until none changes.
    GaussSeidel(GaussSeidel),
    /// Semismooth Newton on the augmented Lagrangian from the active set of the last step, with a
    /// sparse factorisation: all contacts at once; the interior-point method where that fails.
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
    /// Sweeps over all contacts after which a solve gives up.
    pub max_sweeps: u64,
    /// Steps that Anderson's acceleration remembers, 0 for plain sweeps; 8 takes some ten times
    /// fewer sweeps where bonds abound.
    pub acceleration: usize,
}

/// Settings of the methods that solve for all contacts at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Newton {
    /// Load error that the solver aims at, how far the net force on the bodies still changed, over
    /// itself; the velocity error likewise, how far contacts are from their laws, over the free
    /// velocities.
    pub load_tolerance: f64,
    /// Where the reactions start from in every step.
    pub start: Start,
    /// Tangential stiffness over the normal one, in the metric of the stiff limit.
    pub tangential_stiffness: f64,
    /// Bending stiffness over the normal one times the square of the mean diameter, in the metric
    /// of the stiff limit.
    pub rolling_stiffness: f64,
    /// Iterations of one of these methods after which it gives up.
    pub max_iterations: u64,
}

/// Where the reactions start from in every step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// From zero: of all reactions that balance the load, those that stiff springs would give.
    StiffLimit,
    /// From the last step: the reactions keep their history.
    LastStep,
}

/// How one contact is solved, the others held.
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
