//! `--set path=value`: one value of a scene given on the command line; and the values that a sweep
//! varies.
//!
//! A path must exist in the model ([`super::schema`]), whether or not the scene gives a value
//! there; free names, as those of walls, must exist in the scene, unless an object adds one as a
//! whole.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::error::{Origin, Problem, shorten};
use super::parse::{self, Document, join};
use super::schema::Form;
use super::suggest::nearest;

/// Applies the assignments in turn.
///
/// # Errors
/// All assignments that are not `path=value`, or whose path does not exist.
pub(super) fn apply(document: &mut Document, assignments: &[String]) -> Result<(), Vec<Problem>> {
    let mut problems = vec![];
    for assignment in assignments {
        if let Err(problem) = assign(document, assignment) {
            problems.push(problem.with_origin(Origin::Set(assignment.clone())));
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(problems) }
}

fn assign(document: &mut Document, assignment: &str) -> Result<(), Problem> {
    let Some((path, literal)) = assignment.split_once('=') else {
        return Err(Problem::new("", quoted(assignment), "path=value, as in bonds.strength=5"));
    };
    let path = path.trim();
    let value = read_value(path, literal.trim());
    check_path(&document.root, path, value.as_ref().is_ok_and(|(value, _)| value.is_object()))?;
    let (value, non_finite) = value?;
    store(&mut document.root, path, value);
    document.mark_set(path, Origin::Set(assignment.to_string()));
    document.mark_non_finite(non_finite);
    Ok(())
}

/// Puts `value` at `path`; `place` is its place in the sweep.
///
/// # Errors
/// A path that does not exist.
pub(super) fn put(document: &mut Document, path: &str, value: Value, place: &str) -> Result<(), Problem> {
    check_path(&document.root, path, value.is_object())?;
    store(&mut document.root, path, value);
    document.mark_set(path, Origin::Sweep(place.into()));
    Ok(())
}

type Overflows = Vec<(String, String)>;

/// The value of an assignment: JSON, or a bare word as a string.
fn read_value(path: &str, literal: &str) -> Result<(Value, Overflows), Problem> {
    if let Ok(parsed) = parse::parse("--set", literal) {
        let overflows = parsed.non_finite().iter();
        let overflows = overflows.map(|(below, text)| {
            if below.is_empty() { (path.to_string(), text.clone()) } else { (join(path, below), text.clone()) }
        });
        return Ok((parsed.root.clone(), overflows.collect()));
    }
    let bare = !literal.is_empty()
        && literal.chars().all(|c| c.is_alphanumeric() || "_-./ ".contains(c))
        && literal.starts_with(|c: char| c.is_alphabetic() || "_./".contains(c));
    if bare {
        return Ok((Value::String(literal.to_string()), vec![]));
    }
    Err(Problem::new(path, quoted(literal), "a JSON value: a number, true, \"text\", [ … ] or { … }, or a bare word"))
}

/// Whether `path` exists in the model and, where names are free or counted, in the tree. An
/// `object` may get a new free name.
fn check_path(root: &Value, path: &str, object: bool) -> Result<(), Problem> {
    let mut forms = Form::root();
    let mut node = Some(root);
    let mut above = String::new();
    let mut keys = path.split('.').peekable();
    while let Some(key) = keys.next() {
        forms = step(&forms, node, &above, key, object && keys.peek().is_none())?;
        node = node.and_then(|node| child(node, key));
        above = join(&above, key);
    }
    Ok(())
}

/// The forms of the value under `key` in `node`, for which one of `forms` is expected. With `add`,
/// a free name may be new.
fn step(forms: &[Form], node: Option<&Value>, above: &str, key: &str, add: bool) -> Result<Vec<Form>, Problem> {
    let below = join(above, key);
    let object = node.and_then(Value::as_object);
    if let Some((form, found)) = forms.iter().find_map(|form| Some((form, form.property(key)?))) {
        // one kind of several: where the scene has another kind, this path would mix the values of
        // two kinds
        if form.kind
            && let Some(other) = other_kind(node, key)
        {
            let allowed =
                format!("this path only if the scene has \"{key}\"; to change the kind, set {above} as a whole");
            return Err(Problem::new(below, format!("\"{other}\" in {above}"), allowed));
        }
        return Ok(found);
    }
    if let Some(found) = forms.iter().find_map(Form::entries) {
        if add || object.is_some_and(|object| object.contains_key(key)) {
            return Ok(found);
        }
        let names: BTreeSet<&str> = object.into_iter().flatten().map(|(name, _)| name.as_str()).collect();
        let new = format!("a new name with an object: {}={{ … }}", join(above, &shorten(key)));
        let mut problem = unknown(above, key, names.iter().copied());
        problem.allowed = if names.is_empty() { new } else { format!("{}, or {new}", problem.allowed) };
        return Err(problem);
    }
    if let Some(found) = forms.iter().find_map(Form::items) {
        let length = node.and_then(Value::as_array).map_or(0, Vec::len);
        if key.parse::<usize>().is_ok_and(|index| index < length) {
            return Ok(found);
        }
        let allowed = match length {
            0 => format!("{above} is an array without values: set it as a whole"),
            _ => format!("a number from 0 to {}, one of the {length} values of {above}", length - 1),
        };
        return Err(Problem::new(below, quoted(key), allowed));
    }
    Err(unknown(above, key, forms.iter().flat_map(Form::names)))
}

/// The kind at `node`, if it is not `key`.
fn other_kind(node: Option<&Value>, key: &str) -> Option<String> {
    match node? {
        Value::Object(map) => map.keys().find(|name| *name != key).map(|name| shorten(name)),
        Value::String(name) => Some(shorten(name)),
        _ => None,
    }
}

fn unknown<'a>(above: &str, key: &str, names: impl Iterator<Item = &'a str>) -> Problem {
    let names: BTreeSet<&str> = names.collect();
    let allowed = match (names.is_empty(), above) {
        (true, above) => format!("{above} is a single value and has no fields"),
        (false, "") => format!("a path that starts with {}", list(&names)),
        (false, above) => format!("below {above}: {}", list(&names)),
    };
    let suggestion = nearest(key, names.iter().copied()).map(|name| join(above, &name));
    Problem::new(join(above, &shorten(key)), format!("the unknown name \"{}\"", shorten(key)), allowed)
        .with_nearest(suggestion)
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", shorten(text))
}

fn list(names: &BTreeSet<&str>) -> String {
    names.iter().copied().collect::<Vec<_>>().join(", ")
}

fn child<'a>(node: &'a Value, key: &str) -> Option<&'a Value> {
    match node {
        Value::Object(map) => map.get(key),
        Value::Array(items) => items.get(key.parse::<usize>().ok()?),
        _ => None,
    }
}

/// Puts `value` at `path`, which has been checked; creates missing objects along the path.
fn store(root: &mut Value, path: &str, value: Value) {
    let mut node = root;
    for key in path.split('.') {
        node = match node {
            Value::Array(items) => match key.parse::<usize>().ok().and_then(|index| items.get_mut(index)) {
                Some(item) => item,
                None => return,
            },
            Value::Object(map) => map.entry(key).or_insert(Value::Null),
            // the scene omits an optional object, or has a value of a wrong type, which an object
            // replaces
            other => {
                *other = Value::Object(Map::new());
                match other {
                    Value::Object(map) => map.entry(key).or_insert(Value::Null),
                    _ => return,
                }
            }
        };
    }
    *node = value;
}
