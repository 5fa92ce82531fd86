//! The differences between two runs: the report, and how it is computed from their histories.

use std::collections::BTreeMap;

use dem_history::{History, Rupture};
use dem_scene::{Difference, differences};
use serde::Serialize;

use crate::clock::Clock;
use crate::moments::SAME_TIME;
use crate::output::{PostError, Result, Text, counted, facts, number};
use crate::stress_strain;

/// Maximum number of differences of the scenes, and of bonds, in the table.
const SHOWN: usize = 12;

/// The distance of the two runs at a common time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Time, s.
    pub time: f64,
    /// Frames of the two runs.
    pub frames: [usize; 2],
    /// Greatest distance between a grain's two positions, over its radius.
    pub greatest: f64,
    /// The grain with the greatest distance.
    pub grain: usize,
    /// Root of the mean square over all grains.
    pub rms: f64,
}

/// A break, reduced to the data compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Break {
    /// Time, s.
    pub time: f64,
    /// Step.
    pub step: i64,
    /// The two grains, the lesser first.
    pub grains: [i32; 2],
    /// How it broke.
    pub mode: &'static str,
}

/// A bond that broke in one run or in both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fate {
    /// The two grains, the lesser first.
    pub grains: [i32; 2],
    /// The break in the first run.
    pub a: Option<Break>,
    /// The break in the second run.
    pub b: Option<Break>,
}

/// The first place at which the lists of breaks differ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parting {
    /// Number of equal breaks before it.
    pub alike: usize,
    /// The break of the first run; `None` if its list ends.
    pub a: Option<Break>,
    /// The break of the second run.
    pub b: Option<Break>,
}

/// A curve over time.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Times, s.
    pub time: Vec<f64>,
    /// Displacement of the driven wall, m, and its load, N; empty without one.
    pub wall: [Vec<f64>; 2],
}

/// The differences between two runs.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The two files.
    pub files: [String; 2],
    /// Distance over radius up to which frames count as equal.
    pub tolerance: f64,
    /// The differences between the scenes.
    pub scene: Vec<Difference>,
    /// Whether the grains have the same radii, and the same bonds were formed.
    pub same_sample: bool,
    /// The ends of the two runs, s: breaks are compared up to the earlier end.
    pub ends: [f64; 2],
    /// The distance of the runs at each common time.
    pub gaps: Vec<Gap>,
    /// The first distance that exceeds the tolerance.
    pub first_difference: Option<Gap>,
    /// Bonds that broke in both runs, only in the first, only in the second.
    pub broken: [usize; 3],
    /// The first place at which the lists of breaks differ; `None` if the lists are equal.
    pub parting: Option<Parting>,
    /// For each bond that broke: its break in each run.
    #[serde(skip)]
    pub fates: Vec<Fate>,
    /// The breaks of the two runs in order.
    #[serde(skip)]
    pub breaks: [Vec<Break>; 2],
    /// The curves of the two runs.
    #[serde(skip)]
    pub curves: [Curve; 2],
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
}

/// Compares two runs; frames count as equal up to `tolerance` radii.
///
/// # Errors
/// [`PostError::Lacking`] for runs of another dimension, another number of grains, or without a
/// common time; [`PostError::Usage`] for a tolerance that is negative or NaN.
pub fn read(a: &History, b: &History, tolerance: f64) -> Result<Report> {
    if tolerance.is_nan() || tolerance < 0.0 {
        return Err(PostError::Usage(format!("--tolerance {tolerance}: give 0 or more, in radii")));
    }
    let radii = [a.grains()?.radius, b.grains()?.radius];
    let differs = |what: String| PostError::Lacking {
        path: b.path().into(),
        what: format!("it cannot be compared with {}: {what}", a.path().display()),
    };
    if a.dimension() != b.dimension() {
        return Err(differs(format!("one is in {}D, the other in {}D", a.dimension(), b.dimension())));
    }
    if a.follows_breaks() != b.follows_breaks() {
        let what = "one loads from break to break (rupture next_event), and its time counts breaks: compare \
                    ruptures.csv of `dem-post cracks` and the loads in stress-strain.csv of `dem-post stress-strain`";
        return Err(differs(what.into()));
    }
    let [n, m] = [&radii[0], &radii[1]].map(Vec::len);
    if n != m {
        return Err(differs(format!("{n} grains there, {m} here: choose two runs of one sample")));
    }
    let clocks = [Clock::of(a), Clock::of(b)];
    let gaps = gaps([a, b], clocks, &radii[0])?;
    if gaps.is_empty() {
        return Err(differs("the two runs have no frame at a common time".into()));
    }
    let mut breaks = [breaks(&a.ruptures()?), breaks(&b.ruptures()?)];
    let mut curves = [curve(a)?, curve(b)?];
    let mut ends = [end(a, &breaks[0]), end(b, &breaks[1])];
    // a step is as long in both runs where the time counts steps
    let others = breaks[1].iter_mut().map(|found| &mut found.time).chain(&mut curves[1].time).chain(&mut ends[1..]);
    others.for_each(|time| *time = clocks[0].time(clocks[1].value(*time)));
    let both = ends[0].min(ends[1]) * (1.0 + SAME_TIME);
    breaks.iter_mut().for_each(|list| list.retain(|found| found.time <= both));
    let fates = fates(&breaks);
    let count = |kind: fn(&Fate) -> bool| fates.iter().filter(|fate| kind(fate)).count();
    let same_bonds = a.bonds()?.pair == b.bonds()?.pair;
    Ok(Report {
        files: [a, b].map(|history| history.path().display().to_string()),
        tolerance,
        scene: differences(&a.parameters()?.scene, &b.parameters()?.scene),
        same_sample: radii[0] == radii[1] && same_bonds,
        ends,
        first_difference: gaps.iter().copied().find(|gap| gap.greatest > tolerance),
        gaps,
        broken: [
            count(|fate| fate.a.is_some() && fate.b.is_some()),
            count(|fate| fate.b.is_none()),
            count(|fate| fate.a.is_none()),
        ],
        parting: parting(&breaks),
        fates,
        breaks,
        curves,
        clock: clocks[0],
    })
}

/// The distances at all times of A for which both runs have a frame.
fn gaps([a, b]: [&History; 2], clocks: [Clock; 2], radius: &[f64]) -> Result<Vec<Gap>> {
    let mut gaps = vec![];
    for (frame, &time) in a.times().iter().enumerate() {
        let in_b = clocks[1].time(clocks[0].value(time));
        let Some(other) = b.frame_at(in_b) else {
            continue;
        };
        if (b.times()[other] - in_b).abs() > SAME_TIME * in_b.abs() {
            continue;
        }
        let positions = [a.grain_state(frame)?.position, b.grain_state(other)?.position];
        gaps.push(gap(time, [frame, other], &positions, radius, a.dimension()));
    }
    Ok(gaps)
}

fn gap(time: f64, frames: [usize; 2], [a, b]: &[Vec<f64>; 2], radius: &[f64], d: usize) -> Gap {
    let squares: Vec<f64> = (a.chunks(d).zip(b.chunks(d)).zip(radius))
        .map(|((a, b), r)| a.iter().zip(b).map(|(a, b)| ((a - b) / r).powi(2)).sum::<f64>())
        .collect();
    let grain = (0..squares.len()).max_by(|&i, &j| squares[i].total_cmp(&squares[j]).then(j.cmp(&i))).unwrap_or(0);
    Gap {
        time,
        frames,
        greatest: squares.get(grain).copied().unwrap_or(0.0).sqrt(),
        grain,
        rms: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
    }
}

/// The time of the last frame or break, s.
fn end(history: &History, breaks: &[Break]) -> f64 {
    let frame = history.times().last().copied().unwrap_or(0.0);
    breaks.last().map_or(frame, |found| found.time.max(frame))
}

fn breaks(ruptures: &[Rupture]) -> Vec<Break> {
    let name = |[i, j]: [i32; 2]| [i.min(j), i.max(j)];
    let of = |r: &Rupture| Break { time: r.time, step: r.step, grains: name(r.pair), mode: r.mode.label() };
    ruptures.iter().map(of).collect()
}

/// The breaks of each bond that broke, in the order of its grains.
fn fates(breaks: &[Vec<Break>; 2]) -> Vec<Fate> {
    let mut fates: BTreeMap<[i32; 2], Fate> = BTreeMap::new();
    for (run, list) in breaks.iter().enumerate() {
        for &found in list {
            let fate = fates.entry(found.grains).or_insert(Fate { grains: found.grains, a: None, b: None });
            *(if run == 0 { &mut fate.a } else { &mut fate.b }) = Some(found);
        }
    }
    fates.into_values().collect()
}

fn parting([a, b]: &[Vec<Break>; 2]) -> Option<Parting> {
    let like = |(a, b): &(&Break, &Break)| (a.grains, a.mode) == (b.grains, b.mode);
    let alike = a.iter().zip(b).take_while(like).count();
    let (a, b) = (a.get(alike).copied(), b.get(alike).copied());
    (a.is_some() || b.is_some()).then_some(Parting { alike, a, b })
}

/// Load and displacement, where one wall is driven and observed.
fn curve(history: &History) -> Result<Curve> {
    match stress_strain::read(history, None) {
        Ok(found) => Ok(Curve { time: found.time, wall: [found.displacement, found.load] }),
        Err(PostError::Lacking { .. } | PostError::Usage(_)) => Ok(Curve::default()),
        Err(error) => Err(error),
    }
}

impl Report {
    /// The report as tables.
    pub fn table(&self) -> String {
        let last = self.gaps.last();
        let [both, a, b] = self.broken;
        let tolerance = if self.tolerance == 0.0 { "exact".into() } else { format!("{} radii", self.tolerance) };
        let mut out = facts(&[
            ("A", self.files[0].clone()),
            ("B", self.files[1].clone()),
            ("scenes", format!("differ in {}", counted(self.scene.len(), "place"))),
            ("sample", if self.same_sample { "the same radii and bonds" } else { "other radii or other bonds" }.into()),
            ("common times", self.gaps.len().to_string()),
            ("compared until", self.until()),
            ("tolerance", tolerance),
            (
                "frames differ from",
                self.first_difference.as_ref().map_or_else(|| "never".into(), |gap| self.gap_line(gap)),
            ),
            ("at the last common time", last.map_or_else(|| "–".into(), |gap| self.gap_line(gap))),
            ("bonds broken in both", both.to_string()),
            ("only in A", a.to_string()),
            ("only in B", b.to_string()),
            (
                "first other break",
                self.parting.as_ref().map_or_else(|| "none".into(), |parting| self.parting_line(parting)),
            ),
        ]);
        if !self.scene.is_empty() {
            let mut table = Text::new(&["scene", "A", "B"]);
            for place in self.scene.iter().take(SHOWN) {
                let text = |value: &Option<String>| value.as_deref().map_or_else(|| "–".into(), shortened);
                table.row(vec![place.path.clone(), text(&place.a), text(&place.b)]);
            }
            out += &format!("\n{}", table.lines());
            if self.scene.len() > SHOWN {
                out += &format!("… and {} more in scene.csv\n", self.scene.len() - SHOWN);
            }
        }
        out
    }
}

impl Report {
    /// The time up to which breaks are compared, in words.
    fn until(&self) -> String {
        let [a, b] = self.ends;
        let time = self.clock.moment(a.min(b));
        match a - b {
            apart if apart.abs() <= SAME_TIME * a.max(b) => format!("{time}, the end of both"),
            apart => format!("{time}, the end of {}", if apart < 0.0 { "A" } else { "B" }),
        }
    }

    fn gap_line(&self, gap: &Gap) -> String {
        let (at, distance) = (self.clock.at(gap.time), number(gap.greatest));
        format!("{at}: grain {} by {distance} radii, rms {}", gap.grain, number(gap.rms))
    }

    fn parting_line(&self, parting: &Parting) -> String {
        let side = |found: Option<Break>| {
            found.map_or_else(
                || "no more".into(),
                |f| format!("{}–{} {} at {}", f.grains[0], f.grains[1], f.mode, self.clock.moment(f.time)),
            )
        };
        format!("after {} equal breaks: A {}, B {}", parting.alike, side(parting.a), side(parting.b))
    }
}

/// A value of a scene, shortened to fit a line.
fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(grains: [i32; 2], mode: &'static str) -> Break {
        Break { time: 1.0, step: 1, grains, mode }
    }

    #[test]
    fn lists_part_at_the_first_other_bond_or_mode() {
        let list = vec![broken([0, 1], "SHEAR"), broken([1, 2], "SHEAR")];
        assert_eq!(parting(&[list.clone(), list.clone()]), None);
        let shorter = parting(&[list.clone(), list[..1].to_vec()]).unwrap();
        assert_eq!((shorter.alike, shorter.a, shorter.b), (1, Some(list[1]), None));
        let other = vec![list[0], broken([1, 2], "TENSION")];
        assert_eq!(parting(&[list, other]).unwrap().alike, 1);
    }

    #[test]
    fn fates_are_those_of_bonds_not_of_events() {
        let a = vec![broken([0, 1], "SHEAR"), broken([1, 2], "SHEAR")];
        let b = vec![broken([2, 3], "SHEAR"), broken([0, 1], "TENSION")];
        let fates = fates(&[a, b]);
        let known: Vec<_> = fates.iter().map(|f| (f.grains, f.a.is_some(), f.b.is_some())).collect();
        assert_eq!(known, [([0, 1], true, true), ([1, 2], true, false), ([2, 3], false, true)]);
    }

    #[test]
    fn distances_are_counted_in_radii() {
        let places = [vec![0.0, 0.0, 1.0, 1.0], vec![0.0, 0.0, 4.0, 5.0]];
        let found = gap(0.5, [1, 2], &places, &[1.0, 2.0], 2);
        assert_eq!((found.greatest, found.grain), (2.5, 1));
        assert!((found.rms - 2.5 / 2f64.sqrt()).abs() < 1e-15);
    }
}
