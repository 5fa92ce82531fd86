//! Momentum is conserved, and energy never grows without work.

use crate::common::{self, down, floor, grain, run, settings, solver, world};
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::world::{Restitution, World};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A cloud of grains of different sizes that fly into each other; neighbours in the first rows may
/// be bonded.
fn cloud<D: Dim>(seed: u64, friction: f64, restitution: f64) -> World<D> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut set = settings(1e-3);
    set.friction = friction;
    set.solver = solver(1e-11);
    set.restitution = (restitution > 0.0).then_some(Restitution {
        grain_grain: restitution,
        grain_wall: restitution,
        threshold_speed: 0.0,
    });
    let side: usize = if D::N == 2 { 7 } else { 4 };
    let mut grains = Vec::new();
    for k in 0..side.pow(D::N as u32) {
        let x = common::cell::<D>(k, side, |c| 0.02 * c as f64);
        let mut g = grain::<D>(&x, 0.01 * (0.7 + 0.3 * rng.random::<f64>()));
        let centre = 0.01 * (side - 1) as f64;
        for axis in 0..D::N {
            g.velocity[axis] = 3.0 * (centre - x[axis]) + 0.2 * (rng.random::<f64>() - 0.5);
        }
        for axis in 0..D::Spin::LEN {
            g.spin[axis] = 20.0 * (rng.random::<f64>() - 0.5);
        }
        grains.push(g);
    }
    world(grains, vec![], set)
}

fn keeps_momentum<D: Dim>(bonded: bool) {
    let mut w = cloud::<D>(3, 0.4, 0.0);
    if bonded {
        // every sweep conserves momentum, whatever the tolerance
        w.set_solver(solver(1e-5));
        w.form_bonds(0.3, |_| 50.0, 0.3);
        assert!(w.bonds.len() > 5);
    }
    let start = w.momentum();
    // the scale is the exchanged momentum, not its vanishing sum
    let exchanged: f64 = w.grains.mass.iter().zip(&w.grains.velocity).map(|(m, v)| m * v.norm()).sum();
    run(&mut w, 150);
    let end = w.momentum();
    assert!((end.linear - start.linear).norm() <= 1e-13 * exchanged);
    // moments refer to positions at mid-step: the exchange is exact there, up to the drift of half
    // a step
    assert!(
        (end.angular - start.angular).norm() <= 1e-12 * exchanged * 0.1,
        "{}",
        (end.angular - start.angular).norm()
    );
    assert!(w.touches().any(|t| t.reaction.n > 0.0) || bonded);
}

#[test]
fn momentum_is_kept_without_walls_and_gravity() {
    keeps_momentum::<D2>(false);
    keeps_momentum::<D2>(true);
    keeps_momentum::<D3>(false);
    keeps_momentum::<D3>(true);
}

fn never_gains<D: Dim>(friction: f64, restitution: f64) {
    for seed in 0..8 {
        let mut w = cloud::<D>(seed, friction, restitution);
        let start = w.ledger.kinetic;
        let mut last = start;
        for _ in 0..150 {
            w.step().unwrap();
            assert!(w.ledger.kinetic <= last + 1e-9 * start, "seed {seed}: {last} grew to {}", w.ledger.kinetic);
            last = w.ledger.kinetic;
        }
        // energy was lost, and the balance closes
        assert!(last < 0.999 * start || restitution == 1.0);
        assert!(w.ledger.remainder.abs() <= 1e-12 * start);
    }
}

#[test]
fn energy_never_grows_without_work() {
    never_gains::<D2>(0.0, 0.0);
    never_gains::<D2>(0.4, 0.0);
    never_gains::<D2>(0.0, 0.5);
    never_gains::<D2>(0.0, 1.0);
    never_gains::<D3>(0.0, 0.0);
    never_gains::<D3>(0.4, 0.0);
    never_gains::<D3>(0.0, 0.7);
}

#[test]
fn the_ledger_closes_under_gravity_loads_and_drives() {
    let mut set = settings(1e-3);
    set.gravity = down::<D2>(9.81);
    set.solver = solver(1e-10);
    let mut rng = Pcg64::seed_from_u64(5);
    let grains = (0..30).map(|k| {
        let (column, row) = (k % 5, k / 5);
        grain::<D2>(&[0.022 * column as f64 + 0.002 * rng.random::<f64>(), 0.012 + 0.023 * row as f64], 0.01)
    });
    let mut lid = common::force_driven::<D2>([0.0, -1.0].into(), [0.0, 0.16].into(), 3.0, 40.0);
    lid.velocity = [0.0, -0.1].into();
    let mut w = world(grains.collect(), vec![floor(0.2), lid], set);
    // a wall that moves in from the left at a prescribed speed
    let mut pusher = dem_core::body::Wall::fixed(
        dem_core::body::Shape::Plane { normal: [1.0, 0.0].into() },
        [-0.012, 0.0].into(),
        0.2,
    );
    pusher.drive =
        dem_core::body::Drive::Velocity { direction: [1.0, 0.0].into(), speed: std::sync::Arc::new(|t| 0.3 * t) };
    w.walls.push(pusher);
    run(&mut w, 400);
    let l = w.ledger;
    assert!(l.external_work > 0.0 && l.impact > 0.0 && l.friction > 0.0);
    assert!(l.remainder.abs() <= 1e-12 * l.external_work, "{l:?}");
    assert!((l.kinetic - w.kinetic_energy()).abs() <= 1e-12 * l.external_work);
}

#[test]
fn losses_are_booked_where_they_belong() {
    fn case<D: Dim>(friction: f64, e: f64) -> [f64; 2] {
        let mut set = settings(1e-4);
        set.restitution = (e > 0.0).then_some(Restitution { grain_grain: e, grain_wall: e, threshold_speed: 0.0 });
        let mut place = vec![0.0; D::N];
        // touches in the middle of the second step
        place[D::N - 1] = 0.01 + 3e-4 - 1e-13;
        let mut grain = grain::<D>(&place, 0.01);
        grain.velocity[0] = 1.0;
        grain.velocity[D::N - 1] = -2.0;
        let mut w = world(vec![grain], vec![floor(friction)], set);
        run(&mut w, 20);
        [w.ledger.impact, w.ledger.friction].map(|energy| energy / (0.5 * w.grains.mass[0]))
    }
    for e in [0.0, 0.5] {
        // a normal impact at 2 m/s loses (1 − e²) 4 m²/s²; friction reduces the slip of 1 m/s by μ
        // times the normal impulse over the effective mass, a third of the mass for a disk, two
        // sevenths for a sphere
        let (straight, mu) = (4.0 * (1.0 - e * e), 0.05);
        let impulse = mu * 2.0 * (1.0 + e);
        for (smooth, rough, mass) in
            [(case::<D2>(0.0, e), case::<D2>(mu, e), 1.0 / 3.0), (case::<D3>(0.0, e), case::<D3>(mu, e), 2.0 / 7.0)]
        {
            let slip = impulse * (2.0 - impulse / mass);
            assert!((smooth[0] - straight).abs() < 1e-9 && smooth[1] == 0.0, "e = {e}: {smooth:?}");
            assert!((rough[0] - straight).abs() < 1e-9, "e = {e}: {rough:?} against {straight}");
            assert!((rough[1] - slip).abs() < 1e-9, "e = {e}: {rough:?} against {slip}");
        }
    }
}
