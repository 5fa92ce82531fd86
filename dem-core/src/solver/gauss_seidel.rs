//! Non-linear Gauss–Seidel: the method of successive equilibria (Moreau, Jean; paper §2.1).
//!
//! One sweep visits every contact in the order of its group and key, reads the relative velocity from the nodes,
//! betters the contact's impulse by its law and gives the change to the nodes at once. No matrix is assembled.
//! Information moves one neighbour a sweep, so long chains of bonds converge slowly: the residual says how far.
//! Anderson's acceleration of bursts of sweeps, an option, takes ten times fewer of them where bonds abound.

use super::anderson::Anderson;
use super::{ContactSolver, SolveReport, SolveStatus, Work};
use crate::contact::{Law, LocalSolve};
use crate::dim::{Dim, Vect};
use crate::problem::residual::residual;
use crate::problem::{ContactProblem, Group, Nodes};

/// Settings of [`GaussSeidel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussSeidelSettings {
    /// How one contact is bettered.
    pub local: LocalSolve,
    /// Residual that the solver aims at (–).
    pub tolerance: f64,
    /// Largest residual that is accepted (–), at least `tolerance`.
    pub accept: f64,
    /// Most sweeps in one solve.
    pub max_sweeps: u64,
    /// Steps that Anderson's acceleration remembers; 0 for plain sweeps.
    pub acceleration: usize,
}

/// Sweeps between two accelerated steps.
pub(super) const BURST: u64 = 4;
/// Accelerated steps between two looks at the residual.
pub(super) const LOOK: u64 = 4;
/// Plain sweeps before the acceleration begins: easy problems need no more.
pub(super) const PLAIN: u64 = 32;
/// Steps for the acceleration to remember that serve well.
pub(super) const MEMORY: usize = 8;

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

    fn report(&self, sweeps: u64, residual: f64) -> SolveReport {
        let status = if residual <= self.settings.tolerance {
            SolveStatus::Converged
        } else if residual <= self.settings.accept {
            SolveStatus::Accepted
        } else {
            SolveStatus::Failed
        };
        SolveReport { status, work: Work { sweeps, ..Work::default() }, residual, load_error: None }
    }
}

/// One visit of every contact of a group.
#[inline]
fn sweep_group<D: Dim, L: Law>(nodes: &mut Nodes<D>, group: &mut Group<D, L>, local: LocalSolve) {
    for c in group {
        let arm = c.law.arm();
        let u = nodes.relative_velocity(&c.link, arm);
        let r = c.law.improve(local, c.r, u);
        nodes.apply(&c.link, arm, r - c.r);
        c.r = r;
    }
}

/// One sweep over all contacts: bonds, then dry contacts, then frictionless ones.
pub fn sweep<D: Dim>(problem: &mut ContactProblem<D>, local: LocalSolve) {
    // a constant for each call, so that the choice is made outside the loops
    match local {
        LocalSolve::Exact => {
            sweep_group(&mut problem.nodes, &mut problem.bonded, LocalSolve::Exact);
            sweep_group(&mut problem.nodes, &mut problem.elastic, LocalSolve::Exact);
            sweep_group(&mut problem.nodes, &mut problem.dry, LocalSolve::Exact);
            sweep_group(&mut problem.nodes, &mut problem.frictionless, LocalSolve::Exact);
        }
        LocalSolve::PredictorCorrector => {
            sweep_group(&mut problem.nodes, &mut problem.bonded, LocalSolve::PredictorCorrector);
            sweep_group(&mut problem.nodes, &mut problem.elastic, LocalSolve::PredictorCorrector);
            sweep_group(&mut problem.nodes, &mut problem.dry, LocalSolve::PredictorCorrector);
            sweep_group(&mut problem.nodes, &mut problem.frictionless, LocalSolve::PredictorCorrector);
        }
    }
}

/// All impulses in one list.
fn gather<D: Dim>(problem: &ContactProblem<D>) -> Vec<f64> {
    fn group<D: Dim, L: Law>(group: &Group<D, L>, out: &mut Vec<f64>) {
        for c in group {
            out.push(c.r.n);
            out.extend_from_slice(c.r.t.as_slice());
            out.extend_from_slice(c.r.m.as_slice());
        }
    }
    let mut out = Vec::with_capacity(problem.len() * 3);
    group(&problem.bonded, &mut out);
    group(&problem.elastic, &mut out);
    group(&problem.dry, &mut out);
    group(&problem.frictionless, &mut out);
    out
}

/// The inverse of [`gather`], and the velocities that belong to the impulses.
fn scatter<D: Dim>(problem: &mut ContactProblem<D>, from: &[f64]) {
    fn group<D: Dim, L: Law>(group: &mut Group<D, L>, mut from: &[f64]) -> usize {
        let rows = 1 + L::T::LEN + L::B::LEN;
        for c in group.iter_mut() {
            c.r.n = from[0];
            c.r.t = L::T::from_slice(&from[1..][..L::T::LEN]);
            c.r.m = L::B::from_slice(&from[1 + L::T::LEN..][..L::B::LEN]);
            from = &from[rows..];
        }
        rows * group.len()
    }
    let bonded = group(&mut problem.bonded, from);
    let elastic = bonded + group(&mut problem.elastic, &from[bonded..]);
    let dry = elastic + group(&mut problem.dry, &from[elastic..]);
    group(&mut problem.frictionless, &from[dry..]);
    problem.velocities_from_reactions();
}

impl GaussSeidel {
    /// At most `most` sweeps alone; returns how many, and the residual.
    fn plain<D: Dim>(&self, problem: &mut ContactProblem<D>, most: u64) -> (u64, f64) {
        let mut error = residual(problem);
        let mut sweeps = 0;
        while error > self.settings.tolerance && sweeps < most {
            // the residual costs about a sweep: look at it ever more rarely, at most every 64 sweeps
            let burst = (1 + sweeps / 4).min(64).min(most - sweeps);
            for _ in 0..burst {
                sweep(problem, self.settings.local);
            }
            sweeps += burst;
            error = residual(problem);
            if error <= self.settings.tolerance {
                // what counts is the error of the impulses, without the rounding of the sweeps' increments
                problem.velocities_from_reactions();
                error = residual(problem);
            }
        }
        if sweeps >= most {
            problem.velocities_from_reactions();
            error = residual(problem);
        }
        (sweeps, error)
    }

    /// Bursts of sweeps, accelerated, after some plain ones. What it ends with is the result of a burst: every impulse
    /// is in its cone.
    fn accelerated<D: Dim>(&self, problem: &mut ContactProblem<D>) -> (u64, f64) {
        let (mut sweeps, mut error) = self.plain(problem, PLAIN.min(self.settings.max_sweeps));
        if error <= self.settings.tolerance {
            return (sweeps, error);
        }
        let mut memory = Anderson::new(self.settings.acceleration, gather(problem));
        while error > self.settings.tolerance && sweeps < self.settings.max_sweeps {
            for _ in 0..BURST {
                sweep(problem, self.settings.local);
            }
            sweeps += BURST;
            if sweeps.is_multiple_of(LOOK * BURST) || sweeps >= self.settings.max_sweeps {
                problem.velocities_from_reactions();
                error = residual(problem);
            }
            if error > self.settings.tolerance && sweeps < self.settings.max_sweeps {
                let next = memory.next(gather(problem));
                scatter(problem, next);
            }
        }
        (sweeps, error)
    }
}

impl<D: Dim> ContactSolver<D> for GaussSeidel {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        problem.velocities_from_reactions();
        let (sweeps, error) = match self.settings.acceleration {
            0 => self.plain(problem, self.settings.max_sweeps),
            _ => self.accelerated(problem),
        };
        self.report(sweeps, error)
    }
}
