//! Companions of a history: small files that map its data for viewers.
//!
//! ParaView and VTK read `grains.vtkhdf`, `contacts.vtkhdf` and `bonds.vtkhdf`, MDAnalysis reads
//! `grains.h5md`. They contain links and virtual datasets that refer to the history by a relative
//! path. Almost nothing is copied (`docs/history.md` lists the copied data and their size).

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::Files;
use crate::output::{Folder, Result};
pub use files::write;
pub use report::{Report, read};

mod companion;
mod files;
mod h5md;
mod outline;
pub mod report;
mod vtk;

/// Write small files through which ParaView, VTK and MDAnalysis read the history, almost without
/// copies.
///
/// Grains, contacts and bonds over time as grains.vtkhdf, contacts.vtkhdf and bonds.vtkhdf
/// (ParaView 5.13, VTK or pyvista), positions as grains.h5md (MDAnalysis). They refer to the
/// history by a relative path: move them together. docs/history.md shows how to use them.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
}

impl Analysis for Command {
    const NAME: &'static str = "view";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.files.folder(history, Self::NAME)
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
        write(history, report, folder, quiet)
    }
}
