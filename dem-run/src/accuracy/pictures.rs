//! The report as pictures: work against precision, and the performance profile.

use super::report::{Report, Row};
use crate::output::{Folder, Result, short};
use crate::plot::{Chart, Style, colour};

/// Draws the charts for which the report has data.
///
/// # Errors
/// A file cannot be written.
pub fn draw(report: &Report, folder: &mut Folder) -> Result<()> {
    let charts = work_precision(report);
    if !charts.is_empty() {
        folder.draw("work-precision", &Chart::draw(charts))?;
    }
    match profile(report) {
        Some(chart) => folder.draw("profile", &Chart::draw(vec![chart])),
        None => Ok(()),
    }
}

/// For a bonded sample, two errors that the residual does not show: the false strain and the error
/// of the collapse load. For other samples, the residual.
fn work_precision(report: &Report) -> Vec<Chart> {
    let strain = over_time(report, "strain before the first break, all false", &|row| row.outcome.false_strain);
    let deviation = over_time(report, "collapse load: error relative to the reference", &|row| {
        row.collapse_deviation[0].map(f64::abs)
    });
    let residual = over_time(report, "worst residual", &|row| Some(row.outcome.worst_residual));
    let mut charts = vec![strain.or(residual)];
    charts.push(deviation.map(|mut chart| {
        chart
            .levels
            .extend(indeterminate(report).map(|share| (share, format!("indeterminacy: {} %", short(1e2 * share)))));
        chart
    }));
    charts.into_iter().flatten().collect()
}

/// Half the range of the collapse load, over its mean, among runs that should agree (–); the
/// largest of all solvers.
fn indeterminate(report: &Report) -> Option<f64> {
    let spreads = report.indeterminacy.iter().flat_map(|i| &i.spreads);
    let share = spreads.filter_map(|s| s.collapse[0].map(|range| 0.5 * (range.max - range.min) / range.mean));
    share.filter(|share| *share > 0.0).max_by(f64::total_cmp)
}

/// A quantity over the CPU time of the runs, one curve per solver and time step; none if the
/// quantity is never positive.
fn over_time(report: &Report, title: &str, value: &dyn Fn(&Row) -> Option<f64>) -> Option<Chart> {
    let mut chart = Chart::new("CPU time of the steps (s)", title);
    (chart.log_x, chart.log_y) = (true, true);
    let mut colours = colour::CYCLE.into_iter().cycle();
    for solver in &report.asked.solvers {
        for step in &report.asked.steps {
            let rows = report.runs.iter().filter(|row| row.way.solver == *solver && row.way.step_factor == *step);
            let point = |row: &Row| Some((row.outcome.cpu_time, value(row).filter(|v| *v > 0.0)?));
            let points: Vec<(f64, f64)> = rows.filter(|row| row.outcome.error.is_none()).filter_map(point).collect();
            let label = match report.asked.steps.len() {
                1 => solver.name().to_string(),
                _ => format!("{}, {}", solver.name(), length(*step)),
            };
            let colour = colours.next().unwrap_or(colour::BLACK);
            if !points.is_empty() {
                chart = chart.curve(&label, colour, Style::Marked, points);
            }
        }
    }
    (!chart.curves.is_empty()).then_some(chart)
}

/// A time step in units of that of the scene, h.
fn length(factor: f64) -> String {
    let part = 1.0 / factor;
    match factor {
        1.0 => "h".into(),
        _ if factor < 1.0 && (part - part.round()).abs() < 1e-9 => format!("h/{part:.0}"),
        _ => format!("{factor} h"),
    }
}

fn profile(report: &Report) -> Option<Chart> {
    let profile = report.profile.as_ref()?;
    let title = format!("share of {} contact problems solved to {:e} (%)", profile.step.len(), profile.tolerance);
    let mut chart = Chart::new("CPU time over that of the fastest solver", &title);
    chart.log_x = true;
    let colours = colour::CYCLE.into_iter().cycle();
    for ((solver, curve), colour) in profile.solvers.iter().zip(profile.curves()).zip(colours) {
        let points = curve.into_iter().map(|(factor, share)| (factor, 1e2 * share)).collect();
        chart = chart.curve(solver.solver.name(), colour, Style::Steps, points);
    }
    Some(chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_steps_are_told_in_units_of_the_scene_s() {
        for (factor, text) in [(1.0, "h"), (0.5, "h/2"), (0.1, "h/10"), (2.0, "2 h"), (0.75, "0.75 h")] {
            assert_eq!(length(factor), text);
        }
    }
}
