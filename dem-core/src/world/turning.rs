//! What bonds that turn are given back, so that they keep their length, or their force follows it.
//!
//! Write w for the time between the mid-steps of two steps of lengths h and h'. In it a bond grows
//! by w u_n, of which its law has been told h u_n, and by a *hidden* length e(w), because it turns.
//! A step gives e(h) back, the hidden length of steps as long as itself. What a change of the
//! length of steps leaves beside it is *owed*, and given back over the step of the scene. See
//! docs/theory/time-stepping.md, "Bonds that turn in steps of several lengths".

use super::World;
use super::motion::{Midpoint, Motion, Turn};
use super::touch::Kept;
use crate::body::{direction, separation};
use crate::dim::{Dim, Vect};

impl<D: Dim> World<D> {
    /// What the bonds are given back in a step of length `h`, by their numbers.
    pub(super) fn turns(&self, mid: &Midpoint<D>, touches: &[Kept<D>], motion: &Motion<D>, h: f64) -> Vec<Turn> {
        let mut turns = vec![Turn::default(); self.bonds.len()];
        for kept in touches {
            if let Some(bond) = kept.bond() {
                turns[bond as usize] = self.turn(mid, kept, bond as usize, motion, h);
            }
        }
        turns
    }

    /// What the bond of this contact is given back in a step of length `h`.
    fn turn(&self, mid: &Midpoint<D>, kept: &Kept<D>, number: usize, motion: &Motion<D>, h: f64) -> Turn {
        let bond = &self.bonds[number];
        let elastic = bond.stiffness.is_some();
        // without friction, what moved before there was the bond did not move as it lets it
        if !elastic && bond.friction == 0.0 && !kept.held {
            return Turn::default();
        }
        // rigid bonds answer to any misfit with forces, to that of rounding too
        let rounding = if elastic { 0.0 } else { f64::EPSILON * bond.mean_diameter };
        let hidden = |span: f64| {
            if !elastic && bond.friction > 0.0 {
                return self.turning(mid, motion, kept.pair, span);
            }
            let (speed, _) = self.lengthening(mid, motion, kept.pair, span);
            if span * speed <= rounding { 0.0 } else { speed }
        };
        let before = self.turns.get(number).copied().unwrap_or_default();
        let last = if self.last_part > 0.0 { self.last_part } else { h };
        let full = self.settings.step;
        let mut owed = before.owed * (1.0 - last / full);
        let own = hidden(h);
        if last != h {
            let span = 0.5 * (last + h);
            // of a rigid bond the velocity that its law asks for: the errors of solves do not fit
            // each other
            let speed = if elastic { self.lengthening(mid, motion, kept.pair, span).1 } else { -before.bias };
            owed += (span - last) * speed + span * hidden(span) - h * own;
        }
        if owed.abs() <= rounding {
            owed = 0.0;
        }
        Turn { bias: own + owed / full, owed }
    }

    /// How fast a bond grew unknown to its law in the time `span` (s) between the last two
    /// mid-steps, and its normal velocity in the first of them (m/s): for a bond whose grains need
    /// not turn with it, one that is elastic or has no friction.
    ///
    /// Between two mid-steps the grains moved by the way d apart, of which d_t across the normal of
    /// the first one. Their distance grew by d_n and, because the bond turned, by ℓ' − ℓ − d_n =
    /// d_t² / (ℓ' + ℓ + d_n), of which its law, which knows normal velocities, is not told. In a
    /// steady turn that is what [`World::turning`] gives. See docs/theory/elastic-bonds.md.
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

    /// How fast a rigid bond with friction grew unknown to its law in the time `span` (s) between
    /// the last two mid-steps (m/s).
    ///
    /// A velocity along the tangent of mid-step leads away from the partner before mid-step and
    /// after it. Where the bond turned by R since the last mid-step, its velocity u⁻ gained n·(1 −
    /// R) u⁻ along the normal by that alone; half of it back, u_n⁺ = −½ n·(1 − R) u⁻, makes the
    /// step symmetric in time: the length is kept, and since u_n⁺ = −u_n⁻ the reaction does no
    /// work. Within a rigid fragment R is one for all, so that all bonds can do so at once. See
    /// docs/theory/time-stepping.md.
    fn turning(&self, mid: &Midpoint<D>, motion: &Motion<D>, pair: [u32; 2], span: f64) -> f64 {
        let (_, normal, _) = self.geometry(mid, pair);
        let [(v_i, spin_i), (v_j, spin_j)] = pair.map(|k| motion.before[k as usize]);
        // spins follow the tangential row at mid-step, where they are sin φ / w of the angle φ
        // between two of them
        -0.5 * normal.dot(&D::swing(v_i - v_j, (spin_i + spin_j) * (0.5 * span)))
    }
}
