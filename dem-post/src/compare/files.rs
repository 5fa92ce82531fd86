//! What `dem-post compare` writes.

use dem_history::History;

use super::report::{Break, Fate, Gap, Report};
use crate::extent::bonded_frame;
use crate::map::{Key, Link, Panel, Sample, draw};
use crate::output::{Folder, Result, cell};
use dem_drawing::{Chart, Drawing, Style, colour};
use dem_output::row;

/// Colours of bonds that broke in both runs, only in the first, only in the second.
const COLOURS: [&str; 3] = [colour::BLACK, colour::BLUE, colour::VERMILLION];
/// Width of their lines.
const WIDTH: f64 = 3.0;

/// Writes `scene.csv`, `distance.csv`, `bonds.csv`, and as drawings `distance`, `broken`, `bonds`
/// where any broke, and `load` where a wall is driven in either run. `a` is the first history.
///
/// # Errors
/// [`crate::output::PostError::Write`], and those of reading the history.
pub fn write(a: &History, report: &Report, folder: &mut Folder) -> Result<()> {
    let rows = report.scene.iter().map(|place| {
        let text = |value: &Option<String>| value.clone().unwrap_or_default();
        row![place.path, text(&place.a), text(&place.b)]
    });
    folder.table("scene", &["place", "a", "b"], rows)?;
    let head = ["time_s", "frame_a", "frame_b", "greatest_distance_radii", "grain", "rms_distance_radii"];
    let rows =
        report.gaps.iter().map(|gap| row![gap.time, gap.frames[0], gap.frames[1], gap.greatest, gap.grain, gap.rms]);
    folder.table("distance", &head, rows)?;
    let head = ["grain_i", "grain_j", "time_a_s", "mode_a", "time_b_s", "mode_b"];
    let rows = report.fates.iter().map(|fate| {
        let time = |found: Option<Break>| cell(found.map(|found| found.time));
        let mode = |found: Option<Break>| found.map_or("", |found| found.mode);
        row![fate.grains[0], fate.grains[1], time(fate.a), mode(fate.a), time(fate.b), mode(fate.b)]
    });
    folder.table("bonds", &head, rows)?;
    folder.draw("distance", &Chart::draw(vec![distance_chart(report)]))?;
    if !report.fates.is_empty() {
        folder.draw("broken", &Chart::draw(vec![broken_chart(report)]))?;
        folder.draw("bonds", &bond_map(a, report)?)?;
    }
    if report.curves.iter().any(|curve| !curve.time.is_empty()) {
        folder.draw("load", &Chart::draw(load_charts(report)))?;
    }
    Ok(())
}

/// Distances over time; the logarithmic axis cannot show zero distances.
fn distance_chart(report: &Report) -> Chart {
    let mut chart = report.clock.chart("distance between the grains of the two runs (radii)");
    chart.log_y = report.gaps.iter().any(|gap| gap.greatest > 0.0);
    let points = |value: fn(&Gap) -> f64| report.gaps.iter().map(|gap| (gap.time, value(gap))).collect();
    chart.curve("greatest", colour::BLUE, Style::Line, points(|gap| gap.greatest)).curve(
        "rms",
        colour::ORANGE,
        Style::Line,
        points(|gap| gap.rms),
    )
}

fn broken_chart(report: &Report) -> Chart {
    let end = report.gaps.last().map_or(0.0, |gap| gap.time);
    let mut chart = report.clock.chart("broken bonds");
    chart.y_is_count = true;
    for (k, list) in report.breaks.iter().enumerate() {
        let steps = list.iter().enumerate().map(|(n, found)| (found.time, (n + 1) as f64));
        let last = list.last().map_or(end, |found| found.time.max(end));
        let points = std::iter::once((0.0, 0.0)).chain(steps).chain([(last, list.len() as f64)]).collect();
        chart = chart.curve(["A", "B"][k], COLOURS[k + 1], Style::Steps, points);
    }
    chart
}

/// The load over the displacement, and over time: rigid samples do not move before they break.
fn load_charts(report: &Report) -> Vec<Chart> {
    let mut charts = vec![
        Chart::new("displacement of the wall (mm)", "force (N)"),
        report.clock.chart("displacement of the wall (mm)"),
    ];
    for (k, curve) in report.curves.iter().enumerate() {
        let [way, load] = &curve.wall;
        let (name, colour) = (["A", "B"][k], COLOURS[k + 1]);
        let millimetres = || way.iter().map(|x| 1e3 * x);
        let curves = [
            millimetres().zip(load.iter().copied()).collect::<Vec<_>>(),
            curve.time.iter().copied().zip(millimetres()).collect(),
        ];
        charts = charts
            .into_iter()
            .zip(curves)
            .map(|(chart, points)| chart.curve(name, colour, if k == 0 { Style::Line } else { Style::Thin }, points))
            .collect();
    }
    charts.iter_mut().for_each(|chart| chart.pad_x = true);
    charts
}

/// The bonds that broke, over the grains of the first run as they were bonded.
fn bond_map(history: &History, report: &Report) -> Result<Drawing> {
    let (d, frame) = (history.dimension(), bonded_frame(history)?);
    let grains = history.grain_state(frame)?;
    let centre = |grain: i32| grains.position[grain as usize * d..(grain as usize + 1) * d].to_vec();
    let kind = |fate: &Fate| match (fate.a, fate.b) {
        (Some(_), Some(_)) => 0,
        (Some(_), None) => 1,
        _ => 2,
    };
    let links = report.fates.iter().map(|fate| Link {
        from: centre(fate.grains[0]),
        to: centre(fate.grains[1]),
        width: WIDTH,
        colour: COLOURS[kind(fate)].into(),
    });
    let panel = Panel {
        caption: vec!["bonds that broke".into(), "positions when the bonds of A formed".into()],
        links: links.collect(),
        walls: history.wall_state(frame)?,
        fills: vec!["#f4f4f4".into(); history.grains()?.radius.len()],
        outline: "#cfcfcf",
        grains,
        ..Panel::default()
    };
    let label = |k: usize| format!("{}: {}", ["in both", "only in A", "only in B"][k], report.broken[k]);
    let legend = [0, 1, 2].map(|k| Key::Line(COLOURS[k], WIDTH, label(k)));
    Ok(draw(&Sample::read(history)?, &[panel], &legend))
}
