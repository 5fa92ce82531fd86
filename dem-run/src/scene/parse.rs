//! From text to a JSON tree that knows its lines, and from the tree to what it describes: a scene, or a sweep.

use std::collections::{HashMap, HashSet};

use jsonc_parser::ast::{Object, ObjectPropName, Value as Node};
use jsonc_parser::common::Ranged;
use jsonc_parser::errors::ParseErrorKind;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};
use serde::de::DeserializeOwned;
use serde_json::{Map, Number, Value};
use serde_path_to_error::Segment;

use super::error::{Origin, Problem, SceneError, printable, shorten};
use super::suggest::nearest;

/// A JSON tree, with the places where its values were written.
#[derive(Debug, Clone)]
pub(crate) struct Document {
    /// Where the text comes from, for messages.
    name: String,
    /// The tree, with ±`f64::MAX` in place of numbers that overflow.
    pub(super) root: Value,
    /// Where each value was written, by path.
    origins: HashMap<String, Origin>,
    /// Numbers that overflow, as they were written, by path.
    non_finite: HashMap<String, String>,
}

/// JSON with `//` and `/* */` comments, and no other liberty.
fn options() -> ParseOptions {
    ParseOptions {
        allow_comments: true,
        allow_loose_object_property_names: false,
        allow_trailing_commas: false,
        allow_missing_commas: false,
        allow_single_quoted_strings: false,
        allow_hexadecimal_numbers: false,
        allow_unary_plus_numbers: false,
        allow_bare_decimal_point_numbers: false,
        allow_non_finite_numbers: false,
        allow_extended_string_escapes: false,
    }
}

/// Reads JSON with comments.
///
/// # Errors
/// Wrong syntax; names that are given twice in one object, all of them.
pub(crate) fn parse(name: &str, text: &str) -> Result<Document, SceneError> {
    // a byte order mark, as some editors write it, is not part of the text
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let parsed = parse_to_ast(text, &CollectOptions::default(), &options())
        .map_err(|error| syntax(name, text, error.line_display(), error.column_display(), &error.kind().to_string()))?;
    let Some(node) = parsed.value else {
        return Err(syntax(name, text, 1, 1, "The text is empty: an object { … } is expected"));
    };
    let mut walk = Walk { lines: Lines::new(text), origins: HashMap::new(), non_finite: HashMap::new(), twice: vec![] };
    let root = walk.value(String::new(), &node);
    if !walk.twice.is_empty() {
        return Err(SceneError::Wrong { name: name.to_string(), problems: walk.twice });
    }
    Ok(Document { name: name.to_string(), root, origins: walk.origins, non_finite: walk.non_finite })
}

fn syntax(name: &str, text: &str, line: usize, column: usize, message: &str) -> SceneError {
    let content = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    // a window around the place, for lines without end
    let start = column.saturating_sub(60);
    let window: String = content.chars().skip(start).take(100).map(printable).collect();
    let rest: String = content.chars().skip(column.saturating_sub(1)).collect();
    let excerpt = format!("  {window}\n  {}^", " ".repeat(column.saturating_sub(1 + start)));
    SceneError::Syntax { name: name.to_string(), line, column, message: with_remedy(message, &rest), excerpt }
}

/// The parser's message about what starts with `rest`, with what to write instead where that is not plain.
fn with_remedy(message: &str, rest: &str) -> String {
    let unsigned = rest.trim_start_matches(['-', '+']).to_lowercase();
    if unsigned.starts_with("nan") || unsigned.starts_with("inf") {
        return "NaN and infinity are not allowed: write a finite number".to_string();
    }
    let remedies: [(ParseErrorKind, &str); 4] = [
        (ParseErrorKind::TrailingCommasNotAllowed, "remove the comma before the closing bracket"),
        (ParseErrorKind::SingleQuotedStringsNotAllowed, "write \"double quotes\""),
        (ParseErrorKind::BareDecimalPointNumbersNotAllowed, "write 0.5 or 5.0"),
        (ParseErrorKind::ExpectedStringObjectProperty, "names stand in \"double quotes\""),
    ];
    match remedies.iter().find(|(kind, _)| kind.to_string() == message) {
        Some((_, remedy)) => format!("{message}: {remedy}"),
        None => message.to_string(),
    }
}

/// Line and column of byte offsets.
struct Lines<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { text, starts }
    }

    /// Line and column of the byte `offset`, both from 1.
    fn at(&self, offset: usize) -> (usize, usize) {
        let line = self.starts.partition_point(|start| *start <= offset);
        let start = self.starts[line - 1];
        (line, self.text[start..offset].chars().count() + 1)
    }
}

/// One pass over the syntax tree.
struct Walk<'a> {
    lines: Lines<'a>,
    origins: HashMap<String, Origin>,
    non_finite: HashMap<String, String>,
    twice: Vec<Problem>,
}

impl Walk<'_> {
    fn origin(&self, offset: usize) -> Origin {
        let (line, column) = self.lines.at(offset);
        Origin::Text { line, column }
    }

    fn value(&mut self, path: String, node: &Node<'_>) -> Value {
        self.origins.insert(path.clone(), self.origin(node.start()));
        match node {
            Node::NullKeyword(_) => Value::Null,
            Node::BooleanLit(lit) => Value::Bool(lit.value),
            Node::StringLit(lit) => Value::String(lit.value.to_string()),
            Node::NumberLit(lit) => self.number(path, lit.value),
            Node::Array(array) => array
                .elements
                .iter()
                .enumerate()
                .map(|(k, item)| self.value(join(&path, &k.to_string()), item))
                .collect(),
            Node::Object(object) => self.object(&path, object),
        }
    }

    fn number(&mut self, path: String, literal: &str) -> Value {
        // serde_json's own reading, so that a scene and its copy in a history agree to the bit
        match serde_json::from_str::<Number>(literal) {
            Ok(number) => Value::Number(number),
            Err(_) => {
                self.non_finite.insert(path, literal.to_string());
                Value::from(if literal.starts_with('-') { f64::MIN } else { f64::MAX })
            }
        }
    }

    fn object(&mut self, path: &str, object: &Object<'_>) -> Value {
        let mut map = Map::new();
        let mut first: HashMap<&str, usize> = HashMap::new();
        for property in &object.properties {
            let key = match &property.name {
                ObjectPropName::String(lit) => lit.value.as_ref(),
                ObjectPropName::Word(lit) => lit.value,
            };
            let start = property.range.start;
            let below = join(path, key);
            if let Some(earlier) = first.insert(key, start) {
                let found = format!("the name a second time (first on line {})", self.lines.at(earlier).0);
                self.twice.push(Problem::new(below, found, "each name once").with_origin(self.origin(start)));
                continue;
            }
            let value = self.value(below, &property.value);
            map.insert(key.to_string(), value);
        }
        Value::Object(map)
    }
}

/// The path of `key` below `path`.
pub(crate) fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

impl Document {
    /// Records that what stands at `path` comes from elsewhere.
    pub(super) fn mark_set(&mut self, path: &str, origin: Origin) {
        let below = format!("{path}.");
        self.origins.retain(|key, _| key != path && !key.starts_with(&below));
        self.non_finite.retain(|key, _| key != path && !key.starts_with(&below));
        self.origins.insert(path.to_string(), origin);
    }

    /// Records that a number at `path` overflows, written as `literal`.
    pub(super) fn mark_non_finite(&mut self, literals: impl IntoIterator<Item = (String, String)>) {
        self.non_finite.extend(literals);
    }

    /// Numbers that overflow, by path.
    pub(super) fn non_finite(&self) -> &HashMap<String, String> {
        &self.non_finite
    }

    /// Where the value at `path` was written, or else the nearest thing around it.
    pub(super) fn origin(&self, path: &str) -> Option<Origin> {
        let mut path = path;
        loop {
            if let Some(origin) = self.origins.get(path) {
                return Some(origin.clone());
            }
            if path.is_empty() {
                return None;
            }
            path = path.rfind('.').map_or("", |at| &path[..at]);
        }
    }

    /// The error of these problems, each with the place where it was written.
    pub(crate) fn wrong(&self, problems: Vec<Problem>) -> SceneError {
        let problems = problems
            .into_iter()
            .map(|problem| Problem { origin: problem.origin.clone().or_else(|| self.origin(&problem.path)), ..problem })
            .collect();
        SceneError::Wrong { name: self.name.clone(), problems }
    }

    /// The wrong values together with the numbers that overflow, which stand for anything found at their places.
    pub(crate) fn merge_non_finite(&self, problems: Vec<Problem>) -> Vec<Problem> {
        let mut overflows: Vec<Problem> =
            self.non_finite.iter().map(|(path, literal)| overflow(path, literal)).collect();
        overflows.sort_by(|a, b| a.path.cmp(&b.path));
        let seen: HashSet<&String> = self.non_finite.keys().collect();
        overflows.extend(problems.into_iter().filter(|problem| !seen.contains(&problem.path)));
        overflows
    }

    /// What the tree describes.
    ///
    /// # Errors
    /// The first unknown name, missing name, or wrong type.
    pub(crate) fn decode<T: DeserializeOwned>(&self) -> Result<T, Problem> {
        serde_path_to_error::deserialize(&self.root).map_err(|error| {
            let path = error.path().iter().filter_map(segment).fold(String::new(), |path, key| join(&path, &key));
            match self.non_finite.get(&path) {
                Some(literal) => overflow(&path, literal),
                None => {
                    let kinds = self.kinds::<T>(&path);
                    explain(path, &error.into_inner().to_string(), &kinds)
                }
            }
        })
    }

    /// The kinds that may stand at `path`, none where it is no place for one: what an unknown one would be told.
    fn kinds<T: DeserializeOwned>(&self, path: &str) -> Vec<String> {
        let mut root = self.root.clone();
        let Some(place) = root.pointer_mut(&format!("/{}", path.replace('.', "/"))) else { return Vec::new() };
        *place = Value::String("?".into());
        let told = T::deserialize(root).err().map_or(String::new(), |error| error.to_string());
        match told.strip_prefix("unknown variant `?`, ") {
            Some(expected) => quoted(expected).map(String::from).collect(),
            None => Vec::new(),
        }
    }
}

fn overflow(path: &str, literal: &str) -> Problem {
    Problem::new(path, shorten(literal), "a finite number, of magnitude at most 1e60")
}

fn segment(segment: &Segment) -> Option<String> {
    match segment {
        Segment::Seq { index } => Some(index.to_string()),
        Segment::Map { key } => Some(key.clone()),
        Segment::Enum { variant } => Some(variant.clone()),
        Segment::Unknown => None,
    }
}

/// Serde's message about the value at `path`, in the terms of a scene.
fn explain(path: String, message: &str, kinds: &[String]) -> Problem {
    for start in ["unknown field ", "unknown variant "] {
        if let Some((wrong, expected)) = message.strip_prefix(start).and_then(|rest| rest.split_once(", ")) {
            return unknown_name(path, wrong.trim_matches('`'), expected);
        }
    }
    if let Some(field) = message.strip_prefix("missing field ") {
        return Problem::new(join(&path, field.trim_matches('`')), "nothing", "this name is required");
    }
    for start in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((found, expected)) = message.strip_prefix(start).and_then(|rest| rest.rsplit_once(", expected ")) {
            let found = if start == "invalid length " { format!("{found} values") } else { plain_value(found) };
            let allowed = match path.rsplit('.').next() {
                Some(kind) if expected == "newtype variant" => {
                    format!("an object with its settings: {{ \"{kind}\": {{ … }} }}")
                }
                _ => plain_type(expected),
            };
            let which = if kinds.is_empty() { String::new() } else { format!("; the kinds are {}", kinds.join(", ")) };
            return Problem::new(path, found, allowed + &which);
        }
    }
    Problem::new(path, "a value that does not fit", shorten(message))
}

/// A name that the model does not have, where serde lists those it `expected`.
fn unknown_name(path: String, wrong: &str, expected: &str) -> Problem {
    let names: Vec<&str> = quoted(expected).collect();
    let inside = path.rsplit('.').next() == Some(wrong);
    let place = if inside { path } else { join(&path, wrong) };
    let allowed = if names.is_empty() { "no name here".to_string() } else { names.join(", ") };
    Problem::new(place, format!("the unknown name \"{}\"", shorten(wrong)), allowed)
        .with_nearest(nearest(wrong, names.iter().copied()))
}

/// The names between backquotes, as in "one of `a`, `b`" and "`a` or `b`".
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// What serde found, in the terms of JSON.
fn plain_value(found: &str) -> String {
    match found {
        "unit variant" => "the name alone".to_string(),
        "newtype variant" | "struct variant" | "map" => "an object { … }".to_string(),
        "sequence" => "an array [ … ]".to_string(),
        other => match other.split_once('`') {
            Some(("floating point " | "integer " | "boolean ", value)) => value.trim_end_matches('`').to_string(),
            _ => shorten(other),
        },
    }
}

/// What serde expected, in the terms of JSON.
fn plain_type(expected: &str) -> String {
    match expected {
        "f64" => "a number".to_string(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, at least 0".to_string(),
        "a boolean" => "true or false".to_string(),
        "a sequence" => "an array [ … ]".to_string(),
        "a map" | "map" => "an object { … }".to_string(),
        "a string" | "path string" => "a text in \"quotes\"".to_string(),
        "string or map" => "one of the kinds, by its name, or as an object { \"kind\": … }".to_string(),
        "map with a single key" => "an object with one name, that of the kind: { \"kind\": … }".to_string(),
        "unit variant" => "the name alone".to_string(),
        other => match other.strip_prefix("an array of length ") {
            Some(length) => format!("an array of {length} values"),
            None if other.contains("struct") => "an object { … }".to_string(),
            None => other.to_string(),
        },
    }
}
