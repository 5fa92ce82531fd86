//! The sizes of a history: numbers of grains, bonds and frames, and the rows of the contacts of
//! each frame.

use dem_history::History;

use crate::output::{Result, progress};

/// The sizes of a history.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    pub dimension: usize,
    pub frames: usize,
    pub grains: usize,
    pub bonds: usize,
    /// Contacts in all frames.
    pub rows: usize,
    /// First row and number of the contacts of each frame, and how many of them are with walls.
    pub starts: Vec<i64>,
    pub counts: Vec<i64>,
    pub at_walls: Vec<i64>,
}

impl Outline {
    pub fn read(history: &History, quiet: bool) -> Result<Self> {
        let mut outline = Self {
            dimension: history.dimension(),
            frames: history.frames(),
            grains: history.grains()?.id.len(),
            bonds: history.bonds()?.len(),
            ..Self::default()
        };
        let bar = progress(history.frames() as u64, quiet, "{bar:24} {percent} % of the pairs read, {eta} left");
        for frame in 0..history.frames() {
            bar.inc(1);
            let rows = history.contact_rows(frame)?;
            let at_walls = history.contact_pairs(frame)?.iter().filter(|[_, j]| *j < 0).count();
            outline.starts.push(rows.start as i64);
            outline.counts.push(rows.len() as i64);
            outline.at_walls.push(at_walls as i64);
            outline.rows = outline.rows.max(rows.end);
        }
        bar.finish_and_clear();
        Ok(outline)
    }

    /// First row of each frame if all have `length` rows.
    pub fn every(&self, length: usize) -> Vec<i64> {
        (0..self.frames).map(|frame| (frame * length) as i64).collect()
    }
}
