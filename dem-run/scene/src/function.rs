//! Functions of time: how a force or a velocity is prescribed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A function of time. Its unit is that of the driven quantity: N, m/s, or none for a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Function {
    /// The same value at all times.
    Constant(f64),
    /// Zero until `start`, then growing at a constant rate.
    Ramp(Ramp),
    /// Pairs `[time, value]` with increasing times (s): linear in between, constant before the
    /// first and after the last.
    Table(Vec<[f64; 2]>),
}

/// A linear ramp from zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Growth per second (N/s for a force, m/s² for a velocity, 1/s for a factor).
    pub rate: f64,
    /// Start of the growth (s).
    #[serde(default)]
    pub start: f64,
}

impl Function {
    /// The value at time `t` (s).
    ///
    /// A table that is empty, which validation refuses, is zero.
    #[must_use]
    pub fn at(&self, t: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Ramp(ramp) => ramp.rate * (t - ramp.start).max(0.0),
            Self::Table(rows) => interpolate(rows, t),
        }
    }

    /// The times at which the function turns (s): it is affine in between.
    #[must_use]
    pub fn knots(&self) -> Vec<f64> {
        match self {
            Self::Constant(_) => vec![],
            Self::Ramp(ramp) => vec![ramp.start],
            Self::Table(rows) => rows.iter().map(|row| row[0]).collect(),
        }
    }

    /// Whether the function is zero at all times.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        match self {
            Self::Constant(value) => *value == 0.0,
            Self::Ramp(ramp) => ramp.rate == 0.0,
            Self::Table(rows) => rows.iter().all(|row| row[1] == 0.0),
        }
    }
}

/// Piecewise linear interpolation of `rows` = (t, value), held at both ends.
fn interpolate(rows: &[[f64; 2]], t: f64) -> f64 {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return 0.0;
    };
    // the first row after t; its predecessor is at or before t
    let next = rows.partition_point(|row| row[0] <= t);
    if next == 0 {
        return first[1];
    }
    if next == rows.len() {
        return last[1];
    }
    let ([t0, v0], [t1, v1]) = (rows[next - 1], rows[next]);
    let s = (t - t0) / (t1 - t0);
    // this form gives v0 and v1 exactly at the ends
    v0 * (1.0 - s) + v1 * s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_zero_before_it_starts() {
        let ramp = Function::Ramp(Ramp { rate: 200.0, start: 0.1 });
        assert_eq!(ramp.at(0.0), 0.0);
        assert_eq!(ramp.at(0.1), 0.0);
        assert_eq!(ramp.at(0.6), 100.0);
    }

    #[test]
    fn a_table_is_linear_inside_and_held_outside() {
        let table = Function::Table(vec![[1.0, 10.0], [2.0, 30.0], [4.0, -10.0]]);
        for (t, value) in [(-5.0, 10.0), (1.0, 10.0), (1.5, 20.0), (2.0, 30.0), (3.0, 10.0), (4.0, -10.0), (9.0, -10.0)]
        {
            assert_eq!(table.at(t), value, "at t = {t}");
        }
    }

    #[test]
    fn a_table_of_one_row_is_a_constant_and_an_empty_one_is_zero() {
        assert_eq!(Function::Table(vec![[1.0, 3.0]]).at(0.0), 3.0);
        assert_eq!(Function::Table(vec![[1.0, 3.0]]).at(2.0), 3.0);
        assert_eq!(Function::Table(vec![]).at(2.0), 0.0);
    }

    #[test]
    fn zero_functions_are_recognised() {
        assert!(Function::Constant(0.0).is_zero());
        assert!(!Function::Ramp(Ramp { rate: 1.0, start: 0.0 }).is_zero());
        assert!(Function::Table(vec![[0.0, 0.0], [1.0, 0.0]]).is_zero());
    }
}
