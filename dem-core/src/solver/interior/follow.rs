//! Path following: long steps within a wide neighbourhood of the central path, and arc-length
//! continuation where these jam.
//!
//! The reaction and the velocity of a fast sliding contact are both on the boundary of their cones.
//! In x·z the term x₀ z₀ and the others cancel, with a round-off of ε x₀ z₀. Long steps end where
//! this is comparable to the complementarity gap. The arc-length continuation represents a pair by
//! w = x − z, whose eigenvalues keep their digits: its pairs are central to round-off.

use super::continuation::{Continuation, Progress};
use super::direction::{advance, direction, is_central, is_rounded};
use super::sites::Sites;
use super::start::cold;
use super::state::{State, gap};
use super::system::System;
use crate::solver::tuning::{PATIENCE, PROGRESS, SHORTEST, TO_THE_BOUNDARY, direction as steps, follow as tuning};

/// The current point, and how the path is followed from it.
pub(super) struct Follow {
    at: State,
    /// Consecutive steps without progress.
    stuck: u64,
    straight: f64,
    /// Whether round-off shows in the directions.
    rough: bool,
    by_arc_length: Option<ByArcLength>,
    /// Whether round-off has ended the long steps.
    round_off_reached: bool,
}

struct ByArcLength {
    continuation: Continuation,
    /// How often the barrier has been raised to find the path.
    raised: i32,
}

impl Follow {
    /// Follow in long steps, from a point inside all cones.
    pub fn from(at: State) -> Self {
        Self { at, stuck: 0, straight: tuning::STRAIGHT, rough: false, by_arc_length: None, round_off_reached: false }
    }

    /// The current point.
    pub fn state(&self) -> State {
        self.by_arc_length.as_ref().map_or_else(|| self.at.clone(), |by| by.continuation.state())
    }

    /// Whether the path is followed in long steps, which have not jammed.
    pub fn is_in_long_steps(&self) -> bool {
        self.by_arc_length.is_none()
    }

    /// Whether the current point is next to the path: always in long steps.
    pub fn is_on_path(&self) -> bool {
        self.by_arc_length.as_ref().is_none_or(|by| by.continuation.is_on_path())
    }

    /// Continue from an earlier point of the path.
    pub fn turn_back(&mut self, to: State, sites: &Sites) {
        let by_arc_length = self.by_arc_length.take().is_some();
        self.stuck = 0;
        self.at = to;
        if by_arc_length {
            self.jam(1.0);
            return;
        }
        self.at.x = sites.primal(&self.at.r);
        if !is_central(&self.at) {
            self.jam(tuning::RAISED);
        }
    }

    /// One iteration, with the system at the current point. Returns the change of the reactions;
    /// none if the path is lost.
    pub fn step(&mut self, system: &System, sites: &Sites) -> Option<Vec<f64>> {
        let Some(by) = &mut self.by_arc_length else { return Some(self.long_step(system)) };
        let progress = by.continuation.step(system, sites);
        let now = by.continuation.state();
        let r = now.r.iter().zip(&system.at.r).map(|(now, before)| now - before).collect();
        match progress {
            Progress::Path => {}
            Progress::Straight => {
                let x = sites.primal(&now.r);
                let inside = State { x, ..now };
                if !self.round_off_reached && is_central(&inside) {
                    (self.at, self.by_arc_length) = (inside, None);
                }
            }
            Progress::Lost => self.raise(sites)?,
        }
        Some(r)
    }

    /// A predictor–corrector step.
    fn long_step(&mut self, system: &System) -> Vec<f64> {
        let (mut step, far) = direction(system, &mut self.rough);
        let mut length = (TO_THE_BOUNDARY * far).min(1.0);
        let end = |length: f64| {
            let mut end = system.at.clone();
            advance(&mut end, length, &step);
            end
        };
        let mut next = end(length);
        while length > SHORTEST && !is_central(&next) {
            length *= steps::SHORTER;
            next = end(length);
        }
        let left = gap(&next) / gap(system.at);
        self.stuck = if left <= PROGRESS { 0 } else { self.stuck + 1 };
        self.at = next;
        self.round_off_reached = left > 0.5 && is_rounded(&self.at);
        if self.round_off_reached {
            self.jam(1.0);
        } else if self.stuck == PATIENCE {
            self.stuck = 0;
            self.straight *= 0.5;
            self.jam(tuning::RAISED);
        }
        step.r.iter_mut().for_each(|r| *r *= length);
        step.r
    }

    /// Seek the path by arc length, from the current point.
    fn jam(&mut self, raised: f64) {
        let continuation = Continuation::new(&self.at, gap(&self.at), raised, self.straight);
        self.by_arc_length = Some(ByArcLength { continuation, raised: 1 });
    }

    /// The same with a higher barrier, and finally from a cold start; none after that.
    fn raise(&mut self, sites: &Sites) -> Option<()> {
        let raised = self.by_arc_length.as_ref().map_or(0, |by| by.raised) + 1;
        let below = gap(&self.at);
        let continuation = if raised <= tuning::MOST_RAISED {
            Continuation::new(&self.at, below, tuning::RAISED.powi(raised), self.straight)
        } else if raised == tuning::MOST_RAISED + 1 {
            let start = cold(sites, false);
            Continuation::new(&start, below, gap(&start) / below, self.straight)
        } else {
            return None;
        };
        self.by_arc_length = Some(ByArcLength { continuation, raised });
        Some(())
    }
}
