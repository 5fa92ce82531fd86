//! What `dem-post envelope` writes.

use std::f64::consts::PI;

use dem_drawing::{Chart, Style, colour};
use dem_output::row;

use super::report::Report;
use crate::extent::range;
use crate::output::{Folder, Result, cell, number, short};

/// Points of a half circle.
const ARC: usize = 60;
/// Writes `envelope.csv` with a row for each run, and as drawings `envelope`, the circles with
/// their line, and `envelope-principal`, the principal stresses with theirs.
///
/// # Errors
/// [`crate::output::PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = ["run", "time_s", "load_N", "sigma_1_Pa", "sigma_2_Pa", "sigma_3_Pa", "why_left_out"];
    let circles =
        report.circles.iter().map(|c| row![c.run, c.time, c.load, c.major, cell(c.intermediate), c.minor, ""]);
    let left_out = report.left_out.iter().map(|out| row![out.run, "", "", "", "", "", out.why]);
    folder.table("envelope", &head, circles.chain(left_out))?;
    for (name, (chart, _)) in ["envelope", "envelope-principal"].into_iter().zip(charts(report)) {
        folder.draw(name, &Chart::draw(vec![chart]))?;
    }
    Ok(())
}

/// The circles and the principal stresses, each with its line and what it shows in words.
pub(crate) fn charts(report: &Report) -> [(Chart, &'static str); 2] {
    [
        (circles_chart(report), "Mohr circles at failure, with the line that they touch."),
        (principal(report), "Principal stresses at failure, with the line through them."),
    ]
}

/// Half circles over the normal stress, with the line that they touch; both axes have one scale.
fn circles_chart(report: &Report) -> Chart {
    let mut chart = Chart::new("normal stress (kPa), compression positive", "shear stress (kPa)");
    let mut points = vec![];
    // one curve: from circle to circle along the axis
    for circle in &report.circles {
        let (centre, radius) = (0.5 * (circle.major + circle.minor), 0.5 * (circle.major - circle.minor));
        for k in 0..=ARC {
            let angle = PI * (1.0 - k as f64 / ARC as f64);
            points.push((1e-3 * (centre + radius * angle.cos()), 1e-3 * radius * angle.sin().max(0.0)));
        }
    }
    let [low, high] = range(points.iter().map(|p| p.0));
    chart = chart.curve("at failure", colour::BLUE, Style::Thin, points);
    chart.equal = true;
    if let Some(line) = &report.envelope {
        let tan = line.friction_angle.value.to_radians().tan();
        let at = |normal: f64| (normal, 1e-3 * line.shear(1e3 * normal));
        // where the shear stress is zero, if that is not far beyond the circles
        let zero = -1e-3 * line.cohesion.value / tan;
        let first = if tan > 0.0 { zero.max(low - 0.5 * (high - low)).min(high) } else { low };
        let name = format!("φ = {}°, c = {} kPa", short(line.friction_angle.value), short(1e-3 * line.cohesion.value));
        chart = chart.curve(&name, colour::VERMILLION, Style::Line, vec![at(first), at(high)]);
    }
    chart
}

/// The principal stresses at failure, with the fitted line.
fn principal(report: &Report) -> Chart {
    let points: Vec<(f64, f64)> = report.circles.iter().map(|c| (1e-3 * c.minor, 1e-3 * c.major)).collect();
    let mut chart = Chart::new("least principal stress σ₃ (kPa)", "greatest principal stress σ₁ (kPa)");
    chart.pad_x = true;
    if let Some(line) = &report.envelope {
        let (slope, strength) = (line.slope.value, 1e-3 * line.unconfined_strength.value);
        let name = format!("σ₁ = {} σ₃ + {} kPa", number(slope), number(strength));
        let line = range(points.iter().map(|p| p.0)).map(|x| (x, slope * x + strength)).to_vec();
        chart = chart.curve(&name, colour::VERMILLION, Style::Line, line);
    }
    chart.curve("runs", colour::BLUE, Style::Points, points)
}
