//! The pairs (x, z) of the central path, represented by w = x − z, and the relative size of changes
//! of w.
//!
//! A pair (x, z) with x ∘ z = τ e is determined by w alone: x = f(w), z = f(−w) with the spectral
//! function f(λ) = (λ + √(λ² + 4τ))/2, the smoothed projection onto the cone (Fukushima, Luo &
//! Tseng, SIAM J. Optim. 12, 2002). So w is free: no step ends at a boundary, and the pairs of
//! every iterate are central. Only the reactions and velocities of an iterate may differ from those
//! of its pairs.
//!
//! f is curved on the scale √(λ² + 4τ), the eigenvalues of x + z. Changes of w are measured
//! relative to them.

use super::cones::{Point, dot, norm};

/// The pair (x, z) of w on the path with barrier τ.
pub(super) fn pair(w: &Point, barrier: f64) -> (Point, Point) {
    let length = norm(w[1], w[2]);
    let (high, low) = (w[0] + length, w[0] - length);
    let side = |high: f64, low: f64, sign: f64| {
        let (a, b) = (smoothed(sign * high, barrier), smoothed(sign * low, barrier));
        let along = if length > 0.0 { 0.5 * (a - b) / length } else { 0.0 };
        [0.5 * (a + b), along * w[1], along * w[2]]
    };
    (side(high, low, 1.0), side(high, low, -1.0))
}

/// (λ + √(λ² + 4τ))/2.
fn smoothed(value: f64, barrier: f64) -> f64 {
    let root = value.hypot(2.0 * barrier.sqrt());
    if value > 0.0 { 0.5 * (value + root) } else { 2.0 * barrier / (root - value) }
}

/// The three relative components of a change of w, as linear forms: those of its two eigenvalues,
/// and that of its direction.
fn forms(w: &Point, barrier: f64, change: &Point) -> [Point; 3] {
    let length = norm(w[1], w[2]);
    let axis = if length > 0.0 { [w[1] / length, w[2] / length] } else { [0.0, 0.0] };
    let scale = |value: f64| value.hypot(2.0 * barrier.sqrt());
    let (high, low) = (scale(w[0] + length), scale(w[0] - length));
    let along = change[1] * axis[0] + change[2] * axis[1];
    let across = [change[1] - along * axis[0], change[2] - along * axis[1]];
    let size = norm(across[0], across[1]);
    let turn = if size > 0.0 { 2.0 / (high + low) / size } else { 0.0 };
    [
        [1.0 / high, axis[0] / high, axis[1] / high],
        [1.0 / low, -axis[0] / low, -axis[1] / low],
        [0.0, turn * across[0], turn * across[1]],
    ]
}

/// The largest relative component of a change of one w, as a linear form, and its size.
pub(super) fn largest(w: &Point, barrier: f64, change: &Point) -> (Point, f64) {
    let mut found = ([0.0; 3], 0.0);
    for form in forms(w, barrier, change) {
        let size = dot(&form, change).abs();
        if size > found.1 {
            found = (form, size);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::interior::cones::{eigenvalues, moved, product};

    #[test]
    fn a_pair_is_central_and_has_the_given_difference() {
        for w in [[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.3, 1.0, -0.5], [-1e-3, 0.0, 2.0], [0.0, 0.0, 0.0]] {
            for barrier in [1.0, 1e-4, 1e-12] {
                let (x, z) = pair(&w, barrier);
                let product = product(&x, &z);
                let off = moved(&product, -1.0, &[barrier, 0.0, 0.0]);
                let size = eigenvalues(&x)[0] * eigenvalues(&z)[0];
                assert!(off.iter().all(|p| p.abs() <= 1e-15 * size.max(barrier)), "{w:?} {barrier:e} {off:?}");
                let difference = moved(&moved(&x, -1.0, &z), -1.0, &w);
                assert!(
                    difference.iter().all(|d| d.abs() <= 4e-16 * (x[0] + z[0])),
                    "{w:?} {barrier:e} {difference:?}"
                );
            }
        }
    }

    #[test]
    fn changes_are_relative_to_the_eigenvalues_of_the_sum() {
        let (w, barrier) = ([0.5, 0.3, 0.4], 0.01);
        let (x, z) = pair(&w, barrier);
        let [high, low] = eigenvalues(&moved(&x, 1.0, &z));
        // along the two axes, and across them
        for (change, size) in
            [([0.5, 0.3, 0.4], 1.0 / high), ([0.5, -0.3, -0.4], 1.0 / low), ([0.0, 0.4, -0.3], 1.0 / (high + low))]
        {
            let (form, found) = largest(&w, barrier, &change);
            assert!(
                (found - size).abs() < 1e-14 && (dot(&form, &change).abs() - size).abs() < 1e-14,
                "{change:?} {found}"
            );
        }
    }
}
