//! What was checked in a history, and what is wrong with it.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::output::{PostError, Result, facts};

/// What was checked, and what is wrong.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The file.
    pub file: String,
    /// Number of frames.
    pub frames: usize,
    /// Datasets that were found as promised.
    pub datasets: usize,
    /// Numbers that were read.
    pub numbers: u64,
    /// What is wrong, at most ten of each place.
    pub violations: Vec<Violation>,
    /// What is wrong beyond that, by place.
    pub more: BTreeMap<String, usize>,
}

/// Something that should not be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Violation {
    /// The dataset, group or attribute.
    pub place: String,
    /// The row of it, counted from 0; for series and contacts over time, of the whole dataset.
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
                "{} is not sound: {count} violations of its layout. Copy it again, or run the scene again",
                self.file
            ))),
        }
    }
}
