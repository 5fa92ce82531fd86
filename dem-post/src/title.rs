//! Titles of the panels of maps: time, load and strain.

use dem_history::History;

use crate::output::{PostError, Result, number, short};
use crate::stress_strain;

/// A strain below this may be the solver's own, in rigid samples, and is not told.
const STRAIN: f64 = 1e-4;

/// The load and the strain of a run, for the titles of its frames.
pub struct Titles(Option<stress_strain::Report>);

impl Titles {
    /// Reads them, if the scene has a load wall.
    ///
    /// # Errors
    /// Those of reading the history.
    pub fn read(history: &History) -> Result<Self> {
        match stress_strain::read(history, None) {
            Ok(found) => Ok(Self(Some(found))),
            Err(PostError::Lacking { .. } | PostError::Usage(_)) => Ok(Self(None)),
            Err(error) => Err(error),
        }
    }

    /// `t = 0.244 s, F = 48.8 N, ε = 0.013 %`.
    pub fn of(&self, history: &History, frame: usize) -> String {
        let mut title = format!("t = {} s", number(history.times()[frame]));
        let Some(found) = &self.0 else { return title };
        let Ok(row) = found.step.binary_search(&history.steps()[frame]) else { return title };
        if let Some(load) = found.load.get(row) {
            title += &format!(", F = {} N", short(*load));
        }
        if let Some(strain) = found.strain.get(row).filter(|strain| strain.abs() >= STRAIN) {
            title += &format!(", ε = {} %", short(1e2 * strain));
        }
        title
    }
}
