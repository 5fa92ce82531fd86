//! A straight line through points, the spread of numbers, and the standard errors of both.
//!
//! Points (xₖ, yₖ), k = 1 … n, with means x̄, ȳ and sums of squares Sxx = Σ(xₖ − x̄)², Syy, Sxy.
//! The least-squares line y = b x + a and its standard errors are
//!
//! ```text
//! b = Sxy / Sxx                     s² = Σ(yₖ − b xₖ − a)² / (n − 2)
//! a = ȳ − b x̄                       σ_b = s / √Sxx
//! R² = 1 − (n − 2) s² / Syy         σ_a = s √(1/n + x̄² / Sxx)
//! ```
//!
//! and 95 % intervals are b ± t σ_b, a ± t σ_a with the quantile t = t₀.₉₇₅ of Student's
//! distribution with n − 2 degrees of freedom; for the mean of n numbers with standard deviation s,
//! ± t s/√n with n − 1.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Share of the distribution below the upper end of a 95 % interval.
const UPPER: f64 = 0.975;

/// A number that was fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Its value.
    pub value: f64,
    /// Its standard error; `None` for a line through two points, which has no residual.
    pub standard_error: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
}

/// The least-squares line through some points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Number of points.
    pub points: usize,
    /// Slope b, unit of y over unit of x.
    pub slope: Estimate,
    /// Intercept a, unit of y.
    pub intercept: Estimate,
    /// Share of the variance of y that the line explains; `None` where all y are equal.
    pub r_squared: Option<f64>,
}

/// The spread of some numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Count.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation, with n − 1; `None` of a single number.
    pub deviation: Option<f64>,
    /// The 95 % interval of the mean; `None` of a single number.
    pub interval: Option<[f64; 2]>,
}

/// The line through `points` (x, y), all finite; `None` for fewer than two distinct x.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let first = points.first()?.0;
    if points.iter().all(|p| p.0 == first) {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
    let (sxx, syy) = (sum(&|p| (p.0 - x).powi(2)), sum(&|p| (p.1 - y).powi(2)));
    let slope = sum(&|p| (p.0 - x) * (p.1 - y)) / sxx;
    let intercept = y - slope * x;
    let rest = sum(&|p| (p.1 - y - slope * (p.0 - x)).powi(2));
    let freedom = points.len() - 2;
    let variance = (freedom > 0).then(|| rest / freedom as f64);
    let estimate = |value: f64, factor: f64| {
        let error = variance.map(|variance| (variance * factor).sqrt());
        Estimate { value, standard_error: error, interval: error.map(|error| around(value, error, freedom)) }
    };
    Some(Line {
        points: points.len(),
        slope: estimate(slope, 1.0 / sxx),
        intercept: estimate(intercept, 1.0 / n + x * x / sxx),
        r_squared: (syy > 0.0).then(|| 1.0 - rest / syy),
    })
}

/// The spread of `values`; `None` without values.
pub fn spread(values: &[f64]) -> Option<Spread> {
    if values.is_empty() {
        return None;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let freedom = values.len() - 1;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let deviation = (freedom > 0).then(|| (squares / freedom as f64).sqrt());
    let interval = deviation.map(|deviation| around(mean, deviation / n.sqrt(), freedom));
    Some(Spread { count: values.len(), mean, deviation, interval })
}

/// The 95 % interval of a value from its standard error and its degrees of freedom, at least 1.
pub(crate) fn around(value: f64, error: f64, freedom: usize) -> [f64; 2] {
    let half = student(freedom) * error;
    [value - half, value + half]
}

/// The quantile t₀.₉₇₅ of Student's distribution with `freedom` degrees of freedom, at least 1.
fn student(freedom: usize) -> f64 {
    // the constructor rejects only a scale or a freedom that is not positive
    StudentsT::new(0.0, 1.0, freedom as f64).map_or(f64::INFINITY, |distribution| distribution.inverse_cdf(UPPER))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance * b.abs().max(1.0), "{a} is not {b}");
    }

    #[test]
    fn an_exact_line_is_found_exactly() {
        let found = line(&[(5.0, 9.5), (10.0, 17.0), (20.0, 32.0)]).unwrap();
        close(found.slope.value, 1.5, 1e-14);
        close(found.intercept.value, 2.0, 1e-13);
        close(found.r_squared.unwrap(), 1.0, 1e-14);
        assert!(found.slope.standard_error.unwrap() < 1e-14 && found.intercept.standard_error.unwrap() < 1e-13);
    }

    #[test]
    fn standard_errors_are_those_computed_by_hand() {
        // x̄ = 3, ȳ = 4, Sxx = 10, Sxy = 6, Syy = 6: b = 0.6, a = 2.2; residuals -0.8, 0.6, 1,
        // -0.6, -0.2, of squares 2.4
        let found = line(&[(1.0, 2.0), (2.0, 4.0), (3.0, 5.0), (4.0, 4.0), (5.0, 5.0)]).unwrap();
        close(found.slope.value, 0.6, 1e-14);
        close(found.intercept.value, 2.2, 1e-14);
        close(found.r_squared.unwrap(), 0.6, 1e-14);
        // s² = 0.8: σ_b = √0.08, σ_a = √(0.8 (1/5 + 9/10))
        let error = 0.08f64.sqrt();
        close(found.slope.standard_error.unwrap(), error, 1e-14);
        close(found.intercept.standard_error.unwrap(), 0.88f64.sqrt(), 1e-14);
        // three degrees of freedom
        let [low, high] = found.slope.interval.unwrap();
        close(low, 0.6 - 3.182_446_305 * error, 1e-9);
        close(high, 0.6 + 3.182_446_305 * error, 1e-9);
    }

    #[test]
    fn what_points_do_not_tell_is_absent() {
        assert_eq!(line(&[]), None);
        assert_eq!(line(&[(1.0, 2.0), (1.0, 3.0)]), None);
        let two = line(&[(1.0, 2.0), (2.0, 5.0)]).unwrap();
        assert_eq!((two.slope.value, two.intercept.value, two.slope.standard_error), (3.0, -1.0, None));
        let level = line(&[(1.0, 2.0), (2.0, 2.0), (3.0, 2.0)]).unwrap();
        assert_eq!((level.slope.value, level.r_squared), (0.0, None));
        assert_eq!(spread(&[]), None);
        let single = spread(&[4.0]).unwrap();
        assert_eq!((single.mean, single.deviation, single.interval), (4.0, None, None));
    }

    #[test]
    fn the_interval_of_a_mean_is_student_s() {
        // mean 3, deviation √2.5; t with four degrees of freedom is 2.776445105
        let found = spread(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        close(found.deviation.unwrap(), 2.5f64.sqrt(), 1e-15);
        close(found.interval.unwrap()[1], 3.0 + 2.776_445_105 * 0.5f64.sqrt(), 1e-9);
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, t) in [(1, 12.706_204_736), (2, 4.302_652_730), (9, 2.262_157_163), (28, 2.048_407_142)] {
            close(student(freedom), t, 1e-8);
        }
        // towards the normal distribution
        close(student(1000), 1.962_339, 1e-5);
    }
}
