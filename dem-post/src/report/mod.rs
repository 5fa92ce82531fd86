//! A run, or a [`sweep`], on one page: a self-contained HTML file. That of a run begins with the
//! result in a sentence, three moments and a slider over the run; then pictures, curves, tables,
//! the energy balance, the solver's own measures of its accuracy, and the scene.
//!
//! Without scripts the page shows all but the slider and the values of the curves.
//!
//! Curves are SVG; maps are SVG or, of thousands of grains, PNG, whichever is smaller; all of them
//! are inside the page as `data:` addresses. Long curves are thinned, as in all charts. A section
//! without content gives the reason.

use std::path::{Path, PathBuf};

use clap::Args;
use dem_history::History;
use dem_output::command_line::seconds;
use serde::Serialize;

use crate::analysis::Analysis;
use crate::options::{Files, LoadWall};
use crate::output::{Folder, PostError, Result, facts, number};
use crate::section::{Maps, OnPage, Section};
use crate::strength::{self, Measure};
use crate::title::Titles;
use crate::{chains, cracks, emission, fabric, info, stress_strain, velocities};

pub mod limit;
mod page;
mod player;
mod result;
mod sections;
pub mod solver;
pub mod sweep;

use limit::LimitLoad;
use page::Page;
use solver::Accuracy;
use sweep::Sweep;

/// Report of a run, or of a whole sweep, as one self-contained HTML page: pictures, curves, tables,
/// accuracy, scene.
#[derive(Debug, Args)]
pub struct Command {
    /// The history of a run, or the folder of a sweep.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Folder for the page, created if missing [default: RUN-post, of a sweep RUN-report, in the
    /// current folder].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Overwrite a results folder of another history: its results are removed.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    load_wall: LoadWall,
    /// Of a run, times of the maps (s), or steps of a run from break to break, as in 0.1,0.15
    /// [default: first break, collapse or peak, end].
    #[arg(long, value_name = "T,…", value_delimiter = ',', value_parser = seconds)]
    times: Vec<f64>,
    /// Of a run, the limit load of its scene: a file with what `dem-run limit SCENE --json` prints.
    #[arg(long, value_name = "FILE.json")]
    limit: Option<PathBuf>,
    /// Of a sweep, the field of the strength, as --set names it [default: the one that differs].
    #[arg(long, value_name = "FIELD")]
    against: Option<String>,
    /// Of a sweep, the definition of the strength: the load at … [default: broken]
    #[arg(long, value_enum)]
    measure: Option<Measure>,
}

/// What the page is about.
pub enum Input {
    /// A run.
    Run(Box<History>),
    /// A sweep.
    Sweep(Box<Sweep>),
}

/// The content of a page.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Found {
    /// Of a run.
    Run(Box<Report>),
    /// Of a sweep.
    Sweep(Box<sweep::Report>),
}

impl Analysis for Command {
    const NAME: &'static str = "report";
    type Input = Input;
    type Report = Found;

    fn open(&self) -> Result<Input> {
        if self.run.is_dir() {
            if !self.times.is_empty() || self.limit.is_some() {
                let option = if self.limit.is_some() { "--limit" } else { "--times" };
                return Err(PostError::Usage(format!("{option} is of the page of one run: give its history")));
            }
            return Ok(Input::Sweep(Box::new(Sweep::open(&self.run)?)));
        }
        if self.against.is_some() || self.measure.is_some() {
            let option = if self.against.is_some() { "--against" } else { "--measure" };
            return Err(PostError::Usage(format!("{option} is of the page of a sweep: give the folder of one")));
        }
        Ok(Input::Run(Box::new(History::open(&self.run)?)))
    }

    fn read(&self, input: &Input, quiet: bool) -> Result<Found> {
        let wall = self.load_wall.name();
        Ok(match input {
            Input::Run(history) => {
                Found::Run(Box::new(read(history, &self.times, wall, self.limit.as_deref(), quiet)?))
            }
            Input::Sweep(sweep) => {
                let strength = strength::Options {
                    against: self.against.clone(),
                    measure: self.measure.unwrap_or_default(),
                    wall: wall.map(String::from),
                };
                Found::Sweep(Box::new(sweep::read(sweep, &sweep::Options { strength, quiet })?))
            }
        })
    }

    fn table(report: &Found) -> String {
        match report {
            Found::Run(report) => report.table(),
            Found::Sweep(report) => report.table(),
        }
    }

    fn folder(&self, input: &Input) -> Result<Option<Folder>> {
        match input {
            Input::Run(history) => {
                let files = Files { history: self.run.clone(), output: self.output.clone(), force: self.force };
                files.folder(history, Self::NAME)
            }
            Input::Sweep(sweep) => sweep.folder(self.output.as_deref(), self.force).map(Some),
        }
    }

    fn write(&self, input: &Input, report: &mut Found, folder: &mut Folder, _: bool) -> Result<()> {
        match (input, report) {
            (Input::Run(history), Found::Run(report)) => write(history, report, folder),
            (Input::Sweep(sweep), Found::Sweep(report)) => sweep::write(sweep, report, folder),
            // a report is read from its own input
            _ => Ok(()),
        }
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
    /// The limit load of its load wall, if it was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit_load: Option<LimitLoad>,
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
/// load is that of `wall`, or of the scene's load wall; its limit load that in the file `limit`.
///
/// # Errors
/// [`PostError::Usage`] for times outside the history, for a wall that is not driven, and where
/// several walls are driven and none is chosen, and those of [`limit::read`];
/// [`PostError::Lacking`] for a history without frames.
pub fn read(history: &History, times: &[f64], wall: Option<&str>, limit: Option<&Path>, quiet: bool) -> Result<Report> {
    // called first: it reports wrong times and a history without frames
    let velocities = velocities::read(history, times)?;
    let mut left_out = vec![];
    // called before the slow analysis of cracks: they report a wrong wall and a wrong limit load
    let stress_strain = if_there(stress_strain::read(history, wall), &mut left_out)?;
    let limit_load = limit.map(|file| match &stress_strain {
        Some(load) => limit::read(file, history, &load.summary.wall),
        None => Err(PostError::Usage("--limit: the run has no load wall to compare the limit load with".into())),
    });
    Ok(Report {
        velocities,
        info: info::read(history)?,
        accuracy: solver::read(history)?,
        stress_strain,
        limit_load: limit_load.transpose()?,
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
            limit: self.limit_load.as_ref(),
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
    let scene = history.parameters()?.scene;
    let tree: serde_json::Value = serde_json::from_str(&scene).unwrap_or_default();
    let name = history.path().file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let title = tree["title"].as_str().map_or_else(|| name.clone(), |title| format!("{name}: {title}"));
    let sections = report.sections(history)?;
    let (scene, step) = (page::pretty(&scene), report.info.clock.step());
    let page = Page { title, sections, step, scene, scene_of: "As it was run.".into() };
    Ok(folder.write("report.html", page.render()?.as_bytes())?)
}
