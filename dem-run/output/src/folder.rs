//! The results folder of a command.

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Result, WriteError};
use crate::owner::{Owner, Source};
use crate::replace::{self, remove_orphans, replace};

/// A picture, as SVG and as PNG.
pub trait Picture {
    /// The picture as SVG.
    fn svg(&self) -> String;

    /// The picture as PNG.
    ///
    /// # Errors
    /// A message, where the picture cannot be drawn.
    fn png(&self) -> std::result::Result<Vec<u8>, String>;

    /// The picture at a size on paper.
    ///
    /// # Errors
    /// A message, where the picture cannot be drawn.
    fn printed(&self, print: Print) -> std::result::Result<Printed, String>;
}

/// A size on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Print {
    /// Width, m.
    pub width: f64,
    /// Pixels of a PNG in a metre.
    pub dots: f64,
}

impl Print {
    /// Size of the smallest letters that are read without effort, and that journals ask for, in
    /// points.
    pub const LETTERS: f64 = 7.0;
}

/// A picture at a size on paper.
#[derive(Clone, Debug)]
pub struct Printed {
    /// As SVG.
    pub svg: String,
    /// As PNG.
    pub png: Vec<u8>,
    /// Size of its smallest letters, in points.
    pub letters: f64,
}

/// The results folder of a command, and the files written to it. Every file is replaced atomically.
pub struct Folder {
    path: PathBuf,
    written: Vec<PathBuf>,
    owner: Option<Owner>,
    print: Option<Print>,
    small: Vec<(String, f64)>,
}

impl Folder {
    /// Creates the folder if it does not exist.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn create(path: PathBuf) -> Result<Self> {
        fs::create_dir_all(&path).map_err(|error| WriteError { path: path.clone(), why: error.to_string() })?;
        remove_orphans(&path, None);
        Ok(Self { path, written: vec![], owner: None, print: None, small: vec![] })
    }

    /// As [`Folder::create`], for the results that `command` makes of `sources`. A folder with
    /// results of other sources is rejected; a record in the folder lists the files. With `force`
    /// the command takes over the folder and removes results of other sources.
    ///
    /// # Errors
    /// [`WriteError`], also where the folder belongs to other sources; later also for an existing
    /// file that is not in the record.
    pub fn of(path: PathBuf, command: &str, sources: Vec<Source>, force: bool) -> Result<Self> {
        let mut folder = Self::create(path)?;
        let owner = Owner::claim(&folder.path, command, sources, force);
        folder.owner = Some(owner.map_err(|why| WriteError { path: folder.path.clone(), why })?);
        Ok(folder)
    }

    /// Files of other sources that were removed when the command took over the folder.
    pub fn removed(&self) -> usize {
        self.owner.as_ref().map_or(0, Owner::removed)
    }

    /// Removes files of an earlier call of the command that this call did not write. Must be called
    /// last.
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

    /// The size on paper of the pictures, if one was asked for.
    pub fn print(&self) -> Option<Print> {
        self.print
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes a file with `make`, whose argument is the path of a temporary file beside the final
    /// one.
    ///
    /// # Errors
    /// [`WriteError`], and those of `make`; an existing file then stays.
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

    /// Records the names of many files before they are written, in one write of the record.
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

    /// The path of a file, once its name is recorded.
    fn place(&self, name: &str) -> Result<PathBuf> {
        self.announce(&[name.to_string()])?;
        Ok(self.path.join(name))
    }

    /// Sets the size of the pictures on paper.
    pub fn print_at(&mut self, print: Print) {
        self.print = Some(print);
    }

    /// Pictures whose letters are smaller than [`Print::LETTERS`] at the size on paper, and the
    /// size of the letters in points.
    pub fn small(&self) -> &[(String, f64)] {
        &self.small
    }

    /// Writes `NAME.svg` and `NAME.png`.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn draw(&mut self, name: &str, picture: &impl Picture) -> Result<()> {
        let file = format!("{name}.png");
        let failed = |why| WriteError { path: self.path.join(&file), why };
        let (svg, png) = match self.print {
            Some(print) => {
                let printed = picture.printed(print).map_err(failed)?;
                // to the digits that are told
                if printed.letters < Print::LETTERS - 0.05 {
                    self.small.push((name.into(), printed.letters));
                }
                (printed.svg, printed.png)
            }
            None => (picture.svg(), picture.png().map_err(failed)?),
        };
        self.write(&format!("{name}.svg"), svg.as_bytes())?;
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

/// `<stem of the input><suffix>` in the current folder, as `compression-post` for
/// `runs/compression.h5`.
#[must_use]
pub fn default_folder(input: &Path, suffix: &str) -> PathBuf {
    let mut name = input.file_stem().unwrap_or_default().to_os_string();
    name.push(suffix);
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_named_after_its_input() {
        assert_eq!(default_folder(Path::new("runs/compression.h5"), "-post"), Path::new("compression-post"));
    }
}
