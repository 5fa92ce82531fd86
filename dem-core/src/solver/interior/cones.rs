//! Second-order cones Q = {x : x₀ ≥ ‖x₁, x₂‖} and their Jordan algebra, x ∘ z = (x·z, x₀ z₁ + z₀
//! x₁, x₀ z₂ + z₀ x₂).
//!
//! One type represents a ray, the cone in 2D and the cone in 3D: missing components are zero and
//! stay zero.
//!
//! Sources: Alizadeh & Goldfarb, Math. Program. 95, 2003; for the scaling Nesterov & Todd, SIAM J.
//! Optim. 8, 1998.

/// A vector of the algebra.
pub(in crate::solver) type Point = [f64; 3];

/// The scalar product.
#[inline]
pub(in crate::solver) fn dot(a: &Point, b: &Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The Jordan product.
#[inline]
pub(in crate::solver) fn product(a: &Point, b: &Point) -> Point {
    [dot(a, b), a[0] * b[1] + b[0] * a[1], a[0] * b[2] + b[0] * a[2]]
}

/// x + a d.
#[inline]
pub(in crate::solver) fn moved(x: &Point, a: f64, d: &Point) -> Point {
    [x[0] + a * d[0], x[1] + a * d[1], x[2] + a * d[2]]
}

/// ‖a, b‖; in 2D, where b is zero, without a root.
#[inline]
pub(in crate::solver) fn norm(a: f64, b: f64) -> f64 {
    if b == 0.0 { a.abs() } else { a.hypot(b) }
}

/// The two eigenvalues x₀ ± ‖x₁, x₂‖, the larger one first.
#[inline]
pub(in crate::solver) fn eigenvalues(x: &Point) -> [f64; 2] {
    let length = norm(x[1], x[2]);
    [x[0] + length, x[0] - length]
}

/// The product of the eigenvalues.
#[inline]
fn determinant(x: &Point) -> f64 {
    let [high, low] = eigenvalues(x);
    high * low
}

/// The smaller eigenvalue of the product of a pair in the scaling that makes it commute, P(√x) z.
pub(in crate::solver) fn least_product(x: &Point, z: &Point) -> f64 {
    let (half, whole) = (dot(x, z), determinant(x) * determinant(z));
    whole / (half + (half * half - whole).max(0.0).sqrt())
}

/// An automorphism of Q for x, and its transposed inverse for z: the boosts along −w and w, with
/// w₀² − w₁² − w₂² = 1.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct Scaling {
    w: Point,
}

impl Scaling {
    /// The identity.
    pub const NONE: Self = Self { w: [1.0, 0.0, 0.0] };

    /// The scaling of Nesterov & Todd, which makes x and z multiples of each other.
    pub fn of(x: &Point, z: &Point) -> Self {
        let (x_size, z_size) = (determinant(x).sqrt(), determinant(z).sqrt());
        let w = [x[0] / x_size + z[0] / z_size, x[1] / x_size - z[1] / z_size, x[2] / x_size - z[2] / z_size];
        let size = determinant(&w).sqrt();
        let (a, b) = (w[1] / size, w[2] / size);
        Self { w: [(1.0 + a * a + b * b).sqrt(), a, b] }
    }

    /// A scaled x.
    pub fn x(&self, x: &Point) -> Point {
        boosted(&[self.w[0], -self.w[1], -self.w[2]], x)
    }

    /// A scaled z.
    pub fn z(&self, z: &Point) -> Point {
        boosted(&self.w, z)
    }
}

/// The boost along w of p: (w·p, p̄ + w̄ (p₀ + p̄·w̄/(1 + w₀))), where a bar denotes the components
/// after the first.
fn boosted(w: &Point, p: &Point) -> Point {
    let along = w[1] * p[1] + w[2] * p[2];
    let across = p[0] + along / (1.0 + w[0]);
    [w[0] * p[0] + along, p[1] + w[1] * across, p[2] + w[2] * across]
}

/// The change of x that brings its eigenvalues between `low` and `high`, downwards by no more than
/// `high`.
pub(in crate::solver) fn correction(x: &Point, low: f64, high: f64) -> Point {
    let length = norm(x[1], x[2]);
    let change = |value: f64| (value.clamp(low, high) - value).max(-high);
    let (up, down) = (change(x[0] + length), change(x[0] - length));
    let along = if length > 0.0 { 0.5 * (up - down) / length } else { 0.0 };
    [0.5 * (up + down), along * x[1], along * x[2]]
}

/// The longest step from x along d that stays inside Q, in units of d; infinite if there is no
/// limit.
pub(in crate::solver) fn reach(x: &Point, d: &Point) -> f64 {
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
    fn scaled_pairs_commute_and_keep_their_product() {
        for (x, z) in [
            ([1.0, 0.9, 0.1], [0.5, 0.3, -0.2]),
            ([1.0, 0.999, 0.0], [1e-6, 0.0, 0.99e-6]),
            ([2.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ] {
            let scaling = Scaling::of(&x, &z);
            let (a, b) = (scaling.x(&x), scaling.z(&z));
            let (scaled, size) = (product(&a, &b), dot(&x, &z));
            // multiples of each other: their product has the eigenvalues of P(√x) z, the smaller of
            // which is `least_product`
            assert!(
                (a[1] * b[0] - a[0] * b[1]).abs() < 1e-9 * a[0] * b[0]
                    && (a[2] * b[0] - a[0] * b[2]).abs() < 1e-9 * a[0] * b[0]
            );
            assert!((scaled[0] - size).abs() < 1e-9 * size, "{scaled:?} {size}");
            assert!((eigenvalues(&scaled)[1] - least_product(&x, &z)).abs() < 1e-9 * size);
            assert!(least_product(&x, &z) >= eigenvalues(&product(&x, &z))[1] - 1e-15);
        }
    }

    #[test]
    fn corrected_eigenvalues_lie_in_the_range() {
        let x = [1.0, 2.0, -1.0];
        let c = correction(&x, 0.1, 2.0);
        let [high, low] = eigenvalues(&moved(&x, 1.0, &c));
        assert!((high - 2.0).abs() < 1e-14 && (low - 0.1).abs() < 1e-14);
    }
}
