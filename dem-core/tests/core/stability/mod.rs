//! The simulator at its limits. The ignored tests are long; docs/running.md names the one that
//! rewrites docs/stability.md.

mod atlas;
mod cases;
mod harness;
mod random;
mod scene;

use atlas::{ROWS, Row};
use rayon::prelude::*;
use scene::Kind;
use std::path::Path;

#[test]
fn what_must_hold_holds_with_the_default_solver_and_the_interior_point_method() {
    ROWS.par_iter().for_each(|row| row.check(&row.runs(row.must_hold, &[Kind::Auto, Kind::Interior], &[2, 3], 25)));
}

/// `cargo test --release -p dem-core --test core stability::page -- --ignored`
#[test]
#[ignore = "long: see docs/running.md"]
fn page() {
    let rows: Vec<_> = ROWS.par_iter().map(|row| (row, row.runs(row.tried, &Kind::ALL, &[2, 3], 200))).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/stability.md");
    let page = std::fs::read_to_string(&path).expect("docs/stability.md");
    let (marks, mark) = ("<!-- table -->\n", "<!-- end of the table -->\n");
    let (head, rest) = page.split_once(marks).expect("the mark before the table");
    let (_, tail) = rest.split_once(mark).expect("the mark after the table");
    std::fs::write(&path, format!("{head}{marks}{}{mark}{tail}", atlas::table(&rows))).expect("docs/stability.md");
    rows.iter().for_each(|(row, runs)| row.check(runs));
}

/// Light grains that carry heavy ones: the error of their velocities was the residual times the
/// mass ratio, and the heap stopped or gained energy. Below a grain 100 times as large, where
/// sweeps miss the tolerance, it gained energy, too. With a friction of 1e6 the law adds 1e6 times
/// the creep velocity of a contact to its opening velocity.
#[test]
fn heaps_that_failed_hold_with_the_exact_solvers() {
    let exact = [Kind::Auto, Kind::Interior];
    let [dry, bonded, size, friction] = ["mass of every", "the same, bonded", "radius of a grain", "friction"]
        .map(|name| ROWS.iter().find(|row| row.parameter.starts_with(name)).expect("a row of the atlas"));
    let runs = |row: &Row, values: &[f64], dimensions: &[usize]| row.runs(values, &exact, dimensions, 200);
    let all = [
        runs(dry, &[1e-6, 1e6], &[2]),
        runs(bonded, &[1e-9, 1e-6, 1e6, 1e9], &[2]),
        runs(bonded, &[1e-6, 1e6], &[3]),
        runs(size, &[100.0], &[2, 3]),
        runs(friction, &[1e6], &[2]),
    ];
    all.iter().flatten().for_each(|run| assert!(run.failing().is_empty(), "{}: {}", run.name(), run.failing()));
}
