//! Checks for values that a sound history cannot hold. The reader rejects such a value, with its
//! place and row, before anything is computed from it. `dem-post info --check` lists all such
//! values and makes further checks.

use std::fmt::Display;
use std::path::Path;

use super::error::{HistoryError, Result, damaged};
use super::model::Rupture;
use super::schema::LOAD_ERROR;

/// Upper bound of every quantity in SI units; squares and cubes of smaller numbers are finite.
const GREATEST: f64 = 1e100;
/// Largest distance of a grain from the sample, relative to the size of the sample. At larger
/// distances double precision does not resolve the gaps of contacts.
const FAR: f64 = 1e6;

/// Whether a number is finite and below `GREATEST` in magnitude.
#[must_use]
pub fn is_plausible(value: f64) -> bool {
    value.abs() < GREATEST
}

/// Whether the observable `name` may have this value: a plausible number or, for the load error of
/// a step whose solves report none, NaN.
#[must_use]
pub fn may_be_observed(name: &str, value: f64) -> bool {
    is_plausible(value) || (name == LOAD_ERROR && value.is_nan())
}

/// The admissible positions of grains: within a million sizes of the sample from its middle.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Medians of the first coordinates, m, D of them: a single wrong grain does not move them.
    middle: Vec<f64>,
    /// Greatest distance along an axis, m.
    reach: f64,
}

impl Surroundings {
    /// The surroundings of grains with these radii (m, N) and first centres (m, N × D). The size of
    /// the sample is the greater of two lengths: all grains in a row, and twice the median distance
    /// of the centres from the middle.
    #[must_use]
    pub fn of(radius: &[f64], position: &[f64], dimension: usize) -> Self {
        let middle: Vec<f64> =
            (0..dimension).map(|k| median(position.iter().skip(k).step_by(dimension).copied().collect())).collect();
        let distance = |x: &[f64]| x.iter().zip(&middle).map(|(x, m)| (x - m).abs()).fold(0.0, f64::max);
        let spread = median(position.chunks(dimension).map(distance).collect());
        let row = radius.len() as f64 * median(radius.to_vec());
        Self { reach: FAR * 2.0 * row.max(spread), middle }
    }

    /// Whether a centre (m, D) lies within the surroundings.
    #[must_use]
    pub fn hold(&self, centre: &[f64]) -> bool {
        centre.iter().zip(&self.middle).all(|(x, m)| (x - m).abs() <= self.reach)
    }
}

/// Whether the radius of a grain (m) exceeds a million times `usual`, the median of all radii.
#[must_use]
pub fn is_huge(radius: f64, usual: f64) -> bool {
    radius > FAR * usual
}

/// The median, the upper one of an even number of values; 0 without values.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

pub(super) fn row(path: &Path, place: &str, row: usize, why: impl Display) -> HistoryError {
    damaged(path, place, format!("row {row}: {why}"))
}

/// Rejects implausible numbers in rows of `width` numbers; the first row has index `first`.
pub(super) fn reals(path: &Path, place: &str, first: usize, width: usize, values: &[f64]) -> Result<()> {
    refused(path, place, first, width, values.iter().position(|value| !is_plausible(*value)), values)
}

/// The same for the values of the observable `name`.
pub(super) fn observed(path: &Path, name: &str, place: &str, first: usize, width: usize, values: &[f64]) -> Result<()> {
    let wrong = values.iter().position(|value| !may_be_observed(name, *value));
    refused(path, place, first, width, wrong, values)
}

/// Rejects the value with index `wrong`, if any.
fn refused(path: &Path, place: &str, first: usize, width: usize, wrong: Option<usize>, values: &[f64]) -> Result<()> {
    match wrong {
        Some(k) => {
            Err(row(path, place, first + k / width.max(1), format!("{:e} is not a plausible number", values[k])))
        }
        None => Ok(()),
    }
}

/// Rejects numbers that are not positive.
pub(super) fn positive(path: &Path, place: &str, values: &[f64]) -> Result<()> {
    match values.iter().position(|value| *value <= 0.0) {
        Some(k) => Err(row(path, place, k, format!("{:e} is not above zero", values[k]))),
        None => Ok(()),
    }
}

/// Rejects radii far larger than the median.
pub(super) fn radii(path: &Path, place: &str, values: &[f64]) -> Result<()> {
    positive(path, place, values)?;
    let usual = median(values.to_vec());
    match values.iter().position(|radius| is_huge(*radius, usual)) {
        Some(k) => Err(row(path, place, k, format!("{:e} m, but half the grains have at most {usual:e} m", values[k]))),
        None => Ok(()),
    }
}

/// Rejects values that do not increase from row to row.
pub(super) fn growing<T: PartialOrd + Display>(path: &Path, place: &str, values: &[T]) -> Result<()> {
    match values.windows(2).position(|pair| pair[0] >= pair[1]) {
        Some(k) => Err(row(path, place, k + 1, format!("{} does not come after {}", values[k + 1], values[k]))),
        None => Ok(()),
    }
}

/// Rejects steps that are missing; the first row has index `first`.
pub(super) fn consecutive(path: &Path, place: &str, first: usize, steps: &[i64]) -> Result<()> {
    match steps.windows(2).position(|pair| pair[0].checked_add(1) != Some(pair[1])) {
        Some(k) => Err(row(path, place, first + k + 1, format!("step {} follows step {}", steps[k + 1], steps[k]))),
        None => Ok(()),
    }
}

/// Rejects ruptures of unknown bonds or grains, ruptures out of order or after step `until`, and
/// implausible numbers.
pub(super) fn ruptures(
    path: &Path,
    place: &str,
    events: &[Rupture],
    [bonds, grains]: [usize; 2],
    until: i64,
) -> Result<()> {
    let known = |number: i32, count: usize| usize::try_from(number).is_ok_and(|number| number < count);
    let mut last = (i64::MIN, f64::NEG_INFINITY);
    for (k, e) in events.iter().enumerate() {
        let [x, y, z] = e.point;
        // histories older than version 3 have no twisting moment
        let twist = if e.twist.is_nan() { 0.0 } else { e.twist };
        let numbers = [e.time, x, y, z, e.normal_force, e.tangential_force, e.moment, twist, e.energy];
        reals(path, place, k, numbers.len(), &numbers)?;
        let what = if !known(e.bond, bonds) {
            format!("{} is not one of the {bonds} bonds", e.bond)
        } else if !e.pair.iter().all(|grain| known(*grain, grains)) {
            format!("{}, {} are not two different grains of {grains}", e.pair[0], e.pair[1])
        } else if e.step < last.0 || e.time < last.1 {
            format!("step {} at {} s does not come after step {} at {} s", e.step, e.time, last.0, last.1)
        } else if e.step > until {
            format!("step {} comes after the last frame, of step {until}", e.step)
        } else if e.round < 0 {
            format!("{} is not a round of a cascade", e.round)
        } else {
            last = (e.step, e.time);
            continue;
        };
        return Err(row(path, place, k, what));
    }
    Ok(())
}
