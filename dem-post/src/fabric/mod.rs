//! The sample as a continuum, frame by frame: stress, strain, porosity, coordination, fabric, crack
//! density.
//!
//! * **Stress** is the Love–Weber tensor of the history, positive in compression, over the box
//!   around the sample at time zero; p and q are those of [`crate::tensor::mean_and_deviator`].
//! * **Volumetric strain** is the trace of the strain fitted to the grains, positive where the
//!   sample dilates.
//! * **Porosity** is that of a disk (2D) or a sphere (3D) in the middle of the sample, fixed in
//!   space: its diameter is 80 % of the least extent of the box around all grains at the first
//!   frame. The box itself would count the voids beside the outermost grains.
//! * **Contacts** are those between grains that carry a force or are bonded; the **coordination**
//!   is 2 Nc/N.
//! * Tensors of [`tensors`]: fabric and crack density, the latter with the box of the stress as its
//!   volume.

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::Moments;
use crate::output::{Folder, Result};
pub use files::write;
pub use report::{Report, read};

mod files;
mod pictures;
pub mod region;
pub mod report;
mod section;
pub mod tensors;

/// Stress tensor, p and q, volumetric strain, porosity, coordination, fabric and crack density over
/// time.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    moments: Moments,
}

impl Analysis for Command {
    const NAME: &'static str = "fabric";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.moments.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, &self.moments.times, quiet)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.moments.files.folder(history, Self::NAME)
    }

    fn write(&self, _: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(report, folder)
    }
}
