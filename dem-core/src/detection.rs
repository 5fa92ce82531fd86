//! Candidate pairs: a cell grid with a skin.
//!
//! The list holds every pair whose gap was at most `skin` when it was built. It stays valid while twice the largest
//! displacement since then, plus the reach that a step needs, is below the skin. Cells are sorted by key rather than
//! laid out as an array, so a grain that flies away costs no memory.

use crate::body::{Grains, Wall};
use crate::dim::{Dim, Vect};
use rayon::prelude::*;

/// Pairs of grains, and of a grain with a wall, that may touch soon.
#[derive(Clone, Debug)]
pub struct Candidates<D: Dim> {
    /// Sorted pairs (i, j): i < j both grains, or j = number of grains + wall.
    pub pairs: Vec<[u32; 2]>,
    skin: f64,
    grains_then: Vec<D::Vector>,
    walls_then: Vec<D::Vector>,
}

impl<D: Dim> Default for Candidates<D> {
    fn default() -> Self {
        Self { pairs: Vec::new(), skin: f64::NEG_INFINITY, grains_then: Vec::new(), walls_then: Vec::new() }
    }
}

/// Largest distance between two lists of points (m).
fn largest_move<V: Vect>(now: &[V], then: &[V]) -> f64 {
    now.iter().zip(then).map(|(a, b)| (*a - *b).dot(&(*a - *b))).fold(0.0, f64::max).sqrt()
}

impl<D: Dim> Candidates<D> {
    /// Whether every pair whose gap is at most `reach` (m) at these positions is in the list.
    pub fn covers(&self, grains: &[D::Vector], walls: &[D::Vector], reach: f64) -> bool {
        if self.grains_then.len() != grains.len() || self.walls_then.len() != walls.len() {
            return false;
        }
        let moved = largest_move(grains, &self.grains_then)
            + largest_move(grains, &self.grains_then).max(largest_move(walls, &self.walls_then));
        moved + reach <= self.skin
    }

    /// Build the list anew for these positions, with the given skin (m).
    pub fn rebuild(
        &mut self,
        grains: &Grains<D>,
        position: &[D::Vector],
        walls: &[Wall<D>],
        wall_position: &[D::Vector],
        skin: f64,
    ) {
        self.skin = skin;
        self.grains_then = position.to_vec();
        self.walls_then = wall_position.to_vec();
        self.pairs = pairs_within(grains, position, skin);
        let first_wall = grains.len();
        for (w, (wall, place)) in walls.iter().zip(wall_position).enumerate() {
            for (i, x) in position.iter().enumerate() {
                if wall.shape.gap(*x - *place, grains.radius[i]).0 <= skin {
                    self.pairs.push([i as u32, (first_wall + w) as u32]);
                }
            }
        }
        self.pairs.sort_unstable();
    }
}

/// All pairs of grains with a gap of at most `reach` (m), sorted.
pub fn pairs_within<D: Dim>(grains: &Grains<D>, position: &[D::Vector], reach: f64) -> Vec<[u32; 2]> {
    let largest = grains.radius.iter().copied().fold(0.0, f64::max);
    let size = 2.0 * largest + reach;
    let mut cells: Vec<([i64; 3], u32)> =
        position.iter().enumerate().map(|(i, x)| (cell::<D>(x, size), i as u32)).collect();
    cells.par_sort_unstable();
    // chunks of a fixed length, joined in order: the same list for any number of threads
    let mut pairs: Vec<[u32; 2]> = cells
        .par_chunks(256)
        .flat_map_iter(|chunk| chunk.iter().flat_map(|entry| neighbours(grains, position, &cells, *entry, reach)))
        .collect();
    pairs.par_sort_unstable();
    pairs
}

fn cell<D: Dim>(x: &D::Vector, size: f64) -> [i64; 3] {
    let mut key = [0; 3];
    for axis in 0..D::N {
        key[axis] = (x[axis] / size).floor() as i64;
    }
    key
}

/// Pairs of grain `i` with the grains of higher index in its own and the neighbouring cells.
fn neighbours<D: Dim>(
    grains: &Grains<D>,
    position: &[D::Vector],
    cells: &[([i64; 3], u32)],
    (key, i): ([i64; 3], u32),
    reach: f64,
) -> Vec<[u32; 2]> {
    let mut found = Vec::new();
    let me = i as usize;
    let span = |axis: usize| if axis < D::N { -1..=1 } else { 0..=0 };
    for dx in span(0) {
        for dy in span(1) {
            // cells are ordered by their last key last: one run of the sorted list holds all of dz
            let last = if D::N == 3 { 1 } else { 0 };
            let low = [key[0].saturating_add(dx), key[1].saturating_add(dy), key[2].saturating_sub(last)];
            let high = [low[0], low[1], key[2].saturating_add(last)];
            let start = cells.partition_point(|c| c.0 < low);
            for &(_, j) in cells[start..].iter().take_while(|c| c.0 <= high) {
                if j <= i {
                    continue;
                }
                let other = j as usize;
                let limit = grains.radius[me] + grains.radius[other] + reach;
                let apart = position[me] - position[other];
                if apart.dot(&apart) <= limit * limit {
                    found.push([i, j]);
                }
            }
        }
    }
    found
}
