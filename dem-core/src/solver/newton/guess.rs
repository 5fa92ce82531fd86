//! Guesses of the active set: which contacts are open, stick or slip, and in space how far they slip.
//!
//! Across its slip a contact resists by μ r_n / ‖q_t‖, the less the farther it slips. The matrix of a guess that knows how
//! far that was in the last solve is nearly the one that the factor was made of.

use super::inner::Iterate;
use super::rows::{Row, Rows};
use crate::contact::{Local, Padded};
use crate::dim::Vect;
use crate::saved::{Mismatch, Reader, Saved};

/// Relative distance to a limit that counts as at it.
const BEYOND: f64 = 1e-9;

/// A guess of the active set.
pub(super) struct Guess {
    /// Reactions without the shift (N s).
    pub reactions: Vec<Padded>,
    /// How far the rows t and m of each contact are beyond their limits, over those; none where that is not known.
    pub beyond: Vec<[f64; 2]>,
}

impl Guess {
    /// The active set of these reactions.
    pub fn of(reactions: Vec<Padded>) -> Self {
        Self { reactions, beyond: Vec::new() }
    }

    /// The velocity at which the corrector of contact `k` gives the guessed reaction. One at its limit is moved beyond it,
    /// where rounding cannot make it stick.
    pub fn velocity(&self, k: usize, row: &Row) -> Padded {
        let guess = &self.reactions[k];
        let beyond = self.beyond.get(k).copied().unwrap_or_default();
        let (limit, w) = (guess.n + row.shift, row.metric());
        // how far the rows of one group are beyond their limit; zero for those that the guess lets stick
        let at_limit = |c: f64, size: f64, known: f64| {
            if size >= (1.0 - BEYOND) * c * limit { known.max(2.0 * BEYOND) } else { 0.0 }
        };
        let slip = at_limit(row.cone.mu, Vect::norm(&guess.t), beyond[0]);
        let bend = at_limit(row.cone.nu, Vect::norm(&guess.m), beyond[1]);
        let guess = Local { n: guess.n, t: guess.t * (1.0 + slip), m: guess.m * (1.0 + bend) };
        let mut u = row.weights.times(&row.multiplier) + row.compliance.times(&row.carried) - w.times(&guess);
        if row.convex() && beyond != [0.0; 2] {
            // what slips with associated flow opens by so much
            u.n += limit * (row.cone.mu * row.cone.mu * w.t * slip + row.cone.nu * row.cone.nu * w.m * bend);
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
    /// How far its rows t and m were beyond their limits, over those.
    beyond: [f64; 2],
    /// μ‖u_t‖ + ν‖u_m‖ (m/s).
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
            [beyond(q.t.norm(), w.t * row.cone.mu * limit), beyond(q.m.norm(), w.m * row.cone.nu * limit)]
        };
        let all = rows.list.iter().zip(&state.velocities).zip(&state.reactions);
        Self::listed(rows, &state.reactions, all.map(beyond))
    }

    /// Those of a guess.
    pub fn of_guess(rows: &Rows, guess: &Guess) -> Self {
        Self::listed(rows, &guess.reactions, guess.beyond.iter().copied())
    }

    fn listed(rows: &Rows, reactions: &[Padded], beyond: impl Iterator<Item = [f64; 2]>) -> Self {
        if !rows.in_space() {
            return Self::default();
        }
        let slip = |((row, r), beyond): ((&Row, &Padded), [f64; 2])| {
            let (w, limit) = (row.metric(), r.n + row.shift);
            let speed = |c: f64, w: f64, beyond: f64| c * c * w * limit * beyond;
            let speed = speed(row.cone.mu, w.t, beyond[0]) + speed(row.cone.nu, w.m, beyond[1]);
            Slip { at: row.at, beyond, speed }
        };
        let mut list: Vec<Slip> = rows.list.iter().zip(reactions).zip(beyond).map(slip).collect();
        list.sort_by_key(|slip| slip.at);
        // bodies that cannot move have no unknowns, so contacts with two of them look alike: nothing is told of those
        let unlike = list.chunk_by(|a, b| a.at == b.at).filter(|alike| alike.len() == 1).map(|alike| alike[0]);
        Self(unlike.filter(|slip| slip.beyond != [0.0; 2]).collect())
    }

    /// Whether a contact slipped.
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }

    fn known(&self, row: &Row) -> Option<&Slip> {
        self.0.binary_search_by_key(&row.at, |slip| slip.at).ok().map(|k| &self.0[k])
    }

    /// How far each contact of these rows was beyond its limits; an empty list where nothing slipped.
    pub fn in_rows(&self, rows: &Rows) -> Vec<[f64; 2]> {
        let beyond = |row| self.known(row).map_or([0.0; 2], |slip| slip.beyond);
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
            let reals = from.reals(3)?;
            list.push(Slip { at, beyond: [reals[0], reals[1]], speed: reals[2] });
        }
        Ok(Self(list))
    }
}
