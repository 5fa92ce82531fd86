//! Failure loads and peak load of a sample, updated at every step.

use crate::scene::failure::{BROKEN_SHARE, PEAK_DROP, STRAINS};
use dem_core::saved::{Mismatch, Reader, Saved};
use serde::Serialize;

/// Failure loads of a sample (N); none if the sample did not reach that state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Failure {
    /// Load at the step of the first break.
    pub first_break: Option<f64>,
    /// Load of the last step before the axial strain exceeded each of [`STRAINS`]; none if no load
    /// acted in that step.
    pub collapse: [Option<f64>; 2],
    /// Whether the strain exceeded each of [`STRAINS`] before any bond broke.
    pub early: [bool; 2],
    /// Load of the first step after which at least [`BROKEN_SHARE`] of the bonds are broken.
    pub broken_share: Option<f64>,
}

/// The load of greatest magnitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// The load (N); zero if no load ever acted.
    pub load: f64,
    /// Displacement of the wall along its direction at the end of the step of this load (m).
    pub displacement: f64,
}

/// A wall and its sample after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadStep {
    /// The load of the step (N).
    pub load: f64,
    /// Displacement of the wall along its direction since the start (m).
    pub displacement: f64,
    /// Strain of the sample along that direction (–), of either sign.
    pub strain: f64,
    /// Bonds broken so far.
    pub broken: usize,
    /// Bonds at the start.
    pub bonds: usize,
}

/// Follows the load of one wall step by step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Collapse {
    /// Failure loads found so far.
    pub failure: Failure,
    /// Whether the strain has exceeded each of [`STRAINS`].
    pub passed: [bool; 2],
    /// The peak load so far.
    pub peak: Peak,
    /// Whether the peak load is that of the last step.
    pub rising: bool,
    /// Whether the load has fallen by [`PEAK_DROP`] since the peak load: then that is a strength.
    pub fallen: bool,
    last_load: f64,
}

impl Collapse {
    /// Updates the loads with a step.
    pub fn push(&mut self, step: LoadStep) {
        let LoadStep { load, displacement, strain, broken, bonds } = step;
        let failure = &mut self.failure;
        if broken > 0 {
            failure.first_break.get_or_insert(load);
        }
        if bonds > 0 && broken as f64 >= BROKEN_SHARE * bonds as f64 {
            failure.broken_share.get_or_insert(load);
        }
        for (k, limit) in STRAINS.into_iter().enumerate() {
            if strain.abs() > limit && !self.passed[k] {
                self.passed[k] = true;
                failure.collapse[k] = Some(self.last_load).filter(|load| *load != 0.0);
                failure.early[k] = broken == 0;
            }
        }
        self.rising = load.abs() > self.peak.load.abs();
        if self.rising {
            self.peak = Peak { load, displacement };
        }
        // at the peak itself the load has not fallen
        self.fallen = !self.rising && (self.fallen || load.abs() < (1.0 - PEAK_DROP) * self.peak.load.abs());
        self.last_load = load;
    }

    /// Saves the state.
    pub fn save(&self, to: &mut Saved) {
        let Failure { first_break, collapse: [a, b], early, broken_share } = self.failure;
        for load in [first_break, a, b, broken_share] {
            to.flag(load.is_some());
            to.real(load.unwrap_or(0.0));
        }
        early.into_iter().chain(self.passed).chain([self.rising, self.fallen]).for_each(|flag| to.flag(flag));
        to.reals.extend([self.peak.load, self.peak.displacement, self.last_load]);
    }

    /// Restores the state saved by [`Collapse::save`].
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut load = || -> Result<Option<f64>, Mismatch> {
            let (known, load) = (from.flag()?, from.real()?);
            Ok(known.then_some(load))
        };
        let (first_break, a, b, broken_share) = (load()?, load()?, load()?, load()?);
        let early = [from.flag()?, from.flag()?];
        let failure = Failure { first_break, collapse: [a, b], early, broken_share };
        let (passed, rising, fallen) = ([from.flag()?, from.flag()?], from.flag()?, from.flag()?);
        let peak = Peak { load: from.real()?, displacement: from.real()? };
        Ok(Self { failure, passed, peak, rising, fallen, last_load: from.real()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn follow(loads: &[f64], strains: &[f64], broken: &[usize]) -> Collapse {
        let mut collapse = Collapse::default();
        for (k, load) in loads.iter().enumerate() {
            let displacement = 1e-3 * k as f64;
            collapse.push(LoadStep { load: *load, displacement, strain: strains[k], broken: broken[k], bonds: 100 });
        }
        collapse
    }

    #[test]
    fn the_collapse_load_is_that_of_the_step_before_the_strain_passes_its_limit() {
        let strains = [0.0, 5e-5, -2e-4, -5e-4, -2e-3, 0.0];
        let collapse = follow(&[0.0, 10.0, 20.0, 30.0, 40.0, 35.0], &strains, &[0, 1, 2, 5, 9, 9]);
        let expected = Failure {
            first_break: Some(10.0),
            collapse: [Some(10.0), Some(30.0)],
            early: [false, false],
            broken_share: Some(30.0),
        };
        assert_eq!(collapse.failure, expected);
        assert_eq!((collapse.peak, collapse.rising), (Peak { load: 40.0, displacement: 4e-3 }, false));
        let mut saved = Saved::default();
        collapse.save(&mut saved);
        assert_eq!(Collapse::restored(&mut saved.read()), Ok(collapse));
    }

    #[test]
    fn a_strain_that_passes_before_any_load_acts_has_no_collapse_load() {
        let collapse = follow(&[30.0, 20.0], &[2e-4, 2e-3], &[5, 6]);
        assert_eq!((collapse.failure.collapse, collapse.passed), ([None, Some(30.0)], [true, true]));
        assert_eq!(follow(&[-0.0, -0.0], &[0.0, 2e-3], &[0, 0]).failure.collapse, [None, None]);
    }

    #[test]
    fn the_peak_is_the_load_of_greatest_magnitude() {
        let collapse = follow(&[0.0, -3.0, 2.0], &[0.0; 3], &[0; 3]);
        assert_eq!((collapse.peak, collapse.rising), (Peak { load: -3.0, displacement: 1e-3 }, false));
        assert!(follow(&[0.0, 1.0], &[0.0; 2], &[0; 2]).rising);
    }

    #[test]
    fn a_peak_from_which_the_load_has_not_fallen_is_no_strength() {
        for (loads, fallen) in [
            (&[1.0, 2.0][..], false),
            (&[1.0, 2.0, 1.91], false),
            (&[1.0, -2.0, -1.89], true),
            (&[2.0, 1.0, 1.99], true),
            (&[2.0, 1.0, 2.01], false),
        ] {
            assert_eq!(follow(loads, &[0.0; 3], &[0; 3]).fallen, fallen, "{loads:?}");
        }
    }
}
