//! Walls of finite extent: segments in 2D, rectangles in 3D.

use crate::common::{down, floor, grain, pressed, run, settings, solver, world};
use dem_core::body::{Drive, Shape, Wall};
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::plate::Plate;
use dem_core::world::{StepError, World};
use std::f64::consts::PI;
use std::sync::Arc;

const R: f64 = 0.01;
const G: f64 = 9.81;

/// A plate across the last axis, its sides along the others.
fn level<D: Dim>(middle: &[f64], lengths: &[f64], friction: f64) -> Wall<D> {
    let (mut normal, mut side) = (D::Vector::zero(), D::Vector::zero());
    (normal[D::N - 1], side[0]) = (1.0, 1.0);
    let shape = Shape::Plate(Plate::new(normal, Some(side), lengths));
    Wall::fixed(shape, D::Vector::from_slice(middle), friction)
}

fn weight<D: Dim>(w: &World<D>, k: usize) -> f64 {
    w.grains.mass[k] * G
}

fn with_gravity<D: Dim>(grains: Vec<dem_core::body::Grain<D>>, walls: Vec<Wall<D>>, step: f64) -> World<D> {
    let mut set = settings(step);
    set.gravity = down::<D>(G);
    world(grains, walls, set)
}

/// A box of grains on a floor under a lid, once with planes and once with plates that reach far
/// beyond it, has the same bits.
#[test]
fn a_long_plate_is_a_plane_to_the_last_bit() {
    fn case<D: Dim>() {
        let planes = || pressed::<D>(7, 4, 0.3, None);
        let mut plates = planes();
        for wall in &mut plates.walls {
            let normal = wall.shape.flat_normal().expect("a plane");
            let mut side = D::Vector::zero();
            side[0] = 1.0;
            wall.shape = Shape::Plate(Plate::new(normal, Some(side), &[10.0, 10.0]));
        }
        let mut planes = planes();
        for _ in 0..60 {
            planes.step().expect("a step");
            plates.step().expect("a step");
            assert!(planes.touches().any(|t| t.pair[1] >= 4u32.pow(D::N as u32)), "a wall bears a grain");
            for (a, b) in planes.grains.position.iter().zip(&plates.grains.position) {
                assert_eq!(a, b);
            }
            assert_eq!(planes.grains.spin, plates.grains.spin);
            assert_eq!(planes.walls[1].position, plates.walls[1].position);
            assert_eq!(planes.walls[0].reaction, plates.walls[0].reaction);
        }
    }
    case::<D2>();
    case::<D3>();
}

/// A grain that lies in an opening between the edges of two plates, in 3D also on the corners of
/// three: each bears W/(n cos φ) along the line from its edge to the centre, R sin φ the distance
/// of the edge from the vertical through the centre.
#[test]
fn a_grain_in_an_opening_rests_on_the_edges() {
    fn case<D: Dim>(walls: Vec<Wall<D>>, distance: f64) {
        let cosine = (1.0 - (distance / R).powi(2)).sqrt();
        let mut start = vec![0.0; D::N];
        start[D::N - 1] = R * cosine;
        let mut w = with_gravity(vec![grain::<D>(&start, R)], walls, 1e-3);
        run(&mut w, 50);
        let share = weight(&w, 0) / w.walls.len() as f64;
        for wall in &w.walls {
            assert!((wall.reaction[D::N - 1] / -share - 1.0).abs() < 1e-9, "{:?} N", wall.reaction);
            assert!((wall.reaction.norm() / (share / cosine) - 1.0).abs() < 1e-9, "{:?} N", wall.reaction);
            // the force on a wall points from the centre to its edge
            assert!((0..D::N - 1).all(|k| wall.reaction[k] * wall.position[k] >= -1e-12));
        }
        let moved = (w.grains.position[0] - D::Vector::from_slice(&start)).norm();
        assert!(moved < 1e-9 * R, "moved by {moved} m");
    }
    let a = 0.6 * R;
    case::<D2>([1.0, -1.0].map(|s| level(&[s * (a + 0.05), 0.0], &[0.1], 0.0)).to_vec(), a);
    case::<D3>([1.0, -1.0].map(|s| level(&[s * (a + 0.05), 0.0, 0.0], &[0.1, 0.1], 0.0)).to_vec(), a);
    // squares whose diagonals are along the lines from the middle
    let corner = |k: i32| {
        let angle = 2.0 / 3.0 * PI * f64::from(k);
        let (away, side) = (a + 0.5f64.sqrt() * 0.1, angle + 0.25 * PI);
        let plate = Plate::new([0.0, 0.0, 1.0].into(), Some([side.cos(), side.sin(), 0.0].into()), &[0.1, 0.1]);
        Wall::fixed(Shape::Plate(plate), [away * angle.cos(), away * angle.sin(), 0.0].into(), 0.0)
    };
    case::<D3>((0..3).map(corner).collect(), a);
}

/// A grain leaves the end of its plate at `speed`, turns about the edge and parts from it. Returns
/// the cosine of the angle by which it had turned when it parted; `friction` zero or so large that
/// it rolls.
fn turns_off<D: Dim>(speed: f64, friction: f64) -> f64 {
    let mut start = vec![0.0; D::N];
    (start[0], start[D::N - 1]) = (-1e-4 * R, R);
    let mut wall_at = vec![0.0; D::N];
    wall_at[0] = -0.1;
    let mut disk = grain::<D>(&start, R);
    disk.velocity[0] = speed;
    if friction > 0.0 {
        // rolls on the upper face
        let mut about = D::Spin::zero();
        about[D::Spin::LEN / 2] = if D::N == 2 { -speed / R } else { speed / R };
        disk.spin = about;
    }
    let mut w = with_gravity(vec![disk], vec![level(&wall_at, &[0.2, 0.2], friction)], 2e-6);
    w.settings.solver = solver(1e-9);
    let (mut normal, mut cosine) = (D::Vector::zero(), 1.0);
    normal[D::N - 1] = 1.0;
    for _ in 0..200_000 {
        w.step().expect("a step");
        // a gap of less than 1e-6 R counts as closed, so on the edge the reaction may be zero for
        // some steps
        let Some(touch) = w.touches().next().filter(|t| t.gap < 1e-4 * R) else { break };
        let turned = D::normal(&touch.frame);
        let way = w.grains.velocity[0].norm() * w.settings.step;
        assert!((turned - normal).norm() <= 1.01 * way / R, "the normal jumps");
        normal = turned;
        if touch.reaction.n > 0.0 {
            cosine = turned[D::N - 1];
        }
    }
    assert!(w.ledger.remainder.abs() < 1e-9 * w.ledger.external_work.abs(), "{:?}", w.ledger);
    cosine
}

/// Without friction a grain of speed v at the end parts where v² + 2gR(1 − cos θ) = gR cos θ; one
/// that rolls where v² + 2gR(1 − cos θ)/(1 + k) = gR cos θ, k = I/mR².
#[test]
fn a_grain_slides_or_rolls_off_the_end_without_a_jump() {
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 2e-3, "{found} and {expected}");
    let speed = 0.3 * (G * R).sqrt();
    near(turns_off::<D2>(speed, 0.0), (2.0 + 0.09) / 3.0);
    near(turns_off::<D3>(speed, 0.0), (2.0 + 0.09) / 3.0);
    let rolls = |k: f64| (0.09 + 2.0 / (1.0 + k)) / (1.0 + 2.0 / (1.0 + k));
    near(turns_off::<D2>(speed, 100.0), rolls(0.5));
    near(turns_off::<D3>(speed, 100.0), rolls(0.4));
}

/// A punch bears on the grains whose centres are below it, and on no other.
#[test]
fn a_punch_presses_only_on_the_grains_below_it() {
    let (force, width) = (300.0, 6.5 * R);
    let row = (0..11).map(|k| grain::<D2>(&[2.02 * R * f64::from(k - 5), R], R)).collect();
    let mut punch = level::<D2>(&[0.3 * R, 2.0 * R], &[width], 0.2);
    let direction = [0.0, -1.0].into();
    punch.drive = Drive::Force { direction, mass: 1.0, force: Arc::new(move |_| force) };
    let mut w = with_gravity(row, vec![floor(0.2), punch], 1e-3);
    run(&mut w, 100);
    let on = |body: u32| w.touches().filter(move |t| t.pair[1] == body && t.reaction.n > 0.0);
    let below: Vec<u32> =
        (0..11).filter(|k| (w.grains.position[*k as usize][0] - 0.3 * R).abs() <= 0.5 * width).collect();
    assert_eq!(on(12).map(|t| t.pair[0]).collect::<Vec<_>>(), below);
    assert_eq!(below, [4, 5, 6]);
    assert!((on(12).map(|t| t.reaction.n).sum::<f64>() / force - 1.0).abs() < 1e-9);
    for touch in on(11) {
        let own = weight(&w, touch.pair[0] as usize);
        let borne = on(12).find(|t| t.pair[0] == touch.pair[0]).map_or(0.0, |t| t.reaction.n);
        assert!((touch.reaction.n / (own + borne) - 1.0).abs() < 1e-9);
    }
}

/// A grain behind a plate is stopped by its back, and one that meets an edge by the edge: the plate
/// is solid from all sides.
#[test]
fn a_plate_is_solid_from_behind_and_at_its_edge() {
    let meet = |place: [f64; 2], velocity: [f64; 2]| {
        let mut disk = grain::<D2>(&place, R);
        disk.velocity = velocity.into();
        let mut w = world(vec![disk], vec![level(&[0.0, 0.0], &[0.1], 0.0)], settings(1e-3));
        run(&mut w, 100);
        w.grains.position[0]
    };
    assert!((meet([0.0, -0.03], [0.0, 1.0])[1] + R).abs() < 1e-12);
    assert!((meet([0.0, 0.03], [0.0, -1.0])[1] - R).abs() < 1e-12);
    assert!((meet([0.08, 0.0], [-1.0, 0.0])[0] - 0.05 - R).abs() < 1e-12);
    // past the edge at a tenth of its radius
    let passed = meet([0.05 + 1.1 * R, 0.05], [0.0, -1.0]);
    assert!((passed[1] + 0.05).abs() < 1e-12 && (passed[0] - 0.05 - 1.1 * R).abs() < 1e-12, "{passed:?}");
}

/// A grain that would pass through a plate in one step is refused; halved, it is stopped.
#[test]
fn a_fast_grain_does_not_pass_through() {
    let fast = |step: f64| {
        let mut disk = grain::<D2>(&[0.0, 0.05], R);
        disk.velocity = [0.0, -100.0].into();
        world(vec![disk], vec![level(&[0.0, 0.0], &[0.1], 0.0)], settings(step))
    };
    let mut w = fast(1e-2);
    match w.step() {
        Ok(_) => assert!(w.grains.position[0][1] >= R * (1.0 - 1e-9), "{:?}", w.grains.position[0]),
        Err(error) => assert!(matches!(error, StepError::TooFast { .. }), "{error}"),
    }
    let mut w = fast(1e-5);
    run(&mut w, 100);
    assert!((w.grains.position[0][1] - R).abs() < 1e-9);
}

/// A scene turned by any angle gives the turned result.
#[test]
fn a_turned_scene_gives_the_turned_result() {
    let result = |angle: f64| {
        let (s, c) = angle.sin_cos();
        let turn = |v: [f64; 2]| -> [f64; 2] { [c * v[0] - s * v[1], s * v[0] + c * v[1]] };
        let plate = |normal: [f64; 2], at: [f64; 2], length: f64| {
            Wall::<D2>::fixed(Shape::Plate(Plate::new(turn(normal).into(), None, &[length])), turn(at).into(), 0.3)
        };
        // a funnel of two plates and a step below it
        let half = 0.5f64.sqrt();
        let walls = vec![
            plate([half, half], [-0.045, 0.045], 0.1),
            plate([-half, half], [0.05, 0.05], 0.1),
            plate([0.0, 1.0], [-0.028, -0.03], 0.06),
        ];
        let start = [[0.0, 0.04], [0.021, 0.06], [-0.02, 0.065], [0.002, 0.09]];
        let disks = start.map(|x| grain::<D2>(&turn(x), R)).to_vec();
        let mut set = settings(5e-4);
        set.gravity = Some(turn([0.0, -G]).into());
        let mut w = world(disks, walls, set);
        run(&mut w, 400);
        let back = |v: &<D2 as Dim>::Vector| [c * v[0] + s * v[1], c * v[1] - s * v[0]];
        w.grains.position.iter().map(back).collect::<Vec<_>>()
    };
    let straight = result(0.0);
    assert!(straight.iter().any(|x| x[1] < 0.0), "no grain passed the opening: {straight:?}");
    for angle in [0.3, 2.0, -1.1] {
        for (a, b) in straight.iter().zip(result(angle)) {
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9, "{a:?} and {b:?} at {angle}");
        }
    }
}

/// A plate under a stress bears it on the part of the sample that it covers.
#[test]
fn the_stress_of_a_plate_acts_on_what_it_covers() {
    let (stress, thickness) = (1e4, 0.02);
    let lid = |length: f64, middle: f64| {
        let row = (0..5).map(|k| grain::<D2>(&[2.0 * R * f64::from(k), R], R)).collect();
        let mut lid = level::<D2>(&[middle, 2.0 * R], &[length], 0.0);
        let direction = [0.0, -1.0].into();
        lid.drive = Drive::Force { direction, mass: 1.0, force: Arc::new(move |_| stress) };
        lid.per_area = true;
        let mut set = settings(1e-3);
        set.thickness = thickness;
        let mut w = world(row, vec![floor(0.0), lid], set);
        w.step().expect("a step");
        (w.walls[1].applied / (stress * thickness), w.walls[1].section / thickness)
    };
    // the sample reaches from −R to 9R: all of the plate, all of the sample, one end of each
    for (length, middle, covered) in [(3.0, 4.0, 3.0), (30.0, 4.0, 10.0), (6.0, 8.0, 4.0)] {
        for found in <[f64; 2]>::from(lid(length * R, middle * R)) {
            assert!((found / (covered * R) - 1.0).abs() < 1e-12, "{found} m, not {covered} R");
        }
    }
}
