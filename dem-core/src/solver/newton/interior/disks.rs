//! The cone of a contact in space: a disk for t and one for m at every r̂_n, so an intersection of second-order cones.
//!
//! With Q = { x : ‖(x₁, x₂)‖ ≤ x₀ } the reaction is in K where s = G r̂ is in Q × Q, s = (μ r̂_n, r̂_t; ν r̂_n, r̂_m), and z is in K*
//! where z = Gᵀ λ with λ in Q × Q; s·λ = 0. The symmetric N with N λ = N⁻¹ s (Nesterov & Todd, SIAM J. Optim. 8, 1998;
//! Vandenberghe, *The CVXOPT linear and quadratic cone program solvers*, 2010) gives D = 1/ρ + C + Gᵀ N⁻² G. Of rows without
//! friction a ray is left, Q of one component.

use super::super::rows::{Operator, Row};
use super::{Aim, Site, yields};
use crate::contact::Padded;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

type Vector5 = SVector<f64, 5>;
type Matrix5 = SMatrix<f64, 5, 5>;

/// A contact: its second-order cones.
pub(in super::super) struct Disks {
    /// Coefficient of r̂_n, and the place of the first of the two rows beside it; none where the cone is a ray.
    cones: [(f64, Option<usize>); 2],
    /// How many there are.
    count: usize,
    /// 1/ρ + C in order; infinite for rows that carry nothing.
    metric: Vector5,
}

/// The shifted reaction r̂ (N s) and the multiplier λ of each cone (m/s).
#[derive(Clone, Copy)]
pub(in super::super) struct Pair {
    r: Vector5,
    lambda: [Vector3<f64>; 2],
}

/// D⁻¹, and of each cone N⁻¹ and N λ = N⁻¹ s.
pub(in super::super) struct Scaling {
    inverse: Matrix5,
    cones: [(Matrix3<f64>, Vector3<f64>); 2],
}

/// s₀² − ‖(s₁, s₂)‖², without cancellation.
fn hyperbolic(x: &Vector3<f64>) -> f64 {
    let norm = x.fixed_rows::<2>(1).norm();
    (x[0] - norm) * (x[0] + norm)
}

/// Jordan's product x ∘ y.
fn product(x: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
    [x.dot(y), x[0] * y[1] + y[0] * x[1], x[0] * y[2] + y[0] * x[2]].into()
}

/// The y with x ∘ y = right.
fn divided(right: &Vector3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
    let along = x[1] * right[1] + x[2] * right[2];
    let first = (x[0] * right[0] - along) / hyperbolic(x);
    [first, (right[1] - first * x[1]) / x[0], (right[2] - first * x[2]) / x[0]].into()
}

/// N⁻¹ and N λ at the point s, λ inside Q.
fn scaled(s: &Vector3<f64>, lambda: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    let (size_s, size_l) = (hyperbolic(s).sqrt(), hyperbolic(lambda).sqrt());
    let (s_unit, l_unit) = (s / size_s, lambda / size_l);
    let mirrored = Vector3::new(l_unit[0], -l_unit[1], -l_unit[2]);
    let half = (0.5 * (1.0 + s_unit.dot(&l_unit))).sqrt();
    let w = (s_unit + mirrored) / (2.0 * half);
    let tail = Vector2::new(w[1], w[2]);
    let block = SMatrix::<f64, 2, 2>::identity() + tail * tail.transpose() / (1.0 + w[0]);
    let mut inverse = Matrix3::zeros();
    inverse[(0, 0)] = w[0];
    for k in 0..2 {
        inverse[(0, 1 + k)] = -tail[k];
        inverse[(1 + k, 0)] = -tail[k];
        (0..2).for_each(|l| inverse[(1 + k, 1 + l)] = block[(k, l)]);
    }
    inverse *= (size_l / size_s).sqrt();
    (inverse, inverse * s)
}

/// How far x + α d stays inside Q.
fn reach(x: &Vector3<f64>, d: &Vector3<f64>) -> f64 {
    let (a, b) = (hyperbolic(d), x[0] * d[0] - x[1] * d[1] - x[2] * d[2]);
    let c = hyperbolic(x);
    // from inside the root is real, whatever rounding says
    let slope = (b * b - a * c).max(0.0).sqrt() - b;
    if slope > 0.0 { c / slope } else { f64::INFINITY }
}

impl Disks {
    fn cones(&self) -> impl Iterator<Item = (usize, f64, Option<usize>)> {
        self.cones[..self.count].iter().enumerate().map(|(k, (c, place))| (k, *c, *place))
    }

    /// s of cone `k`.
    fn image(&self, k: usize, r: &Vector5) -> Vector3<f64> {
        match self.cones[k] {
            (c, Some(place)) => [c * r[0], r[place], r[place + 1]].into(),
            (c, None) => [c * r[0], 0.0, 0.0].into(),
        }
    }

    /// Gᵀ of values for each cone.
    fn gathered(&self, values: &[Vector3<f64>; 2]) -> Vector5 {
        let mut out = Vector5::zeros();
        for (k, c, place) in self.cones() {
            out[0] += c * values[k][0];
            if let Some(place) = place {
                out[place] += values[k][1];
                out[place + 1] += values[k][2];
            }
        }
        out
    }

    /// N⁻¹ (N λ \ right), where right is what N λ ∘ (N Δλ + N⁻¹ Δs) should be.
    fn aimed(&self, k: usize, scaling: &Scaling, aim: Aim<Pair>) -> Vector3<f64> {
        let (inverse, point) = &scaling.cones[k];
        let mut right = -product(point, point);
        if let Aim::Middle(gap, affine) = aim {
            right[0] += gap;
            // N Δλ of the step to the boundary, where N λ ∘ (N Δλ + N⁻¹ Δs) = −N λ ∘ N λ
            let ds = inverse * self.image(k, &affine.r);
            let dl = -point - ds;
            right -= product(&ds, &dl);
        }
        inverse * divided(&right, point)
    }

    /// Whether a row carries anything.
    fn carries(&self, place: usize) -> bool {
        self.metric[place].is_finite()
    }
}

impl Site for Disks {
    type Pair = Pair;
    type Slack = Vector5;
    type Scaling = Scaling;
    type Drive = Vector5;

    fn new(row: &Row) -> Self {
        let w = row.metric();
        let mut metric = Vector5::from([w.n, w.t, w.t, w.m, w.m]);
        let mut cones = [(1.0, None); 2];
        let mut count = 0;
        for (c, place) in [(row.cone.mu, 1), (row.cone.nu, 3)] {
            if c > 0.0 && row.rows.contains(&place) {
                cones[count] = (c, Some(place));
                count += 1;
            } else {
                (metric[place], metric[place + 1]) = (f64::INFINITY, f64::INFINITY);
            }
        }
        Self { cones, count: count.max(1), metric }
    }

    fn inside(&self, q: &Padded, share: f64, yields: f64) -> Pair {
        let q = q.in_order();
        let tail = |place: Option<usize>| place.map_or([0.0; 2], |place| [q[place], q[place + 1]]);
        let least = share * yields;
        let most = self.cones().map(|(_, c, place)| c * tail(place)[0].hypot(tail(place)[1]));
        let size = most.fold(q[0].abs(), f64::max) + least;
        let mut pair = Pair { r: Vector5::zeros(), lambda: [Vector3::x(); 2] };
        // all products alike: in the middle of the path
        pair.r[0] = share * least / size;
        for (k, c, place) in self.cones() {
            let [a, b] = tail(place);
            pair.lambda[k] = [size / c, a, b].into();
        }
        pair
    }

    fn reaction(&self, row: &Row, at: &Pair) -> Padded {
        let mut r = Padded::from_order(&at.r);
        r.n -= row.shift;
        r
    }

    fn defect(&self, at: &Pair, z: &Padded) -> Vector5 {
        let mut off = self.gathered(&at.lambda) - z.in_order();
        (0..5).filter(|k| !self.carries(*k)).for_each(|k| off[k] = 0.0);
        off
    }

    fn add_products(&self, at: &Pair, sum: &mut f64) -> usize {
        self.cones().for_each(|(k, ..)| *sum += self.image(k, &at.r).dot(&at.lambda[k]));
        self.count
    }

    fn add_scale(&self, at: &Pair, yields: f64, sum: &mut f64) -> usize {
        *sum += self.count as f64 * yields * at.r[0] * at.r[0];
        self.count
    }

    fn scaling(&self, at: &Pair) -> Scaling {
        let mut scaling = Scaling { inverse: Matrix5::zeros(), cones: [(Matrix3::zeros(), Vector3::zeros()); 2] };
        let mut d = Matrix5::from_diagonal(&self.metric.map(|w| if w.is_finite() { w } else { 1.0 }));
        for (k, c, place) in self.cones() {
            let (inverse, point) = scaled(&self.image(k, &at.r), &at.lambda[k]);
            let square = inverse * inverse;
            // G picks (c r_n, r_t)
            let pick = [Some((0, c)), place.map(|p| (p, 1.0)), place.map(|p| (p + 1, 1.0))];
            for (a, row) in pick.iter().enumerate() {
                for (b, column) in pick.iter().enumerate() {
                    if let (Some((i, x)), Some((j, y))) = (row, column) {
                        d[(*i, *j)] += x * y * square[(a, b)];
                    }
                }
            }
            scaling.cones[k] = (inverse, point);
        }
        scaling.inverse = d.try_inverse().unwrap_or_else(Matrix5::zeros);
        for k in (0..5).filter(|k| !self.carries(*k)) {
            scaling.inverse[(k, k)] = 0.0;
        }
        scaling
    }

    fn operator(&self, scaling: &Scaling) -> Operator {
        Operator::Full(scaling.inverse)
    }

    fn drive(&self, scaling: &Scaling, _: &Pair, off: &Vector5, aim: Aim<Pair>) -> Vector5 {
        let mut aimed = [Vector3::zeros(); 2];
        self.cones().for_each(|(k, ..)| aimed[k] = self.aimed(k, scaling, aim));
        scaling.inverse * (self.gathered(&aimed) + off)
    }

    fn force(&self, drive: &Vector5) -> Padded {
        Padded::from_order(drive)
    }

    fn step(&self, scaling: &Scaling, _: &Pair, drive: &Vector5, pulled: &Padded, aim: Aim<Pair>) -> Pair {
        let r = drive - scaling.inverse * pulled.in_order();
        let mut lambda = [Vector3::zeros(); 2];
        for (k, ..) in self.cones() {
            let inverse = &scaling.cones[k].0;
            lambda[k] = self.aimed(k, scaling, aim) - inverse * (inverse * self.image(k, &r));
        }
        Pair { r, lambda }
    }

    fn moved(at: &Pair, step: &Pair, length: f64) -> Pair {
        let lambda = [0, 1].map(|k| at.lambda[k] + step.lambda[k] * length);
        Pair { r: at.r + step.r * length, lambda }
    }

    fn longest(&self, at: &Pair, step: &Pair, longest: f64) -> f64 {
        let ways = self.cones().map(|(k, ..)| {
            let s = reach(&self.image(k, &at.r), &self.image(k, &step.r));
            s.min(reach(&at.lambda[k], &step.lambda[k]))
        });
        ways.fold(longest, f64::min)
    }

    fn snapped(&self, row: &Row, at: &Pair) -> (Padded, [f64; 2]) {
        let (mut r, mut beyond) = (at.r, [0.0; 2]);
        // between the velocity that a reaction gives free bodies, and what the metric lets those in its way yield
        let measure = (yields(row) * row.metric().n).sqrt();
        let least = |x: &Vector3<f64>| x[0] - x[1].hypot(x[2]);
        if self.cones().all(|(k, c, _)| least(&at.lambda[k]) > c * r[0] * measure) {
            r = Vector5::zeros();
        }
        for (k, c, place) in self.cones() {
            let Some(place) = place else { continue };
            let (size, limit) = (r[place].hypot(r[place + 1]), c * r[0]);
            if size > 0.0 && (limit - size) * measure < at.lambda[k][0] {
                r[place] *= limit / size;
                r[place + 1] *= limit / size;
                beyond[place / 2] = at.lambda[k][1].hypot(at.lambda[k][2]) / (self.metric[place] * limit);
            }
        }
        let mut r = Padded::from_order(&r);
        r.n -= row.shift;
        (r, beyond)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points inside Q, far from and near to its boundary.
    fn points() -> Vec<Vector3<f64>> {
        let near = 1.0 - 1e-9;
        vec![
            [1.0, 0.0, 0.0].into(),
            [2.0, 0.6, -1.1].into(),
            [1e-6, -0.3e-6, 0.2e-6].into(),
            [1e3, 0.6e3 * near, 0.8e3 * near].into(),
        ]
    }

    #[test]
    fn the_scaling_maps_the_multiplier_to_the_reaction() {
        for s in points() {
            for lambda in points() {
                let (inverse, point) = scaled(&s, &lambda);
                // N⁻² s = λ, and both have one image
                let image = inverse * (inverse * s);
                assert!((image - lambda).norm() <= 1e-6 * lambda.norm(), "{s} {lambda} {image}");
                assert!((product(&point, &point)[0] - s.dot(&lambda)).abs() <= 1e-6 * s.dot(&lambda));
                let right = Vector3::new(0.3, -0.2, 0.7);
                assert!((product(&point, &divided(&right, &point)) - right).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn a_step_ends_on_the_boundary() {
        for x in points() {
            for d in [[-1.0, 0.0, 0.0], [0.0, 1.0, -2.0], [-0.5, 3.0, 0.1], [1.0, -1.5, 0.0]].map(Vector3::from) {
                let way = reach(&x, &d);
                let end = x + d * way;
                assert!(way > 0.0 && hyperbolic(&end).abs() <= 1e-6 * end[0] * end[0], "{x} {d} {end}");
                assert!(hyperbolic(&(x + d * (0.999 * way))) > 0.0);
            }
            // straight to the tip, whatever rounding makes of it
            let tip = reach(&x, &(x * -0.7));
            assert!((tip - 1.0 / 0.7).abs() < 1e-6, "{x} {tip}");
            // into the cone there is no end
            assert_eq!(reach(&x, &Vector3::new(1.0, 0.4, 0.3)), f64::INFINITY);
        }
    }
}
