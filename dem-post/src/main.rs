//! The `dem-post` command.

use std::process::ExitCode;

use dem_post::analysis::note;
use dem_post::cli::parse;

fn main() -> ExitCode {
    let (analysis, options, shown) = parse();
    match (analysis.run)(&options, shown) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            note(&format!("dem-post: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}
