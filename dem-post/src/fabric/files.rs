//! What `dem-post fabric` writes.

use dem_drawing::Chart;

use super::pictures::{anisotropy, coordination, crack_density, dilation, porosity, stress};
use super::report::Report;
use crate::output::{Folder, Result, cell};

/// Writes `fabric.csv` with a row for each frame, and as drawings `fabric`, coordination,
/// anisotropy and crack density, and `fabric-stress`, p and q, dilation and porosity; quantities
/// that the history does not have are not drawn.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let d = report.dimension;
    let axes: Vec<&str> = ["x", "y", "z"][..d].to_vec();
    let entries: Vec<(usize, String)> = (0..d * d).map(|k| (k, format!("{}{}", axes[k / d], axes[k % d]))).collect();
    // the last two tensors are symmetric
    let upper: Vec<&(usize, String)> = entries.iter().filter(|(k, _)| k / d <= k % d).collect();
    let mut head: Vec<String> = vec!["step".into(), "time_s".into()];
    head.extend(entries.iter().map(|(_, name)| format!("stress_{name}_Pa")));
    head.extend(["p_Pa", "q_Pa", "volumetric_strain", "porosity", "contacts", "coordination"].map(String::from));
    head.extend(upper.iter().map(|(_, name)| format!("fabric_{name}")));
    head.extend(["anisotropy", "direction_deg", "bonds_broken"].map(String::from));
    head.extend(upper.iter().map(|(_, name)| format!("crack_density_{name}_per_m")));
    head.push("crack_area_per_m".into());
    let rows = report.rows.iter().map(|row| {
        let of = |tensor: &Option<Vec<f64>>, k: usize| cell(tensor.as_ref().map(|tensor| tensor[k]));
        let mut cells = vec![row.step.to_string(), cell(Some(row.time))];
        cells.extend(entries.iter().map(|(k, _)| of(&row.stress, *k)));
        cells.extend([row.p, row.q, row.volumetric_strain, Some(row.porosity)].map(cell));
        cells.extend([row.contacts.map_or_else(String::new, |n| n.to_string()), cell(row.coordination)]);
        cells.extend(upper.iter().map(|(k, _)| of(&row.fabric, *k)));
        cells.extend([cell(row.anisotropy), cell(row.direction), row.broken.to_string()]);
        cells.extend(upper.iter().map(|(k, _)| of(&row.crack_density, *k)));
        cells.push(cell(row.crack_area()));
        cells
    });
    folder.table("fabric", &head.iter().map(String::as_str).collect::<Vec<_>>(), rows)?;
    for (name, mut charts) in [
        ("fabric", vec![coordination(report), anisotropy(report), crack_density(report)]),
        ("fabric-stress", vec![stress(report), dilation(report), porosity(report)]),
    ] {
        charts.retain(|chart| chart.curves.iter().any(|curve| !curve.points.is_empty()));
        if !charts.is_empty() {
            folder.draw(name, &Chart::draw(charts))?;
        }
    }
    Ok(())
}
