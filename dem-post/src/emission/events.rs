//! Acoustic events: broken bonds that are near each other in time and place.
//!
//! Two ruptures are **linked** if
//!
//! * their steps differ by at most [`Rule::steps`], or, where the load follows the breaks
//!   (`rupture: next_event`), if they are of one [burst](bursts), and
//! * a grain of one bond is a grain of the other, or at most [`Rule::reach`] bonds of the intact
//!   sample lead from a grain of one to a grain of the other.
//!
//! An **event** is a set of ruptures that are linked, directly or through others (single linkage,
//! as for clusters of earthquakes: Frohlich & Davis 1990). It has no length or time as a constant:
//! the unit of time is the step of the run, the unit of distance a bond. Hazzard & Young (2000)
//! cluster the bonds that break in a bonded particle model in the same manner, within the time
//! that a wave takes to leave the source; bodies here are rigid and have no such time.

use std::ops::Range;

use dem_history::{Bonds, Rupture};
use petgraph::unionfind::UnionFind;
use serde::Serialize;

use crate::cracks::modes::Modes;

/// Which ruptures are linked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Rule {
    /// Greatest difference of their steps; `None`: those of one [burst](bursts).
    pub steps: Option<u32>,
    /// Greatest number of bonds between them.
    pub reach: u32,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Step of its first rupture.
    pub step: i64,
    /// Time of its first rupture, s.
    pub time: f64,
    /// Round of the cascade of its first rupture.
    pub round: i32,
    /// Time from its first to its last rupture, s; `None` where the load follows the breaks and no
    /// time passes.
    pub duration: Option<f64>,
    /// Number of rounds, in all steps, in which its bonds broke.
    pub rounds: usize,
    /// Load of the sample in the step of its first rupture, before anything broke in it, N; `None`
    /// where it is not known.
    pub load: Option<f64>,
    /// Its source size: bonds that broke.
    pub bonds: usize,
    /// The same by mode.
    pub modes: Modes,
    /// Mean of the points at which they broke, m.
    pub place: [f64; 3],
    /// Root of the mean square of their distances from it, m.
    pub radius: f64,
    /// Elastic energy that they released, J; 0 for rigid bonds.
    pub energy: f64,
    /// Its magnitude; `None` where the magnitude is that of the energy and no energy was released.
    pub magnitude: Option<f64>,
}

/// The number of the burst of each step, from the loads under which bonds break in it.
///
/// A burst is what breaks under a load that no longer grows: its first step has a greater load than
/// all before, the others none greater than the first. Under a load that only grows these bonds
/// break at once (Hemmer & Hansen, J. Appl. Mech. 59, 1992).
pub fn bursts(loads: &[f64]) -> Vec<i64> {
    let (mut greatest, mut burst) = (f64::NEG_INFINITY, 0);
    let mut of_step = |load: &f64| {
        if *load > greatest {
            greatest = *load;
            burst += 1;
        }
        burst
    };
    loads.iter().map(&mut of_step).collect()
}

/// The events of `ruptures`, which are in order, in a sample of `grains` grains; for each event the
/// indices of its ruptures. Events are in the order of their first ruptures. `place` is the step of
/// each rupture, or its burst.
pub fn cluster(ruptures: &[Rupture], place: &[i64], grains: usize, bonds: &Bonds, rule: Rule) -> Vec<Vec<usize>> {
    let window = i64::from(rule.steps.unwrap_or(0));
    let around = neighbours(grains, bonds);
    let mut joined = UnionFind::<usize>::new(ruptures.len());
    // the last rupture at each grain. Earlier ones need no look: within the same time they are
    // linked with the last one through that grain
    let mut last: Vec<Option<usize>> = vec![None; grains];
    for (k, rupture) in ruptures.iter().enumerate() {
        let own = rupture.pair.map(|grain| grain as usize);
        for grain in within(&own, &around, rule.reach) {
            let Some(other) = last[grain] else { continue };
            if place[k] - place[other] <= window {
                joined.union(k, other);
            }
        }
        own.into_iter().for_each(|grain| last[grain] = Some(k));
    }
    let mut events: Vec<Vec<usize>> = vec![];
    let mut event_of = vec![usize::MAX; ruptures.len()];
    for k in 0..ruptures.len() {
        let root = joined.find_mut(k);
        if event_of[root] == usize::MAX {
            event_of[root] = events.len();
            events.push(vec![]);
        }
        events[event_of[root]].push(k);
    }
    events
}

/// Grains to which a bond leads, for each grain.
fn neighbours(grains: usize, bonds: &Bonds) -> Vec<Vec<usize>> {
    let mut around = vec![vec![]; grains];
    for pair in &bonds.pair {
        let [i, j] = pair.map(|grain| grain as usize);
        around[i].push(j);
        around[j].push(i);
    }
    around
}

/// The grains `own`, and those to which at most `reach` bonds lead from them.
fn within(own: &[usize], around: &[Vec<usize>], reach: u32) -> Vec<usize> {
    let mut found = own.to_vec();
    let mut shell: Range<usize> = 0..found.len();
    for _ in 0..reach {
        let mut next: Vec<usize> = found[shell.clone()].iter().flat_map(|&grain| &around[grain]).copied().collect();
        next.sort_unstable();
        next.dedup();
        next.retain(|grain| !found.contains(grain));
        shell = found.len()..found.len() + next.len();
        found.extend(next);
    }
    found
}

impl Event {
    /// The event of the ruptures `own`, at least one, in order; without load and magnitude.
    pub fn of(own: &[&Rupture]) -> Self {
        let (first, last, count) = (own[0], own[own.len() - 1], own.len() as f64);
        let mut modes = Modes::default();
        own.iter().for_each(|rupture| modes.add(rupture.mode));
        let place = [0, 1, 2].map(|k| own.iter().map(|rupture| rupture.point[k]).sum::<f64>() / count);
        let off = |rupture: &&Rupture| (0..3).map(|k| (rupture.point[k] - place[k]).powi(2)).sum::<f64>();
        let mut rounds: Vec<(i64, i32)> = own.iter().map(|rupture| (rupture.step, rupture.round)).collect();
        rounds.dedup();
        Self {
            step: first.step,
            time: first.time,
            round: first.round,
            duration: Some(last.time - first.time),
            rounds: rounds.len(),
            load: None,
            bonds: own.len(),
            modes,
            place,
            radius: (own.iter().map(off).sum::<f64>() / count).sqrt(),
            energy: own.iter().map(|rupture| rupture.energy).sum(),
            magnitude: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use dem_history::RuptureMode;

    use super::*;

    /// A chain of ten grains, 0–1–…–9; bond k joins grains k and k + 1, and breaks at x = k.
    fn chain() -> Bonds {
        Bonds { pair: (0..9).map(|k| [k, k + 1]).collect(), ..Bonds::default() }
    }

    fn rupture(step: i64, round: i32, bond: i32) -> Rupture {
        Rupture {
            step,
            time: step as f64 * 0.5,
            point: [f64::from(bond), 0.0, 0.0],
            normal_force: 0.0,
            tangential_force: 0.0,
            moment: 0.0,
            twist: 0.0,
            energy: 2.0,
            round,
            bond,
            pair: [bond, bond + 1],
            mode: RuptureMode::Tension,
        }
    }

    fn events(ruptures: &[Rupture], steps: u32, reach: u32) -> Vec<Vec<usize>> {
        let place: Vec<i64> = ruptures.iter().map(|rupture| rupture.step).collect();
        cluster(ruptures, &place, 10, &chain(), Rule { steps: Some(steps), reach })
    }

    #[test]
    fn a_burst_is_what_breaks_under_a_load_that_no_longer_grows() {
        assert_eq!(bursts(&[1.0, 0.5, 0.9, 1.0, 1.2, 1.1, 1.3, 2.0]), [1, 1, 1, 1, 2, 2, 3, 4]);
        // ruptures of one burst are linked however many steps apart they are, those of two are not
        let list = [rupture(1, 0, 0), rupture(9, 0, 1), rupture(10, 0, 2)];
        let joined = |place: [i64; 3]| cluster(&list, &place, 10, &chain(), Rule { steps: None, reach: 0 });
        assert_eq!(joined([1, 1, 2]), [vec![0, 1], vec![2]]);
        assert_eq!(joined([1, 2, 2]), [vec![0], vec![1, 2]]);
    }

    #[test]
    fn ruptures_far_apart_are_events_of_their_own() {
        let both = [rupture(3, 0, 0), rupture(3, 0, 5)];
        // grains 1 and 5 are four bonds apart
        assert_eq!(events(&both, 0, 3), [[0], [1]]);
        assert_eq!(events(&both, 0, 4), [[0, 1]]);
    }

    #[test]
    fn ruptures_that_share_a_grain_are_linked_within_the_steps() {
        let both = [rupture(3, 0, 0), rupture(5, 0, 1)];
        assert_eq!(events(&both, 1, 0), [[0], [1]]);
        assert_eq!(events(&both, 2, 0), [[0, 1]]);
    }

    #[test]
    fn links_join_what_is_not_linked_itself() {
        // each next to the one before, one step later
        let crack: Vec<Rupture> = (0..5).map(|k| rupture(i64::from(k), 0, k)).collect();
        assert_eq!(events(&crack, 1, 0), [[0, 1, 2, 3, 4]]);
        assert_eq!(events(&crack, 0, 0).len(), 5);
        // two that are far from each other, joined by a later one
        let joined = [rupture(1, 0, 0), rupture(1, 0, 4), rupture(1, 1, 2)];
        assert_eq!(events(&joined, 0, 1), [[0, 1, 2]]);
        assert_eq!(events(&joined, 0, 0), [[0], [1], [2]]);
    }

    #[test]
    fn events_are_the_same_as_by_comparing_all_pairs() {
        // ruptures at places of a fixed sequence, each bond once, a few in a step
        let order = [4, 0, 8, 3, 6, 1, 5, 7, 2];
        let steps = [0, 0, 1, 3, 3, 4, 6, 9, 9];
        let list: Vec<Rupture> = order.iter().zip(steps).map(|(&bond, step)| rupture(step, 0, bond)).collect();
        for (window, reach) in (0..4).flat_map(|w| (0..4).map(move |r| (w, r))) {
            let linked = |a: &Rupture, b: &Rupture| {
                // bonds a and b of the chain have |a − b| − 1 bonds between their nearest grains
                (a.step - b.step).abs() <= window && (a.bond - b.bond).abs() - 1 <= reach
            };
            let mut expected = UnionFind::<usize>::new(9);
            for (i, j) in (0..9).flat_map(|i| (0..i).map(move |j| (i, j))) {
                if linked(&list[i], &list[j]) {
                    expected.union(i, j);
                }
            }
            let found = events(&list, window as u32, reach as u32);
            assert_eq!(found.iter().map(Vec::len).sum::<usize>(), 9);
            for (i, j) in (0..9).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let together = found.iter().any(|event| event.contains(&i) && event.contains(&j));
                assert_eq!(together, expected.equiv(i, j), "{window} steps, {reach} bonds: {i} and {j}");
            }
        }
    }

    #[test]
    fn an_event_has_the_sums_and_means_of_its_ruptures() {
        let list = [rupture(2, 1, 0), rupture(2, 1, 2), rupture(2, 2, 4), rupture(4, 0, 6)];
        let event = Event::of(&list.iter().collect::<Vec<_>>());
        assert_eq!((event.step, event.time, event.round, event.duration), (2, 1.0, 1, Some(1.0)));
        assert_eq!((event.bonds, event.rounds, event.energy), (4, 3, 8.0));
        assert_eq!((event.place, event.radius), ([3.0, 0.0, 0.0], 5f64.sqrt()));
        assert_eq!(event.modes.tension, 4);
    }
}
