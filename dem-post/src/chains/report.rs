//! The contact forces and force chains at some moments: the report, and how it is computed from a
//! history.

use dem_history::{ContactRows, History};
use serde::Serialize;

use super::quasilinear::{Chains, Kind, find};
use super::stress::{grain_stress, thickness};
use crate::clock::Clock;
use crate::moments;
use crate::output::{PostError, Result, Text, number};

/// A contact carries a force if the force is at least this share of the greatest one.
pub(super) const CARRIES: f64 = 1e-9;
/// Width of a bin of |f|/⟨f⟩, and the least number of forces in one.
const BIN: f64 = 0.25;
const LEAST: usize = 5;

/// The columns of the table of chains, after the time.
const CHAIN_HEAD: [&str; 7] = [
    "chains in",
    "number",
    "mean length (grains)",
    "longest",
    "grains in chains",
    "share of the force",
    "threshold (kPa)",
];

/// Statistics of the forces at one moment.
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

/// The chains of one kind at one moment, in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChainFigures {
    /// Compression or tension.
    pub kind: Kind,
    /// Number of chains.
    pub count: usize,
    /// Grains in chains.
    pub grains: usize,
    /// Share of all grains, 0 to 1.
    pub grain_share: f64,
    /// Share of the sum of normal forces of this kind that the links of chains carry, 0 to 1.
    pub load_share: f64,
    /// Mean number of grains of a chain; 0 without chains.
    pub mean_length: f64,
    /// Grains of the longest chain.
    pub longest: usize,
    /// Mean load of the grains whose load is positive, Pa: grains of a chain have more.
    pub mean_load: f64,
    /// How many chains have how many grains: (grains, chains).
    pub lengths: Vec<(usize, usize)>,
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
    /// Statistics of its forces.
    #[serde(flatten)]
    pub statistics: Statistics,
    /// Density of |r_n|/⟨f⟩ in bins: (middle of the bin, density).
    pub distribution: Vec<(f64, f64)>,
    /// The chains in compression and in tension, in numbers.
    pub chain_figures: Vec<ChainFigures>,
    /// These chains.
    #[serde(skip)]
    pub chains: Vec<Chains>,
    /// The contacts.
    #[serde(skip)]
    pub contacts: ContactRows,
}

/// The networks at the chosen moments.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// One entry for each moment.
    pub networks: Vec<Network>,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
}

/// Reads the networks at the frames nearest to `times` (s or steps), or at chosen ones.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history; [`PostError::Lacking`] where no contact
/// carries a force at any of these moments, or where forces were not recorded.
pub fn read(history: &History, times: &[f64]) -> Result<Report> {
    require_reactions(history)?;
    let clock = Clock::of(history);
    let mut networks = vec![];
    for frame in moments::chosen(history, times)? {
        networks.push(network(history, frame)?);
    }
    if networks.iter().all(|network| network.statistics.contacts == 0) {
        let moments: Vec<String> = networks.iter().map(|network| clock.moment(network.time)).collect();
        let what =
            format!("no contact carries a normal force at {}: choose other times with --times", moments.join(", "));
        return Err(PostError::Lacking { path: history.path().into(), what });
    }
    Ok(Report { networks, clock })
}

/// Rejects a history without the reactions of its contacts.
///
/// # Errors
/// [`PostError::Lacking`] where the scene excluded them.
pub fn require_reactions(history: &History) -> Result<()> {
    if history.has_reactions() {
        return Ok(());
    }
    let what = "its scene does not record reactions: run it with output.reactions=true".into();
    Err(PostError::Lacking { path: history.path().into(), what })
}

/// The network at frame `frame`.
fn network(history: &History, frame: usize) -> Result<Network> {
    let (radius, d) = (history.grains()?.radius, history.dimension());
    let contacts = contacts(history, frame, &radius)?;
    let forces = normal_forces(&contacts);
    let statistics = statistics(&forces);
    let position = history.grain_state(frame)?.position;
    let stress = grain_stress(&contacts, &position, &radius, d, thickness(history)?);
    let chains = [Kind::Compression, Kind::Tension].map(|kind| find(kind, &contacts, &position, &stress, d)).to_vec();
    Ok(Network {
        frame,
        step: history.steps()[frame],
        time: history.times()[frame],
        statistics,
        distribution: distribution(&forces, statistics.mean),
        chain_figures: chains.iter().map(|chains| figures(chains, radius.len())).collect(),
        chains,
        contacts,
    })
}

/// The contacts of a frame, without the normal forces that are solver error; `radius` is that of
/// each grain (m).
///
/// # Errors
/// Those of reading the history.
pub fn contacts(history: &History, frame: usize, radius: &[f64]) -> Result<ContactRows> {
    let mut contacts = history.contacts(frame)?;
    drop_round_off(&mut contacts, radius.iter().copied().fold(0.0, f64::max));
    Ok(contacts)
}

/// Sets normal forces to zero that are negligible relative to the greatest tangential force, or to
/// the greatest moment over the greatest radius (m).
fn drop_round_off(contacts: &mut ContactRows, greatest_radius: f64) {
    let tangential = (0..contacts.len()).map(|c| contacts.tangential_force(c));
    let moments = contacts.moment.iter().map(|moment| moment.abs() / greatest_radius);
    let greatest = tangential.chain(moments).fold(0.0, f64::max);
    let rows = contacts.reaction_rows();
    for normal in contacts.reaction.iter_mut().step_by(rows.max(1)) {
        if normal.abs() <= CARRIES * greatest {
            *normal = 0.0;
        }
    }
}

/// Normal force of each contact, N, positive in compression.
pub fn normal_forces(contacts: &ContactRows) -> Vec<f64> {
    (0..contacts.len()).map(|c| contacts.normal_force(c)).collect()
}

/// The chains in numbers, in a sample of `grains` grains.
fn figures(chains: &Chains, grains: usize) -> ChainFigures {
    let count = chains.chains.len();
    let members: usize = chains.chains.iter().map(Vec::len).sum();
    let mut lengths: Vec<(usize, usize)> = vec![];
    // the longest come first
    for chain in chains.chains.iter().rev() {
        match lengths.last_mut() {
            Some((length, number)) if *length == chain.len() => *number += 1,
            _ => lengths.push((chain.len(), 1)),
        }
    }
    ChainFigures {
        kind: chains.kind,
        count,
        grains: members,
        grain_share: members as f64 / grains as f64,
        load_share: chains.share,
        mean_length: if count > 0 { members as f64 / count as f64 } else { 0.0 },
        longest: chains.chains.first().map_or(0, Vec::len),
        mean_load: chains.mean,
        lengths,
    }
}

/// Magnitudes of the forces above the threshold.
fn carried(forces: &[f64]) -> Vec<f64> {
    let greatest = forces.iter().fold(0.0f64, |max, f| max.max(f.abs()));
    forces.iter().map(|f| f.abs()).filter(|&f| f > CARRIES * greatest).collect()
}

/// Statistics of `forces` (N, positive in compression); all zero without forces.
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
        // an empty sum is −0.0 and would be printed with its sign
        strong_share: (0.0 + strong.iter().sum::<f64>()) / sum,
        spread: variance.sqrt() / mean,
    }
}

/// Density of |f|/⟨f⟩, as (middle of the bin, density); its integral is 1.
///
/// Bins are 1/4 wide; a bin with fewer than five forces is widened until it has at least five.
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
        // the remaining forces would be too few for another bin
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
    /// The greatest mean force of the networks, N.
    pub fn greatest_mean(&self) -> f64 {
        self.networks.iter().map(|network| network.statistics.mean).fold(0.0, f64::max)
    }

    /// The report as a table.
    pub fn table(&self) -> String {
        let mut table = Text::new(&[
            self.clock.title(),
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
                number(self.clock.value(network.time)),
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
        table.lines() + "\n" + &self.chain_table()
    }

    /// The columns of the table of chains.
    pub fn chain_head(&self) -> Vec<&'static str> {
        [self.clock.title()].into_iter().chain(CHAIN_HEAD).collect()
    }

    /// The chains at each moment, one kind per line.
    pub fn chain_rows(&self) -> Vec<Vec<String>> {
        let rows = self.networks.iter().flat_map(|network| network.chain_figures.iter().map(|f| (network.time, f)));
        let row = |(time, f): (f64, &ChainFigures)| {
            vec![
                number(self.clock.value(time)),
                f.kind.label().into(),
                f.count.to_string(),
                format!("{:.1}", f.mean_length),
                f.longest.to_string(),
                format!("{} ({:.1} %)", f.grains, 100.0 * f.grain_share),
                format!("{:.1} %", 100.0 * f.load_share),
                number(1e-3 * f.mean_load),
            ]
        };
        rows.map(row).collect()
    }

    fn chain_table(&self) -> String {
        let mut table = Text::new(&self.chain_head());
        self.chain_rows().into_iter().for_each(|row| table.row(row));
        table.lines()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_known_forces() {
        // |f| = 1, 1, 2, 4: mean 2, strong is the 4 alone; the zero and the round-off carry nothing
        let s = statistics(&[1.0, -1.0, 2.0, -4.0, 0.0, 1e-12]);
        assert_eq!((s.contacts, s.in_tension, s.strong), (4, 2, 1));
        assert_eq!((s.mean, s.greatest_compression, s.greatest_tension), (2.0, 2.0, 4.0));
        assert_eq!(s.strong_share, 0.5);
        assert!((s.spread - 1.5f64.sqrt() / 2.0).abs() < 1e-15);
    }

    #[test]
    fn what_the_solver_leaves_beside_tangential_forces_or_moments_is_no_normal_force() {
        let mut contacts = ContactRows {
            pair: vec![[0, 1], [1, 2], [2, 3]],
            reaction: vec![1e-10, 1.0, 1e-3, 0.5, 0.0, 0.0],
            normal: vec![0.0; 6],
            ..ContactRows::default()
        };
        drop_round_off(&mut contacts, 1e-3);
        assert_eq!(normal_forces(&contacts), [0.0, 1e-3, 0.0]);
        contacts.moment = vec![0.0, 1e4, 0.0];
        drop_round_off(&mut contacts, 1e-3);
        assert_eq!(normal_forces(&contacts), [0.0; 3]);
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
}
