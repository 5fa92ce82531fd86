//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

/// Looks at the histories that `dem-run run` writes.
#[derive(Debug, Parser)]
#[command(name = "dem-post", version, propagate_version = true)]
pub struct Cli {
    /// What to look at.
    #[command(subcommand)]
    pub command: Command,
    /// Print results as JSON.
    #[arg(long, global = true)]
    pub json: bool,
    /// Say nothing on standard error but errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

/// The analyses.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// What a history holds, in about twenty lines.
    Info {
        /// The history.
        #[arg(value_name = "FILE.h5")]
        history: PathBuf,
    },
    /// Ruptures, broken bonds over time, the decohesion map, fragments.
    Cracks(Moments),
    /// The force network, and the distribution of its forces.
    Chains(Moments),
    /// Force–displacement, stress–strain, the collapse load.
    StressStrain {
        /// The files.
        #[command(flatten)]
        files: Files,
        /// The driven wall, where there are several.
        #[arg(long, value_name = "NAME")]
        wall: Option<String>,
    },
}

/// A history and the folder for what is made of it.
#[derive(Debug, Args)]
pub struct Files {
    /// The history.
    #[arg(value_name = "FILE.h5")]
    pub history: PathBuf,
    /// Folder for the results, created if need be [default: FILE-post].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// Files, and the moments to draw.
#[derive(Debug, Args)]
pub struct Moments {
    /// The files.
    #[command(flatten)]
    pub files: Files,
    /// Times of the maps, s, as in 0.1,0.15 [default: first break, 5 % broken, end].
    #[arg(long, value_name = "T,…", value_delimiter = ',')]
    pub times: Vec<f64>,
}
