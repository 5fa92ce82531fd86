//! The way to a solution from afar: friction lagged, and a penalty that is raised step by step.
//!
//! With the term μ‖u_t‖ of de Saxcé's bipotential held at its last value, dry friction becomes an associated law and the
//! inner problem convex: Newton with an exact line search solves it from anywhere. Each round takes the term anew from
//! the velocities that it found (Acary, Cadoux, Lemaréchal & Malick, Z. Angew. Math. Mech. 91, 2011), moves the
//! multipliers, and raises the penalty, so that the active set changes by little from one round to the next.

use super::inner::Iterate;
use super::rows::{Padded, Rows};
use super::solvable::Solvable;
use super::{Newton, STALL_SWEEPS, load_change};

/// How much smaller the first penalty is, and by what it grows.
const SOFT: f64 = 1e7;
const RAISE: f64 = 10.0;
/// Newton iterations of one inner problem, below which the penalty is raised, and in all.
const PATIENCE: u64 = 40;
const EASY: u64 = 25;
const MOST: u64 = 150;

/// What was found.
pub(super) struct Found {
    /// Shifted reactions that meet the tolerance.
    pub reactions: Vec<Padded>,
    /// Their load error.
    pub load_error: f64,
}

impl Newton {
    /// Reactions that meet the tolerance, from those at hand; none where they do not come within the iterations.
    pub(super) fn approach(&mut self, problem: &mut impl Solvable, base: &Rows, iterations: &mut u64) -> Option<Found> {
        let mut rows = base.clone();
        let mut reactions = problem.swept(&rows, STALL_SWEEPS);
        let mut state = Iterate::from_reactions(&rows, &reactions);
        rows.soften(SOFT);
        let (mut level, mut made_in_all, mut last_error) = (SOFT, 0, f64::INFINITY);
        while made_in_all < MOST {
            for ((row, own), r) in rows.list.iter_mut().zip(&base.list).zip(&reactions) {
                row.multiplier = *r;
                if !own.associated {
                    let u = base.velocity(own, &state.y);
                    let slip = own.cone.mu * u.t.norm() + own.cone.nu * u.m.norm();
                    row.lag = Some(slip);
                }
            }
            state = Iterate::from_reactions(&rows, &reactions);
            self.renew = true;
            let (made, solved) = self.inner(&rows, &mut state, None, PATIENCE);
            made_in_all += made.max(1);
            *iterations += made.max(1);
            if std::env::var("DBG").is_ok() {
                eprintln!("approach level {level:e} made {made} solved {solved}");
            }
            if !solved {
                return None;
            }
            let load_error = load_change(&rows, &state);
            reactions.clone_from(&state.reactions);
            problem.write_back(&reactions, &rows);
            problem.velocities_from_reactions();
            let error = problem.residual();
            if error <= self.settings.tolerance {
                let enough = load_error <= self.settings.load_tolerance || level <= 1.0;
                if enough || made_in_all >= MOST {
                    return Some(Found { reactions, load_error });
                }
            }
            if level > 1.0 && made <= EASY && error < last_error {
                rows.soften(1.0 / RAISE);
                level /= RAISE;
            }
            last_error = error;
        }
        None
    }
}
