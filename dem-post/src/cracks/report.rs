//! The ruptures of a run: the report, and how it is computed from a history.

use dem_history::{History, Rupture, RuptureMode};
use serde::Serialize;

use super::front::{Front, Growth, fronts, growth};
use super::modes::Modes;
use super::paths::{Crack, Paths};
use super::surfaces::{Surface, Surfaces};
use crate::clock::Clock;
use crate::extent::bonded_frame;
use crate::fragments::{Fragments, fragments};
use crate::output::{PostError, Result, Text, facts, number, progress};

/// Maximum number of events in the table on the terminal; the CSV has all.
const SHOWN: usize = 12;
/// Maximum number of cracks in the table on the terminal.
const CRACKS: usize = 6;

/// The columns of the table of cracks, before the times of their breaks.
const CRACK_HEAD: [&str; 8] =
    ["crack", "bonds", "T/S/R", "length (mm)", "path (mm)", "end to end (mm)", "tortuosity", "orientation (°)"];

/// The same in 3D.
const SURFACE_HEAD: [&str; 7] = ["crack", "bonds", "T/S/R/Tw", "area (mm²)", "extent (mm)", "normal", "flatness"];

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

/// A rupture in the list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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
    /// Bending moment, N m; in histories older than version 3, norm of all moments.
    pub moment: f64,
    /// Twisting moment, N m; unknown in histories older than version 3.
    pub twist: Option<f64>,
    /// Energy released, J.
    pub energy: f64,
}

/// The ruptures, fragments and cracks of a run.
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
    /// The cracks in 2D, the longest first.
    pub cracks: Vec<Crack>,
    /// The cracks in 3D, the largest first.
    pub surfaces: Vec<Surface>,
    /// Growth of the cracks, crack by crack.
    pub fronts: Vec<Front>,
    /// The cracks after each round of breaks.
    pub growth: Vec<Growth>,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
    /// The cracks with their segments.
    #[serde(skip)]
    pub paths: Paths,
    /// The cracks with their facets.
    #[serde(skip)]
    pub faces: Surfaces,
}

/// Reads the report, with a bar unless `quiet`.
///
/// # Errors
/// [`PostError::Lacking`] for a scene without bonds.
pub fn read(history: &History, quiet: bool) -> Result<Report> {
    let bonds = history.bonds()?;
    if bonds.is_empty() {
        let what = "cracks need bonds, and none was formed: add `bonds` to the scene, raise its bonds.gap_tolerance, or \
                    release fixed grains";
        return Err(PostError::Lacking { path: history.path().into(), what: what.into() });
    }
    let ruptures = history.ruptures()?;
    let mut broken = Modes::default();
    ruptures.iter().for_each(|rupture| broken.add(rupture.mode));
    let mass = history.grains()?.mass;
    let mut pieces = vec![];
    let bar = progress(history.frames() as u64, quiet, "{bar:24} {percent} % of the frames read, {eta} left");
    for (frame, (&step, &time)) in history.steps().iter().zip(history.times()).enumerate() {
        let fragments = fragments(&mass, &bonds, &history.bond_status(frame)?);
        pieces.push(Pieces { step, time, fragments });
        bar.inc(1);
    }
    bar.finish_and_clear();
    let five = (bonds.len() as f64 * 0.05).ceil() as usize;
    let (mut paths, mut faces) = (Paths::default(), Surfaces::default());
    if history.frames() > 0 {
        let (position, radius) = (history.grain_state(bonded_frame(history)?)?.position, history.grains()?.radius);
        if history.dimension() == 2 {
            let position: Vec<[f64; 2]> = position.chunks(2).map(|x| [x[0], x[1]]).collect();
            paths = Paths::find(&position, &radius, &bonds, &ruptures);
        } else {
            let position: Vec<[f64; 3]> = position.chunks(3).map(|x| [x[0], x[1], x[2]]).collect();
            faces = Surfaces::find(&position, &radius, &bonds, &ruptures);
        }
    }
    let growth =
        if history.dimension() == 2 { growth(paths.parts(), &ruptures) } else { growth(faces.parts(), &ruptures) };
    let clock = Clock::of(history);
    let mut fronts = fronts(&paths, &ruptures);
    if clock.step().is_some() {
        // steps have no speed
        fronts.iter_mut().for_each(|row| (row.back_speed, row.front_speed) = (None, None));
    }
    Ok(Report {
        bonds: bonds.len(),
        broken,
        first_break: ruptures.first().map(|rupture| rupture.time),
        time_of_5_percent: ruptures.get(five.saturating_sub(1)).map(|rupture| rupture.time),
        events: ruptures.iter().map(Event::from).collect(),
        fragments: pieces,
        cracks: paths.cracks.clone(),
        surfaces: faces.cracks.clone(),
        fronts,
        growth,
        clock,
        paths,
        faces,
    })
}

impl Event {
    /// The index of its mode in [`RuptureMode::ALL`].
    pub fn mode_number(&self) -> usize {
        RuptureMode::ALL.iter().position(|mode| mode.label() == self.mode).unwrap_or(0)
    }
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
            twist: r.twist.is_finite().then_some(r.twist),
            energy: r.energy,
        }
    }
}

/// Number of broken bonds over time (s), from the first frame to the last; `times` are those of the
/// ruptures, in order.
pub fn total_over_time(history: &History, times: &[f64]) -> Vec<(f64, f64)> {
    let [first, last] = [history.times().first(), history.times().last()].map(|time| time.copied().unwrap_or(0.0));
    let counts = times.iter().enumerate().map(|(k, &time)| (time, (k + 1) as f64));
    [(first, 0.0)].into_iter().chain(counts).chain([(last, times.len() as f64)]).collect()
}

/// Cumulative number of broken bonds by mode after each time of a rupture: (time s, [tension,
/// shear, rolling, twist]).
pub fn broken_over_time(events: &[Event]) -> Vec<(f64, [usize; 4])> {
    let mut curve: Vec<(f64, [usize; 4])> = vec![];
    let mut count = [0; 4];
    for event in events {
        count[event.mode_number()] += 1;
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
        let mut lines = vec![
            ("bonds", self.bonds.to_string()),
            ("broken", format!("{} ({share:.1} %)", self.broken.total())),
            ("  TENSION", self.broken.tension.to_string()),
            ("  SHEAR", self.broken.shear.to_string()),
            ("  ROLLING", self.broken.rolling.to_string()),
        ];
        if self.broken.twist > 0 {
            lines.push(("  TWIST", self.broken.twist.to_string()));
        }
        lines.extend([
            ("first break", self.clock.moment_if_known(self.first_break)),
            ("5 % broken", self.clock.moment_if_known(self.time_of_5_percent)),
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
        let mut out = facts(&lines);
        if !self.events.is_empty() {
            out += &format!("\n{}", self.event_table());
        }
        if let Some((head, rows)) = self.crack_rows() {
            let mut table = Text::new(&head);
            rows.into_iter().for_each(|row| table.row(row));
            let rest = (self.cracks.len() + self.surfaces.len()).saturating_sub(CRACKS);
            let more = if rest > 0 { format!("… and {rest} more in cracks.csv\n") } else { String::new() };
            out += &format!("\n{}{more}", table.lines());
        }
        out
    }

    fn event_table(&self) -> String {
        // a time that counts steps says no more than these
        let from = usize::from(self.clock.step().is_some());
        let head = ["time (s)", "step", "round", "bond", "grains", "mode", "r_n (N)", "r_t (N)", "m (N m)"];
        let mut table = Text::new(&head[from..]);
        for e in self.events.iter().take(SHOWN) {
            let grains = format!("{}–{}", e.grains[0], e.grains[1]);
            let row = vec![
                number(e.time),
                e.step.to_string(),
                e.round.to_string(),
                e.bond.to_string(),
                grains,
                e.mode.into(),
                number(e.normal_force),
                number(e.tangential_force),
                number(e.moment),
            ];
            table.row(row[from..].to_vec());
        }
        let rest = self.events.len().saturating_sub(SHOWN);
        table.lines() + &if rest > 0 { format!("… and {rest} more in ruptures.csv\n") } else { String::new() }
    }

    /// The largest cracks, one per line, below the titles of the columns; none without ruptures.
    pub fn crack_rows(&self) -> Option<(Vec<&'static str>, Vec<Vec<String>>)> {
        let times = if self.clock.step().is_some() { ["first step", "last step"] } else { ["first (s)", "last (s)"] };
        let titles = |head: &[&'static str]| [head, &times].concat();
        let row = |place: usize, bonds: usize, modes: Modes, own: Vec<String>, times: [f64; 2]| {
            let Modes { tension, shear, rolling, twist } = modes;
            // disks do not twist
            let twist = if self.surfaces.is_empty() { String::new() } else { format!("/{twist}") };
            let head = [place.to_string(), bonds.to_string(), format!("{tension}/{shear}/{rolling}{twist}")];
            head.into_iter().chain(own).chain(times.map(|time| number(self.clock.value(time)))).collect::<Vec<_>>()
        };
        let line = |c: &Crack| {
            let own = [1e3 * c.length, 1e3 * c.path_length, 1e3 * c.end_to_end, c.tortuosity].map(number);
            let own = own.into_iter().chain([format!("{:.0}", c.orientation)]).collect();
            row(c.number, c.bonds, c.modes, own, [c.first, c.last])
        };
        let surface = |c: &Surface| {
            let [x, y, z] = c.normal;
            let own = vec![
                number(1e6 * c.area),
                number(1e3 * c.extent),
                format!("({x:.2}, {y:.2}, {z:.2})"),
                format!("{:.2}", c.flatness),
            ];
            row(c.number, c.bonds, c.modes, own, [c.first, c.last])
        };
        if !self.cracks.is_empty() {
            Some((titles(&CRACK_HEAD), self.cracks.iter().take(CRACKS).map(line).collect()))
        } else if !self.surfaces.is_empty() {
            Some((titles(&SURFACE_HEAD), self.surfaces.iter().take(CRACKS).map(surface).collect()))
        } else {
            None
        }
    }
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
            twist: 0.0,
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
        assert_eq!(broken_over_time(&events), [(1.0, [1, 0, 1, 0]), (2.0, [1, 1, 1, 0])]);
    }
}
