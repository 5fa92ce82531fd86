//! The stiff limit: among all reactions that balance a load, those of springs with the stiffness
//! ratios of the solver's settings, in the limit of infinite stiffness. A grain held by several
//! bonds distributes its load among them by their stiffness.
//!
//! In 3D a bond is a bar as thick as its pair's mean diameter a: E A/a and G A/a grow with a, E I/a
//! and G J/a with a³, and J = 2 I. In 2D all bonds are alike, except for the arm a of their
//! moments.

use crate::common::{grain, newton, settings};
use dem_core::body::{Grain, Grains, Load};
use dem_core::dim::{D2, D3, D3Twist, Dim, Moments, Vect};
use dem_core::solver::{SolverSettings, StagedSettings, StiffnessRatio};
use dem_core::world::World;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use std::sync::Arc;

const RATIO: StiffnessRatio = StiffnessRatio { tangential: 0.4, rolling: 0.05 };

/// Radius of the central grain (m), and radii of the fixed grains around it with their directions.
const MIDDLE: f64 = 0.008;
const AROUND: [(f64, [f64; 3]); 4] =
    [(0.004, [1.0, 0.0, 0.0]), (0.02, [-0.6, 0.8, 0.0]), (0.012, [-0.3, -1.0, 0.2]), (0.006, [0.1, -0.2, 1.0])];

/// A 3D vector as a vector of the dimension.
fn cut<V: Vect>(x: &Vector3<f64>) -> V {
    match V::LEN {
        // spins in 2D
        1 => V::from_slice(&[x[2]]),
        n => V::from_slice(&x.as_slice()[..n]),
    }
}

fn directions<D: Dim>() -> Vec<(f64, Vector3<f64>)> {
    let here = |(_, d): &&(f64, [f64; 3])| D::N == 3 || d[2] == 0.0 || d[2] == 0.2;
    let flat = |d: [f64; 3]| Vector3::new(d[0], d[1], if D::N == 3 { d[2] } else { 0.0 }).normalize();
    AROUND.iter().filter(here).map(|&(r, d)| (r, flat(d))).collect()
}

/// Force and moment of each bond on the central grain, which is under this force and torque.
/// Displacement method: six unknowns, one spring for each row of a bond.
fn by_springs<D: Dim>(force: &Vector3<f64>, torque: &Vector3<f64>) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let cross = |x: &Vector3<f64>| x.cross_matrix();
    let bonds: Vec<_> = directions::<D>()
        .into_iter()
        .map(|(r, d)| {
            let a = MIDDLE + r;
            let size = if D::N == 3 { a } else { 1.0 };
            let (along, across) = (d * d.transpose(), Matrix3::identity() - d * d.transpose());
            let translation = (along + across * RATIO.tangential) * size;
            // in 2D there is no rotation out of the plane
            let twist = if D::Moment::TWISTS { 2.0 * RATIO.tangential } else { 0.0 };
            let rotation = (across + along * twist) * (RATIO.rolling * a * a * size);
            (d * MIDDLE, translation, rotation)
        })
        .collect();
    let mut k = Matrix6::zeros();
    for (lever, translation, rotation) in &bonds {
        // displacement at the contact: d + θ × lever = d − [lever]× θ
        let turn = -cross(lever);
        let mut add = |row: usize, col: usize, part: Matrix3<f64>| {
            let mut view = k.fixed_view_mut::<3, 3>(row, col);
            view += part;
        };
        add(0, 0, *translation);
        add(0, 3, translation * turn);
        add(3, 0, turn.transpose() * translation);
        add(3, 3, turn.transpose() * translation * turn + rotation);
    }
    let load = Vector6::new(force[0], force[1], force[2], torque[0], torque[1], torque[2]);
    let moved = k.lu().solve(&load).expect("the bonds hold the grain");
    let (shift, turn) = (moved.fixed_rows::<3>(0).into_owned(), moved.fixed_rows::<3>(3).into_owned());
    bonds
        .iter()
        .map(|(lever, translation, rotation)| {
            let at_contact = shift + turn.cross(lever);
            (-(translation * at_contact), -(rotation * turn))
        })
        .collect()
}

fn shares<D: Dim>(force: [f64; 3], torque: [f64; 3]) {
    let (force, torque) = (Vector3::from(force), Vector3::from(torque));
    let mut list: Vec<Grain<D>> = vec![grain(&vec![0.0; D::N], MIDDLE)];
    for (r, d) in directions::<D>() {
        let mut g = grain::<D>(cut::<D::Vector>(&(d * (MIDDLE + r))).as_slice(), r);
        g.fixed = true;
        list.push(g);
    }
    let load = Load { grain: 0, force: cut(&force), torque: cut(&torque), factor: Arc::new(|_| 1.0) };
    let grains: Grains<D> = list.into_iter().collect();
    let mut w = World::new(grains, Vec::new(), vec![load], settings(1e-4));
    w.form_bonds(1e-6, |_| 1e3, 0.3);
    w.limit_twist(0.3);
    w.set_solver(SolverSettings::Staged(StagedSettings { stiffness: RATIO, ..newton(1e-12, 1e-12, 1e-11) }));
    assert!(w.step().unwrap().breaks.is_empty());
    let expected = by_springs::<D>(&force, &torque);
    let largest = expected.iter().map(|(f, _)| f.norm()).fold(0.0, f64::max);
    assert_eq!(w.touches().len(), expected.len());
    for (touch, ((f, m), (_, d))) in w.touches().zip(expected.iter().zip(directions::<D>())) {
        // the normal points to the central grain
        let normal = -f.dot(&d);
        let shear = (f - d * f.dot(&d)).norm();
        let (twist, bending) = (m.dot(&d).abs(), (m - d * m.dot(&d)).norm());
        let r = touch.reaction;
        let near = |found: f64, expected: f64, unit: f64, what: &str| {
            let pair = touch.pair;
            assert!((found - expected).abs() <= 1e-6 * unit, "{what} of {pair:?}: {found} against {expected}");
        };
        near(r.n, normal, largest, "normal reaction");
        near(r.t.norm(), shear, largest, "shear");
        near(r.m.bending(), bending, largest * MIDDLE, "bending");
        near(r.m.twist(), if D::Moment::TWISTS { twist } else { 0.0 }, largest * MIDDLE, "twist");
    }
}

#[test]
fn bonds_share_a_load_by_their_stiffness() {
    for (force, torque) in [([0.05, 0.02, 0.0], [0.0; 3]), ([0.0; 3], [0.0, 0.0, 4e-4])] {
        shares::<D2>(force, torque);
        shares::<D3>(force, torque);
        shares::<D3Twist>(force, torque);
    }
    for (force, torque) in [([0.01, -0.03, 0.05], [0.0; 3]), ([0.0; 3], [4e-4, -1e-4, 2e-4])] {
        shares::<D3>(force, torque);
        shares::<D3Twist>(force, torque);
    }
}
