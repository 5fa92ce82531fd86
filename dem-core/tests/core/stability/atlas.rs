//! Every parameter over its range, in both dimensions and with every solver, and the table of its
//! results.

use super::harness::{Outcome, cause, watch};
use super::scene::{Heap, Kind};
use dem_core::dim::{D2, D3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Largest overlap, over the smallest radius, and largest relative energy gain of a run that holds.
const OVERLAP: f64 = 0.1;
const GAIN: f64 = 0.05;

/// A parameter: the values that are tried, and those that must hold with every solver in 2D and 3D.
pub struct Row {
    pub parameter: &'static str,
    pub tried: &'static [f64],
    pub must_hold: &'static [f64],
    pub heap: fn(f64) -> Heap,
}

pub const ROWS: [Row; 16] = [
    Row {
        parameter: "mass of every other layer over that of the rest",
        tried: &[1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9],
        must_hold: &[1e-3, 1.0, 1e3],
        heap: |mass_ratio| Heap { mass_ratio, ..Heap::default() },
    },
    Row {
        parameter: "the same, bonded",
        tried: &[1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9],
        must_hold: &[1e-3, 1.0, 1e3],
        heap: |mass_ratio| Heap { mass_ratio, cohesion: 3.0, ..Heap::default() },
    },
    Row {
        parameter: "radius of a grain on top over that of the rest",
        tried: &[1.0, 10.0, 100.0, 1000.0],
        must_hold: &[1.0, 10.0],
        heap: |size_ratio| Heap { size_ratio, ..Heap::default() },
    },
    Row {
        parameter: "radius (m)",
        tried: &[1e-9, 1e-6, 1e-3, 1.0, 1e3],
        must_hold: &[1e-9, 1e-6, 1e-3, 1.0, 1e3],
        heap: |radius| Heap { radius, ..Heap::default() },
    },
    Row {
        parameter: "radius (m), bonded",
        tried: &[1e-9, 1e-6, 1e-3, 1.0, 1e3],
        must_hold: &[1e-9, 1e-6, 1e-3, 1.0, 1e3],
        heap: |radius| Heap { radius, cohesion: 3.0, ..Heap::default() },
    },
    Row {
        parameter: "friction",
        tried: &[0.0, 1e-12, 0.3, 1.0, 10.0, 1e6],
        must_hold: &[0.0, 1e-12, 0.3, 1.0],
        heap: |friction| Heap { friction, ..Heap::default() },
    },
    Row {
        parameter: "strength of bonds over the weight of a grain",
        tried: &[1e-12, 1e-3, 1.0, 1e3, 1e12],
        must_hold: &[1e-12, 1e-3, 1.0, 1e3, 1e12],
        heap: |cohesion| Heap { cohesion, ..Heap::default() },
    },
    Row {
        parameter: "the same, thrown at √(R g)",
        tried: &[1e-12, 1e-3, 1.0, 1e3, 1e12],
        must_hold: &[1e-12, 1e-3, 1.0],
        heap: |cohesion| Heap { cohesion, speed: 1.0, ..Heap::default() },
    },
    Row {
        parameter: "time step over √(R/g)",
        tried: &[1e-6, 1e-3, 0.1, 1.0, 10.0, 30.0],
        must_hold: &[1e-6, 1e-3, 0.1],
        heap: |step| Heap { step, ..Heap::default() },
    },
    Row {
        parameter: "the same, bonded",
        tried: &[1e-6, 1e-3, 0.1, 1.0, 10.0, 30.0],
        must_hold: &[1e-6, 1e-3, 0.1, 1.0],
        heap: |step| Heap { step, cohesion: 3.0, ..Heap::default() },
    },
    Row {
        parameter: "speed over √(R g)",
        tried: &[1e-6, 1e-3, 1.0, 1e2, 1e4],
        must_hold: &[1e-6, 1e-3, 1.0],
        heap: |speed| Heap { speed, ..Heap::default() },
    },
    Row {
        parameter: "gravity over that of the Earth",
        tried: &[0.0, 1e-6, 1.0, 1e3, 1e6],
        must_hold: &[0.0, 1e-6, 1.0],
        heap: |gravity| Heap { gravity, speed: 0.1, ..Heap::default() },
    },
    Row {
        parameter: "the same, bonded",
        tried: &[0.0, 1e-6, 1.0, 1e3, 1e6],
        must_hold: &[0.0, 1e-6, 1.0],
        heap: |gravity| Heap { gravity, speed: 0.1, cohesion: 3.0, ..Heap::default() },
    },
    Row {
        parameter: "restitution, thrown at √(R g), no friction",
        tried: &[0.0, 0.5, 1.0],
        must_hold: &[0.0, 0.5, 1.0],
        heap: |restitution| Heap { restitution, friction: 0.0, speed: 1.0, ..Heap::default() },
    },
    Row {
        parameter: "restitution, thrown at √(R g)",
        tried: &[0.0, 0.5, 1.0],
        must_hold: &[0.0, 0.5],
        heap: |restitution| Heap { restitution, speed: 1.0, ..Heap::default() },
    },
    Row {
        parameter: "grains along an axis of the lattice",
        tried: &[1.0, 2.0, 8.0],
        must_hold: &[1.0, 2.0, 8.0],
        heap: |side| Heap { side: side as usize, ..Heap::default() },
    },
];

/// A run: value, solver, dimension and outcome.
pub struct Run {
    value: f64,
    kind: Kind,
    dimension: usize,
    outcome: Outcome,
}

impl Row {
    /// Runs of these values, by value, solver and dimension.
    pub fn runs(&self, values: &[f64], kinds: &[Kind], dimensions: &[usize], steps: usize) -> Vec<Run> {
        let every = values.iter().flat_map(|v| kinds.iter().flat_map(move |k| dimensions.iter().map(|d| (*v, *k, *d))));
        let every: Vec<(f64, Kind, usize)> = every.collect();
        let run = |&(value, kind, dimension): &(f64, Kind, usize)| {
            let heap = Heap { kind, ..(self.heap)(value) };
            let outcome = if dimension == 2 {
                watch(&mut heap.world::<D2>(), steps, heap.accept())
            } else {
                // about as many grains as in 2D
                let side = heap.side.min(4).saturating_sub(1).max(1);
                watch(&mut Heap { side, ..heap.clone() }.world::<D3>(), steps, heap.accept())
            };
            Run { value, kind, dimension, outcome }
        };
        every.par_iter().map(run).collect()
    }

    /// # Panics
    /// If a value that must hold does not.
    pub fn check(&self, runs: &[Run]) {
        for run in runs.iter().filter(|run| self.must_hold.contains(&run.value)) {
            let how = run.failing();
            assert!(how.is_empty(), "{}, {:e}, {}: {how}", self.parameter, run.value, run.name());
        }
    }
}

impl Run {
    /// The failures of the run; empty if it holds.
    pub fn failing(&self) -> String {
        let o = &self.outcome;
        let mut how = Vec::new();
        if o.penetration > OVERLAP {
            how.push(format!("overlap {:.1} R", o.penetration));
        }
        if o.gain > GAIN {
            how.push(format!("energy +{:.0} %", 100.0 * o.gain));
        }
        how.extend(o.stopped.as_ref().map(|error| format!("stops: {}", cause(error))));
        how.join(", ")
    }

    pub fn name(&self) -> String {
        format!("{} {}D", self.kind.name(), self.dimension)
    }
}

/// The table of the page: for each parameter the values that hold, and the failures at the other
/// values.
pub fn table(rows: &[(&Row, Vec<Run>)]) -> String {
    let mut out = String::from("| parameter | holds | overlap | energy gained | elsewhere |\n|---|---|---|---|---|\n");
    for (row, runs) in rows {
        let of = |value: f64| runs.iter().filter(move |run| run.value == value);
        let (held, lost): (Vec<f64>, Vec<f64>) =
            row.tried.iter().partition(|value| of(**value).all(|run| run.failing().is_empty()));
        let within = || runs.iter().filter(|run| held.contains(&run.value)).map(|run| &run.outcome);
        let worst = |of: fn(&Outcome) -> f64| within().map(of).fold(0.0, f64::max);
        let list = held.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(", ");
        let elsewhere: Vec<String> = lost
            .iter()
            .map(|value| {
                let mut ways: BTreeMap<String, Vec<String>> = BTreeMap::new();
                let failing = of(*value).map(|run| (run.failing(), run.name())).filter(|(how, _)| !how.is_empty());
                failing.for_each(|(how, name)| ways.entry(how).or_default().push(name));
                let way = |(how, names): (&String, &Vec<String>)| match names.len() {
                    n if n == of(*value).count() => format!("{how} (all)"),
                    _ => format!("{how} ({})", names.join(", ")),
                };
                format!("**{value:e}** {}", ways.iter().map(way).collect::<Vec<_>>().join("; "))
            })
            .collect();
        let elsewhere = if elsewhere.is_empty() { "–".into() } else { elsewhere.join("<br>") };
        let (overlap, gain) = (worst(|o| o.penetration), worst(|o| o.gain));
        let _ = writeln!(out, "| {} | {list} | {overlap:.0e} R | {gain:.0e} | {elsewhere} |", row.parameter);
    }
    out
}
