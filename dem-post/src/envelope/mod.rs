//! The failure envelope: Mohr circles of several runs at failure, and the line of Mohr and Coulomb
//! that touches them.
//!
//! **Failure** is that of `strength`, with its measures.
//!
//! **Stress** is the Love–Weber tensor of the history, over the box around the sample at time zero,
//! positive in compression: that of the step of failure or, if bonds broke in that step, of the
//! step before, since the history has the stress at the end of a step. Its principal values make
//! the circle. The **confinement** is the least of them, whatever applies it: between smooth walls
//! it is the pressure of the side walls, between rough ones it lacks their shear.
//!
//! **The line** is τ = c + σ tan φ. Circles that touch it have σ₁ = N σ₃ + σ_c with N = (1 + sin
//! φ)/ (1 − sin φ) and σ_c = 2 c √N: N and σ_c are those of the least-squares line through the
//! principal stresses ([`crate::strength::fit`]), and
//!
//! ```text
//! φ = 2 arctan √N − 90°           dφ/dN = 1/((1 + N) √N)
//! c = σ_c/(2 √N)                  dc = dσ_c/(2 √N) − σ_c dN/(4 N √N)
//! ```
//!
//! The errors of N and σ_c, and their covariance −σ̄₃ s_N², propagate to φ and c by these
//! derivatives.

use clap::Args;

use crate::analysis::Analysis;
use crate::options::{LoadWall, Runs};
use crate::output::{Folder, Result};
use crate::strength::Measure;
pub(crate) use files::charts;
pub use files::write;
pub use report::{Report, read};

mod files;
pub mod mohr;
pub mod report;

/// Failure envelope: Mohr circles at failure of runs at several confinements, cohesion and friction
/// angle.
///
/// The exit code is 1 if runs were left out because they did not fail or are not done.
#[derive(Debug, Args)]
pub struct Command {
    /// Definition of failure.
    #[arg(long, value_enum, default_value_t)]
    measure: Measure,
    #[command(flatten)]
    load_wall: LoadWall,
    #[command(flatten)]
    runs: Runs,
}

impl Analysis for Command {
    const NAME: &'static str = "envelope";
    /// Runs are opened one by one, when they are read.
    type Input = ();
    type Report = Report;

    fn open(&self) -> Result<()> {
        Ok(())
    }

    fn read(&self, (): &(), _: bool) -> Result<Report> {
        read(&self.runs.runs, self.measure, self.load_wall.name())
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
