//! Solvers of the contact problem, behind one trait and one enum of settings.

mod anderson;
pub mod assembled;
mod assembled_rows;
pub mod certificate;
mod extrapolation;
mod gauss_seidel;
mod graph;
mod history;
mod interior;
mod newton;
mod rest;
mod rows;
mod solvable;
mod stages;
mod tuning;
mod twofold;

pub use gauss_seidel::{GaussSeidel, GaussSeidelSettings, sweep};
pub use rows::StiffnessRatio;
pub use stages::{Route, Staged, StagedSettings, Stages, Start};

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
    /// What a residual amounts to.
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

/// What solves took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Sweeps of Gauss–Seidel that made up the solution; those that only look for an active set do
    /// not count.
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

/// What a solve did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// How it ended.
    pub status: SolveStatus,
    /// The method that brought the solution.
    pub route: Route,
    /// What it took.
    pub work: Work,
    /// Residual reached (–), see [`crate::problem::residual`].
    pub residual: f64,
    /// Load error (–): the estimated error of the net impulses of the contacts on the bodies, over
    /// those impulses. Gauss–Seidel reports none.
    pub load_error: Option<f64>,
}

/// A method that solves a contact problem from the impulses it holds as a start.
pub trait ContactSolver<D: Dim>: Send {
    /// Improve the impulses and node velocities of `problem` until the tolerance, or a limit, is
    /// reached. It comes with the impulses of the last step, and with the free velocities of its
    /// nodes: [`ContactProblem::velocities_from_reactions`] makes the two agree, before and after.
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport;

    /// Solve a problem once more whose solution is accepted, but lets bodies move too far beyond
    /// the laws of their contacts; none where there is no other way to solve it.
    fn solve_finer(&mut self, _problem: &mut ContactProblem<D>) -> Option<SolveReport> {
        None
    }

    /// A copy with all that is kept from one solve to the next: the solver of a step that may have
    /// to be undone.
    fn snapshot(&self) -> Box<dyn ContactSolver<D>>;

    /// Write what is kept from one solve to the next.
    fn save(&self, to: &mut Saved);

    /// Take up what [`ContactSolver::save`] wrote.
    ///
    /// # Errors
    /// [`Mismatch`] where another solver, or another version of it, wrote it.
    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch>;
}

/// The choice of a solver and its settings.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SolverSettings {
    /// Non-linear Gauss–Seidel, the paper's method of successive equilibria.
    GaussSeidel(GaussSeidelSettings),
    /// The methods of [`Staged`], one after the other.
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

    /// Residual that the solver aims at (–).
    pub fn tolerance(&self) -> f64 {
        match self {
            Self::GaussSeidel(settings) => settings.tolerance,
            Self::Staged(settings) => settings.tolerance,
        }
    }

    /// Load error that the solver aims at (–); none where it reports no load error.
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
