//! Cracks: the bonds that broke, when, where and how; what they leave of the sample.

use dem_run::history::{BondStatus, History, Rupture, RuptureMode};
use serde::Serialize;

use crate::fragments::{Fragments, fragments};
use crate::map::{Key, Panel, Sample, draw};
use crate::moments;
use crate::output::{Folder, PostError, Result, Text, facts, number, quantity};
use crate::plot::{Chart, Drawing, Style, colour};
use crate::row;

/// Events that the table on the terminal shows; the CSV has them all.
const SHOWN: usize = 12;
/// Fill of grains that kept all their bonds.
const BONDED: &str = "#8c8c8c";
/// Fill of grains that lost a bond: white, as in the paper.
const RELEASED: &str = "#ffffff";

/// A number for each way to break.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Modes {
    /// In tension.
    pub tension: usize,
    /// In shear.
    pub shear: usize,
    /// By the rolling moment.
    pub rolling: usize,
}

impl Modes {
    /// All together.
    pub fn total(self) -> usize {
        self.tension + self.shear + self.rolling
    }

    /// Counts one more.
    pub fn add(&mut self, mode: RuptureMode) {
        match mode {
            RuptureMode::Tension => self.tension += 1,
            RuptureMode::Shear => self.shear += 1,
            RuptureMode::Rolling => self.rolling += 1,
        }
    }
}

/// The pieces at one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pieces {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// The pieces.
    #[serde(flatten)]
    pub fragments: Fragments,
}

/// A rupture, as it is listed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Round of the cascade.
    pub round: i32,
    /// The bond.
    pub bond: i32,
    /// Its grains.
    pub grains: [i32; 2],
    /// How it broke.
    pub mode: &'static str,
    /// Where, m.
    pub point: [f64; 3],
    /// Normal force, N, positive in compression.
    pub normal_force: f64,
    /// Tangential force, N.
    pub tangential_force: f64,
    /// Moment, N m.
    pub moment: f64,
    /// Energy released, J.
    pub energy: f64,
}

/// What became of the bonds.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Bonds at the start.
    pub bonds: usize,
    /// Bonds that broke, by mode.
    pub broken: Modes,
    /// Time of the first rupture, s.
    pub first_break: Option<f64>,
    /// Time at which 5 % of the bonds had broken, s.
    pub time_of_5_percent: Option<f64>,
    /// Every rupture, in order.
    pub events: Vec<Event>,
    /// The pieces, frame by frame.
    pub fragments: Vec<Pieces>,
}

/// Reads what became of the bonds.
///
/// # Errors
/// [`PostError::Lacking`] for a scene without bonds.
pub fn read(history: &History) -> Result<Report> {
    let bonds = history.bonds()?;
    if bonds.is_empty() {
        let what = "cracks need bonds, and this scene has none: add `bonds` to the scene".into();
        return Err(PostError::Lacking { path: history.path().into(), what });
    }
    let ruptures = history.ruptures()?;
    let mut broken = Modes::default();
    ruptures.iter().for_each(|rupture| broken.add(rupture.mode));
    let mass = history.grains()?.mass;
    let mut pieces = vec![];
    for (frame, (&step, &time)) in history.steps().iter().zip(history.times()).enumerate() {
        let fragments = fragments(&mass, &bonds, &history.bond_status(frame)?);
        pieces.push(Pieces { step, time, fragments });
    }
    let five = (bonds.len() as f64 * 0.05).ceil() as usize;
    Ok(Report {
        bonds: bonds.len(),
        broken,
        first_break: ruptures.first().map(|rupture| rupture.time),
        time_of_5_percent: ruptures.get(five.saturating_sub(1)).map(|rupture| rupture.time),
        events: ruptures.iter().map(Event::from).collect(),
        fragments: pieces,
    })
}

impl From<&Rupture> for Event {
    fn from(r: &Rupture) -> Self {
        Self {
            step: r.step,
            time: r.time,
            round: r.round,
            bond: r.bond,
            grains: r.pair,
            mode: r.mode.label(),
            point: r.point,
            normal_force: r.normal_force,
            tangential_force: r.tangential_force,
            moment: r.moment,
            energy: r.energy,
        }
    }
}

/// Broken bonds by mode after each time at which any broke: (time s, [tension, shear, rolling]), from zero on.
pub fn broken_over_time(events: &[Event]) -> Vec<(f64, [usize; 3])> {
    let mut curve: Vec<(f64, [usize; 3])> = vec![];
    let mut count = [0; 3];
    for event in events {
        let mode = RuptureMode::ALL.iter().position(|mode| mode.label() == event.mode).unwrap_or(0);
        count[mode] += 1;
        match curve.last_mut() {
            Some((time, counts)) if *time == event.time => *counts = count,
            _ => curve.push((event.time, count)),
        }
    }
    curve
}

impl Report {
    /// The report as tables.
    pub fn table(&self) -> String {
        let share = 100.0 * self.broken.total() as f64 / self.bonds as f64;
        let last = self.fragments.last().map(|pieces| pieces.fragments);
        let mut out = facts(&[
            ("bonds", self.bonds.to_string()),
            ("broken", format!("{} ({share:.1} %)", self.broken.total())),
            ("  TENSION", self.broken.tension.to_string()),
            ("  SHEAR", self.broken.shear.to_string()),
            ("  ROLLING", self.broken.rolling.to_string()),
            ("first break", quantity(self.first_break, "s")),
            ("5 % broken", quantity(self.time_of_5_percent, "s")),
            (
                "fragments at the end",
                last.map_or_else(|| "–".into(), |f| format!("{} ({} single grains)", f.count, f.singles)),
            ),
            (
                "largest fragment",
                last.map_or_else(
                    || "–".into(),
                    |f| format!("{} grains, {:.1} % of the mass", f.largest, 100.0 * f.largest_mass_fraction),
                ),
            ),
        ]);
        if self.events.is_empty() {
            return out;
        }
        let mut table =
            Text::new(&["time (s)", "step", "round", "bond", "grains", "mode", "r_n (N)", "r_t (N)", "m (N m)"]);
        for e in self.events.iter().take(SHOWN) {
            let grains = format!("{}–{}", e.grains[0], e.grains[1]);
            table.row(vec![
                number(e.time),
                e.step.to_string(),
                e.round.to_string(),
                e.bond.to_string(),
                grains,
                e.mode.into(),
                number(e.normal_force),
                number(e.tangential_force),
                number(e.moment),
            ]);
        }
        out += "\n";
        out += &table.lines();
        if self.events.len() > SHOWN {
            out += &format!("… and {} more in ruptures.csv\n", self.events.len() - SHOWN);
        }
        out
    }
}

/// Writes `ruptures.csv`, `broken.csv`, `fragments.csv`, and as drawings `broken`, `fragments` and `decohesion`; the map
/// shows the moments nearest to `times` (s), or chosen ones.
///
/// # Errors
/// [`PostError::Write`], and [`PostError::Usage`] for times outside the history.
pub fn write(history: &History, report: &Report, times: &[f64], folder: &mut Folder) -> Result<()> {
    let frames = moments::chosen(history, times)?;
    write_ruptures(report, folder)?;
    let curve = broken_over_time(&report.events);
    let rows = curve.iter().map(|(time, n)| row![time, n[0], n[1], n[2], n.iter().sum::<usize>()]);
    folder.table("broken", &["time_s", "tension", "shear", "rolling", "total"], rows)?;
    let rows = report.fragments.iter().map(|pieces| {
        let f = pieces.fragments;
        row![pieces.step, pieces.time, f.count, f.singles, f.largest, f.largest_mass_fraction]
    });
    folder.table(
        "fragments",
        &["step", "time_s", "fragments", "single_grains", "largest_grains", "largest_mass_fraction"],
        rows,
    )?;
    let end = history.times().last().copied().unwrap_or(0.0);
    folder.draw("broken", &Chart::draw(vec![broken_chart(&curve, end)]))?;
    folder.draw("fragments", &Chart::draw(fragment_charts(&report.fragments)))?;
    Ok(folder.draw("decohesion", &decohesion(history, &frames)?)?)
}

fn write_ruptures(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "step",
        "time_s",
        "round",
        "bond",
        "grain_i",
        "grain_j",
        "mode",
        "x_m",
        "y_m",
        "z_m",
        "normal_force_N",
        "tangential_force_N",
        "moment_Nm",
        "energy_J",
    ];
    let rows = report.events.iter().map(|e| {
        row![
            e.step,
            e.time,
            e.round,
            e.bond,
            e.grains[0],
            e.grains[1],
            e.mode,
            e.point[0],
            e.point[1],
            e.point[2],
            e.normal_force,
            e.tangential_force,
            e.moment,
            e.energy
        ]
    });
    Ok(folder.table("ruptures", &head, rows)?)
}

fn broken_chart(curve: &[(f64, [usize; 3])], end: f64) -> Chart {
    let points = |count: &dyn Fn(&[usize; 3]) -> usize| -> Vec<(f64, f64)> {
        let last = curve.last().map_or(0, |(_, n)| count(n));
        let inner = curve.iter().map(|(time, n)| (*time, count(n) as f64));
        std::iter::once((0.0, 0.0)).chain(inner).chain([(end, last as f64)]).collect()
    };
    let mut chart = Chart::new("time (s)", "broken bonds")
        .curve("all", colour::BLACK, Style::Steps, points(&|n| n.iter().sum()))
        .curve("tension", colour::BLUE, Style::Steps, points(&|n| n[0]))
        .curve("shear", colour::VERMILLION, Style::Steps, points(&|n| n[1]))
        .curve("rolling", colour::GREEN, Style::Steps, points(&|n| n[2]));
    chart.counts = true;
    chart
}

fn fragment_charts(pieces: &[Pieces]) -> Vec<Chart> {
    let points = |value: &dyn Fn(&Fragments) -> f64| pieces.iter().map(|p| (p.time, value(&p.fragments))).collect();
    let mut number = Chart::new("time (s)", "number of fragments")
        .curve("all", colour::BLACK, Style::Steps, points(&|f| f.count as f64))
        .curve("single grains", colour::VERMILLION, Style::Steps, points(&|f| f.singles as f64));
    number.counts = true;
    let largest = Chart::new("time (s)", "largest fragment (% of the mass)").curve(
        "largest fragment",
        colour::BLUE,
        Style::Steps,
        points(&|f| 100.0 * f.largest_mass_fraction),
    );
    vec![number, largest]
}

/// The decohesion map: grains that lost a bond in white.
fn decohesion(history: &History, frames: &[usize]) -> Result<Drawing> {
    let bonds = history.bonds()?;
    let sample = Sample::read(history)?;
    let mut panels = vec![];
    for &frame in frames {
        let status = history.bond_status(frame)?;
        let grains = history.grain_state(frame)?;
        let mut fills = vec![BONDED; history.grains()?.radius.len()];
        let mut broken = 0;
        for ([i, j], _) in bonds.pair.iter().zip(&status).filter(|(_, status)| **status != BondStatus::Intact) {
            (fills[*i as usize], fills[*j as usize]) = (RELEASED, RELEASED);
            broken += 1;
        }
        panels.push(Panel {
            caption: vec![
                format!("t = {} s", number(history.times()[frame])),
                format!("{broken} of {} bonds broken", bonds.len()),
            ],
            grains,
            walls: history.wall_state(frame)?,
            fills,
            outline: "#404040",
            links: vec![],
        });
    }
    let legend = [
        Key::Disk(BONDED, "#404040", "all bonds intact".into()),
        Key::Disk(RELEASED, "#404040", "lost at least one bond".into()),
    ];
    Ok(draw(&sample, &panels, &legend))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(time: f64, mode: RuptureMode) -> Event {
        let rupture = Rupture {
            step: 0,
            time,
            point: [0.0; 3],
            normal_force: 0.0,
            tangential_force: 0.0,
            moment: 0.0,
            energy: 0.0,
            round: 0,
            bond: 0,
            pair: [0, 1],
            mode,
        };
        Event::from(&rupture)
    }

    #[test]
    fn ruptures_of_one_time_are_one_point_of_the_curve() {
        let events =
            [event(1.0, RuptureMode::Tension), event(1.0, RuptureMode::Rolling), event(2.0, RuptureMode::Shear)];
        assert_eq!(broken_over_time(&events), [(1.0, [1, 0, 1]), (2.0, [1, 1, 1])]);
    }
}
