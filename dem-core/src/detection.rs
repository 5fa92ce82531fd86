//! Candidate pairs for contact, from grids of cells and a skin around each body.
//!
//! The list holds every pair whose gap was at most the sum of its two skins when the list was
//! built. The list is valid while the displacement of each body since then, plus the reach that the
//! step requires of it, is at most its skin. A single fast grain thus adds pairs of its own and no
//! others.
//!
//! The grids form a hierarchy after Ogarko & Luding (Comput. Phys. Commun. 183, 931, 2012): one
//! level for each halving of radius plus skin. A grain is compared with its own level and with
//! those of larger cells, so that neither a wide range of radii nor a fast grain makes all cells
//! large. Cells are sorted by key and not stored as an array: a grain far away costs no memory.

use crate::body::{Grains, Wall, separation};
use crate::dim::{Dim, Vect};
use rayon::prelude::*;

/// Pairs of grains, and of a grain with a wall, that may touch soon.
#[derive(Clone, Debug)]
pub struct Candidates<D: Dim> {
    /// Sorted pairs (i, j): i < j both grains, or j = number of grains + wall.
    pub pairs: Vec<[u32; 2]>,
    skin: Vec<f64>,
    then: Vec<D::Vector>,
}

impl<D: Dim> Default for Candidates<D> {
    fn default() -> Self {
        Self { pairs: Vec::new(), skin: Vec::new(), then: Vec::new() }
    }
}

impl<D: Dim> Candidates<D> {
    /// Make the list hold every pair whose gap at these positions is at most the sum of the `reach`
    /// (m) of its two bodies; bodies are numbered grains first. A list that is no longer valid is
    /// rebuilt with skins of `reach` + `spare` (m): each body may then move by `spare` before the
    /// next rebuild. Returns whether it was rebuilt.
    pub fn cover(
        &mut self,
        grains: &Grains<D>,
        position: &[D::Vector],
        walls: &[Wall<D>],
        wall_position: &[D::Vector],
        reach: impl Fn(usize) -> f64,
        spare: impl Fn(usize) -> f64,
    ) -> bool {
        let bodies = grains.len() + walls.len();
        let now = || position.iter().chain(wall_position);
        let within = |(k, (x, then)): (usize, (&D::Vector, &D::Vector))| (*x - *then).norm() + reach(k) <= self.skin[k];
        if self.then.len() == bodies && now().zip(&self.then).enumerate().all(within) {
            return false;
        }
        let skin: Vec<f64> = (0..bodies).map(|k| reach(k) + spare(k)).collect();
        self.pairs = Grids::new(grains, position, &skin).pairs();
        let first_wall = grains.len();
        for (w, (wall, place)) in walls.iter().zip(wall_position).enumerate() {
            for (i, x) in position.iter().enumerate() {
                if wall.shape.gap(*x - *place, grains.radius[i]).0 <= skin[i] + skin[first_wall + w] {
                    self.pairs.push([i as u32, (first_wall + w) as u32]);
                }
            }
        }
        self.pairs.par_sort_unstable();
        self.then.clear();
        self.then.extend(now());
        self.skin = skin;
        true
    }
}

/// A grain in its cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    level: u16,
    key: [i64; 3],
    grain: u32,
}

/// The grids: cells of level L are 2⁻ᴸ times as wide as those of level 0, which hold the largest
/// grains.
struct Grids<'a, D: Dim> {
    grains: &'a Grains<D>,
    position: &'a [D::Vector],
    skin: &'a [f64],
    /// Width of the cells of level 0 (m).
    widest: f64,
    entries: Vec<Entry>,
    /// The levels that hold grains.
    levels: Vec<u16>,
}

/// All pairs of grains whose gap is at most the sum of their skins (m), sorted.
pub fn pairs_within<D: Dim>(grains: &Grains<D>, position: &[D::Vector], skin: &[f64]) -> Vec<[u32; 2]> {
    let mut pairs = Grids::new(grains, position, skin).pairs();
    pairs.par_sort_unstable();
    pairs
}

impl<'a, D: Dim> Grids<'a, D> {
    fn new(grains: &'a Grains<D>, position: &'a [D::Vector], skin: &'a [f64]) -> Self {
        let size = |k: usize| grains.radius[k] + skin[k];
        let widest = 2.0 * (0..grains.len()).map(size).fold(0.0, f64::max);
        let mut grids = Self { grains, position, skin, widest, entries: Vec::new(), levels: Vec::new() };
        let entry = |k: usize| {
            // the finest level whose cells are at least as wide as the grain with its skin
            let level = (widest / (2.0 * size(k))).log2().floor().clamp(0.0, 1000.0) as u16;
            Entry { level, key: grids.cell(k, level), grain: k as u32 }
        };
        let mut entries: Vec<Entry> = (0..grains.len()).map(entry).collect();
        entries.par_sort_unstable();
        grids.levels = entries.chunk_by(|a, b| a.level == b.level).map(|level| level[0].level).collect();
        grids.entries = entries;
        grids
    }

    fn cell(&self, grain: usize, level: u16) -> [i64; 3] {
        let width = self.widest * 0.5f64.powi(level.into());
        let mut key = [0; 3];
        for axis in 0..D::N {
            key[axis] = (self.position[grain][axis] / width).floor() as i64;
        }
        key
    }

    /// All pairs whose gap is at most the sum of their skins, each once.
    fn pairs(&self) -> Vec<[u32; 2]> {
        // chunks of a fixed length, joined in order: the same list for any number of threads
        self.entries.par_chunks(256).flat_map_iter(|chunk| self.pairs_of(chunk)).collect()
    }

    /// Pairs of these grains with later grains of their own level, and with all grains in levels of
    /// larger cells.
    fn pairs_of(&self, chunk: &[Entry]) -> Vec<[u32; 2]> {
        let mut found = Vec::new();
        let deep = D::N > 2;
        let finest = chunk.last().map_or(0, |entry| entry.level);
        for &level in self.levels.iter().take_while(|level| **level <= finest) {
            for (dx, dy) in [(0, 0), (0, 1), (1, -1), (1, 0), (1, 1), (0, -1), (-1, -1), (-1, 0), (-1, 1)] {
                let ahead = (dx, dy) >= (0, 0);
                // entries are sorted by cell: the next run begins near the last one
                let mut start = 0;
                for entry in chunk.iter().filter(|entry| level < entry.level || level == entry.level && ahead) {
                    let own = level == entry.level;
                    let key = if own { entry.key } else { self.cell(entry.grain as usize, level) };
                    let (Some(x), Some(y)) = (key[0].checked_add(dx), key[1].checked_add(dy)) else { continue };
                    // the last component of the key varies fastest: one run of the sorted list
                    // holds all of dz
                    let below = deep && !(own && (dx, dy) == (0, 0));
                    let low = [x, y, key[2].saturating_sub(below.into())];
                    let high = [x, y, key[2].saturating_add(deep.into())];
                    start = self.first_from(start, (level, low));
                    let run = self.entries[start..].iter().take_while(|e| (e.level, e.key) <= (level, high));
                    // of two grains in one cell, the one with the lower index finds the other
                    for other in run.filter(|e| !own || e.key != key || e.grain > entry.grain) {
                        self.add_if_near(entry.grain, other.grain, &mut found);
                    }
                }
            }
        }
        found
    }

    /// Index of the first entry at or after a cell of a level; the search begins at `near`.
    fn first_from(&self, near: usize, cell: (u16, [i64; 3])) -> usize {
        let before = |e: &Entry| (e.level, e.key) < cell;
        let (passed, coming) = self.entries.split_at(near);
        if passed.last().is_some_and(|e| !before(e)) {
            return passed.partition_point(before);
        }
        let next = coming.iter().take(16).position(|e| !before(e));
        near + next.unwrap_or_else(|| coming.partition_point(before))
    }

    fn add_if_near(&self, a: u32, b: u32, found: &mut Vec<[u32; 2]>) {
        let [i, j] = [a, b].map(|k| k as usize);
        let limit = self.grains.radius[i] + self.grains.radius[j] + self.skin[i] + self.skin[j];
        let apart = separation::<D>(self.position[i], self.position[j]);
        if apart.dot(&apart) <= limit * limit {
            found.push([a.min(b), a.max(b)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Grain;
    use crate::dim::{D2, D3};
    use proptest::prelude::*;

    /// All pairs by brute force.
    fn every_pair<D: Dim>(grains: &Grains<D>, skin: &[f64]) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for i in 0..grains.len() {
            for j in i + 1..grains.len() {
                let apart = grains.position[i] - grains.position[j];
                let gap = apart.norm() - grains.radius[i] - grains.radius[j];
                if gap <= skin[i] + skin[j] {
                    pairs.push([i as u32, j as u32]);
                }
            }
        }
        pairs
    }

    fn finds_every_pair<D: Dim>(numbers: &[(f64, f64, f64, f64, f64)]) {
        let grain = |&(x, y, z, size, _): &(f64, f64, f64, f64, f64)| {
            Grain::<D>::at_rest(D::Vector::from_slice(&[x, y, z][..D::N]), 10f64.powf(size), 1.0)
        };
        let grains: Grains<D> = numbers.iter().map(grain).collect();
        let skin: Vec<f64> = numbers.iter().map(|n| 10f64.powf(n.4)).collect();
        assert_eq!(pairs_within(&grains, &grains.position, &skin), every_pair(&grains, &skin));
    }

    proptest! {
        // sizes and skins over six decades in a box of side 2, so that the result ranges from a few
        // pairs to all of them
        #[test]
        fn grids_find_every_pair(
            numbers in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0, -4.0..0.5, -5.0..0.5), 0..120)
        ) {
            finds_every_pair::<D2>(&numbers);
            finds_every_pair::<D3>(&numbers);
        }
    }

    #[test]
    fn a_fast_grain_looks_far_alone() {
        let grains: Grains<D2> =
            (0..1000).map(|k| Grain::at_rest([f64::from(k % 40), f64::from(k / 40)].into(), 0.5, 1.0)).collect();
        let mut skin = vec![0.01; 1000];
        let calm = pairs_within(&grains, &grains.position, &skin).len();
        skin[500] = 200.0;
        let pairs = pairs_within(&grains, &grains.position, &skin);
        assert_eq!(pairs.iter().filter(|p| p.contains(&500)).count(), 999);
        assert_eq!(pairs.len(), calm - 4 + 999);
    }
}
