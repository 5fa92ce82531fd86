//! The list of candidates while bodies move: it holds every pair within reach, and is kept until a
//! body has used up its skin.

use crate::common::{self, grain};
use dem_core::body::{Grains, Shape, Wall};
use dem_core::detection::Candidates;
use dem_core::dim::{D2, D3, Dim, Vect};
use dem_core::plate::Plate;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Grains of radii over a decade in a box, a floor, a cylinder around (a circle in 2D), and a plate
/// in the middle.
fn scene<D: Dim>(rng: &mut Pcg64, count: usize) -> (Grains<D>, Vec<Wall<D>>) {
    let grains = (0..count).map(|_| {
        let x: Vec<f64> = (0..D::N).map(|_| rng.random::<f64>()).collect();
        grain::<D>(&x, 0.02 * 10f64.powf(-rng.random::<f64>()))
    });
    let grains: Grains<D> = grains.collect();
    let mut axis = D::Vector::zero();
    axis[D::N - 1] = 1.0;
    let mut centre = D::Vector::zero();
    (0..D::N).for_each(|k| centre[k] = 0.5);
    let ring = Shape::Round { radius: 0.6, inside: true, axis: (D::N > 2).then_some(axis) };
    let plate = Shape::Plate(Plate::new(axis, None, &[0.4, 0.2]));
    let walls = [ring, plate].map(|shape| Wall::fixed(shape, centre, 0.1));
    (grains, [vec![common::floor(0.1)], walls.to_vec()].concat())
}

/// Every pair whose gap is at most the sum of the reaches, by brute force.
fn near<D: Dim>(
    grains: &Grains<D>,
    x: &[D::Vector],
    walls: &[Wall<D>],
    at: &[D::Vector],
    reach: &[f64],
) -> Vec<[u32; 2]> {
    let n = grains.len();
    let mut pairs = Vec::new();
    for i in 0..n {
        for j in i + 1..n + walls.len() {
            let gap = match j.checked_sub(n) {
                None => (x[i] - x[j]).norm() - grains.radius[i] - grains.radius[j],
                Some(wall) => walls[wall].shape.gap(x[i] - at[wall], grains.radius[i]).0,
            };
            if gap <= reach[i] + reach[j] {
                pairs.push([i as u32, j as u32]);
            }
        }
    }
    pairs
}

/// Moves bodies at random and checks the list; returns how often it was rebuilt.
fn holds_what_is_near<D: Dim>(seed: u64) -> usize {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (grains, walls) = scene::<D>(&mut rng, 80);
    let bodies = grains.len() + walls.len();
    let mut x = grains.position.clone();
    let mut at: Vec<D::Vector> = walls.iter().map(|w| w.position).collect();
    let mut candidates = Candidates::<D>::default();
    let mut renewed = 0;
    for _ in 0..60 {
        let reach: Vec<f64> = (0..bodies).map(|_| 1e-3 + 4e-3 * rng.random::<f64>()).collect();
        let before = candidates.pairs.clone();
        candidates.cover(&grains, &x, &walls, &at, |k| reach[k], |_| 0.02);
        renewed += usize::from(candidates.pairs != before);
        assert!(candidates.pairs.is_sorted_by(|a, b| a < b), "sorted, each pair once");
        for pair in near(&grains, &x, &walls, &at, &reach) {
            assert!(candidates.pairs.binary_search(&pair).is_ok(), "{pair:?} is missing");
        }
        // no pair beyond the skins and the motion since the list was built
        let skins: Vec<f64> = vec![0.025 + 0.02; bodies];
        let far = near(&grains, &x, &walls, &at, &skins);
        assert!(candidates.pairs.iter().all(|pair| far.binary_search(pair).is_ok()));
        for place in x.iter_mut().chain(&mut at) {
            for axis in 0..D::N {
                place[axis] += 1e-2 * (rng.random::<f64>() - 0.5);
            }
        }
    }
    renewed
}

#[test]
fn candidates_hold_every_pair_within_reach_while_bodies_move() {
    for seed in 0..4 {
        let renewed = [holds_what_is_near::<D2>(seed), holds_what_is_near::<D3>(seed)];
        assert!(renewed.iter().all(|n| (2..50).contains(n)), "made anew {renewed:?} times");
    }
}

#[test]
fn the_list_is_kept_until_a_body_has_used_up_its_skin() {
    // two grains with a gap of 0.1: a list with a reach of 0.01 and a spare of 0.02 lacks the pair,
    // one with a spare of 1 has it
    let grains: Grains<D2> = [grain(&[0.0, 0.0], 0.1), grain(&[0.3, 0.0], 0.1)].into_iter().collect();
    let mut candidates = Candidates::<D2>::default();
    let mut pairs = |moved: f64, reach: f64, spare: f64| {
        let x = [[moved, 0.0].into(), [0.3, 0.0].into()];
        candidates.cover(&grains, &x, &[], &[], |_| reach, |_| spare);
        candidates.pairs.len()
    };
    assert_eq!(pairs(0.0, 0.01, 0.02), 0);
    for (moved, reach) in [(0.0199, 0.01), (-0.0199, 0.01), (0.0, 0.0299)] {
        assert_eq!(pairs(moved, reach, 1.0), 0, "kept after {moved}");
    }
    assert_eq!(pairs(0.0, 0.0301, 1.0), 1);
    assert_eq!(pairs(0.5, 0.01, 0.02), 1);
    assert_eq!(pairs(-1.5, 0.01, 0.02), 0);
    assert_eq!(pairs(-1.5201, 0.01, 2.0), 1);
    // another number of bodies requires a new list
    candidates.cover(&grains, &grains.position, &[common::floor(0.0)], &[[0.0, -0.09].into()], |_| 0.01, |_| 0.02);
    assert_eq!(candidates.pairs, [[0, 2], [1, 2]]);
}
