//! What `dem-post cracks` writes.

use dem_run::history::History;

use super::pictures::{broken_chart, crack_map, decohesion, fragment_charts, front_charts};
use super::{Report, broken_over_time};
use crate::moments;
use crate::output::{Folder, Result, cell};
use crate::plot::Chart;
use crate::row;

/// Writes `ruptures.csv`, `broken.csv`, `fragments.csv`, and as drawings `broken`, `fragments` and `decohesion`; the map
/// shows the moments nearest to `times` (s), or chosen ones. Where cracks were found, also `cracks.csv`,
/// `crack-segments.csv`, `crack-front.csv`, `crack-growth.csv`, and the drawings `cracks`, `cracks-near` where they fill a small
/// part of the sample, and `crack-front` where one grew step by step or round by round.
///
/// # Errors
/// [`crate::output::PostError::Write`], and [`crate::output::PostError::Usage`] for times outside the history.
pub fn write(history: &History, report: &Report, times: &[f64], folder: &mut Folder) -> Result<()> {
    let frames = moments::chosen(history, times)?;
    write_ruptures(report, folder)?;
    let curve = broken_over_time(&report.events);
    let rows = curve.iter().map(|(time, n)| row![time, n[0], n[1], n[2], n.iter().sum::<usize>()]);
    folder.table("broken", &["time_s", "tension", "shear", "rolling", "total"], rows)?;
    let rows = report.fragments.iter().map(|pieces| {
        let f = pieces.fragments;
        row![pieces.step, pieces.time, f.count, f.singles, f.largest, f.largest_mass_fraction]
    });
    folder.table(
        "fragments",
        &["step", "time_s", "fragments", "single_grains", "largest_grains", "largest_mass_fraction"],
        rows,
    )?;
    let end = history.times().last().copied().unwrap_or(0.0);
    folder.draw("broken", &Chart::draw(vec![broken_chart(&curve, end)]))?;
    folder.draw("fragments", &Chart::draw(fragment_charts(&report.fragments)))?;
    folder.draw("decohesion", &decohesion(history, &frames)?)?;
    if report.cracks.is_empty() {
        return Ok(());
    }
    write_cracks(report, folder)?;
    write_segments(report, folder)?;
    write_fronts(report, folder)?;
    let head = ["step", "time_s", "round", "bonds", "cracks", "length_m", "longest_m"];
    let rows = report.growth.iter().map(|g| row![g.step, g.time, g.round, g.bonds, g.cracks, g.length, g.longest]);
    folder.table("crack-growth", &head, rows)?;
    let (all, near) = crack_map(history, report)?;
    folder.draw("cracks", &all)?;
    if let Some(near) = near {
        folder.draw("cracks-near", &near)?;
    }
    let charts = front_charts(report);
    if !charts.is_empty() {
        folder.draw("crack-front", &Chart::draw(charts))?;
    }
    Ok(())
}

fn write_cracks(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "crack",
        "bonds",
        "tension",
        "shear",
        "rolling",
        "length_m",
        "path_bonds",
        "path_length_m",
        "end_to_end_m",
        "tortuosity",
        "orientation_deg",
        "first_s",
        "last_s",
    ];
    let rows = report.cracks.iter().map(|c| {
        let m = c.modes;
        row![
            c.number,
            c.bonds,
            m.tension,
            m.shear,
            m.rolling,
            c.length,
            c.path_bonds,
            c.path_length,
            c.end_to_end,
            c.tortuosity,
            c.orientation,
            c.first,
            c.last
        ]
    });
    Ok(folder.table("cracks", &head, rows)?)
}

fn write_segments(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "crack", "step", "time_s", "round", "bond", "mode", "on_path", "x0_m", "y0_m", "x1_m", "y1_m", "x2_m", "y2_m",
        "length_m",
    ];
    let rows = report.paths.segments.iter().map(|s| {
        let (e, [a, b, c]) = (&report.events[s.event], s.line);
        let on_path = u8::from(s.on_path);
        row![
            s.crack + 1,
            e.step,
            e.time,
            e.round,
            e.bond,
            e.mode,
            on_path,
            a[0],
            a[1],
            b[0],
            b[1],
            c[0],
            c[1],
            s.length
        ]
    });
    Ok(folder.table("crack-segments", &head, rows)?)
}

fn write_fronts(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "crack",
        "step",
        "time_s",
        "round",
        "bonds",
        "length_m",
        "back_m",
        "front_m",
        "back_speed_m_per_s",
        "front_speed_m_per_s",
    ];
    let rows = report.fronts.iter().map(|f| {
        let (back, front) = (cell(f.back_speed), cell(f.front_speed));
        row![f.crack, f.step, f.time, f.round, f.bonds, f.length, f.back, f.front, back, front]
    });
    Ok(folder.table("crack-front", &head, rows)?)
}

fn write_ruptures(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "step",
        "time_s",
        "round",
        "bond",
        "grain_i",
        "grain_j",
        "mode",
        "x_m",
        "y_m",
        "z_m",
        "normal_force_N",
        "tangential_force_N",
        "moment_Nm",
        "energy_J",
    ];
    let rows = report.events.iter().map(|e| {
        row![
            e.step,
            e.time,
            e.round,
            e.bond,
            e.grains[0],
            e.grains[1],
            e.mode,
            e.point[0],
            e.point[1],
            e.point[2],
            e.normal_force,
            e.tangential_force,
            e.moment,
            e.energy
        ]
    });
    Ok(folder.table("ruptures", &head, rows)?)
}
