//! Guesses of the active set: which contacts are open, stick or slip, and in space how far they slip.
//!
//! Across its slip a contact resists by μ r_n / ‖q_t‖, the less the farther it slips. The matrix of a guess that knows how
//! far that was in the last solve is nearly the one that the factor was made of.

use super::inner::Iterate;
use crate::solver::rows::{Row, Rows};
use crate::contact::{Local, Padded};
use crate::dim::{Moments, Vect};
use crate::saved::{Mismatch, Reader, Saved};

/// Relative distance to a limit that counts as at it.
const BEYOND: f64 = 1e-9;

/// How far the tangential, bending and twist rows of a contact are beyond their limits, over those.
pub(super) type Beyond = [f64; 3];

/// A guess of the active set.
pub(super) struct Guess {
    /// Reactions without the shift (N s).
    pub reactions: Vec<Padded>,
    /// How far each contact is beyond its limits; none where that is not known.
    pub beyond: Vec<Beyond>,
    /// Whether all that is at a limit sticks there.
    pub sticks: bool,
}

impl Guess {
    /// The active set of these reactions.
    pub fn of(reactions: Vec<Padded>) -> Self {
        Self { reactions, beyond: Vec::new(), sticks: false }
    }

    /// The same reactions, and nothing slips any more.
    pub fn at_rest(reactions: Vec<Padded>) -> Self {
        Self { sticks: true, ..Self::of(reactions) }
    }

    /// The velocity at which the corrector of contact `k` gives the guessed reaction. One at its limit is moved beyond it,
    /// where rounding cannot make it stick, or inside, where it cannot make it slip.
    pub fn velocity(&self, k: usize, row: &Row) -> Padded {
        let guess = &self.reactions[k];
        let beyond = self.beyond.get(k).copied().unwrap_or_default();
        let (limit, w) = (guess.n + row.shift, row.metric());
        // how far the rows of one group are beyond their limit; zero for those that the guess lets stick
        let at_limit = |c: f64, size: f64, known: f64| match size >= (1.0 - BEYOND) * c * limit {
            true if self.sticks => -2.0 * BEYOND,
            true => known.max(2.0 * BEYOND),
            false => 0.0,
        };
        let slip = at_limit(row.cone.mu, Vect::norm(&guess.t), beyond[0]);
        let bend = at_limit(row.cone.nu, guess.m.bending(), beyond[1]);
        let twist = at_limit(row.cone.xi, guess.m.twist(), beyond[2]);
        let m = guess.m.scaled(1.0 + bend, 1.0 + twist);
        let guess = Local { n: guess.n, t: guess.t * (1.0 + slip), m };
        let mut u = row.weights.times(&row.multiplier) + row.compliance.times(&row.carried) - w.times(&guess);
        if row.convex() && beyond != Beyond::default() {
            // what slips with associated flow opens by so much
            let cone = &row.cone;
            u.n += limit
                * (cone.mu * cone.mu * w.t * slip + cone.nu * cone.nu * w.m * bend + cone.xi * cone.xi * w.w * twist);
        }
        u.n -= row.lag.unwrap_or(0.0);
        u
    }
}

/// How a contact slipped.
#[derive(Clone, Copy)]
struct Slip {
    /// First unknowns of its nodes.
    at: [usize; 2],
    beyond: Beyond,
    /// μ‖u_t‖ + ν‖u_m‖ + ξ|u_τ| (m/s).
    speed: f64,
}

/// How contacts slipped in the last solve, those in space only.
#[derive(Default)]
pub(super) struct Slips(Vec<Slip>);

impl Slips {
    /// Those of a state that solves an inner problem.
    pub fn of(rows: &Rows, state: &Iterate) -> Self {
        let beyond = |((row, u), r): ((&Row, &Padded), &Padded)| {
            let (q, w, limit) = (row.form(u), row.metric(), r.n + row.shift);
            let beyond = |norm: f64, limit: f64| if norm > limit && limit > 0.0 { norm / limit - 1.0 } else { 0.0 };
            [
                beyond(q.t.norm(), w.t * row.cone.mu * limit),
                beyond(q.m.bending(), w.m * row.cone.nu * limit),
                beyond(q.m.twist(), w.w * row.cone.xi * limit),
            ]
        };
        let all = rows.list.iter().zip(&state.velocities).zip(&state.reactions);
        Self::listed(rows, &state.reactions, all.map(beyond))
    }

    /// Those of a guess.
    pub fn of_guess(rows: &Rows, guess: &Guess) -> Self {
        Self::listed(rows, &guess.reactions, guess.beyond.iter().copied())
    }

    fn listed(rows: &Rows, reactions: &[Padded], beyond: impl Iterator<Item = Beyond>) -> Self {
        if !rows.in_space() {
            return Self::default();
        }
        let slip = |((row, r), beyond): ((&Row, &Padded), Beyond)| {
            let speed = |c: f64, w: f64, beyond: f64| c * c * w * (r.n + row.shift) * beyond;
            let (w, [slip, bend, twist]) = (row.metric(), beyond);
            let speed = speed(row.cone.mu, w.t, slip) + speed(row.cone.nu, w.m, bend) + speed(row.cone.xi, w.w, twist);
            Slip { at: row.at, beyond, speed }
        };
        let mut list: Vec<Slip> = rows.list.iter().zip(reactions).zip(beyond).map(slip).collect();
        list.sort_by_key(|slip| slip.at);
        // bodies that cannot move have no unknowns, so contacts with two of them look alike: nothing is told of those
        let unlike = list.chunk_by(|a, b| a.at == b.at).filter(|alike| alike.len() == 1).map(|alike| alike[0]);
        Self(unlike.filter(|slip| slip.beyond != Beyond::default()).collect())
    }

    /// Whether a contact slipped.
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }

    fn known(&self, row: &Row) -> Option<&Slip> {
        self.0.binary_search_by_key(&row.at, |slip| slip.at).ok().map(|k| &self.0[k])
    }

    /// How far each contact of these rows was beyond its limits; an empty list where nothing slipped.
    pub fn in_rows(&self, rows: &Rows) -> Vec<Beyond> {
        let beyond = |row| self.known(row).map_or(Beyond::default(), |slip| slip.beyond);
        if self.any() { rows.list.iter().map(beyond).collect() } else { Vec::new() }
    }

    /// The term of dry friction of each contact of these rows.
    pub fn speeds(&self, rows: &Rows) -> Vec<f64> {
        rows.list.iter().map(|row| self.known(row).map_or(0.0, |slip| slip.speed)).collect()
    }

    pub fn save(&self, to: &mut Saved) {
        to.count(self.0.len());
        for Slip { at, beyond, speed } in &self.0 {
            at.iter().for_each(|k| to.count(*k));
            to.reals.extend_from_slice(beyond);
            to.real(*speed);
        }
    }

    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut list = Vec::with_capacity(from.number_of()?);
        for _ in 0..list.capacity() {
            let at = [from.count()?, from.count()?];
            let reals = from.reals(4)?;
            list.push(Slip { at, beyond: [reals[0], reals[1], reals[2]], speed: reals[3] });
        }
        Ok(Self(list))
    }
}
