//! How a bond broke, what had broken before it, and the load of the sample.

use dem_history::{History, Rupture};
use serde::Serialize;

use super::utilisation::{Limits, Load, Part};
use crate::output::{PostError, Result};
use crate::stress_strain;

/// The rupture of the bond.
#[derive(Clone, Debug, Serialize)]
pub struct Broken {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Round of the cascade of the step, from 0.
    pub round: i32,
    /// How it broke.
    pub mode: &'static str,
    /// Where, m.
    pub point: Vec<f64>,
    /// Elastic energy released, J; 0 for a rigid bond.
    pub energy: f64,
    /// Its local load.
    #[serde(skip)]
    pub local: Load,
    /// The same mode by mode.
    pub parts: Vec<Part>,
    /// The load of the sample in that step.
    pub load: Option<WallLoad>,
    /// Why there is none; empty where there is one.
    pub load_note: String,
    /// Bonds that broke in earlier steps.
    pub before: usize,
    /// Others that broke in the same step: in earlier rounds, in the same and in later ones.
    pub same_step: [usize; 3],
    /// The last bond that broke in an earlier round or step; of several in one round the nearest.
    pub last_before: Option<Neighbour>,
    /// The nearest of all bonds that broke in an earlier round or step; of equally near ones the
    /// last.
    pub nearest_before: Option<Neighbour>,
}

/// The load of the load wall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WallLoad {
    /// Name of the wall.
    pub wall: String,
    /// Load, N.
    pub load: f64,
}

/// A bond that broke before the one in question.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Neighbour {
    /// The bond.
    pub bond: i32,
    /// Its grains.
    pub grains: [i32; 2],
    /// How it broke.
    pub mode: &'static str,
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Round of the cascade of the step.
    pub round: i32,
    /// Distance of the points at which the two broke, m.
    pub distance: f64,
}

impl Broken {
    /// Reads the rupture `own` of `ruptures`; the load is that of `wall`, or of the scene's load
    /// wall.
    ///
    /// # Errors
    /// [`PostError::Usage`] for a wall that is not driven, and those of reading the history.
    pub(super) fn read(
        history: &History,
        ruptures: &[Rupture],
        own: &Rupture,
        limits: &Limits,
        wall: Option<&str>,
    ) -> Result<Self> {
        let (load, load_note) = match wall_load(history, own.step, wall)? {
            Ok(load) => (Some(load), String::new()),
            Err(why) => (None, why),
        };
        let [last_before, nearest_before] = neighbours(ruptures, own);
        let local = limits.at(own);
        Ok(Self {
            step: own.step,
            time: own.time,
            round: own.round,
            mode: own.mode.label(),
            point: own.point[..history.dimension()].to_vec(),
            energy: own.energy,
            local,
            parts: limits.parts(&local),
            load,
            load_note,
            before: ruptures.iter().filter(|r| r.step < own.step).count(),
            same_step: same_step(ruptures, own),
            last_before,
            nearest_before,
        })
    }
}

/// The load in step `step`, or why it is not known.
fn wall_load(history: &History, step: i64, wall: Option<&str>) -> Result<std::result::Result<WallLoad, String>> {
    let (walls, scene) = (history.walls()?, history.parameters()?.scene);
    if wall.is_none() && stress_strain::load_wall(&walls, &scene).0.is_empty() {
        return Ok(Err("no wall is driven".into()));
    }
    let report = match stress_strain::read(history, wall) {
        Ok(report) => report,
        Err(PostError::Usage(why)) if wall.is_none() => return Ok(Err(why)),
        Err(PostError::Lacking { what, .. }) => return Ok(Err(what)),
        Err(error) => return Err(error),
    };
    if let Some(why) = report.load_after_breaks() {
        return Ok(Err(why));
    }
    let load = report.step.iter().position(|&s| s == step).and_then(|k| report.load.get(k).copied());
    Ok(load
        .map(|load| WallLoad { wall: report.summary.wall, load })
        .ok_or_else(|| format!("step {step} was not observed")))
}

/// Others that broke in the step of `own`: in earlier rounds, in the same and in later ones.
fn same_step(ruptures: &[Rupture], own: &Rupture) -> [usize; 3] {
    let mut counts = [0; 3];
    for other in ruptures.iter().filter(|r| r.step == own.step && r.bond != own.bond) {
        counts[match other.round.cmp(&own.round) {
            std::cmp::Ordering::Less => 0,
            std::cmp::Ordering::Equal => 1,
            std::cmp::Ordering::Greater => 2,
        }] += 1;
    }
    counts
}

/// The last and the nearest of the bonds that broke in an earlier round or step than `own`.
fn neighbours(ruptures: &[Rupture], own: &Rupture) -> [Option<Neighbour>; 2] {
    let moment = |r: &Rupture| (r.step, r.round);
    let distance = |r: &Rupture| r.point.iter().zip(own.point).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let before = || ruptures.iter().filter(|r| moment(r) < moment(own)).map(|r| (r, distance(r)));
    let neighbour = |(r, distance): (&Rupture, f64)| Neighbour {
        bond: r.bond,
        grains: r.pair,
        mode: r.mode.label(),
        step: r.step,
        time: r.time,
        round: r.round,
        distance,
    };
    let last = before().min_by(|a, b| moment(b.0).cmp(&moment(a.0)).then(a.1.total_cmp(&b.1)));
    let nearest = before().min_by(|a, b| a.1.total_cmp(&b.1).then(moment(b.0).cmp(&moment(a.0))));
    [last.map(neighbour), nearest.map(neighbour)]
}

#[cfg(test)]
mod tests {
    use dem_history::RuptureMode;

    use super::*;

    fn rupture(bond: i32, step: i64, round: i32, x: f64) -> Rupture {
        Rupture {
            step,
            time: step as f64,
            point: [x, 0.0, 0.0],
            normal_force: 0.0,
            tangential_force: 0.0,
            moment: 0.0,
            twist: 0.0,
            energy: 0.0,
            round,
            bond,
            pair: [0, 1],
            mode: RuptureMode::Shear,
        }
    }

    #[test]
    fn what_breaks_in_the_same_round_is_not_before() {
        let ruptures = [
            rupture(7, 1, 0, 5.0),
            rupture(8, 3, 0, 9.0),
            rupture(9, 3, 0, 2.0),
            rupture(1, 3, 1, 0.0),
            rupture(2, 3, 1, 0.5),
            rupture(3, 3, 2, 0.1),
            rupture(4, 4, 0, 0.1),
        ];
        let found = |own: usize| {
            neighbours(&ruptures, &ruptures[own]).map(|found| found.map(|found| (found.bond, found.distance)))
        };
        // of round 0 of step 3 the nearer one
        assert_eq!(found(3), [Some((9, 2.0)), Some((9, 2.0))]);
        assert_eq!(same_step(&ruptures, &ruptures[3]), [2, 1, 1]);
        assert_eq!(found(1), [Some((7, 4.0)), Some((7, 4.0))]);
        // the last is not the nearest
        assert_eq!(found(4).map(|found| found.map(|found| found.0)), [Some(9), Some(9)]);
        assert_eq!(found(5).map(|found| found.map(|found| found.0)), [Some(1), Some(1)]);
        let far = [rupture(1, 1, 0, 0.0), rupture(2, 2, 0, 9.0), rupture(3, 3, 0, 0.0)];
        assert_eq!(neighbours(&far, &far[2]).map(|found| found.map(|found| found.bond)), [Some(2), Some(1)]);
        assert_eq!(found(0), [None, None]);
    }
}
