//! Solvers of the problem with its matrix ([`Assembled`]), for what other codes wrote.
//!
//! Gauss–Seidel visits the contacts in their order. The block of a contact may be any symmetric matrix here, so there
//! is no solution by cases: the contact sticks if the reaction that stops it lies in its cone, it is open if zero
//! satisfies its law, and otherwise the predictor–corrector is repeated with γ = 1/(largest eigenvalue of the block),
//! which contracts where the flow is associated.

use super::anderson::Anderson;
use super::gauss_seidel::{BURST, LOOK};
use super::{GaussSeidelSettings, SolveReport, SolveStatus, Work};
use crate::contact::{Local, LocalSolve};
use crate::dim::Vect;
use crate::problem::assembled::{Assembled, Padded};
use nalgebra::{SMatrix, SVector};

/// Most repetitions of the predictor–corrector in one visit of a contact; the next sweep goes on.
const ROUNDS: usize = 100;

type Block = SMatrix<f64, 5, 5>;

/// The block of a contact, padded, and what its local solve needs.
struct Site {
    block: Block,
    /// Inverse on the rows that are not zero, if the block has one.
    inverse: Option<Block>,
    gamma: f64,
}

/// What all local solves of a problem need, computed once.
pub(super) struct Sites(Vec<Site>);

fn in_order(r: &Padded) -> SVector<f64, 5> {
    [r.n, r.t[0], r.t[1], r.m[0], r.m[1]].into()
}

fn from_order(v: &SVector<f64, 5>) -> Padded {
    Local { n: v[0], t: [v[1], v[2]].into(), m: [v[3], v[4]].into() }
}

impl Site {
    fn new(problem: &Assembled, contact: usize, scale: f64) -> Self {
        let parts = problem.parts();
        let (rows, values) = (parts.rows, parts.matrix.diagonal(contact));
        let size = rows.count();
        let place = |k: usize| if k > rows.tangents { k - rows.tangents + 2 } else { k };
        let mut block = Block::zeros();
        for (k, w) in values.iter().enumerate() {
            block[(place(k / size), place(k % size))] = *w;
        }
        // rows that the contact lacks: one on the diagonal keeps them out of the way of the inverse
        let mut filled = block;
        let lacks: Vec<usize> = (0..5).filter(|k| block.row(*k).iter().all(|w| *w == 0.0)).collect();
        lacks.iter().for_each(|k| filled[(*k, *k)] = scale);
        let inverse = filled.cholesky().map(|factor| {
            let mut inverse = factor.inverse();
            lacks.iter().for_each(|k| inverse[(*k, *k)] = 0.0);
            inverse
        });
        let largest = block.symmetric_eigenvalues().max().max(scale);
        Self { block, inverse, gamma: 1.0 / largest }
    }

    /// The reaction that satisfies the law of this contact alone, from its reaction and relative velocity.
    fn exact(&self, problem: &Assembled, contact: usize, mut r: Padded, mut u: Padded) -> Padded {
        let cone = problem.cone(contact);
        if let Some(inverse) = &self.inverse {
            let stuck = r + from_order(&(inverse * in_order(&u))) * -1.0;
            if cone.contains(&stuck) {
                return stuck;
            }
        }
        let open = u + from_order(&(self.block * in_order(&r))) * -1.0;
        let pull = if problem.parts().associated[contact] {
            cone.mu * Vect::norm(&open.t) + cone.nu * Vect::norm(&open.m)
        } else {
            0.0
        };
        if open.n >= pull {
            return Padded::zero();
        }
        for _ in 0..ROUNDS {
            let change = problem.correction(contact, self.gamma, r, u);
            r += change;
            u += from_order(&(self.block * in_order(&change)));
            if change.dot(&change) <= 1e-30 * r.dot(&r) {
                break;
            }
        }
        r
    }
}

/// Non-linear Gauss–Seidel, from the reactions that the problem holds.
pub fn gauss_seidel(problem: &mut Assembled, settings: &GaussSeidelSettings) -> SolveReport {
    let sites = Sites::of(problem);
    let mut memory = (settings.acceleration > 0).then(|| Anderson::new(settings.acceleration, problem.r.clone()));
    let mut error = problem.residual();
    let mut sweeps = 0;
    while error > settings.tolerance && sweeps < settings.max_sweeps {
        // the residual costs about a sweep: look at it ever more rarely, at most every 64 sweeps
        let plain = (1 + sweeps / 4).min(64);
        let burst = if memory.is_some() { BURST } else { plain }.min(settings.max_sweeps - sweeps);
        for _ in 0..burst {
            sites.sweep(problem, settings.local);
        }
        sweeps += burst;
        let early = sweeps <= LOOK * BURST || sweeps.is_multiple_of(LOOK * BURST);
        if memory.is_none() || early || sweeps >= settings.max_sweeps {
            error = problem.residual();
        }
        if let Some(memory) = memory.as_mut().filter(|_| error > settings.tolerance && sweeps < settings.max_sweeps) {
            let next = memory.next(problem.r.clone());
            problem.r.copy_from_slice(next);
        }
    }
    let status = if error <= settings.tolerance {
        SolveStatus::Converged
    } else if error <= settings.accept {
        SolveStatus::Accepted
    } else {
        SolveStatus::Failed
    };
    SolveReport { status, work: Work { sweeps, ..Work::default() }, residual: error, load_error: None }
}

impl Sites {
    pub(super) fn of(problem: &Assembled) -> Self {
        let scales = problem.scales().into_iter().enumerate();
        Self(scales.map(|(c, scale)| Site::new(problem, c, scale)).collect())
    }

    /// One visit of every contact.
    pub(super) fn sweep(&self, problem: &mut Assembled, local: LocalSolve) {
        let (rows, size) = (problem.parts().rows, problem.parts().rows.count());
        for (c, site) in self.0.iter().enumerate() {
            let (r, u) = (problem.reaction(c), problem.velocity(c));
            let r = match local {
                LocalSolve::Exact => site.exact(problem, c, r, u),
                LocalSolve::PredictorCorrector => r + problem.correction(c, site.gamma, r, u),
            };
            rows.write(&r, &mut problem.r[c * size..(c + 1) * size]);
        }
    }
}
