//! Young's modulus and Poisson's ratio of a sample with elastic bonds.
//!
//! Both are slopes of least-squares lines ([`crate::strength::fit`]) over the steps in which the
//! load is between 10 % and 50 % of that at the first break, or of the greatest load where no bond
//! breaks: the modulus that of the axial stress of the contacts over the axial strain of the
//! grains, the ratio that of the lateral strain over the axial one, with the opposite sign; in 3D
//! the lateral strain is the mean of both. They are those of the sample where the lateral stress
//! stays the same meanwhile, as without side walls or at constant confinement. In 2D they are those
//! of a plate in plane stress. The standard errors are those of the lines: they measure how far the
//! curves are from straight, not how much the ends of a sample hinder its lateral strain.

use serde::Serialize;

use crate::strength::fit::{Estimate, line};

/// Shares of the load between which the slopes are fitted.
pub(super) const RANGE: [f64; 2] = [0.1, 0.5];
/// Change of the lateral stress, over that of the axial one, from which the slopes are no constants
/// of the sample.
const LATERAL: f64 = 0.05;
/// Least number of steps.
const FEWEST: usize = 5;

/// The elastic constants of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Elastic {
    /// Young's modulus, Pa.
    pub young_modulus: Estimate,
    /// Poisson's ratio.
    pub poisson_ratio: Estimate,
    /// Number of steps in the range.
    pub steps: usize,
    /// The first and the last axial strain of the range.
    pub strains: [f64; 2],
    /// The axial stress that the line has there, Pa.
    pub stresses: [f64; 2],
}

/// Curves with one entry per step, positive along the load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curves<'a> {
    /// The load, N.
    pub load: &'a [f64],
    /// Bonds broken.
    pub broken: &'a [f64],
    /// Axial strain.
    pub strain: &'a [f64],
    /// Axial stress, Pa.
    pub stress: &'a [f64],
    /// Mean lateral strain.
    pub lateral_strain: &'a [f64],
    /// Mean lateral stress, Pa.
    pub lateral_stress: &'a [f64],
}

impl Elastic {
    /// The elastic constants, or why there are none.
    pub(super) fn of(curves: Curves) -> Result<Self, &'static str> {
        let Curves { load, broken, strain, stress, lateral_strain, lateral_stress } = curves;
        let steps = load.len();
        if [strain, stress, lateral_strain, lateral_stress].iter().any(|curve| curve.len() != steps) {
            return Err("stress or strain is not recorded");
        }
        let intact = broken.iter().position(|&n| n > 0.0).unwrap_or(steps);
        let limit = match load.get(intact) {
            Some(&load) => load,
            None => load.iter().copied().fold(0.0, f64::max),
        };
        let reaches = |share: f64| load[..intact].iter().position(|&load| load >= share * limit).unwrap_or(intact);
        let range = reaches(RANGE[0])..reaches(RANGE[1]);
        if range.len() < FEWEST {
            return Err("too few steps between 10 % and 50 % of the load at the first break");
        }
        let change = |curve: &[f64]| (curve[range.end - 1] - curve[range.start]).abs();
        if change(lateral_stress) > LATERAL * change(stress) {
            return Err("the lateral stress changes with the load");
        }
        let fitted = |y: &[f64]| {
            let points: Vec<(f64, f64)> = range.clone().map(|k| (strain[k], y[k])).collect();
            line(&points).ok_or("the axial strain does not change")
        };
        let (axial, lateral) = (fitted(stress)?, fitted(lateral_strain)?);
        let strains = [strain[range.start], strain[range.end - 1]];
        let Estimate { value, standard_error, interval } = lateral.slope;
        Ok(Self {
            young_modulus: axial.slope,
            poisson_ratio: Estimate {
                value: -value,
                standard_error,
                interval: interval.map(|[low, high]| [-high, -low]),
            },
            steps: range.len(),
            strains,
            stresses: strains.map(|strain| axial.slope.value * strain + axial.intercept.value),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sample of E = 2 GPa, ν = 0.25 under a load that grows by 1 N a step, breaks at step 40 and
    /// is soft at first; the lateral stress follows the axial one by a factor.
    fn read(lateral: f64, broken_at: usize) -> Result<Elastic, &'static str> {
        let load: Vec<f64> = (0..100).map(f64::from).collect();
        let broken: Vec<f64> = (0..100).map(|k| f64::from(u8::from(k >= broken_at))).collect();
        let stress: Vec<f64> = load.iter().map(|load| 1e5 * load).collect();
        let seat = |load: f64| if load < 3.0 { 1e-4 * load } else { 3e-4 };
        let strain: Vec<f64> = load.iter().map(|load| 1e5 * load / 2e9 + seat(*load)).collect();
        let lateral_strain: Vec<f64> = load.iter().map(|load| -0.25 * 1e5 * load / 2e9).collect();
        let lateral_stress: Vec<f64> = stress.iter().map(|stress| lateral * stress).collect();
        Elastic::of(Curves {
            load: &load,
            broken: &broken,
            strain: &strain,
            stress: &stress,
            lateral_strain: &lateral_strain,
            lateral_stress: &lateral_stress,
        })
    }

    #[test]
    fn slopes_are_those_of_the_material() {
        for broken_at in [40, 100] {
            let found = read(0.0, broken_at).unwrap();
            assert!((found.young_modulus.value / 2e9 - 1.0).abs() < 1e-12, "{found:?}");
            assert!((found.poisson_ratio.value - 0.25).abs() < 1e-12, "{found:?}");
            assert!(found.young_modulus.standard_error.unwrap() < 1e-3 && found.stresses[0] > 0.0);
        }
        // from 4 N to below 20 N; without a break from 9.9 N to below 49.5 N
        assert_eq!((read(0.0, 40).unwrap().steps, read(0.0, 100).unwrap().steps), (16, 40));
    }

    #[test]
    fn what_a_curve_does_not_tell_is_absent() {
        assert_eq!(read(0.3, 40), Err("the lateral stress changes with the load"));
        assert!(read(0.01, 40).is_ok());
        assert!(read(0.0, 4).is_err_and(|why| why.contains("too few steps")));
    }
}
