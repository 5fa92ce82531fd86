//! The cone of a contact in space: a disk for t and one for m at every r̂_n, so an intersection of second-order cones; for τ a
//! third, whose disk is a line.
//!
//! With Q = { x : ‖(x₁, x₂)‖ ≤ x₀ } the reaction is in K where s = G r̂ is in Q × Q, s = (μ r̂_n, r̂_t; ν r̂_n, r̂_m), and z is in K*
//! where z = Gᵀ λ with λ in Q × Q; s·λ = 0; for twist with one Q more. The symmetric N with N λ = N⁻¹ s (Nesterov & Todd, SIAM J. Optim. 8, 1998;
//! Vandenberghe, *The CVXOPT linear and quadratic cone program solvers*, 2010) gives D = 1/ρ + C + Gᵀ N⁻² G. Of rows without
//! friction a ray is left, Q of one component.

use super::super::guess::Beyond;
use crate::solver::rows::{Operator, Row, TWIST};
use super::{Aim, Site, yields};
use crate::contact::{PADDED, Padded};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// A contact of at most R rows: its second-order cones, at most C.
pub(in super::super) struct Disks<const R: usize, const C: usize> {
    cones: [Disk; C],
    /// How many there are.
    count: usize,
    /// 1/ρ + C in order; infinite for rows that carry nothing.
    metric: SVector<f64, R>,
}

/// A contact whose bonds are free to spin about their normal.
pub(in super::super) type Bending = Disks<5, 2>;

/// A contact whose bonds may resist twist.
pub(in super::super) type Twisting = Disks<6, 3>;

/// A second-order cone of a contact.
#[derive(Clone, Copy)]
struct Disk {
    /// Coefficient of r̂_n.
    coefficient: f64,
    /// Place of the first row beside it, and how many there are: none where the cone is a ray.
    first: usize,
    rows: usize,
}

/// The shifted reaction r̂ (N s) and the multiplier λ of each cone (m/s).
#[derive(Clone, Copy)]
pub(in super::super) struct Pair<const R: usize, const C: usize> {
    r: SVector<f64, R>,
    lambda: [Vector3<f64>; C],
}

/// D⁻¹, and of each cone N⁻¹ and N λ = N⁻¹ s.
pub(in super::super) struct Scaling<const R: usize, const C: usize> {
    inverse: SMatrix<f64, R, R>,
    cones: [(Matrix3<f64>, Vector3<f64>); C],
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

impl<const R: usize, const C: usize> Disks<R, C> {
    fn cones(&self) -> impl Iterator<Item = (usize, Disk)> {
        self.cones[..self.count].iter().copied().enumerate()
    }

    /// s of cone `k`.
    fn image(&self, k: usize, r: &SVector<f64, R>) -> Vector3<f64> {
        let Disk { coefficient, first, rows } = self.cones[k];
        let mut s = Vector3::new(coefficient * r[0], 0.0, 0.0);
        (0..rows).for_each(|row| s[1 + row] = r[first + row]);
        s
    }

    /// Gᵀ of values for each cone.
    fn gathered(&self, values: &[Vector3<f64>; C]) -> SVector<f64, R> {
        let mut out = SVector::zeros();
        for (k, disk) in self.cones() {
            out[0] += disk.coefficient * values[k][0];
            (0..disk.rows).for_each(|row| out[disk.first + row] += values[k][1 + row]);
        }
        out
    }

    /// N⁻¹ (N λ \ right), where right is what N λ ∘ (N Δλ + N⁻¹ Δs) should be.
    fn aimed(&self, k: usize, scaling: &Scaling<R, C>, aim: Aim<Pair<R, C>>) -> Vector3<f64> {
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

/// The rows of a contact that has no more than R.
fn rows_of<const R: usize>(x: &Padded) -> SVector<f64, R> {
    x.in_order().fixed_rows::<R>(0).into()
}

/// The inverse of [`rows_of`].
fn padded<const R: usize>(x: &SVector<f64, R>) -> Padded {
    let mut all = SVector::<f64, PADDED>::zeros();
    all.fixed_rows_mut::<R>(0).copy_from(x);
    Padded::from_order(&all)
}

impl<const R: usize, const C: usize> Site for Disks<R, C> {
    type Pair = Pair<R, C>;
    type Slack = SVector<f64, R>;
    type Scaling = Scaling<R, C>;
    type Drive = SVector<f64, R>;

    fn new(row: &Row) -> Self {
        let w = row.metric();
        let mut metric = rows_of::<R>(&Padded::from_order(&[w.n, w.t, w.t, w.m, w.m, w.w].into()));
        let mut cones = [Disk { coefficient: 1.0, first: 0, rows: 0 }; C];
        let mut count = 0;
        for (coefficient, first, rows) in [(row.cone.mu, 1, 2), (row.cone.nu, 3, 2), (row.cone.xi, TWIST, 1)] {
            if coefficient > 0.0 && row.rows.contains(&first) {
                cones[count] = Disk { coefficient, first, rows };
                count += 1;
            } else {
                (first..R.min(first + rows)).for_each(|place| metric[place] = f64::INFINITY);
            }
        }
        Self { cones, count: count.max(1), metric }
    }

    fn inside(&self, q: &Padded, share: f64, yields: f64) -> Pair<R, C> {
        let q = rows_of::<R>(q);
        let least = share * yields;
        let norm = |disk: &Disk| (0..disk.rows).fold(0.0, |sum: f64, row| sum.hypot(q[disk.first + row]));
        let most = self.cones().map(|(_, disk)| disk.coefficient * norm(&disk));
        let size = most.fold(q[0].abs(), f64::max) + least;
        let mut pair = Pair { r: SVector::zeros(), lambda: [Vector3::x(); C] };
        // all products alike: in the middle of the path
        pair.r[0] = share * least / size;
        for (k, disk) in self.cones() {
            pair.lambda[k] = self.image(k, &q);
            pair.lambda[k][0] = size / disk.coefficient;
        }
        pair
    }

    fn reaction(&self, row: &Row, at: &Pair<R, C>) -> Padded {
        let mut r = padded(&at.r);
        r.n -= row.shift;
        r
    }

    fn defect(&self, at: &Pair<R, C>, z: &Padded) -> SVector<f64, R> {
        let mut off = self.gathered(&at.lambda) - rows_of::<R>(z);
        (0..R).filter(|k| !self.carries(*k)).for_each(|k| off[k] = 0.0);
        off
    }

    fn add_products(&self, at: &Pair<R, C>, sum: &mut f64) -> usize {
        self.cones().for_each(|(k, _)| *sum += self.image(k, &at.r).dot(&at.lambda[k]));
        self.count
    }

    fn add_scale(&self, at: &Pair<R, C>, yields: f64, sum: &mut f64) -> usize {
        *sum += self.count as f64 * yields * at.r[0] * at.r[0];
        self.count
    }

    fn scaling(&self, at: &Pair<R, C>) -> Scaling<R, C> {
        let mut cones = [(Matrix3::zeros(), Vector3::zeros()); C];
        let mut d = SMatrix::<f64, R, R>::from_diagonal(&self.metric.map(|w| if w.is_finite() { w } else { 1.0 }));
        for (k, disk) in self.cones() {
            let (inverse, point) = scaled(&self.image(k, &at.r), &at.lambda[k]);
            let square = inverse * inverse;
            // G picks (c r_n, r_t)
            let pick = |a: usize| if a == 0 { (0, disk.coefficient) } else { (disk.first + a - 1, 1.0) };
            for a in 0..=disk.rows {
                for b in 0..=disk.rows {
                    let ((i, x), (j, y)) = (pick(a), pick(b));
                    d[(i, j)] += x * y * square[(a, b)];
                }
            }
            cones[k] = (inverse, point);
        }
        let mut inverse = d.try_inverse().unwrap_or_else(SMatrix::zeros);
        for k in (0..R).filter(|k| !self.carries(*k)) {
            inverse[(k, k)] = 0.0;
        }
        Scaling { inverse, cones }
    }

    fn operator(&self, scaling: &Scaling<R, C>) -> Operator {
        let mut all = SMatrix::<f64, PADDED, PADDED>::zeros();
        all.fixed_view_mut::<R, R>(0, 0).copy_from(&scaling.inverse);
        Operator::Full(Box::new(all))
    }

    fn drive(
        &self,
        scaling: &Scaling<R, C>,
        _: &Pair<R, C>,
        off: &SVector<f64, R>,
        aim: Aim<Pair<R, C>>,
    ) -> SVector<f64, R> {
        let mut aimed = [Vector3::zeros(); C];
        self.cones().for_each(|(k, _)| aimed[k] = self.aimed(k, scaling, aim));
        scaling.inverse * (self.gathered(&aimed) + off)
    }

    fn force(&self, drive: &SVector<f64, R>) -> Padded {
        padded(drive)
    }

    fn step(
        &self,
        scaling: &Scaling<R, C>,
        _: &Pair<R, C>,
        drive: &SVector<f64, R>,
        pulled: &Padded,
        aim: Aim<Pair<R, C>>,
    ) -> Pair<R, C> {
        let r = drive - scaling.inverse * rows_of::<R>(pulled);
        let mut lambda = [Vector3::zeros(); C];
        for (k, _) in self.cones() {
            let inverse = &scaling.cones[k].0;
            lambda[k] = self.aimed(k, scaling, aim) - inverse * (inverse * self.image(k, &r));
        }
        Pair { r, lambda }
    }

    fn moved(at: &Pair<R, C>, step: &Pair<R, C>, length: f64) -> Pair<R, C> {
        let lambda = std::array::from_fn(|k| at.lambda[k] + step.lambda[k] * length);
        Pair { r: at.r + step.r * length, lambda }
    }

    fn longest(&self, at: &Pair<R, C>, step: &Pair<R, C>, longest: f64) -> f64 {
        let ways = self.cones().map(|(k, _)| {
            let s = reach(&self.image(k, &at.r), &self.image(k, &step.r));
            s.min(reach(&at.lambda[k], &step.lambda[k]))
        });
        ways.fold(longest, f64::min)
    }

    fn snapped(&self, row: &Row, at: &Pair<R, C>) -> (Padded, Beyond) {
        let (mut r, mut beyond) = (at.r, Beyond::default());
        // between the velocity that a reaction gives free bodies, and what the metric lets those in its way yield
        let measure = (yields(row) * row.metric().n).sqrt();
        let least = |x: &Vector3<f64>| x[0] - x[1].hypot(x[2]);
        if self.cones().all(|(k, disk)| least(&at.lambda[k]) > disk.coefficient * r[0] * measure) {
            r = SVector::zeros();
        }
        for (k, Disk { coefficient, first, rows }) in self.cones().filter(|(_, disk)| disk.rows > 0) {
            let size = r.rows(first, rows).fold(0.0, f64::hypot);
            let limit = coefficient * r[0];
            // what is nearly nothing has no direction
            let outward = limit / size;
            if outward.is_finite() && (limit - size) * measure < at.lambda[k][0] {
                r.rows_mut(first, rows).scale_mut(outward);
                beyond[first / 2] = at.lambda[k][1].hypot(at.lambda[k][2]) / (self.metric[first] * limit);
            }
        }
        let mut r = padded(&r);
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
