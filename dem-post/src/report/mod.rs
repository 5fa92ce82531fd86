//! A run on one page: a self-contained HTML file that begins with the result in a sentence, three
//! moments and a slider over the run; then pictures, curves, tables, the energy balance, the
//! solver's own measures of its accuracy, and the scene.
//!
//! Without scripts the page shows all but the slider and the values of the curves.
//!
//! Curves are SVG; maps are SVG or, of thousands of grains, PNG, whichever is smaller; all of them
//! are inside the page as `data:` addresses. Long curves are thinned, as in all charts. A section
//! without content gives the reason.

use clap::Args;
use dem_history::History;
use serde::Serialize;

use crate::analysis::Analysis;
use crate::options::{LoadWall, Moments};
use crate::output::{Folder, PostError, Result, facts, number};
use crate::section::{Maps, OnPage, Section};
use crate::title::Titles;
use crate::{chains, cracks, emission, fabric, info, stress_strain, velocities};

mod page;
mod player;
mod result;
mod sections;
pub mod solver;

use solver::Accuracy;

/// Report of the run as one self-contained HTML page: pictures, curves, tables, accuracy, energy,
/// scene.
#[derive(Debug, Args)]
pub struct Command {
    #[command(flatten)]
    moments: Moments,
    #[command(flatten)]
    load_wall: LoadWall,
}

impl Analysis for Command {
    const NAME: &'static str = "report";
    type Input = History;
    type Report = Report;

    fn open(&self) -> Result<History> {
        self.moments.files.open()
    }

    fn read(&self, history: &History, quiet: bool) -> Result<Report> {
        read(history, &self.moments.times, self.load_wall.name(), quiet)
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

/// Content of the page.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The summary of the history.
    pub info: info::Report,
    /// The accuracy of the solver, from the observables of the run.
    pub accuracy: Accuracy,
    /// The bonds that broke; `None` for a scene without bonds.
    pub cracks: Option<cracks::Report>,
    /// The forces; `None` where no contact carries a force at the chosen moments.
    pub chains: Option<chains::Report>,
    /// The velocities.
    pub velocities: velocities::Report,
    /// Acoustic emission; `None` where no bond broke.
    #[serde(skip)]
    pub emission: Option<emission::Report>,
    /// The sample as a continuum; `None` where grains never touched.
    #[serde(skip)]
    pub fabric: Option<fabric::Report>,
    /// Times of the maps asked for (s); none where they are chosen.
    #[serde(skip)]
    times: Vec<f64>,
    /// Force and displacement of the load wall; `None` without a driven wall that was observed.
    #[serde(skip)]
    pub stress_strain: Option<stress_strain::Report>,
    /// The sections without content.
    pub left_out: Vec<EmptySection>,
}

/// A section without content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EmptySection {
    /// Its [`OnPage::ID`].
    pub section: &'static str,
    /// The reason.
    pub why: String,
}

/// Reads the content of the page. Maps show the frames nearest to `times` (s), or chosen ones; the
/// load is that of `wall`, or of the scene's load wall.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history, for a wall that is not driven, and where
/// several walls are driven and none is chosen; [`PostError::Lacking`] for a history without
/// frames.
pub fn read(history: &History, times: &[f64], wall: Option<&str>, quiet: bool) -> Result<Report> {
    // called first: it reports wrong times and a history without frames
    let velocities = velocities::read(history, times)?;
    let mut left_out = vec![];
    Ok(Report {
        velocities,
        info: info::read(history)?,
        accuracy: solver::read(history)?,
        // called before the slow analysis of cracks: it reports a wrong wall
        stress_strain: if_there(stress_strain::read(history, wall), &mut left_out)?,
        cracks: if_there(cracks::read(history, quiet), &mut left_out)?,
        chains: if_there(chains::read(history, times), &mut left_out)?,
        emission: emission(history, wall)?,
        fabric: Some(fabric::read(history, times, quiet)?).filter(|fabric| fabric.touched()),
        times: times.to_vec(),
        left_out,
    })
}

/// The events, where a bond broke.
fn emission(history: &History, wall: Option<&str>) -> Result<Option<emission::Report>> {
    if history.ruptures()?.is_empty() {
        return Ok(None);
    }
    let options = emission::Options { wall: wall.map(String::from), ..emission::Options::default() };
    match emission::read(history, &options) {
        // no load of the wall asked for; the section on the load gives the reason
        Err(PostError::Lacking { .. }) => Ok(None),
        found => found.map(Some),
    }
}

/// `None` for an analysis whose data the scene lacks; the reason is added to `left_out`.
fn if_there<R: OnPage>(found: Result<R>, left_out: &mut Vec<EmptySection>) -> Result<Option<R>> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(PostError::Lacking { what, .. }) => {
            left_out.push(EmptySection { section: R::ID, why: what });
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

impl Report {
    /// The sections of the page, in order.
    fn sections(&self, history: &History) -> Result<Vec<Section>> {
        let maps = Maps {
            frames: self.velocities.fields.iter().map(|field| field.frame).collect(),
            titles: self.stress_strain.as_ref().map_or_else(Titles::default, Titles::with),
        };
        let parts = result::Parts {
            info: &self.info,
            load: self.stress_strain.as_ref(),
            cracks: self.cracks.as_ref(),
            times: &self.times,
            titles: &maps.titles,
        };
        let mut sections = vec![
            result::section(history, &parts)?,
            self.section_of(self.stress_strain.as_ref(), history, &maps)?,
            self.section_of(self.cracks.as_ref(), history, &maps)?,
        ];
        if let Some(emission) = &self.emission {
            sections.push(emission.section(history, &maps)?);
        }
        sections.push(self.section_of(self.chains.as_ref(), history, &maps)?);
        sections.push(self.velocities.section(history, &maps)?);
        if let Some(fabric) = &self.fabric {
            sections.push(fabric.section(history, &maps)?);
        }
        sections.push(sections::energy(history)?);
        sections.push(self.accuracy.section(history, &maps)?);
        sections.push(self.info.section(history, &maps)?);
        Ok(sections)
    }

    /// The section of an analysis, or the reason why it has none.
    fn section_of<R: OnPage>(&self, found: Option<&R>, history: &History, maps: &Maps) -> Result<Section> {
        if let Some(found) = found {
            return found.section(history, maps);
        }
        let why = self.left_out.iter().find(|out| out.section == R::ID);
        let text = why.map_or_else(String::new, |out| format!("None: {}.", out.why));
        Ok(Section { text, ..Section::of::<R>() })
    }

    /// The page in a few lines.
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
            ("steps whose residual missed the tolerance", missed),
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
    let page = page::render(history, report.sections(history)?)?;
    Ok(folder.write("report.html", page.as_bytes())?)
}
