//! Single situations that break simulators, each in its smallest scene.

use super::harness::{stretch, watch};
use super::scene::{Heap, Kind, TOLERANCE};
use crate::common::{self, DENSITY, down, floor, world};
use dem_core::body::{Drive, Grain, Load, Shape, Wall};
use dem_core::bond::BondStatus;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::certificate::Verdict;
use dem_core::world::{Settings, StepError, World};
use std::sync::Arc;

const R: f64 = 1e-3;

fn settings<D: Dim>(step: f64, kind: Kind) -> Settings<D> {
    Settings { solver: kind.settings(TOLERANCE, 1e-6), max_halvings: 4, ..common::settings(step) }
}

fn at<D: Dim>(components: &[f64]) -> D::Vector {
    let mut x = D::Vector::zero();
    for (axis, c) in components.iter().enumerate().take(D::N) {
        x[axis] = *c;
    }
    x
}

fn grain<D: Dim>(components: &[f64]) -> Grain<D> {
    Grain::at_rest(at::<D>(components), R, DENSITY)
}

fn plane<D: Dim>(normal: &[f64], through: &[f64], friction: f64) -> Wall<D> {
    Wall::fixed(Shape::Plane { normal: at::<D>(normal) }, at::<D>(through), friction)
}

/// Both dimensions, every solver.
macro_rules! everywhere {
    ($case:ident) => {
        for kind in Kind::ALL {
            $case::<D2>(kind);
            $case::<D3>(kind);
        }
    };
}

#[test]
fn nothing_at_all() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let mut empty = world::<D>(vec![], vec![], settings(1e-3, kind));
        assert_eq!(watch(&mut empty, 3, 1e-6).stopped, None);
        let mut alone = world::<D>(vec![grain(&[])], vec![], settings(1e-3, kind));
        alone.form_bonds(1.0, |_| 1.0, 0.3);
        assert!(alone.bonds.is_empty());
        assert_eq!(watch(&mut alone, 0, 1e-6).steps, 0);
        assert_eq!(watch(&mut alone, 3, 1e-6).travel, 0.0);
        // walls alone have no contacts
        let mut room = world::<D>(vec![], vec![plane(&[1.0], &[], 0.3)], settings(1e-3, kind));
        assert_eq!(watch(&mut room, 3, 1e-6).stopped, None);
    }
    everywhere!(case);
}

#[test]
fn grains_in_one_place_part_without_a_number_that_is_none() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let mut w = world::<D>(vec![grain(&[0.1, 0.2]), grain(&[0.1, 0.2])], vec![], settings(1e-3, kind));
        w.grains.velocity[0] = at::<D>(&[0.01]);
        let out = watch(&mut w, 500, 1e-6);
        assert_eq!(out.stopped, None);
        let apart = w.grains.position[0][0] - w.grains.position[1][0];
        assert!(apart > 2.0 * R, "{apart}");
    }
    everywhere!(case);
}

#[test]
fn touching_and_aligned_to_the_last_bit() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let column = (0..20).map(|k| {
            let mut x = vec![0.0; D::N];
            x[D::N - 1] = R * f64::from(2 * k + 1);
            grain::<D>(&x)
        });
        let mut set = settings(1e-3, kind);
        set.gravity = down::<D>(9.81);
        let mut w = world(column.collect(), vec![floor(0.3)], set);
        let out = watch(&mut w, 300, 1e-6);
        assert_eq!(out.stopped, None);
        assert!(out.travel < 1e-4 && out.penetration < 1e-4, "{out:?}");
    }
    everywhere!(case);
}

#[test]
fn a_corner_and_a_wedge_hold_a_grain_at_any_friction() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        for friction in [0.0, 0.3, 1.0, 10.0, 1e6] {
            for half_angle in [0.05f64, 0.5, std::f64::consts::FRAC_PI_4, 1.4] {
                let (s, c) = half_angle.sin_cos();
                let mut down = vec![0.0; D::N];
                down[1] = -9.81;
                let mut set = settings(1e-3, kind);
                set.gravity = Some(at::<D>(&down));
                set.friction = friction;
                // the grain touches both walls and falls towards the edge
                let walls = vec![plane(&[c, s], &[], friction), plane(&[-c, s], &[], friction)];
                let mut w = world::<D>(vec![grain(&[0.0, R / s])], walls, set);
                w.grains.velocity[0] = at::<D>(&[0.01, -0.1]);
                let out = watch(&mut w, 100, 1e-6);
                // with large friction it may be wedged so that no reaction satisfies the law; the
                // run then stops with an error
                assert!(out.stopped.is_none() || friction > 1.0, "{friction} {half_angle} {out:?}");
                // the first half step moves it into the walls at its initial speed
                assert!(out.penetration < 0.1, "{friction} {half_angle} {out:?}");
            }
        }
    }
    everywhere!(case);
}

#[test]
fn walls_that_cannot_yield_stop_the_run_and_say_so() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let mut press = plane::<D>(&[-1.0], &[2.0 * R], 0.3);
        press.drive = Drive::Velocity { direction: at::<D>(&[-1.0]), speed: Arc::new(|_| 0.1) };
        let mut w = world::<D>(vec![grain(&[R])], vec![plane(&[1.0], &[], 0.3), press], settings(1e-3, kind));
        let out = watch(&mut w, 20, 1e-6);
        let error = out.stopped.expect("nothing can obey both walls");
        // Newton reaches the residual with an error that closes the contact; Gauss–Seidel does not
        // converge
        let why = match kind {
            Kind::GaussSeidel => matches!(error, StepError::NotAccepted { time: 0.0, .. }),
            _ => match &error {
                StepError::Yielded { time: 0.0, violation } => {
                    violation.pair[0] == 0 && violation.jammed.as_deref() == Some(&[1, 2])
                }
                _ => false,
            },
        };
        assert!(why, "{kind:?}: {error:?}");
        assert_eq!(error.verdict(), Some(&Verdict::NoSolution(vec![0, 1, 2])), "{kind:?}");
        // the first step is refused, and nothing has moved in it
        assert_eq!(out.steps, 0);
        assert_eq!((w.grains.position[0], w.walls[1].position), (at::<D>(&[R]), at::<D>(&[2.0 * R])));
    }
    everywhere!(case);
}

/// A wall that closes so slowly that no contact yields in a single step; between it and another
/// wall are one grain or three bonded grains. The default solver finds it by its velocity error,
/// Gauss–Seidel in the sum over the steps.
#[test]
fn what_a_slow_wall_squeezes_is_found() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        for count in [1, 3] {
            let h = 1e-3;
            let mut press = plane::<D>(&[-1.0], &[2.0 * R * f64::from(count)], 0.3);
            // some hundred-thousandths of a radius a step
            press.drive = Drive::Velocity { direction: at::<D>(&[-1.0]), speed: Arc::new(move |_| 2e-5 * R / h) };
            let grains = (0..count).map(|k| grain(&[R * f64::from(2 * k + 1)])).collect();
            let mut w = world::<D>(grains, vec![plane(&[1.0], &[], 0.3), press], settings(h, kind));
            w.form_bonds(1e-6, |_| 1.0, 0.3);
            let error = (0..400).find_map(|_| w.step().err()).expect("nothing can obey both walls");
            let closed = 2.0 * R * f64::from(count) - w.walls[1].position[0];
            let walls = [count as u32, count as u32 + 1];
            match &error {
                StepError::Yielded { violation, .. } => {
                    assert!(violation.accumulated && violation.jammed.as_deref() == Some(&walls), "{violation:?}");
                }
                StepError::NotAccepted { velocity_error: Some(error), .. } => assert!(*error > 0.1, "{error}"),
                // the reactions grow from step to step
                StepError::NotAccepted { load_error: Some(_), .. } => {}
                // Gauss–Seidel may not converge either
                _ => {
                    assert!(kind == Kind::GaussSeidel && matches!(error, StepError::NotAccepted { .. }), "{error}");
                    continue;
                }
            }
            assert_eq!(error.verdict(), Some(&Verdict::NoSolution((0..count as u32 + 2).collect())));
            assert!(closed <= 4e-3 * R, "{kind:?}, {count}: {closed:e}");
        }
    }
    everywhere!(case);
}

#[test]
fn nothing_flies_through_anything() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        // up to 10,000 diameters a step, head on against a wall and against a grain
        for speed in [1.0, 1e2, 1e4, 1e7] {
            let mut bullet = grain::<D>(&[0.5, 0.0]);
            bullet.velocity = at::<D>(&[-speed]);
            let mut w = world(vec![bullet], vec![plane(&[1.0], &[], 0.3)], settings(1e-3, kind));
            match watch(&mut w, 1000, 1e-6).stopped {
                None => assert!(w.grains.position[0][0] > 0.4 * R, "{speed}: {}", w.grains.position[0][0]),
                Some(error) => assert!(speed > 1e3 && matches!(error, StepError::TooFast { .. }), "{error}"),
            }
            let mut bullet = grain::<D>(&[0.5, 0.0]);
            bullet.velocity = at::<D>(&[-speed]);
            let mut w = world(vec![grain(&[0.0, 0.0]), bullet], vec![], settings(1e-3, kind));
            match watch(&mut w, 600, 1e-6).stopped {
                // both move on together
                None => {
                    let apart = w.grains.position[1][0] - w.grains.position[0][0];
                    assert!((1.4 * R..3.0 * R).contains(&apart), "{speed}: {apart}");
                }
                Some(error) => assert!(speed > 1e3 && matches!(error, StepError::TooFast { .. }), "{error}"),
            }
        }
    }
    everywhere!(case);
}

#[test]
fn a_grain_that_passes_at_a_distance_is_not_touched() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let mut bullet = grain::<D>(&[0.1, 2.2 * R]);
        bullet.velocity = at::<D>(&[-20.0]);
        let mut w = world(vec![grain(&[0.0, 0.0]), bullet], vec![], settings(1e-3, kind));
        assert_eq!(watch(&mut w, 20, 1e-6).stopped, None);
        assert_eq!(w.grains.velocity[1], at::<D>(&[-20.0]));
        assert_eq!(w.grains.velocity[0], at::<D>(&[]));
    }
    everywhere!(case);
}

#[test]
fn a_fragment_that_flies_away_costs_no_memory() {
    let mut heap = Heap { side: 10, gravity: 0.0, floor: false, speed: 0.0, ..Heap::default() }.world::<D2>();
    let calm = {
        heap.step().unwrap();
        heap.touches().len()
    };
    for k in 0..50 {
        heap.grains.velocity[k] = at::<D2>(&[0.0, 0.0]);
        heap.grains.position[k] += at::<D2>(&[-2e6 * heap.grains.radius[k], 3e6 * heap.grains.radius[k]]);
    }
    let out = watch(&mut heap, 100, 1e-4);
    assert_eq!(out.stopped, None);
    assert!(heap.touches().len() <= calm);
}

#[test]
fn all_bonds_break_in_one_step() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        let chain = (0..20).map(|k| grain::<D>(&[2.0 * R * f64::from(k), 0.0]));
        let loads = (0..20).map(|k| {
            let force = at::<D>(&[f64::from(2 * k - 19) * 1e3]);
            Load { grain: k as usize, force, torque: D::Spin::zero(), factor: Arc::new(|_| 1.0) }
        });
        let mut w = World::new(chain.collect(), vec![], loads.collect(), settings::<D>(1e-6, kind));
        w.form_bonds(1e-6, |_| 1.0, 0.3);
        assert_eq!(w.bonds.len(), 19);
        let report = w.step().unwrap();
        assert_eq!(report.breaks.len(), 19);
        assert!(w.bonds.iter().all(|b| b.status == BondStatus::Tension));
        assert_eq!(watch(&mut w, 50, 1e-6).stopped, None);
    }
    everywhere!(case);
}

/// The same world in other units: lengths, masses and times times these.
fn in_units<D: Dim>(world: &mut World<D>, length: f64, mass: f64, time: f64) {
    let (speed, force) = (length / time, mass * length / (time * time));
    let g = &mut world.grains;
    for k in 0..g.len() {
        g.position[k] = g.position[k] * length;
        g.velocity[k] = g.velocity[k] * speed;
        g.spin[k] = g.spin[k] * (1.0 / time);
        g.radius[k] *= length;
        g.mass[k] *= mass;
        g.inertia[k] *= mass * length * length;
    }
    for wall in &mut world.walls {
        wall.position = wall.position * length;
    }
    for bond in &mut world.bonds {
        bond.rest_gap *= length;
        bond.mean_diameter *= length;
        bond.strength *= force;
    }
    let set = &mut world.settings;
    set.step *= time;
    set.gravity = set.gravity.map(|g| g * (length / (time * time)));
}

#[test]
fn units_scaled_by_powers_of_two_change_no_bit() {
    fn case<D: Dim + PartialEq>(kind: Kind) {
        for cohesion in [0.0, 3.0] {
            let heap = Heap { kind, cohesion, side: 3, speed: 1.0, ..Heap::default() };
            let mut one = heap.world::<D>();
            let out = watch(&mut one, 60, heap.accept());
            assert_eq!(out.stopped, None);
            assert!(out.broken > 0 || cohesion == 0.0);
            for (a, b, c) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-10, -31, 5), (13, 8, -7)] {
                let (length, mass, time) = (2f64.powi(a), 2f64.powi(b), 2f64.powi(c));
                let mut other = heap.world::<D>();
                in_units(&mut other, length, mass, time);
                assert_eq!(watch(&mut other, 60, heap.accept()).stopped, None);
                for k in 0..one.grains.len() {
                    let same = one.grains.position[k] * length == other.grains.position[k]
                        && one.grains.velocity[k] * (length / time) == other.grains.velocity[k]
                        && one.grains.spin[k] * (1.0 / time) == other.grains.spin[k];
                    assert!(same, "{kind:?} {}D, 2^{a} 2^{b} 2^{c}, cohesion {cohesion}, grain {k}", D::N);
                }
                assert!(one.bonds.iter().zip(&other.bonds).all(|(x, y)| x.status == y.status));
            }
        }
    }
    everywhere!(case);
}

/// A block of the hexagonal lattice (2D) or the cubic one (3D), bonded, that turns at ω = 1e-3 / h:
/// the largest change of a bond's length, that of the angular momentum, and the largest force over
/// that which keeps a grain at a distance of 2R from the axis on its circle.
fn turning<D: Dim + PartialEq>(kind: Kind, steps: usize) -> [f64; 3] {
    let mut grains = Vec::new();
    let (side, layers) = if D::N == 2 { (4, 1) } else { (3, 3) };
    for row in 0..side {
        for column in 0..side {
            for layer in 0..layers {
                let x = if D::N == 2 {
                    let shift = f64::from(row % 2);
                    [R * (2.0 * f64::from(column) + shift), R * 3f64.sqrt() * f64::from(row), 0.0]
                } else {
                    [column, row, layer].map(|k| 2.0 * R * f64::from(k))
                };
                grains.push(grain::<D>(&x));
            }
        }
    }
    let mut w = world(grains, vec![], settings(1e-3, kind));
    w.form_bonds(1e-6, |_| 1e6, 0.3);
    let n = w.grains.len() as f64;
    let centre = w.grains.position.iter().fold(D::Vector::zero(), |a, b| a + *b) * (1.0 / n);
    let mut spin = D::Spin::zero();
    // out of the plane in 2D, about an oblique axis in 3D: the choice is arbitrary
    for axis in 0..D::Spin::LEN {
        spin[axis] = 1.0 / (D::Spin::LEN as f64).sqrt();
    }
    for k in 0..w.grains.len() {
        let x = w.grains.position[k] - centre;
        // ω × x from the torque x × f of unit forces: (ω × x)·e = ω·(x × e)
        for axis in 0..D::N {
            let mut e = D::Vector::zero();
            e[axis] = 1.0;
            w.grains.velocity[k][axis] = spin.dot(&D::torque(x, e));
        }
        w.grains.spin[k] = spin;
    }
    let before = w.momentum().angular;
    let out = watch(&mut w, steps, 1e-6);
    assert_eq!((out.stopped, out.broken), (None, 0));
    let turned = (w.momentum().angular - before).norm() / before.norm();
    let largest = w.touches().map(|t| t.reaction.n.abs().max(t.reaction.t.norm())).fold(0.0, f64::max);
    [stretch(&w), turned, largest / (w.grains.mass[0] * spin.dot(&spin) * 2.0 * R)]
}

#[test]
fn a_turning_lattice_keeps_its_bonds_and_its_momentum() {
    for kind in [Kind::Newton, Kind::Auto] {
        for [stretch, turned, force] in [turning::<D2>(kind, 2000), turning::<D3>(kind, 500)] {
            let well = stretch <= 1e-6 && turned <= 1e-9 && force <= 3.0;
            assert!(well, "{kind:?}: {stretch:e} {turned:e} {force}");
        }
    }
}

/// Some minutes in release.
#[test]
#[ignore = "long: see docs/running.md"]
fn a_lattice_turns_for_a_million_steps() {
    for [stretch, turned, force] in [turning::<D2>(Kind::Auto, 1_000_000), turning::<D3>(Kind::Auto, 100_000)] {
        println!("stretch {stretch:.1e} of a diameter, angular momentum off by {turned:.1e}, force {force:.2}");
        assert!(stretch <= 1e-6 && turned <= 1e-9 && force <= 3.0, "{stretch:e} {turned:e} {force}");
    }
}

/// A pile of disks on a floor, each row between those of the one below and a disk shorter.
fn pile(rows: u32, friction: f64, kind: Kind) -> World<D2> {
    let mut grains = Vec::new();
    for row in 0..rows {
        for k in 0..rows - row {
            grains.push(grain(&[R * f64::from(2 * k + row), R * (1.0 + 3f64.sqrt() * f64::from(row))]));
        }
    }
    let mut set = settings(1e-4, kind);
    set.gravity = down::<D2>(9.81);
    set.friction = friction;
    world(grains, vec![floor(friction)], set)
}

/// The largest displacement of a grain (radii) in this number of steps, all of which must succeed.
fn travel(mut pile: World<D2>, steps: usize) -> f64 {
    let out = watch(&mut pile, steps, 1e-6);
    assert!(out.stopped.is_none(), "{out:?}");
    out.travel
}

/// A disk on two touching disks stays if friction is at least tan 15° = 0.268; with less friction
/// it rolls them apart.
#[test]
fn a_pile_rests_or_falls_as_its_friction_says() {
    for kind in Kind::ALL {
        assert!(travel(pile(2, 0.27, kind), 2_000) < 1e-6, "{kind:?}");
        assert!(travel(pile(2, 0.265, kind), 2_000) > 0.1, "{kind:?}");
    }
}

/// Reactions that balance the weights of six disks exist for friction of at least 0.43399 (from a
/// linear programme in the rows of the contacts). Below, the pile must fall with every solver.
/// Above, rest and motion can both be solutions of Coulomb's law, and the start decides which one a
/// solver finds. From 0.7 on all solvers find rest except the central path, which from a cold start
/// ends at motion up to 1.2 at least.
#[test]
fn a_pile_of_six_falls_where_no_reactions_can_hold_it() {
    for kind in Kind::ALL {
        let rests = if kind == Kind::Interior { 3.0 } else { 0.8 };
        assert!(travel(pile(3, rests, kind), 1_000) < 1e-6, "{kind:?}");
        assert!(travel(pile(3, 0.43, kind), 1_000) > 1e-3, "{kind:?}");
    }
}

#[test]
#[ignore = "long: see docs/running.md"]
fn a_pile_rests_for_ten_million_steps() {
    let mut pile = pile(2, 0.3, Kind::Auto);
    let start = pile.grains.position.clone();
    let mut crept = [0.0; 2];
    for crept in &mut crept {
        for _ in 0..5_000_000 {
            pile.step().expect("a pile at rest");
        }
        *crept = start.iter().zip(&pile.grains.position).map(|(a, b)| (*b - *a).norm()).fold(0.0, f64::max) / R;
    }
    let heat = pile.kinetic_energy() / (pile.grains.mass[0] * 9.81 * R);
    println!("crept {:.1e} R and {:.1e} R, kinetic energy {heat:.1e} m g R", crept[0], crept[1]);
    assert!(crept[1] < 1e-3 && heat < 1e-12, "{crept:?} {heat:e}");
}

/// Disks one on another, or hanging from the first by their bonds; returns the force at the end
/// that carries all of them, over their weight.
fn tower(count: usize, hanging: bool, kind: Kind) -> f64 {
    let up = if hanging { -1.0 } else { 1.0 };
    let mut grains: Vec<_> = (0..count).map(|k| grain::<D2>(&[0.0, up * R * (2 * k + 1) as f64])).collect();
    grains[0].fixed = hanging;
    let mut set = settings(1e-3, kind);
    set.gravity = down::<D2>(9.81);
    let mass: f64 = grains.iter().filter(|g| !g.fixed).map(|g| g.mass).sum();
    let walls = if hanging { vec![] } else { vec![floor(0.3)] };
    let mut w = world(grains, walls, set);
    if hanging {
        w.form_bonds(1e-6, |_| 1e9, 0.3);
    }
    let out = watch(&mut w, 3, 1e-6);
    assert_eq!(out.stopped, None);
    let bears = w.touches().map(|t| t.reaction.n.abs()).fold(0.0, f64::max);
    bears / (mass * 9.81)
}

#[test]
fn towers_and_chains_bear_their_weight() {
    for kind in [Kind::Newton, Kind::Auto] {
        for hanging in [false, true] {
            let share = tower(300, hanging, kind);
            assert!((share - 1.0).abs() < 1e-6, "{kind:?} {hanging}: {share}");
        }
    }
}

#[test]
#[ignore = "long: see docs/running.md"]
fn towers_and_chains_of_ten_thousand_bear_their_weight() {
    for hanging in [false, true] {
        let share = tower(10_000, hanging, Kind::Auto);
        println!("hanging: {hanging}; force at the end over the weight: 1 + {:.1e}", share - 1.0);
        assert!((share - 1.0).abs() < 1e-5, "{hanging}: {share}");
    }
}

/// Disks in zigzag between two walls that hold them sideways, every other one `mass_ratio` times as
/// heavy. At rest the forces below and above a disk differ by its weight: a relative error ε of
/// these forces is a speed of ε M/m times g h.
fn shaft(mass_ratio: f64, kind: Kind) -> World<D2> {
    let mut grains: Vec<Grain<D2>> = Vec::new();
    for k in 0..6 {
        let aside = if k % 2 == 0 { 1.0 } else { 1.6 };
        let mut grain = grain::<D2>(&[aside * R, (1.0 + 1.91 * f64::from(k)) * R]);
        if k % 2 == 1 {
            grain.mass *= mass_ratio;
            grain.inertia *= mass_ratio;
        }
        grains.push(grain);
    }
    let mut set = settings(1e-4, kind);
    set.gravity = down::<D2>(9.81);
    set.friction = 0.3;
    let sides = [plane(&[1.0, 0.0], &[0.0, 0.0], 0.3), plane(&[-1.0, 0.0], &[2.6 * R, 0.0], 0.3)];
    world(grains, std::iter::once(floor(0.3)).chain(sides).collect(), set)
}

/// A light disk under heavy ones stays at rest as they do; it once moved at up to the tolerance
/// times the mass ratio.
#[test]
fn a_light_grain_that_bears_heavy_ones_is_solved_too() {
    for kind in [Kind::Newton, Kind::Auto, Kind::Interior] {
        for mass_ratio in [1e3, 1e6] {
            let mut shaft = shaft(mass_ratio, kind);
            let out = watch(&mut shaft, 200, 1e-6);
            assert!(out.stopped.is_none(), "{kind:?} {mass_ratio:e}: {out:?}");
            let speed = shaft.grains.velocity.iter().map(|v| v.norm()).fold(0.0, f64::max);
            println!("{kind:?} {mass_ratio:e}: {:.1e} g h, {out:?}", speed / (9.81 * 1e-4));
            assert!(speed <= 1e-3 * 9.81 * 1e-4, "{kind:?} {mass_ratio:e}: {:.1e} g h", speed / (9.81 * 1e-4));
        }
    }
}
