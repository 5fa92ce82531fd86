//! A problem given by its matrix W, as a [`Solvable`]: its rows have no coefficients and no
//! unknowns, and the methods use W itself ([`Solvable::matrix`]).

use super::assembled::{LocalProblems, gauss_seidel};
use super::rows::{Row, Rows, StiffnessRatio, places};
use super::solvable::Solvable;
use super::{GaussSeidelSettings, SolveReport};
use crate::contact::{Local, LocalSolve, Padded, Weights};
use crate::problem::assembled::{Assembled, BlockMatrix};

impl Assembled {
    /// The reaction of a contact without the shift.
    fn own_reaction(&self, c: usize) -> Padded {
        let r = self.reaction(c);
        Local { n: r.n - self.parts().shift[c], ..r }
    }
}

impl Solvable for Assembled {
    fn rows(&self, kappa: f64, ratio: StiffnessRatio) -> Rows {
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

    fn matrix(&self) -> Option<&BlockMatrix> {
        Some(&self.parts().matrix)
    }

    fn velocities_from_reactions(&mut self) {}

    fn residual(&self) -> f64 {
        self.residual()
    }

    fn velocity_error(&self) -> f64 {
        self.velocity_error()
    }

    fn swept(&mut self, sweeps: usize) -> Vec<Padded> {
        let sites = LocalProblems::of(self);
        for _ in 0..sweeps {
            sites.sweep(self, LocalSolve::Exact);
        }
        (0..self.len()).map(|c| self.own_reaction(c)).collect()
    }

    fn write_back(&mut self, reactions: &[Padded]) {
        let (rows, size) = (self.parts().rows, self.parts().rows.count());
        for (c, r) in reactions.iter().enumerate() {
            let shifted = Local { n: r.n + self.parts().shift[c], ..*r };
            rows.write(&shifted, &mut self.r[c * size..][..size]);
        }
    }

    fn forget_what_is_not_finite(&mut self) {
        if !self.r.iter().all(|r| r.is_finite()) {
            self.r.fill(0.0);
        }
    }

    fn gauss_seidel(&mut self, settings: GaussSeidelSettings) -> SolveReport {
        gauss_seidel(self, &settings)
    }
}
