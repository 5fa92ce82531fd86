//! The section of the sample as a continuum on the page of `dem-post report`.

use dem_drawing::Chart;
use dem_history::History;

use super::pictures::{anisotropy, coordination, crack_density, dilation, porosity, stress};
use super::report::Report;
use crate::output::Result;
use crate::section::{Maps, OnPage, Section, capitalised, chart_figure};

impl OnPage for Report {
    const ID: &'static str = "fabric";
    const TITLE: &'static str = "The sample as a continuum";

    fn section(&self, _: &History, _: &Maps) -> Result<Section> {
        let drawn = |chart: &Chart| chart.curves.iter().any(|curve| curve.points.len() > 1);
        let mut charts = vec![stress(self), dilation(self), porosity(self), coordination(self), anisotropy(self)];
        if self.rows.last().is_some_and(|row| row.broken > 0) {
            charts.push(crack_density(self));
        }
        let figures = charts.into_iter().filter(drawn).map(|chart| {
            let text = format!("{} over {}.", capitalised(&chart.y), self.clock.over());
            chart_figure(chart, &text, &text)
        });
        let text = "Stress is over the box around the sample at the first frame, crack density over that when the \
                    bonds formed; the porosity is that of a round region in its middle. Contacts are those between \
                    grains that carry a force or are bonded.";
        Ok(Section { text: text.into(), figures: figures.collect(), ..Section::of::<Self>() })
    }
}
