//! Results on stdout.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::Path;

use serde::Serialize;

use crate::error::{Result, WriteError};

/// A path for a shell: in quotes unless it has only letters, digits and the usual characters of
/// names.
#[must_use]
pub fn in_shell(path: &Path) -> String {
    let shown = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    if !shown.is_empty() && shown.chars().all(plain) { shown } else { format!("'{}'", shown.replace('\'', r"'\''")) }
}

/// The text with its control characters, except line ends, escaped as in JSON (`\u001b`), so that a
/// terminal does not interpret them. In JSON they occur only within strings, so the meaning of JSON
/// stays the same.
#[must_use]
pub fn escaped(text: &str) -> Cow<'_, str> {
    let raw = |c: char| c.is_control() && c != '\n';
    if !text.contains(raw) {
        return text.into();
    }
    text.chars().map(|c| if raw(c) { format!("\\u{:04x}", u32::from(c)) } else { c.into() }).collect()
}

/// Prints results on stdout, [`escaped`]. A reader that closes the pipe early is no error.
///
/// # Errors
/// [`WriteError`].
pub fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(escaped(text).as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(WriteError { path: "standard output".into(), why: error.to_string() })
        }
        _ => Ok(()),
    }
}

/// Prints a line on stdout, as [`print()`].
///
/// # Errors
/// [`WriteError`].
pub fn print_line(text: &str) -> Result<()> {
    print(&format!("{text}\n"))
}

/// Prints JSON on stdout, as [`print()`].
///
/// # Errors
/// [`WriteError`].
pub fn print_json(value: &serde_json::Value) -> Result<()> {
    print_line(&format!("{value:#}"))
}

/// Prints a result on stdout, as text or as JSON, as [`print()`].
///
/// # Errors
/// [`WriteError`].
pub fn print_result<T: Display + Serialize>(result: &T, json: bool) -> Result<()> {
    if json { print_json(&serde_json::json!(result)) } else { print_line(&result.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(escaped("\u{1b}[31mred\u{7}\r\nµ\t\u{9b}"), "\\u001b[31mred\\u0007\\u000d\nµ\\u0009\\u009b");
        let json = format!("{:#}", serde_json::json!({ "wall": "\u{1b}\u{9b}2J" }));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped(&json)).unwrap()["wall"], "\u{1b}\u{9b}2J");
    }

    #[test]
    fn a_path_is_quoted_where_a_shell_would_part_it() {
        for (path, text) in
            [("runs/µ=0.3.h5", "runs/µ=0.3.h5"), ("my run.h5", "'my run.h5'"), ("a'b.h5", r"'a'\''b.h5'")]
        {
            assert_eq!(in_shell(Path::new(path)), text);
        }
    }
}
