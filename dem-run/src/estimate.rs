//! The time that a run will still take, from its recent speed and its stop condition.

use std::collections::VecDeque;

/// Share of the time since the first step over which speeds are measured.
const WINDOW: f64 = 0.5;
/// Growth of the time since the first step from sample to sample.
const GROWTH: f64 = 1.01;

/// Estimates the time to the end of a run.
#[derive(Debug, Default)]
pub struct Estimate {
    /// The samples of the window and the one before it, with growing times.
    samples: VecDeque<Sample>,
}

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time since the first step (s).
    pub elapsed: f64,
    /// Simulated time (s).
    pub time: f64,
    /// Fraction of the stop condition reached (0 to 1), if the run has one.
    pub stop: Option<f64>,
}

impl Estimate {
    /// Adds a sample.
    pub fn push(&mut self, sample: Sample) {
        if self.samples.back().is_some_and(|last| sample.elapsed <= GROWTH * last.elapsed) {
            return;
        }
        self.samples.push_back(sample);
        while self.samples.get(1).is_some_and(|second| second.elapsed <= (1.0 - WINDOW) * sample.elapsed) {
            self.samples.pop_front();
        }
    }

    /// Time left (s) from `now` to the simulated time `end` (s) or to the stop condition, whichever
    /// is estimated to come first; none before there are two samples.
    #[must_use]
    pub fn left(&self, now: Sample, end: f64) -> Option<f64> {
        let first = self.samples.front().filter(|first| now.time > first.time && now.elapsed > first.elapsed)?;
        let speed = (now.time - first.time) / (now.elapsed - first.elapsed);
        let to_end = (end - now.time).max(0.0);
        Some(self.to_stop(first, now).map_or(to_end, |to_stop| to_stop.min(to_end)) / speed)
    }

    /// Simulated time to the stop condition (s), if it comes nearer. A wall that a growing force
    /// pushes moves ever faster: its travel is extrapolated with the acceleration between the two
    /// halves of the window.
    fn to_stop(&self, first: &Sample, now: Sample) -> Option<f64> {
        let middle = self.samples.iter().find(|sample| sample.time >= 0.5 * (first.time + now.time))?;
        let rate = |from: &Sample, to: &Sample| {
            let span = to.time - from.time;
            Some((to.stop? - from.stop?) / span).filter(|_| span > 0.0)
        };
        let (before, after) = (rate(first, middle)?, rate(middle, &now)?);
        let acceleration = 2.0 * (after - before) / (now.time - first.time);
        let speed = after + 0.5 * acceleration * (now.time - middle.time);
        let missing = (1.0 - now.stop?).max(0.0);
        if acceleration > 0.0 && speed >= 0.0 {
            return Some(((speed * speed + 2.0 * acceleration * missing).sqrt() - speed) / acceleration);
        }
        (after > 0.0).then(|| missing / after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The estimate of a run at `elapsed`, given where it stands at each time since its first step.
    fn estimate(elapsed: f64, end: f64, stands: impl Fn(f64) -> (f64, Option<f64>)) -> Option<f64> {
        let mut estimate = Estimate::default();
        let sample = |elapsed: f64| {
            let (time, stop) = stands(elapsed);
            Sample { elapsed, time, stop }
        };
        for k in 0..=1000 {
            estimate.push(sample(elapsed * f64::from(k) / 1000.0));
        }
        estimate.left(sample(elapsed), end)
    }

    fn near(found: Option<f64>, expected: f64) {
        assert!(found.is_some_and(|found| (found - expected).abs() < 0.05 * expected), "{found:?}, not {expected}");
    }

    #[test]
    fn an_even_run_has_the_time_left_that_it_will_take() {
        near(estimate(10.0, 1.0, |elapsed| (0.02 * elapsed, None)), 40.0);
        assert_eq!(estimate(0.0, 1.0, |_| (0.0, None)), None);
        assert_eq!(estimate(50.0, 1.0, |elapsed| (0.02 * elapsed, None)).map(f64::round), Some(0.0));
    }

    #[test]
    fn the_recent_speed_counts() {
        // ten times slower since the 4th second
        let slower = |elapsed: f64| (if elapsed < 4.0 { 0.1 * elapsed } else { 0.36 + 0.01 * elapsed }, None);
        near(estimate(10.0, 1.0, slower), 54.0);
    }

    #[test]
    fn the_stop_condition_counts_where_it_comes_first() {
        // at constant speed
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some(0.04 * elapsed))), 15.0);
        // at constant acceleration, from the first step on: stop = (elapsed / 20)²
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some((elapsed / 20.0).powi(2)))), 10.0);
        // it stands still, or goes back
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some(0.0))), 90.0);
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some(0.5 - 0.01 * elapsed))), 90.0);
        // and where the end comes first
        near(estimate(10.0, 0.12, |elapsed| (0.01 * elapsed, Some(0.04 * elapsed))), 2.0);
    }

    #[test]
    fn few_samples_are_kept() {
        let mut estimate = Estimate::default();
        for k in 0..1_000_000 {
            let elapsed = f64::from(k) * 1e-3;
            estimate.push(Sample { elapsed, time: elapsed, stop: None });
        }
        assert!(estimate.samples.len() < 100, "{}", estimate.samples.len());
    }
}
