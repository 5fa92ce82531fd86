//! Companions for viewers: their values are those of the history. The Python tests check that
//! viewers read them.

use hdf5::{File, H5Type};

use super::*;

/// All numbers of a dataset.
fn numbers<T: H5Type>(file: &File, place: &str) -> Vec<T> {
    file.dataset(place).unwrap_or_else(|error| panic!("{place}: {error}")).read_raw().unwrap()
}

/// Rows of `d` numbers padded to three.
fn padded(values: &[f64], d: usize) -> Vec<[f64; 3]> {
    values.chunks(d).map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0.0))).collect()
}

fn vectors(file: &File, place: &str) -> Vec<[f64; 3]> {
    padded(&numbers(file, place), 3)
}

/// The companions of the history at `path`, in a folder within its folder, and what the command
/// printed.
fn view(path: &Path) -> (PathBuf, serde_json::Value) {
    let found = json(&dem_post(path, &["view", "--json", "-o", "post/deep"]));
    (path.with_file_name("post").join("deep"), found)
}

/// Number and start of the points of each frame of `file`, as VTK reads them.
fn points(file: &File, frame: usize) -> Vec<[f64; 3]> {
    let at = |place: &str| numbers::<i64>(file, place)[frame] as usize;
    let start = at("VTKHDF/Steps/PointOffsets");
    vectors(file, "VTKHDF/Points")[start..start + at("VTKHDF/NumberOfPoints")].to_vec()
}

/// The pairs of points that the lines of a frame join.
fn lines(file: &File, frame: usize) -> Vec<[usize; 2]> {
    let start = numbers::<i64>(file, "VTKHDF/Steps/ConnectivityIdOffsets")[4 * frame + 1] as usize;
    let count = numbers::<i64>(file, "VTKHDF/Lines/NumberOfCells")[frame] as usize;
    let ids = &numbers::<i32>(file, "VTKHDF/Lines/Connectivity")[start..start + 2 * count];
    ids.chunks(2).map(|pair| [pair[0] as usize, pair[1] as usize]).collect()
}

/// Numbers of the cells of a frame.
fn cells<T: H5Type + Clone>(file: &File, name: &str, frame: usize, count: usize) -> Vec<T> {
    let start = numbers::<i64>(file, &format!("VTKHDF/Steps/CellDataOffsets/{name}"))[frame] as usize;
    numbers::<T>(file, &format!("VTKHDF/CellData/{name}"))[start..start + count].to_vec()
}

fn check_grains(folder: &Path, h: &History) {
    let (file, d) = (File::open(folder.join("grains.vtkhdf")).unwrap(), h.dimension());
    let n = h.grains().unwrap().radius.len();
    assert_eq!(numbers::<f64>(&file, "VTKHDF/Steps/Values"), h.times());
    assert_eq!(numbers::<f64>(&file, "VTKHDF/PointData/radius"), h.grains().unwrap().radius);
    for frame in 0..h.frames() {
        let state = h.grain_state(frame).unwrap();
        assert_eq!(points(&file, frame), padded(&state.position, d));
        assert_eq!(vectors(&file, "VTKHDF/PointData/velocity")[frame * n..][..n], padded(&state.velocity, d));
        if state.angular_velocity.is_empty() {
            assert!(!file.link_exists("VTKHDF/PointData/angular_velocity"));
            continue;
        }
        let spin = &vectors(&file, "VTKHDF/PointData/angular_velocity")[frame * n..][..n];
        if d == 2 {
            assert!(spin.iter().zip(&state.angular_velocity).all(|(spin, w)| *spin == [0.0, 0.0, *w]));
            assert_eq!(numbers::<f64>(&file, "VTKHDF/PointData/angle")[frame * n..][..n], state.orientation);
        } else {
            assert_eq!(*spin, padded(&state.angular_velocity, 3));
            assert_eq!(
                numbers::<f64>(&file, "VTKHDF/PointData/orientation")[4 * frame * n..][..4 * n],
                state.orientation
            );
        }
    }
    let file = File::open(folder.join("grains.h5md")).unwrap();
    let positions = vectors(&file, "particles/trajectory/position/value");
    for frame in 0..h.frames() {
        assert_eq!(positions[frame * n..][..n], padded(&h.grain_state(frame).unwrap().position, d));
    }
    assert_eq!(numbers::<f64>(&file, "particles/trajectory/position/time"), h.times());
    assert!(file.dataset("particles/trajectory/position/value").unwrap().attr("unit").is_err());
}

fn check_contacts(folder: &Path, h: &History) {
    let (file, d) = (File::open(folder.join("contacts.vtkhdf")).unwrap(), h.dimension());
    for frame in 0..h.frames() {
        let (contacts, points, lines) = (h.contacts(frame).unwrap(), points(&file, frame), lines(&file, frame));
        let centres = padded(&h.grain_state(frame).unwrap().position, d);
        assert_eq!(lines.len(), contacts.len());
        for (c, ([i, j], [from, to])) in contacts.pair.iter().zip(lines).enumerate() {
            assert_eq!(points[from], centres[*i as usize]);
            let other = if *j < 0 { padded(&contacts.point, d)[c] } else { centres[*j as usize] };
            assert_eq!(points[to], other);
        }
        let m = contacts.len();
        let forces = cells::<f64>(&file, "normal_force", frame, m);
        assert!((0..m).all(|c| forces[c] == contacts.normal_force(c)));
        let status: Vec<u8> = contacts.status.iter().map(|status| *status as u8).collect();
        assert_eq!(cells::<u8>(&file, "status", frame, m), status);
        let start = h.contact_rows(frame).unwrap().start;
        assert_eq!(vectors(&file, "VTKHDF/CellData/point")[start..][..m], padded(&contacts.point, d));
        let tangential = file.dataset("VTKHDF/CellData/tangential_force").unwrap();
        assert_eq!(tangential.ndim(), d - 1);
    }
}

#[test]
fn companions_map_the_history() {
    let turning = |dimension| Layout { rotation: true, ..layout(dimension) };
    let loose = Layout { bonds: Bonds::default(), ..layout(2) };
    let free = Layout { walls: vec![], observables: vec![], ..layout(3) };
    for l in [layout(2), layout(3), turning(2), turning(3), loose, free] {
        let (_folder, path) = sample(&l);
        let before = std::fs::read(&path).unwrap();
        let (folder, found) = view(&path);
        let names: Vec<&str> =
            found["companions"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
        assert_eq!(names.contains(&"bonds.vtkhdf"), !l.bonds.is_empty());
        assert_eq!(super::names(&folder).len(), names.len());
        let h = History::open(&path).unwrap();
        check_grains(&folder, &h);
        check_contacts(&folder, &h);
        if !l.bonds.is_empty() {
            let file = File::open(folder.join("bonds.vtkhdf")).unwrap();
            let pairs: Vec<[usize; 2]> = l.bonds.pair.iter().map(|pair| pair.map(|grain| grain as usize)).collect();
            for frame in 0..h.frames() {
                let status: Vec<u8> = h.bond_status(frame).unwrap().iter().map(|status| *status as u8).collect();
                assert_eq!(cells::<u8>(&file, "status", frame, pairs.len()), status);
                assert_eq!(lines(&file, frame), pairs);
                assert_eq!(points(&file, frame), padded(&h.grain_state(frame).unwrap().position, l.dimension));
            }
            assert_eq!(numbers::<f64>(&file, "VTKHDF/CellData/strength"), l.bonds.strength);
        }
        assert!(std::fs::read(&path).unwrap() == before, "the history has changed");
    }
}

#[test]
fn companions_move_with_their_history() {
    let (folder, path) = sample(&layout(2));
    // HDF5 would replace %b by a number
    let odd = folder.path().join("50%b é.h5");
    std::fs::rename(&path, &odd).unwrap();
    view(&odd);
    let away = tempfile::tempdir().unwrap();
    let moved = away.path().join("there");
    std::fs::rename(folder.path(), &moved).unwrap();
    let h = History::open(&moved.join("50%b é.h5")).unwrap();
    check_grains(&moved.join("post/deep"), &h);
    check_contacts(&moved.join("post/deep"), &h);
    // without the history the times cannot be read, and nothing reads as zeros
    std::fs::remove_file(h.path()).unwrap();
    let file = File::open(moved.join("post/deep/grains.vtkhdf")).unwrap();
    assert!(file.dataset("VTKHDF/Steps/Values").is_err());
    std::fs::create_dir(folder.path()).unwrap();
}

#[test]
fn frames_with_the_same_pairs_share_their_lines() {
    let (_folder, path) = sample(&layout(2));
    let (folder, _) = view(&path);
    let file = File::open(folder.join("contacts.vtkhdf")).unwrap();
    assert_eq!(file.dataset("VTKHDF/Lines/Connectivity").unwrap().size(), 8);
}

/// A falling grain without contacts.
fn falling(path: &Path, frames: usize) -> Writer {
    let l = Layout { dimension: 2, grains: grains(1, 1.0), ..Layout::default() };
    let mut writer = Writer::create(path, &l, false).unwrap();
    for k in 0..frames {
        let state = GrainState { position: vec![0.5, -(k as f64)], velocity: vec![0.0, -1.0], ..GrainState::default() };
        let (walls, contacts) = (WallState::default(), ContactRows::default());
        let (step, time) = (k as i64, k as f64);
        writer.frame(&Frame { step, time, grains: state, walls, contacts, bonds: vec![] }).unwrap();
    }
    writer
}

#[test]
fn what_is_not_there_is_not_mapped() {
    let (folder, path) = sample(&layout(2));
    view(&path);
    std::fs::remove_file(&path).unwrap();
    falling(&path, 3).finish().unwrap();
    let output = dem_post(&path, &["view", "-o", "post/deep"]);
    let table = String::from_utf8(output.stdout).unwrap();
    for line in ["contacts.vtkhdf", "bonds.vtkhdf"] {
        let line = table.lines().find(|found| found.starts_with(line)).unwrap();
        assert!(line.contains("not made: "), "{line}");
    }
    // the companions of the earlier history are removed
    let folder = folder.path().join("post/deep");
    assert_eq!(names(&folder).len(), 2);
    check_grains(&folder, &History::open(&path).unwrap());
}

#[test]
fn histories_that_viewers_cannot_open_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    falling(&path, 0).finish().unwrap();
    refused(&dem_post(&path, &["view"]), 2, &["run.h5", "no frame"]);
    let open = folder.path().join("open.h5");
    let writer = falling(&open, 2);
    refused(&dem_post(&open, &["view"]), 2, &["open.h5", "not closed", "info --repair"]);
    drop(writer);
    refused(&dem_post(&folder.path().join("none.h5"), &["view"]), 4, &["none.h5", "does not exist"]);
    let named = folder.path().join("grains.h5md");
    falling(&named, 2).finish().unwrap();
    let before = std::fs::read(&named).unwrap();
    refused(&dem_post(&named, &["view", "-o", "."]), 2, &["grains.h5md", "-o"]);
    assert_eq!(std::fs::read(&named).unwrap(), before);
    refused(&dem_post(&named, &["view", "-o", "run.h5"]), 4, &["run.h5"]);
}

#[test]
fn copies_need_no_closed_file_and_keep_the_files_of_other_formats() {
    let folder = tempfile::tempdir().unwrap();
    let open = folder.path().join("open.h5");
    let _writer = falling(&open, 2);
    for (format, files) in [("vtp", 3), ("lammps", 1)] {
        let output = dem_post(&open, &["view", "--format", format, "-o", "post", "--json"]);
        let found = json(&output);
        let written = found["companions"].as_array().unwrap();
        assert_eq!(written.len(), 1, "{found}");
        let bytes: u64 = names(&folder.path().join("post"))
            .iter()
            .filter(|name| name.ends_with("dump") == (format == "lammps"))
            .map(|name| std::fs::metadata(folder.path().join("post").join(name)).unwrap().len())
            .sum();
        assert_eq!(written[0]["bytes"], bytes);
        assert_eq!(names(&folder.path().join("post")).len(), if format == "vtp" { files } else { files + 3 });
    }
    // the default folders
    dem_post(&open, &["view", "--format", "vtp"]);
    dem_post(&open, &["view", "--format", "lammps"]);
    assert!(folder.path().join("open-vtp/grains.pvd").exists() && folder.path().join("open-post/grains.dump").exists());
    let output = dem_post(&open, &["view", "--format", "xyz"]);
    refused(&output, 2, &["xyz", "vtkhdf, vtp, lammps"]);
}
