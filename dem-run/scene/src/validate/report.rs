//! The list of problems, and the common checks.

use std::fmt;

use crate::error::Problem;
use crate::function::Function;
use crate::suggest::nearest;

/// Histories number grains and walls by the same 32-bit signed integers.
pub const MAX_GRAINS: usize = 100_000_000;

/// Largest magnitude of a number, and the inverse of the smallest positive one. Products of a few
/// such numbers, as masses and energies, then neither overflow nor underflow.
pub const LARGEST: f64 = 1e60;
/// Smallest positive value of a field.
pub const LEAST: f64 = 1e-60;

/// The problems found so far.
pub(crate) struct Report {
    /// Dimension of space, 2 or 3.
    pub(crate) dimension: usize,
    /// The problems, in the order of the scene.
    pub(crate) problems: Vec<Problem>,
}

/// A number as printed in a message.
pub(crate) struct Number(pub(crate) f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // the shortest exact digits, with an exponent for large or small numbers
        write!(f, "{:?}", self.0)
    }
}

impl Report {
    pub(crate) fn wrong(&mut self, path: impl Into<String>, found: impl fmt::Display, allowed: impl Into<String>) {
        self.problems.push(Problem::new(path, found.to_string(), allowed));
    }

    /// Reports the name of something that the scene lacks: `what`, as "a wall". `names` are those
    /// that it has.
    pub(crate) fn unknown(&mut self, path: impl Into<String>, name: &str, what: &str, names: Vec<&str>) {
        let allowed = match names.is_empty() {
            true => format!("{what} of the scene: it has none"),
            false => format!("the name of {what}: {}", names.join(", ")),
        };
        let problem = Problem::new(path, format!("\"{name}\""), allowed);
        self.problems.push(problem.with_nearest(nearest(name, names)));
    }

    /// Checks the characters of a name; returns whether they are allowed.
    pub(crate) fn name(&mut self, path: impl Into<String>, name: &str) -> bool {
        let allowed = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !allowed {
            self.wrong(path, format!("the name \"{name}\""), "a name of letters, digits, _ and -");
        }
        allowed
    }

    /// Checks that a number is finite and `inside` holds; `allowed` describes the range.
    pub(crate) fn range(&mut self, path: impl Into<String>, value: f64, inside: bool, allowed: impl Into<String>) {
        if inside && value.abs() <= LARGEST {
            return;
        }
        let allowed = match value.is_finite() && inside {
            true => format!("{}, of magnitude at most {LARGEST:.0e}", allowed.into()),
            false => allowed.into(),
        };
        self.wrong(path, Number(value), allowed);
    }

    pub(crate) fn positive(&mut self, path: impl Into<String>, value: f64, unit: &str) {
        let allowed = match value > 0.0 {
            true => format!("a finite number > 0 ({unit}), at least {LEAST:.0e}"),
            false => format!("a finite number > 0 ({unit})"),
        };
        self.range(path, value, value >= LEAST, allowed);
    }

    pub(crate) fn non_negative(&mut self, path: impl Into<String>, value: f64, unit: &str) {
        self.range(path, value, value >= 0.0, format!("a finite number ≥ 0 ({unit})"));
    }

    /// Checks the strength of bonds at `path`: a force, or a stress.
    pub(crate) fn bond_strength(&mut self, path: &str, strength: Option<f64>, stress: Option<f64>) {
        for (name, value, unit) in [("strength", strength, "N"), ("stress", stress, "Pa")] {
            if let Some(value) = value {
                self.non_negative(format!("{path}.{name}"), value, &format!("{unit}; 0 means no bonds"));
            }
        }
    }

    /// Checks coefficients of the limits of bonds at `path`, by name.
    pub(crate) fn bond_coefficients(&mut self, path: &str, coefficients: &[(&str, Option<f64>)]) {
        for (name, value) in coefficients {
            if let Some(value) = value {
                self.non_negative(format!("{path}.{name}"), *value, "no unit");
            }
        }
    }

    pub(crate) fn finite(&mut self, path: impl Into<String>, value: f64) {
        self.range(path, value, true, "a finite number");
    }

    pub(crate) fn fraction(&mut self, path: impl Into<String>, value: f64) {
        self.range(path, value, (0.0..=1.0).contains(&value), "a number from 0 to 1");
    }

    fn components(&mut self, path: &str, vector: &[f64], length: usize) {
        if vector.len() == length {
            for (k, value) in vector.iter().enumerate() {
                self.finite(format!("{path}.{k}"), *value);
            }
        } else {
            let allowed = format!("an array of {length} in {} dimensions", self.dimension);
            self.wrong(path, format!("an array of {}", vector.len()), allowed);
        }
    }

    pub(crate) fn vector(&mut self, path: &str, vector: &[f64]) {
        self.components(path, vector, self.dimension);
    }

    pub(crate) fn spin(&mut self, path: &str, vector: &[f64]) {
        let length = if self.dimension == 2 { 1 } else { 3 };
        self.components(path, vector, length);
    }

    /// Checks that the length of a vector is not zero.
    pub(crate) fn direction(&mut self, path: &str, vector: &[f64]) {
        self.vector(path, vector);
        let length = vector.iter().fold(0.0_f64, |length, value| length.hypot(*value));
        // a shorter vector cannot be normalised
        if vector.len() == self.dimension && !vector.iter().any(|value| value.is_nan()) && length < LEAST {
            self.wrong(path, format!("{vector:?}"), "a vector whose length is not zero");
        }
    }

    pub(crate) fn function(&mut self, path: &str, function: &Function) {
        match function {
            Function::Constant(value) => self.finite(format!("{path}.constant"), *value),
            Function::Ramp(ramp) => {
                self.finite(format!("{path}.ramp.rate"), ramp.rate);
                self.finite(format!("{path}.ramp.start"), ramp.start);
            }
            Function::Table(rows) => self.table(&format!("{path}.table"), rows),
        }
    }

    fn table(&mut self, path: &str, rows: &[[f64; 2]]) {
        if rows.is_empty() {
            self.wrong(path, "no rows", "at least one pair [time, value]");
        }
        for (k, row) in rows.iter().enumerate() {
            self.finite(format!("{path}.{k}.0"), row[0]);
            self.finite(format!("{path}.{k}.1"), row[1]);
            if k > 0 && row[0] <= rows[k - 1][0] {
                let allowed = format!("a time after that of the row before, {:?} s", rows[k - 1][0]);
                self.wrong(format!("{path}.{k}.0"), Number(row[0]), allowed);
            }
        }
    }

    /// Reports a number that the scene must not give here.
    pub(crate) fn absent(&mut self, path: impl Into<String>, value: Option<f64>, reason: &str) {
        if let Some(value) = value {
            self.wrong(path, Number(value), format!("nothing: {reason}"));
        }
    }

    pub(crate) fn count(&mut self, path: &str, value: usize) {
        if value == 0 || value > MAX_GRAINS {
            self.wrong(path, value, format!("a whole number from 1 to {MAX_GRAINS}"));
        }
    }
}
