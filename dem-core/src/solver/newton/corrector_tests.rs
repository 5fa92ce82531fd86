//! The corrector's derivative agrees with finite differences of the corrector, for every law, in 2D
//! and in 3D.

use super::{correct, operator};
use crate::contact::{Cone, PADDED, Padded, Weights};
use crate::solver::rows::{Operator, Row, places};
use nalgebra::{SMatrix, SVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Step of the finite differences, for numbers of order one.
const STEP: f64 = 1e-6;

fn padded(rng: &mut Pcg64, rows: &[usize]) -> Padded {
    let mut x = SVector::<f64, PADDED>::zeros();
    rows.iter().for_each(|row| x[*row] = 2.0 * rng.random::<f64>() - 1.0);
    Padded::from_order(&x)
}

fn weights(rng: &mut Pcg64) -> Weights {
    let mut any = || 0.3 + 2.0 * rng.random::<f64>();
    Weights { n: any(), t: any(), m: any(), w: any() }
}

/// A contact with these numbers of tangential and moment rows.
fn contact(rng: &mut Pcg64, tangents: usize, moments: usize, associated: bool, elastic: bool) -> Row {
    let rows = places(tangents, moments);
    let mut coefficient = |there: bool| if there { 0.1 + rng.random::<f64>() } else { 0.0 };
    let cone = Cone { mu: coefficient(tangents > 0), nu: coefficient(moments > 0), xi: coefficient(moments > 2) };
    let shift = if moments > 0 { rng.random::<f64>() } else { 0.0 };
    Row {
        at: [0; 2],
        count: [0; 2],
        start: 0,
        rows,
        cone,
        associated,
        is_bond: moments > 0,
        shift,
        given: Padded::zero(),
        weights: weights(rng),
        lowered: Weights::default(),
        multiplier: padded(rng, rows),
        compliance: if elastic { weights(rng) } else { Weights::default() },
        carried: if elastic { padded(rng, rows) } else { Padded::zero() },
        normal: 1.0,
        size: 1.0,
    }
}

/// −∂r/∂u by finite differences, column by column; none at a kink, where forward and backward
/// differences disagree.
fn differences(row: &Row, u: &Padded) -> Option<SMatrix<f64, PADDED, PADDED>> {
    let mut a = SMatrix::<f64, PADDED, PADDED>::zeros();
    let here = correct(row, u).in_order();
    for column in row.rows {
        let moved = |step: f64| {
            let mut other = u.in_order();
            other[*column] += step;
            correct(row, &Padded::from_order(&other)).in_order()
        };
        let (ahead, behind) = ((moved(STEP) - here) / STEP, (here - moved(-STEP)) / STEP);
        if (ahead - behind).amax() > 1e-3 {
            return None;
        }
        a.set_column(*column, &((ahead + behind) * -0.5));
    }
    Some(a)
}

fn whole(operator: Option<&Operator>, rows: &[usize]) -> SMatrix<f64, PADDED, PADDED> {
    let mut a = SMatrix::zeros();
    if let Some(operator) = operator {
        for r in rows {
            for c in rows {
                a[(*r, *c)] = operator.entry(*r, *c);
            }
        }
    }
    a
}

/// Check one contact, and count in `seen` whether it was open, stuck or at a limit; false at a
/// kink.
fn check(rng: &mut Pcg64, row: &Row, seen: &mut [usize; 3]) -> bool {
    let u = padded(rng, row.rows) * 2.0;
    let Some(expected) = differences(row, &u) else { return false };
    let r = correct(row, &u);
    let found = operator(row, &u, &r);
    seen[match &found {
        None => 0,
        Some(Operator::Diagonal(_)) => 1,
        Some(Operator::Full(_)) => 2,
    }] += 1;
    let a = whole(found.as_ref(), row.rows);
    assert!((a - expected).amax() <= 1e-5 * (1.0 + a.amax()), "{row:?} at {u:?}: {a} against {expected}");
    if row.associated {
        assert!((a - a.transpose()).amax() <= 1e-14 * a.amax(), "{a} is not symmetric");
    }
    // `times` agrees with the matrix
    if let Some(found) = found {
        let x = padded(rng, row.rows);
        assert!((found.times(&x).in_order() - a * x.in_order()).amax() <= 1e-14 * (1.0 + a.amax()));
    }
    true
}

#[test]
fn the_operator_is_the_derivative_of_the_corrector() {
    let mut rng = Pcg64::seed_from_u64(30);
    // tangential and moment rows of frictionless contacts, dry contacts and bonds
    for (tangents, moments) in [(0, 0), (1, 0), (2, 0), (1, 1), (2, 2), (2, 3)] {
        for kind in 0..4 {
            let (associated, elastic) = (kind & 1 == 1, kind & 2 == 2);
            let (mut seen, mut smooth) = ([0; 3], 0);
            for _ in 0..600 {
                let row = contact(&mut rng, tangents, moments, associated, elastic);
                smooth += usize::from(check(&mut rng, &row, &mut seen));
            }
            let limited = tangents > 0;
            assert!(smooth > 590 && seen[0] > 5 && seen[1] > 5 && (seen[2] > 5) == limited, "{smooth} {seen:?}");
        }
    }
}
