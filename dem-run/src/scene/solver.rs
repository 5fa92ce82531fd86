//! The settings of the contact solver.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the contact problem of each time step is solved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// The solver.
    pub kind: SolverKind,
    /// Relative residual that the solver aims at.
    pub tolerance: f64,
    /// Largest relative residual of a solve that is accepted, at least the tolerance; the tolerance where it is absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accept: Option<f64>,
    /// How many times a step whose solve was not accepted is cut in half before the run stops.
    pub max_step_halvings: u32,
}

/// A solver of contact problems.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolverKind {
    /// Non-linear Gauss–Seidel: one contact after the other, until none changes.
    GaussSeidel(GaussSeidel),
}

/// Non-linear Gauss–Seidel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaussSeidel {
    /// How one contact is solved.
    pub local: LocalSolve,
    /// Sweeps over all contacts after which a solve gives up.
    pub max_sweeps: u64,
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
        Self {
            kind: SolverKind::GaussSeidel(GaussSeidel::default()),
            tolerance: 1e-4,
            accept: None,
            max_step_halvings: 4,
        }
    }
}

impl Default for GaussSeidel {
    fn default() -> Self {
        Self {
            local: LocalSolve::Exact,
            max_sweeps: 100_000,
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
