//! The metric 1/ρ: a compliance that selects one of many reactions.

use super::local::{State, opened};
use super::sites::Sites;

/// A compliance that draws reactions to given ones.
pub(super) struct Metric {
    pub anchor: Vec<f64>,
    /// Of each row, and with that of elastic bonds.
    pub own: Vec<f64>,
    pub compliance: Vec<f64>,
}

impl Metric {
    pub fn new(sites: &Sites, anchor: Vec<f64>, kappa: f64) -> Self {
        let own: Vec<f64> = sites.metric.iter().map(|w| w / kappa).collect();
        let compliance = own.iter().zip(&sites.compliance).map(|(own, c)| own + c).collect();
        Self { anchor, own, compliance }
    }

    /// Draw to these reactions, by this share of the compliance.
    pub fn anchor_at(&mut self, anchor: Vec<f64>, share: f64) {
        self.anchor = anchor;
        for (c, own) in self.compliance.iter_mut().zip(&mut self.own) {
            *c += (share - 1.0) * *own;
            *own *= share;
        }
    }

    /// What the compliance leaves of the residual: the norm of (r − r₀)/ρ over that of r, where the mean normal entry of W is one.
    pub fn residual(&self, r: &[f64]) -> f64 {
        let soft = r.iter().zip(&self.anchor).zip(&self.own).map(|((r, r0), c)| (c * (r - r0)).powi(2)).sum::<f64>();
        let size = r.iter().map(|r| r * r).sum::<f64>();
        if soft == 0.0 { 0.0 } else { (soft / size).sqrt() }
    }

    /// Σ r²/ρ.
    pub fn weight(&self, r: &[f64]) -> f64 {
        r.iter().zip(&self.own).map(|(r, c)| c * r * r).sum()
    }

    /// Σ (r − r₀)²/ρ.
    pub fn energy(&self, r: &[f64]) -> f64 {
        r.iter().zip(&self.anchor).zip(&self.own).map(|((r, r0), c)| c * (r - r0) * (r - r0)).sum()
    }
}

/// u + C (r − r₀) − Σ Bᵀ z, with the metric among the compliances.
pub(super) fn lack(sites: &Sites, weight: &[f64], at: &State, metric: &Metric) -> Vec<f64> {
    let opened = opened(sites, &at.z);
    let row = |k: usize| {
        let soft = sites.compliance[k] * (at.r[k] - sites.carried[k]) + metric.own[k] * (at.r[k] - metric.anchor[k]);
        sites.free[k] + weight[k] + soft - opened[k]
    };
    (0..sites.rows).map(row).collect()
}
