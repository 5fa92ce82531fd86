//! Dense kernels on the columns of a front. Those of a large front are divided into tiles that
//! threads share; the tiles, and so all bits, depend on the sizes alone.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::matmul::{matmul, triangular};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Number of unknowns from which the work of a front is shared among threads.
pub(super) const LARGE: usize = 384;
/// Columns of a large front that are eliminated together.
const PANEL: usize = 64;
/// Most rows and columns of a large front that one task updates.
const TILE: usize = 192;

/// How a front is divided: not at all if it is small.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    /// Columns that are eliminated together.
    pub panel: usize,
    /// Most rows and columns that one task updates.
    pub size: usize,
}

impl Tiles {
    /// The tiles of a front of n unknowns.
    pub fn of(n: usize) -> Self {
        let whole = n.max(1);
        if n < LARGE { Self { panel: whole, size: whole } } else { Self { panel: PANEL, size: TILE } }
    }

    /// LU factors of columns of n values in their place. The pivots are in rows `first` to `p`.
    /// Returns the sign of the determinant and the order of these rows; none if a pivot is zero or
    /// not finite.
    ///
    /// Recursive (Toledo, SIAM J. Matrix Anal. Appl. 18, 1997): the left half, its effect on the
    /// right half, the right half.
    pub fn lu(self, columns: &mut [f64], n: usize, p: usize, first: usize) -> Option<(f64, Vec<usize>)> {
        let width = columns.len() / n.max(1);
        if width <= self.panel {
            let (_, own) = MatMut::from_column_major_slice_mut(columns, n, width).split_at_row_mut(first);
            let (mut pivots, border) = own.split_at_row_mut(p - first);
            let (sign, rows) = lu_of_panel(pivots.as_mut())?;
            let (upper, _) = pivots.as_ref().split_at_row(width);
            self.divide(border, upper.transpose());
            return Some((sign, rows));
        }
        let half = width / 2;
        let (left, right) = columns.split_at_mut(half * n);
        let (of_left, mut rows) = self.lu(left, n, p, first)?;
        let (_, done) = MatRef::from_column_major_slice(left, n, half).split_at_row(first);
        let (unit, lower) = done.split_at_row(half);
        in_chunks(right, self.panel * n, |_, tile| {
            reorder(tile, n, first, &rows);
            let columns = tile.len() / n;
            let tile = MatMut::from_column_major_slice_mut(tile, n, columns).subrows_mut(first, half);
            solve_unit_lower_triangular_in_place(unit, tile, Par::Seq);
        });
        let right_of = MatMut::from_column_major_slice_mut(right, n, width - half);
        let (across, below) = right_of.split_at_row_mut(first).1.split_at_row_mut(half);
        self.subtract(below, lower, across.as_ref());
        let (of_right, order) = self.lu(right, n, p, first + half)?;
        in_chunks(left, self.panel * n, |_, tile| reorder(tile, n, first + half, &order));
        let pivots = rows.len();
        reorder(&mut rows, pivots, half, &order);
        Some((of_left * of_right, rows))
    }

    /// The Cholesky factor L of columns of n values in its place; their lower triangle begins in
    /// row `first`. None if a pivot is not positive. Recursive, as [`Tiles::lu`].
    pub fn cholesky(self, columns: &mut [f64], n: usize, first: usize) -> Option<()> {
        let width = columns.len() / n.max(1);
        if width <= self.panel {
            let (_, own) = MatMut::from_column_major_slice_mut(columns, n, width).split_at_row_mut(first);
            let (mut pivots, border) = own.split_at_row_mut(width);
            cholesky_of_panel(pivots.as_mut())?;
            self.divide(border, pivots.as_ref());
            return Some(());
        }
        let half = width / 2;
        let (left, right) = columns.split_at_mut(half * n);
        self.cholesky(left, n, first)?;
        let done = MatRef::from_column_major_slice(left, n, half).split_at_row(first + half).1;
        let right_of = MatMut::from_column_major_slice_mut(right, n, width - half).split_at_row_mut(first + half).1;
        self.subtract_square(right_of, done);
        self.cholesky(right, n, first + half)
    }

    /// b ← b L⁻ᵀ for a lower triangle L.
    fn divide(self, b: MatMut<'_, f64>, lower: MatRef<'_, f64>) {
        match self.halved(b.nrows()) {
            Some(half) => {
                let (upper, rest) = b.split_at_row_mut(half);
                rayon::join(|| self.divide(upper, lower), || self.divide(rest, lower));
            }
            None => solve_lower_triangular_in_place(lower, b.transpose_mut(), Par::Seq),
        }
    }

    /// c ← c − a b.
    pub fn subtract(self, c: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
        let by_rows = c.nrows() >= c.ncols();
        match self.halved(c.nrows().max(c.ncols())) {
            Some(half) if by_rows => {
                let ((above, below), (upper, lower)) = (c.split_at_row_mut(half), a.split_at_row(half));
                rayon::join(|| self.subtract(above, upper, b), || self.subtract(below, lower, b));
            }
            Some(half) => {
                let ((left, right), (first, second)) = (c.split_at_col_mut(half), b.split_at_col(half));
                rayon::join(|| self.subtract(left, a, first), || self.subtract(right, a, second));
            }
            None => matmul(c, Accum::Add, a, b, -1.0, Par::Seq),
        }
    }

    /// The lower triangle of c ← c − a aᵀ; c may have fewer columns than rows.
    pub fn subtract_square(self, c: MatMut<'_, f64>, a: MatRef<'_, f64>) {
        let columns = c.ncols();
        let (upper, lower) = a.split_at_row(columns);
        if lower.nrows() > 0 {
            let (square, below) = c.split_at_row_mut(columns);
            let of_square = || self.subtract_square(square, upper);
            let of_rest = || self.subtract(below, lower, upper.transpose());
            match self.halved(columns.max(lower.nrows())) {
                Some(_) => {
                    rayon::join(of_square, of_rest);
                }
                None => {
                    of_square();
                    of_rest();
                }
            }
        } else if let Some(half) = self.halved(columns) {
            let (left, right) = c.split_at_col_mut(half);
            let (_, right) = right.split_at_row_mut(half);
            let lower = upper.split_at_row(half).1;
            rayon::join(|| self.subtract_square(left, upper), || self.subtract_square(right, lower));
        } else {
            let (lower, full) = (triangular::BlockStructure::TriangularLower, triangular::BlockStructure::Rectangular);
            triangular::matmul(c, lower, Accum::Add, upper, full, upper.transpose(), full, -1.0, Par::Seq);
        }
    }

    /// Half of what is too large for a tile.
    fn halved(self, length: usize) -> Option<usize> {
        (length > self.size).then_some(length / 2)
    }
}

/// LU factors of the columns of `matrix` in its place. Returns the sign of the determinant and the
/// rows in the order in which they became pivots; none if a pivot is zero or not finite.
fn lu_of_panel(mut matrix: MatMut<'_, f64>) -> Option<(f64, Vec<usize>)> {
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

/// The Cholesky factor of a symmetric matrix in its lower triangle; none if a pivot is not
/// positive, or not finite.
fn cholesky_of_panel(matrix: MatMut<'_, f64>) -> Option<()> {
    let mut scratch = MemBuffer::new(cholesky_in_place_scratch::<f64>(matrix.nrows(), Par::Seq, Default::default()));
    let stack = MemStack::new(&mut scratch);
    cholesky_in_place(matrix, Default::default(), Par::Seq, stack, Default::default()).ok().map(drop)
}

/// In each column of n values: the values from `first` on in this order.
pub(super) fn reorder<T: Copy>(columns: &mut [T], n: usize, first: usize, order: &[usize]) {
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
