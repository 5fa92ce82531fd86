//! A world restored from its saved state continues bit for bit.

use crate::common::{self, pressed};
use dem_core::body::{Drive, Grains, Shape, Wall};
use dem_core::bond::Stiffness;
use dem_core::contact::BondFlow;
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect};
use dem_core::saved::{Mismatch, Saved};
use dem_core::solver::{SolverSettings, StagedSettings, Stages, StiffnessRatio};
use dem_core::world::World;
use std::sync::Arc;

fn settings() -> StagedSettings {
    let stiffness = StiffnessRatio { tangential: 0.5, rolling: 0.1 };
    StagedSettings { stiffness, ..common::newton(1e-8, 1e-4, 1e-5) }
}

fn saved<D: Dim>(world: &World<D>) -> Saved {
    let mut saved = Saved::default();
    world.save(&mut saved);
    saved
}

/// The world restored from `saved`; walls, loads and settings are those of `like`.
fn restored<D: Dim>(saved: &Saved, like: &World<D>) -> Result<World<D>, Mismatch> {
    let mut from = saved.read();
    let grains = Grains::restored(&mut from)?;
    let world = World::restored(grains, like.walls.clone(), like.loads.clone(), like.settings.clone(), &mut from)?;
    from.end()?;
    Ok(world)
}

fn bits(saved: &Saved) -> (Vec<u64>, &[u64]) {
    (saved.reals.iter().map(|x| x.to_bits()).collect(), &saved.counts)
}

/// Every public number of a world, read from its fields and not from its saved state.
fn shown<D: Dim>(w: &World<D>) -> Vec<u64> {
    let mut all: Vec<f64> = Vec::new();
    let g = &w.grains;
    let vectors = g.position.iter().chain(&g.velocity);
    vectors.for_each(|v| all.extend_from_slice(v.as_slice()));
    g.spin.iter().for_each(|v| all.extend_from_slice(v.as_slice()));
    g.orientation.iter().for_each(|v| all.extend_from_slice(v.as_slice()));
    [&g.radius, &g.mass, &g.inertia].iter().for_each(|list| all.extend_from_slice(list));
    for wall in &w.walls {
        [wall.position, wall.velocity, wall.reaction].iter().for_each(|v| all.extend_from_slice(v.as_slice()));
        all.push(wall.applied);
    }
    for b in &w.bonds {
        all.extend([b.rest_gap, b.mean_diameter, b.strength, b.shear, b.rolling, b.twist]);
        all.extend(b.stiffness.iter().flat_map(|k| [k.normal, k.tangential, k.rolling, k.twist]));
    }
    for t in w.touches() {
        all.extend_from_slice(D::normal(&t.frame).as_slice());
        all.extend_from_slice(D::tangent(&t.frame).as_slice());
        all.extend_from_slice(t.point.as_slice());
        all.extend([t.gap, t.reaction.n]);
        all.extend_from_slice(t.reaction.t.as_slice());
        all.extend_from_slice(t.reaction.m.as_slice());
    }
    let l = &w.ledger;
    all.extend([
        l.kinetic,
        l.external_work,
        l.impact,
        l.friction,
        l.bonds,
        l.elastic,
        l.damping,
        l.fracture,
        l.remainder,
    ]);
    all.extend([w.time, w.reference_volume(), w.kinetic_energy()]);
    all.extend(w.stress().into_iter().chain(w.strain()));
    let mut bits: Vec<u64> = all.into_iter().map(f64::to_bits).collect();
    bits.push(w.steps);
    bits.extend(g.fixed.iter().map(|fixed| u64::from(*fixed)));
    bits.extend(w.bonds.iter().flat_map(|b| [u64::from(b.pair[0]), u64::from(b.pair[1]), b.status as u64]));
    let touch = |t: dem_core::world::Touch<D>| {
        [u64::from(t.pair[0]), u64::from(t.pair[1]), t.bond.map_or(u64::MAX, u64::from), t.status as u64]
    };
    bits.extend(w.touches().flat_map(touch));
    bits
}

/// Saves a world after each of some steps, and continues with it and with a restored one.
fn goes_on<D: Dim>(mut world: World<D>, solver: SolverSettings) -> World<D> {
    world.set_solver(solver);
    let mut broken = 0;
    for steps in [1, 2, 7, 12] {
        common::run(&mut world, steps);
        let state = saved(&world);
        let mut other = restored(&state, &world).expect("the state of this world");
        assert_eq!(bits(&saved(&other)), bits(&state), "what is restored is what was saved");
        assert_eq!(shown(&other), shown(&world), "what is restored shows what was");
        for _ in 0..8 {
            let (a, b) = (world.step().expect("a step"), other.step().expect("a step"));
            broken += a.breaks.len();
            assert_eq!((a.work, a.residual.to_bits()), (b.work, b.residual.to_bits()));
            assert_eq!(bits(&saved(&world)), bits(&saved(&other)), "step {}", world.steps);
            assert_eq!(shown(&world), shown(&other), "step {}", world.steps);
        }
    }
    assert!(broken == 0 || broken < world.bonds.len());
    world
}

#[test]
fn a_state_goes_on_to_the_bit_with_every_solver() {
    let [newton, auto] =
        [Stages::Newton, Stages::All].map(|stages| SolverSettings::Staged(StagedSettings { stages, ..settings() }));
    for solver in [newton, auto, common::solver(1e-6)] {
        let world = goes_on(pressed::<D2>(3, 8, 0.3, Some(BondFlow::Associated)), solver);
        assert!(world.intact_bonds() > 0 && world.intact_bonds() < world.bonds.len(), "some bonds broke");
        goes_on(pressed::<D3>(3, 4, 0.3, Some(BondFlow::Associated)), solver);
        goes_on(pressed::<D2>(5, 8, 0.3, None), solver);
        goes_on(pressed::<D2>(5, 8, 0.0, None), solver);
    }
    let mut elastic = pressed::<D2>(3, 8, 0.3, Some(BondFlow::Associated));
    elastic.make_bonds_elastic(|_| Stiffness { normal: 1e6, tangential: 4e5, rolling: 10.0, twist: 0.0 });
    goes_on(elastic, auto);
    let mut twisting = pressed::<D3Twist>(3, 3, 0.3, Some(BondFlow::Associated));
    twisting.make_bonds_elastic(|_| Stiffness { normal: 1e6, tangential: 4e5, rolling: 10.0, twist: 8.0 });
    twisting.grains.fixed[4] = true;
    (twisting.grains.velocity[4], twisting.grains.spin[4]) = (Vect::zero(), Vect::zero());
    goes_on(twisting, auto);
}

#[test]
fn a_state_goes_on_between_steps_that_are_predicted() {
    // a bonded row at rest on a floor
    let mut set = common::settings(1e-3);
    set.gravity = common::down::<D2>(9.81);
    set.solver = SolverSettings::Staged(settings());
    let row = (0..5).map(|k| common::grain::<D2>(&[0.02 * f64::from(k), 0.01], 0.01)).collect();
    let mut world = common::world(row, vec![common::floor(0.2)], set);
    world.form_bonds(1e-6, |_| 1e3, 0.3);
    let mut predicted = 0;
    for _ in 0..60 {
        // a world restored before every step
        let mut other = restored(&saved(&world), &world).expect("the state of this world");
        let (report, again) = (world.step().expect("a step"), other.step().expect("a step"));
        assert_eq!(report.work, again.work);
        assert_eq!(bits(&saved(&world)), bits(&saved(&other)), "step {}", world.steps);
        predicted += usize::from(report.work.iterations() == 0);
    }
    assert!(predicted > 30, "{predicted}");
}

#[test]
fn a_step_that_fails_leaves_the_world_and_its_solver_as_they_were() {
    // a bonded column at rest below a lid that later reaches it
    let mut set = common::settings(1e-3);
    set.gravity = common::down::<D2>(9.81);
    set.solver = SolverSettings::Staged(settings());
    let column = (0..5).map(|k| common::grain::<D2>(&[0.0, 0.01 + 0.02 * f64::from(k)], 0.01)).collect();
    let lid = Wall {
        shape: Shape::Plane { normal: [0.0, -1.0].into() },
        position: [0.0, 0.1].into(),
        drive: Drive::Velocity {
            direction: [0.0, -1.0].into(),
            speed: Arc::new(|time| if time < 0.0205 { 0.0 } else { 0.1 }),
        },
        ..common::floor(0.2)
    };
    let mut world = common::world(column, vec![common::floor(0.2), lid], set);
    world.form_bonds(1e-6, |_| 1e3, 0.3);
    let mut before = saved(&world);
    let mut steps = 0;
    while world.step().is_ok() {
        before = saved(&world);
        steps += 1;
    }
    assert_eq!(steps, 20, "the lid begins to move");
    assert_eq!(bits(&saved(&world)), bits(&before));
    assert!(world.step().is_err(), "and once more");
    assert_eq!(bits(&saved(&world)), bits(&before));
}

#[test]
fn numbers_that_do_not_fit_are_refused() {
    let mut world = pressed::<D2>(3, 6, 0.3, Some(BondFlow::Associated));
    world.set_solver(SolverSettings::Staged(settings()));
    common::run(&mut world, 5);
    let state = saved(&world);
    // truncated anywhere, at either end of either list
    for cut in 0..state.counts.len() {
        let short = Saved { counts: state.counts[..cut].to_vec(), ..state.clone() };
        assert!(restored(&short, &world).is_err(), "{cut} counts");
    }
    for cut in (0..state.reals.len()).step_by(7) {
        let short = Saved { reals: state.reals[..cut].to_vec(), ..state.clone() };
        assert!(restored(&short, &world).is_err(), "{cut} reals");
    }
    // a changed count must cause neither a panic nor an unbounded allocation
    for place in 0..state.counts.len() {
        for value in [0, 1, 5, u64::MAX, u64::MAX / 16] {
            let mut wrong = state.clone();
            wrong.counts[place] = value;
            if let Ok(mut other) = restored(&wrong, &world) {
                let _ = other.step();
            }
        }
    }
    let walls = World::new(world.grains.clone(), Vec::new(), Vec::new(), world.settings.clone());
    assert!(restored(&state, &walls).is_err(), "other walls");
}

#[test]
fn bonds_that_are_added_between_steps_keep_the_numbers_of_the_others_right() {
    // a chain; at first its middle alone is bonded, so that later bonds come before and after it
    let mut set = common::settings(1e-4);
    set.solver = SolverSettings::Staged(settings());
    let chain = (0..5).map(|k| common::grain::<D2>(&[0.02 * f64::from(k), 0.0], 0.01)).collect();
    let mut world = common::world(chain, vec![], set);
    world.form_bonds(1e-6, |_| 5.0, 0.3);
    let middle = world.bonds[2];
    assert_eq!(world.bonds.iter().map(|b| b.pair).collect::<Vec<_>>(), [[0, 1], [1, 2], [2, 3], [3, 4]]);
    world.bonds = vec![middle].into();
    world.grains.velocity[2][1] = 1e-5;
    common::run(&mut world, 1);
    let carried = world.touches().find(|t| t.pair == [2, 3]).unwrap();
    assert!(carried.bond == Some(0) && carried.reaction.t.norm() > 0.0);
    // twice: pairs that have a bond keep it
    for _ in 0..2 {
        world.form_bonds(1e-2, |_| 7.0, 0.3);
        assert_eq!(world.bonds.iter().map(|b| b.strength).collect::<Vec<_>>(), [7.0, 7.0, 5.0, 7.0]);
    }
    let after = world.touches().find(|t| t.pair == [2, 3]).unwrap();
    assert_eq!((after.bond, after.reaction), (Some(2), carried.reaction));
    common::run(&mut world, 3);
    assert_eq!(world.touches().filter(|t| t.bond.is_some()).count(), 4);
}

#[test]
fn settings_that_change_between_steps_are_followed() {
    let mut world = pressed::<D2>(3, 6, 0.3, Some(BondFlow::Associated));
    common::run(&mut world, 2);
    let mut other = pressed::<D2>(3, 6, 0.3, Some(BondFlow::Associated));
    common::run(&mut other, 2);
    world.settings.solver = SolverSettings::Staged(settings());
    other.set_solver(SolverSettings::Staged(settings()));
    for _ in 0..3 {
        assert_eq!(world.step().unwrap().route, other.step().unwrap().route);
    }
    assert_eq!(bits(&saved(&world)), bits(&saved(&other)));
}
