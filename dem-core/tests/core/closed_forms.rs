//! Scenes with a closed-form solution, in 2D, and in 3D where the same law applies.

use crate::common::{bonded_pair, down, floor, grain, run, settings, solver, world};
use dem_core::body::{Drive, Shape, Wall};
use dem_core::bond::BondStatus;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::world::{Restitution, World};
use std::sync::Arc;

const G: f64 = 9.81;

fn last<D: Dim>(v: &D::Vector) -> f64 {
    v[D::N - 1]
}

/// A grain of radius 1 cm whose lowest point is at the given height over the floor.
fn above<D: Dim>(height: f64) -> dem_core::body::Grain<D> {
    let mut x = vec![0.0; D::N];
    x[D::N - 1] = 0.01 + height;
    grain(&x, 0.01)
}

fn free_flight<D: Dim>() {
    let mut set = settings(1e-3);
    set.gravity = down::<D>(G);
    let mut start = above::<D>(1.0);
    start.velocity[0] = 2.0;
    let mut w = world(vec![start], vec![], set);
    run(&mut w, 400);
    let t: f64 = 0.4;
    // θ = 1/2 integrates a constant acceleration exactly
    assert!((w.grains.position[0][0] - 2.0 * t).abs() < 1e-13);
    assert!((last::<D>(&w.grains.position[0]) - (1.01 - 0.5 * G * t * t)).abs() < 1e-12);
    assert!((last::<D>(&w.grains.velocity[0]) + G * t).abs() < 1e-12);
}

#[test]
fn free_flight_is_a_parabola() {
    free_flight::<D2>();
    free_flight::<D3>();
}

fn bounce<D: Dim>(e: f64) -> f64 {
    let mut set = settings(1e-4);
    set.restitution = Some(Restitution { grain_grain: e, grain_wall: e, threshold_speed: 0.0 });
    let mut start = above::<D>(0.0105);
    start.velocity[D::N - 1] = -1.0;
    let mut w = world(vec![start], vec![floor(0.0)], set);
    run(&mut w, 300);
    last::<D>(&w.grains.velocity[0])
}

#[test]
fn a_bounce_returns_the_fraction_e_of_the_speed() {
    for e in [0.0, 0.5, 1.0] {
        assert!((bounce::<D2>(e) - e).abs() < 1e-14, "2D, e = {e}: {}", bounce::<D2>(e));
        assert!((bounce::<D3>(e) - e).abs() < 1e-14, "3D, e = {e}: {}", bounce::<D3>(e));
    }
}

#[test]
fn pairs_and_walls_have_their_own_restitution() {
    fn case<D: Dim>() {
        let mut set = settings(1e-4);
        set.restitution = Some(Restitution { grain_grain: 0.2, grain_wall: 0.7, threshold_speed: 0.0 });
        let mut start = above::<D>(0.0105);
        start.velocity[D::N - 1] = -1.0;
        // a second grain falls onto a fixed one, far from the first
        let (mut held, mut falling) = (above::<D>(0.2), above::<D>(0.2305));
        (held.position[0], falling.position[0]) = (1.0, 1.0);
        held.fixed = true;
        falling.velocity[D::N - 1] = -1.0;
        let mut w = world(vec![start, held, falling], vec![floor(0.0)], set);
        w.settings.friction = 0.0;
        run(&mut w, 300);
        let [wall, pair] = [0, 2].map(|k: usize| last::<D>(&w.grains.velocity[k]));
        assert!((wall - 0.7).abs() < 1e-12 && (pair - 0.2).abs() < 1e-12, "{wall} {pair}");
    }
    case::<D2>();
    case::<D3>();
}

#[test]
fn restitution_begins_at_its_threshold() {
    fn rebound<D: Dim>(speed: f64) -> f64 {
        let mut set = settings(1e-4);
        set.restitution = Some(Restitution { grain_grain: 0.5, grain_wall: 0.5, threshold_speed: 1.0 });
        let mut start = above::<D>(0.0105);
        start.velocity[D::N - 1] = -speed;
        let mut w = world(vec![start], vec![floor(0.0)], set);
        run(&mut w, 300);
        last::<D>(&w.grains.velocity[0])
    }
    for (speed, expected) in [(0.99, 0.0), (1.01, 0.505), (2.0, 1.0)] {
        for found in [rebound::<D2>(speed), rebound::<D3>(speed)] {
            assert!((found - expected).abs() < 1e-14, "{speed} m/s: {found} against {expected}");
        }
    }
}

/// A contact that an error has opened by some 1e-9 of the radius, and that bears nothing for a
/// step, bears its load again without a gap to close first.
#[test]
fn what_an_error_opened_is_still_closed_after_a_step_without_a_load() {
    fn case<D: Dim>() {
        let mut set = settings(1e-3);
        set.gravity = down::<D>(G);
        let mut w = world(vec![above::<D>(0.0)], vec![floor(0.0)], set);
        let force = |w: &World<D>| w.touches().map(|touch| touch.reaction.n).sum::<f64>();
        let weight = w.grains.mass[0] * G;
        run(&mut w, 2);
        assert!((force(&w) / weight - 1.0).abs() < 1e-9);
        w.grains.position[0][D::N - 1] += 5e-9 * 0.01;
        w.settings.gravity = None;
        run(&mut w, 1);
        assert_eq!(force(&w), 0.0);
        w.settings.gravity = down::<D>(G);
        let before = last::<D>(&w.grains.position[0]);
        run(&mut w, 1);
        assert!((force(&w) / weight - 1.0).abs() < 1e-9, "{} of {weight}", force(&w));
        assert!((last::<D>(&w.grains.position[0]) - before).abs() < 1e-15);
    }
    case::<D2>();
    case::<D3>();
}

/// A wall that pushes a grain along the first axis, its speed growing by 2 m/s².
fn pushed<D: Dim>() -> World<D> {
    let mut first = D::Vector::zero();
    first[0] = 1.0;
    let mut centre = vec![0.0; D::N];
    centre[0] = 0.01;
    let mut wall = Wall::fixed(Shape::Plane { normal: first }, D::Vector::zero(), 0.0);
    wall.drive = Drive::Velocity { direction: first, speed: Arc::new(|t| 2.0 * t) };
    world(vec![grain(&centre, 0.01)], vec![wall], settings(1e-3))
}

#[test]
fn a_wall_has_the_speed_of_the_end_of_the_step() {
    fn case<D: Dim>() {
        let mut w = pushed::<D>();
        for _ in 0..50 {
            w.step().unwrap();
            let (speed, way) = (2.0 * w.time, w.time * w.time);
            // θ = 1/2 integrates a speed that is linear in time exactly
            assert!((w.walls[0].velocity[0] - speed).abs() < 1e-15, "{} against {speed}", w.walls[0].velocity[0]);
            assert!((w.walls[0].position[0] - way).abs() < 1e-15, "{} against {way}", w.walls[0].position[0]);
            assert!((w.grains.velocity[0][0] - speed).abs() < 1e-14);
            // the grain's inertia
            let force = -w.walls[0].reaction[0];
            assert!((force / (2.0 * w.grains.mass[0]) - 1.0).abs() < 1e-9, "{force}");
        }
        let kinetic = 0.5 * w.grains.mass[0] * w.grains.velocity[0][0].powi(2);
        assert!((w.ledger.external_work / kinetic - 1.0).abs() < 1e-12);
    }
    case::<D2>();
    case::<D3>();
}

/// The motion of a grain that starts sliding on a rough floor.
struct Slide {
    /// Displacement of its centre until it rolls (m).
    travelled: f64,
    /// Slip of its contact point until then (m).
    slid: f64,
    /// Its speed as it rolls (m/s).
    rolling: f64,
    /// Work of friction (J) and the energy that the normal rows lost, over the weight (m).
    lost: [f64; 2],
}

fn slide<D: Dim>(v: f64, mu: f64) -> Slide {
    let mut set = settings(1e-5);
    set.gravity = down::<D>(G);
    let mut start = above::<D>(0.0);
    start.velocity[0] = v;
    let mut w = world(vec![start], vec![floor(mu)], set);
    let contact_speed = |w: &World<D>| {
        // the spin that carries the grain along x turns about −z in 2D and about +y in 3D
        let spin = if D::N == 2 { -w.grains.spin[0][0] } else { w.grains.spin[0][1] };
        w.grains.velocity[0][0] - 0.01 * spin
    };
    let mut slid = 0.0;
    while contact_speed(&w) > 1e-9 * v {
        let before = contact_speed(&w);
        w.step().unwrap();
        slid += 0.5e-5 * (before + contact_speed(&w));
        assert!(w.time < 10.0);
    }
    let travelled = w.grains.position[0][0];
    run(&mut w, 1000);
    let lost = [w.ledger.friction, w.ledger.impact].map(|energy| energy / (w.grains.mass[0] * G));
    Slide { travelled, slid, rolling: w.grains.velocity[0][0], lost }
}

#[test]
fn a_free_grain_slides_and_then_rolls() {
    let (v, mu) = (0.3, 0.25);
    // the contact point decelerates by μ g (1 + m R²/I), the centre by μ g; slip ends at v/(3 μ g)
    // in 2D and at v/(3.5 μ g) in 3D
    let unit = v * v / (mu * G);
    for (found, way, slip, speed) in [
        (slide::<D2>(v, mu), 5.0 / 18.0, 1.0 / 6.0, 2.0 / 3.0),
        (slide::<D3>(v, mu), 12.0 / 49.0, 1.0 / 7.0, 5.0 / 7.0),
    ] {
        let Slide { travelled, slid, rolling, lost: [friction, impact] } = found;
        assert!((travelled / (way * unit) - 1.0).abs() < 2e-3, "{travelled}");
        assert!((slid / (slip * unit) - 1.0).abs() < 2e-3, "{slid}");
        assert!((rolling - speed * v).abs() < 1e-9 * v);
        // friction dissipates μ m g per metre of slip, up to the half step in which slip stops
        assert!((friction / (mu * slid) - 1.0).abs() < 1e-3 && impact.abs() < 1e-12 * friction, "{friction} {impact}");
    }
}

#[test]
fn a_bonded_row_slides_v2_over_2_mu_g() {
    let (v, mu) = (0.5, 0.3);
    let mut set = settings(1e-5);
    set.gravity = down::<D2>(G);
    let row = (0..6).map(|k| {
        let mut g = grain::<D2>(&[0.02 * k as f64, 0.01], 0.01);
        g.velocity[0] = v;
        g
    });
    let mut w = world(row.collect(), vec![floor(mu)], set);
    w.form_bonds(1e-6, |_| 1e6, 0.3);
    while w.grains.velocity[0][0] > 1e-9 {
        w.step().unwrap();
        assert!(w.time < 1.0);
    }
    let expected = v * v / (2.0 * mu * G);
    assert!((w.grains.position[0][0] / expected - 1.0).abs() < 1e-3, "{} against {expected}", w.grains.position[0][0]);
    assert_eq!(w.intact_bonds(), 5);
}

/// Acceleration of a grain down a plane tilted by `angle` with friction `mu`.
fn incline<D: Dim>(angle: f64, mu: f64) -> f64 {
    let mut set = settings(1e-4);
    let mut gravity = D::Vector::zero();
    gravity[0] = G * angle.sin();
    gravity[D::N - 1] = -G * angle.cos();
    set.gravity = Some(gravity);
    let mut w = world(vec![above::<D>(0.0)], vec![floor(mu)], set);
    run(&mut w, 1000);
    w.grains.velocity[0][0] / w.time
}

#[test]
fn a_grain_on_an_incline_rolls_or_slides() {
    let angle = 0.5f64;
    let (s, c) = angle.sin_cos();
    // rolling needs μ ≥ tan α / 3 for a disk and 2 tan α / 7 for a sphere
    assert!((incline::<D2>(angle, 0.5) - 2.0 / 3.0 * G * s).abs() < 1e-9);
    assert!((incline::<D2>(angle, 0.1) - G * (s - 0.1 * c)).abs() < 1e-9);
    assert!((incline::<D3>(angle, 0.5) - 5.0 / 7.0 * G * s).abs() < 1e-9);
    assert!((incline::<D3>(angle, 0.1) - G * (s - 0.1 * c)).abs() < 1e-9);
}

#[test]
fn weight_at_the_bottom_of_a_column() {
    let mut set = settings(1e-3);
    set.gravity = down::<D2>(G);
    set.solver = solver(1e-13);
    let column: Vec<_> = (0..50).map(|k| grain::<D2>(&[0.0, 0.01 + 0.02 * k as f64], 0.01)).collect();
    let weight: f64 = column.iter().map(|g| g.mass * G).sum();
    let mut w = world(column, vec![floor(0.2)], set);
    let report = w.step().unwrap();
    assert!(report.residual <= 1e-13);
    assert!((-w.walls[0].reaction[1] / weight - 1.0).abs() < 1e-9, "{}", -w.walls[0].reaction[1] / weight);
}

/// Step a loaded pair until its bond breaks; returns the reaction in the break, and the mode.
fn breaking(mut w: World<D2>, steps: usize) -> Option<(dem_core::world::Break<D2>, f64)> {
    for _ in 0..steps {
        let report = w.step().unwrap();
        if let Some(b) = report.breaks.first() {
            return Some((*b, report.time));
        }
    }
    None
}

#[test]
fn a_bond_breaks_in_tension_at_r_coh() {
    // pulled at 1000 N/s, 10 N is reached after 100 steps of 1e-4 s; one step is 0.1 N, so step
    // finer at the end
    let (b, time) = breaking(bonded_pair(10.0, [1000.0, 0.0], 0.0), 200).expect("it breaks");
    assert_eq!(b.mode, BondStatus::Tension);
    assert!((b.reaction.n + 10.0).abs() < 1e-6 * 10.0, "{}", b.reaction.n);
    // the first step whose mid-step force exceeds the strength
    assert!((1000.0 * (time - 0.5e-4) - 10.0).abs() <= 0.1 + 1e-9);
}

#[test]
fn a_bond_breaks_in_shear_at_mu_times_the_shifted_normal_reaction() {
    // a torque balances the moment of the shear force at the free disk's centre: no moment in the
    // bond
    let (b, _) = breaking(bonded_pair(10.0, [-200.0, 1000.0], -1.0), 2000).expect("it breaks");
    assert_eq!(b.mode, BondStatus::Shear);
    assert!((b.reaction.t[0].abs() / (0.3 * (b.reaction.n + 10.0)) - 1.0).abs() < 1e-6);
    assert!(b.reaction.m[0].abs() < 1e-2 * 2e-3 * b.reaction.t[0].abs());
}

#[test]
fn a_bond_breaks_in_rolling_at_mu_a_times_the_shifted_normal_reaction() {
    let (b, _) = breaking(bonded_pair(10.0, [-500.0, 0.0], 1.0), 2000).expect("it breaks");
    assert_eq!(b.mode, BondStatus::Rolling);
    assert!((b.reaction.m[0].abs() / (0.3 * 2e-3 * (b.reaction.n + 10.0)) - 1.0).abs() < 1e-6);
}

#[test]
fn a_bond_never_breaks_in_compression() {
    let mut w = bonded_pair(10.0, [-1e8, 0.0], 0.0);
    for _ in 0..1000 {
        assert!(w.step().unwrap().breaks.is_empty());
    }
    assert!((w.touches().next().unwrap().reaction.n / 1e7 - 1.0).abs() < 1e-3);
    assert_eq!(w.intact_bonds(), 1);
}
