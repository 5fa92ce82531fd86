//! The report of a step, and the error of a step that could not be made.

use super::{Break, Counts, World};
use crate::dim::Dim;
use crate::solver::certificate::Verdict;
use crate::solver::{Route, SolveReport, SolveStatus, Work};
use std::fmt;

/// Largest number of parts into which fast bodies divide a step.
pub(super) const PARTS: u32 = 4096;

/// Largest number of bodies that a message names.
const NAMED: usize = 8;

/// The result of one step.
#[derive(Clone, Debug)]
pub struct StepReport<D: Dim> {
    /// Time at its end (s).
    pub time: f64,
    /// The worst status of its solves: `Accepted` if a residual or a load error missed the
    /// tolerance of the solver; never `Failed`.
    pub status: SolveStatus,
    /// The method that solved it: among the routes of its accepted solves, the last in the order of
    /// [`Route`].
    pub route: Route,
    /// Work of all its solves.
    pub work: Work,
    /// Largest residual of its accepted solves (–).
    pub residual: f64,
    /// Largest load error of its accepted solves (–), zero for a solve whose residual is zero;
    /// `None` if no solve reports one.
    pub load_error: Option<f64>,
    /// ‖M (v⁺ − v⁻)/h‖ over the grains that are free to move, over the norm of the forces on the
    /// sample: gravity, loads, and those that drive walls (–). Zero without such forces; for a step
    /// in parts, the largest of its parts. In a sample that should be at rest all acceleration is
    /// false.
    pub false_acceleration: f64,
    /// Contacts by status.
    pub counts: Counts,
    /// Bonds that broke, in the order of the cascade rounds.
    pub breaks: Vec<Break<D>>,
    /// Deepest overlap of a dry contact at mid-step (m).
    pub penetration: f64,
    /// Largest difference between the length of an intact bond at mid-step and its length at rest
    /// (m).
    pub bond_elongation: f64,
    /// Number of refused solves, each of which halved a part of the step.
    pub rejected: u32,
    /// Number of parts of the step: 1, or more if a solve was refused or a body was too fast.
    pub substeps: u32,
    /// Mean stress over the parts of a step in parts (Pa).
    pub mean_stress: Option<Vec<f64>>,
}

impl<D: Dim> StepReport<D> {
    /// Mean stress in the step that the `world` has just made (Pa): [`World::stress`], or its mean
    /// over the parts.
    pub fn stress(&self, world: &World<D>) -> Vec<f64> {
        self.mean_stress.clone().unwrap_or_else(|| world.stress())
    }

    /// The report of two half steps as that of one step; `refused` solves caused the halving.
    pub(super) fn followed_by(self, second: Self, refused: u32) -> Self {
        let mut breaks = self.breaks;
        let rounds = breaks.last().map_or(0, |b| b.round + 1);
        breaks.extend(second.breaks.into_iter().map(|b| Break { round: b.round + rounds, ..b }));
        let missed = [self.status, second.status].contains(&SolveStatus::Accepted);
        Self {
            status: if missed { SolveStatus::Accepted } else { SolveStatus::Converged },
            route: self.route.max(second.route),
            work: self.work + second.work,
            residual: self.residual.max(second.residual),
            load_error: larger(self.load_error, second.load_error),
            false_acceleration: self.false_acceleration.max(second.false_acceleration),
            breaks,
            penetration: self.penetration.max(second.penetration),
            bond_elongation: self.bond_elongation.max(second.bond_elongation),
            rejected: self.rejected + second.rejected + refused,
            substeps: self.substeps + second.substeps,
            ..second
        }
    }
}

/// The larger of two load errors, either of which may not be reported.
fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::max)
}

/// The solves of one step taken together.
#[derive(Clone, Copy)]
pub(super) struct Solves {
    pub route: Route,
    pub work: Work,
    pub residual: f64,
    pub load_error: Option<f64>,
    missed_aim: bool,
}

impl Default for Solves {
    fn default() -> Self {
        let route = Route::Extrapolation;
        Self { route, work: Work::default(), residual: 0.0, load_error: None, missed_aim: false }
    }
}

impl Solves {
    pub fn add(&mut self, solve: SolveReport) {
        self.route = self.route.max(solve.route);
        self.work = self.work + solve.work;
        self.residual = self.residual.max(solve.residual);
        self.load_error = larger(self.load_error, solve.load_error_beyond_rounding());
        self.missed_aim |= solve.status != SolveStatus::Converged;
    }

    pub fn status(&self) -> SolveStatus {
        if self.missed_aim { SolveStatus::Accepted } else { SolveStatus::Converged }
    }
}

/// Why a step could not be made. The world is in its state after the last accepted step.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub enum StepError {
    /// No solve was accepted, down to the shortest step that the settings allow.
    NotAccepted {
        /// Time at which the step that failed began (s), or its half; with
        /// [`crate::bond::Rupture::NextEvent`] the time of the loads.
        time: f64,
        /// The shortest step tried (s); zero with [`crate::bond::Rupture::NextEvent`].
        step: f64,
        /// Residual of its solve (–).
        residual: f64,
        /// Velocity error of its solve (–), if the residual alone would be accepted.
        velocity_error: Option<f64>,
        /// Load error of its solve (–), if that is what was not accepted.
        load_error: Option<f64>,
        /// Iterations of its solve.
        iterations: u64,
        /// The bodies of the contact that is furthest from its law (walls follow the grains).
        pair: [u32; 2],
        /// The verdict on its problem, with bodies by index (walls follow the grains).
        verdict: Verdict<u32>,
    },
    /// A grain would pass through another body, or be pushed by one that it passes at a distance,
    /// in the shortest part of a step.
    TooFast {
        /// Time at which the part of the step that failed began (s).
        time: f64,
        /// Grain, and grain or wall (walls follow the grains).
        pair: [u32; 2],
    },
    /// Two bodies move beyond the law of their contact although the residual is small enough.
    Yielded {
        /// Time at which the step that failed began (s), or its half.
        time: f64,
        /// The pair and its displacement.
        violation: Violation,
    },
    /// With [`crate::bond::Rupture::NextEvent`], the bodies do not stay at rest under the loads of
    /// the last event.
    Unbalanced {
        /// Time of the last accepted state (s).
        time: f64,
        /// Time of the loads (s).
        load_time: f64,
        /// The body with the largest momentum (walls follow the grains).
        body: u32,
    },
    /// A membrane has no surface: its disk rolls past the sample, or does not fit between the
    /// plates.
    NoSurface {
        /// Time of the last accepted state (s).
        time: f64,
        /// The plates, if it is between plates (walls follow the grains).
        walls: Option<[u32; 2]>,
        /// Radius of the disk (m).
        disk: f64,
    },
    /// A velocity is not a finite number.
    NotFinite {
        /// The body (walls follow the grains).
        body: u32,
        /// Time of the last accepted state (s); with [`crate::bond::Rupture::NextEvent`] the time
        /// of the loads.
        time: f64,
    },
}

/// A pair that moves beyond its contact law in a solution: a dry contact closes, or a rigid bond
/// changes its length.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Grain, and grain or wall (walls follow the grains).
    pub pair: [u32; 2],
    /// Displacement over the smaller radius (–).
    pub share: f64,
    /// Whether `share` is the sum over the run so far; otherwise it is that of one step.
    pub accumulated: bool,
    /// If the reactions balance each other without stopping the bodies, the walls that carry them
    /// (walls follow the grains), at least one of them driven.
    pub jammed: Option<Vec<u32>>,
    /// The verdict on the problem, with bodies by index (walls follow the grains).
    pub verdict: Verdict<u32>,
}

impl StepError {
    /// The verdict on the unsolved problem, if the error is that of a solve.
    pub fn verdict(&self) -> Option<&Verdict<u32>> {
        match self {
            Self::NotAccepted { verdict, .. } | Self::Yielded { violation: Violation { verdict, .. }, .. } => {
                Some(verdict)
            }
            Self::TooFast { .. } | Self::Unbalanced { .. } | Self::NoSurface { .. } | Self::NotFinite { .. } => None,
        }
    }

    /// The message; `name` maps the index of a body to its name, grains first, then walls.
    pub fn message(&self, name: &dyn Fn(u32) -> String) -> String {
        match self {
            Self::NotAccepted { time, step, residual, velocity_error, load_error, iterations, pair, verdict } => {
                let further = |what: &str, error: &Option<f64>| {
                    error.map(|error| format!(", {what} error {error:.2e}")).unwrap_or_default()
                };
                let further = further("velocity", velocity_error) + &further("load", load_error);
                let [opening, known] = match verdict {
                    Verdict::NoSolution(bodies) => {
                        [format!("no motion satisfies {}", listed(bodies, name)), String::new()]
                    }
                    verdict => {
                        let furthest = listed(pair, name);
                        let known = format!("; {furthest} are furthest from their contact law; {}", existence(verdict));
                        ["no convergence".into(), known]
                    }
                };
                let (under, of) = match *step {
                    0.0 => ("under the loads of", String::new()),
                    step => ("at", format!(", in a step of {step:.2e} s")),
                };
                format!(
                    "{opening} {under} t = {time:.6e} s: residual {residual:.2e}{further} after {iterations} \
                     iterations{of}{known}"
                )
            }
            Self::TooFast { time, pair } => format!(
                "{} is too fast for the step at t = {time:.6e} s: even in {} parts it would pass through {}: shorten the step, \
                 or look why it is so fast",
                name(pair[0]),
                PARTS,
                name(pair[1])
            ),
            Self::Yielded { time, violation } => violation.message(*time, name),
            Self::Unbalanced { load_time, body, .. } => format!(
                "no equilibrium under the loads of {load_time:.6e} s: {} moves, and others with it",
                name(*body)
            ),
            Self::NoSurface { time, walls, disk } => {
                let between = walls.map(|walls| format!(" between {}", listed(&walls, name))).unwrap_or_default();
                format!(
                    "the membrane finds no surface of the sample{between} at t = {time:.6e} s: a disk of radius {disk:.6e} m \
                     rolls past the grains there, or does not fit"
                )
            }
            Self::NotFinite { time, body } => format!(
                "the velocity of {} is not a finite number at t = {time:.6e} s: look for grains squeezed between bodies that \
                 cannot yield",
                name(*body)
            ),
        }
    }
}

/// What the verdict says of the existence of a solution.
fn existence(verdict: &Verdict<u32>) -> &'static str {
    match verdict {
        Verdict::NoSolution(_) => "there is no solution",
        Verdict::Guaranteed => "a solution exists, which the solver has not found",
        Verdict::Undecided => "a solution is not guaranteed",
    }
}

/// Names of bodies for a sentence; of many bodies the last [`NAMED`], among them the walls, and the
/// number of the others.
fn listed(bodies: &[u32], name: &dyn Fn(u32) -> String) -> String {
    let (others, named) = bodies.split_at(bodies.len().saturating_sub(NAMED));
    let mut names: Vec<String> = named.iter().map(|body| name(*body)).collect();
    if !others.is_empty() {
        names.push(format!("{} more", others.len()));
    }
    match names.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        names => names.concat(),
    }
}

impl Violation {
    /// Whether a finer solve or a shorter step may avoid the violation.
    pub(super) fn is_of_the_solve(&self) -> bool {
        !self.accumulated && self.jammed.is_none()
    }

    fn message(&self, time: f64, name: &dyn Fn(u32) -> String) -> String {
        let [i, j] = self.pair.map(name);
        let span = if self.accumulated { "since the start of the run" } else { "in one step" };
        let what = format!("{i} and {j} move {:.1e} of a radius beyond their contact law {span}", self.share);
        let known = match &self.jammed {
            None => "though the residual is small enough".into(),
            Some(walls) => format!("and the reactions of {} only balance each other", listed(walls, name)),
        };
        match &self.verdict {
            Verdict::NoSolution(bodies) => {
                format!("no motion satisfies {} at t = {time:.6e} s: {what}, {known}", listed(bodies, name))
            }
            // the sum over many steps says little of the last problem
            _ if self.accumulated => format!("{what} at t = {time:.6e} s, {known}"),
            verdict => format!("not solved at t = {time:.6e} s: {what}, {known}; {}", existence(verdict)),
        }
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message(&|body| format!("body {body} (grains first, then walls)")))
    }
}

impl std::error::Error for StepError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dim::D2;

    fn solve(route: Route, residual: f64, load_error: Option<f64>) -> SolveReport {
        SolveReport { status: SolveStatus::Converged, route, work: Work::default(), residual, load_error }
    }

    fn together(solves: &[SolveReport]) -> Solves {
        let mut all = Solves::default();
        solves.iter().for_each(|solve| all.add(*solve));
        all
    }

    #[test]
    fn the_route_of_a_step_is_the_last_in_order_of_those_of_its_solves() {
        use Route::{ActiveSet, Extrapolation, InteriorPoint, Sweeps};
        for (routes, step) in [
            (&[Extrapolation][..], Extrapolation),
            (&[Extrapolation, ActiveSet], ActiveSet),
            (&[InteriorPoint, ActiveSet], InteriorPoint),
            (&[ActiveSet, Sweeps, InteriorPoint], Sweeps),
        ] {
            let solves: Vec<SolveReport> = routes.iter().map(|route| solve(*route, 1e-9, None)).collect();
            assert_eq!(together(&solves).route, step, "{routes:?}");
        }
    }

    #[test]
    fn a_message_names_the_last_eight_bodies_and_counts_the_others() {
        let text = |bodies: std::ops::Range<u32>| listed(&bodies.collect::<Vec<_>>(), &|body| format!("b{body}"));
        assert_eq!(text(3..4), "b3");
        assert_eq!(text(3..5), "b3 and b4");
        assert_eq!(text(0..8), "b0, b1, b2, b3, b4, b5, b6 and b7");
        assert_eq!(text(0..10), "b2, b3, b4, b5, b6, b7, b8, b9 and 2 more");
    }

    /// A step in one part.
    fn whole() -> StepReport<D2> {
        let Solves { route, work, residual, load_error, .. } = Solves::default();
        StepReport {
            time: 0.0,
            status: SolveStatus::Converged,
            route,
            work,
            residual,
            load_error,
            false_acceleration: 0.0,
            counts: Counts::default(),
            breaks: Vec::new(),
            penetration: 0.0,
            bond_elongation: 0.0,
            rejected: 0,
            substeps: 1,
            mean_stress: None,
        }
    }

    /// Each refused solve splits one part into two, in either half.
    #[test]
    fn a_step_has_one_part_more_than_refused_solves() {
        let halves = || whole().followed_by(whole(), 1);
        let steps = [halves(), halves().followed_by(whole(), 1), whole().followed_by(halves(), 1)];
        assert_eq!(steps.map(|step| (step.rejected, step.substeps)), [(1, 2), (2, 3), (2, 3)]);
        let both = halves().followed_by(halves(), 1);
        assert_eq!((both.rejected, both.substeps), (3, 4));
        // the step reports the larger value of its halves
        let late = || StepReport { false_acceleration: 2.0, ..whole() };
        for step in [late().followed_by(whole(), 1), whole().followed_by(late(), 1)] {
            assert_eq!(step.false_acceleration, 2.0);
        }
        // halving for fast bodies counts no refused solve
        let fast = halves().followed_by(halves(), 0);
        assert_eq!((fast.rejected, fast.substeps), (2, 4));
    }

    #[test]
    fn the_load_error_of_a_step_is_that_of_the_solves_that_report_one() {
        let (none, some) = (solve(Route::Sweeps, 1e-9, None), solve(Route::ActiveSet, 1e-9, Some(3e-6)));
        assert_eq!(together(&[none, none]).load_error, None);
        // in either order
        assert_eq!(together(&[none, some]).load_error, Some(3e-6));
        assert_eq!(together(&[some, none]).load_error, Some(3e-6));
        assert_eq!(together(&[some, solve(Route::ActiveSet, 1e-9, Some(4e-6))]).load_error, Some(4e-6));
        // without a residual it is round-off
        assert_eq!(together(&[solve(Route::ActiveSet, 0.0, Some(1.0))]).load_error, Some(0.0));
    }
}
