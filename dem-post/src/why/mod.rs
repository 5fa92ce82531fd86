//! One bond: whether it holds, and if not, how it broke: mode, local load and limits, what broke
//! before it; its utilisation over time.
//!
//! Definition of the utilisation: [`utilisation`].

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::{Files, LoadWall};
use crate::output::{Folder, Result};
pub use bond::Which;
pub use files::write;
pub use report::{Report, read};

mod bond;
mod files;
mod report;
mod rupture;
mod text;
pub mod utilisation;

/// What happened to one bond: how it broke, at which local load, after which others, and how near
/// it was to breaking in every frame.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    /// The number of a bond, as in 12, or its two grains, as in 3,17. Both are counted from 0;
    /// `dem-post cracks` lists the bonds that broke in ruptures.csv.
    #[arg(value_name = "BOND")]
    bond: Which,
    #[command(flatten)]
    load_wall: LoadWall,
}

impl Analysis for Command {
    const NAME: &'static str = "why";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, self.bond, self.load_wall.name(), quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        // the files of one bond do not replace those of another
        let bond = self.bond.find(history, &history.bonds()?)?;
        self.files.folder(history, &format!("{}-{bond}", Self::NAME))
    }

    fn write(&self, _: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(report, folder)
    }
}
