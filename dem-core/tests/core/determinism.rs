//! The same bits for every run and every number of threads.

use crate::common::family::{Feature, rows_of_disks};
use crate::common::{self, down, floor, grain, settings, solver, world};
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::{SolveStatus, SolverSettings};
use dem_core::world::World;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Grains that fall on each other and on a floor, some of them bonded.
fn pile<D: Dim>() -> World<D> {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut set = settings(1e-3);
    set.gravity = down::<D>(9.81);
    set.solver = solver(1e-4);
    let side = if D::N == 2 { 40 } else { 11 };
    let mut grains = Vec::new();
    for k in 0..1300usize {
        let mut x = vec![0.0; D::N];
        let mut rest = k;
        for c in x.iter_mut().take(D::N - 1) {
            *c = 0.021 * (rest % side) as f64 + 1e-3 * rng.random::<f64>();
            rest /= side;
        }
        x[D::N - 1] = 0.011 + 0.0205 * rest as f64;
        grains.push(grain::<D>(&x, 0.01 * (0.8 + 0.2 * rng.random::<f64>())));
    }
    let mut w = world(grains, vec![floor(0.2)], set);
    w.form_bonds(0.2, |_| 3.0, 0.3);
    assert!(w.bonds.len() > 100);
    w
}

/// The motion after some steps on this number of threads.
fn bits<D: Dim>(threads: usize, build: fn() -> World<D>, steps: usize) -> Vec<u64> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut w = build();
        common::run(&mut w, steps);
        let g = &w.grains;
        let moving = g.position.iter().chain(&g.velocity).flat_map(|v| v.as_slice().to_vec());
        moving.chain(g.spin.iter().flat_map(|s| s.as_slice().to_vec())).map(f64::to_bits).collect()
    })
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let one = bits(1, pile::<D2>, 40);
    for threads in [1, 2, 3] {
        assert_eq!(one, bits(threads, pile::<D2>, 40), "{threads} threads");
    }
    assert_eq!(bits(1, pile::<D3>, 40), bits(3, pile::<D3>, 40));
}

/// Rows of disks enough for three blocks, which are swept at the same time.
fn blocks(feature: Feature) -> World<D2> {
    let mut w = rows_of_disks(90, 100, feature, 40);
    assert!(w.grains.len() > 8192);
    w.grains.velocity.iter_mut().enumerate().for_each(|(k, v)| v[0] = 0.1 * (k as f64).sin());
    w
}

#[test]
fn blocks_swept_at_once_give_the_same_bits() {
    for build in [|| blocks(Feature::Friction), || blocks(Feature::Bonds)] {
        let one = bits(1, build, 3);
        for threads in [2, 3] {
            assert_eq!(one, bits(threads, build, 3), "{threads} threads");
        }
    }
}

/// Elastic bonds have a unique solution: sweeps in blocks converge to that of Newton.
#[test]
fn blocks_swept_at_once_solve_the_problem() {
    let settled = |solver: SolverSettings| {
        let mut w = blocks(Feature::ElasticBonds);
        w.set_solver(solver);
        let report = w.step().expect("an accepted step");
        assert_eq!(report.status, SolveStatus::Converged);
        w.grains.velocity
    };
    let (swept, newton) = (settled(solver(1e-10)), settled(SolverSettings::Staged(common::newton(1e-12, 1e-12, 1e-9))));
    let fastest = newton.iter().map(|v| v.norm()).fold(0.0, f64::max);
    let apart = swept.iter().zip(&newton).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart <= 1e-7 * fastest, "{apart:e} of {fastest:e} m/s");
}
