//! The cone and the laws on it, at random points: projection by its defining inequalities, local
//! solves by their law.

use dem_core::contact::{Arms, Block, BondFlow, Bonded, Cone, Coulomb, Law, Local, LocalSolve, Weights};
use dem_core::dim::{Moments, V0, Vect};
use nalgebra::SVector;
use proptest::prelude::*;
use std::array::from_fn;
use std::f64::consts::TAU;

fn vect<const N: usize>() -> impl Strategy<Value = SVector<f64, N>> {
    prop::array::uniform(-1.0..1.0f64).prop_map(SVector::from)
}

fn local<T: Vect, B: Moments>(
    t: impl Strategy<Value = T>,
    m: impl Strategy<Value = B>,
) -> impl Strategy<Value = Local<T, B>> {
    (-1.0..1.0f64, t, m).prop_map(|(n, t, m)| Local { n, t, m })
}

fn cone() -> impl Strategy<Value = Cone> {
    (0.0..3.0f64, 0.0..3.0f64, 0.0..3.0f64).prop_map(|(mu, nu, xi)| Cone { mu, nu, xi })
}

/// Norm of the bending rows, which are at most two.
fn bending<T: Vect, B: Moments>(x: &Local<T, B>) -> f64 {
    x.m.as_slice().iter().take(2).map(|m| m * m).sum::<f64>().sqrt()
}

/// How far `x` is outside K, relative to its size.
fn outside<T: Vect, B: Moments>(k: Cone, x: &Local<T, B>) -> f64 {
    let twist = if B::LEN == 3 { x.m[2].abs() - k.xi * x.n } else { 0.0 };
    (-x.n).max(x.t.norm() - k.mu * x.n).max(bending(x) - k.nu * x.n).max(twist)
}

/// How far `y` is outside the polar cone { n ≤ −μ‖t‖ − ν‖m‖ − ξ|τ| }.
fn outside_polar<T: Vect, B: Moments>(k: Cone, y: &Local<T, B>) -> f64 {
    let twist = if B::LEN == 3 { k.xi * y.m[2].abs() } else { 0.0 };
    y.n + k.mu * y.t.norm() + k.nu * bending(y) + twist
}

/// Moreau: p = P_K(x) if and only if p ∈ K, x − p ∈ K°, p ⊥ x − p.
fn is_projection<T: Vect, B: Moments>(k: Cone, x: Local<T, B>) {
    let p = k.project(x);
    let rest = x - p;
    assert!(outside(k, &p) <= 1e-13, "{p:?} is outside the cone");
    assert!(outside_polar(k, &rest) <= 1e-12, "{rest:?} is outside the polar");
    assert!(p.dot(&rest).abs() <= 1e-12, "not orthogonal: {}", p.dot(&rest));
}

proptest! {
    #[test]
    fn projection_in_2d(k in cone(), x in local(vect::<1>(), vect::<1>())) { is_projection(k, x) }

    #[test]
    fn projection_in_3d(k in cone(), x in local(vect::<2>(), vect::<2>())) { is_projection(k, x) }

    #[test]
    fn projection_with_twist(k in cone(), x in local(vect::<2>(), vect::<3>())) { is_projection(k, x) }

    #[test]
    fn projection_without_bending(k in cone(), x in local(vect::<2>(), Just(V0::zeros()))) { is_projection(k, x) }

    /// Round-off puts a point of the edge, where one group of rows is at its limit, on either side
    /// of the cone: its projection is the point itself.
    #[test]
    fn a_point_on_the_edge_of_the_cone_is_its_own_projection(
        k in cone(), n in 0.1..1.0f64, share in 0.0..0.9f64, angle in 0.0..TAU, group in 0..3usize,
    ) {
        let shares: [f64; 3] = from_fn(|row| if row == group { 1.0 } else { share });
        let along = |size: f64| SVector::from([size * angle.cos(), size * angle.sin()]);
        let (t, m) = (along(shares[0] * k.mu * n), along(shares[1] * k.nu * n));
        let x = Local { n, t, m: SVector::from([m[0], m[1], shares[2] * k.xi * n]) };
        let moved = k.project(x) - x;
        prop_assert!(moved.dot(&moved).sqrt() <= 1e-14, "{moved:?}");
    }

    /// The minimiser of ½ Σ w r² + q·r over K: r ∈ K, w r + q ∈ K*, r ⊥ w r + q.
    #[test]
    fn minimisation(k in cone(), q in local(vect::<2>(), vect::<3>()), weights in prop::array::uniform4(0.1..10.0f64)) {
        let [n, t, m, w] = weights;
        let r = k.minimise(Weights { n, t, m, w }, q);
        let moments = SVector::from([m * r.m[0], m * r.m[1], w * r.m[2]]);
        let u = Local { n: n * r.n + q.n, t: r.t * t + q.t, m: moments + q.m };
        prop_assert!(outside(k, &r) <= 1e-12);
        prop_assert!(outside_polar(k, &(u * -1.0)) <= 1e-11);
        prop_assert!(r.dot(&u).abs() <= 1e-11);
    }

    /// The exact local solve of a dry contact satisfies the bipotential's fixed point, and
    /// predictor–corrector steps converge to it.
    #[test]
    fn dry_local_solves_agree(
        mu in 0.0..2.0f64, n in 0.3..3.0f64, t in 0.3..3.0f64,
        row in local(vect::<1>(), Just(V0::zeros())), vector in local(vect::<3>(), Just(V0::zeros())),
    ) {
        let block = Block { n, t, m: 1.0, w: 1.0, tm: 0.0 };
        dry_agree(block, mu, row);
        dry_agree(block, mu, vector);
    }

    /// The same for bonds of either flow, with t and m coupled as for grains of different size.
    #[test]
    fn bonded_local_solves_agree(
        k in prop::array::uniform3(0.05..1.5f64).prop_map(|[mu, nu, xi]| Cone { mu, nu, xi }),
        [n, t, m, w] in prop::array::uniform4(0.3..3.0f64), share in -0.7..0.7f64, shift in 0.0..1.0f64, bipotential: bool,
        q in local(vect::<2>(), vect::<3>()),
    ) {
        let tm = share * (t * m).sqrt();
        let flow = if bipotential { BondFlow::Bipotential } else { BondFlow::Associated };
        let block = Block { n, t, m, w, tm };
        let velocity = |r: Local<SVector<f64, 2>, SVector<f64, 3>>| {
            let bending = r.m.fixed_rows::<2>(0);
            let coupled = bending * m + r.t * tm;
            let moments = SVector::from([coupled[0], coupled[1], w * r.m[2]]);
            Local { n: n * r.n + q.n, t: r.t * t + bending * tm + q.t, m: moments + q.m }
        };
        agree(Bonded::new(block, Arms { lever: [0.5; 2], bending: 1.0 }, shift, k, flow), velocity);
    }
}

fn dry_agree<T: Vect>(block: Block, mu: f64, q: Local<T, V0>) {
    let velocity = |r: Local<T, V0>| Local { n: block.n * r.n + q.n, t: r.t * block.t + q.t, m: r.m };
    agree(Coulomb::<T>::new(block, [0.5; 2], mu, 0.0), velocity);
}

/// Iterate both local solves of a contact alone to their fixed points, and compare.
fn agree<L: Law>(law: L, velocity: impl Fn(Local<L::T, L::B>) -> Local<L::T, L::B>) {
    let solve = |local, rounds| {
        let mut r = Local::zero();
        for _ in 0..rounds {
            r = law.improve(local, r, velocity(r));
        }
        r
    };
    let exact = solve(LocalSolve::Exact, 3);
    let map = law.natural_map(exact, velocity(exact));
    assert!(map.dot(&map).sqrt() <= 1e-11, "the exact solve leaves the residual {map:?}");
    let stepped = solve(LocalSolve::PredictorCorrector, 20_000);
    let apart = exact - stepped;
    assert!(apart.dot(&apart).sqrt() <= 1e-8 * (1.0 + exact.dot(&exact).sqrt()), "{exact:?} against {stepped:?}");
}
