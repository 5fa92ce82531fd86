//! From a sweep file to the scenes of its runs. All scenes are checked before the first run.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::model::{Range, Spacing, Sweep, Values};
use crate::error::RunError;
use crate::output::hex;
use crate::scene::parse::{self, Document};
use crate::scene::{self, Base, Change, Origin, Problem, Scene, SceneError, shorten};

/// Maximum number of runs of a sweep: each run has its own files.
const MOST_RUNS: u64 = 100_000;

/// The runs of a sweep, in their order.
#[derive(Debug)]
pub struct Plan {
    /// The sweep file.
    pub sweep: PathBuf,
    /// The base scene of all runs.
    pub scene: PathBuf,
    /// The title of the sweep.
    pub title: Option<String>,
    /// The fields that are varied.
    pub fields: Vec<String>,
    /// The runs, no two of the same scene.
    pub runs: Vec<PlannedRun>,
    /// The index of the run with each digest.
    places: HashMap<String, usize>,
}

/// One run.
#[derive(Debug)]
pub struct PlannedRun {
    /// The values of the fields that are varied.
    pub values: BTreeMap<String, Value>,
    /// The scene with these values.
    pub scene: Scene,
    /// Digest of the scene: two scenes with the same digest give the same history.
    pub digest: String,
}

impl Plan {
    /// The run whose scene has this digest.
    #[must_use]
    pub fn run(&self, digest: &str) -> Option<&PlannedRun> {
        self.runs.get(*self.places.get(digest)?)
    }

    /// Reads a sweep file and the scene that it names, and sets the values of every run.
    ///
    /// # Errors
    /// [`RunError::Scene`] with all errors; [`RunError::Content`] for files that cannot be read.
    pub fn read(path: &Path) -> Result<Self, RunError> {
        let unreadable = |path: &Path, what, error: std::io::Error| {
            let source = error.into();
            RunError::Content { path: path.into(), what, source }
        };
        let text = scene::text(path).map_err(|error| match error.kind() {
            ErrorKind::InvalidData => RunError::Usage(format!("{}: the sweep cannot be read: {error}", path.display())),
            _ => unreadable(path, "the sweep", error),
        })?;
        let document = parse::parse(&path.display().to_string(), &text)?;
        if document.has("dimension") && !document.has("vary") {
            let allowed = "a sweep, { \"scene\": …, \"vary\": … }; run a scene with `dem-run run`";
            return Err(wrong(&document, vec![Problem::new("", "a scene", allowed)]));
        }
        let sweep: Sweep = document.decode().map_err(|problem| wrong(&document, vec![problem]))?;
        let problems = document.merge_non_finite(validate(&sweep));
        if !problems.is_empty() {
            return Err(wrong(&document, problems));
        }
        let scene = path.parent().unwrap_or(Path::new("")).join(&sweep.scene);
        let base = Base::read(&scene).map_err(|error| match error {
            // the user named only the sweep: the message says where the scene is named
            SceneError::Read { .. } => RunError::InputOutput(format!("{} names a scene: {error}", path.display())),
            error => error.into(),
        })?;
        let runs = runs(&sweep, &base, &scene).map_err(|problems| wrong(&document, problems))?;
        for run in &runs {
            for (path, what) in run.scene.files() {
                std::fs::metadata(path).map_err(|error| unreadable(path, what, error))?;
            }
        }
        let fields = sweep.vary.iter().flat_map(BTreeMap::keys).cloned().collect();
        let places = runs.iter().enumerate().map(|(k, run)| (run.digest.clone(), k)).collect();
        Ok(Self { sweep: path.to_path_buf(), scene, title: sweep.title, fields, runs, places })
    }
}

fn wrong(document: &Document, problems: Vec<Problem>) -> RunError {
    let named = |problem: Problem| {
        if problem.path.is_empty() { Problem { path: "the sweep".into(), ..problem } } else { problem }
    };
    document.wrong(problems.into_iter().map(named).collect()).into()
}

/// The errors of the sweep itself, independent of the scene.
fn validate(sweep: &Sweep) -> Vec<Problem> {
    let mut problems = vec![];
    if sweep.vary.is_empty() {
        problems.push(Problem::new(
            "vary",
            "an empty list",
            "at least one object, as in { \"bonds.strength\": [5, 10] }",
        ));
    }
    let mut count = Some(1u64);
    // every field with the place of its values
    let mut given: Vec<(&str, String)> = sweep.set.keys().map(|path| (path.as_str(), format!("set.{path}"))).collect();
    for (k, fields) in sweep.vary.iter().enumerate() {
        let place = format!("vary.{k}");
        if fields.is_empty() {
            problems.push(Problem::new(&place, "an empty object", "at least one field with its values"));
        }
        for (path, values) in fields {
            let here = format!("{place}.{path}");
            problems.extend(wrong_values(&here, values));
            if let Some((other, there)) = given.iter().find(|(other, _)| overlap(other, path)) {
                let found = format!("{other} also has values at {there}");
                problems.push(Problem::new(&here, found, "each field once, and not both a field and a part of it"));
            }
            given.push((path, here));
        }
        let lengths: Vec<(&String, u64)> = fields.iter().map(|(path, values)| (path, values.len())).collect();
        if lengths.iter().any(|(_, length)| *length != lengths[0].1) {
            let found: Vec<String> =
                lengths.iter().map(|(path, length)| format!("{path} has {length} values")).collect();
            let allowed = "the same number of values for each, since fields in one object vary together; one object per \
                           field combines each value with each";
            problems.push(Problem::new(place, found.join(", "), allowed));
        }
        count = lengths.first().and_then(|(_, length)| count?.checked_mul(*length));
    }
    if problems.is_empty() && count.is_none_or(|count| count > MOST_RUNS) {
        let found = count.map_or("far too many runs".into(), |count| format!("{count} runs"));
        problems.push(Problem::new("vary", found, format!("at most {MOST_RUNS} runs")));
    }
    problems
}

/// Whether two fields are the same, or one is part of the other.
fn overlap(a: &str, b: &str) -> bool {
    let part =
        |whole: &str, part: &str| part.strip_prefix(whole).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    part(a, b) || part(b, a)
}

fn wrong_values(place: &str, values: &Values) -> Option<Problem> {
    let wrong = |name: &str, found: String, allowed: &str| Some(Problem::new(format!("{place}{name}"), found, allowed));
    match values {
        Values::List(list) if list.is_empty() => wrong("", "an empty list".into(), "at least one value"),
        Values::Range(Range { count: 0, .. }) => wrong(".count", "0".into(), "a whole number, at least 1"),
        Values::Range(Range { count, .. }) if *count > MOST_RUNS => {
            wrong(".count", count.to_string(), "at most 100000, the most runs of a sweep")
        }
        Values::Range(Range { from, to: Some(to), count: 1, .. }) if from != to => {
            wrong(".count", "1, with two different ends".into(), "at least 2")
        }
        Values::Range(Range { from, to, spacing: Spacing::Geometric, .. }) => match to {
            None => wrong("", "a geometric range without an end".into(), "the last number as \"to\""),
            Some(to) if from * to <= 0.0 => {
                let found = format!("a geometric range from {from} to {to}");
                wrong("", found, "two numbers of the same sign, and not zero")
            }
            Some(_) => None,
        },
        _ => None,
    }
}

impl Values {
    fn len(&self) -> u64 {
        match self {
            Self::List(list) => list.len() as u64,
            Self::Range(range) => range.count,
        }
    }
}

/// The values that the fields of one object take together, run by run.
fn together(k: usize, fields: &BTreeMap<String, Values>) -> Vec<Vec<Change>> {
    let column = |(path, values): (&String, &Values)| -> Vec<Change> {
        let place = format!("vary.{k}.{path}");
        let change = |value: Value, place: String| Change { path: path.clone(), value, place };
        match values {
            Values::List(list) => {
                list.iter().enumerate().map(|(n, value)| change(value.clone(), format!("{place}.{n}"))).collect()
            }
            Values::Range(range) => range.numbers().into_iter().map(|value| change(value, place.clone())).collect(),
        }
    };
    let columns: Vec<Vec<Change>> = fields.iter().map(column).collect();
    let length = columns.first().map_or(0, Vec::len);
    (0..length).map(|n| columns.iter().map(|column| column[n].clone()).collect()).collect()
}

/// All runs, or all their errors.
fn runs(sweep: &Sweep, base: &Base, scene: &Path) -> Result<Vec<PlannedRun>, Vec<Problem>> {
    let set: Vec<Change> = (sweep.set.iter())
        .map(|(path, value)| Change { path: path.clone(), value: value.clone(), place: format!("set.{path}") })
        .collect();
    let groups: Vec<Vec<Vec<Change>>> = sweep.vary.iter().enumerate().map(|(k, fields)| together(k, fields)).collect();
    let mut combined: Vec<Vec<Change>> = vec![vec![]];
    for group in &groups {
        let joined = |first: &Vec<Change>| group.iter().map(|more| [&first[..], more].concat()).collect::<Vec<_>>();
        combined = combined.iter().flat_map(joined).collect();
    }
    let (mut runs, mut problems, mut told) = (vec![], vec![], HashSet::new());
    let mut samples = HashMap::new();
    for varied in combined {
        let changes = [&set[..], &varied].concat();
        let values: BTreeMap<String, Value> = varied.into_iter().map(|change| (change.path, change.value)).collect();
        match base.with(&changes) {
            Ok(scene) => {
                let digest = digest(&scene, &mut samples);
                runs.push(PlannedRun { values, scene, digest });
            }
            Err(wrong) => {
                for problem in wrong {
                    let (key, problem) = located(problem, &changes, scene, &values);
                    // a wrong value is reported once, not for every run
                    if told.insert(key) {
                        problems.push(problem);
                    }
                }
            }
        }
    }
    if problems.is_empty() {
        problems.extend(same_scene(&runs).or_else(|| load_unknown(&runs)));
    }
    if problems.is_empty() { Ok(runs) } else { Err(problems) }
}

/// Converts a problem of a run's scene to one of the sweep, with a key that identifies repetitions
/// in other runs.
fn located(
    problem: Problem,
    changes: &[Change],
    scene: &Path,
    values: &BTreeMap<String, Value>,
) -> ([String; 3], Problem) {
    let Problem { path, found, allowed, nearest, origin } = problem;
    if let Some(Origin::Sweep(place)) = origin {
        let place = String::from(place);
        let change = changes.iter().find(|change| change.place == place);
        // the problem is in a part of the value or in a parent of the field
        let found = if change.is_some_and(|change| change.path == path) { found } else { format!("{path}: {found}") };
        let key = [place.clone(), path, allowed.clone()];
        return (key, Problem::new(place, found, allowed).with_nearest(nearest));
    }
    let line = match origin {
        Some(Origin::Text { line, column }) => format!(", line {line}, column {column}"),
        _ => String::new(),
    };
    let shown = format!("{path} in {}{line}: {found}, with {}", scene.display(), describe(values));
    ([path, found, allowed.clone()], Problem::new("scene", shown, allowed).with_nearest(nearest))
}

/// The error that two runs have the same scene.
fn same_scene(runs: &[PlannedRun]) -> Option<Problem> {
    let mut first: HashMap<&str, &PlannedRun> = HashMap::new();
    runs.iter().find_map(|run| {
        let earlier = first.insert(&run.digest, run)?;
        let (a, b) = (describe(&earlier.values), describe(&run.values));
        let found = if a == b { format!("{a} twice") } else { format!("the same scene for {a} and for {b}") };
        Some(Problem::new("vary", found, "values that make every run different (a title does not)"))
    })
}

/// The error that a run has several driven walls and no load wall.
fn load_unknown(runs: &[PlannedRun]) -> Option<Problem> {
    let (run, names) = runs.iter().find_map(|run| Some((run, run.scene.load_unknown()?)))?;
    let found = format!("several driven walls, {names}, but no load wall, with {}", describe(&run.values));
    let allowed = "one of them as load_wall, in the scene or in the sweep: \"set\": { \"load_wall\": … }";
    Some(Problem::new("scene", found, allowed))
}

/// The values of a run on one line: `bonds.strength = 5, seed = 1`.
pub fn describe(values: &BTreeMap<String, Value>) -> String {
    values
        .iter()
        .map(|(path, value)| format!("{path} = {}", shorten(&value.to_string())))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The content of a sample file.
fn content(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = vec![];
    scene::open_regular(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// SHA-256 of all data that determine a scene's history: the scene without its title, and the
/// content of the files that it reads instead of their names.
fn digest(scene: &Scene, files: &mut HashMap<PathBuf, Vec<u8>>) -> String {
    let mut plain = Scene { schema: None, title: None, ..scene.clone() };
    let mut hash = Sha256::new();
    for file in plain.files_mut() {
        let path = std::mem::take(file);
        // a file that cannot be read is reported after all other errors
        hash.update(files.entry(path).or_insert_with_key(|path| content(path).unwrap_or_default()));
    }
    hash.update(plain.to_json().unwrap_or_default());
    hex(&hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/two-grains.json");

    fn plan(vary: &str) -> Result<Plan, RunError> {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sweep.json");
        std::fs::write(&path, format!(r#"{{ "scene": {CONFIG:?}, {vary} }}"#)).expect("write");
        Plan::read(&path)
    }

    fn strengths_and_seeds(plan: &Plan) -> Vec<(Option<f64>, u64)> {
        let of = |run: &PlannedRun| (run.scene.bonds.as_ref().and_then(|bonds| bonds.strength), run.scene.seed);
        plan.runs.iter().map(of).collect()
    }

    #[test]
    fn objects_are_multiplied_and_fields_of_one_go_together() {
        let product =
            plan(r#""vary": [{"bonds.strength": [5, 10]}, {"seed": {"from": 1, "count": 2}}]"#).expect("plan");
        assert_eq!(product.fields, ["bonds.strength", "seed"]);
        assert_eq!(strengths_and_seeds(&product), [(Some(5.0), 1), (Some(5.0), 2), (Some(10.0), 1), (Some(10.0), 2)]);
        let zipped = plan(r#""vary": [{"bonds.strength": [5, 10], "seed": [3, 4]}]"#).expect("plan");
        assert_eq!(strengths_and_seeds(&zipped), [(Some(5.0), 3), (Some(10.0), 4)]);
        assert_eq!(describe(&zipped.runs[1].values), "bonds.strength = 10, seed = 4");
        let set = plan(r#""set": {"seed": 9}, "vary": [{"time.end": [0.1]}]"#).expect("plan");
        assert_eq!((set.runs[0].scene.seed, set.runs[0].scene.time.end), (9, 0.1));
    }

    #[test]
    fn the_digest_is_of_what_the_history_depends_on() {
        let digests = |vary: &str| plan(vary).expect("plan").runs.into_iter().map(|run| run.digest).collect::<Vec<_>>();
        let a = digests(r#""vary": [{"seed": [1, 2]}]"#);
        assert_ne!(a[0], a[1]);
        // an explicit default or another title gives the same run
        assert_eq!(a, digests(r#""set": {"title": "another", "rupture": "cascade"}, "vary": [{"seed": [1, 2]}]"#));
        assert_ne!(a, digests(r#""set": {"thickness": 0.02}, "vary": [{"seed": [1, 2]}]"#));
    }

    #[test]
    fn wrong_sweeps_are_told_with_place_and_remedy() {
        for (text, parts) in [
            (r#""vary": []"#, &["vary (line 1", "an empty list", "at least one object"][..]),
            (r#""vary": [{}]"#, &["vary.0", "an empty object"]),
            (r#""vary": [{"seed": []}]"#, &["vary.0.seed (line 1", "an empty list", "at least one value"]),
            (r#""vary": [{"seed": 3}]"#, &["vary.0.seed", "found    3", "a list [ … ], or a range"]),
            (r#""vary": [{"seed": {"from": 1, "cuont": 2}}]"#, &["vary.0.seed.cuont", "nearest  count"]),
            (r#""vary": [{"seed": {"from": 1, "count": 0}}]"#, &["vary.0.seed.count", "at least 1"]),
            (r#""vary": [{"time.end": {"from": 0, "to": 1, "count": 3, "spacing": "geometric"}}]"#, &["not zero"]),
            (r#""vary": [{"time.end": {"from": 1e999, "count": 3}}]"#, &["vary.0.time.end.from", "a finite number"]),
            (
                r#""vary": [{"seed": [1, 2], "bonds.strength": [1, 2, 3]}]"#,
                &["vary.0", "bonds.strength has 3 values, seed has 2", "combines each value with each"],
            ),
            (
                r#""vary": [{"seed": [1]}, {"seed": [2]}]"#,
                &["vary.1.seed", "also has values at vary.0.seed", "each field once"],
            ),
            (r#""set": {"bonds": null}, "vary": [{"bonds.strength": [1]}]"#, &["vary.0.bonds.strength", "set.bonds"]),
            (r#""vary": [{"bonds.strenght": [1, 2]}]"#, &["vary.0.bonds.strenght", "nearest  bonds.strength"]),
            (r#""set": {"sed": 1}, "vary": [{"time.end": [1]}]"#, &["set.sed (line 1", "nearest  seed"]),
            (r#""vary": [{"bonds.strength": [1, -2]}]"#, &["vary.0.bonds.strength.1 (line 1", "-2", "≥ 0"]),
            (r#""vary": [{"time.end": [1, 0]}, {"seed": [1, 1.5]}]"#, &["vary.1.seed.1", "1.5", "a whole number"]),
            (
                r#""vary": [{"time.step": [1e-4, 1], "time.end": [1, 2]}, {"seed": [1]}], "set": {"output": {"interval": 0.01}}"#,
                &["set.output", "output.interval", "at least the time step"],
            ),
            (r#""vary": [{"title": ["a", "b"]}]"#, &["vary", "the same scene for title", "a title does not"]),
            (r#""vary": [{"seed": [7, 7]}]"#, &["seed = 7 twice"]),
            (r#""vary": [{"seed": {"from": 1, "count": 100000}}, {"time.end": [1, 2]}]"#, &["200000 runs", "at most"]),
            (r#""vary": [{"seed": [1]}], "varry": 1"#, &["varry", "nearest  vary"]),
        ] {
            let error = plan(text).expect_err(text);
            assert_eq!(error.exit_code(), 2, "{error}");
            for part in parts {
                assert!(error.to_string().contains(part), "{part:?} is not in the answer to {text}:\n{error}");
            }
        }
    }

    #[test]
    fn a_wrong_value_is_told_once_however_many_runs_have_it() {
        let error = plan(r#""vary": [{"bonds.strength": [-1, 2]}, {"seed": {"from": 1, "count": 50}}]"#);
        let error = error.expect_err("a negative strength");
        assert!(error.to_string().contains("is wrong at one place"), "{error}");
    }
}
