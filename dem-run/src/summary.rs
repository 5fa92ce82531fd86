//! The summary of a run, printed on stdout.

use crate::collapse::{Collapse, Failure};
use crate::history::Ending;
use crate::output::{counted, in_shell, number, quantity};
use crate::scene::failure::{STRAINS, Splitting};
use dem_core::solver::Work;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Shortest preparation that is printed (s).
const SHORTEST_TOLD: f64 = 0.05;

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The history.
    pub history: PathBuf,
    /// Why it ended.
    pub ending: Ending,
    /// Steps made.
    pub steps: u64,
    /// Whether the last state has normal contact forces and the history records them, so that force
    /// chains can be drawn.
    #[serde(skip)]
    pub has_reactions: bool,
    /// Simulated time (s).
    pub time: f64,
    /// With `rupture: next_event`, where that counts steps, the time of the loads (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_time: Option<f64>,
    /// Grains.
    pub grains: usize,
    /// Solid fraction of a random sample in its box (–).
    pub solid_fraction: Option<f64>,
    /// Bonds at the start.
    pub bonds: usize,
    /// Why there are no bonds, if the scene has bonds and none was formed.
    #[serde(skip)]
    pub no_bonds: Option<String>,
    /// Whether bonds are elastic: then the sample may deform before the first break.
    pub elastic: bool,
    /// Bonds broken in tension, shear, rolling and twist.
    pub broken: [usize; 4],
    /// Whether bonds resist twist.
    pub twists: bool,
    /// Whether all grains were bonded into one piece at the start.
    #[serde(skip)]
    pub one_piece: bool,
    /// Name of the wall that loads the sample; none if no wall is driven, or if several are driven
    /// and the scene does not name one.
    pub load_wall: Option<String>,
    /// Loads of this wall at which the sample failed (N).
    pub failure: Failure,
    /// Peak load of this wall (N), if it is driven by a velocity, bonds are elastic, or the load
    /// follows events.
    pub peak_load: Option<f64>,
    /// Displacement of this wall along its direction at the end of the step of peak load (m).
    pub peak_displacement: Option<f64>,
    /// The splitting strength, if this wall splits a disk.
    pub splitting: Option<Splitting>,
    /// The loads of all driven walls.
    pub driven_walls: Vec<WallLoads>,
    /// Tolerance of the solver (–).
    pub tolerance: f64,
    /// Largest residual of an accepted solve (–).
    pub worst_residual: f64,
    /// Tolerance of the load error (–); none of Gauss–Seidel, which stops on the residual alone.
    pub load_tolerance: Option<f64>,
    /// Largest load error of an accepted solve (–); none if no solve reported one.
    pub worst_load_error: Option<f64>,
    /// Work of all accepted solves.
    #[serde(serialize_with = "counts")]
    pub work: Work,
    /// Solved steps: those with a solve that was not an extrapolation.
    pub solved_steps: u64,
    /// Steps with an accepted solve whose residual exceeds the tolerance.
    pub missed_tolerance: u64,
    /// Steps with an accepted solve whose load error exceeds its tolerance.
    pub missed_load_tolerance: u64,
    /// Solves that were not accepted: their steps were halved.
    pub rejected: u64,
    /// Deepest overlap (m).
    pub penetration: f64,
    /// Largest difference between the length of an intact bond and its length at rest (m).
    pub bond_elongation: f64,
    /// Mean diameter of the grains (m).
    pub mean_diameter: f64,
    /// Work of forces and drives (J).
    pub external_work: f64,
    /// Remainder of the energy balance (J).
    pub energy_remainder: f64,
    /// Energy lost in intact bonds, which rigid bonds should not lose (J).
    pub bond_remainder: f64,
    /// Processor time of the whole program (s).
    pub cpu_time: f64,
    /// Processor time until the first step (s): sample, walls and bonds. A packing that another run
    /// made is not in it. None if the run was resumed.
    pub preparation_time: Option<f64>,
}

/// The loads of a driven wall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WallLoads {
    /// Its name.
    pub wall: String,
    /// Loads at which the sample failed (N). The collapse load is absent if no load acted in the
    /// step before the strain was exceeded, or if an elastic sample exceeded the strain before any
    /// bond broke.
    pub failure: Failure,
    /// Peak load (N), if the wall is driven by a velocity, bonds are elastic, or the load follows
    /// events.
    pub peak_load: Option<f64>,
    /// Displacement along its direction at the end of the step of peak load (m).
    pub peak_displacement: Option<f64>,
    /// Whether the strain has exceeded each of [`STRAINS`].
    #[serde(skip)]
    pub passed: [bool; 2],
    /// Whether the peak load is that of the last step.
    #[serde(skip)]
    pub rising: bool,
    /// Whether the load fell after it.
    #[serde(skip)]
    pub fallen: bool,
}

impl WallLoads {
    /// The loads of the wall `wall`. `may_fall`: its load can decrease without a prescription, as
    /// that of a velocity does; `elastic`: bonds are elastic.
    #[must_use]
    pub fn of(wall: &str, may_fall: bool, elastic: bool, found: &Collapse) -> Self {
        let &Collapse { mut failure, passed, peak, rising, fallen, .. } = found;
        for (load, early) in failure.collapse.iter_mut().zip(failure.early) {
            *load = load.filter(|_| !(elastic && early));
        }
        let peak = Some(peak).filter(|peak| (may_fall || elastic) && peak.load != 0.0);
        Self {
            wall: wall.into(),
            failure,
            peak_load: peak.map(|peak| peak.load),
            peak_displacement: peak.map(|peak| peak.displacement),
            passed,
            rising,
            fallen,
        }
    }

    /// The peak load in words, if there is one.
    fn peak(&self) -> Option<String> {
        let (load, displacement) = (self.peak_load?, self.peak_displacement?);
        let end = if self.rising { ", at the end of the run" } else { "" };
        Some(format!("{} N at a displacement of {} m{end}", number(load), number(displacement)))
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ending = self.ending.reason();
        let (steps, grains) = (counted(self.steps as usize, "step"), counted(self.grains, "grain"));
        match self.load_time {
            Some(time) => {
                writeln!(f, "ended            after {steps}, at the loads of t = {time:.6} s: {ending}")?;
            }
            None => writeln!(f, "ended            t = {:.6} s after {steps}: {ending}", self.time)?,
        }
        match self.solid_fraction {
            Some(fraction) => writeln!(f, "sample           {grains}, solid fraction {fraction:.4}")?,
            None => writeln!(f, "sample           {grains}")?,
        }
        match &self.no_bonds {
            _ if self.bonds > 0 => self.write_bonds(f)?,
            Some(why) => writeln!(f, "bonds            none, although the scene has bonds: {why}")?,
            None => {}
        }
        if self.steps > 0 {
            self.write_loads(f)?;
            self.write_solves(f)?;
        }
        let told = self.preparation_time.filter(|time| *time >= SHORTEST_TOLD);
        let preparation = told.map_or(String::new(), |time| format!(", {time:.1} s of it for the preparation"));
        writeln!(f, "CPU time         {:.1} s{preparation}", self.cpu_time)?;
        writeln!(f, "history          {}\n\nlook at it with", self.history.display())?;
        let file = in_shell(&self.history);
        write!(f, "  dem-post info {file}")?;
        let driven = !self.driven_walls.is_empty();
        let more =
            [("report", true), ("cracks", self.bonds > 0), ("chains", self.has_reactions), ("stress-strain", driven)];
        for (command, _) in more.into_iter().filter(|(_, there)| *there && self.steps > 0) {
            let choose = driven && self.load_wall.is_none() && matches!(command, "report" | "stress-strain");
            write!(f, "\n  dem-post {command} {file}{}", if choose { " --wall NAME" } else { "" })?;
        }
        Ok(())
    }
}

/// The nonzero kinds of work in words, each number formatted by `count`; none if all are zero.
pub(crate) fn told(work: Work, count: impl Fn(u64) -> String) -> Option<String> {
    let Work { sweeps, newton, factorisations } = work;
    let kinds = [(newton, "Newton iterations"), (factorisations, "factorisations"), (sweeps, "sweeps")];
    let done = kinds.into_iter().filter(|(done, _)| *done > 0);
    let words: Vec<String> = done.map(|(done, name)| format!("{} {name}", count(done))).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

impl Summary {
    fn write_solves(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rate = |count: u64| format!("{:.2}", count as f64 / self.solved_steps.max(1) as f64);
        match told(self.work, rate) {
            Some(took) => {
                writeln!(f, "solver           {took} a solved step ({} of {})", self.solved_steps, self.steps)?;
            }
            None => writeln!(f, "solver           nothing to solve")?,
        }
        writeln!(
            f,
            "accuracy         worst residual {:.2e} (tolerance {:.0e}), {} steps missed it, {} solves not accepted",
            self.worst_residual, self.tolerance, self.missed_tolerance, self.rejected
        )?;
        match (self.worst_load_error, self.load_tolerance) {
            (Some(worst), Some(tolerance)) => {
                let missed = self.missed_load_tolerance;
                writeln!(
                    f,
                    "load error       worst {worst:.2e} (tolerance {tolerance:.0e}), {missed} steps missed it"
                )?;
            }
            (Some(worst), None) => {
                writeln!(
                    f,
                    "load error       worst {worst:.2e}, of elastic bonds (Gauss–Seidel has no tolerance for it)"
                )?;
            }
            (None, _) => {}
        }
        writeln!(
            f,
            "penetration      {:.2e} m, {:.1e} mean diameters",
            self.penetration,
            self.penetration / self.mean_diameter
        )?;
        if self.bonds > 0 {
            writeln!(f, "bond elongation  {:.2e} m at most, of intact bonds", self.bond_elongation)?;
        }
        writeln!(f, "external work    {:.4e} J", self.external_work)?;
        writeln!(f, "energy remainder {:.2e} J", self.energy_remainder)?;
        if self.bonds > 0 && !self.elastic {
            writeln!(
                f,
                "bond remainder   {:.2e} J, work of intact rigid bonds: solver error and finite rotations",
                self.bond_remainder
            )?;
        }
        Ok(())
    }

    fn write_bonds(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let broken: usize = self.broken.iter().sum();
        let [tension, shear, rolling, twist] = self.broken;
        let twist = if self.twists { format!(", twist {twist}") } else { String::new() };
        writeln!(
            f,
            "bonds            {}, broken {broken} ({:.1} %): tension {tension}, shear {shear}, rolling {rolling}{twist}",
            self.bonds,
            100.0 * broken as f64 / self.bonds as f64
        )?;
        Ok(())
    }

    /// Writes the loads of the load wall, or of each driven wall if the scene names no load wall.
    fn write_loads(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let chosen = self.driven_walls.iter().find(|loads| Some(&loads.wall) == self.load_wall.as_ref());
        let Some(loads) = chosen else { return self.write_walls(f) };
        if self.bonds > 0 {
            self.write_failure(f, loads)?;
        }
        if let Some(peak) = loads.peak() {
            writeln!(f, "peak load        {peak} (wall {})", loads.wall)?;
        }
        if let Some(splitting) = &self.splitting {
            writeln!(f, "splitting        {splitting}")?;
        }
        Ok(())
    }

    fn write_failure(&self, f: &mut fmt::Formatter<'_>, loads: &WallLoads) -> fmt::Result {
        let WallLoads { wall, failure, passed, .. } = loads;
        let load = |load: Option<f64>| load.map_or("none".into(), |n| format!("{} N (wall {wall})", number(n)));
        writeln!(f, "first break      {}", load(failure.first_break))?;
        let mut without: Vec<(f64, &str)> = vec![];
        for (k, strain) in STRAINS.into_iter().enumerate() {
            match failure.collapse[k] {
                Some(load) => {
                    let note = self.early_note(failure.early[k]);
                    writeln!(f, "collapse load    {} N (strain {strain:.0e}{note}; wall {wall})", number(load))?;
                }
                None if !passed[k] => writeln!(f, "collapse load    none (strain {strain:.0e})")?,
                None if self.elastic && failure.early[k] => {
                    without.push((strain, "elastically, before any bond broke"));
                }
                None => without.push((strain, "while no load acted")),
            }
        }
        for (strain, when) in without {
            writeln!(f, "strain           {strain:.0e} passed {when}: no collapse load")?;
        }
        writeln!(f, "5 % broken       {}", load(failure.broken_share))
    }

    /// Note on a collapse load of a rigid sample before any bond broke.
    fn early_note(&self, early: bool) -> &'static str {
        match (early, self.one_piece) {
            (false, _) => "",
            // one rigid piece: no motion is possible before the first break
            (true, true) => ", before any bond broke: solver error, not strain of the sample",
            (true, false) => ", before any bond broke: not all grains are bonded to one piece",
        }
    }

    /// Writes the loads of each driven wall.
    fn write_walls(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<(&str, String)> =
            self.driven_walls.iter().map(|loads| (loads.wall.as_str(), self.wall_line(loads))).collect();
        if lines.is_empty() && self.bonds > 0 {
            return match self.broken {
                [0, 0, 0, 0] => self.write_failure(f, &WallLoads::of("", false, false, &Collapse::default())),
                _ => writeln!(f, "                 no wall is driven: there is no applied force to report"),
            };
        }
        if lines.iter().all(|(_, line)| line.is_empty()) {
            return Ok(());
        }
        let names: Vec<&str> = lines.iter().map(|(wall, _)| *wall).collect();
        writeln!(f, "load wall        none: name one of {} as load_wall in the scene", names.join(", "))?;
        for (wall, line) in lines {
            writeln!(f, "{:<16} {line}", format!("wall {wall}"))?;
        }
        Ok(())
    }

    fn wall_line(&self, loads: &WallLoads) -> String {
        let load = |load: Option<f64>| quantity(load, "N");
        let mut parts = vec![];
        if self.bonds > 0 {
            let failure = &loads.failure;
            let collapse = |k: usize| format!("{} (strain {:.0e})", load(failure.collapse[k]), STRAINS[k]);
            parts.push(format!("first break {}", load(failure.first_break)));
            parts.push(format!("collapse {}, {}", collapse(0), collapse(1)));
            parts.push(format!("5 % broken {}", load(failure.broken_share)));
        }
        parts.extend(loads.peak().map(|peak| format!("peak {peak}")));
        parts.join("; ")
    }
}

fn counts<S: serde::Serializer>(work: &Work, to: S) -> Result<S::Ok, S::Error> {
    let Work { sweeps, newton, factorisations } = *work;
    to.collect_map([("sweeps", sweeps), ("newton_iterations", newton), ("factorisations", factorisations)])
}
