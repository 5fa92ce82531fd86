//! The maps H and Hᵀ between the nodes and the contacts, for grains whose radii differ by a factor
//! of two and walls of every drive: each is the transpose of the other, rigid motion has no
//! relative velocity at any contact, and local blocks are the effect of unit impulses.

use crate::common::{force_driven, grain, settings, world};
use dem_core::body::{Shape, Wall};
use dem_core::bond::{BondStatus, Stiffness};
use dem_core::contact::{Arms, Law, Local};
use dem_core::dim::{Axes, D2, D3, D3Twist, Dim, Vect};
use dem_core::problem::{Contact, ContactProblem, Link, Nodes, Visitor};
use nalgebra::{DMatrix, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn random<V: Vect>(rng: &mut Pcg64) -> V {
    let mut v = V::zero();
    (0..V::LEN).for_each(|k| v[k] = 2.0 * rng.random::<f64>() - 1.0);
    v
}

fn unit<V: Vect>(rng: &mut Pcg64) -> V {
    let v: V = random(rng);
    v * (1.0 / v.norm())
}

/// A random walk of grains, each of which touches the one before and may overlap others. Every
/// third pair that touches is bonded rigidly, every third by a spring. One grain and the floor are
/// fixed; a lid is driven by a force oblique to its normal; a side wall without friction moves at a
/// given speed.
fn crowd<D: Dim>(seed: u64, friction: f64) -> ContactProblem<D> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut grains = vec![grain::<D>(&vec![0.0; D::N], 0.01)];
    for _ in 0..24 {
        let last = *grains.last().unwrap();
        let radius = 0.01 * (0.5 + 0.5 * rng.random::<f64>());
        let x = last.position + unit::<D::Vector>(&mut rng) * (last.radius + radius);
        grains.push(grain(x.as_slice(), radius));
    }
    for g in &mut grains {
        (g.velocity, g.spin) = (random::<D::Vector>(&mut rng) * 0.1, random(&mut rng));
    }
    grains[7].fixed = true;
    (grains[7].velocity, grains[7].spin) = (D::Vector::zero(), D::Spin::zero());
    let axis = |k: usize, sign: f64| {
        let mut e = D::Vector::zero();
        e[k] = sign;
        e
    };
    // through the centre of the outermost grain, so that it overlaps
    let place =
        |normal: &D::Vector| *normal * grains.iter().map(|g| g.position.dot(normal)).fold(f64::INFINITY, f64::min);
    let (up, down, right) = (axis(D::N - 1, 1.0), axis(D::N - 1, -1.0), axis(0, 1.0));
    let floor = Wall::fixed(Shape::Plane { normal: up }, place(&up), friction);
    let mut lid = force_driven::<D>(down, place(&down), 0.3, 2.0);
    if let dem_core::body::Drive::Force { direction, .. } = &mut lid.drive {
        *direction = unit(&mut rng);
    }
    lid.friction = friction;
    let mut side = Wall::fixed(Shape::Plane { normal: right }, place(&right), 0.0);
    side.drive = dem_core::body::Drive::Velocity { direction: right, speed: std::sync::Arc::new(|_| 0.05) };
    let mut w = world(grains, vec![floor, lid, side], settings(1e-3));
    w.settings.friction = friction;
    w.form_bonds(1e-6, |_| 5.0, 0.3);
    w.limit_twist(0.1);
    for (k, bond) in w.bonds.iter_mut().enumerate() {
        match k % 3 {
            0 => bond.status = BondStatus::Shear,
            1 => bond.stiffness = Some(Stiffness { normal: 3e4, tangential: 2e4, rolling: 0.7, twist: 0.9 }),
            _ => {}
        }
    }
    w.contact_problem()
}

/// Checks every contact that it visits, at random velocities and impulses, and counts them by their
/// rows.
struct Check {
    rng: Pcg64,
    seen: [usize; 4],
    at_driven_wall: usize,
}

impl Check {
    /// ⟨M (M⁻¹ H r), v⟩ = ⟨r, Hᵀ v⟩ for velocities that the nodes can have.
    fn adjoint<D: Dim, L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let rng = &mut self.rng;
        let mut moving = nodes.clone();
        for (k, node) in moving.all.iter_mut().enumerate() {
            (node.velocity, node.spin) = (random(rng), random(rng));
            if let Some(wall) = k.checked_sub(nodes.grains) {
                node.velocity = nodes.drives[wall] * (2.0 * rng.random::<f64>() - 1.0);
            }
            if node.inverse_mass == 0.0 {
                (node.velocity, node.spin) = (D::Vector::zero(), D::Spin::zero());
            }
        }
        let r = impulse(c, rng);
        let u: Local<L::T, L::B> = moving.relative_velocity(&c.link, c.law.arms());
        let mut pushed = moving.clone();
        pushed.apply(&c.link, c.law.arms(), r);
        let (mut work, mut size) = (0.0, 0.0);
        for (before, after) in moving.all.iter().zip(&pushed.all) {
            if before.inverse_mass > 0.0 {
                let linear = (after.velocity - before.velocity).dot(&before.velocity) / before.inverse_mass;
                work += linear;
                size += linear.abs();
            } else {
                assert_eq!((before.velocity, before.spin), (after.velocity, after.spin), "what does not yield moved");
            }
            if before.inverse_inertia > 0.0 {
                let angular = (after.spin - before.spin).dot(&before.spin) / before.inverse_inertia;
                work += angular;
                size += angular.abs();
            }
        }
        assert!((work - r.dot(&u)).abs() <= 1e-12 * (size + 1e-3), "{work} against {}", r.dot(&u));
    }

    /// v = V + Ω × x is the motion of one rigid body.
    fn rigid<D: Dim, L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>, distance: f64) {
        let mut moving = nodes.clone();
        let (shift, turn): (D::Vector, D::Spin) = (random(&mut self.rng), random(&mut self.rng));
        // the centres of i and j, from that of j
        let [i, j] = c.link.nodes.map(|k| k as usize);
        let apart = c.link.axes.normal() * distance;
        (moving.all[i].velocity, moving.all[i].spin) = (shift + D::velocity(turn, apart), turn);
        (moving.all[j].velocity, moving.all[j].spin) = (shift, turn);
        let u: Local<L::T, L::B> = moving.relative_velocity(&c.link, c.law.arms());
        assert!(u.dot(&u).sqrt() <= 1e-13, "{u:?}");
    }

    /// The entries of the local block, for a link with a whole frame.
    fn block<D: Dim>(nodes: &Nodes<D>, link: &Link<D>, arms: Arms) {
        let w = responses(nodes, link, arms);
        let wall = (link.nodes[1] as usize).checked_sub(nodes.grains).map(|wall| nodes.drives[wall]);
        let driven = wall.filter(|d| d.norm() > 0.0);
        let block = nodes.block(link, arms);
        let tangents = D::N - 1;
        let size = if arms.bending > 0.0 { 1 + tangents + D::Moment::LEN } else { D::N };
        let mut expected = DMatrix::zeros(size, size);
        for row in 0..size {
            expected[(row, row)] = match row {
                0 => block.n,
                row if row <= tangents => block.t,
                row if row <= 2 * tangents => block.m,
                _ => block.w,
            };
            if (1..=tangents).contains(&row) && size > D::N {
                expected[(row, row + tangents)] = block.tm;
                expected[(row + tangents, row)] = block.tm;
            }
        }
        let w = w.view((0, 0), (size, size)).into_owned();
        let (off, scale) = (&expected - &w, w.amax());
        if driven.is_some() {
            // an upper bound
            let least = SymmetricEigen::new(off).eigenvalues.min();
            assert!(least >= -1e-12 * scale, "{expected} against {w}");
        } else {
            assert!(off.amax() <= 1e-12 * scale, "{expected} against {w}");
        }
    }
}

/// A random impulse that the contact can have.
fn impulse<D: Dim, L: Law>(c: &Contact<D, L>, rng: &mut Pcg64) -> Local<L::T, L::B> {
    let mut r: Local<L::T, L::B> = Local { n: 2.0 * rng.random::<f64>() - 1.0, t: random(rng), m: random(rng) };
    if L::T::LEN == D::N {
        // a vector in the tangent plane
        let normal = c.link.axes.normal();
        let along: f64 = (0..D::N).map(|k| r.t[k] * normal[k]).sum();
        (0..D::N).for_each(|k| r.t[k] -= along * normal[k]);
    }
    r
}

/// Hᵀ M⁻¹ H of one contact, rows n, t, m.
fn responses<D: Dim>(nodes: &Nodes<D>, link: &Link<D>, arms: Arms) -> DMatrix<f64> {
    let size = D::N + D::Moment::LEN;
    let mut w = DMatrix::zeros(size, size);
    for column in 0..size {
        let mut still = nodes.clone();
        still.all.iter_mut().for_each(|n| (n.velocity, n.spin) = (D::Vector::zero(), D::Spin::zero()));
        let mut r = Local::<D::Tangent, D::Moment>::zero();
        match column {
            0 => r.n = 1.0,
            k if k < D::N => r.t[k - 1] = 1.0,
            k => r.m[k - D::N] = 1.0,
        }
        still.apply(link, arms, r);
        let u = still.relative_velocity::<D::Tangent, D::Moment>(link, arms);
        let rows = [u.n].into_iter().chain(u.t.as_slice().iter().copied()).chain(u.m.as_slice().iter().copied());
        rows.enumerate().for_each(|(row, x)| w[(row, column)] = x);
    }
    w
}

impl<D: Dim> Visitor<D> for Check {
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, c: &Contact<D, L>) {
        let arms = c.law.arms();
        let group = match (L::B::LEN > 0, L::T::LEN > 0) {
            (true, _) if c.law.compliance().n > 0.0 => 1,
            (true, _) => 0,
            (false, true) => 2,
            (false, false) => 3,
        };
        self.seen[group] += 1;
        self.adjoint(nodes, c);
        let wall = (c.link.nodes[1] as usize).checked_sub(nodes.grains);
        self.at_driven_wall += usize::from(wall.is_some_and(|wall| nodes.drives[wall].norm() > 0.0));
        if wall.is_none() && L::T::LEN > 0 {
            let [a, b] = arms.lever;
            self.rigid(nodes, c, a + b);
        }
        Self::block(nodes, &c.link.whole(), arms);
    }
}

fn check<D: Dim>() {
    let mut check = Check { rng: Pcg64::seed_from_u64(1), seen: [0; 4], at_driven_wall: 0 };
    for seed in 0..4 {
        crowd::<D>(seed, 0.3).visit(&mut check);
        crowd::<D>(seed, 0.0).visit(&mut check);
    }
    assert!(
        check.seen.iter().all(|n| *n > 20) && check.at_driven_wall > 4,
        "{:?} {}",
        check.seen,
        check.at_driven_wall
    );
}

#[test]
fn each_map_is_the_transpose_of_the_other_and_blocks_are_their_product() {
    check::<D2>();
    check::<D3>();
    check::<D3Twist>();
}
