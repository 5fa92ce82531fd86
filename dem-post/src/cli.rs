//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::frames::Subject;
use crate::strength::Measure;

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
    /// What a history holds, in about twenty lines; with --check, whether it is sound; with --repair, after a kill.
    Info {
        /// The history.
        #[arg(value_name = "FILE.h5")]
        history: PathBuf,
        /// Read everything and name each place that breaks the promises of the layout: types, shapes, units, order,
        /// numbers that are not finite, bonds and their ruptures. The exit code is 4 where there is one.
        #[arg(long)]
        check: bool,
        /// Make a file that any program opens of one whose run was killed: its complete frames are copied, and the copy
        /// takes its place. `dem-run resume` does the same and goes on with the run.
        #[arg(long, conflicts_with = "check")]
        repair: bool,
    },
    /// Ruptures, broken bonds over time, cracks as lines and their fronts, fragments.
    Cracks(Moments),
    /// The force network, the distribution of its forces, force chains.
    Chains(Moments),
    /// Maps and table of the velocities.
    Velocities(Moments),
    /// A series of numbered pictures, for a viewer or a film.
    Frames {
        /// The files.
        #[command(flatten)]
        files: Files,
        /// What to draw.
        #[arg(long, value_enum, default_value_t)]
        draw: Subject,
        /// Take every N-th frame, and the last.
        #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "times")]
        every: usize,
        /// Take the frames nearest to these times, s.
        #[arg(long, value_name = "T,…", value_delimiter = ',')]
        times: Vec<f64>,
    },
    /// Where two runs of one sample part: scenes, frames, broken bonds, curves.
    Compare {
        /// The first history.
        #[arg(value_name = "A.h5")]
        a: PathBuf,
        /// The second history.
        #[arg(value_name = "B.h5")]
        b: PathBuf,
        /// Distance of a grain's two places, in radii, up to which frames count as equal; 0 is equal in every bit.
        #[arg(long, value_name = "RADII", default_value_t = 0.0)]
        tolerance: f64,
        /// Folder for the results, created if need be [default: A-compare].
        #[arg(short, long, value_name = "DIR")]
        output: Option<PathBuf>,
        /// Take the folder over from the history that it belongs to: its results are removed.
        #[arg(long)]
        force: bool,
    },
    /// The run on one HTML page that needs nothing else: pictures, curves, tables, accuracy, energy, scene.
    Report {
        /// Files and moments.
        #[command(flatten)]
        moments: Moments,
        /// The load wall [default: that of the scene, else the only driven one].
        #[arg(long, value_name = "NAME")]
        wall: Option<String>,
    },
    /// Strength against a field of the scene over many runs, as against cohesion: a line, its errors, the scatter of samples.
    ///
    /// The exit code is 1 where runs were left out because they did not give way, or are not done.
    Strength {
        /// Histories, or the folder of a sweep.
        #[arg(value_name = "RUNS", required = true)]
        runs: Vec<PathBuf>,
        /// The varied field, as --set names it [default: the one that differs].
        #[arg(long, value_name = "FIELD")]
        against: Option<String>,
        /// What counts as the strength: the load at …
        #[arg(long, value_enum, default_value_t)]
        measure: Measure,
        /// The load wall [default: that of the scene, else the only driven one].
        #[arg(long, value_name = "NAME")]
        wall: Option<String>,
        /// Folder for the results, created if need be [default: RUNS-strength].
        #[arg(short, long, value_name = "DIR")]
        output: Option<PathBuf>,
        /// Take the folder over from the history that it belongs to: its results are removed.
        #[arg(long)]
        force: bool,
    },
    /// Small files that show the history in ParaView, VTK and MDAnalysis, and copy almost nothing of it.
    ///
    /// Grains, contacts and bonds over time as grains.vtkhdf, contacts.vtkhdf and bonds.vtkhdf (ParaView 5.13, VTK or
    /// pyvista), positions as grains.h5md (MDAnalysis). They lead to the history by a path relative to themselves:
    /// move them together. docs/history.md shows how to use them.
    View(Files),
    /// Compress a history: a copy with checksums takes its place once it is found to be the same to the bit.
    Pack {
        /// The history.
        #[arg(value_name = "FILE.h5")]
        history: PathBuf,
        /// Write the copy there, and leave the history as it is.
        #[arg(short, long, value_name = "PACKED.h5")]
        output: Option<PathBuf>,
        /// Replace a file that stands at PACKED.h5.
        #[arg(long)]
        force: bool,
    },
    /// Force–displacement, stress–strain, the collapse load.
    StressStrain {
        /// The files.
        #[command(flatten)]
        files: Files,
        /// The load wall [default: that of the scene, else the only driven one].
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
    /// Folder for the results, created if need be [default: FILE-post, of `frames` FILE-frames, in the current folder].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Take the folder over from the history that it belongs to: its results are removed.
    #[arg(long)]
    pub force: bool,
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
