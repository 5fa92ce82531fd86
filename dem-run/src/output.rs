//! Where results go: tables on stdout, files in one folder.

use std::fmt::Display;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::plot::Drawing;
use crate::scene::printable;

/// A result that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {why}", .path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// Why not.
    pub why: String,
}

/// Whether something was written.
pub type Result<T> = std::result::Result<T, WriteError>;

/// The folder that takes the files of a command, and what has been written there.
pub struct Folder {
    path: PathBuf,
    written: Vec<PathBuf>,
}

impl Folder {
    /// Creates the folder if it is not there.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn create(path: PathBuf) -> Result<Self> {
        fs::create_dir_all(&path).map_err(|error| WriteError { path: path.clone(), why: error.to_string() })?;
        Ok(Self { path, written: vec![] })
    }

    /// The files written so far.
    pub fn written(&self) -> &[PathBuf] {
        &self.written
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of a file that another library writes; it counts as written.
    pub fn place(&mut self, name: &str) -> PathBuf {
        let path = self.path.join(name);
        self.written.push(path.clone());
        path
    }

    /// Writes a file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&mut self, name: &str, content: &[u8]) -> Result<()> {
        let path = self.path.join(name);
        fs::write(&path, content).map_err(|error| WriteError { path: path.clone(), why: error.to_string() })?;
        self.written.push(path);
        Ok(())
    }

    /// Writes `NAME.svg` and `NAME.png`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn draw(&mut self, name: &str, drawing: &Drawing) -> Result<()> {
        self.write(&format!("{name}.svg"), drawing.svg().as_bytes())?;
        let file = format!("{name}.png");
        let png = drawing.png().map_err(|why| WriteError { path: self.path.join(&file), why })?;
        self.write(&file, &png)
    }

    /// Writes `NAME.csv`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn table(&mut self, name: &str, head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Result<()> {
        let file = format!("{name}.csv");
        let failed = |why: String| WriteError { path: self.path.join(&file), why };
        let mut writer = csv::Writer::from_writer(vec![]);
        writer.write_record(head).map_err(|error| failed(error.to_string()))?;
        for row in rows {
            writer.write_record(row).map_err(|error| failed(error.to_string()))?;
        }
        let content = writer.into_inner().map_err(|error| failed(error.to_string()))?;
        self.write(&file, &content)
    }
}

/// `<stem of the input><suffix>` in the current folder, as `compression-post` for `runs/compression.h5`.
#[must_use]
pub fn default_folder(input: &Path, suffix: &str) -> PathBuf {
    let mut name = input.file_stem().unwrap_or_default().to_os_string();
    name.push(suffix);
    name.into()
}

/// A path as a shell takes it: between quotes where it has more than letters, digits and what names usually have.
#[must_use]
pub fn in_shell(path: &Path) -> String {
    let shown = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    if !shown.is_empty() && shown.chars().all(plain) { shown } else { format!("'{}'", shown.replace('\'', r"'\''")) }
}

/// A row of a CSV file from numbers and words.
#[macro_export]
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$($cell.to_string()),*] };
}

/// A table of text with right-aligned numbers.
#[derive(Default)]
pub struct Text {
    rows: Vec<Vec<String>>,
}

impl Text {
    /// A table with a head.
    pub fn new(head: &[&str]) -> Self {
        Self { rows: vec![head.iter().map(ToString::to_string).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The table as lines, the first column to the left, the others to the right.
    pub fn lines(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cell = |row: &[String], c: usize| row.get(c).cloned().unwrap_or_default();
        let width = |c: usize| self.rows.iter().map(|row| cell(row, c).chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let line = |row: &Vec<String>| {
            let mut line = String::new();
            for (c, &width) in widths.iter().enumerate() {
                let text = cell(row, c);
                match c {
                    0 => line += &format!("{text:<width$}"),
                    _ => line += &format!("  {text:>width$}"),
                }
            }
            line.trim_end().to_string() + "\n"
        };
        self.rows.iter().map(line).collect()
    }
}

/// A list of names and values, one a line.
pub fn facts(facts: &[(&str, String)]) -> String {
    let width = facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    facts.iter().map(|(name, value)| format!("{name:<width$}  {value}\n")).collect()
}

/// A text as a terminal may have it: blanks for control characters, which titles and file names may hold, but line breaks.
#[must_use]
pub fn plain(text: &str) -> String {
    text.chars().map(|c| if c == '\n' { c } else { printable(c) }).collect()
}

/// Prints results on stdout, as [`plain`] text. A reader that closes the pipe early is no error.
///
/// # Errors
/// [`WriteError`].
pub fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(plain(text).as_bytes()) {
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

/// Prints a result on stdout, for people or as JSON, as [`print()`].
///
/// # Errors
/// [`WriteError`].
pub fn print_result<T: Display + Serialize>(result: &T, json: bool) -> Result<()> {
    if json { print_json(&serde_json::json!(result)) } else { print_line(&result.to_string()) }
}

/// A number for people: four digits, and a power of ten where it is very large or small.
pub fn number(value: f64) -> String {
    digits(value, 4)
}

/// A number for captions: three digits.
pub fn short(value: f64) -> String {
    digits(value, 3)
}

fn digits(value: f64, digits: i32) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&magnitude) {
        return format!("{value:.*e}", digits as usize - 1);
    }
    let decimals = (digits - 1 - magnitude.log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A number with its unit, or a dash where there is none.
pub fn quantity(value: Option<impl Into<f64>>, unit: &str) -> String {
    value.map_or_else(|| "–".into(), |value| with_unit(number(value.into()), unit))
}

fn with_unit(number: impl Display, unit: &str) -> String {
    if unit.is_empty() { number.to_string() } else { format!("{number} {unit}") }
}

/// An optional number as a cell of a CSV file: empty where there is none.
pub fn cell(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_right() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (15.975, "15.97"),
            (-0.25, "-0.25"),
            (123456.0, "123456"),
            (1.5e-5, "1.500e-5"),
            (0.001234, "0.001234"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_table_is_aligned() {
        let mut text = Text::new(&["mode", "bonds"]);
        text.row(vec!["TENSION".into(), "7".into()]);
        assert_eq!(text.lines(), "mode     bonds\nTENSION      7\n");
    }

    #[test]
    fn a_path_is_quoted_where_a_shell_would_part_it() {
        for (path, text) in
            [("runs/µ=0.3.h5", "runs/µ=0.3.h5"), ("my run.h5", "'my run.h5'"), ("a'b.h5", r"'a'\''b.h5'")]
        {
            assert_eq!(in_shell(Path::new(path)), text);
        }
    }

    #[test]
    fn a_folder_is_named_after_its_input() {
        assert_eq!(default_folder(Path::new("runs/compression.h5"), "-post"), Path::new("compression-post"));
    }
}
