//! Force and displacement of the driven wall; axial stress and strain, from the walls and from the particles.
//!
//! **Signs.** Everything counts positive along the load: the displacement of the wall in the sense in which its force
//! does work, compressive stress and shortening under a wall that pushes, tensile stress and elongation under one that
//! pulls. The history has stress positive in compression and strain positive in elongation.
//!
//! **Size of the sample.** Height H along the drive and cross-section A across it are those of the box around all
//! grains at the first frame; in 2D, A is the width times the scene's `thickness`.
//!
//! The applied force is the prescribed one, or, where the motion is prescribed, what it takes against the grains.
//!
//! **Collapse load** (under an ever-growing force there is no peak): the applied force at the last step before the
//! strain fitted to the grains exceeds 1e-4; also reported at 1e-3. Of rigid bonds none of which has broken by then the
//! strain is the solver's, and the load says nothing: the tables say so, and the drawings leave it out.

use std::path::Path;

use dem_run::history::{History, Series, Wall, WallDrive};
use serde::Serialize;

use crate::chains::stress::thickness;
use crate::collapse::{is_elastic, last_step_below, peak, whole_at, work};
use crate::output::{Folder, PostError, Result, cell, facts, quantity, short};
use crate::plot::{Chart, Style, colour};

/// Strains that define the collapse.
const COLLAPSE: [f64; 2] = [1e-4, 1e-3];
/// Share of broken bonds whose load is reported.
const BROKEN: f64 = 0.05;
/// Least strain that the logarithmic axis shows.
const LEAST_STRAIN: f64 = 1e-9;

/// The numbers that the analysis ends with. `None`: it did not happen, or was not recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// The driven wall.
    pub wall: String,
    /// Applied force at the first break, N.
    pub first_break: Option<f64>,
    /// Height of the sample along the drive, m.
    pub height: f64,
    /// Cross-section of the sample, m².
    pub area: f64,
    /// Applied force before the fitted strain exceeds 1e-4, N.
    pub collapse_load: Option<f64>,
    /// Time of that step, s.
    pub collapse_time: Option<f64>,
    /// Applied force before the fitted strain exceeds 1e-3, N.
    pub collapse_load_1e3: Option<f64>,
    /// Whether no bond had broken by each of the two, so that the strain is the solver's own.
    pub collapse_early: [bool; 2],
    /// Applied force when 5 % of the bonds have broken, N.
    pub load_at_5_percent_broken: Option<f64>,
    /// Greatest applied force where the load falls afterwards, N.
    pub peak_load: Option<f64>,
    /// Strain fitted to the grains at the peak.
    pub peak_strain: Option<f64>,
    /// Greatest applied force, N.
    pub greatest_load: f64,
    /// Displacement of the wall at the end, m.
    pub final_displacement: f64,
    /// Strain fitted to the grains at the end.
    pub final_strain: Option<f64>,
    /// Work that the applied force has done, J.
    pub work: f64,
    /// Bonds broken at the end.
    pub bonds_broken: Option<f64>,
    /// Mean cohesion of the bonds, N.
    pub cohesion: Option<f64>,
    /// Collapse load over cohesion; none where it is the solver's own.
    pub collapse_over_cohesion: Option<f64>,
    /// Greatest residual that was accepted.
    pub worst_residual: Option<f64>,
}

/// The curves, one entry per observed step, and what follows from them.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Steps.
    pub step: Vec<i64>,
    /// Times, s.
    pub time: Vec<f64>,
    /// Displacement of the wall, m.
    pub displacement: Vec<f64>,
    /// Applied force, N.
    pub load: Vec<f64>,
    /// Reaction of the grains on the wall, N; empty if not recorded.
    pub reaction: Vec<f64>,
    /// Axial strain fitted to the grains; empty if not recorded.
    pub strain: Vec<f64>,
    /// Axial stress of the contacts after Love and Weber, Pa; empty if not recorded.
    pub stress: Vec<f64>,
    /// Bonds broken; empty if not recorded.
    pub broken: Vec<f64>,
    /// What follows.
    pub summary: Summary,
}

/// Reads the curves of the wall `wall`, or of the only driven one.
///
/// # Errors
/// [`PostError::Lacking`] for a scene without a driven wall or without its force and place at every step;
/// [`PostError::Usage`] for a wall that is none.
pub fn read(history: &History, wall: Option<&str>) -> Result<Report> {
    let walls = history.walls()?;
    let k = driven(history.path(), &walls, wall)?;
    let direction = walls[k].direction;
    let size = |&d: &usize| direction[d].abs();
    let axis = (0..history.dimension()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    let motion = motion(history, &walls[k], k)?;
    let tensor = |name: &str| -> Result<Vec<f64>> {
        let series = history.observable(name)?;
        series.map_or_else(|| Ok(vec![]), |series| component(history, &series, &[axis, axis], name))
    };
    let (sample, push) = sample_size(history, k, axis, motion.sense * direction[axis])?;
    let mut report = Report {
        displacement: motion.way.iter().map(|x| motion.sense * x).collect(),
        load: motion.load.iter().map(|f| motion.sense * f).collect(),
        // the grains push back
        reaction: motion.reaction.iter().map(|f| -motion.sense * f).collect(),
        strain: tensor("strain")?.iter().map(|e| -push * e).collect(),
        stress: tensor("stress")?.iter().map(|s| push * s).collect(),
        broken: history.observable("bonds_broken")?.map(|series| series.value).unwrap_or_default(),
        summary: Summary { wall: walls[k].name.clone(), height: sample[0], area: sample[1], ..Summary::default() },
        step: motion.step,
        time: motion.time,
    };
    let elastic = is_elastic(&history.parameters()?.scene);
    report.summarise(&history.bonds()?.strength, elastic, history.observable("solver_residual")?);
    Ok(report)
}

/// What the driven wall does, along its direction and with the signs of that direction.
struct Motion {
    step: Vec<i64>,
    time: Vec<f64>,
    /// Displacement since the first frame, m.
    way: Vec<f64>,
    /// Force of the grains on the wall, N; empty if not recorded.
    reaction: Vec<f64>,
    /// Force on the wall from outside, N.
    load: Vec<f64>,
    /// The sign that makes the load positive.
    sense: f64,
}

fn motion(history: &History, wall: &Wall, k: usize) -> Result<Motion> {
    let direction = &wall.direction;
    let position = required(history, "wall_position")?;
    let start = start_of(history, k, direction)?;
    let way: Vec<f64> = along(history, &position, k, direction, "wall_position")?.iter().map(|x| x - start).collect();
    let reaction = match history.observable("wall_force")? {
        Some(series) => along(history, &series, k, direction, "wall_force")?,
        None => vec![],
    };
    // the load is counted in the sense of the prescribed force, or of the prescribed motion
    let load = match wall.drive {
        WallDrive::Force => component(history, &required(history, "applied_force")?, &[k], "applied_force")?,
        _ => required(history, "wall_force").map(|_| reaction.iter().map(|f| -f).collect())?,
    };
    let sense = sense(if wall.drive == WallDrive::Force { &load } else { &way });
    Ok(Motion { step: position.step, time: position.time, way, reaction, load, sense })
}

/// The sign of the value of greatest magnitude.
fn sense(values: &[f64]) -> f64 {
    values.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0).signum()
}

/// The component along `direction` of a vector that is observed for each wall.
fn along(history: &History, series: &Series, wall: usize, direction: &[f64; 3], name: &str) -> Result<Vec<f64>> {
    let mut sum = vec![0.0; series.step.len()];
    for d in 0..history.dimension() {
        let values = component(history, series, &[wall, d], name)?;
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += direction[d] * value);
    }
    Ok(sum)
}

fn lacking(path: &Path, what: String) -> PostError {
    PostError::Lacking { path: path.into(), what }
}

/// The driven wall: the one named, or the only one.
fn driven(path: &Path, walls: &[Wall], name: Option<&str>) -> Result<usize> {
    let moving: Vec<usize> = (0..walls.len()).filter(|&k| walls[k].drive != WallDrive::Fixed).collect();
    let names = || moving.iter().map(|&k| walls[k].name.as_str()).collect::<Vec<_>>().join(", ");
    match (name, moving.as_slice()) {
        (_, []) => {
            let what = "stress and strain need a driven wall, and this scene has none: \
                        give one of its walls a velocity or a force";
            Err(lacking(path, what.into()))
        }
        (Some(name), moving) => moving.iter().copied().find(|&k| walls[k].name == name).ok_or_else(|| {
            PostError::Usage(format!("--wall {name}: no driven wall has this name; there is {}", names()))
        }),
        (None, [k]) => Ok(*k),
        (None, _) => Err(PostError::Usage(format!("several walls are driven: choose one by --wall: {}", names()))),
    }
}

fn required(history: &History, name: &str) -> Result<Series> {
    history.observable(name)?.filter(|series| !series.step.is_empty()).ok_or_else(|| {
        lacking(
            history.path(),
            format!("it has no steps of /observables/{name}: run the scene again with walls observed"),
        )
    })
}

fn component(history: &History, series: &Series, index: &[usize], name: &str) -> Result<Vec<f64>> {
    series.component(index).ok_or_else(|| {
        lacking(
            history.path(),
            format!("/observables/{name} has shape {:?}, which has no entry {index:?}", series.shape),
        )
    })
}

/// Place of wall `k` along the drive at the first frame, m.
fn start_of(history: &History, k: usize, direction: &[f64; 3]) -> Result<f64> {
    let d = history.dimension();
    if history.frames() == 0 {
        return Err(lacking(history.path(), "it holds no frame yet: wait for the run to write one".into()));
    }
    let position = history.wall_state(0)?.position;
    Ok(position.get(k * d..(k + 1) * d).into_iter().flatten().zip(direction).map(|(x, n)| x * n).sum())
}

/// Height and cross-section of the sample at the first frame (m, m²), and whether the load pushes (1) or pulls (−1).
fn sample_size(history: &History, wall: usize, axis: usize, drive: f64) -> Result<([f64; 2], f64)> {
    let d = history.dimension();
    let (radius, position) = (history.grains()?.radius, history.grain_state(0)?.position);
    let mut extents = vec![];
    let mut middle = 0.0;
    for k in 0..d {
        let edge = |sign: f64| {
            let reach = radius.iter().zip(position.chunks(d)).map(|(r, x)| sign * x[k] + r);
            sign * reach.fold(f64::NEG_INFINITY, f64::max)
        };
        let (low, high) = (edge(-1.0), edge(1.0));
        extents.push(high - low);
        if k == axis {
            middle = 0.5 * (low + high);
        }
    }
    let place = history.wall_state(0)?.position.get(wall * d + axis).copied().unwrap_or(middle);
    let across: f64 = (0..d).filter(|&k| k != axis).map(|k| extents[k]).product();
    let area = if d == 2 { across * thickness(history)? } else { across };
    // a wall above that moves down pushes, one that moves up pulls
    let push = if drive * (place - middle) > 0.0 { -1.0 } else { 1.0 };
    Ok(([extents[axis], area], push))
}

impl Summary {
    /// The collapse load at one of the two strains in words.
    pub fn collapse(&self, k: usize) -> String {
        let load = quantity([self.collapse_load, self.collapse_load_1e3][k], "N");
        if self.collapse_early[k] { load + ", before any bond broke: the solver's own strain" } else { load }
    }

    /// The collapse load to draw (N): that at 1e-4, if it is the sample's.
    fn level(&self) -> Option<f64> {
        self.collapse_load.filter(|_| !self.collapse_early[0])
    }
}

impl Report {
    fn summarise(&mut self, strengths: &[f64], elastic: bool, residual: Option<Series>) {
        let at = |step: Option<usize>| step.and_then(|k| self.load.get(k).copied());
        let steps = COLLAPSE.map(|threshold| last_step_below(&self.strain, threshold));
        let [collapse, collapse_1e3] = steps;
        let rigid = !strengths.is_empty() && !elastic;
        let early = steps.map(|step| rigid && step.is_some_and(|step| whole_at(&self.broken, step)));
        let limit = BROKEN * strengths.len() as f64;
        let five = if strengths.is_empty() { None } else { self.broken.iter().position(|&n| n >= limit) };
        let top = peak(&self.load);
        let cohesion = (!strengths.is_empty()).then(|| strengths.iter().sum::<f64>() / strengths.len() as f64);
        let maximum = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let summary = Summary {
            wall: std::mem::take(&mut self.summary.wall),
            first_break: at(self.broken.iter().position(|&n| n > 0.0)),
            height: self.summary.height,
            area: self.summary.area,
            collapse_load: at(collapse),
            collapse_time: collapse.and_then(|k| self.time.get(k).copied()),
            collapse_load_1e3: at(collapse_1e3),
            collapse_early: early,
            load_at_5_percent_broken: at(five),
            peak_load: at(top),
            peak_strain: top.and_then(|k| self.strain.get(k).copied()),
            greatest_load: maximum(&self.load),
            final_displacement: self.displacement.last().copied().unwrap_or(0.0),
            final_strain: self.strain.last().copied(),
            work: work(&self.load, &self.displacement),
            bonds_broken: self.broken.last().copied(),
            cohesion,
            collapse_over_cohesion: at(collapse)
                .filter(|_| !early[0])
                .zip(cohesion)
                .map(|(load, cohesion)| load / cohesion),
            worst_residual: residual.map(|series| maximum(&series.value)),
        };
        self.summary = summary;
    }

    /// The summary as a table.
    pub fn table(&self) -> String {
        let s = &self.summary;
        let bonds = s.bonds_broken.map_or_else(|| "–".into(), |n| format!("{n:.0}"));
        facts(&[
            ("driven wall", s.wall.clone()),
            ("sample", format!("{} high, section {}", quantity(Some(s.height), "m"), quantity(Some(s.area), "m²"))),
            ("first break", quantity(s.first_break, "N")),
            ("collapse load (strain 1e-4)", s.collapse(0)),
            ("collapse load (strain 1e-3)", s.collapse(1)),
            ("load with 5 % of bonds broken", quantity(s.load_at_5_percent_broken, "N")),
            ("collapse load / cohesion", quantity(s.collapse_over_cohesion, "")),
            ("collapse at", quantity(s.collapse_time, "s")),
            ("peak load", s.peak_load.map_or_else(|| "none: the load never falls".into(), |f| quantity(Some(f), "N"))),
            ("strain at the peak", quantity(s.peak_strain, "")),
            ("greatest load", quantity(Some(s.greatest_load), "N")),
            ("displacement at the end", quantity(Some(s.final_displacement), "m")),
            ("strain at the end", quantity(s.final_strain, "")),
            ("work of the wall", quantity(Some(s.work), "J")),
            ("bonds broken", bonds),
            ("worst residual accepted", quantity(s.worst_residual, "")),
        ])
    }
}

/// Writes `stress-strain.csv`, and as drawings `force-displacement` and `stress-strain`.
///
/// # Errors
/// [`PostError::Write`].
pub fn write(report: &Report, folder: &mut Folder) -> Result<()> {
    let head = [
        "step",
        "time_s",
        "wall_displacement_m",
        "applied_force_N",
        "wall_reaction_N",
        "wall_strain",
        "wall_stress_Pa",
        "particle_strain",
        "particle_stress_Pa",
        "bonds_broken",
    ];
    let (height, area) = (report.summary.height, report.summary.area);
    let at = |values: &[f64], k: usize| values.get(k).copied();
    let rows = (0..report.step.len()).map(|k| {
        vec![
            report.step[k].to_string(),
            report.time[k].to_string(),
            report.displacement[k].to_string(),
            report.load[k].to_string(),
            cell(at(&report.reaction, k)),
            (report.displacement[k] / height).to_string(),
            cell(at(&report.reaction, k).map(|f| f / area)),
            cell(at(&report.strain, k)),
            cell(at(&report.stress, k)),
            cell(at(&report.broken, k)),
        ]
    });
    folder.table("stress-strain", &head, rows)?;
    folder.draw("force-displacement", &Chart::draw(vec![force_displacement(report)]))?;
    let mut charts = vec![stress_strain(report)];
    charts.extend(onset(report));
    Ok(folder.draw("stress-strain", &Chart::draw(charts))?)
}

fn pairs(x: &[f64], x_scale: f64, y: &[f64], y_scale: f64) -> Vec<(f64, f64)> {
    x.iter().zip(y).map(|(x, y)| (x * x_scale, y * y_scale)).collect()
}

/// Force over displacement of the wall.
pub fn force_displacement(report: &Report) -> Chart {
    let mut chart = Chart::new("displacement of the wall (mm)", "force (N)");
    chart.set_off = true;
    if !report.reaction.is_empty() {
        let points = pairs(&report.displacement, 1e3, &report.reaction, 1.0);
        chart = chart.curve("reaction of the grains", colour::ORANGE, Style::Thin, points);
    }
    let points = pairs(&report.displacement, 1e3, &report.load, 1.0);
    chart = chart.curve("applied force", colour::BLUE, Style::Line, points);
    if let Some(load) = report.summary.level() {
        chart.levels.push((load, format!("at strain 10⁻⁴: {} N", short(load))));
    }
    chart
}

/// The load over the logarithm of the fitted strain, which shows how little the sample gives way before it collapses.
pub fn onset(report: &Report) -> Option<Chart> {
    let visible = |&(strain, _): &(f64, f64)| strain >= LEAST_STRAIN;
    let points: Vec<(f64, f64)> =
        report.strain.iter().map(|e| e.abs()).zip(report.load.iter().copied()).filter(visible).collect();
    if points.len() < 2 {
        return None;
    }
    let mut chart = Chart::new("magnitude of the axial strain, from the particles", "applied force (N)");
    chart = chart.curve("applied force", colour::BLUE, Style::Line, points);
    chart.log_x = true;
    chart.moments = COLLAPSE.to_vec();
    if let Some(load) = report.summary.level() {
        chart.levels.push((load, format!("at strain 10⁻⁴: {} N", short(load))));
    }
    Some(chart)
}

/// Stress over strain.
pub fn stress_strain(report: &Report) -> Chart {
    let mut chart = Chart::new("axial strain (%)", "axial stress (kPa)");
    chart.set_off = true;
    let wall_strain = 1e2 / report.summary.height;
    let wall_stress = 1e-3 / report.summary.area;
    if !report.reaction.is_empty() {
        let points = pairs(&report.displacement, wall_strain, &report.reaction, wall_stress);
        chart = chart.curve("from walls", colour::ORANGE, Style::Thin, points);
    }
    let points = pairs(&report.strain, 1e2, &report.stress, 1e-3);
    if !points.is_empty() {
        chart = chart.curve("from particles", colour::BLUE, Style::Thin, points);
    }
    if let Some(load) = report.summary.level() {
        chart.levels.push((load * wall_stress, format!("at strain 10⁻⁴: {} kPa", short(load * wall_stress))));
    }
    chart
}
