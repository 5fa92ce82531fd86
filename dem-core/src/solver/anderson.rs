//! Anderson's acceleration of a fixed-point iteration x ← g(x) (Anderson 1965; Walker & Ni, SIAM J.
//! Numer. Anal. 49, 2011).
//!
//! It stores the changes of the results g and of the residuals f = g − x over the last steps. The
//! combination of changes of f that is nearest to the present f is sought, and the same combination
//! of changes of g is subtracted from g. On a linear iteration this is GMRES. Gauss–Seidel is
//! linear while no contact changes its status; there the acceleration removes long-wave errors,
//! which sweeps alone reduce only by diffusion.

use crate::solver::tuning::INVISIBLE;
use nalgebra::{DMatrix, DVector};

/// The memory of an accelerated iteration.
pub(super) struct Anderson {
    depth: usize,
    /// The point that the iteration was last applied to.
    from: Vec<f64>,
    last: Option<Pair>,
    changes: Vec<Pair>,
    gram: Vec<Vec<f64>>,
    least: f64,
}

/// A result g and a residual f, or changes of them.
struct Pair {
    g: Vec<f64>,
    f: Vec<f64>,
}

/// Scalar product in eight partial sums: fast, and in a fixed order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (mut blocks_a, mut blocks_b) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut blocks_a).zip(&mut blocks_b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = blocks_a.remainder().iter().zip(blocks_b.remainder()).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

impl Anderson {
    /// A memory of `depth` steps for an iteration that starts from `from`.
    pub fn new(depth: usize, from: Vec<f64>) -> Self {
        Self { depth, from, last: None, changes: Vec::new(), gram: Vec::new(), least: f64::INFINITY }
    }

    /// The next point, for the result `g` of the iteration at the last one.
    pub fn next(&mut self, g: Vec<f64>) -> &[f64] {
        let f = minus(&g, &self.from);
        let size = dot(&f, &f);
        // twice the least residual so far, squared
        if size > 2.0 * 2.0 * self.least {
            self.last = None;
            self.changes.clear();
            self.gram.clear();
            self.least = f64::INFINITY;
        }
        self.least = self.least.min(size);
        if let Some(last) = self.last.take() {
            self.remember(Pair { g: minus(&g, &last.g), f: minus(&f, &last.f) });
        }
        self.from.clone_from(&g);
        if let Some(weights) = self.weights(&f) {
            for (weight, change) in weights.iter().zip(&self.changes) {
                self.from.iter_mut().zip(&change.g).for_each(|(x, d)| *x -= weight * d);
            }
        }
        self.last = Some(Pair { g, f });
        &self.from
    }

    fn remember(&mut self, change: Pair) {
        if self.changes.len() == self.depth {
            self.changes.remove(0);
            self.gram.remove(0);
            self.gram.iter_mut().for_each(|row| {
                row.remove(0);
            });
        }
        let mut row: Vec<f64> = self.changes.iter().map(|c| dot(&c.f, &change.f)).collect();
        row.push(dot(&change.f, &change.f));
        self.changes.push(change);
        self.gram.push(row);
    }

    /// Least-squares weights of the changes for the present residual `f`; none without changes.
    fn weights(&self, f: &[f64]) -> Option<DVector<f64>> {
        let k = self.changes.len();
        if k == 0 {
            return None;
        }
        // keeps the matrix positive definite if changes are nearly parallel
        let ridge = INVISIBLE * (0..k).map(|i| self.gram[i][i]).sum::<f64>();
        let entry = |i: usize, j: usize| self.gram[i.max(j)][i.min(j)] + if i == j { ridge } else { 0.0 };
        let right = DVector::from_iterator(k, self.changes.iter().map(|c| dot(&c.f, f)));
        Some(DMatrix::from_fn(k, k, entry).cholesky()?.solve(&right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_iteration_ends_in_as_many_steps_as_it_has_rates() {
        // x ← R x + b with four rates near one: without acceleration it takes thousands of steps
        let rates = [0.999, 0.99, 0.9, -0.5];
        let b = [1.0, 2.0, -3.0, 4.0];
        let apply = |x: &[f64]| (0..4).map(|k| rates[k] * x[k] + b[k]).collect::<Vec<_>>();
        let mut memory = Anderson::new(8, vec![0.0; 4]);
        let mut x = vec![0.0; 4];
        for _ in 0..12 {
            x = memory.next(apply(&x)).to_vec();
        }
        for k in 0..4 {
            assert!((x[k] * (1.0 - rates[k]) / b[k] - 1.0).abs() < 1e-6, "{x:?}");
        }
    }

    #[test]
    fn growth_makes_it_start_over() {
        let mut memory = Anderson::new(4, vec![0.0]);
        for g in [1.0, 1.5, 50.0] {
            memory.next(vec![g]);
        }
        assert!(memory.changes.is_empty());
    }
}
