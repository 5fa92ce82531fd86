//! A better guess where nearly nothing slips, with the friction term held for a solve and then taken anew.
//!
//! Where many contacts creep Newton runs in circles: after a bond has broken, and from the end of a path that held the term of
//! other slips, whose reactions balance the load and are not those of Newton's metric ([`super::interior`]). With the
//! term held the inner problem is convex and its active set near. From solve to solve the reactions of what creeps change
//! by a third of the change before.

use super::guess::{Guess, Slips};
use super::inner::Iterate;
use super::rows::Rows;
use super::{Newton, relative_change};

/// Most solves, and Newton iterations of each: without progress, and all of them.
const MOST_SOLVES: usize = 20;
const PATIENCE: u64 = 30;
const MOST: u64 = 60;
/// Change of the reactions, over them, from which Newton goes on without a held term.
const NEAR: f64 = 1e-2;

impl Newton {
    /// The guess to which the held terms lead from that of `guess`; none where they lead nowhere.
    pub(super) fn by_held_terms(&mut self, base: &Rows, mut guess: Guess, iterations: &mut u64) -> Option<Guess> {
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
            guess = Guess { beyond: self.slips.in_rows(&rows), reactions: state.reactions };
            if change <= NEAR {
                break;
            }
        }
        Some(guess)
    }
}
