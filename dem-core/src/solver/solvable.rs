//! Interface of the solver stages to a problem, matrix-free or given by its matrix.

use super::rows::{Rows, StiffnessRatio, mass_unit};
use super::{ContactSolver, GaussSeidel, GaussSeidelSettings, SolveReport, sweep};
use crate::contact::{Law, LocalSolve, Padded, Reached};
use crate::dim::{Dim, Vect};
use crate::problem::assembled::BlockMatrix;
use crate::problem::residual::{elastic_error, residual, velocity_error};
use crate::problem::{Contact, ContactProblem, Nodes, Visitor, VisitorMut};

/// A problem that can be converted to rows over scaled unknowns, swept and measured.
pub(super) trait Solvable {
    /// The problem as rows, without coefficients if it has a matrix; ρ is `kappa` over the mean
    /// normal entry of W.
    fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows;
    /// Its matrix, if it is given by one.
    fn matrix(&self) -> Option<&BlockMatrix> {
        None
    }
    /// Recompute the velocities from the reactions, without the round-off of increments.
    fn velocities_from_reactions(&mut self);
    /// The residual of the current reactions (–).
    fn residual(&self) -> f64;
    /// Their velocity error (–).
    fn velocity_error(&self) -> f64;
    /// Their elastic error (–); zero where a compliance is part of the matrix.
    fn elastic_error(&self) -> f64 {
        0.0
    }
    /// One visit of every contact by Gauss–Seidel.
    fn sweep(&mut self, local: LocalSolve);
    /// The reactions in one list.
    fn gather(&self) -> Vec<f64>;
    /// Set the reactions from such a list, and the velocities that they give.
    fn scatter(&mut self, list: &[f64]);
    /// The reactions of the contacts without the shift, in the unit of the rows.
    fn in_frames(&self) -> Vec<Padded>;
    /// Set the reactions, given in the unit of the rows, and the velocities that they give. No bond
    /// is then known to have reached its limit.
    fn write_back(&mut self, reactions: &[Padded]);
    /// Set what of its limit each contact has reached.
    fn set_reached(&mut self, _: &[Option<Reached>]) {}
    /// Set the reactions to zero if one of them is not finite.
    fn forget_what_is_not_finite(&mut self);
    /// Gauss–Seidel from the current reactions.
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

    fn elastic_error(&self) -> f64 {
        elastic_error(self)
    }

    fn sweep(&mut self, local: LocalSolve) {
        sweep(self, local);
    }

    fn gather(&self) -> Vec<f64> {
        self.reactions()
    }

    fn scatter(&mut self, list: &[f64]) {
        self.set_reactions(list);
        self.velocities_from_reactions();
    }

    fn in_frames(&self) -> Vec<Padded> {
        struct InFrame(Vec<Padded>, f64);
        impl<D: Dim> Visitor<D> for InFrame {
            fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
                self.0.push(c.link.in_frame(&c.r) * (1.0 / self.1));
            }
        }
        let mut reactions = InFrame(Vec::with_capacity(self.len()), mass_unit(&self.nodes));
        self.visit(&mut reactions);
        reactions.0
    }

    fn write_back(&mut self, reactions: &[Padded]) {
        struct OfFrame<'a>(std::slice::Iter<'a, Padded>, f64);
        impl<D: Dim> VisitorMut<D> for OfFrame<'_> {
            fn visit<L: Law>(&mut self, c: &mut Contact<D, L>) {
                if let Some(r) = self.0.next() {
                    c.r = c.link.of_frame(&(*r * self.1));
                    c.law.set_reached(None);
                }
            }
        }
        let unit = mass_unit(&self.nodes);
        self.visit_mut(&mut OfFrame(reactions.iter(), unit));
        self.velocities_from_reactions();
    }

    fn set_reached(&mut self, reached: &[Option<Reached>]) {
        struct Set<'a>(std::slice::Iter<'a, Option<Reached>>);
        impl<D: Dim> VisitorMut<D> for Set<'_> {
            fn visit<L: Law>(&mut self, c: &mut Contact<D, L>) {
                c.law.set_reached(self.0.next().copied().flatten());
            }
        }
        self.visit_mut(&mut Set(reached.iter()));
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
