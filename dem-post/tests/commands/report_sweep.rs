//! The page of `dem-post report` of a sweep.

use std::collections::BTreeMap;

use dem_history::sweep::{Entry, Manifest, Outcome, State, Store};
use serde_json::{Value, json};

use super::report::{bytes, well_formed};
use super::*;

/// A sweep in the folder `name` of `folder`, of these varied fields.
struct Planned {
    folder: PathBuf,
    store: Store,
    manifest: Manifest,
}

impl Planned {
    fn new(folder: &Path, fields: &[&str]) -> Self {
        let store = Store::new(folder.join("a study"));
        store.create().unwrap();
        let fields = fields.iter().map(ToString::to_string).collect();
        let manifest = Manifest::new(Path::new("study.json"), Path::new("base.json"), fields);
        Self { folder: folder.into(), store, manifest }
    }

    /// Adds a run with these values of the fields, and returns the path of its history.
    fn run(&mut self, values: &[Value], state: State) -> PathBuf {
        let id = format!("{:04}", self.manifest.runs.len() + 1);
        let named: BTreeMap<String, Value> = self.manifest.fields.iter().cloned().zip(values.iter().cloned()).collect();
        self.manifest.runs.push(Entry::new(id.clone(), named, format!("digest {id}")));
        let (exit_code, ending) = if state == State::Failed { (3, "no_convergence") } else { (0, "broken_fraction") };
        let outcome = Outcome {
            digest: format!("digest {id}"),
            state,
            exit_code: Some(exit_code),
            message: (state == State::Failed).then(|| "step 31 <was> not solved\nand more".into()),
            wall_time: 9.0,
            summary: Some(json!({ "ending": ending, "cpu_time": 1.5 })),
        };
        if matches!(state, State::Done | State::Failed) {
            self.store.record(&id, &outcome).unwrap();
        }
        self.store.path(&id, if state == State::Failed { ".failed.h5" } else { ".h5" })
    }

    /// Calls `dem-post report` on it.
    fn report(&self, options: &[&str]) -> Output {
        self.store.write_manifest(&self.manifest).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        command.current_dir(&self.folder).args(["report", "a study"]).args(options).output().unwrap()
    }

    /// The page.
    fn page(&self, options: &[&str]) -> String {
        let output = self.report(options);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read_to_string(self.folder.join("a study-report/report.html")).unwrap()
    }
}

fn scene(cohesion: f64, seed: usize) -> String {
    json!({ "seed": seed, "thickness": 0.5, "bonds": { "strength": cohesion }, "walls": { "top": { "force_rate": 100.0 * cohesion } } })
        .to_string()
}

/// Three runs that break at 20, 40 and 60 N, one that failed at 30 N, and one that has not started.
fn study(folder: &Path) -> Planned {
    let mut planned = Planned::new(folder, &["bonds.strength", "walls.top.force_rate", "seed"]);
    for (k, cohesion) in [10.0, 20.0, 30.0].into_iter().enumerate() {
        let path = planned.run(&[json!(cohesion), json!(100.0 * cohesion), json!(1)], State::Done);
        let mut l = layout(2);
        l.parameters.scene = scene(cohesion, 1);
        let first = 20 * (k as i64 + 1);
        write_course(&path, &l, Course { steps: 100, breaks: [first, first + 20] });
    }
    let path = planned.run(&[json!(10), json!(1000), json!(2)], State::Failed);
    let mut l = layout(2);
    l.parameters.scene = scene(10.0, 2);
    write_course(&path, &l, Course { steps: 30, breaks: [25, 99] });
    planned.run(&[json!(20), json!(2000), json!(2)], State::Left);
    planned
}

/// The text of a section of the page.
fn section<'a>(page: &'a str, id: &str) -> &'a str {
    page.split(&format!("<section id=\"{id}\">")).nth(1).expect(id).split("</section>").next().unwrap()
}

/// The values of an attribute.
fn values<'a>(page: &'a str, attribute: &str) -> Vec<&'a str> {
    page.split(&format!(" {attribute}=\"")).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn a_truncated_history_does_not_stop_the_page_of_a_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path());
    let path = study.store.path("0002", ".h5");
    let cut = std::fs::OpenOptions::new().write(true).open(path).unwrap();
    cut.set_len(cut.metadata().unwrap().len() / 2).unwrap();
    let page = study.page(&[]);
    let result = section(&page, "result");
    assert!(result.contains("its history is truncated"), "{result}");
    assert!(result.contains("2 ended when enough bonds were broken, 2 failed, 1 of them with exit code 3"), "{result}");
}

#[test]
fn the_page_of_a_sweep_begins_with_its_result() {
    let folder = tempfile::tempdir().unwrap();
    let page = study(folder.path()).page(&[]);
    let result = section(&page, "result");
    for said in [
        "study.json: 5 runs of base.json, over bonds.strength (10, 20, 30 N), walls.top.force_rate (1000, 2000, 3000 N/s) and seed (1, 2).",
        "3 ended when enough bonds were broken, 1 failed with exit code 3 and 1 is not started.",
        "The load with 5 % of bonds broken is 20 to 60 N; over bonds.strength it is y = 2 x, slope ± 0 (standard error).",
    ] {
        assert!(result.contains(said), "{said}\n{result}");
    }
    // the histories have no residuals
    assert!(!result.contains("missed the tolerance"));
    let row = |run: &str| {
        let row = result.split("<tr>").find(|row| row.contains(&format!(">{run}<"))).unwrap();
        let cells = row.split("<td>").skip(1).map(|cell| cell.split("</td>").next().unwrap().to_string());
        cells
            .map(|cell| {
                cell.rsplit_once("</a>").map_or(cell.clone(), |(link, _)| link.rsplit('>').next().unwrap().into())
            })
            .collect::<Vec<String>>()
    };
    // the sample shortens from 41 N on: with an intact rigid sample that is solver error
    let done = ["done", "broken fraction"];
    assert_eq!(
        row("0001"),
        [&["0001", "10", "1000", "1"][..], &done, &["20", "20", "40", "–", "2", "–", "1.5"]].concat()
    );
    assert_eq!(
        row("0003"),
        [&["0003", "30", "3000", "1"][..], &done, &["60", "60", "–", "–", "2", "–", "1.5"]].concat()
    );
    assert_eq!(
        row("0004"),
        ["0004", "10", "1000", "2", "failed", "no convergence", "25", "25", "–", "–", "1", "–", "1.5"]
    );
    assert_eq!(row("0005"), ["0005", "20", "2000", "2", "left", "–", "–", "–", "–", "–", "–", "–", "–"]);
    assert!(result.contains("step 31 &#60;was&#62; not solved") && !page.contains("and more"));
    let strength = section(&page, "strength");
    assert!(strength.contains("<td>y = 2 x</td>") && strength.contains("2 runs: not done, or the sample did not fail"));
    // the runs differ in their bonds: no envelope
    assert!(!page.contains("id=\"envelope\""));
}

#[test]
fn the_page_has_the_title_of_the_sweep_else_the_name_of_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let mut planned = study(folder.path());
    assert!(planned.page(&[]).contains("<title>a study</title>"));
    planned.manifest.title = Some("Strength and rate".into());
    assert!(planned.page(&["--force"]).contains("<title>Strength and rate</title>"));
}

#[test]
fn the_page_of_a_sweep_links_to_its_histories_and_needs_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let page = study(folder.path()).page(&[]);
    well_formed(&page);
    let pictures = values(&page, "src");
    assert!(pictures.iter().all(|address| address.starts_with("data:image/")));
    assert_eq!(values(&page, "alt").iter().filter(|alt| !alt.is_empty()).count(), pictures.len());
    // a chart of strengths, two of the curves, a picture of each run with a history
    assert_eq!((pictures.len(), page.matches("class=\"small\"").count()), (3 + 4, 4));
    for outside in ["http:", "https:", "url(", "@import", "<script src", "<link", "<iframe"] {
        assert!(!page.contains(outside), "{outside}");
    }
    let links: Vec<&str> = values(&page, "href").into_iter().filter(|link| !link.starts_with('#')).collect();
    assert_eq!(links.len(), 4);
    for link in links {
        let path = folder.path().join("a study-report").join(link.replace("%20", " "));
        assert!(History::open(&path).is_ok(), "{link}");
    }
    for said in ["Run 0001: collapse, t = 0.04 s", "Run 0003: end, t = 0.1 s", "Run 0004: end, t = 0.03 s"] {
        assert!(page.contains(said), "{said}");
    }
}

#[test]
fn the_curves_of_all_runs_are_on_one_chart() {
    let folder = tempfile::tempdir().unwrap();
    let page = study(folder.path()).page(&[]);
    let curves = section(&page, "curves");
    let data = curves.split("<script type=\"application/json\">").nth(1).unwrap().split("</script>").next().unwrap();
    let chart: Value = serde_json::from_str(data).unwrap();
    let names: Vec<&str> =
        chart["curves"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["strength 10", "strength 10", "strength 20", "strength 30"]);
    let colours: Vec<&Value> = chart["curves"].as_array().unwrap().iter().map(|one| &one["colour"]).collect();
    assert!(colours[0] == colours[1] && colours[1] != colours[2] && colours[2] != colours[3]);
    assert!(curves.contains("in colours by bonds.strength (N)"));
    // the end of the first run: 100 N at a strain of 6 %
    let places = bytes(&chart["curves"][0]["points"]);
    let last = places.chunks(4).next_back().unwrap();
    let value = |axis: &str, low: u8, high: u8| {
        let ends = [0, 1].map(|k| chart[axis][k].as_f64().unwrap());
        ends[0] + f64::from(u16::from_le_bytes([low, high])) / 65535.0 * (ends[1] - ends[0])
    };
    assert!((value("x", last[0], last[1]) - 6.0).abs() < 1e-3 && (value("y", last[2], last[3]) - 100.0).abs() < 1e-2);
}

#[test]
fn runs_that_differ_in_the_loads_of_walls_have_an_envelope() {
    let folder = tempfile::tempdir().unwrap();
    let mut planned = Planned::new(folder.path(), &["walls.left.force"]);
    for minor in [0.0, 500.0, 1000.0, 4000.0] {
        let path = planned.run(&[json!(minor)], State::Done);
        envelope::run(
            path.parent().unwrap(),
            path.file_name().unwrap().to_str().unwrap(),
            2,
            [minor, envelope::major(minor)],
            true,
        );
    }
    let page = planned.page(&[]);
    let found = section(&page, "envelope");
    assert!(found.contains("<td>30 °, standard error") && found.contains("<td>1000 Pa, standard error"), "{found}");
    assert!(section(&page, "result").contains("friction angle 30° and cohesion 1 kPa"));
    assert_eq!(found.matches("<img").count(), 2);
    // the load grows until the end: it has no peak
    let none = planned.page(&["--measure", "peak"]);
    assert!(section(&none, "strength").contains("None: no run has a peak load") && !none.contains("id=\"envelope\""));
}

#[test]
fn options_of_another_page_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let planned = study(folder.path());
    refused(&planned.report(&["--times", "0.1"]), 2, &["--times is of the page of one run", "history"]);
    refused(&planned.report(&["--against", "bonds.friction", "--wall", "none"]), 2, &["none"]);
    let history = planned.store.path("0001", ".h5");
    refused(&dem_post(&history, &["report", "--against", "seed"]), 2, &["--against is of the page of a sweep"]);
    refused(&dem_post(&history, &["report", "--measure", "peak"]), 2, &["--measure is of the page of a sweep"]);
    // a field without a number is no error of the page
    let page = planned.page(&["--against", "bonds.friction"]);
    assert!(section(&page, "strength").contains("None: --against bonds.friction"));
    std::fs::remove_file(planned.store.folder().join("manifest.json")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let output = command.current_dir(folder.path()).args(["report", "a study"]).output().unwrap();
    refused(&output, 2, &["a study holds no manifest.json", "dem-run sweep"]);
}

#[test]
fn the_page_of_a_sweep_as_json_has_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let output = study(folder.path()).report(&["--json", "--quiet"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let loads: Vec<&Value> = found["runs"].as_array().unwrap().iter().map(|run| &run["first_break"]).collect();
    assert_eq!(loads, [&json!(20.0), &json!(40.0), &json!(60.0), &json!(25.0), &Value::Null]);
    assert_eq!(found["strength"]["line"]["slope"]["value"], 2.0);
    assert_eq!((&found["runs"][3]["exit_code"], &found["runs"][4]["state"]), (&json!(3), &json!("left")));
}
