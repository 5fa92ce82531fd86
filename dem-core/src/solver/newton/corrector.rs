//! The corrector of one contact in the metric 1/ρ, and its derivative.
//!
//! The corrector maps a multiplier r̂ and a relative velocity u to a reaction r(q), with
//! q = u − r̂/ρ (and the carried reaction of an elastic bond, [`Row::form`]). For an associated law
//! r minimises ½ Σ w r² + q·r over the cone, w = 1/ρ + C. For Coulomb's law r_n = (−q_n/w_n)⁺
//! (Signorini), and the tangential part is clipped to μ r_n (Alart & Curnier 1991). A contact adds
//! A = −∂r/∂q to the matrix of the Newton step; A is symmetric if the law is associated.

use crate::contact::{Local, PADDED, Padded, Weights};
use crate::dim::{Moments, Vect};
use crate::solver::rows::{Operator, Row, TWIST};
use nalgebra::{SMatrix, SVector, Vector2};

/// The corrected reaction for the relative velocity `u`, without the shift, so that a reaction much
/// smaller than the cohesion keeps all its digits while its bond sticks.
#[inline]
pub(super) fn correct(row: &Row, u: &Padded) -> Padded {
    let mut q = row.form(u);
    let (w, cone, shift) = (row.metric(), &row.cone, row.shift);
    // most contacts stick, and then the rows are uncoupled
    let stuck = Local { n: -q.n / w.n, t: q.t * (-1.0 / w.t), m: q.m.scaled(-1.0 / w.m, -1.0 / w.w) };
    if cone.contains(&Local { n: stuck.n + shift, ..stuck }) {
        return stuck;
    }
    let mut r = if row.associated {
        q.n -= w.n * shift;
        cone.minimise(w, q)
    } else {
        let n = (stuck.n + shift).max(0.0);
        Local { n, t: stuck.t.clipped(cone.mu * n), m: stuck.m.within(cone.nu * n, cone.xi * n) }
    };
    r.n -= shift;
    r
}

/// A = −∂r/∂q at the velocity `u`, at which the corrector gave `r`; none if the contact is open.
pub(super) fn operator(row: &Row, u: &Padded, r: &Padded) -> Option<Operator> {
    let limit = r.n + row.shift;
    if limit <= 0.0 {
        return None;
    }
    let q = row.form(u);
    let (w, cone) = (row.metric(), &row.cone);
    // rows of a bond that bear nothing have no stiffness, even where q is zero
    let free = |c: f64, place: usize| (row.is_bond && c == 0.0 && row.rows.contains(&place)).then(none_at_all);
    let slip = free(cone.mu, 1).or_else(|| limit_direction(q.t, w.t, cone.mu * limit));
    let bend = free(cone.nu, 3).or_else(|| limit_direction(q.m.fixed_rows::<2>(0).into(), w.m, cone.nu * limit));
    let twists = free(cone.xi, TWIST).is_some() || q.m.twist() > w.w * cone.xi * limit;
    if slip.is_none() && bend.is_none() && !twists {
        return Some(Operator::Diagonal(Weights { n: 1.0 / w.n, t: 1.0 / w.t, m: 1.0 / w.m, w: 1.0 / w.w }));
    }
    let mut a = SMatrix::<f64, PADDED, PADDED>::zeros();
    // a row group below its limit has its own stiffness; at its limit it turns with q
    block(&mut a, 1, slip, 1.0 / w.t, cone.mu * limit);
    block(&mut a, 3, bend, 1.0 / w.m, cone.nu * limit);
    // the limits follow the normal reaction: r = n (1, −μ q̂_t, −ν q̂_m, −ξ q̂_τ) in the active
    // groups
    let mut drag = SVector::<f64, PADDED>::ith(0, 1.0);
    let mut stiffness = w.n;
    if let Some((direction, _)) = slip {
        drag.fixed_rows_mut::<2>(1).copy_from(&(direction * -cone.mu));
        stiffness += if row.associated { cone.mu * cone.mu * w.t } else { 0.0 };
    }
    if let Some((direction, _)) = bend {
        drag.fixed_rows_mut::<2>(3).copy_from(&(direction * -cone.nu));
        stiffness += if row.associated { cone.nu * cone.nu * w.m } else { 0.0 };
    }
    if twists {
        drag[TWIST] = -cone.xi.copysign(q.m[2]);
        stiffness += if row.associated { cone.xi * cone.xi * w.w } else { 0.0 };
    } else {
        a[(TWIST, TWIST)] = 1.0 / w.w;
    }
    if row.associated {
        a += drag * drag.transpose() / stiffness;
    } else {
        a += drag * SVector::<f64, PADDED>::ith(0, 1.0).transpose() / w.n;
    }
    Some(Operator::Full(Box::new(a)))
}

/// The direction and norm for a row group with a limit of zero: [`block`] adds nothing.
fn none_at_all() -> (Vector2<f64>, f64) {
    (Vector2::zeros(), 1.0)
}

/// Direction and norm of a row group's q if the group is at its limit.
fn limit_direction(q: Vector2<f64>, weight: f64, limit: f64) -> Option<(Vector2<f64>, f64)> {
    let norm = Vect::norm(&q);
    (norm > weight * limit).then(|| (q / norm, norm))
}

/// The part of A of a row group, for a fixed limit.
fn block(
    a: &mut SMatrix<f64, PADDED, PADDED>,
    at: usize,
    limited: Option<(Vector2<f64>, f64)>,
    stiffness: f64,
    limit: f64,
) {
    match limited {
        None => {
            a[(at, at)] += stiffness;
            a[(at + 1, at + 1)] += stiffness;
        }
        Some((d, norm)) => {
            let turn = limit / norm;
            for r in 0..2 {
                for c in 0..2 {
                    a[(at + r, at + c)] += turn * (f64::from(u8::from(r == c)) - d[r] * d[c]);
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "corrector_tests.rs"]
mod tests;
