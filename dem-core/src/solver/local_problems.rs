//! Visits of Gauss–Seidel in a problem given by its matrix ([`Assembled`]), as other codes write
//! it.
//!
//! Contacts are visited in their order. The block of a contact may be any symmetric matrix, so
//! there is no closed-form local solve. The contact sticks if the reaction that stops it lies in
//! its cone; it is open if zero satisfies its law; otherwise the predictor–corrector is repeated
//! with γ = 1/(largest eigenvalue of the block), which contracts for associated flow.

use crate::contact::{LocalSolve, PADDED, Padded};
use crate::dim::{Moments, Vect};
use crate::problem::assembled::Assembled;
use crate::solver::tuning::{ROUND_OFF, gauss_seidel as tuning};
use nalgebra::SMatrix;

type PaddedMatrix = SMatrix<f64, PADDED, PADDED>;

/// The block of a contact, padded, with the data of its local solve.
struct LocalProblem {
    block: PaddedMatrix,
    /// Inverse on the rows that are not zero, if the block has one.
    inverse: Option<PaddedMatrix>,
    gamma: f64,
}

/// Data of all local solves of a problem, computed once.
pub(super) struct LocalProblems(Vec<LocalProblem>);

impl LocalProblem {
    fn new(problem: &Assembled, contact: usize, scale: f64) -> Self {
        let parts = problem.parts();
        let (rows, values) = (parts.rows, parts.matrix.diagonal(contact));
        let size = rows.count();
        let place = |k: usize| if k > rows.tangents { k - rows.tangents + 2 } else { k };
        let mut block = PaddedMatrix::zeros();
        for (k, w) in values.iter().enumerate() {
            block[(place(k / size), place(k % size))] = *w;
        }
        // a diagonal entry for each row that the contact lacks makes the matrix invertible
        let mut filled = block;
        let lacks: Vec<usize> = (0..PADDED).filter(|k| block.row(*k).iter().all(|w| *w == 0.0)).collect();
        lacks.iter().for_each(|k| filled[(*k, *k)] = scale);
        let inverse = filled.cholesky().map(|factor| {
            let mut inverse = factor.inverse();
            lacks.iter().for_each(|k| inverse[(*k, *k)] = 0.0);
            inverse
        });
        let largest = block.symmetric_eigenvalues().max().max(scale);
        Self { block, inverse, gamma: 1.0 / largest }
    }

    /// The reaction that satisfies the law of this contact alone, from its reaction and relative
    /// velocity.
    fn exact(&self, problem: &Assembled, contact: usize, mut r: Padded, mut u: Padded) -> Padded {
        let cone = problem.cone(contact);
        if let Some(inverse) = &self.inverse {
            let stuck = r + Padded::from_order(&(inverse * u.in_order())) * -1.0;
            if cone.contains(&stuck) {
                return stuck;
            }
        }
        let open = u + Padded::from_order(&(self.block * r.in_order())) * -1.0;
        let pull = if problem.parts().associated[contact] {
            cone.mu * Vect::norm(&open.t) + cone.nu * open.m.bending() + cone.xi * open.m.twist()
        } else {
            0.0
        };
        if open.n >= pull {
            return Padded::zero();
        }
        for _ in 0..tuning::ROUNDS {
            let change = problem.correction(contact, self.gamma, r, u);
            r += change;
            u += Padded::from_order(&(self.block * change.in_order()));
            if change.dot(&change) <= ROUND_OFF * ROUND_OFF * r.dot(&r) {
                break;
            }
        }
        r
    }
}

impl LocalProblems {
    pub(super) fn of(problem: &Assembled) -> Self {
        let scales = problem.scales().into_iter().enumerate();
        Self(scales.map(|(c, scale)| LocalProblem::new(problem, c, scale)).collect())
    }

    /// One visit of every contact.
    pub(super) fn sweep(&self, problem: &mut Assembled, local: LocalSolve) {
        let (rows, size) = (problem.parts().rows, problem.parts().rows.count());
        for (c, data) in self.0.iter().enumerate() {
            let (r, u) = (problem.reaction(c), problem.velocity(c));
            let r = match local {
                LocalSolve::Exact => data.exact(problem, c, r, u),
                LocalSolve::PredictorCorrector => r + problem.correction(c, data.gamma, r, u),
            };
            rows.write(&r, &mut problem.r[c * size..(c + 1) * size]);
        }
    }
}
