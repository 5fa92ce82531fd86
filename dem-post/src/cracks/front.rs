//! The front of a crack: its position along the direction of the path, break by break.
//!
//! A crack here is one of the final cracks: its parts count as one crack even before they meet.
//! Positions are measured from its first break along the line between the ends of its path,
//! positive towards the end that broke later. The **front** is the greatest position reached by a
//! broken segment, the **back** the least. All breaks of one step have the same time; the rounds of
//! the cascade define an order, not a speed. So each row is a round, and a **speed** is the mean
//! speed of the tip since the last time at which the crack grew.
//!
//! The **growth**, in contrast, lists the cracks after each round, joined only by bonds that have
//! broken so far. Where two cracks meet, the largest grows by the size of the other.

use dem_history::Rupture;
use petgraph::unionfind::UnionFind;
use serde::Serialize;

use super::parts::{Part, join, nodes};
use super::paths::Paths;

/// A crack after a round of breaks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Front {
    /// Number of the crack, from 1.
    pub crack: usize,
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Round of the cascade within the step.
    pub round: i32,
    /// Bonds broken so far.
    pub bonds: usize,
    /// Length of all segments so far, m.
    pub length: f64,
    /// Position of the rear tip, m, at most 0.
    pub back: f64,
    /// Position of the front tip, m, at least 0.
    pub front: f64,
    /// Speed of the rear tip away from the origin, m/s. Only the last round of a time has a speed;
    /// the first time has none.
    pub back_speed: Option<f64>,
    /// Speed of the front tip away from the origin, m/s.
    pub front_speed: Option<f64>,
}

/// The fronts of all cracks, crack by crack, in order of time and round.
pub fn fronts(paths: &Paths, ruptures: &[Rupture]) -> Vec<Front> {
    let mut fronts: Vec<Vec<Front>> = vec![vec![]; paths.cracks.len()];
    for segment in &paths.segments {
        let (crack, rupture) = (&paths.cracks[segment.crack], &ruptures[segment.event]);
        let rows = &mut fronts[segment.crack];
        let place = |point: [f64; 2]| {
            (point[0] - crack.origin[0]) * crack.direction[0] + (point[1] - crack.origin[1]) * crack.direction[1]
        };
        let last = rows.last().copied();
        let (bonds, length, back, front) = last.map_or((0, 0.0, 0.0, 0.0), |f| (f.bonds, f.length, f.back, f.front));
        let row = Front {
            crack: crack.number,
            step: rupture.step,
            time: rupture.time,
            round: rupture.round,
            bonds: bonds + 1,
            length: length + segment.length,
            back: segment.line.map(place).into_iter().fold(back, f64::min),
            front: segment.line.map(place).into_iter().fold(front, f64::max),
            back_speed: None,
            front_speed: None,
        };
        if last.is_some_and(|last| (last.step, last.round) == (row.step, row.round)) {
            rows.pop();
        }
        rows.push(row);
    }
    fronts.iter_mut().for_each(|rows| speeds(rows));
    fronts.concat()
}

/// Fills in the speeds at the last row of each time.
fn speeds(rows: &mut [Front]) {
    let mut before: Option<Front> = None;
    for k in 0..rows.len() {
        if rows.get(k + 1).is_some_and(|next| next.time == rows[k].time) {
            continue;
        }
        if let Some(before) = before {
            let elapsed = rows[k].time - before.time;
            rows[k].back_speed = Some((before.back - rows[k].back) / elapsed);
            rows[k].front_speed = Some((rows[k].front - before.front) / elapsed);
        }
        before = Some(rows[k]);
    }
}

/// The cracks after a round of breaks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Round of the cascade within the step.
    pub round: i32,
    /// Bonds broken so far.
    pub bonds: usize,
    /// Number of cracks.
    pub cracks: usize,
    /// Length (m) or area (m²) of all of them.
    pub size: f64,
    /// Length or area of the largest crack.
    pub largest: f64,
}

/// The growth of all cracks, in order of time and round, from the broken bonds in their order.
pub fn growth<'a>(parts: impl Iterator<Item = Part<'a>> + Clone, ruptures: &[Rupture]) -> Vec<Growth> {
    let nodes = nodes(parts.clone());
    let mut joined = UnionFind::<usize>::new(nodes);
    // size of each crack at its root; `None` where no part has broken yet
    let mut sizes = vec![None; nodes];
    let mut rows: Vec<Growth> = vec![];
    let (mut cracks, mut largest, mut size) = (0usize, 0.0f64, 0.0);
    for (k, part) in parts.enumerate() {
        let mut roots: Vec<usize> = part.nodes.iter().map(|node| joined.find_mut(*node)).collect();
        roots.sort_unstable();
        roots.dedup();
        let met: Vec<f64> = roots.iter().filter_map(|root| sizes[*root].take()).collect();
        cracks = cracks + 1 - met.len();
        let all = met.iter().sum::<f64>() + part.size;
        join(&mut joined, &roots);
        sizes[joined.find_mut(roots[0])] = Some(all);
        largest = largest.max(all);
        size += part.size;
        let Rupture { step, time, round, .. } = ruptures[part.event];
        if rows.last().is_some_and(|last| (last.step, last.round) == (step, round)) {
            rows.pop();
        }
        rows.push(Growth { step, time, round, bonds: k + 1, cracks, size, largest });
    }
    rows
}
