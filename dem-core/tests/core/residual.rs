//! The residual of a pair of grains against its definition: its scale, and the round-off below
//! which it is zero.

use crate::common::{grain, settings, world};
use dem_core::bond::Stiffness;
use dem_core::contact::Law;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::problem::ContactProblem;
use dem_core::problem::assembled::{Assembled, BlockMatrix, ContactRows, Parts};
use dem_core::problem::residual::{residual, velocity_error};

const MU: f64 = 0.3;
/// Normal impulse (N s), so large that the contact sticks.
const PUSH: f64 = 1e3;

/// Two grains that touch, the second three times as large, at these velocities (m/s) along their
/// line and spins (rad/s).
fn pair<D: Dim>(speeds: [f64; 2], spins: [f64; 2]) -> ContactProblem<D> {
    let mut second = vec![0.0; D::N];
    second[0] = 0.04;
    let mut w = world(vec![grain::<D>(&vec![0.0; D::N], 0.01), grain(&second, 0.03)], vec![], settings(1e-3));
    w.settings.friction = MU;
    let mut problem = w.contact_problem();
    assert_eq!((problem.len(), problem.dry.len()), (1, 1));
    for (node, (speed, spin)) in problem.nodes.all.iter_mut().zip(speeds.into_iter().zip(spins)) {
        node.velocity[0] = speed;
        node.spin[D::Spin::LEN - 1] = spin;
    }
    problem.dry[0].r.n = PUSH;
    problem
}

fn definition<D: Dim>() {
    // the first grain moves along the normal, away from the second, at 0.1 m/s: the map is γ u_n,
    // whatever the applied load
    let mut problem = pair::<D>([-0.1, 0.0], [0.0; 2]);
    let gamma = problem.dry[0].law.gamma();
    for (applied, scale) in [(0.0, PUSH), (0.5 * PUSH, PUSH), (7.0 * PUSH, 7.0 * PUSH)] {
        problem.applied = applied;
        let (found, expected) = (residual(&problem), gamma * 0.1 / scale);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found:e} against {expected:e}");
    }
    // they slip by 0.01 × 20 + 0.03 × 10 m/s: γ (μ |u_t|, u_t)
    let problem = pair::<D>([0.0; 2], [20.0, 10.0]);
    let (found, expected) = (residual(&problem), gamma * 0.5 * (1.0 + MU * MU).sqrt() / PUSH);
    assert!((found / expected - 1.0).abs() < 1e-9, "{found:e} against {expected:e}");
}

/// A map of half the round-off threshold counts as zero, a map of twice the threshold does not.
fn rounding<D: Dim>() {
    const ROUNDING: f64 = 64.0 * f64::EPSILON;
    let gamma = pair::<D>([0.0; 2], [0.0; 2]).dry[0].law.gamma();
    for (share, counts) in [(0.5, false), (2.0, true)] {
        // both at 3 m/s but for a small difference: the round-off scale of the map is √2 × 3 m/s
        let part = share * ROUNDING * 2f64.sqrt() * 3.0;
        let found = residual(&pair::<D>([3.0 - part, 3.0], [0.0; 2]));
        assert_eq!(found > 0.0, counts, "{share}: {found:e}");
        // rolling on each other but for a small slip: the scale is √2 × 0.01 × 900 m/s
        let part = share * ROUNDING * 2f64.sqrt() * 9.0 / (1.0 + MU * MU).sqrt();
        let found = residual(&pair::<D>([0.0; 2], [900.0, -300.0 + part / 0.03]));
        assert_eq!(found > 0.0, counts, "{share}: {found:e}");
        if counts {
            assert!((found / (gamma * share * ROUNDING * 2f64.sqrt() * 9.0 / PUSH) - 1.0).abs() < 0.1, "{found:e}");
        }
    }
}

#[test]
fn the_residual_is_the_natural_map_over_the_larger_of_reactions_and_load() {
    definition::<D2>();
    definition::<D3>();
}

/// Beyond some ten thousand contacts sums are made in parts. The residual of many equal contacts is
/// that of one.
#[test]
fn a_sum_in_parts_is_that_of_its_contacts() {
    let one = pair::<D2>([-0.1, 0.0], [20.0, 10.0]);
    let mut many = one.clone();
    many.dry = vec![one.dry[0]; 100_000];
    let (expected, found) = (residual(&one), residual(&many));
    assert!((found / expected - 1.0).abs() < 1e-12, "{found:e} against {expected:e}");
    // round-off is relative to the velocities of all contacts
    let part = 32.0 * f64::EPSILON * 2f64.sqrt() * 3.0;
    let one = pair::<D2>([3.0 - part, 3.0], [0.0; 2]);
    let mut many = one.clone();
    many.dry = vec![one.dry[0]; 100_000];
    assert_eq!((residual(&one), residual(&many)), (0.0, 0.0));
}

#[test]
fn a_map_that_is_rounding_is_none() {
    rounding::<D2>();
    rounding::<D3>();
}

/// The grains of a pair bonded by a spring of compliance C separate. After a step without an
/// initial force the bond carries R, and u = −C R. In the next step, reactions ρ R make the
/// velocity −C R + w ρ R, with w = 1/m_i + 1/m_j; the law of the spring is u + C (ρ R − R) = 0.
/// Without reactions its left side is −2 C R, so the error is |ρ (1 + w/C) / 2 − 1|.
fn sprung<D: Dim>() {
    let (h, ratio) = (1e-3, 3.0);
    let mut second = vec![0.0; D::N];
    second[0] = 0.04;
    let mut w = world(vec![grain::<D>(&vec![0.0; D::N], 0.01), grain(&second, 0.03)], vec![], settings(h));
    w.grains.velocity[0][0] = -0.01;
    w.grains.velocity[1][0] = 0.02;
    w.form_bonds(1e-6, |_| 1e6, MU);
    let normal = ratio / (h * h * w.grains.mass.iter().map(|m| 1.0 / m).sum::<f64>());
    w.make_bonds_elastic(|_| Stiffness { normal, tangential: normal, rolling: normal, twist: normal });
    w.step().expect("a step");
    let mut problem = w.contact_problem();
    let carried = problem.elastic[0].law.carried().n;
    assert!(carried < 0.0 && problem.len() == 1, "{carried:e}");
    for rho in [0.0, 0.25, 0.5, 1.0, 3.0] {
        problem.elastic[0].r.n = rho * carried;
        problem.velocities_from_reactions();
        let (found, expected) = (velocity_error(&problem), f64::abs(rho * (1.0 + ratio) / 2.0 - 1.0));
        assert!((found - expected).abs() < 1e-9, "{rho}: {found:e} against {expected:e}");
    }
}

#[test]
fn the_velocity_error_of_a_spring_is_relative_to_what_its_force_would_leave() {
    sprung::<D2>();
    sprung::<D3>();
}

/// A grain at 1 mm/s towards one that it touches; a third comes at 10 mm/s and stays apart in the
/// step, by 5 mm/s over it.
#[test]
fn the_velocity_error_is_relative_to_velocities_that_must_change() {
    fn case<D: Dim>(speed: f64) -> ContactProblem<D> {
        let at = |x: f64| [vec![x], vec![0.0; D::N - 1]].concat();
        let grains = [0.0, 0.02, 0.04 + 2e-5].map(|x| grain::<D>(&at(x), 0.01));
        let mut w = world(grains.to_vec(), vec![], settings(1e-3));
        w.grains.velocity[0] = D::Vector::from_slice(&at(speed));
        w.grains.velocity[2] = D::Vector::from_slice(&at(-1e-2));
        let problem = w.contact_problem();
        assert_eq!((problem.len(), problem.dry.len()), (2, 2));
        problem
    }
    fn errors<D: Dim>() {
        let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        close(velocity_error(&case::<D>(1e-3)), 1.0);
        // they part: nothing must change, and a reaction between them is an error beside the other
        let mut apart = case::<D>(-1e-3);
        assert_eq!(velocity_error(&apart), 0.0);
        let push = 0.5 * apart.dry[0].law.gamma() * 1e-3;
        apart.dry[0].r.n = push;
        close(velocity_error(&apart), 0.5e-3 / 5e-3);
    }
    errors::<D2>();
    errors::<D3>();
}

/// One contact with its matrix: W = diag(w, w/2), q = −w r − `push` in the normal row, so that u_n
/// is −`push`.
fn assembled(w: f64, r: f64, push: f64, shift: f64, applied: f64) -> Assembled {
    let parts = Parts {
        rows: ContactRows { tangents: 1, moments: 0 },
        matrix: BlockMatrix::from_entries(1, 2, &[(0, 0, w), (1, 1, 0.5 * w)]),
        q: vec![-w * r - push, 0.0],
        mu: vec![MU],
        nu: vec![0.0],
        xi: vec![0.0],
        associated: vec![false],
        shift: vec![shift],
        applied,
    };
    let mut problem = Assembled::new(parts).expect("parts of a problem");
    problem.r[0] = r;
    problem
}

#[test]
fn with_its_matrix_the_residual_is_the_same_measure() {
    // reactions enter without their shift
    for (shift, applied, scale) in [(0.0, 0.0, 30.0), (12.0, 0.0, 18.0), (12.0, 70.0, 70.0)] {
        let (found, expected) = (assembled(0.1, 30.0, 0.2, shift, applied).residual(), 0.2 / 0.1 / scale);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found:e} against {expected:e}");
    }
    // the round-off scale is that of q and W r, which are opposite: √2 w r
    for (w, r) in [(0.1, 30.0), (7.0, 0.3)] {
        for (share, counts) in [(0.8, false), (1.25, true)] {
            let push = share * 64.0 * f64::EPSILON * 2f64.sqrt() * w * r;
            let found = assembled(w, r, push, 0.0, 0.0).residual();
            assert_eq!(found > 0.0, counts, "{w} {r} {share}: {found:e}");
        }
    }
}

#[test]
fn a_problem_without_contacts_is_empty() {
    let mut alone = world(vec![grain::<D2>(&[0.0, 0.0], 0.01)], vec![], settings(1e-3)).contact_problem();
    assert!(alone.is_empty() && alone.contact_bytes() == 0);
    alone.applied = 1.0;
    assert_eq!(residual(&alone), 0.0);
    let two = pair::<D2>([0.0; 2], [0.0; 2]);
    assert!(!two.is_empty() && two.contact_bytes() == size_of_val(&two.dry[0]));
}
