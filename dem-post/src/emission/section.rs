//! The section of acoustic emission on the page of `dem-post report`.

use dem_history::History;

use super::pictures::{course, frequencies, magnitudes};
use super::report::Report;
use crate::output::Result;
use crate::section::{Maps, OnPage, Section, capitalised, chart_figure};

impl OnPage for Report {
    const ID: &'static str = "emission";
    const TITLE: &'static str = "Acoustic emission";

    fn section(&self, _: &History, _: &Maps) -> Result<Section> {
        let over = self.curves.clock.over();
        let mut figures = vec![];
        for (chart, text) in [
            (course(self), format!("Load, broken bonds and events over {over}, each over its greatest value.")),
            (magnitudes(self), format!("Magnitude of the events over {over}.")),
            (
                frequencies(self),
                "Number of events by magnitude, and the Gutenberg–Richter law where it is fitted.".to_string(),
            ),
        ] {
            figures.push(chart_figure(chart, &text, &text));
        }
        let facts = self.lines().into_iter().map(|(name, value)| (capitalised(name.trim_start()), value)).collect();
        let text = "Broken bonds that are near each other in the sample and in time are one event; the defaults of \
                    dem-post emission.";
        Ok(Section { text: text.into(), facts, figures, ..Section::of::<Self>() })
    }
}
