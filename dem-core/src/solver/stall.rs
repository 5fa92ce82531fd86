//! When to go on, and when to give up.

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
