//! Proximal iterations: a sequence of inner problems, each with the reactions of the last one as
//! multipliers.

use super::inner::{Iterate, distance};
use super::{Newton, SolveReport};
use crate::contact::Padded;
use crate::solver::extrapolation::margins;
use crate::solver::rows::{Rows, change};
use crate::solver::solvable::Solvable;
use crate::solver::tuning::newton as tuning;
use crate::solver::{SolveStatus, Work};

impl Newton {
    /// Proximal iterations. Each starts from the active set of the last one, the first from that of
    /// `guess` (in a `warm` start the active set of the last solve). None if an inner problem is
    /// not solved.
    pub(super) fn rounds(
        &mut self,
        problem: &mut impl Solvable,
        rows: &mut Rows,
        mut guess: Vec<Padded>,
        warm: bool,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let mut shrinking = Shrinking::default();
        let (mut last_error, mut last_velocity_error, mut softened, mut made_in_all) = (f64::INFINITY, 0.0, 0, 0);
        let mut elastic_error: f64 = 0.0;
        self.margins.clear();
        loop {
            let mut state = Iterate::from_reactions(rows, &guess);
            let (made, solved) = self.inner(rows, &mut state, &guess, warm && self.margins.is_empty());
            *iterations += made.max(1);
            if !solved && !self.is_first_guess && made > 1 && last_error <= self.settings.tolerance {
                // the last iteration met the residual tolerance, and this one was to measure its
                // load error: the velocities give it
                let begun = rows.given_by(&guess);
                let load_error = (distance(&begun, &state.y) / distance(&begun, &rows.free)).max(elastic_error);
                let report = self.report(*iterations, last_error, load_error, last_velocity_error);
                if report.status == SolveStatus::Converged {
                    return Some(report);
                }
            }
            if !solved {
                self.margins.clear();
                return None;
            }
            if self.margins.is_empty() {
                self.margins = margins(rows, &state.velocities, &state.reactions);
            }
            problem.write_back(&state.reactions);
            let multipliers: Vec<_> = rows.list.iter().map(|row| row.multiplier).collect();
            elastic_error = problem.elastic_error();
            let load_error = shrinking.error(change(rows, &multipliers, &state.reactions)).max(elastic_error);
            let (error, velocity_error) = (problem.residual(), problem.velocity_error());
            rows.move_multipliers(&state.reactions);
            guess = state.reactions;
            let report = self.report(*iterations, error, load_error, velocity_error);
            if report.status == SolveStatus::Converged {
                return Some(report);
            }
            made_in_all += made;
            let stuck = softened == tuning::MOST_SOFTENED && error > 0.5 * last_error;
            if stuck || made_in_all >= self.settings.max_iterations {
                return (report.status == SolveStatus::Accepted).then_some(report);
            }
            if error > 0.5 * last_error && softened < tuning::MOST_SOFTENED {
                // a smaller ρ reduces the round-off of ρ u of fast contacts, at the cost of more
                // iterations
                rows.soften(tuning::SOFTENED);
                softened += 1;
            }
            (last_error, last_velocity_error) = (error, velocity_error);
        }
    }

    fn report(&self, iterations: u64, residual: f64, load_error: f64, velocity_error: f64) -> SolveReport {
        let work = Work { newton: iterations, ..Work::default() };
        self.settings.report(work, residual, load_error, velocity_error)
    }
}

/// Convergence of the proximal iterations: the last change of the reactions.
struct Shrinking {
    last: f64,
}

impl Default for Shrinking {
    fn default() -> Self {
        Self { last: 1.0 }
    }
}

impl Shrinking {
    /// Enter the next change and return the estimated error that remains: iterations that reduce
    /// the error by the factor c leave c/(1 − c) of the last change.
    fn error(&mut self, change: f64) -> f64 {
        let shrinkage = (change / self.last).min(0.5);
        self.last = change;
        change * shrinkage / (1.0 - shrinkage)
    }
}
