//! Selection among many reactions: the minimum-energy reactions r* in the metric. Elastic bonds
//! have no metric: their own compliance determines their reactions.
//!
//! 1. With the compliance of the metric the path is followed until the complementarity gaps are far
//!    below the energy of the metric. The reactions are then r*, and the limits of r* are known.
//! 2. If the compliance takes much of the tolerance of the residual or of the velocity error, as
//!    between bodies of very different masses, the path is followed again with the metric anchored
//!    at r*, then with stiffer metrics. It starts from an earlier point of the path, since steps
//!    near the boundary are short.
//! 3. Where the path jams before that, its point of least gap is the result if it is a solution and
//!    its gaps and its energy are far below Σ r²/ρ.

use super::aims::{Aims, Found};
use super::limits::Limit;
use super::metric::Metric;
use super::sites::Sites;
use super::state::{State, gap};
use crate::contact::Reached;
use crate::solver::solvable::Solvable;
use crate::solver::tuning::{KAPPA, SHARE, defaults, selection as tuning};

/// How the path continues at a point.
pub(super) enum Next {
    /// The point is a solution, or no better one will follow.
    Arrived,
    /// The path continues.
    Onwards,
    /// The metric has a new anchor: the path continues from this point.
    Anchored(State),
}

/// The state of the selection, and the best point so far.
pub(super) struct Selection {
    aims: Aims,
    pub metric: Metric,
    best: Option<Found>,
    /// Relative [change](super::system::System::change) of the reactions in the last iteration (–).
    pub change: f64,
    /// The limits of r*, once it is known, and the sum of the complementarity gaps up to which a
    /// solution counts.
    limits: Option<Vec<Limit>>,
    /// What of them the contacts have reached, if the compliance leaves r* accurate.
    reached: Option<Vec<Option<Reached>>>,
    enough: f64,
    turn: Option<State>,
    anchored: u32,
    /// The unmeasured point of least gap: the sum of its complementarity gaps, the relative change
    /// of the reactions in the iteration that led to it, and the point.
    nearest: Option<(f64, f64, State)>,
    iterations: u64,
}

impl Selection {
    pub fn new(sites: &Sites, anchor: Vec<f64>, aims: Aims) -> Self {
        // the selection is the same for all tolerances
        let kappa = match aims {
            Aims { least: true, .. } => KAPPA,
            Aims { far: true, .. } => tuning::STIFFEST,
            _ => (1.0 / (SHARE * aims.tolerance)).clamp(KAPPA, tuning::STIFFEST),
        };
        let metric = Metric::new(sites, anchor, kappa);
        let limits = (!aims.least).then(Vec::new);
        Self {
            aims,
            metric,
            best: None,
            change: 1.0,
            limits,
            reached: None,
            enough: f64::INFINITY,
            turn: None,
            anchored: 0,
            nearest: None,
            iterations: 0,
        }
    }

    /// Measure a point, and decide how the path continues. Only a point `on_path` can be r*.
    pub fn assess(
        &mut self,
        problem: &mut impl Solvable,
        sites: &Sites,
        (at, on_path): (&State, bool),
        iteration: u64,
    ) -> Next {
        let gaps = gap(at) * at.x.len() as f64;
        // reactions that hardly differ from the anchor are known well enough
        let energy = self.metric.energy(&at.r).max(tuning::LEAST * self.metric.weight(&at.r));
        let least = tuning::LEAST * energy;
        if self.limits.is_none() && gaps <= least && on_path {
            self.know(sites, at, least);
        }
        let selected = self.limits.is_some() && gaps <= self.enough;
        self.iterations = iteration;
        // a point far from the minimum-energy reactions is no solution: it is measured only if the
        // path ends without one
        if !selected && self.nearest.as_ref().is_none_or(|(least, ..)| gaps < *least) {
            self.nearest = Some((gaps, self.change, at.clone()));
        }
        let mut solved = selected && self.measure(problem, sites, at, false) <= 1.0;
        if selected && self.aims.least {
            // reactions near r* need not be at its limits
            solved |= self.measure(problem, sites, at, true) <= 1.0;
        }
        // a gap at round-off cannot fall further
        let exhausted = gaps.is_nan() || gap(at) <= tuning::LEAST_GAP || iteration == self.aims.most;
        if solved || exhausted {
            return Next::Arrived;
        }
        if gaps <= tuning::BACK * energy && self.turn.is_none() && on_path {
            self.turn = Some(at.clone());
        }
        match &self.turn {
            Some(turn) if gaps <= least && on_path && self.metric_shows(sites, at) => {
                if self.anchored == tuning::MOST_ANCHORED {
                    return Next::Arrived;
                }
                // where r* counts the same metric once more, then stiffer ones
                let share = if self.aims.least && self.anchored == 0 { 1.0 } else { tuning::HARDER };
                self.metric.anchor_at(at.r.clone(), share);
                self.enough *= share;
                self.anchored += 1;
                Next::Anchored(turn.clone())
            }
            _ => Next::Onwards,
        }
    }

    /// Take a point as r*: its limits are known, and gaps up to `enough` count.
    fn know(&mut self, sites: &Sites, at: &State, enough: f64) {
        let limits = sites.limits(at, &self.metric.compliance);
        let is_accurate = self.metric.left(sites, &at.r).0 <= 0.5 * defaults::TOLERANCE;
        self.reached = is_accurate.then(|| sites.reached(at, &limits));
        (self.limits, self.enough) = (Some(limits), enough);
    }

    /// Take no point as r* any more.
    fn forget(&mut self) {
        (self.limits, self.reached, self.enough) = (None, None, f64::INFINITY);
        self.best.iter_mut().for_each(|best| best.reached.clear());
    }

    /// Where the path has jammed: whether its point of least gap is a solution whose reactions
    /// hardly differ from the anchor. They would require gaps near round-off, at which it jams.
    pub fn ends_at_nearest(&mut self, problem: &mut impl Solvable, sites: &Sites) -> bool {
        if self.limits.is_some() {
            return false;
        }
        let Some((gaps, change, nearest)) = self.nearest.take() else { return false };
        let enough = tuning::LEAST * self.metric.weight(&nearest.r);
        let last = std::mem::replace(&mut self.change, change);
        if gaps.max(self.metric.energy(&nearest.r)) <= enough {
            self.know(sites, &nearest, enough);
            let missed = [false, true].map(|known| self.measure(problem, sites, &nearest, known));
            if missed.iter().any(|missed| *missed <= 1.0) {
                return true;
            }
            self.forget();
        }
        (self.change, self.nearest) = (last, Some((gaps, change, nearest)));
        false
    }

    /// The best point, or the unmeasured point of least gap if no measured one is a solution and
    /// that one misses less.
    pub fn found(mut self, problem: &mut impl Solvable, sites: &Sites) -> Option<Found> {
        if self.best.as_ref().is_none_or(|best| best.missed(self.aims) > 1.0)
            && let Some((_, change, nearest)) = self.nearest.take()
        {
            // what was taken for r* has led to no solution
            self.change = change;
            self.forget();
            self.measure(problem, sites, &nearest, false);
        }
        self.best.map(|best| Found { iterations: self.iterations, ..best })
    }

    /// Whether the compliance of the metric takes much of the tolerance of the residual or of the
    /// velocity error.
    fn metric_shows(&self, sites: &Sites, at: &State) -> bool {
        let Aims { tolerance, load_tolerance, .. } = self.aims;
        let (residual, velocity) = self.metric.left(sites, &at.r);
        residual > 0.5 * tolerance || velocity > 0.5 * load_tolerance * sites.largest_free()
    }

    /// By which factor the reactions of a point, projected on their limits, and on those of r* if
    /// these are `known`, [miss](Aims::missed) the tolerances. The best are kept: of those within
    /// the tolerances the last, which are nearest to r*, else those that miss least.
    fn measure(&mut self, problem: &mut impl Solvable, sites: &Sites, at: &State, known: bool) -> f64 {
        let limits = self.limits.as_deref().unwrap_or_default();
        let reactions = sites.snapped(at, if known { limits } else { &[] });
        problem.write_back(&reactions);
        let (residual, velocity_error) = (problem.residual(), problem.velocity_error());
        let load_error = self.change.max(problem.elastic_error());
        let (reached, iterations) = (Vec::new(), self.iterations);
        let found = Found { reactions, reached, residual, load_error, velocity_error, iterations };
        let missed = found.missed(self.aims);
        if self.best.as_ref().is_none_or(|best| missed <= 1.0 || missed < best.missed(self.aims)) {
            let reached = match &self.reached {
                Some(reached) => reached.clone(),
                None if !limits.is_empty() => sites.reached(at, limits),
                None if sites.has_elastic() => sites.reached(at, &sites.limits(at, &self.metric.compliance)),
                None => Vec::new(),
            };
            self.best = Some(Found { reached, ..found });
        }
        missed
    }
}
