//! What the programs have in common on their command lines: values of options, completions, manual
//! pages, error messages.

use std::io::{IsTerminal, Write};
use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;

use crate::error::{Result, WriteError};
use crate::print::{escaped, print, print_line};

/// Print the completions of a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = COMPLETIONS_EXAMPLE)]
pub struct Completions {
    /// Shell.
    #[arg(value_enum)]
    shell: Shell,
}

const COMPLETIONS_EXAMPLE: &str = "\
Where a shell looks for them, for dem-run (dem-post alike):
  bash  dem-run completions bash > ~/.local/share/bash-completion/completions/dem-run
  zsh   dem-run completions zsh > DIR/_dem-run, with DIR in $fpath before compinit
  fish  dem-run completions fish > ~/.config/fish/completions/dem-run.fish";

/// Print the manual page, or write it and those of all commands into a folder.
#[derive(Debug, clap::Args)]
#[command(after_help = MAN_EXAMPLE)]
pub struct Man {
    /// Folder for the pages, created if missing.
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
}

const MAN_EXAMPLE: &str = "\
For dem-run (dem-post alike):
  dem-run man | man -l -
  dem-run man ~/.local/share/man/man1 && man dem-run-run";

impl Completions {
    /// Prints the completions of `command`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn print(&self, mut command: Command) -> Result<()> {
        let (name, mut script) = (command.get_name().to_string(), vec![]);
        clap_complete::generate(self.shell, &mut command, name, &mut script);
        print(&String::from_utf8_lossy(&script))
    }
}

impl Man {
    /// Prints or writes the pages of `command`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn print(&self, command: Command) -> Result<()> {
        let Some(folder) = &self.folder else {
            let mut page = vec![];
            let rendered = clap_mangen::Man::new(command).render(&mut page);
            rendered.map_err(|error| WriteError { path: "standard output".into(), why: error.to_string() })?;
            return print(&String::from_utf8_lossy(&page));
        };
        let name = command.get_name().to_string();
        let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
        written.map_err(|error| WriteError { path: folder.clone(), why: error.to_string() })?;
        print_line(&format!("wrote {name}.1 and the pages of its commands to {}", folder.display()))
    }
}

/// The command whose options, and those of its commands, take values that begin with a minus sign
/// and a digit.
#[must_use]
pub fn with_negative_numbers(command: Command) -> Command {
    let option = |arg: clap::Arg| {
        let takes = !arg.is_positional() && arg.get_action().takes_values();
        if takes { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(option).mut_subcommands(with_negative_numbers)
}

/// Reads a time (s).
///
/// # Errors
/// What is allowed.
pub fn seconds(text: &str) -> std::result::Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| "it must be a time in s, as in 0.15".into())
}

/// Reads whole numbers in `range`.
pub fn whole<T: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> std::result::Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        let value = text.trim().parse::<u64>().ok().filter(|value| range.contains(value));
        value.and_then(|value| T::try_from(value).ok()).ok_or_else(|| match (range.start(), range.end()) {
            (low, &u64::MAX) => format!("it must be a whole number, at least {low}"),
            (low, high) => format!("it must be a whole number from {low} to {high}"),
        })
    }
}

/// Prints an error on stderr as clap does: the word in red on a terminal, unless NO_COLOR is set.
/// With stderr closed there is nobody to tell.
pub fn print_error(error: &dyn std::fmt::Display) {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
        || std::env::var_os("TERM").is_some_and(|terminal| terminal == "dumb");
    let mut stderr = std::io::stderr();
    let word = if stderr.is_terminal() && !plain { "\u{1b}[1;31merror:\u{1b}[0m" } else { "error:" };
    let _ = writeln!(stderr, "{word} {}", escaped(&error.to_string()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program() -> Command {
        let option = clap::Arg::new("until").long("until").value_parser(seconds);
        let file = clap::Arg::new("file");
        with_negative_numbers(Command::new("program").subcommand(Command::new("run").about("Run").args([option, file])))
    }

    #[test]
    fn a_negative_number_is_the_value_of_an_option_and_no_file() {
        let matches = program().try_get_matches_from(["program", "run", "--until", "-1.5"]).expect("a number");
        let run = matches.subcommand_matches("run").expect("run");
        assert_eq!(run.get_one::<f64>("until"), Some(&-1.5));
        program().try_get_matches_from(["program", "run", "-1"]).expect_err("an option that does not exist");
        let told = program().try_get_matches_from(["program", "run", "--until", "abc"]).expect_err("a word");
        assert!(told.to_string().contains("it must be a time in s"), "{told}");
    }

    #[test]
    fn whole_numbers_have_limits() {
        let threads = whole::<usize>(1..=8);
        assert_eq!(threads("8"), Ok(8));
        for text in ["0", "9", "-1", "two", "1.5"] {
            assert_eq!(threads(text), Err("it must be a whole number from 1 to 8".into()), "{text}");
        }
        assert_eq!(whole::<u64>(1..=u64::MAX)("0"), Err("it must be a whole number, at least 1".into()));
    }

    #[test]
    fn every_command_has_a_manual_page() {
        let folder = tempfile::tempdir().expect("folder");
        let pages = folder.path().join("man1");
        Man { folder: Some(pages.clone()) }.print(program()).expect("pages");
        let page = std::fs::read_to_string(pages.join("program-run.1")).expect("the page of run");
        assert!(page.contains("\\-\\-until"), "{page}");
        assert!(pages.join("program.1").exists());
    }
}
