//! Walls driven by a stress, walls that slide under their load, and walls that hold grains.

use crate::common::{floor, force_driven, grain, newton, settings, solver, world};
use dem_core::body::{Drive, Grains, Shape, Slide, Wall};
use dem_core::bond::Stiffness;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::saved::Saved;
use dem_core::solver::SolverSettings;
use dem_core::world::{Restitution, World};
use std::f64::consts::PI;
use std::sync::Arc;

const R: f64 = 0.01;

/// Both solvers: sweeps, and Newton.
fn solvers() -> [SolverSettings; 2] {
    [solver(1e-13), SolverSettings::Staged(newton(1e-12, 1e-10, 1e-9))]
}

fn plane<D: Dim>(axis: usize, sign: f64, at: f64) -> Wall<D> {
    let (mut normal, mut position) = (D::Vector::zero(), D::Vector::zero());
    (normal[axis], position[axis]) = (sign, at);
    Wall::fixed(Shape::Plane { normal }, position, 0.0)
}

fn moving<D: Dim>(wall: Wall<D>, direction: D::Vector, speed: f64) -> Wall<D> {
    let drive = Drive::Velocity { direction, speed: Arc::new(move |_| speed) };
    Wall { velocity: direction * speed, drive, ..wall }
}

fn normal<D: Dim>(wall: &Wall<D>) -> D::Vector {
    wall.shape.flat_normal().expect("a plane")
}

fn stressed<D: Dim>(wall: Wall<D>, mass: f64, stress: f64) -> Wall<D> {
    let direction = normal(&wall);
    Wall { drive: Drive::Force { direction, mass, force: Arc::new(move |_| stress) }, per_area: true, ..wall }
}

/// The force is σ·L(t)·thickness for side walls that move apart and touch nothing, at the middle of
/// each step; the floor bears it.
#[test]
fn a_stress_acts_on_the_distance_of_the_walls_that_face_each_other() {
    let (stress, speed, thickness, h) = (5e4, 0.03, 0.02, 1e-3);
    let left = moving::<D2>(plane(0, 1.0, -0.03), [-1.0, 0.0].into(), speed);
    let right = moving::<D2>(plane(0, -1.0, 0.05), [1.0, 0.0].into(), speed);
    let lid = stressed(plane(1, -1.0, 2.0 * R), 3.0, stress);
    let mut set = settings(h);
    set.thickness = thickness;
    let mut w = world(vec![grain(&[0.0, R], R)], vec![plane(1, 1.0, 0.0), left, right, lid], set);
    for step in 0..50 {
        w.step().expect("a step");
        let length = 0.08 + 2.0 * speed * h * (f64::from(step) + 0.5);
        let expected = stress * length * thickness;
        assert!((w.walls[3].applied / expected - 1.0).abs() < 1e-13, "{} N", w.walls[3].applied);
        assert!((w.walls[0].reaction[1] / -expected - 1.0).abs() < 1e-9, "{:?} N", w.walls[0].reaction);
        assert!((w.walls[3].section / (length * thickness) - 1.0).abs() < 1e-13);
    }
    assert!(w.ledger.remainder.abs() < 1e-12 * w.ledger.external_work.abs().max(1e-3), "{:?}", w.ledger);
}

/// Without side walls the section is that of the grains; in 3D the product of two extents, or that
/// of a cylinder around the sample.
#[test]
fn a_stress_acts_on_the_extent_of_the_grains_or_on_a_cylinder_around_them() {
    let lid = stressed::<D3>(plane(2, -1.0, 2.0 * R), 1.0, 1e4);
    let spheres = || [-0.03, 0.0, 0.04].map(|x| grain::<D3>(&[x, 0.5 * x, R], R)).to_vec();
    let section = |walls: Vec<Wall<D3>>| {
        let mut w = world(spheres(), walls, settings(1e-3));
        w.step().expect("a step");
        w.walls[1].section
    };
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
    near(section(vec![floor(0.0), lid.clone()]), 0.09 * 0.055);
    // one wall alone bounds nothing, two do
    near(section(vec![floor(0.0), lid.clone(), plane(0, 1.0, -0.06)]), 0.09 * 0.055);
    near(section(vec![floor(0.0), lid.clone(), plane(0, 1.0, -0.06), plane(0, -1.0, 0.07)]), 0.13 * 0.055);
    // of several the innermost
    let four = vec![floor(0.0), lid.clone(), plane(0, 1.0, -0.06), plane(0, -1.0, 0.07), plane(0, -1.0, 0.06)];
    near(section(four), 0.12 * 0.055);
    let axis: [f64; 3] = [0.0, 0.0, 1.0];
    let shape = Shape::Round { radius: 0.1, inside: true, axis: Some(axis.into()) };
    near(section(vec![floor(0.0), lid, Wall::fixed(shape, Vect::zero(), 0.0)]), PI * 0.01);
}

/// A disk that a lid presses between two others: it drives them and the side walls apart. The side
/// walls bear σ·H(t)·thickness, H the distance of lid and floor, and the lid 2F/tan φ, φ the angle
/// of the contacts with the vertical: equilibrium of three disks without friction.
#[test]
fn stresses_hold_while_the_sample_swells() {
    let (stress, thickness, h, half, speed) = (1e5, 0.02, 0.1, 1.2 * R, 2e-5);
    let height = |half: f64| 2.0 * R + (4.0 * R * R - half * half).sqrt();
    for settled in solvers() {
        let disks = [[-half, R], [half, R], [0.0, height(half) - R]];
        let lid = moving::<D2>(plane(1, -1.0, height(half)), [0.0, -1.0].into(), speed);
        let sides = [(1.0, -half - R), (-1.0, half + R)].map(|(sign, at)| stressed(plane(0, sign, at), 1.0, stress));
        let [left, right] = sides;
        let mut set = settings(h);
        (set.friction, set.thickness, set.solver) = (0.0, thickness, settled);
        let walls = vec![plane(1, 1.0, 0.0), lid, left, right];
        let mut w = world(disks.map(|x| grain(&x, R)).to_vec(), walls, set);
        for step in 0..500 {
            w.step().expect("a step");
            // the lid starts with an impact
            if step < 10 {
                continue;
            }
            let mid = w.walls[1].position[1] + 0.5 * h * speed;
            let section = mid * thickness;
            for wall in &w.walls[2..] {
                let found = wall.reaction[0].abs() / section;
                assert!((found / stress - 1.0).abs() < 1e-6, "{found} Pa in step {step}");
            }
            let touch = w.touches().find(|t| t.pair == [0, 2]).expect("a contact");
            let frame = D2::normal(&touch.frame);
            let expected = 2.0 * stress * section * frame[1].abs() / frame[0].abs();
            let load = w.walls[1].reaction[1];
            assert!((load / expected - 1.0).abs() < 1e-5, "{load} N, not {expected} N, in step {step}");
        }
        let swollen = w.walls[3].position[0] - half - R;
        assert!(swollen > 0.5e-3, "the side moved by {swollen} m");
    }
}

/// A lid that is pressed on fixed grains and slides: Coulomb's law gives its force along the slide.
#[test]
fn a_wall_that_slides_under_a_force_is_held_back_by_friction() {
    let (force, mu, speed) = (700.0, 0.4, 0.05);
    for settled in solvers() {
        let mut disks = [-0.03, 0.0, 0.04].map(|x| grain::<D2>(&[x, R], R)).to_vec();
        disks.iter_mut().for_each(|disk| disk.fixed = true);
        let mut lid = force_driven::<D2>([0.0, -1.0].into(), [0.0, 2.0 * R].into(), 2.0, force);
        lid.friction = mu;
        lid.slide = Some(Slide { direction: [1.0, 0.0].into(), speed: Arc::new(move |t| speed * (1.0 + t)) });
        lid.velocity = [speed, 0.0].into();
        let mut set = settings(1e-3);
        set.solver = settled;
        let mut w = world(disks, vec![lid], set);
        for step in 1..=100 {
            w.step().expect("a step");
            let lid = &w.walls[0];
            assert!((lid.reaction[1] / force - 1.0).abs() < 1e-9, "{:?}", lid.reaction);
            assert!((lid.reaction[0] / (-mu * force) - 1.0).abs() < 1e-9, "{:?}", lid.reaction);
            assert_eq!(lid.velocity[0], speed * (1.0 + w.time), "in step {step}");
            assert!(lid.velocity[1].abs() < 1e-12);
        }
        // work of the slide = heat of friction
        let way = w.walls[0].position[0];
        assert!((w.ledger.friction / (mu * force * way) - 1.0).abs() < 1e-9, "{:?}", w.ledger);
        assert!(w.ledger.remainder.abs() < 1e-12 * w.ledger.friction, "{:?}", w.ledger);
        assert!(w.ledger.kinetic < 1e-20 && w.kinetic_energy() < 1e-20, "{:?}", w.ledger);
    }
}

/// The outer two of three bonded disks are held, and one wall rises: two springs in series.
#[test]
fn grains_that_a_wall_holds_move_with_it_and_load_it() {
    for settled in solvers() {
        let mut w = between(settled, vec![]);
        assert_eq!([w.grains_held_by(0), w.grains_held_by(1)], [1, 1]);
        assert_eq!(w.grains.fixed, [true, false, true]);
        let speed = 1e-3;
        let mut broke = 0;
        for _ in 0..1200 {
            let report = w.step().expect("a step");
            let way = w.walls[1].position[1] - 6.0 * R;
            assert!((way / (speed * w.time) - 1.0).abs() < 1e-9);
            assert!((w.grains.position[2][1] - w.walls[1].position[1] + R).abs() < 1e-15);
            let (lower, upper) = (w.walls[0].reaction_at_limit[1], w.walls[1].reaction_at_limit[1]);
            broke += report.breaks.len();
            if broke == 0 {
                let expected = 0.5e6 * way;
                // the free grain vibrates: half its amplitude is the first step's
                assert!((upper + expected).abs() < 2.0, "{upper} N at {expected} N");
            } else if report.breaks.is_empty() {
                assert!(lower.abs().min(upper.abs()) < 1e-9, "{lower} N and {upper} N after the break");
            } else {
                assert!((upper.abs().max(lower.abs()) / 50.0 - 1.0).abs() < 0.05, "{lower}, {upper} N");
            }
        }
        // both bear the same force but for the vibration
        assert!(broke > 0);
        assert!(w.ledger.remainder.abs() < 1e-9 * w.ledger.external_work.abs(), "{:?}", w.ledger);
    }
}

/// Three disks in a column, bonded by springs: the outer two are held.
fn between(settled: SolverSettings, more: Vec<Wall<D2>>) -> World<D2> {
    let hold = |wall: Wall<D2>| Wall { grip: Some(0.5 * R), ..wall };
    let top = moving(hold(plane(1, -1.0, 6.0 * R)), [0.0, 1.0].into(), 1e-3);
    let mut set = settings(1e-4);
    set.solver = settled;
    let disks = [1.0, 3.0, 5.0].map(|y| grain(&[0.0, y * R], R)).to_vec();
    let mut w = world(disks, [vec![hold(floor(0.3)), top], more].concat(), set);
    w.form_bonds(1e-6, |_| 50.0, 0.3);
    w.make_bonds_elastic(|_| Stiffness { normal: 1e6, tangential: 1e6, rolling: 1.0, twist: 0.0 });
    w
}

/// Grains that are held, stresses and slides go on bit for bit from a saved state.
#[test]
fn a_saved_state_remembers_what_the_walls_hold() {
    let saved = |w: &World<D2>| {
        let mut to = Saved::default();
        w.save(&mut to);
        to
    };
    let mut lid = stressed(plane(1, -1.0, 6.0 * R), 2.0, 1e3);
    lid.slide = Some(Slide { direction: [1.0, 0.0].into(), speed: Arc::new(|t| 0.01 * t) });
    lid.friction = 0.2;
    let mut straight = between(solver(1e-12), vec![lid]);
    (0..20).for_each(|_| drop(straight.step().expect("a step")));
    let state = saved(&straight);
    let mut from = state.read();
    let grains = Grains::restored(&mut from).expect("grains");
    let (walls, set) = (straight.walls.clone(), straight.settings.clone());
    let mut resumed = World::restored(grains, walls, vec![], set, &mut from).expect("what was saved");
    from.end().expect("all of it");
    assert_eq!(resumed.grains_held_by(1), 1);
    for w in [&mut straight, &mut resumed] {
        (0..20).for_each(|_| drop(w.step().expect("a step")));
    }
    let (a, b) = (saved(&straight), saved(&resumed));
    assert_eq!(a.counts, b.counts);
    let bits = |s: &Saved| s.reals.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&a), bits(&b));
}

/// A grain that slides without friction inside a round wall: it keeps its distance from the wall
/// and its speed, since the wall turns its velocity.
fn circling<D: Dim>(axis: Option<D::Vector>, restitution: f64) {
    let mut set = settings(1e-3);
    set.restitution = (restitution > 0.0).then_some(Restitution {
        grain_grain: restitution,
        grain_wall: restitution,
        threshold_speed: 0.0,
    });
    let shape = Shape::Round { radius: 0.1, inside: true, axis };
    let mut place = vec![0.0; D::N];
    place[0] = 0.1 - R;
    let mut start = grain::<D>(&place, R);
    start.velocity[1] = 1.0;
    let mut w = world(vec![start], vec![Wall::fixed(shape, D::Vector::zero(), 0.0)], set);
    for step in 0..2000 {
        w.step().expect("a step");
        let (x, v) = (w.grains.position[0].norm(), w.grains.velocity[0].norm());
        assert!((x / (0.1 - R) - 1.0).abs() < 1e-12 && (v - 1.0).abs() < 1e-12, "{x} m, {v} m/s in step {step}");
    }
}

#[test]
fn a_grain_that_circles_in_a_round_wall_keeps_its_distance_and_speed() {
    for restitution in [0.0, 0.5] {
        circling::<D2>(None, restitution);
        circling::<D3>(None, restitution);
        circling::<D3>(Some([0.0, 0.0, 1.0].into()), restitution);
    }
}

/// In a step the force would move free grains by 1e9 radii: a residual of 1e-12 leaves them moving
/// by a thousandth of a radius, and is not small enough.
#[test]
fn a_force_far_above_what_moves_the_grains_in_a_step_is_borne() {
    let grains = vec![grain::<D2>(&[0.0, R], R), grain(&[0.0, 3.0 * R], R)];
    let (step, ratio) = (1e-3, 1e9);
    let force = ratio * grains[0].mass * grains[0].radius / (step * step);
    let mut set = settings(step);
    set.solver = SolverSettings::default();
    let mut lid = force_driven::<D2>([0.0, -1.0].into(), [0.0, 0.04].into(), grains[0].mass, 0.0);
    let Drive::Force { force: of_time, .. } = &mut lid.drive else { panic!("driven by a force") };
    *of_time = Arc::new(move |t| force * t / (20.0 * step));
    let mut w = world(grains, vec![floor(0.0), lid], set);
    w.form_bonds(1e-6, |_| 1e-3 * force, 0.3);
    for _ in 0..40 {
        w.step().unwrap();
    }
    let pressed = w.walls[0].reaction[1];
    assert!((pressed + force * 39.5 / 20.0).abs() < 1e-6 * force, "{pressed} N");
}

/// A disk that meets a moving wall too fast for a step: its parts take up the impact and what comes
/// after it. Wall force, work and stress are those of the whole step.
#[test]
fn the_forces_of_a_step_in_parts_are_those_of_the_step() {
    let (h, speed) = (1e-3, 0.5);
    for restitution in [0.0, 1.0] {
        let mut set = settings(h);
        set.restitution = Some(Restitution { grain_grain: 0.0, grain_wall: restitution, threshold_speed: 0.0 });
        let wall = moving::<D2>(plane(0, 1.0, 0.0), [1.0, 0.0].into(), speed);
        let mut disk = grain(&[0.0043, 0.0], 0.1 * R);
        disk.velocity = [-8.0, 0.0].into();
        let mut w = world(vec![disk], vec![wall], set);
        let (mut parts, mut work) = (1, 0.0);
        for _ in 0..3 {
            let before = w.momentum().linear[0];
            let report = w.step().unwrap();
            let push = (w.momentum().linear[0] - before) / h;
            let reaction = w.walls[0].reaction;
            assert!((reaction[0] + push).abs() <= 1e-12 * push.abs(), "{} N for {push} N", reaction[0]);
            assert_eq!(w.walls[0].reaction_at_limit, reaction);
            // the branch of a contact with a wall ends at the wall
            let stress = report.stress(&w);
            assert!(push == 0.0 || stress[0] > 0.0, "{stress:?} Pa for {push} N");
            parts = parts.max(report.substeps);
            work += push * speed * h;
        }
        assert!(parts > 1 && work > 0.0);
        assert!((work / w.ledger.external_work - 1.0).abs() < 1e-12, "{work} J of {} J", w.ledger.external_work);
    }
}
