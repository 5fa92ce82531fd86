//! Tables in CSV files, read line by line: lines that are neither empty nor a comment, and what is
//! wrong with them.

use crate::error::RunError;
use crate::scene::open_regular;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Maximum number of wrong lines that are reported individually.
pub const MOST_TOLD: usize = 20;
/// Maximum length of a line (bytes), so that a file without line breaks is not read into memory.
const LONGEST_LINE: usize = 4096;

/// The lines of a table that are neither empty nor a comment.
pub struct Lines<R> {
    /// Path of the file.
    pub path: PathBuf,
    inner: R,
    line: Vec<u8>,
    /// Number of the current line, from 1.
    pub number: u64,
}

impl Lines<BufReader<File>> {
    /// Opens the file that the `field` of the scene names.
    ///
    /// # Errors
    /// [`RunError::SceneFile`].
    pub fn open(path: &Path, field: &'static str) -> Result<Self, RunError> {
        let file = open_regular(path).map_err(|source| RunError::SceneFile { field, path: path.into(), source })?;
        Ok(Self::new(path, BufReader::new(file)))
    }
}

impl<R: BufRead> Lines<R> {
    /// The lines of `inner`, which came from the file `path`.
    pub fn new(path: &Path, inner: R) -> Self {
        Self { path: path.into(), inner, line: vec![], number: 0 }
    }

    /// Reads the next line; returns false at the end of the file.
    ///
    /// # Errors
    /// [`RunError::File`]; [`RunError::Sample`] for a line that is too long.
    pub fn next(&mut self) -> Result<bool, RunError> {
        loop {
            self.line.clear();
            let most = LONGEST_LINE as u64 + 1;
            self.inner.by_ref().take(most).read_until(b'\n', &mut self.line).map_err(|error| RunError::File {
                path: self.path.clone(),
                doing: "cannot be read",
                source: error.into(),
            })?;
            if self.line.is_empty() {
                return Ok(false);
            }
            self.number += 1;
            if self.line.len() > LONGEST_LINE {
                let (name, number) = (self.path.display(), self.number);
                return Err(RunError::Sample(vec![format!(
                    "{name}, line {number}: it has more than {LONGEST_LINE} bytes: write one row of the table per line"
                )]));
            }
            if self.number == 1 && self.line.starts_with("\u{feff}".as_bytes()) {
                self.line.drain(..3);
            }
            let text = self.line.trim_ascii();
            if !text.is_empty() && text[0] != b'#' {
                return Ok(true);
            }
        }
    }

    /// The fields of the current line, without enclosing quotes.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn fields(&self) -> Result<impl Iterator<Item = &str>, String> {
        let text = std::str::from_utf8(&self.line).map_err(|_| "it is not UTF-8 text".to_string())?;
        Ok(text.split(',').map(|field| field.trim().trim_matches('"')))
    }

    /// The fields of the current line, as many as the header has.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn row(&self, columns: usize) -> Result<Vec<&str>, String> {
        let fields: Vec<&str> = self.fields()?.collect();
        if fields.len() != columns {
            let values = if fields.len() == 1 { "value" } else { "values" };
            return Err(format!("it has {} {values}, the header has {columns}", fields.len()));
        }
        Ok(fields)
    }
}

/// The errors of a file.
pub struct Wrong {
    name: String,
    told: Vec<String>,
    count: usize,
}

impl Wrong {
    /// No errors yet.
    pub fn of(path: &Path) -> Self {
        Self { name: path.display().to_string(), told: vec![], count: 0 }
    }

    /// Adds an error of a line.
    pub fn tell(&mut self, line: u64, what: String) {
        self.count += 1;
        if self.told.len() < MOST_TOLD {
            self.told.push(format!("{}, line {line}: {what}", self.name));
        }
    }

    /// Returns the errors found so far, if any.
    ///
    /// # Errors
    /// [`RunError::Sample`].
    pub fn end(&mut self) -> Result<(), RunError> {
        if self.count == 0 {
            return Ok(());
        }
        let more = self.count - self.told.len();
        if more > 0 {
            self.told.push(format!("{}: {more} more lines are wrong", self.name));
        }
        Err(RunError::Sample(std::mem::take(&mut self.told)))
    }
}
