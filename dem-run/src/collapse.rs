//! The collapse load, and the load at which a share of the bonds has broken.

use dem_core::saved::{Mismatch, Reader, Saved};
use serde::Serialize;

/// Axial strains (–) at which the collapse load is told.
pub const STRAINS: [f64; 2] = [1e-4, 1e-3];
/// Share of broken bonds (–) at which the load is told.
pub const BROKEN_SHARE: f64 = 0.05;

/// Loads (N) that mark the failure of a sample; none where it did not come to that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Failure {
    /// Applied force at the step of the first break.
    pub first_break: Option<f64>,
    /// Applied force at the last step before the axial strain exceeded each of [`STRAINS`].
    pub collapse: [Option<f64>; 2],
    /// Whether no bond had broken by then: the strain is the solver's, not the sample's.
    pub early: [bool; 2],
    /// Applied force at the step by whose end [`BROKEN_SHARE`] of the bonds had broken.
    pub broken_share: Option<f64>,
}

/// Follows a run step by step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Collapse {
    /// What was found so far.
    pub failure: Failure,
    last_load: f64,
}

impl Collapse {
    /// Enter one step: the applied force (N), the axial strain (–, either sign) and the bonds broken so far, of how many.
    pub fn push(&mut self, load: f64, strain: f64, broken: usize, bonds: usize) {
        let failure = &mut self.failure;
        if broken > 0 {
            failure.first_break.get_or_insert(load);
        }
        if bonds > 0 && broken as f64 >= BROKEN_SHARE * bonds as f64 {
            failure.broken_share.get_or_insert(load);
        }
        for (k, limit) in STRAINS.into_iter().enumerate() {
            if strain.abs() > limit && failure.collapse[k].is_none() {
                failure.collapse[k] = Some(self.last_load);
                failure.early[k] = broken == 0;
            }
        }
        self.last_load = load;
    }

    /// Write what was found so far.
    pub fn save(&self, to: &mut Saved) {
        let Failure { first_break, collapse: [a, b], early, broken_share } = self.failure;
        for load in [first_break, a, b, broken_share] {
            to.flag(load.is_some());
            to.real(load.unwrap_or(0.0));
        }
        early.into_iter().for_each(|early| to.flag(early));
        to.real(self.last_load);
    }

    /// What [`Collapse::save`] wrote.
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
        Ok(Self { failure, last_load: from.real()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_collapse_load_is_that_of_the_step_before_the_strain_passes_its_limit() {
        let mut collapse = Collapse::default();
        let strains = [0.0, 5e-5, -2e-4, -5e-4, -2e-3, 0.0];
        let broken = [0, 1, 2, 5, 9, 9];
        for k in 0..6 {
            collapse.push(10.0 * k as f64, strains[k], broken[k], 100);
        }
        let expected = Failure {
            first_break: Some(10.0),
            collapse: [Some(10.0), Some(30.0)],
            early: [false, false],
            broken_share: Some(30.0),
        };
        assert_eq!(collapse.failure, expected);
        let mut saved = Saved::default();
        collapse.save(&mut saved);
        assert_eq!(Collapse::restored(&mut saved.read()), Ok(collapse));
    }
}
