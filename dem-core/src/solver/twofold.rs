//! Arithmetic in twice the precision: a number is a pair of a rounded value and its rounding error.
//!
//! It uses no fused multiply-add, whose rounding differs between processors.
//!
//! Sources: Dekker, Numer. Math. 18, 1971; Knuth, The Art of Computer Programming 2, §4.2.2.

/// A number as the sum of a rounded value and its rounding error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Twofold {
    pub high: f64,
    pub low: f64,
}

impl Twofold {
    /// Add a · b.
    #[inline]
    pub fn add_product(&mut self, a: f64, b: f64) {
        let (product, left) = two_product(a, b);
        let (sum, lost) = two_sum(self.high, product);
        *self = Self { high: sum, low: self.low + (left + lost) };
    }

    /// Add a · b for a number b of twice the precision.
    #[inline]
    pub fn add_scaled(&mut self, a: f64, b: Self) {
        self.add_product(a, b.high);
        self.low += a * b.low;
    }

    /// Rounded to one number.
    pub fn rounded(self) -> f64 {
        self.high + self.low
    }
}

impl From<f64> for Twofold {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

/// a + b and its rounding error.
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// a · b and its rounding error.
#[inline]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ([ah, al], [bh, bl]) = (halves(a), halves(b));
    (product, ((ah * bh - product) + ah * bl + al * bh) + al * bl)
}

/// A number as the sum of two with half its digits.
#[inline]
fn halves(x: f64) -> [f64; 2] {
    let scaled = f64::from((1_u32 << 27) + 1) * x;
    let high = scaled - (scaled - x);
    [high, x - high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cancels_leaves_the_digits_below_rounding() {
        // (1 + 2⁻³⁰)² − 1 − 2⁻²⁹ = 2⁻⁶⁰
        let x = 1.0 + 2f64.powi(-30);
        let mut sum = Twofold::from(-1.0);
        sum.add_product(x, x);
        sum.add_product(-1.0, 2f64.powi(-29));
        assert_eq!(sum.rounded(), 2f64.powi(-60));
        assert_eq!((x * x - 1.0) - 2f64.powi(-29), 0.0, "one number loses them");
    }

    #[test]
    fn scaled_numbers_keep_their_low_part() {
        let mut small = Twofold::from(1.0);
        small.add_product(1.0, 2f64.powi(-70));
        let mut sum = Twofold::from(-3.0);
        sum.add_scaled(3.0, small);
        assert_eq!(sum.rounded(), 3.0 * 2f64.powi(-70));
    }
}
