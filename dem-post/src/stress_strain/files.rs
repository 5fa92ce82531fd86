//! Table and drawings of the load.

use dem_drawing::Chart;

use super::pictures::{force_displacement, load_breaks, onset, stress_strain};
use super::report::Report;
use crate::output::{Folder, Result, cell};

/// Writes `stress-strain.csv`, and as drawings `force-displacement` and `stress-strain`; where the
/// load follows the breaks, `load-breaks` too.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "step",
        "time_s",
        "wall_displacement_m",
        "applied_force_N",
        "wall_reaction_N",
        "wall_strain",
        "wall_stress_Pa",
        "particle_strain",
        "particle_stress_Pa",
        "bonds_broken",
    ];
    let (height, area) = (report.summary.height, report.summary.area);
    let at = |values: &[f64], k: usize| values.get(k).copied();
    let rows = (0..report.step.len()).map(|k| {
        vec![
            report.step[k].to_string(),
            cell(Some(report.time[k])),
            cell(Some(report.displacement[k])),
            cell(Some(report.load[k])),
            cell(at(&report.reaction, k)),
            cell(area.map(|_| report.displacement[k] / height)),
            cell(at(&report.reaction, k).zip(area).map(|(f, area)| f / area)),
            cell(at(&report.strain, k)),
            cell(at(&report.stress, k)),
            cell(at(&report.broken, k)),
        ]
    });
    folder.table("stress-strain", &head, rows)?;
    folder.draw("force-displacement", &Chart::draw(vec![force_displacement(report)]))?;
    if let Some(chart) = load_breaks(report) {
        folder.draw("load-breaks", &Chart::draw(vec![chart]))?;
    }
    let mut charts = vec![stress_strain(report)];
    charts.extend(onset(report));
    Ok(folder.draw("stress-strain", &Chart::draw(charts))?)
}
