//! The observables: names, values, and checks of the values.

use std::ops::Range;

use hdf5::H5Type;
use hdf5::types::VarLenUnicode;

use super::codes::{RouteCode, SolverRoute};
use super::error::{Result, while_reading};
use super::model::{Observable, ValueKind};
use super::schema::path;
use super::sound;
use super::source::Source;

/// One observable over the whole run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Its unit, empty for a number.
    pub unit: String,
    /// The shape of one value.
    pub shape: Vec<usize>,
    /// Steps, S.
    pub step: Vec<i64>,
    /// Times, s, S.
    pub time: Vec<f64>,
    /// Values, S × shape, row by row; for an enumeration, its codes.
    pub value: Vec<f64>,
}

impl Series {
    /// Component `index` of every value, as `[1, 1]` of a tensor or `[]` of a scalar; `None`
    /// outside the shape.
    pub fn component(&self, index: &[usize]) -> Option<Vec<f64>> {
        if index.len() != self.shape.len() || index.iter().zip(&self.shape).any(|(i, n)| i >= n) {
            return None;
        }
        let offset = index.iter().zip(&self.shape).fold(0, |offset, (i, n)| offset * n + i);
        let width = self.shape.iter().product();
        Some(self.value.chunks_exact(width).map(|value| value[offset]).collect())
    }
}

/// The names of the observables, sorted.
pub(super) fn names(source: &Source) -> Result<Vec<String>> {
    let group = source.file.group(path::OBSERVABLES).map_err(while_reading(&source.path, path::OBSERVABLES))?;
    let mut names = group.member_names().map_err(while_reading(&source.path, path::OBSERVABLES))?;
    names.retain(|name| group.link_exists(&format!("{name}/value")));
    names.sort_unstable();
    Ok(names)
}

/// The observables, in the order of their names.
pub(super) fn observables(source: &Source) -> Result<Vec<Observable>> {
    let observable = |name: String| -> Result<Observable> {
        let Series { unit, shape, .. } = series(source, &name, 0..0)?.unwrap_or_default();
        let kind = kind(source, &format!("{}/{name}/value", path::OBSERVABLES))?;
        Ok(Observable { name, unit, shape, kind })
    };
    names(source)?.into_iter().map(observable).collect()
}

/// One observable over a range of its rows, `None` if it was not recorded.
pub(super) fn series(source: &Source, name: &str, rows: Range<usize>) -> Result<Option<Series>> {
    let place = format!("{}/{name}/value", path::OBSERVABLES);
    if name.contains('/') || !source.has(&format!("{}/{name}", path::OBSERVABLES)) || !source.has(&place) {
        return Ok(None);
    }
    let (shape, value) = match kind(source, &place)? {
        ValueKind::Real => source.read(&place, rows.clone())?,
        ValueKind::Route => {
            let (shape, codes) = source.read::<RouteCode>(&place, rows.clone())?;
            let routes: Vec<SolverRoute> = source.coded(&place, codes, rows.len())?;
            (shape, routes.into_iter().map(SolverRoute::number).collect())
        }
    };
    sound::observed(&source.path, name, &place, rows.start, shape.iter().product(), &value)?;
    let unit = match source.dataset(&place)?.attr("unit") {
        Ok(unit) => unit.read_scalar::<VarLenUnicode>().map_err(while_reading(&source.path, &place))?.to_string(),
        Err(_) => String::new(),
    };
    let steps = format!("{}/step", path::OBSERVABLES);
    let step: Vec<i64> = source.read(&steps, rows.clone())?.1;
    sound::consecutive(&source.path, &steps, rows.start, &step)?;
    let times = format!("{}/time", path::OBSERVABLES);
    let time = source.read(&times, rows.clone())?.1;
    sound::reals(&source.path, &times, rows.start, 1, &time)?;
    Ok(Some(Series { unit, shape, step, time, value }))
}

/// The type of the values at `place`, from their type in the file.
fn kind(source: &Source, place: &str) -> Result<ValueKind> {
    let found = source.dataset(place)?.dtype().and_then(|dtype| dtype.to_descriptor());
    let found = found.map_err(while_reading(&source.path, place))?;
    Ok(if found == RouteCode::type_descriptor() { ValueKind::Route } else { ValueKind::Real })
}
