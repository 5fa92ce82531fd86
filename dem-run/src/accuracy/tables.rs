//! The report as tables: as text on stdout, and as CSV.

use super::report::{Indeterminacy, LimitLoad, Report, Row};
use super::spread::MinMeanMax;
use super::trial::{End, Outcome};
use crate::limit::GrowingLoad;
use crate::output::{Folder, Result, Text, cell, counted, number, short};
use crate::row;

/// All tables, as they are printed.
pub fn text(report: &Report) -> String {
    let mut text = head(report);
    text += "\nWork and precision: the cost and the accuracy of each run\n\n";
    text += &work(report);
    if report.bonds > 0 {
        text += "\nResults of the runs for the sample\n\n";
        text += &failure(report);
        text += &limit(report);
    }
    text += &notes(report);
    if let Some(indeterminacy) = &report.indeterminacy {
        text += &spreads(report, indeterminacy);
    }
    text += &profile(report);
    text
}

fn tolerance(value: f64) -> String {
    format!("{value:e}")
}

fn head(report: &Report) -> String {
    let mut text = report.title.as_ref().map_or(String::new(), |title| format!("{title}\n"));
    let bonds = if report.bonds > 0 { format!(", {}", counted(report.bonds, "bond")) } else { String::new() };
    let wall = report.load_wall.as_ref().map_or(String::new(), |name| format!(", loads of wall {name}"));
    text += &format!("{}{bonds}, time step {} s{wall}\n", counted(report.grains, "grain"), tolerance(report.step));
    match report.reference.map(|k| &report.runs[k]) {
        Some(Row { way, step, outcome, .. }) => {
            text += &format!(
                "reference: {}, tolerance {}, step {} s; its residual: median {}, worst {}, {} of {} steps missed the tolerance",
                way.solver.name(),
                tolerance(way.tolerance),
                tolerance(*step),
                short(outcome.median_residual),
                short(outcome.worst_residual),
                outcome.missed_tolerance,
                outcome.steps
            );
            text += &outcome
                .false_strain
                .map_or("\n".into(), |e| format!("; strain before the first break {}\n", short(e)));
        }
        None => text += "reference: none, as no run reached its end\n",
    }
    text
}

/// Solver, tolerance and time step of a row; the reference is marked.
fn labels(report: &Report, k: usize) -> Vec<String> {
    let row = &report.runs[k];
    let mark = if report.reference == Some(k) { " (ref.)" } else { "" };
    row![format!("{}{mark}", row.way.solver.name()), tolerance(row.way.tolerance), tolerance(row.step)]
}

fn work(report: &Report) -> String {
    let bonded = report.bonds > 0;
    // a rigid sample does not deform before the first break
    let rigid = bonded && !report.elastic;
    let mut heads = row!["solver", "tolerance", "step", "CPU", "steps", "iterations", "residual", "false accel."];
    let mut units = row!["", "", "s", "s", "", "", "worst", if bonded { "to 1st break" } else { "worst" }];
    if rigid {
        heads.push("strain".into());
        units.push("to 1st break".into());
    }
    heads.extend(row!["penetration", "energy rem.", "missed", "refused"]);
    units.extend(row!["m", "J", "steps", "solves"]);
    let mut table = Text::default();
    table.row(heads);
    table.row(units);
    for (k, row) in report.runs.iter().enumerate() {
        let o = &row.outcome;
        let mut cells = labels(report, k);
        cells.extend(row![
            short(o.cpu_time),
            o.steps,
            o.iterations,
            short(o.worst_residual),
            short(o.false_acceleration)
        ]);
        if rigid {
            cells.push(o.false_strain.map_or("–".into(), short));
        }
        cells.extend(row![short(o.penetration), short(o.energy_remainder), o.missed_tolerance, o.rejected]);
        table.row(cells);
    }
    table.lines()
}

fn failure(report: &Report) -> String {
    let axes = place_width(report);
    let mut heads = row!["solver", "tolerance", "step"];
    let mut units = row!["", "", "s"];
    if report.driven {
        heads.push("1st break".into());
        units.push("N".into());
    }
    heads.push(if report.driven { "bond" } else { "1st bond" }.into());
    units.push(String::new());
    for axis in &["x", "y", "z"][..axes] {
        heads.push((*axis).into());
        units.push("mm".into());
    }
    heads.push("time".into());
    units.push("s".into());
    if report.driven {
        heads.extend(row!["collapse", "collapse"]);
        units.extend(row!["N, 1e-4", "N, 1e-3"]);
    }
    heads.extend(row!["broken", "Jaccard", "ended by"]);
    units.extend(row!["bonds", "with ref.", ""]);
    let mut table = Text::default();
    table.row(heads);
    table.row(units);
    for (k, row) in report.runs.iter().enumerate() {
        let mut cells = labels(report, k);
        let first = row.outcome.first_break.as_ref();
        if report.driven {
            cells.push(quantity(row.first_break()));
        }
        cells.push(first.map_or("–".into(), |first| first.bond.to_string()));
        cells.extend((0..axes).map(|axis| first.map_or("–".into(), |first| format!("{:.2}", 1e3 * first.place[axis]))));
        cells.push(first.map_or("–".into(), |first| number(first.time)));
        if report.driven {
            cells.extend([0, 1].map(|k| collapse(&row.outcome, k)));
        }
        cells.push(row.outcome.broken.len().to_string());
        cells.push(row.jaccard.map_or("–".into(), |j| format!("{j:.2}")));
        cells.push(row.outcome.ended.name());
        table.row(cells);
    }
    table.lines()
}

/// The limit load in words, beside the first break of the reference.
fn limit(report: &Report) -> String {
    let words = match &report.limit {
        None => return String::new(),
        Some(LimitLoad::Missing { reason }) => return format!("\nno limit load: {reason}\n"),
        Some(LimitLoad::Found(found)) => {
            let own = |load: &&GrowingLoad| {
                load.load.strip_prefix("walls.").is_some_and(|name| Some(name) == report.load_wall.as_deref())
            };
            let limit = found.loads.iter().find(own).and_then(|load| load.limit);
            let first = report.reference.and_then(|k| report.runs[k].first_break());
            match (limit, first) {
                (Some(limit), Some(first)) => format!(
                    "{} N, whatever solver, step and order; the first break of the reference is at {:.2} of it",
                    number(limit),
                    first / limit
                ),
                _ => found.in_words(),
            }
        }
    };
    format!("\nlimit load, at or below which the first bond breaks: {words}\n")
}

fn place_width(report: &Report) -> usize {
    report.runs.iter().find_map(|row| Some(row.outcome.first_break.as_ref()?.place.len())).unwrap_or(2)
}

fn quantity(value: Option<f64>) -> String {
    value.map_or("–".into(), number)
}

/// A collapse load, with a star if before the first break.
fn collapse(outcome: &Outcome, k: usize) -> String {
    let star = if outcome.failure.early[k] { "*" } else { "" };
    quantity(outcome.failure.collapse[k]) + star
}

fn notes(report: &Report) -> String {
    let mut text = String::from("\n");
    if report.elastic {
        text += "false acceleration is that before the first break; it is meaningful only if the load grows slowly\n";
    } else if report.bonds > 0 {
        text += "false acceleration and strain are those before the first break, where a rigid sample is at rest and keeps its shape\n";
    } else {
        text += "false acceleration is meaningful only for a sample that should be at rest\n";
    }
    if report.runs.iter().any(|row| row.outcome.failure.early.contains(&true)) {
        text += match (report.elastic, report.one_piece) {
            (true, _) => "* before any bond broke: strain of the elastic bonds, and solver error\n",
            (false, true) => "* before any bond broke: solver error, not strain of the sample\n",
            (false, false) => "* before any bond broke: not all grains are bonded to one piece\n",
        };
    }
    for row in &report.runs {
        if let End::Failed(why) = &row.outcome.ended {
            let way = &row.way;
            text += &format!("{}, {}, {} s: {why}\n", way.solver.name(), tolerance(way.tolerance), tolerance(row.step));
        }
    }
    if report.interrupted {
        text += "interrupted: unfinished runs are missing\n";
    }
    if text.len() == 1 { String::new() } else { text }
}

fn spreads(report: &Report, indeterminacy: &Indeterminacy) -> String {
    let mut text = format!(
        "\nIndeterminacy: the same scene with other contact orders{}, tolerance {}, step {} s\n\n",
        if report.elastic { "" } else { " and from other starting reactions" },
        tolerance(indeterminacy.tolerance),
        tolerance(indeterminacy.step_factor * report.step)
    );
    let mut table = Text::default();
    let mut heads = row!["solver", "varied", "runs", "1st bonds"];
    let mut units = row!["", "", "", "different"];
    if report.driven {
        heads.extend(row!["1st break", "", ""]);
        units.extend(row!["N: min", "mean", "max"]);
        heads.extend(row!["collapse", "", "", "collapse", "", ""]);
        units.extend(row!["N, 1e-4: min", "mean", "max", "N, 1e-3: min", "mean", "max"]);
    }
    heads.push("Jaccard".into());
    units.push("mean".into());
    table.row(heads);
    table.row(units);
    for spread in &indeterminacy.spreads {
        let failed = if spread.failed > 0 { format!(" + {} failed", spread.failed) } else { String::new() };
        let mut cells = row![spread.solver.name(), spread.varied.name(), format!("{}{failed}", spread.runs)];
        cells.push(spread.first_bonds.to_string());
        if report.driven {
            cells.extend(range(spread.first_break));
            cells.extend(spread.collapse.into_iter().flat_map(range));
        }
        cells.push(spread.jaccard.map_or("–".into(), |j| format!("{j:.2}")));
        table.row(cells);
    }
    text += &table.lines();
    text += "\n1st bonds: number of different bonds that broke first; Jaccard: similarity of the broken bonds of two runs, 1 if equal\n";
    text
}

fn range(range: Option<MinMeanMax>) -> Vec<String> {
    match range {
        Some(MinMeanMax { min, mean, max }) => row![number(min), number(mean), number(max)],
        None => row!["–", "–", "–"],
    }
}

fn profile(report: &Report) -> String {
    let Some(profile) = &report.profile else { return String::new() };
    let text = format!(
        "\nPerformance profile: {} contact problems of the reference, each from the same start to a residual of {}\n\n",
        profile.step.len(),
        tolerance(profile.tolerance)
    );
    let mut table = Text::default();
    let mut heads = row!["solver", "solved", "iterations", "", "residual", "CPU"];
    let mut units = row!["", "%", "median", "max", "median", "ms, mean"];
    for factor in &profile.factors {
        heads.push(if heads.len() == 6 { "% within".into() } else { String::new() });
        units.push(format!("{factor} ×"));
    }
    table.row(heads);
    table.row(units);
    for solver in &profile.solvers {
        let mut iterations: Vec<u64> = solver.costs.iter().map(|cost| cost.iterations).collect();
        iterations.sort_unstable();
        let mut residuals: Vec<f64> = solver.costs.iter().map(|cost| cost.residual).collect();
        residuals.sort_unstable_by(f64::total_cmp);
        let count = solver.costs.len().max(1) as f64;
        let solved = solver.costs.iter().filter(|cost| cost.solved).count() as f64;
        let cpu: f64 = solver.costs.iter().map(|cost| cost.cpu_time).sum();
        let mut cells = row![
            solver.solver.name(),
            format!("{:.0}", 100.0 * solved / count),
            iterations.get(iterations.len() / 2).copied().unwrap_or(0),
            iterations.last().copied().unwrap_or(0),
            quantity(residuals.get(residuals.len() / 2).copied()),
            short(1e3 * cpu / count)
        ];
        cells.extend(solver.shares.iter().map(|share| format!("{:.0}", 100.0 * share)));
        table.row(cells);
    }
    text + &table.lines()
}

/// Writes the tables as CSV with all digits: a row for each run, or for each problem and solver.
///
/// # Errors
/// A file cannot be written.
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let mut head = vec!["solver", "tolerance", "step_factor", "step_s"];
    head.extend(OUTCOME);
    head.extend(["jaccard", "first_break_deviation", "collapse_1e4_deviation", "collapse_1e3_deviation", "reference"]);
    let rows = report.runs.iter().enumerate().map(|(k, row)| {
        let mut cells = row![row.way.solver.name(), row.way.tolerance, row.way.step_factor, row.step];
        cells.extend(outcome(&row.outcome));
        cells.extend([cell(row.jaccard), cell(row.first_break_deviation)]);
        cells.extend(row.collapse_deviation.map(cell));
        cells.push((report.reference == Some(k)).to_string());
        cells
    });
    folder.table("work-precision", &head, rows)?;
    if let Some(indeterminacy) = &report.indeterminacy {
        let mut head = vec!["solver", "varied", "number"];
        head.extend(OUTCOME);
        let rows = indeterminacy.runs.iter().map(|run| {
            let mut cells = row![run.solver.name(), run.varied.name(), run.number];
            cells.extend(outcome(&run.outcome));
            cells
        });
        folder.table("indeterminacy", &head, rows)?;
    }
    let Some(profile) = &report.profile else { return Ok(()) };
    let head = ["step", "time_s", "contacts", "solver", "solved", "residual", "iterations", "cpu_s"];
    let rows = (0..profile.step.len()).flat_map(|p| {
        profile.solvers.iter().map(move |solver| {
            let cost = &solver.costs[p];
            let posed = (profile.step[p], profile.time[p], profile.contacts[p]);
            row![
                posed.0,
                posed.1,
                posed.2,
                solver.solver.name(),
                cost.solved,
                cost.residual,
                cost.iterations,
                cost.cpu_time
            ]
        })
    });
    folder.table("profile", &head, rows)
}

/// Columns of [`outcome`].
const OUTCOME: [&str; 25] = [
    "ended",
    "time_s",
    "steps",
    "cpu_s",
    "iterations",
    "worst_residual",
    "median_residual",
    "false_acceleration",
    "false_strain",
    "missed_tolerance",
    "rejected",
    "penetration_m",
    "energy_remainder_J",
    "bond_remainder_J",
    "first_break_N",
    "first_break_s",
    "first_break_bond",
    "first_break_x_m",
    "first_break_y_m",
    "first_break_z_m",
    "collapse_1e4_N",
    "collapse_1e3_N",
    "collapse_1e4_early",
    "load_at_5_percent_broken_N",
    "bonds_broken",
];

fn outcome(o: &Outcome) -> Vec<String> {
    let first = o.first_break.as_ref();
    let place = |axis: usize| cell(first.and_then(|first| first.place.get(axis).copied()));
    row![
        o.ended.name(),
        o.time,
        o.steps,
        o.cpu_time,
        o.iterations,
        o.worst_residual,
        o.median_residual,
        o.false_acceleration,
        cell(o.false_strain),
        o.missed_tolerance,
        o.rejected,
        o.penetration,
        o.energy_remainder,
        o.bond_remainder,
        cell(first.and_then(|first| first.load)),
        cell(first.map(|first| first.time)),
        first.map_or(String::new(), |first| first.bond.to_string()),
        place(0),
        place(1),
        place(2),
        cell(o.failure.collapse[0]),
        cell(o.failure.collapse[1]),
        o.failure.early[0],
        cell(o.failure.broken_share),
        o.broken.len()
    ]
}
