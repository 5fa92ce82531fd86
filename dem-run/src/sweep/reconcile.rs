//! Reconciles the results of an earlier start of a sweep with the sweep file.
//!
//! A run is identified by the digest of its scene, not by its position in the sweep. Values may
//! therefore be added anywhere: existing runs keep their numbers, new runs get the next ones.

use std::collections::HashSet;
use std::fs;

use serde_json::Value;

use super::plan::{Plan, PlannedRun, describe};
use crate::error::RunError;
use crate::history::sweep::{Entry, Manifest, Store};
use crate::scene::parse::join;
use crate::scene::shorten;

/// Maximum number of runs that an error names.
const MOST_TOLD: usize = 10;

/// The manifest of the plan, in which existing runs keep their numbers.
///
/// # Errors
/// Results that are no longer part of the plan, unless `give_up`.
pub fn reconcile(store: &Store, plan: &Plan, give_up: bool) -> Result<Manifest, RunError> {
    let title = plan.title.clone();
    let mut manifest = Manifest { title, ..Manifest::new(&plan.sweep, &plan.scene, plan.fields.clone()) };
    let old = store.manifest()?;
    if old.is_none() && store.path("", "").exists() && !give_up {
        let remedy = "-o DIR names another folder, --force replaces its runs by those of this sweep".into();
        let state = "holds runs but no manifest.json";
        return Err(RunError::Unfit { path: store.folder().into(), state, remedy });
    }
    let old = old.map(|manifest| manifest.runs).unwrap_or_default();
    let known: HashSet<&str> = old.iter().map(|run| run.digest.as_str()).collect();
    let mut new: Vec<&PlannedRun> = plan.runs.iter().filter(|run| !known.contains(run.digest.as_str())).collect();
    let (mut changed, mut told) = (vec![], vec![]);
    for entry in &old {
        if let Some(run) = plan.run(&entry.digest) {
            manifest.runs.push(Entry::new(entry.id.clone(), run.values.clone(), run.digest.clone()));
            continue;
        }
        let successor = new.iter().position(|run| run.values == entry.values).map(|k| new.remove(k));
        if store.outcome(&entry.id).is_some() {
            let what = successor.map_or("no longer in the sweep".into(), |run| difference(store, &entry.id, run));
            told.push(format!("  {} ({}): {what}", entry.id, describe(&entry.values)));
        }
        changed.push((&entry.id, successor));
    }
    if !told.is_empty() && !give_up {
        return Err(refusal(store, &told));
    }
    for (id, successor) in changed {
        store.delete(id);
        if let Some(run) = successor {
            manifest.runs.push(Entry::new(id.clone(), run.values.clone(), run.digest.clone()));
        }
    }
    let number = |id: &str| id.parse::<usize>().unwrap_or(0);
    let last = old.iter().map(|run| number(&run.id)).max().unwrap_or(0);
    let width = (last + new.len()).to_string().len().max(4);
    for (k, run) in new.into_iter().enumerate() {
        let id = format!("{:0width$}", last + 1 + k);
        manifest.runs.push(Entry::new(id, run.values.clone(), run.digest.clone()));
    }
    manifest.runs.sort_by_key(|run| number(&run.id));
    Ok(manifest)
}

fn refusal(store: &Store, told: &[String]) -> RunError {
    let mut shown: Vec<String> = told.iter().take(MOST_TOLD).cloned().collect();
    if told.len() > MOST_TOLD {
        shown.push(format!("  … and {} more", told.len() - MOST_TOLD));
    }
    RunError::InputOutput(format!(
        "{} holds results of scenes that are no longer those of the sweep:\n{}\n--force runs the changed ones again and deletes \
         those that are no longer in the sweep; -o DIR names another folder",
        store.folder().display(),
        shown.join("\n")
    ))
}

/// The difference between the scene of the earlier run and that of the plan.
fn difference(store: &Store, id: &str, run: &PlannedRun) -> String {
    let before = fs::read(store.path(id, ".json")).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let now = run.scene.to_json().ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    match before.zip(now).and_then(|(before, now)| first_difference("", &before, &now)) {
        Some((path, before, now)) => format!("{path} was {}, is {}", shorten(&before), shorten(&now)),
        None => "its scene or its sample file has changed".into(),
    }
}

fn first_difference(path: &str, before: &Value, now: &Value) -> Option<(String, String, String)> {
    // these fields change no results
    if before == now || matches!(path, "title" | "$schema" | "sample.file.path") {
        return None;
    }
    if let (Value::Object(before), Value::Object(now)) = (before, now) {
        let mut names: Vec<&String> = before.keys().chain(now.keys()).collect();
        names.sort();
        names.dedup();
        let value = |of: &serde_json::Map<String, Value>, name: &str| of.get(name).cloned().unwrap_or(Value::Null);
        return (names.into_iter())
            .find_map(|name| first_difference(&join(path, name), &value(before, name), &value(now, name)));
    }
    Some((path.into(), before.to_string(), now.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_difference_is_named_and_titles_are_none() {
        let before = json!({"title": "a", "time": {"step": 1, "end": 2}, "bonds": {"strength": 5}});
        let now = json!({"title": "b", "time": {"step": 1, "end": 3}, "bonds": {"strength": 5}});
        assert_eq!(first_difference("", &before, &now), Some(("time.end".into(), "2".into(), "3".into())));
        assert_eq!(
            first_difference("", &before, &json!({"title": "c", "time": {"step": 1, "end": 2}, "bonds": null}))
                .map(|d| d.0),
            Some("bonds".into())
        );
        assert_eq!(first_difference("", &json!({"title": "a"}), &json!({"title": "b"})), None);
    }
}
