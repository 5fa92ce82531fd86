//! What a run tells at its end, on stdout.

use crate::collapse::{Failure, STRAINS};
use crate::output::{in_shell, number};
use dem_core::solver::Work;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// The end of the scene's time.
    Time,
    /// The wall has moved far enough.
    WallTravel,
    /// Enough bonds have broken.
    BrokenFraction,
    /// Ctrl-C or SIGTERM.
    Interrupted,
    /// A step was not solved.
    NoConvergence,
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The history.
    pub history: PathBuf,
    /// Why it ended.
    pub ending: Ending,
    /// Steps made.
    pub steps: u64,
    /// Whether a wall is driven: then there is a curve of stress and strain.
    #[serde(skip)]
    pub driven: bool,
    /// Whether contacts carry normal forces at the end, and the history has them: then there are chains.
    #[serde(skip)]
    pub carries: bool,
    /// Simulated time (s).
    pub time: f64,
    /// Grains.
    pub grains: usize,
    /// Solid fraction of a random sample in its box (–).
    pub solid_fraction: Option<f64>,
    /// Bonds at the start.
    pub bonds: usize,
    /// Where the scene asks for bonds that bear anything, the gap up to which it bonds grains, over their mean diameter (–).
    #[serde(skip)]
    pub gap_tolerance: Option<f64>,
    /// Whether they are elastic: then the sample may deform before any breaks.
    pub elastic: bool,
    /// Bonds broken in tension, shear, rolling and twist.
    pub broken: [usize; 4],
    /// Whether bonds resist twist.
    pub twists: bool,
    /// Loads at which the sample failed (N).
    pub failure: Failure,
    /// Tolerance of the solver (–).
    pub tolerance: f64,
    /// Largest residual of an accepted solve (–).
    pub worst_residual: f64,
    /// Sweeps of all solves.
    #[serde(serialize_with = "counts")]
    pub work: Work,
    /// Steps that were accepted and missed the tolerance.
    pub missed_tolerance: u64,
    /// Solves that were not accepted: their steps were halved.
    pub rejected: u64,
    /// Deepest overlap (m).
    pub penetration: f64,
    /// Mean diameter of the grains (m).
    pub mean_diameter: f64,
    /// Work of forces and drives (J).
    pub external_work: f64,
    /// Energy that the books do not account for (J).
    pub energy_remainder: f64,
    /// Energy lost in intact bonds, which rigid bonds should not lose (J).
    pub bond_remainder: f64,
    /// Processor time of the whole program (s).
    pub cpu_time: f64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ending = match self.ending {
            Ending::Time => "the end of its time",
            Ending::WallTravel => "the wall has moved as far as the scene lets it",
            Ending::BrokenFraction => "as many bonds broken as the scene lets break",
            Ending::Interrupted => "interrupted",
            Ending::NoConvergence => "a step was not solved",
        };
        writeln!(f, "ended            t = {:.6} s after {} steps: {ending}", self.time, self.steps)?;
        match self.solid_fraction {
            Some(fraction) => writeln!(f, "sample           {} grains, solid fraction {fraction:.4}", self.grains)?,
            None => writeln!(f, "sample           {} grains", self.grains)?,
        }
        match self.gap_tolerance {
            _ if self.bonds > 0 => self.write_bonds(f)?,
            Some(gap) => writeln!(
                f,
                "bonds            none, though the scene asks for them: no two grains are within bonds.gap_tolerance, {gap} mean \
                 diameters"
            )?,
            None => {}
        }
        if self.steps > 0 {
            self.write_solves(f)?;
        }
        writeln!(f, "CPU time         {:.1} s", self.cpu_time)?;
        writeln!(f, "history          {}\n\nlook at it with", self.history.display())?;
        let file = in_shell(&self.history);
        write!(f, "  dem-post info {file}")?;
        let more =
            [("report", true), ("cracks", self.bonds > 0), ("chains", self.carries), ("stress-strain", self.driven)];
        for (command, _) in more.into_iter().filter(|(_, there)| *there && self.steps > 0) {
            write!(f, "\n  dem-post {command} {file}")?;
        }
        Ok(())
    }
}

/// The kinds of work that were done, each as `count` tells it; none where nothing was.
pub(crate) fn told(work: Work, count: impl Fn(u64) -> String) -> Option<String> {
    let Work { sweeps, newton, factorisations } = work;
    let kinds = [(newton, "Newton iterations"), (factorisations, "factorisations"), (sweeps, "sweeps")];
    let done = kinds.into_iter().filter(|(done, _)| *done > 0);
    let words: Vec<String> = done.map(|(done, name)| format!("{} {name}", count(done))).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

impl Summary {
    fn write_solves(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rate = |count: u64| format!("{:.2}", count as f64 / self.steps.max(1) as f64);
        let took = told(self.work, rate).map_or_else(|| "nothing to solve".into(), |took| took + " a step");
        writeln!(f, "solver           {took}")?;
        writeln!(
            f,
            "accuracy         worst residual {:.2e} (tolerance {:.0e}), {} steps missed it, {} solves not accepted",
            self.worst_residual, self.tolerance, self.missed_tolerance, self.rejected
        )?;
        writeln!(
            f,
            "penetration      {:.2e} m, {:.1e} mean diameters",
            self.penetration,
            self.penetration / self.mean_diameter
        )?;
        writeln!(f, "external work    {:.4e} J", self.external_work)?;
        writeln!(f, "energy remainder {:.2e} J", self.energy_remainder)?;
        if self.bonds > 0 && !self.elastic {
            writeln!(f, "bond remainder   {:.2e} J, the work of intact bonds: it should be zero", self.bond_remainder)?;
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
        let Failure { first_break, collapse, early, broken_share } = self.failure;
        if broken > 0 && first_break.is_none() {
            return writeln!(f, "                 no wall is driven: there is no applied force to tell");
        }
        let load = |load: Option<f64>| load.map_or("none".into(), |n| format!("{} N", number(n)));
        writeln!(f, "first break      {}", load(first_break))?;
        for ((collapse, early), strain) in collapse.into_iter().zip(early).zip(STRAINS) {
            // rigid grains and bonds: before the first break nothing can have moved
            let note = if early && !self.elastic {
                ", before any bond broke: the solver's own strain, not the sample's"
            } else {
                ""
            };
            writeln!(f, "collapse load    {} (strain {strain:.0e}{note})", load(collapse))?;
        }
        writeln!(f, "5 % broken       {}", load(broken_share))
    }
}

fn counts<S: serde::Serializer>(work: &Work, to: S) -> Result<S::Ok, S::Error> {
    let Work { sweeps, newton, factorisations } = *work;
    to.collect_map([("sweeps", sweeps), ("newton_iterations", newton), ("factorisations", factorisations)])
}
