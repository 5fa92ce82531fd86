//! The sections of the page of a sweep.

use std::path::{Component, Path};

use dem_history::sweep::State;

use super::pictures;
use super::report::Report;
use super::runs::{Run, values};
use super::table::{cell, run_rows};
use crate::envelope;
use crate::output::{Result, counted, number, short};
use crate::report::result::joined;
use crate::section::{Section, Table, chart_figure};
use crate::strength;
use crate::strength::report::estimate;
use crate::strength::scenes::unit;

/// Maximum number of values of a field that are listed.
const VALUES: usize = 8;

/// The sections, in order; links lead from the folder `from` to the histories.
///
/// # Errors
/// Those of reading histories and of drawing.
pub fn all(report: &Report, from: &Path) -> Result<Vec<Section>> {
    let mut sections = vec![result(report, from), strength_section(report)];
    sections.extend(report.envelope.as_ref().map(envelope_section));
    sections.push(curves(report));
    sections.push(pictures::section(report)?);
    Ok(sections)
}

/// The result in words, and the tables of the runs.
fn result(report: &Report, from: &Path) -> Section {
    let (head, rows) = run_rows(&report.fields, &report.runs);
    let links = report.runs.iter().map(|run| run.history.as_deref().and_then(|path| link(from, path))).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let caption = "The runs, with links to their histories.";
    let mut tables = vec![Table { links, ..Table::new(caption, &head, rows) }];
    tables.extend(failed(report));
    Section { id: "result", title: "Result", text: sentences(report), tables, ..Section::default() }
}

/// Which fields vary, how the runs ended, and the strength.
fn sentences(report: &Report) -> String {
    let varied: Vec<String> = report.fields.iter().map(|field| in_words(report, field)).collect();
    let runs = counted(report.runs.len(), "run");
    let mut said = vec![if varied.is_empty() {
        format!("{}: {runs} of {}.", report.sweep, report.scene)
    } else {
        format!("{}: {runs} of {}, over {}.", report.sweep, report.scene, joined(&varied))
    }];
    said.push(endings(report));
    said.extend(strength_sentence(report));
    said.extend(report.envelope.as_ref().and_then(|found| found.envelope.as_ref()).map(|line| {
        let (angle, cohesion) = (short(line.friction_angle.value), short(1e-3 * line.cohesion.value));
        format!("The circles at failure touch a line of friction angle {angle}° and cohesion {cohesion} kPa.")
    }));
    let solved = report.runs.iter().filter_map(|run| Some((run.missed_tolerance?, run.steps)));
    let (missed, steps) = solved.fold((0, 0), |all, run| (all.0 + run.0, all.1 + run.1));
    if steps > 0 {
        let missed = if missed == 0 { "None".into() } else { missed.to_string() };
        said.push(format!("{missed} of {} missed the tolerance of the solver.", counted(steps, "step")));
    }
    said.join(" ")
}

/// A field with its values: `bonds.strength (5, 10, 20 N)`, `seed (1 to 10)`.
fn in_words(report: &Report, field: &str) -> String {
    let values = values(&report.runs.iter().collect::<Vec<_>>(), field);
    let numbers: Vec<f64> = values.iter().filter_map(|value| value.as_f64()).collect();
    let unit = unit(field);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let text = if numbers.len() < values.len() || numbers.is_empty() {
        // tables have no place in a sentence
        let plain = values.len() <= VALUES && !values.iter().any(|value| value.is_array() || value.is_object());
        let listed = || values.iter().map(|value| cell(value)).collect::<Vec<_>>().join(", ");
        if plain { listed() } else { counted(values.len(), "value") }
    } else {
        let (first, last) = (numbers[0], numbers[numbers.len() - 1]);
        let consecutive = numbers.len() > 2 && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
        match numbers.len() {
            _ if consecutive => format!("{} to {}{unit}", number(first), number(last)),
            count if count > VALUES => format!("{count} values from {} to {}{unit}", number(first), number(last)),
            _ => format!("{}{unit}", numbers.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", ")),
        }
    };
    format!("{field} ({text})")
}

/// How many runs ended, and why; how many failed, with which exit codes.
fn endings(report: &Report) -> String {
    let mut parts = vec![];
    let done = report.count(State::Done);
    if done > 0 {
        let mut ends: Vec<(&str, usize)> = vec![];
        for run in report.runs.iter().filter(|run| run.state == State::Done) {
            let why = ended(run.ending.as_deref().unwrap_or_default());
            match ends.iter_mut().find(|(other, _)| *other == why) {
                Some((_, count)) => *count += 1,
                None => ends.push((why, 1)),
            }
        }
        ends.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let each: Vec<String> = ends.iter().map(|(why, count)| format!("{count} {why}")).collect();
        parts.push(match &ends[..] {
            [(why, 1)] if done == report.runs.len() => format!("It ended {why}"),
            [(why, _)] if done == report.runs.len() => format!("All ended {why}"),
            [(why, _)] => format!("{done} ended {why}"),
            _ => format!("{done} ended: {}", joined(&each)),
        });
    }
    let failed: Vec<&Run> = report.runs.iter().filter(|run| run.state == State::Failed).collect();
    if !failed.is_empty() {
        let mut codes: Vec<String> = failed.iter().filter_map(|run| run.exit_code).map(|c| c.to_string()).collect();
        let of_them = if codes.len() < failed.len() { format!(", {} of them", codes.len()) } else { String::new() };
        codes.sort();
        codes.dedup();
        let codes =
            if codes.is_empty() { String::new() } else { format!("{of_them} with exit code {}", joined(&codes)) };
        parts.push(format!("{} failed{codes}", failed.len()));
    }
    for (state, what) in [(State::Running, "in progress"), (State::Left, "not started")] {
        let count = report.count(state);
        if count > 0 {
            parts.push(format!("{count} {} {what}", if count == 1 { "is" } else { "are" }));
        }
    }
    if parts.is_empty() { "No run.".into() } else { format!("{}.", joined(&parts)) }
}

/// Why a run ended, from its summary.
fn ended(ending: &str) -> &str {
    match ending {
        "time" => "at the end of the scene's time",
        "wall_travel" => "with the travel of the wall",
        "broken_fraction" => "when enough bonds were broken",
        "load_drop" => "with the drop of the load",
        "stages" => "with the last stage",
        "no_break" => "because no further bond breaks",
        "no_equilibrium" => "because the sample does not stay at rest",
        "interrupted" => "when they were interrupted",
        "" => "without a summary",
        other => other,
    }
}

/// The strength and its line.
fn strength_sentence(report: &Report) -> Option<String> {
    let found = report.strength.as_ref()?;
    let low = found.runs.iter().map(|run| run.strength).fold(f64::INFINITY, f64::min);
    let high = found.runs.iter().map(|run| run.strength).fold(f64::NEG_INFINITY, f64::max);
    let range =
        if low < high { format!("{} to {} N", number(low), number(high)) } else { format!("{} N", number(low)) };
    let line = found.line.as_ref().map_or_else(String::new, |line| {
        let error = line
            .slope
            .standard_error
            .map_or_else(String::new, |error| format!(", slope ± {} (standard error)", number(error)));
        format!("; over {} it is y = {}{error}", found.field, found.equation(line).trim_start_matches("y = "))
    });
    Some(format!("The {} is {range}{line}.", found.measure.title()))
}

/// The runs that failed, with their messages.
fn failed(report: &Report) -> Option<Table> {
    let failed = report.runs.iter().filter(|run| run.state == State::Failed);
    let row = |run: &Run| {
        let code = run.exit_code.map_or_else(|| "–".into(), |code| code.to_string());
        vec![run.id.clone(), code, run.message.clone().unwrap_or_default()]
    };
    let rows: Vec<Vec<String>> = failed.map(row).collect();
    if rows.is_empty() {
        return None;
    }
    let caption = "Runs that failed; their loads are those up to the failure.";
    Some(Table { sentences: true, ..Table::new(caption, &["run", "exit code", "message"], rows) })
}

/// The strength over the field that varies, or the reason why there is none.
fn strength_section(report: &Report) -> Section {
    let empty = Section { id: "strength", title: "Strength", ..Section::default() };
    let Some(found) = &report.strength else {
        let why = report.no_strength.as_deref().unwrap_or_default();
        return Section { text: format!("None: {why}."), ..empty };
    };
    let mut facts = vec![("Strength".to_string(), found.measure.title().to_string())];
    if let Some(line) = &found.line {
        facts.push(("Line through all runs".into(), found.equation(line)));
        facts.push(("Slope".into(), estimate(&line.slope, &found.slope_unit())));
        facts.push(("Intercept".into(), found.intercept(line)));
        facts.extend(found.explained(line).map(|told| ("R²".to_string(), told)));
    }
    facts.extend(found.scatter().into_iter().map(|(name, value)| (crate::section::capitalised(name), value)));
    facts.extend(found.notes.iter().map(|note| ("Note".to_string(), note.clone())));
    let out = found.left_out.len();
    if out > 0 {
        facts.push(("Left out".into(), format!("{}: not done, or the sample did not fail", counted(out, "run"))));
    }
    let alt = format!("The {} over {}: runs by sample, means and line.", found.measure.title(), found.field);
    let figures = vec![chart_figure(strength::chart(found), &alt, &alt)];
    let (head, rows) = found.value_rows();
    let tables = vec![Table::new("The runs at each value.", &head, rows)];
    Section { facts, figures, tables, ..empty }
}

/// The failure envelope.
fn envelope_section(found: &envelope::Report) -> Section {
    let mut facts = vec![("Failure".to_string(), found.measure.title().to_string())];
    if let Some(line) = &found.envelope {
        facts.extend(
            envelope::report::line_facts(line)
                .into_iter()
                .map(|(name, value)| (crate::section::capitalised(name.trim()), value)),
        );
    }
    facts.extend(found.notes.iter().map(|note| ("Note".to_string(), note.clone())));
    let figures = envelope::charts(found).map(|(chart, alt)| chart_figure(chart, alt, alt)).into();
    Section { id: "envelope", title: "Failure envelope", facts, figures, ..Section::default() }
}

/// The curves of all runs.
fn curves(report: &Report) -> Section {
    let text = "The load over the axial strain of the grains, fitted to their displacements. If rigid bonds join all \
                grains to one piece, strain before the first break is solver error.";
    let figures: Vec<_> =
        pictures::curves(report).into_iter().map(|(chart, caption)| chart_figure(chart, &caption, &caption)).collect();
    let text = if figures.is_empty() { "None: no run has a load and a strain." } else { text };
    Section { id: "curves", title: "Load and strain", text: text.into(), figures, ..Section::default() }
}

/// The address of a file in a page of the folder `from`: relative, so that both may be moved
/// together; `None` where there is no way from one to the other.
fn link(from: &Path, to: &Path) -> Option<String> {
    let (from, to) = (from.canonicalize().ok()?, to.canonicalize().ok()?);
    let (mut from, mut to) = (from.components().peekable(), to.components().peekable());
    while from.peek().is_some() && from.peek() == to.peek() {
        from.next();
        to.next();
    }
    let up = from.map(|_| Some("..".to_string()));
    let down = to.map(|part| match part {
        Component::Normal(name) => name.to_str().map(encoded),
        _ => None,
    });
    up.chain(down).collect::<Option<Vec<String>>>().map(|parts| parts.join("/"))
}

/// A name as a part of an address: letters, digits and `-._~` as they are, other bytes in
/// hexadecimal digits (RFC 3986, section 2).
fn encoded(name: &str) -> String {
    let byte = |b: u8| match b {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(b).to_string(),
        other => format!("%{other:02X}"),
    };
    name.bytes().map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_leads_from_the_page_to_the_history() {
        let folder = tempfile::tempdir().unwrap();
        let (page, runs) = (folder.path().join("a b-report"), folder.path().join("a b/runs"));
        std::fs::create_dir_all(&page).unwrap();
        std::fs::create_dir_all(&runs).unwrap();
        let history = runs.join("0001 100%.h5");
        std::fs::write(&history, "").unwrap();
        assert_eq!(link(&page, &history).as_deref(), Some("../a%20b/runs/0001%20100%25.h5"));
        assert_eq!(link(&runs, &history).as_deref(), Some("0001%20100%25.h5"));
        assert_eq!(link(&page, &runs.join("none.h5")), None);
    }
}
