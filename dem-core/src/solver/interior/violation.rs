//! The least violation of the contact laws over all velocities, and the impulses dual to it.
//!
//! For an associated problem without shifts,
//!
//! minimise ½ d·C d + ½ κ d·W d + q·d over d ∈ K,
//!
//! is strictly convex and has one solution. With y = κ H̃ d and u = H̃ᵀ y + q, the velocity u + C d
//! lies in K*: C d is the violation. The problem is solved again with q + κ W d in place of q. Then
//! κ W d tends to zero, and C d to the least of all violations, with H̃ d = 0 and q·d = −d·C d
//! (docs/theory/interior-point.md, "What has no solution").

use super::Interior;
use super::coupling::Coupling;
use super::direction::{advance, direction};
use super::metric::Metric;
use super::sites::Sites;
use super::start::cold;
use super::state::{State, gap};
use crate::contact::Padded;
use crate::problem::assembled::BlockMatrix;
use crate::solver::graph::Graph;
use crate::solver::rows::Rows;
use crate::solver::tuning::{STIFF, TO_THE_BOUNDARY, defaults, violation as tuning};

/// The least violation.
pub(in crate::solver) struct Least {
    /// d, in the unit of the rows' reactions.
    pub direction: Vec<Padded>,
    /// The reactions that give the bodies their velocities, in the same unit.
    pub reactions: Vec<Padded>,
}

impl Interior {
    /// The least violation of an associated problem without shifts; none if no elimination tree can
    /// be made.
    pub fn least_violation(&mut self, rows: &Rows, matrix: Option<&BlockMatrix>) -> Option<Least> {
        let mut sites = Sites::of(rows, &[]);
        let ratio = sites.speed / (sites.force * STIFF);
        let graph = if matrix.is_none() { Graph::of(rows, &mut None) } else { None };
        let coupling = Coupling::of(rows, matrix, graph.as_deref(), &sites, ratio)?;
        let metric = Metric::new(&sites, vec![0.0; sites.rows], 1.0);
        let mut reactions = vec![0.0; sites.rows];
        let mut at = State::default();
        for _ in 0..tuning::ROUNDS {
            at = self.of_a_round(&sites, &coupling, &metric);
            let moved = coupling.velocity(&sites, &at.r);
            sites.free.iter_mut().zip(&moved).for_each(|(q, u)| *q += u);
            reactions.iter_mut().zip(&at.r).for_each(|(sum, d)| *sum += STIFF * d);
        }
        Some(Least { direction: sites.scattered(&at.r), reactions: sites.scattered(&reactions) })
    }

    /// The end of the central path of one multiplier iteration.
    fn of_a_round(&mut self, sites: &Sites, coupling: &Coupling, metric: &Metric) -> State {
        let (mut at, mut rough) = (cold(sites, false), false);
        for _ in 0..defaults::MAX_ITERATIONS {
            if gap(&at) <= tuning::LEAST_GAP {
                break;
            }
            let Some(system) = self.factorised(sites, coupling, &at, metric) else { break };
            let (step, far) = direction(&system, &mut rough);
            advance(&mut at, (TO_THE_BOUNDARY * far).min(1.0), &step);
        }
        at
    }
}
