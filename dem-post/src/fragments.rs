//! Fragments: the pieces of a sample that intact bonds hold together.

use dem_run::history::{BondStatus, Bonds};
use petgraph::unionfind::UnionFind;
use serde::Serialize;

/// The pieces at one moment. A grain without an intact bond is a piece of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fragments {
    /// Number of pieces.
    pub count: usize,
    /// Pieces of a single grain.
    pub singles: usize,
    /// Grains in the largest piece.
    pub largest: usize,
    /// Share of the sample's mass in the heaviest piece, 0 to 1.
    pub largest_mass_fraction: f64,
}

/// The pieces that the intact bonds of `bonds` make of grains with masses `mass` (kg).
///
/// `status` has one entry per bond; bonds must name grains within `mass`.
pub fn fragments(mass: &[f64], bonds: &Bonds, status: &[BondStatus]) -> Fragments {
    let mut pieces = UnionFind::<usize>::new(mass.len());
    for ([i, j], _) in bonds.pair.iter().zip(status).filter(|(_, status)| **status == BondStatus::Intact) {
        pieces.union(*i as usize, *j as usize);
    }
    let (mut grains, mut masses) = (vec![0usize; mass.len()], vec![0.0; mass.len()]);
    for (grain, mass) in mass.iter().enumerate() {
        let piece = pieces.find_mut(grain);
        grains[piece] += 1;
        masses[piece] += mass;
    }
    let total: f64 = mass.iter().sum();
    let heaviest = masses.iter().copied().fold(0.0, f64::max);
    Fragments {
        count: grains.iter().filter(|&&n| n > 0).count(),
        singles: grains.iter().filter(|&&n| n == 1).count(),
        largest: grains.iter().copied().max().unwrap_or(0),
        largest_mass_fraction: if total > 0.0 { heaviest / total } else { 0.0 },
    }
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
        // the largest piece by grains is the chain, the heaviest is the pair
        let expected = Fragments { count: 3, singles: 1, largest: 4, largest_mass_fraction: 0.8 };
        assert_eq!(found, expected);
    }

    #[test]
    fn broken_bonds_hold_nothing() {
        let mut status = [BondStatus::Intact; 4];
        (status[1], status[3]) = (BondStatus::Shear, BondStatus::Rolling);
        let found = fragments(&[1.0; 7], &bonds(), &status);
        let expected = Fragments { count: 5, singles: 3, largest: 2, largest_mass_fraction: 2.0 / 7.0 };
        assert_eq!(found, expected);
    }
}
