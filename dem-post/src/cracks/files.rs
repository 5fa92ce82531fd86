//! What `dem-post cracks` writes.

use dem_history::History;

use super::pictures::{
    ColourBy, broken_chart, crack_map, decohesion, fragment_charts, fragment_map, front_charts, surface_maps,
};
use super::report::{Report, broken_over_time};
use super::surfaces::Facet;
use crate::fragments::{Fragment, fragment_list};
use crate::map::Sample;
use crate::moments;
use crate::output::{Folder, Result, cell};
use crate::title::Titles;
use dem_drawing::Chart;
use dem_output::row;

/// Writes `ruptures.csv`, `broken.csv`, `fragments.csv` and `fragment-list.csv`, and as drawings
/// `broken`, `fragments`, `fragment-map` and `decohesion`, for spheres also `decohesion-inside`.
/// The list and the maps are at the moments nearest to `times` (s), or at chosen ones. Where cracks
/// were found, also `cracks.csv`, `crack-growth.csv`, and the drawings `cracks`, whose colours show
/// `by`, and, where one grew step by step or round by round, `crack-front`; in 2D
/// `crack-segments.csv`, `crack-front.csv` and, where the cracks fill a small part of the sample,
/// the drawing `cracks-near`; in 3D `crack-facets.csv`, their corners in `crack-facets.vtk`, and
/// the drawings `cracks-along-y` and `cracks-along-x`.
///
/// # Errors
/// [`crate::output::PostError::Write`], and [`crate::output::PostError::Usage`] for times outside
/// the history.
pub fn write(history: &History, report: &Report, times: &[f64], by: ColourBy, folder: &mut Folder) -> Result<()> {
    let frames = moments::chosen(history, times)?;
    write_ruptures(report, folder)?;
    let curve = broken_over_time(&report.events);
    let rows = curve.iter().map(|(time, n)| row![time, n[0], n[1], n[2], n[3], n.iter().sum::<usize>()]);
    folder.table("broken", &["time_s", "tension", "shear", "rolling", "twist", "total"], rows)?;
    let rows = report.fragments.iter().map(|pieces| {
        let f = pieces.fragments;
        row![pieces.step, pieces.time, f.count, f.singles, f.largest, f.largest_mass_fraction]
    });
    folder.table(
        "fragments",
        &["step", "time_s", "fragments", "single_grains", "largest_grains", "largest_mass_fraction"],
        rows,
    )?;
    let (grains, bonds) = (history.grains()?, history.bonds()?);
    let list = |&frame| {
        Ok(fragment_list(&grains, &history.grain_state(frame)?.position, &bonds, &history.bond_status(frame)?))
    };
    let fragments = frames.iter().map(list).collect::<Result<Vec<_>>>()?;
    write_fragments(history, &frames, &fragments, folder)?;
    let end = history.times().last().copied().unwrap_or(0.0);
    folder.draw("broken", &Chart::draw(vec![broken_chart(report, &curve, end)]))?;
    folder.draw("fragments", &Chart::draw(fragment_charts(report)))?;
    let in_space = history.dimension() == 3;
    let (sample, titles) = (Sample::with_depth(history)?, Titles::read(history)?);
    folder.draw("fragment-map", &fragment_map(history, &sample, &titles, &frames, &fragments)?)?;
    folder.draw("decohesion", &decohesion(history, &sample, &titles, &frames)?)?;
    if in_space {
        folder.draw("decohesion-inside", &decohesion(history, &Sample::cut_open(history)?, &titles, &frames)?)?;
    }
    let sizes = if !report.cracks.is_empty() {
        write_cracks(report, folder)?;
        write_segments(report, folder)?;
        write_fronts(report, folder)?;
        let (all, near) = crack_map(history, report, by)?;
        folder.draw("cracks", &all)?;
        if let Some(near) = near {
            folder.draw("cracks-near", &near)?;
        }
        ["length_m", "longest_m"]
    } else if !report.surfaces.is_empty() {
        write_surfaces(report, folder)?;
        write_facets(report, folder)?;
        let [whole, front, side] = surface_maps(history, report, by)?;
        folder.draw("cracks", &whole)?;
        folder.draw("cracks-along-y", &front)?;
        folder.draw("cracks-along-x", &side)?;
        ["area_m2", "largest_m2"]
    } else {
        return Ok(());
    };
    let head = ["step", "time_s", "round", "bonds", "cracks", sizes[0], sizes[1]];
    let rows = report.growth.iter().map(|g| row![g.step, g.time, g.round, g.bonds, g.cracks, g.size, g.largest]);
    folder.table("crack-growth", &head, rows)?;
    let charts = front_charts(report);
    if !charts.is_empty() {
        folder.draw("crack-front", &Chart::draw(charts))?;
    }
    Ok(())
}

/// The pieces one by one, the heaviest first, at each of `frames`.
fn write_fragments(history: &History, frames: &[usize], lists: &[Vec<Fragment>], folder: &mut Folder) -> Result<()> {
    let rows = frames.iter().zip(lists).flat_map(|(&frame, list)| {
        let (step, time) = (history.steps()[frame], history.times()[frame]);
        list.iter().enumerate().map(move |(k, f)| {
            let at = |axis: usize| cell(f.centre.get(axis).copied());
            row![step, time, k + 1, f.grains.len(), f.mass, f.mass_fraction, f.filled, at(0), at(1), at(2)]
        })
    });
    let filled = if history.dimension() == 2 { "area_m2" } else { "volume_m3" };
    let head = ["step", "time_s", "fragment", "grains", "mass_kg", "mass_fraction", filled, "x_m", "y_m", "z_m"];
    Ok(folder.table("fragment-list", &head, rows)?)
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

fn write_surfaces(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "crack", "bonds", "tension", "shear", "rolling", "twist", "area_m2", "extent_m", "normal_x", "normal_y",
        "normal_z", "flatness", "first_s", "last_s",
    ];
    let rows = report.surfaces.iter().map(|c| {
        let (m, [x, y, z]) = (c.modes, c.normal);
        row![
            c.number, c.bonds, m.tension, m.shear, m.rolling, m.twist, c.area, c.extent, x, y, z, c.flatness, c.first,
            c.last
        ]
    });
    Ok(folder.table("cracks", &head, rows)?)
}

/// A table of the facets, and the facets with their corners as poly data for ParaView.
fn write_facets(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "crack", "step", "time_s", "round", "bond", "mode", "area_m2", "normal_x", "normal_y", "normal_z", "x_m",
        "y_m", "z_m",
    ];
    let rows = report.faces.facets.iter().map(|f| {
        let (e, [x, y, z]) = (&report.events[f.event], f.normal);
        let crack = f.crack + 1;
        row![crack, e.step, e.time, e.round, e.bond, e.mode, f.area, x, y, z, e.point[0], e.point[1], e.point[2]]
    });
    folder.table("crack-facets", &head, rows)?;
    Ok(folder.write("crack-facets.vtk", poly_data(report).as_bytes())?)
}

/// The facets in VTK's legacy format.
fn poly_data(report: &Report) -> String {
    let facets: Vec<&Facet> = report.faces.seen().collect();
    let corners: usize = facets.iter().map(|f| f.corners.len()).sum();
    let mut text =
        String::from("# vtk DataFile Version 3.0\nfacets of broken bonds, m and s\nASCII\nDATASET POLYDATA\n");
    text += &format!("POINTS {corners} double\n");
    for [x, y, z] in facets.iter().flat_map(|f| &f.corners) {
        text += &format!("{x} {y} {z}\n");
    }
    text += &format!("POLYGONS {} {}\n", facets.len(), facets.len() + corners);
    let mut first = 0;
    for facet in &facets {
        let next = first + facet.corners.len();
        let ids: Vec<String> = (first..next).map(|k| k.to_string()).collect();
        text += &format!("{} {}\n", ids.len(), ids.join(" "));
        first = next;
    }
    text += &format!("CELL_DATA {}\n", facets.len());
    let mut array = |name: &str, kind: &str, value: &dyn Fn(&Facet) -> String| {
        text += &format!("SCALARS {name} {kind} 1\nLOOKUP_TABLE default\n");
        facets.iter().for_each(|facet| text += &format!("{}\n", value(facet)));
    };
    array("time", "double", &|f| report.events[f.event].time.to_string());
    array("crack", "int", &|f| (f.crack + 1).to_string());
    // as in the history: 0 is intact
    array("mode", "int", &|f| (1 + report.events[f.event].mode_number()).to_string());
    text
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
        "twist_Nm",
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
            e.twist.map_or(String::new(), |twist| twist.to_string()),
            e.energy
        ]
    });
    Ok(folder.table("ruptures", &head, rows)?)
}
