//! The way to a solution from afar: friction lagged, and a penalty that is raised step by step.
//!
//! With the term μ‖u_t‖ of de Saxcé's bipotential held at its last value, dry friction becomes an associated law and the
//! inner problem convex: Newton with an exact line search solves it from anywhere. Each round takes the term anew from
//! the velocities that it found (Acary, Cadoux, Lemaréchal & Malick, Z. Angew. Math. Mech. 91, 2011), moves the
//! multipliers, and raises the penalty, so that the active set changes by little from one round to the next. Once it is
//! near, Newton with the friction in it is tried first, which needs no lag.

use super::inner::Iterate;
use crate::solver::rows::Rows;
use crate::solver::solvable::Solvable;
use super::{Found, Newton, load_change};
use crate::contact::Padded;

/// How much smaller the first penalty is, and by what it grows.
const SOFT: f64 = 1e7;
const RAISE: f64 = 10.0;
/// Newton iterations of one inner problem, those below which the penalty is raised, and all of them.
const PATIENCE: u64 = 100;
const EASY: u64 = 60;
const MOST: u64 = 400;
/// Residual below which friction is tried without the lag (–), and the Newton iterations of a try.
const NEAR: f64 = 1e-5;
const TRY: u64 = 8;
/// Inner problems that may fail.
const MOST_FAILURES: u32 = 6;

impl Newton {
    /// The best reactions that are met on the way from `reactions`; none where they are not accepted.
    pub(super) fn approach(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        mut reactions: Vec<Padded>,
        iterations: &mut u64,
    ) -> Option<Found> {
        let mut rows = base.clone();
        let mut state = Iterate::from_reactions(&rows, &reactions);
        rows.soften(SOFT);
        let (mut level, mut share, mut failures) = (SOFT, 1.0f64, 0);
        let (mut last_error, mut made_in_all) = (f64::INFINITY, 0);
        let mut best: Option<Found> = None;
        while made_in_all < MOST && failures < MOST_FAILURES {
            rows.move_multipliers(&reactions);
            // a lag that overshoots is followed in part only
            rows.follow_slips(&state.y, &reactions, share);
            let mut made = 0;
            let mut solved = false;
            if last_error <= NEAR {
                let mut own = rows.clone();
                own.list.iter_mut().for_each(|row| row.lag = None);
                (made, solved) = self.attempt(&own, &reactions, &mut state, TRY);
            }
            if !solved {
                let (more, done) = self.attempt(&rows, &reactions, &mut state, PATIENCE);
                (made, solved) = (made + more, done);
            }
            made_in_all += made;
            *iterations += made;
            if !solved {
                failures += 1;
                rows.soften(RAISE);
                level *= RAISE;
                continue;
            }
            let load_error = load_change(&rows, &state.reactions);
            reactions.clone_from(&state.reactions);
            problem.write_back(&reactions);
            let error = problem.residual();
            let least = best.as_ref().map_or(f64::INFINITY, |b| b.residual);
            if error <= least {
                best = Some(Found { reactions: reactions.clone(), residual: error, load_error });
            }
            let settled = load_error <= self.settings.load_tolerance || level <= 1.0;
            if error <= self.settings.tolerance && settled {
                break;
            }
            if level > 1.0 && made <= EASY && error < 1.5 * least {
                rows.soften(1.0 / RAISE);
                level /= RAISE;
            }
            share = if error < last_error { (1.2 * share).min(1.0) } else { (0.5 * share).max(0.1) };
            last_error = error;
        }
        best.filter(|b| b.residual <= self.settings.accept)
    }

    /// One inner problem with a new factor, from the velocities that the reactions give.
    fn attempt(&mut self, rows: &Rows, reactions: &[Padded], state: &mut Iterate, patience: u64) -> (u64, bool) {
        let mut next = Iterate::from_reactions(rows, reactions);
        self.kept().renew = true;
        let (made, solved) = self.inner(rows, &mut next, None, patience, patience);
        if solved {
            *state = next;
        }
        (made.max(1), solved)
    }
}
