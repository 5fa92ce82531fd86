//! The line of Mohr and Coulomb through principal stresses at failure.

use serde::Serialize;

use crate::extent::range;
use crate::strength::fit::{Estimate, around, line};

/// τ = c + σ tan φ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Envelope {
    /// Number of circles.
    pub circles: usize,
    /// Friction angle φ, degrees.
    pub friction_angle: Estimate,
    /// Cohesion c, Pa.
    pub cohesion: Estimate,
    /// Slope N of σ₁ over σ₃.
    pub slope: Estimate,
    /// Strength σ_c without confinement, Pa.
    pub unconfined_strength: Estimate,
    /// Share of the variance of σ₁ that the line explains.
    pub r_squared: Option<f64>,
}

/// Range of σ₃ over the greatest |σ₁| below which circles count as those of one confinement: the
/// slope would be that of their scatter.
const ONE_CONFINEMENT: f64 = 0.01;

/// Whether all circles with these principal stresses (σ₃, σ₁) have one confinement.
pub fn one_confinement(principal: &[(f64, f64)]) -> bool {
    let [low, high] = range(principal.iter().map(|p| p.0));
    let [_, most] = range(principal.iter().map(|p| p.1.abs()));
    high - low <= ONE_CONFINEMENT * most
}

/// The line that circles with these principal stresses (σ₃, σ₁) touch in the mean; `None` for those
/// of one confinement, and where σ₁ does not grow with σ₃.
pub fn envelope(principal: &[(f64, f64)]) -> Option<Envelope> {
    if one_confinement(principal) {
        return None;
    }
    let line = line(principal).filter(|line| line.slope.value > 0.0)?;
    let n = principal.len() as f64;
    let (slope, strength) = (line.slope.value, line.intercept.value);
    let root = slope.sqrt();
    let angle = (2.0 * root.atan()).to_degrees() - 90.0;
    let cohesion = strength / (2.0 * root);
    // derivatives by N and by σ_c
    let by = [(1.0 / ((1.0 + slope) * root)).to_degrees(), -strength / (4.0 * slope * root)];
    let mean = principal.iter().map(|p| p.0).sum::<f64>() / n;
    let with_error = |value: f64, by_slope: f64, by_strength: f64| {
        let error = line.slope.standard_error.zip(line.intercept.standard_error).map(|(s, i)| {
            let variance =
                (by_slope * s).powi(2) + (by_strength * i).powi(2) - 2.0 * by_slope * by_strength * mean * s * s;
            // round-off may leave less than zero
            variance.max(0.0).sqrt()
        });
        let interval = error.map(|error| around(value, error, principal.len() - 2));
        Estimate { value, standard_error: error, interval }
    };
    Some(Envelope {
        circles: principal.len(),
        friction_angle: with_error(angle, by[0], 0.0),
        cohesion: with_error(cohesion, by[1], 1.0 / (2.0 * root)),
        slope: line.slope,
        unconfined_strength: line.intercept,
        r_squared: line.r_squared,
    })
}

impl Envelope {
    /// Shear stress of the line at a normal stress, Pa.
    pub fn shear(&self, normal: f64) -> f64 {
        self.cohesion.value + normal * self.friction_angle.value.to_radians().tan()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Principal stresses (σ₃, σ₁) of the circle around (centre, 0) that touches τ = c + σ tan φ:
    /// its radius is the distance of the centre from the line.
    fn tangent(centre: f64, cohesion: f64, degrees: f64) -> (f64, f64) {
        let angle = degrees.to_radians();
        let radius = cohesion * angle.cos() + centre * angle.sin();
        (centre - radius, centre + radius)
    }

    #[test]
    fn circles_that_touch_a_line_give_it_back() {
        for (cohesion, degrees) in [(5e3, 30.0), (1.0, 0.0), (0.0, 17.0), (2e6, 55.0)] {
            let scale = f64::max(cohesion, 1.0);
            let circles: Vec<_> = [2.0, 3.0, 5.0, 9.0].map(|c| tangent(c * scale, cohesion, degrees)).to_vec();
            let found = envelope(&circles).unwrap();
            assert!((found.friction_angle.value - degrees).abs() < 1e-9, "{found:?}");
            assert!((found.cohesion.value - cohesion).abs() < 1e-9 * scale, "{found:?}");
            assert!(found.friction_angle.standard_error.unwrap() < 1e-5);
            assert!(found.cohesion.standard_error.unwrap() < 1e-6 * scale);
            // the line touches each circle: their distance is the radius
            let tan = degrees.to_radians().tan();
            for (minor, major) in circles {
                let distance = found.shear(0.5 * (major + minor)) / (1.0 + tan * tan).sqrt();
                assert!((distance - 0.5 * (major - minor)).abs() < 1e-8 * scale);
            }
        }
    }

    #[test]
    fn errors_are_those_of_a_resampled_fit() {
        // φ and c of many sets of circles whose σ₁ has a known scatter, against the error that the
        // line of each set gives
        let mut state = 7u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / 2f64.powi(53)
        };
        let (sets, mut values, mut errors) = (4000, [vec![], vec![]], [0.0; 2]);
        for _ in 0..sets {
            let circles: Vec<(f64, f64)> = (0..12)
                .map(|k| {
                    let minor = f64::from(k % 4);
                    // the sum of twelve uniform numbers has a variance of one
                    let scatter = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                    (minor, 3.0 * minor + 8.0 + 0.1 * scatter)
                })
                .collect();
            let found = envelope(&circles).unwrap();
            for (k, estimate) in [found.friction_angle, found.cohesion].into_iter().enumerate() {
                values[k].push(estimate.value);
                errors[k] += estimate.standard_error.unwrap().powi(2) / f64::from(sets);
            }
        }
        // N = 3: φ = 30°; c = 8/(2 √3)
        for (k, known) in [30.0, 4.0 / 3f64.sqrt()].into_iter().enumerate() {
            let n = values[k].len() as f64;
            let mean = values[k].iter().sum::<f64>() / n;
            let variance = values[k].iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
            assert!((mean - known).abs() < 4.0 * (variance / n).sqrt() + 1e-3 * known, "{mean} is not {known}");
            assert!((errors[k] / variance - 1.0).abs() < 0.1, "{} and {variance}", errors[k]);
        }
    }

    #[test]
    fn what_circles_do_not_tell_is_absent() {
        assert_eq!(envelope(&[]), None);
        assert_eq!(envelope(&[(1.0, 4.0), (1.0, 5.0)]), None);
        // σ₃ of unconfined samples is no confinement
        assert_eq!(envelope(&[(1e-9, 4.0), (-1e-9, 5.0), (3e-9, 4.5)]), None);
        // σ₁ falls with σ₃
        assert_eq!(envelope(&[(0.0, 5.0), (1.0, 4.0)]), None);
        let two = envelope(&[(0.0, 2.0), (1.0, 5.0)]).unwrap();
        assert!((two.friction_angle.value - 30.0).abs() < 1e-12);
        assert_eq!((two.friction_angle.standard_error, two.cohesion.interval), (None, None));
    }
}
