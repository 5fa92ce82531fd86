//! When to go on, to give up, and to try again.

use crate::saved::{Mismatch, Reader, Saved};

/// Most solves for which something that failed is not tried again.
const LONGEST_REST: u64 = 64;

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

    /// It failed: one failure is forgiven, after the next it rests for one solve, then for twice as many each time.
    pub fn lengthen(&mut self) {
        self.left = self.next;
        self.next = (2 * self.next).clamp(1, LONGEST_REST);
    }

    /// Whether it did not fail the last time.
    pub fn served(&self) -> bool {
        self.next == 0
    }

    /// It served.
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
        if rest.left.max(rest.next) <= LONGEST_REST { Ok(rest) } else { Err(Mismatch) }
    }
}

/// The changes of proximal rounds.
pub(super) struct Shrinking {
    last: f64,
}

impl Default for Shrinking {
    fn default() -> Self {
        Self { last: 1.0 }
    }
}

impl Shrinking {
    /// Enter the next change: the error that is left, for rounds that shorten it by c leave c/(1 − c) of the last change.
    pub fn error(&mut self, change: f64) -> f64 {
        let shrinkage = (change / self.last).min(0.5);
        self.last = change;
        change * shrinkage / (1.0 - shrinkage)
    }
}

/// Whether a quantity that should shrink no longer does.
pub(super) struct Stall {
    pub mark: f64,
    since: u64,
    patience: u64,
    share: f64,
}

impl Stall {
    /// To less than this share of what it was in so many values.
    pub fn after(patience: u64, share: f64) -> Self {
        Self { mark: f64::INFINITY, since: 0, patience, share }
    }

    /// Enter the next value: whether it has not shrunk for too long, or is no number.
    pub fn at(&mut self, value: f64) -> bool {
        self.since += 1;
        if value < self.share * self.mark {
            (self.mark, self.since) = (value, 0);
        }
        self.since >= self.patience || !value.is_finite()
    }
}
