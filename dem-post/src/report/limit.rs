//! The limit load of a run, from what `dem-run limit --json` prints for its scene.
//!
//! It bounds the load of the first break from above (docs/theory/limit-load.md). Computing it needs
//! a solver, so the page takes it from a file.

use std::fs;
use std::path::Path;

use dem_history::History;
use dem_scene::differences;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::output::{PostError, Result, number, short};

/// Fields of a scene that do not change its limit load.
const WITHOUT_EFFECT: [&str; 7] = ["$schema", "title", "output", "solver", "stop", "rupture", "time.step"];
/// Maximum number of differing fields that an error names.
const NAMED: usize = 3;

/// The limit load of the load wall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitLoad {
    /// The load, N; `None` where `outcome` says why.
    pub load: Option<f64>,
    /// What the limit load is: `limit`, `unbounded`, `broken_at_start`, `never_borne`.
    pub outcome: String,
}

/// What `dem-run limit --json` prints, as far as it is read.
#[derive(Deserialize)]
struct Printed {
    outcome: String,
    loads: Vec<Growing>,
    scene: Value,
}

/// A load that grows.
#[derive(Deserialize)]
struct Growing {
    load: String,
    limit: Option<f64>,
}

/// Reads the limit load of a wall of the run.
///
/// # Errors
/// [`PostError::Usage`] for a file that cannot be read, that is of another scene, or without a load
/// of that wall; those of reading the history.
pub fn read(file: &Path, history: &History, wall: &str) -> Result<LimitLoad> {
    let shown = file.display();
    let usage = |what: String| PostError::Usage(format!("--limit {shown}: {what}"));
    let remedy = "write it with `dem-run limit SCENE --json > FILE`";
    let text = fs::read_to_string(file).map_err(|error| usage(format!("it cannot be read: {error}")))?;
    let printed: Printed = serde_json::from_str(&text)
        .map_err(|error| usage(format!("it holds no limit load with its scene ({error}): {remedy}")))?;
    let found = differences(&printed.scene.to_string(), &history.parameters()?.scene);
    let without_effect =
        |path: &str| WITHOUT_EFFECT.iter().any(|field| path == *field || path.starts_with(&format!("{field}.")));
    let differing: Vec<String> = found
        .iter()
        .filter(|difference| !without_effect(&difference.path))
        .map(|difference| {
            let [there, here] = [&difference.a, &difference.b].map(|value| value.as_deref().unwrap_or("absent"));
            format!("{} is {there} there and {here} in the run", difference.path)
        })
        .collect();
    if !differing.is_empty() {
        let more = differing.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(", and {more} more fields differ") } else { String::new() };
        let named = differing.into_iter().take(NAMED).collect::<Vec<_>>().join(", ");
        return Err(usage(format!("it is of another scene: {named}{more}; {remedy}, with the scene of the run")));
    }
    let name = format!("walls.{wall}");
    let Some(of_wall) = printed.loads.iter().find(|load| load.load == name) else {
        let others: Vec<&str> = printed.loads.iter().map(|load| load.load.as_str()).collect();
        return Err(usage(format!(
            "it has no load of the load wall, {name}, but of {}; choose another with --wall",
            others.join(", ")
        )));
    };
    // the load of a wall counts in its own sense
    Ok(LimitLoad { load: of_wall.limit.map(f64::abs), outcome: printed.outcome })
}

impl LimitLoad {
    /// In a sentence.
    pub fn sentence(&self, first_break: Option<f64>) -> String {
        match (self.load, self.outcome.as_str()) {
            (Some(load), _) => {
                let share = first_break.filter(|_| load > 0.0).map_or_else(String::new, |first| {
                    format!(": the first bond broke at {} % of it", short(100.0 * first / load))
                });
                format!("The limit load, an upper bound of that of the first break, is {} N{share}.", number(load))
            }
            (None, "unbounded") => "There is no limit load: some reactions bear any load.".into(),
            (None, "broken_at_start") => {
                "The limit load is that of the start: the constant loads alone break a bond.".into()
            }
            (None, _) => "There is no limit load: no growth of the loads is borne from the start.".into(),
        }
    }
}
