//! The simulator at its limits. The tests that are not ignored are the quick part; README names the long one, which writes
//! docs/stability.md anew.

mod atlas;
mod cases;
#[path = "../common/mod.rs"]
mod common;
mod harness;
mod random;
mod scene;

use atlas::ROWS;
use rayon::prelude::*;
use scene::Kind;
use std::path::Path;

#[test]
fn what_must_hold_holds_with_the_default_solver() {
    ROWS.par_iter().for_each(|row| row.check(&row.runs(row.must_hold, &[Kind::Auto], 25)));
}

/// `cargo test --release -p dem-core --test stability page -- --ignored`
#[test]
#[ignore = "long: see README"]
fn page() {
    let rows: Vec<_> = ROWS.par_iter().map(|row| (row, row.runs(row.tried, &Kind::ALL, 200))).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/stability.md");
    let page = std::fs::read_to_string(&path).expect("docs/stability.md");
    let (marks, mark) = ("<!-- table -->\n", "<!-- end of the table -->\n");
    let (head, rest) = page.split_once(marks).expect("the mark before the table");
    let (_, tail) = rest.split_once(mark).expect("the mark after the table");
    std::fs::write(&path, format!("{head}{marks}{}{mark}{tail}", atlas::table(&rows))).expect("docs/stability.md");
    rows.iter().for_each(|(row, runs)| row.check(runs));
}
