//! The programs, a folder to run them in, and what they answered.

use assert_cmd::Command;
use dem_run::history::{History, Layout, Parameters, Series};
use serde_json::Value;
use std::collections::HashMap;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::sync::OnceLock;
use std::time::Duration;
use tempfile::TempDir;

/// The compression scene with 60 grains: it runs in half a second.
pub const SMALL: [&str; 8] = [
    "--set",
    "sample.random.count=60",
    "--set",
    "sample.random.width=0.014",
    "--set",
    "sample.random.preparation.compaction.solid_fraction=0.7",
    "--set",
    "walls.top.force_rate=100",
];

/// No command takes so long; one that hangs fails its test.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// The root of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace around this package").to_path_buf()
}

/// The path of a scene in `configs/`.
pub fn config(name: &str) -> String {
    root().join("configs").join(name).to_str().expect("UTF-8").to_string()
}

/// The folder of the collection of contact problems.
pub fn problems() -> PathBuf {
    root().join("tests/problems")
}

/// The path of a program. `scripts/test` says in which folder it built them. Cargo knows the
/// programs of a test's own package only, so it is asked to build them otherwise, in release, as
/// README does: the compression takes seconds there, and minutes in the profile of the tests.
pub fn program(name: &str) -> &'static Path {
    static PROGRAMS: OnceLock<HashMap<String, PathBuf>> = OnceLock::new();
    let programs = || match env::var_os("DEM_PROGRAMS") {
        Some(folder) => ["dem-run", "dem-post"].map(|p| (p.to_string(), Path::new(&folder).join(p))).into(),
        None => build(),
    };
    &PROGRAMS.get_or_init(programs)[name]
}

fn build() -> HashMap<String, PathBuf> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = std::process::Command::new(cargo)
        .args(["build", "--release", "--locked", "-p", "dem-run", "-p", "dem-post"])
        .arg("--message-format=json-render-diagnostics")
        .current_dir(root())
        .stderr(Stdio::inherit())
        .output()
        .expect("cargo");
    assert!(output.status.success(), "the programs cannot be built");
    let artifact = |line: &str| {
        let message: Value = serde_json::from_str(line).ok()?;
        let path = message["executable"].as_str()?;
        Some((message["target"]["name"].as_str()?.to_string(), PathBuf::from(path)))
    };
    String::from_utf8(output.stdout).expect("UTF-8").lines().filter_map(artifact).collect()
}

/// A folder that commands run in, gone at the end of its test.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder for temporary files"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("write");
    }

    pub fn history(&self, name: &str) -> History {
        History::open(&self.path(name)).expect("history")
    }

    /// The names of all that stands in the folder, sorted.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).expect("read the folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("entry").file_name().into_string().expect("UTF-8")).collect();
        names.sort();
        names
    }

    pub fn dem_run<S: AsRef<str>>(&self, args: &[S]) -> Outcome {
        self.command("dem-run", args)
    }

    pub fn dem_post<S: AsRef<str>>(&self, args: &[S]) -> Outcome {
        self.command("dem-post", args)
    }

    /// Run a scene of `configs/` with more arguments, and give its summary.
    pub fn run_config(&self, name: &str, args: &[&str]) -> Value {
        let scene = config(name);
        self.dem_run(&[&["run", &scene, "--json"], args].concat()).json()
    }

    fn command<S: AsRef<str>>(&self, program: &str, args: &[S]) -> Outcome {
        let args: Vec<&str> = args.iter().map(AsRef::as_ref).collect();
        let mut command = Command::new(self::program(program));
        let output = command.args(&args).current_dir(self.0.path()).timeout(PATIENCE).output().expect("start");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Outcome {
            command: format!("{program} {}", args.join(" ")),
            code: output.status.code(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
}

/// A number of a JSON answer.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// The arguments of these assignments.
pub fn sets<'a>(assignments: &[&'a str]) -> Vec<&'a str> {
    assignments.iter().flat_map(|assignment| ["--set", assignment]).collect()
}

/// Runs the scene in the file `scene` into `a.h5`, and gives its summary.
pub fn run(here: &Folder, scene: &str, args: &[&str]) -> Value {
    here.dem_run(&[&["run", scene, "-o", "a.h5", "--force", "--quiet", "--json"], args].concat()).json()
}

/// An observable of a history.
pub fn observable(history: &History, name: &str) -> Series {
    history.observable(name).expect("read").unwrap_or_else(|| panic!("no observable {name}"))
}

/// One component of an observable, step by step.
pub fn series(history: &History, name: &str, index: &[usize]) -> Vec<f64> {
    observable(history, name).component(index).unwrap_or_else(|| panic!("{name} has no {index:?}"))
}

/// Index of a wall.
pub fn wall(history: &History, name: &str) -> usize {
    let walls = history.walls().expect("walls");
    walls.iter().position(|wall| wall.name == name).unwrap_or_else(|| panic!("no wall {name}"))
}

/// All that a history holds, part by part, but its parameters and the processor time.
pub fn content(history: &History) -> Vec<String> {
    let shown = history.path().display();
    assert!(!history.open_ended(), "{shown}: not closed");
    let layout = history.layout().map(|layout| Layout { parameters: Parameters::default(), ..layout });
    let mut content = vec![
        format!("layout {layout:?}"),
        format!("rows {:?}", history.complete()),
        format!("frames {:?} {:?}", history.steps(), history.times()),
        format!("ruptures {:?}", history.ruptures()),
    ];
    for name in history.observable_names().expect("names").iter().filter(|name| *name != "cpu_time") {
        content.push(format!("{name} {:?}", history.observable(name)));
    }
    for frame in 0..history.frames() {
        content.push(format!("frame {frame}: grains {:?}", history.grain_state(frame)));
        content.push(format!("frame {frame}: walls {:?}", history.wall_state(frame)));
        content.push(format!("frame {frame}: contacts {:?}", history.contacts(frame)));
        content.push(format!("frame {frame}: bonds {:?}", history.bond_status(frame)));
    }
    assert!(content.iter().all(|part| !part.contains("Err(")), "{shown}: unreadable");
    content
}

/// A run that would go on for hours, killed when it is dropped.
pub struct Endless(Option<Child>);

impl Endless {
    /// Starts it, and waits until its history stands with so many frames.
    pub fn start(here: &Folder, file: &str, frames: usize) -> Self {
        let mut command = std::process::Command::new(program("dem-run"));
        command.args(["run", &config("column.json"), "-o", file, "--quiet"]);
        command.args(["--set", "time.end=1e4", "--set", "output.every_steps=10"]).current_dir(here.path(""));
        let endless = Self(Some(command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("start")));
        while !here.path(file).exists() || here.history(file).frames() < frames {
            std::thread::sleep(Duration::from_millis(5));
        }
        endless
    }

    /// The number of its process.
    pub fn id(&self) -> u32 {
        self.0.as_ref().expect("a process").id()
    }

    /// Waits for its end.
    pub fn end(mut self) -> Output {
        self.0.take().expect("a process").wait_with_output().expect("end")
    }
}

impl Drop for Endless {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            child.kill().expect("kill");
            child.wait().expect("end");
        }
    }
}

/// What a command answered.
pub struct Outcome {
    command: String,
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    /// It did its work.
    pub fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{}: {}", self.command, self.stderr);
        self
    }

    /// It did its work, and stdout is JSON.
    pub fn json(self) -> Value {
        let outcome = self.succeeds();
        serde_json::from_str(&outcome.stdout).unwrap_or_else(|error| panic!("{}: {error}", outcome.command))
    }

    /// It ended with this code, and stderr has these parts: the place and the remedy.
    pub fn fails(self, code: i32, parts: &[&str]) -> Self {
        let told = format!("{}\n{}", self.command, self.stderr);
        assert_eq!(self.code, Some(code), "{told}");
        for part in parts {
            assert!(self.stderr.contains(part), "{part:?} is not in the answer to {told}");
        }
        assert!(!self.stderr.contains("panicked"), "{told}");
        self
    }
}
