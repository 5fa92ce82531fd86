//! The command line: the options of all commands, and a command for each analysis.

use clap::{ArgMatches, Args, Command, FromArgMatches};
use dem_output::Print;
use dem_output::command_line::{Completions, Man, whole, with_negative_numbers};

use crate::ANALYSES;
use crate::analysis::Shown;

/// Analyses the histories that `dem-run run` writes.
#[derive(Debug, Args)]
#[command(version = env!("DEM_VERSION"), propagate_version = true, subcommand_required = true)]
#[command(arg_required_else_help = true, after_help = EXIT_CODES)]
struct Cli {
    /// Print results as JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Print only errors on standard error.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Width of the figures on paper, as in 85mm: charts are laid out for letters of 7 pt.
    #[arg(long, global = true, value_name = "85mm", value_parser = millimetres, allow_hyphen_values = true)]
    width: Option<f64>,
    /// Pixels of the PNG figures in an inch.
    #[arg(long, global = true, value_name = "N", default_value_t = 600, value_parser = whole::<u32>(30..=2400))]
    dpi: u32,
}

/// A width in millimetres, as in `85mm` or `85`.
fn millimetres(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix("mm").unwrap_or(text).trim_end().parse::<f64>();
    let width = number.map_err(|_| "found no width in millimetres, as in 85mm".to_string())?;
    // a chart has no room for its ticks on less
    if (40.0..=2000.0).contains(&width) { Ok(width) } else { Err("allowed 40mm to 2000mm".into()) }
}

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 some runs have no result, 2 wrong usage or nothing to analyse, 4 input/output.

Examples:
  dem-post report compression.h5
  dem-post cracks compression.h5 --times 0.29,0.3";

/// Runs the requested command. Wrong usage ends the process.
///
/// # Errors
/// Those of the command.
pub fn run() -> crate::output::Result<()> {
    let mut matches = command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    // clap rejects a command line without one of these commands
    let (name, options) = matches.remove_subcommand().unwrap_or_else(|| unreachable!("no command"));
    let shown = Shown {
        json: cli.json,
        quiet: cli.quiet,
        print: cli.width.map(|width| Print { width: 1e-3 * width, dots: f64::from(cli.dpi) / 0.0254 }),
    };
    match ANALYSES.iter().find(|one| one.name == name) {
        Some(analysis) => (analysis.run)(&options, shown),
        None if name == "man" => Ok(own::<Man>(&options).print(command())?),
        None => Ok(own::<Completions>(&options).print(command())?),
    }
}

fn own<A: FromArgMatches>(options: &ArgMatches) -> A {
    A::from_arg_matches(options).unwrap_or_else(|error| error.exit())
}

/// `dem-post` with a command for each analysis.
fn command() -> Command {
    let own = [Completions::augment_args(Command::new("completions")), Man::augment_args(Command::new("man"))];
    // commands first: help lists options in the order of definition, and these come last
    let commands = ANALYSES.iter().map(|analysis| (analysis.command)()).chain(own);
    with_negative_numbers(Cli::augment_args(Command::new("dem-post").subcommands(commands)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_is_in_millimetres() {
        assert_eq!(["85mm", "170 mm", "60.5"].map(millimetres), [Ok(85.0), Ok(170.0), Ok(60.5)]);
        for wrong in ["85cm", "", "mm", "-85mm", "NaN", "1mm", "1e9mm"] {
            assert!(millimetres(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_analysis_has_a_command_of_its_own_with_help() {
        let command = command();
        command.clone().debug_assert();
        let names: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        let analyses = ANALYSES.iter().map(|analysis| analysis.name);
        assert_eq!(names, analyses.chain(["completions", "man"]).collect::<Vec<_>>());
        assert!(command.get_subcommands().all(|command| command.get_about().is_some()));
    }
}
