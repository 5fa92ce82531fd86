//! A Cholesky factor that is kept over solves as a preconditioner, and when it must be made anew.

use super::factor::Factor;
use crate::saved::{Mismatch, Reader, Saved};

/// A factor, and how it served.
#[derive(Default)]
pub(super) struct Kept {
    pub factor: Factor,
    /// Whether it must be made anew.
    pub renew: bool,
    /// Whether the factor alone gave the last direction well enough.
    pub trusted: bool,
    /// Linear solves before it can be trusted again.
    pub distrust: usize,
    /// GMRES iterations when it was fresh, and those beyond it since.
    pub floor: usize,
    pub wasted: usize,
}

impl Kept {
    /// Whether it can be tried for this many unknowns.
    pub fn serves(&self, unknowns: usize) -> bool {
        !self.renew && self.factor.serves(unknowns)
    }

    /// Write it and how it served.
    pub fn save(&self, to: &mut Saved) {
        to.flag(self.renew);
        to.flag(self.trusted);
        for count in [self.distrust, self.floor, self.wasted] {
            to.count(count);
        }
        self.factor.save(to);
    }

    /// What [`Kept::save`] wrote.
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let (renew, trusted) = (from.flag()?, from.flag()?);
        let (distrust, floor, wasted) = (from.count()?, from.count()?, from.count()?);
        Ok(Self { factor: Factor::restored(from)?, renew, trusted, distrust, floor, wasted })
    }
}
