//! Differences between two scenes.

use serde::Serialize;
use serde_json::Value;

/// A place at which two scenes differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The path, in the notation of `--set`: `bonds.strength`.
    pub path: String,
    /// The value in the first scene, as JSON; `None` if absent.
    pub a: Option<String>,
    /// The value in the second scene.
    pub b: Option<String>,
}

/// The paths at which the JSON texts `a` and `b` differ, sorted; for a text that is not JSON, the
/// whole text.
pub fn differences(a: &str, b: &str) -> Vec<Difference> {
    let mut found = vec![];
    match (serde_json::from_str::<Value>(a), serde_json::from_str::<Value>(b)) {
        (Ok(a), Ok(b)) => collect(String::new(), Some(&a), Some(&b), &mut found),
        _ if a == b => {}
        _ => found.push(Difference { path: String::new(), a: Some(a.into()), b: Some(b.into()) }),
    }
    found
}

fn collect(path: String, a: Option<&Value>, b: Option<&Value>, found: &mut Vec<Difference>) {
    let below = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
    match (a, b) {
        // 1 and 1.0 are equal
        (Some(Value::Number(x)), Some(Value::Number(y))) if x.as_f64() == y.as_f64() => {}
        (Some(Value::Object(x)), Some(Value::Object(y))) => {
            let mut names: Vec<&String> = x.keys().chain(y.keys()).collect();
            names.sort_unstable();
            names.dedup();
            names.into_iter().for_each(|name| collect(below(name), x.get(name), y.get(name), found));
        }
        (Some(Value::Array(x)), Some(Value::Array(y))) if x.len() == y.len() => {
            let pairs = x.iter().zip(y).enumerate();
            pairs.for_each(|(k, (x, y))| collect(below(&k.to_string()), Some(x), Some(y), found));
        }
        (a, b) if a == b => {}
        (a, b) => found.push(Difference { path, a: a.map(Value::to_string), b: b.map(Value::to_string) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_named_as_set_names_it() {
        let a =
            r#"{"bonds": {"strength": 10}, "seed": 1, "walls": {"top": {"normal": [0, -1]}}, "same": [1, {"x": 2}]}"#;
        let b = r#"{"bonds": {"strength": 5.0}, "title": "b", "walls": {"top": {"normal": [0, 1]}}, "same": [1.0, {"x": 2}]}"#;
        let found = differences(a, b);
        let places: Vec<&str> = found.iter().map(|d| d.path.as_str()).collect();
        assert_eq!(places, ["bonds.strength", "seed", "title", "walls.top.normal.1"]);
        assert_eq!((found[0].a.as_deref(), found[0].b.as_deref()), (Some("10"), Some("5.0")));
        assert_eq!((found[1].b.as_deref(), found[2].a.as_deref()), (None, None));
    }

    #[test]
    fn a_scene_does_not_differ_from_itself() {
        let scene = r#"{"time": {"step": 1e-4}, "walls": null}"#;
        assert!(differences(scene, scene).is_empty());
        assert!(differences("no JSON", "no JSON").is_empty());
        assert_eq!(differences("no JSON", "other").len(), 1);
    }
}
