//! Fragments: the pieces of a sample joined by intact bonds.

use dem_history::{BondStatus, Bonds, Grains};
use petgraph::unionfind::UnionFind;
use serde::Serialize;

use crate::extent::volume;

/// The pieces at one moment. A grain without an intact bond is a piece of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fragments {
    /// Number of pieces.
    pub count: usize,
    /// Pieces of a single grain.
    pub singles: usize,
    /// Grains in the heaviest piece; of equally heavy ones, the one with the most grains.
    pub largest: usize,
    /// Share of the sample's mass in the same piece, 0 to 1.
    pub largest_mass_fraction: f64,
}

/// One piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragment {
    /// Its grains.
    pub grains: Vec<usize>,
    /// Mass, kg.
    pub mass: f64,
    /// Share of the sample's mass, 0 to 1.
    pub mass_fraction: f64,
    /// Volume of its grains, without the pores: m³ in 3D, m² in 2D.
    pub filled: f64,
    /// Its centre of mass, m, D numbers.
    pub centre: Vec<f64>,
}

/// For each of `count` grains, the representative grain of its piece.
fn pieces(count: usize, bonds: &Bonds, status: &[BondStatus]) -> Vec<usize> {
    let mut pieces = UnionFind::<usize>::new(count);
    for ([i, j], _) in bonds.pair.iter().zip(status).filter(|(_, status)| **status == BondStatus::Intact) {
        pieces.union(*i as usize, *j as usize);
    }
    pieces.into_labeling()
}

/// The pieces of grains with masses `mass` (kg) that are joined by the intact bonds of `bonds`.
///
/// `status` has one entry per bond; bonds must name grains within `mass`.
pub fn fragments(mass: &[f64], bonds: &Bonds, status: &[BondStatus]) -> Fragments {
    let (mut grains, mut masses) = (vec![0usize; mass.len()], vec![0.0; mass.len()]);
    for (piece, mass) in pieces(mass.len(), bonds, status).into_iter().zip(mass) {
        grains[piece] += 1;
        masses[piece] += mass;
    }
    let total: f64 = mass.iter().sum();
    let heavier = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    let (heaviest, largest) = masses.iter().copied().zip(grains.iter().copied()).max_by(heavier).unwrap_or_default();
    Fragments {
        count: grains.iter().filter(|&&n| n > 0).count(),
        singles: grains.iter().filter(|&&n| n == 1).count(),
        largest,
        largest_mass_fraction: if total > 0.0 { heaviest / total } else { 0.0 },
    }
}

/// The list of the pieces, the heaviest first; `position` has D numbers for each grain (m).
pub fn fragment_list(sample: &Grains, position: &[f64], bonds: &Bonds, status: &[BondStatus]) -> Vec<Fragment> {
    let dimension = position.len() / sample.mass.len().max(1);
    let mut list: Vec<Option<Fragment>> = vec![None; sample.mass.len()];
    for (grain, piece) in pieces(sample.mass.len(), bonds, status).into_iter().enumerate() {
        let none = || Fragment { centre: vec![0.0; dimension], ..Fragment::default() };
        let fragment = list[piece].get_or_insert_with(none);
        let (mass, radius) = (sample.mass[grain], sample.radius[grain]);
        fragment.grains.push(grain);
        fragment.mass += mass;
        fragment.filled += volume(dimension, radius);
        for (sum, x) in fragment.centre.iter_mut().zip(&position[grain * dimension..]) {
            *sum += mass * x;
        }
    }
    let mut list: Vec<Fragment> = list.into_iter().flatten().collect();
    let total: f64 = sample.mass.iter().sum();
    for fragment in &mut list {
        fragment.mass_fraction = fragment.mass / total;
        fragment.centre.iter_mut().for_each(|x| *x /= fragment.mass);
    }
    list.sort_by(|a, b| b.mass.total_cmp(&a.mass));
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain 0–1–2–3, a pair 4–5 and a lone grain 6.
    fn bonds() -> Bonds {
        Bonds { pair: vec![[0, 1], [2, 1], [2, 3], [4, 5]], ..Bonds::default() }
    }

    #[test]
    fn intact_bonds_hold_pieces_together() {
        let mass = [1.0, 1.0, 1.0, 1.0, 10.0, 10.0, 1.0];
        let found = fragments(&mass, &bonds(), &[BondStatus::Intact; 4]);
        // the chain has more grains, the pair is heavier
        let expected = Fragments { count: 3, singles: 1, largest: 2, largest_mass_fraction: 0.8 };
        assert_eq!(found, expected);
        // of equally heavy pieces, the one with the most grains
        let found = fragments(&[1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 4.0], &bonds(), &[BondStatus::Intact; 4]);
        assert_eq!((found.largest, found.largest_mass_fraction), (4, 4.0 / 12.0));
    }

    #[test]
    fn broken_bonds_hold_nothing() {
        let mut status = [BondStatus::Intact; 4];
        (status[1], status[3]) = (BondStatus::Shear, BondStatus::Rolling);
        let found = fragments(&[1.0; 7], &bonds(), &status);
        let expected = Fragments { count: 5, singles: 3, largest: 2, largest_mass_fraction: 2.0 / 7.0 };
        assert_eq!(found, expected);
    }

    #[test]
    fn pieces_have_a_mass_a_volume_and_a_centre() {
        let mass = vec![1.0, 1.0, 1.0, 1.0, 10.0, 30.0, 1.0];
        let sample = Grains { radius: vec![2.0; 7], mass, ..Grains::default() };
        // the chain lies along x, the pair along z
        let mut position = vec![0.0; 21];
        (position[3], position[6], position[9], position[17]) = (1.0, 2.0, 3.0, 4.0);
        let list = fragment_list(&sample, &position, &bonds(), &[BondStatus::Intact; 4]);
        let grains: Vec<&[usize]> = list.iter().map(|f| f.grains.as_slice()).collect();
        assert_eq!(grains, [&[4, 5][..], &[0, 1, 2, 3], &[6]]);
        assert_eq!((list[0].mass, list[0].centre.clone()), (40.0, vec![0.0, 0.0, 3.0]));
        assert_eq!(list[1].centre, [1.5, 0.0, 0.0]);
        assert!((list[1].filled / (4.0 * 4.0 / 3.0 * std::f64::consts::PI * 8.0) - 1.0).abs() < 1e-12);
    }
}
