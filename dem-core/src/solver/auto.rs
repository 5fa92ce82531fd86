//! The choice of a solver for each step, by a fixed model of what they cost; no clock is looked at.
//!
//! Intact bonds go to Newton: nothing else picks one answer among the many of a rigid network. Dry contacts go to
//! Gauss–Seidel with as many sweeps as Newton is expected to cost; if those do not do, Newton goes on from where they
//! ended. So a solve costs at most twice what the better of the two would. Where the sweeps were in vain they are left
//! out for a while, for twice as many solves each time.
//!
//! Costs are counted in visits: what one sweep costs for one contact. The figures were fitted to a beam of 4190 bonded
//! disks and a column of 2000 dry ones (docs/decisions/0008-auto.md).

use super::gauss_seidel::MEMORY;
use super::{ContactSolver, GaussSeidel, GaussSeidelSettings, Newton, NewtonSettings, SolveReport, SolveStatus, Work};
use crate::contact::LocalSolve;
use crate::dim::Dim;
use crate::problem::ContactProblem;

/// Visits per contact that a Newton iteration costs, and a factorisation.
const ITERATION: f64 = 60.0;
const FACTORISATION: f64 = 550.0;
/// What a first Newton solve of dry contacts is expected to take.
const EXPECTED: Work = Work { sweeps: 0, newton: 6, factorisations: 3 };
/// Fewest sweeps that are tried, and most solves without trying any.
const FEWEST_SWEEPS: u64 = 100;
const LONGEST_REST: u64 = 64;

/// Newton or Gauss–Seidel, whichever is expected to be cheaper.
pub struct Auto {
    newton: Newton,
    settings: NewtonSettings,
    /// Visits per contact that Newton is expected to take.
    expected: f64,
    /// Solves in which no sweeps are tried, and how many after the next vain try.
    rest: u64,
    next_rest: u64,
}

impl Auto {
    /// A chooser between Newton with these settings and Gauss–Seidel with the same tolerance.
    pub fn new(settings: NewtonSettings) -> Self {
        Self { newton: Newton::new(settings), settings, expected: cost(EXPECTED), rest: 0, next_rest: 1 }
    }
}

/// Visits per contact.
fn cost(work: Work) -> f64 {
    work.sweeps as f64 + ITERATION * work.newton as f64 + FACTORISATION * work.factorisations as f64
}

impl<D: Dim> ContactSolver<D> for Auto {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        if !problem.bonded.is_empty() || !problem.elastic.is_empty() {
            return self.newton.solve(problem);
        }
        let mut vain = Work::default();
        if self.rest > 0 {
            self.rest -= 1;
        } else {
            let sweeps = GaussSeidelSettings {
                local: LocalSolve::Exact,
                tolerance: self.settings.tolerance,
                accept: self.settings.tolerance,
                max_sweeps: (self.expected as u64).max(FEWEST_SWEEPS),
                acceleration: MEMORY,
            };
            let swept = GaussSeidel::new(sweeps).solve(problem);
            if swept.status == SolveStatus::Converged {
                self.next_rest = 1;
                return swept;
            }
            vain = swept.work;
            self.rest = self.next_rest;
            self.next_rest = (2 * self.next_rest).min(LONGEST_REST);
        }
        let report = self.newton.solve(problem);
        self.expected = cost(report.work);
        SolveReport { work: vain + report.work, ..report }
    }
}
