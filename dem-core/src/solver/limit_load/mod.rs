//! The limit load: the largest factor λ for which reactions inside all cones balance the constant
//! loads f₀ and λ times the growing loads f₁,
//!
//! maximise λ subject to H r + f₀ + λ f₁ = 0, r + r_coh n ∈ K.
//!
//! It is the static theorem of limit analysis (Drucker, Prager & Greenberg 1952; for assemblies
//! of rigid blocks Livesley 1978), a second-order cone programme. A bond that holds keeps its
//! reaction inside the cone, so that a load beyond λ breaks a bond, whatever the stiffness, the
//! time step and the solver.
//!
//! The method is the homogeneous self-dual embedding with the scaling of Nesterov & Todd and
//! Mehrotra's predictor–corrector (Andersen, Roos & Terlaky, Math. Program. 95, 2003). Where there
//! is no optimum it ends at a proof: reactions that balance f₁ alone inside the cones without
//! cohesion (the load is not bounded), or a mechanism that the loads drive at every λ (they are
//! balanced at none).
//!
//! With x = (r̂, λ), A = (H, f₁), s = L r̂ in a product of cones Q:
//!
//! minimise c·x subject to A x = b, s = L r̂ ∈ Q, b = −f₀ + H (r_coh n),
//!
//! with c = (0, −1) to maximise λ and c = (0, 1) to minimise it.
//!
//! Eliminating s and the dual z leaves S δr̂ + Hᵀδy = p with S = Lᵀ W⁻² L block by block, and with
//! that (H S⁻¹ Hᵀ) δy on the graph of the bodies, bordered by f₁.

mod iterate;
mod path;
mod programme;
mod scaling;
mod system;

use super::rows::{Rows, StiffnessRatio};
use super::tuning::limit_load as tuning;
use crate::dim::{Dim, Vect};
use crate::problem::ContactProblem;
use programme::Programme;
use std::sync::Arc;

pub use super::tuning::limit_load::TOLERANCE as ACCURACY;
pub use programme::LimitLoad;

/// The limit load of a problem over a step of 1 s. The free velocities of the problem are those
/// that the constant loads give, M⁻¹ f₀; `growing` are those of the growing loads, M⁻¹ f₁. All its
/// contacts take part; geometry, bias, compliance and flow do not matter.
pub fn limit_load<D: Dim>(problem: &ContactProblem<D>, growing: Arc<[(D::Vector, D::Spin)]>) -> LimitLoad {
    let constant = problem.free.iter().any(|(v, w)| v.norm() > 0.0 || w.norm() > 0.0);
    let rows = |free: Arc<[(D::Vector, D::Spin)]>| {
        let loaded = ContactProblem { free, ..problem.clone() };
        Rows::of(&loaded, 1.0, StiffnessRatio::default())
    };
    let (bonded, load) = (rows(Arc::clone(&problem.free)), rows(growing).free);
    let strengths = || bonded.list.iter().map(|row| row.shift).filter(|shift| *shift > 0.0);
    let strongest = strengths().fold(0.0, f64::max);
    let mut cap = tuning::SPREAD * strengths().fold(f64::INFINITY, f64::min);
    loop {
        let (found, holds) = capped(bonded.clone(), load.clone(), constant, cap);
        if holds || cap >= strongest {
            return found;
        }
        cap *= tuning::SPREAD.sqrt();
    }
}

/// The limit load with strengths of at most `cap`, and whether it is that of the strengths
/// themselves: a bond that is inside its capped cone does not limit the load, since the programme
/// is convex. Strengths of very unlike sizes would leave the weaker ones to round-off.
fn capped(mut rows: Rows, load: Vec<f64>, constant: bool, cap: f64) -> (LimitLoad, bool) {
    rows.list.iter_mut().for_each(|row| row.shift = row.shift.min(cap));
    let mut programme = match Programme::of(rows, load, cap) {
        Ok(programme) => programme,
        Err(known) => return (known, true),
    };
    let (mut borne, zero) = (!constant, tuning::ACCEPT * programme.unit);
    if constant {
        // whether they are balanced at λ = 0: the least λ
        programme.sense = 1.0;
        match programme.solve() {
            (LimitLoad::Unbounded, _) => {}
            (LimitLoad::Factor { lower, upper }, holds) => {
                let least = 0.5 * (lower + upper);
                if lower > zero.max((upper - lower).abs()) {
                    programme.sense = -1.0;
                    let (most, holds_too) = match programme.solve() {
                        (LimitLoad::Factor { lower, upper }, holds) => (Some(0.5 * (lower + upper)), holds),
                        (_, holds) => (None, holds),
                    };
                    return (LimitLoad::BrokenAtStart { least, most }, holds && holds_too);
                }
                borne = true;
            }
            other => return other,
        }
        programme.sense = -1.0;
    }
    match programme.solve() {
        (LimitLoad::Factor { lower, upper }, holds) if upper < -zero.max((upper - lower).abs()) => {
            (LimitLoad::NeverBalanced, holds)
        }
        (LimitLoad::Unbounded, _) if !borne => {
            // the growing loads are balanced in both directions; the constant ones may not be
            programme.sense = 0.0;
            match programme.solve() {
                (LimitLoad::Factor { .. }, _) => (LimitLoad::Unbounded, true),
                other => other,
            }
        }
        found => found,
    }
}
