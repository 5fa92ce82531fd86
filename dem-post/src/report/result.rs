//! The beginning of the page: the result in a sentence, three moments as pictures, and the slider.

use dem_drawing::{Style, colour};
use dem_history::{Ending, History, Rupture};

use super::limit::LimitLoad;
use super::player;
use crate::clock::Clock;
use crate::collapse::peak;
use crate::cracks::report::total_over_time;
use crate::extent::{bonded_frame, box_around};
use crate::frames::{self, Subject};
use crate::moments::{self, SAME_TIME};
use crate::output::{PostError, Result, counted, number, quantity, short};
use crate::section::{Figure, Section, capitalised, chart_figure, map_figure};
use crate::title::Titles;
use crate::{cracks, info, stress_strain};

/// Greatest ratio of a limit load to the loads of the run at which the chart of the load shows it.
const FAR: f64 = 5.0;

/// A moment of which the page shows a picture.
struct Moment {
    /// What happened, with its time where that of the frame is another (s).
    events: Vec<(&'static str, Option<f64>)>,
    frame: usize,
}

/// The analyses of which the section tells.
pub struct Parts<'a> {
    /// What the history holds.
    pub info: &'a info::Report,
    /// The load, if a wall is driven.
    pub load: Option<&'a stress_strain::Report>,
    /// The limit load, if it was given.
    pub limit: Option<&'a LimitLoad>,
    /// The breaks, if there are bonds.
    pub cracks: Option<&'a cracks::Report>,
    /// Times of the pictures that were asked for (s).
    pub times: &'a [f64],
    /// The titles of frames.
    pub titles: &'a Titles,
}

/// The section.
///
/// # Errors
/// Those of reading the history and of drawing.
pub fn section(history: &History, parts: &Parts) -> Result<Section> {
    let (ruptures, load) = (history.ruptures()?, parts.load);
    let shown = shown(history, &ruptures, load, parts.times)?;
    let pictured: Vec<usize> = shown.iter().map(|moment| moment.frame).collect();
    let figures = pictures(history, &shown, parts)?;
    let mut player = player::read(history, &ruptures, &pictured, load)?;
    let charts = charts(history, &ruptures, parts);
    let text = sentences(history, parts, &ruptures)?;
    let mut section = Section { id: "result", title: "Result", text, figures, ..Section::default() };
    match &mut player {
        Some(player) => player.charts = charts,
        None => section.figures.extend(charts),
    }
    Ok(Section { player, ..section })
}

/// First break, collapse or peak, and end; the frames nearest to `times` (s), if there are any.
fn shown(
    history: &History,
    ruptures: &[Rupture],
    load: Option<&stress_strain::Report>,
    times: &[f64],
) -> Result<Vec<Moment>> {
    if !times.is_empty() {
        let chosen = moments::chosen(history, times)?;
        return Ok(chosen.into_iter().map(|frame| Moment { events: vec![], frame }).collect());
    }
    let of_frame = |time: f64, frame: usize| (time - history.times()[frame]).abs() <= SAME_TIME * time.abs();
    let event = |name, time: f64, frame| (frame, name, Some(time).filter(|time| !of_frame(*time, frame)));
    let mut found = vec![];
    let after = |time: f64| history.times().iter().position(|other| *other >= time);
    if let Some(time) = ruptures.first().map(|rupture| rupture.time) {
        found.extend(after(time).map(|frame| event("first break", time, frame)));
    }
    if let Some(load) = load {
        let s = &load.summary;
        let collapse = s.collapse_time.filter(|_| !s.collapse_early[0]).map(|time| ("collapse", time));
        let peak = || peak(&load.load).and_then(|row| load.time.get(row)).map(|time| ("peak load", *time));
        if let Some((name, time)) = collapse.or_else(peak) {
            found.extend(history.frame_at(time).map(|frame| event(name, time, frame)));
        }
    }
    let last = history.frames() - 1;
    if found.len() < 2 && last > 0 {
        found.insert(0, (0, "start", None));
    }
    found.push((last, "end", None));
    found.sort_by_key(|(frame, ..)| *frame);
    let mut moments: Vec<Moment> = vec![];
    for (frame, name, time) in found {
        match moments.last_mut().filter(|moment| moment.frame == frame) {
            Some(moment) => moment.events.push((name, time)),
            None => moments.push(Moment { events: vec![(name, time)], frame }),
        }
    }
    Ok(moments)
}

/// A picture of each moment, all on one scale.
fn pictures(history: &History, shown: &[Moment], parts: &Parts) -> Result<Vec<Figure>> {
    let clock = parts.info.clock;
    let times: Vec<f64> = shown.iter().map(|moment| clock.value(history.times()[moment.frame])).collect();
    // what the sample has: bonds, else forces or speeds; forces between spheres hide the spheres
    let dry = [Subject::Forces, Subject::Speed];
    let [first, second] = if history.dimension() == 2 { dry } else { [dry[1], dry[0]] };
    let mut chosen = None;
    for subject in [Subject::Bonds, first, second] {
        match frames::read(history, subject, 1, &times) {
            Ok(found) => {
                chosen = Some(found);
                break;
            }
            Err(PostError::Lacking { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let Some(chosen) = chosen else { return Ok(vec![]) };
    let view = frames::shown(history, &chosen, parts.titles)?;
    let what = match chosen.subject {
        Subject::Bonds => "bonds and those that broke",
        Subject::Forces => "contact forces",
        Subject::Speed => "speeds",
    };
    let mut figures = vec![];
    for Moment { events, frame } in shown {
        let at = clock.at(history.times()[*frame]);
        let load = parts.load.and_then(|load| load.load_at(history.steps()[*frame]));
        let load = load.map_or_else(String::new, |load| format!(", load {} N", short(load)));
        let caption = format!("{}{at}{load}.", told(events, clock));
        let alt = format!("The sample with its {what} at {at}.");
        figures.push(map_figure(&frames::drawing(history, &chosen, &view, *frame)?, &alt, &caption)?);
    }
    Ok(figures)
}

/// What comes before the time of a picture: its events, as in `First break: ` or, where the frame
/// has another time than some of them, `First break at 0.031 s; shown: collapse, `.
fn told(events: &[(&str, Option<f64>)], clock: Clock) -> String {
    if events.is_empty() {
        return String::new();
    }
    let before = events.iter().filter_map(|(name, time)| Some(format!("{name} at {}", clock.moment((*time)?))));
    let before: Vec<String> = before.collect();
    let own: Vec<&str> = events.iter().filter(|(_, time)| time.is_none()).map(|(name, _)| *name).collect();
    let (before, own) = (before.join(", "), own.join(", "));
    capitalised(&match (before.is_empty(), own.is_empty()) {
        (true, _) => format!("{own}: "),
        (false, true) => format!("{before}; shown: "),
        (false, false) => format!("{before}; shown: {own}, "),
    })
}

/// Load and broken bonds over time.
fn charts(history: &History, ruptures: &[Rupture], parts: &Parts) -> Vec<Figure> {
    let clock = parts.info.clock;
    let (mut figures, over) = (vec![], clock.over());
    if let Some(load) = parts.load {
        let points = load.time.iter().copied().zip(load.load.iter().copied()).collect();
        let mut chart = clock.chart("load (N)").curve("load", colour::BLUE, Style::Line, points);
        chart.pad_x = true;
        let mut text = format!("Load of wall {} over {over}", load.summary.wall);
        if let Some(limit) = parts.limit.and_then(|limit| limit.load) {
            // beside a far greater limit load the curve would be flat
            if limit <= FAR * load.summary.greatest_load {
                chart.levels.push((limit, format!("limit load: {} N", short(limit))));
                text += ", with the limit load";
            } else {
                text += &format!("; the limit load, {} N, is beyond the axis", short(limit));
            }
        }
        text += ".";
        figures.push(chart_figure(chart, &text, &text));
    }
    if !ruptures.is_empty() {
        let times: Vec<f64> = ruptures.iter().map(|rupture| rupture.time).collect();
        let points = total_over_time(history, &times);
        let mut chart = clock.chart("broken bonds").curve("broken bonds", colour::BLUE, Style::Steps, points);
        (chart.y_is_count, chart.pad_x) = (true, true);
        let text = format!("Broken bonds over {over}.");
        figures.push(chart_figure(chart, &format!("Number of broken bonds over {over}."), &text));
    }
    figures
}

/// The result in words.
fn sentences(history: &History, parts: &Parts, ruptures: &[Rupture]) -> Result<String> {
    let mut said = vec![];
    said.extend(parts.load.map(|load| load_sentence(load, ruptures)));
    let first_break = parts.load.and_then(|load| load.summary.first_break);
    said.extend(parts.limit.map(|limit| limit.sentence(first_break)));
    let end = parts.info.clock.at(history.times().last().copied().unwrap_or(0.0));
    match parts.cracks {
        Some(cracks) => said.push(break_sentence(history, cracks, ruptures)?),
        None => {
            let n = parts.info.grains;
            let energy = parts
                .info
                .kinetic_energy
                .map(|energy| format!(", with a kinetic energy of {} J at the end", number(energy)));
            let energy = energy.unwrap_or_default();
            said.push(format!("{} without bonds, until {end}{energy}.", counted(n, "grain")));
        }
    }
    match parts.info.ending {
        Some(Ending::NoConvergence) => {
            said.push(format!("The run ended at {end} because the next step was not solved."));
        }
        Some(Ending::Interrupted) => said.push(format!("The run was interrupted at {end}.")),
        _ => {}
    }
    if parts.info.open_ended {
        said.push("The run was not closed: it is in progress or was stopped.".into());
    }
    Ok(said.join(" "))
}

/// First break, collapse and peak of the load.
fn load_sentence(load: &stress_strain::Report, ruptures: &[Rupture]) -> String {
    let s = &load.summary;
    let newton = |load: f64| quantity(Some(load), "N");
    let mut parts = vec![];
    if let (Some(first), Some(rupture)) = (s.first_break, ruptures.first()) {
        let mode = rupture.mode.label().to_lowercase();
        parts.push(format!("the first bond broke at {} ({}, in {mode})", newton(first), load.clock.at(rupture.time)));
    }
    if let Some(collapse) = s.collapse_load.filter(|_| !s.collapse_early[0]) {
        parts.push(format!("the sample collapsed at {} (strain 10⁻⁴)", newton(collapse)));
    }
    match s.peak_load {
        Some(peak) => parts.push(format!("the load peaked at {}", newton(peak))),
        None if parts.len() < 2 => {
            parts.push(format!("the load reached {} without falling by 5 %", newton(s.greatest_load)))
        }
        None => {}
    }
    format!("Under wall {}, {}.", s.wall, joined(&parts))
}

/// How many bonds broke, in which modes, where the first, and what is left.
fn break_sentence(history: &History, cracks: &cracks::Report, ruptures: &[Rupture]) -> Result<String> {
    let Some(first) = ruptures.first() else {
        return Ok(match cracks.bonds {
            1 => "The bond did not break.".into(),
            bonds => format!("None of the {bonds} bonds broke."),
        });
    };
    let broken = cracks.broken;
    let modes = [
        (broken.tension, "in tension"),
        (broken.shear, "in shear"),
        (broken.rolling, "by rolling"),
        (broken.twist, "by twist"),
    ];
    let mut modes: Vec<_> = modes.into_iter().filter(|(count, _)| *count > 0).collect();
    modes.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let how = match &modes[..] {
        [(1, how)] => format!(", {how}"),
        [(_, how)] => format!(", all {how}"),
        _ => {
            let each: Vec<String> = modes.iter().map(|(count, how)| format!("{count} {how}")).collect();
            format!(": {}", joined(&each))
        }
    };
    let mut text = format!("{} of {} broke{how}", broken.total(), counted(cracks.bonds, "bond"));
    text += &format!("; the first {}.", place(history, first)?);
    if let Some(last) = cracks.fragments.last() {
        let f = last.fragments;
        let whole = cracks.fragments.first().map_or(1, |pieces| pieces.fragments.count);
        let before = if whole > 1 { format!(" ({whole} at the start)") } else { String::new() };
        let single = if f.singles > 0 { format!(", {} of them single grains", f.singles) } else { String::new() };
        text += &format!(
            " {}{before} at the end{single}; the heaviest has {:.1} % of the mass.",
            counted(f.count, "fragment"),
            100.0 * f.largest_mass_fraction
        );
    }
    Ok(text)
}

/// Where a bond was, as shares of the box of the sample as it was bonded.
fn place(history: &History, rupture: &Rupture) -> Result<String> {
    let (d, position) = (history.dimension(), history.grain_state(bonded_frame(history)?)?.position);
    let ends = box_around(&history.grains()?.radius, &position, d);
    let centre = |k: usize| 0.5 * rupture.pair.map(|grain| position[grain as usize * d + k]).iter().sum::<f64>();
    let names = if d == 2 { &["width", "height"][..] } else { &["width", "depth", "height"] };
    let share = |(k, [low, high]): (usize, &[f64; 2])| {
        let share = 100.0 * (centre(k) - low) / (high - low);
        format!("{share:.0} % of the {}", names[k])
    };
    let shares: Vec<String> = ends.iter().enumerate().map(share).collect();
    Ok(format!("at {}, between grains {} and {}", joined(&shares), rupture.pair[0], rupture.pair[1]))
}

/// `a, b and c`.
pub(super) fn joined(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [head @ .., last] => format!("{} and {last}", head.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_joined_as_in_prose() {
        let of = |n: usize| joined(&["a", "b", "c"][..n].iter().map(ToString::to_string).collect::<Vec<_>>());
        assert_eq!([0, 1, 2, 3].map(of), ["", "a", "a and b", "a, b and c"]);
    }
}
