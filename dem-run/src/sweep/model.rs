//! What a sweep file may say.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A sweep: one scene, run with many values. Fields of the scene are named as `--set` names them:
/// bonds.strength.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// JSON Schema for editors, as printed by `dem-run schema --sweep`.
    #[serde(default, rename = "$schema", skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Title of the sweep, one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// File of the scene on which all runs are based. A relative path starts from the folder of the
    /// sweep.
    pub scene: PathBuf,
    /// Values that replace those of the scene in all runs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, Value>,
    /// The varied fields. Fields of one object vary together: the first run has the first value of
    /// each, and so on. Several objects are combined, each with each; the last varies fastest.
    pub vary: Vec<BTreeMap<String, Values>>,
}

/// The values that a field takes.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Values {
    /// These values, in this order.
    List(Vec<Value>),
    /// Equally spaced numbers.
    Range(Range),
}

/// Equally spaced numbers, rounded to 12 digits; whole numbers are written without a decimal point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The first number.
    pub from: f64,
    /// The last number; default: each number is its predecessor plus 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
    /// How many numbers.
    pub count: u64,
    /// Spacing of the numbers; default: `linear`.
    #[serde(default)]
    pub spacing: Spacing,
}

/// Spacing of the numbers of a range.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios.
    Geometric,
}

/// A list or an object, distinguished by its bracket: serde's untagged enum would lose the position
/// of an error.
impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct ByBracket;
        impl<'de> Visitor<'de> for ByBracket {
            type Value = Values;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list [ … ], or a range { \"from\": …, \"to\": …, \"count\": … }")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, items: A) -> Result<Values, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(items)).map(Values::List)
            }
            fn visit_map<A: MapAccess<'de>>(self, entries: A) -> Result<Values, A::Error> {
                Deserialize::deserialize(MapAccessDeserializer::new(entries)).map(Values::Range)
            }
        }
        from.deserialize_any(ByBracket)
    }
}

impl Range {
    /// The numbers, with the last one exactly at the end.
    #[must_use]
    pub fn numbers(&self) -> Vec<Value> {
        let last = self.count.saturating_sub(1);
        let to = self.to.unwrap_or(self.from + last as f64);
        let number = |k: u64| {
            let share = if last == 0 { 0.0 } else { k as f64 / last as f64 };
            match self.spacing {
                _ if k == 0 => self.from,
                _ if k == last => to,
                Spacing::Linear => round(self.from + share * (to - self.from)),
                Spacing::Geometric => round(self.from * (to / self.from).powf(share)),
            }
        };
        (0..self.count).map(number).map(plain).collect()
    }
}

/// Rounds to 12 digits, because the last bits of a power depend on the machine.
fn round(number: f64) -> f64 {
    format!("{number:.11e}").parse().unwrap_or(number)
}

/// Writes a whole number without a decimal point, as integer fields require.
fn plain(number: f64) -> Value {
    /// Above this limit, not every whole number is a double.
    const WHOLE: f64 = 9_007_199_254_740_992.0;
    if number.fract() == 0.0 && number.abs() <= WHOLE { Value::from(number as i64) } else { Value::from(number) }
}

static SCHEMA: LazyLock<Value> = LazyLock::new(|| schemars::schema_for!(Sweep).to_value());

/// The JSON Schema of a sweep (draft 2020-12).
#[must_use]
pub fn json_schema() -> &'static Value {
    &SCHEMA
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(range: &str) -> String {
        let range: Range = serde_json::from_str(range).expect("range");
        Value::from(range.numbers()).to_string()
    }

    #[test]
    fn ranges_hit_their_ends_and_are_short() {
        assert_eq!(numbers(r#"{"from": 1, "count": 4}"#), "[1,2,3,4]");
        assert_eq!(numbers(r#"{"from": 0.1, "to": 0.5, "count": 5}"#), "[0.1,0.2,0.3,0.4,0.5]");
        assert_eq!(numbers(r#"{"from": 3, "to": 1, "count": 3}"#), "[3,2,1]");
        assert_eq!(numbers(r#"{"from": 1, "to": 1e3, "count": 4, "spacing": "geometric"}"#), "[1,10,100,1000]");
        assert_eq!(numbers(r#"{"from": 7.5, "to": 7.5, "count": 1}"#), "[7.5]");
    }

    #[test]
    fn values_are_told_by_their_bracket() {
        let list: Values = serde_json::from_str("[1, \"a\", {}]").expect("list");
        assert!(matches!(list, Values::List(values) if values.len() == 3));
        let range: Values = serde_json::from_str(r#"{"from": 1, "count": 2}"#).expect("range");
        assert!(matches!(range, Values::Range(_)));
        let error = serde_json::from_str::<Values>("3").expect_err("a number");
        assert!(error.to_string().contains("a list [ … ]"), "{error}");
    }
}
