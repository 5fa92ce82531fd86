//! The `dem-run` command: see [`dem_run::cli`].

fn main() -> std::process::ExitCode {
    dem_run::cli::main()
}
