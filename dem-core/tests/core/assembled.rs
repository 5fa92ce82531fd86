//! The assembled problem, with its matrix, is the matrix-free problem.

use crate::common::{self, pressed, solver};
use dem_core::contact::{BondFlow, Law, Local, LocalSolve};
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect, resized};
use dem_core::problem::assembled::{Assembled, AssemblyError, BlockMatrix, ContactRows, Parts};
use dem_core::problem::residual::residual;
use dem_core::problem::{Contact, ContactProblem, Nodes, Visitor};
use dem_core::solver::assembled::gauss_seidel;
use dem_core::solver::{ContactSolver, GaussSeidelSettings, SolveStatus, Staged};

fn settings(local: LocalSolve, tolerance: f64) -> GaussSeidelSettings {
    GaussSeidelSettings { local, tolerance, accept: tolerance, max_sweeps: 200_000, acceleration: 0 }
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    largest(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>())
}

/// Compares the relative velocities of all contacts with those from the nodes: rows n, t and m in
/// the whole frame of each contact, with the bias of its law.
struct Velocities<'a> {
    assembled: &'a [f64],
    size: usize,
    scale: f64,
    contact: usize,
    /// Square of the natural maps and of the reactions.
    map: f64,
    reaction: f64,
}

impl<D: Dim> Visitor<D> for Velocities<'_> {
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let link = c.link.whole();
        let seen: Local<L::T, L::B> = nodes.relative_velocity(&c.link, c.law.arms());
        let map = c.law.natural_map(c.r, seen);
        self.map += map.dot(&map);
        self.reaction += c.r.dot(&c.r);
        let mut rows = nodes.relative_velocity::<D::Tangent, D::Moment>(&link, c.law.arms());
        let bias = c.law.bias();
        rows += Local { n: bias.n, t: resized(bias.t), m: resized(bias.m) };
        let compliance = c.law.compliance();
        assert_eq!(compliance.n, 0.0, "these problems are rigid");
        let mut expected = vec![rows.n];
        let has = |there: bool, rows: &[f64]| rows.iter().map(|x| if there { *x } else { 0.0 }).collect::<Vec<_>>();
        expected.extend(has(L::T::LEN > 0, rows.t.as_slice()));
        expected.extend(has(L::B::LEN > 0, rows.m.as_slice()));
        expected.truncate(self.size);
        let found = &self.assembled[self.contact * self.size..][..self.size];
        let off = difference(found, &expected);
        assert!(off <= 1e-12 * self.scale, "contact {}: {found:?} against {expected:?}", self.contact);
        // the tangential part as sweeps see it: in 3D a vector
        assert!((seen.n + bias.n - rows.n).abs() <= 1e-12 * self.scale);
        if L::T::LEN > 0 {
            assert!((seen.t.norm() - rows.t.norm()).abs() <= 1e-12 * self.scale);
        }
        self.contact += 1;
    }
}

/// One problem both ways, after some sweeps: u of every contact from the nodes and from W, and both
/// residuals.
fn same<D: Dim>(mut problem: ContactProblem<D>) {
    problem.velocities_from_reactions();
    let walls = problem.nodes.drives.iter().any(|d| d.norm() > 0.0);
    assert!(walls, "a wall is driven by a force");
    for _ in 0..5 {
        dem_core::solver::sweep(&mut problem, LocalSolve::Exact);
        let assembled = Assembled::of(&problem);
        let u = assembled.velocities();
        let (size, scale) = (assembled.parts().rows.count(), largest(&u));
        let mut seen = Velocities { assembled: &u, size, scale, contact: 0, map: 0.0, reaction: 0.0 };
        problem.visit(&mut seen);
        assert_eq!(seen.contact, assembled.len());
        let (a, b) = (residual(&problem), assembled.residual());
        // by definition and by the matrix: the wall is driven along its normal, so that its blocks
        // are exact
        let defined = seen.map.sqrt() / seen.reaction.sqrt().max(problem.applied);
        assert!(a > 0.0 && (a - defined).abs() <= 1e-12 * a + 1e-15, "{a:e} and {defined:e}");
        assert!((a - b).abs() <= 1e-9 * a + 1e-15, "{a:e} and {b:e}");
    }
}

#[test]
fn velocities_and_residual_are_those_of_the_nodes() {
    for flow in [None, Some(BondFlow::Associated), Some(BondFlow::Bipotential)] {
        same(pressed::<D2>(1, 6, 0.3, flow).contact_problem());
        same(pressed::<D3>(1, 3, 0.3, flow).contact_problem());
        same(pressed::<D3Twist>(1, 3, 0.3, flow).contact_problem());
        same(pressed::<D2>(2, 6, 0.0, flow).contact_problem());
    }
}

#[test]
fn gauss_seidel_finds_the_same_velocities() {
    for flow in [None, Some(BondFlow::Associated)] {
        let problem = pressed::<D2>(3, 3, 0.3, flow).contact_problem();
        let mut free = problem.clone();
        let report = solver(1e-9).build::<D2>().solve(&mut free);
        assert_eq!(report.status, SolveStatus::Converged);
        let expected = Assembled::of(&free).velocities();
        for local in [LocalSolve::Exact, LocalSolve::PredictorCorrector] {
            let mut assembled = Assembled::of(&problem);
            let report = gauss_seidel(&mut assembled, &settings(local, 1e-9));
            assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
            assert!(assembled.siconos_error() <= 1e-6, "{:e}", assembled.siconos_error());
            let distance = difference(&assembled.velocities(), &expected);
            assert!(distance <= 1e-6 * largest(&expected), "{flow:?} {local:?}: {distance:e}");
        }
    }
}

#[test]
fn newton_finds_the_same_velocities() {
    for (flow, mu) in [(None, 0.3), (None, 0.0), (Some(BondFlow::Associated), 0.0)] {
        newton_is_newton(pressed::<D2>(0, 5, mu, flow).contact_problem(), 1e-10);
        newton_is_newton(pressed::<D3>(0, 3, mu, flow).contact_problem(), 1e-10);
    }
    // with twist rows a residual of 1e-10 leaves larger velocities
    let mut twisting = pressed::<D3Twist>(0, 3, 0.0, Some(BondFlow::Associated));
    newton_is_newton(twisting.contact_problem(), 1e-11);
}

/// Newton on the matrix and on the bodies, from a cold start to the stiff limit.
fn newton_is_newton<D: Dim>(mut problem: ContactProblem<D>, tolerance: f64) {
    let settings = common::newton(tolerance, tolerance, 1e-6);
    let mut assembled = Assembled::of(&problem);
    let report = Staged::new(settings).solve_assembled(&mut assembled);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    let report = Staged::new(settings).solve(&mut problem);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    if assembled.parts().associated.iter().all(|a| *a) {
        let expected = Assembled::of(&problem).velocities();
        let distance = difference(&assembled.velocities(), &expected);
        assert!(distance <= 1e-7 * largest(&expected), "{distance:e}");
    }
}

fn parts() -> Parts {
    let entries = [(0, 0, 2.0), (1, 1, 6.0), (0, 1, 0.5), (1, 0, 0.5)];
    Parts {
        rows: ContactRows { tangents: 1, moments: 0 },
        matrix: BlockMatrix::from_entries(1, 2, &entries),
        q: vec![-1.0, 3.0],
        mu: vec![0.3],
        nu: vec![0.0],
        xi: vec![0.0],
        associated: vec![false],
        shift: vec![0.0],
        applied: 0.0,
    }
}

#[test]
fn a_block_of_another_code_is_solved() {
    let mut problem = Assembled::new(parts()).unwrap();
    let report = gauss_seidel(&mut problem, &settings(LocalSolve::Exact, 1e-12));
    assert_eq!(report.status, SolveStatus::Converged);
    // it slips: r_t = −μ r_n and 2 r_n + 0.5 r_t = 1
    let n = 1.0 / (2.0 - 0.15);
    let [n_error, t_error] = [problem.r[0] - n, problem.r[1] + 0.3 * n];
    assert!(n_error.abs() <= 1e-11 && t_error.abs() <= 1e-11, "{:?}", problem.r);
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let wrong = |change: fn(&mut Parts)| {
        let mut parts = parts();
        change(&mut parts);
        Assembled::new(parts).unwrap_err()
    };
    assert!(matches!(wrong(|p| p.q.push(0.0)), AssemblyError::Length { array: "q", found: 3, expected: 2 }));
    assert!(matches!(wrong(|p| p.mu[0] = -0.1), AssemblyError::Value { array: "mu", index: 0, .. }));
    assert!(matches!(wrong(|p| p.q[1] = f64::NAN), AssemblyError::Value { array: "q", index: 1, .. }));
    let skew = wrong(|p| p.matrix = BlockMatrix::from_entries(1, 2, &[(0, 0, 2.0), (0, 1, 0.5)]));
    assert!(matches!(skew, AssemblyError::Asymmetric { row: 0, column: 1, .. }), "{skew}");
}

#[test]
fn entries_of_one_place_add_up() {
    let matrix = BlockMatrix::from_entries(2, 2, &[(0, 0, 1.0), (0, 3, 2.0), (0, 0, 0.5)]);
    assert_eq!(matrix.entries(), [(0, 0, 1.5), (0, 3, 2.0)]);
    assert_eq!(matrix.diagonal(1), [0.0; 4]);
}
