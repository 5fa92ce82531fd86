//! Charts of the sample over time.

use dem_drawing::{Chart, Style, colour};

use super::report::{Report, Row};
use crate::tensor::principal;

/// The times at which a quantity is known, and its values.
fn over_time(report: &Report, of: &dyn Fn(&Row) -> Option<f64>) -> Vec<(f64, f64)> {
    report.rows.iter().filter_map(|row| Some((row.time, of(row)?))).collect()
}

fn single(report: &Report, title: &str, of: &dyn Fn(&Row) -> Option<f64>) -> Chart {
    report.clock.chart(title).curve("", colour::BLUE, Style::Line, over_time(report, of))
}

/// Mean stress and deviator.
pub fn stress(report: &Report) -> Chart {
    report
        .clock
        .chart("stress (kPa)")
        .curve("mean stress p", colour::BLUE, Style::Thin, over_time(report, &|row| Some(1e-3 * row.p?)))
        .curve("deviator q", colour::VERMILLION, Style::Thin, over_time(report, &|row| Some(1e-3 * row.q?)))
}

/// Volumetric strain.
pub fn dilation(report: &Report) -> Chart {
    single(report, "volumetric strain (%), dilation positive", &|row| Some(1e2 * row.volumetric_strain?))
}

/// Porosity of the middle of the sample.
pub fn porosity(report: &Report) -> Chart {
    single(report, "porosity of the middle (%)", &|row| Some(1e2 * row.porosity))
}

/// Contacts of a grain.
pub fn coordination(report: &Report) -> Chart {
    single(report, "coordination number", &|row| row.coordination)
}

/// Anisotropy of the contacts.
pub fn anisotropy(report: &Report) -> Chart {
    single(report, "anisotropy of the contact fabric", &|row| row.anisotropy)
}

/// Principal values of the crack density.
pub fn crack_density(report: &Report) -> Chart {
    let mut chart = report.clock.chart("crack density (1/m)");
    let names = ["greatest principal value", if report.dimension == 2 { "least" } else { "middle" }, "least"];
    for (k, name) in names[..report.dimension].iter().enumerate() {
        let value = |row: &Row| Some(principal(row.crack_density.as_ref()?, report.dimension)[k]);
        chart = chart.curve(name, colour::CYCLE[k], Style::Line, over_time(report, &value));
    }
    chart
}
