//! The page as HTML.

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_history::History;

use super::{Report, sections};
use crate::output::{PostError, Result};
use crate::plot::{Chart, Drawing};

/// Width and height of a chart: small, so that its text is still read on a narrow screen.
const CHART: (f64, f64) = (500.0, 400.0);
/// Pixels of a map per unit of its drawing.
const PIXELS: f32 = 2.0;

/// The page.
#[derive(Template)]
#[template(path = "report.html")]
struct Page {
    title: String,
    sections: Vec<Section>,
    scene: String,
}

/// A part of the page with a head of its own.
#[derive(Default)]
pub struct Section {
    /// Where links to it lead.
    pub id: &'static str,
    /// Its head.
    pub title: &'static str,
    /// What there is to know before reading on.
    pub text: String,
    /// Names and values.
    pub facts: Vec<(String, String)>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
}

impl Section {
    /// The maps and then the charts, each with the name of their kind; kinds without a picture are left out.
    fn groups(&self) -> Vec<(&'static str, Vec<&Figure>)> {
        let (charts, maps): (Vec<_>, Vec<_>) = self.figures.iter().partition(|figure| figure.class == "chart");
        [("maps", maps), ("charts", charts)].into_iter().filter(|(_, figures)| !figures.is_empty()).collect()
    }
}

/// A picture inside the page.
pub struct Figure {
    /// Its `data:` address.
    pub source: String,
    /// What it shows, for those who cannot see it.
    pub alt: String,
    /// The line below it.
    pub caption: String,
    /// How much room it takes: `chart`, `map` or `wide`.
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
    /// A table from what the terminal shows.
    pub fn new(caption: &str, head: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { caption: caption.into(), head: head.iter().map(ToString::to_string).collect(), rows }
    }
}

/// A chart as SVG.
pub fn chart(chart: Chart, alt: &str, caption: &str) -> Figure {
    let svg = STANDARD.encode(Chart::draw_sized(vec![chart], CHART).svg());
    let source = format!("data:image/svg+xml;base64,{svg}");
    Figure { source, alt: alt.into(), caption: caption.into(), class: "chart" }
}

/// A map as PNG.
///
/// # Errors
/// [`PostError::Usage`] with the plotting crate's message.
pub fn map(drawing: &Drawing, alt: &str, caption: &str) -> Result<Figure> {
    let png = drawing.png_scaled(PIXELS).map_err(|why| PostError::Usage(format!("the map {caption}: {why}")))?;
    let (width, height) = drawing.size();
    let class = if width > 1.2 * height { "wide" } else { "map" };
    let source = format!("data:image/png;base64,{}", STANDARD.encode(png));
    Ok(Figure { source, alt: alt.into(), caption: caption.into(), class })
}

/// The whole page.
///
/// # Errors
/// Those of reading the history and of drawing.
pub fn render(history: &History, report: &Report) -> Result<String> {
    let scene = history.parameters()?.scene;
    let tree: serde_json::Value = serde_json::from_str(&scene).unwrap_or_default();
    let name = history.path().file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let title = tree
        .get("title")
        .and_then(|title| title.as_str())
        .map_or_else(|| name.clone(), |title| format!("{name}: {title}"));
    // what is no JSON is shown as it stands
    let scene = if tree.is_null() { scene } else { serde_json::to_string_pretty(&tree).unwrap_or(scene) };
    let page = Page { title, sections: sections::all(history, report)?, scene };
    page.render().map_err(|error| PostError::Usage(format!("the page: {error}")))
}
