//! The `dem-post` command.
fn main() {}
