//! The section of the load on the page of `dem-post report`.

use dem_history::History;

use super::pictures::{force_displacement, load_breaks, onset, stress_strain};
use super::report::Report;
use crate::output::{Result, quantity};
use crate::section::{Maps, OnPage, Section, chart_figure};

impl OnPage for Report {
    const ID: &'static str = "load";
    const TITLE: &'static str = "Load and displacement";

    fn section(&self, _: &History, _: &Maps) -> Result<Section> {
        let breaks = load_breaks(self).map(|chart| {
            let alt = "Load at which each bond breaks over the number of broken bonds.";
            chart_figure(chart, alt, "The load of each break: it falls where the sample bears less.")
        });
        let mut figures: Vec<_> = breaks.into_iter().collect();
        figures.extend([
            chart_figure(
                force_displacement(self),
                "Applied force and reaction of the grains over the displacement of the driven wall.",
                "Force over displacement of the driven wall.",
            ),
            chart_figure(
                stress_strain(self),
                "Axial stress over axial strain, from the walls and from the grains.",
                "Axial stress over strain.",
            ),
        ]);
        figures.extend(onset(self).map(|onset| {
            let alt =
                "Applied force over the logarithm of the axial strain, with the strains that define the collapse.";
            chart_figure(onset, alt, "The onset of collapse: force over the logarithm of the strain.")
        }));
        let s = &self.summary;
        let mut facts = vec![
            ("Driven wall", s.wall.clone()),
            ("Sample", s.sample()),
            ("First break", quantity(s.first_break, "N")),
            ("Collapse load (strain 1e-4)", s.collapse(0)),
            ("Collapse load (strain 1e-3)", s.collapse(1)),
            ("Load with 5 % of the bonds broken", quantity(s.load_at_5_percent_broken, "N")),
            ("Collapse load over cohesion", quantity(s.collapse_over_cohesion, "")),
            ("Peak load", s.peak()),
            ("Greatest load", quantity(Some(s.greatest_load), "N")),
            ("Work of the wall", quantity(Some(s.work), "J")),
        ];
        facts.extend(s.elastic().into_iter().flatten());
        facts.extend(s.splitting.as_ref().map(|splitting| ("Splitting strength", splitting.to_string())));
        Ok(Section {
            text:
                "If rigid bonds join all grains to one piece, strain before the first break is solver error: a collapse load \
                   is then meaningful only above the load of the first break. For a wall with prescribed velocity, the \
                   load of a step is the force that acted before any bond broke in it."
                    .into(),
            facts: facts.into_iter().map(|(name, value)| (name.into(), value)).collect(),
            figures,
            ..Section::of::<Self>()
        })
    }
}
