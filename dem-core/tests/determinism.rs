//! The same bits for every run and every number of threads.

mod common;

use common::{down, floor, grain, settings, solver, world};
use dem_core::dim::{D2, D3, Dim, Vect};
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

fn bits<D: Dim>(threads: usize) -> Vec<u64> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut w = pile::<D>();
        common::run(&mut w, 40);
        let g = &w.grains;
        let moving = g.position.iter().chain(&g.velocity).flat_map(|v| v.as_slice().to_vec());
        moving.chain(g.spin.iter().flat_map(|s| s.as_slice().to_vec())).map(f64::to_bits).collect()
    })
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let one = bits::<D2>(1);
    for threads in [1, 2, 3] {
        assert_eq!(one, bits::<D2>(threads), "{threads} threads");
    }
    assert_eq!(bits::<D3>(1), bits::<D3>(3));
}
