//! 3D against 2D and against itself: a flat twin, a rotated scene, a spinning sphere, a cantilever
//! of spheres.

use crate::common::{self, DENSITY, down, floor, force_driven, newton, settings, solver};
use dem_core::body::{Drive, Grain, Grains, Load, Shape, Wall};
use dem_core::bond::{BondStatus, Stiffness, failure};
use dem_core::contact::Law;
use dem_core::dim::{D2, D3, D3Twist, Dim, Moments, Space, Vect};
use dem_core::problem::{Contact, RigidBond};
use dem_core::solver::{ContactSolver, Route, SolveStatus, SolverSettings, Staged, StagedSettings, Stages, Start};
use dem_core::world::{Break, Settings, World};
use nalgebra::{Matrix3, Rotation3, SVector, Unit, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// A point in 2D; in 3D its second coordinate is zero.
fn flat<D: Dim>(x: f64, y: f64) -> D::Vector {
    let mut point = D::Vector::zero();
    point[0] = x;
    point[D::N - 1] = y;
    point
}

/// A disk, or a sphere with its mass and moment of inertia.
fn disk<D: Dim>(x: f64, y: f64, radius: f64) -> Grain<D> {
    let twin = Grain::<D2>::at_rest([x, y].into(), radius, DENSITY);
    Grain { mass: twin.mass, inertia: twin.inertia, ..Grain::at_rest(flat::<D>(x, y), radius, DENSITY) }
}

/// Rows of bonded disks on a floor, the upper ones pulled aside by a force that grows.
fn sheared<D: Dim>(solver: SolverSettings) -> World<D> {
    let r = 0.01;
    let mut list = Vec::new();
    let mut loads = Vec::new();
    for row in 0..5 {
        for column in 0..6 - row % 2 {
            if row == 4 {
                let force = flat::<D>(1.0, 0.3);
                loads.push(Load { grain: list.len(), force, torque: D::Spin::zero(), factor: Arc::new(|t| 2e5 * t) });
            }
            let shift = (row % 2) as f64;
            list.push(disk::<D>(r * (2.0 * column as f64 + shift), r * (1.0 + 3f64.sqrt() * row as f64), r));
        }
    }
    list.iter_mut().take(6).for_each(|grain| grain.fixed = true);
    let set = Settings { gravity: down::<D>(9.81), solver, ..settings(1e-4) };
    let mut world = World::new(list.into_iter().collect(), vec![floor(0.3)], loads, set);
    world.form_bonds(1e-6, |_| 2e3, 0.3);
    world
}

/// Loose disks of many sizes that fall into a box under a lid.
fn pressed<D: Dim>() -> World<D> {
    let mut rng = Pcg64::seed_from_u64(5);
    let mut list = Vec::new();
    for k in 0..36 {
        let r = 0.01 * (0.6 + 0.4 * rng.random::<f64>());
        let (x, y) = (0.01 + 0.02 * f64::from(k % 6), 0.01 + 0.02 * f64::from(k / 6));
        let mut grain = disk::<D>(x, y, r);
        grain.velocity = flat::<D>(0.1 * (rng.random::<f64>() - 0.5), 0.0);
        list.push(grain);
    }
    let side = |x: f64, out: f64| Wall::fixed(Shape::Plane { normal: flat::<D>(out, 0.0) }, flat::<D>(x, 0.0), 0.2);
    let lid = force_driven::<D>(flat::<D>(0.0, -1.0), flat::<D>(0.0, 0.125), 2.0, 300.0);
    let set = Settings { gravity: down::<D>(9.81), solver: solver(1e-12), ..settings(1e-4) };
    World::new(list.into_iter().collect(), vec![floor(0.3), side(0.0, 1.0), side(0.12, -1.0), lid], Vec::new(), set)
}

/// Steps both until a bond breaks, at most `most` times; everything agrees to 1e-8 and nothing
/// leaves the plane. In the step in which bonds break, the first `rounds` cascade rounds are
/// compared.
fn assert_twins(mut plane: World<D2>, mut space: World<D3>, most: usize, rounds: u32) -> usize {
    for step in 0..most {
        let (two, three) = (plane.step().expect("accepted"), space.step().expect("accepted"));
        let two: Vec<_> = two.breaks.iter().filter(|b| b.round < rounds).map(|b| (b.bond, b.mode, b.round)).collect();
        let three: Vec<_> =
            three.breaks.iter().filter(|b| b.round < rounds).map(|b| (b.bond, b.mode, b.round)).collect();
        assert_eq!(two, three, "step {step}");
        if !two.is_empty() {
            return step;
        }
        // a grain is at rest to the round-off of its velocity gain by gravity in a step
        let fastest = plane.grains.velocity.iter().map(Vect::norm).fold(9.81 * 1e-4, f64::max);
        for k in 0..plane.grains.len() {
            let near = |a: f64, b: f64, scale: f64| assert!((a - b).abs() <= 1e-8 * scale, "step {step}: {a} and {b}");
            let (p, s) = (&plane.grains, &space.grains);
            near(p.position[k][0], s.position[k][0], p.radius[k]);
            near(p.position[k][1], s.position[k][2], p.radius[k]);
            near(0.0, s.position[k][1], p.radius[k]);
            near(p.velocity[k][0], s.velocity[k][0], fastest);
            near(p.velocity[k][1], s.velocity[k][2], fastest);
            // a counter-clockwise spin, from the first axis to the last, is a spin about minus the
            // second axis
            near(p.spin[k][0] * p.radius[k], -s.spin[k][1] * p.radius[k], fastest);
        }
        assert_eq!(plane.touches().len(), space.touches().len());
        let largest = plane.touches().map(|t| t.reaction.n.abs()).fold(0.0, f64::max);
        for (p, s) in plane.touches().zip(space.touches()) {
            assert_eq!(p.pair, s.pair);
            let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-8 * largest, "step {step}: {a} and {b}");
            near(p.reaction.n, s.reaction.n);
            near(p.reaction.t.norm(), s.reaction.t.norm());
            near(p.reaction.m.norm() / 0.02, s.reaction.m.norm() / 0.02);
        }
    }
    most
}

#[test]
fn centres_in_a_plane_move_as_their_flat_twin() {
    assert_eq!(assert_twins(pressed::<D2>(), pressed::<D3>(), 150, u32::MAX), 150);
}

#[test]
fn bonds_in_a_plane_carry_and_break_as_in_their_flat_twin() {
    let newton = SolverSettings::Staged(newton(1e-12, 1e-12, 1e-9));
    // in the fifth cascade round all grains fall and many contacts slip: Newton then finds other
    // solutions in 3D than in 2D
    for (solver, rounds) in [(solver(1e-12), u32::MAX), (newton, 4)] {
        let first = assert_twins(sheared::<D2>(solver), sheared::<D3>(solver), 400, rounds);
        assert!((5..400).contains(&first), "the first break comes in step {first}");
    }
}

/// Initial speed of the grains of [`turned`] along each axis (m/s).
const SPEED: f64 = 0.05;

/// A scene in 3D, rotated as a whole.
fn turned<const M: usize>(by: &Rotation3<f64>, bonds: bool) -> World<Space<M>>
where
    SVector<f64, M>: Moments,
{
    let mut rng = Pcg64::seed_from_u64(9);
    let mut list = Vec::new();
    for k in 0..64 {
        let r = 0.01 * if bonds { 1.0 } else { 0.8 + 0.2 * rng.random::<f64>() };
        let x = Vector3::new(f64::from(k % 4), f64::from(k / 4 % 4), 0.5 + f64::from(k / 16)) * 0.02;
        let mut grain = Grain::<Space<M>>::at_rest(by * x, r, DENSITY);
        let mut any = || rng.random::<f64>() - 0.5;
        grain.velocity = by * Vector3::new(any(), any(), any()) * 2.0 * SPEED;
        grain.spin = by * Vector3::new(any(), any(), any()) * 5.0;
        list.push(grain);
    }
    let plane = |normal: Vector3<f64>, through: Vector3<f64>| {
        Wall::fixed(Shape::Plane { normal: by * normal }, by * through, 0.3)
    };
    let mut lid = plane(-Vector3::z(), Vector3::z() * 0.08);
    lid.drive = Drive::Force { direction: by * -Vector3::z(), mass: 1.0, force: Arc::new(|_| 20.0) };
    let walls = vec![plane(Vector3::z(), Vector3::zeros()), plane(Vector3::x(), Vector3::x() * -0.01), lid];
    let set = Settings { gravity: Some(by * Vector3::z() * -9.81), solver: solver(1e-12), ..settings(1e-4) };
    let mut world = World::new(list.into_iter().collect(), walls, Vec::new(), set);
    if bonds {
        world.set_solver(SolverSettings::Staged(newton(1e-12, 1e-12, 1e-9)));
        world.form_bonds(1e-6, |_| 1.5, 0.3);
        world.limit_twist(0.1);
        let rolling = |a: f64| 1e4 * a * a;
        world.make_bonds_elastic(|a| Stiffness {
            normal: 1e5,
            tangential: 1e5,
            rolling: rolling(a),
            twist: rolling(a),
        });
    }
    world
}

#[test]
fn a_turned_scene_does_the_same_turned() {
    let modes = turned_is_the_same::<2>(false);
    assert!(modes.is_empty(), "{modes:?}");
    let modes = turned_is_the_same::<2>(true);
    assert!(!modes.is_empty() && !modes.contains(&BondStatus::Twist), "{modes:?}");
    let modes = turned_is_the_same::<3>(true);
    assert!(modes.contains(&BondStatus::Twist), "{modes:?}");
}

/// The failure modes of the bonds.
fn turned_is_the_same<const M: usize>(bonds: bool) -> Vec<BondStatus>
where
    SVector<f64, M>: Moments,
{
    let by = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(0.3, -0.8, 0.5)), 1.1);
    let (mut straight, mut other) = (turned::<M>(&Rotation3::identity(), bonds), turned::<M>(&by, bonds));
    let mut modes = Vec::new();
    for step in 0..100 {
        let (a, b) = (straight.step().expect("accepted"), other.step().expect("accepted"));
        let bonds = |list: &[Break<Space<M>>]| list.iter().map(|b| (b.bond, b.mode)).collect::<Vec<_>>();
        assert_eq!(bonds(&a.breaks), bonds(&b.breaks), "step {step}");
        modes.extend(a.breaks.iter().map(|b| b.mode));
    }
    let (a, b) = (&straight.grains, &other.grains);
    for k in 0..a.len() {
        assert!((by * a.position[k] - b.position[k]).norm() <= 1e-9 * a.radius[k], "grain {k}");
        // a spring turns the round-off of lengths into forces
        let near = SPEED * if bonds { 1e-7 } else { 1e-9 };
        assert!((by * a.velocity[k] - b.velocity[k]).norm() <= near, "grain {k}");
        assert!((by * a.spin[k] - b.spin[k]).norm() * a.radius[k] <= near, "grain {k}");
    }
    modes
}

/// The rotation matrix of a unit quaternion.
fn matrix(q: &SVector<f64, 4>) -> Matrix3<f64> {
    let q = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
    q.to_rotation_matrix().into_inner()
}

#[test]
fn a_free_sphere_spins_on() {
    let mut grain = common::grain::<D3>(&[0.0; 3], 0.01);
    grain.spin = [30.0, -20.0, 50.0].into();
    let (spin, h, steps) = (grain.spin, 1e-3, 1_000_000);
    let mut world = common::world::<D3>(vec![grain], Vec::new(), settings(h));
    common::run(&mut world, steps);
    assert_eq!(world.grains.spin[0], spin, "nothing acts on it");
    let q = world.grains.orientation[0];
    assert!((q.norm() - 1.0).abs() < 1e-12);
    let exact = Rotation3::from_axis_angle(
        &Unit::new_normalize(spin),
        (spin.norm() * h * steps as f64).rem_euclid(std::f64::consts::TAU),
    );
    assert!((matrix(&q) - exact.matrix()).norm() < 1e-8, "it turned by the angle of its spin and time");
    assert!((matrix(&q) * spin - spin).norm() < 1e-9 * spin.norm(), "its axis stays");
}

#[test]
fn a_cantilever_of_spheres_carries_its_load_at_the_root() {
    let (r, count, force) = (0.01, 12, 0.05);
    let mut list: Vec<Grain<D3>> = (0..count).map(|k| common::grain(&[2.0 * r * k as f64, 0.0, 0.0], r)).collect();
    list[0].fixed = true;
    // across the chain in both directions, so that both bending rows carry
    let load = Load {
        grain: count - 1,
        force: Vector3::new(0.0, 0.6, -0.8) * force,
        torque: Vector3::zeros(),
        factor: Arc::new(|_| 1.0),
    };
    let grains: Grains<D3> = list.into_iter().collect();
    let newton = SolverSettings::Staged(StagedSettings { start: Start::StiffLimit, ..newton(1e-13, 1e-13, 1e-12) });
    let mut world = World::new(grains, Vec::new(), vec![load], Settings { solver: newton, ..settings(1e-4) });
    world.form_bonds(1e-6, |_| 1e3, 0.3);
    common::run(&mut world, 3);
    for (k, touch) in world.touches().enumerate() {
        // from the contact point to the load
        let length = r * (2 * (count - 1 - k) - 1) as f64;
        assert!((touch.reaction.t.norm() - force).abs() < 1e-9 * force, "shear in bond {k}");
        assert!((touch.reaction.m.norm() - force * length).abs() < 1e-9 * force * length, "moment in bond {k}");
        assert!(touch.reaction.n.abs() < 1e-9 * force);
    }
}

/// A row of spheres along x with an arm along y at its end, which a force along z pulls: the row
/// bends and twists.
fn bent_arm(solver: SolverSettings) -> World<D3Twist> {
    let (row, arm) = (6, 4);
    let centre = |k: usize| if k < row { [k as f64, 0.0, 0.0] } else { [(row - 1) as f64, (k + 1 - row) as f64, 0.0] };
    let list = (0..row + arm).map(|k| common::grain::<D3Twist>(&centre(k).map(|x| 0.02 * x), 0.01));
    let mut grains: Grains<D3Twist> = list.collect();
    grains.fixed[0] = true;
    let force = Vector3::z() * ARM_FORCE;
    let load = Load { grain: row + arm - 1, force, torque: Vector3::zeros(), factor: Arc::new(|_| 1.0) };
    let mut world = World::new(grains, Vec::new(), vec![load], Settings { solver, ..settings(1e-4) });
    world.form_bonds(1e-6, |_| 1e3, 0.3);
    world.limit_twist(0.1);
    world
}

/// Force at the end of the arm (N).
const ARM_FORCE: f64 = 0.05;

#[test]
fn an_arm_twists_the_row_that_carries_it() {
    let stiff = StagedSettings { start: Start::StiffLimit, ..newton(1e-13, 1e-13, 1e-12) };
    for solver in [SolverSettings::Staged(stiff), solver(1e-13)] {
        let mut world = bent_arm(solver);
        common::run(&mut world, 3);
        for touch in world.touches() {
            let along_row = touch.point[1].abs() < 1e-9;
            // the load is 80 mm off the row, and 100 mm from its root
            let twist = if along_row { ARM_FORCE * 0.08 } else { 0.0 };
            let length = if along_row { 0.1 - touch.point[0] } else { 0.08 - touch.point[1] };
            let (m, whole) = (touch.reaction.m, ARM_FORCE * 0.1);
            assert!((m[2].abs() - twist).abs() < 1e-9 * whole, "{solver:?}: {touch:?}");
            assert!((m.fixed_rows::<2>(0).norm() - ARM_FORCE * length).abs() < 1e-9 * whole, "{solver:?}: {touch:?}");
            assert!((touch.reaction.t.norm() - ARM_FORCE).abs() < 1e-9 * ARM_FORCE);
        }
    }
}

/// A cube of cemented spheres of many sizes, held at its lowest layer, under forces on its highest
/// that grow.
fn cemented() -> World<D3> {
    let mut rng = Pcg64::seed_from_u64(3);
    let side = 5;
    let (mut grains, mut loads) = (Vec::new(), Vec::new());
    for k in 0..side * side * side {
        let x = common::cell::<D3>(k, side, |c| 0.02 * c as f64);
        let mut g = common::grain::<D3>(&x, 0.01 * (0.98 + 0.02 * rng.random::<f64>()));
        g.fixed = k < side * side;
        grains.push(g);
        if k >= side * side * (side - 1) {
            let force = [rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5, -1.0].into();
            loads.push(Load { grain: k, force, torque: SVector::zeros(), factor: Arc::new(|t| 1e5 * t) });
        }
    }
    let mut w = World::new(grains.into_iter().collect(), Vec::new(), loads, settings(1e-5));
    w.set_solver(SolverSettings::Staged(newton(1e-8, 1e-6, 1e-5)));
    w.form_bonds(0.05, |_| 20.0, 0.3);
    w
}

#[test]
fn newton_and_the_interior_point_method_find_the_same_reactions() {
    let mut w = cemented();
    let problem = (0..100).find_map(|_| {
        let problem = w.contact_problem();
        (!w.step().unwrap().breaks.is_empty()).then_some(problem)
    });
    let problem = problem.expect("a bond that breaks");
    let solved = |stages: Stages| {
        let mut problem = problem.clone();
        let report = Staged::new(StagedSettings { stages, ..newton(1e-8, 1e-6, 1e-5) }).solve(&mut problem);
        assert_eq!(report.status, SolveStatus::Converged);
        (report.route, problem.bonded)
    };
    let (by_newton, by_path) = (solved(Stages::Newton), solved(Stages::Interior));
    assert_eq!((by_newton.0, by_path.0), (Route::ActiveSet, Route::InteriorPoint));
    let at_limit = |c: &Contact<D3, RigidBond<D3>>| failure(&c.r, c.law.shift(), c.law.cone()).is_some();
    assert!(by_newton.1.iter().any(at_limit));
    let energy = |list: &[Contact<D3, RigidBond<D3>>]| list.iter().map(|c| c.r.dot(&c.r)).sum::<f64>();
    let apart: f64 = by_newton.1.iter().zip(&by_path.1).map(|(a, b)| (a.r - b.r).dot(&(a.r - b.r))).sum();
    let share = (apart / energy(&by_newton.1)).sqrt();
    assert!(share <= 1e-2, "{share:e}");
}
