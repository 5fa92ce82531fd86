//! The Newton solver against Gauss–Seidel, closed forms, and itself from other starts.

use crate::common::{self, down, floor, force_driven, grain, settings, solver, world};
use dem_core::body::{Drive, Load, Shape, Wall};
use dem_core::bond::failure;
use dem_core::contact::Law;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::problem::ContactProblem;
use dem_core::problem::residual::residual;
use dem_core::solver::{Route, SolveStatus, SolverSettings, StagedSettings, Start};
use dem_core::world::{StepReport, World};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

fn newton(tolerance: f64, start: Start) -> SolverSettings {
    SolverSettings::Staged(StagedSettings { start, ..common::newton(tolerance, tolerance, 1e-6) })
}

#[test]
fn weight_at_the_bottom_of_a_column_of_500() {
    let mut set = settings(1e-3);
    set.gravity = down::<D2>(9.81);
    set.solver = newton(1e-10, Start::StiffLimit);
    let column: Vec<_> = (0..500).map(|k| grain::<D2>(&[0.0, 0.01 + 0.02 * k as f64], 0.01)).collect();
    let weight: f64 = column.iter().map(|g| g.mass * 9.81).sum();
    let mut w = world(column, vec![floor(0.2)], set);
    for _ in 0..3 {
        let report = w.step().unwrap();
        assert_eq!(report.status, SolveStatus::Converged);
        assert!((-w.walls[0].reaction[1] / weight - 1.0).abs() < 1e-6, "{}", -w.walls[0].reaction[1] / weight - 1.0);
    }
    // the previous step provides the active set
    assert!(w.step().unwrap().work.newton <= 10);
}

/// Disks of 1 cm under gravity between these walls.
fn dry_disks(centres: impl Iterator<Item = [f64; 2]>, walls: Vec<Wall<D2>>) -> World<D2> {
    let mut set = settings(1e-3);
    set.gravity = down::<D2>(9.81);
    world(centres.map(|x| grain::<D2>(&x, 0.01)).collect(), walls, set)
}

/// A sweep carries forces little further than to the next disk, so sweeps miss the tolerance in a
/// column of 200. Scenes without bonds accept residuals up to 1e-4.
#[test]
fn dry_contacts_that_sweeps_miss_are_solved_exactly() {
    let mut world = dry_disks((0..200).map(|k| [0.0, 0.01 + 0.02 * f64::from(k)]), vec![floor(0.2)]);
    world.settings.solver = SolverSettings::Staged(StagedSettings { accept: 1e-4, ..StagedSettings::default() });
    let weight: f64 = 9.81 * world.grains.mass.iter().sum::<f64>();
    for _ in 0..20 {
        let report = world.step().unwrap();
        assert_eq!(report.status, SolveStatus::Converged);
        let foot = -world.walls[0].reaction[1];
        assert!((foot / weight - 1.0).abs() < 1e-6, "{:e}", foot / weight - 1.0);
    }
}

/// The problem solved by Newton from a cold start, to a residual of 1e-10 and a load error of 1e-9,
/// in at most thirty iterations.
fn solved_cold<D: Dim>(world: &mut World<D>) -> ContactProblem<D> {
    let mut problem = world.contact_problem();
    // accepted sweeps would end far from the solution
    let settings = SolverSettings::Staged(common::newton(1e-10, 1e-3, 1e-9));
    let report = settings.build::<D>().solve(&mut problem);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    assert!(report.work.newton <= 30, "{report:?}");
    problem
}

#[test]
fn a_column_of_2000_from_no_reactions() {
    let mut world = dry_disks((0..2000).map(|k| [0.0, 0.01 + 0.02 * f64::from(k)]), vec![floor(0.2)]);
    let problem = solved_cold(&mut world);
    let weight: f64 = 9.81e-3 * world.grains.mass.iter().sum::<f64>();
    let on_the_floor = problem.dry.iter().map(|c| c.r.n).fold(0.0, f64::max);
    assert!((on_the_floor / weight - 1.0).abs() <= 1e-6, "{:e}", on_the_floor / weight - 1.0);
}

/// Disks along the line of thrust of their weight: each contact carries the same horizontal force,
/// and no friction.
#[test]
fn an_arch_from_no_reactions() {
    let (count, rise) = (41, 0.1);
    // slope of the line from disk k to the next, from the left wall to the right one
    let slope = |k: i32| rise * (f64::from(count) / 2.0 - f64::from(k));
    let along = |k: i32| Vector2::new(1.0, slope(k)).normalize();
    let mut centres = vec![Vector2::new(0.0, 1.0)];
    for k in 1..count {
        centres.push(centres[k as usize - 1] + along(k) * 0.02);
    }
    let wall = |normal: Vector2<f64>, disk: &Vector2<f64>| {
        Wall::<D2>::fixed(Shape::Plane { normal }, disk - normal * 0.01, 0.2)
    };
    let walls = vec![wall(along(0), &centres[0]), wall(-along(count), &centres[count as usize - 1])];
    let mut world = dry_disks(centres.iter().map(|x| [x[0], x[1]]), walls);
    let problem = solved_cold(&mut world);
    let thrust = 9.81e-3 * world.grains.mass[0] / rise;
    let mut found: Vec<f64> = problem.dry.iter().map(|c| c.r.n / thrust).collect();
    let mut wanted: Vec<f64> = (0..=count).map(|k| 1f64.hypot(slope(k))).collect();
    found.sort_by(f64::total_cmp);
    wanted.sort_by(f64::total_cmp);
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() <= 1e-6, "{found} {wanted}");
    }
}

/// A dry hexagonal block in a box, under a lid. The contact forces are not unique, but the force on
/// the floor is.
#[test]
fn a_pressed_hexagonal_block_from_no_reactions() {
    let (rows, columns, r) = (40, 40, 0.01);
    let centre = |k: i32| {
        let (row, column) = (k / columns, k % columns);
        [r * f64::from(1 + 2 * column + row % 2), r * (1.0 + 3f64.sqrt() * f64::from(row))]
    };
    let (width, height) = (r * f64::from(2 * columns + 1), r * (2.0 + 3f64.sqrt() * f64::from(rows - 1)));
    let side =
        |normal: f64, x: f64| Wall::<D2>::fixed(Shape::Plane { normal: [normal, 0.0].into() }, [x, 0.0].into(), 0.2);
    let lid = force_driven::<D2>([0.0, -1.0].into(), [0.0, height].into(), 100.0, 5e3);
    let mut world =
        dry_disks((0..rows * columns).map(centre), vec![floor(0.2), side(1.0, 0.0), side(-1.0, width), lid]);
    let problem = solved_cold(&mut world);
    let fastest = problem.nodes.all.iter().map(|n| n.velocity.norm()).fold(0.0, f64::max);
    // the velocity of the lid without the sample
    let free = 1e-3 * (5e3 / 100.0 + 9.81);
    assert!(fastest <= 1e-9 * free, "{:e}", fastest / free);
}

/// A box of bonded and dry grains with random radii, pressed from above and sheared from the side:
/// all kinds of rows.
fn pressed<D: Dim>(seed: u64, bonded: bool) -> World<D> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let side: usize = if D::N == 2 { 8 } else { 4 };
    let mut grains = Vec::new();
    for k in 0..side.pow(D::N as u32) {
        let x = common::cell::<D>(k, side, |c| 0.01 + 0.02 * c as f64);
        let mut g = grain::<D>(&x, 0.01 * (0.98 + 0.02 * rng.random::<f64>()));
        g.velocity[0] = 0.05 * (rng.random::<f64>() - 0.5);
        grains.push(g);
    }
    let mut set = settings(1e-3);
    set.gravity = down::<D>(9.81);
    let mut down = D::Vector::zero();
    down[D::N - 1] = -1.0;
    let lid = force_driven::<D>(down, down * (-0.02 * side as f64), 2.0, 300.0);
    let mut w = world(grains, vec![floor(0.2), lid], set);
    if bonded {
        w.form_bonds(0.03, |_| 20.0, 0.3);
        assert!(w.bonds.len() > 40);
    }
    w
}

fn solved<D: Dim>(problem: &ContactProblem<D>, settings: SolverSettings) -> ContactProblem<D> {
    let mut problem = problem.clone();
    let report = settings.build::<D>().solve(&mut problem);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    problem
}

/// Largest difference of velocities between Newton and Gauss–Seidel at a tolerance, over the
/// largest velocity.
fn apart<D: Dim>(problem: &ContactProblem<D>, found: &ContactProblem<D>, tolerance: f64) -> f64 {
    let swept = solved(problem, solver(tolerance));
    let scale: f64 = swept.nodes.all.iter().map(|n| n.velocity.norm()).fold(0.0, f64::max);
    let pairs = swept.nodes.all.iter().zip(&found.nodes.all);
    pairs.map(|(a, b)| (a.velocity - b.velocity).norm()).fold(0.0, f64::max) / scale
}

#[test]
fn velocities_agree_with_gauss_seidel() {
    for seed in 0..4 {
        let problem = pressed::<D2>(seed, true).contact_problem();
        let distance = apart(&problem, &solved(&problem, newton(1e-10, Start::StiffLimit)), 1e-10);
        assert!(distance <= 1e-6, "seed {seed}: {distance:e}");
    }
}

/// A beam of bonded disks hit by a wall: no warm start finds the active set of its plastic zone.
#[test]
fn a_struck_beam_is_solved_from_no_guess() {
    let (rows, columns, d) = (6, 60, 4e-3);
    let mut grains = Vec::new();
    for row in 0..rows {
        for column in 0..columns - row % 2 {
            let x = d * (0.5 + column as f64 + 0.5 * (row % 2) as f64);
            grains.push(grain::<D2>(&[x, d * (0.5 + row as f64 * 0.75f64.sqrt())], 0.5 * d));
        }
    }
    let round = |x: f64, y: f64| {
        let shape = Shape::Round { radius: 0.01, inside: false, axis: None };
        Wall::<D2>::fixed(shape, [x, y].into(), 0.2)
    };
    let top = d * (1.0 + (rows - 1) as f64 * 0.75f64.sqrt());
    let mut loader = round(30.0 * d, top + 0.01);
    loader.drive = Drive::Velocity { direction: [0.0, -1.0].into(), speed: Arc::new(|_| 1.0) };
    let walls = vec![round(4.5 * d, -0.01), loader, round(55.5 * d, -0.01)];
    let mut w = world(grains, walls, settings(1e-4));
    w.form_bonds(1e-6, |_| 100.0, 0.3);
    let problem = w.contact_problem();
    let found = solved(&problem, newton(1e-9, Start::StiffLimit));
    // the test needs active limits: many bonds are at their limit
    let limit = found.bonded.iter().filter(|c| failure(&c.r, c.law.shift(), c.law.cone()).is_some()).count();
    assert!(4 * limit > found.bonded.len(), "{limit} of {}", found.bonded.len());
    // Gauss–Seidel does not reach this in a million sweeps; the residual, on which both stop, is
    // compared
    assert!(residual(&found) <= 1e-9);
}

#[test]
fn gauss_seidel_approaches_newton_in_3d() {
    // a million sweeps reach 1e-7 here: the test is that they approach the same velocities
    let problem = pressed::<D3>(0, true).contact_problem();
    // the last path leaves a load error of 3e-8 or 4e-6, depending on round-off: small beside the
    // thousandth required below
    let found = solved(&problem, SolverSettings::Staged(common::newton(1e-10, 1e-10, 1e-5)));
    let [coarse, fine] = [1e-5, 1e-7].map(|tolerance| apart(&problem, &found, tolerance));
    assert!(fine <= 0.1 * coarse && fine <= 1e-3, "{coarse:e}, then {fine:e}");
}

#[test]
fn dry_and_bonded_problems_reach_the_residual() {
    for seed in 0..6 {
        solved(&pressed::<D2>(seed, false).contact_problem(), newton(1e-10, Start::StiffLimit));
        solved(&pressed::<D2>(seed, true).contact_problem(), newton(1e-10, Start::LastStep));
        solved(&pressed::<D3>(seed, false).contact_problem(), newton(1e-10, Start::StiffLimit));
    }
}

/// A hexagonal block between two plates: hyperstatic, so that reactions are not unique but
/// velocities are.
fn block() -> World<D2> {
    pressed_block(|_| 50.0)
}

/// The same under a force (N) that is a function of time (s).
fn pressed_block(force: impl Fn(f64) -> f64 + Send + Sync + 'static) -> World<D2> {
    let r = 2e-3;
    let mut disks = Vec::new();
    for row in 0..9 {
        for column in 0..10 - row % 2 {
            let x = 2.0 * r * column as f64 + r * (row % 2) as f64;
            disks.push(grain::<D2>(&[x, r + 3f64.sqrt() * r * row as f64], r));
        }
    }
    let top = disks.iter().map(|d| d.position[1] + r).fold(0.0, f64::max);
    let mut lid = force_driven::<D2>([0.0, -1.0].into(), [0.0, top].into(), 1.0, 0.0);
    if let Drive::Force { force: given, .. } = &mut lid.drive {
        *given = Arc::new(force);
    }
    let mut w = world(disks, vec![floor(0.2), lid], settings(1e-4));
    w.form_bonds(1e-6, |_| 100.0, 0.3);
    w
}

#[test]
fn the_stiff_limit_does_not_depend_on_the_start() {
    let mut w = block();
    let mut problem = w.contact_problem();
    let first = solved(&problem, newton(1e-9, Start::StiffLimit));
    let mut rng = Pcg64::seed_from_u64(7);
    for contact in &mut problem.bonded {
        contact.r.n = 1e-2 * rng.random::<f64>();
        contact.r.t[0] = 1e-3 * (rng.random::<f64>() - 0.5);
    }
    let other = solved(&problem, newton(1e-9, Start::StiffLimit));
    let kept = solved(&problem, newton(1e-9, Start::LastStep));
    let distance = |a: &ContactProblem<D2>, b: &ContactProblem<D2>| {
        a.bonded.iter().zip(&b.bonded).map(|(a, b)| (a.r - b.r).dot(&(a.r - b.r))).sum::<f64>().sqrt()
    };
    let size = first.bonded.iter().map(|c| c.r.dot(&c.r)).sum::<f64>().sqrt();
    assert!(distance(&first, &other) <= 1e-6 * size, "{:e}", distance(&first, &other) / size);
    // a start from other reactions keeps their self-balanced part, which does no work
    assert!(distance(&first, &kept) > 1e-2 * size);
    // among all reactions that balance the load, those of the stiff limit have the least
    // complementary energy
    let energy = |p: &ContactProblem<D2>| {
        p.bonded.iter().map(|c| c.r.n * c.r.n + c.r.t[0] * c.r.t[0] + 12.0 * c.r.m[0] * c.r.m[0]).sum::<f64>()
    };
    assert!(energy(&first) < energy(&kept));
}

#[test]
fn a_rigid_block_does_not_move_before_it_breaks() {
    let mut w = block();
    w.set_solver(newton(1e-8, Start::StiffLimit));
    for _ in 0..50 {
        let report = w.step().unwrap();
        assert!(report.breaks.is_empty() && report.load_error.is_some_and(|error| error <= 1e-6));
    }
    let strain = w.strain();
    assert!(strain.iter().all(|e| e.abs() <= 1e-9), "{strain:?}");
}

/// Steps a sample `most` times, or until a bond breaks, beside one whose solver is new in every
/// step and cannot extrapolate: the reactions and the ruptures are the same. Returns the share of
/// extrapolated steps, and whether a bond broke.
fn predicted(most: u64, mut w: World<D2>, mut solved: World<D2>) -> (f64, bool) {
    w.set_solver(newton(1e-8, Start::StiffLimit));
    let mut predicted = 0;
    for steps in 1..=most {
        solved.set_solver(newton(1e-8, Start::StiffLimit));
        let (report, other) = (w.step().unwrap(), solved.step().unwrap());
        predicted += u64::from(report.route == Route::Extrapolation);
        assert_eq!(report.route == Route::Extrapolation, report.work.iterations() == 0);
        assert!(other.route == Route::ActiveSet && other.work.newton > 0);
        assert!(report.load_error.is_some_and(|error| error <= 1e-6));
        assert_eq!(report.status, SolveStatus::Converged);
        let (mut off, mut size) = (0.0, 0.0);
        for (a, b) in w.touches().zip(solved.touches()) {
            assert_eq!((a.pair, a.bond), (b.pair, b.bond), "step {steps}");
            off += (a.reaction - b.reaction).dot(&(a.reaction - b.reaction));
            size += b.reaction.dot(&b.reaction);
        }
        assert!(off <= 1e-16 * size, "step {steps}: {:e}", (off / size).sqrt());
        let breaks = |report: &StepReport<D2>| report.breaks.iter().map(|b| (b.bond, b.mode)).collect::<Vec<_>>();
        assert_eq!(breaks(&report), breaks(&other), "step {steps}");
        if !report.breaks.is_empty() {
            assert!(report.work.newton > 0, "what breaks is solved");
            return (predicted as f64 / steps as f64, true);
        }
    }
    (predicted as f64 / most as f64, false)
}

#[test]
fn steps_that_are_predicted_are_those_that_a_solve_finds() {
    // a kink in the load, which then grows until rupture
    let force = |t: f64| if t < 0.02 { 5e3 * t } else { 100.0 + 2e4 * (t - 0.02) };
    let (share, broke) = predicted(2_000, pressed_block(force), pressed_block(force));
    assert!(share > 0.5 && broke, "{share}");
}

#[test]
fn contacts_that_stick_or_close_unseen_are_not_predicted() {
    // one load is constant while another grows: contacts that slip under the first stick under the
    // second
    let turned = || {
        let mut w = pressed_block(|_| 500.0);
        let top = w.grains.position.iter().map(|x| x[1]).fold(0.0, f64::max);
        let corner = w.grains.position.iter().position(|x| x[1] == top).unwrap();
        let (force, torque) = ([1.0, -0.3].into(), Vect::zero());
        w.loads.push(Load { grain: corner, force, torque, factor: Arc::new(|t| 1e3 * t) });
        w
    };
    let (share, broke) = predicted(900, turned(), turned());
    assert!(share > 0.5 && !broke, "{share}");
}

/// The forces (N) between a floor and a row of five bonded disks on it, before and after the row is
/// tilted: each disk then lies `tilt` (–) radii higher than the one before.
fn forces_of_a_tilted_row(tilt: f64) -> [Vec<f64>; 2] {
    let mut set = settings(1e-5);
    set.gravity = down::<D2>(9.81);
    set.solver = newton(1e-10, Start::StiffLimit);
    let r = 0.01;
    let row: Vec<_> = (0..5).map(|k| grain::<D2>(&[2.0 * r * f64::from(k), r], r)).collect();
    let mut w = world(row, vec![floor(0.2)], set);
    w.form_bonds(1e-6, |_| 1e3, 0.3);
    let forces = |w: &World<D2>| w.touches().filter(|t| t.bond.is_none()).map(|t| t.reaction.n).collect::<Vec<_>>();
    w.step().unwrap();
    let before = forces(&w);
    for (k, place) in w.grains.position.iter_mut().enumerate() {
        place[1] += tilt * r * k as f64;
    }
    w.step().unwrap();
    [before, forces(&w)]
}

#[test]
fn a_contact_that_pushed_keeps_its_force_until_it_is_open() {
    // like the errors of many solves: ten times the gap that counts as none without a previous
    // reaction
    let [before, after] = forces_of_a_tilted_row(1e-8);
    assert!(before.len() == 5 && before.iter().all(|f| *f > 0.0), "{before:?}");
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * b;
    assert!(after.len() == 5 && after.iter().zip(&before).all(close), "{after:?} {before:?}");
    // a gap: the row stands on its first disk
    let [_, after] = forces_of_a_tilted_row(1e-4);
    assert!(after[0] > 0.0 && after[1..].iter().all(|f| *f == 0.0), "{after:?}");
}
