//! The linear system of an iteration.

use super::iterate::{Iterate, Residual};
use super::programme::{Programme, sum, unknowns};
use super::scaling::{Metric, Soft};
use crate::linear::Factors;
use crate::solver::interior::cones::{Point, moved};
use crate::solver::tuning::{INVISIBLE, limit_load as tuning};

/// Right sides, or a solution, of the linear system; z is scaled, W z.
pub(super) struct Parts {
    pub r: Vec<f64>,
    pub lambda: f64,
    pub y: Vec<f64>,
    pub z: Vec<Point>,
}

/// The linear system at a point.
pub(super) struct System<'a> {
    pub of: &'a Programme,
    pub metrics: Vec<Metric>,
    /// S⁻¹ of each contact.
    pub soft: Vec<Soft>,
    pub factors: Factors,
    /// Scales of the unknowns of H S⁻¹ Hᵀ: with them its regularisation is the unit matrix.
    pub scales: Vec<f64>,
    /// (H S⁻¹ Hᵀ)⁻¹ f₁, and f₁ · of it.
    pub border: Vec<f64>,
    pub pivot: f64,
    /// Solution for the right side (−c, b, 0), which a change of τ multiplies; its z is scaled.
    pub by_tau: Parts,
}

impl<'a> System<'a> {
    pub fn of(of: &'a Programme, at: &Iterate) -> Option<Self> {
        let metrics: Vec<Metric> = at.s.iter().zip(&at.z).map(|(s, z)| Metric::of(s, z)).collect();
        let soft: Option<Vec<Soft>> = of.sites.list.iter().map(|site| Soft::of(&of.sites, site, &metrics)).collect();
        let soft = soft?;
        let mut diagonal = vec![0.0; of.rows.unknowns];
        for ((site, row), soft) in of.sites.list.iter().zip(&of.rows.list).zip(&soft) {
            // the diagonal entries of S⁻¹ stand for all of it
            for (j, k) in site.of[..site.rows].iter().enumerate() {
                let line = &of.rows.coefficients[row.start + k * row.width()..][..row.width()];
                unknowns(row).zip(line).for_each(|(unknown, h)| diagonal[unknown] += h * h * soft.inverse[j][j]);
            }
        }
        // an unknown of no contact has no entry of its own
        let least = diagonal.iter().copied().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
        let least = if least.is_finite() { least } else { 1.0 };
        let scale = |d: &f64| (INVISIBLE * if *d > 0.0 { *d } else { least }).sqrt().recip();
        let scales: Vec<f64> = diagonal.iter().map(scale).collect();
        let mut factors = Factors::default();
        factors.factorise(&of.graph.tree, |element, out| {
            let c = of.graph.contacts[element];
            let inverse = &soft[c].inverse;
            let site = &of.sites.list[c];
            of.rows.add_element(&of.rows.list[c], &site.of[..site.rows], |i, j| inverse[i][j], out);
            let own: Vec<f64> = unknowns(&of.rows.list[c]).map(|unknown| scales[unknown]).collect();
            for (line, scale) in out.chunks_exact_mut(own.len()).zip(&own) {
                line.iter_mut().zip(&own).for_each(|(entry, other)| *entry *= scale * other);
            }
        })?;
        let none = Parts { r: vec![], lambda: 0.0, y: vec![], z: vec![] };
        let mut system = Self { of, metrics, soft, factors, scales, border: vec![], pivot: 0.0, by_tau: none };
        system.border = system.inverted(&of.load);
        system.pivot = sum(&of.load, &system.border);
        let cones = vec![[0.0; 3]; of.sites.cones.len()];
        system.by_tau =
            system.solve(&Parts { r: vec![0.0; of.sites.rows], lambda: -of.sense, y: of.b.clone(), z: cones });
        (system.pivot > 0.0).then_some(system)
    }

    /// (H S⁻¹ Hᵀ)⁻¹ x, but for the regularisation.
    pub fn inverted(&self, x: &[f64]) -> Vec<f64> {
        let scaled = |x: &[f64]| -> Vec<f64> { x.iter().zip(&self.scales).map(|(x, scale)| x * scale).collect() };
        let mut y = scaled(x);
        self.factors.solve(&self.of.graph.tree, &mut y);
        scaled(&y)
    }

    /// S⁻¹ x.
    pub fn softened(&self, x: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(x.len());
        for (site, soft) in self.of.sites.list.iter().zip(&self.soft) {
            out.extend(soft.times(site.part(x), site.rows));
        }
        out
    }

    /// The solution of Hᵀy − LᵀW⁻¹z = r, f₁·y = λ, H r + f₁ λ = y, −W⁻¹L r − z = z. The scaled z
    /// has an error of rounding relative to itself, where W⁻²L r would lose all digits.
    pub fn solve(&self, right: &Parts) -> Parts {
        let of = self.of;
        let mut found = self.once(right);
        for _ in 0..tuning::REFINEMENTS {
            let (pulled, of_cones) = (of.pulled(&found.y), of.sites.velocity(&self.unscaled(&found.z)));
            let balance = of.pushed(&found.r).into_iter().zip(&of.load).zip(&right.y);
            let pairs = self.in_scaled_cones(&found.r).into_iter().zip(&found.z).zip(&right.z);
            let left = Parts {
                r: pulled.iter().zip(&of_cones).zip(&right.r).map(|((y, z), right)| right - y + z).collect(),
                lambda: right.lambda - sum(&of.load, &found.y),
                y: balance.map(|((h, f), right)| right - h - f * found.lambda).collect(),
                z: pairs.map(|((own, z), right)| moved(&moved(right, 1.0, &own), 1.0, z)).collect(),
            };
            let more = self.once(&left);
            found.r.iter_mut().zip(more.r).for_each(|(r, d)| *r += d);
            found.y.iter_mut().zip(more.y).for_each(|(y, d)| *y += d);
            found.z.iter_mut().zip(more.z).for_each(|(z, d)| *z = moved(z, 1.0, &d));
            found.lambda += more.lambda;
        }
        found
    }

    /// The same without refinement.
    pub fn once(&self, right: &Parts) -> Parts {
        let own = self.of.sites.velocity(&self.unscaled(&right.z));
        let p: Vec<f64> = right.r.iter().zip(own).map(|(r, z)| r - z).collect();
        let (r, lambda, y) = self.reduced(&p, right.lambda, &right.y);
        let pairs = self.in_scaled_cones(&r).into_iter().zip(&right.z);
        let z = pairs.map(|(own, z)| moved(&own, 1.0, z).map(|x| -x)).collect();
        Parts { r, lambda, y, z }
    }

    /// W⁻¹ z.
    pub fn unscaled(&self, z: &[Point]) -> Vec<Point> {
        self.metrics.iter().zip(z).map(|(w, z)| w.inverse(z)).collect()
    }

    /// W⁻¹ L r.
    pub fn in_scaled_cones(&self, r: &[f64]) -> Vec<Point> {
        self.unscaled(&self.of.sites.change(r))
    }

    /// The solution of S r + Hᵀy = p, f₁·y = `end`, H r + f₁ λ = q, but for the regularisation.
    pub fn reduced(&self, p: &[f64], end: f64, q: &[f64]) -> (Vec<f64>, f64, Vec<f64>) {
        let of = self.of;
        let pushed = of.pushed(&self.softened(p));
        let right: Vec<f64> = pushed.iter().zip(q).map(|(h, q)| h - q).collect();
        let mut y = self.inverted(&right);
        let lambda = (end - sum(&of.load, &y)) / self.pivot;
        y.iter_mut().zip(&self.border).for_each(|(y, border)| *y += lambda * border);
        let rest: Vec<f64> = p.iter().zip(of.pulled(&y)).map(|(p, h)| p - h).collect();
        (self.softened(&rest), lambda, y)
    }

    /// The step that reduces the residual by `share` and changes the scaled pairs by `towards`, τ κ
    /// by `last`, to first order.
    pub fn step(&self, at: &Iterate, residual: &Residual, share: f64, towards: &[Point], last: f64) -> Iterate {
        let of = self.of;
        let outside = self.unscaled(&residual.z);
        let right = Parts {
            r: residual.x.iter().map(|x| -share * x).collect(),
            lambda: -share * residual.lambda,
            y: residual.y.iter().map(|y| share * y).collect(),
            z: outside.iter().zip(towards).map(|(z, x)| moved(&x.map(|x| -x), -share, z)).collect(),
        };
        let own = self.solve(&right);
        let value = |x: &Parts| of.sense * x.lambda + sum(&of.b, &x.y);
        let tau = (-share * residual.tau - last / at.tau - value(&own)) / (value(&self.by_tau) - at.kappa / at.tau);
        let with = |own: &[f64], more: &[f64]| own.iter().zip(more).map(|(own, more)| own + tau * more).collect();
        let scaled: Vec<Point> = own.z.iter().zip(&self.by_tau.z).map(|(z, more)| moved(z, tau, more)).collect();
        let r: Vec<f64> = with(&own.r, &self.by_tau.r);
        let s = of.sites.change(&r).into_iter().zip(&residual.z).map(|(own, z)| moved(&own, -share, z)).collect();
        Iterate {
            r,
            lambda: own.lambda + tau * self.by_tau.lambda,
            y: with(&own.y, &self.by_tau.y),
            s,
            z: self.unscaled(&scaled),
            tau,
            kappa: (last - at.kappa * tau) / at.tau,
        }
    }
}
