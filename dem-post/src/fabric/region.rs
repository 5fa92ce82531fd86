//! Porosity of a part of the sample: what grains leave of a disk or a sphere.

use std::f64::consts::PI;

use crate::extent::volume;

/// Diameter of the region over the least extent of the sample: walls may move by a tenth of it on
/// each side before they enter the region.
const SHARE: f64 = 0.8;

/// A disk (2D) or a sphere (3D), fixed in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its centre, m.
    pub centre: Vec<f64>,
    /// Its radius, m.
    pub radius: f64,
}

impl Region {
    /// The region in the middle of a box with these ends along each axis (m).
    pub fn inside(ends: &[[f64; 2]]) -> Self {
        let least = ends.iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min);
        Self { centre: ends.iter().map(|[low, high]| 0.5 * (low + high)).collect(), radius: 0.5 * SHARE * least }
    }

    /// Share of the region that no grain fills; grains have centres `position` (m, D numbers each)
    /// and do not overlap.
    pub fn porosity(&self, position: &[f64], radius: &[f64]) -> f64 {
        let d = self.centre.len();
        let common = |(x, r): (&[f64], &f64)| {
            let distance = x.iter().zip(&self.centre).map(|(x, c)| (x - c).powi(2)).sum::<f64>().sqrt();
            common(d, distance, self.radius, *r)
        };
        let filled: f64 = position.chunks(d).zip(radius).map(common).sum();
        1.0 - filled / volume(d, self.radius)
    }
}

/// Area (2D) or volume (3D) common to two disks or spheres of radii `a` and `b`.
fn common(dimension: usize, distance: f64, a: f64, b: f64) -> f64 {
    if distance >= a + b {
        return 0.0;
    }
    let small = a.min(b);
    if distance <= (a - b).abs() {
        return volume(dimension, small);
    }
    // distance of the common chord, or plane, from each centre
    let of_a = (distance * distance + a * a - b * b) / (2.0 * distance);
    cap(dimension, a, of_a) + cap(dimension, b, distance - of_a)
}

/// The part of a disk or sphere beyond a chord or plane at `distance` from its centre, which may be
/// negative.
fn cap(dimension: usize, radius: f64, distance: f64) -> f64 {
    if dimension == 2 {
        let cosine = (distance / radius).clamp(-1.0, 1.0);
        radius * radius * (cosine.acos() - cosine * (1.0 - cosine * cosine).sqrt())
    } else {
        let height = radius - distance;
        PI * height * height * (radius - height / 3.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by the midpoint rule over slices across the line of the centres.
    fn by_slices(dimension: usize, distance: f64, a: f64, b: f64) -> f64 {
        let (slices, from, to) = (1_000_000, -a, a);
        let step = (to - from) / f64::from(slices);
        let slice = |k: i32| {
            let x = from + (f64::from(k) + 0.5) * step;
            let half = |r: f64, x: f64| (r * r - x * x).max(0.0).sqrt();
            let half = half(a, x).min(half(b, x - distance));
            if dimension == 2 { 2.0 * half } else { PI * half * half }
        };
        (0..slices).map(slice).sum::<f64>() * step
    }

    #[test]
    fn common_parts_are_those_of_the_integral() {
        for dimension in [2, 3] {
            for (distance, a, b) in
                [(1.5, 1.0, 1.0), (1.2, 2.0, 1.0), (1.9, 2.0, 0.5), (0.3, 2.0, 1.0), (4.0, 2.0, 1.0)]
            {
                let (found, known) = (common(dimension, distance, a, b), by_slices(dimension, distance, a, b));
                assert!((found - known).abs() < 1e-6, "{dimension}D, {distance}: {found} is not {known}");
                assert!((found - common(dimension, distance, b, a)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_square_lattice_has_its_porosity() {
        // grains of radius 1 on a grid; with the region the error of its edge shrinks
        let position: Vec<f64> =
            (0..10_000).flat_map(|k| [2.0 * f64::from(k % 100), 2.0 * f64::from(k / 100)]).collect();
        let region = Region::inside(&[[-1.0, 199.0], [-1.0, 199.0]]);
        assert_eq!((region.centre.as_slice(), region.radius), (&[99.0, 99.0][..], 80.0));
        let porosity = region.porosity(&position, &[1.0; 10_000]);
        assert!((porosity - (1.0 - 0.25 * PI)).abs() < 1e-3, "{porosity}");
        // one sphere in the middle: 1 − (r/R)³
        let alone = Region::inside(&[[-5.0, 5.0]; 3]).porosity(&[0.0; 3], &[1.0]);
        assert!((alone - (1.0 - 4f64.powi(-3))).abs() < 1e-15);
    }
}
