//! Files with which other schedulers carry out a sweep: a job array for Slurm, a Snakefile.

use std::path::Path;

use crate::error::RunError;
use crate::history::sweep::{Manifest, State, Store};

/// Writes `slurm.sh` and `Snakefile` beside the manifest; returns their paths.
///
/// # Errors
/// A file cannot be written.
pub fn write(store: &Store, sweep: &Path, manifest: &Manifest) -> Result<(), RunError> {
    let system = |what: String, error: std::io::Error| RunError::System { what, source: error.into() };
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).map_err(|error| system(path.display().to_string(), error))?;
        Ok::<String, RunError>(path.display().to_string())
    };
    let program = std::env::current_exe().map_err(|error| system("this program".into(), error))?;
    let (program, sweep, folder) = (absolute(&program)?, absolute(sweep)?, absolute(store.folder())?);
    let name = &manifest.sweep;
    store.write("slurm.sh", slurm(name, &numbers(manifest), &program, &sweep, &folder).as_bytes())?;
    Ok(store.write("Snakefile", snakefile(name, &program, &sweep, &folder).as_bytes())?)
}

/// The numbers of the runs that are not done, in Slurm's format: 1-3,7.
fn numbers(manifest: &Manifest) -> String {
    let undone = manifest.runs.iter().filter(|run| run.state != State::Done);
    let mut spans: Vec<(u64, u64)> = vec![];
    for number in undone.filter_map(|run| run.id.parse().ok()) {
        match spans.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => spans.push((number, number)),
        }
    }
    let span = |(first, last): &(u64, u64)| if first == last { first.to_string() } else { format!("{first}-{last}") };
    spans.iter().map(span).collect::<Vec<_>>().join(",")
}

fn slurm(name: &str, numbers: &str, program: &str, sweep: &str, folder: &str) -> String {
    let (program, quoted_sweep, quoted_folder) = (shell(program), shell(sweep), shell(folder));
    // in `#SBATCH` lines a blank ends a word
    let title: String = name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect();
    let log = folder.replace('\\', "\\\\").replace('%', "%%").replace('"', "\\\"");
    format!(
        r#"#!/bin/bash
# The runs of {title} that are not done, as a job array: sbatch slurm.sh
# More options (--time, --partition, --mem) go to sbatch, as in: sbatch --time=2:00:00 slurm.sh
# Add %N to --array for at most N runs at a time.
#SBATCH --job-name={title}
#SBATCH --array={numbers}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --output="{log}/runs/%4a.slurm.log"
exec {program} sweep {quoted_sweep} -o {quoted_folder} --run "$SLURM_ARRAY_TASK_ID" --quiet
"#
    )
}

fn snakefile(name: &str, program: &str, sweep: &str, folder: &str) -> String {
    let json = |text: &str| serde_json::Value::from(text).to_string();
    // in commands, braces are Snakemake's placeholders
    let command = |rest: &str| {
        let words = format!("{} sweep {} -o {}", shell(program), shell(sweep), shell(folder));
        json(&format!("{}{rest}", words.replace('{', "{{").replace('}', "}}")))
    };
    let (run, status) = (command(" --run {wildcards.id} --quiet"), command(" --status"));
    let folder = json(folder);
    let title = name.replace(['\n', '\r'], " ");
    format!(
        r#"# The runs of {title}: snakemake -s Snakefile --cores 8 --keep-going
import json

workdir: {folder}

with open({folder} + "/manifest.json") as file:
    RUNS = [run["id"] for run in json.load(file)["runs"]]

rule all:
    input: expand("runs/{{id}}.h5", id=RUNS)

rule run:
    output: "runs/{{id}}.h5"
    wildcard_constraints: id=r"\d+"
    threads: 1
    shell: {run}

onsuccess:
    shell({status})

onerror:
    shell({status})
"#
    )
}

/// A word for the shell.
fn shell(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+:,@%=".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::sweep::Entry;

    #[test]
    fn numbers_of_runs_are_spans_without_those_that_are_done() {
        let mut manifest = Manifest::new(Path::new("a.json"), Path::new("b.json"), vec![]);
        for (number, state) in
            [(1, State::Left), (2, State::Failed), (3, State::Done), (4, State::Left), (7, State::Left)]
        {
            let run = Entry::new(format!("{number:04}"), Default::default(), String::new());
            manifest.runs.push(Entry { state, ..run });
        }
        assert_eq!(numbers(&manifest), "1-2,4,7");
    }

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(shell("/a/b-c.json"), "/a/b-c.json");
        assert_eq!(shell("it's a {b}"), "'it'\\''s a {b}'");
    }
}
