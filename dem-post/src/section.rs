//! Sections of the page of `dem-post report`: text, figures, tables.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_drawing::{Axes, Chart, Curve, Drawing, Style, thinned};
use dem_history::History;
use serde::Serialize;

use crate::output::{PostError, Result};
use crate::title::Titles;

/// Width and height of a chart: small, so that its text stays legible on a narrow screen.
const CHART: (f64, f64) = (500.0, 400.0);
/// Pixels of a map per unit of its drawing.
const PIXELS: f32 = 2.0;
/// Maximum number of points of a curve whose values the page shows.
const CURVE_POINTS: usize = 1000;
/// Places in the page are quantised: those of a chart to this part of its width and height.
const STEPS: f64 = 65535.0;

/// The report of an analysis with a section on the page.
pub trait OnPage {
    /// Anchor of the section in the page.
    const ID: &'static str;
    /// Its head.
    const TITLE: &'static str;

    /// The section.
    ///
    /// # Errors
    /// Those of reading the history and of drawing.
    fn section(&self, history: &History, maps: &Maps) -> Result<Section>;
}

/// What the maps of the page show.
pub struct Maps {
    /// Their frames.
    pub frames: Vec<usize>,
    /// The titles of frames.
    pub titles: Titles,
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
    /// The legend of its maps, if they have none themselves: colour and text.
    pub legend: Vec<(&'static str, String)>,
    /// Tables.
    pub tables: Vec<Table>,
    /// The slider.
    pub player: Option<Player>,
}

/// The slider over the moments of the run.
pub struct Player {
    /// Its data, as JSON for the page.
    pub data: String,
    /// Number of its moments.
    pub moments: usize,
    /// The legend: colour and text.
    pub legend: Vec<(&'static str, String)>,
    /// The charts beside it.
    pub charts: Vec<Figure>,
}

impl Section {
    /// The section of an analysis, without content.
    pub fn of<R: OnPage>() -> Self {
        Self { id: R::ID, title: R::TITLE, ..Self::default() }
    }

    /// The maps and then the charts, each with the name of its kind; kinds without a picture are
    /// omitted.
    pub(crate) fn groups(&self) -> Vec<(&'static str, Vec<&Figure>)> {
        let of = |kinds: &[&str]| self.figures.iter().filter(|figure| kinds.contains(&figure.class)).collect();
        let groups: [(_, Vec<_>); 3] =
            [("maps", of(&["map", "wide"])), ("charts", of(&["chart"])), ("pictures", of(&["small"]))];
        groups.into_iter().filter(|(_, figures)| !figures.is_empty()).collect()
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
    /// Its size class: `chart`, `map`, `wide`, or `small` for a picture of many.
    pub class: &'static str,
    /// Of a chart: axes and curves, as JSON for the page; empty for maps.
    pub curves: String,
}

/// The axes and curves of a chart, for the script of the page.
#[derive(Serialize)]
struct Plot {
    /// Left, upper, right and lower edge of the area, as shares of the picture.
    area: [f64; 4],
    /// Values at the left and right, and at the lower and upper edge.
    x: [f64; 2],
    y: [f64; 2],
    log: [bool; 2],
    /// Whether values of the vertical axis are counts.
    whole: bool,
    titles: [String; 2],
    /// Units of the horizontal axis in a second of the run; 0 where the axis is not the time.
    time: f64,
    curves: Vec<PlotCurve>,
}

#[derive(Serialize)]
struct PlotCurve {
    name: String,
    colour: &'static str,
    /// Shares of the area from the left and from below, in turn; see [`quantised`].
    points: String,
    /// Times of the points (s); empty if they are at no times of the run.
    times: Vec<f64>,
}

impl Plot {
    fn of(chart: &Chart, axes: &Axes, size: (f64, f64)) -> Self {
        let [left, top, right, bottom] = axes.area;
        let round = |share: f64| (1e5 * share).round() / 1e5;
        Self {
            area: [left / size.0, top / size.1, right / size.0, bottom / size.1].map(round),
            x: axes.x,
            y: axes.y,
            log: axes.log,
            whole: chart.y_is_count,
            titles: [chart.x.clone(), chart.y.clone()],
            time: chart.second().unwrap_or(0.0),
            curves: chart.curves.iter().map(|curve| PlotCurve::of(curve, axes)).collect(),
        }
    }
}

impl PlotCurve {
    fn of(curve: &Curve, axes: &Axes) -> Self {
        let inside = |point: &(f64, f64)| axes.share(*point).iter().all(|x| (-1e-9..=1.0 + 1e-9).contains(x));
        let kept: Vec<usize> = (0..curve.points.len()).filter(|&k| inside(&curve.points[k])).collect();
        let points: Vec<(f64, f64)> = kept.iter().map(|&k| curve.points[k]).collect();
        let kept: Vec<usize> = thinned(&points, CURVE_POINTS).into_iter().map(|k| kept[k]).collect();
        let times = if curve.style == Style::Level { &[][..] } else { &curve.times };
        Self {
            name: curve.label.clone(),
            colour: curve.colour,
            points: quantised(kept.iter().flat_map(|&k| axes.share(curve.points[k]))),
            times: kept.iter().filter_map(|&k| times.get(k)).map(|time| rounded(*time)).collect(),
        }
    }
}

/// A number with six significant digits: fewer letters in the page.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Numbers from 0 to 1 as whole numbers from 0 to 65535 of 16 bits, the lower byte first, in base
/// 64. Numbers outside become 0 or 65535.
pub fn quantised(values: impl Iterator<Item = f64>) -> String {
    let bytes: Vec<u8> = values.flat_map(|x| ((STEPS * x).round().clamp(0.0, STEPS) as u16).to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

/// JSON inside a page: no text in it ends the element that holds it.
///
/// # Errors
/// [`PostError::Usage`] where the value has no form in JSON.
pub fn json(value: &impl Serialize) -> Result<String> {
    let json = serde_json::to_string(value).map_err(|error| PostError::Usage(format!("the page: {error}")))?;
    Ok(json.replace('<', "\\u003c"))
}

/// A table.
pub struct Table {
    /// The line above it.
    pub caption: String,
    /// Titles of its columns.
    pub head: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<String>>,
    /// What the first cell of each row links to; none for a table without links.
    pub links: Vec<Option<String>>,
    /// Whether its last column holds sentences.
    pub sentences: bool,
}

impl Table {
    /// A table with the cells of a table on the terminal.
    pub fn new(caption: &str, head: &[&str], rows: Vec<Vec<String>>) -> Self {
        let head = head.iter().map(ToString::to_string).collect();
        Self { caption: caption.into(), head, rows, links: vec![], sentences: false }
    }

    /// The rows, each with what its first cell links to.
    pub(crate) fn linked(&self) -> Vec<(Option<&str>, &[String])> {
        let link = |row: usize| self.links.get(row)?.as_deref();
        self.rows.iter().enumerate().map(|(k, row)| (link(k), row.as_slice())).collect()
    }
}

/// A chart as SVG, with its curves for the script of the page.
pub fn chart_figure(chart: Chart, alt: &str, caption: &str) -> Figure {
    let chart = chart.readable();
    let (drawing, axes) = Chart::draw_located(vec![chart.clone()], CHART);
    let source = address("svg+xml", drawing.svg().as_bytes());
    let plot = axes.first().map(|axes| Plot::of(&chart, axes, drawing.size()));
    let curves = plot.and_then(|plot| json(&plot).ok()).unwrap_or_default();
    Figure { source, alt: alt.into(), caption: caption.into(), class: "chart", curves }
}

/// A map as SVG or PNG, whichever is smaller.
///
/// # Errors
/// [`PostError::Usage`] with the plotting crate's message.
pub fn map_figure(drawing: &Drawing, alt: &str, caption: &str) -> Result<Figure> {
    map_figure_of(drawing, PIXELS, alt, caption)
}

/// As [`map_figure`], with so many pixels per unit of the drawing.
///
/// # Errors
/// As [`map_figure`].
pub fn map_figure_of(drawing: &Drawing, pixels: f32, alt: &str, caption: &str) -> Result<Figure> {
    let (width, height) = drawing.size();
    let class = if width > 1.2 * height { "wide" } else { "map" };
    let svg = drawing.svg();
    let png = drawing.png_scaled(pixels).map_err(|why| PostError::Usage(format!("the map {caption}: {why}")))?;
    let source = if svg.len() < png.len() { address("svg+xml", svg.as_bytes()) } else { address("png", &png) };
    Ok(Figure { source, alt: alt.into(), caption: caption.into(), class, curves: String::new() })
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
    use dem_drawing::{Canvas, colour};

    use super::*;

    #[test]
    fn the_page_has_the_values_of_a_curve_to_the_quantisation() {
        let (times, load): (Vec<f64>, Vec<f64>) =
            (0..5000).map(|k| (1e-3 * f64::from(k), (0.01 * f64::from(k)).sin() * 40.0 + f64::from(k % 7))).unzip();
        let points: Vec<(f64, f64)> = load.iter().map(|load| 0.5 * load).zip(load.iter().copied()).collect();
        let chart = Chart::new("way (mm)", "</script> (N)").curve("a", colour::BLUE, Style::Line, points.clone());
        let figure = chart_figure(chart.timed(&times), "alt", "caption");
        assert!(!figure.curves.contains('<'));
        let plot: serde_json::Value = serde_json::from_str(&figure.curves).unwrap();
        assert_eq!((plot["titles"][1].as_str(), plot["time"].as_f64()), (Some("</script> (N)"), Some(0.0)));
        let end = |name: &str, k: usize| plot[name][k].as_f64().unwrap();
        let curve = &plot["curves"][0];
        let bytes = STANDARD.decode(curve["points"].as_str().unwrap()).unwrap();
        let shares: Vec<f64> =
            bytes.chunks(2).map(|pair| f64::from(u16::from_le_bytes([pair[0], pair[1]])) / STEPS).collect();
        let read: Vec<f64> = curve["times"].as_array().unwrap().iter().map(|time| time.as_f64().unwrap()).collect();
        assert_eq!((shares.len() / 2, read.len()), (read.len(), shares.len() / 2));
        assert!((500..=CURVE_POINTS).contains(&read.len()), "{}", read.len());
        for (pair, time) in shares.chunks(2).zip(read) {
            // a point for each time, found by the time
            let k = (1e3 * time).round() as usize;
            let value = |axis: &str, share: f64| end(axis, 0) + share * (end(axis, 1) - end(axis, 0));
            let off = [value("x", pair[0]) - points[k].0, value("y", pair[1]) - points[k].1];
            let unit = ["x", "y"].map(|axis| (end(axis, 1) - end(axis, 0)) / STEPS);
            assert!(off[0].abs() <= 0.51 * unit[0] && off[1].abs() <= 0.51 * unit[1], "{time}: {off:?}");
        }
    }

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
