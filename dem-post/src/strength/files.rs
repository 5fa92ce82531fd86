//! What `dem-post strength` writes.

use super::report::{Report, Run, axis};
use crate::output::{Folder, Result, cell};
use dem_drawing::{Bars, Chart, Style, colour};
use dem_output::row;

/// Ratio of the greatest to the least value from which the axis is logarithmic.
const DECADE: f64 = 10.0;
/// Points of a line that is curved on logarithmic axes.
const LINE_POINTS: usize = 100;
/// Offset of the mean from its points, as a share of the axis, so that the mean hides no point.
const BESIDE: f64 = 0.018;

/// Writes `strength.csv` with a row for each run, `strength-values.csv` with one for each value of
/// the field, `strength-samples.csv` with one for each sample, and as a drawing `strength`.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = ["run", &report.field, "sample", "strength_N", "time_s", "strength_over_field", "why_left_out"];
    let runs =
        report.runs.iter().map(|run| row![run.run, run.value, run.sample, run.strength, run.time, cell(run.ratio), ""]);
    let left_out = report.left_out.iter().map(|out| row![out.run, "", "", "", "", "", out.why]);
    folder.table("strength", &head, runs.chain(left_out))?;
    let head = [
        &report.field,
        "runs",
        "mean_strength_N",
        "standard_deviation_N",
        "mean_low_95_N",
        "mean_high_95_N",
        "least_N",
        "greatest_N",
        "mean_strength_over_field",
    ];
    let values = report.values.iter().map(|at| {
        let s = &at.strength;
        let [low, high] = [0, 1].map(|end| cell(s.interval.map(|interval| interval[end])));
        let ratio = cell(at.ratio.map(|ratio| ratio.mean));
        row![at.value, s.count, s.mean, cell(s.deviation), low, high, at.range[0], at.range[1], ratio]
    });
    folder.table("strength-values", &head, values)?;
    let head = ["sample", "runs", "same_grains", "strength_over_field", "greatest_deviation", "slope", "intercept_N"];
    let samples = report.samples.iter().map(|sample| {
        let of = |value: Option<f64>| cell(value);
        let (slope, intercept) = (sample.line.map(|l| l.slope.value), sample.line.map(|l| l.intercept.value));
        let (ratio, deviation) = (of(sample.ratio), of(sample.ratio_deviation));
        row![sample.sample, sample.runs, sample.same_grains, ratio, deviation, of(slope), of(intercept)]
    });
    folder.table("strength-samples", &head, samples)?;
    Ok(folder.draw("strength", &Chart::draw(vec![chart(report)]))?)
}

/// Strengths by sample, their means with the spread, and the line.
pub(crate) fn chart(report: &Report) -> Chart {
    let mut chart = Chart::new(&axis(&report.field, &report.unit), &axis(report.measure.title(), "N"));
    chart.pad_x = true;
    chart.log_x = spans_decades(report.runs.iter().map(|run| run.value));
    chart.log_y = chart.log_x && spans_decades(report.runs.iter().map(|run| run.strength));
    if let Some(line) = &report.line {
        let (first, last) = (report.values[0].value, report.values[report.values.len() - 1].value);
        let log_x = chart.log_x;
        let place = |k: usize| {
            let share = k as f64 / LINE_POINTS as f64;
            if log_x { first * (last / first).powf(share) } else { first + share * (last - first) }
        };
        let points = (0..=LINE_POINTS).map(place).map(|x| (x, line.slope.value * x + line.intercept.value));
        chart = chart.curve(&report.equation(line), colour::BLACK, Style::Line, points.collect());
    }
    let points = |of: &dyn Fn(&Run) -> bool| {
        report.runs.iter().filter(|run| of(run)).map(|run| (run.value, run.strength)).collect()
    };
    // with more samples than colours, all samples have the same colour
    if report.samples.len() <= colour::CYCLE.len() {
        for (sample, colour) in report.samples.iter().zip(colour::CYCLE) {
            chart = chart.curve(&sample.sample, colour, Style::Points, points(&|run| run.sample == sample.sample));
        }
    } else {
        let label = format!("{} samples", report.samples.len());
        chart = chart.curve(&label, colour::BLUE, Style::Points, points(&|_| true));
    }
    let log_x = chart.log_x;
    let beside = |value: f64| {
        let (first, last) = (report.values[0].value, report.values[report.values.len() - 1].value);
        if log_x { value * (last / first).powf(BESIDE) } else { value + BESIDE * (last - first) }
    };
    let bars = report.values.iter().filter_map(|at| Some((beside(at.value), at.strength.mean, at.strength.deviation?)));
    let bars: Vec<(f64, f64, f64)> = bars.collect();
    if !bars.is_empty() {
        let label = "mean ± standard deviation, drawn beside its points".into();
        chart.bars = Some(Bars { label, colour: colour::BLACK, bars });
    }
    chart
}

fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    let [low, high] = values.fold([f64::INFINITY, 0.0], |[l, h], v| [l.min(v), h.max(v)]);
    low > 0.0 && high >= DECADE * low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_values_over_a_decade_have_a_logarithmic_axis() {
        assert!(spans_decades([1.0, 10.0].into_iter()));
        assert!(!spans_decades([5.0, 10.0, 20.0].into_iter()));
        assert!(!spans_decades([0.0, 10.0].into_iter()) && !spans_decades([-1.0, 10.0].into_iter()));
    }
}
