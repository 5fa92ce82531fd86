//! Parses a text into a JSON tree with line numbers, and decodes the tree into a scene or a sweep.

use std::collections::HashSet;
use std::collections::hash_map::{Entry, HashMap};
use std::fmt;
use std::sync::Arc;

use jsonc_parser::ast::{Object, ObjectPropName, Value as Node};
use jsonc_parser::common::Ranged;
use jsonc_parser::errors::ParseErrorKind;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast, parse_to_serde_value};
use serde::de::{self, Deserialize, DeserializeOwned, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use serde_path_to_error::Segment;

use super::error::{Origin, Problem, SceneError, printable, shorten};
use super::suggest::nearest;

/// A JSON tree, with the text that it was read from.
#[derive(Debug, Clone)]
pub struct Document {
    /// Where the text comes from, for messages.
    name: String,
    /// The text without its byte order mark. Used to locate wrong values, if any.
    text: Arc<str>,
    /// The tree, with ±`f64::MAX` in place of numbers that overflow.
    pub(super) root: Value,
    /// Origins of values that are not from the text, by path.
    replaced: HashMap<String, Origin>,
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
/// Wrong syntax; all names that occur twice in one object.
pub fn parse(name: &str, text: &str) -> Result<Document, SceneError> {
    // a byte order mark, as some editors write it, is not part of the text
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (root, non_finite) = match parse_to_serde_value(text, &options()) {
        // this parser reads an empty text as null
        Ok(Tree(root)) if !root.is_null() => (root, HashMap::new()),
        _ => by_syntax(name, text)?,
    };
    let (name, text) = (name.to_string(), Arc::from(text));
    Ok(Document { name, text, root, replaced: HashMap::new(), non_finite })
}

/// The tree and the numbers that overflow, from the syntax tree, which has the places of errors.
fn by_syntax(name: &str, text: &str) -> Result<(Value, HashMap<String, String>), SceneError> {
    let parsed = parse_to_ast(text, &CollectOptions::default(), &options())
        .map_err(|error| syntax(name, text, error.line_display(), error.column_display(), &error.kind().to_string()))?;
    let Some(node) = parsed.value else {
        return Err(syntax(name, text, 1, 1, "The text is empty: an object { … } is expected"));
    };
    let mut walk = Walk { path: String::new(), non_finite: HashMap::new(), twice: vec![] };
    let root = walk.value(node);
    if !walk.twice.is_empty() {
        return Err(SceneError::Wrong { name: name.to_string(), problems: given_twice(text, &walk.twice) });
    }
    Ok((root, walk.non_finite))
}

/// The problems of duplicate names in an object.
fn given_twice(text: &str, twice: &[Twice]) -> Vec<Problem> {
    let places = places(text, twice.iter().flat_map(|twice| [twice.first, twice.second]));
    let problem = |Twice { path, first, second }: &Twice| {
        let found = format!("the name a second time (first on line {})", places[first].0);
        Problem::new(path, found, "each name once").with_origin(in_text(places[second]))
    };
    twice.iter().map(problem).collect()
}

fn syntax(name: &str, text: &str, line: usize, column: usize, message: &str) -> SceneError {
    let content = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    // a window around the place, for very long lines
    let start = column.saturating_sub(60);
    let window: String = content.chars().skip(start).take(100).map(printable).collect();
    let rest: String = content.chars().skip(column.saturating_sub(1)).collect();
    let excerpt = format!("  {window}\n  {}^", " ".repeat(column.saturating_sub(1 + start)));
    SceneError::Syntax { name: name.to_string(), line, column, message: with_remedy(message, &rest), excerpt }
}

/// The parser's message about the text at the start of `rest`, with a remedy where it is not
/// obvious.
fn with_remedy(message: &str, rest: &str) -> String {
    let unsigned = rest.trim_start_matches(['-', '+']).to_lowercase();
    if unsigned.starts_with("nan") || unsigned.starts_with("inf") {
        return "NaN and infinity are not allowed: write a finite number".to_string();
    }
    let remedies: [(ParseErrorKind, &str); 4] = [
        (ParseErrorKind::TrailingCommasNotAllowed, "remove the comma before the closing bracket"),
        (ParseErrorKind::SingleQuotedStringsNotAllowed, "write \"double quotes\""),
        (ParseErrorKind::BareDecimalPointNumbersNotAllowed, "write 0.5 or 5.0"),
        (ParseErrorKind::ExpectedStringObjectProperty, "write names in \"double quotes\""),
    ];
    match remedies.iter().find(|(kind, _)| kind.to_string() == message) {
        Some((_, remedy)) => format!("{message}: {remedy}"),
        None => message.to_string(),
    }
}

/// The JSON tree of a valid text: no name occurs twice and no number overflows. It is read without
/// the syntax tree, which for millions of grains is larger.
struct Tree(Value);

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TreeVisitor).map(Tree)
    }
}

struct TreeVisitor;

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E: de::Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E: de::Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Value, E> {
        Number::from_f64(value).map(Value::Number).ok_or_else(|| E::custom("not finite"))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut list = vec![];
        while let Some(Tree(item)) = items.next_element()? {
            list.push(item);
        }
        Ok(Value::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some((name, Tree(value))) = entries.next_entry::<String, _>()? {
            if map.insert(name, value).is_some() {
                return Err(de::Error::custom("a name a second time"));
            }
        }
        Ok(Value::Object(map))
    }
}

/// Line and column, both from 1, of byte offsets in `text`.
fn places(text: &str, offsets: impl Iterator<Item = usize>) -> HashMap<usize, (usize, usize)> {
    let mut sorted: Vec<usize> = offsets.collect();
    sorted.sort_unstable();
    let found = in_order(text.char_indices(), &sorted);
    sorted.into_iter().zip(found).collect()
}

/// Line and column of offsets that do not decrease, in one pass: counting from the start of its
/// line for each of them would be quadratic in a long line.
fn in_order(chars: impl Iterator<Item = (usize, char)>, offsets: &[usize]) -> Vec<(usize, usize)> {
    let (mut line, mut column) = (1, 1);
    let mut chars = chars.peekable();
    let place = |offset: &usize| {
        while let Some((_, c)) = chars.next_if(|(at, _)| at < offset) {
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        (line, column)
    };
    offsets.iter().map(place).collect()
}

fn in_text((line, column): (usize, usize)) -> Origin {
    Origin::Text { line, column }
}

/// Offset of the value at `path` in the text, or else of the innermost value around it (bytes).
fn offset(node: &Node<'_>, path: &str) -> usize {
    let below = match node {
        _ if path.is_empty() => None,
        Node::Array(array) => {
            let (index, rest) = path.split_once('.').unwrap_or((path, ""));
            index.parse().ok().and_then(|k: usize| array.elements.get(k)).map(|node| (node, rest))
        }
        // a name may hold a full stop
        Node::Object(object) => object.properties.iter().find_map(|property| {
            let rest = path.strip_prefix(key(&property.name))?;
            if rest.is_empty() { Some(rest) } else { rest.strip_prefix('.') }.map(|rest| (&property.value, rest))
        }),
        _ => None,
    };
    below.map_or(node.start(), |(node, rest)| offset(node, rest))
}

fn key<'a>(name: &'a ObjectPropName<'_>) -> &'a str {
    match name {
        ObjectPropName::String(lit) => lit.value.as_ref(),
        ObjectPropName::Word(lit) => lit.value,
    }
}

/// A duplicate name in an object: its path and its offset (bytes).
struct Twice {
    path: String,
    first: usize,
    second: usize,
}

/// One pass over the syntax tree.
struct Walk {
    /// The path of the current value.
    path: String,
    non_finite: HashMap<String, String>,
    twice: Vec<Twice>,
}

impl Walk {
    fn value(&mut self, node: Node<'_>) -> Value {
        match node {
            Node::NullKeyword(_) => Value::Null,
            Node::BooleanLit(lit) => Value::Bool(lit.value),
            Node::StringLit(lit) => Value::String(lit.value.into_owned()),
            Node::NumberLit(lit) => self.number(lit.value),
            Node::Array(array) => {
                let items = array.elements.into_iter().enumerate();
                items.map(|(k, item)| self.below(&k.to_string(), |walk| walk.value(item))).collect()
            }
            Node::Object(object) => self.object(object),
        }
    }

    /// The result of `visit` for the value under `key`.
    fn below<T>(&mut self, key: &str, visit: impl FnOnce(&mut Self) -> T) -> T {
        let above = self.path.len();
        if above > 0 {
            self.path.push('.');
        }
        self.path.push_str(key);
        let found = visit(self);
        self.path.truncate(above);
        found
    }

    fn number(&mut self, literal: &str) -> Value {
        // serde_json's own reading, so that a scene and its copy in a history agree to the bit
        match serde_json::from_str::<Number>(literal) {
            Ok(number) => Value::Number(number),
            Err(_) => {
                self.non_finite.insert(self.path.clone(), literal.to_string());
                Value::from(if literal.starts_with('-') { f64::MIN } else { f64::MAX })
            }
        }
    }

    fn object(&mut self, object: Object<'_>) -> Value {
        let mut first: HashMap<&str, usize> = HashMap::new();
        for property in &object.properties {
            let (name, start) = (key(&property.name), property.range.start);
            match first.entry(name) {
                Entry::Vacant(entry) => _ = entry.insert(start),
                Entry::Occupied(entry) => {
                    self.twice.push(Twice { path: join(&self.path, name), first: *entry.get(), second: start });
                }
            }
        }
        let mut map = Map::new();
        for property in object.properties {
            let name = property.name.into_string();
            if !map.contains_key(&name) {
                let value = self.below(&name, |walk| walk.value(property.value));
                map.insert(name, value);
            }
        }
        Value::Object(map)
    }
}

/// The path of `key` below `path`.
pub fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

impl Document {
    /// Whether the tree is an object with this name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.root.get(name).is_some()
    }

    /// Records that the value at `path` does not come from the text.
    pub(super) fn mark_set(&mut self, path: &str, origin: Origin) {
        let below = format!("{path}.");
        self.replaced.retain(|key, _| key != path && !key.starts_with(&below));
        self.non_finite.retain(|key, _| key != path && !key.starts_with(&below));
        self.replaced.insert(path.to_string(), origin);
    }

    /// Records that a number at `path` overflows, written as `literal`.
    pub(super) fn mark_non_finite(&mut self, literals: impl IntoIterator<Item = (String, String)>) {
        self.non_finite.extend(literals);
    }

    /// Numbers that overflow, by path.
    pub(super) fn non_finite(&self) -> &HashMap<String, String> {
        &self.non_finite
    }

    /// The origin of the value at `path`, if not the text.
    fn replacement(&self, path: &str) -> Option<Origin> {
        let mut path = path;
        loop {
            if let Some(origin) = self.replaced.get(path) {
                return Some(origin.clone());
            }
            path = &path[..path.rfind('.')?];
        }
    }

    /// The problems, each with the place where it was written.
    pub(super) fn located(&self, mut problems: Vec<Problem>) -> Vec<Problem> {
        let parsed = parse_to_ast(&self.text, &CollectOptions::default(), &options());
        // the text was parsed before, so this succeeds
        let Some(node) = parsed.ok().and_then(|parsed| parsed.value) else { return problems };
        let mut written = vec![];
        for (k, problem) in problems.iter_mut().enumerate().filter(|(_, problem)| problem.origin.is_none()) {
            problem.origin = self.replacement(&problem.path);
            if problem.origin.is_none() {
                written.push((k, offset(&node, &problem.path)));
            }
        }
        let places = places(&self.text, written.iter().map(|(_, offset)| *offset));
        written.iter().for_each(|(k, offset)| problems[*k].origin = Some(in_text(places[offset])));
        problems
    }

    /// The error of these problems, each with the place where it was written.
    pub fn wrong(&self, problems: Vec<Problem>) -> SceneError {
        SceneError::Wrong { name: self.name.clone(), problems: self.located(problems) }
    }

    /// The wrong values together with the numbers that overflow. An overflow replaces every other
    /// problem at its path.
    pub fn merge_non_finite(&self, problems: Vec<Problem>) -> Vec<Problem> {
        let mut overflows: Vec<Problem> =
            self.non_finite.iter().map(|(path, literal)| overflow(path, literal)).collect();
        overflows.sort_by(|a, b| a.path.cmp(&b.path));
        let seen: HashSet<&String> = self.non_finite.keys().collect();
        overflows.extend(problems.into_iter().filter(|problem| !seen.contains(&problem.path)));
        overflows
    }

    /// Decodes the tree.
    ///
    /// # Errors
    /// The first unknown name, missing name, or wrong type.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, Problem> {
        serde_path_to_error::deserialize(&self.root).map_err(|error| {
            let path = error.path().iter().filter_map(segment).fold(String::new(), |path, key| join(&path, &key));
            match self.non_finite.get(&path) {
                Some(literal) => overflow(&path, literal),
                None => {
                    let (kinds, field) = (self.kinds::<T>(&path), self.first_field::<T>(&path));
                    explain(path, &error.into_inner().to_string(), &kinds, field)
                }
            }
        })
    }

    /// The kinds allowed at `path`, from the message about an unknown kind; none where the path has
    /// no kind.
    fn kinds<T: DeserializeOwned>(&self, path: &str) -> Vec<String> {
        let told = self.told_of::<T>(path, Value::String("?".into()));
        match told.strip_prefix("unknown variant `?`, ") {
            Some(expected) => quoted(expected).map(String::from).collect(),
            None => Vec::new(),
        }
    }

    /// The first required field of the object at `path`, from the message about an empty object.
    fn first_field<T: DeserializeOwned>(&self, path: &str) -> Option<String> {
        let told = self.told_of::<T>(path, Value::Object(Map::new()));
        told.strip_prefix("missing field ").map(|field| field.trim_matches('`').to_string())
    }

    /// Serde's message if `value` stood at `path`; empty if it accepts it.
    fn told_of<T: DeserializeOwned>(&self, path: &str, value: Value) -> String {
        let mut root = self.root.clone();
        let Some(place) = root.pointer_mut(&format!("/{}", path.replace('.', "/"))) else { return String::new() };
        *place = value;
        T::deserialize(root).err().map_or(String::new(), |error| error.to_string())
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

/// What is allowed where a required field is missing.
pub(super) const REQUIRED: &str = "this field is required";

/// Serde's message about the value at `path`, in the terms of a scene.
fn explain(path: String, message: &str, kinds: &[String], field: Option<String>) -> Problem {
    for start in ["unknown field ", "unknown variant "] {
        if let Some((wrong, expected)) = message.strip_prefix(start).and_then(|rest| rest.split_once(", ")) {
            return unknown_name(path, wrong.trim_matches('`'), expected);
        }
    }
    if let Some(field) = message.strip_prefix("missing field ") {
        return Problem::new(join(&path, field.trim_matches('`')), "nothing", REQUIRED);
    }
    for start in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((found, expected)) = message.strip_prefix(start).and_then(|rest| rest.rsplit_once(", expected ")) {
            let found = if start == "invalid length " { format!("{found} values") } else { plain_value(found) };
            let allowed = match path.rsplit('.').next() {
                Some(kind) if expected == "newtype variant" => {
                    format!("an object with its settings: {{ \"{kind}\": {{ … }} }}")
                }
                _ => match field.filter(|_| expected.contains("struct")) {
                    Some(field) => format!("an object {{ \"{field}\": … }}"),
                    None => plain_type(expected),
                },
            };
            let which = if kinds.is_empty() { String::new() } else { format!("; the kinds are {}", kinds.join(", ")) };
            return Problem::new(path, found, allowed + &which);
        }
    }
    Problem::new(path, "an invalid value", shorten(message))
}

/// The problem of a name that the model does not have; `expected` is serde's list of valid names.
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

/// The value that serde found, in the terms of JSON.
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

/// The type that serde expected, in the terms of JSON.
fn plain_type(expected: &str) -> String {
    match expected {
        "f64" => "a number".to_string(),
        "u8" | "u16" => "a whole number, at least 0".to_string(),
        "u32" => format!("a whole number, at least 0 and at most {}", u32::MAX),
        "u64" | "usize" => format!("a whole number, at least 0 and at most {}", u64::MAX),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_places_in_one_long_line_are_found_in_one_pass() {
        let text = format!("[{}]", ["[0, 1]"; 1000].join(", "));
        let offsets: Vec<usize> = (0..1000).map(|k| 1 + 8 * k).collect();
        let mut looked_at = 0;
        let found = in_order(text.char_indices().inspect(|_| looked_at += 1), &offsets);
        assert!(found.iter().zip(&offsets).all(|(place, offset)| *place == (1, offset + 1)));
        assert!(looked_at <= text.len(), "{looked_at} characters of {}", text.len());
    }

    #[test]
    fn both_ways_to_read_give_the_same_tree() {
        let numbers =
            "[0, -7, 18446744073709551615, 18446744073709551616, 1e5, 0.1, -0.0, 5e-324, 1.7976931348623157e308]";
        let quirks = r#"{ "a\u0041\n": [true, null, "é\ud83d\ude00"], // a comment
            "b": { /* and another */ "c": [] , "d": {} } }"#;
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        let entries = std::fs::read_dir(folder).expect("configs").map(|entry| entry.expect("entry").path());
        let texts = entries.map(|path| std::fs::read_to_string(path).expect("text"));
        for text in texts.chain([numbers.to_string(), quirks.to_string()]) {
            let Tree(quick) = parse_to_serde_value(&text, &options()).expect("JSON");
            assert_eq!((quick, HashMap::new()), by_syntax("test", &text).expect("JSON"), "{text}");
        }
    }

    #[test]
    fn a_place_is_that_of_the_value_or_of_the_nearest_thing_around_it() {
        let text = "{ \"a.b\": [0,\n  { \"é\": 1, \"c\": 2 }] }";
        let document = parse("test", text).expect("JSON");
        let paths = ["a.b.1.c", "a.b.0", "a.b.1.d.e", "a.c", "a.b.7", ""];
        let problems = paths.map(|path| Problem::new(path, "", "")).to_vec();
        let found = document.located(problems).into_iter().map(|problem| problem.origin.expect("a place"));
        let text = |line, column| Origin::Text { line, column };
        assert_eq!(
            found.collect::<Vec<_>>(),
            [text(2, 18), text(1, 11), text(2, 3), text(1, 1), text(1, 10), text(1, 1)]
        );
    }
}
