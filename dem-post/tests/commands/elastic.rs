//! Elastic constants of `dem-post stress-strain`.

use super::*;

#[test]
fn elastic_constants_are_slopes_of_the_curves() {
    // stress in units of load, axial strain and lateral strain with E = 2e5 Pa and ν = 0.3
    let constants = |stiffness: &str, lateral: f64| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.h5");
        let mut l = layout(2);
        l.parameters.scene = format!(r#"{{"thickness": 0.5, "bonds": {{{stiffness}}}}}"#);
        let mut writer = Writer::create(&path, &l, false).unwrap();
        frame(&mut writer, &l, COURSE, 0, 4e-3);
        for step in 1..=100 {
            let load = step as f64;
            let axial = load / 2e-3;
            let (along, across) = (-axial / 2e5, 0.3 * axial / 2e5);
            let row = [
                vec![0.0, 0.0, 0.0, 4e-3 * (1.0 + along)],
                vec![0.0, -load, 0.0, load],
                vec![0.0, load],
                vec![across, 0.0, 0.0, along],
                vec![lateral * axial, 0.0, 0.0, axial],
                vec![f64::from(u8::from(step >= 60))],
            ];
            writer.observe(step, load * 1e-3, &row.concat()).unwrap();
        }
        frame(&mut writer, &l, COURSE, 100, 4e-3);
        writer.finish().unwrap();
        let found = json(&dem_post(&path, &["stress-strain", "--json"]));
        (found, String::from_utf8(dem_post(&path, &["stress-strain"]).stdout).unwrap())
    };
    let (found, text) = constants(r#""stiffness": {}"#, 0.0);
    let value = |name: &str| found["elastic"][name]["value"].as_f64().unwrap();
    assert!(
        (value("young_modulus") / 2e5 - 1.0).abs() < 1e-9 && (value("poisson_ratio") - 0.3).abs() < 1e-9,
        "{found}"
    );
    // from 6 N to below 30 N, half the load at the first break
    assert_eq!(found["elastic"]["steps"], 24);
    assert!(text.contains("Young's modulus") && text.contains("Poisson's ratio"), "{text}");
    // side walls that push back
    let (found, text) = constants(r#""stiffness": {}"#, 0.4);
    assert!(found["elastic"].is_null() && text.contains("none: the lateral stress changes"), "{text}");
    let (found, text) = constants("", 0.0);
    assert!(found["elastic"].is_null() && !text.contains("Young"), "{text}");
}
