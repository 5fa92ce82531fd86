//! The accuracy of the solver, from the observables of every step.

use dem_history::{FALSE_ACCELERATION, History, LOAD_ERROR, ROUTE, SolverRoute};
use serde::Serialize;

use crate::clock::Clock;
use crate::output::{Result, number};

/// The distribution of a measure over the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// Median.
    pub median: f64,
    /// 99th percentile: one step in a hundred exceeds it; of fewer than 100 steps the greatest
    /// value.
    pub high: f64,
    /// Greatest value.
    pub worst: f64,
    /// Time of the greatest value, s.
    pub time: f64,
}

/// The figures of the solver; `None` for what was not recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Accuracy {
    /// Observed steps.
    pub steps: usize,
    /// The target residual, from the scene.
    pub tolerance: Option<f64>,
    /// The tolerated residual, from the scene.
    pub accept: Option<f64>,
    /// Residuals.
    pub residual: Option<Distribution>,
    /// Load errors of the steps whose solves reported one; in histories older than version 4 some
    /// of them are false accelerations.
    pub load_error: Option<Distribution>,
    /// False accelerations; none in histories older than version 4.
    pub false_acceleration: Option<Distribution>,
    /// Steps by the method that solved them, in the order of [`SolverRoute::ALL`]; none in
    /// histories older than version 4.
    pub routes: Option<[usize; 4]>,
    /// Steps whose residual exceeds the tolerance.
    pub missed: Option<usize>,
    /// Refused solves.
    pub rejected: Option<f64>,
    /// Iterations of a step.
    pub iterations: Option<Distribution>,
    /// Mean number of iterations of a step.
    pub mean_iterations: Option<f64>,
    /// Newton iterations and factorisations of a step, means.
    pub newton: Option<[f64; 2]>,
    /// Processor time of the run, s.
    pub cpu_time: Option<f64>,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
}

/// Reads the solver's figures.
///
/// # Errors
/// Those of reading the history.
pub fn read(history: &History) -> Result<Accuracy> {
    let scene: serde_json::Value = serde_json::from_str(&history.parameters()?.scene).unwrap_or_default();
    let setting = |name: &str| scene.get("solver").and_then(|solver| solver.get(name)).and_then(|value| value.as_f64());
    let series = |name: &str| -> Result<Option<(Vec<f64>, Vec<f64>)>> {
        let Some(found) = history.observable(name)? else { return Ok(None) };
        // a load error is NaN where no solve reported one
        let told = found.time.into_iter().zip(found.value).filter(|(_, value)| !value.is_nan());
        let (time, value): (Vec<f64>, Vec<f64>) = told.unzip();
        Ok((!value.is_empty()).then_some((time, value)))
    };
    let of = |name: &str| -> Result<Option<Distribution>> {
        Ok(series(name)?.map(|(time, value)| distribution(&time, value)))
    };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mean_of = |name: &str| -> Result<Option<f64>> { Ok(series(name)?.map(|(_, value)| mean(&value))) };
    let tolerance = setting("tolerance");
    let residual = series("solver_residual")?;
    let beyond =
        |limit: f64| residual.as_ref().map(|(_, value)| value.iter().filter(|&&r| r.is_nan() || r > limit).count());
    Ok(Accuracy {
        steps: history.observed_steps(),
        tolerance,
        accept: setting("accept"),
        missed: tolerance.and_then(beyond),
        residual: of("solver_residual")?,
        load_error: of(LOAD_ERROR)?,
        false_acceleration: of(FALSE_ACCELERATION)?,
        routes: series(ROUTE)?.map(|(_, value)| {
            let mut counts = [0; 4];
            value.iter().filter_map(|code| SolverRoute::of_number(*code)).for_each(|route| counts[route as usize] += 1);
            counts
        }),
        rejected: series("solver_rejected")?.map(|(_, value)| value.iter().sum()),
        iterations: of("solver_iterations")?,
        mean_iterations: mean_of("solver_iterations")?,
        newton: mean_of("solver_newton_iterations")?.zip(mean_of("solver_factorisations")?).map(|(n, f)| [n, f]),
        cpu_time: series("cpu_time")?.and_then(|(_, value)| value.last().copied()),
        clock: Clock::of(history),
    })
}

/// The distribution of `value` over the times `time` (s), of at least one step.
pub fn distribution(time: &[f64], value: Vec<f64>) -> Distribution {
    let worst = (0..value.len()).max_by(|&a, &b| value[a].total_cmp(&value[b]).then(b.cmp(&a))).unwrap_or(0);
    let (greatest, at) = (value[worst], time.get(worst).copied().unwrap_or(0.0));
    let mut sorted = value;
    sorted.sort_by(f64::total_cmp);
    let place = |share: f64| sorted[((share * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1];
    Distribution { median: place(0.5), high: place(0.99), worst: greatest, time: at }
}

impl Accuracy {
    /// The figures as names and values, for people.
    pub fn lines(&self) -> Vec<(String, String)> {
        let distribution = |found: Option<Distribution>| {
            found.map_or_else(
                || "not recorded".into(),
                |s| {
                    let [median, high, worst] = [s.median, s.high, s.worst].map(number);
                    // with fewer than 100 steps no step is above
                    let above =
                        if s.high < s.worst { format!("1 % of the steps above {high}; ") } else { String::new() };
                    format!("median {median}; {above}worst {worst} at {}", self.clock.at(s.time))
                },
            )
        };
        let plain = |value: Option<f64>| value.map_or_else(|| "–".into(), number);
        let missed = self.missed.map_or_else(
            || "–".into(),
            |n| format!("{n} of {} ({:.1} %)", self.steps, 100.0 * n as f64 / self.steps.max(1) as f64),
        );
        let routes = self.routes.map_or_else(
            || "not recorded".into(),
            |counts| {
                let named = SolverRoute::ALL.iter().zip(counts).filter(|(_, count)| *count > 0);
                named.map(|(route, count)| format!("{count} {}", route.label())).collect::<Vec<_>>().join(", ")
            },
        );
        let newton = self.newton.map_or_else(
            || "–".into(),
            |[n, f]| format!("{} iterations and {} factorisations a step", number(n), number(f)),
        );
        [
            ("Residual: tolerance, accepted", format!("{}, {}", plain(self.tolerance), plain(self.accept))),
            ("Residual", distribution(self.residual)),
            (
                match self.false_acceleration {
                    Some(_) => "Load error",
                    None => "Load error; false acceleration where none was reported",
                },
                distribution(self.load_error),
            ),
            ("False acceleration", distribution(self.false_acceleration)),
            ("Steps by method", routes),
            ("Steps that missed the tolerance of the residual", missed),
            ("Solves not accepted", plain(self.rejected)),
            (
                "Iterations of a step",
                format!("mean {}; {}", plain(self.mean_iterations), distribution(self.iterations)),
            ),
            ("Newton", newton),
            ("Processor time", self.cpu_time.map_or_else(|| "–".into(), |t| format!("{} s", number(t)))),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_tells_middle_tail_and_worst() {
        let time: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.5).collect();
        // 0 … 199 in reverse: the worst comes first
        let found = distribution(&time, (0..200).rev().map(f64::from).collect());
        assert_eq!(found, Distribution { median: 99.0, high: 197.0, worst: 199.0, time: 0.0 });
        assert_eq!(distribution(&[2.0], vec![7.0]), Distribution { median: 7.0, high: 7.0, worst: 7.0, time: 2.0 });
    }

    #[test]
    fn a_share_above_is_named_only_if_a_step_is_above() {
        let line = |steps: u32| {
            let time: Vec<f64> = (0..steps).map(f64::from).collect();
            let residual = Some(distribution(&time, time.clone()));
            Accuracy { residual, ..Accuracy::default() }.lines()[1].1.clone()
        };
        assert_eq!(line(78), "median 38; worst 77 at t = 77 s");
        assert_eq!(line(200), "median 99; 1 % of the steps above 197; worst 199 at t = 199 s");
    }
}
