//! GMRES, preconditioned from the right (Saad & Schultz 1986), for a matrix that its preconditioner nearly inverts.
//!
//! From the right, so that what it makes small is the residual itself: seen through the inverse of a matrix that is as
//! badly conditioned as the penalty makes it, a large residual looks small.

/// How a linear solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Krylov {
    /// Iterations made.
    pub iterations: usize,
    /// Norm of the residual over that of the right-hand side.
    pub residual: f64,
    /// The same for the preconditioned right-hand side in place of the solution.
    pub plain: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn axpy(k: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += k * x);
}

/// Iterations whose rate tells whether the solve will end in time.
const FORECAST: usize = 4;

/// Solve A x = b from x = 0 up to `tolerance`, in at most `most` iterations, or with a `forecast` in fewer where those will not do; `apply` is x ← A x, `precondition` its
/// approximate inverse.
pub(super) fn gmres(
    b: &[f64],
    tolerance: f64,
    most: usize,
    forecast: bool,
    mut apply: impl FnMut(&[f64], &mut [f64]),
    precondition: impl Fn(&mut [f64]),
) -> (Vec<f64>, Krylov) {
    let n = b.len();
    let mut first = b.to_vec();
    let norm = dot(&first, &first).sqrt();
    if norm == 0.0 {
        return (vec![0.0; n], Krylov { iterations: 0, residual: 0.0, plain: 0.0 });
    }
    first.iter_mut().for_each(|x| *x /= norm);
    let mut basis = vec![first];
    let mut preconditioned: Vec<Vec<f64>> = Vec::new();
    // columns of the upper triangle, the Givens rotations that made it, and the rotated right-hand side
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut rotations: Vec<(f64, f64)> = Vec::new();
    let mut rhs = vec![norm];
    let (mut residual, mut plain) = (1.0, f64::INFINITY);
    while columns.len() < most && residual > tolerance {
        // at the rate so far
        let made = columns.len();
        if forecast && made >= FORECAST && residual.powf(most as f64 / made as f64) > tolerance {
            break;
        }
        let mut z = basis[columns.len()].clone();
        precondition(&mut z);
        let mut w = vec![0.0; n];
        apply(&z, &mut w);
        preconditioned.push(z);
        let mut column = Vec::with_capacity(basis.len() + 1);
        for v in &basis {
            let h = dot(v, &w);
            axpy(-h, v, &mut w);
            column.push(h);
        }
        let last = dot(&w, &w).sqrt();
        if columns.is_empty() {
            plain = (1.0 - column[0]).hypot(last);
        }
        for (k, (c, s)) in rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            (column[k], column[k + 1]) = (c * a + s * b, c * b - s * a);
        }
        let k = columns.len();
        let length = column[k].hypot(last);
        if length == 0.0 {
            break;
        }
        let (c, s) = (column[k] / length, last / length);
        column[k] = length;
        rotations.push((c, s));
        columns.push(column);
        rhs.push(-s * rhs[k]);
        rhs[k] *= c;
        residual = (rhs[k + 1] / norm).abs();
        if last == 0.0 {
            break;
        }
        w.iter_mut().for_each(|x| *x /= last);
        basis.push(w);
    }
    (combine(&preconditioned, &columns, &rhs, n), Krylov { iterations: columns.len(), residual, plain })
}

/// Back substitution, and the combination of the basis.
fn combine(basis: &[Vec<f64>], columns: &[Vec<f64>], rhs: &[f64], n: usize) -> Vec<f64> {
    let m = columns.len();
    let mut y = rhs[..m].to_vec();
    for k in (0..m).rev() {
        y[k] /= columns[k][k];
        for row in 0..k {
            y[row] -= columns[k][row] * y[k];
        }
    }
    let mut x = vec![0.0; n];
    basis.iter().zip(&y).for_each(|(v, y)| axpy(*y, v, &mut x));
    x
}
