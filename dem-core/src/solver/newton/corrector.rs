//! The corrector of one contact in the metric 1/ρ, and its derivative.
//!
//! From a multiplier r̂ and a relative velocity u the corrector is r(q) with q = u − r̂/ρ: for an associated law the
//! minimiser of ½ Σ r²/ρ + q·r over the cone, for Coulomb's law Signorini's r_n = (−ρ_n q_n)⁺ and the tangential part
//! clipped to μ r_n (Alart & Curnier 1991). Its negative derivative A = −∂r/∂q is what a contact adds to the matrix of
//! the Newton step; it is symmetric where the law is associated.

use super::rows::{Operator, Padded, Row, from_order, in_order};
use crate::contact::Local;
use crate::dim::Vect;
use nalgebra::{SVector, Vector2};

/// The corrected reaction r̂ for the relative velocity `u`.
pub(super) fn correct(row: &Row, u: &Padded) -> Padded {
    let q = pulled(row, u);
    let (w, cone) = (&row.weights, &row.cone);
    if row.associated {
        return cone.minimise(*w, q);
    }
    let n = (-q.n / w.n).max(0.0);
    Local { n, t: (q.t * (-1.0 / w.t)).clipped(cone.mu * n), m: (q.m * (-1.0 / w.m)).clipped(cone.nu * n) }
}

/// q = u − r̂/ρ.
fn pulled(row: &Row, u: &Padded) -> Padded {
    let (w, r) = (&row.weights, &row.multiplier);
    Local { n: u.n - r.n * w.n, t: u.t - r.t * w.t, m: u.m - r.m * w.m }
}

/// A = −∂r/∂q at the velocity `u`, where the corrector gave `r`; nothing where the contact is open.
///
/// `symmetric` leaves out how the threshold of Coulomb's law follows r_n.
pub(super) fn operator(row: &Row, u: &Padded, r: &Padded, symmetric: bool) -> Option<Operator> {
    if r.n <= 0.0 {
        return None;
    }
    let q = pulled(row, u);
    let (w, cone) = (&row.weights, &row.cone);
    let slip = limit_direction(q.t, w.t, cone.mu * r.n);
    let bend = limit_direction(q.m, w.m, cone.nu * r.n);
    let mut a = Operator::zeros();
    // a row group inside its ball follows its own stiffness; on the sphere it turns with q
    block(&mut a, 1, slip, 1.0 / w.t, cone.mu * r.n);
    block(&mut a, 3, bend, 1.0 / w.m, cone.nu * r.n);
    // the normal row drags the limits along: r = n (1, −μ q̂_t, −ν q̂_m) on the active ones
    let mut drag = Padded { n: 1.0, t: Vector2::zeros(), m: Vector2::zeros() };
    let mut stiffness = w.n;
    if let Some((direction, _)) = slip {
        drag.t = direction * -cone.mu;
        stiffness += if row.associated { cone.mu * cone.mu * w.t } else { 0.0 };
    }
    if let Some((direction, _)) = bend {
        drag.m = direction * -cone.nu;
        stiffness += if row.associated { cone.nu * cone.nu * w.m } else { 0.0 };
    }
    let drag = in_order(&drag);
    if row.associated {
        a += drag * drag.transpose() / stiffness;
    } else if symmetric {
        a[(0, 0)] += 1.0 / w.n;
    } else {
        a += drag * SVector::<f64, 5>::ith(0, 1.0).transpose() / w.n;
    }
    Some(a)
}

/// Direction and norm of a row group's q where the group is at its limit.
fn limit_direction(q: Vector2<f64>, weight: f64, limit: f64) -> Option<(Vector2<f64>, f64)> {
    let norm = Vect::norm(&q);
    (norm > weight * limit).then(|| (q / norm, norm))
}

/// The part of A that a row group has for a fixed limit.
fn block(a: &mut Operator, at: usize, limited: Option<(Vector2<f64>, f64)>, stiffness: f64, limit: f64) {
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

/// A du for one contact.
pub(super) fn act(a: &Operator, du: &Padded) -> Padded {
    from_order(&(a * in_order(du)))
}
