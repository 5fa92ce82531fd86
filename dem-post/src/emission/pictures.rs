//! Charts of the events.

use dem_drawing::{Bars, Chart, Style, colour};

use super::report::{Report, Scale};

/// Load, broken bonds, events and energy over time or steps, each over its greatest value.
pub fn course(report: &Report) -> Chart {
    let curves = &report.curves;
    let mut chart = curves.clock.chart("share of the greatest value");
    let greatest = curves.load.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
    if greatest > 0.0 {
        let load = curves.load.iter().map(|&(time, load)| (time, load / greatest)).collect();
        chart = chart.curve("load", colour::GREY, Style::Line, load);
    }
    let ones = |times: &mut dyn Iterator<Item = f64>| times.map(|time| (time, 1.0)).collect::<Vec<_>>();
    let broken = ones(&mut curves.ruptures.iter().map(|r| r.0));
    chart = chart.curve("broken bonds", colour::BLUE, Style::Steps, sums(&broken, curves.end));
    let events = ones(&mut report.events.iter().map(|event| event.time));
    chart = chart.curve("events", colour::VERMILLION, Style::Steps, sums(&events, curves.end));
    if report.energy > 0.0 {
        chart = chart.curve("energy released", colour::GREEN, Style::Steps, sums(&curves.ruptures, curves.end));
    }
    chart
}

/// The sum of what comes at some times, over its last value, until `end`.
fn sums(parts: &[(f64, f64)], end: f64) -> Vec<(f64, f64)> {
    let total: f64 = parts.iter().map(|part| part.1).sum();
    let mut points = vec![(0.0, 0.0)];
    let mut sum = 0.0;
    for &(time, part) in parts {
        sum += part;
        points.push((time, sum / total));
    }
    points.push((end, if total > 0.0 { 1.0 } else { 0.0 }));
    points
}

/// The magnitude of each event at its time or step.
pub fn magnitudes(report: &Report) -> Chart {
    let curves = &report.curves;
    let points = report.events.iter().filter_map(|event| Some((event.time, event.magnitude?))).collect();
    let mut chart = curves.clock.chart(report.axis()).curve("events", colour::BLUE, Style::Points, points);
    chart.pad_x = true;
    chart
}

/// Number of events over magnitude, with the law.
pub fn frequencies(report: &Report) -> Chart {
    let mut chart = Chart::new(report.axis(), "number of events");
    chart.log_y = !report.frequencies.is_empty();
    chart.pad_x = true;
    let of = |count: &dyn Fn(usize) -> usize| {
        (0..report.frequencies.len()).map(|k| (report.frequencies[k].magnitude, count(k) as f64)).collect::<Vec<_>>()
    };
    let each = if report.magnitude == Scale::Energy { "in the bin" } else { "of this size" };
    chart = chart.curve(each, colour::ORANGE, Style::Points, of(&|k| report.frequencies[k].events));
    chart = chart.curve(
        "of this magnitude or more",
        colour::BLUE,
        Style::Points,
        of(&|k| report.frequencies[k].cumulative),
    );
    if let Some(law) = &report.b_value {
        let values = report.values();
        let shown = report.frequencies.iter().filter(|f| f.magnitude >= law.from);
        let points = shown.map(|f| (f.magnitude, values.expected(law, f.magnitude))).collect();
        let caveat = if law.law_holds { "" } else { ", does not fit" };
        let name = format!("b = {:.2} ± {:.2}{caveat}", law.b, law.error);
        chart = chart.curve(&name, colour::BLACK, Style::Line, points);
    }
    chart
}

/// The b-value from each magnitude on; none where there are too few events.
pub fn b_values(report: &Report) -> Option<Chart> {
    let law = report.b_value?;
    let mut chart = Chart::new("least magnitude", "b-value");
    chart.pad_x = true;
    chart.bars = Some(Bars {
        label: "from this magnitude on, with its standard error".into(),
        colour: colour::BLUE,
        bars: report.b_values.iter().map(|law| (law.from, law.b, law.error)).collect(),
    });
    chart.levels.push((law.b, format!("from {:.2}: b = {:.2}", law.from, law.b)));
    Some(chart)
}
