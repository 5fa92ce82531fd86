//! Frequency and magnitude of events: the b-value, its error, and the magnitude from which it
//! holds.
//!
//! The law of Gutenberg and Richter, N(≥ M) ∝ 10^(−b M), from the completeness magnitude Mc on.
//! Both magnitudes here are discrete, and b is the estimate of greatest likelihood on their values:
//!
//! * **energies** are rounded to bins of width ΔM. The number in the bin Mc + k ΔM falls as
//!   10^(−b k ΔM), and b = log₁₀(1 + ΔM/(M̄ − Mc))/ΔM with the mean magnitude M̄ of the events from
//!   Mc on (Tinti & Mulargia 1987). For ΔM → 0 it is Aki's estimate (1965), b = log₁₀e/(M̄ − Mc);
//!   its expansion to first order in ΔM is Utsu's correction (1966), M̄ − Mc + ΔM/2;
//! * **sizes** n, with M = log₁₀ n, are whole numbers. The number of events of size n falls as
//!   n^(−α) with b = α − 1, and α solves Σₙ n^(−α) ln n / Σₙ n^(−α) = mean of ln n, over n ≥ nc
//!   (Clauset, Shalizi & Newman 2009). Aki's estimate takes sizes for continuous numbers, and is
//!   wrong by tens of per cent where most events are single bonds.
//!
//! The **error** is that of Shi and Bolt (1982): the standard error s/√N of the mean magnitude,
//! from the scatter s of the magnitudes, over the slope |dM̄/db| of the expected mean. For ΔM → 0
//! it is their 2.30 b² s/√N.
//!
//! **Completeness**: a run lists all of its ruptures, so Mc is not where events begin to be missed
//! but where the law begins to hold. It is the magnitude with the most events, of several the least
//! (maximum curvature, Wiemer & Wyss 2000), unless it is given. Whether the law holds from there on
//! is tested by the greatest distance of the cumulative shares (Lilliefors 1969).

use std::f64::consts::LN_10;

use serde::Serialize;

/// Least number of events from which a b-value is estimated: its error is a third of it by then.
pub const FEWEST: usize = 10;
/// Limit of the distance of a law whose b is fitted, times √N, that one in twenty catalogues of the
/// law exceeds (Lilliefors 1969, for exponential distributions; of discrete ones fewer do).
const LILLIEFORS: f64 = 1.06;
/// Terms of a sum over all sizes that are added one by one; the rest is integrated.
const TERMS: u32 = 100;
/// Halvings of an interval: its length is then below the round-off of its ends.
const HALVINGS: usize = 60;

/// The values that a magnitude can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values {
    /// Multiples of the width of a bin.
    Bins(f64),
    /// Decimal logarithms of whole numbers.
    Sizes,
}

/// The b-value of the events from a magnitude on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BValue {
    /// Least magnitude of the events.
    pub from: f64,
    /// Number of events.
    pub events: usize,
    /// b.
    pub b: f64,
    /// Its standard error.
    pub error: f64,
    /// Greatest distance of the share of events of a magnitude or more from that of the law.
    pub distance: f64,
    /// Whether the law may hold: whether that distance is below Lilliefors' limit.
    pub law_holds: bool,
}

/// The events of one magnitude.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Frequency {
    /// The magnitude, or the middle of its bin.
    pub magnitude: f64,
    /// Events of this magnitude.
    pub events: usize,
    /// Events of this magnitude or a greater one.
    pub cumulative: usize,
}

impl Values {
    /// The value of a magnitude as an index: the number of the bin, or the size.
    fn index(self, magnitude: f64) -> i64 {
        match self {
            Self::Bins(width) => (magnitude / width).round() as i64,
            Self::Sizes => 10f64.powf(magnitude).round() as i64,
        }
    }

    fn magnitude(self, index: i64) -> f64 {
        match self {
            Self::Bins(width) => index as f64 * width,
            Self::Sizes => (index as f64).log10(),
        }
    }

    /// The index from which on values are not less than a magnitude.
    fn first(self, from: f64) -> i64 {
        match self {
            Self::Bins(_) => self.index(from),
            // a size may be given as a rounded logarithm
            Self::Sizes => (10f64.powf(from) - 0.01).ceil().max(1.0) as i64,
        }
    }

    /// The least magnitude that counts as not less than `from`: the middle of its bin, or the
    /// logarithm of a whole number.
    pub fn least(self, from: f64) -> f64 {
        self.magnitude(self.first(from))
    }

    /// Number of events of each magnitude that occurs, in order.
    pub fn frequencies(self, magnitudes: &[f64]) -> Vec<Frequency> {
        let mut sorted: Vec<i64> = magnitudes.iter().map(|&m| self.index(m)).collect();
        sorted.sort_unstable();
        let mut left = sorted.len();
        let each = |same: &[i64]| {
            let cumulative = left;
            left -= same.len();
            Frequency { magnitude: self.magnitude(same[0]), events: same.len(), cumulative }
        };
        sorted.chunk_by(|a, b| a == b).map(each).collect()
    }

    /// The b-value of the events of magnitude `from` and more; `None` for fewer than [`FEWEST`]
    /// events, and for events of one magnitude.
    pub fn b_value(self, magnitudes: &[f64], from: f64) -> Option<BValue> {
        let first = self.first(from);
        let found: Vec<i64> = magnitudes.iter().map(|&m| self.index(m)).filter(|&index| index >= first).collect();
        if found.len() < FEWEST || found.iter().all(|index| *index == found[0]) {
            return None;
        }
        // in the units of the estimate: bins above Mc, natural logarithms of sizes
        let place = |index: &i64| match self {
            Self::Bins(_) => (index - first) as f64,
            Self::Sizes => (*index as f64 / first as f64).ln(),
        };
        let n = found.len() as f64;
        let mean = found.iter().map(place).sum::<f64>() / n;
        let variance = found.iter().map(|index| (place(index) - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let (b, slope) = match self {
            Self::Bins(width) => {
                // the mean of a geometric distribution of ratio q = 10^(−b ΔM) is q/(1 − q)
                let b = (1.0 + 1.0 / mean).ln() / (width * LN_10);
                (b, width * LN_10 * mean * (1.0 + mean))
            }
            Self::Sizes => {
                let exponent = exponent(mean, first);
                (exponent - 1.0, logarithms(exponent, first)[1])
            }
        };
        let from = self.magnitude(first);
        let distance = self.distance(b, first, &found);
        let law_holds = distance * n.sqrt() < LILLIEFORS;
        Some(BValue { from, events: found.len(), b, error: (variance / n).sqrt() / slope, distance, law_holds })
    }

    /// Greatest distance of the share of the events `found` of an index or more from that of the
    /// law with `b` from the index `first` on.
    fn distance(self, b: f64, first: i64, found: &[i64]) -> f64 {
        let mut sorted = found.to_vec();
        sorted.sort_unstable();
        let n = sorted.len() as f64;
        let law = |index: i64| self.share(b, first, index);
        let mut before = 0;
        let mut greatest: f64 = 0.0;
        // the share of the events falls after each index that occurs; that of the law everywhere
        for same in sorted.chunk_by(|x, y| x == y) {
            let after = before + same.len();
            let at = |count: usize| 1.0 - count as f64 / n;
            greatest = greatest.max((at(before) - law(same[0])).abs()).max((at(after) - law(same[0] + 1)).abs());
            before = after;
        }
        greatest
    }

    /// Share of the events of index `first` and more that have index `index` or more, by the law.
    fn share(self, b: f64, first: i64, index: i64) -> f64 {
        match self {
            Self::Bins(width) => 10f64.powf(-b * width * (index - first) as f64),
            Self::Sizes => {
                let ratio = index as f64 / first as f64;
                sums(b + 1.0, index)[0] / sums(b + 1.0, first)[0] * ratio.powf(-b - 1.0)
            }
        }
    }

    /// Number of events of at least `magnitude` that the law expects.
    pub fn expected(self, law: &BValue, magnitude: f64) -> f64 {
        law.events as f64 * self.share(law.b, self.index(law.from), self.index(magnitude))
    }
}

/// The magnitude with the most events, of several the least; `None` without events.
pub fn maximum_curvature(frequencies: &[Frequency]) -> Option<f64> {
    let most = frequencies.iter().map(|f| f.events).max()?;
    frequencies.iter().find(|f| f.events == most).map(|f| f.magnitude)
}

/// The exponent α > 1 of sizes n ≥ `first` whose mean of ln(n/first) is `mean` > 0.
fn exponent(mean: f64, first: i64) -> f64 {
    // the mean falls from infinity at α = 1 to zero
    let above = |excess: f64| logarithms(1.0 + excess, first)[0] > mean;
    let (mut low, mut high) = (0.0, 1.0);
    while above(high) {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if above(middle) { low = middle } else { high = middle }
    }
    1.0 + 0.5 * (low + high)
}

/// Mean and variance of ln(n/first) over sizes n ≥ `first` with the exponent α > 1.
fn logarithms(exponent: f64, first: i64) -> [f64; 2] {
    let [zero, one, two] = sums(exponent, first);
    [one / zero, two / zero - (one / zero).powi(2)]
}

/// Σ (n/q)^(−α) lnᵐ(n/q) over n ≥ q for m = 0, 1, 2: some terms, and for the rest the formula of
/// Euler and Maclaurin, ∫ f + f/2 − f′/12.
fn sums(exponent: f64, first: i64) -> [f64; 3] {
    let q = first as f64;
    let term = |x: f64| [0, 1, 2].map(|m| x.powf(-exponent) * x.ln().powi(m));
    let mut sums = [0.0; 3];
    // the smallest first
    for k in (0..TERMS).rev() {
        let term = term(1.0 + f64::from(k) / q);
        (0..3).for_each(|m| sums[m] += term[m]);
    }
    let x = 1.0 + f64::from(TERMS) / q;
    let (log, over, values) = (x.ln(), 1.0 / (exponent - 1.0), term(x));
    let scale = q * x.powf(1.0 - exponent) * over;
    let integrals = [1.0, log + over, log * log + 2.0 * over * log + 2.0 * over * over];
    for m in 0..3 {
        let lower = if m > 0 { m as f64 * values[m - 1] } else { 0.0 };
        let slope = (lower - exponent * values[m]) / x / q;
        sums[m] += scale * integrals[m] + 0.5 * values[m] - slope / 12.0;
    }
    sums
}

#[cfg(test)]
mod tests;
