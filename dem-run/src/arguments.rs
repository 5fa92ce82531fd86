//! The arguments of the command line, with their help texts.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::accuracy::trial::SolverName;
use crate::output::command_line::{Completions, Man, seconds, whole, with_negative_numbers};
use crate::output::escaped;
use crate::progress::ProgressMode;
use crate::solve::Solver;

/// Simulates cemented grains by non-smooth contact dynamics.
#[derive(Debug, Parser)]
#[command(name = "dem-run", version = VERSION, about, arg_required_else_help = true, after_help = EXIT_CODES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

/// Version number, and the revision of the source where it is known.
pub const VERSION: &str = env!("DEM_VERSION");

const EXIT_CODES: &str = "\
Exit codes: 0 done, 2 wrong usage or scene, 3 no convergence, 4 input/output, 130 interrupted.

Example:
  dem-run run configs/compression.json --set bonds.strength=5";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a shipped scene, with its comments, as the start of one's own; without NAME, list all.
    #[command(after_help = NEW_EXAMPLE)]
    New(NewArgs),
    /// Run a scene and write its history.
    #[command(after_help = RUN_EXAMPLE)]
    Run(RunArgs),
    /// Resume an interrupted or killed run from its history, or continue a finished one to a later
    /// end.
    #[command(after_help = RESUME_EXAMPLE)]
    Resume(ResumeArgs),
    /// Pack the random sample of a scene and write it to a file, for many runs.
    #[command(after_help = PACK_EXAMPLE)]
    Pack(PackArgs),
    /// Check a scene without running it; print grains and their sizes, walls, steps, frames, memory
    /// and disk space.
    #[command(after_help = CHECK_EXAMPLE)]
    Check(CheckArgs),
    /// Compute the largest load that a sample can bear before a bond must break, without running
    /// the scene.
    #[command(after_help = LIMIT_EXAMPLE)]
    Limit(LimitArgs),
    /// Write the contact problem of one step of a history in FCLIB's format, which other programs
    /// can solve too.
    #[command(after_help = EXPORT_EXAMPLE)]
    Export(ExportArgs),
    /// Solve a contact problem in FCLIB's format, from `dem-run export` or another program.
    #[command(after_help = SOLVE_EXAMPLE)]
    Solve(SolveArgs),
    /// Measure how accurate a scene's results are, and what more accuracy costs.
    #[command(after_help = ACCURACY_EXAMPLE)]
    Accuracy(AccuracyArgs),
    /// Run a scene with many values of its fields: a parameter study.
    #[command(after_help = SWEEP_EXAMPLE)]
    Sweep(SweepArgs),
    /// Print the JSON Schema of scenes, for editors, or a page of all their fields.
    #[command(after_help = SCHEMA_EXAMPLE)]
    Schema {
        /// Print the schema of sweeps instead.
        #[arg(long)]
        sweep: bool,
        /// Print the fields of scenes as a page in Markdown instead, docs/scenes.md.
        #[arg(long, conflicts_with = "sweep")]
        markdown: bool,
    },
    Completions(Completions),
    Man(Man),
}

const NEW_EXAMPLE: &str = "\
Example:
  dem-run new direct-tension -o mine.json";

const RUN_EXAMPLE: &str = "\
Ctrl-C ends the run after the current step, a second Ctrl-C immediately; `dem-run resume` continues it.

Example:
  dem-run run configs/compression.json -o weak.h5 --set bonds.strength=5 --set walls.top.force_rate=100";

const RESUME_EXAMPLE: &str = "\
The run continues from its last checkpoint (output.checkpoint_every; a run that ended, also by Ctrl-C, has one at its
end). Its results are bit for bit those of an uninterrupted run. The history up to the checkpoint is copied to a new
file, which then replaces the old one: this needs as much disk space again. Readers that have the file open keep the old
one.

A scene that differs from the one in the history is rejected with a list of the fields that differ; --force accepts it,
except for fields that cannot change during a run.

Example:
  dem-run resume compression.h5 --until 0.6";

const PACK_EXAMPLE: &str = "\
The sample is that of a run of the scene with the same seed, to the bit. A scene reads it as
  \"sample\": { \"file\": { \"path\": \"compression-sample.csv\" } }
A run with sample.random packs each time, a run with the file does not. The runs of a sweep share their packings and
need no file.

Example:
  dem-run pack configs/compression.json --set seed=3 -o seed-3.csv";

const CHECK_EXAMPLE: &str = "\
Values out of range are reported all together, each with its place, the value found and the values allowed. Errors of
syntax, names and types are reported before them, one at a time. The sample file is read, and grains and walls are
placed, as in a run; a random sample is not packed. Scenes that are valid but probably not as intended give warnings on
stderr, as in a run.

A scene is a regular file of at most 256 MiB; a sample file has at most 100,000,000 grains, in lines of at most 4096
bytes.

Example:
  dem-run check configs/compression.json --set time.step=5e-5";

const LIMIT_EXAMPLE: &str = "\
The largest factor on the growing loads for which some reactions balance all loads within the limits of all bonds and
contacts, with the grains at their places. Loads that grow are forces of walls and loads on grains whose values differ
between t = 0 and time.end: the factor multiplies that difference. Gravity, constant forces and the values at t = 0 are
not multiplied. If nothing grows, the force of the load wall is taken, also of one that is driven by a velocity.

A run breaks its first bond at or below this load, whatever its time step, solver, stiffnesses and order of contacts;
often well below, since it does not choose the best reactions. docs/theory/limit-load.md.

Example:
  dem-run limit configs/bending.json";

const ACCURACY_EXAMPLE: &str = "\
Runs the scene with several solvers, tolerances and time steps, all from one sample, and compares each run with the
finest. Then varies the order of the contacts and the starting reactions of rigid bonds; neither should change the
results. Runs of a bonded sample end at its collapse. docs/accuracy.md explains the tables.
--threads applies to the runs whose CPU time is not reported; the others use one thread. A step that misses its
tolerance is accepted if its residual is at most the scene's solver.accept; such steps are counted.

Example:
  dem-run accuracy configs/compression.json --tolerances 1e-3,1e-5 --steps 1 --orders 2";

const SCHEMA_EXAMPLE: &str = "\
Editors that support JSON Schema complete and explain a scene that names the schema:
  { \"$schema\": \"../docs/scene.schema.json\", … }

Example:
  dem-run schema > docs/scene.schema.json";

const SWEEP_EXAMPLE: &str = "\
A sweep file names a scene and the fields to vary. Fields in one object vary together; objects are combined, each with
each:
  { \"scene\": \"compression.json\",
    \"vary\": [ { \"bonds.strength\": [5, 10], \"walls.top.force_rate\": [100, 200] },
              { \"seed\": { \"from\": 1, \"count\": 10 } } ] }
All runs are checked before the first starts. Each run is a separate process with one thread and writes its own history.

Repeating the command continues the sweep: finished runs are kept; runs that were interrupted, killed or could not write
start again from the beginning; runs that failed for good (no convergence) are repeated only with --retry. Values added
to the sweep file make new runs. Exit codes 2 to 4: some runs failed, or another process makes them; the others are
done. More: docs/sweep.md.

Example:
  dem-run sweep configs/sweep-cohesion.json --jobs 4";

const EXPORT_EXAMPLE: &str = "\
The scene in the history is run again up to the step, so its sample file, if any, must still exist. The problem written
is the first one of the step, with the solution of the scene's solver. Its contents: docs/theory/fclib.md.

Example:
  dem-run export compression.h5 --step 1800 -o problem.hdf5";

const SOLVE_EXAMPLE: &str = "\
The solver starts from the initial guess in the file, or from zero. The exit code is 3 if the tolerance is not reached.

Example:
  dem-run solve problem.hdf5 --tolerance 1e-8 -o solved.hdf5";

/// The scene of a command.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Scene: a JSON file with comments.
    pub scene: PathBuf,
    /// Set the field PATH of the scene to VALUE, as in bonds.strength=5; VALUE is JSON or a bare
    /// word. May be repeated.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub set: Vec<String>,
}

/// How progress is shown.
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t)]
    pub progress: ProgressMode,
    /// Print only errors on stderr.
    #[arg(short, long)]
    pub quiet: bool,
}

/// How a command is carried out.
#[derive(Debug, Args)]
pub struct ExecutionArgs {
    /// Number of threads; results do not depend on it [default: all].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(1..=1024))]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub show: ShowArgs,
}

/// What the commands that hold the contacts of a scene have in common.
#[derive(Debug, Args)]
pub struct MemoryArgs {
    /// Run the scene even though it needs more memory than is free.
    #[arg(long)]
    pub ignore_memory: bool,
}

/// What the commands that run a scene from its start have in common.
#[derive(Debug, Args)]
pub struct MannerArgs {
    /// Overwrite files that exist.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub execution: ExecutionArgs,
}

#[derive(Debug, Args)]
pub struct NewArgs {
    /// Name of the scene.
    pub name: Option<String>,
    /// File to write [default: the scene's name with .json, in the current folder].
    #[arg(short, long, value_name = "FILE.json", requires = "name")]
    pub output: Option<PathBuf>,
    /// Overwrite a file that exists.
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// History to write [default: the scene's name with .h5, in the current folder].
    #[arg(short, long, value_name = "FILE.h5")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub manner: MannerArgs,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
    /// Write the prepared sample; scenes can read it as sample.file.
    #[arg(long, value_name = "FILE.csv")]
    pub write_sample: Option<PathBuf>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Take random packings from this folder, and keep new ones there.
    #[arg(long, hide = true, value_name = "DIR")]
    pub packings: Option<PathBuf>,
    /// End when the parent process ends, so that killing a sweep also ends its runs.
    #[arg(long, hide = true)]
    pub end_with_parent: bool,
}

#[derive(Debug, Args)]
pub struct PackArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Sample to write [default: the scene's name with -sample.csv, in the current folder].
    #[arg(short, long, value_name = "FILE.csv")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub manner: MannerArgs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct ResumeArgs {
    /// History of the run to resume.
    #[arg(value_name = "FILE.h5")]
    pub history: PathBuf,
    /// New, later end of the run (s).
    #[arg(long, value_name = "T", value_parser = later)]
    pub until: Option<f64>,
    /// Resume with this scene instead of the one in the history.
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Set the field PATH of the scene to VALUE, as in stop=null; VALUE is JSON or a bare word. May
    /// be repeated.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub set: Vec<String>,
    /// Resume even if the scene differs from the one in the history.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub execution: ExecutionArgs,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct SweepArgs {
    /// Sweep: a JSON file with comments.
    #[arg(value_name = "SWEEP.json")]
    pub sweep: PathBuf,
    /// Folder for the results, created if missing [default: the sweep's name with -sweep, in the
    /// current folder].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Number of runs at a time, one thread each [default: the number of processors].
    #[arg(short, long, value_name = "N", value_parser = whole::<usize>(1..=1024))]
    pub jobs: Option<usize>,
    /// Check every run; print their number, steps and disk space; write nothing.
    #[arg(long, group = "mode")]
    pub check: bool,
    /// Write the manifest, slurm.sh and Snakefile for other schedulers; run nothing.
    #[arg(long, group = "mode")]
    pub prepare: bool,
    /// Print which runs are done, failed or left, and update manifest.json and runs.csv; run
    /// nothing.
    #[arg(long, group = "mode")]
    pub status: bool,
    /// Run only the run with this number, unless it is done; for the tasks of a scheduler.
    #[arg(long, group = "mode", value_name = "NUMBER")]
    pub run: Option<String>,
    /// Also repeat runs that failed for good.
    #[arg(long)]
    pub retry: bool,
    /// Repeat runs whose scene has changed in the sweep, and delete runs that are no longer in it.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub show: ShowArgs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct AccuracyArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Folder for the results, created if missing [default: the scene's name with -accuracy, in the
    /// current folder].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Solvers to compare.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,…", default_value = "gauss-seidel,newton")]
    pub solvers: Vec<SolverName>,
    /// Tolerances of the residual.
    #[arg(long, value_delimiter = ',', value_name = "TOL,…", default_value = "1e-4,1e-6", value_parser = positive)]
    pub tolerances: Vec<f64>,
    /// Time steps, as factors on the scene's time.step.
    #[arg(long, value_delimiter = ',', value_name = "FACTOR,…", default_value = "1,0.5", value_parser = positive)]
    pub steps: Vec<f64>,
    /// End of the runs (s), instead of the scene's time.end.
    #[arg(long, value_name = "T", value_parser = later)]
    pub until: Option<f64>,
    /// Number of contact orders, and of starting reactions of rigid bonds, that each solver is run
    /// with; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = whole::<u64>(0..=10_000))]
    pub orders: u64,
    /// Continue each run to the scene's end, beyond the collapse of the sample.
    #[arg(long)]
    pub whole: bool,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub manner: MannerArgs,
    /// Print all measurements as JSON instead of the tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print JSON: the description of the run, or the problems of the scene.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct LimitArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub execution: ExecutionArgs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// History whose scene is run again.
    #[arg(value_name = "FILE.h5")]
    pub history: PathBuf,
    /// Step whose problem is written, counted from 1.
    #[arg(long, value_name = "K", value_parser = whole::<u64>(1..=u64::MAX))]
    pub step: u64,
    /// Problem to write.
    #[arg(short, long, value_name = "PROBLEM.hdf5")]
    pub output: PathBuf,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub manner: MannerArgs,
}

#[derive(Debug, Args)]
pub struct SolveArgs {
    /// Problem: a file in FCLIB's format (HDF5), with the group /fclib_local, /fclib_global or
    /// /fclib_global_rolling.
    #[arg(value_name = "PROBLEM.hdf5")]
    pub problem: PathBuf,
    /// Solver.
    #[arg(long, value_enum, default_value_t)]
    pub solver: Solver,
    /// Residual to reach.
    #[arg(long, value_name = "T", default_value_t = 1e-8, value_parser = positive)]
    pub tolerance: f64,
    /// Maximum number of iterations [default: 100000 sweeps of Gauss–Seidel, 300 iterations of the
    /// interior-point method].
    #[arg(long, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub max_iterations: Option<u64>,
    /// Memory of Anderson's acceleration of Gauss–Seidel, in iterations; 8 is a good value, 0 means
    /// plain sweeps.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<usize>(0..=10_000))]
    pub acceleration: usize,
    /// Write the problem with its solution if the tolerance is reached.
    #[arg(short, long, value_name = "SOLVED.hdf5")]
    pub output: Option<PathBuf>,
    /// Overwrite a file that exists.
    #[arg(long)]
    pub force: bool,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// A finite number above zero.
fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err("it must be a finite number above zero, as in 1e-8".into()),
    }
}

/// A time above zero (s).
fn later(text: &str) -> Result<f64, String> {
    match seconds(text)? {
        time if time > 0.0 => Ok(time),
        _ => Err("it must be a time above zero in s, as in 0.6".into()),
    }
}

/// The program's command line.
pub fn command() -> clap::Command {
    with_negative_numbers(Cli::command())
}

/// The arguments. An error message about them is printed without the control characters that they
/// may contain.
pub fn arguments() -> Cli {
    let read = command().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    read.unwrap_or_else(|error| {
        let controls = |argument: std::ffi::OsString| argument.to_string_lossy().contains(char::is_control);
        if !error.use_stderr() || !std::env::args_os().any(controls) {
            error.exit()
        }
        let _ = write!(std::io::stderr(), "{}", escaped(&error.render().to_string()));
        std::process::exit(error.exit_code())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }
}
