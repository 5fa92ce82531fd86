//! What `dem-post why` writes.

use dem_drawing::{Chart, Style};
use dem_history::RuptureMode;
use dem_output::row;

use super::report::{Moment, Report};
use super::rupture::Broken;
use super::utilisation::{Part, greatest};
use crate::cracks::{mode_colour, mode_name};
use crate::output::{Folder, Result, cell};

/// Writes `why-BOND.csv`: the load and the utilisation in each frame and, last, at rupture. Where
/// they are known in at least two frames, also the drawing `why-BOND`.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let name = format!("why-{}", report.bond);
    let head = [
        "step",
        "time_s",
        "source",
        "normal_force_N",
        "tangential_force_N",
        "moment_Nm",
        "twist_Nm",
        "tension",
        "shear",
        "rolling",
        "twist",
        "utilisation",
        "mode",
    ];
    let frames = report.frames.iter().map(|moment| line("frame", moment, moment.greatest.map_or("", |most| most.mode)));
    let own = report.broken.as_ref().map(|broken| {
        let Broken { step, time, local, parts, .. } = broken.clone();
        let moment = Moment { step, time, load: local, greatest: greatest(&parts), parts };
        line("rupture", &moment, broken.mode)
    });
    folder.table(&name, &head, frames.chain(own))?;
    if report.frames.len() >= 2 {
        folder.draw(&name, &Chart::draw(vec![chart(report)]))?;
    }
    Ok(())
}

fn line(source: &str, moment: &Moment, mode: &str) -> Vec<String> {
    let Moment { step, time, load, parts, greatest } = moment;
    let ratio = |mode: RuptureMode| cell(of(parts, mode).and_then(|part| part.utilisation));
    row![
        step,
        time,
        source,
        load.normal_force,
        load.tangential_force,
        cell(load.moment),
        cell(load.twist),
        ratio(RuptureMode::Tension),
        ratio(RuptureMode::Shear),
        ratio(RuptureMode::Rolling),
        ratio(RuptureMode::Twist),
        cell(greatest.map(|most| most.utilisation)),
        mode
    ]
}

/// What is known of a mode.
fn of(parts: &[Part], mode: RuptureMode) -> Option<&Part> {
    parts.iter().find(|part| part.mode == mode.label())
}

/// The utilisation of each mode over time, up to the rupture.
fn chart(report: &Report) -> Chart {
    let mut chart = report.clock.chart(&format!("utilisation of bond {}", report.bond));
    chart.pad_x = true;
    for &mode in RuptureMode::ALL {
        let ratio = |parts: &[Part]| of(parts, mode).and_then(|part| part.utilisation);
        let frames = report.frames.iter().filter_map(|moment| Some((moment.time, ratio(&moment.parts)?)));
        let end = report.broken.as_ref().and_then(|broken| Some((broken.time, ratio(&broken.parts)?)));
        let points: Vec<(f64, f64)> = frames.chain(end).collect();
        if !points.is_empty() {
            chart = chart.curve(&mode_name(mode), mode_colour(mode), Style::Line, points);
        }
    }
    chart.levels.push((1.0, "it breaks".into()));
    chart
}
