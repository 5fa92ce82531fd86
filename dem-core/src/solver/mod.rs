//! Solvers of the contact problem: one trait, [`ContactSolver`], and one enum of settings,
//! [`SolverSettings`].

mod anderson;
pub mod assembled;
mod backoff;
pub mod certificate;
mod extrapolation;
mod gauss_seidel;
mod graph;
mod history;
mod interior;
pub mod limit_load;
mod local_problems;
mod newton;
mod rows;
mod solvable;
mod stages;
mod tuning;
mod twofold;

pub use gauss_seidel::{GaussSeidel, GaussSeidelSettings, sweep};
pub use rows::StiffnessRatio;
pub use stages::{Route, Staged, StagedSettings, Stages, Start};
pub use tuning::stages::MOST_FACTORISED;

use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::saved::{Mismatch, Reader, Saved};
use std::ops::Add;

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolveStatus {
    /// The residual reached the tolerance.
    Converged,
    /// The tolerance was missed, the bound for acceptance was met.
    Accepted,
    /// Neither was met: the result must not be used.
    Failed,
}

impl SolveStatus {
    /// The status for a residual (–).
    #[must_use]
    pub fn of(residual: f64, tolerance: f64, accept: f64) -> Self {
        if residual <= tolerance {
            Self::Converged
        } else if residual <= accept {
            Self::Accepted
        } else {
            Self::Failed
        }
    }
}

/// Iterations and factorisations of solves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Gauss–Seidel sweeps of the solution, without those that only estimate an active set.
    pub sweeps: u64,
    /// Newton iterations.
    pub newton: u64,
    /// Sparse factorisations.
    pub factorisations: u64,
}

impl Work {
    /// Sweeps and Newton iterations together.
    #[must_use]
    pub fn iterations(&self) -> u64 {
        self.sweeps + self.newton
    }
}

impl Add for Work {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            sweeps: self.sweeps + o.sweeps,
            newton: self.newton + o.newton,
            factorisations: self.factorisations + o.factorisations,
        }
    }
}

/// Result of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// How it ended.
    pub status: SolveStatus,
    /// The method that found the solution.
    pub route: Route,
    /// Its iterations and factorisations.
    pub work: Work,
    /// Residual reached (–), see [`crate::problem::residual`].
    pub residual: f64,
    /// Load error (–): the estimated error of the reactions r relative to them, in the norm of
    /// r·(W + C) r, at least the
    /// [elastic error](crate::problem::residual::elastic_error). For rigid contacts that is the
    /// error of the net impulses on the bodies. Gauss–Seidel reports the elastic error alone, and
    /// none without elastic bonds.
    pub load_error: Option<f64>,
}

impl SolveReport {
    /// The load error; zero with a residual of zero, where it is round-off.
    pub(crate) fn load_error_beyond_rounding(&self) -> Option<f64> {
        self.load_error.map(|error| if self.residual == 0.0 { 0.0 } else { error })
    }
}

/// A method that solves a contact problem, starting from the impulses in it.
pub trait ContactSolver<D: Dim>: Send {
    /// Update the impulses and node velocities of `problem` until the tolerance or an iteration
    /// limit is reached. On entry `problem` holds the impulses of the last step and the free
    /// velocities of its nodes; [`ContactProblem::velocities_from_reactions`] makes the two agree,
    /// before and after.
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport;

    /// Solve a problem again more accurately, because its solution `_found` violates the contact
    /// laws by displacements that are too large by the factor `_excess`; none if that is not
    /// possible.
    fn solve_finer(
        &mut self,
        _problem: &mut ContactProblem<D>,
        _found: SolveReport,
        _excess: f64,
    ) -> Option<SolveReport> {
        None
    }

    /// A copy with the state kept between solves, for a step that may be undone.
    fn snapshot(&self) -> Box<dyn ContactSolver<D>>;

    /// Write the state kept between solves.
    fn save(&self, to: &mut Saved);

    /// Restore the state that [`ContactSolver::save`] wrote.
    ///
    /// # Errors
    /// [`Mismatch`] if another solver, or another version of this one, wrote it.
    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch>;
}

/// The choice of a solver and its settings.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SolverSettings {
    /// Non-linear Gauss–Seidel, the paper's method of successive equilibria.
    GaussSeidel(GaussSeidelSettings),
    /// The stages of [`Staged`], one after the other.
    Staged(StagedSettings),
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self::Staged(StagedSettings::default())
    }
}

impl SolverSettings {
    /// Largest residual that is accepted (–).
    pub fn accept(&self) -> f64 {
        match self {
            Self::GaussSeidel(settings) => settings.accept,
            Self::Staged(settings) => settings.accept,
        }
    }

    /// Target residual (–).
    pub fn tolerance(&self) -> f64 {
        match self {
            Self::GaussSeidel(settings) => settings.tolerance,
            Self::Staged(settings) => settings.tolerance,
        }
    }

    /// Target load error (–); none for Gauss–Seidel, which stops on the residual alone.
    pub fn load_tolerance(&self) -> Option<f64> {
        match self {
            Self::GaussSeidel(_) => None,
            Self::Staged(settings) => Some(settings.load_tolerance),
        }
    }

    /// The solver with these settings.
    pub fn build<D: Dim>(&self) -> Box<dyn ContactSolver<D>> {
        match *self {
            Self::GaussSeidel(settings) => Box::new(GaussSeidel::new(settings)),
            Self::Staged(settings) => Box::new(Staged::new(settings)),
        }
    }
}
