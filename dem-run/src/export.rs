//! `dem-run export`: writes the contact problem of one step of a history in FCLIB's format.

use std::io::Write;
use std::path::PathBuf;

use dem_core::dim::Dim;
use dem_core::problem::assembled::Assembled;
use dem_core::solver::SolveStatus;

use crate::build::build;
use crate::check;
use crate::error::{NoConvergence, RunError};
use crate::fclib::Problem;
use crate::history::History;
use crate::in_dimension;
use crate::memory;
use crate::output::{escaped, print_line};
use crate::progress::StepProgress;
use crate::run::{Execution, handle_signals};
use crate::scene::{self, Scene};
use crate::signals::Interrupt;
use crate::stages::Stages;

/// Options of `dem-run export`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportOptions {
    /// The history whose scene is rerun.
    pub history: PathBuf,
    /// The step whose problem is written, counted from 1.
    pub step: u64,
    /// The file to write.
    pub output: PathBuf,
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether a scene is run although it needs more memory than is free.
    pub ignore_memory: bool,
}

/// Reruns the scene of a history up to a step and writes the first problem of that step, before any
/// bond breaks in the step.
///
/// # Errors
/// [`RunError`]: an unreadable history, a step that the scene does not have, a run that ends before
/// the step.
pub fn export(options: &ExportOptions) -> Result<(), RunError> {
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    let history = History::open(&options.history)?;
    let parameters = history.parameters()?;
    let shown = options.history.display();
    let scene = scene::from_text(&format!("the scene in {shown}"), &parameters.scene, &[])?;
    // the step after the last frame may be the one that was not solved
    let last = history.steps().last().map_or(0, |last| *last as u64);
    let steps = scene.steps().min(last + 1);
    if !(1..=steps).contains(&options.step) {
        let step = options.step;
        return Err(RunError::Usage(format!(
            "there is no step {step} in {shown}: steps 1 to {steps} can be exported, the last frame is of step {last}"
        )));
    }
    let (version, revision) = (env!("CARGO_PKG_VERSION"), option_env!("DEM_GIT_REVISION").unwrap_or_default());
    if !options.execution.quiet && (parameters.version != version || parameters.git_revision != revision) {
        let note = "it was written by another version of the program: the states of this run may differ from it";
        let _ = writeln!(std::io::stderr(), "{}", escaped(&format!("note: {shown}: {note}")));
    }
    if !options.ignore_memory {
        memory::refuse_too_large(&scene, check::count(&scene)?)?;
    }
    in_dimension!(scene, D => export_in::<D>(&scene, options, &interrupt))
}

fn export_in<D: Dim>(scene: &Scene, options: &ExportOptions, interrupt: &Interrupt) -> Result<(), RunError> {
    let mut progress = options.execution.show();
    let mut world = build::<D>(scene, None, &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?
    .world;
    let mut stages = Stages::new(scene, &world);
    while world.steps + 1 < options.step {
        let report = world.step().map_err(|error| NoConvergence::Export {
            error: error.to_string(),
            step: options.step,
            last: world.steps + 1,
        })?;
        let broken = world.bonds.len() - world.intact_bonds();
        stages.count(&world, broken);
        stages.advance(scene, &mut world, broken)?;
        progress.step(&StepProgress {
            step: world.steps,
            time: world.time,
            counts_steps: scene.rupture == scene::Rupture::NextEvent,
            end: (options.step - 1) as f64 * scene.time.step,
            residual: report.residual,
            iterations: report.work.iterations(),
            broken,
            bonds: world.bonds.len(),
            load: None,
            strain: None,
            stop: None,
            may_end_early: false,
            bonded: scene.has_bonds(),
        });
        if interrupt.requested() {
            return Err(RunError::Interrupted("nothing was written"));
        }
    }
    let mut contacts = world.contact_problem();
    let assembled = Assembled::of(&contacts);
    progress.finish();
    if assembled.is_empty() {
        return Err(RunError::Usage(format!("step {} has no contacts: choose a step with contacts", options.step)));
    }
    let solve = world.settings.solver.build::<D>().solve(&mut contacts);
    let solved = solve.status != SolveStatus::Failed;
    if !solved && !options.execution.quiet {
        let what = format!("the scene's solver left a residual of {:.2e}", solve.residual);
        let _ = writeln!(std::io::stderr(), "note: {what}: the problem is written without a solution");
    }
    let (step, source) = (options.step, options.history.file_name().unwrap_or_default().to_string_lossy());
    // the description states, for readers, what the format cannot express
    let associated = assembled.parts().associated.iter().filter(|flag| **flag).count();
    let problem = Problem {
        title: format!("{}, step {step}", scene.title.as_deref().unwrap_or("A scene of dem-run")),
        description: format!(
            "Step {step} of {source}, h = {:e} s. Impulses (N s), velocities (m/s). r is the shifted reaction r + h r_coh n, \
             which absorbs cohesion. Moments are divided by the mean diameter of their pair, relative spins multiplied by \
             it. Rows that a contact lacks are zero. In {associated} of {} contacts (/cohesive_dem/associated) the flow \
             is associated: r in K, u in its dual, without mu |u_t| + mu_r |u_m| in the normal velocity.",
            scene.time.step,
            assembled.len()
        ),
        math_info: "W is symmetric and positive semi-definite".into(),
        solution: solved.then(|| Assembled::of(&contacts).r),
        assembled,
        warnings: Vec::new(),
    };
    problem.write(&options.output)?;
    let shown = format!(
        "problem          {}: {} contacts of {} rows\nlook at it with\n  dem-run solve {}",
        options.output.display(),
        problem.assembled.len(),
        problem.assembled.parts().rows.count(),
        options.output.display()
    );
    Ok(print_line(&shown)?)
}
