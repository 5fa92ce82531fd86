//! Cost of one Gauss–Seidel sweep per contact: 2 and 3 rows, 430 and 4190 disks, beside a loop that streams the same bytes.
//!
//! `cargo bench -p dem-core --bench sweep`; criterion's throughput line gives contacts per second, 1e9 / that is ns a contact.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{floor, grain, settings, world};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dem_core::contact::LocalSolve;
use dem_core::dim::D2;
use dem_core::problem::ContactProblem;
use dem_core::solver::sweep;
use std::hint::black_box;

/// Hexagonal rows of `columns` and `columns` − 1 disks under gravity on a floor.
fn lattice(rows: usize, columns: usize, bonded: bool) -> ContactProblem<D2> {
    let r = 2e-3;
    let mut disks = Vec::new();
    for row in 0..rows {
        let shift = if row % 2 == 0 { 0.0 } else { r };
        for column in 0..columns - row % 2 {
            disks.push(grain::<D2>(&[2.0 * r * column as f64 + shift, r + 3f64.sqrt() * r * row as f64], r));
        }
    }
    let mut set = settings(1e-4);
    set.gravity = common::down::<D2>(9.81);
    let mut w = world(disks, vec![floor(0.2)], set);
    if bonded {
        w.form_bonds(1e-6, |_| 100.0, 0.3);
    }
    w.contact_problem()
}

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

fn sweeps(c: &mut Criterion) {
    for (name, rows, columns) in [("430", 20, 22), ("4190", 20, 210)] {
        let mut group = c.benchmark_group(format!("sweep {name} disks"));
        for (kind, bonded) in [("2 rows", false), ("3 rows", true)] {
            let mut problem = lattice(rows, columns, bonded);
            group.throughput(Throughput::Elements(problem.len() as u64));
            for local in [LocalSolve::Exact, LocalSolve::PredictorCorrector] {
                group.bench_function(BenchmarkId::new(kind, format!("{local:?}")), |b| {
                    b.iter(|| sweep(black_box(&mut problem), local))
                });
            }
            let bytes = size_of_val(problem.bonded.as_slice()) + size_of_val(problem.dry.as_slice());
            let words = vec![1.0f64; bytes / 8];
            group.bench_function(BenchmarkId::new(kind, "stream"), |b| b.iter(|| stream(black_box(&words))));
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = sweeps
}
criterion_main!(benches);
