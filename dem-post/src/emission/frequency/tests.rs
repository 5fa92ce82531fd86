//! Catalogues whose b-value is known.

use super::*;

/// Uniform numbers between 0 and 1, both excluded: SplitMix64 (Steele, Lea & Flood 2014).
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 12) as f64 / 2f64.powi(52) + 2f64.powi(-53)
    }
}

/// Shares of catalogues whose estimate is within one and two of its standard errors of b, and the
/// mean of the estimates over b, and the share whose law is found to hold; `catalogue` draws one,
/// Mc is given or that of maximum curvature.
fn recovered(values: Values, b: f64, from: Option<f64>, catalogue: &mut dyn FnMut() -> Vec<f64>) -> [f64; 4] {
    const TRIALS: usize = 2000;
    let mut found = [0.0; 4];
    for _ in 0..TRIALS {
        let magnitudes = catalogue();
        let from = from.unwrap_or_else(|| maximum_curvature(&values.frequencies(&magnitudes)).unwrap());
        let law = values.b_value(&magnitudes, from).unwrap();
        let off = (law.b - b).abs() / law.error;
        found[0] += f64::from(u8::from(off < 1.0));
        found[1] += f64::from(u8::from(off < 2.0));
        found[2] += law.b / b;
        found[3] += f64::from(u8::from(law.law_holds));
    }
    found.map(|sum| sum / TRIALS as f64)
}

/// A share of 2000 trials scatters by 1.1 % (one error) and 0.5 % (two): four of these are allowed,
/// and what a catalogue of 200 events lacks to the normal distribution.
fn agrees([one, two, mean, hold]: [f64; 4], bias: f64) {
    assert!((one - 0.683).abs() < 0.045, "{one} of the catalogues are within one error");
    assert!((two - 0.954).abs() < 0.025, "{two} are within two");
    assert!((mean - 1.0).abs() < bias, "the mean estimate is {mean} of b");
    assert!(hold > 0.93, "the law is found to hold in {hold}");
}

#[test]
fn b_of_exponential_catalogues_is_recovered_within_its_error() {
    let mut uniform = Uniform(1);
    for (b, width) in [(0.7, 0.1), (1.0, 0.1), (1.8, 0.1), (1.0, 0.5)] {
        // complete from the lower edge of the bin of magnitude 0 on
        let mut catalogue = || (0..200).map(|_| -0.5 * width - uniform.next().log10() / b).collect();
        agrees(recovered(Values::Bins(width), b, Some(0.0), &mut catalogue), 0.02);
        agrees(recovered(Values::Bins(width), b, None, &mut catalogue), 0.03);
    }
}

#[test]
fn b_of_sizes_is_recovered_within_its_error() {
    let mut uniform = Uniform(2);
    for (b, first) in [(0.8, 1), (1.5, 1), (1.0, 3)] {
        // cumulative shares of sizes by direct summation, with no use of the estimate's own sums
        let weight = |n: i64| (n as f64).powf(-b - 1.0);
        let many = 200_000;
        let rest = ((many as f64) - 0.5).powf(-b) / b;
        let total: f64 = (first..many).rev().map(weight).sum::<f64>() + rest;
        let mut draw = || {
            let (mut left, mut n) = (uniform.next() * total, first);
            while left > weight(n) && n < 2000 {
                left -= weight(n);
                n += 1;
            }
            // the tail is a power law of its own
            let n = if n < 2000 { n as f64 } else { (n as f64 * uniform.next().powf(-1.0 / b)).round() };
            n.log10()
        };
        let from = Some((first as f64).log10());
        let mut catalogue = || (0..200).map(|_| draw()).collect();
        agrees(recovered(Values::Sizes, b, from, &mut catalogue), 0.02);
    }
}

#[test]
fn narrow_bins_give_the_estimates_of_aki_and_of_shi_and_bolt() {
    let mut uniform = Uniform(3);
    let magnitudes: Vec<f64> = (0..500).map(|_| -uniform.next().log10()).collect();
    let law = Values::Bins(1e-6).b_value(&magnitudes, 0.0).unwrap();
    let n = magnitudes.len() as f64;
    let mean = magnitudes.iter().sum::<f64>() / n;
    let aki = std::f64::consts::LOG10_E / mean;
    let squares: f64 = magnitudes.iter().map(|m| (m - mean).powi(2)).sum();
    let shi = LN_10 * aki * aki * (squares / (n * (n - 1.0))).sqrt();
    assert!((law.b / aki - 1.0).abs() < 1e-5 && (law.error / shi - 1.0).abs() < 1e-5, "{law:?}, {aki}, {shi}");
    // Utsu's correction is the first order in ΔM; the next is (b ΔM ln 10)²/12
    let law = Values::Bins(0.1).b_value(&magnitudes, 0.0).unwrap();
    let binned: f64 = magnitudes.iter().map(|m| (m / 0.1).round() * 0.1).sum::<f64>() / n;
    let utsu = std::f64::consts::LOG10_E / (binned + 0.05);
    let second = (law.b * 0.1 * LN_10).powi(2) / 12.0;
    assert!((law.b / utsu - 1.0 - second).abs() < 0.1 * second, "{} and {utsu}", law.b);
}

#[test]
fn sums_over_sizes_are_those_of_the_zeta_function() {
    // ζ(2) = π²/6; ζ'(2) = −0.9375482543…, ζ''(2) = 1.98928023429…
    let [zero, one, two] = sums(2.0, 1);
    let pi = std::f64::consts::PI;
    for (sum, known) in [(zero, pi * pi / 6.0), (one, 0.937_548_254_315_844), (two, 1.989_280_234_298_901)] {
        assert!((sum / known - 1.0).abs() < 1e-9, "{sum} is not {known}");
    }
    // from a size on: ζ(3, 4) = ζ(3) − 1 − 1/8 − 1/27
    let known = 1.202_056_903_159_594 - 1.0 - 0.125 - 1.0 / 27.0;
    assert!((sums(3.0, 4)[0] * 4f64.powi(-3) / known - 1.0).abs() < 1e-9);
    // the exponent is found again from its mean, small and large
    for (alpha, first) in [(1.05, 1), (2.5, 1), (9.0, 2), (40.0, 100)] {
        assert!((exponent(logarithms(alpha, first)[0], first) / alpha - 1.0).abs() < 1e-9, "{alpha}");
    }
}

#[test]
fn frequencies_count_from_the_largest() {
    let found = Values::Bins(0.5).frequencies(&[0.0, 1.1, 0.2, -0.1, 0.9]);
    let rows: Vec<(f64, usize, usize)> = found.iter().map(|f| (f.magnitude, f.events, f.cumulative)).collect();
    assert_eq!(rows, [(0.0, 3, 5), (1.0, 2, 2)]);
    assert_eq!(maximum_curvature(&found), Some(0.0));
    let sizes = Values::Sizes.frequencies(&[0.0, 7f64.log10(), 2f64.log10(), 7f64.log10()]);
    let rows: Vec<(f64, usize, usize)> = sizes.iter().map(|f| (f.magnitude, f.events, f.cumulative)).collect();
    assert_eq!(rows, [(0.0, 1, 4), (2f64.log10(), 1, 3), (7f64.log10(), 2, 2)]);
    assert_eq!(maximum_curvature(&[]), None);
}

#[test]
fn what_events_do_not_tell_is_absent() {
    let values = Values::Bins(0.1);
    assert_eq!(values.b_value(&[0.3; 50], 0.0), None);
    let mut few = vec![0.0; 8];
    few.push(1.0);
    assert_eq!(values.b_value(&few, 0.0), None);
    few.push(1.0);
    assert!(values.b_value(&few, 0.0).is_some());
    // only two of them are from 0.5 on
    assert_eq!(values.b_value(&few, 0.5), None);
    // a size given by its rounded logarithm counts
    let sizes: Vec<f64> = [7.0, 8.0].repeat(6).into_iter().map(f64::log10).collect();
    assert_eq!(Values::Sizes.b_value(&sizes, 0.845).unwrap().events, 12);
}

#[test]
fn the_law_expects_its_own_numbers() {
    let law = BValue { from: 0.0, events: 1000, b: 1.0, error: 0.03, distance: 0.0, law_holds: true };
    assert!((Values::Bins(0.1).expected(&law, 2.0) - 10.0).abs() < 1e-9);
    // Σ_{n ≥ 2} n⁻² over Σ_{n ≥ 1} n⁻²
    let zeta = std::f64::consts::PI.powi(2) / 6.0;
    assert!((Values::Sizes.expected(&law, 2f64.log10()) / (1000.0 * (zeta - 1.0) / zeta) - 1.0).abs() < 1e-9);
}

#[test]
fn magnitudes_of_another_law_are_noticed() {
    let mut uniform = Uniform(4);
    // evenly spread between two magnitudes, and around one
    let even: Vec<f64> = (0..200).map(|_| uniform.next()).collect();
    let narrow: Vec<f64> = (0..200).map(|_| (0..12).map(|_| uniform.next()).sum::<f64>()).collect();
    for (magnitudes, from) in [(even, 0.0), (narrow, 4.5)] {
        let law = Values::Bins(0.1).b_value(&magnitudes, from).unwrap();
        assert!(!law.law_holds, "{law:?}");
    }
    // sizes that are all alike but for a few
    let sizes: Vec<f64> = (0..100).map(|k| f64::from(20 + k % 3).log10()).collect();
    assert!(!Values::Sizes.b_value(&sizes, 0.0).unwrap().law_holds);
}

#[test]
fn a_given_completeness_is_that_of_the_events_that_count() {
    let bins = Values::Bins(0.1);
    let magnitudes: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k % 10)).collect();
    for (given, used) in [(0.24, 0.2), (0.26, 0.3), (0.3, 0.3)] {
        assert!((bins.least(given) - used).abs() < 1e-12);
        let [asked, told] = [given, bins.least(given)].map(|from| bins.b_value(&magnitudes, from));
        assert_eq!(asked, told);
    }
    assert_eq!(Values::Sizes.least(0.5), 4f64.log10());
}
