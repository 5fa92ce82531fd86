//! The processor time that a scene takes as long as nothing breaks, as a range.

use crate::memory::contacts_per_grain;
use crate::scene::{Scene, SolverKind};

/// Least and greatest time (s) of a step, apart from its contacts: the writer of the history.
const STEP: [f64; 2] = [0.0, 1e-4];
/// Least and greatest time (s) of a contact in a step: extrapolated steps only, and several
/// factorisations a step; of disks.
const DISKS: [f64; 2] = [3e-7, 5e-6];
/// The same of spheres in samples of [`FEW`] contacts.
const SPHERES: [f64; 2] = [1.5e-6, 4e-5];
/// Contacts above which the greatest time of a contact grows by the power [`FILL`]: in 3D factors
/// fill in.
const FEW: f64 = 3000.0;
/// Power of the number of contacts.
const FILL: f64 = 0.7;
/// Greatest time of a contact of spheres with elastic bonds, over that with rigid ones: the loaded
/// sample swings, so contacts without a bond open, close and slip.
const SWINGS: f64 = 4.0;
/// The same of Gauss–Seidel and of the default solver without bonds, from tens to thousands of
/// sweeps a step.
const SWEEPS: [f64; 2] = [3e-7, 1e-4];

/// Least and greatest processor time (s) of all steps of `scene` with this many grains, if nothing
/// breaks, without the preparation. Fitted to runs of 1 to 10,000 grains (docs/cost.md).
#[must_use]
pub fn unbroken(scene: &Scene, grains: usize) -> [f64; 2] {
    let contacts = contacts_per_grain(scene) * grains as f64;
    let elastic = scene.bonds.as_ref().is_some_and(|bonds| bonds.stiffness.is_some());
    let swings = if elastic { SWINGS } else { 1.0 };
    let [low, high] = match (&scene.solver.kind, scene.dimension) {
        (SolverKind::GaussSeidel(_), _) => SWEEPS,
        (SolverKind::Auto(_), _) if !scene.has_bonds() => SWEEPS,
        (_, 2) => DISKS,
        _ => [SPHERES[0], SPHERES[1] * swings * (contacts / FEW).max(1.0).powf(FILL)],
    };
    let steps = scene.steps() as f64;
    [STEP[0] + low * contacts, STEP[1] + high * contacts].map(|step| step * steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{count, tests::config};

    /// Mean processor time of the steps before the first break, or of all steps without bonds, in
    /// runs of the shipped scenes on one thread; with elastic bonds the median that docs/cost.md
    /// has.
    #[test]
    fn the_measured_times_are_in_the_range() {
        let elastic = r#"bonds.stiffness={"young": {"modulus": 1e10, "poisson_ratio": 0.2}}"#;
        for (name, sets, grains, measured) in [
            ("compression", &[][..], None, 0.465e-3),
            ("brazilian-2d", &[], Some(531), 1.025e-3),
            ("biaxial", &[], None, 0.786e-3),
            ("direct-tension", &[], None, 0.798e-3),
            ("shear-box", &[], None, 0.769e-3),
            ("bending-elastic", &[], None, 25.5e-3),
            ("brazilian-3d", &[], Some(873), 86.0e-3),
            ("brazilian-3d", &[], Some(892), 9.0e-3),
            ("cylinder-compression", &[], None, 523e-3),
            ("cylinder-compression", &[], Some(10_000), 3.18),
            ("cylinder-compression", &[elastic], Some(500), 49e-3),
            ("cylinder-compression", &[elastic], None, 7.54),
            ("cylinder-compression", &[elastic], Some(10_000), 18.5),
            ("column-collapse-3d", &[], None, 60.5e-3),
            ("column", &[], None, 0.097e-3),
            ("incline", &[], None, 0.077e-3),
            ("two-grains", &[], None, 0.079e-3),
        ] {
            let scene = config(&format!("{name}.json"), sets);
            let grains = grains.unwrap_or_else(|| count(&scene).expect("a number of grains"));
            let [low, high] = unbroken(&scene, grains).map(|time| time / scene.time.steps() as f64);
            assert!((low..=high).contains(&measured), "{name}: {measured} is not in {low} to {high}");
        }
    }
}
