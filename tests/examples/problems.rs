//! The contact problems of steps of a scene, each with the reactions of the interior-point method,
//! for `scripts/measure_selection.py`.
//!
//! `problems SCENE FOLDER STEPS [PATH=VALUE…]`: STEPS is `first:last:stride`, or numbers separated
//! by commas. The scene runs with its own solver; each problem is solved besides by the
//! interior-point method alone, and written as `dem-run export` writes it, with
//!
//! ```text
//! /cohesive_dem/metric   1/ρ of each row of each contact, up to a common factor
//! /cohesive_dem/last     1: the metric is anchored at the last step's reactions, 0: at zero
//! /cohesive_dem/work     factorisations of the solve
//! ```

use dem_core::dim::{Dim, Vect};
use dem_core::problem::ContactProblem;
use dem_core::problem::assembled::Assembled;
use dem_core::solver::{SolveStatus, SolverSettings, StagedSettings, Stages, Start};
use dem_run::build::build;
use dem_run::fclib::Problem;
use dem_run::in_dimension;
use dem_run::scene::{self, Scene};
use std::error::Error;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder, steps, values @ ..] = &arguments[..] else {
        return Err("problems SCENE FOLDER STEPS [PATH=VALUE…]".into());
    };
    let (scene, steps) = (scene::load(Path::new(file), values)?, listed(steps)?);
    std::fs::create_dir_all(folder)?;
    in_dimension!(scene, D => problems::<D>(&scene, Path::new(folder), &steps))
}

fn listed(steps: &str) -> Result<Vec<u64>, std::num::ParseIntError> {
    let bounds: Vec<u64> = steps.split(':').map_while(|k| k.parse().ok()).collect();
    match bounds[..] {
        [first, last, stride] => Ok((first..=last).step_by(stride as usize).collect()),
        _ => steps.split(',').map(str::parse).collect(),
    }
}

fn problems<D: Dim>(scene: &Scene, folder: &Path, steps: &[u64]) -> Outcome {
    let mut world = build::<D>(scene, None, &mut |_| true)?.world;
    let SolverSettings::Staged(settings) = world.settings.solver else {
        return Err("the scene's solver has no metric".into());
    };
    let settings = StagedSettings { stages: Stages::Interior, ..settings };
    let last = steps.iter().copied().max().unwrap_or(0);
    while world.steps < last {
        let step = world.steps + 1;
        if steps.contains(&step) {
            let problem = world.contact_problem();
            write(problem, settings, &folder.join(format!("{step:05}.hdf5")))?;
        }
        // the steps before the one that ends a run are problems, too
        if let Err(error) = world.step() {
            println!("{error}");
            break;
        }
    }
    Ok(())
}

/// The problem with its reactions by the interior-point method, if it has rigid bonds.
fn write<D: Dim>(mut problem: ContactProblem<D>, settings: StagedSettings, path: &Path) -> Outcome {
    let assembled = Assembled::of(&problem);
    let report = SolverSettings::Staged(settings).build::<D>().solve(&mut problem);
    let solved = report.status != SolveStatus::Failed;
    println!("{} {report:?}", path.display());
    let metric = metric(&problem, &assembled, settings);
    let problem = Problem {
        title: String::new(),
        description: String::new(),
        math_info: String::new(),
        solution: solved.then(|| Assembled::of(&problem).r),
        assembled,
        warnings: Vec::new(),
    };
    problem.write(path)?;
    let ours = hdf5::File::append(path)?.group("cohesive_dem")?;
    let add = |name: &str, values: &[f64]| ours.new_dataset_builder().with_data(values).create(name).map(drop);
    add("metric", &metric)?;
    add("last", &[f64::from(u8::from(settings.start == Start::LastStep))])?;
    Ok(add("work", &[report.work.factorisations as f64])?)
}

/// 1/ρ of all rows: in 3D over the mean diameter of a pair, or the radius at a wall.
fn metric<D: Dim>(problem: &ContactProblem<D>, assembled: &Assembled, settings: StagedSettings) -> Vec<f64> {
    let pairs = problem.bonded.iter().map(|c| c.link.nodes);
    let pairs =
        pairs.chain(problem.elastic.iter().map(|c| c.link.nodes)).chain(problem.dry.iter().map(|c| c.link.nodes));
    let pairs = pairs.chain(problem.frictionless.iter().map(|c| c.link.nodes));
    let rows = assembled.parts().rows;
    let ratio = settings.stiffness;
    let mut metric = Vec::new();
    for nodes in pairs {
        let radius = |side: usize| problem.radii.get(nodes[side] as usize).copied();
        let normal = radius(0).map_or(1.0, |r| 1.0 / (r + radius(1).unwrap_or(r)));
        let (tangential, rolling) = (normal / ratio.tangential, normal / ratio.rolling);
        metric.push(normal);
        metric.extend(std::iter::repeat_n(tangential, rows.tangents));
        metric.extend(std::iter::repeat_n(rolling, rows.moments.min(D::Tangent::LEN)));
        metric.extend((rows.tangents < rows.moments).then_some(0.5 * rolling / ratio.tangential));
    }
    metric
}
