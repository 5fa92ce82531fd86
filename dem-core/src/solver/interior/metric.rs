//! The metric 1/ρ: a compliance that selects among the reactions that balance a load.

use super::sites::{ROWS, Sites};
use super::state::State;

/// A compliance, and the anchor to which it draws the reactions.
pub(super) struct Metric {
    pub anchor: Vec<f64>,
    /// The compliance of the metric for each row; the same plus that of elastic bonds.
    pub own: Vec<f64>,
    pub compliance: Vec<f64>,
}

impl Metric {
    pub fn new(sites: &Sites, anchor: Vec<f64>, kappa: f64) -> Self {
        let own: Vec<f64> = sites.metric.iter().map(|w| w / kappa).collect();
        let compliance = own.iter().zip(&sites.compliance).map(|(own, c)| own + c).collect();
        Self { anchor, own, compliance }
    }

    /// Set a new anchor, and multiply the compliance of the metric by `share`.
    pub fn anchor_at(&mut self, anchor: Vec<f64>, share: f64) {
        self.anchor = anchor;
        for (c, own) in self.compliance.iter_mut().zip(&mut self.own) {
            *c += (share - 1.0) * *own;
            *own *= share;
        }
    }

    /// The residual and the largest velocity of a contact that are due to the compliance, by
    /// u = (r − r_a)/ρ. For the residual u is divided by the normal entry of W, which makes it an
    /// impulse. If the flow is not associated, the law adds μ times the slip to the normal
    /// velocity.
    pub fn left(&self, sites: &Sites, r: &[f64]) -> (f64, f64) {
        let (mut all, mut largest) = (0.0, 0.0f64);
        for (site, normal) in sites.list.iter().zip(&sites.normal).filter(|(_, normal)| **normal > 0.0) {
            let mut u = [0.0; ROWS];
            for (k, u) in (site.at..site.at + site.rows).zip(&mut u) {
                *u = self.own[k] * (r[k] - self.anchor[k]);
            }
            for cone in sites.cones[site.cones.clone()].iter().filter(|cone| !cone.acts_on_normal) {
                let slip = cone.rows[..cone.tangents].iter().map(|row| u[*row] * u[*row]).sum::<f64>();
                u[0] += cone.slope * slip.sqrt();
            }
            let square = u.iter().map(|u| u * u).sum::<f64>();
            (all, largest) = (all + square / (normal * normal), largest.max(square));
        }
        let size = r.iter().map(|r| r * r).sum::<f64>();
        (if all == 0.0 { 0.0 } else { (all / size).sqrt() }, largest.sqrt())
    }

    /// Σ r²/ρ.
    pub fn weight(&self, r: &[f64]) -> f64 {
        r.iter().zip(&self.own).map(|(r, c)| c * r * r).sum()
    }

    /// Σ (r − r_a)²/ρ, with the anchor r_a.
    pub fn energy(&self, r: &[f64]) -> f64 {
        r.iter().zip(&self.anchor).zip(&self.own).map(|((r, r0), c)| c * (r - r0) * (r - r0)).sum()
    }
}

/// ℓ = u + C (r − r₀) + (r − r_a)/ρ − Σ Bᵀ z, for the relative velocities u.
pub(super) fn lack(sites: &Sites, velocity: &[f64], at: &State, metric: &Metric) -> Vec<f64> {
    let opened = sites.velocity(&at.z);
    let row = |k: usize| {
        let soft = sites.compliance[k] * (at.r[k] - sites.carried[k]) + metric.own[k] * (at.r[k] - metric.anchor[k]);
        velocity[k] + soft - opened[k]
    };
    (0..sites.rows).map(row).collect()
}
