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
    /// Rows of a reaction and of a moment; 0 where the history has none.
    pub reaction_rows: usize,
    pub moment_rows: usize,
    /// Whether contacts have a tangent of their own.
    pub tangents: bool,
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
        let (layout, d) = (history.layout()?, outline.dimension);
        if !layout.without_reactions {
            outline.reaction_rows = if layout.friction { d } else { 1 };
            outline.moment_rows = match (outline.bonds, d) {
                (0, _) => 0,
                (_, 2) => 1,
                _ => 2 + usize::from(layout.twist),
            };
            outline.tangents = d == 3 && layout.friction;
        }
        Ok(outline)
    }

    /// First row of each frame if all have `length` rows.
    pub fn every(&self, length: usize) -> Vec<i64> {
        (0..self.frames).map(|frame| (frame * length) as i64).collect()
    }
}
