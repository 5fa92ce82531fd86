//! Cost of one Gauss–Seidel sweep per contact, for each law, from 430 to 1,000,000 disks and for
//! spheres, compared with a loop that streams the same bytes on one thread. Large problems are
//! swept by `RAYON_NUM_THREADS` threads.
//!
//! `cargo bench -p dem-core --bench sweep`; criterion's throughput line gives contacts per second,
//! 1e9 / that is ns a contact.

#[path = "../tests/core/common/mod.rs"]
mod common;

use common::family::{FEATURES, Feature, layers_of_spheres, rows_of_disks};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dem_core::contact::LocalSolve;
use dem_core::dim::{D3, Dim};
use dem_core::solver::sweep;
use dem_core::world::World;
use std::hint::black_box;
use std::time::Instant;

/// Sum of all words in eight lanes: bound by memory, not by the latency of one chain of additions.
fn stream(words: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    for chunk in words.chunks_exact(8) {
        for (lane, word) in lanes.iter_mut().zip(chunk) {
            *lane += word;
        }
    }
    lanes.iter().sum()
}

fn of_disks(c: &mut Criterion) {
    for (name, rows, columns) in [("430", 20, 22), ("4190", 20, 210), ("40000", 200, 200), ("1000000", 1000, 1000)] {
        // a million disks are for comparison with the memory bandwidth
        let wanted = |feature| rows < 1000 || feature == Feature::Friction;
        sweeps(c, &format!("sweep {name} disks"), wanted, |feature| rows_of_disks(rows, columns, feature, 0));
    }
}

fn of_spheres(c: &mut Criterion) {
    for (name, layers, columns) in [("724", 8, 10), ("39000", 40, 32)] {
        sweeps(
            c,
            &format!("sweep {name} spheres"),
            |_| true,
            |feature| layers_of_spheres::<D3>(layers, columns, feature, 0),
        );
    }
}

/// Sweeps over the contacts of a scene, once for each wanted feature.
fn sweeps<D: Dim>(
    c: &mut Criterion,
    name: &str,
    wanted: impl Fn(Feature) -> bool,
    scene: impl Fn(Feature) -> World<D>,
) {
    let mut group = c.benchmark_group(name);
    // contacts with restitution are dry contacts
    for (kind, feature) in FEATURES.into_iter().filter(|&(_, f)| f != Feature::Restitution && wanted(f)) {
        let mut problem = scene(feature).contact_problem();
        let bytes = problem.contact_bytes();
        println!("{kind}: {} contacts of {} bytes", problem.len(), bytes / problem.len());
        group.throughput(Throughput::Elements(problem.len() as u64));
        for local in [LocalSolve::Exact, LocalSolve::PredictorCorrector] {
            group.bench_function(BenchmarkId::new(kind, format!("{local:?}")), |b| {
                b.iter_custom(|times| {
                    let start = Instant::now();
                    // inside the thread pool, as in a solver
                    rayon::scope(|_| (0..times).for_each(|_| sweep(black_box(&mut problem), local)));
                    start.elapsed()
                })
            });
        }
        let words = vec![1.0f64; bytes / 8];
        group.bench_function(BenchmarkId::new(kind, "stream"), |b| b.iter(|| stream(black_box(&words))));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = of_disks, of_spheres
}
criterion_main!(benches);
