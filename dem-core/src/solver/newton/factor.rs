//! The symmetric matrix I + Σ H̃ A H̃ᵀ of a Newton step and its sparse Cholesky factor, kept as a preconditioner.

use super::rows::{Operator, Rows};
use faer::prelude::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{MatMut, Side};

/// A factor, and the pattern that it was made for.
#[derive(Default)]
pub(super) struct Factor {
    pattern: Option<Pattern>,
    numeric: Option<Llt<usize, f64>>,
    /// Numeric factorisations so far.
    pub made: u64,
}

struct Pattern {
    /// Blocks of the contact graph: first unknowns and counts of the two nodes of each contact.
    blocks: Vec<([usize; 2], [usize; 2])>,
    unknowns: usize,
    matrix: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    symbolic: SymbolicLlt<usize>,
}

impl Factor {
    /// Whether there is a factor for this many unknowns.
    pub fn serves(&self, unknowns: usize) -> bool {
        self.numeric.is_some() && self.pattern.as_ref().is_some_and(|p| p.unknowns == unknowns)
    }

    /// Factorise I + Σ H̃ A H̃ᵀ for these (symmetric) operators; false if it is not positive definite to rounding.
    pub fn renew(&mut self, rows: &Rows, operators: &[Option<Operator>]) -> bool {
        self.numeric = None;
        let blocks: Vec<_> = rows.list.iter().map(|r| (r.at, r.count)).collect();
        let known = self.pattern.as_ref().is_some_and(|p| p.unknowns == rows.unknowns && p.blocks == blocks);
        if !known {
            self.pattern = Pattern::new(rows, blocks);
        }
        let Some(pattern) = &self.pattern else { return false };
        let values = values(rows, operators);
        let Ok(matrix) = SparseColMat::new_from_argsort(pattern.matrix.clone(), &pattern.order, &values) else {
            return false;
        };
        self.made += 1;
        self.numeric = Llt::try_new_with_symbolic(pattern.symbolic.clone(), matrix.as_ref(), Side::Lower).ok();
        self.numeric.is_some()
    }

    /// x ← (L Lᵀ)⁻¹ x.
    pub fn solve(&self, x: &mut [f64]) {
        if let Some(factor) = &self.numeric {
            let n = x.len();
            factor.solve_in_place(MatMut::from_column_major_slice_mut(x, n, 1));
        }
    }
}

/// Visit the entries of the lower triangle that one contact has: row and column in the matrix, then in the pair.
fn entries(at: [usize; 2], count: [usize; 2], mut visit: impl FnMut(usize, usize, usize, usize)) {
    let unknown = |k: usize| if k < count[0] { at[0] + k } else { at[1] + k - count[0] };
    let width = count[0] + count[1];
    for c in 0..width {
        for r in 0..width {
            if unknown(r) >= unknown(c) {
                visit(unknown(r), unknown(c), r, c);
            }
        }
    }
}

impl Pattern {
    fn new(rows: &Rows, blocks: Vec<([usize; 2], [usize; 2])>) -> Option<Self> {
        let mut indices: Vec<Pair<usize, usize>> = (0..rows.unknowns).map(|k| Pair::new(k, k)).collect();
        for (at, count) in &blocks {
            entries(*at, *count, |row, col, _, _| indices.push(Pair::new(row, col)));
        }
        let (matrix, order) =
            SymbolicSparseColMat::try_new_from_indices(rows.unknowns, rows.unknowns, &indices).ok()?;
        let symbolic = SymbolicLlt::try_new(matrix.as_ref(), Side::Lower).ok()?;
        Some(Self { blocks, unknowns: rows.unknowns, matrix, order, symbolic })
    }
}

/// The values of the entries, in the order of [`Pattern::new`].
fn values(rows: &Rows, operators: &[Option<Operator>]) -> Vec<f64> {
    let mut values = vec![1.0; rows.unknowns];
    for (row, operator) in rows.list.iter().zip(operators) {
        let width = row.count[0] + row.count[1];
        let h = |k: usize, c: usize| rows.coefficients[row.start + k * width + c];
        // A H̃ᵀ, then H̃ (A H̃ᵀ)
        let mut pulled = [[0.0; 12]; 5];
        if let Some(a) = operator {
            for (k, row_place) in row.rows.iter().enumerate() {
                for c in 0..width {
                    pulled[k][c] = match a {
                        Operator::Diagonal(_) => a.entry(*row_place, *row_place) * h(k, c),
                        Operator::Full(_) => {
                            row.rows.iter().enumerate().map(|(l, place)| a.entry(*row_place, *place) * h(l, c)).sum()
                        }
                    };
                }
            }
        }
        entries(row.at, row.count, |_, _, r, c| {
            values.push((0..row.rows.len()).map(|k| h(k, r) * pulled[k][c]).sum());
        });
    }
    values
}
