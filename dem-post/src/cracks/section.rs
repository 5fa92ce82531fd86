//! The section on cracks in the page of a report.

use dem_history::History;

use super::pictures::{ColourBy, broken_chart, crack_map, decohesion, fragment_charts, front_charts, surface_maps};
use super::report::{Report, broken_over_time};
use crate::map::Sample;
use crate::output::Result;
use crate::section::{Maps, OnPage, Section, Table, capitalised, chart_figure, map_figure};

impl OnPage for Report {
    const ID: &'static str = "cracks";
    const TITLE: &'static str = "Cracks";

    fn section(&self, history: &History, maps: &Maps) -> Result<Section> {
        let end = history.times().last().copied().unwrap_or(0.0);
        let mut figures = vec![];
        if !self.cracks.is_empty() {
            let (all, near) = crack_map(history, self, ColourBy::Time)?;
            let alt =
                "Broken bonds as lines over the grains as they were bonded, coloured by the time at which they broke.";
            figures.push(map_figure(&all, alt, "Cracks by the time at which each bond broke.")?);
            if let Some(near) = near {
                figures.push(map_figure(&near, &format!("{alt} Enlarged."), "The part around the cracks.")?);
            }
        }
        if !self.surfaces.is_empty() {
            let alt =
                "Facets of broken bonds at their positions when they formed, coloured by the time at which they broke.";
            let [whole, front, side] = surface_maps(history, self, ColourBy::Time)?;
            figures.push(map_figure(&whole, alt, "Cracks by the time at which each bond broke.")?);
            figures.push(map_figure(&front, alt, "The same, seen along y.")?);
            figures.push(map_figure(&side, alt, "The same, seen in the direction −x.")?);
        }
        for &frame in &maps.frames {
            let at = self.clock.at(history.times()[frame]);
            let alt = format!("Grains at {at}; those that lost a bond are white.");
            // spheres hide the breaks behind them
            let (sample, seen) = if history.dimension() == 2 {
                (Sample::read(history)?, "")
            } else {
                (Sample::cut_open(history)?, ", cut open along the middle")
            };
            let caption = format!("Lost bonds at {at}{seen}.");
            figures.push(map_figure(&decohesion(history, &sample, &maps.titles, &[frame])?, &alt, &caption)?);
        }
        if self.broken.total() > 0 {
            let curve = broken_chart(self, &broken_over_time(&self.events), end);
            let over = self.clock.over();
            let alt = format!("Number of broken bonds over {over}, by mode.");
            figures.push(chart_figure(curve, &alt, "Broken bonds by mode."));
            for curve in fragment_charts(self) {
                let alt = format!("{} over {over}.", capitalised(&curve.y));
                figures.push(chart_figure(curve, &alt, &alt));
            }
        }
        if !self.cracks.is_empty() || !self.surfaces.is_empty() {
            for curve in front_charts(self) {
                let over = if curve.second().is_some() { self.clock.over() } else { &curve.x };
                let alt = format!("{} over {over}.", capitalised(&curve.y));
                figures.push(chart_figure(curve, &alt, &alt));
            }
        }
        let caption = if self.surfaces.is_empty() {
            "The largest cracks; T/S/R: bonds broken in tension, in shear, by rolling"
        } else {
            "The largest cracks; T/S/R/Tw: bonds broken in tension, in shear, by rolling, by twist"
        };
        let tables = self.crack_rows().into_iter().map(|(head, rows)| Table::new(caption, &head, rows)).collect();
        let facts = vec![
            ("Bonds".into(), self.bonds.to_string()),
            ("Broken".into(), self.broken.total().to_string()),
            ("Cracks".into(), (self.cracks.len() + self.surfaces.len()).to_string()),
            ("First break".into(), self.clock.moment_if_known(self.first_break)),
            ("5 % broken".into(), self.clock.moment_if_known(self.time_of_5_percent)),
        ];
        let text = if history.dimension() == 2 {
            "A crack is a set of broken bonds that meet in the voids between the grains; its path is the longest line through it, drawn \
             thick. Positions are those when the bonds formed."
        } else {
            "A crack is a set of broken bonds whose facets (the common faces of the cells of two grains) meet in the voids between the \
             grains. Positions are those when the bonds formed."
        };
        Ok(Section { text: text.into(), facts, figures, tables, ..Section::of::<Self>() })
    }
}
