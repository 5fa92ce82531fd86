//! Where results go: tables on stdout, files in one folder.

use std::borrow::Cow;
use std::fmt::Display;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::owner::Owner;
pub use crate::owner::Source;
use crate::plot::Drawing;
use crate::replace::{self, remove_orphans, replace};

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

/// The folder that takes the files of a command, and what has been written there. Every file comes into its place whole.
pub struct Folder {
    path: PathBuf,
    written: Vec<PathBuf>,
    owner: Option<Owner>,
}

impl Folder {
    /// Creates the folder if it is not there.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn create(path: PathBuf) -> Result<Self> {
        fs::create_dir_all(&path).map_err(|error| WriteError { path: path.clone(), why: error.to_string() })?;
        remove_orphans(&path, None);
        Ok(Self { path, written: vec![], owner: None })
    }

    /// As [`Folder::create`], for what `command` makes of `sources`: the folder takes results of no others, and a record
    /// in it says which files are theirs. With `force` the folder is taken over, and what others wrote is removed.
    ///
    /// # Errors
    /// [`WriteError`], also where the folder belongs to others, and later for a file that is in no record.
    pub fn of(path: PathBuf, command: &str, sources: Vec<Source>, force: bool) -> Result<Self> {
        let mut folder = Self::create(path)?;
        let owner = Owner::claim(&folder.path, command, sources, force);
        folder.owner = Some(owner.map_err(|why| WriteError { path: folder.path.clone(), why })?);
        Ok(folder)
    }

    /// Files of others that were removed when the folder was taken over.
    pub fn removed(&self) -> usize {
        self.owner.as_ref().map_or(0, Owner::removed)
    }

    /// Removes what an earlier call of the command wrote and this one did not: the last thing to do.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn finish(&self) -> Result<()> {
        let finished = self.owner.as_ref().map_or(Ok(()), |owner| owner.finish(&self.written));
        finished.map_err(|why| WriteError { path: self.path.clone(), why })
    }

    /// The files written so far.
    pub fn written(&self) -> &[PathBuf] {
        &self.written
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file by `make`, which is given the name under which it is made, beside its place.
    ///
    /// # Errors
    /// [`WriteError`], and those of `make`; what stood in its place then stands.
    pub fn make<T, E: From<WriteError>>(
        &mut self,
        name: &str,
        make: impl FnOnce(&Path) -> std::result::Result<T, E>,
    ) -> std::result::Result<T, E> {
        let path = self.place(name)?;
        let failed = |_, error: std::io::Error| WriteError { path: path.clone(), why: error.to_string() }.into();
        let made = replace(&path, failed, make)?;
        self.written.push(path);
        Ok(made)
    }

    /// Writes a file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&mut self, name: &str, content: &[u8]) -> Result<()> {
        let path = self.place(name)?;
        replace::write(&path, content).map_err(|error| WriteError { path: path.clone(), why: error.to_string() })?;
        self.written.push(path);
        Ok(())
    }

    /// Puts down the names of many files that will be written: one by one each would write the record anew.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn announce(&self, names: &[String]) -> Result<()> {
        let registered = self.owner.as_ref().map_or(Ok(()), |owner| owner.register(names));
        registered.map_err(|(name, why)| {
            let path = name.map_or_else(|| self.path.clone(), |name| self.path.join(name));
            WriteError { path, why }
        })
    }

    /// The path of a file that may be written.
    fn place(&self, name: &str) -> Result<PathBuf> {
        self.announce(&[name.to_string()])?;
        Ok(self.path.join(name))
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

/// A text in which a terminal obeys nothing but the ends of lines: other control characters are written as JSON escapes
/// them, as in `\u001b`. In JSON they stand only within texts, so its meaning stays.
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

/// A size as a person reads it.
#[must_use]
pub fn size(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
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
    fn sizes_are_short() {
        assert_eq!(
            (size(5_000), size(63_400_000), size(2_500_000_000)),
            ("5 kB".into(), "63.4 MB".into(), "2.5 GB".into())
        );
    }

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(escaped("\u{1b}[31mred\u{7}\r\nµ\t\u{9b}"), "\\u001b[31mred\\u0007\\u000d\nµ\\u0009\\u009b");
        let json = format!("{:#}", serde_json::json!({ "wall": "\u{1b}\u{9b}2J" }));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped(&json)).unwrap()["wall"], "\u{1b}\u{9b}2J");
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
