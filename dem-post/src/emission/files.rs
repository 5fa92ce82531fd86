//! What `dem-post emission` writes.

use dem_drawing::Chart;
use dem_output::row;

use super::pictures::{b_values, course, frequencies, magnitudes};
use super::report::Report;
use crate::output::{Folder, Result, cell};

/// Writes `emission-events.csv`, `emission-magnitudes.csv` with the number of events by magnitude,
/// `emission-b-values.csv` with the b-value from each magnitude on, and as drawings `emission`, the
/// events over time with the load, and `emission-magnitudes`.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "event",
        "step",
        "time_s",
        "round",
        "load_N",
        "bonds",
        "tension",
        "shear",
        "rolling",
        "twist",
        "rounds",
        "duration_s",
        "energy_J",
        "magnitude",
        "x_m",
        "y_m",
        "z_m",
        "radius_m",
    ];
    let rows = report.events.iter().enumerate().map(|(k, e)| {
        let (m, [x, y, z]) = (e.modes, e.place);
        let (load, magnitude) = (cell(e.load), cell(e.magnitude));
        row![
            k + 1,
            e.step,
            e.time,
            e.round,
            load,
            e.bonds,
            m.tension,
            m.shear,
            m.rolling,
            m.twist,
            e.rounds,
            cell(e.duration),
            e.energy,
            magnitude,
            x,
            y,
            z,
            e.radius
        ]
    });
    folder.table("emission-events", &head, rows)?;
    let values = report.values();
    let rows = report.frequencies.iter().map(|f| {
        let law = report.b_value.filter(|law| f.magnitude >= law.from);
        let expected = law.map(|law| values.expected(&law, f.magnitude));
        row![f.magnitude, f.events, f.cumulative, cell(expected)]
    });
    folder.table("emission-magnitudes", &["magnitude", "events", "cumulative", "expected_cumulative"], rows)?;
    let rows = report.b_values.iter().map(|law| row![law.from, law.events, law.b, law.error, u8::from(law.law_holds)]);
    folder.table("emission-b-values", &["completeness", "events", "b_value", "standard_error", "law_holds"], rows)?;
    folder.draw("emission", &Chart::draw(vec![course(report), magnitudes(report)]))?;
    let mut charts = vec![frequencies(report)];
    charts.extend(b_values(report));
    Ok(folder.draw("emission-magnitudes", &Chart::draw(charts))?)
}
