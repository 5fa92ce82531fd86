//! The `dem-post` command.

use std::process::ExitCode;

use dem_output::command_line::print_error;

fn main() -> ExitCode {
    match dem_post::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}
