//! Cracks: time, place and mode of the broken bonds; the cracks that they form, the growth of the
//! cracks, and the fragments of the sample.
//!
//! Definitions: of cracks, paths and fronts in 2D, [`paths`] and [`front`]; of cracks as surfaces
//! in 3D, [`surfaces`].

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::Moments;
use crate::output::{Folder, Result};
pub use files::write;
pub use modes::{Modes, mode_colour, mode_name};
pub use pictures::ColourBy;
pub use report::{Report, read};

mod files;
pub mod front;
mod longest;
pub mod modes;
pub mod parts;
pub mod paths;
pub mod pictures;
pub mod report;
mod section;
pub mod surfaces;
pub mod voids;

/// Ruptures, broken bonds over time, cracks and their fronts, fragments.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    moments: Moments,
    /// What the colours of the cracks show.
    #[arg(long, value_enum, default_value_t)]
    colour: ColourBy,
}

impl Analysis for Command {
    const NAME: &'static str = "cracks";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.moments.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.moments.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(history, report, &self.moments.times, self.colour, folder)
    }
}
