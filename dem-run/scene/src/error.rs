//! The errors of a scene, each with the information to correct it.

use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read, or is not UTF-8 text.
    #[error("{}: the scene cannot be read: {source}{}", path.display(), did_you_mean(nearest.as_deref()))]
    Read {
        /// The file.
        path: PathBuf,
        /// A file of nearly this name, if there is none of it.
        nearest: Option<PathBuf>,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The text is not JSON with comments.
    #[error("{name}, line {line}, column {column}: {message}\n{excerpt}")]
    Syntax {
        /// Where the text comes from.
        name: String,
        /// Line, from 1.
        line: usize,
        /// Column, in characters, from 1.
        column: usize,
        /// What is wrong, and what to write instead.
        message: String,
        /// The line itself, with a mark below the place.
        excerpt: String,
    },
    /// The text is JSON, but not a scene: all problems, in the order of the scene.
    #[error("{}", render(name, problems))]
    Wrong {
        /// Where the text comes from.
        name: String,
        /// What is wrong, at least one.
        problems: Vec<Problem>,
    },
}

/// The question for a file of nearly the name given; nothing for none.
fn did_you_mean(nearest: Option<&Path>) -> String {
    nearest.map_or_else(String::new, |path| format!("; did you mean {}?", path.display()))
}

impl SceneError {
    /// The problems of a text that is JSON; none for the other errors.
    #[must_use]
    pub fn problems(&self) -> &[Problem] {
        match self {
            Self::Wrong { problems, .. } => problems,
            Self::Read { .. } | Self::Syntax { .. } => &[],
        }
    }
}

/// One thing that is wrong in a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// The path in the scene, in the notation of `--set`: `materials.friction.grain_grain`; empty
    /// for the whole scene.
    pub path: String,
    /// The value found.
    pub found: String,
    /// The values allowed, or what to do.
    pub allowed: String,
    /// The valid name nearest to a wrong one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest: Option<String>,
    /// The origin of the value, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
}

/// Origin of a value.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// In the text, at this line and column, both from 1.
    Text {
        /// Line, from 1.
        line: usize,
        /// Column, in characters, from 1.
        column: usize,
    },
    /// In an assignment `--set path=value`.
    Set(String),
    /// In a sweep, at this place.
    Sweep(Box<str>),
}

impl Problem {
    /// A problem without a nearest name or a known origin.
    #[must_use]
    pub fn new(path: impl Into<String>, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self { path: path.into(), found: found.into(), allowed: allowed.into(), nearest: None, origin: None }
    }

    /// The same problem with the valid name nearest to the wrong one.
    #[must_use]
    pub fn with_nearest(self, nearest: Option<String>) -> Self {
        Self { nearest, ..self }
    }

    /// The same problem with its origin.
    pub(super) fn with_origin(self, origin: Origin) -> Self {
        Self { origin: Some(origin), ..self }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.path.as_str() {
            "" => f.write_str("the scene")?,
            path => f.write_str(&cut(path, 200))?,
        }
        match &self.origin {
            Some(Origin::Text { line, column }) => write!(f, " (line {line}, column {column})")?,
            Some(Origin::Set(assignment)) => write!(f, " (--set {})", shorten(assignment))?,
            Some(Origin::Sweep(place)) => write!(f, " ({})", shorten(place))?,
            None => {}
        }
        write!(f, "\n      found    {}", cut(&self.found, 200))?;
        write!(f, "\n      allowed  {}", cut(&self.allowed, 1000))?;
        match &self.nearest {
            Some(nearest) => write!(f, "\n      nearest  {}", cut(nearest, 200)),
            None => Ok(()),
        }
    }
}

/// At most 80 characters of a text, printable.
pub fn shorten(text: &str) -> String {
    cut(text, 80)
}

/// At most `limit` characters of a text, printable.
fn cut(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        None => text.chars().map(printable).collect(),
        Some((end, _)) => text[..end].chars().map(printable).chain(['…']).collect(),
    }
}

/// A blank for a control character, which could move the cursor of a terminal.
pub fn printable(c: char) -> char {
    if c.is_control() { ' ' } else { c }
}

/// Maximum number of problems listed: lists of grains may be long.
const MOST_TOLD: usize = 100;

/// The problems under one heading.
fn render(name: &str, problems: &[Problem]) -> String {
    let mut text = match problems.len() {
        1 => format!("{name} is wrong at one place"),
        count => format!("{name} is wrong at {count} places"),
    };
    for problem in &problems[..problems.len().min(MOST_TOLD)] {
        // writing to a string cannot fail
        let _ = write!(text, "\n  {problem}");
    }
    if problems.len() > MOST_TOLD {
        let _ = write!(text, "\n  and {} more", problems.len() - MOST_TOLD);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_and_terminals_left_alone() {
        assert_eq!(shorten("a\u{1b}[31m\n"), "a [31m ");
        assert_eq!(shorten(&"é".repeat(80)), "é".repeat(80));
        assert_eq!(shorten(&"é".repeat(81)), "é".repeat(80) + "…");
        let problem = Problem::new("x\n".repeat(1000), "y".repeat(1000), "z");
        assert!(problem.to_string().chars().count() < 450);
    }

    #[test]
    fn a_problem_says_where_what_stood_there_what_is_allowed_and_the_nearest_name() {
        let problems = vec![
            Problem::new("bonds.strenght", "an unknown name", "strength, stress")
                .with_nearest(Some("strength".into()))
                .with_origin(Origin::Text { line: 3, column: 5 }),
            Problem::new("time.step", "0.0", "a number > 0 (s)").with_origin(Origin::Set("time.step=0".into())),
        ];
        let text = SceneError::Wrong { name: "a.json".into(), problems }.to_string();
        assert_eq!(
            text,
            "a.json is wrong at 2 places\
             \n  bonds.strenght (line 3, column 5)\
             \n      found    an unknown name\
             \n      allowed  strength, stress\
             \n      nearest  strength\
             \n  time.step (--set time.step=0)\
             \n      found    0.0\
             \n      allowed  a number > 0 (s)"
        );
    }
}
