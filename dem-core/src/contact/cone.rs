//! The one family of cones, K = { ‖t‖ ≤ μ n, ‖m‖ ≤ ν n }, and the minimisation over it that every law needs.
//!
//! `Local<T, B>` holds the rows of one contact: the normal component n, the tangential rows t and the bending
//! rows m (moments divided by the mean diameter, relative spins multiplied by it, so all rows share a unit).
//! A group that a contact lacks has length zero, so one formula serves frictionless, dry and bonded contacts.
//!
//! Source: the cone of Coulomb with rolling resistance, Guessasma & Fortin 2011 with the rolling of Taboada,
//! Estrada & Radjaï 2006.

use crate::dim::{Vect, resized};
use nalgebra::SVector;
use std::ops::{Add, AddAssign, Mul, Sub};

/// One value for each row of a contact: reaction (N s) or relative velocity (m/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local<T, B> {
    /// Normal component.
    pub n: f64,
    /// Tangential components; no rows without friction.
    pub t: T,
    /// Bending components, scaled by the mean diameter; no rows without a bond.
    pub m: B,
}

impl<T: Vect, B: Vect> Local<T, B> {
    /// Number of rows.
    pub const ROWS: usize = 1 + T::LEN + B::LEN;

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

    /// The same rows in groups of other lengths: those that only one of the two has are zero, or left out.
    #[inline(always)]
    pub(crate) fn resized<U: Vect, C: Vect>(&self) -> Local<U, C> {
        Local { n: self.n, t: resized(self.t), m: resized(self.m) }
    }
}

/// Rows of any contact, padded with zeros to the most that one has: n, two tangential, two bending.
pub(crate) type Padded = Local<SVector<f64, 2>, SVector<f64, 2>>;

impl Padded {
    /// The rows in the order n, t, m.
    #[inline]
    pub(crate) fn in_order(&self) -> SVector<f64, 5> {
        [self.n, self.t[0], self.t[1], self.m[0], self.m[1]].into()
    }

    /// The inverse of [`Padded::in_order`].
    #[inline]
    pub(crate) fn from_order(v: &SVector<f64, 5>) -> Self {
        Self { n: v[0], t: [v[1], v[2]].into(), m: [v[3], v[4]].into() }
    }
}

impl<T: Vect, B: Vect> Add for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { n: self.n + o.n, t: self.t + o.t, m: self.m + o.m }
    }
}

impl<T: Vect, B: Vect> Sub for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { n: self.n - o.n, t: self.t - o.t, m: self.m - o.m }
    }
}

impl<T: Vect, B: Vect> Mul<f64> for Local<T, B> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: f64) -> Self {
        Self { n: self.n * k, t: self.t * k, m: self.m * k }
    }
}

impl<T: Vect, B: Vect> AddAssign for Local<T, B> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

/// The cone K = { ‖t‖ ≤ `mu` n, ‖m‖ ≤ `nu` n } of shifted reactions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Coefficient of the tangential rows (–).
    pub mu: f64,
    /// Coefficient of the bending rows, whose moments are divided by the mean diameter (–).
    pub nu: f64,
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
}

impl Weights {
    /// The weighted rows of `x`.
    #[inline(always)]
    pub fn times<T: Vect, B: Vect>(&self, x: &Local<T, B>) -> Local<T, B> {
        Local { n: x.n * self.n, t: x.t * self.t, m: x.m * self.m }
    }
}

impl Add for Weights {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { n: self.n + o.n, t: self.t + o.t, m: self.m + o.m }
    }
}

impl Mul<f64> for Weights {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: f64) -> Self {
        Self { n: self.n * k, t: self.t * k, m: self.m * k }
    }
}

impl Cone {
    /// Whether `x` lies in K.
    #[inline(always)]
    pub fn contains<T: Vect, B: Vect>(&self, x: &Local<T, B>) -> bool {
        let (mu, nu) = (self.mu * x.n, self.nu * x.n);
        x.n >= 0.0 && x.t.dot(&x.t) <= mu * mu && x.m.dot(&x.m) <= nu * nu
    }

    /// The point of K nearest to `x`.
    pub fn project<T: Vect, B: Vect>(&self, x: Local<T, B>) -> Local<T, B> {
        self.minimise(Weights { n: 1.0, t: 1.0, m: 1.0 }, x * -1.0)
    }

    /// The r in K that minimises ½ Σ w r² + q·r.
    ///
    /// For a given r_n the rows t and m are clipped to their balls, which leaves one increasing, piecewise linear
    /// equation in r_n,
    ///
    /// w_n n + q_n − μ (‖q_t‖ − w_t μ n)⁺ − ν (‖q_m‖ − w_m ν n)⁺ = 0,
    ///
    /// with at most two breakpoints: solved by cases, without iterations. With unit weights and q = −x it is the
    /// projection of x on K.
    pub fn minimise<T: Vect, B: Vect>(&self, w: Weights, q: Local<T, B>) -> Local<T, B> {
        let (slip, bend) = (q.t.norm(), q.m.norm());
        // with the row group active its equation reads: pull = coefficient × norm, stiffness = coefficient² × weight
        let (pull_t, stiff_t) = (self.mu * slip, self.mu * self.mu * w.t);
        let (pull_m, stiff_m) = (self.nu * bend, self.nu * self.nu * w.m);
        let active = |n: f64, pull: f64, stiff: f64| pull > stiff * n;

        let both = (pull_t + pull_m - q.n) / (w.n + stiff_t + stiff_m);
        if both <= 0.0 {
            return Local::zero();
        }
        let mut n = -q.n / w.n;
        if active(n, pull_t, stiff_t) || active(n, pull_m, stiff_m) {
            // fewer active groups mean a smaller n; walk down from none to one to both
            let only_t = (pull_t - q.n) / (w.n + stiff_t);
            let only_m = (pull_m - q.n) / (w.n + stiff_m);
            n = if active(only_t, pull_t, stiff_t) && !active(only_t, pull_m, stiff_m) {
                only_t
            } else if active(only_m, pull_m, stiff_m) && !active(only_m, pull_t, stiff_t) {
                only_m
            } else {
                both
            };
        }
        Local { n, t: (q.t * (-1.0 / w.t)).clipped(self.mu * n), m: (q.m * (-1.0 / w.m)).clipped(self.nu * n) }
    }
}
