//! The measures of a world against closed forms: stress, strain, volume.

use crate::common::{cell, down, floor, force_driven, grain, newton, run, settings, world};
use dem_core::body::{Drive, Grains, Load, Shape, Wall};
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::{Route, SolverSettings};
use dem_core::world::{Counts, World};
use std::sync::Arc;

const G: f64 = 9.81;

/// Compares the stress times the volume with the tensor Σ ℓ ⊗ f of the contacts (N m).
fn assert_stress<D: Dim>(w: &World<D>, expected: impl Fn(usize, usize) -> f64, tolerance: f64) {
    let stress = w.stress();
    assert_eq!(stress.len(), D::N * D::N);
    let size = (0..D::N * D::N).map(|k| expected(k / D::N, k % D::N).abs()).fold(0.0, f64::max);
    for row in 0..D::N {
        for col in 0..D::N {
            let (found, expected) = (stress[row * D::N + col] * w.reference_volume(), expected(row, col));
            assert!((found - expected).abs() <= tolerance * size, "{row} {col}: {found} against {expected}");
        }
    }
}

/// A grain that slides over a floor: the branch is normal to the floor, the force is inclined
/// against the motion.
fn sliding<D: Dim>() {
    let (r, mu) = (0.01, 0.25);
    let mut place = vec![0.0; D::N];
    place[D::N - 1] = r;
    let mut set = settings(1e-5);
    set.gravity = down::<D>(G);
    set.thickness = if D::N == 2 { 0.4 } else { 1.0 };
    let mut start = grain::<D>(&place, r);
    start.velocity[0] = 1.0;
    let mut w = world(vec![start], vec![floor(mu)], set);
    run(&mut w, 3);
    let volume = if D::N == 2 { 4.0 * r * r * 0.4 } else { 8.0 * r * r * r };
    assert!((w.reference_volume() / volume - 1.0).abs() < 1e-14);
    let weight = w.grains.mass[0] * G;
    let (last, force) = (D::N - 1, [-mu * weight, weight]);
    // ℓ = R e_last, f = −μ m g e_0 + m g e_last: the branch gives the row, the force the column
    let expected = |row: usize, col: usize| match (row == last, col) {
        (true, 0) => r * force[0],
        (true, col) if col == last => r * force[1],
        _ => 0.0,
    };
    assert_stress(&w, expected, 1e-9);
}

#[test]
fn the_stress_of_a_sliding_grain_has_the_branch_in_its_rows() {
    sliding::<D2>();
    sliding::<D3>();
}

/// A column of grains of several sizes between a floor and a lid: Σ ℓ f is the force times the
/// height.
fn column<D: Dim>() {
    let radii = [0.01, 0.006, 0.008, 0.005];
    let (mut grains, mut top) = (Vec::new(), 0.0);
    for r in radii {
        let mut place = vec![0.0; D::N];
        place[D::N - 1] = top + r;
        grains.push(grain::<D>(&place, r));
        top += 2.0 * r;
    }
    let mut normal = D::Vector::zero();
    normal[D::N - 1] = -1.0;
    let lid = force_driven::<D>(normal, normal * -top, 1.0, 7.0);
    let mut w = world(grains, vec![floor(0.2), lid], settings(1e-4));
    run(&mut w, 2);
    let last = D::N - 1;
    assert_stress(&w, |row, col| if row == last && col == last { 7.0 * top } else { 0.0 }, 1e-9);
}

#[test]
fn the_stress_of_a_column_is_its_load() {
    column::<D2>();
    column::<D3>();
}

/// A bonded column between walls that hold its ends, with a force on a grain between: the walls
/// bear it, and Σ ℓ ⊗ f is that of the forces on the column from outside, −Σ x ⊗ f.
#[test]
fn the_stress_of_a_column_that_walls_hold_counts_their_forces() {
    let (r, force) = (0.01, 5.0);
    let grains: Grains<D2> = (0..4).map(|k| grain(&[0.0, r + 2.0 * r * f64::from(k)], r)).collect();
    let lid = Wall::fixed(Shape::Plane { normal: [0.0, -1.0].into() }, [0.0, 8.0 * r].into(), 0.2);
    let held = [floor(0.2), lid].map(|wall| Wall { grip: Some(1e-3 * r), ..wall });
    let load = Load { grain: 1, force: [0.0, force].into(), torque: [0.0].into(), factor: Arc::new(|_| 1.0) };
    let mut w = World::new(grains, held.to_vec(), vec![load], settings(1e-4));
    w.settings.solver = SolverSettings::Staged(newton(1e-12, 1e-10, 1e-9));
    w.form_bonds(1e-6, |_| 100.0, 0.3);
    run(&mut w, 2);
    let [below, above] = [0, 1].map(|wall: usize| w.walls[wall].reaction[1]);
    assert!((below + above - force).abs() < 1e-9 * force && above > 0.1 * force, "{below} {above}");
    let expected = 8.0 * r * above - 3.0 * r * force;
    assert_stress(&w, |row, col| if row == 1 && col == 1 { expected } else { 0.0 }, 1e-9);
}

/// Grains inside a ring that shrinks onto them from one side: the branch at a wall begins at the
/// contact point.
#[test]
fn the_branch_at_a_round_wall_begins_at_the_contact_point() {
    let (r, ring) = (0.01, 0.05);
    let mut set = settings(1e-4);
    set.gravity = down::<D2>(G);
    let wall = Wall::fixed(Shape::Round { radius: ring, inside: true, axis: None }, [0.0, 0.0].into(), 0.0);
    let mut w = world(vec![grain::<D2>(&[0.0, r - ring], r)], vec![wall], set);
    run(&mut w, 2);
    let weight = w.grains.mass[0] * G;
    assert_stress(&w, |row, col| if row == 1 && col == 1 { r * weight } else { 0.0 }, 1e-9);
}

/// Grains moved by an affine map.
fn strained<D: Dim>() {
    let side: usize = 3;
    let grains: Grains<D> = (0..side.pow(D::N as u32))
        .map(|k| {
            let x = cell::<D>(k, side, |c| 0.3 + 0.021 * c as f64);
            grain::<D>(&x, 0.01)
        })
        .collect();
    let mut w = World::new(grains, Vec::new(), Vec::new(), settings(1e-3));
    let gradient = |row: usize, col: usize| 1e-3 * (1.0 + row as f64) - 3e-4 * (col as f64) * (2.0 - row as f64);
    for x in &mut w.grains.position {
        let before = *x;
        for row in 0..D::N {
            x[row] += 0.05 + (0..D::N).map(|col| gradient(row, col) * before[col]).sum::<f64>();
        }
    }
    for (k, found) in w.strain().into_iter().enumerate() {
        let expected = gradient(k / D::N, k % D::N);
        assert!((found - expected).abs() < 1e-13, "{k}: {found} against {expected}");
    }
}

/// The fit subtracts the mean displacement first: otherwise a displacement of 2³⁰ m, which is exact
/// here, would turn the round-off of the positions into a strain of some 1e-6.
#[test]
fn a_sample_that_is_carried_far_is_not_strained() {
    let grains = (0..7u8).map(|k| grain::<D2>(&[0.25 * f64::from(k % 3), 0.25 * f64::from(k / 3)], 0.125)).collect();
    let mut w = world(grains, Vec::new(), settings(1e-3));
    w.grains.position.iter_mut().for_each(|x| x[0] += 2f64.powi(30));
    assert!(w.strain().iter().all(|e| e.abs() < 1e-12), "{:?}", w.strain());
}

#[test]
fn the_strain_is_the_gradient_of_the_displacements() {
    strained::<D2>();
    strained::<D3>();
    // grains in a row span one direction only, even if every other grain is off by a ten-millionth
    // of a radius: there is no strain across it
    let of_row = |off: f64| {
        let place = |k: u8| [0.02 * f64::from(k), off * f64::from(k % 2)];
        let mut w = world((0..4).map(|k| grain::<D2>(&place(k), 0.01)).collect(), Vec::new(), settings(1e-3));
        w.grains.position[3][0] += 1e-3;
        w.strain()
    };
    for off in [0.0, 1e-9] {
        let strain = of_row(off);
        // Σ u x / Σ x² with the one grain that moves by 1 mm at 30 mm from the middle
        assert!((strain[0] - 0.015).abs() < 1e-12, "{strain:?}");
        assert!(strain[1..].iter().all(|e| e.abs() < 1e-8), "{strain:?}");
    }
    // a layer of spheres that is stretched in it
    let layer = (0..9u8).map(|k| grain::<D3>(&[0.02 * f64::from(k % 3), 0.0, 0.02 * f64::from(k / 3)], 0.01));
    let mut w = World::new(layer.collect(), Vec::new(), Vec::new(), settings(1e-3));
    w.grains.position.iter_mut().for_each(|x| x[2] *= 1.001);
    let strain = w.strain();
    assert!((strain[8] - 1e-3).abs() < 1e-12 && strain[..8].iter().all(|e| e.abs() < 1e-12), "{strain:?}");
    assert!(of_row(1e-6)[0] > 0.0);
}

#[test]
fn kinetic_energy_and_momentum_are_sums_over_what_moves() {
    let mut w = world(
        vec![grain::<D2>(&[0.0, 0.0], 0.01), grain(&[0.1, 0.2], 0.02), grain(&[0.0, 0.3], 0.01)],
        vec![force_driven::<D2>([0.0, -1.0].into(), [0.0, 1.0].into(), 3.0, 0.0), floor(0.0)],
        settings(1e-3),
    );
    w.grains.fixed[2] = true;
    let g = &mut w.grains;
    (g.velocity[0], g.velocity[1], g.velocity[2]) = ([1.0, 2.0].into(), [-3.0, 0.5].into(), [9.0, 9.0].into());
    (g.spin[0], g.spin[1], g.spin[2]) = ([10.0].into(), [-20.0].into(), [5.0].into());
    w.walls[0].velocity = [0.0, 0.7].into();
    let (m, i) = (w.grains.mass.clone(), w.grains.inertia.clone());
    assert_eq!(i[1], 0.5 * m[1] * 0.02 * 0.02);
    let kinetic = 0.5 * (5.0 * m[0] + 9.25 * m[1] + 100.0 * i[0] + 400.0 * i[1] + 3.0 * 0.49);
    assert!((w.kinetic_energy() / kinetic - 1.0).abs() < 1e-14);
    let momentum = w.momentum();
    let linear = [m[0] - 3.0 * m[1], 2.0 * m[0] + 0.5 * m[1]];
    assert!((0..2).all(|c| (momentum.linear[c] - linear[c]).abs() < 1e-14 * m[1]));
    // x v_y − y v_x of the second grain, and the spins
    let angular = m[1] * (0.1 * 0.5 + 0.2 * 3.0) + 10.0 * i[0] - 20.0 * i[1];
    assert!((momentum.angular[0] / angular - 1.0).abs() < 1e-14);
}

/// The false acceleration has one definition, whatever solver made the step; only Newton reports a
/// load error beside it.
#[test]
fn the_false_acceleration_is_the_same_quantity_for_every_solver() {
    for direct in [false, true] {
        let mut set = settings(1e-4);
        set.gravity = down::<D2>(G);
        if direct {
            set.solver = SolverSettings::Staged(newton(1e-10, 1e-10, 1e-9));
        }
        // one disk falls, another of the same mass lies on the floor: half of the squared load
        // accelerates
        let mut w = world(vec![grain::<D2>(&[0.0, 1.0], 0.01), grain(&[1.0, 0.01], 0.01)], vec![floor(0.2)], set);
        let report = w.step().expect("a step");
        let expected = f64::sqrt(0.5);
        assert!((report.false_acceleration - expected).abs() < 1e-9, "{}", report.false_acceleration);
        assert_eq!(report.load_error.is_some(), direct);
        assert_eq!(report.route, if direct { Route::ActiveSet } else { Route::Sweeps });
    }
}

/// A wall of prescribed velocity loads the sample with the force that it needs.
#[test]
fn the_force_of_a_wall_of_prescribed_velocity_is_a_load() {
    let (r, speed, h) = (0.01, 0.5, 1e-4);
    let direction: <D2 as Dim>::Vector = [1.0, 0.0].into();
    let drive = Drive::Velocity { direction, speed: Arc::new(move |_| speed) };
    let wall = Wall { drive, ..Wall::fixed(Shape::Plane { normal: direction }, [0.0, 0.0].into(), 0.0) };
    let mut w = world(vec![grain::<D2>(&[r, 0.0], r)], vec![wall], settings(h));
    let report = w.step().expect("a step");
    // it pushes one grain, and all of its force accelerates the grain
    assert!((w.grains.velocity[0][0] - speed).abs() < 1e-9 * speed, "{}", w.grains.velocity[0][0]);
    assert!((report.false_acceleration - 1.0).abs() < 1e-9, "{}", report.false_acceleration);
    // once it moves with the wall there is neither load nor acceleration
    assert_eq!(w.step().expect("a step").false_acceleration, 0.0);
}

/// On a floor: a grain at rest, a sliding grain, a bonded pair at rest, and two grains at rest with
/// a small gap between them.
#[test]
fn contacts_are_counted_by_what_they_did() {
    let r = 0.01;
    let places = [0.0, 0.1, 0.2, 0.2 + 2.0 * r, 0.3, 0.3 + 2.0005 * r];
    let mut set = settings(1e-4);
    set.gravity = down::<D2>(G);
    let mut w = world(places.map(|x| grain::<D2>(&[x, r], r)).into(), vec![floor(0.3)], set);
    w.grains.velocity[1][0] = 1.0;
    w.form_bonds(1e-6, |_| 1.0, 0.3);
    let counts = w.step().expect("a step").counts;
    assert_eq!(counts, Counts { open: 1, stick: 5, slip: 1, bonded: 1 });
}
