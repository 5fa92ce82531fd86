//! A guess of the active set, which contacts are open, stick or slip, is given by reactions.

use crate::contact::{Local, Padded};
use crate::dim::{Moments, Vect};
use crate::solver::rows::Row;
use crate::solver::tuning::newton as tuning;

/// The velocity at which the corrector of a contact gives the reaction `guess` (N s, without the
/// shift). A reaction at its limit is moved beyond it, so that round-off cannot make the contact
/// stick.
pub(super) fn guessed_velocity(row: &Row, guess: &Padded) -> Padded {
    let limit = guess.n + row.shift;
    // relative distance by which a group at its limit is moved beyond it; zero if the group
    // sticks
    let at_limit =
        |c: f64, size: f64| if size >= (1.0 - tuning::BEYOND) * c * limit { 2.0 * tuning::BEYOND } else { 0.0 };
    let slip = at_limit(row.cone.mu, Vect::norm(&guess.t));
    let bend = at_limit(row.cone.nu, guess.m.bending());
    let twist = at_limit(row.cone.xi, guess.m.twist());
    let m = guess.m.scaled(1.0 + bend, 1.0 + twist);
    let guess = Local { n: guess.n, t: guess.t * (1.0 + slip), m };
    row.weights.times(&row.multiplier) + row.compliance.times(&row.carried) - row.metric().times(&guess)
}
