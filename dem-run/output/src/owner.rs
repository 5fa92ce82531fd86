//! Ownership of a results folder. A record in the folder names its histories and the files made
//! from them, so that the results of two runs never mix.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::replace::write;

/// The name of the record.
const RECORD: &str = ".dem-post.json";

/// A source of results, as a history.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// Its absolute path.
    path: PathBuf,
    /// A description of its run that does not change while the run continues; none for a source of
    /// several runs.
    run: Option<String>,
}

impl Source {
    /// An existing file or folder.
    pub fn new(path: &Path, run: Option<String>) -> Self {
        // the text of a path that is not Unicode does not open the file, but it can be compared
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.into()).to_string_lossy().into_owned().into();
        Self { path, run }
    }

    /// Whether both are the same run at the same path, or `other` is `self` after a move.
    fn is(&self, other: &Self) -> bool {
        self.run == other.run && (self.path == other.path || (self.run.is_some() && !self.path.exists()))
    }
}

/// Content of the record.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Record {
    /// The sources of all results.
    sources: Vec<Source>,
    /// The files of each command.
    files: BTreeMap<String, BTreeSet<String>>,
}

impl Record {
    /// The record of a folder, if any.
    fn read(folder: &Path) -> Result<Option<Self>, String> {
        match fs::read(folder.join(RECORD)) {
            Ok(text) => serde_json::from_slice(&text).map(Some).map_err(|error| format!("{RECORD} in it: {error}")),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(format!("{RECORD} in it: {error}")),
        }
    }

    fn save(&self, folder: &Path) -> Result<(), String> {
        let text = serde_json::to_vec_pretty(self).map_err(|error| error.to_string())?;
        write(&folder.join(RECORD), &text).map_err(|error| format!("{RECORD} in it: {error}"))
    }

    /// The files of all commands but `command`.
    fn others<'a>(&'a self, command: &'a str) -> impl Iterator<Item = &'a String> {
        self.files.iter().filter(move |(other, _)| *other != command).flat_map(|(_, files)| files)
    }
}

/// A command that writes the results of its sources into a folder.
#[derive(Debug)]
pub struct Owner {
    folder: PathBuf,
    command: String,
    sources: Vec<Source>,
    /// Whether existing files that are not in the record are replaced.
    force: bool,
    /// Removed files of other sources.
    removed: usize,
}

impl Owner {
    /// Claims the folder, which must exist, for the results that `command` makes of `sources`. With
    /// `force` it removes the files that the record lists for other sources; other files stay.
    ///
    /// # Errors
    /// A message, where the folder belongs to other sources, or the record cannot be read or
    /// written.
    pub fn claim(folder: &Path, command: &str, sources: Vec<Source>, force: bool) -> Result<Self, String> {
        let mut owner = Self { folder: folder.into(), command: command.into(), sources, force, removed: 0 };
        let _lock = owner.lock();
        let record = match Record::read(folder) {
            Err(_) if force => None,
            read => {
                read.map_err(|why| format!("{why}; choose another folder with -o DIR, or start anew with --force"))?
            }
        };
        let mut record = record.unwrap_or_else(|| Record { sources: owner.sources.clone(), ..Record::default() });
        let same = record.sources.len() == owner.sources.len()
            && record.sources.iter().zip(&owner.sources).all(|(before, now)| before.is(now));
        if !same {
            if !force {
                return Err(refusal(&record.sources, &owner.sources));
            }
            let listed: BTreeSet<String> = record.files.into_values().flatten().collect();
            owner.removed = listed.iter().filter(|name| owner.remove(name)).count();
            record.files = BTreeMap::new();
        }
        // the record keeps the new path of a history that was moved
        record.sources.clone_from(&owner.sources);
        record.save(folder)?;
        Ok(owner)
    }

    /// Files of other sources that were removed.
    #[must_use]
    pub fn removed(&self) -> usize {
        self.removed
    }

    /// Records files that the command is about to write.
    ///
    /// # Errors
    /// A message, with the name of the file where it exists and no command has written it, or where
    /// it is one of the sources; without a name where another command has taken over the folder.
    pub fn register(&self, names: &[String]) -> Result<(), (Option<String>, String)> {
        let _lock = self.lock();
        let unnamed = |why| (None, why);
        let mut record = self.current().map_err(unnamed)?;
        let mut news = false;
        for name in names {
            let refuse = |why: &str| Err((Some(name.clone()), why.to_string()));
            if self.is_source(name) {
                return refuse("it is an input of the results: choose another folder with -o DIR");
            }
            let listed = record.files.values().any(|files| files.contains(name));
            if !listed && !self.force && self.folder.join(name).exists() {
                return refuse(
                    "it exists and is not listed in the record of the folder: choose another folder with -o DIR, or replace it \
                     with --force",
                );
            }
            news |= record.files.entry(self.command.clone()).or_default().insert(name.clone());
        }
        if news { record.save(&self.folder).map_err(unnamed) } else { Ok(()) }
    }

    /// Removes the files of an earlier call of the command that are not in `written`.
    ///
    /// # Errors
    /// A message, where the record cannot be read or written.
    pub fn finish(&self, written: &[PathBuf]) -> Result<(), String> {
        let _lock = self.lock();
        let mut record = self.current()?;
        let written: BTreeSet<String> =
            written.iter().filter_map(|path| Some(path.file_name()?.to_str()?.to_string())).collect();
        let listed = record.files.insert(self.command.clone(), written.clone()).unwrap_or_default();
        if listed == written {
            return Ok(());
        }
        let others: BTreeSet<&String> = record.others(&self.command).collect();
        for name in listed.difference(&written).filter(|name| !others.contains(name)) {
            self.remove(name);
        }
        record.save(&self.folder)
    }

    /// The record, if it still lists these sources.
    fn current(&self) -> Result<Record, String> {
        match Record::read(&self.folder)? {
            Some(record) if record.sources == self.sources => Ok(record),
            _ => Err("another command has taken over the folder in the meantime".into()),
        }
    }

    /// Locks the record against other processes until the file is dropped. Without effect on file
    /// systems without locks on folders.
    fn lock(&self) -> Option<File> {
        File::open(&self.folder).ok().filter(|folder| folder.lock().is_ok())
    }

    fn is_source(&self, name: &str) -> bool {
        fs::canonicalize(self.folder.join(name)).is_ok_and(|path| self.sources.iter().any(|source| source.path == path))
    }

    /// Removes a file of the folder; ignores a name that leads out of the folder.
    fn remove(&self, name: &str) -> bool {
        let inside = Path::new(name).file_name().is_some_and(|file| file == name);
        inside && !self.is_source(name) && fs::remove_file(self.folder.join(name)).is_ok()
    }
}

/// The reason why a folder with results of `before` rejects results of `now`.
fn refusal(before: &[Source], now: &[Source]) -> String {
    let name = |sources: &[Source]| {
        sources.iter().map(|source| source.path.display().to_string()).collect::<Vec<_>>().join(" and ")
    };
    let [before, now] = [name(before), name(now)];
    let held = if before == now {
        format!("an earlier run in {now}, which has been made anew")
    } else {
        format!("{before}, not of {now}")
    };
    format!("it holds results of {held}: choose another folder with -o DIR, or remove those results with --force")
}
