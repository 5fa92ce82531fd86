//! The report of a check of a history.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::output::{PostError, Result, facts};

/// The extent of the check, and the violations.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The file.
    pub file: String,
    /// Number of frames.
    pub frames: usize,
    /// Datasets that conform to the layout.
    pub datasets: usize,
    /// Numbers that were read.
    pub numbers: u64,
    /// The violations, at most ten per place.
    pub violations: Vec<Violation>,
    /// The number of further violations, by place.
    pub more: BTreeMap<String, usize>,
}

/// A violation of the layout.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Violation {
    /// The dataset, group or attribute.
    pub place: String,
    /// Its row, counted from 0; for series and contacts over time, the row of the whole dataset.
    pub row: Option<usize>,
    /// What is wrong.
    pub what: String,
}

impl Report {
    /// The number of violations.
    pub fn count(&self) -> usize {
        self.violations.len() + self.more.values().sum::<usize>()
    }

    /// The report as lines.
    pub fn table(&self) -> String {
        let sound = if self.count() == 0 { "yes".into() } else { format!("no, {} violations", self.count()) };
        let mut text = facts(&[
            ("file", self.file.clone()),
            ("checked", format!("{} datasets, {} frames, {} numbers", self.datasets, self.frames, self.numbers)),
            ("sound", sound),
        ]);
        for violation in &self.violations {
            let row = violation.row.map_or_else(String::new, |row| format!(" row {row}"));
            text += &format!("/{}{row}: {}\n", violation.place, violation.what);
        }
        for (place, count) in &self.more {
            text += &format!("/{place}: {count} more\n");
        }
        text
    }

    /// Whether the history is sound.
    ///
    /// # Errors
    /// [`PostError::Unsound`] if it is not.
    pub fn verdict(&self) -> Result<()> {
        match self.count() {
            0 => Ok(()),
            count => Err(PostError::Unsound(format!(
                "{} is damaged: {count} violations of its layout. Copy it again, or run the scene again",
                self.file
            ))),
        }
    }
}
