//! What the time of a history counts: seconds or, in a run that loads from break to break
//! (`rupture: next_event`), steps.

use dem_drawing::Chart;
use dem_history::History;

use crate::output::number;

/// The words and units for times of a history.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Where the time counts steps, what a step adds to it (s).
    step: Option<f64>,
}

impl Clock {
    /// That of a history.
    pub fn of(history: &History) -> Self {
        let made = history.steps().iter().zip(history.times()).rfind(|(step, _)| **step > 0);
        let step = made.map_or(1.0, |(step, time)| time / *step as f64);
        Self { step: history.follows_breaks().then_some(step) }
    }

    /// Where the time counts steps, what a step adds to it (s).
    pub fn step(self) -> Option<f64> {
        self.step
    }

    /// The title of a column of times.
    pub fn title(self) -> &'static str {
        if self.step.is_some() { "step" } else { "time (s)" }
    }

    /// What runs along the axis of a chart: `time`, `the steps`.
    pub fn over(self) -> &'static str {
        if self.step.is_some() { "the steps" } else { "time" }
    }

    /// A time (s) in the unit of the clock.
    pub fn value(self, time: f64) -> f64 {
        self.step.map_or(time, |step| (time / step).round())
    }

    /// The time (s) of a value in the unit of the clock.
    pub fn time(self, value: f64) -> f64 {
        self.step.map_or(value, |step| value * step)
    }

    /// A time (s) in words: `0.244 s`, `step 61`.
    pub fn moment(self, time: f64) -> String {
        match self.step {
            Some(_) => format!("step {}", self.value(time)),
            None => format!("{} s", number(time)),
        }
    }

    /// The same for a time that may be unknown: `–` where it is.
    pub fn moment_if_known(self, time: Option<f64>) -> String {
        time.map_or_else(|| "–".into(), |time| self.moment(time))
    }

    /// A time (s) in a title: `t = 0.244 s`, `step 61`.
    pub fn at(self, time: f64) -> String {
        if self.step.is_some() { self.moment(time) } else { format!("t = {}", self.moment(time)) }
    }

    /// A chart of `y` over the time. Its points are at times (s).
    pub fn chart(self, y: &str) -> Chart {
        Chart { step: self.step, ..Chart::over_time(y) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_of_steps_has_no_seconds() {
        let (seconds, steps) = (Clock::default(), Clock { step: Some(1e-3) });
        assert_eq!([seconds.moment(0.061), seconds.at(0.061)], ["0.061 s", "t = 0.061 s"]);
        // 61 sums of a step are not 61 steps exactly
        assert_eq!([steps.moment(0.0610000001), steps.at(0.061)], ["step 61", "step 61"]);
        assert_eq!([steps.moment_if_known(Some(0.061)), steps.moment_if_known(None)], ["step 61", "–"]);
        assert_eq!((steps.value(0.061), steps.time(61.0), seconds.time(61.0)), (61.0, 0.061, 61.0));
    }
}
