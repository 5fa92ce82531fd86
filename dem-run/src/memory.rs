//! The memory that a run needs, and the free memory.

use crate::error::RunError;
use crate::scene::{Lattice, Sample, Scene, SolverKind};
use dem_core::solver::MOST_FACTORISED;
use std::path::{Path, PathBuf};

/// Memory of the program, its threads and the HDF5 library (bytes).
const PROGRAM: f64 = 20e6;
/// Memory of a grain without its contacts (bytes).
const GRAIN: f64 = 300.0;

/// Peak memory of a run of `scene` with this many grains (bytes), fitted to runs of 500 to 250,000
/// grains (docs/cost.md). The error is about 20 % for a typical number of contacts. In 3D, the
/// fill-in of Newton's factor per grain grows with the sample.
#[must_use]
pub fn expected(scene: &Scene, grains: usize) -> u64 {
    let bonded = scene.has_bonds();
    let contacts = contacts_per_grain(scene) * grains as f64;
    let newton = match scene.solver.kind {
        SolverKind::Newton(_) | SolverKind::Interior(_) => true,
        SolverKind::Auto(_) => bonded || contacts <= MOST_FACTORISED as f64,
        SolverKind::GaussSeidel(_) => false,
    };
    let contact = match (scene.dimension, newton, bonded) {
        (2, true, _) => 4200.0,
        (2, false, true) => 1250.0,
        (2, false, false) => 850.0,
        (_, true, _) => 18e3 * (contacts / 3000.0).max(0.1).powf(0.15),
        (_, false, true) => 1650.0,
        (_, false, false) => 1150.0,
    };
    (PROGRAM + GRAIN * grains as f64 + contact * contacts) as u64
}

/// Contacts per grain in a large sample (–).
pub(crate) fn contacts_per_grain(scene: &Scene) -> f64 {
    match (&scene.sample, scene.dimension) {
        (Sample::Lattice(Lattice::Square { .. }), _) => 2.0,
        (Sample::Lattice(Lattice::Cubic { .. }), _) => 3.0,
        (Sample::Lattice(Lattice::Hexagonal { .. }), 2) => 3.0,
        (Sample::Lattice(Lattice::Hexagonal { .. }), _) => 6.0,
        (_, 2) => 2.2,
        _ => 3.5,
    }
}

/// Rejects a run that needs more memory than is free.
///
/// # Errors
/// [`RunError::Memory`].
pub fn refuse_too_large(scene: &Scene, grains: usize) -> Result<(), RunError> {
    let needed = expected(scene, grains);
    match free() {
        Some(free) if free < needed => Err(RunError::Memory { grains, needed, free }),
        _ => Ok(()),
    }
}

/// Memory that this process can still allocate (bytes): free memory and swap space of the machine,
/// within the limits of the control groups and of the process; none if the system does not report
/// it.
#[must_use]
pub fn free() -> Option<u64> {
    let left = machine().into_iter().chain(control_groups()).chain(process());
    left.min()
}

/// Free memory and swap space of the machine (bytes).
fn machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kilobytes = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    Some(1024 * (kilobytes("MemAvailable")? + kilobytes("SwapFree").unwrap_or(0)))
}

/// Memory left (bytes) within the limits of the control group of this process and of its parents,
/// such as a container.
fn control_groups() -> Vec<u64> {
    let own = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let group = own.lines().find_map(|line| line.strip_prefix("0::/")).unwrap_or_default();
    let root = Path::new("/sys/fs/cgroup");
    let folders = root.join(group);
    folders.ancestors().take_while(|folder| folder.starts_with(root)).filter_map(left_in_group).collect()
}

fn left_in_group(folder: &Path) -> Option<u64> {
    let read = |name: &str| std::fs::read_to_string(PathBuf::from(folder).join(name)).ok();
    // without a limit, the file contains "max"
    let limit: u64 = read("memory.max")?.trim().parse().ok()?;
    let used: u64 = read("memory.current")?.trim().parse().ok()?;
    // cached files can be dropped
    let files = read("memory.stat")?.lines().find_map(|line| line.strip_prefix("inactive_file ")?.parse().ok());
    Some(limit.saturating_sub(used.saturating_sub(files.unwrap_or(0))))
}

/// Memory left within the limit of this process (`ulimit -v`) (bytes).
#[cfg(unix)]
fn process() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::As).current
}

#[cfg(not(unix))]
fn process() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::config;

    #[test]
    fn the_estimate_is_near_what_was_measured() {
        let hexagonal = |dimension, newton, bonded, grains| {
            let layers = if dimension == 3 { r#", "layers": 1"# } else { "" };
            let sample = format!(
                r#"sample={{"lattice": {{"hexagonal": {{"diameter": 1e-3, "rows": 9, "columns": 9{layers}}}}}}}"#
            );
            let bonds = format!("bonds={}", if bonded { r#"{"strength": 1, "gap_tolerance": 1e-3}"# } else { "null" });
            let kind = if newton { r#"solver.kind={"newton": {}}"# } else { r#"solver.kind={"gauss_seidel": {}}"# };
            let base = if dimension == 2 { "compression.json" } else { "cylinder-compression.json" };
            let sets = [&*sample, &bonds, kind, "stop=null"];
            expected(&config(base, &sets), grains) as f64
        };
        for (dimension, newton, bonded, grains, measured) in [
            (2, false, false, 254_773, 700e6),
            (2, false, true, 254_773, 964e6),
            (2, true, true, 7_877, 109e6),
            (2, true, true, 63_378, 894e6),
            (3, false, false, 248_063, 1730e6),
            (3, false, true, 63_200, 628e6),
            (3, true, true, 950, 101e6),
            (3, true, true, 3_968, 479e6),
        ] {
            let ratio = hexagonal(dimension, newton, bonded, grains) / measured;
            assert!((0.75..1.35).contains(&ratio), "{dimension} {newton} {bonded} {grains}: {ratio}");
        }
        // 874 MB was measured for 10,000 spheres
        let cylinder = expected(&config("cylinder-compression.json", &[]), 10_000) as f64 / 874e6;
        assert!((0.75..1.35).contains(&cylinder), "{cylinder}");
    }

    #[test]
    fn a_limit_of_a_control_group_leaves_what_is_not_used() {
        let folder = tempfile::tempdir().expect("folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("write");
        assert_eq!(left_in_group(folder.path()), None);
        write("memory.max", "max\n");
        write("memory.current", "700\n");
        write("memory.stat", "anon 400\ninactive_file 300\n");
        assert_eq!(left_in_group(folder.path()), None);
        write("memory.max", "1000\n");
        assert_eq!(left_in_group(folder.path()), Some(600));
    }
}
