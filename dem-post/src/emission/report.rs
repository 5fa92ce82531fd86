//! The events of a run: the report, and how it is computed from a history.

use clap::ValueEnum;
use dem_history::{History, Rupture, Series};
use serde::Serialize;

use super::events::{Event, Rule, bursts, cluster};
use super::frequency::{BValue, FEWEST, Frequency, Values, maximum_curvature};
use crate::clock::Clock;
use crate::output::{PostError, Result, Text, counted, facts, number, quantity};
use crate::strength::runs::Course;

/// Maximum number of events in the table on the terminal; the CSV has all.
const SHOWN: usize = 12;

/// The magnitude of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// ⅔ log₁₀ of the elastic energy released, in J.
    Energy,
    /// log₁₀ of the number of bonds.
    Size,
}

/// Options of the analysis.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which ruptures are linked. Without steps, those at most one step apart, or of one burst
    /// where the load follows the breaks.
    pub rule: Rule,
    /// The magnitude; by default energy where bonds released some, else size.
    pub scale: Option<Scale>,
    /// Width of the bins of magnitudes of energy.
    pub bin: f64,
    /// Magnitude from which the b-value is estimated; by default that of the most events.
    pub completeness: Option<f64>,
    /// The load wall; by default that of the scene.
    pub wall: Option<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self { rule: Rule { steps: None, reach: 1 }, scale: None, bin: 0.1, completeness: None, wall: None }
    }
}

/// The load, and what had broken, over time.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// What times count.
    pub clock: Clock,
    /// Time, s, and load, N; empty for a run without a load.
    pub load: Vec<(f64, f64)>,
    /// Time of each rupture, s, and its energy, J.
    pub ruptures: Vec<(f64, f64)>,
    /// End of the run, s.
    pub end: f64,
}

/// The events of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Which ruptures are linked.
    pub rule: Rule,
    /// What the magnitude is.
    pub magnitude: Scale,
    /// Width of the bins of magnitudes; `None` for sizes.
    pub bin: Option<f64>,
    /// Bonds at the start.
    pub bonds: usize,
    /// Bonds that broke.
    pub ruptures: usize,
    /// Elastic energy that they released, J.
    pub energy: f64,
    /// Magnitude from which the b-value is estimated; `None` without events.
    pub completeness: Option<f64>,
    /// The b-value; `None` for too few events.
    pub b_value: Option<BValue>,
    /// Why there is none; empty where there is one.
    pub b_note: String,
    /// Why the events have no load; empty where they have one.
    pub load_note: String,
    /// The events in the order of their first ruptures.
    pub events: Vec<Event>,
    /// Numbers of events by magnitude.
    pub frequencies: Vec<Frequency>,
    /// The b-value from each magnitude on that has enough events.
    pub b_values: Vec<BValue>,
    /// The load and the ruptures over time.
    #[serde(skip)]
    pub curves: Curves,
}

/// Reads the report.
///
/// # Errors
/// [`PostError::Lacking`] for a scene without bonds, and for magnitudes of the energy of rigid
/// bonds; [`PostError::Usage`] for wrong options and a wall that is not driven.
pub fn read(history: &History, options: &Options) -> Result<Report> {
    if !(options.bin > 0.0 && options.bin.is_finite()) {
        return Err(PostError::Usage(format!("--bin {}: a width is a positive number, as in 0.1", options.bin)));
    }
    if let Some(wrong) = options.completeness.filter(|m| !m.is_finite()) {
        return Err(PostError::Usage(format!("--completeness {wrong}: a magnitude is a finite number")));
    }
    let lacking = |what: &str| PostError::Lacking { path: history.path().into(), what: what.into() };
    let bonds = history.bonds()?;
    if bonds.is_empty() {
        return Err(lacking(
            "events need bonds, and none was formed: add `bonds` to the scene, raise its bonds.gap_tolerance, or release \
             fixed grains",
        ));
    }
    let ruptures = history.ruptures()?;
    // an empty sum is −0.0 and would be printed with its sign
    let energy = 0.0 + ruptures.iter().map(|rupture| rupture.energy).sum::<f64>();
    let scale = options.scale.unwrap_or(if energy > 0.0 { Scale::Energy } else { Scale::Size });
    if scale == Scale::Energy && energy <= 0.0 && !ruptures.is_empty() {
        return Err(lacking(
            "its bonds are rigid and release no energy: choose --magnitude size, or give the scene bonds.stiffness",
        ));
    }
    let (course, load_note) = load(history, options.wall.as_deref())?;
    let load_times = history.observable("load_time")?;
    let clock = Clock::of(history);
    let own = |event: &Vec<usize>| {
        let mut event = Event::of(&event.iter().map(|&k| &ruptures[k]).collect::<Vec<_>>());
        if load_note.is_empty() {
            let row = course.step.binary_search(&event.step).ok();
            event.load = row.and_then(|row| course.load.get(row).copied());
        }
        event.duration = event.duration.filter(|_| clock.step().is_none());
        event.magnitude = match scale {
            Scale::Energy => (event.energy > 0.0).then(|| event.energy.log10() / 1.5),
            Scale::Size => Some((event.bonds as f64).log10()),
        };
        event
    };
    let grains = history.grains()?.radius.len();
    let (rule, place) = rule_of(load_times.as_ref(), options.rule, &ruptures);
    let events: Vec<Event> = cluster(&ruptures, &place, grains, &bonds, rule).iter().map(own).collect();
    let values = if scale == Scale::Energy { Values::Bins(options.bin) } else { Values::Sizes };
    let magnitudes: Vec<f64> = events.iter().filter_map(|event| event.magnitude).collect();
    let frequencies = values.frequencies(&magnitudes);
    let given = options.completeness.map(|from| values.least(from));
    let completeness = given.or_else(|| maximum_curvature(&frequencies));
    let b_value = completeness.and_then(|from| values.b_value(&magnitudes, from));
    Ok(Report {
        rule,
        magnitude: scale,
        bin: (scale == Scale::Energy).then_some(options.bin),
        bonds: bonds.len(),
        ruptures: ruptures.len(),
        energy,
        completeness,
        b_note: if b_value.is_some() { String::new() } else { note(&magnitudes, completeness) },
        b_value,
        load_note,
        b_values: frequencies.iter().filter_map(|f| values.b_value(&magnitudes, f.magnitude)).collect(),
        frequencies,
        events,
        curves: Curves {
            clock,
            load: course.time.into_iter().zip(course.load).collect(),
            ruptures: ruptures.iter().map(|r| (r.time, r.energy)).collect(),
            end: history.times().last().copied().unwrap_or(0.0),
        },
    })
}

/// The rule by which ruptures are linked, and the step of each rupture, or its burst.
fn rule_of(load_times: Option<&Series>, asked: Rule, ruptures: &[Rupture]) -> (Rule, Vec<i64>) {
    let steps: Vec<i64> = ruptures.iter().map(|rupture| rupture.step).collect();
    let Some(loads) = load_times.filter(|_| asked.steps.is_none()) else {
        return (Rule { steps: asked.steps.or(Some(1)), ..asked }, steps);
    };
    let burst = bursts(&loads.value);
    let of = |step: &i64| loads.step.binary_search(step).ok().and_then(|row| burst.get(row)).copied();
    (asked, steps.iter().map(|step| of(step).unwrap_or(0)).collect())
}

/// The load over the steps, and why that of an event is not known; empty where it is.
fn load(history: &History, wall: Option<&str>) -> Result<(Course, String)> {
    match Course::read(history, wall) {
        Ok(mut course) => {
            let why = course.load_after_breaks.take();
            Ok((course, why.unwrap_or_default()))
        }
        Err(PostError::Usage(why)) if wall.is_none() => Ok((Course::default(), why)),
        Err(PostError::Lacking { what, .. }) if wall.is_none() => Ok((Course::default(), what)),
        Err(error) => Err(error),
    }
}

/// Why there is no b-value.
fn note(magnitudes: &[f64], completeness: Option<f64>) -> String {
    let Some(from) = completeness else { return "no event has a magnitude".into() };
    let count = magnitudes.iter().filter(|&&m| m >= from).count();
    if count < FEWEST {
        format!("{} of magnitude {} or more, fewer than {FEWEST}", counted(count, "event"), number(from))
    } else {
        "all events have the same magnitude".into()
    }
}

impl Report {
    /// The values that magnitudes can have.
    pub(super) fn values(&self) -> Values {
        self.bin.map_or(Values::Sizes, Values::Bins)
    }

    /// The magnitude in words.
    pub(super) fn axis(&self) -> &'static str {
        match self.magnitude {
            Scale::Energy => "magnitude ⅔ log₁₀(E / 1 J)",
            Scale::Size => "magnitude log₁₀(bonds)",
        }
    }

    /// The report as tables.
    pub fn table(&self) -> String {
        facts(&self.lines()) + &if self.events.is_empty() { String::new() } else { format!("\n{}", self.event_table()) }
    }

    /// Names and values, in order.
    pub(super) fn lines(&self) -> Vec<(&'static str, String)> {
        let Rule { steps, reach } = self.rule;
        let when = steps.map_or("a load that no longer grows".into(), |steps| format!("steps apart: at most {steps}"));
        let share = 100.0 * self.ruptures as f64 / self.bonds as f64;
        let most = self.events.iter().map(|event| event.bonds).max();
        let released = match self.ruptures {
            0 => "–".into(),
            _ if self.energy > 0.0 => quantity(Some(self.energy), "J"),
            _ => "none: rigid bonds".into(),
        };
        let mut lines = vec![
            ("bonds", format!("{}, {} broken ({share:.1} %)", self.bonds, self.ruptures)),
            ("events", self.events.len().to_string()),
            ("  linked ruptures", format!("{when}; bonds between: at most {reach}")),
            ("  largest", most.map_or_else(|| "–".into(), |most| counted(most, "bond"))),
            ("energy released", released),
            ("magnitude", self.axis().trim_start_matches("magnitude ").into()),
            ("  from", quantity(self.completeness, "")),
            ("b-value", self.b_value.map_or_else(|| format!("none: {}", self.b_note), |law| words(&law))),
        ];
        if !self.load_note.is_empty() {
            lines.push(("load of an event", format!("not known: {}", self.load_note)));
        }
        lines
    }

    /// The largest events in order of time.
    fn event_table(&self) -> String {
        let mut largest: Vec<usize> = (0..self.events.len()).collect();
        let size = |k: &usize| (self.events[*k].magnitude.unwrap_or(f64::NEG_INFINITY), self.events[*k].bonds);
        largest.sort_by(|a, b| {
            let ((ma, na), (mb, nb)) = (size(a), size(b));
            mb.total_cmp(&ma).then(nb.cmp(&na)).then(a.cmp(b))
        });
        largest.truncate(SHOWN);
        largest.sort_unstable();
        let clock = self.curves.clock;
        let head = ["event", clock.title(), "load (N)", "bonds", "rounds", "duration (s)", "energy (J)", "magnitude"];
        let mut table = Text::new(&head);
        for k in largest {
            let e = &self.events[k];
            table.row(vec![
                (k + 1).to_string(),
                number(clock.value(e.time)),
                quantity(e.load, ""),
                e.bonds.to_string(),
                e.rounds.to_string(),
                quantity(e.duration, ""),
                number(e.energy),
                quantity(e.magnitude, ""),
            ]);
        }
        let rest = self.events.len().saturating_sub(SHOWN);
        let more =
            if rest > 0 { format!("… and {rest} smaller ones in emission-events.csv\n") } else { String::new() };
        table.lines() + &more
    }
}

/// A b-value with its error.
fn words(law: &BValue) -> String {
    let caveat = if law.law_holds { "" } else { "; but they do not follow the law: b has no meaning from there on" };
    format!("{:.2} ± {:.2} (standard error), {} events{caveat}", law.b, law.error, law.events)
}
