//! `dem-run pack`: the random sample of a scene as a table of grains.

use std::fmt;
use std::path::{Path, PathBuf};

use dem_core::dim::Dim;
use serde::Serialize;

use crate::clock::cpu_time;
use crate::error::RunError;
use crate::in_dimension;
use crate::output::{facts, in_shell, print_result};
use crate::prepare::{self, Packing};
use crate::run::{Execution, handle_signals};
use crate::sample_file;
use crate::scene::{RandomSample, Sample, Scene};
use crate::signals::Interrupt;
use crate::warnings;

/// Options of `dem-run pack`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackOptions {
    /// The file of the scene.
    pub scene: PathBuf,
    /// Its changed fields, as given to `--set`.
    pub set: Vec<String>,
    /// CSV file to which the sample is written.
    pub output: PathBuf,
    /// How the command is carried out.
    pub execution: Execution,
    /// Whether the result on stdout is JSON.
    pub json: bool,
}

/// A packed sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Packed {
    #[serde(skip)]
    scene: PathBuf,
    /// Its changed fields, apart from those of the sample.
    #[serde(skip)]
    set: Vec<String>,
    /// Number of grains, after a cut.
    grains: usize,
    /// Solid fraction in the box, before a cut (–).
    solid_fraction: f64,
    /// Processor time of the packing (s).
    cpu_time: f64,
    /// The file.
    sample: PathBuf,
}

/// Packs the random sample of a scene and writes it as `run --write-sample` does.
///
/// # Errors
/// [`RunError`]: no random sample, a sample that cannot be packed, a file that cannot be written,
/// an interruption.
pub fn pack(scene: &Scene, options: &PackOptions) -> Result<(), RunError> {
    let Sample::Random(random) = &scene.sample else {
        return Err(RunError::Usage(format!(
            "sample: {} has no random sample: `dem-run pack` needs sample.random; grains of a lattice, a list or a file \
             need no packing",
            options.scene.display()
        )));
    };
    let interrupt = handle_signals()?;
    options.execution.start_threads()?;
    in_dimension!(scene, D => pack_in::<D>(random, scene.seed, options, &interrupt))
}

fn pack_in<D: Dim>(
    sample: &RandomSample,
    seed: u64,
    options: &PackOptions,
    interrupt: &Interrupt,
) -> Result<(), RunError> {
    let mut progress = options.execution.show();
    let Packing { balls, solid_fraction, unsettled } = prepare::pack::<D>(sample, seed, &mut |done| {
        progress.phase("packing the sample", done);
        !interrupt.requested()
    })?;
    progress.finish();
    if let Some(moved) = unsettled {
        progress.note(&format!("warning: {}", warnings::of_packing(moved)));
    }
    let (grains, scene, path) = (balls.len(), options.scene.clone(), &options.output);
    sample_file::write::<D>(balls, (&[], &[]), path)?;
    let of_sample = |set: &String| set.starts_with("sample.") || set.starts_with("sample=");
    let set = options.set.iter().filter(|set| !of_sample(set)).cloned().collect();
    let packed = Packed { scene, set, grains, solid_fraction, cpu_time: cpu_time(), sample: path.clone() };
    Ok(print_result(&packed, options.json)?)
}

impl fmt::Display for Packed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = facts(&[
            ("grains", self.grains.to_string()),
            ("solid fraction", format!("{:.4}", self.solid_fraction)),
            ("CPU time", format!("{:.1} s", self.cpu_time)),
            ("sample", self.sample.display().to_string()),
        ]);
        // a relative path would start from the folder of the scene
        let path = std::path::absolute(&self.sample).unwrap_or_else(|_| self.sample.clone());
        let sample = format!("sample={}", serde_json::json!({ "file": { "path": path.to_string_lossy() } }));
        write!(f, "{text}\nuse it with\n  dem-run run {}", in_shell(&self.scene))?;
        self.set.iter().chain([&sample]).try_for_each(|set| write!(f, " --set {}", in_shell(Path::new(set))))
    }
}
