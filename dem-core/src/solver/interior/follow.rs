//! How the path is followed: in long steps within a wide neighbourhood, and by arc length where these jam.

use super::continuation::{Continuation, Progress};
use super::direction::{advance, direction, is_central};
use super::local::{State, gap};
use super::sites::Sites;
use super::start::cold;
use super::system::System;

/// How near the boundary a step may go, and by which factor it is shortened until its end is central.
const NEAR: f64 = 0.99;
const SHORTER: f64 = 0.8;
const SHORTEST: f64 = 1e-3;
/// A step shorter than this is short, and the path jams where so many follow each other.
const SHORT: f64 = 0.1;
const JAMMED: u32 = 2;
/// By how much the barrier is above the gap of a jam where the path is looked for by arc length, and how often it is raised so.
const RAISED: f64 = 10.0;
const MOST_RAISED: i32 = 2;
/// Relative change with θ up to which the path counts as straight: this factor at each jam times this.
const STRAIGHT: f64 = 4.0;
const STRAIGHTER: f64 = 0.5;

/// Where the path is, and how it is followed.
pub(super) struct Follow {
    at: State,
    /// Short steps in a row.
    short: u32,
    straight: f64,
    by_arc_length: Option<ByArcLength>,
}

struct ByArcLength {
    continuation: Continuation,
    /// How often the barrier has been raised to find the path.
    raised: i32,
}

impl Follow {
    /// In long steps, from a point within all cones.
    pub fn from(at: State) -> Self {
        Self { at, short: 0, straight: STRAIGHT, by_arc_length: None }
    }

    /// The point at hand.
    pub fn state(&self) -> State {
        self.by_arc_length.as_ref().map_or_else(|| self.at.clone(), |by| by.continuation.state())
    }

    /// Go on from a point that was passed.
    pub fn turn_back(&mut self, to: State, sites: &Sites) {
        let by_arc_length = self.by_arc_length.take().is_some();
        self.short = 0;
        self.at = to;
        if by_arc_length {
            self.jam(1.0);
            return;
        }
        self.at.x = sites.primal(&self.at.r);
        if !is_central(&self.at) {
            self.jam(RAISED);
        }
    }

    /// One iteration, with the system at the point at hand; its change of the reactions, none where the path is lost.
    pub fn step(&mut self, system: &System, sites: &Sites) -> Option<State> {
        let Some(by) = &mut self.by_arc_length else { return Some(self.long_step(system)) };
        let progress = by.continuation.step(system, sites);
        let now = by.continuation.state();
        let r = now.r.iter().zip(&system.at.r).map(|(now, before)| now - before).collect();
        match progress {
            Progress::Path => {}
            Progress::Straight => {
                let x = sites.primal(&now.r);
                let inside = State { x, ..now };
                if is_central(&inside) {
                    (self.at, self.by_arc_length) = (inside, None);
                }
            }
            Progress::Lost => self.raise(sites)?,
        }
        Some(State { r, ..State::default() })
    }

    /// A predictor–corrector step.
    fn long_step(&mut self, system: &System) -> State {
        let (mut step, far) = direction(system);
        let mut length = (NEAR * far).min(1.0);
        let end = |length: f64| {
            let mut end = system.at.clone();
            advance(&mut end, length, &step);
            end
        };
        let mut next = end(length);
        while length > SHORTEST && !is_central(&next) {
            length *= SHORTER;
            next = end(length);
        }
        self.short = if length > SHORT { 0 } else { self.short + 1 };
        self.at = next;
        if self.short == JAMMED {
            self.short = 0;
            self.straight *= STRAIGHTER;
            self.jam(RAISED);
        }
        step.r.iter_mut().for_each(|r| *r *= length);
        step
    }

    /// Look for the path by arc length, from the point at hand.
    fn jam(&mut self, raised: f64) {
        let continuation = Continuation::new(&self.at, gap(&self.at), raised, self.straight);
        self.by_arc_length = Some(ByArcLength { continuation, raised: 1 });
    }

    /// The same with a higher barrier; from a cold start at last.
    fn raise(&mut self, sites: &Sites) -> Option<()> {
        let raised = self.by_arc_length.as_ref().map_or(0, |by| by.raised) + 1;
        let below = gap(&self.at);
        let continuation = if raised <= MOST_RAISED {
            Continuation::new(&self.at, below, RAISED.powi(raised), self.straight)
        } else if raised == MOST_RAISED + 1 {
            let start = cold(sites);
            Continuation::new(&start, below, gap(&start) / below, self.straight)
        } else {
            return None;
        };
        self.by_arc_length = Some(ByArcLength { continuation, raised });
        Some(())
    }
}
