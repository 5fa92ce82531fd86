//! The failure envelope: the report, and how it is computed from histories.

use std::path::{Path, PathBuf};

use dem_history::History;
use serde::Serialize;

use super::mohr::{Envelope, envelope, one_confinement};
use crate::clock::Clock;
use crate::output::{PostError, Result, Text, facts, number, quantity};
use crate::strength::left_out::{self, LeftOut};
use crate::strength::report::estimate;
use crate::strength::runs::{Course, Measure, histories, name};
use crate::strength::scenes::varied;
use crate::tensor::principal;

/// The stress of a run at failure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Circle {
    /// Its file.
    pub run: String,
    /// Time of the state, s.
    pub time: f64,
    /// What it counts.
    #[serde(skip)]
    pub clock: Clock,
    /// Load of the sample in the step of failure, N.
    pub load: f64,
    /// Greatest principal stress σ₁, Pa, positive in compression.
    pub major: f64,
    /// In 3D the middle one, Pa.
    pub intermediate: Option<f64>,
    /// The least one, Pa: the confinement.
    pub minor: f64,
}

/// The failure envelope of some runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Definition of failure.
    pub measure: Measure,
    /// Fields of the scenes that differ, without those that make the sample.
    pub varied: Vec<String>,
    /// The circles, in the order of the runs.
    pub circles: Vec<Circle>,
    /// Runs that did not fail or are unfinished.
    pub left_out: Vec<LeftOut>,
    /// The line that the circles touch; `None` where they have no such line.
    pub envelope: Option<Envelope>,
    /// Notes: what the runs do not show, and caveats.
    pub notes: Vec<String>,
}

/// Reads the runs that `paths` name: histories, and folders of sweeps.
///
/// # Errors
/// [`PostError::Usage`] for no runs, and where none failed; [`PostError::Lacking`] for a run
/// without a load or a stress; those of reading histories and manifests.
pub fn read(paths: &[PathBuf], measure: Measure, wall: Option<&str>) -> Result<Report> {
    let (paths, mut left_out) = histories(paths)?;
    let (mut circles, mut scenes) = (vec![], vec![]);
    for path in &paths {
        let (found, scene) = circle(path, measure, wall)?;
        match found {
            Ok(circle) => {
                circles.push(circle);
                scenes.push((name(path), scene));
            }
            Err(why) => left_out.push(LeftOut { run: name(path), why }),
        }
    }
    if circles.is_empty() {
        return Err(left_out::none_failed(&left_out, measure.title()));
    }
    let envelope = envelope(&principals(&circles));
    let mut report = Report { measure, varied: varied(&scenes)?, envelope, circles, left_out, notes: vec![] };
    report.notes = report.remarks();
    Ok(report)
}

/// The least and the greatest principal stress of each circle.
fn principals(circles: &[Circle]) -> Vec<(f64, f64)> {
    circles.iter().map(|circle| (circle.minor, circle.major)).collect()
}

/// The circle of a run, or the state that it reached; and its scene.
fn circle(path: &Path, measure: Measure, wall: Option<&str>) -> Result<(std::result::Result<Circle, String>, String)> {
    let history = History::open(path)?;
    let course = Course::read(&history, wall)?;
    let scene = history.parameters()?.scene;
    let failure = match course.failure(&history, measure)? {
        Ok(failure) => failure,
        Err(why) => return Ok((Err(why), scene)),
    };
    let Some(row) = course.borne(failure) else {
        return Ok((Err("bonds broke in its first step: it has no stress before".into()), scene));
    };
    let d = history.dimension();
    let stress = history.observable("stress")?.filter(|series| !series.step.is_empty());
    let lacking = || PostError::Lacking { path: path.into(), what: "it has no steps of /observables/stress".into() };
    let stress = stress.ok_or_else(lacking)?;
    let stress = stress.value.get(row * d * d..(row + 1) * d * d).ok_or_else(lacking)?;
    let values = principal(stress, d);
    let circle = Circle {
        run: name(path),
        time: course.time[row],
        clock: Clock::of(&history),
        load: course.load[failure],
        major: values[0],
        intermediate: (d == 3).then(|| values[1]),
        minor: values[d - 1],
    };
    Ok((Ok(circle), scene))
}

/// The line of an envelope: names and values.
pub(crate) fn line_facts(line: &Envelope) -> Vec<(&'static str, String)> {
    let mut facts = vec![
        ("friction angle", estimate(&line.friction_angle, "°")),
        ("cohesion", estimate(&line.cohesion, "Pa")),
        ("unconfined strength", estimate(&line.unconfined_strength, "Pa")),
        ("slope of σ₁ over σ₃", estimate(&line.slope, "")),
    ];
    facts.extend(line.r_squared.map(|share| ("  R²", number(share))));
    facts
}

impl Report {
    /// Whether every run has a circle.
    ///
    /// # Errors
    /// [`PostError::Incomplete`] where runs were left out.
    pub fn complete(&self) -> Result<()> {
        left_out::complete(&self.left_out, self.circles.len())
    }

    /// Notes: what the runs do not show, and caveats.
    fn remarks(&self) -> Vec<String> {
        let mut notes = vec![];
        match &self.envelope {
            None if one_confinement(&principals(&self.circles)) => {
                notes.push("one confinement: no line can be fitted".into());
            }
            None => notes.push("the greatest principal stress does not grow with the confinement: no line".into()),
            Some(line) if line.cohesion.standard_error.is_none() => {
                notes.push("two circles: the line is exact, and its errors are unknown".into());
            }
            Some(line) if line.cohesion.value < 0.0 => {
                notes.push("the cohesion is negative: the circles do not follow a straight line through τ > 0".into());
            }
            Some(_) => {}
        }
        notes
    }

    /// The report as tables.
    pub fn table(&self) -> String {
        let varied = if self.varied.is_empty() { "nothing but the sample".into() } else { self.varied.join(", ") };
        let mut lines = vec![
            ("failure", self.measure.title().to_string()),
            ("runs", left_out::counted(self.circles.len(), &self.left_out)),
            ("differ in", varied),
        ];
        if let Some(line) = &self.envelope {
            lines.extend(line_facts(line));
        }
        let clock = self.circles.first().map(|circle| circle.clock).unwrap_or_default();
        let mut table = Text::new(&["run", clock.title(), "load (N)", "σ₁ (Pa)", "σ₂ (Pa)", "σ₃ (Pa)"]);
        for c in &self.circles {
            let middle = quantity(c.intermediate, "");
            table.row(vec![
                c.run.clone(),
                number(c.clock.value(c.time)),
                number(c.load),
                number(c.major),
                middle,
                number(c.minor),
            ]);
        }
        facts(&lines) + "\n" + &table.lines() + &left_out::remarks(&self.left_out, "envelope.csv", &self.notes)
    }
}
