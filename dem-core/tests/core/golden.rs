//! One short run, compared to the bit. A change that alters it alters all results and belongs in
//! the list of changes.
//!
//! Its bits are those of x86_64 Linux: Gauss–Seidel in 2D uses operations defined by IEEE 754
//! (sums, products, quotients and roots) in an order fixed by the scene. For an intended change,
//! the test prints the new value for [`GOLDEN`].

use crate::common::{self, pressed};
use dem_core::body::Drive;
use dem_core::contact::BondFlow;
use dem_core::dim::D2;
use dem_core::world::World;
use std::sync::Arc;

/// Hash of the state after the last step of [`compressed`].
const GOLDEN: u64 = 0x3a9b_83c0_2384_425b;

/// FNV-1a over the bytes of the numbers, lowest byte first.
struct Hash(u64);

impl Hash {
    fn add(&mut self, bits: u64) {
        for byte in bits.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    fn add_all(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|x| self.add(x.to_bits()));
    }
}

/// Bonded disks on a floor, under a lid whose force grows until some of their bonds have broken,
/// and twenty steps more.
fn compressed() -> World<D2> {
    let mut w = pressed::<D2>(3, 6, 0.3, Some(BondFlow::Associated));
    w.stop_motion();
    w.settings.gravity = None;
    w.set_solver(common::solver(1e-6));
    w.bonds.iter_mut().for_each(|bond| bond.strength *= 100.0);
    if let Drive::Force { force, .. } = &mut w.walls[1].drive {
        *force = Arc::new(|t| 5e4 * t);
    }
    let mut rest = 20;
    while rest > 0 {
        w.step().expect("an accepted step");
        rest -= usize::from(w.intact_bonds() < w.bonds.len());
        assert!(w.steps < 300, "nothing breaks");
    }
    w
}

#[test]
fn a_short_compression_has_the_bits_it_had() {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("skipped: the hash holds for x86_64 Linux");
        return;
    }
    let w = compressed();
    let broken = w.bonds.len() - w.intact_bonds();
    assert!(w.steps > 25 && w.intact_bonds() > 0, "{broken} of {} broke in {} steps", w.bonds.len(), w.steps);
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    let g = &w.grains;
    g.position.iter().chain(&g.velocity).for_each(|x| hash.add_all(x.as_slice()));
    g.spin.iter().chain(&g.orientation).for_each(|x| hash.add_all(x.as_slice()));
    w.walls.iter().for_each(|wall| hash.add_all(&[wall.position[1], wall.velocity[1], wall.reaction[1]]));
    w.bonds.iter().for_each(|bond| hash.add(bond.status as u64));
    for touch in w.touches() {
        touch.pair.iter().for_each(|k| hash.add(u64::from(*k)));
        hash.add_all(&[touch.reaction.n, touch.reaction.t[0], touch.reaction.m[0]]);
    }
    let l = &w.ledger;
    hash.add_all(&[l.kinetic, l.external_work, l.impact, l.friction, l.bonds, l.remainder]);
    assert_eq!(
        hash.0,
        GOLDEN,
        "the run ends in other bits: 0x{:016x}, with {broken} of {} bonds broken after {} steps. If that is meant, make it the \
         value of GOLDEN in dem-core/tests/core/golden.rs, and list the change in CHANGELOG.md",
        hash.0,
        w.bonds.len(),
        w.steps
    );
}
