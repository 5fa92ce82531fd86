//! Bonds that turn: a pair that flies round keeps its length, its rate of turning and its energy, whatever holds it together.

mod common;

use common::{grain, newton, settings, world};
use dem_core::bond::Stiffness;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::SolverSettings;

/// Radius of the grains (m).
const R: f64 = 0.01;

/// Two bonded grains that turn about the middle between them at 100 rad/s, a hundredth of a radian a step, for a hundred radians: by how
/// much the bond lengthened (–), the rate of turning at the end over that at the start (–), and the largest gain of energy (–).
fn dumbbell<D: Dim>(stiffness: Option<f64>, friction: f64) -> (f64, f64, f64) {
    let (h, rate) = (1e-4, 100.0);
    let mut pair: Vec<_> = [-R, R].iter().map(|x| grain::<D>(&[*x, 0.0, 0.0][..D::N], R)).collect();
    for (grain, side) in pair.iter_mut().zip([-1.0, 1.0]) {
        grain.velocity[1] = side * rate * R;
        grain.spin[D::Spin::LEN - 1] = if friction > 0.0 { rate } else { 0.0 };
    }
    let mut set = settings(h);
    set.solver = SolverSettings::Staged(newton(1e-10, 1e-8, 1e-6));
    let mut w = world(pair, vec![], set);
    w.form_bonds(1e-6, |_| 1e6, friction);
    if let Some(k) = stiffness {
        w.make_bonds_elastic(|a| Stiffness {
            normal: k,
            tangential: 0.7 * k,
            rolling: k * a * a / 12.0,
            twist: k * a * a / 16.0,
        });
    }
    let (length, first) = (2.0 * R, w.kinetic_energy());
    let (mut longest, mut gain) = (0.0f64, 0.0f64);
    for _ in 0..10_000 {
        w.step().unwrap();
        longest = longest.max(((w.grains.position[1] - w.grains.position[0]).norm() / length - 1.0).abs());
        gain = gain.max((w.ledger.kinetic + w.ledger.elastic) / first - 1.0);
    }
    let turning = (w.grains.velocity[1] - w.grains.velocity[0]).norm() / (2.0 * R * rate);
    (longest, turning, gain)
}

#[test]
fn a_bond_that_turns_keeps_its_length_its_spin_and_its_energy() {
    for (stiffness, friction) in [(Some(1e8), 0.3), (Some(1e10), 0.3), (Some(1e8), 0.0), (None, 0.3), (None, 0.0)] {
        for (longest, turning, gain) in [dumbbell::<D2>(stiffness, friction), dumbbell::<D3>(stiffness, friction)] {
            let what = format!("{stiffness:?} {friction}: {longest:e} {turning} {gain:e}");
            assert!(longest <= 1e-3 && (turning - 1.0).abs() <= 5e-3 && gain <= 1e-6, "{what}");
        }
    }
}
