//! What `dem-post chains` writes.

use dem_drawing::Chart;
use dem_history::History;
use dem_output::row;

use super::pictures::{chain_map, distribution_chart, length_charts, network_map};
use super::report::Report;
use crate::output::{Folder, Result};
use crate::title::Titles;

/// Writes `forces.csv`, `distribution.csv`, `force-chains.csv`, `force-chain-lengths.csv`, and as
/// drawings `chains` (the network), `distribution`, `force-chains` and, where chains differ in
/// length, `force-chain-lengths`.
///
/// # Errors
/// [`crate::output::PostError::Write`].
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
    let titles = Titles::read(history)?;
    folder.draw("chains", &network_map(history, report, &titles, report.greatest_mean())?)?;
    folder.draw("distribution", &Chart::draw(vec![distribution_chart(report)]))?;
    write_chains(report, folder)?;
    folder.draw("force-chains", &chain_map(history, report, &titles)?)?;
    let charts = length_charts(report);
    if !charts.is_empty() {
        folder.draw("force-chain-lengths", &Chart::draw(charts))?;
    }
    Ok(())
}

fn write_chains(report: &Report, folder: &mut Folder) -> Result<()> {
    let head =
        ["step", "time_s", "kind", "chain", "place", "grain", "load_Pa", "direction_x", "direction_y", "direction_z"];
    let mut rows = vec![];
    for network in &report.networks {
        for chains in &network.chains {
            let members =
                chains.chains.iter().enumerate().flat_map(|(k, chain)| chain.iter().enumerate().map(move |m| (k, m)));
            for (k, (place, &grain)) in members {
                let (kind, load, [x, y, z]) = (chains.kind.label(), chains.load[grain], chains.direction[grain]);
                rows.push(row![network.step, network.time, kind, k + 1, place + 1, grain, load, x, y, z]);
            }
        }
    }
    folder.table("force-chains", &head, rows.into_iter())?;
    let rows = report.networks.iter().flat_map(|network| {
        network.chain_figures.iter().flat_map(move |f| {
            f.lengths
                .iter()
                .map(move |(grains, chains)| row![network.step, network.time, f.kind.label(), grains, chains])
        })
    });
    Ok(folder.table("force-chain-lengths", &["step", "time_s", "kind", "grains", "chains"], rows)?)
}
