//! `dem-post envelope` on runs whose stresses at failure are known.

use super::*;

/// A run at a confinement (Pa) whose axial stress grows to `strength` (Pa) in step 5; a bond breaks
/// in step 6 if `fails`, and the stress has fallen by then.
pub(super) fn run(folder: &Path, name: &str, d: usize, stresses: [f64; 2], fails: bool) -> PathBuf {
    let path = folder.join(name);
    let mut l = layout(d);
    let [confinement, strength] = stresses;
    l.parameters.scene = format!(r#"{{"seed": 1, "walls": {{"left": {{"force": {confinement}}}}}}}"#);
    let mut writer = Writer::create(&path, &l, false).unwrap();
    let course = Course { steps: 10, breaks: [99, 99] };
    frame(&mut writer, &l, course, 0, 4e-3);
    for step in 1..=10 {
        let share = if step <= 5 { step as f64 / 5.0 } else { 0.2 };
        let mut stress = vec![0.0; d * d];
        for k in 0..d {
            stress[k * (d + 1)] = if k == 1 { share * strength } else { confinement * (1 + k / 2) as f64 };
        }
        let load = step as f64;
        let values = [
            vec![0.0; 2 * d],
            vector(d, -load),
            vector(d, load),
            vec![0.0, load],
            vec![0.0; d * d],
            stress,
            vec![f64::from(u8::from(fails && step >= 6))],
        ];
        writer.observe(step, step as f64 * 1e-3, &values.concat()).unwrap();
    }
    frame(&mut writer, &l, course, 10, 4e-3);
    writer.finish().unwrap();
    path
}

/// σ₁ that touches τ = 1000 Pa + σ tan 30° at a confinement: N = 3, σ_c = 2 c √3.
pub(super) fn major(minor: f64) -> f64 {
    3.0 * minor + 2000.0 * 3f64.sqrt()
}

#[test]
fn circles_that_touch_a_line_give_its_cohesion_and_angle() {
    for d in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let minors = [0.0, 500.0, 1000.0, 4000.0];
        let runs: Vec<PathBuf> = minors
            .iter()
            .enumerate()
            .map(|(k, &minor)| run(folder.path(), &format!("r{k}.h5"), d, [minor, major(minor)], true))
            .collect();
        let names = ["r1.h5", "r2.h5", "r3.h5"];
        let found = json(&dem_post(&runs[0], &[&["envelope"], &names[..], &["--json"]].concat()));
        let value = |name: &str, of: &str| found["envelope"][name][of].as_f64().unwrap();
        assert!((value("friction_angle", "value") - 30.0).abs() < 1e-9, "{found}");
        assert!((value("cohesion", "value") - 1000.0).abs() < 1e-7);
        assert!(value("cohesion", "standard_error") < 1e-6);
        assert_eq!(found["varied"], serde_json::json!(["walls.left.force"]));
        // the state is that before the break, the load that of the break
        for (k, circle) in found["circles"].as_array().unwrap().iter().enumerate() {
            assert_eq!((&circle["time"], &circle["load"]), (&5e-3.into(), &6.0.into()));
            assert!((circle["minor"].as_f64().unwrap() - minors[k]).abs() < 1e-9);
            assert!((circle["major"].as_f64().unwrap() - major(minors[k])).abs() < 1e-9);
            let middle = circle["intermediate"].as_f64();
            assert!(middle.is_some() == (d == 3) && middle.is_none_or(|m| (m - 2.0 * minors[k]).abs() < 1e-9));
        }
        let results = folder.path().join("r0-envelope");
        let files =
            ["envelope-principal.png", "envelope-principal.svg", "envelope.csv", "envelope.png", "envelope.svg"];
        assert_eq!(super::names(&results), files);
        assert_eq!(std::fs::read_to_string(results.join("envelope.csv")).unwrap().lines().count(), 5);
    }
}

#[test]
fn what_runs_do_not_show_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let first = run(folder.path(), "a.h5", 2, [100.0, major(100.0)], true);
    run(folder.path(), "b.h5", 2, [100.0, 1.1 * major(100.0)], true);
    run(folder.path(), "c.h5", 2, [500.0, 300.0], false);
    run(folder.path(), "d.h5", 2, [900.0, 2000.0], true);
    let text = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned();
    run(folder.path(), "e.h5", 2, [101.0, major(100.0)], true);
    for other in ["b.h5", "e.h5"] {
        let same = dem_post(&first, &["envelope", other, "--force"]);
        assert!(same.status.success() && text(&same).contains("one confinement"), "{}", text(&same));
    }
    // a run that did not fail is left out
    let output = dem_post(&first, &["envelope", "c.h5", "--force"]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("1 of 2 runs are left out") && message.contains("fewer than 5 %"), "{message}");
    let falls = dem_post(&first, &["envelope", "d.h5", "--force"]);
    assert!(falls.status.success() && text(&falls).contains("does not grow with the confinement"), "{}", text(&falls));
    // the load only grows: it has no peak
    refused(&dem_post(&first, &["envelope", "--measure", "peak", "-o", "x"]), 2, &["peak load", "--measure"]);
    let mut l = layout(2);
    l.observables.retain(|one| one.name != "stress" && one.name != "strain");
    let (_folder, path) = without_stress(&l);
    refused(&dem_post(&path, &["envelope"]), 2, &["/observables/stress"]);
}

/// A run without the stress in which a bond breaks.
fn without_stress(l: &Layout) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let mut writer = Writer::create(&path, l, false).unwrap();
    frame(&mut writer, l, COURSE, 0, 4e-3);
    for step in 1..=3 {
        let load = step as f64;
        let values =
            [vec![0.0; 4], vector(2, -load), vector(2, load), vec![0.0, load], vec![f64::from(u8::from(step > 2))]];
        writer.observe(step, step as f64 * 1e-3, &values.concat()).unwrap();
    }
    frame(&mut writer, l, COURSE, 3, 4e-3);
    writer.finish().unwrap();
    (folder, path)
}
