//! The dense matrix of a front: what is added to it, and the elimination of its pivots.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

/// Number of unknowns from which the work of a front is shared among threads.
const LARGE: usize = 384;
/// Columns of a large front that are eliminated together.
const PANEL: usize = 64;
/// Columns of a large front that one task updates.
const WIDTH: usize = 128;

/// How the columns of a front are divided: one tile if it is small.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    /// Columns that are eliminated together.
    pub panel: usize,
    /// Columns that one task updates.
    width: usize,
}

/// The numeric values of a front.
pub(super) struct FrontValues<'a> {
    /// Number of unknowns, and of pivots among them.
    pub n: usize,
    pub p: usize,
    /// Columns of the pivots (n each), rows of the pivots in the columns of the border (p each),
    /// and the Schur complement on the border (column by column).
    pub columns: &'a mut [f64],
    pub across: &'a mut [f64],
    pub rest: Vec<f64>,
}

impl FrontValues<'_> {
    #[inline]
    pub fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        let (n, p) = (self.n, self.p);
        match (row < p, column < p) {
            (_, true) => &mut self.columns[column * n + row],
            (true, false) => &mut self.across[(column - p) * p + row],
            (false, false) => &mut self.rest[(column - p) * (n - p) + row - p],
        }
    }

    /// Add the Schur complements of the fronts below, each with the places of its unknowns here, in
    /// ascending order.
    pub fn take_over(&mut self, below: &[(Vec<f64>, &[usize])]) {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        let tile = Tiles::of(n).width;
        // to columns from `first` on, of these rows
        let add = |first: usize, rows: Range<usize>, values: &mut [f64]| {
            let height = rows.len();
            let last = first + values.len() / height;
            for (left, up) in below {
                let from = |place: usize| up.partition_point(|at| *at < place);
                let (upper, lower) = (from(rows.start), from(rows.end));
                let runs = runs(&up[upper..lower], rows.start);
                for c in from(first)..from(last) {
                    let column = &mut values[(up[c] - first) * height..][..height];
                    let mut left = &left[c * up.len()..][upper..lower];
                    for (start, length) in &runs {
                        let (run, later) = left.split_at(*length);
                        column[*start..][..*length].iter_mut().zip(run).for_each(|(x, value)| *x += value);
                        left = later;
                    }
                }
            }
        };
        in_chunks(self.columns, tile * n, |k, values| add(k * tile, 0..n, values));
        in_chunks(self.across, tile * p, |k, values| add(p + k * tile, 0..p, values));
        in_chunks(&mut self.rest, tile * b, |k, values| add(p + k * tile, p..n, values));
    }

    /// Factorise the pivots and form the Schur complement. Returns the sign of their determinant
    /// and their rows; none if a pivot is zero or not finite.
    pub fn eliminate(&mut self) -> Option<(f64, Vec<usize>)> {
        self.eliminate_in(Tiles::of(self.n))
    }

    fn eliminate_in(&mut self, tiles: Tiles) -> Option<(f64, Vec<usize>)> {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        let (sign, rows) = tiles.factorise(self.columns, n, p, 0)?;
        if b > 0 {
            let (pivots, below) = MatRef::from_column_major_slice(self.columns, n, p).split_at_row(p);
            in_chunks(self.across, tiles.width * p, |_, tile| {
                reorder(tile, p, 0, &rows);
                let columns = tile.len() / p;
                let tile = MatMut::from_column_major_slice_mut(tile, p, columns);
                solve_unit_lower_triangular_in_place(pivots, tile, Par::Seq);
            });
            let across = MatRef::from_column_major_slice(self.across, p, b);
            in_chunks(&mut self.rest, tiles.width * b, |k, tile| {
                let columns = tile.len() / b;
                let tile = MatMut::from_column_major_slice_mut(tile, b, columns);
                let across = across.get(.., k * tiles.width..k * tiles.width + columns);
                matmul(tile, Accum::Add, below, across, -1.0, Par::Seq);
            });
        }
        Some((sign, rows))
    }
}

impl Tiles {
    /// The tiles of a front of n unknowns.
    pub fn of(n: usize) -> Self {
        let whole = n.max(1);
        if n < LARGE { Self { panel: whole, width: whole } } else { Self { panel: PANEL, width: WIDTH } }
    }

    /// LU factors of columns of n values in their place. The pivots are in rows `first` to `p`.
    /// Returns the sign of the determinant and the order of these rows; none if a pivot is zero or
    /// not finite.
    ///
    /// Recursive (Toledo, SIAM J. Matrix Anal. Appl. 18, 1997): the left half, its effect on the
    /// right half, the right half.
    fn factorise(self, columns: &mut [f64], n: usize, p: usize, first: usize) -> Option<(f64, Vec<usize>)> {
        let width = columns.len() / n.max(1);
        if width <= self.panel {
            let (_, own) = MatMut::from_column_major_slice_mut(columns, n, width).split_at_row_mut(first);
            let (mut pivots, border) = own.split_at_row_mut(p - first);
            let (sign, rows) = factorise_panel(pivots.as_mut())?;
            let (upper, _) = pivots.as_ref().split_at_row(width);
            solve_lower_triangular_in_place(upper.transpose(), border.transpose_mut(), Par::Seq);
            return Some((sign, rows));
        }
        let half = width / 2;
        let (left, right) = columns.split_at_mut(half * n);
        let (of_left, mut rows) = self.factorise(left, n, p, first)?;
        let (_, done) = MatRef::from_column_major_slice(left, n, half).split_at_row(first);
        let (unit, lower) = done.split_at_row(half);
        in_chunks(right, self.width * n, |_, tile| {
            reorder(tile, n, first, &rows);
            let columns = tile.len() / n;
            let (_, tile) = MatMut::from_column_major_slice_mut(tile, n, columns).split_at_row_mut(first);
            let (mut across, below) = tile.split_at_row_mut(half);
            solve_unit_lower_triangular_in_place(unit, across.as_mut(), Par::Seq);
            matmul(below, Accum::Add, lower, across.as_ref(), -1.0, Par::Seq);
        });
        let (of_right, order) = self.factorise(right, n, p, first + half)?;
        in_chunks(left, self.width * n, |_, tile| reorder(tile, n, first + half, &order));
        let pivots = rows.len();
        reorder(&mut rows, pivots, half, &order);
        Some((of_left * of_right, rows))
    }
}

/// LU factors of the columns of `matrix` in its place. Returns the sign of the determinant and the
/// rows in the order in which they became pivots; none if a pivot is zero or not finite.
fn factorise_panel(mut matrix: MatMut<'_, f64>) -> Option<(f64, Vec<usize>)> {
    let (height, width) = (matrix.nrows(), matrix.ncols());
    let (mut forward, mut inverse) = (vec![0usize; height], vec![0usize; height]);
    let scratch = lu_in_place_scratch::<usize, f64>(height, width, Par::Seq, Default::default());
    let mut scratch = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut scratch);
    let (info, _) = lu_in_place(matrix.as_mut(), &mut forward, &mut inverse, Par::Seq, stack, Default::default());
    if (0..width).any(|d| matrix[(d, d)] == 0.0 || !matrix[(d, d)].is_finite()) {
        return None;
    }
    let odd = info.transposition_count % 2 == 1;
    let sign = (0..width).fold(if odd { -1.0 } else { 1.0 }, |sign, d| matrix[(d, d)].signum() * sign);
    Some((sign, forward))
}

/// Runs of consecutive places in an ascending list, relative to `origin`: start and length.
fn runs(places: &[usize], origin: usize) -> Vec<(usize, usize)> {
    let consecutive = places.chunk_by(|a, b| a + 1 == *b);
    consecutive.map(|run| (run[0] - origin, run.len())).collect()
}

/// In each column of n values: the values from `first` on in this order.
fn reorder<T: Copy>(columns: &mut [T], n: usize, first: usize, order: &[usize]) {
    let mut reordered = Vec::with_capacity(order.len());
    for column in columns.chunks_exact_mut(n) {
        let values = &mut column[first..first + order.len()];
        reordered.clear();
        reordered.extend(order.iter().map(|k| values[*k]));
        values.copy_from_slice(&reordered);
    }
}

/// `work` on chunks of `size` values and their numbers, in parallel if there are several.
pub(super) fn in_chunks(values: &mut [f64], size: usize, work: impl Fn(usize, &mut [f64]) + Sync) {
    match values.len() {
        0 => {}
        length if length <= size => work(0, values),
        _ => values.par_chunks_mut(size).enumerate().for_each(|(k, chunk)| work(k, chunk)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn tiles_have_the_factors_of_the_whole() {
        let (n, p) = (LARGE + 90, LARGE + 10);
        let b = n - p;
        // pivots are exchanged in every column
        let mut random = Pcg64::seed_from_u64(7);
        let matrix: Vec<f64> = (0..n * n).map(|_| random.random_range(-1.0..1.0)).collect();
        let eliminated = |tiles: Tiles| {
            let (mut columns, mut across, rest) = (vec![0.0; n * p], vec![0.0; p * b], vec![0.0; b * b]);
            let mut values = FrontValues { n, p, columns: &mut columns, across: &mut across, rest };
            for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
                *values.at(row, column) = matrix[row * n + column];
            }
            let (sign, rows) = values.eliminate_in(tiles).unwrap();
            (sign, rows, values.rest, columns)
        };
        let (sign, rows, rest, columns) = eliminated(Tiles { panel: n, width: n });
        let (same_sign, same_rows, same_rest, same_columns) = eliminated(Tiles::of(n));
        assert_eq!((sign, rows), (same_sign, same_rows));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&rest, &same_rest) && close(&columns, &same_columns));
    }
}
