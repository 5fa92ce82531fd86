//! The page docs/scenes.md: every field of a scene, from the schema.

use std::fmt::Write as _;

use serde_json::Value;

use super::parse::join;
use super::schema::json_schema;

const HEAD: &str = "\
# Scenes

A scene is one JSON file with `//` and `/* */` comments. All numbers are in SI units. This page is made from the model
of the program, by `dem-run schema --markdown`; editors read the same from [scene.schema.json](scene.schema.json).
Complete scenes are in [the gallery](gallery.md), commands in [running scenes](running.md).

A run goes through these stages: the grains are packed, or placed as listed; walls that are `seated` move until they
touch a grain; grains nearer than `bonds.gap_tolerance` are bonded, unless a stage of loading has `cement`; then the
drives of the walls, gravity, the loads on grains and a membrane act, from t = 0 on, until `time.end` or a condition of
`stop`.

![A plane with its normal; a circle or sphere outside the grains, seated; a circle, sphere or cylinder around
them.](images/walls.svg)

![The drives of a wall: velocity; force with a mass; stress on the section of the sample; a biaxial test; a slide across
a stress; a grip.](images/drives.svg)

*Walls and what drives them; [more in words](running.md#how-walls-load-a-sample). `scripts/draw_walls.py` draws both.*

*One of* means one of the kinds listed: by its name alone where it stands in quotes, else as an object with that one
name. `--set` names a field by its path, as in `--set bonds.strength=5` or `--set walls.top.force_rate=100`.
`dem-run check SCENE` reads a scene and prints sizes, walls, steps, memory and disk space without a run.
";

/// Units as they stand in parentheses in the descriptions.
const UNITS: [&str; 17] = [
    "m", "kg", "kg/m³", "kg m²", "m/s", "m/s²", "rad/s", "N", "N/s", "N m", "N/m", "N m/rad", "Pa", "s", "J", "rad",
    "1/s",
];

/// The page in Markdown.
#[must_use]
pub fn markdown() -> String {
    let mut page = Page { text: HEAD.to_string(), told: vec![] };
    page.section("", json_schema());
    page.text
}

struct Page {
    text: String,
    /// The definitions that have a section, with its path.
    told: Vec<(String, String)>,
}

impl Page {
    /// The section of the object or the kinds at `path`, and those below it.
    fn section(&mut self, path: &str, schema: &'static Value) {
        let (_, schema) = resolved(schema);
        if path.is_empty() {
            self.text.push_str("\n## The whole scene\n");
        } else {
            // writing to a string cannot fail
            let _ = write!(self.text, "\n## `{path}`\n");
        }
        if let Some(described) = schema["description"].as_str().filter(|_| !path.is_empty()) {
            let _ = write!(self.text, "\n{}\n", wrapped(&one_line(described)));
        }
        match kinds(schema) {
            Some(kinds) => self.kinds(path, kinds),
            None => self.fields(path, schema),
        }
    }

    fn fields(&mut self, path: &str, schema: &'static Value) {
        let required: Vec<&str> = list(&schema["required"]).filter_map(Value::as_str).collect();
        let Some(all) = schema["properties"].as_object() else { return };
        let (first, rest): (Vec<_>, Vec<_>) = all.iter().partition(|(name, _)| required.contains(&name.as_str()));
        self.text.push_str("\n| field | value | unit | default | meaning |\n|---|---|---|---|---|\n");
        let mut below = vec![];
        for (name, field) in first.into_iter().chain(rest) {
            let (meaning, unit) = without_unit(field["description"].as_str().unwrap_or_default());
            let default = match &field["default"] {
                _ if required.contains(&name.as_str()) => "**required**".into(),
                Value::Null => String::new(),
                Value::Object(_) | Value::Array(_) => "see there".into(),
                value => format!("`{value}`"),
            };
            let value = self.value(&join(path, name), field, &mut below);
            let _ = writeln!(self.text, "| `{name}` | {value} | {unit} | {default} | {meaning} |");
        }
        self.sections(below);
    }

    fn kinds(&mut self, path: &str, kinds: &'static [Value]) {
        self.text.push_str("\n| one of | unit | meaning |\n|---|---|---|\n");
        let mut below = vec![];
        for kind in kinds {
            let (meaning, unit) = without_unit(kind["description"].as_str().unwrap_or_default());
            let shown = match (kind["const"].as_str(), kind["properties"].as_object().and_then(|all| all.iter().next()))
            {
                (Some(name), _) => format!("`\"{name}\"`"),
                (None, Some((name, inner))) => {
                    format!("`{name}`: {}", self.value(&join(path, name), inner, &mut below))
                }
                (None, None) => String::new(),
            };
            let _ = writeln!(self.text, "| {shown} | {unit} | {meaning} |");
        }
        self.sections(below);
    }

    fn sections(&mut self, below: Vec<(String, &'static Value)>) {
        for (path, schema) in below {
            self.section(&path, schema);
        }
    }

    /// The value that `schema` allows, in words; what needs a section is added to `below`.
    fn value(&mut self, path: &str, schema: &'static Value, below: &mut Vec<(String, &'static Value)>) -> String {
        let (name, inner) = resolved(schema);
        let kind = match &inner["type"] {
            Value::Array(several) => several[0].as_str(),
            one => one.as_str(),
        };
        if kinds(inner).is_some() || inner["properties"].is_object() {
            let word = if kinds(inner).is_some() { "one of" } else { "object" };
            // a definition has one section, at the first place that refers to it
            let told = self.told.iter().find(|(other, _)| Some(other.as_str()) == name);
            let place = told.map(|(_, place)| place.clone()).unwrap_or_else(|| {
                below.push((path.to_string(), schema));
                self.told.extend(name.map(|name| (name.to_string(), path.to_string())));
                path.to_string()
            });
            return format!("[{word}](#{})", anchor(&place));
        }
        match kind {
            Some("array") => format!("list: {}", self.value(&join(path, "K"), &inner["items"], below)),
            Some("object") => {
                format!("names: {}", self.value(&join(path, "NAME"), &inner["additionalProperties"], below))
            }
            Some("integer") => "whole number".into(),
            Some("boolean") => "true, false".into(),
            Some("string") => "text".into(),
            other => other.unwrap_or_default().into(),
        }
    }
}

/// The schema that this one refers to, with its name, or the one that is not null.
fn resolved(schema: &'static Value) -> (Option<&'static str>, &'static Value) {
    if let Some(place) = schema["$ref"].as_str() {
        let target = json_schema().pointer(place.trim_start_matches('#')).unwrap_or(schema);
        return (place.rsplit('/').next(), target);
    }
    match list(&schema["anyOf"]).find(|form| form["type"] != "null") {
        Some(form) => resolved(form),
        None => (None, schema),
    }
}

/// The kinds of which a value is one.
fn kinds(schema: &'static Value) -> Option<&'static [Value]> {
    schema["oneOf"].as_array().map(Vec::as_slice)
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// A description as the cell of a table, and its unit, if it has one.
fn without_unit(description: &str) -> (String, &'static str) {
    let text = one_line(description).replace('|', "\\|");
    let unit = UNITS.into_iter().find(|unit| text.contains(&format!(" ({unit})")));
    match unit {
        Some(unit) => (text.replacen(&format!(" ({unit})"), "", 1), unit),
        None => (text, ""),
    }
}

/// A text in lines of at most 120 characters.
fn wrapped(text: &str) -> String {
    let mut lines = String::new();
    let mut length = 0;
    for word in text.split(' ') {
        let more = word.chars().count();
        if length > 0 {
            let breaks = length + 1 + more > 120;
            lines.push(if breaks { '\n' } else { ' ' });
            length = if breaks { 0 } else { length + 1 };
        }
        lines.push_str(word);
        length += more;
    }
    lines
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The anchor that a heading of this path gets.
fn anchor(path: &str) -> String {
    path.chars().filter(|c| c.is_alphanumeric() || *c == '_').flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_and_kind_has_a_row_and_every_link_a_section() {
        let page = markdown();
        fn names(schema: &Value, found: &mut Vec<String>) {
            for (name, inner) in schema["properties"].as_object().into_iter().flatten() {
                found.push(name.clone());
                names(inner, found);
            }
            for kind in list(&schema["oneOf"]) {
                found.extend(kind["const"].as_str().map(|name| format!("\"{name}\"")));
                names(kind, found);
            }
        }
        let mut found = vec![];
        names(json_schema(), &mut found);
        json_schema()["$defs"].as_object().expect("definitions").values().for_each(|one| names(one, &mut found));
        assert!(found.len() > 100, "{}", found.len());
        for name in found {
            assert!(page.contains(&format!("| `{name}` |")) || page.contains(&format!("| `{name}`: ")), "{name}");
        }
        let headings: Vec<String> = page.lines().filter_map(|line| line.strip_prefix("## ")).map(anchor).collect();
        for link in page.split("](#").skip(1).map(|rest| rest.split(')').next().unwrap_or_default()) {
            assert!(headings.iter().any(|heading| heading == link), "{link}");
        }
    }

    #[test]
    fn a_row_has_unit_default_and_meaning() {
        let page = markdown();
        for row in [
            "| `density` | number | kg/m³ | **required** | Density of the grains. |",
            "| `start` | number | s | `0.0` | Start of the growth. |",
            "| `\"seated\"` |  | Seated against the sample: moved along its normal until it touches the first grain. |",
            "| `walls` | names: [object](#wallsname) |  |",
            "| `loads` | list: [object](#grainsloadsk) |  | see there | Forces and torques on grains. |",
        ] {
            assert!(page.contains(row), "{row}\n{page}");
        }
    }
}
