//! The limit load: closed forms, an independent conic solver, and the first break of runs.

use crate::common::{DENSITY, bonded_pair, down, floor, grain, settings, world};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{self, NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver};
use dem_core::body::{Drive, Grain, Load, Shape, Wall};
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect};
use dem_core::solver::SolverSettings;
use dem_core::solver::limit_load::LimitLoad;
use dem_core::world::World;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::PI;
use std::sync::Arc;

/// The factor of the loads that a world has one second after its start, over those at its start.
fn limit<D: Dim>(world: &mut World<D>) -> f64 {
    match world.limit_load(0.0, 1.0) {
        LimitLoad::Factor { lower, upper } => {
            assert!((upper - lower).abs() <= 1e-9 * upper.abs().max(1e-300), "{lower} to {upper}");
            0.5 * (lower + upper)
        }
        other => panic!("{other:?}"),
    }
}

fn close(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 1e-8,
        "{found} instead of {expected}: off by {:e}",
        found / expected - 1.0
    );
}

/// A load that grows by this force (N) and torque (N m) a second.
fn growing<D: Dim>(grain: usize, force: &[f64], torque: &[f64]) -> Load<D> {
    let (force, torque) = (D::Vector::from_slice(force), D::Spin::from_slice(torque));
    Load { grain, force, torque, factor: Arc::new(|t| t) }
}

/// Bonded disks of radius 1 mm in a row along x, the first one fixed, with r_coh = 10 N.
fn row(count: u32) -> World<D2> {
    let mut grains: Vec<Grain<D2>> = (0..count).map(|k| grain(&[2e-3 * f64::from(k), 0.0], 1e-3)).collect();
    grains[0].fixed = true;
    let mut world = world(grains, vec![], settings(1e-4));
    world.form_bonds(1e-6, |_| 10.0, 0.3);
    world
}

#[test]
fn two_grains_bear_what_their_bond_bears() {
    let (r_coh, mu, a) = (10.0, 0.3, 2e-3);
    for angle in [0.0, 0.3, 1.0, 0.5 * PI] {
        let (pull, shear) = (f64::cos(angle), f64::sin(angle));
        // r_n = −F cos, ‖t‖ = F sin at most μ (r_n + r_coh); the moment F sin a/2 stays below
        let expected = if angle == 0.0 { r_coh } else { mu * r_coh / (shear + mu * pull) };
        close(limit(&mut bonded_pair(r_coh, [pull, shear], 0.0)), expected);
    }
    close(limit(&mut bonded_pair(r_coh, [0.0, 0.0], 1e-3)), mu * a * r_coh / 1e-3);
    // pressed at any angle within the friction cone the bond bears everything
    assert_eq!(bonded_pair(r_coh, [-1.0, 0.0], 0.0).limit_load(0.0, 1.0), LimitLoad::Unbounded);
    assert_eq!(bonded_pair(r_coh, [-1.0, 0.29], 0.0).limit_load(0.0, 1.0), LimitLoad::Unbounded);
    // beyond it not: F (0.32 − μ) = μ r_coh
    close(limit(&mut bonded_pair(r_coh, [-1.0, 0.32], 0.0)), mu * r_coh / 0.02);
}

#[test]
fn a_row_bears_its_weakest_bond_and_bends_at_its_root() {
    let mut pulled = row(8);
    let strengths = [9.0, 7.0, 8.0, 3.25, 6.0, 4.0, 5.0];
    pulled.bonds.iter_mut().zip(strengths).for_each(|(bond, s)| bond.strength = s);
    pulled.loads.push(growing(7, &[2.0, 0.0], &[0.0]));
    close(limit(&mut pulled), 3.25 / 2.0);
    // across, the bond at the root bends by F (N − 3/2) a, at most ν a r_coh
    for count in [2, 3, 8, 100] {
        let mut bent = row(count);
        bent.loads.push(growing(count as usize - 1, &[0.0, -1.0], &[0.0]));
        close(limit(&mut bent), f64::min(0.3 * 10.0, 0.3 * 10.0 / (f64::from(count) - 1.5)));
    }
}

/// The tip of a row is pulled obliquely. The force F and the moment of its cross part at the middle
/// of the first bond meet its rolling limit: 0.2 · 1.5 a F = ν a (r_coh − F), so that F = r_coh/2.
#[test]
fn far_stronger_bonds_do_not_hide_the_limit_of_a_weak_one() {
    for strong in [1.0, 1e3, 1e7, 1e12] {
        let mut world = row(3);
        world.bonds[1].strength *= strong;
        world.loads = vec![growing(2, &[1.0, 0.2], &[0.0])];
        close(limit(&mut world), 5.0);
    }
}

#[test]
fn a_leaf_beside_a_grain_that_nothing_presses_hides_no_limit() {
    // a sphere with one bond turns about its axis; a contact without load is softer by many orders
    for pull in [1.0, 1e-3] {
        let at = |x: f64, y: f64| grain::<D3>(&[x, y, 0.0], 1e-3);
        let mut grains = vec![at(0.0, 0.0), at(2e-3, 0.0), at(2e-3, 2e-3), at(2e-3, -2.002e-3)];
        grains[0].fixed = true;
        let mut world = world(grains, vec![], settings(1e-4));
        world.form_bonds(1e-6, |_| 10.0, 0.3);
        assert_eq!(world.bonds.len(), 2);
        world.loads.push(growing(1, &[pull, 0.0, 0.0], &[0.0; 3]));
        close(limit(&mut world), 10.0 / pull);
    }
}

#[test]
fn grains_that_a_wall_holds_are_part_of_it() {
    // disks in a row, of which walls hold the first and the last
    let held = |count: u32, angle: f64| {
        let disks = (0..count).map(|k| grain::<D2>(&[1e-3 + 2e-3 * f64::from(k), 0.0], 1e-3)).collect();
        let wall = |side: f64, x: f64| {
            let shape = Shape::Plane { normal: [side, 0.0].into() };
            Wall { grip: Some(0.5e-3), ..Wall::fixed(shape, [x, 0.0].into(), 0.3) }
        };
        let (left, mut right) = (wall(1.0, 0.0), wall(-1.0, 2e-3 * f64::from(count)));
        let direction = [angle.cos(), angle.sin()].into();
        right.drive = Drive::Force { direction, mass: 1.0, force: Arc::new(|t| 2.0 * t) };
        let mut world = world(disks, vec![left, right], settings(1e-4));
        world.form_bonds(1e-6, |_| 10.0, 0.3);
        assert_eq!((world.grains_held_by(0), world.grains_held_by(1)), (1, 1));
        world.bonds[1].strength = 4.0;
        world
    };
    for count in [3, 4, 10] {
        for angle in [0.0, 0.3, 1.0] {
            // the wall bears what is across its way: the weakest bond is pulled along the row
            close(limit(&mut held(count, angle)), 4.0 * f64::cos(angle) / 2.0);
        }
        // walls that cannot part may press on the row as hard as they like
        assert_eq!(held(count, 0.5 * PI).limit_load(0.0, 1.0), LimitLoad::Unbounded);
    }
}

/// A velocity drives a wall: its limit is that of a force in its way, under the loads of the
/// moment.
#[test]
fn a_wall_that_moves_has_the_limit_of_its_force() {
    // a row of disks, of which walls hold the first and the last
    let moved = |speed: f64| {
        let disks = (0..4).map(|k| grain::<D2>(&[1e-3 + 2e-3 * f64::from(k), 0.0], 1e-3)).collect();
        let wall = |side: f64, x: f64| {
            let shape = Shape::Plane { normal: [side, 0.0].into() };
            Wall { grip: Some(0.5e-3), ..Wall::fixed(shape, [x, 0.0].into(), 0.3) }
        };
        let (left, mut right) = (wall(1.0, 0.0), wall(-1.0, 8e-3));
        right.drive = Drive::Velocity { direction: [2.0, 0.0].into(), speed: Arc::new(move |_| speed) };
        let mut world = world(disks, vec![left, right], settings(1e-4));
        world.form_bonds(1e-6, |_| 10.0, 0.3);
        world.bonds[0].strength = 7.0;
        world
    };
    let unit = |velocity: Option<<D2 as Dim>::Vector>| velocity.expect("it moves").normalize();
    for mut world in [moved(1e-3), moved(1e3)] {
        let direction = unit(world.motion_of_drive(1));
        let LimitLoad::Factor { lower, upper } = world.limit_of_force(1, direction) else { panic!("no limit") };
        close(0.5 * (lower + upper), 7.0);
        // the second bond is pulled by a load of the moment, in the way of the wall
        let (force, torque) = ([3.0, 0.0].into(), <D2 as Dim>::Spin::zero());
        world.loads = vec![Load { grain: 1, force, torque, factor: Arc::new(|_| 1.0) }];
        let direction = unit(world.motion_of_drive(1));
        let LimitLoad::Factor { lower, upper } = world.limit_of_force(1, direction) else { panic!("no limit") };
        close(0.5 * (lower + upper), 4.0);
        assert!(matches!(world.walls[1].drive, Drive::Velocity { .. }), "its drive is as before");
    }
    let mut back = moved(-1e-3);
    let direction = unit(back.motion_of_drive(1));
    assert_eq!(back.limit_of_force(1, direction), LimitLoad::Unbounded);
    let still = moved(0.0);
    assert_eq!((still.motion_of_drive(0), still.motion_of_drive(1)), (None, None));
}

/// A beam of 2 n + 1 disks on two round supports without friction, loaded at its middle.
fn beam(n: u32) -> World<D2> {
    let grains = (0..2 * n + 1).map(|k| grain(&[2e-3 * f64::from(k), 0.0], 1e-3)).collect();
    let support = |x: f64| {
        let shape = Shape::Round { radius: 1e-3, inside: false, axis: None };
        Wall::fixed(shape, [x, -2e-3].into(), 0.0)
    };
    let mut world = world(grains, vec![support(0.0), support(4e-3 * f64::from(n))], settings(1e-4));
    world.form_bonds(1e-6, |_| 10.0, 0.3);
    world.loads.push(growing(n as usize, &[0.0, -1.0], &[0.0]));
    world
}

#[test]
fn a_beam_in_three_point_bending_breaks_beside_its_middle() {
    // the moment F/2 (n − 1/2) a in the bonds beside the middle, at most ν a r_coh
    for n in [1, 2, 10, 40] {
        let bending = 2.0 * 0.3 * 10.0 / (f64::from(n) - 0.5);
        close(limit(&mut beam(n)), bending.min(2.0 * 0.3 * 10.0));
    }
    // two supports without friction do not hold it along x
    let mut pushed = beam(3);
    pushed.loads[0] = growing(3, &[1.0, -1.0], &[0.0]);
    assert!(limit_is_zero(&mut pushed));
}

fn limit_is_zero(world: &mut World<D2>) -> bool {
    let LimitLoad::Factor { lower, upper } = world.limit_load(0.0, 1.0) else { return false };
    lower.abs() < 1e-7 && upper.abs() < 1e-7
}

#[test]
fn weight_is_borne_first() {
    // a hanging row: the weight of all below the first bond, then the pull
    let weight = 9.81 * DENSITY * PI * 1e-6;
    let hanging = |r_coh: f64, pull: f64| {
        let mut world = row(6);
        world.bonds.iter_mut().for_each(|bond| bond.strength = r_coh);
        world.settings.gravity = Some([9.81, 0.0].into());
        world.loads.push(growing(5, &[pull, 0.0], &[0.0]));
        world
    };
    close(limit(&mut hanging(2.0, 1.0)), 2.0 - 5.0 * weight);
    // held up by the load, from some factor on
    let LimitLoad::BrokenAtStart { least, most } = hanging(4.0 * weight, -1.0).limit_load(0.0, 1.0) else { panic!() };
    close(least, weight);
    assert_eq!(most, None);
    // the growing load has another size than the weight
    let LimitLoad::BrokenAtStart { least, .. } = hanging(4.0 * weight, -1e8).limit_load(0.0, 1.0) else { panic!() };
    close(least, 1e-8 * weight);
    assert_eq!(hanging(4.0 * weight, 1e8).limit_load(0.0, 1.0), LimitLoad::NeverBalanced);
    // a shear of 5 N of which the bond bears 3 N, and a load against it
    let mut between = row(2);
    let up = Load { factor: Arc::new(|_| 5.0), ..growing(1, &[0.0, 1.0], &[0.0]) };
    between.loads = vec![up, growing(1, &[0.0, -1.0], &[0.0])];
    let LimitLoad::BrokenAtStart { least, most } = between.limit_load(0.0, 1.0) else { panic!() };
    close(least, 2.0);
    close(most.expect("a largest factor"), 8.0);
    // a load that does not help: the fifth bond from the end carries five weights
    let mut sideways = hanging(4.0 * weight, 0.0);
    sideways.loads[0] = growing(5, &[0.0, 1.0], &[0.0]);
    assert_eq!(sideways.limit_load(0.0, 1.0), LimitLoad::NeverBalanced);
    assert_eq!(hanging(4.0 * weight, 1.0).limit_load(0.0, 1.0), LimitLoad::NeverBalanced);
}

/// A disk between two fixed walls bears any load along them, in both directions: self-stress and
/// friction balance it. That says nothing of a second disk that falls.
#[test]
fn a_load_that_is_always_borne_does_not_hide_a_weight_that_is_not() {
    let answer = |falls: bool, load: f64| {
        let mut grains: Vec<Grain<D2>> = vec![grain(&[0.0, 1e-3], 1e-3)];
        if falls {
            grains.push(grain(&[1.0, 1e-3 + 1e-4], 1e-3));
        }
        let ceiling = Wall::fixed(Shape::Plane { normal: [0.0, -1.0].into() }, [0.0, 2e-3].into(), 0.3);
        let mut set = settings(1e-4);
        set.gravity = down::<D2>(9.81);
        let mut world = world(grains, vec![floor::<D2>(0.3), ceiling], set);
        world.loads.push(growing(0, &[load, 0.0], &[0.0]));
        world.limit_load(0.0, 1.0)
    };
    for load in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        assert_eq!(answer(false, load), LimitLoad::Unbounded, "{load} N");
        assert_eq!(answer(true, load), LimitLoad::NeverBalanced, "{load} N");
    }
}

#[test]
fn dry_contacts_bear_what_friction_bears() {
    // two disks that a strong bond joins stand on a floor and are pushed along it: they slide at
    // μ times their weight, before they tip
    let weight = 9.81 * DENSITY * PI * 1e-6;
    let mut grains: Vec<Grain<D2>> = (0..2).map(|k| grain(&[2e-3 * f64::from(k), 1e-3], 1e-3)).collect();
    let stand = |grains: Vec<Grain<D2>>, mu: f64, r_coh: f64| {
        let mut set = settings(1e-4);
        set.gravity = down::<D2>(9.81);
        let mut world = world(grains, vec![floor::<D2>(mu)], set);
        world.form_bonds(1e-6, |_| r_coh, 10.0);
        world.loads.push(growing(0, &[1.0, 0.0], &[0.0]));
        world
    };
    close(limit(&mut stand(grains.clone(), 0.3, 1e3)), 0.3 * 2.0 * weight);
    // with much friction they tip about the front disk: F R = W 2 R
    close(limit(&mut stand(grains.clone(), 5.0, 1e3)), 2.0 * weight);
    // a disk above the floor, with nothing under it
    grains.truncate(1);
    grains[0].position[1] += 1e-3;
    assert_eq!(stand(grains, 0.3, 1.0).limit_load(0.0, 1.0), LimitLoad::Unsupported { grains: vec![0] });
}

/// A row that hangs at a fixed grain, and two bonded grains beside it that fall: what their bond
/// bears is no limit, and a fixed grain is a support.
#[test]
fn grains_that_fall_are_named() {
    let places = [[0.0, 0.0], [2e-3, 0.0], [1e-2, 1e-2], [1.2e-2, 1e-2]];
    let mut grains = places.map(|place| grain::<D2>(&place, 1e-3));
    grains[0].fixed = true;
    let mut world = world(grains.to_vec(), vec![], settings(1e-4));
    world.loads.push(growing(1, &[1.0, 0.0], &[0.0]));
    world.settings.gravity = Some([9.81, 0.0].into());
    world.form_bonds(1e-6, |_| 1.0, 0.3);
    assert_eq!(world.limit_load(0.0, 1.0), LimitLoad::Unsupported { grains: vec![2, 3] });
}

/// A block of bonded grains on a lattice, with random radii, strengths and coefficients; a layer is
/// fixed and some others are loaded.
fn block<D: Dim>(seed: u64, side: u32, weight: bool) -> World<D> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut grains = Vec::new();
    for k in 0..side.pow(D::N as u32) {
        let x: Vec<f64> = (0..D::N as u32).map(|c| 2.0 * f64::from((k / side.pow(c)) % side)).collect();
        let mut g = grain::<D>(&x, 0.98 + 0.02 * rng.random::<f64>());
        g.fixed = x[D::N - 1] == 0.0;
        grains.push(g);
    }
    let count = grains.len();
    let mut set = settings::<D>(1e-3);
    if weight {
        set.gravity = down::<D>(1e-6);
    }
    let mut world = world(grains, vec![], set);
    world.form_bonds(0.03, |_| 1.0, 0.3);
    world.limit_twist(0.2);
    for bond in &mut world.bonds {
        bond.strength = 0.5 + rng.random::<f64>();
        (bond.shear, bond.rolling) = (0.2 + 0.5 * rng.random::<f64>(), 0.1 + 0.3 * rng.random::<f64>());
    }
    for _ in 0..3 {
        let k = rng.random_range(0..count);
        let mut signed = |_| rng.random::<f64>() - 0.5;
        let force: Vec<f64> = (0..D::N).map(&mut signed).collect();
        let torque: Vec<f64> = (0..D::Spin::LEN).map(&mut signed).collect();
        world.loads.push(growing(k, &force, &torque));
    }
    world
}

fn cross(a: &[f64], b: &[f64]) -> Vec<f64> {
    match a.len() {
        2 => vec![a[0] * b[1] - a[1] * b[0]],
        _ => (0..3).map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]).collect(),
    }
}

/// The limit load by Clarabel, from positions, radii and bonds alone. The unknowns are for each
/// bond the force on its first grain and the moment, along the axes of space, and last λ.
fn by_clarabel<D: Dim>(world: &World<D>, twists: bool) -> f64 {
    let (d, spins) = (D::N, D::Spin::LEN);
    let (each, body, g) = (d + spins, d + spins, &world.grains);
    let unknowns = each * world.bonds.len() + 1;
    let height_of_balance = body * g.len();
    let mut list: Vec<(usize, usize, f64)> = Vec::new();
    let mut right = vec![0.0; height_of_balance];
    // s = b − A x; fixed grains have no row: 0 = 0
    for (k, fixed) in g.fixed.iter().enumerate().filter(|(_, fixed)| !**fixed) {
        let _ = fixed;
        let gravity = world.settings.gravity.unwrap_or(D::Vector::zero());
        for axis in 0..d {
            right[body * k + axis] = -g.mass[k] * gravity[axis];
        }
    }
    for load in world.loads.iter().filter(|load| !g.fixed[load.grain]) {
        for axis in 0..d {
            list.push((body * load.grain + axis, unknowns - 1, load.force[axis]));
        }
        for axis in 0..spins {
            list.push((body * load.grain + d + axis, unknowns - 1, load.torque[axis]));
        }
    }
    let mut cones = vec![ZeroConeT(height_of_balance)];
    let mut height = height_of_balance;
    for (b, bond) in world.bonds.iter().enumerate() {
        let [i, j] = bond.pair.map(|k| k as usize);
        let at = each * b;
        let apart = g.position[i] - g.position[j];
        let n: Vec<f64> = apart.as_slice().iter().map(|x| x / apart.norm()).collect();
        let lever = [-(g.radius[i] + 0.5 * bond.rest_gap), g.radius[j] + 0.5 * bond.rest_gap];
        for (side, (grain, lever)) in [i, j].into_iter().zip(lever).enumerate().filter(|(_, (k, _))| !g.fixed[*k]) {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            for axis in 0..d {
                let mut e = vec![0.0; d];
                e[axis] = sign;
                list.push((body * grain + axis, at + axis, sign));
                let arm: Vec<f64> = n.iter().map(|n| n * lever).collect();
                let torque = cross(&arm, &e);
                torque.iter().enumerate().for_each(|(k, x)| list.push((body * grain + d + k, at + axis, *x)));
            }
            (0..spins).for_each(|k| list.push((body * grain + d + k, at + d + k, sign)));
        }
        // n·f + r_coh times the coefficient, before the vector that it bounds
        let mut limit = |coefficient: f64, rows: Vec<Vec<(usize, f64)>>, kind: SupportedConeT<f64>| {
            (0..d).for_each(|axis| list.push((height, at + axis, -coefficient * n[axis])));
            right.push(coefficient * bond.strength);
            for (k, row) in rows.iter().enumerate() {
                row.iter().for_each(|(unknown, factor)| list.push((height + 1 + k, *unknown, -factor)));
                right.push(0.0);
            }
            height += 1 + rows.len();
            cones.push(kind);
        };
        // f − n (n·f), and m − n (n·m)
        let across = |first: usize| -> Vec<Vec<(usize, f64)>> {
            let entry = |r: usize, c: usize| if r == c { 1.0 } else { 0.0 } - n[r] * n[c];
            (0..d).map(|r| (0..d).map(|c| (at + first + c, entry(r, c))).collect()).collect()
        };
        limit(1.0, vec![], NonnegativeConeT(1));
        limit(bond.shear, across(0), SecondOrderConeT(1 + d));
        let arm = bond.mean_diameter;
        match d {
            2 => limit(arm * bond.rolling, vec![vec![(at + d, 1.0)]], SecondOrderConeT(2)),
            _ => {
                limit(arm * bond.rolling, across(d), SecondOrderConeT(1 + d));
                let along: Vec<(usize, f64)> = (0..d).map(|c| (at + d + c, n[c])).collect();
                // without a twist row the bond bears no moment about its normal
                limit(if twists { arm * bond.twist } else { 0.0 }, vec![along], SecondOrderConeT(2));
            }
        }
    }
    let (at, factors): (Vec<(usize, usize)>, Vec<f64>) = list.into_iter().map(|(i, j, x)| ((i, j), x)).unzip();
    let (i, j) = at.into_iter().unzip();
    let constraint = CscMatrix::new_from_triplets(height, unknowns, i, j, factors);
    let mut cost = vec![0.0; unknowns];
    cost[unknowns - 1] = -1.0;
    let mut settings = DefaultSettingsBuilder::default();
    settings.verbose(false).max_iter(200).tol_gap_abs(1e-11).tol_gap_rel(1e-11).tol_feas(1e-11);
    let settings = settings.build().expect("settings");
    let none = CscMatrix::zeros((unknowns, unknowns));
    let mut solver = DefaultSolver::new(&none, &cost, &constraint, &right, &cones, settings).expect("a problem");
    solver.solve();
    solver.solution.x[unknowns - 1]
}

fn agrees<D: Dim>(seed: u64, side: u32, weight: bool, twists: bool) {
    let mut world = block::<D>(seed, side, weight);
    let (found, expected) = (limit(&mut world), by_clarabel(&world, twists));
    assert!((found / expected - 1.0).abs() < 1e-7, "seed {seed}: {found} and {expected} by Clarabel");
}

#[test]
fn an_independent_solver_finds_the_same_in_2d_and_3d() {
    for seed in 0..12 {
        agrees::<D2>(seed, 5, seed % 2 == 0, false);
        agrees::<D3Twist>(seed, 3, seed % 2 == 0, true);
        agrees::<D3>(seed, 3, seed % 2 == 1, false);
    }
}

#[test]
fn the_unit_of_force_and_the_size_of_the_load_do_not_matter() {
    let mut world = block::<D2>(3, 5, true);
    let expected = limit(&mut world);
    for factor in [1e-12, 1e9] {
        let mut other = block::<D2>(3, 5, true);
        other.loads.iter_mut().for_each(|load| {
            load.force *= factor;
            load.torque *= factor;
        });
        close(limit(&mut other), expected / factor);
        other.settings.gravity = down::<D2>(1e-6 * factor);
        other.bonds.iter_mut().for_each(|bond| bond.strength *= factor);
        close(limit(&mut other), expected);
    }
}

/// A fixed row under random bonded grains, which a lid presses or loads pull.
fn quasi_static(seed: u64) -> World<D2> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut world = block::<D2>(seed, rng.random_range(2..5), seed.is_multiple_of(3));
    world.settings.solver = SolverSettings::default();
    world.settings.step = 1e-2;
    if seed.is_multiple_of(2) {
        let high = world.grains.position.iter().zip(&world.grains.radius).map(|(x, r)| x[1] + r).fold(0.0, f64::max);
        let direction: [f64; 2] = [0.0, -1.0];
        let mut lid = Wall::fixed(Shape::Plane { normal: direction.into() }, [0.0, high].into(), 0.2);
        let mass = world.grains.mass.iter().sum();
        lid.drive = Drive::Force { direction: direction.into(), mass, force: Arc::new(|t| 0.2 * t) };
        let (grains, loads, set) = (world.grains.clone(), world.loads.clone(), world.settings.clone());
        let bonds = world.bonds.to_vec();
        world = World::new(grains, vec![lid], loads, set);
        world.add_bonds(bonds);
    }
    world
}

#[test]
fn the_first_break_comes_before_the_limit() {
    let (mut reached, mut bounded) = (0, 0);
    for seed in 0.. {
        if bounded == 50 {
            break;
        }
        let mut world = quasi_static(seed);
        // some loads press on what bears everything
        if world.limit_load(0.0, 1.0) == LimitLoad::Unbounded {
            assert!(seed < 100, "{bounded} scenes of {seed} are bounded");
            continue;
        }
        bounded += 1;
        let (limit, step) = (limit(&mut world), world.settings.step);
        assert!(limit > 0.0);
        let broken = loop {
            let report = world.step().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            if !report.breaks.is_empty() {
                break report.time;
            }
            assert!(
                world.time < 2.0 * limit + 10.0 * step,
                "seed {seed}: nothing breaks up to twice the limit {limit} s"
            );
        };
        // loads grow with time, and a step bears that of its middle
        let load = broken - 0.5 * step;
        assert!(load <= limit + step, "seed {seed}: the first bond breaks at {load} s, beyond the limit {limit} s");
        reached += usize::from(load > 0.5 * limit);
    }
    // the bound is of the size of the loads: 0.1 to 0.85 of it break the first bond, 0.4 on average
    assert!(reached >= 15, "{reached} of 50 bear half the limit");
}

/// A loose disk beside a rough wall rolls down it, whatever pulls at the others: the mechanism has
/// no bound where it also leaves the wall.
#[test]
fn a_loose_grain_beside_a_rough_wall_is_not_borne() {
    let mut grains: Vec<Grain<D2>> = [[0.0, 1e-3], [0.0, 3e-3], [5e-3, 3e-3]].iter().map(|x| grain(x, 1e-3)).collect();
    grains[0].fixed = true;
    let mut wall = Wall::fixed(Shape::Plane { normal: [-1.0, 0.0].into() }, [6e-3, 0.0].into(), 0.0);
    for friction in [0.0, 0.3] {
        wall.friction = friction;
        let mut set = settings(1e-4);
        set.gravity = Some([0.0, -9.81].into());
        let mut w = World::new(
            grains.iter().cloned().collect(),
            vec![wall.clone()],
            vec![growing(1, &[1.0, 0.0], &[0.0])],
            set,
        );
        w.form_bonds(1e-6, |_| 10.0, 0.3);
        assert_eq!(w.limit_load(0.0, 1.0), LimitLoad::NeverBalanced, "friction {friction}");
    }
}
