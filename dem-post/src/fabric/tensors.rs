//! Fabric and crack density: tensors of directions.
//!
//! **Fabric** (Satake 1982, Oda 1982): F = (1/Nc) Σ n ⊗ n over the Nc contacts between grains, with
//! their normals n; its trace is 1. Normals without a preferred direction have F = 1/D. To second
//! order the density of normals is 1 + a·n·n over that of the isotropic one, with a = 4 (F − ½) in
//! 2D and a = 15/2 (F − ⅓) in 3D (Kanatani 1984); the **anisotropy** is the scalar √(½ a:a) in 2D,
//! where the density is 1 + a cos 2(θ − θ₁) (Rothenburg & Bathurst 1989), and √(3/2 a:a) in 3D (Guo
//! & Zhao 2013).
//!
//! **Crack density**: C = (1/V) Σ A n ⊗ n over the broken bonds, with the section A of each (m²),
//! its normal n, from grain to grain as they were bonded, and the volume V of the sample (1/m). It
//! is Oda's crack tensor (1984) without its factor of length. Its trace is the area of these
//! sections in a unit of volume, not that of the surfaces of cracks between the grains.

use crate::tensor::principal;

/// Sum of weighted dyads n ⊗ n, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Dyads {
    dimension: usize,
    /// The sum, D × D.
    sum: Vec<f64>,
}

impl Dyads {
    /// No dyads in `dimension` dimensions.
    pub fn new(dimension: usize) -> Self {
        Self { dimension, sum: vec![0.0; dimension * dimension] }
    }

    /// Adds n ⊗ n with a weight.
    pub fn add(&mut self, weight: f64, normal: &[f64]) {
        let d = self.dimension;
        for (k, sum) in self.sum.iter_mut().enumerate() {
            *sum += weight * normal[k / d] * normal[k % d];
        }
    }

    /// The sum over `total`.
    pub fn over(&self, total: f64) -> Vec<f64> {
        self.sum.iter().map(|sum| sum / total).collect()
    }
}

/// The anisotropy of a fabric tensor.
pub fn anisotropy(fabric: &[f64], dimension: usize) -> f64 {
    let mean = 1.0 / dimension as f64;
    let squares: f64 = principal(fabric, dimension).iter().map(|value| (value - mean).powi(2)).sum();
    if dimension == 2 { 4.0 * (0.5 * squares).sqrt() } else { 7.5 * (1.5 * squares).sqrt() }
}

/// Direction of the greatest principal value of a 2D tensor, degrees from x, 0 to 180.
pub fn direction(tensor: &[f64]) -> f64 {
    (0.5 * (tensor[1] + tensor[2]).atan2(tensor[0] - tensor[3])).to_degrees().rem_euclid(180.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn fabric(normals: &[&[f64]]) -> Vec<f64> {
        let d = normals[0].len();
        let mut dyads = Dyads::new(d);
        normals.iter().for_each(|normal| dyads.add(1.0, normal));
        dyads.over(normals.len() as f64)
    }

    #[test]
    fn lattices_have_no_preferred_direction_of_second_order() {
        let square = fabric(&[&[1.0, 0.0], &[0.0, 1.0]]);
        assert_eq!((square.as_slice(), anisotropy(&square, 2)), (&[0.5, 0.0, 0.0, 0.5][..], 0.0));
        let (c, s) = ((PI / 3.0).cos(), (PI / 3.0).sin());
        let hexagonal = fabric(&[&[1.0, 0.0], &[c, s], &[-c, s]]);
        assert!(anisotropy(&hexagonal, 2) < 1e-15);
        let cubic = fabric(&[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]]);
        assert!(anisotropy(&cubic, 3) < 1e-15);
    }

    #[test]
    fn the_anisotropy_is_the_amplitude_of_the_density() {
        // a column: all normals along y, a = 4 (1 − ½)
        let column = fabric(&[&[0.0, 1.0]]);
        assert_eq!((anisotropy(&column, 2), direction(&column)), (2.0, 90.0));
        // weights 1 + a cos 2(θ − θ₁) at many angles
        let (a, major) = (0.3, 0.6);
        let (mut dyads, mut total) = (Dyads::new(2), 0.0);
        for k in 0..360 {
            let angle = PI * f64::from(k) / 360.0;
            let weight = 1.0 + a * (2.0 * (angle - major)).cos();
            dyads.add(weight, &[angle.cos(), angle.sin()]);
            total += weight;
        }
        let fabric = dyads.over(total);
        assert!((anisotropy(&fabric, 2) - a).abs() < 1e-12);
        assert!((direction(&fabric) - f64::to_degrees(major)).abs() < 1e-9);
        // in 3D the density 1 + a₁ (3 z² − 1)/2 has a = diag(−a₁/2, −a₁/2, a₁) and the scalar 3/2
        // a₁
        let (mut dyads, mut total) = (Dyads::new(3), 0.0);
        let rings = 20_000;
        for k in 0..rings {
            let z = (f64::from(k) + 0.5) / f64::from(rings) * 2.0 - 1.0;
            let weight = 1.0 + 0.4 * 0.5 * (3.0 * z * z - 1.0);
            let across = (1.0 - z * z).sqrt();
            for turn in 0..4 {
                let angle = f64::from(turn) * 0.5 * PI + 0.3;
                dyads.add(weight, &[across * angle.cos(), across * angle.sin(), z]);
                total += weight;
            }
        }
        let found = anisotropy(&dyads.over(total), 3);
        assert!((found - 0.6).abs() < 1e-7, "{found}");
    }
}
