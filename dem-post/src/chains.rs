//! Force chains: the network of contact forces, and how the forces are distributed.
//!
//! A force here is the normal component r_n of a contact, positive in compression. ⟨f⟩ is the mean of |r_n| over the
//! contacts that carry a force; the strong network is the contacts with |r_n| > ⟨f⟩.

use dem_run::history::{ContactRows, History};
use serde::Serialize;

use crate::map::{Key, Link, Panel, Sample, draw};
use crate::moments;
use crate::output::{Folder, PostError, Result, Text, number, short};
use crate::plot::{Chart, Drawing, Style, colour};
use crate::row;

/// A contact carries a force if it has this share of the greatest.
const CARRIES: f64 = 1e-9;
/// Width of a line that carries ⟨f⟩, and the greatest width, units of the drawing.
const WIDTH: (f64, f64) = (1.3, 8.0);
/// Width of a bin of |f|/⟨f⟩, and the least number of forces in one.
const BIN: f64 = 0.25;
const LEAST: usize = 5;
/// Colours of the weak network, compression and tension.
const PALE: [&str; 2] = ["#9cc9e3", "#f0b27a"];

/// What the forces of one moment are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Contacts that carry a force.
    pub contacts: usize,
    /// Of these, in tension.
    pub in_tension: usize,
    /// Mean ⟨f⟩ of |r_n|, N.
    pub mean: f64,
    /// Greatest compression, N.
    pub greatest_compression: f64,
    /// Greatest tension, N.
    pub greatest_tension: f64,
    /// Contacts of the strong network.
    pub strong: usize,
    /// Share of the sum of |r_n| that the strong network carries.
    pub strong_share: f64,
    /// Standard deviation of |r_n| over ⟨f⟩.
    pub spread: f64,
}

/// The network at one moment.
#[derive(Clone, Debug, Serialize)]
pub struct Network {
    /// The frame.
    pub frame: usize,
    /// Its step.
    pub step: i64,
    /// Its time, s.
    pub time: f64,
    /// What its forces are like.
    #[serde(flatten)]
    pub statistics: Statistics,
    /// Density of |r_n|/⟨f⟩ in bins: (middle of the bin, density).
    pub distribution: Vec<(f64, f64)>,
    /// The contacts.
    #[serde(skip)]
    pub contacts: ContactRows,
}

/// The networks at the chosen moments.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// One entry for each moment.
    pub networks: Vec<Network>,
}

/// Reads the networks at the frames nearest to `times` (s), or at chosen ones.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history; [`PostError::Lacking`] where no contact carries a force at any
/// of them.
pub fn read(history: &History, times: &[f64]) -> Result<Report> {
    let mut networks = vec![];
    for frame in moments::chosen(history, times)? {
        let contacts = history.contacts(frame)?;
        let forces: Vec<f64> = (0..contacts.len()).map(|c| contacts.normal_force(c)).collect();
        let statistics = statistics(&forces);
        networks.push(Network {
            frame,
            step: history.steps()[frame],
            time: history.times()[frame],
            statistics,
            distribution: distribution(&forces, statistics.mean),
            contacts,
        });
    }
    if networks.iter().all(|network| network.statistics.contacts == 0) {
        let moments: Vec<String> = networks.iter().map(|network| format!("{} s", number(network.time))).collect();
        let what = format!("no contact carries a force at {}: choose other moments by --times", moments.join(", "));
        return Err(PostError::Lacking { path: history.path().into(), what });
    }
    Ok(Report { networks })
}

/// Magnitudes of the forces that count.
fn carried(forces: &[f64]) -> Vec<f64> {
    let greatest = forces.iter().fold(0.0f64, |max, f| max.max(f.abs()));
    forces.iter().map(|f| f.abs()).filter(|&f| f > CARRIES * greatest).collect()
}

/// What `forces` (N, positive in compression) are like; all zero where none is.
pub fn statistics(forces: &[f64]) -> Statistics {
    let carried = carried(forces);
    if carried.is_empty() {
        return Statistics::default();
    }
    let sum: f64 = carried.iter().sum();
    let mean = sum / carried.len() as f64;
    let strong: Vec<f64> = carried.iter().copied().filter(|&f| f > mean).collect();
    let variance = carried.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / carried.len() as f64;
    let greatest_tension = forces.iter().fold(0.0f64, |max, f| max.max(-f));
    let greatest_compression = forces.iter().fold(0.0f64, |max, f| max.max(*f));
    let threshold = CARRIES * greatest_tension.max(greatest_compression);
    Statistics {
        contacts: carried.len(),
        in_tension: forces.iter().filter(|&&f| f < -threshold).count(),
        mean,
        greatest_compression,
        greatest_tension,
        strong: strong.len(),
        strong_share: strong.iter().sum::<f64>() / sum,
        spread: variance.sqrt() / mean,
    }
}

/// Density of |f|/⟨f⟩, as (middle of the bin, density); its integral is 1.
///
/// Bins are 1/4 wide; where fewer than five forces fall into one, it is widened until that many do.
pub fn distribution(forces: &[f64], mean: f64) -> Vec<(f64, f64)> {
    let mut ratios: Vec<f64> = carried(forces).iter().map(|f| f / mean).collect();
    ratios.sort_by(f64::total_cmp);
    let all = ratios.len() as f64;
    let mut density = vec![];
    let mut low = 0.0;
    let mut rest = ratios.as_slice();
    while let Some(last) = rest.last() {
        let enough = rest[rest.len().min(LEAST) - 1];
        let mut high = low + BIN * ((enough - low) / BIN).floor() + BIN;
        // what would be left over is too little for a bin of its own
        if rest.len() - rest.partition_point(|&ratio| ratio < high) < LEAST {
            high = low + BIN * ((last - low) / BIN).floor() + BIN;
        }
        let count = rest.partition_point(|&ratio| ratio < high);
        density.push((0.5 * (low + high), count as f64 / (all * (high - low))));
        (low, rest) = (high, &rest[count..]);
    }
    density
}

impl Report {
    /// The report as a table.
    pub fn table(&self) -> String {
        let mut table = Text::new(&[
            "time (s)",
            "contacts",
            "in tension",
            "<f> (N)",
            "max compression (N)",
            "max tension (N)",
            "strong",
            "strong share",
            "spread",
        ]);
        for network in &self.networks {
            let s = network.statistics;
            table.row(vec![
                number(network.time),
                s.contacts.to_string(),
                s.in_tension.to_string(),
                number(s.mean),
                number(s.greatest_compression),
                number(s.greatest_tension),
                s.strong.to_string(),
                format!("{:.1} %", 100.0 * s.strong_share),
                number(s.spread),
            ]);
        }
        table.lines()
    }
}

/// Writes `forces.csv`, `distribution.csv`, and as drawings `chains` and `distribution`.
///
/// # Errors
/// [`PostError::Write`].
pub fn write(history: &History, report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "step",
        "time_s",
        "body_i",
        "body_j",
        "normal_force_N",
        "tangential_force_N",
        "ratio_to_mean",
        "strong",
        "status",
    ];
    let rows = report.networks.iter().flat_map(|network| {
        let (contacts, mean) = (&network.contacts, network.statistics.mean);
        (0..contacts.len()).map(move |c| {
            let force = contacts.normal_force(c);
            let ratio = if mean > 0.0 { force.abs() / mean } else { 0.0 };
            let [i, j] = contacts.pair[c];
            let (tangential, status) = (contacts.tangential_force(c), contacts.status[c].label());
            row![network.step, network.time, i, j, force, tangential, ratio, u8::from(ratio > 1.0), status]
        })
    });
    folder.table("forces", &head, rows)?;
    let rows = report.networks.iter().flat_map(|network| {
        network.distribution.iter().map(|(ratio, density)| row![network.step, network.time, ratio, density])
    });
    folder.table("distribution", &["step", "time_s", "ratio_to_mean", "density"], rows)?;
    folder.draw("chains", &network_map(history, report)?)?;
    Ok(folder.draw("distribution", &Chart::draw(vec![distribution_chart(report)]))?)
}

fn distribution_chart(report: &Report) -> Chart {
    let mut chart = Chart::new("normal force over its mean, |f|/⟨f⟩", "probability density");
    (chart.log_y, chart.set_off) = (true, true);
    for (k, network) in report.networks.iter().enumerate() {
        let colour = colour::CYCLE[k % colour::CYCLE.len()];
        let label = format!("t = {} s", number(network.time));
        chart = chart.curve(&label, colour, Style::Marked, network.distribution.clone());
    }
    chart
}

/// The map of the network: a line for each contact between the centres, or from a centre to the point on a wall.
fn network_map(history: &History, report: &Report) -> Result<Drawing> {
    let sample = Sample::read(history)?;
    let grains = history.grains()?.radius.len();
    let mut panels = vec![];
    for network in &report.networks {
        let state = history.grain_state(network.frame)?;
        let s = network.statistics;
        panels.push(Panel {
            caption: vec![format!("t = {} s", number(network.time)), format!("⟨f⟩ = {} N", short(s.mean))],
            links: links(&network.contacts, &state.position, s.mean, history.dimension()),
            grains: state,
            walls: history.wall_state(network.frame)?,
            fills: vec!["#f4f4f4"; grains],
            outline: "#c4c4c4",
        });
    }
    let legend = [
        Key::Line(colour::BLUE, 3.0 * WIDTH.0, "compression, 3⟨f⟩".into()),
        Key::Line(colour::VERMILLION, 3.0 * WIDTH.0, "tension, 3⟨f⟩".into()),
        Key::Line(PALE[0], 0.7 * WIDTH.0, "weak compression".into()),
        Key::Line(PALE[1], 0.7 * WIDTH.0, "weak tension".into()),
    ];
    Ok(draw(&sample, &panels, &legend))
}

/// The lines of a network, the strongest last, so that they lie on top.
fn links(contacts: &ContactRows, position: &[f64], mean: f64, d: usize) -> Vec<Link> {
    let centre = |grain: i32| position[grain as usize * d..(grain as usize + 1) * d].to_vec();
    let mut order: Vec<usize> =
        (0..contacts.len()).filter(|&c| contacts.normal_force(c).abs() > CARRIES * mean).collect();
    order.sort_by(|&a, &b| contacts.normal_force(a).abs().total_cmp(&contacts.normal_force(b).abs()));
    let link = |c: usize| {
        let ([i, j], force) = (contacts.pair[c], contacts.normal_force(c));
        let (ratio, tension) = (force.abs() / mean, usize::from(force < 0.0));
        Link {
            from: centre(i),
            to: if j < 0 { contacts.point[c * d..(c + 1) * d].to_vec() } else { centre(j) },
            width: (WIDTH.0 * ratio).min(WIDTH.1),
            colour: if ratio > 1.0 { [colour::BLUE, colour::VERMILLION][tension] } else { PALE[tension] },
        }
    };
    order.into_iter().map(link).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_known_forces() {
        // |f| = 1, 1, 2, 4: mean 2, strong is the 4 alone; the zero and the rounding error carry nothing
        let s = statistics(&[1.0, -1.0, 2.0, -4.0, 0.0, 1e-12]);
        assert_eq!((s.contacts, s.in_tension, s.strong), (4, 2, 1));
        assert_eq!((s.mean, s.greatest_compression, s.greatest_tension), (2.0, 2.0, 4.0));
        assert_eq!(s.strong_share, 0.5);
        assert!((s.spread - 1.5f64.sqrt() / 2.0).abs() < 1e-15);
    }

    #[test]
    fn no_force_is_no_statistics() {
        assert_eq!(statistics(&[]), Statistics::default());
        assert_eq!(statistics(&[0.0, 0.0]).contacts, 0);
        assert_eq!(distribution(&[0.0], 0.0), []);
    }

    #[test]
    fn the_distribution_integrates_to_one() {
        let forces: Vec<f64> = (1..200).map(|k| f64::from(k) * if k % 3 == 0 { -0.1 } else { 0.1 }).collect();
        let density = distribution(&forces, statistics(&forces).mean);
        let mut low = 0.0;
        let mut sum = 0.0;
        for (middle, density) in &density {
            let width = 2.0 * (middle - low);
            sum += density * width;
            low += width;
        }
        assert!((sum - 1.0).abs() < 1e-12);
        // uniform magnitudes: |f|/⟨f⟩ is uniform on 0…2, with density 1/2
        assert!(density.iter().all(|(_, density)| (density - 0.5).abs() < 0.03), "{density:?}");
    }

    #[test]
    fn bins_of_the_tail_are_widened() {
        // nineteen forces of 1 and one of 21: mean 2
        let mut forces = vec![1.0; 19];
        forces.push(21.0);
        let density = distribution(&forces, statistics(&forces).mean);
        assert_eq!(density.len(), 1);
        assert_eq!(density[0].0, 0.5 * 10.75);
    }

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
        assert_eq!((lines[1].to.as_slice(), lines[1].colour), (&[1.0, 0.0][..], colour::VERMILLION));
    }
}
