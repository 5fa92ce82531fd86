//! A run on one page: an HTML file that needs nothing else, with pictures, curves, tables, the solver's own measures of
//! its accuracy, the energy books and the scene.
//!
//! Curves are SVG, maps are PNG (a map of thousands of grains is far smaller so), all of them
//! inside the page as `data:` addresses. Long curves are thinned as all charts are. A section that
//! a scene has nothing for says why.

use dem_history::History;
use serde::Serialize;

use crate::output::{Folder, PostError, Result, facts, number};
use crate::{chains, cracks, info, stress_strain, velocities};

mod page;
mod sections;
pub mod solver;

use solver::Accuracy;

/// What the page tells.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// What the history holds.
    pub info: info::Report,
    /// How accurately the run was solved, by its own measures.
    pub accuracy: Accuracy,
    /// The bonds that broke; `None` for a scene without bonds.
    pub cracks: Option<cracks::Report>,
    /// The forces; `None` where there is none at the chosen moments.
    pub chains: Option<chains::Report>,
    /// The velocities.
    pub velocities: velocities::Report,
    /// Force and displacement of the load wall; `None` without a driven wall that was observed.
    #[serde(skip)]
    pub stress_strain: Option<stress_strain::Report>,
    /// The sections that have nothing to show.
    pub left_out: Vec<LeftOut>,
}

/// A section that has nothing to show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// What it is about.
    pub section: &'static str,
    /// Why there is nothing.
    pub why: String,
}

/// Reads all that the page tells; maps show the frames nearest to `times` (s), or chosen ones, and
/// the load is that of `wall`, or of the scene's load wall.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history, for a wall that is not driven, and where
/// several walls are driven and none is chosen; [`PostError::Lacking`] for a history without
/// frames.
pub fn read(history: &History, times: &[f64], wall: Option<&str>, quiet: bool) -> Result<Report> {
    // the first to say that a time is wrong or that there is no frame
    let velocities = velocities::read(history, times)?;
    let mut left_out = vec![];
    Ok(Report {
        velocities,
        info: info::read(history)?,
        accuracy: solver::read(history)?,
        // the first to say that a wall is wrong: cracks take their time
        stress_strain: if_there("load", stress_strain::read(history, wall), &mut left_out)?,
        cracks: if_there("cracks", cracks::read(history, quiet), &mut left_out)?,
        chains: if_there("chains", chains::read(history, times), &mut left_out)?,
        left_out,
    })
}

/// What a scene lacks, it has no section of: the reason stands in its place.
fn if_there<T>(section: &'static str, found: Result<T>, left_out: &mut Vec<LeftOut>) -> Result<Option<T>> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(PostError::Lacking { what, .. }) => {
            left_out.push(LeftOut { section, why: what });
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

impl Report {
    /// What stands on the page, in a few lines.
    pub fn table(&self) -> String {
        let a = &self.accuracy;
        let broken = self.cracks.as_ref().map_or_else(
            || "no bonds".into(),
            |c| {
                let cracks = c.cracks.len() + c.surfaces.len();
                format!("{} of {}, {cracks} crack{}", c.broken.total(), c.bonds, if cracks == 1 { "" } else { "s" })
            },
        );
        let percent = |value: Option<f64>| value.map_or_else(|| "–".into(), number);
        let missed = a.missed.map_or_else(|| "–".into(), |n| n.to_string());
        let mut lines = vec![
            ("run", self.info.file.clone()),
            ("grains", self.info.grains.to_string()),
            ("bonds broken", broken),
            ("worst residual", percent(a.residual.map(|r| r.worst))),
            ("worst load error", percent(a.load_error.map(|r| r.worst))),
            ("worst false acceleration", percent(a.false_acceleration.map(|r| r.worst))),
            ("steps whose residual missed it", missed),
        ];
        lines.extend(self.left_out.iter().map(|out| ("left out", format!("{}: {}", out.section, out.why))));
        facts(&lines)
    }
}

/// Writes `report.html`.
///
/// # Errors
/// [`PostError::Write`], and those of reading the history.
pub fn write(history: &History, report: &Report, folder: &mut Folder) -> Result<()> {
    let page = page::render(history, report)?;
    Ok(folder.write("report.html", page.as_bytes())?)
}
