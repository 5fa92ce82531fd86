//! A run on one page: an HTML file that needs nothing else, with pictures, curves, tables, the solver's own measures of
//! its accuracy, the energy books and the scene.
//!
//! Curves are SVG, maps are PNG (a map of thousands of grains is far smaller so), all of them inside the page as `data:`
//! addresses. Long curves are thinned as all charts are. Sections that a scene has nothing for are left out.

use dem_run::history::History;
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
    /// Force and displacement; `None` without just one driven wall that was observed.
    #[serde(skip)]
    pub stress_strain: Option<stress_strain::Report>,
}

/// Reads all that the page tells; maps show the frames nearest to `times` (s), or chosen ones.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history, [`PostError::Lacking`] for a history without frames.
pub fn read(history: &History, times: &[f64], quiet: bool) -> Result<Report> {
    Ok(Report {
        // the first to say that a time is wrong or that there is no frame
        velocities: velocities::read(history, times)?,
        info: info::read(history)?,
        accuracy: solver::read(history)?,
        cracks: if_there(cracks::read(history, quiet))?,
        chains: if_there(chains::read(history, times))?,
        stress_strain: match stress_strain::read(history, None) {
            // several driven walls: which one is meant only a person can say
            Err(PostError::Usage(_)) => None,
            found => if_there(found)?,
        },
    })
}

/// What a scene lacks is left out.
fn if_there<T>(found: Result<T>) -> Result<Option<T>> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(PostError::Lacking { .. }) => Ok(None),
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
        facts(&[
            ("run", self.info.file.clone()),
            ("grains", self.info.grains.to_string()),
            ("bonds broken", broken),
            ("worst residual", percent(a.residual.map(|r| r.worst))),
            ("worst load error", percent(a.load_error.map(|r| r.worst))),
            ("steps whose residual missed it", missed),
        ])
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
