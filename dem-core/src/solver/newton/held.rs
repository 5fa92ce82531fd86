//! A better guess where nearly nothing slips, with the friction term held for a solve and then taken anew.
//!
//! Where many contacts creep Newton runs in circles: after a bond has broken, and from the end of a path that held the term of
//! other slips, whose reactions balance the load and are not those of Newton's metric ([`super::interior`]). With the
//! term held the inner problem is convex and its active set near. From solve to solve the reactions of what creeps change
//! by a third of the change before.

use super::guess::{Guess, Slips};
use super::inner::Iterate;
use super::patience::{Shrinking, Stall};
use crate::solver::rows::Rows;
use crate::solver::solvable::Solvable;
use super::{Newton, SolveReport, SolveStatus, load_change, relative_change};

/// Most solves, and Newton iterations of each: without progress, and all of them.
const MOST_SOLVES: usize = 20;
const PATIENCE: u64 = 12;
const MOST: u64 = 40;
/// Change of the reactions, over them, from which Newton is tried without a held term, and that which serves where it failed so.
pub(super) const ABOUT: f64 = 0.08;
pub(super) const NEAR: f64 = 1e-2;
/// Solves in which that change does not halve, and proximal rounds in which the greater error does not.
const IN_VAIN: u64 = 2;

impl Newton {
    /// The guess to which the held terms lead from that of `guess`, where the reactions change by no more than `least`; none
    /// where they lead nowhere, and then not in all of the solve of the problem.
    pub(super) fn by_held_terms(
        &mut self,
        base: &Rows,
        mut guess: Guess,
        least: f64,
        iterations: &mut u64,
    ) -> Option<Guess> {
        if std::mem::replace(&mut self.astray, true) {
            return None;
        }
        let mut stall = Stall::after(IN_VAIN, 0.5);
        let mut rows = base.clone();
        rows.hold(&self.slips.speeds(base));
        for _ in 0..MOST_SOLVES {
            let mut state = Iterate::from_reactions(&rows, &guess.reactions);
            let (made, solved) = self.inner(&rows, &mut state, Some(&guess), PATIENCE, MOST);
            *iterations += made;
            if !solved {
                return None;
            }
            self.slips = Slips::of(&rows, &state);
            rows.follow_slips(&state.y, &state.reactions, 1.0);
            let change = relative_change(&guess.reactions, &state.reactions);
            guess = Guess { beyond: self.slips.in_rows(&rows), ..Guess::of(state.reactions) };
            if change <= least {
                self.astray = false;
                return Some(guess);
            }
            if stall.at(change) {
                break;
            }
        }
        None
    }

    /// Proximal rounds with these terms of dry friction, from the active set of `guess`: two where nothing slips. Where they
    /// leave something the terms follow the slips. None where an inner problem is not solved, or the rounds lead nowhere.
    pub(super) fn rounds_of_held_terms(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        terms: &[f64],
        mut guess: Guess,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let mut rows = base.clone();
        rows.hold(terms);
        let mut shrinking = Shrinking::default();
        let mut stall = Stall::after(IN_VAIN, 0.5);
        let mut last = f64::INFINITY;
        loop {
            let mut state = Iterate::from_reactions(&rows, &guess.reactions);
            let (made, solved) = self.inner(&rows, &mut state, Some(&guess), PATIENCE, MOST);
            *iterations += made;
            if !solved {
                return None;
            }
            self.slips = Slips::of(&rows, &state);
            problem.write_back(&state.reactions);
            let load_error = shrinking.error(load_change(&rows, &state.reactions));
            let error = problem.residual();
            let report = self.report(*iterations, error, load_error);
            if report.status == SolveStatus::Converged {
                return Some(report);
            }
            if stall.at(error.max(load_error)) {
                return None;
            }
            rows.move_multipliers(&state.reactions);
            if error > self.settings.tolerance.max(0.5 * last) {
                rows.follow_slips(&state.y, &state.reactions, 1.0);
            }
            last = error;
            guess = Guess { beyond: self.slips.in_rows(&rows), ..Guess::of(state.reactions) };
        }
    }
}
