//! Correction of bonds that turn: rigid bonds keep their length and direction in the fragment, and
//! the force of elastic bonds follows theirs. The law of a bond knows the relative velocity u at
//! mid-step, but not the displacement by rotation.
//!
//! Let w be the time between the mid-steps of two steps of lengths h and h'. In this time a bond
//! moves by w u, of which its law includes h u, and by a *hidden* displacement e(w) due to
//! rotation. A step corrects e(h), the hidden displacement in steps of its own length. If the
//! length of steps changes, a remainder is *owed*; it is corrected over the step of the scene. See
//! docs/theory/time-stepping.md, "Bonds that turn in steps of several lengths".

use super::World;
use super::motion::{Midpoint, Motion, Turn};
use super::touch::StoredTouch;
use crate::body::{direction, separation};
use crate::dim::{Dim, Vect, rotated, versine_share};
use petgraph::unionfind::UnionFind;

/// Angle (rad) in a step by which the spins of two grains of a rigid bond differ at most if they
/// count as equal, and velocities from those of a rigid body. Solver errors make them differ by
/// some 1e-9 of the angle of the step; the corrections of a fragment would be incompatible by as
/// much, and its bonds would respond with forces that add up over the steps.
const EQUAL: f64 = 1e-6;

impl<D: Dim> World<D> {
    /// Length of the step, or the part of a step, before one of length `h` (s); `h` for the first.
    pub(super) fn last_step(&self, h: f64) -> f64 {
        if self.last_part > 0.0 { self.last_part } else { h }
    }

    /// Corrections of all bonds in a step of length `h`, by bond index.
    pub(super) fn turns(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        motion: &Motion<D>,
        h: f64,
    ) -> Vec<Turn<D>> {
        let mut turns = vec![Turn::default(); self.bonds.len()];
        if self.bonds.is_empty() || touches.iter().all(|stored| stored.bond().is_none()) {
            return turns;
        }
        let spins = self.spins_of_fragments(touches, motion, h);
        for stored in touches {
            if let Some(bond) = stored.bond() {
                turns[bond as usize] = self.turn(mid, stored, bond as usize, motion, &spins, h);
            }
        }
        turns
    }

    /// Spins of the grains (rad/s), equal to the last bit where rigid bonds make them equal: their
    /// mean over the fragment.
    fn spins_of_fragments(&self, touches: &[StoredTouch<D>], motion: &Motion<D>, h: f64) -> Vec<D::Spin> {
        let mut spins: Vec<D::Spin> = motion.before.iter().map(|(_, spin)| *spin).collect();
        if self.bonds.iter().all(|bond| bond.stiffness.is_some()) {
            return spins;
        }
        let mut fragments = UnionFind::<usize>::new(self.grains.len());
        for stored in touches {
            let rigid = stored.bond().is_some_and(|bond| self.bonds[bond as usize].stiffness.is_none());
            let [i, j] = stored.pair.map(|k| k as usize);
            if rigid && (spins[i] - spins[j]).norm() * h <= EQUAL {
                fragments.union(i, j);
            }
        }
        let fragments = fragments.into_labeling();
        let mut sums = vec![(D::Spin::zero(), 0.0); fragments.len()];
        for (spin, fragment) in spins.iter().zip(&fragments) {
            let (sum, count) = &mut sums[*fragment];
            (*sum, *count) = (*sum + *spin, *count + 1.0);
        }
        for (spin, fragment) in spins.iter_mut().zip(&fragments) {
            let (sum, count) = sums[*fragment];
            let mean = sum * (1.0 / count);
            // in a chain small differences may add up
            if (*spin - mean).norm() * h <= EQUAL {
                *spin = mean;
            }
        }
        spins
    }

    /// Correction of the bond of this contact in a step of length `h`.
    fn turn(
        &self,
        mid: &Midpoint<D>,
        stored: &StoredTouch<D>,
        number: usize,
        motion: &Motion<D>,
        spins: &[D::Spin],
        h: f64,
    ) -> Turn<D> {
        let bond = &self.bonds[number];
        let elastic = bond.stiffness.is_some();
        let sheared = bond.shear > 0.0;
        let [i, j] = stored.pair.map(|k| k as usize);
        let in_a_fragment = !elastic && spins[i] == spins[j];
        let (gap, normal, _) = self.geometry(mid, stored.pair);
        let apart = separation::<D>(mid.grains[i], mid.grains[j]);
        let velocity = motion.before[i].0 - motion.before[j].0;
        let spin = self.spin(stored.pair, gap, [spins[i], spins[j]]);
        // the velocities before a bond formed need not satisfy its constraint
        let constrained =
            stored.was_bonded || in_a_fragment && sheared && moves_rigidly::<D>(apart, velocity * h, spin * h);
        if !elastic && !constrained {
            return Turn::default();
        }
        // rigid bonds respond to any misfit with forces, even to round-off
        let rounding = if elastic { 0.0 } else { f64::EPSILON * bond.mean_diameter };
        let below = |x: &D::Vector| x.dot(x) <= rounding * rounding;
        let hidden = |span: f64| {
            let mut rate = if sheared { arc::<D>(apart, spin, span) } else { D::Vector::zero() };
            if !(sheared && in_a_fragment) {
                let along = lengthening::<D>(apart, velocity * span, span).0;
                rate += normal * (along - rate.dot(&normal));
            }
            if below(&(rate * span)) { D::Vector::zero() } else { rate }
        };
        let before = self.turns.get(number).copied().unwrap_or_default();
        let (full, last) = (self.settings.step, self.last_step(h));
        let span = 0.5 * (last + h);
        // of the last mid-step at this one: in a fragment by its rotation, so that it remains one
        // velocity field
        let brought = |old: D::Vector| {
            let new = rotated::<D>(old, spin * span);
            if in_a_fragment {
                return new;
            }
            let earlier = apart - velocity * span;
            let along = old.dot(&direction::<D>(earlier, earlier.norm()));
            let across = if sheared { new - normal * new.dot(&normal) } else { D::Vector::zero() };
            across + normal * along
        };
        let mut owed = if below(&before.owed) { D::Vector::zero() } else { brought(before.owed) * (1.0 - last / full) };
        let own = hidden(h);
        if last != h {
            // for a rigid bond the velocity required by its law: solver errors of different bonds
            // are incompatible; along the tangents that of a steady turn
            let mut moves = brought(before.bias) * -1.0;
            if elastic {
                let along = lengthening::<D>(apart, velocity * span, span).1;
                moves += normal * (along - moves.dot(&normal));
            }
            owed = owed + moves * (span - last) + hidden(span) * span - own * h;
        }
        if below(&owed) {
            owed = D::Vector::zero();
        }
        Turn { bias: own + owed * (1.0 / full), owed }
    }

    /// Velocity (m/s, negative) that the law of a closed contact with a round wall around the grain
    /// adds to the normal velocity, since the normal turns as the grain moves along the wall; none
    /// if it does not turn, and for other pairs. Without it the grain would sink into the wall by
    /// (v h)²/2ρ in each step on a circle of radius ρ.
    #[inline]
    pub(super) fn turn_around(&self, mid: &Midpoint<D>, pair: [u32; 2], motion: &Motion<D>, h: f64) -> Option<f64> {
        let [i, j] = pair.map(|k| k as usize);
        let shape = &self.walls[j.checked_sub(self.grains.len())?].shape;
        let apart = shape.around(separation::<D>(mid.grains[i], mid.place(j)))?;
        let span = 0.5 * (self.last_step(h) + h);
        let way = shape.around((motion.before[i].0 - motion.before[j].0) * span)?;
        let hidden = lengthening::<D>(apart, way, span).0;
        (hidden > 0.0).then_some(-hidden)
    }

    /// Spin of the vector between the centres of a bonded pair (rad/s), and of its frame about it:
    /// the spins i and j of its grains, weighted with their distances from the contact point, as in
    /// the tangential rows of the bond.
    pub(super) fn spin(&self, pair: [u32; 2], gap: f64, [i, j]: [D::Spin; 2]) -> D::Spin {
        let [a, b] = pair.map(|k| self.grains.radius[k as usize] + 0.5 * gap);
        (i * a + j * b) * (1.0 / (a + b))
    }
}

/// Whether two grains whose centres are `apart` (m) at mid-step begin the step with the velocities
/// of a rigid body: `way` is their relative displacement in the step (m), `turn` that of their spin
/// (rad).
fn moves_rigidly<D: Dim>(apart: D::Vector, way: D::Vector, turn: D::Spin) -> bool {
    (way - D::velocity(turn, apart - way * 0.5)).norm() <= EQUAL * apart.norm()
}

/// Rate of hidden lengthening of a bond in the time `span` (s) between the last two mid-steps, and
/// its normal velocity at the first of them (m/s). `apart` is the vector between its centres at the
/// second, `way` the relative displacement of its grains (m). For bonds whose length does not
/// follow from the spins of their grains: elastic or frictionless ones, and those of grains that
/// twist against each other.
///
/// Let d be that displacement, with d_n along the normal at the first mid-step and d_t across it.
/// The distance ℓ grows by d_n and, because the bond turned, by
/// ℓ' − ℓ − d_n = d_t² / (ℓ' + ℓ + d_n). The law knows normal velocities only, so the second part
/// is hidden from it. In a steady turn it equals the normal part of [`arc`]. See
/// docs/theory/elastic-bonds.md.
fn lengthening<D: Dim>(apart: D::Vector, way: D::Vector, span: f64) -> (f64, f64) {
    let before = apart - way;
    let length = before.norm();
    let normal = direction::<D>(before, length);
    let along = way.dot(&normal);
    let across = way - normal * along;
    let square = across.dot(&across);
    let hidden = if square == 0.0 { 0.0 } else { square / (span * (apart.norm() + length + along)) };
    (hidden, along / span)
}

/// Rate of hidden displacement (m/s) of a bond with friction in the time `span` (s) between the
/// last two mid-steps, with the vector `apart` between its centres (m) and the `spin` of this
/// vector.
///
/// The rows of its law ask for the velocity ω × x along the tangent, where x is the vector between
/// the centres. A rotation R by φ = arcsin(w ‖ω‖) about ω displaces x by
/// (R − 1) x = w ω × x − (1 − cos φ) x⊥, with the part x⊥ across ω. The law takes the last term
/// from u. It has a tangential part where ω is oblique to x. In a fragment it is the difference of
/// one velocity field at both grains, so the corrections of all its bonds are compatible. See
/// docs/theory/time-stepping.md.
fn arc<D: Dim>(apart: D::Vector, spin: D::Spin, span: f64) -> D::Vector {
    let sine = spin * span;
    D::velocity(sine, D::velocity(sine, apart)) * (-versine_share(sine.norm()) / span)
}
