//! Repeats one operation on a scene, for tools that count instructions or bytes: `cost
//! disks|spheres|twisting FEATURE ROWS COLUMNS sweep|step TIMES` prints the number of grains and
//! contacts, the bytes of a contact, and the peak resident size (kB).

#[path = "../tests/core/common/mod.rs"]
mod common;

use common::family::{FEATURES, layers_of_spheres, rows_of_disks};
use dem_core::contact::LocalSolve;
use dem_core::dim::{D3, D3Twist, Dim};
use dem_core::solver::sweep;
use dem_core::world::World;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [grains, feature, rows, columns, what, times] = arguments.as_slice() else {
        panic!("usage: cost disks|spheres|twisting FEATURE ROWS COLUMNS sweep|step TIMES");
    };
    let number = |text: &str| text.parse::<usize>().expect("a whole number");
    let feature = FEATURES.iter().find(|(name, _)| name == feature).expect("a feature of common/family.rs").1;
    let (rows, columns, times) = (number(rows), number(columns), number(times));
    match grains.as_str() {
        "disks" => spend(rows_of_disks(rows, columns, feature, 20), what, times),
        "spheres" => spend(layers_of_spheres::<D3>(rows, columns, feature, 20), what, times),
        "twisting" => spend(layers_of_spheres::<D3Twist>(rows, columns, feature, 20), what, times),
        other => panic!("disks, spheres or twisting, not {other}"),
    }
}

fn spend<D: Dim>(mut world: World<D>, what: &str, times: usize) {
    let mut problem = world.contact_problem();
    let (contacts, bytes) = (problem.len(), problem.contact_bytes());
    if what == "sweep" {
        rayon::scope(|_| (0..times).for_each(|_| sweep(&mut problem, LocalSolve::Exact)));
    } else {
        drop(problem);
        for _ in 0..times {
            world.step().expect("any residual is accepted");
        }
    }
    println!("{} {contacts} {} {}", world.grains.len(), bytes / contacts, peak());
}

/// The peak resident size of this process (kB) as Linux reports it; zero elsewhere.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok()).unwrap_or(0)
}
