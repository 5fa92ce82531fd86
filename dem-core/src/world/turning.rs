//! Length correction of bonds that turn: rigid bonds keep their length, and the force of elastic
//! bonds follows theirs. The law of a bond knows its normal velocity u_n, but not the lengthening
//! by rotation.
//!
//! Let w be the time between the mid-steps of two steps of lengths h and h'. In this time a bond
//! lengthens by w u_n, of which its law includes h u_n, and by a *hidden* length e(w) due to
//! rotation. A step corrects e(h), the hidden length of steps of its own length. If the length of
//! steps changes, a remainder is *owed*; it is corrected over the step of the scene. See
//! docs/theory/time-stepping.md, "Bonds that turn in steps of several lengths".

use super::World;
use super::motion::{Midpoint, Motion, Turn};
use super::touch::StoredTouch;
use crate::body::{direction, separation};
use crate::dim::{Dim, Vect};

impl<D: Dim> World<D> {
    /// Length corrections of all bonds in a step of length `h`, by bond index.
    pub(super) fn turns(&self, mid: &Midpoint<D>, touches: &[StoredTouch<D>], motion: &Motion<D>, h: f64) -> Vec<Turn> {
        let mut turns = vec![Turn::default(); self.bonds.len()];
        for stored in touches {
            if let Some(bond) = stored.bond() {
                turns[bond as usize] = self.turn(mid, stored, bond as usize, motion, h);
            }
        }
        turns
    }

    /// Length correction of the bond of this contact in a step of length `h`.
    fn turn(&self, mid: &Midpoint<D>, stored: &StoredTouch<D>, number: usize, motion: &Motion<D>, h: f64) -> Turn {
        let bond = &self.bonds[number];
        let elastic = bond.stiffness.is_some();
        // the grains turn with a bond that resists shear and rolling
        let turns_with_it = bond.shear > 0.0 && bond.rolling > 0.0;
        // the velocities before a frictionless bond formed do not satisfy its constraint
        if !elastic && !turns_with_it && !stored.was_bonded {
            return Turn::default();
        }
        // rigid bonds respond to any misfit with forces, even to round-off
        let rounding = if elastic { 0.0 } else { f64::EPSILON * bond.mean_diameter };
        let hidden = |span: f64| {
            if !elastic && turns_with_it {
                return self.turning(mid, motion, stored.pair, span);
            }
            let (speed, _) = self.lengthening(mid, motion, stored.pair, span);
            if span * speed <= rounding { 0.0 } else { speed }
        };
        let before = self.turns.get(number).copied().unwrap_or_default();
        let last = if self.last_part > 0.0 { self.last_part } else { h };
        let full = self.settings.step;
        let mut owed = before.owed * (1.0 - last / full);
        let own = hidden(h);
        if last != h {
            let span = 0.5 * (last + h);
            // for a rigid bond the velocity required by its law: solver errors of different bonds
            // are incompatible
            let speed = if elastic { self.lengthening(mid, motion, stored.pair, span).1 } else { -before.bias };
            owed += (span - last) * speed + span * hidden(span) - h * own;
        }
        if owed.abs() <= rounding {
            owed = 0.0;
        }
        Turn { bias: own + owed / full, owed }
    }

    /// Rate of hidden lengthening of a bond in the time `span` (s) between the last two mid-steps,
    /// and its normal velocity at the first of them (m/s). For bonds that may turn without their
    /// grains: elastic or frictionless ones.
    ///
    /// Between two mid-steps the relative displacement of the grains is d, with d_n along the
    /// normal at the first and d_t across it. The distance ℓ grows by d_n and, because the bond
    /// turned, by ℓ' − ℓ − d_n = d_t² / (ℓ' + ℓ + d_n). The law knows normal velocities only, so
    /// the second part is hidden from it. In a steady turn it equals the result of
    /// [`World::turning`]. See docs/theory/elastic-bonds.md.
    fn lengthening(&self, mid: &Midpoint<D>, motion: &Motion<D>, pair: [u32; 2], span: f64) -> (f64, f64) {
        let [i, j] = pair.map(|k| k as usize);
        let apart = separation::<D>(mid.grains[i], mid.grains[j]);
        let way = (motion.before[i].0 - motion.before[j].0) * span;
        let before = apart - way;
        let length = before.norm();
        let normal = direction::<D>(before, length);
        let along = way.dot(&normal);
        let across = way - normal * along;
        let square = across.dot(&across);
        let hidden = if square == 0.0 { 0.0 } else { square / (span * (apart.norm() + length + along)) };
        (hidden, along / span)
    }

    /// Rate of hidden lengthening of a rigid bond with friction in the time `span` (s) between the
    /// last two mid-steps (m/s).
    ///
    /// A velocity along the tangent at mid-step increases the distance both before and after
    /// mid-step. A turn by R since the last mid-step alone changes the normal component of the
    /// bond's velocity u⁻ by n·(1 − R) u⁻. Correcting half of it, u_n⁺ = −½ n·(1 − R) u⁻, makes the
    /// step symmetric in time: the length is kept, and since u_n⁺ = −u_n⁻ the reaction does no
    /// work. R is the same for all bonds of a rigid fragment, so their corrections are compatible.
    /// See docs/theory/time-stepping.md.
    fn turning(&self, mid: &Midpoint<D>, motion: &Motion<D>, pair: [u32; 2], span: f64) -> f64 {
        let (_, normal, _) = self.geometry(mid, pair);
        let [(v_i, spin_i), (v_j, spin_j)] = pair.map(|k| motion.before[k as usize]);
        // the tangential row at mid-step determines the spins: sin φ / w, with the angle φ between
        // two mid-steps
        -0.5 * normal.dot(&D::swing(v_i - v_j, (spin_i + spin_j) * (0.5 * span)))
    }
}
