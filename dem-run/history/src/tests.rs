//! A history written is the history read, and no file makes the reader panic.

use std::fs;
use std::path::{Path, PathBuf};

use super::*;

mod cement;
mod ending;
mod plate;
mod resumed;

/// Three grains, two walls, two bonds, in `dimension` dimensions.
fn full(dimension: usize) -> Layout {
    let wall = |name: &str, kind, drive, radius| Wall {
        name: name.into(),
        kind,
        normal: [0.0, 1.0, 0.0],
        radius,
        drive,
        direction: [0.0, -1.0, 0.0],
        ..Wall::default()
    };
    Layout {
        dimension,
        rotation: true,
        friction: true,
        twist: false,
        without_reactions: false,
        single: false,
        grains: Grains {
            id: vec![7, 8, 9],
            radius: vec![0.1, 0.2, 0.3],
            mass: vec![1.0, 2.0, 3.0],
            inertia: vec![0.5, 0.6, 0.7],
            material: vec![0, 1, 1],
        },
        walls: vec![
            wall("sol", WallKind::Plane, WallDrive::Fixed, 0.0),
            wall("tête", WallKind::Circle, WallDrive::Force, -0.5),
        ],
        bonds: Bonds {
            pair: vec![[0, 1], [1, 2]],
            rest_gap: vec![1e-9, -1e-9],
            strength: vec![5.0, 10.0],
            friction: vec![0.3, 0.2],
            rolling: vec![0.1, 0.25],
            mean_diameter: vec![0.3, 0.5],
            ..Bonds::default()
        },
        materials: vec!["base".into(), "pâte".into()],
        observables: vec![
            Observable::new("kinetic_energy", "J", &[]),
            Observable::new("stress", "Pa", &[dimension, dimension]),
            Observable::new("bonds_broken", "", &[]),
        ],
        parameters: Parameters {
            scene: "{\"dimension\": 2, \"name\": \"été\"}".into(),
            earlier_scenes: "[{\"last_step\": 12, \"scene\": {}}]".into(),
            seed: u64::MAX,
            version: "0.1.0".into(),
            solid_fraction: Some(0.8),
            git_revision: "abc".into(),
            build: "debug".into(),
            host: "here".into(),
            start: "2026-01-01T00:00:00Z".into(),
        },
    }
}

/// The smallest history: one grain, nothing else.
fn bare() -> Layout {
    Layout {
        dimension: 2,
        grains: Grains { id: vec![0], radius: vec![1.0], mass: vec![1.0], inertia: vec![1.0], material: vec![] },
        ..Layout::default()
    }
}

/// Distinct numbers, so that no two arrays can be confused.
fn numbers(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|k| seed + 0.1 * k as f64).collect()
}

struct Sample {
    grains: GrainState,
    walls: WallState,
    contacts: ContactRows,
    bonds: Vec<BondStatus>,
}

/// Plausible data of frame `k` for layout `l`; the number of contacts changes from frame to frame.
fn sample(l: &Layout, k: usize) -> Sample {
    let (d, n, w) = (l.dimension, l.grains.id.len(), l.walls.len());
    let (bonded, m, s) = (!l.bonds.is_empty(), k % 4, k as f64);
    let tangential = l.friction || bonded;
    let rotation = |width| if l.rotation { n * width } else { 0 };
    Sample {
        grains: GrainState {
            position: numbers(n * d, s),
            velocity: numbers(n * d, 1e3 + s),
            angular_velocity: numbers(rotation(if d == 2 { 1 } else { 3 }), 2e3 + s),
            orientation: numbers(rotation(if d == 2 { 1 } else { 4 }), 3e3 + s),
        },
        walls: WallState {
            position: numbers(w * d, 4e3 + s),
            velocity: numbers(w * d, 5e3 + s),
            force: numbers(w * d, 6e3 + s),
        },
        contacts: ContactRows {
            pair: (0..m).map(|c| if c == 2 { [2, -2] } else { [c as i32 % n as i32, 0] }).collect(),
            point: numbers(m * d, 7e3 + s),
            normal: numbers(m * d, 8e3 + s),
            tangent: numbers(if d == 3 && tangential { m * 3 } else { 0 }, 9e3 + s),
            reaction: numbers(if tangential { m * d } else { m }, 1e4 + s),
            moment: numbers(if bonded { m * (d - 1 + usize::from(l.twist)) } else { 0 }, 11e3 + s),
            gap: numbers(m, 12e3 + s),
            status: (0..m).map(|c| ContactStatus::ALL[c % 4]).collect(),
            bond: if bonded { (0..m as i32).map(|c| c - 1).collect() } else { vec![] },
        },
        bonds: (0..l.bonds.len()).map(|b| BondStatus::ALL[(b + k) % 5]).collect(),
    }
}

fn rupture(k: usize) -> Rupture {
    Rupture {
        step: k as i64,
        time: 0.5 * k as f64,
        point: [1.0, 2.0, k as f64],
        normal_force: -5.0,
        tangential_force: 2.0,
        moment: 0.25,
        twist: 0.125,
        energy: 0.125,
        round: 3,
        bond: 1,
        pair: [1, 2],
        mode: RuptureMode::ALL[k % 4],
    }
}

fn write_frame(writer: &mut Writer, l: &Layout, k: usize) {
    let s = sample(l, k);
    let (step, time) = (10 * k as i64, 0.1 * k as f64);
    writer
        .frame(&Frame { step, time, grains: s.grains, walls: s.walls, contacts: s.contacts, bonds: s.bonds })
        .unwrap();
}

/// Writes `frames` frames, ten observed steps and one rupture before each.
fn write(path: &Path, l: &Layout, frames: usize) -> Writer {
    let mut writer = Writer::create(path, l, false).unwrap();
    let width: usize = l.observables.iter().map(Observable::width).sum();
    for k in 0..frames {
        for step in 10 * k..10 * (k + 1) {
            writer.observe(step as i64, 0.01 * step as f64, &numbers(width, step as f64)).unwrap();
        }
        if !l.bonds.is_empty() {
            writer.rupture(&rupture(k)).unwrap();
        }
        write_frame(&mut writer, l, k);
    }
    writer
}

fn check(path: &Path, l: &Layout, frames: usize) {
    let h = History::open(path).unwrap();
    assert_eq!((h.dimension(), h.frames()), (l.dimension, frames));
    assert_eq!(h.grains().unwrap(), l.grains);
    assert_eq!((h.bonds().unwrap(), h.materials().unwrap()), (l.bonds.clone(), l.materials.clone()));
    assert_eq!(h.parameters().unwrap(), l.parameters);
    assert_eq!(h.walls().unwrap(), l.walls);
    for k in 0..frames {
        let s = sample(l, k);
        assert_eq!((h.steps()[k], h.times()[k]), (10 * k as i64, 0.1 * k as f64));
        assert_eq!(h.grain_state(k).unwrap(), s.grains);
        assert_eq!(h.wall_state(k).unwrap(), s.walls);
        assert_eq!(h.contacts(k).unwrap(), s.contacts);
        assert_eq!(h.bond_status(k).unwrap(), s.bonds);
    }
    assert!(matches!(h.contacts(frames), Err(HistoryError::NoFrame { .. })));
    let events: Vec<Rupture> = if l.bonds.is_empty() { vec![] } else { (0..frames).map(rupture).collect() };
    assert_eq!(h.ruptures().unwrap(), events);
    let mut offset = 0;
    for o in &l.observables {
        let series = h.observable(&o.name).unwrap().unwrap();
        assert_eq!((&series.unit, &series.shape), (&o.unit, &o.shape));
        assert_eq!(series.step, (0..10 * frames as i64).collect::<Vec<_>>());
        for (step, value) in series.value.chunks(o.width()).enumerate() {
            let width: usize = l.observables.iter().map(Observable::width).sum();
            assert_eq!(value, &numbers(width, step as f64)[offset..offset + o.width()]);
        }
        offset += o.width();
    }
    assert_eq!(h.observable("nothing").unwrap(), None);
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    (folder, path)
}

fn open_error(path: &Path) -> HistoryError {
    match History::open(path) {
        Ok(_) => panic!("{} was opened", path.display()),
        Err(error) => error,
    }
}

#[test]
fn what_is_written_is_read() {
    // 300 frames cross the blocks of observables and the chunks of frames
    let bonds_without_friction = Layout { friction: false, ..full(3) };
    for (layout, frames) in [(full(2), 300), (full(3), 40), (bare(), 3), (full(2), 0), (bonds_without_friction, 2)] {
        let (_folder, path) = folder();
        write(&path, &layout, frames).finish().unwrap();
        check(&path, &layout, frames);
    }
}

#[test]
fn what_a_scene_lacks_is_absent() {
    let (_folder, path) = folder();
    write(&path, &bare(), 2).finish().unwrap();
    let file = hdf5::File::open(&path).unwrap();
    for absent in ["walls", "bonds", "events", "contacts/moment", "contacts/bond", "commit_rows/events"] {
        assert!(!file.link_exists(absent), "{absent}");
    }
    assert!(!file.group("particles/grains").unwrap().link_exists("angle"));
    assert_eq!(file.dataset("contacts/reaction").unwrap().shape()[1], 1);
}

#[test]
fn units_and_enums_stand_in_the_file() {
    let (_folder, path) = folder();
    write(&path, &full(2), 1).finish().unwrap();
    let file = hdf5::File::open(&path).unwrap();
    let unit = |place: &str| {
        file.dataset(place)
            .unwrap()
            .attr("unit")
            .unwrap()
            .read_scalar::<hdf5::types::VarLenUnicode>()
            .unwrap()
            .to_string()
    };
    assert_eq!(unit("particles/grains/velocity/value"), "m s-1");
    assert_eq!(unit("observables/stress/value"), "Pa");
    let descriptor = file.dataset("bonds/status/value").unwrap().dtype().unwrap().to_descriptor().unwrap();
    assert!(format!("{descriptor:?}").contains("ROLLING"), "{descriptor:?}");
    // shared times are one dataset under many names
    let token = |place: &str| format!("{:?}", file.loc_info_by_name(place).unwrap().token);
    assert_eq!(token("walls/force/time"), token("particles/grains/position/time"));
}

#[test]
fn only_complete_frames_are_seen_in_an_open_file() {
    let (folder, path) = folder();
    let layout = full(2);
    let mut writer = write(&path, &layout, 5);
    for k in 0..1000 {
        writer.observe(k, 0.0, &numbers(6, 0.0)).unwrap();
    }
    // the file of a killed run
    let killed = folder.path().join("killed.h5");
    fs::copy(&path, &killed).unwrap();
    check(&killed, &layout, 5);
    assert!(History::open(&killed).unwrap().open_ended());
    write_frame(&mut writer, &layout, 5);
    fs::copy(&path, &killed).unwrap();
    assert_eq!(History::open(&killed).unwrap().observed_steps(), 1050);
    writer.finish().unwrap();
    assert!(!History::open(&path).unwrap().open_ended());
}

#[test]
fn an_existing_file_is_replaced_only_when_asked() {
    let (folder, path) = folder();
    fs::write(&path, "mine").unwrap();
    let error = Writer::create(&path, &full(2), false).err().unwrap();
    assert!(matches!(error, HistoryError::Exists { .. }));
    for remedy in ["--force", "-o"] {
        assert!(error.to_string().contains(remedy), "{error}");
    }
    // an inconsistent layout leaves the old file unchanged, even where overwriting is allowed
    let mut wrong = full(2);
    wrong.bonds.strength.pop();
    assert!(matches!(Writer::create(&path, &wrong, true), Err(HistoryError::Shape { .. })));
    // so does a layout that HDF5 rejects half-way
    wrong = full(2);
    wrong.observables.push(wrong.observables[0].clone());
    assert!(matches!(Writer::create(&path, &wrong, true), Err(HistoryError::Write { .. })));
    assert_eq!(fs::read(&path).unwrap(), b"mine");
    Writer::create(&path, &full(2), true).unwrap().finish().unwrap();
    check(&path, &full(2), 0);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_file_that_cannot_be_made_is_named() {
    let (folder, _) = folder();
    for path in [folder.path().join("no/such/run.h5"), folder.path().to_path_buf()] {
        let error = Writer::create(&path, &full(2), true).err().unwrap();
        assert!(matches!(error, HistoryError::Io { .. }));
        assert!(error.to_string().contains(&*path.to_string_lossy()), "{error}");
    }
}

#[test]
fn arrays_of_another_length_are_refused_whole() {
    let (_folder, path) = folder();
    let layout = full(2);
    let mut writer = Writer::create(&path, &layout, false).unwrap();
    let mut s = sample(&layout, 3);
    s.contacts.gap.pop();
    let frame = Frame { step: 0, time: 0.0, grains: s.grains, walls: s.walls, contacts: s.contacts, bonds: s.bonds };
    assert!(matches!(writer.frame(&frame), Err(HistoryError::Shape { found: 2, expected: 3, .. })));
    assert!(writer.observe(0, 0.0, &[1.0]).is_err());
    assert_eq!(writer.frames(), 0);
}

#[test]
fn foreign_files_are_told_apart() {
    let (folder, path) = folder();
    assert!(matches!(open_error(&path), HistoryError::Missing { .. }));
    assert!(matches!(open_error(folder.path()), HistoryError::Io { .. }));
    for content in ["", "x,y,radius\n1,2,3\n", "\u{89}"] {
        fs::write(&path, content).unwrap();
        assert!(matches!(open_error(&path), HistoryError::NotHdf5 { .. }), "{content}");
    }
    let file = hdf5::File::create(&path).unwrap();
    file.new_dataset::<f64>().create("commit").unwrap();
    drop(file);
    let error = open_error(&path);
    assert!(matches!(error, HistoryError::Foreign { .. }), "{error}");
    let file = hdf5::File::create(&path).unwrap();
    let creator = file.create_group("h5md").unwrap().create_group("creator").unwrap();
    table::text_attribute(&creator, "name", "espresso").unwrap();
    drop(file);
    let error = open_error(&path);
    assert!(matches!(error, HistoryError::Foreign { .. }) && error.to_string().contains("espresso"), "{error}");
}

#[test]
fn a_newer_schema_is_refused() {
    let (_folder, path) = folder();
    write(&path, &full(2), 1).finish().unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    file.group("parameters").unwrap().attr("schema_version").unwrap().write_scalar(&(SCHEMA_VERSION + 1)).unwrap();
    drop(file);
    let error = open_error(&path);
    assert!(matches!(error, HistoryError::Newer { found, .. } if found == SCHEMA_VERSION + 1), "{error}");
}

#[test]
fn values_that_name_nothing_are_refused() {
    let (_folder, path) = folder();
    write(&path, &full(2), 4).finish().unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    let pair = file.dataset("contacts/pair").unwrap();
    pair.write_slice(ndarray::arr1(&[99i32]).view(), ndarray::s![5..6, 0]).unwrap();
    file.dataset("bonds/status/value").unwrap().write(ndarray::arr2(&[[codes::BondCode(77); 2]; 4]).view()).unwrap();
    file.dataset("contacts/count").unwrap().write(&[0u32, 1, 2, u32::MAX]).unwrap();
    drop((pair, file));
    let h = History::open(&path).unwrap();
    assert!(h.contacts(2).is_ok());
    for (error, place) in [(h.contacts(3).err(), "contacts/count"), (h.bond_status(0).err(), "bonds/status")] {
        assert!(error.unwrap().to_string().contains(place));
    }
}

/// Reads everything; every result or error is accepted, a panic is not.
fn read_all(path: &Path) -> Result<usize> {
    let h = History::open(path)?;
    h.parameters()?;
    h.grains()?;
    h.walls()?;
    h.bonds()?;
    for k in 0..h.frames() {
        h.grain_state(k)?;
        h.wall_state(k)?;
        h.contacts(k)?;
        h.bond_status(k)?;
    }
    h.ruptures()?;
    for name in h.observable_names()? {
        h.observable(&name)?;
    }
    Ok(h.frames())
}

#[test]
fn a_truncated_file_is_refused_wherever_it_is_cut() {
    let (folder, path) = folder();
    let (finished, open) = (folder.path().join("finished.h5"), folder.path().join("open.h5"));
    let writer = write(&path, &full(2), 6);
    fs::copy(&path, &open).unwrap();
    writer.finish().unwrap();
    fs::copy(&path, &finished).unwrap();
    for whole in [&finished, &open] {
        assert_eq!(read_all(whole).unwrap(), 6);
        let bytes = fs::read(whole).unwrap();
        let cuts = (0..64).chain((64..bytes.len()).step_by(997)).chain(bytes.len() - 64..bytes.len());
        for cut in cuts {
            fs::write(&path, &bytes[..cut]).unwrap();
            match read_all(&path) {
                Err(HistoryError::Truncated { .. }) => assert!(cut > 0),
                Err(HistoryError::NotHdf5 { .. }) => assert!(cut == 0),
                // bytes that no complete frame needs may be missing
                Ok(frames) => assert!(frames == 6 && whole == &open),
                Err(error) => panic!("cut at {cut}: {error}"),
            }
        }
    }
}

#[test]
fn a_file_with_wrong_bytes_never_makes_the_reader_panic() {
    let (_folder, path) = folder();
    write(&path, &full(2), 3).finish().unwrap();
    let bytes = fs::read(&path).unwrap();
    let mut state = 1u64;
    for _ in 0..400 {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mut wrong = bytes.clone();
        wrong[(state >> 33) as usize % bytes.len()] ^= (state >> 25) as u8 | 1;
        fs::write(&path, &wrong).unwrap();
        let _ = read_all(&path);
    }
}

#[test]
fn a_packed_history_is_the_same_and_smaller() {
    let (folder, path) = folder();
    let packed = folder.path().join("packed.h5");
    let twisting = Layout { twist: true, bonds: Bonds { twist: Some(vec![0.5, 0.0]), ..full(3).bonds }, ..full(3) };
    for layout in [full(2), full(3), twisting, Layout { single: true, without_reactions: true, ..full(3) }] {
        let _ = fs::remove_file(&path);
        let mut writer = Writer::create(&path, &layout, false).unwrap();
        for k in 0..300 {
            let mut s = sample(&layout, k);
            if layout.without_reactions {
                s.contacts.reaction.clear();
                s.contacts.tangent.clear();
                s.contacts.moment.clear();
            }
            let Sample { grains, walls, contacts, bonds } = s;
            writer.frame(&Frame { step: k as i64, time: k as f64, grains, walls, contacts, bonds }).unwrap();
        }
        let checkpoint = Checkpoint { step: 299, reals: numbers(1000, 0.5), counts: (0..70).collect() };
        writer.checkpoint(&Checkpoint { step: 17, ..checkpoint.clone() }).unwrap();
        writer.checkpoint(&checkpoint).unwrap();
        // also for the file of a killed run
        std::mem::forget(writer);
        let history = History::open(&path).unwrap();
        let mut last = 0.0;
        let mut tell = |done: f64| {
            assert!(done >= last && done <= 1.0);
            last = done;
            true
        };
        let length = copy(&history, &packed, CopyAs::Packed, &mut tell).unwrap();
        assert!(last > 0.99, "{last}");
        let copied = History::open(&packed).unwrap();
        assert_eq!(length, fs::metadata(&packed).unwrap().len());
        assert!(!copied.open_ended() && history.open_ended());
        assert_eq!(copied.layout().unwrap(), history.layout().unwrap());
        assert_eq!(copied.checkpoint().unwrap(), Some(checkpoint));
        assert_eq!((copied.steps(), copied.times()), (history.steps(), history.times()));
        for frame in 0..history.frames() {
            assert_eq!(copied.grain_state(frame).unwrap(), history.grain_state(frame).unwrap());
            assert_eq!(copied.contacts(frame).unwrap(), history.contacts(frame).unwrap());
            assert_eq!(copied.bond_status(frame).unwrap(), history.bond_status(frame).unwrap());
        }
        let plain = folder.path().join("plain.h5");
        copy(&copied, &plain, CopyAs::Plain, &mut |_| true).unwrap();
        assert!(length < fs::metadata(&plain).unwrap().len());
        assert_eq!(History::open(&plain).unwrap().layout().unwrap(), history.layout().unwrap());
    }
}

#[test]
fn a_copy_that_is_ended_leaves_everything_as_it_was() {
    let (folder, path) = folder();
    drop(write(&path, &full(2), 20));
    let before = fs::read(&path).unwrap();
    let history = History::open(&path).unwrap();
    let ended = copy(&history, &path, CopyAs::Packed, &mut |done| done < 0.3);
    assert!(matches!(ended, Err(HistoryError::Interrupted)));
    assert_eq!(fs::read(&path).unwrap(), before);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// A minimal history of the solver's observables: these routes (as numbers) and load errors.
fn solved(path: &Path, observables: Vec<Observable>, rows: &[&[f64]]) -> Writer {
    let layout = Layout { observables, ..bare() };
    let mut writer = Writer::create(path, &layout, false).unwrap();
    for (step, row) in rows.iter().enumerate() {
        writer.observe(step as i64, step as f64, row).unwrap();
    }
    write_frame(&mut writer, &layout, 0);
    writer
}

fn of_solver() -> Vec<Observable> {
    let real = |name: &str| Observable::new(name, "", &[]);
    vec![Observable::route(), real(LOAD_ERROR), real(FALSE_ACCELERATION)]
}

#[test]
fn the_route_is_an_enumeration_and_read_as_its_codes() {
    let (folder, path) = folder();
    let routes: Vec<f64> = SolverRoute::ALL.iter().map(|route| route.number()).collect();
    let rows: Vec<[f64; 3]> = routes.iter().map(|route| [*route, 1e-6, 0.5]).collect();
    solved(&path, of_solver(), &rows.iter().map(|row| &row[..]).collect::<Vec<_>>()).finish().unwrap();
    let packed = folder.path().join("packed.h5");
    let history = History::open(&path).unwrap();
    copy(&history, &packed, CopyAs::Packed, &mut |_| true).unwrap();
    drop(history);
    for path in [&path, &packed] {
        let file = hdf5::File::open(path).unwrap();
        let descriptor = file.dataset("observables/solver_route/value").unwrap().dtype().unwrap().to_descriptor();
        assert_eq!(descriptor.unwrap(), <codes::RouteCode as hdf5::H5Type>::type_descriptor());
        drop(file);
        let history = History::open(path).unwrap();
        assert_eq!(history.observable(ROUTE).unwrap().unwrap().value, routes);
        let kinds = history.layout().unwrap().observables.into_iter().map(|observable| observable.kind);
        assert_eq!(kinds.collect::<Vec<_>>(), [ValueKind::Real, ValueKind::Real, ValueKind::Route]);
    }
    let file = hdf5::File::open_rw(&path).unwrap();
    let values = file.dataset("observables/solver_route/value").unwrap();
    values.write(&[0, 1, 7, 3].map(codes::RouteCode)).unwrap();
    drop((values, file));
    let error = History::open(&path).unwrap().observable(ROUTE).unwrap_err().to_string();
    assert!(error.contains("solver_route") && error.contains("unknown value"), "{error}");
}

#[test]
fn a_route_that_is_none_is_not_written() {
    let (_folder, path) = folder();
    let layout = Layout { observables: of_solver(), ..bare() };
    let mut writer = Writer::create(&path, &layout, false).unwrap();
    writer.observe(0, 0.0, &[4.0, 0.0, 0.0]).unwrap();
    let Sample { grains, walls, contacts, bonds } = sample(&layout, 0);
    let error = writer.frame(&Frame { grains, walls, contacts, bonds, ..Frame::default() }).unwrap_err();
    assert!(matches!(error, HistoryError::Write { .. }), "{error}");
    writer.abandon();
}

#[test]
fn only_a_load_error_may_be_no_number() {
    for (name, column) in [(LOAD_ERROR, 1), (FALSE_ACCELERATION, 2)] {
        let (_folder, path) = folder();
        let mut row = [3.0, 0.0, 0.0];
        row[column] = f64::NAN;
        solved(&path, of_solver(), &[&row]).finish().unwrap();
        let read = History::open(&path).unwrap().observable(name);
        match name {
            LOAD_ERROR => assert!(read.unwrap().unwrap().value[0].is_nan()),
            _ => assert!(read.unwrap_err().to_string().contains("not a plausible number")),
        }
    }
}

/// The version of a copy shows whether its load error may be a false acceleration.
#[test]
fn a_copy_keeps_the_meaning_of_its_load_error() {
    for (observables, version) in [(of_solver(), SCHEMA_VERSION), (vec![Observable::new(LOAD_ERROR, "", &[])], 3)] {
        let (folder, path) = folder();
        let packed = folder.path().join("packed.h5");
        let row = &[1.0, 2.0, 3.0][..observables.len()];
        solved(&path, observables, &[row]).finish().unwrap();
        let history = History::open(&path).unwrap();
        copy(&history, &packed, CopyAs::Packed, &mut |_| true).unwrap();
        let parameters = hdf5::File::open(&packed).unwrap().group("parameters").unwrap();
        assert_eq!(parameters.attr("schema_version").unwrap().read_scalar::<u32>().unwrap(), version);
    }
}
