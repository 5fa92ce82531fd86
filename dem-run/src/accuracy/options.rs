//! Options of `dem-run accuracy`.

use super::trial::SolverName;
use crate::run::Execution;
use std::path::PathBuf;

/// Options of the command.
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
    /// Number of contact orders, and of starting reactions, for each solver.
    pub orders: u64,
    /// Whether runs continue to the scene's end.
    pub whole: bool,
    /// Execution of the command. The number of threads applies only to runs whose CPU time is not
    /// reported.
    pub execution: Execution,
    /// Whether stdout is JSON.
    pub json: bool,
    /// Whether a scene is run although it needs more memory than is free.
    pub ignore_memory: bool,
}
