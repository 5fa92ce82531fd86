//! The command line: the options of all commands, and a command for each analysis.

use clap::{ArgMatches, Args, Command, FromArgMatches};

use crate::ANALYSES;
use crate::analysis::{Entry, Shown};

/// Analyses the histories that `dem-run run` writes.
#[derive(Debug, Args)]
#[command(version, propagate_version = true, subcommand_required = true, arg_required_else_help = true)]
struct Cli {
    /// Print results as JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Print only errors on standard error.
    #[arg(long, short, global = true)]
    quiet: bool,
}

/// The requested analysis, its options, and the format of its output. Wrong usage ends the process.
pub fn parse() -> (&'static Entry, ArgMatches, Shown) {
    let mut matches = command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let asked = matches.remove_subcommand();
    let found = asked.and_then(|(name, options)| Some((ANALYSES.iter().find(|one| one.name == name)?, options)));
    // clap rejects a command line without one of these commands
    let (analysis, options) = found.unwrap_or_else(|| unreachable!("a command that is not listed"));
    (analysis, options, Shown { json: cli.json, quiet: cli.quiet })
}

/// `dem-post` with a command for each analysis.
fn command() -> Command {
    // commands first: help lists options in the order of definition, and these come last
    let commands = ANALYSES.iter().map(|analysis| (analysis.command)());
    Cli::augment_args(Command::new("dem-post").subcommands(commands))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_analysis_has_a_command_of_its_own_with_help() {
        let command = command();
        command.clone().debug_assert();
        let names: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        assert_eq!(names, ANALYSES.iter().map(|analysis| analysis.name).collect::<Vec<_>>());
        assert!(command.get_subcommands().all(|command| command.get_about().is_some()));
    }
}
