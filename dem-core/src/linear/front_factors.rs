//! The factors of one front, and triangular solves with them.

use super::dense::{Tiles, in_chunks};
use super::front_values::Kind;
use super::tree::Front;

/// Rows of a large front that one task of a triangular solve updates.
pub(super) const ROWS: usize = 256;
/// Columns of a large front whose products with a vector one task computes.
const PRODUCTS: usize = 16;

/// The factors of a front with n unknowns, of which p are pivots.
#[derive(Clone, Debug, Default)]
pub(super) struct FrontFactors {
    pub kind: Kind,
    /// Columns of the pivots (n each): L and U of the pivots, L of the border below; L alone if
    /// symmetric.
    pub columns: Vec<f64>,
    /// U of the border: rows of the pivots in the columns of the border (p each); none if
    /// symmetric.
    pub across: Vec<f64>,
    /// Rows of the front in the order in which they became pivots; none if symmetric.
    pub rows: Vec<usize>,
}

impl FrontFactors {
    /// x ← L⁻¹ x for the unknowns of a front.
    pub fn forward(&self, front: &Front, x: &mut [f64], line: &mut Vec<f64>) {
        let (n, p) = (front.unknowns.len(), front.pivots);
        line.clear();
        match self.kind {
            Kind::Symmetric => line.extend(front.unknowns.iter().map(|at| x[*at])),
            Kind::General => {
                line.extend(self.rows.iter().map(|row| x[front.unknowns[*row]]));
                line.extend(front.unknowns[p..].iter().map(|at| x[*at]));
            }
        }
        let panel = Tiles::of(n).panel;
        for first in (0..p).step_by(panel) {
            let last = (first + panel).min(p);
            let columns = &self.columns[first * n..last * n];
            for (c, column) in (first..last).zip(columns.chunks_exact(n)) {
                if self.kind == Kind::Symmetric {
                    line[c] /= column[c];
                }
                let value = line[c];
                line[c + 1..last].iter_mut().zip(&column[c + 1..]).for_each(|(x, l)| *x -= l * value);
            }
            let (above, below) = line.split_at_mut(last);
            in_chunks(below, ROWS, |k, rows| {
                let columns = columns.chunks_exact(n).map(|column| &column[last + k * ROWS..]);
                subtract(rows, above[first..].iter().zip(columns));
            });
        }
        front.unknowns.iter().zip(&*line).for_each(|(at, value)| x[*at] = *value);
    }

    /// x ← U⁻¹ x (L⁻ᵀ x if symmetric) for the pivots of a front.
    pub fn backward(&self, front: &Front, x: &mut [f64], line: &mut Vec<f64>) {
        line.clear();
        line.extend(front.unknowns.iter().map(|at| x[*at]));
        match self.kind {
            Kind::Symmetric => self.backward_by_columns(front.pivots, line),
            Kind::General => self.backward_by_rows(front.pivots, line),
        }
        front.unknowns[..front.pivots].iter().zip(&*line).for_each(|(at, value)| x[*at] = *value);
    }

    /// x ← L⁻ᵀ x.
    fn backward_by_columns(&self, p: usize, x: &mut [f64]) {
        let n = x.len();
        let panel = Tiles::of(n).panel;
        for first in (0..p).step_by(panel).rev() {
            let last = (first + panel).min(p);
            let columns = &self.columns[first * n..last * n];
            let (own, below) = x[first..].split_at_mut(last - first);
            in_chunks(own, if n > panel { PRODUCTS } else { panel }, |k, own| {
                let columns = columns[k * PRODUCTS * n..].chunks_exact(n);
                own.iter_mut().zip(columns).for_each(|(x, column)| *x -= product(&column[last..], below));
            });
            for (c, column) in columns.chunks_exact(n).enumerate().rev() {
                let (value, later) = own[c..].split_first_mut().expect("c is a place in own");
                *value = (*value - product(&column[first + c + 1..], later)) / column[first + c];
            }
        }
    }

    /// x ← U⁻¹ x.
    fn backward_by_rows(&self, p: usize, x: &mut [f64]) {
        let n = x.len();
        let (own, border) = x.split_at_mut(p);
        let panel = Tiles::of(n).panel;
        in_chunks(own, ROWS, |k, rows| {
            let columns = self.across.chunks_exact(p.max(1)).map(|column| &column[k * ROWS..]);
            subtract(rows, border.iter().zip(columns));
        });
        for first in (0..p).step_by(panel).rev() {
            let last = (first + panel).min(p);
            let columns = &self.columns[first * n..last * n];
            let (above, own) = own[..last].split_at_mut(first);
            for (c, column) in columns.chunks_exact(n).enumerate().rev() {
                let value = own[c] / column[first + c];
                own[c] = value;
                own[..c].iter_mut().zip(&column[first..]).for_each(|(x, u)| *x -= u * value);
            }
            in_chunks(above, ROWS, |k, rows| {
                let columns = columns.chunks_exact(n).map(|column| &column[k * ROWS..]);
                subtract(rows, own.iter().zip(columns).rev());
            });
        }
    }
}

/// x ← x − Σ value column, in the order of the columns. Four columns at once read and write x less
/// often; the result has the same bits.
fn subtract<'a>(x: &mut [f64], mut columns: impl Iterator<Item = (&'a f64, &'a [f64])>) {
    let length = x.len();
    while let Some(first) = columns.next() {
        match [Some(first), columns.next(), columns.next(), columns.next()] {
            [Some((a, p)), Some((b, q)), Some((c, r)), Some((d, s))] => {
                let (p, q, r, s) = (&p[..length], &q[..length], &r[..length], &s[..length]);
                for (k, x) in x.iter_mut().enumerate() {
                    *x = *x - p[k] * a - q[k] * b - r[k] * c - s[k] * d;
                }
            }
            last => {
                for (value, column) in last.into_iter().flatten() {
                    x.iter_mut().zip(column).for_each(|(x, l)| *x -= l * value);
                }
            }
        }
    }
}

/// a · b over the length of the shorter list, in eight sums.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len().min(b.len());
    let (a, b) = (a[..length].chunks_exact(8), b[..length].chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 8];
    for (a, b) in a.zip(b) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum::<f64>() + rest
}
