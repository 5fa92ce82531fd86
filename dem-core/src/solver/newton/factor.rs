//! The symmetric matrix I + Σ H̃ A H̃ᵀ of a Newton step and its Cholesky factor, kept as a preconditioner: sparse where
//! rows come from pairs of bodies, dense where they come from the factor of a matrix.

use super::order::dissected;
use crate::solver::rows::{Operator, PAIR, Rows};
use crate::contact::PADDED;
use crate::saved::{Mismatch, Reader, Saved};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::prelude::Solve;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Mat, MatMut, Par, Side};

/// A factor, and the pattern that it was made for.
#[derive(Default)]
pub(super) struct Factor {
    pattern: Option<Pattern>,
    numeric: Option<Numeric>,
    /// Numeric factorisations so far.
    pub made: u64,
}

enum Numeric {
    /// The values of L for the pattern at hand, and the entries that they were made of.
    Sparse(Vec<f64>, Vec<f64>),
    Dense(faer::linalg::solvers::Llt<f64>),
}

struct Pattern {
    /// Blocks of the contact graph: first unknowns and counts of the two nodes of each contact.
    blocks: Vec<([usize; 2], [usize; 2])>,
    unknowns: usize,
    /// Entries of all blocks and the diagonal, those at one place counted each.
    entries: usize,
    matrix: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    symbolic: SymbolicCholesky<usize>,
}

impl Factor {
    /// Whether there is a factor for this many unknowns.
    pub fn serves(&self, unknowns: usize) -> bool {
        match &self.numeric {
            None => false,
            Some(Numeric::Sparse(..)) => self.pattern.as_ref().is_some_and(|p| p.unknowns == unknowns),
            Some(Numeric::Dense(factor)) => factor.L().nrows() == unknowns,
        }
    }

    /// Factorise I + Σ H̃ A H̃ᵀ for these (symmetric) operators; false if it is not positive definite to rounding.
    pub fn renew(&mut self, rows: &Rows, operators: &[Option<Operator>]) -> bool {
        // the room of a large factor is taken over: from the system it comes page by page
        let (room, made_of) = match self.numeric.take() {
            Some(Numeric::Sparse(factor, values)) => (factor, values),
            _ => Default::default(),
        };
        if rows.list.iter().any(|r| r.count[0] + r.count[1] > PAIR) {
            self.made += 1;
            let matrix = dense(rows, operators);
            self.numeric = faer::linalg::solvers::Llt::new(matrix.as_ref(), Side::Lower).ok().map(Numeric::Dense);
            return self.numeric.is_some();
        }
        let blocks: Vec<_> = rows.list.iter().map(|r| (r.at, r.count)).collect();
        let known = self.pattern.as_ref().is_some_and(|p| p.unknowns == rows.unknowns && p.blocks == blocks);
        if !known {
            self.pattern = Pattern::new(rows.unknowns, blocks);
        }
        let Some(pattern) = &self.pattern else { return false };
        let factor = pattern.factorised(values(rows, operators, made_of), room);
        self.made += u64::from(factor.is_some());
        self.numeric = factor.flatten();
        self.numeric.is_some()
    }

    /// Write what the factor was made of. One of a whole matrix is not kept: it serves one solve.
    pub fn save(&self, to: &mut Saved) {
        let kept = match (&self.pattern, &self.numeric) {
            (Some(pattern), Some(Numeric::Sparse(_, values))) => Some((pattern, values)),
            _ => None,
        };
        to.flag(kept.is_some());
        let Some((pattern, values)) = kept else { return };
        to.count(pattern.unknowns);
        to.count(pattern.blocks.len());
        for (at, count) in &pattern.blocks {
            at.iter().chain(count).for_each(|n| to.count(*n));
        }
        to.count(values.len());
        to.reals.extend_from_slice(values);
    }

    /// The same factor, made anew of what [`Factor::save`] wrote.
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut factor = Self::default();
        if !from.flag()? {
            return Ok(factor);
        }
        let unknowns = from.number_of()?;
        let mut blocks = Vec::with_capacity(from.number_of()?);
        for _ in 0..blocks.capacity() {
            let mut pair = || Ok([from.count()?, from.count()?]);
            let (at, count) = (pair()?, pair()?);
            let inside = |(at, count): (&usize, &usize)| *count <= PAIR && at.saturating_add(*count) <= unknowns;
            if !at.iter().zip(&count).all(inside) {
                return Err(Mismatch);
            }
            blocks.push((at, count));
        }
        let count = from.number_of()?;
        let values = from.reals(count)?.to_vec();
        let pattern = Pattern::new(unknowns, blocks).filter(|p| p.entries == count).ok_or(Mismatch)?;
        factor.numeric = pattern.factorised(values, Vec::new()).flatten();
        factor.pattern = Some(pattern);
        if factor.numeric.is_some() { Ok(factor) } else { Err(Mismatch) }
    }

    /// x ← (L Lᵀ)⁻¹ x.
    pub fn solve(&self, x: &mut [f64]) {
        let n = x.len();
        let x = MatMut::from_column_major_slice_mut(x, n, 1);
        match (&self.numeric, &self.pattern) {
            (Some(Numeric::Sparse(values, _)), Some(Pattern { symbolic, .. })) => {
                let mut scratch = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
                let factor = LltRef::new(symbolic, values);
                factor.solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(&mut scratch));
            }
            (Some(Numeric::Dense(factor)), _) => factor.solve_in_place(x),
            _ => {}
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
    fn new(unknowns: usize, blocks: Vec<([usize; 2], [usize; 2])>) -> Option<Self> {
        let mut indices: Vec<Pair<usize, usize>> = (0..unknowns).map(|k| Pair::new(k, k)).collect();
        for (at, count) in &blocks {
            entries(*at, *count, |row, col, _, _| indices.push(Pair::new(row, col)));
        }
        let (matrix, order) = SymbolicSparseColMat::try_new_from_indices(unknowns, unknowns, &indices).ok()?;
        // a body in space has half the unknowns that a pair has at most
        let in_space = blocks.iter().any(|(_, count)| count.contains(&(PAIR / 2)));
        let own = if in_space { dissected(unknowns, &blocks) } else { None };
        let places = own.as_ref().map_or(SymmetricOrdering::Amd, |own| SymmetricOrdering::Custom(own.as_ref()));
        let symbolic = factorize_symbolic_cholesky(matrix.as_ref(), Side::Lower, places, Default::default()).ok()?;
        Some(Self { blocks, unknowns, entries: indices.len(), matrix, order, symbolic })
    }

    /// The factor of the matrix with these entries, in `room`; `Some(None)` if it is not positive definite to rounding.
    fn factorised(&self, values: Vec<f64>, room: Vec<f64>) -> Option<Option<Numeric>> {
        let matrix = SparseColMat::new_from_argsort(self.matrix.clone(), &self.order, &values).ok()?;
        let (symbolic, par) = (&self.symbolic, Par::Seq);
        let mut factor = room;
        factor.resize(symbolic.len_val(), 0.0);
        let mut scratch = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(par, Default::default()));
        let made = symbolic.factorize_numeric_llt(
            &mut factor,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            par,
            MemStack::new(&mut scratch),
            Default::default(),
        );
        Some(made.is_ok().then_some(Numeric::Sparse(factor, values)))
    }
}

/// The values of the entries, in the order of [`Pattern::new`], written over `values`.
fn values(rows: &Rows, operators: &[Option<Operator>], mut values: Vec<f64>) -> Vec<f64> {
    values.clear();
    values.resize(rows.unknowns, 1.0);
    for (row, operator) in rows.list.iter().zip(operators) {
        let width = row.count[0] + row.count[1];
        let h = |k: usize, c: usize| rows.coefficients[row.start + k * width + c];
        // A H̃ᵀ, then H̃ (A H̃ᵀ)
        let mut pulled = [[0.0; PAIR]; PADDED];
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

/// The whole matrix, for rows over the same unknowns.
fn dense(rows: &Rows, operators: &[Option<Operator>]) -> Mat<f64> {
    let n = rows.unknowns;
    let height: usize = rows.list.iter().map(|row| row.rows.len()).sum();
    // H̃ᵀ of all rows, and A H̃ᵀ
    let mut h = Mat::<f64>::zeros(n, height);
    let mut pulled = Mat::<f64>::zeros(n, height);
    let mut first = 0;
    for (row, operator) in rows.list.iter().zip(operators) {
        for (k, place) in row.rows.iter().enumerate() {
            for c in 0..n {
                h[(c, first + k)] = rows.coefficients[row.start + k * n + c];
            }
            let Some(a) = operator else { continue };
            for (l, other) in row.rows.iter().enumerate() {
                for c in 0..n {
                    pulled[(c, first + k)] += a.entry(*place, *other) * rows.coefficients[row.start + l * n + c];
                }
            }
        }
        first += row.rows.len();
    }
    Mat::<f64>::identity(n, n) + h * pulled.transpose()
}
