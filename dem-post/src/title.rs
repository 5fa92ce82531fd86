//! Titles of the panels of maps: time, load and strain.

use dem_history::History;

use crate::clock::Clock;
use crate::output::{PostError, Result, short};
use crate::stress_strain;

/// A strain below this may be the solver's own, in rigid samples, and is not told.
const STRAIN: f64 = 1e-4;

/// The load and the strain of a run, for the titles of its frames; empty without a load wall.
#[derive(Debug, Default)]
pub struct Titles {
    step: Vec<i64>,
    /// Load of the wall, N.
    load: Vec<f64>,
    strain: Vec<f64>,
}

impl Titles {
    /// Those of the scene's load wall, if there is one.
    ///
    /// # Errors
    /// Those of reading the history.
    pub fn read(history: &History) -> Result<Self> {
        match stress_strain::read(history, None) {
            Ok(found) => Ok(Self::with(&found)),
            Err(PostError::Lacking { .. } | PostError::Usage(_)) => Ok(Self::default()),
            Err(error) => Err(error),
        }
    }

    /// Those of a load that is read.
    pub fn with(load: &stress_strain::Report) -> Self {
        Self { step: load.step.clone(), load: load.load.clone(), strain: load.strain.clone() }
    }

    /// `t = 0.244 s, F = 48.8 N, ε = 0.013 %`, or `step 61, …` where the time counts steps.
    pub fn of(&self, history: &History, frame: usize) -> String {
        let mut title = Clock::of(history).at(history.times()[frame]);
        let Ok(row) = self.step.binary_search(&history.steps()[frame]) else { return title };
        if let Some(load) = self.load.get(row) {
            title += &format!(", F = {} N", short(*load));
        }
        if let Some(strain) = self.strain.get(row).filter(|strain| strain.abs() >= STRAIN) {
            title += &format!(", ε = {} %", short(1e2 * strain));
        }
        title
    }
}
