//! A problem given by its matrix W, for the methods of a problem over the bodies: its rows have no
//! coefficients and no unknowns, and the methods use W itself.

use super::gauss_seidel::iterate;
use super::local_problems::LocalProblems;
use super::rows::{Row, Rows, StiffnessRatio, places};
use super::solvable::Solvable;
use super::{GaussSeidelSettings, SolveReport};
use crate::contact::{Local, LocalSolve, Padded, Weights};
use crate::problem::assembled::{Assembled, BlockMatrix};
use std::cell::OnceCell;

impl Assembled {
    /// The reaction of a contact without the shift.
    fn own_reaction(&self, c: usize) -> Padded {
        let r = self.reaction(c);
        Local { n: r.n - self.parts().shift[c], ..r }
    }

    /// The problem as rows without coefficients; ρ is `kappa` over the mean normal entry of W.
    pub(super) fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows {
        let parts = self.parts();
        let (rows, size) = (parts.rows, parts.rows.count());
        let normal: f64 = (0..self.len()).map(|c| parts.matrix.diagonal(c)[0]).sum();
        let soft = normal / (self.len().max(1) as f64 * kappa);
        let weights = ratio.weights(soft);
        // for reactions without the shift s: u = W r + (q + W s)
        let mut shifts = vec![0.0; self.r.len()];
        (0..self.len()).for_each(|c| shifts[c * size] = parts.shift[c]);
        let mut out = Rows { applied: parts.applied, ..Rows::default() };
        for c in 0..self.len() {
            let mut given = parts.q[c * size..(c + 1) * size].to_vec();
            parts.matrix.multiply_row(c, &shifts, &mut given);
            out.list.push(Row {
                at: [0, 0],
                count: [0, 0],
                start: 0,
                rows: places(rows.tangents, rows.moments),
                cone: self.cone(c),
                associated: parts.associated[c],
                // a matrix tells no more of a bond
                is_bond: parts.shift[c] > 0.0,
                shift: parts.shift[c],
                given: rows.padded(&given),
                weights,
                lowered: Weights::default(),
                multiplier: self.own_reaction(c),
                // the compliance of elastic bonds is part of W and q
                compliance: Weights::default(),
                carried: Padded::zero(),
                normal: parts.matrix.diagonal(c)[0],
                // the trace of the block
                size: parts.matrix.diagonal(c).iter().step_by(size + 1).sum(),
            });
        }
        out
    }
}

/// Non-linear Gauss–Seidel, from the reactions that the problem holds.
pub fn gauss_seidel(problem: &mut Assembled, settings: &GaussSeidelSettings) -> SolveReport {
    iterate(&mut Visited::new(problem), settings)
}

/// A problem with the data of its local solves, which are computed if it is swept.
pub(super) struct Visited<'a> {
    problem: &'a mut Assembled,
    locals: OnceCell<LocalProblems>,
}

impl<'a> Visited<'a> {
    pub fn new(problem: &'a mut Assembled) -> Self {
        Self { problem, locals: OnceCell::new() }
    }
}

impl Solvable for Visited<'_> {
    fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows {
        self.problem.rows(kappa, ratio)
    }

    fn matrix(&self) -> Option<&BlockMatrix> {
        Some(&self.problem.parts().matrix)
    }

    /// Nothing: velocities are computed from W when they are needed.
    fn velocities_from_reactions(&mut self) {}

    fn residual(&self) -> f64 {
        self.problem.residual()
    }

    fn velocity_error(&self) -> f64 {
        self.problem.velocity_error()
    }

    fn sweep(&mut self, local: LocalSolve) {
        self.locals.get_or_init(|| LocalProblems::of(self.problem)).sweep(self.problem, local);
    }

    fn gather(&self) -> Vec<f64> {
        self.problem.r.clone()
    }

    fn scatter(&mut self, list: &[f64]) {
        self.problem.r.copy_from_slice(list);
    }

    fn in_frames(&self) -> Vec<Padded> {
        (0..self.problem.len()).map(|c| self.problem.own_reaction(c)).collect()
    }

    fn write_back(&mut self, reactions: &[Padded]) {
        let (rows, size) = (self.problem.parts().rows, self.problem.parts().rows.count());
        for (c, r) in reactions.iter().enumerate() {
            let shifted = Local { n: r.n + self.problem.parts().shift[c], ..*r };
            rows.write(&shifted, &mut self.problem.r[c * size..][..size]);
        }
    }

    fn forget_what_is_not_finite(&mut self) {
        if !self.problem.r.iter().all(|r| r.is_finite()) {
            self.problem.r.fill(0.0);
        }
    }

    fn gauss_seidel(&mut self, settings: GaussSeidelSettings) -> SolveReport {
        iterate(self, &settings)
    }
}
