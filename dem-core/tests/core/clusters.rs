//! Fragments that fly and slide: bonds far below their limits, and contacts with fast slip and
//! small reactions.

use crate::common::{down, floor, grain, newton, settings, world};
use dem_core::dim::D3;
use dem_core::solver::{SolverSettings, StagedSettings, Stages};
use dem_core::world::World;

const R: f64 = 1e-3;

/// Blocks of 2 × 3 × 2 bonded spheres above a floor, tilted, by `more` (rad) in addition, and
/// thrown; strength of a bond 10⁴ weights of a sphere.
fn blocks(stages: Stages, more: f64) -> World<D3> {
    let mut grains = Vec::new();
    for (k, (tilt, v)) in
        [(0.66, [0.34, 0.11, -0.43]), (0.73, [0.06, 0.2, -0.86]), (0.03, [-0.19, -0.32, -0.45])].into_iter().enumerate()
    {
        let (sin, cos) = f64::sin_cos(tilt + more);
        for n in 0..12 {
            let [a, b, c] = [n % 2, (n / 2) % 3, n / 6].map(|m| 2.0 * R * f64::from(m));
            let at = [9.0 * R * k as f64 + cos * a - sin * c, b, 3.0 * R + sin * a + cos * c];
            let mut sphere = grain::<D3>(&at, R);
            (0..3).for_each(|axis| sphere.velocity[axis] = v[axis]);
            grains.push(sphere);
        }
    }
    let weight = grains[0].mass * 9.81;
    let mut set = settings(1e-4);
    set.gravity = down::<D3>(9.81);
    set.friction = 0.48;
    set.solver = SolverSettings::Staged(StagedSettings { stages, ..newton(1e-8, 1e-4, 1e-5) });
    let mut world = world(grains, vec![floor(0.21)], set);
    world.form_bonds(1e-3, |_| 1e4 * weight, 0.48);
    world
}

/// With ε x₀ z₀ in the complementarity gap, long steps took up to 300 factorisations and left load
/// errors of 1e-4.
#[test]
fn fragments_that_slide_fast_take_few_factorisations() {
    const TILTS: [f64; 4] = [0.0, 0.01, 0.02, 0.03];
    for (stages, most_in_all) in [(Stages::All, 5_000), (Stages::Interior, 3_500)] {
        let (mut all, mut missed, mut long) = (0, 0, 0);
        for tilt in TILTS {
            let mut world = blocks(stages, tilt);
            for _ in 0..200 {
                let report = world.step().expect("a step");
                assert!(report.residual <= 1e-8 && report.work.factorisations <= 200, "{report:?}");
                missed += usize::from(report.load_error.is_some_and(|error| error > 1e-5));
                long += usize::from(report.work.factorisations > 100);
                all += report.work.factorisations;
            }
        }
        let most = most_in_all * TILTS.len() as u64;
        assert!(all <= most && missed <= 2 && long <= 3, "{stages:?}: {all}, {missed}, {long}");
    }
}
