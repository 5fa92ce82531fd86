//! The `dem-run` command.
fn main() {}
