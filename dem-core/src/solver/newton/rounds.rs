//! Proximal rounds: one inner problem after the other, each with the reactions of the one before as multipliers.

use super::guess::{Guess, Slips};
use super::inner::{Iterate, distance};
use super::patience::Shrinking;
use super::predictor::margins;
use crate::solver::rows::{Row, Rows};
use crate::solver::solvable::Solvable;
use super::{Newton, SolveReport, SolveStatus, Start, held, load_change};
use crate::bond::failure;
use crate::contact::Padded;

/// Newton iterations of one inner problem before it is given up: those in which F shrinks by less than a tenth, fewer in space
/// where each is dear, and all of them.
const PATIENCE: u64 = 8;
const PATIENCE_IN_SPACE: u64 = 4;
const MOST_INNER: u64 = 30;
/// How often the penalty may be lowered a hundredfold in one solve.
const MOST_SOFTENED: u32 = 4;
/// Load error up to which the first round is near enough to the stiff limit to tell what breaks; 2e-6 is usual.
const SMALL: f64 = 1e-4;

impl Newton {
    /// Proximal rounds at the largest penalty, each begun with the active set of `guess`: in space one alone where it tells what
    /// breaks. None if an inner problem is not solved, where `held` not by way of held terms either: the problem then holds
    /// the reactions of the last one that was.
    pub(super) fn rounds(
        &mut self,
        problem: &mut impl Solvable,
        rows: &mut Rows,
        guess: &mut Guess,
        held: bool,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        // held terms, or a path, have led to what knows how far it is beyond its limits
        let led = !guess.beyond.is_empty();
        if !led {
            guess.beyond = self.slips.in_rows(rows);
        }
        let mut first = true;
        let mut shrinking = Shrinking::default();
        let (mut last_error, mut softened, mut made_in_all) = (f64::INFINITY, 0, 0);
        let report = loop {
            let (mut state, mut made, mut solved) = self.solve_from(rows, guess);
            *iterations += made.max(1);
            if !solved && made > 1 && last_error <= self.settings.tolerance {
                // what the round before left is good enough, and this was to tell its load error: the velocities show it
                let begun = rows.given_by(&guess.reactions);
                let load_error = distance(&begun, &state.y) / distance(&begun, &rows.free);
                let report = self.report(*iterations, last_error, load_error);
                if report.status == SolveStatus::Converged {
                    break Some(report);
                }
            }
            if !solved && held {
                let begun = Guess::of(std::mem::take(&mut guess.reactions));
                let Some(nearer) = self.by_held_terms(rows, begun, held::NEAR, iterations) else { break None };
                *guess = nearer;
                (state, made, solved) = self.solve_from(rows, guess);
                *iterations += made;
            }
            if !solved {
                break None;
            }
            if first {
                self.slips = Slips::of(rows, &state);
                self.margins = margins(rows, &state.velocities, &state.reactions);
            }
            problem.write_back(&state.reactions);
            let load_error = shrinking.error(load_change(rows, &state.reactions));
            let error = problem.residual();
            rows.move_multipliers(&state.reactions);
            // what crept in one round hardly slips in the next
            *guess = if held && led { Guess::at_rest(state.reactions) } else { Guess::of(state.reactions) };
            let report = self.report(*iterations, error, load_error);
            if report.status == SolveStatus::Converged {
                break Some(report);
            }
            if std::mem::take(&mut first)
                && error <= self.settings.tolerance
                && self.tells_what_breaks(rows, &guess.reactions)
                && let Some(load_error) = self.load_error_ahead(rows, &guess.reactions)
                && load_error <= SMALL.max(self.settings.load_tolerance)
            {
                // another round would take what creeps inside its limit, by the error that it removes
                break Some(self.report(*iterations, error, load_error));
            }
            made_in_all += made;
            let stuck = softened == MOST_SOFTENED && error > 0.5 * last_error;
            if stuck || made_in_all >= self.settings.max_iterations {
                break (report.status == SolveStatus::Accepted).then_some(report);
            }
            if error > 0.5 * last_error && softened < MOST_SOFTENED {
                // what moves fast is rounded by ρ u: a smaller ρ hears less of it, and takes more rounds
                rows.soften(100.0);
                softened += 1;
            }
            last_error = error;
            if held && !self.later {
                self.later = true;
                // it may be many solves old
                self.kept().trusted = false;
            }
        };
        let later = std::mem::take(&mut self.later);
        if report.is_none() {
            self.kept[1].renew |= later;
            self.margins.clear();
        }
        report
    }

    /// The inner problem from the active set of `guess`, first as if nothing slipped where it says so: the last state, the
    /// iterations, and whether it is solved.
    fn solve_from(&mut self, rows: &Rows, guess: &mut Guess) -> (Iterate, u64, bool) {
        let patience = if rows.in_space() { PATIENCE_IN_SPACE } else { PATIENCE };
        // the kept factor may be one of contacts that slip
        self.kept().renew |= guess.sticks;
        let mut state = Iterate::from_reactions(rows, &guess.reactions);
        let (mut made, mut solved) = self.inner(rows, &mut state, Some(guess), patience, MOST_INNER);
        if !solved && std::mem::take(&mut guess.sticks) {
            // or it does slip
            state = Iterate::from_reactions(rows, &guess.reactions);
            let (more, now) = self.inner(rows, &mut state, Some(guess), patience, MOST_INNER);
            (made, solved) = (made + more, now);
        }
        (state, made, solved)
    }

    /// Whether the reactions of a first round are the stiff limit, leave a bond at its limit, and nothing will move by them.
    fn tells_what_breaks(&self, rows: &Rows, reactions: &[Padded]) -> bool {
        let at_limit = |(row, r): (&Row, &Padded)| row.shift > 0.0 && failure(r, row.shift, row.cone).is_some();
        let stiff_limit = self.settings.start == Start::StiffLimit;
        rows.in_space() && rows.cascades && stiff_limit && rows.list.iter().zip(reactions).any(at_limit)
    }
}
