//! The runs of a sweep as a table.

use serde_json::Value;

use super::runs::Run;
use crate::output::{number, quantity};
use crate::strength::report::axis;
use crate::strength::scenes::unit;

/// Maximum number of letters of a value of a field.
const LETTERS: usize = 24;

/// The runs as a table: its head and its rows.
pub fn run_rows(fields: &[String], runs: &[Run]) -> (Vec<String>, Vec<Vec<String>>) {
    let mut head = vec!["run".to_string()];
    head.extend(fields.iter().map(|field| axis(field, &unit(field))));
    let measured = ["first break (N)", "5 % broken (N)", "collapse (N)", "peak (N)", "broken bonds", "missed steps"];
    head.extend(["state", "ended by"].into_iter().chain(measured).chain(["CPU (s)"]).map(String::from));
    let row = |run: &Run| {
        let plain = |value: Option<f64>| quantity(value, "");
        let count = |value: Option<usize>| value.map_or_else(|| "–".into(), |n| n.to_string());
        let mut row = vec![run.id.clone()];
        row.extend(fields.iter().map(|field| run.values.get(field).map_or_else(|| "–".into(), cell)));
        let ending = run.ending.as_deref().map_or_else(|| "–".into(), |ending| ending.replace('_', " "));
        row.extend([run.state.name().into(), ending]);
        row.extend([run.first_break, run.broken_5_percent, run.collapse, run.peak].map(plain));
        row.extend([count(run.bonds_broken), count(run.missed_tolerance), plain(run.cpu_time)]);
        row
    };
    (head, runs.iter().map(row).collect())
}

/// A value of a field in a cell.
pub fn cell(value: &Value) -> String {
    let text = match value {
        Value::Null => "–".into(),
        Value::String(text) => text.clone(),
        Value::Number(plain) => plain.as_f64().map_or_else(|| plain.to_string(), number),
        other => other.to_string(),
    };
    if text.chars().count() <= LETTERS {
        return text;
    }
    text.chars().take(LETTERS - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_value_is_cut() {
        let table = serde_json::json!([[0, 0], [0.01, 150], [0.02, 300], [0.03, 450]]);
        assert_eq!(cell(&table).chars().count(), LETTERS);
        assert!(cell(&table).ends_with('…'));
        assert_eq!([cell(&serde_json::json!(0.1)), cell(&Value::Null), cell(&"a".into())], ["0.1", "–", "a"]);
    }
}
