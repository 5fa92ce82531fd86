//! Samples as CSV tables: reads the grains of a scene, writes those of a run.

use crate::error::RunError;
use crate::output::replace;
use crate::prepare::Ball;
use crate::scene::{LARGEST, MAX_GRAINS, open_regular, shorten};
use dem_core::dim::{Dim, Vect};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Maximum number of wrong lines that are reported individually.
const MOST_TOLD: usize = 20;
/// Maximum length of a line (bytes), so that a file without line breaks is not read into memory.
const LONGEST_LINE: usize = 4096;

fn header<D: Dim>() -> &'static [&'static str] {
    if D::N == 2 { &["x", "y", "radius"] } else { &["x", "y", "z", "radius"] }
}

/// Number of grains in a sample file, without parsing them: lines except the header, empty lines
/// and comments.
///
/// # Errors
/// [`RunError::SampleFile`], [`RunError::File`], [`RunError::Sample`].
pub fn count(path: &Path) -> Result<usize, RunError> {
    let mut lines = Lines::open(path)?;
    let mut count = 0_usize;
    while lines.next()? {
        count += 1;
    }
    Ok(count.saturating_sub(1))
}

/// The grains of a CSV file with the header `x,y,radius` or `x,y,z,radius` (m).
///
/// # Errors
/// [`RunError::SampleFile`] and [`RunError::File`] for a file that cannot be read,
/// [`RunError::Sample`] with all wrong lines.
pub fn read<D: Dim>(path: &Path) -> Result<Vec<Ball<D>>, RunError> {
    parse::<D, _>(Lines::open(path)?)
}

/// As [`read`], from text that was read from the file `path`.
///
/// # Errors
/// [`RunError::Sample`] with all wrong lines.
pub fn read_text<D: Dim>(path: &Path, text: &str) -> Result<Vec<Ball<D>>, RunError> {
    parse::<D, _>(Lines::new(path, text.as_bytes()))
}

fn parse<D: Dim, R: BufRead>(mut lines: Lines<R>) -> Result<Vec<Ball<D>>, RunError> {
    let mut wrong = Wrong { name: lines.path.display().to_string(), told: vec![], count: 0 };
    let header = header::<D>().join(",");
    lines.next()?;
    match lines.fields().map(|fields| fields.collect::<Vec<_>>().join(",")) {
        Ok(found) if found == header => {}
        Ok(found) => {
            let commas = if found.contains([';', '\t']) { ", between commas" } else { "" };
            let found = shorten(&found);
            wrong.tell(lines.number.max(1), format!("the header is {found}, it must be {header}{commas}"));
        }
        Err(what) => wrong.tell(lines.number, what),
    }
    // below a wrong header, lines cannot be checked
    wrong.end()?;
    let mut balls = Vec::new();
    while lines.next()? {
        match lines.fields().and_then(|fields| ball::<D>(&fields.collect::<Vec<_>>())) {
            Ok(ball) => balls.push(ball),
            Err(what) => wrong.tell(lines.number, what),
        }
        if balls.len() > MAX_GRAINS {
            wrong.tell(lines.number, format!("there are more than {MAX_GRAINS} grains"));
            break;
        }
    }
    wrong.end()?;
    if balls.is_empty() {
        wrong.tell(lines.number, "there are no grains in the file".into());
    }
    wrong.end()?;
    Ok(balls)
}

/// The grain of a line, or the error of the line.
fn ball<D: Dim>(fields: &[&str]) -> Result<Ball<D>, String> {
    let header = header::<D>();
    if fields.len() != header.len() {
        let values = if fields.len() == 1 { "value" } else { "values" };
        return Err(format!("it has {} {values}, the header has {}", fields.len(), header.len()));
    }
    let mut numbers = [0.0; 4];
    let mut wrong = vec![];
    for (k, (field, name)) in fields.iter().zip(header).enumerate() {
        match field.parse::<f64>() {
            Ok(x) if x.abs() <= LARGEST => numbers[k] = x,
            _ => wrong.push(format!("{name} is {:?}, it must be a finite number (m)", shorten(field))),
        }
    }
    let radius = numbers[D::N];
    if wrong.is_empty() && radius < 1.0 / LARGEST {
        wrong.push(format!("radius is {radius:?}, it must be above zero"));
    }
    if wrong.is_empty() { Ok((D::Vector::from_slice(&numbers[..D::N]), radius)) } else { Err(wrong.join("; ")) }
}

/// The lines of a table that are neither empty nor a comment.
struct Lines<R> {
    path: PathBuf,
    inner: R,
    line: Vec<u8>,
    /// Number of the current line, from 1.
    number: u64,
}

impl Lines<BufReader<File>> {
    fn open(path: &Path) -> Result<Self, RunError> {
        let file = open_regular(path).map_err(|source| RunError::SampleFile { path: path.into(), source })?;
        Ok(Self::new(path, BufReader::new(file)))
    }
}

impl<R: BufRead> Lines<R> {
    fn new(path: &Path, inner: R) -> Self {
        Self { path: path.into(), inner, line: vec![], number: 0 }
    }

    /// Reads the next line; returns false at the end of the file.
    fn next(&mut self) -> Result<bool, RunError> {
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
                    "{name}, line {number}: it has more than {LONGEST_LINE} bytes: write one grain per line"
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
    fn fields(&self) -> Result<impl Iterator<Item = &str>, String> {
        let text = std::str::from_utf8(&self.line).map_err(|_| "it is not UTF-8 text".to_string())?;
        Ok(text.split(',').map(|field| field.trim().trim_matches('"')))
    }
}

/// The errors of a file.
struct Wrong {
    name: String,
    told: Vec<String>,
    count: usize,
}

impl Wrong {
    fn tell(&mut self, line: u64, what: String) {
        self.count += 1;
        if self.told.len() < MOST_TOLD {
            self.told.push(format!("{}, line {line}: {what}", self.name));
        }
    }

    /// Returns the errors found so far, if any.
    fn end(&mut self) -> Result<(), RunError> {
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

/// Writes the grains to a CSV file that [`read`] reads back bit for bit. An old file stays until
/// the new one is complete.
///
/// # Errors
/// [`RunError::File`]: a file that cannot be written.
pub fn write<D: Dim>(balls: impl IntoIterator<Item = Ball<D>>, path: &Path) -> Result<(), RunError> {
    let mut content = Vec::new();
    write_to::<D>(balls, &mut content)?;
    // a device cannot be replaced
    let written = match path.exists() && !path.is_file() {
        true => std::fs::write(path, &content),
        false => replace::write(path, &content),
    };
    written.map_err(|error| RunError::File { path: path.into(), doing: "cannot be written", source: error.into() })
}

/// As [`write()`], to `out`.
///
/// # Errors
/// `out` cannot be written.
pub fn write_to<D: Dim>(balls: impl IntoIterator<Item = Ball<D>>, out: impl Write) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(header::<D>())?;
    for (x, r) in balls {
        writer.write_record(x.as_slice().iter().chain([&r]).map(f64::to_string))?;
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem_core::dim::{D2, D3};

    fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sample.csv");
        std::fs::write(&path, text).expect("write");
        (folder, path)
    }

    fn refused(text: &str) -> Vec<String> {
        let (_folder, path) = file(text);
        let Err(RunError::Sample(told)) = read::<D2>(&path) else { panic!("not refused: {text}") };
        told
    }

    #[test]
    fn all_wrong_lines_are_told_at_once() {
        let told = refused("x,y,radius\n0,0,1\n0,nan,1\n1,x,-1\n2,0\n3,0,-1\n# 4\n5,0,0\n6,0,1e-70\n");
        let lines = [3, 4, 5, 6, 8, 9].map(|line| format!("line {line}: "));
        assert_eq!(told.len(), lines.len(), "{told:?}");
        assert!(told.iter().zip(lines).all(|(told, line)| told.contains(&line)), "{told:?}");
        let many = refused(&format!("x,y,radius\n{}", "0,0,-1\n".repeat(100)));
        assert_eq!((many.len(), many[MOST_TOLD].ends_with("80 more lines are wrong")), (MOST_TOLD + 1, true));
    }

    #[test]
    fn a_header_says_what_it_should_be_and_a_line_has_an_end() {
        assert!(refused("x;y;radius\n0;0;1\n")[0].ends_with("it must be x,y,radius, between commas"));
        assert!(refused("")[0].contains("the header is , it must be x,y,radius"));
        assert!(refused("x,y,radius\n")[0].contains("no grains"));
        for text in ["0".repeat(100_000), format!("x,y,radius\n{}", "0".repeat(100_000))] {
            let told = refused(&text);
            assert!(told[0].contains("it has more than 4096 bytes"), "{told:?}");
        }
    }

    #[test]
    fn lines_are_counted_as_they_are_read() {
        for text in [
            "x,y,z,radius\n# two grains\n0,0,0,1\n\n2,0,0,1",
            "\u{feff}\"x\", \"y\",\"z\",\"radius\"\r\n0, 0,0,1\r\n2,0,0,1\r\n",
        ] {
            let (_folder, path) = file(text);
            assert_eq!((count(&path).expect("count"), read::<D3>(&path).expect("grains").len()), (2, 2));
        }
    }
}
