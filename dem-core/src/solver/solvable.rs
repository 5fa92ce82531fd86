//! What the Newton solver asks of a problem, matrix-free or with its matrix.

use super::rows::{Rows, StiffnessRatio, mass_unit};
use super::{ContactSolver, GaussSeidel, GaussSeidelSettings, SolveReport, sweep};
use crate::contact::{Law, LocalSolve, Padded};
use crate::dim::{Dim, Vect};
use crate::problem::assembled::BlockMatrix;
use crate::problem::residual::{residual, velocity_error};
use crate::problem::{ContactProblem, Group};

/// A problem that can be put into rows over scaled unknowns, swept and measured.
pub(super) trait Solvable {
    /// The problem as rows, without coefficients where it has a matrix; ρ is `kappa` over the mean normal entry of W.
    fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows;
    /// Its matrix, where there is one.
    fn matrix(&self) -> Option<&BlockMatrix> {
        None
    }
    /// Set the velocities to what the reactions make of them, free of the rounding of increments.
    fn velocities_from_reactions(&mut self);
    /// The residual of the reactions at hand (–).
    fn residual(&self) -> f64;
    /// Their velocity error (–).
    fn velocity_error(&self) -> f64;
    /// The reactions after some sweeps of Gauss–Seidel, in the unit of the rows.
    fn swept(&mut self, sweeps: usize) -> Vec<Padded>;
    /// Take over reactions in the unit of the rows, and the velocities that they give.
    fn write_back(&mut self, reactions: &[Padded]);
    /// Set the reactions to zero if one of them is not finite.
    fn forget_what_is_not_finite(&mut self);
    /// Gauss–Seidel from the reactions at hand.
    fn gauss_seidel(&mut self, settings: GaussSeidelSettings) -> SolveReport;
}

impl<D: Dim> Solvable for ContactProblem<D> {
    fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows {
        Rows::of(self, kappa, ratio)
    }

    fn velocities_from_reactions(&mut self) {
        self.velocities_from_reactions();
    }

    fn residual(&self) -> f64 {
        residual(self)
    }

    fn velocity_error(&self) -> f64 {
        velocity_error(self)
    }

    fn swept(&mut self, sweeps: usize) -> Vec<Padded> {
        self.velocities_from_reactions();
        for _ in 0..sweeps {
            sweep(self, LocalSolve::Exact);
        }
        let mut reactions = Vec::with_capacity(self.len());
        reactions.extend(self.bonded.iter().map(|c| c.link.in_frame(&c.r)));
        reactions.extend(self.elastic.iter().map(|c| c.link.in_frame(&c.r)));
        reactions.extend(self.dry.iter().map(|c| c.link.in_frame(&c.r)));
        reactions.extend(self.frictionless.iter().map(|c| c.link.in_frame(&c.r)));
        let unit = mass_unit(&self.nodes);
        reactions.iter_mut().for_each(|r| *r = *r * (1.0 / unit));
        reactions
    }

    fn write_back(&mut self, reactions: &[Padded]) {
        fn group<D: Dim, L: Law>(group: &mut Group<D, L>, list: &[Padded], unit: f64) {
            for (c, r) in group.iter_mut().zip(list) {
                c.r = c.link.of_frame(&(*r * unit));
            }
        }
        let unit = mass_unit(&self.nodes);
        let bonded = self.bonded.len();
        let elastic = bonded + self.elastic.len();
        let dry = elastic + self.dry.len();
        group(&mut self.bonded, &reactions[..bonded], unit);
        group(&mut self.elastic, &reactions[bonded..elastic], unit);
        group(&mut self.dry, &reactions[elastic..dry], unit);
        group(&mut self.frictionless, &reactions[dry..], unit);
        self.velocities_from_reactions();
    }

    fn forget_what_is_not_finite(&mut self) {
        let mut sum: f64 = 0.0;
        self.nodes.all.iter().for_each(|n| sum += n.velocity.dot(&n.velocity) + n.spin.dot(&n.spin));
        if !sum.is_finite() {
            self.forget_reactions();
        }
    }

    fn gauss_seidel(&mut self, settings: GaussSeidelSettings) -> SolveReport {
        GaussSeidel::new(settings).solve(self)
    }
}
