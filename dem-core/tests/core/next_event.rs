//! Loading to the next event: the load of each break against closed forms, its independence of the
//! load function, and branches on which the load decreases.

use crate::common::{grain, newton, settings};
use dem_core::body::{Grains, Load};
use dem_core::bond::{Bond, BondStatus, Rupture};
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect};
use dem_core::solver::{SolverSettings, StagedSettings};
use dem_core::world::{Settings, StepError, World};
use std::sync::Arc;

const MU: f64 = 0.3;
const R: f64 = 1e-3;
const H: f64 = 1e-4;
/// Relative accuracy of a load at rupture: the distance from its limit at which a bond breaks.
const ACCURACY: f64 = 3e-7;

fn event_settings<D: Dim>(until: f64) -> Settings<D> {
    let solver = SolverSettings::Staged(StagedSettings::default());
    Settings { rupture: Rupture::NextEvent { until }, solver, friction: MU, ..settings(H) }
}

/// A grain under a load along the first axis, bonded to two fixed grains on the other side of the
/// first axis, at 60° above and below it; `strengths` are those of the two bonds (N).
fn fork<D: Dim>(strengths: [f64; 2], factor: fn(f64) -> f64) -> World<D> {
    let (c, s) = (0.5, 0.75f64.sqrt());
    let at = |x: f64, y: f64| {
        let mut place = vec![0.0; D::N];
        (place[0], place[1]) = (2.0 * R * x, 2.0 * R * y);
        grain::<D>(&place, R)
    };
    let mut grains = [at(0.0, 0.0), at(-c, s), at(-c, -s)];
    grains[1].fixed = true;
    grains[2].fixed = true;
    let grains: Grains<D> = grains.into_iter().collect();
    let mut force = D::Vector::zero();
    force[0] = 1.0;
    let load = Load { grain: 0, force, torque: D::Spin::zero(), factor: Arc::new(factor) };
    let mut world = World::new(grains, Vec::new(), vec![load], event_settings(100.0));
    let bond = |j: u32, strength: f64| Bond {
        pair: [0, j],
        rest_gap: 0.0,
        mean_diameter: 2.0 * R,
        strength,
        shear: MU,
        rolling: MU,
        twist: MU,
        stiffness: None,
        status: BondStatus::Intact,
    };
    world.add_bonds(vec![bond(1, strengths[0]), bond(2, strengths[1])]);
    world
}

/// With both bonds each carries the tension F c/2 and the shear F s/2, without moment; alone, one
/// carries F c, F s and the moment F s R. Required strengths are ‖t‖/μ − r_n and ‖m‖/(μ 2R) − r_n.
fn loads_of_the_fork(strengths: [f64; 2]) -> [f64; 2] {
    let required = 0.75f64.sqrt() / MU + 0.5;
    [2.0 * strengths[0].min(strengths[1]) / required, strengths[0].max(strengths[1]) / required]
}

fn check_fork<D: Dim>(strengths: [f64; 2], factor: fn(f64) -> f64) {
    let mut world = fork::<D>(strengths, factor);
    let weaker = usize::from(strengths[1] < strengths[0]);
    for (expected, bond) in loads_of_the_fork(strengths).into_iter().zip([weaker, 1 - weaker]) {
        let report = world.step().expect("an event");
        let load = factor(world.load_time);
        assert!((load / expected - 1.0).abs() < ACCURACY, "{strengths:?}: {load} N, not {expected} N");
        let broken: Vec<_> = report.breaks.iter().map(|b| (b.bond as usize, b.mode)).collect();
        assert_eq!(broken, [(bond, BondStatus::Shear)]);
        assert_eq!(world.bonds[bond].status, BondStatus::Shear);
        // nothing moves
        assert!(world.grains.velocity.iter().all(|v| v.norm() == 0.0));
    }
    // nothing holds the grain any more
    let error = world.step().expect_err("no equilibrium");
    assert!(matches!(error, StepError::Unbalanced { body: 0, .. }), "{error}");
    assert_eq!(world.steps, 2);
}

/// After the first break the load of the second is lower (a branch that no growing load can
/// follow), or higher.
#[test]
fn loads_of_breaks_are_those_of_statics_on_falling_and_rising_branches() {
    for strengths in [[10.0, 11.0], [11.0, 10.0], [10.0, 19.0], [10.0, 40.0], [30.0, 7.0]] {
        check_fork::<D2>(strengths, |t| t);
        check_fork::<D3>(strengths, |t| t);
        check_fork::<D3Twist>(strengths, |t| t);
    }
}

#[test]
fn loads_of_breaks_do_not_depend_on_the_load_function() {
    check_fork::<D2>([10.0, 12.0], |t| 1e4 * t);
    check_fork::<D2>([10.0, 12.0], |t| 100.0 * t * t);
    check_fork::<D2>([10.0, 40.0], |t| 100.0 * t.sqrt());
    // a load that waits, then grows
    check_fork::<D2>([10.0, 40.0], |t| (t - 0.1).max(0.0) * 100.0);
}

/// Bonds at their limit together break together.
#[test]
fn bonds_that_reach_their_limits_at_one_load_break_in_one_event() {
    let mut world = fork::<D2>([10.0, 10.0], |t| t);
    let report = world.step().expect("an event");
    assert_eq!(report.breaks.iter().map(|b| b.bond).collect::<Vec<_>>(), [0, 1]);
    assert!((world.load_time / loads_of_the_fork([10.0, 10.0])[0] - 1.0).abs() < ACCURACY);
}

/// Without an event the loads of the last time act, and no bond breaks.
#[test]
fn a_load_that_stays_below_the_limit_breaks_nothing() {
    let mut world = fork::<D2>([10.0, 10.0], |t| t.min(1.0));
    let report = world.step().expect("a step");
    assert!(report.breaks.is_empty());
    assert_eq!((world.load_time, world.intact_bonds()), (100.0, 2));
    let pull: f64 = world.touches().map(|touch| touch.reaction.n).sum();
    assert!((pull + 0.5).abs() < 1e-9, "{pull}");
}

/// A bonded pair that hangs on its weight and is pulled by a growing load: the load at rupture is
/// the strength less the weight. A weight beyond the strength breaks the bond without a load.
#[test]
fn constant_loads_are_part_of_the_equilibrium() {
    let weight = |world: &World<D2>| world.grains.mass[1] * 9.81;
    for (share, expected) in [(2.0, 0.5), (0.5, 0.0)] {
        let grains = [grain::<D2>(&[0.0, 0.0], R), grain(&[0.0, -2.0 * R], R)];
        let mut grains: Grains<D2> = grains.into_iter().collect();
        grains.fixed[0] = true;
        let force = <D2 as Dim>::Vector::new(0.0, -1.0);
        let load = Load { grain: 1, force, torque: Vect::zero(), factor: Arc::new(|t| t) };
        let set = Settings { gravity: Some([0.0, -9.81].into()), ..event_settings(1e3) };
        let mut world = World::new(grains, Vec::new(), vec![load], set);
        let strength = share * weight(&world);
        world.form_bonds(1e-6, |_| strength, MU);
        let report = world.step().expect("an event");
        assert_eq!(report.breaks.iter().map(|b| b.mode).collect::<Vec<_>>(), [BondStatus::Tension]);
        let found = world.load_time / strength;
        assert!((found - expected).abs() < ACCURACY, "{found}");
    }
}

/// Two rows of six disks in squares, the two at one end fixed, the lower one of the other end
/// pulled across the rows. Once the upper bond at the fixed end is broken, the lower one alone
/// bears the load, and its moment is F 9 R: this load is less than half of the first.
#[test]
fn a_rest_that_bears_less_than_half_of_the_released_load_breaks_at_what_it_bears() {
    for rolling in [0.5, 0.45, 0.3, 0.1] {
        let at = |k: usize| grain::<D2>(&[2.0 * R * (k / 2) as f64, 2.0 * R * (k % 2) as f64], R);
        let mut grains: Grains<D2> = (0..12).map(at).collect();
        (grains.fixed[0], grains.fixed[1]) = (true, true);
        let force = <D2 as Dim>::Vector::new(0.0, -1.0);
        let load = Load { grain: 10, force, torque: Vect::zero(), factor: Arc::new(|t| t) };
        let mut world = World::new(grains, Vec::new(), vec![load], event_settings(1e3));
        world.form_bonds(1e-6 * R, |_| 10.0, 5.0);
        world.bonds.iter_mut().for_each(|bond| bond.rolling = rolling);
        let first = world.step().expect("an event").breaks;
        assert_eq!(first.iter().map(|b| b.pair).collect::<Vec<_>>(), [[1, 3]], "{rolling}");
        let peak = world.load_time;
        let second = world.step().expect("an event").breaks;
        assert_eq!(second.iter().map(|b| (b.pair, b.mode)).collect::<Vec<_>>(), [([0, 2], BondStatus::Rolling)]);
        let expected = rolling * 2.0 * R * 10.0 / (9.0 * R);
        assert!((world.load_time / expected - 1.0).abs() < ACCURACY, "{rolling}: {} N", world.load_time);
        assert!(rolling == 0.5 || world.load_time < 0.5 * peak, "{rolling}: {} N after {peak} N", world.load_time);
    }
}

/// Events are those of a stepped run whose steps are small; its load grows by `rate` each second.
#[test]
fn the_first_break_is_that_of_a_stepped_run_with_small_steps() {
    let expected = loads_of_the_fork([10.0, 12.0])[0];
    for steps in [1e3, 1e4] {
        let mut world = fork::<D2>([10.0, 12.0], |t| t);
        world.settings = Settings {
            step: expected / steps,
            rupture: Rupture::Cascade,
            solver: SolverSettings::Staged(newton(1e-10, 1e-8, 1e-8)),
            ..settings(H)
        };
        let load = loop {
            if !world.step().expect("a step").breaks.is_empty() {
                break world.time - 0.5 * world.settings.step;
            }
        };
        // the break is in the first step whose load is enough
        assert!(load >= expected * (1.0 - 1e-6) && load <= expected * (1.0 + 1.0 / steps + 1e-6), "{load}");
    }
}

/// A run that is saved between two events goes on to the same bits.
#[test]
fn a_restored_world_finds_the_same_events() {
    use dem_core::saved::{Reader, Saved};
    let mut world = fork::<D2>([10.0, 12.0], |t| t);
    world.step().expect("an event");
    let mut saved = Saved::default();
    world.save(&mut saved);
    let mut reader = Reader::new(&saved.reals, &saved.counts);
    let grains = Grains::restored(&mut reader).expect("grains");
    let World { walls, loads, settings, .. } = fork::<D2>([10.0, 12.0], |t| t);
    let mut restored = World::restored(grains, walls, loads, settings, &mut reader).expect("what was saved");
    assert_eq!(restored.load_time, world.load_time);
    for world in [&mut world, &mut restored] {
        world.step().expect("an event");
    }
    assert_eq!(restored.load_time.to_bits(), world.load_time.to_bits());
}

/// A load that rises above the strength and falls again before the next trial is met all the same,
/// since the times at which it turns are known.
#[test]
fn a_peak_of_the_load_between_two_trials_is_met() {
    let strengths = [10.0, 12.0];
    let [first, _] = loads_of_the_fork(strengths);
    // 8 N at 3 s, nothing before 1 s and after 5 s; then 1 N
    let peak = |t: f64| if t < 6.0 { (8.0 - 4.0 * (t - 3.0).abs()).max(0.0) } else { (t - 6.0).min(1.0) };
    for step in [1e-4, 0.1, 1.0, 10.0] {
        let mut world = fork::<D2>(strengths, peak);
        world.settings.step = step;
        world.load_knots = vec![1.0, 3.0, 5.0, 6.0, 7.0];
        let report = world.step().expect("an event");
        assert_eq!(report.breaks.len(), 1, "step {step}");
        assert!((peak(world.load_time) / first - 1.0).abs() < ACCURACY, "step {step}: {} s", world.load_time);
        assert!(world.load_time < 3.0, "step {step}: {} s", world.load_time);
    }
}
