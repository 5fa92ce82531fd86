//! Frames into a history: 4,000 grains in the plane with 12,000 bonded contacts, about 1.3 MB each,
//! in double and single precision.
//!
//! `cargo bench -p dem-run --bench history`; criterion's throughput line gives the bytes of the
//! frames per second. The file lies in the folder for temporary files and stays in the page cache.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dem_run::history::{BondStatus, Bonds, ContactRows, ContactStatus, Frame, GrainState, Grains, Layout, Writer};
use std::hint::black_box;

const GRAINS: usize = 4_000;
const CONTACTS: usize = 12_000;

fn layout(single: bool) -> Layout {
    Layout {
        dimension: 2,
        rotation: true,
        friction: true,
        single,
        grains: Grains {
            id: (0..GRAINS as i32).collect(),
            radius: vec![1e-3; GRAINS],
            mass: vec![1.0; GRAINS],
            inertia: vec![1.0; GRAINS],
            material: vec![],
        },
        bonds: Bonds {
            pair: (0..CONTACTS).map(|k| [(k % GRAINS) as i32, ((k + 1) % GRAINS) as i32]).collect(),
            rest_gap: vec![0.0; CONTACTS],
            strength: vec![10.0; CONTACTS],
            friction: vec![0.3; CONTACTS],
            rolling: vec![],
            twist: None,
            mean_diameter: vec![2e-3; CONTACTS],
            formed: None,
        },
        ..Layout::default()
    }
}

/// A frame whose numbers are all different, as those of a run are.
fn frame(layout: &Layout) -> Frame {
    let numbers = |count: usize| (0..count).map(|k| (k as f64).sqrt()).collect::<Vec<f64>>();
    Frame {
        grains: GrainState {
            position: numbers(2 * GRAINS),
            velocity: numbers(2 * GRAINS),
            angular_velocity: numbers(GRAINS),
            orientation: numbers(GRAINS),
        },
        contacts: ContactRows {
            pair: layout.bonds.pair.clone(),
            point: numbers(2 * CONTACTS),
            normal: numbers(2 * CONTACTS),
            reaction: numbers(2 * CONTACTS),
            moment: numbers(CONTACTS),
            gap: numbers(CONTACTS),
            status: vec![ContactStatus::Bonded; CONTACTS],
            bond: (0..CONTACTS as i32).collect(),
            ..ContactRows::default()
        },
        bonds: vec![BondStatus::Intact; CONTACTS],
        ..Frame::default()
    }
}

/// Bytes of the numbers of a frame.
fn bytes(single: bool) -> u64 {
    let real = if single { 4 } else { 8 };
    let codes = CONTACTS * (2 * size_of::<i32>() + 1 + size_of::<i32>() + 1);
    (real * (6 * GRAINS + 8 * CONTACTS) + codes) as u64
}

fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10);
    for (name, single) in [("double", false), ("single", true)] {
        let folder = tempfile::tempdir().expect("a folder for temporary files");
        let layout = layout(single);
        let mut writer = Writer::create(&folder.path().join("bench.h5"), &layout, false).expect("create");
        let mut frame = frame(&layout);
        group.throughput(Throughput::Bytes(bytes(single)));
        group.bench_function(name, |b| {
            b.iter(|| {
                frame.step += 1;
                writer.frame(black_box(&frame)).expect("write");
            });
        });
        writer.finish().expect("close");
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
