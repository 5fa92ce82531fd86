//! Finds the field varied between the scenes of some runs, and the runs of each sample.
//!
//! Fields are named as in `--set`. Of the fields that differ between the runs,
//!
//! * titles and output intervals are ignored;
//! * `seed`, a sample's file and listed grains define the **sample**;
//! * one is the **varied** field: the requested one, or else the only one of the first kind with a
//!   difference. The kinds are, in order: the sample (bonds, materials, its size), the loading
//!   (walls, loads on grains), the computation (time, solver);
//! * fields that are functions of the varied field **move with it**, as a ramp scaled by the
//!   cohesion.
//!
//! With any other difference the runs have different scenes and are rejected.

use std::collections::BTreeMap;

use dem_scene::schema::json_schema;
use serde_json::Value;

use crate::output::{PostError, Result};

/// The varied field where only the sample differs: that of the paper's figure 9.
const DEFAULT: &str = "bonds.strength";
/// Maximum number of fields named in a message.
const NAMED: usize = 8;

/// The leaves of a scene by their names.
type Leaves = BTreeMap<String, Value>;

/// The varied field and the samples of some runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// The varied field.
    pub field: String,
    /// Fields that move with it.
    pub along: Vec<String>,
    /// Differing fields that define the sample.
    pub sample_fields: Vec<String>,
    /// The field's value in each run.
    pub values: Vec<f64>,
    /// The number of each run's sample in `samples`.
    pub sample: Vec<usize>,
    /// Names of the samples, in order.
    pub samples: Vec<String>,
}

/// The varied field and the samples of runs with these names and scenes (JSON); at least one run.
/// `against`, if given, is the varied field.
///
/// # Errors
/// [`PostError::Usage`] where the scenes are different, where two runs are the same, or where the
/// field is unknown or not a number.
pub fn design(runs: &[(String, String)], against: Option<&str>) -> Result<Design> {
    let scenes = runs.iter().map(leaves).collect::<Result<Vec<Leaves>>>()?;
    let differing = differing(&scenes);
    let field = match against {
        Some(name) => name.to_string(),
        None => choose(&scenes, &differing)?,
    };
    let values = values(runs, &scenes, &field, &differing)?;
    let (mut along, mut sample_fields, mut other) = (vec![], vec![], vec![]);
    for name in differing.into_iter().filter(|name| *name != field) {
        if makes_sample(&name) {
            sample_fields.push(name);
        } else if follows(&scenes, &values, &name) {
            along.push(name);
        } else {
            other.push(name);
        }
    }
    if !other.is_empty() {
        return Err(PostError::Usage(format!(
            "these are runs of different scenes: besides {field} and the sample they differ in {}; choose runs that have \
             these in common, or another field with --against",
            list(&other)
        )));
    }
    let labels: Vec<(Vec<SortKey>, String)> = scenes.iter().map(|scene| label(scene, &sample_fields, &field)).collect();
    let mut sorted = labels.clone();
    sorted.sort();
    sorted.dedup();
    let sample: Vec<usize> = labels.iter().map(|label| sorted.iter().position(|s| s == label).unwrap_or(0)).collect();
    for (k, name) in runs.iter().map(|run| &run.0).enumerate() {
        if let Some(j) = (0..k).find(|&j| (values[j], sample[j]) == (values[k], sample[k])) {
            let earlier = &runs[j].0;
            return Err(PostError::Usage(format!("{earlier} and {name} are runs of the same scene: give one of them")));
        }
    }
    Ok(Design { field, along, sample_fields, values, sample, samples: sorted.into_iter().map(|s| s.1).collect() })
}

/// The fields that differ between runs with these names and scenes (JSON), without those that make
/// the sample.
///
/// # Errors
/// [`PostError::Usage`] for a scene that cannot be read.
pub fn varied(runs: &[(String, String)]) -> Result<Vec<String>> {
    let mut names = differing(&runs.iter().map(leaves).collect::<Result<Vec<Leaves>>>()?);
    names.retain(|name| !makes_sample(name));
    Ok(names)
}

/// The leaves of a run's scene that are compared.
fn leaves((name, scene): &(String, String)) -> Result<Leaves> {
    let tree: Value = serde_json::from_str(scene)
        .map_err(|error| PostError::Usage(format!("{name}: its scene cannot be read: {error}")))?;
    let mut leaves = Leaves::new();
    collect(String::new(), tree, &mut leaves);
    leaves.retain(|name, _| !matches!(name.as_str(), "$schema" | "title") && !name.starts_with("output."));
    Ok(leaves)
}

fn collect(path: String, value: Value, leaves: &mut Leaves) {
    let below = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
    match value {
        Value::Object(map) if !map.is_empty() => map.into_iter().for_each(|(k, v)| collect(below(&k), v, leaves)),
        Value::Array(list) if !list.is_empty() => {
            list.into_iter().enumerate().for_each(|(k, v)| collect(below(&k.to_string()), v, leaves));
        }
        // 1 and 1.0 are equal
        Value::Number(number) => drop(leaves.insert(path, number.as_f64().map_or(Value::Number(number), Value::from))),
        leaf => drop(leaves.insert(path, leaf)),
    }
}

/// Names of all fields that differ between the scenes.
fn differing(scenes: &[Leaves]) -> Vec<String> {
    let mut names: Vec<&String> = scenes.iter().flat_map(Leaves::keys).collect();
    names.sort_unstable();
    names.dedup();
    let differs = |name: &&String| scenes.iter().any(|scene| scene.get(*name) != scenes[0].get(*name));
    names.into_iter().filter(differs).cloned().collect()
}

fn makes_sample(name: &str) -> bool {
    name == "seed" || name.starts_with("sample.file.") || name.starts_with("sample.grains.")
}

fn is_number(scenes: &[Leaves], name: &str) -> bool {
    scenes.iter().all(|scene| scene.get(name).is_some_and(Value::is_number))
}

/// The varied field where none was requested.
fn choose(scenes: &[Leaves], differing: &[String]) -> Result<String> {
    let candidates: Vec<&String> =
        differing.iter().filter(|name| !makes_sample(name) && is_number(scenes, name)).collect();
    let rank = |name: &str| match name.split('.').next() {
        Some("walls" | "grains") => 1,
        Some("time" | "stop" | "solver") => 2,
        _ => 0,
    };
    let Some(least) = candidates.iter().map(|name| rank(name)).min() else {
        return match is_number(scenes, DEFAULT) {
            true => Ok(DEFAULT.into()),
            false => Err(PostError::Usage(
                "these runs differ in no number except those of the sample: name a field with --against".into(),
            )),
        };
    };
    let first: Vec<String> = candidates.into_iter().filter(|name| rank(name) == least).cloned().collect();
    match first.as_slice() {
        [field] => Ok(field.clone()),
        several => Err(PostError::Usage(format!(
            "several fields differ between these runs: choose one with --against: {}",
            list(several)
        ))),
    }
}

/// The varied field's number in each run.
fn values(runs: &[(String, String)], scenes: &[Leaves], field: &str, differing: &[String]) -> Result<Vec<f64>> {
    let number = |(run, scene): (&(String, String), &Leaves)| {
        scene.get(field).and_then(Value::as_f64).ok_or_else(|| {
            let numbers: Vec<String> = differing.iter().filter(|name| is_number(scenes, name)).cloned().collect();
            let remedy = match numbers.as_slice() {
                [] => "no number differs between these runs".into(),
                numbers => format!("numbers that differ: {}", list(numbers)),
            };
            let found = scene.get(field).map_or_else(|| "nothing".into(), Value::to_string);
            PostError::Usage(format!(
                "--against {field}: the scene of {} has {found} there, not a number; {remedy}",
                run.0
            ))
        })
    };
    runs.iter().zip(scenes).map(number).collect()
}

/// Whether a field is a function of `values`.
fn follows(scenes: &[Leaves], values: &[f64], name: &str) -> bool {
    let first = |value: f64| values.iter().position(|v| *v == value).map(|k| &scenes[k]);
    scenes.iter().zip(values).all(|(scene, &value)| first(value).is_some_and(|one| one.get(name) == scene.get(name)))
}

/// Sort key of a sample: numbers before words.
type SortKey = (u64, String);

/// The name of a scene's sample, and its sort key; samples differ in `fields`, not in `varied`.
fn label(scene: &Leaves, fields: &[String], varied: &str) -> (Vec<SortKey>, String) {
    let value = |name: &str| scene.get(name).cloned().unwrap_or_default();
    let text = |name: &str| match value(name) {
        Value::String(text) => text,
        value => value.as_f64().map_or_else(|| value.to_string(), |number| number.to_string()),
    };
    let key = |name: &String| (value(name).as_f64().map_or(u64::MAX, |n| n.max(0.0) as u64), text(name));
    // listed grains are too many to be named individually
    let named: Vec<&String> = fields.iter().filter(|name| !name.starts_with("sample.grains.")).collect();
    let label = match named.as_slice() {
        [] if fields.is_empty() && varied == "seed" => "the only one".into(),
        [] if fields.is_empty() => format!("seed {}", text("seed")),
        [] => format!("grains {}", fields.iter().map(|name| text(name)).collect::<Vec<_>>().join(" ")),
        named => named.iter().map(|name| format!("{name} {}", text(name))).collect::<Vec<_>>().join(", "),
    };
    (fields.iter().map(key).collect(), label)
}

fn list(names: &[String]) -> String {
    let mut text = names.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > NAMED {
        text += &format!(" and {} more", names.len() - NAMED);
    }
    text
}

/// The unit of a field, from the parentheses in the scene's schema; empty for a number without unit
/// or an unknown unit.
pub fn unit(field: &str) -> String {
    let root = json_schema();
    let mut forms = vec![root];
    let mut described = None;
    for name in field.split('.') {
        let mut below = vec![];
        for form in forms {
            let next = form
                .pointer(&format!("/properties/{name}"))
                .or_else(|| form.get("additionalProperties").filter(|schema| schema.is_object()))
                .or_else(|| form.get("items").filter(|_| name.parse::<usize>().is_ok()));
            if let Some(next) = next {
                if let Some(text) = next.get("description").and_then(Value::as_str) {
                    described = Some(text);
                }
                expand(root, next, &mut below);
            }
        }
        forms = below;
    }
    if forms.is_empty() {
        return String::new();
    }
    let parts = described.unwrap_or_default().split('(').skip(1).filter_map(|rest| rest.split(')').next());
    parts.into_iter().find(|text| is_unit(text)).unwrap_or_default().to_string()
}

/// All alternatives of a schema.
fn expand<'a>(root: &'a Value, schema: &'a Value, forms: &mut Vec<&'a Value>) {
    if let Some(target) =
        schema.get("$ref").and_then(Value::as_str).and_then(|path| root.pointer(path.trim_start_matches('#')))
    {
        expand(root, target, forms);
    }
    for kind in ["oneOf", "anyOf", "allOf"] {
        schema.get(kind).and_then(Value::as_array).into_iter().flatten().for_each(|one| expand(root, one, forms));
    }
    forms.push(schema);
}

fn is_unit(text: &str) -> bool {
    let known = ["1", "N", "Pa", "m", "s", "kg", "J", "rad", "m²", "m³", "s²"];
    text.split([' ', '/']).all(|part| known.contains(&part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(scenes: &[&str]) -> Vec<(String, String)> {
        scenes.iter().enumerate().map(|(k, scene)| (format!("run {k}"), scene.to_string())).collect()
    }

    /// Runs of cohesions and seeds, with a ramp that is a function of both.
    fn grid(ramp: impl Fn(u32, u32) -> u32) -> Vec<(String, String)> {
        let scene = |c: u32, seed: u32| {
            let force_rate = ramp(c, seed);
            format!(
                r#"{{"title": "{c} {seed}", "seed": {seed}, "bonds": {{"strength": {c}.0}}, "output": {{"every_steps": {seed}}},
                    "walls": {{"top": {{"force_rate": {force_rate}, "normal": [0, -1]}}}}}}"#
            )
        };
        let all = [5, 10, 20].into_iter().flat_map(|c| [10, 2].map(|seed| scene(c, seed)));
        all.enumerate().map(|(k, scene)| (format!("run {k}"), scene)).collect()
    }

    fn refusal(runs: &[(String, String)], against: Option<&str>) -> String {
        design(runs, against).expect_err("these runs cannot be compared").to_string()
    }

    #[test]
    fn a_ramp_that_is_scaled_moves_with_the_cohesion() {
        let found = design(&grid(|c, _| 20 * c), None).unwrap();
        assert_eq!(
            (found.field.as_str(), &found.along[..]),
            ("bonds.strength", &["walls.top.force_rate".to_string()][..])
        );
        assert_eq!(found.values, [5.0, 5.0, 10.0, 10.0, 20.0, 20.0]);
        // seeds are sorted as numbers
        assert_eq!(
            (&found.samples[..], &found.sample[..]),
            (&["seed 2".to_string(), "seed 10".into()][..], &[1, 0, 1, 0, 1, 0][..])
        );
        let other = design(&grid(|c, _| 20 * c), Some("walls.top.force_rate")).unwrap();
        assert_eq!((other.values[0], &other.along[..]), (100.0, &["bonds.strength".to_string()][..]));
        assert!(design(&grid(|_, _| 200), None).unwrap().along.is_empty());
    }

    #[test]
    fn runs_of_different_scenes_are_refused_by_the_field() {
        assert!(
            refusal(&grid(|_, seed| seed), None)
                .contains("besides bonds.strength and the sample they differ in walls.top.force_rate")
        );
        let scenes =
            runs(&[r#"{"bonds": {"strength": 1}, "thickness": 1}"#, r#"{"bonds": {"strength": 2}, "thickness": 2}"#]);
        let message = refusal(&scenes, None);
        assert!(message.contains("--against") && message.contains("bonds.strength, thickness"), "{message}");
        // with an explicit field the other one moves with it
        assert_eq!(design(&scenes, Some("thickness")).unwrap().along, ["bonds.strength"]);
        let lacking = runs(&[r#"{"bonds": {"strength": 1}}"#, r#"{"bonds": null}"#]);
        assert!(
            refusal(&lacking, Some("bonds.strength")).contains("run 1 has nothing there"),
            "{}",
            refusal(&lacking, Some("bonds.strength"))
        );
        let twice = runs(&[r#"{"bonds": {"strength": 1}}"#, r#"{"bonds": {"strength": 1.0}, "title": "x"}"#]);
        assert!(refusal(&twice, None).contains("run 0 and run 1 are runs of the same scene"));
        assert!(refusal(&grid(|_, _| 1), Some("bonds.strenght")).contains("numbers that differ: bonds.strength, seed"));
        assert!(refusal(&runs(&["{}"]), None).contains("--against"));
        assert!(refusal(&runs(&["no JSON"]), None).contains("run 0"));
    }

    #[test]
    fn one_value_is_a_field_all_the_same() {
        let found = design(
            &runs(&[r#"{"seed": 1, "bonds": {"strength": 5}}"#, r#"{"seed": 2, "bonds": {"strength": 5}}"#]),
            None,
        );
        let found = found.unwrap();
        assert_eq!((found.field.as_str(), found.values.len(), found.samples.len()), ("bonds.strength", 2, 2));
    }

    #[test]
    fn a_seed_may_be_what_is_varied() {
        let found = design(&runs(&[r#"{"seed": 1}"#, r#"{"seed": 2}"#]), Some("seed")).unwrap();
        assert_eq!((found.values, found.samples.len(), found.sample_fields.len()), (vec![1.0, 2.0], 1, 0));
    }

    #[test]
    fn units_are_those_of_the_schema() {
        for (field, expected) in [
            ("bonds.strength", "N"),
            ("bonds.stress", "Pa"),
            ("walls.top.force_rate", "N/s"),
            ("materials.friction.grain_grain", ""),
            ("materials.density", "kg/m³"),
            ("sample.random.count", ""),
            ("sample.random.width", "m"),
            ("time.step", "s"),
            ("bonds.stiffness.young.modulus", "Pa"),
            ("bonds.stiffness.springs.rolling", "N m/rad"),
            ("grains.loads.0.force.1", "N"),
            ("no.such.field", ""),
        ] {
            assert_eq!(unit(field), expected, "{field}");
        }
    }
}
