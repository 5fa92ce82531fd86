//! Back-off: a method that failed is not tried again for some solves.

use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::extrapolation as tuning;

/// State of a back-off. Similar steps fail alike.
#[derive(Clone, Copy, Default)]
pub(super) struct Backoff {
    left: u64,
    next: u64,
}

/// The longest back-off (solves): twice the steps between two solves.
const LONGEST: u64 = 2 * tuning::MOST;

impl Backoff {
    /// Whether the method may be tried again.
    pub fn is_over(&self) -> bool {
        self.left == 0
    }

    /// Count a solve without the method.
    pub fn count_down(&mut self) {
        self.left = self.left.saturating_sub(1);
    }

    /// Record a failure. The first has no effect, the second pauses for one solve, each further one
    /// for twice as many.
    pub fn lengthen(&mut self) {
        self.left = self.next;
        self.next = (2 * self.next).clamp(1, LONGEST);
    }

    /// Record a success.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Write the state.
    pub fn save(&self, to: &mut Saved) {
        to.count(self.left as usize);
        to.count(self.next as usize);
    }

    /// Read the state that [`Backoff::save`] wrote.
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let backoff = Self { left: from.count()? as u64, next: from.count()? as u64 };
        if backoff.left.max(backoff.next) <= LONGEST { Ok(backoff) } else { Err(Mismatch) }
    }
}
