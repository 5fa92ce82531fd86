//! The interior-point method, with Coulomb's law exact.
//!
//! Every contact is a list of cone pairs ([`sites`]): x = G r̂ ∈ Q ⊥ z ∈ Q with
//! u + C (r − r₀) = Σ Bᵀ z and u = W r + q. The method follows the central path x ∘ z = τ e to the
//! barrier parameter τ = 0. The path is linearised completely, slip speeds included. The direction
//! is that of Alizadeh, Haeberly & Overton, or of Nesterov & Todd for a pair whose product has left
//! the cone. An iteration is Mehrotra's predictor–corrector with Gondzio's correctors, and takes
//! one factorisation.
//!
//! The metric 1/ρ is a compliance anchored at given reactions r_a. Among the many reactions that
//! balance a rigid network the path ends at the minimum-energy ones, of least Σ (r − r_a)²/ρ. See
//! docs/theory/interior-point.md.
//!
//! Sources: Alizadeh, Haeberly & Overton, SIAM J. Optim. 8, 1998; Nesterov & Todd, SIAM J. Optim.
//! 8, 1998; Mehrotra, SIAM J. Optim. 2, 1992; Gondzio, Comput. Optim. Appl. 6, 1996; for contact
//! with friction Acary, Armand, Nguyen & Shpakovych, Optim. Methods Softw. 39, 2024.

mod aims;
pub(super) mod cones;
mod continuation;
mod coupling;
mod direction;
mod follow;
mod limits;
mod local;
mod metric;
mod pairs;
mod selection;
pub(super) mod sites;
mod start;
mod state;
mod system;
mod violation;

use crate::contact::Padded;
use crate::linear::Factors;
use crate::solver::graph::Graph;
use crate::solver::rows::Rows;
use crate::solver::solvable::Solvable;
use coupling::Coupling;
use follow::Follow;
use local::{invert, scaled};
use metric::{Metric, lack};
use selection::{Next, Selection};
use sites::Sites;
use start::{cold, warm};
use state::State;
use std::sync::Arc;
use system::System;

pub(super) use aims::{Aims, Found};
pub(super) use violation::Least;

/// The method, with buffers kept between solves.
#[derive(Default)]
pub(super) struct Interior {
    factors: Factors,
    inverses: Vec<f64>,
    /// Factorisations so far.
    pub made: u64,
}

impl Interior {
    /// Follow the central path to a solution, from the reactions `start` moved inside their cones,
    /// or else from a cold start. If many reactions solve the problem, the solution has minimum
    /// energy in the metric anchored at `anchor` ([`Selection`]). `graph` is that of the last
    /// problem.
    pub fn solve(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        graph: &mut Option<Arc<Graph>>,
        anchor: &[Padded],
        start: Option<&[Padded]>,
        aims: Aims,
    ) -> Option<Found> {
        let sites = Sites::of(rows, start.unwrap_or(anchor));
        let graph = if problem.matrix().is_none() { Graph::of(rows, graph) } else { None };
        let coupling = Coupling::of(rows, problem.matrix(), graph.as_deref(), &sites, sites.speed / sites.force)?;
        let begun = match start {
            Some(reactions) => warm(&sites, &coupling, &sites.gathered(reactions)),
            None => cold(&sites, aims.far),
        };
        let mut selection = Selection::new(&sites, sites.gathered(anchor), aims);
        let mut follow = Follow::from(begun);
        for iteration in 0..=aims.most {
            let at = follow.state();
            match selection.assess(problem, &sites, (&at, follow.is_on_path()), iteration) {
                Next::Arrived => break,
                Next::Onwards => {}
                Next::Anchored(turn) => {
                    follow.turn_back(turn, &sites);
                    continue;
                }
            }
            let Some(system) = self.factorised(&sites, &coupling, &at, &selection.metric) else { break };
            let in_long_steps = follow.is_in_long_steps();
            let Some(change) = follow.step(&system, &sites) else { break };
            selection.change = system.change(&change);
            let has_jammed = in_long_steps && !follow.is_in_long_steps();
            if has_jammed && selection.ends_at_nearest(problem, &sites) {
                break;
            }
        }
        selection.found(problem, &sites)
    }

    /// The linear system at a point, factorised; none if it is singular to round-off.
    fn factorised<'a>(
        &'a mut self,
        sites: &'a Sites,
        coupling: &'a Coupling<'a>,
        at: &'a State,
        metric: &'a Metric,
    ) -> Option<System<'a>> {
        let relative = coupling.relative_velocity(sites, &at.r);
        let right = lack(sites, &relative, at, metric).into_iter().map(|x| -x).collect();
        let velocity = relative.iter().zip(&sites.free).map(|(u, q)| u - q).collect();
        let pairs = scaled(at);
        let locally = invert(sites, &pairs, &metric.compliance, &mut self.inverses)?;
        self.made += 1;
        let globally = coupling.factorise(sites, &self.inverses, &mut self.factors)?;
        let (compliance, inverses, factors) = (&metric.compliance[..], &self.inverses[..], &self.factors);
        Some(System {
            sites,
            coupling,
            at,
            velocity,
            right,
            pairs,
            compliance,
            inverses,
            factors,
            sign: locally * globally,
        })
    }
}
