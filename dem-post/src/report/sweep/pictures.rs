//! The pictures of a sweep: the curves of all runs on one chart, and the sample of each run.

use dem_drawing::{Chart, Style, colour};
use dem_history::History;

use super::report::Report;
use super::runs::{Run, same, values};
use super::table::cell;
use crate::frames::{self, Subject};
use crate::output::{PostError, Result, number, short};
use crate::section::{Figure, Section, capitalised, map_figure_of};
use crate::strength::report::axis;
use crate::strength::scenes::unit;

/// Maximum number of bytes of all pictures of samples in the page.
const BYTES: usize = 2_000_000;
/// Pixels per unit of a picture: of a few runs, and of many.
const PIXELS: [f32; 2] = [1.0, 0.5];
const FEW: usize = 12;
/// Least strain on the logarithmic axis.
const LEAST_STRAIN: f64 = 1e-9;

/// The load over the strain of all runs, on a linear and on a logarithmic axis, each with its
/// caption. Runs with one value of a field have one colour: of the field of the strength, else of
/// the first that has few values.
pub fn curves(report: &Report) -> Vec<(Chart, String)> {
    let mut drawn: Vec<&Run> = report.runs.iter().filter(|run| run.curve.len() > 1).collect();
    if drawn.is_empty() {
        return vec![];
    }
    let fields = report.strength.iter().map(|found| &found.field).chain(&report.fields);
    let grouped = fields.map(|field| (field, values(&drawn, field)));
    let grouped = grouped.into_iter().find(|(_, values)| (2..=colour::CYCLE.len()).contains(&values.len()));
    let group = |run: &Run| {
        let (field, values) = grouped.as_ref()?;
        let own = run.values.get(*field)?;
        let name = field.rsplit_once('.').map_or(field.as_str(), |(_, name)| name);
        values.iter().position(|value| same(value, own)).map(|k| (k, format!("{name} {}", cell(own))))
    };
    // the legend has the order of the curves
    drawn.sort_by_key(|run| group(run).map(|(k, _)| k));
    let draw = |mut chart: Chart, x: &dyn Fn(f64) -> f64| {
        let mut named = vec![];
        for run in &drawn {
            let points = run.curve.iter().map(|(strain, load)| (x(*strain), *load)).collect();
            let (k, label) = group(run).unwrap_or_else(|| (0, format!("run {}", run.id)));
            chart = chart.curve(&label, colour::CYCLE[k], Style::Thin, points);
            if grouped.is_none() || named.contains(&label) {
                chart = chart.unlisted();
            }
            named.push(label);
        }
        chart
    };
    let by = grouped
        .as_ref()
        .map_or_else(String::new, |(field, _)| format!(", in colours by {}", axis(field, &unit(field))));
    let mut linear = Chart::new("axial strain (%)", "load (N)");
    linear.pad_x = true;
    let mut charts = vec![(draw(linear, &|strain| 1e2 * strain), format!("Load over strain of all runs{by}."))];
    // before its collapse a rigid sample has no strain to show
    if drawn.iter().any(|run| run.collapse.is_some()) {
        let mut onset = Chart::new("magnitude of the axial strain", "load (N)");
        onset.log_x = true;
        let visible = |strain: f64| if strain < LEAST_STRAIN { f64::NAN } else { strain };
        let caption = format!("The onset of collapse: load over the logarithm of the strain{by}.");
        charts.push((draw(onset, &visible), caption));
    }
    charts
}

/// A picture of each run at its collapse or, without one, at its end, as many as the page has room
/// for.
///
/// # Errors
/// Those of reading histories and of drawing.
pub fn section(report: &Report) -> Result<Section> {
    let (mut figures, mut bytes, mut legend) = (vec![], 0, vec![]);
    let with_history = report.runs.iter().filter(|run| run.history.is_some()).count();
    for run in &report.runs {
        let Some((figure, keys)) = picture(run, PIXELS[usize::from(with_history > FEW)])? else { continue };
        bytes += figure.source.len();
        if bytes > BYTES {
            break;
        }
        keys.into_iter().for_each(|key| {
            if !legend.contains(&key) {
                legend.push(key);
            }
        });
        figures.push(figure);
    }
    let mut text = "Each run at its collapse (strain 10⁻⁴) or, without one, at its end.".to_string();
    if figures.len() < with_history {
        text += &format!(" {} of {with_history} runs are shown: the page has no room for more.", figures.len());
    }
    text += " The page of one run: dem-post report RUN.h5.";
    Ok(Section { id: "samples", title: "Samples", text, figures, legend, ..Section::default() })
}

/// Colour and text of an entry of a legend.
type Entry = (&'static str, String);

/// The picture of a run and its legend; `None` without frames or without anything to draw.
fn picture(run: &Run, pixels: f32) -> Result<Option<(Figure, Vec<Entry>)>> {
    let Some(path) = &run.history else { return Ok(None) };
    let history = History::open(path)?;
    let Some(last) = history.frames().checked_sub(1) else { return Ok(None) };
    let at_collapse = run.collapse_time.and_then(|time| history.times().iter().position(|t| *t >= time));
    let frame = at_collapse.unwrap_or(last);
    let time = history.times()[frame];
    for subject in [Subject::Bonds, Subject::Forces, Subject::Speed] {
        match frames::read(&history, subject, 1, &[time]) {
            Ok(chosen) => {
                let drawing = frames::plain(&history, &chosen, frame)?;
                let what = if at_collapse.is_some() { "collapse" } else { "end" };
                let peak = run.peak.or(run.greatest_load);
                let load = peak.map_or_else(String::new, |load| format!(", greatest load {} N", short(load)));
                let caption = format!("Run {}: {what}, t = {} s{load}.", run.id, number(time));
                let alt = format!("The sample of run {} at its {what}.", run.id);
                let figure = map_figure_of(&drawing, pixels, &alt, &capitalised(&caption))?;
                let legend =
                    if subject == Subject::Bonds { frames::bond_legend(history.dimension(), false) } else { vec![] };
                return Ok(Some((Figure { class: "small", ..figure }, legend)));
            }
            Err(PostError::Lacking { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(None)
}
