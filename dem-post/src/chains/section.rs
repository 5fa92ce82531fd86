//! What the page of a report shows of contact forces and force chains.

use dem_history::History;

use super::pictures::{chain_map, distribution_chart, length_charts, network_map};
use super::report::Report;
use crate::output::Result;
use crate::section::{Figure, Maps, OnPage, Section, Table, capitalised, chart_figure, map_figure};

impl OnPage for Report {
    const ID: &'static str = "chains";
    const TITLE: &'static str = "Forces and chains";

    fn section(&self, history: &History, maps: &Maps) -> Result<Section> {
        let mut figures: Vec<Figure> = vec![];
        let mean = self.greatest_mean();
        for network in &self.networks {
            let one = Self { networks: vec![network.clone()], ..*self };
            let at = self.clock.at(network.time);
            let alt =
                format!("Contact forces as lines at {at}: blue is compression, orange is tension, width is magnitude.");
            let network = network_map(history, &one, &maps.titles, mean)?;
            figures.push(map_figure(&network, &alt, &format!("Force network at {at}."))?);
            let alt = format!("Grains in force chains at {at}, blue in compression, orange in tension.");
            let chains = chain_map(history, &one, &maps.titles)?;
            figures.push(map_figure(&chains, &alt, &format!("Force chains at {at}."))?);
        }
        let alt = "Probability density of the normal forces over their mean, at each moment.";
        figures.push(chart_figure(distribution_chart(self), alt, alt));
        for curve in length_charts(self) {
            let alt = format!("{}, by the number of their grains.", capitalised(&curve.y));
            figures.push(chart_figure(curve, &alt, &alt));
        }
        let text = "A chain is a line of at least three grains whose greatest principal stress exceeds the mean, each \
                    within 45° of the direction of that stress (Peters et al., Phys. Rev. E 72, 041307, 2005).";
        let tables = vec![Table::new("Force chains", &self.chain_head(), self.chain_rows())];
        Ok(Section { text: text.into(), figures, tables, ..Section::of::<Self>() })
    }
}
