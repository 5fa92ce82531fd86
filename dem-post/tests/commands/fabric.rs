//! `dem-post fabric` on samples whose tensors are known.

use super::*;

/// A number of a CSV file by its column; `None` for an empty cell.
fn column(table: &str, name: &str) -> Vec<Option<f64>> {
    let place = table.lines().next().unwrap().split(',').position(|head| head == name);
    let place = place.unwrap_or_else(|| panic!("no column {name}"));
    table.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().ok()).collect()
}

/// A square lattice of `n` × `n` (× `n`) grains of radius 1 mm whose contacts along the last axis
/// are open at the second of two frames.
pub(super) fn lattice(dimension: usize, n: usize) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let d = dimension;
    let count = n.pow(d as u32);
    let place = |grain: usize, axis: usize| grain / n.pow(axis as u32) % n;
    let mut l = layout(d);
    l.walls.clear();
    l.bonds = Bonds::default();
    l.observables = vec![Observable::new("strain", "", &[d, d]), Observable::new("stress", "Pa", &[d, d])];
    l.grains = grains(count, 1e-3);
    let mut writer = Writer::create(&path, &l, false).unwrap();
    for step in 0..3 {
        let mut contacts = ContactRows::default();
        for (grain, axis) in (0..count).flat_map(|grain| (0..d).map(move |axis| (grain, axis))) {
            if place(grain, axis) + 1 == n || step == 0 {
                continue;
            }
            let unit = |axis: usize| (0..3).map(|k| f64::from(u8::from(k == axis))).collect::<Vec<f64>>();
            contacts.pair.push([(grain + n.pow(axis as u32)) as i32, grain as i32]);
            contacts.point.extend(vec![0.0; d]);
            contacts.normal.extend(&unit(axis)[..d]);
            if d == 3 {
                contacts.tangent.extend(unit((axis + 1) % 3));
            }
            contacts.reaction.extend(vec![1.0; d]);
            contacts.gap.push(0.0);
            let open = step == 2 && axis + 1 == d;
            contacts.status.push(if open { ContactStatus::Open } else { ContactStatus::Stick });
        }
        let position = (0..count).flat_map(|g| (0..d).map(move |k| 2e-3 * place(g, k) as f64)).collect();
        let grains = GrainState { position, velocity: vec![0.0; count * d], ..GrainState::default() };
        let time = step as f64 * 1e-3;
        if step > 0 {
            // stress 9, 5 (, 1) along the axes with a shear of 3 on one face, strains of 1, 2 (, 3)
            // %
            let diagonal =
                |values: [f64; 3]| (0..d * d).map(move |k| if k % (d + 1) == 0 { values[k / (d + 1)] } else { 0.0 });
            let mut stress: Vec<f64> = diagonal([9.0, 5.0, 1.0]).collect();
            stress[1] = 3.0;
            let values: Vec<f64> = diagonal([0.01, 0.02, 0.03]).chain(stress).collect();
            writer.observe(step, time, &values).unwrap();
        }
        writer.frame(&Frame { step, time, grains, contacts, ..Frame::default() }).unwrap();
    }
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn a_square_lattice_is_isotropic_until_one_direction_opens() {
    for (d, n) in [(2, 10), (3, 6)] {
        let (_folder, path) = lattice(d, n);
        let rows = json(&dem_post(&path, &["fabric", "--json"]))["rows"].clone();
        // the first frame has no contacts
        assert!(rows[0]["coordination"].is_null() && rows[0]["fabric"].is_null() && rows[0]["p"].is_null());
        let tensor = |row: usize, name: &str| -> Vec<f64> {
            rows[row][name].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let expected =
            |values: &[f64]| (0..d * d).map(|k| if k % (d + 1) == 0 { values[k / (d + 1)] } else { 0.0 }).collect();
        let close = |found: Vec<f64>, known: Vec<f64>| {
            assert!(found.iter().zip(&known).all(|(a, b)| (a - b).abs() < 1e-12), "{d}D: {found:?} is not {known:?}");
        };
        let lines = (n - 1) * n.pow(d as u32 - 1);
        close(tensor(1, "fabric"), expected(&vec![1.0 / d as f64; d]));
        assert!(rows[1]["anisotropy"].as_f64().unwrap() < 1e-12);
        assert_eq!(rows[1]["contacts"], d * lines);
        let coordination = 2.0 * (d * lines) as f64 / n.pow(d as u32) as f64;
        assert!((rows[1]["coordination"].as_f64().unwrap() - coordination).abs() < 1e-12);
        // without the last direction: along x in 2D, in the plane in 3D
        let (left, anisotropy) = if d == 2 { (vec![1.0, 0.0], 2.0) } else { (vec![0.5, 0.5, 0.0], 7.5 * 0.5) };
        close(tensor(2, "fabric"), expected(&left));
        assert!((rows[2]["anisotropy"].as_f64().unwrap() - anisotropy).abs() < 1e-12, "{}", rows[2]["anisotropy"]);
        assert_eq!(rows[2]["direction"].as_f64(), (d == 2).then_some(0.0));
        // of the symmetric part: in 2D 7 ± √(2² + 1.5²) = 7 ± 2.5
        let [p, q, e] = ["p", "q", "volumetric_strain"].map(|name| rows[1][name].as_f64().unwrap());
        let known = if d == 2 { [7.0, 2.5, 0.03] } else { [5.0, (3.0 * 16.0 + 3.0 * 2.25f64).sqrt(), 0.06] };
        close(vec![p, q, e], known.to_vec());
        assert!(rows[1]["crack_density"].is_null());
    }
}

#[test]
fn quantities_that_a_history_lacks_are_not_drawn() {
    let ((_loose, loose), (_bonded, bonded)) = (lattice(2, 3), sample(&layout(2)));
    for (path, cracks) in [(&loose, false), (&bonded, true)] {
        assert!(dem_post(path, &["fabric"]).status.success());
        let drawn = std::fs::read_to_string(path.with_file_name("run-post").join("fabric.svg")).unwrap();
        assert!(drawn.contains("coordination number"));
        assert_eq!(drawn.contains("crack density"), cracks);
    }
}

#[test]
fn crack_density_is_the_section_of_broken_bonds_in_the_sample() {
    for d in [2, 3] {
        let (_folder, path) = sample(&layout(d));
        assert!(dem_post(&path, &["fabric"]).status.success());
        let table = std::fs::read_to_string(path.with_file_name("run-post").join("fabric.csv")).unwrap();
        // the box of four grains is 4 mm wide and high, in 3D 2 mm deep; bond 0 lies along x, bond
        // 1 along y, and breaks last
        let (volume, section) = if d == 2 { (16e-6, 2e-3) } else { (32e-9, 0.25 * std::f64::consts::PI * 4e-6) };
        let one = section / volume;
        let [xx, yy, area, broken] =
            ["crack_density_xx_per_m", "crack_density_yy_per_m", "crack_area_per_m", "bonds_broken"]
                .map(|name| column(&table, name));
        for (frame, steps) in (0..=10).map(|frame| (frame, 10 * frame)) {
            let known = [steps >= 30, steps >= 60].map(|there| if there { one } else { 0.0 });
            for (found, known) in [(&xx, known[0]), (&yy, known[1]), (&area, known[0] + known[1])] {
                assert!((found[frame].unwrap() - known).abs() < 1e-9 * one, "{d}D, step {steps}: {:?}", found[frame]);
            }
            assert_eq!(broken[frame], Some(f64::from(u8::from(steps >= 30) + u8::from(steps >= 60))));
        }
    }
}
