//! Small problems in 2D against Lemke's method: there the cones are polyhedral, and Coulomb's
//! problem is a linear complementarity problem w = M z + b ≥ 0 ⊥ z ≥ 0, which pivoting solves to
//! round-off, or ends on a ray.
//!
//! Source: Cottle, Pang & Stone, *The linear complementarity problem*, 1992, section 4.4 with the
//! lexicographic ratio test of section 4.9; friction as in Stewart & Trinkle, Int. J. Numer.
//! Methods Eng. 39, 1996.

use crate::common::newton;
use dem_core::problem::assembled::{Assembled, BlockMatrix, ContactRows, Parts};
use dem_core::solver::{SolveStatus, Staged, StagedSettings, Stages};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Rows of a contact: n, t, m.
const ROWS: usize = 3;
const TOLERANCE: f64 = 1e-10;
/// Problems of each kind.
const SEEDS: u64 = 70;
/// Relative difference of two ratios that counts as round-off, and the smallest pivot.
const TIE: f64 = 1e-10;
const PIVOT: f64 = 1e-9;

/// A solution z of w = M z + b ≥ 0 ⊥ z ≥ 0 by Lemke's method; none where it ends on a ray.
fn lemke(m: &DMatrix<f64>, b: &DVector<f64>) -> Option<DVector<f64>> {
    let n = b.len();
    // columns: b, then those of w (the inverse of the basis), of z, and of the artificial variable
    let artificial = 1 + 2 * n;
    let mut table = DMatrix::zeros(n, artificial + 1);
    table.column_mut(0).copy_from(b);
    table.view_mut((0, 1), (n, n)).fill_with_identity();
    table.view_mut((0, 1 + n), (n, n)).copy_from(&-m);
    table.column_mut(artificial).fill(-1.0);
    let mut basis: Vec<usize> = (1..=n).collect();
    let solution = |table: &DMatrix<f64>, basis: &[usize]| {
        let mut z = DVector::zeros(n);
        basis.iter().enumerate().filter(|(_, v)| **v > n).for_each(|(k, v)| z[v - 1 - n] = table[(k, 0)]);
        z
    };
    let mut row = b.imin();
    if b[row] >= 0.0 {
        return Some(DVector::zeros(n));
    }
    let mut entering = artificial;
    for _ in 0..50 * n {
        let pivot = table[(row, entering)];
        table.row_mut(row).scale_mut(1.0 / pivot);
        let own = table.row(row).clone_owned();
        for k in (0..n).filter(|k| *k != row) {
            let factor = -table[(k, entering)];
            table.row_mut(k).zip_apply(&own, |x, o| *x += factor * o);
        }
        let leaving = std::mem::replace(&mut basis[row], entering);
        if leaving == artificial {
            return Some(solution(&table, &basis));
        }
        // the complement of the variable that left enters
        entering = if leaving > n { leaving - n } else { leaving + n };
        // the least ratio, in lexicographic order of the columns of b and of w
        let before = |i: usize, j: usize| {
            let ratio = |k: usize, column: usize| table[(k, column)] / table[(k, entering)];
            let differ =
                (0..=n).map(|c| (ratio(i, c), ratio(j, c))).find(|(x, y)| (x - y).abs() > TIE * (1.0 + x.abs()));
            differ.is_some_and(|(x, y)| x < y)
        };
        let rows = (0..n).filter(|k| table[(*k, entering)] > PIVOT);
        row = rows.reduce(|best, k| if before(k, best) { k } else { best })?;
    }
    None
}

/// W.
fn matrix(problem: &Assembled) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(problem.r.len(), problem.r.len());
    problem.parts().matrix.entries().iter().for_each(|(i, j, w)| matrix[(*i, *j)] = *w);
    matrix
}

fn largest(x: impl Iterator<Item = f64>) -> f64 {
    x.fold(0.0, |most, x| most.max(x.abs()))
}

/// Reactions r̂ of a problem in 2D. A bond has the edges (1, ±μ, ±ν) of its cone as unknowns; a dry
/// contact r_n, both directions of r_t and its slip speed σ.
fn referee(problem: &Assembled) -> Option<Vec<f64>> {
    let (parts, rows) = (problem.parts(), problem.r.len());
    // r̂ = G z, and E the part of M that is not Gᵀ W G
    let (mut edges, mut beside) = (Vec::new(), Vec::new());
    for c in 0..problem.len() {
        let (mu, nu, first) = (parts.mu[c], parts.nu[c], edges.len());
        let mut edge = |n: f64, t: f64, m: f64| {
            let mut column = DVector::zeros(rows);
            column.rows_mut(c * ROWS, ROWS).copy_from_slice(&[n, t, m]);
            edges.push(column);
        };
        if parts.associated[c] {
            [(mu, nu), (mu, -nu), (-mu, nu), (-mu, -nu)].iter().for_each(|(t, m)| edge(1.0, *t, *m));
        } else {
            [(1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.0, 0.0)].iter().for_each(|(n, t)| edge(*n, *t, 0.0));
            let sigma = first + 3;
            beside.push((sigma, first, mu));
            beside.extend([1, 2].iter().flat_map(|k| [(first + k, sigma, 1.0), (sigma, first + k, -1.0)]));
        }
    }
    let edges = DMatrix::from_columns(&edges);
    let mut m = edges.transpose() * matrix(problem) * &edges;
    beside.iter().for_each(|(i, j, x)| m[(*i, *j)] += x);
    let z = lemke(&m, &(edges.transpose() * DVector::from_column_slice(&parts.q)))?;
    Some((edges * z).as_slice().to_vec())
}

/// The violation of the laws, evaluated as they are written, over the largest of the reactions and
/// the free velocities; masses are one.
fn violation(problem: &Assembled) -> f64 {
    let (parts, u) = (problem.parts(), problem.velocities());
    let size = largest(problem.r.iter().chain(&parts.q).copied());
    let mut most: f64 = 0.0;
    for c in 0..problem.len() {
        let ([rn, rt, rm], [un, ut, um]) =
            ([0, 1, 2].map(|k| problem.r[c * ROWS + k]), [0, 1, 2].map(|k| u[c * ROWS + k]));
        let (mu, nu) = (parts.mu[c], parts.nu[c]);
        let opening = if parts.associated[c] { un - mu * ut.abs() - nu * um.abs() } else { un };
        let slip = |r: f64, u: f64, slope: f64| r * u + slope * rn * u.abs();
        let products = (rn * opening).abs().max(slip(rt, ut, mu)).max(slip(rm, um, nu)) / size;
        most = most.max(-rn).max(rt.abs() - mu * rn).max(rm.abs() - nu * rn).max(-opening).max(products);
    }
    most / size
}

/// Disks of mass and inertia one that touch each other and the ground at random angles; a `share`
/// of the contacts are bonds. With a bias that no motion satisfies there may be no solution.
fn random(seed: u64, friction: f64, share: f64, bias: f64) -> Assembled {
    let mut rng = Pcg64::seed_from_u64(seed);
    let contacts = rng.random_range(2..=12);
    let bodies = rng.random_range(1..=contacts);
    let mut h = DMatrix::zeros(3 * bodies, ROWS * contacts);
    let (mut mu, mut nu, mut associated, mut shift) = (vec![], vec![], vec![], vec![]);
    for c in 0..contacts {
        let bonded = rng.random::<f64>() < share;
        let (sin, cos) = (std::f64::consts::TAU * rng.random::<f64>()).sin_cos();
        // the ground is the body after the last
        let first = rng.random_range(0..bodies);
        let second = (first + rng.random_range(1..=bodies)) % (bodies + 1);
        for (body, sign) in [(first, 1.0), (second, -1.0)].into_iter().filter(|(body, _)| *body < bodies) {
            let rolls = if bonded { sign } else { 0.0 };
            for (k, row) in
                [[sign * cos, sign * sin, 0.0], [-sign * sin, sign * cos, -0.5], [0.0, 0.0, rolls]].iter().enumerate()
            {
                h.view_mut((3 * body, ROWS * c + k), (3, 1)).copy_from_slice(row);
            }
        }
        mu.push(friction * rng.random::<f64>());
        nu.push(if bonded { 0.2 * rng.random::<f64>() } else { 0.0 });
        shift.push(if bonded { rng.random::<f64>() } else { 0.0 });
        associated.push(bonded);
    }
    let w = h.transpose() * &h;
    let free = DVector::from_fn(3 * bodies, |_, _| 4.0 * rng.random::<f64>() - 2.0);
    let mut q = h.transpose() * free;
    for c in 0..contacts {
        q -= w.column(ROWS * c) * shift[c];
        q[ROWS * c] += bias * (2.0 * rng.random::<f64>() - 1.0);
    }
    let entries: Vec<_> =
        (0..w.nrows()).flat_map(|i| (0..w.ncols()).map(move |j| (i, j))).map(|(i, j)| (i, j, w[(i, j)])).collect();
    let matrix = BlockMatrix::from_entries(contacts, ROWS, &entries);
    let (rows, xi, q) = (ContactRows { tangents: 1, moments: 1 }, vec![0.0; contacts], q.as_slice().to_vec());
    Assembled::new(Parts { rows, matrix, q, mu, nu, xi, associated, shift, applied: 0.0 }).unwrap()
}

/// Numbers of problems: those compared with Lemke's solution; among them those with other
/// velocities, and of these the ones with a regular W; those that the solver missed; those that end
/// on a ray in Lemke's method and that the solver solved or refused.
#[derive(Debug, Default, PartialEq)]
struct Count {
    compared: usize,
    apart: usize,
    apart_regular: usize,
    missed: usize,
    ray_solved: usize,
    ray_refused: usize,
}

/// Whether W has no kernel over the rows that the contacts have: no reactions balance each other.
fn is_regular(problem: &Assembled) -> bool {
    let parts = problem.parts();
    let rows: Vec<usize> = (0..problem.r.len()).filter(|k| k % ROWS < 2 || parts.associated[k / ROWS]).collect();
    let whole = matrix(problem);
    let eigenvalues =
        DMatrix::from_fn(rows.len(), rows.len(), |i, j| whole[(rows[i], rows[j])]).symmetric_eigenvalues();
    eigenvalues.min() > 1e-6 * eigenvalues.max()
}

fn compare(friction: f64, share: f64, bias: f64) -> Count {
    let settings = StagedSettings { stages: Stages::Interior, ..newton(TOLERANCE, TOLERANCE, 1e-6) };
    let mut count = Count::default();
    for seed in 0..SEEDS {
        let mut problem = random(seed, friction, share, bias);
        let expected = referee(&problem).map(|r| {
            let mut exact = problem.clone();
            exact.r = r;
            let (wrong, residual, velocity) = (violation(&exact), exact.residual(), exact.velocity_error());
            assert!(wrong.max(residual) <= 1e-9, "seed {seed}: Lemke's solution is off by {wrong:e}, {residual:e}");
            assert!(velocity <= 1e-6, "seed {seed}: Lemke's velocities are off by {velocity:e}");
            exact.velocities()
        });
        let report = Staged::new(settings).solve_assembled(&mut problem);
        let solved = report.status != SolveStatus::Failed && problem.velocity_error() <= 1e-5;
        let wrong = violation(&problem);
        assert!(!solved || wrong <= 1e-9, "seed {seed}: {report:?}, and the laws are violated by {wrong:e}");
        match (expected, solved) {
            (Some(expected), true) => {
                let apart = largest(expected.iter().zip(problem.velocities()).map(|(a, b)| a - b));
                let differ = apart > 1e-5 * largest(problem.parts().q.iter().copied());
                count.compared += 1;
                count.apart += usize::from(differ);
                count.apart_regular += usize::from(differ && is_regular(&problem));
            }
            (Some(_), false) => count.missed += 1,
            (None, true) => count.ray_solved += 1,
            (None, false) => count.ray_refused += 1,
        }
    }
    count
}

/// Velocities are unique if all flows are associated or there is no friction.
#[test]
fn velocities_of_convex_problems_are_lemkes() {
    for (friction, share) in [(0.0, 0.0), (1.5, 1.0)] {
        let count = compare(friction, share, 0.0);
        assert_eq!(count, Count { compared: SEEDS as usize, ..Count::default() }, "friction {friction}");
    }
}

/// For Coulomb friction with a regular W the velocities do not depend on the method. Where
/// reactions can balance each other, a fifth of the dry problems have several solutions: both
/// methods then reach residuals of round-off, with different velocities. One dry problem of eight
/// contacts is solved to 1e-8 only.
#[test]
fn coulomb_problems_are_solved_where_lemke_solves_them() {
    for (friction, share) in [(0.05, 0.0), (0.3, 0.0), (0.3, 0.5), (1.5, 0.0), (1.5, 0.5)] {
        let count = compare(friction, share, 0.0);
        assert_eq!(
            (count.apart_regular, count.ray_solved, count.ray_refused),
            (0, 0, 0),
            "friction {friction}: {count:?}"
        );
        assert!(count.missed <= 1, "friction {friction}: {count:?}");
    }
}

/// With biases that no motion satisfies, Lemke's method ends on a ray in up to half of the
/// problems; for convex problems this proves that no solution exists. The solver refuses all of
/// them: reactions grow, the residual falls, and the velocity error stays at a hundredth or more.
#[test]
fn what_lemke_leaves_on_a_ray_is_refused() {
    for (friction, share) in [(0.0, 0.0), (1.5, 1.0), (0.3, 0.5), (1.5, 0.0), (1.5, 0.5)] {
        let count = compare(friction, share, 1.0);
        assert!(count.ray_refused > 0, "friction {friction}: {count:?}");
        assert_eq!((count.ray_solved, count.missed, count.apart_regular), (0, 0, 0), "friction {friction}: {count:?}");
    }
}
