//! The cone of a contact in the plane: spanned by rays e = (1, ±μ, ±ν), four for a bond, two for a dry contact.
//!
//! r̂ = Σ λ e with λ ≥ 0, and z ∈ K* where w = Eᵀ z ≥ 0; λ w = 0. D⁻¹ is E (w/λ + Eᵀ(1/ρ + C)E)⁻¹ Eᵀ.

use super::super::guess::Beyond;
use crate::solver::rows::{Operator, Row};
use super::{Aim, Site, yields};
use crate::contact::{PADDED, Padded};
use nalgebra::{SMatrix, SVector};

/// A value for each ray.
type Values = SVector<f64, 4>;

/// A contact: the rays of its cone, and how many it has.
pub(in super::super) struct Rays {
    rays: SMatrix<f64, PADDED, 4>,
    count: usize,
    /// 1/ρ + C in order.
    metric: SVector<f64, PADDED>,
}

/// Multipliers of the rays (N s) and their slacks (m/s), one for each; ones beyond the last ray.
#[derive(Clone, Copy)]
pub(in super::super) struct Pair {
    lambda: Values,
    slack: Values,
}

impl Rays {
    fn shifted(&self, row: &Row, lambda: &Values) -> Padded {
        let mut used = *lambda;
        used.iter_mut().skip(self.count).for_each(|l| *l = 0.0);
        let mut r = Padded::from_order(&(self.rays * used));
        r.n -= row.shift;
        r
    }

    /// Eᵀ x on the rays that there are.
    fn along(&self, x: &Padded) -> Values {
        self.rays.transpose() * x.in_order()
    }
}

/// What λ w should be of ray `k`.
fn target(aim: Aim<Pair>, k: usize) -> f64 {
    match aim {
        Aim::Boundary => 0.0,
        Aim::Middle(product, affine) => product - affine.lambda[k] * affine.slack[k],
    }
}

impl Site for Rays {
    type Pair = Pair;
    type Slack = Values;
    type Scaling = SMatrix<f64, 4, 4>;
    type Drive = Values;

    fn new(row: &Row) -> Self {
        let signs = |c: f64, there: bool| if there && c > 0.0 { &[1.0, -1.0][..] } else { &[0.0][..] };
        let mut rays = SMatrix::<f64, PADDED, 4>::zeros();
        let mut count = 0;
        for t in signs(row.cone.mu, row.rows.contains(&1)) {
            for m in signs(row.cone.nu, row.rows.contains(&3)) {
                rays.set_column(count, &SVector::from([1.0, t * row.cone.mu, 0.0, m * row.cone.nu, 0.0, 0.0]));
                count += 1;
            }
        }
        let w = row.metric();
        Self { rays, count, metric: [w.n, w.t, w.t, w.m, w.m, w.w].into() }
    }

    fn inside(&self, q: &Padded, share: f64, yields: f64) -> Pair {
        let share = share / self.count as f64;
        let least = Values::repeat(share * yields);
        let slack = self.along(q).abs() + least;
        // all products alike: in the middle of the path
        Pair { lambda: least.component_div(&slack) * share, slack }
    }

    fn reaction(&self, row: &Row, at: &Pair) -> Padded {
        self.shifted(row, &at.lambda)
    }

    fn defect(&self, at: &Pair, z: &Padded) -> Values {
        let mut slack = at.slack - self.along(z);
        slack.iter_mut().skip(self.count).for_each(|w| *w = 0.0);
        slack
    }

    fn add_products(&self, at: &Pair, sum: &mut f64) -> usize {
        (0..self.count).for_each(|k| *sum += at.lambda[k] * at.slack[k]);
        self.count
    }

    fn add_scale(&self, at: &Pair, yields: f64, sum: &mut f64) -> usize {
        (0..self.count).for_each(|k| *sum += yields * at.lambda[k] * at.lambda[k]);
        self.count
    }

    /// (w/λ + Eᵀ(1/ρ + C)E)⁻¹.
    fn scaling(&self, at: &Pair) -> SMatrix<f64, 4, 4> {
        let mut d = self.rays.transpose() * SMatrix::from_diagonal(&self.metric) * self.rays;
        for k in 0..4 {
            d[(k, k)] += if k < self.count { at.slack[k] / at.lambda[k] } else { 1.0 };
        }
        d.try_inverse().unwrap_or_else(SMatrix::zeros)
    }

    fn operator(&self, inverse: &SMatrix<f64, 4, 4>) -> Operator {
        Operator::Full(Box::new(self.rays * inverse * self.rays.transpose()))
    }

    fn drive(&self, inverse: &SMatrix<f64, 4, 4>, at: &Pair, off: &Values, aim: Aim<Pair>) -> Values {
        let mut right = Values::zeros();
        for k in 0..self.count {
            right[k] = (target(aim, k) - at.lambda[k] * at.slack[k]) / at.lambda[k] + off[k];
        }
        inverse * right
    }

    fn force(&self, drive: &Values) -> Padded {
        Padded::from_order(&(self.rays * drive))
    }

    fn step(&self, inverse: &SMatrix<f64, 4, 4>, at: &Pair, drive: &Values, pulled: &Padded, aim: Aim<Pair>) -> Pair {
        let mut lambda = drive - inverse * self.along(pulled);
        let mut slack = Values::zeros();
        for k in 0..4 {
            if k < self.count {
                slack[k] = (target(aim, k) - at.slack[k] * lambda[k]) / at.lambda[k] - at.slack[k];
            } else {
                lambda[k] = 0.0;
            }
        }
        Pair { lambda, slack }
    }

    fn moved(at: &Pair, step: &Pair, length: f64) -> Pair {
        Pair { lambda: at.lambda + step.lambda * length, slack: at.slack + step.slack * length }
    }

    fn longest(&self, at: &Pair, step: &Pair, mut longest: f64) -> f64 {
        for k in 0..self.count {
            for (x, d) in [(at.lambda[k], step.lambda[k]), (at.slack[k], step.slack[k])] {
                if d < 0.0 {
                    longest = longest.min(-x / d);
                }
            }
        }
        longest
    }

    fn snapped(&self, row: &Row, at: &Pair) -> (Padded, Beyond) {
        let mut lambda = at.lambda;
        for k in 0..self.count {
            if lambda[k] * yields(row) < at.slack[k] {
                lambda[k] = 0.0;
            }
        }
        // in the plane nothing asks how far
        (self.shifted(row, &lambda), Beyond::default())
    }
}
