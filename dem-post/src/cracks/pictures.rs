//! The drawings of cracks.

use clap::ValueEnum;
use dem_history::{BondStatus, History, RuptureMode};

use super::front::Growth;
use super::modes::{mode_colour, mode_name};
use super::paths::Crack;
use super::report::{Event, Report};
use super::surfaces::Facet;
use crate::extent::{bonded_frame, range};
use crate::fragments::{Fragment, Fragments};
use crate::map::{Colour, Key, Link, Materials, Panel, Patch, Ramp, Sample, Scale, draw, draw_part, draw_view};
use crate::output::{Result, counted};
use crate::title::Titles;
use dem_drawing::{Chart, Drawing, Style, colour};

/// Fill of grains that kept all their bonds.
const BONDED: &str = "#8c8c8c";
/// Fill of grains that lost a bond: white, as in the paper.
const RELEASED: &str = "#ffffff";
/// Outline of grains in maps of fragments and decohesion.
const OUTLINE: &str = "#404040";
/// Fill and outline of grains under cracks.
const PALE: [&str; 2] = ["#f0f0f0", "#cfcfcf"];
/// Fills of the heaviest fragments: colours that colour-blind readers distinguish (Okabe & Ito
/// 2008).
const FRAGMENTS: [&str; 6] = ["#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#d55e00"];
/// Widths of a segment on the path of its crack and of another.
const WIDTHS: [f64; 2] = [3.2, 1.8];
/// Colours of the backs of cracks: lighter than those of their fronts.
const PALER: [&str; 3] = ["#7fb8d8", "#eaae7f", "#7fceb9"];
/// Cracks whose fronts are drawn.
const FRONTS: usize = 3;

/// Broken bonds over time, by mode, until `end` (s).
pub fn broken_chart(report: &Report, curve: &[(f64, [usize; 4])], end: f64) -> Chart {
    let points = |count: &dyn Fn(&[usize; 4]) -> usize| -> Vec<(f64, f64)> {
        let last = curve.last().map_or(0, |(_, n)| count(n));
        let inner = curve.iter().map(|(time, n)| (*time, count(n) as f64));
        std::iter::once((0.0, 0.0)).chain(inner).chain([(end, last as f64)]).collect()
    };
    let mut chart = report.clock.chart("broken bonds");
    chart = chart.curve("all", colour::BLACK, Style::Steps, points(&|n| n.iter().sum()));
    for (k, mode) in RuptureMode::ALL.iter().enumerate() {
        // few samples have bonds that resist twist
        if *mode != RuptureMode::Twist || curve.last().is_some_and(|(_, n)| n[k] > 0) {
            chart = chart.curve(&mode_name(*mode), mode_colour(*mode), Style::Steps, points(&|n| n[k]));
        }
    }
    (chart.y_is_count, chart.pad_x) = (true, true);
    chart
}

/// Number of fragments, and mass of the largest, over time.
pub fn fragment_charts(report: &Report) -> Vec<Chart> {
    let pieces = &report.fragments;
    let points = |value: &dyn Fn(&Fragments) -> f64| pieces.iter().map(|p| (p.time, value(&p.fragments))).collect();
    let mut number = report
        .clock
        .chart("number of fragments")
        .curve("all", colour::BLACK, Style::Steps, points(&|f| f.count as f64))
        .curve("single grains", colour::VERMILLION, Style::Steps, points(&|f| f.singles as f64));
    (number.y_is_count, number.pad_x) = (true, true);
    let mut largest = report.clock.chart("largest fragment (% of the mass)").curve(
        "largest fragment",
        colour::BLUE,
        Style::Steps,
        points(&|f| 100.0 * f.largest_mass_fraction),
    );
    largest.pad_x = true;
    vec![number, largest]
}

/// The tips of the longest cracks over time; the size of all cracks and of the largest over time;
/// and, where a step broke bonds in several rounds, these sizes over the rounds of the step with
/// the most rounds.
pub fn front_charts(report: &Report) -> Vec<Chart> {
    let mut over_time = report.clock.chart("position of the tips along the crack (mm)");
    over_time.pad_x = true;
    // a crack has no curve over time if all its bonds broke at one time
    let grown = |crack: &&Crack| crack.first < crack.last;
    for crack in report.cracks.iter().filter(grown).take(FRONTS) {
        let rows = || report.fronts.iter().filter(|row| row.crack == crack.number);
        let place = over_time.curves.len() / 2;
        let colour = colour::CYCLE[place % colour::CYCLE.len()];
        let label = |tip: &str| format!("crack {}, {tip}", crack.number);
        let front = rows().map(|row| (row.time, 1e3 * row.front)).collect();
        let back = rows().map(|row| (row.time, 1e3 * row.back)).collect();
        over_time = over_time.curve(&label("front"), colour, Style::Steps, front);
        over_time = over_time.curve(&label("back"), PALER[place % PALER.len()], Style::Steps, back);
    }
    let mut charts = if over_time.curves.is_empty() { vec![] } else { vec![over_time] };
    charts.extend(growth_chart(report));
    charts.extend(cascade_chart(report));
    charts
}

/// Name of the size of cracks, and the factor from SI to its unit.
fn size_of_cracks(report: &Report) -> (&'static str, f64) {
    if report.surfaces.is_empty() { ("length of cracks (mm)", 1e3) } else { ("area of cracks (mm²)", 1e6) }
}

fn largest(report: &Report) -> &'static str {
    if report.surfaces.is_empty() { "the longest" } else { "the largest" }
}

/// The size of all cracks and of the largest over time, unless all bonds broke at once.
fn growth_chart(report: &Report) -> Option<Chart> {
    report.growth.first().zip(report.growth.last()).filter(|(first, last)| first.time < last.time)?;
    let (label, unit) = size_of_cracks(report);
    let points = |size: fn(&Growth) -> f64| report.growth.iter().map(|row| (row.time, unit * size(row))).collect();
    let mut chart = report.clock.chart(label).curve("all", colour::BLACK, Style::Steps, points(|row| row.size)).curve(
        largest(report),
        colour::BLUE,
        Style::Steps,
        points(|row| row.largest),
    );
    chart.pad_x = true;
    Some(chart)
}

fn cascade_chart(report: &Report) -> Option<Chart> {
    let steps = report.growth.chunk_by(|a, b| a.step == b.step);
    let rounds = steps.max_by_key(|rounds| rounds.len()).filter(|rounds| rounds.len() > 1)?;
    let (label, unit) = size_of_cracks(report);
    let points = |size: fn(&Growth) -> f64| -> Vec<(f64, f64)> {
        rounds.iter().map(|row| (f64::from(row.round), unit * size(row))).collect()
    };
    let mut chart = Chart::new(&format!("round of the cascade in step {}", rounds[0].step), label)
        .curve("all", colour::BLACK, Style::Marked, points(|row| row.size))
        .curve(largest(report), colour::BLUE, Style::Marked, points(|row| row.largest));
    (chart.pad_x, chart.x_is_count) = (true, true);
    Some(chart)
}

/// What the colours of cracks show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ColourBy {
    /// The time at which each bond broke; the round of the cascade, where all broke in one step.
    #[default]
    Time,
    /// The rank of each break in their order, from 1; breaks of one round of a step have one rank.
    Rank,
}

/// The rank of each break, which are in order: one more than the number of those before its round.
fn ranks(events: &[Event]) -> Vec<f64> {
    let rounds = events.chunk_by(|a, b| (a.step, a.round) == (b.step, b.round));
    let mut before = 0;
    let mut ranks = Vec::with_capacity(events.len());
    for round in rounds {
        ranks.extend(std::iter::repeat_n((before + 1) as f64, round.len()));
        before += round.len();
    }
    ranks
}

/// The value of each break, and its colours.
struct When {
    values: Vec<f64>,
    scale: Scale,
}

impl When {
    fn of(report: &Report, by: ColourBy) -> Self {
        let events = &report.events;
        let span = events.first().zip(events.last()).map_or([0.0; 2], |(first, last)| [first.time, last.time]);
        let (title, values) = match by {
            ColourBy::Rank => ("rank of the break".into(), ranks(events)),
            ColourBy::Time if span[0] == span[1] => (
                format!("round of the cascade at {}", report.clock.at(span[0])),
                events.iter().map(|event| f64::from(event.round)).collect(),
            ),
            ColourBy::Time => {
                let title = if report.clock.step().is_some() { "broken in step" } else { "broken at t (s)" };
                (title.into(), events.iter().map(|event| report.clock.value(event.time)).collect())
            }
        };
        let [low, high] = range(values.iter().copied());
        Self { values, scale: Scale { title, low, high, ramp: Ramp::Lines } }
    }

    fn colour(&self, event: usize) -> Colour {
        self.scale.colour(self.values[event])
    }

    /// The legend of the colours; a single value needs none.
    fn key(self) -> Option<Key> {
        (self.scale.low < self.scale.high).then_some(Key::Bar(self.scale))
    }
}

/// The grains as they were bonded, pale, with the legend of their materials; the caption gives the
/// numbers of cracks and broken bonds.
fn pale_panel(history: &History, report: &Report, cracks: usize) -> Result<(Panel, Vec<Key>)> {
    let (materials, frame) = (Materials::read(history)?, bonded_frame(history)?);
    let keys = materials.iter().flat_map(|materials| materials.keys(PALE[1])).collect();
    let panel = Panel {
        caption: vec![
            format!("{} of {}", counted(cracks, "crack"), counted(report.broken.total(), "broken bond")),
            "positions when the bonds formed".into(),
        ],
        grains: history.grain_state(frame)?,
        walls: history.wall_state(frame)?,
        fills: Materials::fills(materials.as_ref(), history.grains()?.radius.len(), PALE[0]),
        outline: PALE[1],
        ..Panel::default()
    };
    Ok((panel, keys))
}

/// The facets of cracks in 3D, in colours that show when each bond broke: in perspective, and over
/// the grains as they were bonded along y and against x.
///
/// # Errors
/// Those of reading the history.
pub fn surface_maps(history: &History, report: &Report, by: ColourBy) -> Result<[Drawing; 3]> {
    let when = When::of(report, by);
    let (mut panel, materials) = pale_panel(history, report, report.surfaces.len())?;
    let patch = |facet: &Facet| Patch { corners: facet.corners.clone(), colour: when.colour(facet.event) };
    panel.patches = report.faces.seen().map(patch).collect();
    let mut legend: Vec<Key> = when.key().into_iter().collect();
    let map = |sample: &Sample, panel: &Panel, legend: &[Key]| draw(sample, std::slice::from_ref(panel), legend);
    // without the grains
    let facets = Panel { fills: vec![], ..panel.clone() };
    let whole = map(&Sample::with_depth(history)?, &facets, &legend);
    legend.extend(materials);
    let [front, side] = [Sample::read(history)?, Sample::from_the_side(history)?];
    Ok([whole, map(&front, &panel, &legend), map(&side, &panel, &legend)])
}

/// The cracks over the grains as they were bonded, in colours that show when each bond broke. The
/// second drawing shows the part around the cracks, if this part is small.
///
/// # Errors
/// Those of reading the history.
pub fn crack_map(history: &History, report: &Report, by: ColourBy) -> Result<(Drawing, Option<Drawing>)> {
    let when = When::of(report, by);
    let (mut panel, materials) = pale_panel(history, report, report.cracks.len())?;
    // the latest first, so that the origin of the crack is on top
    for segment in report.paths.segments.iter().rev() {
        let [a, b, c] = segment.line.map(Vec::from);
        let (width, colour) = (WIDTHS[usize::from(!segment.on_path)], when.colour(segment.event));
        panel.links.push(Link { from: a, to: b.clone(), width, colour: colour.clone() });
        panel.links.push(Link { from: b, to: c, width, colour });
    }
    let mut legend: Vec<Key> = when.key().into_iter().collect();
    legend.push(Key::Line(colour::GREY, WIDTHS[0], "path of a crack".into()));
    legend.push(Key::Line(colour::GREY, WIDTHS[1], "branch".into()));
    legend.extend(materials);
    let (sample, panels) = (Sample::read(history)?, [panel]);
    let all = sample.view(panels.iter().map(|panel| (&panel.grains, &panel.walls)));
    let near = sample.near(report.paths.segments.iter().flat_map(|s| s.line.iter().map(|x| x.as_slice())), all);
    let near = near.map(|view| draw_part(&sample, view, &panels, &legend));
    Ok((draw_view(&sample, all, &panels, &legend), near))
}

/// The grains at a frame in these colours; the caption is the title of the frame and `what`.
fn filled_panel(history: &History, titles: &Titles, frame: usize, fills: Vec<Colour>, what: String) -> Result<Panel> {
    Ok(Panel {
        caption: vec![titles.of(history, frame), what],
        grains: history.grain_state(frame)?,
        walls: history.wall_state(frame)?,
        fills,
        outline: OUTLINE,
        ..Panel::default()
    })
}

/// The fragments of a sample at some frames, listed in `lists` frame by frame: the heaviest have
/// separate colours, in the order of their masses.
///
/// # Errors
/// Those of reading the history.
pub fn fragment_map(
    history: &History,
    sample: &Sample,
    titles: &Titles,
    frames: &[usize],
    lists: &[Vec<Fragment>],
) -> Result<Drawing> {
    let grains = history.grains()?.radius.len();
    let (mut panels, mut shown) = (vec![], 0);
    for (&frame, list) in frames.iter().zip(lists) {
        let mut fills = vec![Colour::from(PALE[0]); grains];
        let coloured = list.iter().filter(|f| f.grains.len() > 1).zip(FRAGMENTS);
        for (fragment, colour) in coloured.clone() {
            fragment.grains.iter().for_each(|&grain| fills[grain] = colour.into());
        }
        shown = shown.max(coloured.count());
        let heaviest = 100.0 * list.first().map_or(0.0, |f| f.mass_fraction);
        let plural = if list.len() == 1 { "" } else { "s" };
        let what = format!("{} fragment{plural}, the heaviest {heaviest:.1} %", list.len());
        panels.push(filled_panel(history, titles, frame, fills, what)?);
    }
    let names = ["heaviest", "second", "third", "fourth", "fifth", "sixth"];
    let coloured = FRAGMENTS.iter().zip(names).take(shown);
    let mut legend: Vec<Key> = coloured.map(|(colour, name)| Key::Disk(colour, OUTLINE, name.into())).collect();
    legend.push(Key::Disk(PALE[0], OUTLINE, "the rest".into()));
    Ok(draw(sample, &panels, &legend))
}

/// The decohesion map of a sample at some frames: grains that lost a bond in white.
///
/// # Errors
/// Those of reading the history.
pub fn decohesion(history: &History, sample: &Sample, titles: &Titles, frames: &[usize]) -> Result<Drawing> {
    let bonds = history.bonds()?;
    let mut panels = vec![];
    for &frame in frames {
        let status = history.bond_status(frame)?;
        let mut fills = vec![Colour::from(BONDED); history.grains()?.radius.len()];
        let mut broken = 0;
        for ([i, j], _) in bonds.pair.iter().zip(&status).filter(|(_, status)| **status != BondStatus::Intact) {
            (fills[*i as usize], fills[*j as usize]) = (RELEASED.into(), RELEASED.into());
            broken += 1;
        }
        let what = format!("{broken} of {} bonds broken", bonds.len());
        panels.push(filled_panel(history, titles, frame, fills, what)?);
    }
    let legend = [
        Key::Disk(BONDED, OUTLINE, "lost no bond".into()),
        Key::Disk(RELEASED, OUTLINE, "lost at least one bond".into()),
    ];
    Ok(draw(sample, &panels, &legend))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn breaks_of_one_round_have_one_rank() {
        let event = |(step, round): (i64, i32)| Event { step, round, ..Event::default() };
        let events: Vec<Event> = [(3, 0), (5, 0), (5, 0), (5, 1), (9, 0)].map(event).to_vec();
        assert_eq!(ranks(&events), [1.0, 2.0, 2.0, 4.0, 5.0]);
    }
}
