//! Runs a world and checks the invariants of every step, which hold for any scene.

use dem_core::bond::BondStatus;
use dem_core::dim::{Dim, Vect};
use dem_core::solver::certificate::Verdict;
use dem_core::world::{StepError, World};

/// The outcome of a run. Ratios are without unit.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Steps made.
    pub steps: usize,
    /// The error that ended it early.
    pub stopped: Option<StepError>,
    /// Deepest overlap of a dry contact over the smallest radius.
    pub penetration: f64,
    /// Spurious energy gain: increases of kinetic plus elastic energy minus the work done on the
    /// sample, summed over the steps, over the largest energy seen.
    pub gain: f64,
    /// Bonds that broke.
    pub broken: usize,
    /// Largest displacement of a grain over its radius.
    pub travel: f64,
}

/// The cause of an error, in the words of the page.
pub fn cause(error: &StepError) -> String {
    match error {
        _ if matches!(error.verdict(), Some(Verdict::NoSolution(_))) => "no motion is admissible".into(),
        StepError::NotAccepted { .. } => "no convergence".into(),
        StepError::Yielded { .. } => "a contact yields".into(),
        StepError::TooFast { .. } => "too fast for the step".into(),
        StepError::NotFinite { .. } => "not finite".into(),
        other => format!("{other:?}"),
    }
}

/// Make this number of steps, or stop at the first error, which must leave the world unchanged.
///
/// # Panics
/// If a number is not finite, a residual is above `accept`, a bond heals or changes its mode, bonds
/// and contacts contradict each other, or the energy balance does not close; without external
/// action also if the momentum changes.
pub fn watch<D: Dim + PartialEq>(world: &mut World<D>, steps: usize, accept: f64) -> Outcome {
    let mut out = Outcome::default();
    // the scene may have set velocities
    world.ledger.kinetic = world.kinetic_energy();
    let start = world.grains.position.clone();
    let (before, mut exchanged) = (world.momentum().linear, 0.0);
    let free = world.walls.is_empty() && world.settings.gravity.is_none() && world.loads.is_empty();
    let free = free && !world.grains.fixed.iter().any(|f| *f);
    let smallest = world.grains.radius.iter().copied().fold(f64::INFINITY, f64::min);
    let mut largest = world.ledger.kinetic;
    let mut last = world.ledger;
    let mut gained = 0.0;
    let mut statuses: Vec<BondStatus> = world.bonds.iter().map(|b| b.status).collect();
    while out.steps < steps {
        let was = (world.time, world.grains.clone(), world.ledger, world.touches().collect::<Vec<_>>());
        let report = match world.step() {
            Ok(report) => report,
            Err(error) => {
                assert_eq!(was.0, world.time, "an error moved the clock");
                assert!(was.1.position == world.grains.position && was.1.velocity == world.grains.velocity, "{error}");
                assert!(was.2 == world.ledger && was.3.into_iter().eq(world.touches()), "{error}");
                out.stopped = Some(error);
                break;
            }
        };
        out.steps += 1;
        finite(world);
        assert!(report.residual <= accept, "residual {} in step {}", report.residual, out.steps);
        out.penetration = out.penetration.max(report.penetration / smallest);
        let now: Vec<BondStatus> = world.bonds.iter().map(|b| b.status).collect();
        for (k, (old, new)) in statuses.iter().zip(&now).enumerate() {
            assert!(*old == BondStatus::Intact || old == new, "bond {k} healed or changed its mode");
        }
        let bonded = world.touches().filter_map(|t| t.bond).collect::<Vec<_>>();
        let intact = now.iter().filter(|s| **s == BondStatus::Intact).count();
        assert_eq!(bonded.len() - report_late(world, &report.breaks), intact, "bonds and contacts differ");
        statuses = now;
        let ledger = world.ledger;
        largest = largest.max(ledger.kinetic + ledger.elastic).max((ledger.external_work - last.external_work).abs());
        largest = largest.max(ledger.impact + ledger.friction);
        let energy = |l: &dem_core::world::Ledger| l.kinetic + l.elastic + l.fracture - l.external_work;
        gained += (energy(&ledger) - energy(&last)).max(0.0);
        last = ledger;
        // losses by impact and negative losses by friction may be large beside the remaining energy
        let entered = largest.max(ledger.impact.abs() + ledger.friction.abs());
        assert!(ledger.remainder.abs() <= 1e-9 * entered, "the balance is off by {} of {entered}", ledger.remainder);
        exchanged += world.touches().map(|t| t.reaction.n.abs() * world.settings.step).sum::<f64>();
    }
    exchanged += world.grains.mass.iter().zip(&world.grains.velocity).map(|(m, v)| m * v.norm()).sum::<f64>();
    out.gain = if largest > 0.0 { gained / largest } else { 0.0 };
    if free && exchanged > 0.0 {
        let change = (world.momentum().linear - before).norm();
        assert!(change <= 1e-9 * exchanged, "the momentum changed by {change} of {exchanged} exchanged");
    }
    out.broken = world.bonds.iter().filter(|b| b.status != BondStatus::Intact).count();
    let way = |k: usize| (world.grains.position[k] - start[k]).norm() / world.grains.radius[k];
    out.travel = (0..start.len()).map(way).fold(0.0, f64::max);
    out
}

/// Bonds that broke at the end of this step are still among its contacts.
fn report_late<D: Dim>(world: &World<D>, breaks: &[dem_core::world::Break<D>]) -> usize {
    let still = |bond: u32| world.touches().any(|t| t.bond == Some(bond));
    breaks.iter().filter(|b| still(b.bond)).count()
}

fn finite<D: Dim>(world: &World<D>) {
    let g = &world.grains;
    let all = |v: &[f64], what: &str| assert!(v.iter().all(|x| x.is_finite()), "{what} is not finite");
    for k in 0..g.len() {
        all(g.position[k].as_slice(), "a position");
        all(g.velocity[k].as_slice(), "a velocity");
        all(g.spin[k].as_slice(), "a spin");
        all(g.orientation[k].as_slice(), "an orientation");
    }
    for touch in world.touches() {
        all(&[touch.reaction.n, touch.gap], "a reaction");
        all(touch.reaction.t.as_slice(), "a reaction");
        all(touch.reaction.m.as_slice(), "a moment");
    }
}

/// Largest change of the length of an intact bond over its mean diameter.
pub fn stretch<D: Dim>(world: &World<D>) -> f64 {
    let intact = world.bonds.iter().filter(|b| b.status == BondStatus::Intact);
    let change = intact.map(|b| {
        let [i, j] = b.pair.map(|k| k as usize);
        let length = (world.grains.position[i] - world.grains.position[j]).norm();
        (length - b.mean_diameter - b.rest_gap).abs() / b.mean_diameter
    });
    change.fold(0.0, f64::max)
}
