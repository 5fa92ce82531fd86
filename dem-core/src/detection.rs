//! Candidate pairs: grids of cells with a skin around each body.
//!
//! The list holds every pair whose gap was at most the sum of its two skins when it was built. It stays valid while each
//! body's displacement since then, plus the reach that the step needs of it, is within its own skin: a single fast grain
//! lengthens its own list and no other.
//!
//! Grains lie in a hierarchy of grids after Ogarko & Luding (Comput. Phys. Commun. 183, 931, 2012): a level for each halving
//! of radius plus skin. A grain is compared with its own level and those of larger cells, so that neither a wide range of
//! radii nor a fast grain makes all cells large. Cells are sorted by key rather than laid out as an array: a grain that
//! flies away costs no memory.

use crate::body::{Grains, Wall};
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
    /// Make the list hold every pair whose gap at these places is at most the sum of what `reach` (m) gives for its bodies,
    /// grains first. If it must be built anew, each body may go as far as `spare` (m) gives before that is so again.
    pub fn cover(
        &mut self,
        grains: &Grains<D>,
        position: &[D::Vector],
        walls: &[Wall<D>],
        wall_position: &[D::Vector],
        reach: impl Fn(usize) -> f64,
        spare: impl Fn(usize) -> f64,
    ) {
        let bodies = grains.len() + walls.len();
        let now = || position.iter().chain(wall_position);
        let within = |(k, (x, then)): (usize, (&D::Vector, &D::Vector))| (*x - *then).norm() + reach(k) <= self.skin[k];
        if self.then.len() == bodies && now().zip(&self.then).enumerate().all(within) {
            return;
        }
        let skin: Vec<f64> = (0..bodies).map(|k| reach(k) + spare(k)).collect();
        self.pairs = pairs_within(grains, position, &skin);
        let first_wall = grains.len();
        for (w, (wall, place)) in walls.iter().zip(wall_position).enumerate() {
            for (i, x) in position.iter().enumerate() {
                if wall.shape.gap(*x - *place, grains.radius[i]).0 <= skin[i] + skin[first_wall + w] {
                    self.pairs.push([i as u32, (first_wall + w) as u32]);
                }
            }
        }
        self.pairs.sort_unstable();
        self.then.clear();
        self.then.extend(now());
        self.skin = skin;
    }
}

/// A grain in its cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    level: u16,
    key: [i64; 3],
    grain: u32,
}

/// The grids: cells of level L are 2⁻ᴸ times as wide as those of level 0, which hold the largest grains.
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
    let grids = Grids::new(grains, position, skin);
    // chunks of a fixed length, joined in order: the same list for any number of threads
    let mut pairs: Vec<[u32; 2]> = grids
        .entries
        .par_chunks(256)
        .flat_map_iter(|chunk| chunk.iter().flat_map(|entry| grids.neighbours(entry)))
        .collect();
    pairs.par_sort_unstable();
    pairs
}

impl<'a, D: Dim> Grids<'a, D> {
    fn new(grains: &'a Grains<D>, position: &'a [D::Vector], skin: &'a [f64]) -> Self {
        let size = |k: usize| grains.radius[k] + skin[k];
        let widest = 2.0 * (0..grains.len()).map(size).fold(0.0, f64::max);
        let mut grids = Self { grains, position, skin, widest, entries: Vec::new(), levels: Vec::new() };
        let entry = |k: usize| {
            // as many halvings as leave the cell at least as wide as the grain with its skin
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

    /// Pairs of a grain with those of higher index in its own level, and with all in levels of larger cells.
    fn neighbours(&self, entry: &Entry) -> Vec<[u32; 2]> {
        let mut found = Vec::new();
        let me = entry.grain as usize;
        let span = |axis: usize| if axis < D::N { -1..=1 } else { 0..=0 };
        for &level in self.levels.iter().take_while(|level| **level <= entry.level) {
            let key = if level == entry.level { entry.key } else { self.cell(me, level) };
            for dx in span(0) {
                for dy in span(1) {
                    // cells are ordered by their last key last: one run of the sorted list holds all of dz
                    let last = if D::N == 3 { 1 } else { 0 };
                    let low = [key[0].saturating_add(dx), key[1].saturating_add(dy), key[2].saturating_sub(last)];
                    let high = [low[0], low[1], key[2].saturating_add(last)];
                    let start = self.entries.partition_point(|e| (e.level, e.key) < (level, low));
                    let cells = self.entries[start..].iter().take_while(|e| (e.level, e.key) <= (level, high));
                    for other in cells.filter(|e| level < entry.level || e.grain > entry.grain) {
                        let j = other.grain as usize;
                        let limit = self.grains.radius[me] + self.grains.radius[j] + self.skin[me] + self.skin[j];
                        let apart = self.position[me] - self.position[j];
                        if apart.dot(&apart) <= limit * limit {
                            found.push([entry.grain.min(other.grain), entry.grain.max(other.grain)]);
                        }
                    }
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Grain;
    use crate::dim::{D2, D3};
    use proptest::prelude::*;

    /// Every pair, looked at one by one.
    fn every_pair<D: Dim>(grains: &Grains<D>, skin: &[f64]) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for i in 0..grains.len() {
            for j in i + 1..grains.len() {
                let gap = (grains.position[i] - grains.position[j]).norm() - grains.radius[i] - grains.radius[j];
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
        // sizes and skins over six decades in a box of side 2, so that all is found from a few pairs to every one
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
