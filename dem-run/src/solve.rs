//! `dem-run solve`: solves a contact problem from an FCLIB file.

use std::fmt;
use std::io::Write;
use std::path::PathBuf;

use dem_core::contact::LocalSolve;
use dem_core::problem::assembled::Assembled;
use dem_core::solver::assembled::gauss_seidel;
use dem_core::solver::certificate::{Verdict, verdict_of_assembled};
use dem_core::solver::{
    GaussSeidelSettings, SolveReport, SolveStatus, Staged, StagedSettings, Stages, Start, StiffnessRatio, Work,
};
use serde::Serialize;

use crate::clock::cpu_time;
use crate::error::{NoConvergence, RunError};
use crate::fclib::Problem;
use crate::output::{escaped, listed, print_result};
use crate::scene;
use crate::summary::told;

/// A solver of problems from files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Non-linear Gauss–Seidel.
    #[default]
    GaussSeidel,
    /// The interior-point method, with a sparse factorisation of W.
    #[value(alias = "newton")]
    Interior,
}

/// Options of `dem-run solve`.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveOptions {
    /// The problem.
    pub problem: PathBuf,
    /// The solver.
    pub solver: Solver,
    /// Tolerance of the residual (–).
    pub tolerance: f64,
    /// Maximum number of iterations; if absent, the default of the solver.
    pub max_iterations: Option<u64>,
    /// Memory of the acceleration of Gauss–Seidel (steps); 0 for plain sweeps.
    pub acceleration: usize,
    /// File to which the problem is written with its solution, if any.
    pub output: Option<PathBuf>,
    /// Whether the result on stdout is JSON.
    pub json: bool,
}

/// Result of a solve.
#[derive(Debug, Clone, Serialize)]
struct Solved {
    problem: PathBuf,
    title: String,
    contacts: usize,
    rows: usize,
    associated: usize,
    solver: Solver,
    converged: bool,
    iterations: u64,
    #[serde(skip)]
    work: Work,
    tolerance: f64,
    residual: f64,
    velocity_error: f64,
    siconos_error: f64,
    cpu_time: f64,
}

/// Velocity error (–) up to which a problem counts as solved, for tolerances of at most [`FINE`];
/// for larger tolerances the bound grows in proportion. In problems with a solution the velocity
/// error is up to some hundred times the residual.
const VELOCITY_ERROR: f64 = 1e-3;
const FINE: f64 = 1e-6;

/// Remedy if a solution may exist.
const REMEDY: &str = "; a larger --max-iterations, another --solver or a larger --tolerance may help";

/// Default maximum number of Gauss–Seidel sweeps.
const MOST_SWEEPS: u64 = 100_000;

/// Solves a problem from its first guess, or from zero, and prints the result.
///
/// # Errors
/// [`RunError`]: a file without a problem, an output that cannot be written,
/// [`RunError::NoConvergence`] if the tolerance was not reached.
pub fn solve(options: &SolveOptions) -> Result<(), RunError> {
    let mut problem = Problem::read(&options.problem)?;
    for warning in &problem.warnings {
        let text = format!("warning: {}: {warning}", options.problem.display());
        let _ = writeln!(std::io::stderr(), "{}", escaped(&text));
    }
    let began = cpu_time();
    let mut at = problem.assembled.clone();
    let report = iterate(&mut at, options);
    let parts = at.parts();
    let velocity_error = at.velocity_error();
    let allowed = VELOCITY_ERROR * (options.tolerance / FINE).max(1.0);
    let solved = Solved {
        problem: options.problem.clone(),
        title: problem.title.clone(),
        contacts: at.len(),
        rows: parts.rows.count(),
        associated: parts.associated.iter().filter(|flag| **flag).count(),
        solver: options.solver,
        converged: report.status == SolveStatus::Converged && velocity_error <= allowed,
        iterations: report.work.iterations(),
        work: report.work,
        tolerance: options.tolerance,
        residual: report.residual,
        velocity_error,
        siconos_error: at.siconos_error(),
        cpu_time: cpu_time() - began,
    };
    let printed = print_result(&solved, options.json);
    if !solved.converged {
        return Err(NoConvergence::Problem { path: options.problem.clone(), why: solved.failure(&at) }.into());
    }
    if let Some(output) = &options.output {
        problem.solution = Some(at.r);
        problem.write(output)?;
    }
    Ok(printed?)
}

fn iterate(problem: &mut Assembled, options: &SolveOptions) -> SolveReport {
    let tolerance = options.tolerance;
    match options.solver {
        Solver::GaussSeidel => {
            let max_sweeps = options.max_iterations.unwrap_or(MOST_SWEEPS);
            let (local, accept, acceleration) = (LocalSolve::Exact, tolerance, options.acceleration);
            let settings = GaussSeidelSettings { local, tolerance, accept, max_sweeps, acceleration };
            gauss_seidel(problem, &settings)
        }
        Solver::Interior => {
            let scene = scene::Newton::default();
            let settings = StagedSettings {
                stages: Stages::Interior,
                tolerance,
                accept: tolerance,
                // a file has no load: only the residual is checked
                load_tolerance: f64::INFINITY,
                start: Start::StiffLimit,
                stiffness: StiffnessRatio { tangential: scene.tangential_stiffness, rolling: scene.rolling_stiffness },
                max_iterations: options.max_iterations.unwrap_or(scene.max_iterations),
            };
            Staged::new(settings).solve_assembled(problem)
        }
    }
}

impl Solved {
    /// Why the problem counts as unsolved, with the proven verdict on its feasibility.
    fn failure(&self, problem: &Assembled) -> String {
        let (verdict, remedy) = match verdict_of_assembled(problem) {
            Verdict::NoSolution(contacts) => {
                (format!("no velocities satisfy the laws of contacts {}", listed(&contacts)), "")
            }
            Verdict::Guaranteed => ("not solved, though a solution exists".into(), REMEDY),
            Verdict::Undecided => ("not solved, and a solution is not guaranteed".into(), REMEDY),
        };
        let residual = self.residual;
        if residual <= self.tolerance {
            return format!(
                "{verdict}: the residual is {residual:.2e} only because the reactions are very large; the contacts still \
                 violate their laws by {:.2e} of the free velocities",
                self.velocity_error
            );
        }
        format!(
            "{verdict}: residual {residual:.2e} after {}, but the tolerance is {:.0e}{remedy}",
            self.took(),
            self.tolerance
        )
    }

    fn took(&self) -> String {
        told(self.work, |count| count.to_string()).unwrap_or_else(|| "nothing to do".into())
    }
}

impl fmt::Display for Solved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "problem          {}", self.problem.display())?;
        if !self.title.is_empty() {
            writeln!(f, "title            {}", self.title)?;
        }
        writeln!(
            f,
            "contacts         {} of {} rows, {} with associated flow",
            self.contacts, self.rows, self.associated
        )?;
        let status = if self.converged { "solved" } else { "not solved" };
        let solver = match self.solver {
            Solver::GaussSeidel => "Gauss–Seidel",
            Solver::Interior => "the interior-point method",
        };
        writeln!(f, "status           {status} by {solver}, {}", self.took())?;
        writeln!(f, "residual         {:.2e} (tolerance {:.0e})", self.residual, self.tolerance)?;
        writeln!(f, "velocity error   {:.2e} (of the free velocities)", self.velocity_error)?;
        writeln!(f, "Siconos's error  {:.2e} (natural map with ρ = 1: depends on the units)", self.siconos_error)?;
        write!(f, "CPU time         {:.3} s", self.cpu_time)
    }
}
