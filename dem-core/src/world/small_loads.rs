//! Errors of solves where next to nothing acts: they are relative to loads and velocities that
//! vanish, beside reactions that friction has locked in.

use super::World;
use super::assembly::TOUCHING;
use crate::bond::BondStatus;
use crate::contact::Law;
use crate::dim::{Dim, Vect};
use crate::problem::residual::wrong_velocity;
use crate::problem::{Contact, ContactProblem, Nodes, Visitor};
use crate::solver::{SolveReport, SolveStatus};

/// Share of the largest reaction, below which impulses on bodies count as that large.
const SMALL: f64 = 1e-3;

impl<D: Dim> World<D> {
    /// The report of a solve with its errors relative to loads that matter, and accepted where its
    /// false motion is nothing.
    pub(super) fn judged(&self, solve: SolveReport, problem: &ContactProblem<D>) -> SolveReport {
        self.accepted_as_rest(self.beside_strengths(solve, problem), problem)
    }

    /// Where all forces are given, the load error relative to the impulses on the bodies or, if
    /// larger, to a thousandth of the largest reaction, but no more than of what the weakest bond
    /// bears in a step of the scene; and the status by such a velocity error. Where walls drive the
    /// sample, reactions grow without loads.
    fn beside_strengths(&self, solve: SolveReport, problem: &ContactProblem<D>) -> SolveReport {
        let solver = &self.settings.solver;
        let (Some(aim), Some(load_error)) = (solver.load_tolerance(), solve.load_error) else { return solve };
        let missed = solve.status != SolveStatus::Converged;
        if !missed || solve.residual.is_nan() || solve.residual > solver.accept() || is_driven(problem) {
            return solve;
        }
        let intact = self.bonds.iter().filter(|bond| bond.status == BondStatus::Intact);
        let weakest = intact.map(|bond| bond.strength).fold(f64::INFINITY, f64::min);
        let mut largest = Largest(0.0);
        problem.visit(&mut largest);
        let floor = SMALL * largest.0.sqrt().min(self.settings.step * weakest);
        if weakest.is_infinite() || floor == 0.0 {
            return solve;
        }
        let nodes = || problem.nodes.all.iter().zip(problem.free.iter());
        let taken = nodes().map(|(node, (v, w))| node.impulse(&(node.velocity - *v), &(node.spin - *w)));
        let net = taken.fold(0.0, f64::hypot);
        let moving = nodes().map(|(node, _)| node.inverse_mass).filter(|inverse| *inverse > 0.0);
        let heaviest = moving.map(f64::recip).fold(0.0, f64::max);
        let load_error = load_error * (net / floor).min(1.0);
        let status = if heaviest * wrong_velocity(problem) > aim * floor {
            solve.status
        } else if solve.residual <= solver.tolerance() && load_error <= aim {
            SolveStatus::Converged
        } else {
            SolveStatus::Accepted
        };
        SolveReport { status, load_error: Some(load_error), ..solve }
    }

    /// The report of a solve that missed its velocity error alone, accepted where the bodies rest.
    fn accepted_as_rest(&self, solve: SolveReport, problem: &ContactProblem<D>) -> SolveReport {
        let missed = solve.status == SolveStatus::Failed && solve.residual <= self.settings.solver.accept();
        let status = if missed && self.rests(problem) { SolveStatus::Accepted } else { solve.status };
        SolveReport { status, ..solve }
    }

    /// Whether the false motion of a solution is nothing: in a step it moves no contact by more
    /// than what counts as rest, and it is small beside the motion of the bodies relative to each
    /// other. Where a sample has come apart, its fragments move as wholes, and no contact has to
    /// change its velocity.
    pub(super) fn rests(&self, problem: &ContactProblem<D>) -> bool {
        let smallest = self.grains.radius.iter().copied().fold(f64::INFINITY, f64::min);
        let range = |k: usize| {
            let along = || problem.nodes.all.iter().map(|node| node.velocity[k]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        let apart = (0..D::N).map(|k| range(k).powi(2)).sum::<f64>().sqrt();
        let (wrong, aim) = (wrong_velocity(problem), self.settings.solver.load_tolerance().unwrap_or(0.0));
        self.settings.step * wrong <= TOUCHING * smallest && wrong <= aim * apart
    }
}

/// The square of the largest reaction.
struct Largest(f64);

impl<D: Dim> Visitor<D> for Largest {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
        self.0 = self.0.max(c.r.dot(&c.r));
    }
}

/// Whether a body moves at a given velocity.
fn is_driven<D: Dim>(problem: &ContactProblem<D>) -> bool {
    let given = problem.nodes.all.iter().zip(problem.free.iter()).filter(|(node, _)| node.inverse_mass == 0.0);
    let moves = |(velocity, spin): &(D::Vector, D::Spin)| velocity.norm() > 0.0 || spin.norm() > 0.0;
    given.map(|(_, free)| free).any(moves) || problem.nodes.slides.iter().any(|slide| slide.norm() > 0.0)
}
