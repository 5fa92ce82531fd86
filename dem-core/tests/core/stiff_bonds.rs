//! Elastic bonds that are stiff for the step, k h²/m ≫ 1: how they share a load, and that they
//! break.

use crate::common::{grain, settings};
use crate::elastic::{A, K, R, springs};
use dem_core::body::{Load, Schedule};
use dem_core::bond::{BondStatus, Stiffness};
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::solver::{GaussSeidelSettings, SolverSettings, StagedSettings, Stages};
use dem_core::world::World;
use std::sync::Arc;

/// A grain between two fixed ones, with bonds of strength 1 N, k h²/m = `mobility` and a force
/// along the row that grows by `growth` (N) a step.
fn held<D: Dim>(mobility: f64, growth: f64, solver: SolverSettings) -> World<D> {
    let mut grains = [0.0, A, 2.0 * A].map(|x| grain::<D>(&[&[x], &[0.0; 2][..D::N - 1]].concat(), R));
    (grains[0].fixed, grains[2].fixed) = (true, true);
    let step = (mobility * grains[1].mass / K).sqrt();
    let mut force = D::Vector::zero();
    force[0] = growth;
    let factor: Schedule = Arc::new(move |t| t / step);
    let load = Load { grain: 1, force, torque: D::Spin::zero(), factor };
    let mut set = settings(step);
    set.solver = solver;
    let mut w = World::new(grains.into_iter().collect(), vec![], vec![load], set);
    w.form_bonds(1e-6, |_| 1.0, 0.3);
    w.make_bonds_elastic(springs(K, 0.4));
    w
}

/// With bonds of 3 k and k, the forces of the bonds over that of the load after a few steps, and
/// the largest load error.
fn shares<D: Dim>(mobility: f64, solver: SolverSettings) -> ([f64; 2], f64) {
    let mut w = held::<D>(mobility, 0.1, solver);
    let k = w.bonds[0].stiffness.expect("elastic");
    let [normal, tangential, rolling, twist] = [k.normal, k.tangential, k.rolling, k.twist].map(|k| 3.0 * k);
    w.bonds[0].stiffness = Some(Stiffness { normal, tangential, rolling, twist });
    let errors = (0..5).map(|_| w.step().unwrap().load_error.unwrap_or(0.0));
    let worst = errors.fold(0.0, f64::max);
    let forces: Vec<f64> = w.touches().map(|t| t.reaction.n / (0.5 * 0.2 * 4.5)).collect();
    ([forces[0], forces[1]], worst)
}

/// k h²/m up to 1e10: beside W the compliance is hardly there, and neither the residual nor the
/// velocity error depends on how the bonds share the load.
#[test]
fn stiff_bonds_share_a_load_by_their_stiffness() {
    fn check<D: Dim>() {
        for stages in [Stages::All, Stages::Interior] {
            for mobility in [1e2, 1e4, 1e6, 1e8, 1e10] {
                let staged = SolverSettings::Staged(StagedSettings { stages, ..StagedSettings::default() });
                let (forces, error) = shares::<D>(mobility, staged);
                // beyond that round-off shows, and is reported
                assert!(error < if mobility < 1e9 { 1e-5 } else { 1e-3 }, "{stages:?} {mobility:e}: {error:e}");
                let off = (forces[0] + 0.75).abs().max((forces[1] - 0.25).abs());
                // the inertia of the grain bears a share of the order of 1/mobility
                assert!(off < 1e-4 + 10.0 / mobility, "{stages:?} {mobility:e}: {forces:?}");
            }
        }
    }
    check::<D2>();
    check::<D3>();
}

/// A bond that reaches its limit breaks there: it neither yields nor stays just below.
#[test]
fn the_interior_point_method_breaks_elastic_bonds_at_their_limit() {
    for mobility in [1e2, 1e5, 1e8] {
        let mut grains = [0.0, A].map(|x| grain::<D2>(&[x, 0.0], R));
        grains[0].fixed = true;
        let step = (mobility * grains[1].mass / K).sqrt();
        let factor: Schedule = Arc::new(move |t| 0.01 * t / step);
        let load = Load { grain: 1, force: [0.0, 1.0].into(), torque: Vect::zero(), factor };
        let mut set = settings(step);
        set.solver = SolverSettings::Staged(StagedSettings { stages: Stages::Interior, ..StagedSettings::default() });
        let mut w = World::new(grains.into_iter().collect(), vec![], vec![load], set);
        w.form_bonds(1e-6, |_| 1.0, 0.3);
        w.make_bonds_elastic(springs(K, 0.4));
        while w.step().unwrap().breaks.is_empty() {
            assert!(w.steps < 40, "{mobility:e}: the bond yields");
        }
        // in shear at 0.3 N, and its moment is not larger: in step 31, whose middle is at 0.305 N
        assert_eq!((w.steps, w.bonds[0].status), (31, BondStatus::Shear), "{mobility:e}");
    }
}

/// The forces of the bonds are known however far below their strength they are: three disks in a
/// row, the outer ones fixed, one bond a hundred million times as strong as the other. Each bears
/// half of the load, and the weak one breaks at twice its strength.
#[test]
fn a_strong_bond_leaves_the_weak_one_its_share() {
    fn check<D: Dim>() {
        for strong in [1.0, 1e4, 1e8] {
            for mobility in [1e3, 1e6] {
                let mut w = held::<D>(mobility, 0.05, SolverSettings::default());
                w.bonds[1].strength = strong;
                let mut made = 0;
                while w.bonds[0].status == BondStatus::Intact && w.steps < 60 {
                    made += w.step().unwrap().work.factorisations;
                }
                // the middle of step 41 is at 2.025 N
                assert_eq!(w.steps, 41, "{strong:e}, {mobility:e}");
                // the same factors suffice until the break: no bond is at a limit
                assert!(made <= 4, "{strong:e}, {mobility:e}: {made} factorisations");
            }
        }
    }
    check::<D2>();
    check::<D3>();
}

/// Gauss–Seidel stops on the residual, which does not tell how stiff bonds share a load; its load
/// error does.
#[test]
fn gauss_seidel_reports_that_stiff_bonds_share_a_load_wrongly() {
    let sweeps = || SolverSettings::GaussSeidel(GaussSeidelSettings::default());
    let (soft, error) = shares::<D2>(1.0, sweeps());
    assert!(error < 1e-5 && (soft[0] / soft[1] + 3.0).abs() < 1e-3, "{soft:?}, {error:e}");
    let (stiff, error) = shares::<D2>(1e8, sweeps());
    assert!(error > 1e-2 && (stiff[0] / stiff[1] + 3.0).abs() > 1e-2, "{stiff:?}, {error:e}");
}
