//! The report of a bond in lines.

use dem_history::RuptureMode;

use super::report::{Grain, LEVELS, Report};
use super::rupture::{Broken, Neighbour};
use super::utilisation::{Greatest, Part, Twist};
use crate::output::{facts, number};

impl Report {
    /// The report as lines.
    pub fn table(&self) -> String {
        let [i, j] = self.grains.each_ref().map(|grain| grain.grain);
        let mut lines = vec![("bond", format!("{}, of grains {i} and {j}", self.bond))];
        lines.extend(self.grains.iter().map(|grain| ("grain", describe(grain))));
        lines.extend([("strength", self.strength_line()), ("breaks at", self.limit_line())]);
        match &self.broken {
            Some(broken) => lines.extend(self.broken_lines(broken)),
            None => lines.push(("state", format!("intact at {}, the last frame", self.when(self.end.1, self.end.0)))),
        }
        lines.extend(self.frame_lines());
        facts(&lines)
    }

    fn strength_line(&self) -> String {
        let mut line =
            format!("r_coh = {} N; μ = {}, ν = {}", number(self.strength), number(self.shear), number(self.rolling));
        match self.limits.twist {
            Twist::Free => {}
            Twist::Coefficient(twist) => line += &format!(", ξ = {}", number(twist)),
            Twist::Unknown => line += ", ξ is not recorded",
        }
        line + &format!("; mean diameter a = {} mm", number(1e3 * self.mean_diameter))
    }

    fn limit_line(&self) -> String {
        let twist = if self.limits.twist == Twist::Free { "" } else { ", twisting moment ξ a (r_n + r_coh)" };
        format!("tension r_coh, shear force μ (r_n + r_coh), rolling moment ν a (r_n + r_coh){twist}")
    }

    fn broken_lines(&self, broken: &Broken) -> Vec<(&'static str, String)> {
        let b = broken;
        let mut lines = vec![
            (
                "state",
                format!("broke in {} at {}, round {} of the cascade", b.mode, self.when(b.time, b.step), b.round),
            ),
            ("place", place(&b.point)),
        ];
        lines.extend(b.parts.iter().map(part_line));
        if b.energy > 0.0 {
            lines.push(("energy released", format!("{} J", number(b.energy))));
        }
        let load =
            b.load.as_ref().map(|load| format!("{} N on the wall {}, in that step", number(load.load), load.wall));
        lines.push(("load", load.unwrap_or_else(|| format!("not known: {}", b.load_note))));
        let [earlier, same, later] = b.same_step;
        lines.push(("broke before", format!("{} in earlier steps", bonds(b.before))));
        let rounds = format!("{earlier} in earlier rounds, {same} in its round, {later} in later rounds");
        lines.push(("in its step", format!("{} more: {rounds}", earlier + same + later)));
        match (&b.last_before, &b.nearest_before) {
            (Some(last), Some(nearest)) if last == nearest => {
                lines.push(("last and nearest", self.neighbour(last)));
            }
            (Some(last), Some(nearest)) => {
                lines.extend([("last before it", self.neighbour(last)), ("nearest before", self.neighbour(nearest))]);
            }
            _ => lines.push(("last before it", "none: no bond broke in an earlier round or step".into())),
        }
        lines
    }

    /// A time (s) and its step: `0.24 s, step 240`, or `step 240` where the time counts steps.
    fn when(&self, time: f64, step: i64) -> String {
        let moment = self.clock.moment(time);
        if self.clock.step().is_some() { moment } else { format!("{moment}, step {step}") }
    }

    fn neighbour(&self, other: &Neighbour) -> String {
        let Neighbour { bond, grains: [i, j], mode, step, time, round, distance } = other;
        let away = format!("{} mm ({} a)", number(1e3 * distance), number(distance / self.mean_diameter));
        let when = format!("{}, round {round}", self.when(*time, *step));
        format!("bond {bond} ({i}–{j}), {mode}, {when}; {away} away")
    }

    /// The utilisation over time.
    fn frame_lines(&self) -> Vec<(&'static str, String)> {
        if !self.frames_note.is_empty() {
            return vec![("utilisation", format!("not known: {}", self.frames_note))];
        }
        let mut lines = vec![];
        if let Some((moment, most)) = self.peak() {
            let when = self.when(moment.time, moment.step);
            let frames = self.frames.len();
            lines.push(("utilisation", format!("at most {} at {when}; {frames} frames", share(most))));
        }
        for level in LEVELS {
            if let Some(moment) = self.reached(level) {
                let mode = moment.greatest.map_or("", |most| most.mode);
                let when = self.clock.moment(moment.time);
                lines.push(("", format!("at least {} first at {when} ({mode})", number(level))));
            }
        }
        if let Some((moment, most)) = self.frames.last().and_then(|moment| Some((moment, moment.greatest?))) {
            let last = if self.broken.is_some() { "in the last frame before it broke" } else { "in the last frame" };
            lines.push(("", format!("{} {last}, {}", share(most), self.clock.moment(moment.time))));
        }
        lines
    }
}

fn bonds(count: usize) -> String {
    if count == 1 { "1 bond".into() } else { format!("{count} bonds") }
}

fn describe(grain: &Grain) -> String {
    let Grain { grain, centre, radius } = grain;
    format!("{grain}: centre {} when the bond formed, radius {} mm", place(centre), number(1e3 * radius))
}

fn place(point: &[f64]) -> String {
    let point: Vec<String> = point.iter().map(|x| number(1e3 * x)).collect();
    format!("({}) mm", point.join(", "))
}

/// A force at rupture, its limit and their ratio.
fn part_line(part: &Part) -> (&'static str, String) {
    let names = [("normal force", "N"), ("shear force", "N"), ("rolling moment", "N m"), ("twisting moment", "N m")];
    let place = RuptureMode::ALL.iter().position(|mode| mode.label() == part.mode);
    let (name, unit) = names[place.unwrap_or(0)];
    let value = part.value.map_or_else(|| "–".into(), |value| format!("{} {unit}", number(value)));
    let tension = part.mode == RuptureMode::Tension.label();
    let limit = match (part.limit, part.value) {
        // compression has no limit
        (_, Some(force)) if tension && force > 0.0 => " (compression)".into(),
        (_, Some(force)) if tension && force == 0.0 => String::new(),
        (Some(limit), _) if tension => format!(" (tension), limit {} {unit}", number(limit)),
        (Some(limit), _) => format!(", limit {} {unit}", number(limit)),
        (None, _) => String::new(),
    };
    let ratio = part.utilisation.map_or_else(|| part.note.into(), |ratio| format!("utilisation {}", number(ratio)));
    (name, format!("{value}{limit}: {ratio}"))
}

/// A utilisation and the nearest mode. A bond that holds is not shown at 1, and one without a load
/// has no nearest mode.
fn share(most: Greatest) -> String {
    match most.utilisation {
        0.0 => "0".into(),
        0.99995..1.0 => format!("above 0.9999 ({})", most.mode),
        utilisation => format!("{} ({})", number(utilisation), most.mode),
    }
}
