//! Rupture of bonds: thresholds, cascades, broken bonds as dry contacts, and refused solves that
//! change nothing.

use crate::common::{self, grain, settings, world};
use dem_core::body::{Grains, Load, Shape, Wall};
use dem_core::bond::{BondStatus, Rupture};
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect};
use dem_core::solver::{GaussSeidelSettings, SolverSettings};
use dem_core::world::{Break, StepError, World};
use std::sync::Arc;

const R_COH: f64 = 10.0;
const MU: f64 = 0.3;
/// Coefficient of the twisting moment.
const XI: f64 = 0.17;
/// Mean diameter of the pair (m).
const A: f64 = 2e-3;

/// A bonded pair along the first axis, its first grain fixed, under a constant force and torque on
/// the second.
fn pair<D: Dim>(force: &[f64], torque: &[f64]) -> World<D> {
    let mut second = vec![0.0; D::N];
    second[0] = A;
    let mut fixed = grain::<D>(&vec![0.0; D::N], 0.5 * A);
    fixed.fixed = true;
    let grains: Grains<D> = [fixed, grain(&second, 0.5 * A)].into_iter().collect();
    let load = Load {
        grain: 1,
        force: D::Vector::from_slice(force),
        torque: D::Spin::from_slice(torque),
        factor: Arc::new(|_| 1.0),
    };
    let mut w = World::new(grains, Vec::new(), vec![load], settings(1e-4));
    w.form_bonds(1e-6, |_| R_COH, MU);
    w.limit_twist(XI);
    w
}

/// A solver that fails on a row of 20 grains.
fn one_sweep() -> SolverSettings {
    SolverSettings::GaussSeidel(GaussSeidelSettings {
        local: Default::default(),
        tolerance: 1e-14,
        accept: 1e-14,
        max_sweeps: 1,
        acceleration: 0,
    })
}

fn first_break<D: Dim>(mut w: World<D>) -> Option<Break<D>> {
    w.step().unwrap().breaks.first().copied()
}

#[test]
fn thresholds_are_met_within_1e_6() {
    let near = 1e-6;
    for normal in [-R_COH * 0.5, 0.0, 3.0 * R_COH] {
        let limit = normal + R_COH;
        // tension: a pure pull, which is minus the normal reaction; shear: the force at the centre
        // has the lever A/2, and a torque cancels its moment in the bond; rolling: a torque alone
        for (share, breaks) in [(1.0 - near, None), (1.0 + near, Some(()))] {
            let tension = first_break(pair::<D2>(&[R_COH * share, 0.0], &[0.0]));
            assert_eq!(tension.map(|b| b.mode), breaks.map(|_| BondStatus::Tension));
            let shear = MU * limit * share;
            let found = first_break(pair::<D2>(&[-normal, shear], &[-shear * 0.5 * A]));
            assert_eq!(found.map(|b| b.mode), breaks.map(|_| BondStatus::Shear), "normal {normal}");
            let moment = MU * A * limit * share;
            let found = first_break(pair::<D2>(&[-normal, 0.0], &[moment]));
            assert_eq!(found.map(|b| b.mode), breaks.map(|_| BondStatus::Rolling), "normal {normal}");
            let found = first_break(pair::<D3>(&[-normal, 0.0, 0.0], &[0.0, moment, 0.0]));
            assert_eq!(found.map(|b| b.mode), breaks.map(|_| BondStatus::Rolling), "3D, normal {normal}");
            // the limit of twist is separate: bending just below its own limit changes nothing
            for bending in [0.0, (1.0 - near) * MU * A * limit] {
                let torque = [XI * A * limit * share, bending * 0.6, bending * 0.8];
                let found = first_break(pair::<D3Twist>(&[-normal, 0.0, 0.0], &torque));
                assert_eq!(found.map(|b| b.mode), breaks.map(|_| BondStatus::Twist), "normal {normal}");
                if let Some(found) = found {
                    let limit = XI * A * (found.reaction.n + R_COH);
                    assert!((found.reaction.m[2].abs() - limit).abs() < 1e-9 * limit, "{found:?}");
                }
            }
        }
    }
}

#[test]
fn without_a_twist_row_a_bonded_grain_spins_freely_about_its_normal() {
    let torque = 1e-4;
    let mut free = pair::<D3>(&[0.0; 3], &[torque, 0.0, 0.0]);
    let mut held = pair::<D3Twist>(&[0.0; 3], &[torque, 0.0, 0.0]);
    common::run(&mut free, 10);
    common::run(&mut held, 10);
    let spin = torque * 1e-3 / free.grains.inertia[1];
    assert!((free.grains.spin[1][0] / spin - 1.0).abs() < 1e-9, "{}", free.grains.spin[1]);
    assert!(held.grains.spin[1].norm() < 1e-9 * spin, "{}", held.grains.spin[1]);
    assert!((held.touches().next().unwrap().reaction.m[2].abs() / torque - 1.0).abs() < 1e-9);
}

#[test]
fn compression_a_million_times_the_cohesion_breaks_nothing() {
    assert!(first_break(pair::<D2>(&[-1e6 * R_COH, 0.0], &[0.0])).is_none());
    assert!(first_break(pair::<D3>(&[-1e6 * R_COH, 0.0, 0.0], &[0.0; 3])).is_none());
}

/// Two grains that meet at an angle, spinning, bonded or not.
fn colliding() -> Vec<dem_core::body::Grain<D2>> {
    let (mut a, mut b) = (grain::<D2>(&[0.0, 0.0], 1e-3), grain::<D2>(&[2e-3, 0.0], 1e-3));
    (a.velocity, b.velocity) = ([0.3, 0.1].into(), [-0.4, 0.0].into());
    (a.spin, b.spin) = ([400.0].into(), [900.0].into());
    vec![a, b]
}

#[test]
fn a_broken_pair_is_bit_for_bit_a_pair_that_was_never_bonded() {
    let mut never = world(colliding(), vec![], settings(1e-4));
    let mut broken = world(colliding(), vec![], settings(1e-4));
    broken.form_bonds(1e-6, |_| R_COH, MU);
    broken.bonds[0].status = BondStatus::Shear;
    for _ in 0..50 {
        never.step().unwrap();
        broken.step().unwrap();
        for k in 0..2 {
            assert_eq!(never.grains.position[k].as_slice(), broken.grains.position[k].as_slice());
            assert_eq!(never.grains.velocity[k].as_slice(), broken.grains.velocity[k].as_slice());
            assert_eq!(never.grains.spin[k], broken.grains.spin[k]);
        }
    }
}

#[test]
fn a_bond_that_breaks_in_a_step_acts_in_it_as_if_it_had_never_been() {
    // far too weak for the impact: the bond breaks in the first step, and the cascade solves that
    // step without it
    let mut never = world(colliding(), vec![], settings(1e-4));
    let mut bonded = world(colliding(), vec![], settings(1e-4));
    bonded.form_bonds(1e-6, |_| 1e-3, MU);
    never.step().unwrap();
    assert_eq!(bonded.step().unwrap().breaks.len(), 1);
    assert_eq!(never.grains.velocity[0].as_slice(), bonded.grains.velocity[0].as_slice());
    assert_eq!(never.grains.spin, bonded.grains.spin);
}

/// A row of bonded grains, pulled at its free end.
fn chain(rule: Rupture) -> World<D2> {
    let mut row: Vec<_> = (0..5).map(|k| grain::<D2>(&[A * k as f64, 0.0], 0.5 * A)).collect();
    row[0].fixed = true;
    let mut set = settings(1e-4);
    set.rupture = rule;
    let load = Load { grain: 4, force: [20.0, 0.0].into(), torque: [0.0].into(), factor: Arc::new(|_| 1.0) };
    let mut w = World::new(row.into_iter().collect(), Vec::new(), vec![load], set);
    w.form_bonds(1e-6, |_| R_COH, MU);
    w
}

#[test]
fn the_rules_of_rupture_differ_as_they_say() {
    // all four bonds carry the same 20 N at once
    let all = chain(Rupture::Cascade).step().unwrap().breaks;
    assert_eq!(all.iter().map(|b| b.round).collect::<Vec<_>>(), [0; 4]);
    // one break unloads the others
    let worst = chain(Rupture::CascadeWorst).step().unwrap().breaks;
    assert_eq!(worst.len(), 1);
    let mut late = chain(Rupture::EndOfStep);
    let end = late.step().unwrap().breaks;
    assert_eq!(end.len(), 4);
    // within the step the bonds carried their limit: r_coh held the free end back
    let expected = 1e-4 * (20.0 - R_COH) / late.grains.mass[4];
    assert!((late.grains.velocity[4][0] / expected - 1.0).abs() < 1e-9);
}

#[test]
fn a_cascade_tells_how_far_it_has_come() {
    for (rule, rounds) in [(Rupture::Cascade, vec![4]), (Rupture::CascadeWorst, vec![1]), (Rupture::EndOfStep, vec![])]
    {
        let mut told = Vec::new();
        chain(rule).step_watched(&mut |broken| told.push(broken)).unwrap();
        assert_eq!(told, rounds, "{rule:?}");
    }
}

#[test]
fn bonds_never_form_again() {
    let mut w = pair::<D2>(&[20.0, 0.0], &[0.0]);
    assert_eq!(w.step().unwrap().breaks.len(), 1);
    w.loads[0].force = [-20.0, 0.0].into();
    for _ in 0..200 {
        assert!(w.step().unwrap().breaks.is_empty());
    }
    assert_eq!(w.bonds[0].status, BondStatus::Tension);
    assert_eq!(w.intact_bonds(), 0);
    // pressed together again: a dry contact
    assert!(w.touches().any(|t| t.reaction.n > 0.0 && t.bond.is_none()));
}

#[test]
fn an_unaccepted_solve_breaks_no_bond_and_moves_no_body() {
    let mut set = settings(1e-4);
    set.solver = one_sweep();
    set.max_halvings = 2;
    let mut row: Vec<_> = (0..20).map(|k| grain::<D2>(&[A * k as f64, 0.0], 0.5 * A)).collect();
    row[0].fixed = true;
    let load = Load { grain: 19, force: [30.0, 1.0].into(), torque: [0.0].into(), factor: Arc::new(|_| 1.0) };
    let mut w = World::new(row.into_iter().collect(), Vec::new(), vec![load], set);
    w.form_bonds(1e-6, |_| R_COH, MU);
    let before = (w.grains.clone(), w.bonds.clone(), w.ledger, w.time, w.steps);
    let error = w.step().unwrap_err();
    assert!(matches!(error, StepError::NotAccepted { step, .. } if step == 0.25e-4), "{error}");
    // one sweep along the row visits its end last: the last contact satisfies its law, and the
    // contact before it is furthest from its law
    let message = error.message(&|body| format!("grain {body}"));
    assert!(message.contains("grain 17 and grain 18 are furthest from their contact law"), "{message}");
    assert_eq!(before.0.position, w.grains.position);
    assert_eq!(before.0.velocity, w.grains.velocity);
    assert_eq!(before.1, w.bonds);
    assert_eq!((before.2, before.3, before.4), (w.ledger, w.time, w.steps));
    assert!(w.touches().len() == 0);
}

#[test]
fn a_step_whose_second_half_fails_is_taken_back_whole() {
    // the pull of the second half breaks a chain that one sweep cannot solve; the first half,
    // without load, is easy
    let mut set = settings(1e-4);
    set.solver = one_sweep();
    set.max_halvings = 1;
    let mut row: Vec<_> = (0..20).map(|k| grain::<D2>(&[A * k as f64, 0.0], 0.5 * A)).collect();
    row.push(grain::<D2>(&[-10.0 * A, 0.0], 0.5 * A));
    row[20].velocity = [1.0, 0.0].into();
    row[0].fixed = true;
    let factor = Arc::new(|t: f64| if t > 0.4e-4 { 1.0 } else { 0.0 });
    let load = Load { grain: 19, force: [30.0, 1.0].into(), torque: [0.0].into(), factor };
    let mut w = World::new(row.into_iter().collect(), Vec::new(), vec![load], set);
    w.form_bonds(1e-6, |_| R_COH, MU);
    let before = (w.grains.clone(), w.bonds.clone(), w.ledger, w.time, w.steps);
    let error = w.step().unwrap_err();
    // the second half failed: the error has its time
    assert!(matches!(error, StepError::NotAccepted { time, .. } if time == 0.5e-4), "{error}");
    assert_eq!(before.0.position, w.grains.position);
    assert_eq!((before.1, before.2, before.3, before.4), (w.bonds.clone(), w.ledger, w.time, w.steps));
}

#[test]
fn a_force_driven_wall_on_a_fixed_grain_carries_its_force() {
    let mut held = grain::<D2>(&[0.0, 0.01], 0.01);
    held.fixed = true;
    let lid = common::force_driven::<D2>([0.0, -1.0].into(), [0.0, 0.02].into(), 1.0, 10.0);
    let mut w = world(vec![held], vec![lid], settings(1e-4));
    w.step().unwrap();
    assert!((w.walls[0].reaction[1] - 10.0).abs() < 1e-9, "{}", w.walls[0].reaction[1]);
}

/// Pairs of grains that touch, far from each other: the first grain of each is fixed, the second is
/// pulled by a force (N) from a time on (s).
fn pairs(rule: Rupture, pulls: &[(f64, f64)]) -> World<D2> {
    let (mut grains, mut loads) = (Vec::new(), Vec::new());
    for (k, &(force, from)) in pulls.iter().enumerate() {
        let y = 10.0 * A * k as f64;
        let mut held = grain::<D2>(&[0.0, y], 0.5 * A);
        held.fixed = true;
        grains.extend([held, grain(&[A, y], 0.5 * A)]);
        let factor = Arc::new(move |t| if t > from { 1.0 } else { 0.0 });
        loads.push(Load { grain: 2 * k + 1, force: [force, 0.0].into(), torque: [0.0].into(), factor });
    }
    let mut set = settings(1e-4);
    set.rupture = rule;
    let mut w = World::new(grains.into_iter().collect(), Vec::new(), loads, set);
    w.form_bonds(1e-6, |_| R_COH, MU);
    assert_eq!(w.bonds.len(), pulls.len());
    w
}

#[test]
fn the_worst_bond_breaks_first() {
    // beyond the limit by 5 N, 25 N, 15 N and not at all
    let mut w = pairs(Rupture::CascadeWorst, &[(15.0, 0.0), (35.0, 0.0), (25.0, 0.0), (5.0, 0.0)]);
    let mut told = Vec::new();
    let breaks = w.step_watched(&mut |broken| told.push(broken)).unwrap().breaks;
    assert_eq!(breaks.iter().map(|b| (b.bond, b.round)).collect::<Vec<_>>(), [(1, 0), (2, 1), (0, 2)]);
    assert_eq!(told, [1, 2, 3]);
}

#[test]
fn rounds_of_a_step_in_halves_are_counted_on() {
    // a grain would pass through a wall in the whole step, but not in half a step; bonds fail in
    // each half, whose loads are those of its middle: 0.25e-4 and 0.75e-4 s
    for rule in [Rupture::Cascade, Rupture::CascadeWorst] {
        let mut w = pairs(rule, &[(15.0, 0.0), (25.0, 0.5e-4), (35.0, 0.5e-4)]);
        let wall = Wall::fixed(Shape::Plane { normal: [-1.0, 0.0].into() }, [1.0, 0.0].into(), 0.0);
        w.walls.push(wall);
        let mut bullet = grain::<D2>(&[1.0 - 0.5 * A, 100.0 * A], 0.5 * A);
        bullet.velocity = [0.75 * A / 1e-4, 0.0].into();
        w.grains.push(bullet);
        let mut told = Vec::new();
        let report = w.step_watched(&mut |broken| told.push(broken)).unwrap();
        let found: Vec<_> = report.breaks.iter().map(|b| (b.bond, b.round)).collect();
        let (expected, counts): (&[_], &[_]) = match rule {
            Rupture::Cascade => (&[(0, 0), (1, 1), (2, 1)], &[1, 3]),
            _ => (&[(0, 0), (2, 1), (1, 2)], &[1, 2, 3]),
        };
        assert_eq!(found, expected, "{rule:?}");
        // the refused whole step also reported counts, before those of the halves
        assert!(told.ends_with(counts), "{told:?}");
        assert_eq!((report.rejected, w.time), (0, 1e-4));
    }
}
