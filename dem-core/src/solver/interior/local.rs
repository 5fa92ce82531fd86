//! The equations of one contact in an interior-point step, and their inverse.
//!
//! For a step (dr, dz), with t the velocity that the bodies add to the contact:
//!
//! C dr − Bᵀ dz = a − t,     Arw(z) G dr + Arw(x) dz = b.
//!
//! The upper left corner of the inverse of this small matrix is D⁻¹ of
//! docs/theory/interior-point.md. D itself contains Arw(x)⁻¹ Arw(z), and would lose the digits of
//! sticking rows, which are small beside slipping ones.

use super::cones::{Point, Scaling, eigenvalues, product};
use super::sites::{CONES, ROWS, SecondOrderCone, Sites};
use super::state::State;

/// Largest order of a local matrix.
pub(super) const ORDER: usize = ROWS + CONES;

/// The factor on the complementarity equations of a cone.
#[inline]
fn scale(x: &Point, z: &Point) -> f64 {
    1.0 / (x[0] + z[0])
}

/// A pair in the scaling in which it is linearised.
pub(super) struct Scaled {
    pub scaling: Scaling,
    pub x: Point,
    pub z: Point,
}

/// The pairs of a point, unscaled, or in the scaling of Nesterov & Todd if x ∘ z is outside the
/// cone. In that scaling the direction is defined for every interior pair.
pub(super) fn scaled(at: &State) -> Vec<Scaled> {
    let one = |(x, z): (&Point, &Point)| {
        let scaling = if eigenvalues(&product(x, z))[1] > 0.0 { Scaling::NONE } else { Scaling::of(x, z) };
        Scaled { scaling, x: scaling.x(x), z: scaling.z(z) }
    };
    at.x.iter().zip(&at.z).map(one).collect()
}

/// Compute the inverses of all local matrices at a point, with the compliance of each row. Returns
/// the sign of the product of their determinants; none if one is singular.
pub(super) fn invert(sites: &Sites, pairs: &[Scaled], compliance: &[f64], inverses: &mut Vec<f64>) -> Option<f64> {
    let mut sign = 1.0;
    inverses.clear();
    inverses.resize(sites.matrices, 0.0);
    for site in &sites.list {
        let order = site.order();
        let a = &mut inverses[site.matrix..][..order * order];
        for (k, c) in site.part(compliance).iter().enumerate() {
            a[k * order + k] = *c;
        }
        let mut first = site.rows;
        for c in site.cones.clone() {
            let SecondOrderCone { slope, rows, tangents, acts_on_normal } = &sites.cones[c];
            let Scaled { scaling, x, z } = &pairs[c];
            let scale = scale(x, z);
            if *acts_on_normal {
                a[first] = -slope;
            }
            for k in 0..=*tangents {
                let mut unit = [0.0; 3];
                unit[k] = 1.0;
                // the columns of Arw(z) G and of Arw(x)
                let (dx, dz) = (product(z, &scaling.x(&unit)), product(x, &scaling.z(&unit)));
                let (column, factor) = if k == 0 { (0, *slope) } else { (rows[k - 1], 1.0) };
                for row in 0..=*tangents {
                    a[(first + row) * order + column] = scale * factor * dx[row];
                    a[(first + row) * order + first + k] = scale * dz[row];
                }
                if k > 0 {
                    a[column * order + first + k] = -1.0;
                }
            }
            first += 1 + tangents;
        }
        sign *= gauss_jordan(a, order)?;
    }
    Some(sign)
}

/// Replace a matrix, stored row by row, by its inverse, with partial pivoting. Returns the sign of
/// the determinant; none if it is zero.
fn gauss_jordan(a: &mut [f64], order: usize) -> Option<f64> {
    let mut sign = 1.0;
    let mut pivots = [0; ORDER];
    for k in 0..order {
        let mut pivot = k;
        for row in k + 1..order {
            pivot = if a[row * order + k].abs() > a[pivot * order + k].abs() { row } else { pivot };
        }
        pivots[k] = pivot;
        if pivot != k {
            let (above, below) = a.split_at_mut(pivot * order);
            above[k * order..][..order].swap_with_slice(&mut below[..order]);
        }
        let inverse = 1.0 / a[k * order + k];
        if !inverse.is_finite() {
            return None;
        }
        sign *= if pivot == k { inverse.signum() } else { -inverse.signum() };
        // column k becomes that of the inverse
        a[k * order + k] = 1.0;
        let mut line = [0.0; ORDER];
        for (x, l) in a[k * order..][..order].iter_mut().zip(&mut line) {
            *x *= inverse;
            *l = *x;
        }
        for (row, x) in a.chunks_exact_mut(order).enumerate() {
            if row != k {
                let factor = std::mem::take(&mut x[k]);
                if factor != 0.0 {
                    x.iter_mut().zip(&line).for_each(|(x, l)| *x -= factor * l);
                }
            }
        }
    }
    // the columns follow the rows that were swapped
    for (k, pivot) in pivots[..order].iter().enumerate().rev().filter(|(k, pivot)| k != *pivot) {
        a.chunks_exact_mut(order).for_each(|row| row.swap(k, *pivot));
    }
    Some(sign)
}

/// The step (`r` and `z` alone) for these right sides, with t = 0.
pub(super) fn solve(sites: &Sites, pairs: &[Scaled], inverses: &[f64], a: &[f64], b: &[Point]) -> State {
    let mut step = State { r: vec![0.0; sites.rows], x: Vec::new(), z: vec![[0.0; 3]; sites.cones.len()] };
    for site in &sites.list {
        let order = site.order();
        let mut right = [0.0; ORDER];
        right[..site.rows].copy_from_slice(site.part(a));
        let mut first = site.rows;
        for c in site.cones.clone() {
            let scale = scale(&pairs[c].x, &pairs[c].z);
            let tangents = sites.cones[c].tangents;
            for k in 0..1 + tangents {
                right[first + k] = scale * b[c][k];
            }
            first += 1 + tangents;
        }
        let line = |row: usize| &inverses[site.matrix + row * order..][..order];
        let sum = |row: usize| line(row).iter().zip(&right).map(|(a, x)| a * x).sum::<f64>();
        site.part_mut(&mut step.r).iter_mut().enumerate().for_each(|(k, r)| *r = sum(k));
        let mut row = site.rows;
        for c in site.cones.clone() {
            for k in 0..1 + sites.cones[c].tangents {
                step.z[c][k] = sum(row);
                row += 1;
            }
        }
    }
    step
}

/// Subtract from a step the effect of the bodies' velocities `t`.
pub(super) fn yield_to(sites: &Sites, inverses: &[f64], t: &[f64], step: &mut State) {
    for site in &sites.list {
        let order = site.order();
        let own = site.part(t);
        let sum = |row: usize| inverses[site.matrix + row * order..].iter().zip(own).map(|(a, t)| a * t).sum::<f64>();
        site.part_mut(&mut step.r).iter_mut().enumerate().for_each(|(k, r)| *r -= sum(k));
        let mut row = site.rows;
        for c in site.cones.clone() {
            for k in 0..1 + sites.cones[c].tangents {
                step.z[c][k] -= sum(row);
                row += 1;
            }
        }
    }
}
