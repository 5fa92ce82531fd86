//! The anchor, from which a step's reactions are measured: the last reactions, those of the bonds
//! without self-stress.
//!
//! In the limit of stiff contacts reactions change by ρ times the displacements of a step. An
//! intact bond carries ρ H̃ᵀλ, with λ the displacements of the bodies since the bond formed: the
//! minimum-energy reactions (least Σ r²/ρ) with the same net impulses on the bodies. A solve adds a
//! small self-stress, balanced among the bonds. With the last reactions as the anchor of the metric
//! the self-stress would accumulate over the steps. It is removed: the reactions r_b of the bonds
//! become
//!
//! r_a = ρ H̃ᵀ (H̃ ρ H̃ᵀ)⁺ H̃ r_b.
//!
//! A dry contact keeps its reactions, which depend on its slip history.

use super::graph::Graph;
use super::rows::{Row, Rows};
use crate::contact::Padded;
use crate::linear::Factors;
use crate::solver::tuning::STIFF;
use std::sync::Arc;

/// The multipliers of all contacts, those of the bonds without their self-stress (N s); unchanged
/// if the matrix is singular. Adds its factorisation to `made`.
pub(super) fn history(rows: &Rows, graph: &mut Option<Arc<Graph>>, made: &mut u64) -> Vec<Padded> {
    let all: Vec<Padded> = rows.list.iter().map(|row| row.multiplier).collect();
    let Some(graph) = rows.list.iter().any(Row::is_rigid_bond).then(|| Graph::of(rows, graph)).flatten() else {
        return all;
    };
    let stiff = stiffness(rows);
    let mut factors = Factors::default();
    *made += 1;
    let factorised = factors.factorise(&graph.tree, |e, out| {
        let row = &rows.list[graph.contacts[e]];
        if row.is_rigid_bond() {
            let bearing: Vec<usize> = (0..row.rows.len()).filter(|k| row.bears(row.rows[*k])).collect();
            let weights = row.weights.in_order();
            let entry = |i: usize, j: usize| if i == j { stiff / weights[row.rows[bearing[i]]] } else { 0.0 };
            rows.add_element(row, &bearing, entry, out);
        }
    });
    if factorised.is_none() {
        return all;
    }
    let mut pushed = vec![0.0; rows.unknowns];
    rows.list
        .iter()
        .zip(&all)
        .filter(|(row, _)| row.is_rigid_bond())
        .for_each(|(row, r)| rows.apply(row, r, &mut pushed));
    // one step of refinement removes the effect of the identity
    let mut moved = vec![0.0; rows.unknowns];
    for _ in 0..2 {
        let mut left = pushed.clone();
        for row in rows.list.iter().filter(|row| row.is_rigid_bond()) {
            rows.apply(row, &(stiffened(rows, row, stiff, &moved) * -1.0), &mut left);
        }
        factors.solve(&graph.tree, &mut left);
        moved.iter_mut().zip(&left).for_each(|(x, d)| *x += d);
    }
    let history = |(row, r): (&Row, Padded)| if row.is_rigid_bond() { stiffened(rows, row, stiff, &moved) } else { r };
    rows.list.iter().zip(all).map(history).collect()
}

/// ρ H̃ᵀ y of a bond.
fn stiffened(rows: &Rows, row: &Row, stiff: f64, y: &[f64]) -> Padded {
    let (mut r, weights) = (rows.pulled(row, y).in_order(), row.weights.in_order());
    for (place, (r, w)) in r.iter_mut().zip(weights.iter()).enumerate() {
        *r *= if row.bears(place) { stiff / w } else { 0.0 };
    }
    Padded::from_order(&r)
}

/// The factor on ρ that gives H̃ ρ H̃ᵀ the size [`STIFF`].
fn stiffness(rows: &Rows) -> f64 {
    let count = rows.list.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Row) -> f64| rows.list.iter().map(of).sum::<f64>() / count;
    STIFF * mean(&|row| row.weights.n) / mean(&|row| row.normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Cone, PADDED, Weights};
    use crate::solver::rows::places;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Five disks, each bonded to all others and to the ground: 45 rows of bonds over 15 unknowns.
    fn network() -> Rows {
        let mut rng = Pcg64::seed_from_u64(7);
        let mut any = || 2.0 * rng.random::<f64>() - 1.0;
        let mut rows = Rows { unknowns: 15, free: vec![0.0; 15], applied: 1.0, ..Rows::default() };
        for i in 0..5 {
            for j in i..5 {
                let counts = [3, if i == j { 0 } else { 3 }];
                let start = rows.coefficients.len();
                rows.coefficients.extend((0..3 * (counts[0] + counts[1])).map(|_| any()));
                let mut r = [0.0; PADDED];
                [0, 1, 3].into_iter().for_each(|place| r[place] = any());
                rows.list.push(Row {
                    at: [3 * i, 3 * j],
                    count: counts,
                    start,
                    rows: places(1, 1),
                    cone: Cone { mu: 0.3, nu: 0.3, xi: 0.0 },
                    associated: true,
                    is_bond: true,
                    shift: 1.0,
                    given: Padded::zero(),
                    weights: Weights { n: 1.0, t: 2.0, m: 12.0, w: 1.0 },
                    lowered: Weights::default(),
                    multiplier: Padded::from_order(&r.into()),
                    compliance: Weights { n: 0.0, t: 0.0, m: 0.0, w: 0.0 },
                    carried: Padded::zero(),
                    normal: 1.0,
                    size: 1.0,
                });
            }
        }
        rows
    }

    fn net(rows: &Rows, reactions: &[Padded]) -> Vec<f64> {
        let mut y = vec![0.0; rows.unknowns];
        rows.list.iter().zip(reactions).for_each(|(row, r)| rows.apply(row, r, &mut y));
        y
    }

    fn energy(rows: &Rows, reactions: &[Padded]) -> f64 {
        rows.list.iter().zip(reactions).map(|(row, r)| row.weights.times(r).dot(r)).sum()
    }

    #[test]
    fn self_stress_is_removed_and_the_net_impulses_stay() {
        let mut rows = network();
        let before: Vec<Padded> = rows.list.iter().map(|row| row.multiplier).collect();
        let after = history(&rows, &mut None, &mut 0);
        let (wanted, kept) = (net(&rows, &before), net(&rows, &after));
        wanted.iter().zip(&kept).for_each(|(a, b)| assert!((a - b).abs() < 1e-10, "{a} {b}"));
        assert!(energy(&rows, &after) < 0.7 * energy(&rows, &before));
        // the result has no self-stress
        rows.move_multipliers(&after);
        let again = history(&rows, &mut None, &mut 0);
        after.iter().zip(&again).for_each(|(a, b)| assert!((*a - *b).dot(&(*a - *b)).sqrt() < 1e-10));
    }

    /// Grains joined by pins: a bond without rolling strength carries no moment, so none may share
    /// its load in the anchor.
    #[test]
    fn rows_that_bear_nothing_take_no_part() {
        let mut rows = network();
        for row in &mut rows.list {
            row.cone.nu = 0.0;
            row.multiplier.m = Padded::zero().m;
        }
        let after = history(&rows, &mut None, &mut 0);
        assert!(after.iter().all(|r| r.m == Padded::zero().m));
        let before: Vec<Padded> = rows.list.iter().map(|row| row.multiplier).collect();
        net(&rows, &before)
            .iter()
            .zip(&net(&rows, &after))
            .for_each(|(a, b)| assert!((a - b).abs() < 1e-10, "{a} {b}"));
        // reactions without self-stress are their own history
        rows.move_multipliers(&after);
        let again = history(&rows, &mut None, &mut 0);
        after.iter().zip(&again).for_each(|(a, b)| assert!((*a - *b).dot(&(*a - *b)).sqrt() < 1e-10));
    }

    #[test]
    fn dry_contacts_keep_their_reactions() {
        let mut rows = network();
        rows.list[3].is_bond = false;
        let after = history(&rows, &mut None, &mut 0);
        assert_eq!(after[3], rows.list[3].multiplier);
        assert_ne!(after[4], rows.list[4].multiplier);
    }
}
