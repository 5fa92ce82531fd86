//! When something that failed is tried again.

use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::extrapolation as tuning;

/// Solves for which something that failed is not tried: steps that are alike fail alike.
#[derive(Clone, Copy, Default)]
pub(super) struct Rest {
    left: u64,
    next: u64,
}

impl Rest {
    /// Whether it is time to try again; else one solve of it passes.
    pub fn is_over(&mut self) -> bool {
        let over = self.left == 0;
        self.left = self.left.saturating_sub(1);
        over
    }

    /// It failed: one failure is forgiven, after the next it rests for one solve, then for twice as
    /// many each time.
    pub fn lengthen(&mut self) {
        self.left = self.next;
        self.next = (2 * self.next).clamp(1, tuning::LONGEST_REST);
    }

    /// It succeeded.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Write it.
    pub fn save(&self, to: &mut Saved) {
        to.count(self.left as usize);
        to.count(self.next as usize);
    }

    /// What [`Rest::save`] wrote.
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let rest = Self { left: from.count()? as u64, next: from.count()? as u64 };
        if rest.left.max(rest.next) <= tuning::LONGEST_REST { Ok(rest) } else { Err(Mismatch) }
    }
}
