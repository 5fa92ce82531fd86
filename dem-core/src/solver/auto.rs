//! The choice of a solver for each step. No clock is looked at, so runs stay the same to the bit.
//!
//! Intact bonds go to Newton: nothing else picks one answer among the many of a rigid network. Dry contacts go to
//! Gauss–Seidel, in plain sweeps (the acceleration takes more of them where contacts slip): some for the tolerance, more
//! for what is accepted; where those do not do, as in a tall column that starts from nothing, Newton goes on.

use super::{ContactSolver, GaussSeidel, GaussSeidelSettings, Newton, NewtonSettings, SolveReport, SolveStatus};
use crate::contact::LocalSolve;
use crate::dim::Dim;
use crate::problem::ContactProblem;
use crate::saved::{Mismatch, Reader, Saved};

/// Sweeps over dry contacts that aim at the tolerance, and those beyond that aim at what is accepted.
const FINE_SWEEPS: u64 = 2_000;
const COARSE_SWEEPS: u64 = 20_000;

/// Newton for bonds, Gauss–Seidel for dry contacts.
pub struct Auto {
    newton: Newton,
    fine: GaussSeidel,
    coarse: GaussSeidel,
}

impl Auto {
    /// Newton with these settings, and Gauss–Seidel with the same tolerance.
    pub fn new(settings: NewtonSettings) -> Self {
        let NewtonSettings { tolerance, accept, .. } = settings;
        let sweeps = |tolerance, max_sweeps| {
            let local = LocalSolve::Exact;
            GaussSeidel::new(GaussSeidelSettings { local, tolerance, accept, max_sweeps, acceleration: 0 })
        };
        let (fine, coarse) = (sweeps(tolerance, FINE_SWEEPS), sweeps(accept, COARSE_SWEEPS));
        Self { newton: Newton::new(settings), fine, coarse }
    }
}

impl<D: Dim> ContactSolver<D> for Auto {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        if !problem.bonded.is_empty() || !problem.elastic.is_empty() {
            return self.newton.solve(problem);
        }
        let fine = self.fine.solve(problem);
        if fine.status != SolveStatus::Failed {
            return fine;
        }
        let coarse = self.coarse.solve(problem);
        if coarse.status != SolveStatus::Failed {
            // it aimed at less than the tolerance
            return SolveReport { status: SolveStatus::Accepted, work: fine.work + coarse.work, ..coarse };
        }
        let report = self.newton.solve(problem);
        SolveReport { work: fine.work + coarse.work + report.work, ..report }
    }

    /// By Newton, where Gauss–Seidel solved it as well as is accepted and no better.
    fn solve_finer(&mut self, problem: &mut ContactProblem<D>) -> Option<SolveReport> {
        let dry = problem.bonded.is_empty() && problem.elastic.is_empty();
        dry.then(|| self.newton.solve(problem))
    }

    fn save(&self, to: &mut Saved) {
        self.newton.save_state(to);
    }

    fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        self.newton.restore_state(from)
    }
}
