//! Performance profiles of the solvers over the contact problems of a run (Dolan & Moré, Math.
//! Program. 91, 2002).
//!
//! For solver s and problem p let c(p, s) be the cost, infinite if s does not solve p, and b(p) the
//! least cost of any solver. The profile of s is ρ_s(τ), the share of all problems with c(p, s) ≤ τ
//! b(p): ρ_s(1) is the share of problems that s solves fastest, and ρ_s(τ) for large τ the share
//! that s solves.

use super::trial::{Posed, SolverName, Way};
use crate::build::settings;
use crate::clock::thread_time;
use crate::scene::Scene;
use dem_core::dim::Dim;
use dem_core::saved::Saved;
use serde::Serialize;

/// Number of solves of one problem. The fastest counts: it is the least disturbed by other
/// processes.
const REPEATS: usize = 3;
/// Factors τ of the table.
pub const FACTORS: [f64; 6] = [1.0, 1.5, 2.0, 5.0, 10.0, 100.0];

/// Cost of one problem for a solver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Whether the residual reached the tolerance.
    pub solved: bool,
    /// Residual reached (–).
    pub residual: f64,
    /// Sweeps, or Newton iterations.
    pub iterations: u64,
    /// CPU time (s).
    pub cpu_time: f64,
}

/// The costs of one solver, problem by problem, and its profile.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SolverCosts {
    /// The solver.
    pub solver: SolverName,
    /// One for each problem.
    pub costs: Vec<Cost>,
    /// Share of the problems solved within each of [`FACTORS`] of the least CPU time (–).
    pub shares: Vec<f64>,
}

/// The solvers compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Profile {
    /// Tolerance that all solvers had to reach (–).
    pub tolerance: f64,
    /// Number of steps made before each problem.
    pub step: Vec<u64>,
    /// Time of each problem (s).
    pub time: Vec<f64>,
    /// Contacts of each problem.
    pub contacts: Vec<usize>,
    /// Factors at which the shares are reported (–).
    pub factors: Vec<f64>,
    /// One for each solver.
    pub solvers: Vec<SolverCosts>,
}

impl Profile {
    /// Solves every problem with every solver, to the tolerance of `way`. `watch` receives the
    /// completed share; if it returns false, the result is none.
    pub fn measure<D: Dim>(
        posed: &[Posed<D>],
        scene: &Scene,
        solvers: &[SolverName],
        way: &Way,
        watch: &dyn Fn(f64) -> bool,
    ) -> Option<Self> {
        let mut profile = Self {
            tolerance: way.tolerance,
            step: posed.iter().map(|p| p.step).collect(),
            time: posed.iter().map(|p| p.time).collect(),
            contacts: posed.iter().map(|p| p.problem.len()).collect(),
            factors: FACTORS.to_vec(),
            solvers: vec![],
        };
        let total = (solvers.len() * posed.len()) as f64;
        for (k, &solver) in solvers.iter().enumerate() {
            let mut scene = Way { solver, ..*way }.scene(scene);
            scene.solver.accept = None;
            // one solver for all problems: as in a run, its state is kept between steps
            let mut built = settings::<D>(&scene).solver.build::<D>();
            let mut costs = vec![];
            for (p, posed) in posed.iter().enumerate() {
                if !watch((k * profile.step.len() + p) as f64 / total) {
                    return None;
                }
                let mut cpu_time = f64::INFINITY;
                let mut solve = None;
                let mut state = Saved::default();
                built.save(&mut state);
                for _ in 0..REPEATS {
                    let mut problem = posed.problem.clone();
                    // a repeated solve must not use solver state from the same problem
                    built.restore(&mut state.read()).expect("its own state");
                    let began = thread_time();
                    solve = Some(built.solve(&mut problem));
                    cpu_time = cpu_time.min(thread_time() - began);
                }
                costs.extend(solve.map(|solve| Cost {
                    solved: solve.residual <= way.tolerance,
                    residual: solve.residual,
                    iterations: solve.work.iterations(),
                    cpu_time,
                }));
            }
            profile.solvers.push(SolverCosts { solver, costs, shares: vec![] });
        }
        let ratios = ratios(&profile.cpu_times());
        for (solver, ratios) in profile.solvers.iter_mut().zip(&ratios) {
            solver.shares = FACTORS.iter().map(|factor| share(ratios, *factor)).collect();
        }
        Some(profile)
    }

    fn cpu_times(&self) -> Vec<Vec<Option<f64>>> {
        let time = |cost: &Cost| cost.solved.then_some(cost.cpu_time);
        self.solvers.iter().map(|solver| solver.costs.iter().map(time).collect()).collect()
    }

    /// The profile of each solver as a curve of steps: (τ, share of the problems solved within τ
    /// times the best), from 1 to a little beyond the largest ratio.
    #[must_use]
    pub fn curves(&self) -> Vec<Vec<(f64, f64)>> {
        let ratios = ratios(&self.cpu_times());
        let finite = ratios.iter().flatten().copied().filter(|r| r.is_finite());
        let last = 1.2 * finite.fold(1.0, f64::max);
        let curve = |ratios: &Vec<f64>| {
            let mut factors: Vec<f64> = ratios.iter().copied().filter(|r| r.is_finite()).collect();
            factors.extend([1.0, last]);
            factors.sort_unstable_by(f64::total_cmp);
            factors.dedup();
            factors.iter().map(|factor| (*factor, share(ratios, *factor))).collect()
        };
        ratios.iter().map(curve).collect()
    }
}

/// Cost over the least cost of any solver, for each solver and problem; infinite if the solver does
/// not solve the problem.
fn ratios(costs: &[Vec<Option<f64>>]) -> Vec<Vec<f64>> {
    let problems = costs.first().map_or(0, Vec::len);
    let best = |p: usize| costs.iter().filter_map(|costs| costs[p]).fold(f64::INFINITY, f64::min);
    let best: Vec<f64> = (0..problems).map(best).collect();
    let ratio = |(cost, best): (&Option<f64>, &f64)| match cost {
        // if the least cost is zero, its ratio is 1 and all others are infinite
        Some(cost) if cost == best => 1.0,
        Some(cost) => cost / best,
        None => f64::INFINITY,
    };
    costs.iter().map(|costs| costs.iter().zip(&best).map(ratio).collect()).collect()
}

/// Share of the problems with a ratio of at most `factor` (–).
fn share(ratios: &[f64], factor: f64) -> f64 {
    ratios.iter().filter(|ratio| **ratio <= factor).count() as f64 / ratios.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four problems: A is fastest on the first two, B on the third; neither solves the last.
    fn hand_made() -> Vec<Vec<f64>> {
        ratios(&[vec![Some(1.0), Some(2.0), Some(6.0), None], vec![Some(3.0), None, Some(2.0), None]])
    }

    #[test]
    fn a_ratio_is_the_cost_over_the_best() {
        let infinite = f64::INFINITY;
        assert_eq!(hand_made(), [[1.0, 1.0, 3.0, infinite], [3.0, infinite, 1.0, infinite]]);
        assert_eq!(ratios(&[vec![Some(0.0)], vec![Some(2.0)]]), [[1.0], [infinite]]);
    }

    #[test]
    fn a_profile_counts_what_is_solved_within_a_factor() {
        let ratios = hand_made();
        let at = |factor: f64| [share(&ratios[0], factor), share(&ratios[1], factor)];
        assert_eq!(at(1.0), [0.5, 0.25]);
        assert_eq!(at(2.9), [0.5, 0.25]);
        assert_eq!(at(3.0), [0.75, 0.5]);
        assert_eq!(at(1e9), [0.75, 0.5]);
        assert_eq!(share(&[], 1.0), 0.0);
    }

    #[test]
    fn a_curve_starts_at_one_and_rises_in_steps() {
        let cost = |cpu_time: f64, solved| Cost { solved, residual: 0.0, iterations: 1, cpu_time };
        let solver = |solver, costs: Vec<Cost>| SolverCosts { solver, costs, shares: vec![] };
        let profile = Profile {
            tolerance: 1e-6,
            step: vec![0, 1],
            time: vec![0.0, 1.0],
            contacts: vec![1, 1],
            factors: vec![],
            solvers: vec![
                solver(SolverName::GaussSeidel, vec![cost(1.0, true), cost(4.0, true)]),
                solver(SolverName::Newton, vec![cost(2.0, true), cost(1.0, false)]),
            ],
        };
        assert_eq!(profile.curves(), [vec![(1.0, 1.0), (2.4, 1.0)], vec![(1.0, 0.0), (2.0, 0.5), (2.4, 0.5)]]);
    }
}
