//! `dem-run new`: the shipped scenes, from which one's own scene starts.

use std::path::{Path, PathBuf};

use crate::destination::writable;
use crate::error::RunError;
use crate::output::{facts, in_shell, print_line, replace};
use crate::scene::from_text;

/// The names of the scenes in `configs/` and their texts.
macro_rules! scenes {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../configs/", $name, ".json")))),*]
    };
}

/// The shipped scenes, by name, with their texts.
pub const SCENES: &[(&str, &str)] = scenes![
    "bending",
    "bending-elastic",
    "bending-force",
    "bending-polydisperse",
    "bent-arm",
    "biaxial",
    "brazilian-2d",
    "brazilian-3d",
    "column",
    "column-collapse-3d",
    "compression",
    "cylinder-compression",
    "direct-tension",
    "incline",
    "membrane-biaxial",
    "notched-beam",
    "pull-off",
    "punch",
    "shear-box",
    "staged-biaxial",
    "triaxial",
    "two-grains",
    "uniaxial-scatter",
];

/// Options of `dem-run new`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewOptions {
    /// Name of the scene; without it, all are listed.
    pub name: Option<String>,
    /// The file to write; by default the name with `.json`, in the current folder.
    pub output: Option<PathBuf>,
    /// Whether a file that exists is overwritten.
    pub overwrite: bool,
}

/// Writes a shipped scene to a file, or lists all.
///
/// # Errors
/// [`RunError`]: an unknown name, or a file that cannot be written.
pub fn new(options: &NewOptions) -> Result<(), RunError> {
    let Some(name) = &options.name else { return Ok(print_line(&list())?) };
    let Some((_, text)) = SCENES.iter().find(|(known, _)| known == name) else {
        let names: Vec<&str> = SCENES.iter().map(|(known, _)| *known).collect();
        return Err(RunError::Usage(format!("no scene is called \"{name}\"; there are {}", names.join(", "))));
    };
    let path = options.output.clone().unwrap_or_else(|| Path::new(name).with_extension("json"));
    writable(&path, "-o FILE.json", options.overwrite)?;
    replace::write(&path, start(text).as_bytes()).map_err(|error| RunError::File {
        path: path.clone(),
        doing: "cannot be written",
        source: error.into(),
    })?;
    Ok(print_line(&format!("{} written\nrun it with\n  dem-run run {}", path.display(), in_shell(&path)))?)
}

/// The text of a scene outside `configs/`: without the path of the schema, which leads from there,
/// and with commands for the folder of the file.
fn start(text: &str) -> String {
    let lines = text.split_inclusive('\n').filter(|line| !line.trim_start().starts_with("\"$schema\""));
    lines.collect::<String>().replace("configs/", "")
}

/// Names and titles of all scenes.
fn list() -> String {
    let title = |text: &str| from_text("a shipped scene", text, &[]).ok().and_then(|scene| scene.title);
    let lines: Vec<(&str, String)> =
        SCENES.iter().map(|(name, text)| (*name, title(text).unwrap_or_default())).collect();
    format!("{}\nwrite one with\n  dem-run new NAME", facts(&lines).trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_of_configs_is_shipped_and_reads_the_same_without_its_schema() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
        let mut names: Vec<String> = std::fs::read_dir(&folder)
            .expect("configs")
            .map(|entry| entry.expect("entry").path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
            .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
            // sweeps are no scenes
            .filter(|name| !name.starts_with("sweep-"))
            .collect();
        names.sort();
        let shipped: Vec<&str> = SCENES.iter().map(|(name, _)| *name).collect();
        assert_eq!(shipped, names);
        for (name, text) in SCENES {
            let file = std::fs::read_to_string(folder.join(name).with_extension("json")).expect("read");
            assert_eq!(*text, file);
            let read = |text: &str| from_text(name, text, &[]).unwrap_or_else(|error| panic!("{error}"));
            let (mut shipped, own) = (read(text), read(&start(text)));
            assert!(shipped.schema.take().is_some() && own.schema.is_none(), "{name}");
            assert_eq!(shipped, own);
            assert!(own.title.is_some(), "{name} has no title to list");
            assert!(!start(text).contains("configs/"), "{name}");
        }
    }
}
