//! The `dem-run` command line: results on stdout, everything else on stderr.
//!
//! Exit codes: 0 done, 2 wrong usage or scene, 3 no convergence, 4 input/output, 130 interrupted.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::accuracy::{self, AccuracyOptions};
use crate::arguments::{
    AccuracyArgs, CheckArgs, Command, ExecutionArgs, ExportArgs, LimitArgs, NewArgs, PackArgs, ResumeArgs, RunArgs,
    SceneArgs, ShowArgs, SolveArgs, SweepArgs, arguments, command,
};
use crate::check::Check;
use crate::destination::{apart, folder_or_new, not_itself, unicode, writable};
use crate::error::RunError;
use crate::export::{self, ExportOptions};
use crate::limit::{self, LimitOptions};
use crate::new::{self, NewOptions};
use crate::output::command_line::print_error;
use crate::output::{default_folder, print, print_json, print_result};
use crate::pack::{self, PackOptions};
use crate::resume::{self, ResumeOptions};
use crate::run::{self, Execution, RunOptions};
use crate::scene::{self, Scene, SceneError, page, schema};
use crate::signals;
use crate::solve::{self, SolveOptions};
use crate::sweep::{self, Mode, SweepOptions};

/// The command: reads the arguments, runs, and gives the exit code.
#[must_use]
pub fn main() -> ExitCode {
    let result = match arguments().command {
        Command::New(NewArgs { name, output, force: overwrite }) => new::new(&NewOptions { name, output, overwrite }),
        Command::Run(args) => run(args),
        Command::Resume(args) => resume(args),
        Command::Pack(args) => pack(args),
        Command::Check(args) => check(&args),
        Command::Limit(args) => limit(args),
        Command::Export(args) => export(args),
        Command::Solve(args) => solve(args),
        Command::Accuracy(args) => accuracy(args),
        Command::Sweep(args) => sweep(args),
        Command::Schema { markdown: true, .. } => print(&page::markdown()).map_err(RunError::from),
        Command::Schema { sweep, .. } => {
            let schema = if sweep { sweep::model::json_schema() } else { schema::json_schema() };
            print_json(schema).map_err(RunError::from)
        }
        Command::Completions(shell) => shell.print(command()).map_err(RunError::from),
        Command::Man(pages) => pages.print(command()).map_err(RunError::from),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

impl From<ExecutionArgs> for Execution {
    fn from(args: ExecutionArgs) -> Self {
        Self { threads: args.threads, progress: args.show.progress, quiet: args.show.quiet }
    }
}

impl SceneArgs {
    fn load(&self) -> Result<Scene, SceneError> {
        scene::load(&self.scene, &self.set)
    }
}

fn run(args: RunArgs) -> Result<(), RunError> {
    if args.end_with_parent {
        signals::end_with_parent().map_err(|error| RunError::System {
            what: "cannot watch the parent process".into(),
            source: error.into(),
        })?;
    }
    let scene = args.scene.load()?;
    let options = RunOptions {
        output: args.output.unwrap_or_else(|| default_output(&args.scene.scene, ".h5")),
        overwrite: args.manner.force,
        execution: args.manner.execution.into(),
        json: args.json,
        write_sample: args.write_sample,
        packings: args.packings,
        ignore_memory: args.memory.ignore_memory,
    };
    apart(&args.scene.scene, &scene, &options)?;
    writable(&options.output, "-o FILE.h5", options.overwrite)?;
    if let Some(sample) = &options.write_sample {
        writable(sample, "--write-sample FILE.csv", options.overwrite)?;
    }
    run::run(&scene, &options)
}

fn pack(args: PackArgs) -> Result<(), RunError> {
    let scene = args.scene.load()?;
    let output = args.output.unwrap_or_else(|| default_output(&args.scene.scene, "-sample.csv"));
    not_itself(&args.scene.scene, &output)?;
    writable(&output, "-o FILE.csv", args.manner.force)?;
    let execution = args.manner.execution.into();
    let SceneArgs { scene: file, set } = args.scene;
    pack::pack(&scene, &PackOptions { scene: file, set, output, execution, json: args.json })
}

fn resume(args: ResumeArgs) -> Result<(), RunError> {
    resume::resume(&ResumeOptions {
        history: args.history,
        until: args.until,
        scene: args.scene,
        set: args.set,
        force: args.force,
        execution: args.execution.into(),
        json: args.json,
    })
}

fn check(args: &CheckArgs) -> Result<(), RunError> {
    let scene = match args.scene.load() {
        Err(error @ SceneError::Wrong { .. }) if args.json => {
            print_json(&serde_json::json!({ "problems": error.problems() }))?;
            return Err(error.into());
        }
        Err(SceneError::Syntax { name, line, column, message, excerpt }) if args.json => {
            print_json(&serde_json::json!({ "problems": [{ "line": line, "column": column, "message": message }] }))?;
            return Err(SceneError::Syntax { name, line, column, message, excerpt }.into());
        }
        result => result?,
    };
    let check = match Check::new(&scene) {
        Err(RunError::Sample(lines)) if args.json => {
            let problems: Vec<_> = lines.iter().map(|line| serde_json::json!({ "message": line })).collect();
            print_json(&serde_json::json!({ "problems": problems }))?;
            return Err(RunError::Sample(lines));
        }
        result => result?,
    };
    for warning in &check.warnings {
        let _ = writeln!(std::io::stderr(), "warning: {warning}");
    }
    Ok(print_result(&check, args.json)?)
}

fn limit(args: LimitArgs) -> Result<(), RunError> {
    let ignore_memory = args.memory.ignore_memory;
    let options = LimitOptions { execution: args.execution.into(), json: args.json, ignore_memory };
    limit::limit(&args.scene.load()?, &options)
}

fn export(args: ExportArgs) -> Result<(), RunError> {
    not_itself(&args.history, &args.output)?;
    writable(&args.output, "-o PROBLEM.hdf5", args.manner.force)?;
    export::export(&ExportOptions {
        history: args.history,
        step: args.step,
        output: args.output,
        execution: args.manner.execution.into(),
        ignore_memory: args.memory.ignore_memory,
    })
}

fn solve(args: SolveArgs) -> Result<(), RunError> {
    if let Some(output) = &args.output {
        not_itself(&args.problem, output)?;
        writable(output, "-o SOLVED.hdf5", args.force)?;
    }
    solve::solve(&SolveOptions {
        problem: args.problem,
        solver: args.solver,
        tolerance: args.tolerance,
        max_iterations: args.max_iterations,
        acceleration: args.acceleration,
        output: args.output,
        json: args.json,
    })
}

fn accuracy(args: AccuracyArgs) -> Result<(), RunError> {
    let mut scene = args.scene.load()?;
    if let Some(until) = args.until {
        scene.time.end = until;
    }
    let folder = args.output.unwrap_or_else(|| default_folder(&args.scene.scene, "-accuracy"));
    folder_or_new(&folder)?;
    if folder.join("accuracy.json").exists() && !args.manner.force {
        let remedy = "--force overwrites them, -o DIR names another folder".into();
        return Err(RunError::Unfit { path: folder, state: "holds results", remedy });
    }
    let options = AccuracyOptions {
        folder,
        solvers: args.solvers,
        tolerances: args.tolerances,
        steps: args.steps,
        orders: args.orders,
        whole: args.whole,
        execution: args.manner.execution.into(),
        json: args.json,
        ignore_memory: args.memory.ignore_memory,
    };
    accuracy::accuracy(&scene, &options)
}

fn sweep(args: SweepArgs) -> Result<(), RunError> {
    let mode = match args.run {
        Some(number) => Mode::One(number),
        None if args.check => Mode::Check,
        None if args.prepare => Mode::Prepare,
        None if args.status => Mode::Status,
        None => Mode::All,
    };
    let ShowArgs { progress, quiet } = args.show;
    let folder = args.output.unwrap_or_else(|| default_folder(&args.sweep, "-sweep"));
    unicode(&folder, "-o DIR")?;
    sweep::sweep(&SweepOptions {
        folder,
        sweep: args.sweep,
        mode,
        jobs: args.jobs,
        retry: args.retry,
        overwrite: args.force,
        execution: Execution { threads: None, progress, quiet },
        json: args.json,
    })
}

/// `<scene stem><ending>` in the current folder.
fn default_output(scene: &Path, ending: &str) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or_default().to_os_string();
    name.push(ending);
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_output_is_the_scene_s_name_in_the_current_folder() {
        assert_eq!(default_output(Path::new("configs/compression.json"), ".h5"), Path::new("compression.h5"));
        assert_eq!(default_output(Path::new("a.b.json"), "-sample.csv"), Path::new("a.b-sample.csv"));
    }
}
