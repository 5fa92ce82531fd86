//! Semismooth Newton on the augmented Lagrangian, from a guess of the active set.
//!
//! For multipliers r̂ (N s) and a penalty ρ the inner problem is
//!
//! F(v) = M (v − v_f) − H (P(r̂ − ρ (Hᵀv + b)) − s n) = 0,
//!
//! where F is the gradient of a convex function of v for associated laws. Its derivative M + H A Hᵀ
//! is sparse, and symmetric except for slipping dry contacts. The outer, proximal iteration is
//! r̂ ← P(r̂ − ρ (Hᵀv + b)). With a large ρ two or three iterations suffice; nearly always the
//! active set of the last step still holds, so that each costs one linear solve. The factors are
//! kept over steps and renewed when refinement with them no longer converges. Newton gives up if
//! the active set cycles; the interior-point method needs no active set.
//!
//! From zero reactions the first proximal iteration gives the stiff limit: the minimum-energy
//! reactions (least Σ r²/ρ among all that balance the load), as of elastic contacts with
//! stiffnesses in the ratio of ρ.
//!
//! Sources: Hestenes 1969 and Powell 1969 (augmented Lagrangian); Alart & Curnier 1991; Qi & Sun
//! 1993 (semismooth Newton); Olsen & Kamrin, arXiv 1805.07437 (the stiff limit).

mod corrector;
mod factor;
mod guess;
mod inner;
mod rounds;

use super::graph::Graph;
use super::rows::Rows;
use super::solvable::Solvable;
use super::{SolveReport, SolveStatus, StagedSettings};
use crate::contact::LocalSolve;
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::newton as tuning;
use factor::Factor;
use std::sync::Arc;

/// Augmented-Lagrangian semismooth Newton.
#[derive(Clone)]
pub(super) struct Newton {
    settings: StagedSettings,
    factor: Factor,
    /// Graph of the last problem.
    pub graph: Option<Arc<Graph>>,
    /// Number of factorisations, since the first solve, at which this guess is given up.
    most_made: u64,
    /// Whether it is the first of two guesses.
    is_first_guess: bool,
    /// Margins of the contacts to another status, in the first proximal iteration of the last
    /// solve.
    pub margins: Vec<f64>,
}

impl Newton {
    /// A solver with these settings.
    pub fn new(settings: StagedSettings) -> Self {
        Self {
            settings,
            factor: Factor::default(),
            graph: None,
            most_made: 0,
            is_first_guess: false,
            margins: Vec::new(),
        }
    }

    /// Factorisations so far.
    pub fn made(&self) -> u64 {
        self.factor.made
    }

    /// Proximal iterations from the active set of the reactions in the problem. In 2D they are
    /// repeated from that after some Gauss–Seidel sweeps where they fail, and a cold start has this
    /// guess alone; in 3D unconverged sweeps would spoil the slip directions. The first of two
    /// guesses is for steps without a change of status: it has the kept factors alone, or half of
    /// the factorisations where there are none. None if Newton fails.
    pub fn solve(
        &mut self,
        problem: &mut impl Solvable,
        rows: &mut Rows,
        cold: bool,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        if !cold && !rows.in_space() {
            let begun: Vec<_> = rows.list.iter().map(|row| (row.multiplier, row.weights, row.lowered)).collect();
            let reactions = problem.in_frames();
            self.is_first_guess = true;
            let fits = self.factor.fits(rows.unknowns);
            self.most_made = self.made() + if fits { 0 } else { tuning::MOST_FACTORISATIONS / 2 };
            let report = self.rounds(problem, rows, reactions.clone(), true, iterations);
            if report.is_some_and(|report| report.status == SolveStatus::Converged) {
                return report;
            }
            let list = rows.list.iter_mut().zip(begun);
            list.for_each(|(row, begun)| (row.multiplier, row.weights, row.lowered) = begun);
            problem.write_back(&reactions);
        }
        let sweeps = match rows.in_space() {
            _ if cold => tuning::COLD_SWEEPS,
            true => 0,
            false => tuning::SWEEPS,
        };
        self.is_first_guess = false;
        self.most_made = self.made() + tuning::MOST_FACTORISATIONS;
        problem.velocities_from_reactions();
        (0..sweeps).for_each(|_| problem.sweep(LocalSolve::Exact));
        let guess = problem.in_frames();
        let report = self.rounds(problem, rows, guess, !cold, iterations);
        self.factor.stale |= report.is_none();
        report
    }

    /// Write the state kept between solves.
    pub fn save(&self, to: &mut Saved) {
        self.factor.save(to);
    }

    /// Restore the state that [`Newton::save`] wrote.
    pub fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        self.factor = Factor::restored(from)?;
        Ok(())
    }
}
