//! What happened to one bond: the report, and how it is computed from a history.

use dem_history::{BondStatus, ContactRows, History, HistoryError};
use serde::Serialize;

use super::bond::Which;
use super::rupture::Broken;
use super::utilisation::{Greatest, Limits, Load, Part, Twist, greatest};
use crate::clock::Clock;
use crate::extent::bonded_frame;
use crate::output::{PostError, Result, progress};
use crate::stress_strain::driven;

/// Utilisations whose first frame is reported.
pub(super) const LEVELS: [f64; 2] = [0.5, 0.9];

/// One of the two grains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grain {
    /// Its number.
    pub grain: usize,
    /// Its centre when the bond formed, m.
    pub centre: Vec<f64>,
    /// Its radius, m.
    pub radius: f64,
}

/// The bond in one frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moment {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Its load.
    #[serde(flatten)]
    pub load: Load,
    /// How near it is to breaking in each mode.
    pub parts: Vec<Part>,
    /// The greatest utilisation; `None` where the history lacks a force or a coefficient.
    pub greatest: Option<Greatest>,
}

/// One bond.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Its number.
    pub bond: usize,
    /// Its grains.
    pub grains: [Grain; 2],
    /// Strength r_coh, N.
    pub strength: f64,
    /// Coefficient μ of the shear limit.
    pub shear: f64,
    /// Coefficient ν of the rolling limit.
    pub rolling: f64,
    /// Coefficient ξ of the twist limit, for a bond that resists twist.
    pub twist: Option<f64>,
    /// Mean diameter a, m.
    pub mean_diameter: f64,
    /// Gap at rest, m.
    pub rest_gap: f64,
    /// How it broke; `None` for a bond that holds.
    pub broken: Option<Broken>,
    /// Step and time (s) of the last frame.
    pub end: (i64, f64),
    /// Frames in which it is intact, one entry each; the first frame of a run holds no forces.
    pub frames: Vec<Moment>,
    /// Why there are none, or why the utilisation is not known; empty otherwise.
    pub frames_note: &'static str,
    /// What it bears.
    #[serde(skip)]
    pub limits: Limits,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
}

/// Reads what happened to the bond `which`, with a bar unless `quiet`; the load is that of `wall`,
/// or of the scene's load wall.
///
/// # Errors
/// [`PostError::Lacking`] for a history without bonds or frames; [`PostError::Usage`] for a bond
/// that does not exist, and for a wall that is not driven.
pub fn read(history: &History, which: Which, wall: Option<&str>, quiet: bool) -> Result<Report> {
    let bonds = history.bonds()?;
    let bond = which.find(history, &bonds)?;
    let Some(end) = history.steps().last().copied().zip(history.times().last().copied()) else {
        let what = "it holds no frame yet: wait for the run to write one".into();
        return Err(PostError::Lacking { path: history.path().into(), what });
    };
    let limits = Limits::of(history, &bonds, bond)?;
    let ruptures = history.ruptures()?;
    let broken = ruptures.iter().find(|rupture| rupture.bond == bond as i32);
    agree(history, bond, broken.is_some())?;
    if wall.is_some()
        && let Err(error @ PostError::Usage(_)) =
            driven(history.path(), &history.walls()?, &history.parameters()?.scene, wall)
    {
        // the load of a bond that holds is not shown, but a wrong name is an error
        return Err(error);
    }
    let until = broken.map_or(i64::MAX, |rupture| rupture.step);
    let frames = moments(history, bond, bonds.pair[bond], &limits, until, quiet)?;
    let (radius, position) = (history.grains()?.radius, history.grain_state(bonded_frame(history)?)?.position);
    let d = history.dimension();
    let grain = |grain: i32| {
        let grain = grain as usize;
        Grain { grain, centre: position[grain * d..(grain + 1) * d].to_vec(), radius: radius[grain] }
    };
    Ok(Report {
        bond,
        grains: bonds.pair[bond].map(grain),
        strength: limits.strength,
        shear: limits.shear,
        rolling: limits.rolling,
        twist: if let Twist::Coefficient(twist) = limits.twist { Some(twist) } else { None },
        mean_diameter: limits.arm,
        rest_gap: bonds.rest_gap[bond],
        broken: broken.map(|own| Broken::read(history, &ruptures, own, &limits, wall)).transpose()?,
        end,
        frames_note: note(history, &frames),
        frames,
        limits,
        clock: Clock::of(history),
    })
}

/// The list of ruptures and the last frame must agree on whether the bond holds.
fn agree(history: &History, bond: usize, broken: bool) -> Result<()> {
    // a frame of the step after which bonds form has none
    let status = history.bond_status(history.frames() - 1)?.get(bond).copied().unwrap_or(BondStatus::Intact);
    if broken == (status != BondStatus::Intact) {
        return Ok(());
    }
    let listed = if broken { "lists its rupture" } else { "does not list it" };
    Err(PostError::History(HistoryError::Damaged {
        path: history.path().into(),
        place: "bonds/status/value".into(),
        why: format!("bond {bond} is {} in the last frame, and /events/rupture {listed}", status.label()),
    }))
}

/// The bond in the frames before step `until`.
fn moments(
    history: &History,
    bond: usize,
    pair: [i32; 2],
    limits: &Limits,
    until: i64,
    quiet: bool,
) -> Result<Vec<Moment>> {
    let mut moments = vec![];
    if !history.has_reactions() {
        return Ok(moments);
    }
    let frames = history.steps().iter().zip(history.times()).take_while(|(step, _)| **step < until);
    let bar = progress(frames.clone().count() as u64, quiet, "{bar:24} {percent} % of the frames read, {eta} left");
    for (frame, (&step, &time)) in frames.enumerate() {
        if let Some(load) = load(history, frame, bond, pair, limits)? {
            let parts = limits.parts(&load);
            moments.push(Moment { step, time, load, greatest: greatest(&parts), parts });
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(moments)
}

/// The load of the bond at frame `frame`; `None` where the frame has no row of it.
fn load(history: &History, frame: usize, bond: usize, pair: [i32; 2], limits: &Limits) -> Result<Option<Load>> {
    let rows = history.contact_rows(frame)?;
    let [i, j] = pair;
    let place = history.contact_pairs(frame)?.iter().position(|&found| found == [i, j] || found == [j, i]);
    let Some(row) = place.map(|place| rows.start + place) else {
        return Ok(None);
    };
    let contact = history.contacts_in(row..row + 1)?;
    let own = contact.bond.first() == Some(&(bond as i32)) && contact.reaction_rows() > 0;
    Ok(own.then(|| load_of(&contact, limits)))
}

fn load_of(contact: &ContactRows, limits: &Limits) -> Load {
    // in 2D one moment, in 3D two that bend, and where bonds resist twist a third about the normal
    let (bending, about_normal) = contact.moment.split_at(contact.moment.len().min(2));
    let resists = limits.twist != Twist::Free;
    Load {
        normal_force: contact.normal_force(0),
        tangential_force: contact.tangential_force(0),
        moment: (!bending.is_empty()).then(|| bending.iter().map(|m| m * m).sum::<f64>().sqrt()),
        twist: about_normal.first().filter(|_| resists).map(|m| m.abs()),
    }
}

/// Why the utilisation over time is not known; empty where it is.
fn note(history: &History, frames: &[Moment]) -> &'static str {
    match frames.last() {
        _ if !history.has_reactions() => "no forces in the frames: the scene has output.reactions = false",
        None => "no frame holds its forces: record more frames (output.every_steps)",
        Some(last) if last.greatest.is_none() => "the history lacks a force or a coefficient of a mode",
        Some(_) => "",
    }
}

impl Report {
    /// The greatest utilisation in the frames, and where it occurs; the first of equal ones.
    pub fn peak(&self) -> Option<(&Moment, Greatest)> {
        let known = self.frames.iter().filter_map(|moment| Some((moment, moment.greatest?)));
        known.reduce(|most, next| if next.1.utilisation > most.1.utilisation { next } else { most })
    }

    /// The first frame in which the utilisation reaches `level`.
    pub fn reached(&self, level: f64) -> Option<&Moment> {
        self.frames.iter().find(|moment| moment.greatest.is_some_and(|most| most.utilisation >= level))
    }
}
