//! The drawings of forces and chains.

use dem_history::{ContactRows, History};

use super::report::{CARRIES, Report};
use crate::map::{Colour, Key, Link, Materials, Panel, Sample, draw};
use crate::output::{Result, short};
use crate::title::Titles;
use dem_drawing::{Chart, Drawing, Style, colour};

/// Width of a line that carries the force of the scale, and the greatest width, units of the
/// drawing: of disks, and of spheres.
const WIDTH: [(f64, f64); 2] = [(1.3, 8.0), (0.6, 4.0)];
/// Width of the thinnest lines: visible where the forces of other moments are far greater.
const HAIRLINE: f64 = 0.15;
/// Colours of the weak network, compression and tension; also of grains in chains.
const PALE: [&str; 2] = ["#9cc9e3", "#f0b27a"];
/// Fill and outline of other grains.
const GRAIN: [&str; 2] = ["#f4f4f4", "#c4c4c4"];
/// Width of the line of a chain: of disks, and of spheres.
const CHAIN: [f64; 2] = [3.0, 2.4];

/// The lines that a map of forces needs in its legend; `scale` is the force (N) up to which lines
/// are pale.
pub fn force_legend(d: usize, scale: f64) -> Vec<Key> {
    let width = WIDTH[d - 2].0;
    let strong = |what: &str| format!("{what}, {} N", short(3.0 * scale));
    let mut legend = vec![
        Key::Line(colour::BLUE, 3.0 * width, strong("compression")),
        Key::Line(colour::VERMILLION, 3.0 * width, strong("tension")),
    ];
    if d == 2 {
        let weak = |what: &str| format!("{what} below {} N", short(scale));
        legend.push(Key::Line(PALE[0], 0.7 * width, weak("compression")));
        legend.push(Key::Line(PALE[1], 0.7 * width, weak("tension")));
    }
    legend
}

/// Fills of the grains behind lines, with the legend of their materials; none for spheres, which
/// would hide the lines.
fn behind_lines(history: &History) -> Result<(Vec<Colour>, Vec<Key>)> {
    if history.dimension() == 3 {
        return Ok((vec![], vec![]));
    }
    let materials = Materials::read(history)?;
    let fills = Materials::fills(materials.as_ref(), history.grains()?.radius.len(), GRAIN[0]);
    Ok((fills, materials.iter().flat_map(|materials| materials.keys(GRAIN[1])).collect()))
}

/// Number of chains with at least so many grains, at each moment: one chart for each kind with
/// chains of two or more lengths.
pub fn length_charts(report: &Report) -> Vec<Chart> {
    let mut charts = vec![];
    for (kind, label) in [(0, "chains in compression"), (1, "chains in tension")] {
        let mut chart = Chart::new("grains, at least", label);
        (chart.pad_x, chart.log_y, chart.x_is_count) = (true, true, true);
        for (k, network) in report.networks.iter().enumerate() {
            let Some(figures) = network.chain_figures.get(kind).filter(|figures| figures.count > 0) else {
                continue;
            };
            let mut left = figures.count;
            let mut points = vec![];
            for &(grains, chains) in &figures.lengths {
                points.push((grains as f64, left as f64));
                left -= chains;
            }
            let colour = colour::CYCLE[k % colour::CYCLE.len()];
            chart = chart.curve(&report.clock.at(network.time), colour, Style::Marked, points);
        }
        // a single point is no distribution
        if chart.curves.iter().any(|curve| curve.points.len() > 1) {
            charts.push(chart);
        }
    }
    charts
}

/// The map of the chains: their grains filled, a line through the centres.
///
/// # Errors
/// Those of reading the history.
pub fn chain_map(history: &History, report: &Report, titles: &Titles) -> Result<Drawing> {
    let d = history.dimension();
    let (behind, materials) = behind_lines(history)?;
    let mut panels = vec![];
    for network in &report.networks {
        let state = history.grain_state(network.frame)?;
        let centre = |grain: usize| state.position[grain * d..(grain + 1) * d].to_vec();
        let (mut fills, mut links) = (behind.clone(), vec![]);
        for (k, chains) in network.chains.iter().enumerate() {
            for chain in &chains.chains {
                for &grain in chain {
                    if let Some(fill) = fills.get_mut(grain) {
                        *fill = PALE[k].into();
                    }
                }
                let colour = [colour::BLUE, colour::VERMILLION][k];
                links.extend(chain.windows(2).map(|pair| Link {
                    from: centre(pair[0]),
                    to: centre(pair[1]),
                    width: CHAIN[d - 2],
                    colour: colour.into(),
                }));
            }
        }
        let number_of = |k: usize| network.chain_figures[k].count;
        panels.push(Panel {
            caption: vec![
                titles.of(history, network.frame),
                format!("chains: {} in compression, {} in tension", number_of(0), number_of(1)),
            ],
            walls: history.wall_state(network.frame)?,
            grains: state,
            fills,
            outline: GRAIN[1],
            links,
            ..Panel::default()
        });
    }
    let mut legend = vec![
        Key::Line(colour::BLUE, CHAIN[d - 2], "chain in compression".into()),
        Key::Line(colour::VERMILLION, CHAIN[d - 2], "chain in tension".into()),
    ];
    legend.extend(materials);
    Ok(draw(&Sample::with_depth(history)?, &panels, &legend))
}

/// The distributions of the forces at each moment.
pub fn distribution_chart(report: &Report) -> Chart {
    let mut chart = Chart::new("normal force over its mean, |f|/⟨f⟩", "probability density");
    (chart.log_y, chart.pad_x) = (true, true);
    for (k, network) in report.networks.iter().enumerate() {
        let colour = colour::CYCLE[k % colour::CYCLE.len()];
        let label = report.clock.at(network.time);
        chart = chart.curve(&label, colour, Style::Marked, network.distribution.clone());
    }
    chart
}

/// The map of the network: a line for each contact between the centres, or from a centre to the
/// point on a wall. Widths are of forces over `mean` (N) in all panels.
///
/// # Errors
/// Those of reading the history.
pub fn network_map(history: &History, report: &Report, titles: &Titles, mean: f64) -> Result<Drawing> {
    let (sample, d) = (Sample::with_depth(history)?, history.dimension());
    let (behind, materials) = behind_lines(history)?;
    let mut panels = vec![];
    for network in &report.networks {
        let state = history.grain_state(network.frame)?;
        let caption = format!("⟨f⟩ = {} N", short(network.statistics.mean));
        panels.push(Panel {
            caption: vec![titles.of(history, network.frame), caption],
            links: links(&network.contacts, &state.position, mean, d),
            grains: state,
            walls: history.wall_state(network.frame)?,
            fills: behind.clone(),
            outline: GRAIN[1],
            ..Panel::default()
        });
    }
    let mut legend = force_legend(d, mean);
    legend.extend(materials);
    Ok(draw(&sample, &panels, &legend))
}

/// The lines of a network, the strongest last, so that they lie on top. For spheres only the lines
/// above the mean, because many more lie behind each other.
pub fn links(contacts: &ContactRows, position: &[f64], mean: f64, d: usize) -> Vec<Link> {
    let centre = |grain: i32| position[grain as usize * d..(grain as usize + 1) * d].to_vec();
    let (width, greatest) = WIDTH[d - 2];
    let least = if d == 2 { CARRIES * mean } else { mean };
    let mut order: Vec<usize> = (0..contacts.len()).filter(|&c| contacts.normal_force(c).abs() > least).collect();
    order.sort_by(|&a, &b| contacts.normal_force(a).abs().total_cmp(&contacts.normal_force(b).abs()));
    let link = |c: usize| {
        let ([i, j], force) = (contacts.pair[c], contacts.normal_force(c));
        let (ratio, tension) = (force.abs() / mean, usize::from(force < 0.0));
        Link {
            from: centre(i),
            to: if j < 0 { contacts.point[c * d..(c + 1) * d].to_vec() } else { centre(j) },
            width: (width * ratio).clamp(HAIRLINE, greatest),
            colour: if ratio > 1.0 { [colour::BLUE, colour::VERMILLION][tension] } else { PALE[tension] }.into(),
        }
    };
    order.into_iter().map(link).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_join_centres_or_end_on_the_wall() {
        let contacts = ContactRows {
            pair: vec![[0, 1], [1, -1]],
            point: vec![0.5, 0.0, 1.0, -0.5],
            reaction: vec![-3.0, 0.0, 1.0, 0.0],
            ..ContactRows::default()
        };
        let lines = links(&contacts, &[0.0, 0.0, 1.0, 0.0], 2.0, 2);
        // the stronger one comes last
        assert_eq!((lines[0].from.as_slice(), lines[0].to.as_slice()), (&[1.0, 0.0][..], &[1.0, -0.5][..]));
        assert_eq!((lines[1].to.as_slice(), &*lines[1].colour), (&[1.0, 0.0][..], colour::VERMILLION));
    }

    #[test]
    fn of_spheres_lines_that_carry_less_than_the_mean_are_left_out() {
        let contacts = ContactRows {
            pair: vec![[0, 1], [1, -1]],
            point: vec![0.5, 0.0, 0.0, 1.0, 0.0, -0.5],
            reaction: vec![-3.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            ..ContactRows::default()
        };
        let lines = links(&contacts, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 2.0, 3);
        assert_eq!(lines.len(), 1);
        assert_eq!((lines[0].to.as_slice(), &*lines[0].colour), (&[1.0, 0.0, 0.0][..], colour::VERMILLION));
    }
}
