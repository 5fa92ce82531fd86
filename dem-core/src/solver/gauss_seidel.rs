//! Non-linear Gauss–Seidel: the method of successive equilibria (Moreau, Jean; paper §2.1).
//!
//! One sweep visits every contact in the order of its group and key, reads the relative velocity
//! from the nodes, updates the contact's impulse by its law and applies the change to the nodes at
//! once. No matrix is assembled. Information moves one neighbour per sweep, so long chains of bonds
//! converge slowly; the residual measures the convergence. Optionally, Anderson's acceleration of
//! bursts of sweeps reduces their number by a factor of ten in bonded samples.

use super::anderson::Anderson;
use super::solvable::Solvable;
use super::{ContactSolver, Route, SolveReport, SolveStatus, Work};
use crate::contact::{Law, LocalSolve};
use crate::dim::Dim;
use crate::problem::residual::elastic_error;
use crate::problem::{ContactProblem, Group, GroupVisitorMut, Nodes, blocks};
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::tuning::{defaults, gauss_seidel as tuning};
use crate::threads::among_threads;

/// Settings of [`GaussSeidel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussSeidelSettings {
    /// How the reaction of one contact is updated.
    pub local: LocalSolve,
    /// Target residual (–).
    pub tolerance: f64,
    /// Largest residual that is accepted (–), at least `tolerance`.
    pub accept: f64,
    /// Most sweeps in one solve.
    pub max_sweeps: u64,
    /// Steps stored by Anderson's acceleration; 0 for plain sweeps.
    pub acceleration: usize,
}

impl Default for GaussSeidelSettings {
    /// Exact local solves to a residual of 10⁻⁸, residuals up to 10⁻⁶ accepted, no acceleration.
    fn default() -> Self {
        Self {
            local: LocalSolve::Exact,
            tolerance: defaults::TOLERANCE,
            accept: defaults::ACCEPT,
            max_sweeps: defaults::MAX_SWEEPS,
            acceleration: 0,
        }
    }
}

/// Non-linear Gauss–Seidel on node velocities.
#[derive(Clone, Copy, Debug)]
pub struct GaussSeidel {
    settings: GaussSeidelSettings,
}

impl GaussSeidel {
    /// A solver with these settings.
    pub fn new(settings: GaussSeidelSettings) -> Self {
        Self { settings }
    }
}

/// One visit of every contact of a group.
#[inline]
fn sweep_group<D: Dim, L: Law>(nodes: &mut Nodes<D>, group: &mut Group<D, L>, local: LocalSolve) {
    blocks::for_each(nodes, group, |span, c| {
        let arms = c.law.arms();
        let u = span.relative_velocity(&c.link, arms);
        let r = c.law.improve(local, c.r, u);
        span.apply(&c.link, arms, r - c.r);
        c.r = r;
    });
}

struct Sweep(LocalSolve);

impl<D: Dim> GroupVisitorMut<D> for Sweep {
    #[inline]
    fn visit<L: Law>(&mut self, nodes: &mut Nodes<D>, group: &mut Group<D, L>) {
        // a constant argument in each call moves the branch out of the loops
        match self.0 {
            LocalSolve::Exact => sweep_group(nodes, group, LocalSolve::Exact),
            LocalSolve::PredictorCorrector => sweep_group(nodes, group, LocalSolve::PredictorCorrector),
        }
    }
}

/// One sweep over all contacts: bonds, then dry contacts, then frictionless ones.
pub fn sweep<D: Dim>(problem: &mut ContactProblem<D>, local: LocalSolve) {
    problem.visit_groups_mut(&mut Sweep(local));
}

/// At most `most` plain sweeps; returns how many, and the residual.
fn plain(problem: &mut impl Solvable, settings: &GaussSeidelSettings, most: u64) -> (u64, f64) {
    let mut error = problem.residual();
    let mut sweeps = 0;
    while error > settings.tolerance && sweeps < most {
        // the residual costs about a sweep: evaluate it ever more rarely, up to 64 sweeps apart
        let burst = (1 + sweeps / 4).min(64).min(most - sweeps);
        for _ in 0..burst {
            problem.sweep(settings.local);
        }
        sweeps += burst;
        error = problem.residual();
        if error <= settings.tolerance {
            // decide on the residual without the round-off of the sweeps' increments
            problem.velocities_from_reactions();
            error = problem.residual();
        }
    }
    if sweeps >= most {
        problem.velocities_from_reactions();
        error = problem.residual();
    }
    (sweeps, error)
}

/// Plain sweeps, then accelerated bursts of sweeps. The result is that of a burst, not of an
/// extrapolation: every impulse is in its cone.
fn accelerated(problem: &mut impl Solvable, settings: &GaussSeidelSettings) -> (u64, f64) {
    let (mut sweeps, mut error) = plain(problem, settings, tuning::PLAIN.min(settings.max_sweeps));
    if error <= settings.tolerance {
        return (sweeps, error);
    }
    let mut memory = Anderson::new(settings.acceleration, problem.gather());
    while error > settings.tolerance && sweeps < settings.max_sweeps {
        let burst = tuning::BURST.min(settings.max_sweeps - sweeps);
        for _ in 0..burst {
            problem.sweep(settings.local);
        }
        sweeps += burst;
        if sweeps.is_multiple_of(tuning::BURST * tuning::BURST) || sweeps >= settings.max_sweeps {
            problem.velocities_from_reactions();
            error = problem.residual();
        }
        if error > settings.tolerance && sweeps < settings.max_sweeps {
            let next = memory.next(problem.gather());
            problem.scatter(next);
        }
    }
    (sweeps, error)
}

/// The whole solve, from the impulses that the problem holds.
pub(super) fn iterate(problem: &mut impl Solvable, settings: &GaussSeidelSettings) -> SolveReport {
    problem.velocities_from_reactions();
    let (sweeps, residual) = match settings.acceleration {
        0 => plain(problem, settings, settings.max_sweeps),
        _ => accelerated(problem, settings),
    };
    let status = SolveStatus::of(residual, settings.tolerance, settings.accept);
    let route = Route::Sweeps;
    SolveReport { status, route, work: Work { sweeps, ..Work::default() }, residual, load_error: None }
}

impl<D: Dim> ContactSolver<D> for GaussSeidel {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        let settings = self.settings;
        let report = among_threads(blocks::are_several(problem.nodes.grains), || iterate(problem, &settings));
        let load_error = (!problem.elastic.is_empty()).then(|| elastic_error(problem));
        SolveReport { load_error, ..report }
    }

    fn snapshot(&self) -> Box<dyn ContactSolver<D>> {
        Box::new(*self)
    }

    /// No state is kept.
    fn save(&self, _: &mut Saved) {}

    fn restore(&mut self, _: &mut Reader) -> Result<(), Mismatch> {
        Ok(())
    }
}
