//! The dense matrix of a front: what is added to it, and the elimination of its pivots.

use super::dense::{Tiles, in_chunks, reorder};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::{MatMut, MatRef, Par};
use std::ops::Range;

/// What is known of a matrix, and how it is factorised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Kind {
    /// Symmetric and positive definite: L Lᵀ, in the lower triangle.
    Symmetric,
    /// L U with pivoting.
    #[default]
    General,
}

/// The Schur complement that a front leaves on its border, column by column; of a symmetric one the
/// lower triangle.
#[derive(Debug, Default)]
pub(super) struct Schur {
    pub kind: Kind,
    pub values: Vec<f64>,
}

impl Schur {
    /// Write the upper triangle of a symmetric matrix of n rows.
    fn fill(&mut self, n: usize) {
        if self.kind == Kind::Symmetric {
            self.kind = Kind::General;
            for c in 0..n {
                (c + 1..n).for_each(|r| self.values[r * n + c] = self.values[c * n + r]);
            }
        }
    }
}

/// The numeric values of a front.
pub(super) struct FrontValues<'a> {
    pub kind: Kind,
    /// Number of unknowns, and of pivots among them.
    pub n: usize,
    pub p: usize,
    /// Columns of the pivots (n each), rows of the pivots in the columns of the border (p each;
    /// none if symmetric), and the Schur complement on the border (column by column).
    pub columns: &'a mut [f64],
    pub across: &'a mut [f64],
    pub rest: Vec<f64>,
}

impl FrontValues<'_> {
    /// Add the identity to the rows of the pivots.
    pub fn add_identity(&mut self) {
        self.columns.iter_mut().step_by(self.n + 1).for_each(|x| *x = 1.0);
    }

    /// Add an element, row by row; `places` are those of its rows here.
    pub fn add(&mut self, element: &[f64], places: &[usize]) {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        let all = self.kind == Kind::General;
        for (row, line) in places.iter().zip(element.chunks_exact(places.len().max(1))) {
            for (column, entry) in places.iter().zip(line).filter(|(column, _)| all || row >= column) {
                *match (*row < p, *column < p) {
                    (_, true) => &mut self.columns[column * n + row],
                    (true, false) => &mut self.across[(column - p) * p + row],
                    (false, false) => &mut self.rest[(column - p) * b + row - p],
                } += entry;
            }
        }
    }

    /// Add the Schur complements of the fronts below, each with the places of its unknowns here, in
    /// ascending order.
    pub fn take_over(&mut self, below: &mut [(Schur, &[usize])]) {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        if self.kind == Kind::General {
            below.iter_mut().for_each(|(left, up)| left.fill(up.len()));
        }
        let tile = Tiles::of(n).size;
        // to columns from `first` on, of these rows
        let add = |first: usize, rows: Range<usize>, values: &mut [f64]| {
            let height = rows.len();
            let last = first + values.len() / height;
            for (left, up) in below.iter() {
                let from = |place: usize| up.partition_point(|at| *at < place);
                let runs = runs(up, from(rows.start)..from(rows.end), rows.start);
                let mut runs = runs.as_slice();
                for c in from(first)..from(last) {
                    let column = &mut values[(up[c] - first) * height..][..height];
                    let left_column = &left.values[c * up.len()..][..up.len()];
                    let begin = if left.kind == Kind::Symmetric { c } else { 0 };
                    while let Some((_, later)) = runs.split_first().filter(|(run, _)| run.from + run.length <= begin) {
                        runs = later;
                    }
                    for run in runs {
                        let above = begin.saturating_sub(run.from);
                        let to = &mut column[run.to + above..run.to + run.length];
                        to.iter_mut().zip(&left_column[run.from + above..]).for_each(|(x, value)| *x += value);
                    }
                }
            }
        };
        in_chunks(self.columns, tile * n, |k, values| add(k * tile, 0..n, values));
        in_chunks(self.across, tile * p, |k, values| add(p + k * tile, 0..p, values));
        in_chunks(&mut self.rest, tile * b, |k, values| add(p + k * tile, p..n, values));
    }

    /// Factorise the pivots and form the Schur complement. Returns the sign of their determinant
    /// and the order of their rows (empty if symmetric); none if a pivot is zero or not finite, or
    /// if a symmetric matrix is not positive definite.
    pub fn eliminate(&mut self) -> Option<(f64, Vec<usize>)> {
        self.eliminate_in(Tiles::of(self.n))
    }

    fn eliminate_in(&mut self, tiles: Tiles) -> Option<(f64, Vec<usize>)> {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        let factorised = match self.kind {
            Kind::Symmetric => tiles.cholesky(self.columns, n, 0).map(|()| (1.0, Vec::new()))?,
            Kind::General => tiles.lu(self.columns, n, p, 0)?,
        };
        if b == 0 {
            return Some(factorised);
        }
        let (pivots, below) = MatRef::from_column_major_slice(self.columns, n, p).split_at_row(p);
        let rest = MatMut::from_column_major_slice_mut(&mut self.rest, b, b);
        if self.kind == Kind::Symmetric {
            tiles.subtract_square(rest, below);
        } else {
            in_chunks(self.across, tiles.panel * p, |_, tile| {
                reorder(tile, p, 0, &factorised.1);
                let columns = tile.len() / p;
                let tile = MatMut::from_column_major_slice_mut(tile, p, columns);
                solve_unit_lower_triangular_in_place(pivots, tile, Par::Seq);
            });
            tiles.subtract(rest, below, MatRef::from_column_major_slice(self.across, p, b));
        }
        Some(factorised)
    }
}

/// Values that are consecutive both in a border and in the front above.
struct Run {
    from: usize,
    to: usize,
    length: usize,
}

/// Runs of consecutive places in a part of an ascending list; places are counted from `origin`.
fn runs(places: &[usize], part: Range<usize>, origin: usize) -> Vec<Run> {
    let mut from = part.start;
    let consecutive = places[part].chunk_by(|a, b| a + 1 == *b);
    let runs = consecutive.map(|run| {
        from += run.len();
        Run { from: from - run.len(), to: run[0] - origin, length: run.len() }
    });
    runs.collect()
}

#[cfg(test)]
mod tests {
    use super::super::dense::LARGE;
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// The order of the pivots' rows, the Schur complement and the columns of a front.
    fn eliminated(kind: Kind, n: usize, p: usize, matrix: &[f64], tiles: Tiles) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
        let b = n - p;
        let (mut columns, mut across, rest) = (vec![0.0; n * p], vec![0.0; p * b], vec![0.0; b * b]);
        let mut values = FrontValues { kind, n, p, columns: &mut columns, across: &mut across, rest };
        values.add(matrix, &(0..n).collect::<Vec<_>>());
        let (_, rows) = values.eliminate_in(tiles).unwrap();
        (rows, values.rest, columns)
    }

    fn close(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    #[test]
    fn tiles_have_the_factors_of_the_whole() {
        let (n, p) = (LARGE + 90, LARGE + 10);
        let whole = Tiles { panel: n, size: n };
        // pivots are exchanged in every column
        let mut random = Pcg64::seed_from_u64(7);
        let matrix: Vec<f64> = (0..n * n).map(|_| random.random_range(-1.0..1.0)).collect();
        let (rows, rest, columns) = eliminated(Kind::General, n, p, &matrix, whole);
        let (same_rows, same_rest, same_columns) = eliminated(Kind::General, n, p, &matrix, Tiles::of(n));
        assert_eq!(rows, same_rows);
        assert!(close(&rest, &same_rest) && close(&columns, &same_columns));
    }

    #[test]
    fn a_symmetric_front_leaves_the_schur_complement_of_a_general_one() {
        let (n, p) = (LARGE + 300, LARGE + 10);
        let mut random = Pcg64::seed_from_u64(8);
        let mut matrix: Vec<f64> = (0..n * n).map(|_| random.random_range(-1.0..1.0)).collect();
        for (r, c) in (0..n).flat_map(|r| (0..r).map(move |c| (r, c))) {
            matrix[c * n + r] = matrix[r * n + c];
        }
        (0..n).for_each(|d| matrix[d * n + d] = n as f64);
        let (_, wanted, _) = eliminated(Kind::General, n, p, &matrix, Tiles::of(n));
        for tiles in [Tiles::of(n), Tiles { panel: n, size: n }] {
            let (_, rest, _) = eliminated(Kind::Symmetric, n, p, &matrix, tiles);
            let mut rest = Schur { kind: Kind::Symmetric, values: rest };
            rest.fill(n - p);
            assert!(close(&rest.values, &wanted));
        }
    }
}
