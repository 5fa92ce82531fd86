//! What is measured, and how.

use super::trial::SolverName;
use crate::run::Execution;
use std::path::PathBuf;

/// What the command is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyOptions {
    /// The folder for the results.
    pub folder: PathBuf,
    /// Solvers, in the order of the tables.
    pub solvers: Vec<SolverName>,
    /// Tolerances (–).
    pub tolerances: Vec<f64>,
    /// Time steps over that of the scene (–).
    pub steps: Vec<f64>,
    /// Contact orders, and starting reactions, for each solver.
    pub orders: u64,
    /// Whether runs go on to the scene's end.
    pub whole: bool,
    /// How the command is carried out; the number of threads applies to the runs whose CPU time is
    /// not reported.
    pub execution: Execution,
    /// Whether stdout is JSON.
    pub json: bool,
}
