//! Bonds that turn: a rotating pair keeps its length, its angular velocity and its energy, with
//! every kind of bond.

mod common;

use common::{grain, newton, settings, world};
use dem_core::body::{Shape, Wall};
use dem_core::bond::Stiffness;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::SolverSettings;
use dem_core::world::Restitution;

/// Radius of the grains (m).
const R: f64 = 0.01;

/// Angle by which the pair of [`stopped_dumbbell`] turns in a step (rad).
const ANGLE: f64 = 0.1;

/// Stiffness of a bond of mean diameter `a` with the normal stiffness `k`.
fn stiff(k: f64, a: f64) -> Stiffness {
    Stiffness { normal: k, tangential: 0.7 * k, rolling: k * a * a / 12.0, twist: k * a * a / 16.0 }
}

/// Two bonded grains rotate about their common centre at 100 rad/s, a hundredth of a radian a step,
/// for a hundred radians. Returns the largest relative change of length, the final angular velocity
/// over the initial one, and the largest relative gain of energy.
fn dumbbell<D: Dim>(stiffness: Option<f64>, friction: f64) -> (f64, f64, f64) {
    let (h, rate) = (1e-4, 100.0);
    let mut pair: Vec<_> = [-R, R].iter().map(|x| grain::<D>(&[*x, 0.0, 0.0][..D::N], R)).collect();
    for (grain, side) in pair.iter_mut().zip([-1.0, 1.0]) {
        grain.velocity[1] = side * rate * R;
        grain.spin[D::Spin::LEN - 1] = if friction > 0.0 { rate } else { 0.0 };
    }
    let mut set = settings(h);
    set.solver = SolverSettings::Staged(newton(1e-10, 1e-8, 1e-6));
    let mut w = world(pair, vec![], set);
    w.form_bonds(1e-6, |_| 1e6, friction);
    if let Some(k) = stiffness {
        w.make_bonds_elastic(|a| stiff(k, a));
    }
    let (length, first) = (2.0 * R, w.kinetic_energy());
    let (mut longest, mut gain) = (0.0f64, 0.0f64);
    for _ in 0..10_000 {
        w.step().unwrap();
        longest = longest.max(((w.grains.position[1] - w.grains.position[0]).norm() / length - 1.0).abs());
        gain = gain.max((w.ledger.kinetic + w.ledger.elastic) / first - 1.0);
    }
    let turning = (w.grains.velocity[1] - w.grains.velocity[0]).norm() / (2.0 * R * rate);
    (longest, turning, gain)
}

#[test]
fn a_bond_that_turns_keeps_its_length_its_spin_and_its_energy() {
    for (stiffness, friction) in [(Some(1e8), 0.3), (Some(1e10), 0.3), (Some(1e8), 0.0), (None, 0.3), (None, 0.0)] {
        for (longest, turning, gain) in [dumbbell::<D2>(stiffness, friction), dumbbell::<D3>(stiffness, friction)] {
            let what = format!("{stiffness:?} {friction}: {longest:e} {turning} {gain:e}");
            assert!(longest <= 1e-3 && (turning - 1.0).abs() <= 5e-3 && gain <= 1e-6, "{what}");
        }
    }
}

/// Two bonded grains turn by [`ANGLE`] a step until two fixed grains stop them after `way` steps.
/// If `fast`, another grain is so fast that the third step is made in two parts. Returns the
/// relative length of the bond afterwards beyond the length that follows from its force (–).
fn stopped_dumbbell<D: Dim>(stiffness: Option<f64>, friction: f64, way: f64, fast: bool) -> f64 {
    let h = 1e-3;
    let at = |x: f64, y: f64| grain::<D>(&[x, y, 0.0][..D::N], R);
    let mut grains = vec![at(-R, 0.0), at(R, 0.0)];
    for (grain, side) in grains.iter_mut().zip([-1.0, 1.0]) {
        grain.velocity[1] = side * ANGLE / h * R;
        grain.spin[D::Spin::LEN - 1] = if friction > 0.0 { ANGLE / h } else { 0.0 };
    }
    for side in [-1.0, 1.0] {
        grains.push(at(side * R, side * (2.0 + way * ANGLE) * R));
        grains.last_mut().unwrap().fixed = true;
    }
    // with restitution a contact acts only when it touches, so the fast grain would pass the wall
    // in half a step
    let (speed, arrival) = (6.0 * R / h, 2.7 * h);
    let (mut normal, mut place) = (D::Vector::zero(), D::Vector::zero());
    normal[0] = -1.0;
    place[0] = 101.0 * R + arrival * speed;
    grains.push(at(100.0 * R, 0.0));
    grains[4].velocity[0] = if fast { speed } else { 0.0 };
    let mut set = settings(h);
    set.friction = 0.0;
    set.restitution = Some(Restitution { grain_wall: 0.5, ..Restitution::default() });
    set.solver = SolverSettings::Staged(newton(1e-10, 1e-8, 1e-6));
    let mut w = world(grains, vec![Wall::fixed(Shape::Plane { normal }, place, 0.0)], set);
    w.form_bonds(1e-6, |_| 1e9, friction);
    if let Some(k) = stiffness {
        w.make_bonds_elastic(|a| stiff(k, a));
    }
    let parts: Vec<u32> = (0..16).map(|_| w.step().unwrap().substeps).collect();
    assert_eq!(parts.iter().sum::<u32>(), if fast { 17 } else { 16 }, "{parts:?}");
    let length = (w.grains.position[1] - w.grains.position[0]).norm();
    let force = w.touches().find(|t| t.bond.is_some()).map_or(0.0, |t| t.reaction.n);
    (length + stiffness.map_or(0.0, |k| force / k)) / (2.0 * R) - 1.0
}

/// The hidden length that a change of step length leaves is corrected: at rest a bond is as long as
/// without a step in parts, wherever the turn is stopped.
#[test]
fn parts_of_a_step_leave_the_length_of_a_bond_that_turned() {
    for (stiffness, friction) in [(None, 0.0), (None, 0.3), (Some(1e9), 0.0), (Some(1e9), 0.3)] {
        for way in [2.3, 2.9, 3.3, 4.2] {
            for (whole, parts) in [
                [false, true].map(|fast| stopped_dumbbell::<D2>(stiffness, friction, way, fast)).into(),
                [false, true].map(|fast| stopped_dumbbell::<D3>(stiffness, friction, way, fast)).into(),
            ] {
                let left = (parts - whole) / (ANGLE * ANGLE);
                assert!(left.abs() < 2e-3, "{stiffness:?} {friction} {way}: {left} of the square of the angle is left");
            }
        }
    }
}
