//! A user-defined solver in a world: plain sweeps, counted, until the residual is small enough.
//!
//! `cargo run --release -p dem-core --example own_solver`

use dem_core::contact::LocalSolve;
use dem_core::prelude::*;
use dem_core::problem::ContactProblem;
use dem_core::problem::residual::residual;
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::solver::{ContactSolver, Route, SolveReport, SolveStatus, Work, sweep};

/// Gauss–Seidel sweeps, each followed by a check of the residual.
#[derive(Clone)]
struct PlainSweeps {
    tolerance: f64,
    most: u64,
}

impl<D: Dim> ContactSolver<D> for PlainSweeps {
    fn solve(&mut self, problem: &mut ContactProblem<D>) -> SolveReport {
        let mut work = Work::default();
        // the problem has the reactions of the last step, and its nodes the free velocities
        problem.velocities_from_reactions();
        while residual(problem) > self.tolerance && work.sweeps < self.most {
            sweep(problem, LocalSolve::Exact);
            work.sweeps += 1;
        }
        problem.velocities_from_reactions();
        let residual = residual(problem);
        let status = SolveStatus::of(residual, self.tolerance, self.tolerance);
        SolveReport { status, route: Route::Sweeps, work, residual, load_error: None }
    }

    fn snapshot(&self) -> Box<dyn ContactSolver<D>> {
        Box::new(self.clone())
    }

    // the solver has no state from one solve to the next
    fn save(&self, _: &mut Saved) {}

    fn restore(&mut self, _: &mut Reader) -> Result<(), Mismatch> {
        Ok(())
    }
}

fn main() -> Result<(), StepError> {
    // five disks on top of each other
    let disks = (0..5).map(|k| Grain::at_rest([0.0, 0.01 + 0.02 * f64::from(k)].into(), 0.01, 25.0));
    let floor = Wall::fixed(Shape::Plane { normal: [0.0, 1.0].into() }, [0.0, 0.0].into(), 0.5);
    let settings = Settings { step: 1e-3, gravity: Some([0.0, -9.81].into()), friction: 0.5, ..Settings::default() };
    let mut world = World::<D2>::new(disks.collect(), vec![floor], vec![], settings);
    world.use_solver(Box::new(PlainSweeps { tolerance: 1e-8, most: 10_000 }));
    for _ in 0..3 {
        let report = world.step()?;
        println!("{} sweeps, residual {:.1e}", report.work.sweeps, report.residual);
    }
    let weight: f64 = world.grains.mass.iter().sum::<f64>() * 9.81;
    assert!((world.walls[0].reaction[1] / weight + 1.0).abs() < 1e-6);
    Ok(())
}
