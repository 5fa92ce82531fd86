//! The report of the load: curves of the run and the numbers that follow from them.

use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;

use dem_history::{History, Series, Wall, WallDrive, WallKind};
use dem_scene::failure::{Disk, Splitting};
use dem_scene::{Scene, choose_load_wall};
use nalgebra::Vector3;
use serde::Serialize;
use serde_json::Value;

use super::axes::{Axes, FirstFrame, Size, place_along, projected};
use super::elastic::{Curves, Elastic, RANGE};
use crate::clock::Clock;
use crate::collapse::{Bonding, Collapse, peak, work};
use crate::output::{PostError, Result, facts, number, quantity};
use crate::strength::fit::Estimate;

/// Strains that define the collapse.
pub(super) const COLLAPSE: [f64; 2] = [1e-4, 1e-3];
/// Share of broken bonds whose load is reported.
const BROKEN: f64 = 0.05;
/// Extent of the centres of the grains, over that along the load, up to which they are one layer.
const FLAT: f64 = 1e-6;

/// The results in numbers. `None`: the event did not occur, or the quantity was not recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// The load wall.
    pub wall: String,
    /// Load at the first break, N.
    pub first_break: Option<f64>,
    /// Height of the sample along the drive, m.
    pub height: f64,
    /// Cross-section of the sample, m²; `None` unless the wall is a plane that moves along its
    /// normal.
    pub area: Option<f64>,
    /// Load before the fitted strain exceeds 1e-4, N.
    pub collapse_load: Option<f64>,
    /// Time of that step, s.
    pub collapse_time: Option<f64>,
    /// Load before the fitted strain exceeds 1e-3, N.
    pub collapse_load_1e3: Option<f64>,
    /// Whether no rigid bond had broken by each of the two steps.
    pub collapse_early: [bool; 2],
    /// A caveat on each of the two loads, or the reason why there is none.
    #[serde(skip)]
    pub collapse_note: [&'static str; 2],
    /// Load when 5 % of the bonds have broken, N.
    pub load_at_5_percent_broken: Option<f64>,
    /// Greatest load where it falls by 5 % afterwards, N.
    pub peak_load: Option<f64>,
    /// Displacement of the wall at the peak, m.
    pub peak_displacement: Option<f64>,
    /// Strain fitted to the grains at the peak.
    pub peak_strain: Option<f64>,
    /// Greatest load, N.
    pub greatest_load: f64,
    /// The splitting strength of a disk between plates.
    pub splitting: Option<Splitting>,
    /// Young's modulus and Poisson's ratio; `None` without elastic bonds, and where
    /// `elastic_note` says why.
    pub elastic: Option<Elastic>,
    /// Why a sample with elastic bonds has no elastic constants; empty else.
    pub elastic_note: &'static str,
    /// Displacement of the wall at the end, m.
    pub final_displacement: f64,
    /// Strain fitted to the grains at the end.
    pub final_strain: Option<f64>,
    /// Work that the wall has done, J.
    pub work: f64,
    /// Bonds broken at the end.
    pub bonds_broken: Option<f64>,
    /// Mean cohesion of the bonds, N.
    pub cohesion: Option<f64>,
    /// Collapse load over cohesion; `None` where the strain is solver error.
    pub collapse_over_cohesion: Option<f64>,
    /// Greatest residual that was accepted.
    pub worst_residual: Option<f64>,
}

/// The curves, one entry per observed step, and their summary; JSON contains only the summary.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(transparent)]
pub struct Report {
    /// Steps.
    #[serde(skip)]
    pub step: Vec<i64>,
    /// Times, s.
    #[serde(skip)]
    pub time: Vec<f64>,
    /// Displacement of the wall, m.
    #[serde(skip)]
    pub displacement: Vec<f64>,
    /// Load, N.
    #[serde(skip)]
    pub load: Vec<f64>,
    /// Whether the load of a step is that before anything broke in it: a prescribed force, or a
    /// recorded `wall_force_at_limit`. Else it is the force at the end of the step.
    #[serde(skip)]
    load_before_breaks: bool,
    /// Reaction of the grains on the wall, N; empty if not recorded.
    #[serde(skip)]
    pub reaction: Vec<f64>,
    /// Axial strain fitted to the grains; empty if not recorded.
    #[serde(skip)]
    pub strain: Vec<f64>,
    /// Axial stress of the contacts after Love and Weber, Pa; empty if not recorded.
    #[serde(skip)]
    pub stress: Vec<f64>,
    /// Bonds broken; empty if not recorded.
    #[serde(skip)]
    pub broken: Vec<f64>,
    /// What times count: steps where each is the load at which the next bond breaks.
    #[serde(skip)]
    pub clock: Clock,
    /// The summary.
    pub summary: Summary,
}

/// Reads the curves of the wall `wall`, or of the load wall.
///
/// # Errors
/// [`PostError::Lacking`] for a scene without a driven wall, or without its force and position at
/// every step; [`PostError::Usage`] for an unknown or fixed wall, or where several walls are driven
/// and the scene does not name the load wall.
pub fn read(history: &History, wall: Option<&str>) -> Result<Report> {
    let walls = history.walls()?;
    let scene = history.parameters()?.scene;
    let k = driven(history.path(), &walls, &scene, wall)?;
    let axes = Axes::of(&walls[k].direction, history.dimension());
    let motion = motion(history, &walls[k], k)?;
    let first = FirstFrame::read(history)?;
    let size = Size::of(history, &first, &scene, &axes)?;
    let tensor = |name: &str| tensor_along(history, name, &axes.along);
    let push = push(history, k, &size, &axes.along, motion.sense)?;
    let facing = Vector3::from(walls[k].normal).dot(&axes.along).abs() > FRAC_1_SQRT_2;
    let plate = facing && covers(history, &first, &walls[k], k)?;
    let mut report = Report {
        displacement: scaled(&motion.way, motion.sense),
        load: scaled(&motion.load, motion.sense),
        load_before_breaks: motion.load_before_breaks,
        // the reaction of the grains has the opposite sign
        reaction: scaled(&motion.reaction, -motion.sense),
        strain: scaled(&tensor("strain")?, -push),
        stress: scaled(&tensor("stress")?, push * size.box_share),
        clock: Clock::of(history),
        broken: history.observable("bonds_broken")?.map(|series| series.value).unwrap_or_default(),
        summary: Summary {
            wall: walls[k].name.clone(),
            height: size.ends[1] - size.ends[0],
            area: Some(size.area).filter(|_| plate),
            ..Summary::default()
        },
        step: motion.step,
        time: motion.time,
    };
    let bonds = Bonding::of(history)?;
    report.summarise(&history.bonds()?.strength, bonds, history.observable("solver_residual")?);
    let s = &mut report.summary;
    s.work = work(&motion.applied, &motion.way) + motion.slide_work;
    let disk = serde_json::from_str::<Scene>(&scene).ok().and_then(|scene| Disk::of(&scene, &s.wall, &size.extents));
    let collapse = s.collapse_load.filter(|_| !s.collapse_early[0]);
    s.splitting = disk.map(|disk| Splitting::of(disk, collapse, s.peak_load));
    if bonds == Bonding::Elastic {
        let found = if plate && disk.is_none() {
            elastic(history, &report, (&first, &axes), push, size.box_share)?
        } else {
            Err("only a sample that plates load along its axis has them")
        };
        match found {
            Ok(found) => report.summary.elastic = Some(found),
            Err(why) => report.summary.elastic_note = why,
        }
    }
    Ok(report)
}

/// All values times a factor; a zero stays without sign.
fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|value| factor * value + 0.0).collect()
}

/// The elastic constants, or why there are none; `push` is that of [`push`], `share` that of
/// [`Size`].
fn elastic(
    history: &History,
    report: &Report,
    (first, axes): (&FirstFrame, &Axes),
    push: f64,
    share: f64,
) -> Result<std::result::Result<Elastic, &'static str>> {
    // a layer of grains has no strain across it
    let others: Vec<_> = axes.across.iter().filter(|u| first.spread(u) > FLAT * first.spread(&axes.along)).collect();
    if others.is_empty() {
        return Ok(Err("the grains have no extent across the load"));
    }
    // the mean over the other axes, positive along the load as the axial one
    let lateral = |name: &str, sign: f64| -> Result<Vec<f64>> {
        let mut sum = vec![0.0; report.load.len()];
        for u in &others {
            let part = tensor_along(history, name, u)?;
            if part.is_empty() {
                return Ok(part);
            }
            sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += sign * x / others.len() as f64);
        }
        Ok(sum)
    };
    Ok(Elastic::of(Curves {
        load: &report.load,
        broken: &report.broken,
        strain: &report.strain,
        stress: &report.stress,
        lateral_strain: &lateral("strain", -push)?,
        lateral_stress: &lateral("stress", push * share)?,
    }))
}

/// Motion and forces of the driven wall along its direction, with the signs of that direction.
struct Motion {
    step: Vec<i64>,
    time: Vec<f64>,
    /// Displacement since the first frame, m.
    way: Vec<f64>,
    /// Work of the wall on the grains as it slides across its drive, J; 0 if not recorded.
    slide_work: f64,
    /// Force of the grains on the wall, N; empty if not recorded.
    reaction: Vec<f64>,
    /// Force that drives the wall at the end of each step, N: the prescribed one, or that which
    /// keeps a prescribed velocity.
    applied: Vec<f64>,
    /// The load, N.
    load: Vec<f64>,
    /// Whether it is that before anything broke in a step.
    load_before_breaks: bool,
    /// The sign that makes the load positive.
    sense: f64,
}

fn motion(history: &History, wall: &Wall, k: usize) -> Result<Motion> {
    let direction = &wall.direction;
    let position = required(history, "wall_position")?;
    let start = start_of(history, k, direction)?;
    let way: Vec<f64> = along(history, &position, k, direction, "wall_position")?.iter().map(|x| x - start).collect();
    let (reaction, slide_work) = match history.observable("wall_force")? {
        Some(force) => (
            along(history, &force, k, direction, "wall_force")?,
            slide_work(history, k, direction, &position, &way, &force)?,
        ),
        None => (vec![], 0.0),
    };
    let recorded = |name: &str| -> Result<Option<Series>> {
        Ok(history.observable(name)?.filter(|series| !series.step.is_empty()))
    };
    let applied = match recorded("applied_force")? {
        Some(series) => component(history, &series, &[k], "applied_force")?,
        None => reaction.iter().map(|f| -f).collect(),
    };
    // the load is counted in the sense of the prescribed force, or of the prescribed motion
    let (load, load_before_breaks) = match (recorded("wall_load")?, wall.drive) {
        // stages change what is prescribed
        (Some(series), _) => (component(history, &series, &[k], "wall_load")?, true),
        (None, WallDrive::Force) => {
            (component(history, &required(history, "applied_force")?, &[k], "applied_force")?, true)
        }
        (None, _) => {
            let (series, name, before) = match recorded("wall_force_at_limit")? {
                Some(series) => (series, "wall_force_at_limit", true),
                None => (required(history, "wall_force")?, "wall_force", false),
            };
            (along(history, &series, k, direction, name)?.iter().map(|f| -f).collect(), before)
        }
    };
    let sense = sense(if wall.drive == WallDrive::Force { &load } else { &way });
    let (step, time) = (position.step, position.time);
    Ok(Motion { step, time, way, slide_work, reaction, applied, load, load_before_breaks, sense })
}

/// Work of a wall on the grains as it slides across its drive (J), from its `position` (m), its
/// displacement `way` along the drive (m) and the `force` of the grains on it (N).
fn slide_work(
    history: &History,
    wall: usize,
    drive: &[f64; 3],
    position: &Series,
    way: &[f64],
    force: &Series,
) -> Result<f64> {
    let mut sum = 0.0;
    for d in 0..history.dimension() {
        let mut axis = [0.0; 3];
        axis[d] = 1.0;
        let start = start_of(history, wall, &axis)?;
        let place = component(history, position, &[wall, d], "wall_position")?;
        let across: Vec<f64> = place.iter().zip(way).map(|(x, way)| x - start - drive[d] * way).collect();
        // that of the wall on the grains is opposite
        sum -= work(&component(history, force, &[wall, d], "wall_force")?, &across);
    }
    Ok(sum)
}

/// The sign of the value of greatest magnitude.
fn sense(values: &[f64]) -> f64 {
    values.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0).signum()
}

/// The component along `direction` of a vector observed for each wall.
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

/// Names of the driven walls, and which of them loads the sample of a scene (JSON).
pub(crate) fn load_wall<'a>(walls: &'a [Wall], scene: &str) -> (Vec<&'a str>, Option<&'a str>) {
    let moving = walls.iter().filter(|wall| wall.drive != WallDrive::Fixed);
    let driven: Vec<&str> = moving.map(|wall| wall.name.as_str()).collect();
    let scene: Value = serde_json::from_str(scene).unwrap_or_default();
    let named = ["/load_wall", "/stop/wall_travel/wall"].map(|place| scene.pointer(place).and_then(Value::as_str));
    let chosen = choose_load_wall(named, &driven);
    (driven, chosen)
}

/// The load wall: the requested one, or that of the scene.
pub(crate) fn driven(path: &Path, walls: &[Wall], scene: &str, asked: Option<&str>) -> Result<usize> {
    let (driven, chosen) = load_wall(walls, scene);
    let names = || driven.join(", ");
    let name = match asked {
        _ if driven.is_empty() => {
            let what = "stress and strain need a driven wall, and this scene has none: \
                        give one of its walls a velocity or a force";
            return Err(lacking(path, what.into()));
        }
        Some(name) if driven.contains(&name) => name,
        Some(name) => {
            return Err(PostError::Usage(format!("--wall {name}: no driven wall has this name; there is {}", names())));
        }
        None => chosen.ok_or_else(|| {
            let shown = path.display();
            PostError::Usage(format!("{shown}: several walls are driven: choose one with --wall: {}", names()))
        })?,
    };
    Ok(walls.iter().position(|wall| wall.name == name).unwrap_or(0))
}

fn required(history: &History, name: &str) -> Result<Series> {
    let why = match history.observable(name)? {
        Some(series) if !series.step.is_empty() => return Ok(series),
        Some(_) => "no step of its run was completed",
        None => "run the scene again with walls observed",
    };
    Err(lacking(history.path(), format!("it has no steps of /observables/{name}: {why}")))
}

fn component(history: &History, series: &Series, index: &[usize], name: &str) -> Result<Vec<f64>> {
    series.component(index).ok_or_else(|| {
        lacking(
            history.path(),
            format!("/observables/{name} has shape {:?}, which has no entry {index:?}", series.shape),
        )
    })
}

/// Position of wall `k` along the drive at the first frame, m.
fn start_of(history: &History, k: usize, direction: &[f64; 3]) -> Result<f64> {
    let d = history.dimension();
    if history.frames() == 0 {
        return Err(lacking(history.path(), "it holds no frame yet: wait for the run to write one".into()));
    }
    let position = history.wall_state(0)?.position;
    Ok(position.get(k * d..(k + 1) * d).into_iter().flatten().zip(direction).map(|(x, n)| x * n).sum())
}

/// Whether the load pushes (1) or pulls (−1).
fn push(history: &History, wall: usize, size: &Size, along: &Vector3<f64>, sense: f64) -> Result<f64> {
    let d = history.dimension();
    let middle = 0.5 * (size.ends[0] + size.ends[1]);
    let position = history.wall_state(0)?.position;
    let place = position.get(wall * d..(wall + 1) * d).map(|x| place_along(x, along));
    // a wall above that moves down pushes, one that moves up pulls
    Ok(if sense * (place.unwrap_or(middle) - middle) > 0.0 { -1.0 } else { 1.0 })
}

/// The component of a tensor along a unit vector in each step; empty where it was not observed.
fn tensor_along(history: &History, name: &str, u: &Vector3<f64>) -> Result<Vec<f64>> {
    let Some(series) = history.observable(name)? else { return Ok(vec![]) };
    projected(&series, history.dimension(), u).ok_or_else(|| {
        lacking(history.path(), format!("/observables/{name} has shape {:?}, which is not a tensor's", series.shape))
    })
}

/// Whether the wall `k` is a plane, or a plate that reaches beyond the sample on all sides at the
/// start. A punch that is narrower than the sample gives no stress on the section of the sample.
fn covers(history: &History, first: &FirstFrame, wall: &Wall, k: usize) -> Result<bool> {
    if wall.kind != WallKind::Plate {
        return Ok(wall.kind == WallKind::Plane);
    }
    let (d, state) = (history.dimension(), history.wall_state(0)?);
    let Some(middle) = state.position.get(k * d..(k + 1) * d) else { return Ok(false) };
    let side = Vector3::from(wall.side);
    let sides = [(side, wall.length), (Vector3::from(wall.normal).cross(&side), wall.width)];
    for (side, length) in sides.iter().take(d - 1) {
        let middle = place_along(middle, side);
        let [low, high] = first.ends(side);
        if f64::max(high - middle, middle - low) > 0.5 * length {
            return Ok(false);
        }
    }
    Ok(true)
}

impl Summary {
    /// The collapse load at one of the two strains in words.
    pub fn collapse(&self, k: usize) -> String {
        let note = self.collapse_note[k];
        match [self.collapse_load, self.collapse_load_1e3][k] {
            None if note.is_empty() => "–".into(),
            None => format!("none: {note}"),
            load if note.is_empty() => quantity(load, "N"),
            load => format!("{}, {note}", quantity(load, "N")),
        }
    }

    /// The sample in words: its height, and its section under a plate.
    pub fn sample(&self) -> String {
        let section = self.area.map_or_else(String::new, |area| format!(", section {}", quantity(Some(area), "m²")));
        format!("{} high{section}", quantity(Some(self.height), "m"))
    }

    /// Young's modulus and Poisson's ratio in words; `None` for samples without elastic bonds.
    pub fn elastic(&self) -> Option<[(&'static str, String); 2]> {
        let words = |found: &Estimate, unit: &str| {
            let error = found.standard_error.map(|error| format!(" ± {}", number(error)));
            format!("{}{} {unit}", number(found.value), error.unwrap_or_default()).trim_end().to_string()
        };
        let names = ["Young's modulus", "Poisson's ratio"];
        match &self.elastic {
            Some(found) => {
                let whole = if self.first_break.is_some() { "load at the first break" } else { "greatest load" };
                let over = format!("at {:.0} % to {:.0} % of the {whole}", 1e2 * RANGE[0], 1e2 * RANGE[1]);
                let modulus = format!("{} (standard error), {over}", words(&found.young_modulus, "Pa"));
                Some([(names[0], modulus), (names[1], words(&found.poisson_ratio, ""))])
            }
            None if self.elastic_note.is_empty() => None,
            None => Some(names.map(|name| (name, format!("none: {}", self.elastic_note)))),
        }
    }

    /// The peak in words.
    pub fn peak(&self) -> String {
        let at = self.peak_displacement.map(|way| format!(" at a displacement of {}", quantity(Some(way), "m")));
        match self.peak_load {
            Some(load) => quantity(Some(load), "N") + &at.unwrap_or_default(),
            None => "none: the load never falls by 5 %".into(),
        }
    }

    /// The collapse load to draw (N): that at 1e-4, if it is the sample's.
    pub(super) fn level(&self) -> Option<f64> {
        self.collapse_load.filter(|_| !self.collapse_early[0])
    }
}

impl Report {
    fn summarise(&mut self, strengths: &[f64], bonds: Bonding, residual: Option<Series>) {
        let at = |step: Option<usize>| step.and_then(|k| self.load.get(k).copied());
        let found = COLLAPSE.map(|limit| Collapse::read(&self.load, &self.strain, &self.broken, limit, bonds));
        let [collapse, collapse_1e3] = found.map(|found| found.step);
        let early = found.map(|found| found.early);
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
            collapse_note: found.map(|found| found.note),
            load_at_5_percent_broken: at(five),
            peak_load: at(top),
            peak_displacement: top.and_then(|k| self.displacement.get(k).copied()),
            peak_strain: top.and_then(|k| self.strain.get(k).copied()),
            greatest_load: maximum(&self.load),
            final_displacement: self.displacement.last().copied().unwrap_or(0.0),
            final_strain: self.strain.last().copied(),
            bonds_broken: self.broken.last().copied(),
            cohesion,
            collapse_over_cohesion: at(collapse)
                .filter(|_| !early[0])
                .zip(cohesion)
                .map(|(load, cohesion)| load / cohesion),
            worst_residual: residual.map(|series| maximum(&series.value)),
            ..Summary::default()
        };
        self.summary = summary;
    }

    /// The load at a step (N); `None` where it was not observed.
    pub fn load_at(&self, step: i64) -> Option<f64> {
        self.step.binary_search(&step).ok().and_then(|row| self.load.get(row).copied())
    }

    /// Why the load of a step is not that before anything broke in it; `None` where it is.
    pub(crate) fn load_after_breaks(&self) -> Option<String> {
        let why = "its force before the breaks of a step";
        (!self.load_before_breaks)
            .then(|| format!("the history has no wall_force_at_limit of wall {}, {why}", self.summary.wall))
    }

    /// The summary as a table.
    pub fn table(&self) -> String {
        let s = &self.summary;
        let bonds = s.bonds_broken.map_or_else(|| "–".into(), |n| format!("{n:.0}"));
        let mut lines = vec![("driven wall", s.wall.clone()), ("sample", s.sample())];
        lines.extend(s.elastic().into_iter().flatten());
        lines.extend([
            ("first break", quantity(s.first_break, "N")),
            ("collapse load (strain 1e-4)", s.collapse(0)),
            ("collapse load (strain 1e-3)", s.collapse(1)),
            ("load with 5 % of bonds broken", quantity(s.load_at_5_percent_broken, "N")),
            ("collapse load / cohesion", quantity(s.collapse_over_cohesion, "")),
            ("collapse at", self.clock.moment_if_known(s.collapse_time)),
            ("peak load", s.peak()),
            ("strain at the peak", quantity(s.peak_strain, "")),
        ]);
        lines.extend(s.splitting.as_ref().map(|splitting| ("splitting strength", splitting.to_string())));
        lines.extend([
            ("greatest load", quantity(Some(s.greatest_load), "N")),
            ("displacement at the end", quantity(Some(s.final_displacement), "m")),
            ("strain at the end", quantity(s.final_strain, "")),
            ("work of the wall", quantity(Some(s.work), "J")),
            ("bonds broken", bonds),
            ("worst residual accepted", quantity(s.worst_residual, "")),
        ]);
        facts(&lines)
    }
}
