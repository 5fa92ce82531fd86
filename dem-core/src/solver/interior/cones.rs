//! Second-order cones Q = {x : x₀ ≥ ‖x₁, x₂‖} and their Jordan algebra, x ∘ z = (x·z, x₀ z₁ + z₀ x₁, x₀ z₂ + z₀ x₂).
//!
//! One type stands for a ray, the cone in 2D and the cone in 3D: components that are missing are zero and stay zero.
//!
//! Source: Alizadeh & Goldfarb, Math. Program. 95, 2003.

/// A vector of the algebra.
pub(super) type Point = [f64; 3];

/// The scalar product.
#[inline]
pub(super) fn dot(a: &Point, b: &Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The Jordan product.
#[inline]
pub(super) fn product(a: &Point, b: &Point) -> Point {
    [dot(a, b), a[0] * b[1] + b[0] * a[1], a[0] * b[2] + b[0] * a[2]]
}

/// x + a d.
#[inline]
pub(super) fn moved(x: &Point, a: f64, d: &Point) -> Point {
    [x[0] + a * d[0], x[1] + a * d[1], x[2] + a * d[2]]
}

/// The two eigenvalues x₀ ± ‖x₁, x₂‖, the larger one first.
#[inline]
pub(super) fn eigenvalues(x: &Point) -> [f64; 2] {
    let length = x[1].hypot(x[2]);
    [x[0] + length, x[0] - length]
}

/// The product of the eigenvalues.
#[inline]
fn determinant(x: &Point) -> f64 {
    let [high, low] = eigenvalues(x);
    high * low
}

/// By how much the eigenvalues of x must change to lie between `low` and `high`, downwards by no more than `high`.
pub(super) fn correction(x: &Point, low: f64, high: f64) -> Point {
    let length = x[1].hypot(x[2]);
    let change = |value: f64| (value.clamp(low, high) - value).max(-high);
    let (up, down) = (change(x[0] + length), change(x[0] - length));
    let along = if length > 0.0 { 0.5 * (up - down) / length } else { 0.0 };
    [0.5 * (up + down), along * x[1], along * x[2]]
}

/// How far one can go from x inside Q along d and stay in it; infinite where there is no end.
pub(super) fn reach(x: &Point, d: &Point) -> f64 {
    // the roots of det(x + τ d) = c + 2 b τ + a τ², and where x₀ + τ d₀ vanishes
    let (a, c) = (determinant(d), determinant(x).max(0.0));
    let b = x[0] * d[0] - x[1] * d[1] - x[2] * d[2];
    let mut end = if d[0] < 0.0 { -x[0] / d[0] } else { f64::INFINITY };
    let under = b * b - a * c;
    if under >= 0.0 {
        let root = under.sqrt();
        for tau in [c / (root - b), c / (-b - root)] {
            if tau > 0.0 && tau < end {
                end = tau;
            }
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reach_ends_on_the_boundary() {
        for (x, d) in [
            ([1.0, 0.0, 0.0], [-0.5, 0.0, 0.0]),
            ([1.0, 0.5, 0.0], [0.0, 1.0, 0.0]),
            ([2.0, 0.5, -1.0], [-0.3, 0.4, -0.7]),
            ([1.0, 0.1, 0.2], [0.1, 0.5, 0.5]),
        ] {
            let tau = reach(&x, &d);
            let [high, low] = eigenvalues(&moved(&x, tau, &d));
            assert!(low.abs() < 1e-12 && high >= 0.0, "{x:?} {d:?} {tau} {low:e}");
        }
        assert_eq!(reach(&[1.0, 0.2, 0.0], &[1.0, 0.5, 0.5]), f64::INFINITY);
    }

    #[test]
    fn corrected_eigenvalues_lie_in_the_range() {
        let x = [1.0, 2.0, -1.0];
        let c = correction(&x, 0.1, 2.0);
        let [high, low] = eigenvalues(&moved(&x, 1.0, &c));
        assert!((high - 2.0).abs() < 1e-14 && (low - 0.1).abs() < 1e-14);
    }
}
