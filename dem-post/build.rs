//! Records the version of the program, with the revision of its source where git knows it.

use std::path::Path;
use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    // without optional locks, git does not write its index here
    let output = Command::new("git").arg("--no-optional-locks").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

fn main() {
    let mut version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    if let Some(revision) = git(&["describe", "--always", "--dirty", "--abbrev=12"]) {
        version = format!("{version} ({revision})");
        // the log grows with every commit and checkout
        if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).exists()) {
            println!("cargo::rerun-if-changed={log}");
        }
    }
    println!("cargo::rustc-env=DEM_VERSION={version}");
    // what the program is made of: a change makes the revision "dirty"
    for source in ["build.rs", "src", "templates", "Cargo.toml", "../Cargo.lock"] {
        println!("cargo::rerun-if-changed={source}");
    }
    for part in ["drawing", "history", "output", "scene"] {
        println!("cargo::rerun-if-changed=../dem-run/{part}");
    }
}
