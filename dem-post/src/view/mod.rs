//! Files through which viewers show a history.
//!
//! By default companions: ParaView and VTK read `grains.vtkhdf`, `contacts.vtkhdf` and
//! `bonds.vtkhdf`, MDAnalysis reads `grains.h5md`. They contain links and virtual datasets that
//! refer to the history by a relative path. Almost nothing is copied (`docs/history.md` lists the
//! copied data and their size). For viewers that cannot read them there are copies: `vtp.rs`,
//! `dump.rs`.

use clap::{Args, ValueEnum};
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::Files;
use crate::output::{Folder, Result};
pub use files::write;
pub use report::{Report, read};

mod companion;
mod dump;
mod files;
mod h5md;
mod outline;
pub mod report;
mod vtk;
mod vtp;

/// Write files through which ParaView, VTK, OVITO and MDAnalysis show the history.
///
/// By default small companions, almost without copies: grains, contacts and bonds over time as
/// grains.vtkhdf, contacts.vtkhdf and bonds.vtkhdf (ParaView 5.13, VTK 9.4, pyvista), positions as
/// grains.h5md (MDAnalysis). They refer to the history by a relative path: move them together. The
/// other formats copy the history, also of a run that goes on. docs/history.md shows how to use
/// them.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    /// Format of the files.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Format of the files for viewers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Companions in VTK's HDF5 format and in H5MD, which refer to the history.
    #[default]
    Vtkhdf,
    /// Copies in VTK's XML format, a file a frame and grains.pvd, contacts.pvd, bonds.pvd: for
    /// ParaView before 5.13. The default folder is FILE-vtp.
    Vtp,
    /// Copies as text dumps of LAMMPS, grains.dump, contacts.dump, bonds.dump: for OVITO.
    Lammps,
}

impl Format {
    /// The name by which a folder of results knows the files of this format: a call removes files
    /// of earlier calls of the same name.
    fn of_folder(self) -> &'static str {
        match self {
            Self::Vtkhdf => Command::NAME,
            Self::Vtp => "view vtp",
            Self::Lammps => "view lammps",
        }
    }
}

impl Analysis for Command {
    const NAME: &'static str = "view";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, self.format, quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.files.folder(history, self.format.of_folder())
    }

    fn write(&self, history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
        write(history, report, folder, quiet)
    }
}
