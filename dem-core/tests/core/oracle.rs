//! The convex problems against an interior-point method: without friction, or with associated bonds
//! only.
//!
//! minimise ½ r̂·W r̂ + q·r̂ over the cones; K = { ‖t‖ ≤ μ n, ‖m‖ ≤ ν n, |τ| ≤ ξ n } consists of
//! second-order cones on the same n.

use crate::common::{self, pressed, solver};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{self, NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver};
use dem_core::contact::BondFlow;
use dem_core::dim::{D2, D3, D3Twist, Dim};
use dem_core::problem::ContactProblem;
use dem_core::problem::assembled::Assembled;
use dem_core::solver::{SolveStatus, SolverSettings};
use nalgebra::{DMatrix, SymmetricEigen};

/// L with W = L Lᵀ, one row for each row of W.
fn root(problem: &Assembled) -> DMatrix<f64> {
    let n = problem.r.len();
    let mut dense = DMatrix::zeros(n, n);
    for (row, column, w) in problem.parts().matrix.entries() {
        dense[(row, column)] = w;
    }
    let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(dense);
    let least = 1e-13 * eigenvalues.max();
    let kept: Vec<usize> = (0..n).filter(|k| eigenvalues[*k] > least).collect();
    DMatrix::from_fn(n, kept.len(), |row, k| eigenvectors[(row, kept[k])] * eigenvalues[kept[k]].sqrt())
}

/// Reactions by Clarabel, with y = Lᵀ r̂ as additional unknowns: minimise ½ y·y + q·r̂.
fn interior_point(problem: &Assembled) -> Vec<f64> {
    let parts = problem.parts();
    let (rows, size, n) = (parts.rows, parts.rows.count(), problem.r.len());
    let bends = rows.moments.min(rows.tangents);
    let twists = rows.moments - bends;
    let root = root(problem);
    let unknowns = n + root.ncols();
    let ones: Vec<usize> = (n..unknowns).collect();
    let weights = CscMatrix::new_from_triplets(unknowns, unknowns, ones.clone(), ones.clone(), vec![1.0; root.ncols()]);
    let costs: Vec<f64> = parts.q.iter().copied().chain(ones.iter().map(|_| 0.0)).collect();
    // s = −A x ∈ cone: (row, unknown, factor)
    let mut list: Vec<(usize, usize, f64)> = Vec::new();
    for k in 0..root.ncols() {
        list.push((k, n + k, 1.0));
        list.extend((0..n).map(|row| (k, row, -root[(row, k)])));
    }
    // rows that a contact lacks
    let present = |unknown: usize| parts.matrix.diagonal(unknown / size)[(unknown % size) * (size + 1)] > 0.0;
    let absent: Vec<usize> = (0..n).filter(|unknown| !present(*unknown)).collect();
    list.extend(absent.iter().enumerate().map(|(k, unknown)| (root.ncols() + k, *unknown, 1.0)));
    let mut height = root.ncols() + absent.len();
    let mut cones: Vec<SupportedConeT<f64>> = vec![ZeroConeT(height)];
    for c in 0..problem.len() {
        let cone = problem.cone(c);
        list.push((height, c * size, -1.0));
        cones.push(NonnegativeConeT(1));
        height += 1;
        let after = 1 + rows.tangents;
        for (coefficient, first, count) in
            [(cone.mu, 1, rows.tangents), (cone.nu, after, bends), (cone.xi, after + bends, twists)]
        {
            let group: Vec<usize> = (0..count).map(|k| c * size + first + k).filter(|v| present(*v)).collect();
            if !group.is_empty() {
                list.push((height, c * size, -coefficient));
                list.extend(group.iter().enumerate().map(|(k, unknown)| (height + 1 + k, *unknown, -1.0)));
                cones.push(SecondOrderConeT(1 + group.len()));
                height += 1 + group.len();
            }
        }
    }
    let (at, factors): (Vec<(usize, usize)>, Vec<f64>) = list.into_iter().map(|(i, j, x)| ((i, j), x)).unzip();
    let (i, j) = at.into_iter().unzip();
    let constraint = CscMatrix::new_from_triplets(height, unknowns, i, j, factors);
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(200)
        .tol_gap_abs(1e-14)
        .tol_gap_rel(1e-14)
        .tol_feas(1e-13)
        .build()
        .unwrap();
    let bounds = vec![0.0; height];
    let mut solver = DefaultSolver::new(&weights, &costs, &constraint, &bounds, &cones, settings).unwrap();
    solver.solve();
    solver.solution.x[..n].to_vec()
}

fn newton() -> SolverSettings {
    SolverSettings::Staged(common::newton(1e-11, 1e-11, 1e-6))
}

/// Largest difference of the relative velocities, over the largest of them.
fn apart<D: Dim>(mut problem: ContactProblem<D>, settings: SolverSettings) -> f64 {
    let mut oracle = Assembled::of(&problem);
    assert!(oracle.parts().associated.iter().all(|a| *a), "the problem is not convex");
    oracle.r = interior_point(&oracle);
    assert!(oracle.residual() <= 1e-10, "the oracle is off: {:e}", oracle.residual());
    let expected = oracle.velocities();
    let report = settings.build::<D>().solve(&mut problem);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    let found = Assembled::of(&problem).velocities();
    let scale = expected.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
    expected.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale
}

#[test]
fn associated_bonds_agree() {
    let flow = Some(BondFlow::Associated);
    for seed in 0..3 {
        let plane = pressed::<D2>(seed, 5, 0.0, flow).contact_problem();
        assert!(!plane.bonded.is_empty() && plane.dry.is_empty());
        for settings in [newton(), solver(1e-11)] {
            let distance = apart(plane.clone(), settings);
            assert!(distance <= 1e-7, "2D, seed {seed}, {settings:?}: {distance:e}");
        }
    }
    for seed in 0..3 {
        let distance = apart(pressed::<D3>(seed, 3, 0.0, flow).contact_problem(), newton());
        assert!(distance <= 1e-7, "3D, seed {seed}: {distance:e}");
    }
    // seeds of problems with bonds at the twist limit that the oracle also solves
    for seed in [0, 3, 5, 6, 7] {
        let problem = pressed::<D3Twist>(seed, 3, 0.0, flow).contact_problem();
        let distance = apart(problem, newton());
        assert!(distance <= 1e-7, "3D with twist, seed {seed}: {distance:e}");
    }
}

#[test]
fn contacts_without_friction_agree() {
    for seed in 0..3 {
        for settings in [newton(), solver(1e-11)] {
            let plane = apart(pressed::<D2>(seed, 6, 0.0, None).contact_problem(), settings);
            let space = apart(pressed::<D3>(seed, 4, 0.0, None).contact_problem(), settings);
            assert!(plane <= 1e-7 && space <= 1e-7, "seed {seed}, {settings:?}: {plane:e}, {space:e}");
        }
    }
}
