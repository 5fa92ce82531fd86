//! Force chains: the network of contact forces, the distribution of the forces, and the lines of
//! the most loaded grains.
//!
//! **Network.** A force here is the normal component r_n of a contact, positive in compression. ⟨f⟩
//! is the mean of |r_n| over the contacts that carry a force; the strong network is the contacts
//! with |r_n| > ⟨f⟩.
//!
//! **Chains** are lines of at least three grains, as defined in [`quasilinear`].

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::Moments;
use crate::output::{Folder, Result};
pub use files::write;
pub use report::{Report, read};

mod files;
pub mod pictures;
pub mod quasilinear;
pub mod report;
mod section;
pub mod stress;

/// Force network, distribution of its forces, force chains.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    moments: Moments,
}

impl Analysis for Command {
    const NAME: &'static str = "chains";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.moments.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        read(history, &self.moments.times)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.moments.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(history, report, folder)
    }
}
