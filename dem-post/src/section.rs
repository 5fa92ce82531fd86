//! Sections of the page of `dem-post report`: text, figures, tables.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_drawing::{Chart, Drawing};
use dem_history::History;

use crate::output::{PostError, Result};

/// Width and height of a chart: small, so that its text stays legible on a narrow screen.
const CHART: (f64, f64) = (500.0, 400.0);
/// Pixels of a map per unit of its drawing.
const PIXELS: f32 = 2.0;

/// The report of an analysis with a section on the page.
pub trait OnPage {
    /// Anchor of the section in the page.
    const ID: &'static str;
    /// Its head.
    const TITLE: &'static str;

    /// The section; its maps show the frames `frames`.
    ///
    /// # Errors
    /// Those of reading the history and of drawing.
    fn section(&self, history: &History, frames: &[usize]) -> Result<Section>;
}

/// A section of the page.
#[derive(Default)]
pub struct Section {
    /// Its anchor in the page.
    pub id: &'static str,
    /// Its head.
    pub title: &'static str,
    /// Its first paragraph.
    pub text: String,
    /// Names and values.
    pub facts: Vec<(String, String)>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
}

impl Section {
    /// The section of an analysis, without content.
    pub fn of<R: OnPage>() -> Self {
        Self { id: R::ID, title: R::TITLE, ..Self::default() }
    }

    /// The maps and then the charts, each with the name of its kind; kinds without a picture are
    /// omitted.
    pub(crate) fn groups(&self) -> Vec<(&'static str, Vec<&Figure>)> {
        let (charts, maps): (Vec<_>, Vec<_>) = self.figures.iter().partition(|figure| figure.class == "chart");
        [("maps", maps), ("charts", charts)].into_iter().filter(|(_, figures)| !figures.is_empty()).collect()
    }
}

/// A picture inside the page.
pub struct Figure {
    /// Its `data:` address.
    pub source: String,
    /// Alternative text.
    pub alt: String,
    /// The line below it.
    pub caption: String,
    /// Its size class: `chart`, `map` or `wide`.
    pub class: &'static str,
}

/// A table.
pub struct Table {
    /// The line above it.
    pub caption: String,
    /// Titles of its columns.
    pub head: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with the cells of a table on the terminal.
    pub fn new(caption: &str, head: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { caption: caption.into(), head: head.iter().map(ToString::to_string).collect(), rows }
    }
}

/// A chart as SVG.
pub fn chart_figure(chart: Chart, alt: &str, caption: &str) -> Figure {
    let source = address("svg+xml", Chart::draw_sized(vec![chart], CHART).svg().as_bytes());
    Figure { source, alt: alt.into(), caption: caption.into(), class: "chart" }
}

/// A map as SVG or PNG, whichever is smaller.
///
/// # Errors
/// [`PostError::Usage`] with the plotting crate's message.
pub fn map_figure(drawing: &Drawing, alt: &str, caption: &str) -> Result<Figure> {
    let (width, height) = drawing.size();
    let class = if width > 1.2 * height { "wide" } else { "map" };
    let svg = drawing.svg();
    let png = drawing.png_scaled(PIXELS).map_err(|why| PostError::Usage(format!("the map {caption}: {why}")))?;
    let source = if svg.len() < png.len() { address("svg+xml", svg.as_bytes()) } else { address("png", &png) };
    Ok(Figure { source, alt: alt.into(), caption: caption.into(), class })
}

/// The `data:` address of a picture.
fn address(kind: &str, picture: &[u8]) -> String {
    format!("data:image/{kind};base64,{}", STANDARD.encode(picture))
}

/// A text with a capital first letter.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

#[cfg(test)]
mod tests {
    use dem_drawing::Canvas;

    use super::*;

    #[test]
    fn a_map_is_svg_or_png_whichever_is_smaller() {
        let kind = |grains: usize| {
            let mut canvas = Canvas::new(100.0, 100.0);
            for k in 0..grains {
                canvas.disk((k as f64 % 97.0, k as f64 % 89.0), 2.0, "#ffffff", "#404040", 0.5);
            }
            let source = map_figure(&canvas.finish(), "", "").unwrap().source;
            source.split(';').next().unwrap().to_string()
        };
        assert_eq!((kind(10), kind(5000)), ("data:image/svg+xml".into(), "data:image/png".into()));
    }
}
