//! Charts of the load.

use dem_drawing::{Chart, Style, colour};

use super::report::{COLLAPSE, Report};
use crate::output::short;

/// Least strain on the logarithmic axis.
const LEAST_STRAIN: f64 = 1e-9;

fn pairs(x: &[f64], x_scale: f64, y: &[f64], y_scale: f64) -> Vec<(f64, f64)> {
    x.iter().zip(y).map(|(x, y)| (x * x_scale, y * y_scale)).collect()
}

/// Force over displacement of the wall.
pub fn force_displacement(report: &Report) -> Chart {
    let mut chart = Chart::new("displacement of the wall (mm)", "force (N)");
    chart.pad_x = true;
    if !report.reaction.is_empty() {
        let points = pairs(&report.displacement, 1e3, &report.reaction, 1.0);
        chart = chart.curve("reaction of the grains", colour::ORANGE, Style::Thin, points);
    }
    let points = pairs(&report.displacement, 1e3, &report.load, 1.0);
    chart = chart.curve("applied force", colour::BLUE, Style::Line, points).timed(&report.time);
    if let Some(load) = report.summary.level() {
        chart.levels.push((load, format!("at strain 10⁻⁴: {} N", short(load))));
    }
    chart
}

/// The load of each break over the number of broken bonds, where the load follows the breaks.
pub fn load_breaks(report: &Report) -> Option<Chart> {
    report.clock.step()?;
    let mut chart = Chart::new("broken bonds", "load of the break (N)");
    (chart.pad_x, chart.x_is_count) = (true, true);
    Some(chart.curve("applied force", colour::BLUE, Style::Line, pairs(&report.broken, 1.0, &report.load, 1.0)))
}

/// The load over the logarithm of the fitted strain: it shows the small strains before the
/// collapse.
pub fn onset(report: &Report) -> Option<Chart> {
    let visible = |&(strain, _): &(f64, f64)| strain >= LEAST_STRAIN;
    let points: Vec<(f64, f64)> =
        report.strain.iter().map(|e| e.abs()).zip(report.load.iter().copied()).filter(visible).collect();
    if points.len() < 2 {
        return None;
    }
    let mut chart = Chart::new("magnitude of the axial strain, from the grains", "applied force (N)");
    chart = chart.curve("applied force", colour::BLUE, Style::Line, points);
    (chart.log_x, chart.pad_x) = (true, true);
    chart.moments = COLLAPSE.to_vec();
    if let Some(load) = report.summary.level() {
        chart.levels.push((load, format!("at strain 10⁻⁴: {} N", short(load))));
    }
    Some(chart)
}

/// Stress over strain.
pub fn stress_strain(report: &Report) -> Chart {
    let mut chart = Chart::new("axial strain (%)", "axial stress (kPa)");
    chart.pad_x = true;
    let wall_strain = 1e2 / report.summary.height;
    let wall_stress = report.summary.area.map(|area| 1e-3 / area);
    if let Some(wall_stress) = wall_stress.filter(|_| !report.reaction.is_empty()) {
        let points = pairs(&report.displacement, wall_strain, &report.reaction, wall_stress);
        chart = chart.curve("from walls", colour::ORANGE, Style::Thin, points);
    }
    let points = pairs(&report.strain, 1e2, &report.stress, 1e-3);
    if !points.is_empty() {
        chart = chart.curve("from grains", colour::BLUE, Style::Thin, points).timed(&report.time);
    }
    if let Some(elastic) = &report.summary.elastic {
        let points = pairs(&elastic.strains, 1e2, &elastic.stresses, 1e-3);
        let name = format!("E = {} GPa", short(1e-9 * elastic.young_modulus.value));
        chart = chart.curve(&name, colour::BLACK, Style::Line, points);
    }
    if let Some((load, wall_stress)) = report.summary.level().zip(wall_stress) {
        chart.levels.push((load * wall_stress, format!("at strain 10⁻⁴: {} kPa", short(load * wall_stress))));
    }
    chart
}
