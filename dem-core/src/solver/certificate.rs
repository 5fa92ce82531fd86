//! The verdict on a problem that was not solved: no solution, solvable, or undecided.
//!
//! | verdict | proof |
//! |---|---|
//! | no solution | impulses d ∈ K_S that balance on all bodies, H d = 0, with q·d < 0 |
//! | a solution exists (2D) | velocities well inside the admissible ones of the associated problem: u ∈ int K* |
//! | neither is proved | |
//!
//! K_S = { dry contacts and bipotential bonds: d_n ≥ 0, all else 0; associated bonds: d ∈ K;
//! elastic bonds: d = 0 }. Every solution has d·u ≥ 0 for d ∈ K_S, and d·u = q·d if H d = 0. In 2D
//! the problem is a linear complementarity problem with a copositive matrix: it has a solution if
//! q·d ≥ 0 for all d ∈ K with H d = 0, which follows from u ∈ K*.
//!
//! Both proofs come from the least violation of an associated problem (`interior/violation.rs`) and
//! are checked here on the original problem. A verdict is reported only if its proof passes this
//! check. Derivation and sources: docs/theory/interior-point.md, "What has no solution".

use super::interior::{Interior, Least};
use super::rows::{Row, Rows, StiffnessRatio};
use crate::contact::{Cone, PADDED, Padded};
use crate::dim::{Dim, Moments};
use crate::problem::ContactProblem;
use crate::problem::assembled::{Assembled, BlockMatrix};
use crate::solver::tuning::{ROUND_OFF, certificate as tuning};

/// The verdict on a problem that was not solved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict<T> {
    /// No solution: no velocities are admissible for these contacts, or bodies, in ascending order.
    NoSolution(Vec<T>),
    /// It has a solution, which the solver has not found.
    Guaranteed,
    /// Neither: a solution is not guaranteed.
    Undecided,
}

impl<T> Verdict<T> {
    /// The same verdict with other names for its contacts or bodies.
    #[must_use]
    pub fn map<U>(self, names: impl FnOnce(Vec<T>) -> Vec<U>) -> Verdict<U> {
        match self {
            Self::NoSolution(list) => Verdict::NoSolution(names(list)),
            Self::Guaranteed => Verdict::Guaranteed,
            Self::Undecided => Verdict::Undecided,
        }
    }
}

/// The verdict on a problem; its contacts are numbered in the order of [`ContactProblem::visit`].
#[must_use]
pub fn verdict<D: Dim>(problem: &ContactProblem<D>) -> Verdict<usize> {
    of(&Rows::of(problem, 1.0, ALIKE), None)
}

/// The verdict on a problem given by its matrix.
#[must_use]
pub fn verdict_of_assembled(problem: &Assembled) -> Verdict<usize> {
    of(&problem.rows(1.0, ALIKE), Some(&problem.parts().matrix))
}

/// The proofs do not depend on stiffnesses.
const ALIKE: StiffnessRatio = StiffnessRatio { tangential: 1.0, rolling: 1.0 };

fn of(rows: &Rows, matrix: Option<&BlockMatrix>) -> Verdict<usize> {
    if let Some(d) = certificate(rows, matrix) {
        let largest = d.iter().map(|d| d.n).fold(0.0, f64::max);
        return Verdict::NoSolution((0..d.len()).filter(|c| d[*c].n >= tuning::CARRIES * largest).collect());
    }
    if !rows.in_space() && is_admissible(rows, matrix) { Verdict::Guaranteed } else { Verdict::Undecided }
}

/// The cone of a contact in K_S.
fn strict(row: &Row) -> Cone {
    if row.associated { row.cone } else { Cone { mu: 0.0, nu: 0.0, xi: 0.0 } }
}

/// Impulses that prove that there is no solution.
fn certificate(rows: &Rows, matrix: Option<&BlockMatrix>) -> Option<Vec<Padded>> {
    let Least { direction: mut d, .. } = least(rows, matrix, strict, 0.0)?;
    for (row, d) in rows.list.iter().zip(&mut d) {
        // round-off may leave them just outside the cone
        let cone = strict(row);
        for (slope, size) in [(cone.mu, d.t.norm()), (cone.nu, d.m.bending()), (cone.xi, d.m.twist())] {
            d.n = if size > slope * d.n { (1.0 + ROUND_OFF) * size / slope } else { d.n };
        }
    }
    proves(rows, matrix, &d).then_some(d)
}

/// Whether impulses lie in K_S, balance on every body and do negative work at the given velocities:
/// then there is no solution.
fn proves(rows: &Rows, matrix: Option<&BlockMatrix>, d: &[Padded]) -> bool {
    let in_cone =
        |(row, d): (&Row, &Padded)| if row.is_elastic() { *d == Padded::zero() } else { strict(row).contains(d) };
    let largest =
        d.iter().flat_map(|d| <[f64; PADDED]>::from(d.in_order())).fold(0.0, |most: f64, d| most.max(d.abs()));
    // H̃ d relative to the largest coefficient of each unknown, or W d to the size of each block
    let net: Vec<f64> = match matrix {
        None => rows.pushed(d).iter().zip(rows.largest()).map(|(net, most)| net / most).collect(),
        Some(_) => {
            let u = velocities(rows, matrix, d);
            rows.list.iter().zip(u).flat_map(|(row, u)| <[f64; PADDED]>::from(u.in_order() / row.size)).collect()
        }
    };
    let (mut power, mut size) = (0.0, 0.0);
    for (row, d) in rows.list.iter().zip(d) {
        let products = row.given.in_order().component_mul(&d.in_order());
        power += products.sum();
        size += products.abs().sum();
    }
    let balanced = net.iter().all(|net| net.abs() <= tuning::EXACT * largest);
    rows.list.iter().zip(d).all(in_cone) && balanced && power < -tuning::EXACT * size
}

/// The least violation of the associated problem with these cones, without shifts and elastic
/// bonds. Normal velocities must exceed `margin` (m/s).
fn least(rows: &Rows, matrix: Option<&BlockMatrix>, cone: impl Fn(&Row) -> Cone, margin: f64) -> Option<Least> {
    let mut convex = rows.clone();
    convex.free.fill(0.0);
    convex.applied = 0.0;
    convex.list.retain(|row| !row.is_elastic());
    if convex.list.is_empty() {
        return None;
    }
    for row in &mut convex.list {
        (row.cone, row.associated, row.shift) = (cone(row), true, 0.0);
        row.given.n -= margin;
    }
    let Least { direction, reactions } = Interior::default().least_violation(&convex, matrix)?;
    let spread = |found: Vec<Padded>| {
        let mut found = found.into_iter();
        let one = |row: &Row| if row.is_elastic() { None } else { found.next() };
        rows.list.iter().map(one).map(|r| r.unwrap_or(Padded::zero())).collect()
    };
    Some(Least { direction: spread(direction), reactions: spread(reactions) })
}

/// W r.
fn velocities(rows: &Rows, matrix: Option<&BlockMatrix>, r: &[Padded]) -> Vec<Padded> {
    let Some(matrix) = matrix else {
        let y = rows.pushed(r);
        return rows.list.iter().map(|row| rows.pulled(row, &y)).collect();
    };
    let flat = |(row, r): (&Row, &Padded)| row.rows.iter().map(|place| r.in_order()[*place]).collect::<Vec<_>>();
    let r: Vec<f64> = rows.list.iter().zip(r).flat_map(flat).collect();
    let one = |(c, row): (usize, &Row)| {
        let mut own = vec![0.0; row.rows.len()];
        matrix.multiply_row(c, &r, &mut own);
        let mut u = [0.0; PADDED];
        row.rows.iter().zip(own).for_each(|(place, value)| u[*place] = value);
        Padded::from_order(&u.into())
    };
    rows.list.iter().enumerate().map(one).collect()
}

/// Whether there are velocities in K*: the given ones, or else those of the least violation, if
/// they lie well inside.
fn is_admissible(rows: &Rows, matrix: Option<&BlockMatrix>) -> bool {
    let inside = |u: &[Padded], least: f64| {
        let margin = |(row, u): (&Row, &Padded)| {
            let Cone { mu, nu, xi } = row.cone;
            u.n - mu * u.t.norm() - nu * u.m.bending() - xi * u.m.twist()
        };
        rows.list.iter().zip(u).filter(|(row, _)| !row.is_elastic()).all(|pair| margin(pair) >= least)
    };
    let given: Vec<Padded> = rows.list.iter().map(|row| row.given).collect();
    if inside(&given, 0.0) {
        return true;
    }
    let speed = given.iter().map(|u| u.dot(u)).fold(0.0, f64::max).sqrt();
    let Some(found) = least(rows, matrix, |row| row.cone, tuning::MARGIN * speed) else { return false };
    let moved = velocities(rows, matrix, &found.reactions);
    let u: Vec<Padded> = given.iter().zip(moved).map(|(given, moved)| *given + moved).collect();
    inside(&u, 0.5 * tuning::MARGIN * speed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Local, Weights};
    use crate::problem::assembled::{ContactRows, Parts};

    /// A disk of unit mass between two walls that close: rows n, t of each contact over (x, y,
    /// spin).
    fn squeezed() -> Assembled {
        let h = [[1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, -1.0]];
        let entry = |k: usize| (k / 4, k % 4, (0..3).map(|c| h[k / 4][c] * h[k % 4][c]).sum());
        let parts = Parts {
            rows: ContactRows { tangents: 1, moments: 0 },
            matrix: BlockMatrix::from_entries(2, 2, &(0..16).map(entry).collect::<Vec<_>>()),
            q: vec![-1.0, 0.3, -0.5, 0.2],
            mu: vec![0.3; 2],
            nu: vec![0.0; 2],
            xi: vec![0.0; 2],
            associated: vec![false; 2],
            shift: vec![0.0; 2],
            applied: 0.0,
        };
        Assembled::new(parts).unwrap()
    }

    #[test]
    fn a_certificate_spoilt_by_one_number_is_refused() {
        let problem = squeezed();
        let (rows, matrix) = (problem.rows(1.0, ALIKE), Some(&problem.parts().matrix));
        let d = certificate(&rows, matrix).expect("no solution");
        assert!(proves(&rows, matrix, &d));
        assert!((d[0].n / d[1].n - 1.0).abs() < 1e-12, "{d:?}");
        // one impulse, or the given velocity of one contact
        for contact in 0..2 {
            for spoil in [1.0 + 1e-9, 1.0 - 1e-9, 0.0, -1.0, f64::NAN, f64::INFINITY] {
                let mut spoilt = d.clone();
                spoilt[contact].n *= spoil;
                assert!(!proves(&rows, matrix, &spoilt), "{spoil}");
            }
            for push in [1e-12, -0.3] {
                let mut spoilt = d.clone();
                spoilt[contact].t[0] = push * d[contact].n;
                assert!(!proves(&rows, matrix, &spoilt), "{push}");
            }
        }
        let mut opened = rows.clone();
        opened.list[0].given.n = 0.5;
        assert!(!proves(&opened, matrix, &d));
        assert!(certificate(&opened, matrix).is_none());
        // a compliant contact; zero impulses
        let mut soft = rows.clone();
        soft.list[1].compliance = Weights { n: 1e-6, ..Weights::default() };
        assert!(!proves(&soft, matrix, &d));
        assert!(!proves(&rows, matrix, &[Local::zero(); 2]));
    }
}
