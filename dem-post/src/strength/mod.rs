//! Strength against a field of the scene, over many runs: the paper's figure 9 (strength against
//! cohesion), and the same for rates, sizes, friction.
//!
//! **Strength** of a run is the load at the step chosen by [`Measure`], with the definitions of the
//! run's own summary and of `stress-strain`. The load is that of the load wall or, without a driven
//! wall, the only force on a grain. The default measure is 5 % of the bonds broken. It is an event
//! of the bonds, so it has the same meaning for rigid and elastic bonds, under a prescribed force
//! and a prescribed motion. The other measures are less general: a strain of 1e-4 may be solver
//! error where the tolerance is coarse, and intact elastic bonds can reach it; the first break is
//! one weak bond; a peak requires a load that can fall.
//!
//! **Samples.** Runs are grouped by the value of the varied field and by sample ([`scenes`] says
//! how both are found). Runs of one sample are not independent: they have the same grains. The
//! standard errors of the line through all points assume independent runs. Therefore each sample
//! also has its own line, and the intervals over the samples are those of the mean of their slopes
//! and intercepts.

use clap::Args;

use crate::analysis::Analysis;
use crate::options::{LoadWall, Runs};
use crate::output::{Folder, Result};
pub(crate) use files::chart;
pub use files::write;
pub use report::{Options, Report, read};
pub use runs::Measure;

mod files;
pub mod fit;
pub mod left_out;
pub mod report;
pub mod runs;
pub mod scenes;

/// Strength as a function of a field of the scene over many runs, such as cohesion: fitted line,
/// its errors, scatter of samples.
///
/// The exit code is 1 if runs were left out because they did not fail or are not done.
#[derive(Debug, Args)]
pub struct Command {
    /// The varied field, as --set names it [default: the one that differs].
    #[arg(long, value_name = "FIELD")]
    against: Option<String>,
    /// Definition of the strength: the load at …
    #[arg(long, value_enum, default_value_t)]
    measure: Measure,
    #[command(flatten)]
    load_wall: LoadWall,
    #[command(flatten)]
    runs: Runs,
}

impl Analysis for Command {
    const NAME: &'static str = "strength";
    /// Runs are opened one by one, when they are read.
    type Input = ();
    type Report = Report;

    fn open(&self) -> Result<()> {
        Ok(())
    }

    fn read(&self, (): &(), _: bool) -> Result<Report> {
        let options = Options {
            against: self.against.clone(),
            measure: self.measure,
            wall: self.load_wall.name().map(String::from),
        };
        read(&self.runs.runs, &options)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, (): &()) -> Result<Option<Folder>> {
        self.runs.folder(Self::NAME)
    }

    fn write(&self, (): &(), report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(report, folder)
    }

    fn verdict(report: &Report) -> Result<()> {
        report.complete()
    }
}
