//! Iterations along the central path, to the optimum or to a proof that there is none.

use super::iterate::{Iterate, Residual};
use super::programme::{LimitLoad, Programme, most, sum};
use super::system::System;
use crate::solver::interior::cones::{Point, dot, eigenvalues, moved, product, reach};
use crate::solver::tuning::{TO_THE_BOUNDARY, defaults, limit_load as tuning};

impl Programme {
    /// The outcome at the end of the central path, and whether it would be the same without the cap
    /// on the strengths.
    pub fn solve(&self) -> (LimitLoad, bool) {
        let cones = self.sites.cones.len();
        let e = [1.0, 0.0, 0.0];
        let mut at = Iterate {
            r: vec![0.0; self.sites.rows],
            lambda: 0.0,
            y: vec![0.0; self.rows.unknowns],
            s: vec![e; cones],
            z: vec![e; cones],
            tau: 1.0,
            kappa: 1.0,
        };
        // the best score, its error, its factors, and whether no cap matters there
        let mut best = (f64::INFINITY, f64::INFINITY, LimitLoad::Undecided, false);
        let mut since = 0;
        for _ in 0..defaults::MAX_ITERATIONS {
            let residual = self.residual(&at);
            if let Some(proved) = self.proved(&at, &residual) {
                // larger cones are no less unbounded
                let holds = proved == LimitLoad::Unbounded;
                return (proved, holds);
            }
            let (error, apart, found) = self.error(&at, &residual);
            // the factor itself may be zero
            let score = error.max(apart.min(error.sqrt()));
            since += 1;
            if score < best.0 {
                (best, since) = ((score, error, found, self.is_inside_caps(&at)), 0);
            }
            let stalled = since > tuning::PATIENCE && best.1 <= tuning::ACCEPT;
            if stalled || error.max(apart) <= tuning::TOLERANCE {
                break;
            }
            let Some(next) = self.next(&at, &residual) else { break };
            at = next;
        }
        if best.1 <= tuning::ACCEPT { (best.2, best.3) } else { (LimitLoad::Undecided, false) }
    }

    /// Whether the reactions of all bonds of capped strength are inside their cones, by the least
    /// strength or more.
    fn is_inside_caps(&self, at: &Iterate) -> bool {
        let mut capped = self.sites.list.iter().zip(&self.rows.list).filter(|(_, row)| row.shift >= self.cap);
        capped.all(|(site, row)| {
            let far = row.shift / tuning::SPREAD / self.force * at.tau;
            let cones = self.sites.cones_at(site).iter().zip(&at.s[site.cones.clone()]);
            cones.into_iter().all(|(cone, s)| eigenvalues(s)[1] >= far * cone.slope)
        })
    }

    /// The error of a point as a solution, relative to the loads; the difference of its two factors
    /// relative to them; and the factors.
    fn error(&self, at: &Iterate, residual: &Residual) -> (f64, f64, LimitLoad) {
        let [primal, dual] = [self.sense * at.lambda, -sum(&self.b, &at.y)].map(|value| value / at.tau);
        let size = 1.0 + primal.abs();
        let balance = most(&residual.y) / at.tau / (1.0 + most(&self.b) + primal.abs());
        let cone = residual.z.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs())) / at.tau / size;
        let mechanism = most(&residual.x).max(residual.lambda.abs()) / at.tau;
        let apart = (primal - dual).abs();
        let error = balance.max(cone).max(mechanism).max(apart / size);
        // to maximise λ is to minimise −λ
        let [lower, upper] = if self.sense < 0.0 { [-primal, -dual] } else { [dual, primal] };
        let found = LimitLoad::Factor { lower: lower * self.unit, upper: upper * self.unit };
        if error.is_finite() {
            (error, apart / primal.abs(), found)
        } else {
            (f64::INFINITY, f64::INFINITY, LimitLoad::Undecided)
        }
    }

    /// A proof that there is no optimum.
    fn proved(&self, at: &Iterate, residual: &Residual) -> Option<LimitLoad> {
        // reactions in the cones that balance a growing load alone
        let gain = -self.sense * at.lambda;
        if gain > 0.0 {
            let net = self.pushed(&at.r).into_iter().zip(&self.load).map(|(h, f)| h + f * at.lambda);
            let outside = residual.z.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
            if net.fold(outside, |most, value| most.max(value.abs())) <= tuning::CERTIFICATE * gain {
                return Some(LimitLoad::Unbounded);
            }
        }
        // a mechanism, with its velocities y, on which the loads do work at every λ
        let work = -sum(&self.b, &at.y);
        let least = tuning::CERTIFICATE * work;
        let proved = work > 0.0 && sum(&self.load, &at.y).abs() <= least && self.outside_duals(&at.y) <= least;
        proved.then_some(LimitLoad::NeverBalanced)
    }

    /// By how much the velocities of contacts that y gives are outside the dual cones at most,
    /// where reactions do no work: Σ slope ‖u_k‖ − u_n. The duals z are not asked: where bodies
    /// part freely y is large, and z differs from it by its round-off.
    fn outside_duals(&self, y: &[f64]) -> f64 {
        let pulled = self.pulled(y);
        let in_cones = self.sites.change(&pulled);
        let outside = self.sites.list.iter().map(|site| {
            let own = self.sites.cones_at(site).iter().zip(&in_cones[site.cones.clone()]);
            own.map(|(cone, [_, a, b])| cone.slope * a.hypot(*b)).sum::<f64>() - pulled[site.at]
        });
        outside.fold(0.0, f64::max)
    }

    /// The next point; none if no step can be computed.
    fn next(&self, at: &Iterate, residual: &Residual) -> Option<Iterate> {
        let system = System::of(self, at)?;
        let centre = at.s.iter().zip(&at.z).map(|(s, z)| dot(s, z)).sum::<f64>() + at.tau * at.kappa;
        let mu = centre / (self.sites.cones.len() + 1) as f64;
        // predictor
        let scaled: Vec<Point> = system.metrics.iter().zip(&at.z).map(|(w, z)| w.times(z)).collect();
        let towards: Vec<Point> = scaled.iter().map(|x| x.map(|x| -x)).collect();
        let guess = system.step(at, residual, 1.0, &towards, -at.tau * at.kappa);
        let far = length(at, &guess);
        // corrector
        let sigma = (1.0 - far) * (1.0 - far) * (1.0 - far);
        let pairs = scaled.iter().zip(&system.metrics).zip(guess.s.iter().zip(&guess.z));
        let towards: Vec<Point> = pairs
            .map(|((x, w), (ds, dz))| {
                let second = product(&w.inverse(ds), &w.times(dz));
                let square = product(x, x);
                divided(&[sigma * mu - square[0] - second[0], -square[1] - second[1], -square[2] - second[2]], x)
            })
            .collect();
        let last = sigma * mu - at.tau * at.kappa - guess.tau * guess.kappa;
        let step = system.step(at, residual, 1.0 - sigma, &towards, last);
        let far = (TO_THE_BOUNDARY * length(at, &step)).min(1.0);
        let by = |x: &[f64], d: &[f64]| x.iter().zip(d).map(|(x, d)| x + far * d).collect();
        let cones = |x: &[Point], d: &[Point]| x.iter().zip(d).map(|(x, d)| moved(x, far, d)).collect();
        let next = Iterate {
            r: by(&at.r, &step.r),
            lambda: at.lambda + far * step.lambda,
            y: by(&at.y, &step.y),
            s: cones(&at.s, &step.s),
            z: cones(&at.z, &step.z),
            tau: at.tau + far * step.tau,
            kappa: at.kappa + far * step.kappa,
        };
        let inside = |x: &Point| eigenvalues(x)[1] > 0.0;
        let sound = next.tau > 0.0 && next.kappa > 0.0 && next.s.iter().chain(&next.z).all(inside);
        (sound && next.lambda.is_finite()).then_some(next)
    }
}

/// The longest step, at most 1, that stays inside.
fn length(at: &Iterate, step: &Iterate) -> f64 {
    let ray = |x: f64, d: f64| if d < 0.0 { -x / d } else { f64::INFINITY };
    let pairs = at.s.iter().zip(&step.s).chain(at.z.iter().zip(&step.z));
    let far = pairs.map(|(x, d)| reach(x, d)).fold(1.0, f64::min);
    far.min(ray(at.tau, step.tau)).min(ray(at.kappa, step.kappa))
}

/// x with λ ∘ x = v.
fn divided(v: &Point, by: &Point) -> Point {
    let [high, low] = eigenvalues(by);
    let first = (by[0] * v[0] - by[1] * v[1] - by[2] * v[2]) / (high * low);
    [first, (v[1] - first * by[1]) / by[0], (v[2] - first * by[2]) / by[0]]
}
