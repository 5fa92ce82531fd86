//! Elastic bonds: waves, moduli, energy, stability, rupture, and the same unique solution with
//! every solver.

use crate::common::{self, bonded_pair, grain, pressed, settings, solver, world};
use dem_core::body::{Grain, Grains, Load, Schedule, Shape, Wall};
use dem_core::bond::{BondStatus, Rupture, Stiffness};
use dem_core::contact::{BondFlow, Law, Local};
use dem_core::dim::{D2, D3, D3Twist, Dim, Moments, Vect, versine_share};
use dem_core::problem::ContactProblem;
use dem_core::solver::{GaussSeidelSettings, SolveStatus, SolverSettings};
use dem_core::world::World;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::PI;
use std::sync::Arc;

/// Radius of the grains (m), and the distance of their centres.
pub const R: f64 = 0.01;
pub const A: f64 = 2.0 * R;
/// Normal stiffness (N/m).
pub const K: f64 = 1e6;
/// Strength (N) above all forces of these tests. It is not much larger: as a shift of the reactions
/// it costs them digits.
const UNBREAKABLE: f64 = 1e3;

fn newton(tolerance: f64, load_tolerance: f64) -> SolverSettings {
    SolverSettings::Staged(common::newton(tolerance, 100.0 * tolerance, load_tolerance))
}

/// Springs with this ratio of tangential to normal stiffness; they bend like a bar as wide as it is
/// long.
pub fn springs(normal: f64, ratio: f64) -> impl Fn(f64) -> Stiffness {
    move |a| Stiffness {
        normal,
        tangential: ratio * normal,
        rolling: normal * a * a / 12.0,
        twist: normal * a * a / 16.0,
    }
}

/// The angular frequency observed with steps of length h for a vibration ω: the phase advances by
/// atan(ωh) a step instead of ωh.
fn seen(omega: f64, h: f64) -> f64 {
    (omega * h).atan() / h
}

/// Angular frequency (1/s) of the `amplitude` of a vibrating world, from its first zeros.
fn frequency<D: Dim>(w: &mut World<D>, amplitude: impl Fn(&World<D>) -> f64) -> f64 {
    let mut zeros = Vec::new();
    let mut last = amplitude(w);
    while zeros.len() < 5 {
        w.step().unwrap();
        let now = amplitude(w);
        if last * now < 0.0 {
            zeros.push(w.time - w.settings.step * now / (now - last));
        }
        last = now;
        assert!(w.steps < 2000, "no vibration");
    }
    4.0 * PI / (zeros[4] - zeros[0])
}

#[test]
fn a_chain_vibrates_as_a_chain_of_springs() {
    let free = 30;
    let mut grains: Vec<_> = (0..free + 2).map(|k| grain::<D2>(&[A * k as f64, 0.0], R)).collect();
    (grains[0].fixed, grains[free + 1].fixed) = (true, true);
    let shape = |k: usize| (PI * k as f64 / (free + 1) as f64).sin();
    for (k, g) in grains.iter_mut().enumerate() {
        g.velocity[0] = 1e-3 * shape(k);
    }
    // chain of masses and springs: m ω² = 4 k sin²(q a / 2), and c = a √(k/m) for long waves
    let q = PI / (A * (free + 1) as f64);
    let omega = 2.0 * (K / grains[1].mass).sqrt() * (0.5 * q * A).sin();
    let speed = A * (K / grains[1].mass).sqrt();
    let mut set = settings(2.0 * PI / omega / 200.0);
    set.solver = newton(1e-10, 1e-10);
    let mut w = world(grains, vec![], set);
    w.form_bonds(1e-6, |_| UNBREAKABLE, 0.3);
    w.make_bonds_elastic(springs(K, 0.5));
    let found = frequency(&mut w, |w| (0..=free).map(|k| shape(k) * w.grains.velocity[k][0]).sum());
    assert!((found / seen(omega, w.settings.step) - 1.0).abs() < 1e-4, "{found} against {omega}");
    assert!((found / q / speed - 1.0).abs() < 0.01, "{} m/s against {speed}", found / q);
}

/// A strip of an infinite hexagonal lattice at rest, cut so that it carries a longitudinal standing
/// wave of half a length `cells` A along its rows as the lattice does.
///
/// The upper and the lower edge are mirrors: half a row (half of its mass, half of the stiffness
/// along it) that does not turn and slides without friction on a wall, against which a load presses
/// it. At both ends the wave is odd: a row ends in a fixed grain, or in a mirror image that moves
/// opposite to its last grain; a fixed grain with twice the stiffness replaces the image.
fn wave_strip(cells: usize, ratio: f64) -> World<D2> {
    let rows = 5;
    let (length, pitch) = (A * cells as f64, 0.75f64.sqrt() * A);
    let (mut grains, mut loads) = (Vec::new(), Vec::new());
    for row in 0..rows {
        let edge = row == 0 || row == rows - 1;
        for column in 0..=cells + row % 2 {
            let x = A * (column as f64 - 0.5 * (row % 2) as f64);
            let mut g = grain::<D2>(&[x, R + pitch * row as f64], R);
            g.fixed = x < 0.1 * R || x > length - 0.1 * R;
            if edge {
                g.mass *= 0.5;
                g.inertia = 1e9;
                let outward = if row == 0 { -100.0 } else { 100.0 };
                let force = [0.0, outward].into();
                loads.push(Load { grain: grains.len(), force, torque: [0.0].into(), factor: Arc::new(|_| 1.0) });
            }
            grains.push(g);
        }
    }
    let top = 2.0 * R + pitch * (rows - 1) as f64;
    let walls = [(0.0, 1.0), (top, -1.0)]
        .map(|(y, normal)| Wall::fixed(Shape::Plane { normal: [0.0, normal].into() }, [0.0, y].into(), 0.0));
    let grains: Grains<D2> = grains.into_iter().collect();
    let mut w = World::new(grains, walls.into(), loads, settings(1.0));
    w.form_bonds(1e-6, |_| UNBREAKABLE, 0.3);
    w.make_bonds_elastic(springs(K, ratio));
    for bond in &mut w.bonds {
        let [i, j] = bond.pair.map(|k| w.grains.position[k as usize]);
        let fixed = bond.pair.iter().any(|k| w.grains.fixed[*k as usize]);
        let along = (i[1] - j[1]).abs() < 0.1 * R;
        let edge = i[1] < 1.5 * R || i[1] > top - 1.5 * R;
        let odd = fixed && (i[0].min(j[0]) < -0.1 * R || i[0].max(j[0]) > length + 0.1 * R);
        let factor = if along && edge {
            0.5
        } else if along && odd {
            2.0
        } else {
            1.0
        };
        let k = bond.stiffness.as_mut().unwrap();
        (k.normal, k.tangential, k.rolling) = (factor * k.normal, factor * k.tangential, factor * k.rolling);
    }
    w
}

#[test]
fn a_wave_in_the_hexagonal_lattice_has_the_lattice_s_speed() {
    // Displacements u(x) along x, a direction of the rows. The mirror y → −y leaves u as it is and
    // changes the sign of u_y and of spins: both stay zero. A grain has two neighbours at ±a, and
    // four at ±a/2 whose bonds are tilted by 60° and resist with k_n cos²60° + k_t sin²60°. So m ω²
    // = 4 k_n sin²(q a/2) + (2 k_n + 6 k_t) sin²(q a/4), and for long waves c² = 3 a² (3 k_n + k_t)
    // / (8 m), the longitudinal modulus √3/4 (3 k_n + k_t) of the lattice over its density m /
    // (√3/2 a²).
    let cells = 24;
    let q = PI / (A * cells as f64);
    for ratio in [1e-6, 0.3, 1.0] {
        let mut w = wave_strip(cells, ratio);
        let mass = grain::<D2>(&[0.0, 0.0], R).mass;
        let squared = 4.0 * K * (0.5 * q * A).sin().powi(2) + (2.0 + 6.0 * ratio) * K * (0.25 * q * A).sin().powi(2);
        let omega = (squared / mass).sqrt();
        let speed = (3.0 * A * A * (3.0 + ratio) * K / (8.0 * mass)).sqrt();
        w.settings.step = 2.0 * PI / omega / 200.0;
        w.set_solver(newton(1e-10, 1e-10));
        let wave: Vec<f64> = w.grains.position.iter().map(|x| (q * x[0]).sin()).collect();
        for k in 0..w.grains.len() {
            w.grains.velocity[k][0] = if w.grains.fixed[k] { 0.0 } else { 1e-3 * wave[k] };
        }
        let found = frequency(&mut w, |w| {
            w.grains.velocity.iter().zip(&w.grains.mass).zip(&wave).map(|((v, m), s)| v[0] * m * s).sum()
        });
        let across = w.grains.velocity.iter().map(|v| v[1].abs()).fold(0.0, f64::max);
        let spin = w.grains.spin.iter().map(|s| s[0].abs() * R).fold(0.0, f64::max);
        assert!((found / seen(omega, w.settings.step) - 1.0).abs() < 1e-3, "ratio {ratio}: {found} against {omega}");
        assert!((found / q / speed - 1.0).abs() < 0.01, "ratio {ratio}: {} m/s against {speed}", found / q);
        assert!(across < 1e-6 && spin < 1e-6, "ratio {ratio}: {across:e} m/s across, {spin:e} m/s of spin");
    }
}

/// Step until nothing moves: the implicit step damps the motion, the more the longer it is.
fn settle<D: Dim>(w: &mut World<D>) {
    for _ in 0..60 {
        w.step().unwrap();
    }
}

#[test]
fn the_hexagonal_lattice_has_its_moduli() {
    // C11 = √3/4 (3 k_n + k_t) and C12 = √3/4 (k_n − k_t) (forces per length, no spins in a uniform
    // strain) give E = 2√3 k_n (k_n + k_t) / (3 k_n + k_t) and ν = (k_n − k_t) / (3 k_n + k_t) for
    // a free lattice pulled along its rows.
    let (rows, columns) = (7, 20);
    let stress = 100.0;
    let h32 = 0.75f64.sqrt();
    for ratio in [1e-6, 0.3, 1.0] {
        let young = 2.0 * 3f64.sqrt() * K * (1.0 + ratio) / (3.0 + ratio);
        let poisson = (1.0 - ratio) / (3.0 + ratio);
        let strain = [stress / young, -poisson * stress / young];
        // the forces of the strained lattice on a grain from its six neighbours; the forces of
        // missing neighbours are the load
        let neighbours = [(1.0, 0.0), (0.5, h32), (-0.5, h32), (-1.0, 0.0), (-0.5, -h32), (0.5, -h32)];
        let mut lattice = Vec::new();
        for row in 0..rows {
            for column in 0..columns - row % 2 {
                let x = A * (column as f64 + 0.5 * (row % 2) as f64);
                lattice.push(grain::<D2>(&[x, h32 * A * row as f64], R));
            }
        }
        let mut loads: Vec<Load<D2>> = Vec::new();
        for (k, g) in lattice.iter().enumerate() {
            let (mut force, mut torque) = ([0.0, 0.0], 0.0);
            for (nx, ny) in neighbours {
                let place = [g.position[0] + A * nx, g.position[1] + A * ny];
                let within = place[1] > -R && place[1] < h32 * A * (rows as f64 - 0.5);
                let there = |o: &Grain<D2>| (o.position[0] - place[0]).hypot(o.position[1] - place[1]) < 0.1 * R;
                if within && !lattice.iter().any(there) {
                    let stretch = [A * nx * strain[0], A * ny * strain[1]];
                    let normal = K * (nx * stretch[0] + ny * stretch[1]);
                    let across = ratio * K * (-ny * stretch[0] + nx * stretch[1]);
                    let f = [normal * nx - across * ny, normal * ny + across * nx];
                    force = [force[0] + f[0], force[1] + f[1]];
                    torque += R * (nx * f[1] - ny * f[0]);
                }
            }
            // no stress across the rows, as the moduli above assume
            assert!(force[1].abs() < 1e-9 * stress * A, "{force:?}");
            loads.push(Load { grain: k, force: force.into(), torque: [torque].into(), factor: Arc::new(|_| 1.0) });
        }
        // a long step: 1 s is two hundred periods of the slowest vibration
        let mut set = settings(1.0);
        set.solver = newton(1e-12, 1e-12);
        let mut w = World::new(lattice.into_iter().collect(), vec![], loads, set);
        w.form_bonds(1e-6, |_| UNBREAKABLE, 0.3);
        w.make_bonds_elastic(springs(K, ratio));
        settle(&mut w);
        let found = w.strain();
        assert!((found[0] / strain[0] - 1.0).abs() < 1e-4, "ratio {ratio}: {} against {}", found[0], strain[0]);
        assert!((found[3] - strain[1]).abs() < 1e-4 * strain[0], "ratio {ratio}: {} against {}", found[3], strain[1]);
        assert!(w.kinetic_energy() < 1e-12 * w.ledger.elastic);
    }
}

#[test]
fn a_cantilever_bends_by_its_springs() {
    // bond j, at a distance d_j from the force at the last grain, shears by F/k_t and bends by F
    // d_j / k_m
    let count = 12;
    let mut grains: Vec<_> = (0..=count).map(|k| grain::<D2>(&[A * k as f64, 0.0], R)).collect();
    grains[0].fixed = true;
    let force = 1e-3;
    let load = Load { grain: count, force: [0.0, force].into(), torque: [0.0].into(), factor: Arc::new(|_| 1.0) };
    let mut set = settings(10.0);
    set.solver = newton(1e-12, 1e-12);
    let mut w = World::new(grains.into_iter().collect(), vec![], vec![load], set);
    w.form_bonds(1e-6, |_| 1.0, 0.3);
    let k = springs(K, 0.4)(A);
    w.make_bonds_elastic(|_| k);
    settle(&mut w);
    let yields = |j: usize| force / k.tangential + force * (A * (j as f64 + 0.5)).powi(2) / k.rolling;
    let expected: f64 = (0..count).map(yields).sum();
    let found = w.grains.position[count][1];
    assert!((found / expected - 1.0).abs() < 1e-5, "{found:e} against {expected:e}");
    assert!((w.ledger.elastic / (0.5 * force * expected) - 1.0).abs() < 1e-5);
}

#[test]
fn a_row_twists_by_its_springs() {
    let count = 8;
    let list = (0..=count).map(|k| grain::<D3Twist>(&[A * k as f64, 0.0, 0.0], R));
    let mut grains: Grains<D3Twist> = list.collect();
    grains.fixed[0] = true;
    let torque = 1e-5;
    let (force, torques) = ([0.0; 3].into(), [torque, 0.0, 0.0].into());
    let load = Load { grain: count, force, torque: torques, factor: Arc::new(|_| 1.0) };
    // long compared with the slowest period, 8 ms
    let mut set = settings(0.1);
    set.solver = newton(1e-12, 1e-12);
    let mut w = World::new(grains, vec![], vec![load], set);
    w.form_bonds(1e-6, |_| 1.0, 0.3);
    w.limit_twist(0.2);
    let k = springs(K, 0.4)(A);
    w.make_bonds_elastic(|_| k);
    settle(&mut w);
    let expected = count as f64 * torque / k.twist;
    // a quaternion turned by φ about x is cos φ/2, sin φ/2
    let found = 2.0 * w.grains.orientation[count][1].asin();
    assert!((found / expected - 1.0).abs() < 1e-5, "{found:e} against {expected:e}");
    assert!((w.ledger.elastic / (0.5 * torque * expected) - 1.0).abs() < 1e-5);
}

/// The energy that the bonds of a world store, from their reactions.
fn stored<D: Dim>(w: &World<D>) -> f64 {
    let intact = w.touches().filter_map(|t| Some((t, &w.bonds[t.bond? as usize])));
    intact
        .filter(|(_, bond)| bond.status == BondStatus::Intact)
        .map(|(t, bond)| {
            let (k, r) = (bond.stiffness.unwrap(), t.reaction);
            let (bending, twist) = (r.m.bending(), r.m.twist());
            let moments = bending * bending / k.rolling + if twist > 0.0 { twist * twist / k.twist } else { 0.0 };
            0.5 * (r.n * r.n / k.normal + r.t.dot(&r.t) / k.tangential + moments)
        })
        .sum()
}

fn books<D: Dim>(seed: u64, side: usize, rupture: Rupture) {
    let mut w = pressed::<D>(seed, side, 0.3, Some(BondFlow::Associated));
    w.make_bonds_elastic(springs(3e4, 0.5));
    w.settings.rupture = rupture;
    w.set_solver(newton(1e-8, 1e-6));
    // pulled apart for a while
    for (k, x) in w.grains.position.iter().enumerate() {
        let mut force = D::Vector::zero();
        force[0] = if x[0] > R * side as f64 { 600.0 } else { -600.0 };
        let factor: Schedule = Arc::new(|t| if t < 0.04 { t } else { 0.0 });
        w.loads.push(Load { grain: k, force, torque: D::Spin::zero(), factor });
    }
    let (start, mut fracture, mut broken) = (w.kinetic_energy(), 0.0, 0);
    for _ in 0..60 {
        let report = w.step().unwrap();
        broken += report.breaks.len();
        fracture += report.breaks.iter().map(|b| b.energy).sum::<f64>();
        let l = w.ledger;
        assert!((l.kinetic - w.kinetic_energy()).abs() <= 1e-12 * l.kinetic);
        assert!((l.elastic - stored(&w)).abs() <= 1e-9 * l.elastic.max(1e-6), "{} against {}", l.elastic, stored(&w));
        assert!((l.fracture - fracture).abs() <= 1e-12 * fracture);
        assert!(l.bonds == 0.0 && l.fracture >= 0.0 && l.elastic >= 0.0);
        let found = l.kinetic - start + l.elastic + l.damping + l.fracture + l.friction + l.impact;
        let size = l.external_work.abs().max(start);
        assert!((l.external_work - found).abs() <= 1e-9 * size, "{:e} J of {size:e}", l.external_work - found);
    }
    let l = w.ledger;
    assert!(broken > 5 && broken < w.bonds.len(), "{broken} broken");
    assert!(l.fracture > 0.0 && l.damping > 0.0 && l.elastic > 0.0 && l.friction != 0.0);
}

#[test]
fn the_books_balance_through_breaks() {
    for rupture in [Rupture::Cascade, Rupture::CascadeWorst, Rupture::EndOfStep] {
        books::<D2>(1, 6, rupture);
        books::<D3>(2, 3, rupture);
        books::<D3Twist>(2, 3, rupture);
    }
}

/// Without forces, kinetic and elastic energy never grow, except by the correction of
/// turning bonds. The loss of a step is the damping ½ Σ m |Δv|² + ½ Σ k (h u⁺)² + Σ r b, with the
/// rate b of hidden lengthening before the step.
fn never_grows<D: Dim>(periods: f64) {
    let mut rng = Pcg64::seed_from_u64(5);
    let side: usize = if D::N == 2 { 5 } else { 3 };
    let grains = (0..side.pow(D::N as u32)).map(|k| {
        let x = common::cell::<D>(k, side, |c| A * c as f64);
        let mut g = grain::<D>(&x, R);
        for c in 0..D::N {
            g.velocity[c] = rng.random::<f64>() - 0.5;
        }
        g.spin = D::Spin::from_slice(&vec![30.0 * (rng.random::<f64>() - 0.5); if D::N == 2 { 1 } else { 3 }]);
        g
    });
    let grains: Vec<_> = grains.collect();
    let omega = (K / grains[0].mass).sqrt();
    let h = periods * 2.0 * PI / omega;
    let mut set = settings(h);
    // at rest, bonds that turned keep self-balanced forces, while the load error is relative to the
    // remaining motion
    set.solver = newton(1e-10, 1e-6);
    let mut w = world(grains, vec![], set);
    // a thousandth of the radius in a step, or in a period
    let slow = 1e-3 * R * omega.min(1.0 / h);
    w.grains.velocity.iter_mut().for_each(|v| *v = *v * slow);
    w.grains.spin.iter_mut().for_each(|s| *s = *s * slow);
    let strength = 100.0 * slow * (K * w.grains.mass[0]).sqrt();
    w.form_bonds(1e-6, |_| strength, 0.3);
    w.make_bonds_elastic(springs(K, 0.7));
    let (mut last, first) = (w.kinetic_energy(), w.kinetic_energy());
    let (steps, mut iterations, mut exchanged) = (40, 0, 0.0);
    for _ in 0..steps {
        let (before, spins, damped) = (w.grains.velocity.clone(), w.grains.spin.clone(), w.ledger.damping);
        let places = w.grains.position.clone();
        let old: Vec<_> = w.bonds.iter().map(|b| w.touches().find(|t| t.pair == b.pair).map(|t| t.reaction)).collect();
        let report = w.step().unwrap();
        assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
        assert!(report.breaks.is_empty());
        iterations += report.work.newton;
        let energy = w.ledger.kinetic + w.ledger.elastic;
        assert!(energy <= last + 1e-6 * first, "{energy:e} after {last:e}");
        last = energy;
        let mut lost = 0.0;
        for k in 0..w.grains.len() {
            let (dv, ds) = (w.grains.velocity[k] - before[k], w.grains.spin[k] - spins[k]);
            lost += 0.5 * (w.grains.mass[k] * dv.dot(&dv) + w.grains.inertia[k] * ds.dot(&ds));
        }
        for (bond, old) in w.bonds.iter().zip(old) {
            let (k, t) = (bond.stiffness.unwrap(), w.touches().find(|t| t.pair == bond.pair).unwrap());
            let change = old.map_or(t.reaction, |old| t.reaction - old);
            let parts = change.n.powi(2) / k.normal + change.t.dot(&change.t) / k.tangential;
            lost += 0.5 * (parts + change.m.dot(&change.m) / k.rolling);
            // from the previous mid-step, of a step of the same length, to this one
            let [i, j] = bond.pair.map(|k| k as usize);
            let way = (before[i] - before[j]) * h;
            let now = places[i] - places[j] + way * 0.5;
            let length = (now - way).norm();
            let along = way.dot(&(now - way)) / length;
            // ℓ' − ℓ − d_n without cancellation
            exchanged += (t.reaction.n * way.norm()).abs();
            lost += t.reaction.n * (way.dot(&way) - along * along) / (now.norm() + length + along);
            // the tangential part of −ω × (ω × x) h², where ω is oblique to x
            if D::N > 2 {
                let turn = (spins[i] + spins[j]) * (0.5 * h);
                let arc = D::velocity(turn, D::velocity(turn, now)) * -versine_share(turn.norm());
                lost += t.reaction.t.dot(&D::split(&t.frame, arc).1);
            }
        }
        let damping = w.ledger.damping - damped;
        // the laws are satisfied to the solver's tolerance, 1e-10 of the exchanged work
        let allowed = 1e-12 * first + 1e-10 * exchanged;
        assert!((damping - lost).abs() <= allowed, "{damping:e} against {lost:e} of {first:e}");
    }
    assert!(iterations <= 11 * steps, "{iterations}");
}

#[test]
fn energy_never_grows_however_long_the_step() {
    for periods in [0.01, 1.0, 100.0] {
        never_grows::<D2>(periods);
        never_grows::<D3>(periods);
    }
}

/// Loads a pair slowly up to a share of the limit of its bond and holds the load; returns the
/// failure mode, if the bond broke, with the released energy over ½ f²/k.
fn loaded(share: f64, force: [f64; 2], torque: f64) -> Option<(BondStatus, f64)> {
    let (k, coh) = (1e12, 10.0);
    let steps = 400;
    let mut w = bonded_pair(coh, force, torque);
    w.settings.step = 1e-5;
    let end = 1e-5 * steps as f64;
    // a smooth rise, without overshoot
    w.loads[0].factor = Arc::new(move |t| {
        let s = (t / end).min(1.0);
        share * s * s * (3.0 - 2.0 * s)
    });
    let stiffness = springs(k, 0.6)(2e-3);
    w.make_bonds_elastic(|_| stiffness);
    for _ in 0..steps + 20 {
        let report = w.step().unwrap();
        if let Some(b) = report.breaks.first() {
            let r = b.reaction;
            let energy = r.n * r.n / stiffness.normal
                + r.t[0] * r.t[0] / stiffness.tangential
                + r.m[0] * r.m[0] / stiffness.rolling;
            assert_eq!(w.ledger.fracture, b.energy);
            assert_eq!(w.ledger.elastic, 0.0);
            return Some((b.mode, b.energy / (0.5 * energy)));
        }
    }
    None
}

#[test]
fn a_bond_breaks_at_its_threshold_and_sets_its_energy_free() {
    let (mu, coh, a) = (0.3, 10.0, 2e-3);
    // tension; shear under pressure, with a torque that cancels its moment at the contact; a moment
    // under pressure
    let shear = mu * coh / (1.0 - 0.2 * mu);
    let moment = mu * a * (coh + 5.0);
    for (mode, force, torque) in [
        (BondStatus::Tension, [coh, 0.0], 0.0),
        (BondStatus::Shear, [-0.2 * shear, shear], -0.5 * a * shear),
        // pressure that grows with the moment: m = μ a (n + coh), n = coh/2 at the limit
        (BondStatus::Rolling, [-0.5 * coh, 0.0], moment),
    ] {
        assert_eq!(loaded(1.0 - 1e-6, force, torque), None, "{mode:?}");
        let (found, energy) = loaded(1.0 + 1e-6, force, torque).expect("it breaks");
        assert_eq!(found, mode);
        assert!((energy - 1.0).abs() < 1e-4, "{mode:?}: {energy}");
    }
}

fn solved<D: Dim>(problem: &ContactProblem<D>, settings: SolverSettings) -> ContactProblem<D> {
    let mut problem = problem.clone();
    let report = settings.build::<D>().solve(&mut problem);
    assert_eq!(report.status, SolveStatus::Converged, "{report:?}");
    problem
}

/// A problem with history: bonds that carry forces, dry contacts with floor and lid.
fn with_history<D: Dim>(side: usize) -> ContactProblem<D> {
    let mut w = pressed::<D>(3, side, 0.3, Some(BondFlow::Associated));
    w.make_bonds_elastic(springs(3e4, 0.5));
    w.set_solver(newton(1e-10, 1e-8));
    for _ in 0..10 {
        w.step().unwrap();
    }
    let problem = w.contact_problem();
    let carrying = problem.elastic.iter().filter(|c| c.law.carried().n.abs() > 0.0).count();
    assert!(carrying > 20 && carrying == problem.elastic.len() && !problem.dry.is_empty());
    problem
}

/// Largest difference of velocities, over the largest velocity.
fn apart<D: Dim>(a: &ContactProblem<D>, b: &ContactProblem<D>) -> f64 {
    let size = a.nodes.all.iter().map(|n| n.velocity.norm()).fold(0.0, f64::max);
    let pairs = a.nodes.all.iter().zip(&b.nodes.all);
    pairs.map(|(a, b)| (a.velocity - b.velocity).norm()).fold(0.0, f64::max) / size
}

fn solvers_agree<D: Dim>(side: usize) {
    let problem = with_history::<D>(side);
    let found = solved(&problem, newton(1e-11, 1e-10));
    let swept = |acceleration| match solver(1e-11) {
        SolverSettings::GaussSeidel(gs) => SolverSettings::GaussSeidel(GaussSeidelSettings { acceleration, ..gs }),
        other => other,
    };
    for acceleration in [0, 5] {
        let distance = apart(&solved(&problem, swept(acceleration)), &found);
        assert!(distance <= 1e-7, "{}D, acceleration {acceleration}: {distance:e}", D::N);
    }
}

#[test]
fn all_solvers_reach_the_same_velocities() {
    solvers_agree::<D2>(6);
    solvers_agree::<D3>(3);
    solvers_agree::<D3Twist>(3);
}

/// Distance of the reactions of elastic bonds, over their size.
fn reactions_apart<D: Dim>(a: &ContactProblem<D>, b: &ContactProblem<D>) -> f64 {
    let square = |r: Local<D::Tangent, D::Moment>| r.dot(&r);
    let size: f64 = a.elastic.iter().map(|c| square(c.r)).sum();
    (a.elastic.iter().zip(&b.elastic).map(|(a, b)| square(a.r - b.r)).sum::<f64>() / size).sqrt()
}

fn start_does_not_matter<D: Dim>(side: usize) {
    let mut problem = with_history::<D>(side);
    let found = solved(&problem, newton(1e-10, 1e-10));
    let size = problem.elastic.iter().map(|c| c.r.n.abs()).fold(0.0, f64::max);
    let mut rng = Pcg64::seed_from_u64(11);
    for _ in 0..3 {
        for contact in &mut problem.elastic {
            contact.r.n = size * (rng.random::<f64>() - 0.5);
            contact.r.t = D::Tangent::from_slice(&vec![0.1 * size * (rng.random::<f64>() - 0.5); D::N - 1]);
            contact.r.m = D::Moment::from_slice(&vec![0.1 * size * (rng.random::<f64>() - 0.5); D::Moment::LEN]);
        }
        let other = solved(&problem, newton(1e-10, 1e-10));
        let distance = reactions_apart(&found, &other);
        assert!(distance <= 1e-8 && apart(&found, &other) <= 1e-8, "{}D: {distance:e}", D::N);
    }
}

#[test]
fn the_answer_does_not_depend_on_the_start() {
    start_does_not_matter::<D2>(6);
    start_does_not_matter::<D3>(3);
    start_does_not_matter::<D3Twist>(3);
}

/// A hexagonal block whose first column is fixed and whose last column is pulled obliquely: many
/// reactions balance the load.
fn held_block() -> World<D2> {
    let (mut grains, mut loads) = (Vec::new(), Vec::new());
    for row in 0..6 {
        for column in 0..7 {
            let x = A * (column as f64 + 0.5 * (row % 2) as f64);
            let mut g = grain::<D2>(&[x, 0.75f64.sqrt() * A * row as f64], R);
            g.fixed = column == 0;
            if column == 6 {
                let factor: Schedule = Arc::new(|_| 1.0);
                loads.push(Load { grain: grains.len(), force: [3.0, 5.0].into(), torque: [0.01].into(), factor });
            }
            grains.push(g);
        }
    }
    let mut w = World::new(grains.into_iter().collect(), vec![], loads, settings(1e-2));
    w.form_bonds(1e-6, |_| UNBREAKABLE, 0.3);
    w.set_solver(newton(1e-12, 1e-12));
    w
}

#[test]
fn stiff_bonds_tend_to_the_stiff_limit() {
    let mut rigid = held_block();
    rigid.step().unwrap();
    let size = rigid.touches().map(|t| t.reaction.dot(&t.reaction)).sum::<f64>().sqrt();
    let distances: Vec<f64> = (6..=12)
        .map(|decade| {
            let mut w = held_block();
            w.make_bonds_elastic(springs(10f64.powi(decade), 1.0));
            w.step().unwrap();
            let pairs = w.touches().zip(rigid.touches()).map(|(a, b)| a.reaction - b.reaction);
            pairs.map(|d| d.dot(&d)).sum::<f64>().sqrt() / size
        })
        .collect();
    for pair in distances.windows(2) {
        let fall = pair[0] / pair[1];
        // a tenth for each decade, down to the round-off of the rigid solve
        assert!(pair[1] < 1e-9 || (pair[0] > 0.1 && fall > 1.5) || (9.0..11.0).contains(&fall), "{distances:?}");
    }
    assert!(distances[6] < 1e-6, "{distances:?}");
}
