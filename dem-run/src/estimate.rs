//! The time that a run will still take: a figure where steps cost the same, else what is known.

use std::collections::VecDeque;
use std::fmt;

/// Share of the time since the first step over which speeds are measured.
const WINDOW: f64 = 0.5;
/// Growth of the time since the first step from sample to sample.
const GROWTH: f64 = 1.01;
/// Ratio of the speeds of the two halves of the window up to which steps cost the same.
const EVEN: f64 = 1.2;
/// Time that a broken sample takes to the end, over that at the speed of the window, in the median
/// of recorded runs (docs/decisions/0043-what-people-see.md): it comes to rest, so its steps become
/// cheaper.
const SLOWING: f64 = 0.6;
/// The range that is told reaches from the expected time over this factor to the time multiplied by
/// it.
const SPREAD: f64 = 2.0;

/// What is known of the time to the end of a run (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Left {
    /// Time at the speed of the window: its steps cost the same.
    Even(f64),
    /// Time to the end if the sample does not fail. Before that, neither the cost of a collapse nor
    /// the time at which it ends the run is known.
    IfHolds(f64),
    /// Expected time, where costs vary. It is told as a range.
    About(f64),
    /// Upper bound of the time, where a condition without a measure may end the run earlier:
    /// twice the time at the speed of the window.
    AtMost(f64),
}

impl Left {
    /// The time (s) that is told; the centre of a range.
    #[must_use]
    pub fn seconds(self) -> f64 {
        let (Self::Even(seconds) | Self::IfHolds(seconds) | Self::About(seconds) | Self::AtMost(seconds)) = self;
        seconds
    }

    /// What the time is, as a name in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Even(_) => "even",
            Self::IfHolds(_) => "if_it_holds",
            Self::About(_) => "about",
            Self::AtMost(_) => "at_most",
        }
    }
}

impl fmt::Display for Left {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Even(seconds) => write!(f, "{} left", duration(seconds)),
            Self::IfHolds(seconds) => write!(f, "{} left if it holds", duration(seconds)),
            Self::AtMost(seconds) => write!(f, "≤ {} left", duration(seconds)),
            Self::About(seconds) => {
                let (low, high) = (seconds / SPREAD, seconds * SPREAD);
                let (unit, name) = unit(high);
                write!(f, "{}–{} {name} left", digits(low / unit), digits(high / unit))
            }
        }
    }
}

/// A duration (s) of one or two digits in a readable unit.
pub fn duration(seconds: f64) -> String {
    let (unit, name) = unit(seconds);
    format!("{} {name}", digits(seconds / unit))
}

/// The unit of a duration (s), and its name.
fn unit(seconds: f64) -> (f64, &'static str) {
    match seconds {
        ..100.0 => (1.0, "s"),
        ..6000.0 => (60.0, "min"),
        _ => (3600.0, "h"),
    }
}

/// A count of units: with one decimal below 10, seconds too.
fn digits(count: f64) -> String {
    if (0.05..9.95).contains(&count) { format!("{count:.1}") } else { format!("{count:.0}") }
}

/// What, beside the speed, determines how long a run takes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outlook {
    /// Simulated time at the end (s).
    pub end: f64,
    /// Whether the sample has bonds, or a stage will form them.
    pub bonded: bool,
    /// Whether the sample has failed, by its strain or its broken bonds.
    pub failed: bool,
    /// Whether a condition without a measure may end the run: a drop of the load, a share of broken
    /// bonds, or the end of a stage.
    pub open: bool,
}

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
    /// Fraction of the travel reached (0 to 1), if the travel of a wall ends the run.
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

    /// What is known of the time from `now` to the end of the run, or to its stop condition if that
    /// is estimated to come first; none before there are two samples.
    #[must_use]
    pub fn left(&self, now: Sample, outlook: Outlook) -> Option<Left> {
        let first = self.samples.front().filter(|first| now.time > first.time && now.elapsed > first.elapsed)?;
        let speed = (now.time - first.time) / (now.elapsed - first.elapsed);
        let to_end = (outlook.end - now.time).max(0.0);
        let seconds = self.to_stop(first, now).map_or(to_end, |to_stop| to_stop.min(to_end)) / speed;
        Some(match outlook {
            Outlook { bonded: true, failed: false, .. } => Left::IfHolds(seconds),
            Outlook { open: true, .. } => Left::AtMost(SPREAD * seconds),
            Outlook { failed: false, .. } if self.is_even(first, now) => Left::Even(seconds),
            _ => Left::About(SLOWING * seconds),
        })
    }

    /// Whether the two halves of the window have nearly the same speed.
    fn is_even(&self, first: &Sample, now: Sample) -> bool {
        let half = 0.5 * (first.elapsed + now.elapsed);
        let Some(middle) = self.samples.iter().find(|sample| sample.elapsed >= half) else { return false };
        let speed = |from: &Sample, to: &Sample| (to.time - from.time) / (to.elapsed - from.elapsed);
        let ratio = speed(first, middle) / speed(middle, &now);
        (1.0 / EVEN..=EVEN).contains(&ratio)
    }

    /// Simulated time to the stop condition (s), if it comes nearer. A wall that a growing force
    /// pushes moves ever faster: its travel is extrapolated with the acceleration between the two
    /// halves of the window; of a window without a sample in between, with that of a start from
    /// rest.
    fn to_stop(&self, first: &Sample, now: Sample) -> Option<f64> {
        let half = 0.5 * (first.time + now.time);
        let between = self.samples.iter().filter(|sample| first.time < sample.time && sample.time < now.time);
        let middle = between.min_by(|a, b| (a.time - half).abs().total_cmp(&(b.time - half).abs()));
        let rate = |from: &Sample, to: &Sample| Some((to.stop? - from.stop?) / (to.time - from.time));
        let (after, acceleration, since) = match middle {
            Some(middle) => {
                let (before, after) = (rate(first, middle)?, rate(middle, &now)?);
                (after, 2.0 * (after - before) / (now.time - first.time), now.time - middle.time)
            }
            None => {
                let mean = rate(first, &now)?;
                (mean, 2.0 * mean / (now.time - first.time), now.time - first.time)
            }
        };
        let speed = after + 0.5 * acceleration * since;
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
        told(elapsed, Outlook { end, ..Outlook::default() }, stands).map(|left| match left {
            Left::About(seconds) => seconds / SLOWING,
            left => left.seconds(),
        })
    }

    fn told(elapsed: f64, outlook: Outlook, stands: impl Fn(f64) -> (f64, Option<f64>)) -> Option<Left> {
        let mut estimate = Estimate::default();
        let sample = |elapsed: f64| {
            let (time, stop) = stands(elapsed);
            Sample { elapsed, time, stop }
        };
        for k in 0..=1000 {
            estimate.push(sample(elapsed * f64::from(k) / 1000.0));
        }
        estimate.left(sample(elapsed), outlook)
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
        // of two samples, from rest: stop = 0.25 elapsed² s⁻², so the second left has two halves
        let two = [(0.0, 0.0), (1.0, 0.25)].map(|(elapsed, stop)| Sample { elapsed, time: elapsed, stop: Some(stop) });
        let mut short = Estimate::default();
        two.into_iter().for_each(|sample| short.push(sample));
        let left = short.left(two[1], Outlook { end: 100.0, ..Outlook::default() });
        assert_eq!(left, Some(Left::About(SLOWING)));
        // it stands still, or goes back
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some(0.0))), 90.0);
        near(estimate(10.0, 1.0, |elapsed| (0.01 * elapsed, Some(0.5 - 0.01 * elapsed))), 90.0);
        // and where the end comes first
        near(estimate(10.0, 0.12, |elapsed| (0.01 * elapsed, Some(0.04 * elapsed))), 2.0);
    }

    #[test]
    fn what_is_not_known_is_not_told_as_a_figure() {
        let even = |elapsed: f64| (0.02 * elapsed, None);
        let slower = |elapsed: f64| (if elapsed < 7.0 { 0.1 * elapsed } else { 0.63 + 0.01 * elapsed }, None);
        let outlook = |bonded, failed, open| Outlook { end: 1.0, bonded, failed, open };
        let name = |outlook, stands: &dyn Fn(f64) -> (f64, Option<f64>)| told(10.0, outlook, stands).map(Left::name);
        assert_eq!(name(outlook(false, false, false), &even), Some("even"));
        assert_eq!(name(outlook(false, false, false), &slower), Some("about"));
        assert_eq!(name(outlook(true, false, true), &even), Some("if_it_holds"));
        assert_eq!(name(outlook(true, true, false), &even), Some("about"));
        assert_eq!(name(outlook(true, true, true), &even), Some("at_most"));
        // a broken sample slows down: 40 s at the present speed
        near(told(10.0, outlook(true, true, false), even).map(Left::seconds), 24.0);
        near(told(10.0, outlook(true, true, true), even).map(Left::seconds), 80.0);
    }

    #[test]
    fn a_time_has_one_or_two_digits() {
        for (left, text) in [
            (Left::Even(0.0), "0 s left"),
            (Left::Even(1.26), "1.3 s left"),
            (Left::Even(59.6), "60 s left"),
            (Left::IfHolds(130.0), "2.2 min left if it holds"),
            (Left::AtMost(3599.0), "≤ 60 min left"),
            (Left::AtMost(7.3 * 3600.0), "≤ 7.3 h left"),
            (Left::About(12.0), "6.0–24 s left"),
            (Left::About(60.0), "0.5–2.0 min left"),
        ] {
            assert_eq!(left.to_string(), text);
        }
        assert_eq!([0.4, 125.0, 7265.0].map(duration), ["0.4 s", "2.1 min", "2.0 h"]);
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
