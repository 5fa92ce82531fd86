//! Acoustic emission: broken bonds clustered to events, their magnitudes, and the b-value.
//!
//! Definitions: of events, [`events`]; of the b-value, [`frequency`].
//!
//! **Magnitude** of an event, by [`Scale`]:
//!
//! * `energy`: ⅔ log₁₀(E / 1 J), with the elastic energy E that its bonds held when they broke. The
//!   factor ⅔ is that of Gutenberg and Richter (1956); its additive constant is left out, and the
//!   b-value does not depend on it. What a bond held is the upper bound of what it radiates;
//! * `size`: log₁₀ n, with the number n of its bonds. Rigid bonds hold no energy: their events have
//!   no other magnitude.

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::{Files, LoadWall};
use crate::output::{Folder, Result};
use events::Rule;
pub use files::write;
pub use report::{Options, Report, Scale, read};

pub mod events;
mod files;
pub mod frequency;
mod pictures;
pub mod report;
mod section;

/// Acoustic emission: broken bonds clustered to events, their magnitudes, b-value.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    /// Ruptures at most this many steps apart can be linked to one event [default: 1; of
    /// `rupture: next_event` those that break under a load that no longer grows].
    #[arg(long, value_name = "N")]
    steps: Option<u32>,
    /// Ruptures at most this many bonds apart can be linked: 0 if they share a grain.
    #[arg(long, value_name = "N", default_value_t = Options::default().rule.reach)]
    reach: u32,
    /// Magnitude of an event [default: energy, of rigid bonds size].
    #[arg(long, value_enum)]
    magnitude: Option<Scale>,
    /// Width of the bins of magnitudes of energy.
    #[arg(long, value_name = "WIDTH", default_value_t = Options::default().bin)]
    bin: f64,
    /// Magnitude from which the b-value is estimated [default: that of the most events].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    completeness: Option<f64>,
    #[command(flatten)]
    load_wall: LoadWall,
}

impl Analysis for Command {
    const NAME: &'static str = "emission";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        let options = Options {
            rule: Rule { steps: self.steps, reach: self.reach },
            scale: self.magnitude,
            bin: self.bin,
            completeness: self.completeness,
            wall: self.load_wall.name().map(String::from),
        };
        read(history, &options)
    }

    fn table(report: &Report) -> String {
        report.table()
    }

    fn folder(&self, history: &History) -> Result<Option<Folder>> {
        self.files.folder(history, Self::NAME)
    }

    fn write(&self, _: &History, report: &mut Report, folder: &mut Folder, _: bool) -> Result<()> {
        write(report, folder)
    }
}
