//! Strength over many runs: the report, and how it is computed from their histories.

use std::path::PathBuf;

use dem_scene::failure::PEAK_DROP;
use serde::Serialize;

use super::fit::{Estimate, Line, Spread, line, spread};
use super::left_out::{self, LeftOut};
use super::runs::{self, Found, Measure, histories, name};
use super::scenes::{design, unit};
use crate::extent::range;
use crate::output::{Result, Text, counted, facts, number, quantity};

/// Threshold of round-off: of 1 − R², and of the ratio of an intercept to the greatest strength.
const ROUNDING: f64 = 1e-12;

/// Options of the analysis.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The varied field, as `--set` names it; found from the scenes where it is absent.
    pub against: Option<String>,
    /// What counts as the strength.
    pub measure: Measure,
    /// The load wall; that of the scenes where it is absent.
    pub wall: Option<String>,
}

/// A run that has a strength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Its file.
    pub run: String,
    /// Value of the varied field.
    pub value: f64,
    /// Its sample.
    pub sample: String,
    /// Its strength, N.
    pub strength: f64,
    /// Its time, s.
    pub time: f64,
    /// Strength over the field's value; `None` where that is zero.
    pub ratio: Option<f64>,
    /// The greatest load up to this time, N.
    pub greatest_before: f64,
}

/// The runs at one value of the field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtValue {
    /// The value.
    pub value: f64,
    /// Their strengths, N.
    pub strength: Spread,
    /// The least and the greatest strength, N.
    pub range: [f64; 2],
    /// Strength over the value; `None` where that is zero.
    pub ratio: Option<Spread>,
}

/// The runs of one sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfSample {
    /// The sample.
    pub sample: String,
    /// Number of runs.
    pub runs: usize,
    /// Whether the runs have the same grains and bonds.
    pub same_grains: bool,
    /// The line through the runs; `None` for runs at one value.
    pub line: Option<Line>,
    /// Mean of strength over value; `None` where a value is zero.
    pub ratio: Option<f64>,
    /// Greatest deviation of that ratio from its mean, as a share of the mean; `None` for runs at
    /// one value.
    pub ratio_deviation: Option<f64>,
}

/// The scatter of the samples; a value is `None` where no sample has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OverSamples {
    /// Their slopes.
    pub slope: Option<Spread>,
    /// Their intercepts, N.
    pub intercept: Option<Spread>,
    /// Their means of strength over value.
    pub ratio: Option<Spread>,
}

/// Strength against a field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// What counts as the strength.
    pub measure: Measure,
    /// The varied field.
    pub field: String,
    /// Its unit; empty for a number without unit.
    pub unit: String,
    /// Fields that vary with it.
    pub along: Vec<String>,
    /// Fields that make the sample, of those that differ.
    pub sample_fields: Vec<String>,
    /// The runs, in the order given.
    pub runs: Vec<Run>,
    /// Runs that did not fail or are unfinished.
    pub left_out: Vec<LeftOut>,
    /// The runs at each value, in order.
    pub values: Vec<AtValue>,
    /// The runs of each sample, in order.
    pub samples: Vec<OfSample>,
    /// The line through all points; `None` where they have one value.
    pub line: Option<Line>,
    /// The spread of the samples.
    pub over_samples: OverSamples,
    /// Notes: what the runs do not show, and caveats.
    pub notes: Vec<String>,
}

/// Reads the runs that `paths` name: histories, and folders of sweeps.
///
/// # Errors
/// [`crate::output::PostError::Usage`] for no runs, runs of different scenes, and where none
/// failed; [`crate::output::PostError::Lacking`] for a run without a load; those of reading
/// histories and manifests.
pub fn read(paths: &[PathBuf], options: &Options) -> Result<Report> {
    let (paths, mut left_out) = histories(paths)?;
    let wall = options.wall.as_deref();
    let found = paths.iter().map(|path| runs::read(path, options.measure, wall)).collect::<Result<Vec<Found>>>()?;
    let scenes: Vec<(String, String)> = found.iter().map(|run| (name(&run.path), run.scene.clone())).collect();
    let design = design(&scenes, options.against.as_deref())?;
    let (mut runs, mut grains) = (vec![], vec![]);
    for (k, one) in found.into_iter().enumerate() {
        let (run, value) = (name(&one.path), design.values[k]);
        match one.strength {
            Ok(at) => {
                let sample = design.samples[design.sample[k]].clone();
                let ratio = (value != 0.0).then(|| at.load / value);
                let (strength, time, greatest_before) = (at.load, at.time, at.greatest_before);
                runs.push(Run { run, value, sample, strength, time, ratio, greatest_before });
                grains.push(one.grains);
            }
            Err(why) => left_out.push(LeftOut { run, why }),
        }
    }
    if runs.is_empty() {
        return Err(left_out::none_failed(&left_out, options.measure.title()));
    }
    let samples = samples(&design.samples, &runs, &grains);
    let mut report = Report {
        measure: options.measure,
        unit: unit(&design.field),
        field: design.field,
        along: design.along,
        sample_fields: design.sample_fields,
        values: at_values(&runs),
        line: line(&points(runs.iter())),
        over_samples: over_samples(&samples),
        samples,
        left_out,
        runs,
        notes: vec![],
    };
    report.notes = report.remarks();
    Ok(report)
}

fn points<'a>(runs: impl Iterator<Item = &'a Run>) -> Vec<(f64, f64)> {
    runs.map(|run| (run.value, run.strength)).collect()
}

/// The runs at each value of the field.
fn at_values(runs: &[Run]) -> Vec<AtValue> {
    let mut values: Vec<f64> = runs.iter().map(|run| run.value).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let at = |value: f64| {
        let here: Vec<&Run> = runs.iter().filter(|run| run.value == value).collect();
        let strengths: Vec<f64> = here.iter().map(|run| run.strength).collect();
        let ratios: Vec<f64> = here.iter().filter_map(|run| run.ratio).collect();
        let range = range(strengths.iter().copied());
        Some(AtValue { value, strength: spread(&strengths)?, range, ratio: spread(&ratios) })
    };
    values.into_iter().filter_map(at).collect()
}

/// The runs of each sample; `grains` are the radii and bonds of each run.
fn samples(names: &[String], runs: &[Run], grains: &[(Vec<f64>, Vec<[i32; 2]>)]) -> Vec<OfSample> {
    let of = |sample: &String| {
        let here: Vec<usize> = (0..runs.len()).filter(|&k| runs[k].sample == *sample).collect();
        let first = *here.first()?;
        let ratios = here.iter().map(|&k| runs[k].ratio).collect::<Option<Vec<f64>>>().unwrap_or_default();
        let ratio = spread(&ratios).map(|ratios| ratios.mean);
        let deviation = |mean: f64| ratios.iter().map(|r| (r / mean - 1.0).abs()).fold(0.0, f64::max);
        let line = line(&points(here.iter().map(|&k| &runs[k])));
        Some(OfSample {
            sample: sample.clone(),
            runs: here.len(),
            same_grains: here.iter().all(|&k| grains[k] == grains[first]),
            ratio_deviation: line.and(ratio).filter(|mean| *mean != 0.0).map(deviation),
            ratio,
            line,
        })
    };
    names.iter().filter_map(of).collect()
}

fn over_samples(samples: &[OfSample]) -> OverSamples {
    let over = |of: &dyn Fn(&OfSample) -> Option<f64>| spread(&samples.iter().filter_map(of).collect::<Vec<f64>>());
    OverSamples {
        slope: over(&|sample| sample.line.map(|line| line.slope.value)),
        intercept: over(&|sample| sample.line.map(|line| line.intercept.value)),
        ratio: over(&|sample| sample.ratio),
    }
}

impl Report {
    /// Whether every run has a strength.
    ///
    /// # Errors
    /// [`crate::output::PostError::Incomplete`] where runs were left out.
    pub fn complete(&self) -> Result<()> {
        left_out::complete(&self.left_out, self.runs.len())
    }

    /// The unit of strength over field, and of a slope.
    pub fn slope_unit(&self) -> String {
        match self.unit.as_str() {
            "N" => String::new(),
            "" => "N".into(),
            unit if unit.contains(['/', ' ']) => format!("N/({unit})"),
            unit => format!("N/{unit}"),
        }
    }

    /// Notes: what the runs do not show, and caveats.
    fn remarks(&self) -> Vec<String> {
        let mut notes = vec![];
        let lined = self.samples.iter().filter(|sample| sample.line.is_some()).count();
        if self.values.len() == 1 {
            notes.push(format!(
                "only one value of {}: no line can be fitted, and constancy of the ratio cannot be tested",
                self.field
            ));
        } else if lined == 0 {
            notes.push(
                "no sample was run at two values: no lines of single samples, and constancy of ratios cannot be tested"
                    .into(),
            );
        } else if self.line.is_some_and(|line| line.slope.standard_error.is_none()) {
            notes.push("two points: the line is exact, and its errors are unknown".into());
        }
        if self.line.is_some_and(|line| line.r_squared.is_none()) {
            notes.push("all strengths are equal: R² is undefined".into());
        }
        if self.samples.len() == 1 {
            notes.push("only one sample: the scatter of strength between samples is unknown".into());
        } else if lined == 1 {
            notes
                .push("only one sample was run at two values: the scatter of slopes between samples is unknown".into());
        }
        if self.values.iter().any(|at| at.value == 0.0) {
            notes.push(format!("{} is zero in some runs: the ratio is undefined", self.field));
        }
        let other: Vec<&str> =
            self.samples.iter().filter(|sample| !sample.same_grains).map(|sample| sample.sample.as_str()).collect();
        if let Some(first) = other.first() {
            let count = other.len();
            notes.push(format!(
                "{count} of the samples have different grains at different values, such as {first}: the line of such a \
                 sample mixes different samples"
            ));
        }
        let fallen = self.runs.iter().filter(|run| run.strength < (1.0 - PEAK_DROP) * run.greatest_before).count();
        if fallen > 0 {
            notes.push(format!(
                "in {} the load was larger before, and had fallen: --measure peak takes the greatest load",
                counted(fallen, "run")
            ));
        }
        notes
    }

    /// The report as tables.
    pub fn table(&self) -> String {
        let slope_unit = self.slope_unit();
        let varied = format!("{}, {}", axis(&self.field, &self.unit), counted(self.values.len(), "value"));
        let by = if self.sample_fields.is_empty() {
            String::new()
        } else {
            format!(", by {}", self.sample_fields.join(", "))
        };
        let mut lines = vec![("strength", self.measure.title().to_string()), ("against", varied)];
        if !self.along.is_empty() {
            lines.push(("moves with it", self.along.join(", ")));
        }
        lines.extend([
            ("samples", format!("{}{by}", self.samples.len())),
            ("runs", left_out::counted(self.runs.len(), &self.left_out)),
        ]);
        if let Some(line) = &self.line {
            lines.extend([
                ("line through all runs", self.equation(line)),
                ("  slope", estimate(&line.slope, &slope_unit)),
                ("  intercept", self.intercept(line)),
            ]);
            lines.extend(self.explained(line).map(|told| ("  R²", told)));
        }
        lines.extend(self.scatter());
        let (head, rows) = self.value_rows();
        let mut values = Text::new(&head);
        rows.into_iter().for_each(|row| values.row(row));
        let mut out = facts(&lines) + "\n" + &values.lines() + "\n" + &self.sample_table();
        out += &left_out::remarks(&self.left_out, "strength.csv", &self.notes);
        out
    }

    /// The intercept of a line with its errors.
    pub(crate) fn intercept(&self, line: &Line) -> String {
        estimate(&Estimate { value: self.plain(line.intercept.value), ..line.intercept }, "N")
    }

    /// The scatter over the samples: names and values.
    pub(crate) fn scatter(&self) -> Vec<(&'static str, String)> {
        let (over, unit) = (&self.over_samples, self.slope_unit());
        let intercept = over.intercept.map(|found| Spread {
            mean: self.plain(found.mean),
            deviation: found.deviation.map(|deviation| self.plain(deviation)),
            interval: found.interval.map(|ends| ends.map(|end| self.plain(end))),
            ..found
        });
        let lines = [
            ("slope over samples", &over.slope, unit.as_str()),
            ("intercept over samples", &intercept, "N"),
            ("strength/field over samples", &over.ratio, &unit),
        ];
        lines.into_iter().filter_map(|(name, found, unit)| Some((name, spread_line(&(*found)?, unit)))).collect()
    }

    /// The runs at each value: the head and the rows of a table.
    pub(crate) fn value_rows(&self) -> ([&str; 6], Vec<Vec<String>>) {
        let row = |at: &AtValue| {
            let s = &at.strength;
            vec![
                quantity(Some(at.value), &self.unit),
                s.count.to_string(),
                quantity(Some(s.mean), "N"),
                quantity(s.deviation, "N"),
                interval(s.interval),
                quantity(at.ratio.map(|ratio| ratio.mean), &self.slope_unit()),
            ]
        };
        let head = [&self.field, "runs", "mean strength", "spread", "95 % of the mean", "strength/field"];
        (head, self.values.iter().map(row).collect())
    }

    fn sample_table(&self) -> String {
        let mut table = Text::new(&["sample", "runs", "strength/field", "within", "slope", "intercept"]);
        for sample in &self.samples {
            table.row(vec![
                sample.sample.clone(),
                sample.runs.to_string(),
                quantity(sample.ratio, &self.slope_unit()),
                sample.ratio_deviation.map_or_else(|| "–".into(), within),
                quantity(sample.line.map(|line| line.slope.value), &self.slope_unit()),
                quantity(sample.line.map(|line| self.plain(line.intercept.value)), "N"),
            ]);
        }
        table.lines()
    }

    /// An intercept, or zero where it is round-off.
    fn plain(&self, intercept: f64) -> f64 {
        let greatest = self.runs.iter().map(|run| run.strength.abs()).fold(0.0, f64::max);
        if intercept.abs() < ROUNDING * greatest { 0.0 } else { intercept }
    }

    /// R² of the line through all runs, which includes the scatter of samples, and the least R² of
    /// the samples' own lines, which does not.
    pub(crate) fn explained(&self, line: &Line) -> Option<String> {
        let all = line.r_squared.map(share)?;
        let lines = self.samples.iter().filter_map(|sample| sample.line);
        // two points fit a line exactly
        let own = lines.filter(|line| line.points > 2).filter_map(|line| line.r_squared).reduce(f64::min);
        Some(match (self.samples.len(), own) {
            (1, _) => all,
            (_, None) => format!("{all} over all runs, with the scatter of samples"),
            (_, Some(own)) => {
                format!(
                    "{all} over all runs, with the scatter of samples; {} at least in each sample's own line",
                    share(own)
                )
            }
        })
    }

    /// The equation of the line in the units of the axes.
    pub fn equation(&self, line: &Line) -> String {
        let intercept = match self.plain(line.intercept.value) {
            0.0 => String::new(),
            value if value < 0.0 => format!(" − {}", number(-value)),
            value => format!(" + {}", number(value)),
        };
        format!("y = {} x{intercept}", number(line.slope.value))
    }
}

/// A relative deviation in percent; round-off is printed as exact.
fn within(share: f64) -> String {
    if share < ROUNDING { "exact".into() } else { format!("±{} %", number(100.0 * share)) }
}

/// R², as 1 − rest where four digits would round it to 1.
fn share(r: f64) -> String {
    match 1.0 - r {
        rest if rest < ROUNDING => "1".into(),
        rest if rest < 1e-3 => format!("1 − {rest:.1e}"),
        _ => number(r),
    }
}

/// A field or a load with its unit, as on an axis.
pub(crate) fn axis(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} ({unit})") }
}

/// A fitted number with its errors.
pub(crate) fn estimate(found: &Estimate, unit: &str) -> String {
    let value = quantity(Some(found.value), unit);
    match found.standard_error {
        Some(error) => format!("{value}, standard error {}, 95 % {}", number(error), interval(found.interval)),
        None => value,
    }
}

fn spread_line(found: &Spread, unit: &str) -> String {
    let mean = quantity(Some(found.mean), unit);
    match found.deviation {
        Some(deviation) => format!(
            "mean {mean}, spread {}, 95 % of the mean {}, {} samples",
            number(deviation),
            interval(found.interval),
            found.count
        ),
        None => format!("{mean} in one sample"),
    }
}

fn interval(found: Option<[f64; 2]>) -> String {
    found.map_or_else(|| "–".into(), |[low, high]| format!("{} to {}", number(low), number(high)))
}
