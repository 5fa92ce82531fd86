//! Records where the program comes from, for `/parameters` of its histories.

use std::path::Path;
use std::process::Command;

fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

fn main() {
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let rustc = output(&variable("RUSTC"), &["--version"]).unwrap_or_default();
    println!("cargo::rustc-env=DEM_BUILD={}, {}, {rustc}", variable("PROFILE"), variable("TARGET"));
    // without optional locks, git does not write its index here
    let mut version = variable("CARGO_PKG_VERSION");
    let describe = ["--no-optional-locks", "describe", "--always", "--dirty", "--abbrev=12"];
    if let Some(revision) = output("git", &describe) {
        println!("cargo::rustc-env=DEM_GIT_REVISION={revision}");
        version = format!("{version} ({revision})");
        // the log grows with every commit and checkout; the index would not do, because every
        // `git status` may write it
        if let Some(log) =
            output("git", &["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).exists())
        {
            println!("cargo::rerun-if-changed={log}");
        }
    }
    println!("cargo::rustc-env=DEM_VERSION={version}");
    // what the program is made of: a change makes the revision "dirty"
    for source in
        ["build.rs", "src", "drawing", "history", "output", "scene", "Cargo.toml", "../dem-core/src", "../Cargo.lock"]
    {
        println!("cargo::rerun-if-changed={source}");
    }
}
