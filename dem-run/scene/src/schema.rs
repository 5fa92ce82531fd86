//! The model of a scene as a JSON Schema: for editors, and for the check of paths.

use std::sync::LazyLock;

use serde_json::Value;

use super::error::Problem;
use super::model::Scene;
use super::parse::{REQUIRED, join};

static SCHEMA: LazyLock<Value> = LazyLock::new(|| schemars::schema_for!(Scene).to_value());

/// The JSON Schema of a scene (draft 2020-12), with descriptions and units.
#[must_use]
pub fn json_schema() -> &'static Value {
    &SCHEMA
}

/// One admissible form of a value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    schema: &'static Value,
    /// Whether it is one kind of several, identified by its only name.
    pub(super) kind: bool,
}

impl Form {
    /// All forms of a whole scene.
    pub(super) fn root() -> Vec<Self> {
        let mut forms = vec![];
        collect(&SCHEMA, false, &mut forms);
        forms
    }

    /// The names allowed in an object of this form.
    pub(super) fn names(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.schema.get("properties").and_then(Value::as_object).into_iter().flatten().map(|(name, _)| name.as_str())
    }

    /// The forms of the value under `name`.
    pub(super) fn property(&self, name: &str) -> Option<Vec<Self>> {
        let schema = self.schema.get("properties")?.get(name)?;
        let mut forms = vec![];
        collect(schema, false, &mut forms);
        Some(forms)
    }

    /// The forms of the values of a map with free names.
    pub(super) fn entries(&self) -> Option<Vec<Self>> {
        let schema = self.schema.get("additionalProperties").filter(|schema| schema.is_object())?;
        let mut forms = vec![];
        collect(schema, false, &mut forms);
        Some(forms)
    }

    /// The forms of the items of an array.
    pub(super) fn items(&self) -> Option<Vec<Self>> {
        let mut forms = vec![];
        collect(self.schema.get("items")?, false, &mut forms);
        Some(forms)
    }
}

/// The required fields that the scene `root` lacks.
pub(super) fn missing(root: &Value) -> Vec<Problem> {
    let mut found = vec![];
    look_for_missing(&Form::root(), root, "", &mut found);
    found
}

fn look_for_missing(forms: &[Form], node: &Value, path: &str, found: &mut Vec<Problem>) {
    let given = |form: &&Form| !form.kind || form.names().any(|name| node.get(name).is_some());
    for form in forms.iter().filter(given) {
        match node {
            Value::Object(map) => {
                for name in form.schema.get("required").and_then(Value::as_array).into_iter().flatten() {
                    let Some(name) = name.as_str().filter(|name| !map.contains_key(*name)) else { continue };
                    let described = form.schema["properties"][name]["description"].as_str().unwrap_or_default();
                    let meaning = described.split(". ").next().unwrap_or_default().trim_end_matches('.');
                    let allowed =
                        if meaning.is_empty() { REQUIRED.to_string() } else { format!("{REQUIRED}: {meaning}") };
                    found.push(Problem::new(join(path, name), "nothing", allowed));
                }
                for (name, value) in map {
                    let below = form.property(name).or_else(|| form.entries()).unwrap_or_default();
                    look_for_missing(&below, value, &join(path, name), found);
                }
            }
            Value::Array(items) => {
                let below = form.items().unwrap_or_default();
                for (k, item) in items.iter().enumerate() {
                    look_for_missing(&below, item, &join(path, &k.to_string()), found);
                }
            }
            _ => {}
        }
    }
}

/// Follows references and alternatives down to the forms themselves.
fn collect(schema: &'static Value, kind: bool, forms: &mut Vec<Form>) {
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        // "#/$defs/Name" is "#" and a JSON pointer
        if let Some(target) = SCHEMA.pointer(reference.trim_start_matches('#')) {
            collect(target, kind, forms);
        }
    }
    for (word, kinds) in [("oneOf", true), ("anyOf", false), ("allOf", false)] {
        for alternative in schema.get(word).and_then(Value::as_array).into_iter().flatten() {
            collect(alternative, kind || kinds, forms);
        }
    }
    if schema.get("type").is_some() {
        forms.push(Form { schema, kind });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_the_model_is_described() {
        fn check(path: &str, schema: &Value, silent: &mut Vec<String>) {
            for (name, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
                if property.get("description").is_none() && property.get("$ref").is_none() {
                    silent.push(format!("{path}.{name}"));
                }
                check(&format!("{path}.{name}"), property, silent);
            }
            for alternative in schema.get("oneOf").and_then(Value::as_array).into_iter().flatten() {
                if alternative.get("description").is_none() {
                    silent.push(format!("{path}: {alternative}"));
                }
                // the description of the kind also describes its name
                for inner in alternative["properties"].as_object().into_iter().flatten().map(|(_, inner)| inner) {
                    check(path, inner, silent);
                }
            }
        }
        let mut silent = vec![];
        check("scene", json_schema(), &mut silent);
        for (name, definition) in json_schema()["$defs"].as_object().expect("definitions") {
            check(name, definition, &mut silent);
        }
        assert_eq!(silent, Vec::<String>::new());
    }

    #[test]
    fn units_reach_the_schema() {
        let text = json_schema().to_string();
        for unit in ["(kg/m³)", "(N/s)", "(m/s²)", "(s)", "(Pa)", "(N m)", "(rad/s)"] {
            assert!(text.contains(unit), "{unit}");
        }
    }

    #[test]
    fn forms_follow_options_and_kinds() {
        let root = Form::root();
        let bonds = root[0].property("bonds").expect("bonds");
        assert!(bonds.iter().any(|form| form.names().any(|name| name == "strength")));
        let sample = root[0].property("sample").expect("sample");
        assert!(sample.iter().all(|form| form.kind));
        assert_eq!(sample.len(), 4);
    }
}
