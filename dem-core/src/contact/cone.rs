//! The cone K = { ‖t‖ ≤ μ n, ‖m‖ ≤ ν n, |τ| ≤ ξ n } of all contact laws, with projection and
//! minimisation on it.
//!
//! `Local<T, B>` holds the rows of one contact: the normal component n, the tangential rows t and
//! the moment rows, bending m and twist τ (moments divided by the mean diameter, relative spins
//! multiplied by it, so all rows share a unit). A group that a contact lacks has length zero, so
//! one formula covers frictionless, dry and bonded contacts.
//!
//! Source: the cone of Coulomb with rolling resistance, Guessasma & Fortin 2011 with the rolling of
//! Taboada, Estrada & Radjaï 2006.

use crate::dim::{Moments, Vect};
use nalgebra::SVector;
use std::ops::{Add, AddAssign, Mul, Sub};

/// One value for each row of a contact: reaction (N s) or relative velocity (m/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local<T, B> {
    /// Normal component.
    pub n: f64,
    /// Tangential components, or a vector in the tangent plane; no rows without friction.
    pub t: T,
    /// Moment components, scaled by the mean diameter: bending, then twist; no rows without a bond.
    pub m: B,
}

impl<T: Vect, B: Moments> Local<T, B> {
    /// All rows zero.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { n: 0.0, t: T::zero(), m: B::zero() }
    }

    /// Scalar product over all rows.
    #[inline(always)]
    pub fn dot(&self, other: &Self) -> f64 {
        self.n * other.n + self.t.dot(&other.t) + self.m.dot(&other.m)
    }
}

/// Rows of any contact, padded with zeros to the largest number: n, two tangential, two bending,
/// one twist.
pub(crate) type Padded = Local<SVector<f64, 2>, SVector<f64, 3>>;

/// Number of rows of `Padded`.
pub(crate) const PADDED: usize = 6;

impl Padded {
    /// The rows in the order n, t, m.
    #[inline]
    pub(crate) fn in_order(&self) -> SVector<f64, PADDED> {
        [self.n, self.t[0], self.t[1], self.m[0], self.m[1], self.m[2]].into()
    }

    /// The inverse of [`Padded::in_order`].
    #[inline]
    pub(crate) fn from_order(v: &SVector<f64, PADDED>) -> Self {
        Self { n: v[0], t: [v[1], v[2]].into(), m: [v[3], v[4], v[5]].into() }
    }
}

impl<T: Vect, B: Moments> Add for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { n: self.n + o.n, t: self.t + o.t, m: self.m + o.m }
    }
}

impl<T: Vect, B: Moments> Sub for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { n: self.n - o.n, t: self.t - o.t, m: self.m - o.m }
    }
}

impl<T: Vect, B: Moments> Mul<f64> for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: f64) -> Self {
        Self { n: self.n * k, t: self.t * k, m: self.m * k }
    }
}

impl<T: Vect, B: Moments> AddAssign for Local<T, B> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

/// The cone K = { ‖t‖ ≤ `mu` n, ‖m‖ ≤ `nu` n, |τ| ≤ `xi` n } of shifted reactions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Coefficient of the tangential rows (–).
    pub mu: f64,
    /// Coefficient of the bending rows, whose moments are divided by the mean diameter (–).
    pub nu: f64,
    /// Coefficient of the twist row, likewise (–).
    pub xi: f64,
}

/// Weights of a quadratic form that is a multiple of the identity in each group of rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weights {
    /// Normal row.
    pub n: f64,
    /// Tangential rows.
    pub t: f64,
    /// Bending rows.
    pub m: f64,
    /// Twist row.
    pub w: f64,
}

impl Weights {
    /// The weight of each row in the order n, t, m.
    #[inline]
    pub(crate) fn in_order(&self) -> [f64; PADDED] {
        [self.n, self.t, self.t, self.m, self.m, self.w]
    }

    /// The weighted rows of `x`.
    #[inline(always)]
    pub fn times<T: Vect, B: Moments>(&self, x: &Local<T, B>) -> Local<T, B> {
        Local { n: x.n * self.n, t: x.t * self.t, m: x.m.scaled(self.m, self.w) }
    }
}

impl Add for Weights {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { n: self.n + o.n, t: self.t + o.t, m: self.m + o.m, w: self.w + o.w }
    }
}

impl Mul<f64> for Weights {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: f64) -> Self {
        Self { n: self.n * k, t: self.t * k, m: self.m * k, w: self.w * k }
    }
}

impl Cone {
    /// Whether `x` lies in K.
    #[inline(always)]
    pub fn contains<T: Vect, B: Moments>(&self, x: &Local<T, B>) -> bool {
        let (mu, nu) = (self.mu * x.n, self.nu * x.n);
        let bending = if B::TWISTS { x.m[0] * x.m[0] + x.m[1] * x.m[1] } else { x.m.dot(&x.m) };
        x.n >= 0.0 && x.t.dot(&x.t) <= mu * mu && bending <= nu * nu && (!B::TWISTS || x.m.twist() <= self.xi * x.n)
    }

    /// The point of K nearest to `x`.
    pub fn project<T: Vect, B: Moments>(&self, x: Local<T, B>) -> Local<T, B> {
        self.minimise(Weights { n: 1.0, t: 1.0, m: 1.0, w: 1.0 }, x * -1.0)
    }

    /// The r in K that minimises ½ Σ w r² + q·r.
    ///
    /// For a given r_n the rows t, m and τ are clipped to their balls. The remaining equation in
    /// r_n is increasing and piecewise linear:
    ///
    /// w_n n + q_n − μ (‖q_t‖ − w_t μ n)⁺ − ν (‖q_m‖ − w_m ν n)⁺ − ξ (|q_τ| − w_τ ξ n)⁺ = 0,
    ///
    /// Its root is the largest of the roots of its linear pieces. With unit weights and q = −x the
    /// minimiser is the projection of x on K.
    pub fn minimise<T: Vect, B: Moments>(&self, w: Weights, q: Local<T, B>) -> Local<T, B> {
        let (slip, bend) = (q.t.norm(), q.m.bending());
        // an active group contributes pull − stiff n, with pull = coefficient × norm and stiff =
        // coefficient² × weight
        let slip = RowGroup { pull: self.mu * slip, stiff: self.mu * self.mu * w.t };
        let bend = RowGroup { pull: self.nu * bend, stiff: self.nu * self.nu * w.m };
        let mut n = root(w.n, q.n, slip, bend);
        if B::TWISTS {
            // the left side is the minimum of two increasing functions, without and with the twist
            // row at its limit: its root is the larger of their roots
            let twist = RowGroup { pull: self.xi * q.m.twist(), stiff: self.xi * self.xi * w.w };
            n = n.max(root(w.n + twist.stiff, q.n - twist.pull, slip, bend));
        }
        if n <= 0.0 {
            return Local::zero();
        }
        Local {
            n,
            t: (q.t * (-1.0 / w.t)).clipped(self.mu * n),
            m: q.m.scaled(-1.0 / w.m, -1.0 / w.w).within(self.nu * n, self.xi * n),
        }
    }
}

/// The contribution (pull − stiff n)⁺ of a row group to the equation of r_n.
#[derive(Clone, Copy)]
struct RowGroup {
    pull: f64,
    stiff: f64,
}

/// The root n of w n + q = Σ (pull − stiff n)⁺; a result ≤ 0 means that there is no positive root.
///
/// Left side minus right side is the minimum of four increasing lines, one for each set of groups
/// at their limit, so the root is the largest of the four roots. Selecting the set by comparison
/// would depend on round-off at a kink.
#[inline(always)]
fn root(w: f64, q: f64, t: RowGroup, m: RowGroup) -> f64 {
    let [none, slips] = [-q / w, (t.pull - q) / (w + t.stiff)];
    let [bends, both] = [(m.pull - q) / (w + m.stiff), (t.pull + m.pull - q) / (w + t.stiff + m.stiff)];
    none.max(slips).max(bends).max(both)
}

/// Predictor and corrector on the cone, as the change of the reaction: P_K(r̂ − γ ũ) − r̂.
///
/// A predictor inside the cone is its own projection; the change −γ ũ is then exact, however large
/// the shift s is beside r.
#[inline]
pub(crate) fn predict_correct<T: Vect, B: Moments>(
    cone: Cone,
    shift: f64,
    non_associated: bool,
    gamma: f64,
    r: Local<T, B>,
    mut u: Local<T, B>,
) -> Local<T, B> {
    if non_associated {
        u.n += cone.mu * u.t.norm() + cone.nu * u.m.bending();
        if B::TWISTS {
            u.n += cone.xi * u.m.twist();
        }
    }
    let change = u * -gamma;
    let mut predictor = r + change;
    predictor.n += shift;
    if cone.contains(&predictor) {
        return change;
    }
    let mut corrected = cone.project(predictor);
    corrected.n -= shift;
    corrected - r
}
