//! Force and displacement of the load wall; axial stress and strain, from the walls and from the
//! particles.
//!
//! **The load wall** is the requested wall, else the scene's `load_wall`, else the wall of its
//! `stop.wall_travel`, else the only driven one.
//!
//! **Signs.** All quantities are positive along the load: the displacement of the wall in the sense
//! in which its force does work; compressive stress and shortening under a wall that pushes;
//! tensile stress and elongation under a wall that pulls. In the history stress is positive in
//! compression and strain is positive in elongation.
//!
//! **Size of the sample.** Height H along the drive and cross-section A perpendicular to it are
//! those of all grains at the first frame, A of the box around them; in 2D, A is the width times
//! the scene's `thickness`, and πR² inside a cylinder. Strain and stress of the particles are the
//! components e·E e and e·S e along the drive e, S over the volume H A. Only a plane that moves
//! along its normal has a section: for a round loader no stress or strain from the walls is
//! reported.
//!
//! **The load** is the prescribed force, or, where the motion is prescribed, the force of the wall
//! on the grains before any bond broke in the step (`wall_force_at_limit`; in histories without it
//! `wall_force`, the force after the breaks). Where some stages prescribe the one and some the
//! other, each step has its own (`wall_load`; without it that of the first stage holds for all).
//!
//! **Collapse load** (under an ever-growing force there is no peak): the load at the last step
//! before the strain fitted to the grains exceeds 1e-4; also reported at 1e-3. There is no collapse
//! load where no load acted in that step, or where elastic bonds reached that strain before any
//! broke. If rigid bonds join all grains to one piece and none has broken by then, the strain is
//! solver error and the load is meaningless: the tables note this, and the drawings omit the load.
//!
//! **Young's modulus and Poisson's ratio** of samples with elastic bonds: [`elastic`].

use clap::Args;
use dem_history::History;

use crate::analysis::Analysis;
use crate::options::{Files, LoadWall};
use crate::output::{Folder, Result};
pub use files::write;
pub use report::{Report, Summary, read};
pub(crate) use report::{driven, load_wall};

mod axes;
pub mod elastic;
mod files;
mod pictures;
mod report;
mod section;

/// Force–displacement and stress–strain curves, collapse load.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    load_wall: LoadWall,
}

impl Analysis for Command {
    const NAME: &'static str = "stress-strain";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.files.open()
    }

    fn read(&self, history: &History, _: bool) -> Result<Report> {
        read(history, self.load_wall.name())
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
