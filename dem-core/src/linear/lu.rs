//! LU factors over the fronts of a [`Tree`], with pivoting within each front.

use super::tree::{Front, Tree};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place};
use faer::{Accum, MatMut, Par};

/// The factors of a matrix; the next factorisation reuses their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lu {
    /// Of each front in turn: its pivot columns (L and U of the pivots, L of the border below),
    /// then U of the border.
    values: Vec<f64>,
    /// Start of the values of each front.
    starts: Vec<usize>,
    /// Rows in the order in which they became pivots, front by front.
    rows: Vec<usize>,
}

impl Lu {
    /// Factorise 1 + Σ of all elements; `element` writes the matrix of an element, row by row, over
    /// the unknowns of its first node and then its second. Returns the sign of the determinant;
    /// none if a pivot is zero or not finite.
    pub fn factorise(&mut self, tree: &Tree, mut element: impl FnMut(usize, &mut [f64])) -> Option<f64> {
        let mut sign = 1.0;
        self.starts.clear();
        self.rows.clear();
        let mut total = 0;
        for front in &tree.fronts {
            self.starts.push(total);
            total += front.pivots * (front.unknowns.len() + front.border());
        }
        self.values.clear();
        self.values.resize(total, 0.0);
        let mut left: Vec<Vec<f64>> = vec![Vec::new(); tree.fronts.len()];
        let mut matrix = Vec::new();
        for (k, front) in tree.fronts.iter().enumerate() {
            let (n, p, b) = (front.unknowns.len(), front.pivots, front.border());
            let (columns, across) = self.values[self.starts[k]..][..p * (n + b)].split_at_mut(n * p);
            let mut parts = FrontValues { n, p, columns, across, rest: vec![0.0; b * b] };
            (0..p).for_each(|d| *parts.at(d, d) = 1.0);
            for place in &front.elements {
                let [first, second] = tree.widths(place.element);
                let width = first + second;
                matrix.clear();
                matrix.resize(width * width, 0.0);
                element(place.element, &mut matrix);
                let at = |c: usize| if c < first { place.at[0] + c } else { place.at[1] + c - first };
                for (r, row) in matrix.chunks_exact(width.max(1)).enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        *parts.at(at(r), at(c)) += value;
                    }
                }
            }
            for child in &front.children {
                parts.take_over(&std::mem::take(&mut left[*child]), &tree.fronts[*child].up);
            }
            sign *= parts.eliminate(&mut self.rows)?;
            left[k] = parts.rest;
        }
        Some(sign)
    }

    /// x ← (L U)⁻¹ x.
    pub fn solve(&self, tree: &Tree, x: &mut [f64]) {
        let mut own = Vec::new();
        let mut pivot = 0;
        for (front, start) in tree.fronts.iter().zip(&self.starts) {
            let (columns, _) = self.parts(front, *start);
            let (n, p) = (front.unknowns.len(), front.pivots);
            own.clear();
            own.extend(self.rows[pivot..pivot + p].iter().map(|row| x[front.unknowns[*row]]));
            pivot += p;
            for (c, column) in columns.chunks_exact(n.max(1)).enumerate() {
                let value = own[c];
                own[c + 1..].iter_mut().zip(&column[c + 1..p]).for_each(|(x, l)| *x -= l * value);
                front.unknowns[p..].iter().zip(&column[p..]).for_each(|(at, l)| x[*at] -= l * value);
            }
            front.unknowns[..p].iter().zip(&own).for_each(|(at, value)| x[*at] = *value);
        }
        for (front, start) in tree.fronts.iter().zip(&self.starts).rev() {
            let (columns, across) = self.parts(front, *start);
            let (n, p) = (front.unknowns.len(), front.pivots);
            own.clear();
            own.extend(front.unknowns[..p].iter().map(|at| x[*at]));
            for (at, column) in front.unknowns[p..].iter().zip(across.chunks_exact(p.max(1))) {
                let value = x[*at];
                own.iter_mut().zip(column).for_each(|(x, u)| *x -= u * value);
            }
            for c in (0..p).rev() {
                let column = &columns[c * n..][..p];
                let value = own[c] / column[c];
                own[c] = value;
                own[..c].iter_mut().zip(column).for_each(|(x, u)| *x -= u * value);
            }
            front.unknowns[..p].iter().zip(&own).for_each(|(at, value)| x[*at] = *value);
        }
    }

    fn parts(&self, front: &Front, start: usize) -> (&[f64], &[f64]) {
        let (n, p, b) = (front.unknowns.len(), front.pivots, front.border());
        self.values[start..][..p * (n + b)].split_at(n * p)
    }
}

/// The numeric values of a front.
struct FrontValues<'a> {
    n: usize,
    p: usize,
    /// Columns of the pivots (n each), rows of the pivots in the columns of the border (p each),
    /// and the Schur complement on the border (column by column).
    columns: &'a mut [f64],
    across: &'a mut [f64],
    rest: Vec<f64>,
}

impl FrontValues<'_> {
    #[inline]
    fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        let (n, p) = (self.n, self.p);
        match (row < p, column < p) {
            (_, true) => &mut self.columns[column * n + row],
            (true, false) => &mut self.across[(column - p) * p + row],
            (false, false) => &mut self.rest[(column - p) * (n - p) + row - p],
        }
    }

    /// Add the Schur complement of a child front; `up` are the places of its unknowns here.
    fn take_over(&mut self, left: &[f64], up: &[usize]) {
        for (c, column) in left.chunks_exact(up.len().max(1)).enumerate() {
            for (r, value) in column.iter().enumerate() {
                *self.at(up[r], up[c]) += value;
            }
        }
    }

    /// Factorise the pivots and form the Schur complement. Returns the sign of their determinant;
    /// none if a pivot is zero or not finite.
    fn eliminate(&mut self, rows: &mut Vec<usize>) -> Option<f64> {
        let (n, p, b) = (self.n, self.p, self.n - self.p);
        let columns = MatMut::from_column_major_slice_mut(self.columns, n, p);
        let (mut pivots, mut below) = columns.split_at_row_mut(p);
        let (mut forward, mut inverse) = (vec![0usize; p], vec![0usize; p]);
        let mut scratch = MemBuffer::new(lu_in_place_scratch::<usize, f64>(p, p, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut scratch);
        let (info, _) = lu_in_place(pivots.as_mut(), &mut forward, &mut inverse, Par::Seq, stack, Default::default());
        if (0..p).any(|d| pivots[(d, d)] == 0.0 || !pivots[(d, d)].is_finite()) {
            return None;
        }
        let odd = info.transposition_count % 2 == 1;
        let sign = (0..p).fold(if odd { -1.0 } else { 1.0 }, |sign, d| pivots[(d, d)].signum() * sign);
        if b > 0 {
            let mut line = vec![0.0; p];
            for column in self.across.chunks_exact_mut(p) {
                line.iter_mut().zip(&forward).for_each(|(x, row)| *x = column[*row]);
                column.copy_from_slice(&line);
            }
            let mut across = MatMut::from_column_major_slice_mut(self.across, p, b);
            solve_unit_lower_triangular_in_place(pivots.as_ref(), across.as_mut(), Par::Seq);
            solve_lower_triangular_in_place(pivots.as_ref().transpose(), below.as_mut().transpose_mut(), Par::Seq);
            let rest = MatMut::from_column_major_slice_mut(&mut self.rest, b, b);
            matmul(rest, Accum::Add, below.as_ref(), across.as_ref(), -1.0, Par::Seq);
        }
        rows.extend(forward);
        Some(sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice of nodes with 3 unknowns, a plate with one, and an isolated node: sizes and
    /// elements.
    fn lattice(side: usize) -> (Vec<usize>, Vec<[usize; 2]>) {
        let plate = side * side;
        let mut sizes = vec![3; plate];
        sizes.push(1);
        sizes.push(3);
        let mut elements = Vec::new();
        for x in 0..side {
            for y in 0..side {
                let at = x + side * y;
                elements.push([at, at]);
                if x + 1 < side {
                    elements.push([at + 1, at]);
                }
                if y + 1 < side {
                    elements.push([at, at + side]);
                } else {
                    elements.push([plate, at]);
                }
            }
        }
        (sizes, elements)
    }

    #[test]
    fn factors_solve_what_elements_add_up_to() {
        let (sizes, elements) = lattice(12);
        let tree = Tree::new(sizes.clone(), elements.clone()).unwrap();
        let fill = |e: usize, m: &mut [f64]| {
            let width = (m.len() as f64).sqrt() as usize;
            for (k, value) in m.iter_mut().enumerate() {
                let (r, c) = (k / width, k % width);
                // not symmetric, and large off the diagonal, so that pivoting exchanges rows
                *value = (1.0 + ((7 * e + 3 * r + 5 * c) % 11) as f64)
                    * if (r + c + e).is_multiple_of(3) { -10.0 } else { 1.0 };
            }
        };
        let mut lu = Lu::default();
        assert!(lu.factorise(&tree, fill).is_some());
        let n: usize = sizes.iter().sum();
        let firsts: Vec<usize> = sizes
            .iter()
            .scan(0, |at, s| {
                *at += s;
                Some(*at - s)
            })
            .collect();
        let mut dense = vec![vec![0.0; n]; n];
        (0..n).for_each(|k| dense[k][k] = 1.0);
        for (e, [a, b]) in elements.iter().enumerate() {
            let mut places: Vec<usize> = (firsts[*a]..firsts[*a] + sizes[*a]).collect();
            if a != b {
                places.extend(firsts[*b]..firsts[*b] + sizes[*b]);
            }
            let mut m = vec![0.0; places.len() * places.len()];
            fill(e, &mut m);
            for (r, pr) in places.iter().enumerate() {
                for (c, pc) in places.iter().enumerate() {
                    dense[*pr][*pc] += m[r * places.len() + c];
                }
            }
        }
        let wanted: Vec<f64> = (0..n).map(|k| 1.0 + (k % 5) as f64).collect();
        let mut x: Vec<f64> = dense.iter().map(|row| row.iter().zip(&wanted).map(|(a, x)| a * x).sum()).collect();
        lu.solve(&tree, &mut x);
        let off = x.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off:e}");
    }

    #[test]
    fn a_matrix_without_an_inverse_is_told() {
        let tree = Tree::new(vec![2], vec![[0, 0]]).unwrap();
        assert!(Lu::default().factorise(&tree, |_, m| m.copy_from_slice(&[-1.0, 1.0, 0.0, -1.0 + 0.0])).is_none());
    }
}
