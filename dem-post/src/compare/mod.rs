//! The differences between two runs of one sample: scenes, frames, broken bonds, curves.
//!
//! * **Frames** are compared at equal times, or equal steps of two runs that load from break to
//!   break. The distance of two frames is the greatest distance between the two centres of a grain,
//!   relative to its radius. Frames differ if their distance exceeds the tolerance. The default
//!   tolerance is zero: equal then means equal in every bit.
//! * **Bonds** are identified by their two grains. Events are compared in order: the first
//!   difference is the first place at which bond or mode differ between the two lists.
//!
//! Grains are compared by number, so the two samples must have the same number of grains. Other
//! differences of the samples are allowed and reported.

use std::path::PathBuf;

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::results;
use crate::output::{Folder, Result, default_folder, source};
pub use files::write;
pub use report::{Report, read};

mod files;
pub mod report;

/// Compare two runs of one sample: first differences of scenes, frames, broken bonds and curves.
#[derive(Debug, Args)]
pub struct Command {
    /// The first history.
    #[arg(value_name = "A.h5")]
    a: PathBuf,
    /// The second history.
    #[arg(value_name = "B.h5")]
    b: PathBuf,
    /// Largest distance between the positions of a grain in the two runs, in radii, for frames to
    /// count as equal; 0: equal in every bit.
    #[arg(long, value_name = "RADII", default_value_t = 0.0)]
    tolerance: f64,
    /// Folder for the results, created if missing [default: A-compare].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Overwrite a results folder of other histories: their results are removed.
    #[arg(long)]
    force: bool,
}

impl Analysis for Command {
    const NAME: &'static str = "compare";
    type Input = [History; 2];
    type Report = Report;

    fn open(&self) -> Result<Self::Input> {
        Ok([History::open(&self.a)?, History::open(&self.b)?])
    }

    fn read(&self, [a, b]: &Self::Input, _: bool) -> Result<Report> {
        read(a, b, self.tolerance)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, [a, b]: &Self::Input) -> Result<Option<Folder>> {
        let path = self.output.clone().unwrap_or_else(|| default_folder(&self.a, "-compare"));
        Ok(Some(results(path, Self::NAME, vec![source(a)?, source(b)?], self.force)?))
    }

    fn write(&self, [a, _]: &Self::Input, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(a, report, folder)
    }
}
