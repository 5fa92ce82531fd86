//! Every analysis of histories with one corrupted value each: nothing panics, nothing is drawn, and
//! `info --check` reports the place.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dem_post::output::{Folder, PostError, Result};
use dem_post::{
    chains, check, compare, cracks, emission, envelope, fabric, film, frames, info, pack, report, strength,
    stress_strain, velocities, view, why,
};
use hdf5::types::{IntSize, TypeDescriptor};
use hdf5::{File, H5Type};

use super::check::{Code, EventBond, EventForce, EventGrain, EventMode, EventRound, EventStep, EventTime, Mode};
use super::check::{damaged, member, put};
use super::*;

member!(EventX, x, f64);
member!(EventTwist, twist, f64);
member!(EventOther, j, i32);

/// Writes a wrong value at an index of a dataset.
type Spoil = Box<dyn Fn(&File, &str, &[usize])>;

fn spoil<T: H5Type + Copy>(value: T) -> Spoil {
    Box::new(move |file, place, index| put(file, place, index, value))
}

/// Values that are wrong in any dataset of a type, with their names.
fn spoils(place: &str, kind: &TypeDescriptor) -> Vec<(String, Spoil)> {
    fn named<T: H5Type + Copy + std::fmt::Debug>(values: &[T]) -> Vec<(String, Spoil)> {
        values.iter().map(|value| (format!("{value:?}"), spoil(*value))).collect()
    }
    match (kind, place) {
        (TypeDescriptor::Float(_), _) => named(&[f64::NAN, f64::NEG_INFINITY, 1e300, -1e300]),
        (TypeDescriptor::Integer(IntSize::U8), _) => named(&[i64::MIN, i64::MAX]),
        (TypeDescriptor::Integer(_), _) => named(&[100_000_000, -100_000_000]),
        (TypeDescriptor::Unsigned(IntSize::U8), _) => named(&[u64::MAX, 100_000_000]),
        (TypeDescriptor::Unsigned(_), _) => named(&[u32::MAX, 1_000]),
        (TypeDescriptor::Enum(_), "bonds/status/value") => vec![("code".into(), spoil(Code::<0>(250)))],
        (TypeDescriptor::Enum(_), "contacts/status") => vec![("code".into(), spoil(Code::<1>(250)))],
        (TypeDescriptor::Enum(_), "walls/kind") => vec![("code".into(), spoil(Code::<2>(250)))],
        (TypeDescriptor::Enum(_), "walls/drive") => vec![("code".into(), spoil(Code::<3>(250)))],
        (TypeDescriptor::Enum(_), "ending") => vec![("code".into(), spoil(Code::<4>(250)))],
        (TypeDescriptor::Compound(_), _) => vec![
            ("step".into(), spoil(EventStep { step: i64::MAX })),
            ("time".into(), spoil(EventTime { time: f64::NAN })),
            ("time of the next year".into(), spoil(EventTime { time: 3e7 })),
            ("x".into(), spoil(EventX { x: f64::INFINITY })),
            ("force".into(), spoil(EventForce { rn: 1e300 })),
            ("twist".into(), spoil(EventTwist { twist: f64::INFINITY })),
            ("round".into(), spoil(EventRound { round: i32::MIN })),
            ("bond".into(), spoil(EventBond { bond: 100_000_000 })),
            ("no bond".into(), spoil(EventBond { bond: -1 })),
            ("i".into(), spoil(EventGrain { i: -3 })),
            ("j".into(), spoil(EventOther { j: 4 })),
            ("mode".into(), spoil(EventMode { mode: Mode(0) })),
        ],
        (other, _) => panic!("{place}: no wrong value of {other}"),
    }
}

/// The datasets below a group that hold numbers, each under one of its paths.
fn datasets(group: &hdf5::Group, seen: &mut Vec<String>) -> Vec<String> {
    let mut found = vec![];
    for dataset in group.datasets().unwrap() {
        let token = format!("{:?}", dataset.loc_info().unwrap().token);
        // checkpoint slots have a checksum; texts are not numbers
        let name = dataset.name().trim_start_matches('/').to_string();
        let text = matches!(dataset.dtype().unwrap().to_descriptor(), Ok(TypeDescriptor::VarLenUnicode));
        // the names of axes have no values
        let values = dataset.size() > 0 && dataset.storage_size() > 0;
        if !seen.contains(&token) && !text && !name.starts_with("checkpoint/") && values {
            found.push(name);
        }
        seen.push(token);
    }
    for inner in group.groups().unwrap() {
        found.extend(datasets(&inner, seen));
    }
    found
}

type Command<'a> = (&'static str, Box<dyn Fn(&History, &mut Folder) -> Result<()> + 'a>);

fn command<'a>(name: &'static str, run: impl Fn(&History, &mut Folder) -> Result<()> + 'a) -> Command<'a> {
    (name, Box::new(run))
}

/// The reading part of every command.
fn reads(good: &Path) -> Vec<Command<'_>> {
    vec![
        command("info", |h, _| info::read(h).map(|report| drop(report.table()))),
        command("cracks", |h, _| cracks::read(h, true).map(|report| drop(report.table()))),
        command("emission", |h, _| emission::read(h, &emission::Options::default()).map(|report| drop(report.table()))),
        command("why", |h, _| why::read(h, why::Which::Number(0), None, true).map(|report| drop(report.table()))),
        command("chains", |h, _| chains::read(h, &[]).map(|report| drop(report.table()))),
        command("velocities", |h, _| velocities::read(h, &[]).map(|report| drop(report.table()))),
        command("fabric", |h, _| fabric::read(h, &[], true).map(|report| drop(report.table()))),
        command("report", |h, _| report::read(h, &[], None, None, true).map(|report| drop(report.table()))),
        command("stress-strain", |h, _| stress_strain::read(h, None).map(|report| drop(report.table()))),
        command("frames", |h, _| frames::read(h, frames::Subject::Forces, 1, &[]).map(drop)),
        command("film", |h, _| film::read(h, frames::Subject::Bonds, None, 1).map(drop)),
        command("compare", |h, _| compare::read(h, &History::open(good)?, 0.0).map(|report| drop(report.table()))),
        command("strength", |h, _| {
            let runs = [good.to_path_buf(), h.path().to_path_buf()];
            let options = strength::Options { against: None, measure: strength::Measure::Broken, wall: None };
            strength::read(&runs, &options).map(drop)
        }),
        command("envelope", |h, _| {
            let runs = [good.to_path_buf(), h.path().to_path_buf()];
            envelope::read(&runs, strength::Measure::Broken, None).map(|report| drop(report.table()))
        }),
        command("view", |h, _| view::read(h, view::Format::Vtkhdf, true).map(|report| drop(report.table()))),
        command("pack", |h, folder| pack::write(h, &folder.path().join("packed.h5"), CopyAs::Packed, true).map(drop)),
    ]
}

/// The writing part of every command.
fn writes(good: &Path) -> Vec<Command<'_>> {
    vec![
        command("cracks", |h, folder| cracks::write(h, &cracks::read(h, true)?, &[], cracks::ColourBy::Time, folder)),
        command("emission", |h, folder| emission::write(&emission::read(h, &emission::Options::default())?, folder)),
        command("why", |h, folder| why::write(&why::read(h, why::Which::Number(0), None, true)?, folder)),
        command("chains", |h, folder| chains::write(h, &chains::read(h, &[])?, folder)),
        command("velocities", |h, folder| velocities::write(h, &velocities::read(h, &[])?, folder)),
        command("fabric", |h, folder| fabric::write(&fabric::read(h, &[], true)?, folder)),
        command("report", |h, folder| report::write(h, &report::read(h, &[], None, None, true)?, folder)),
        command("stress-strain", |h, folder| stress_strain::write(&stress_strain::read(h, None)?, folder)),
        command("frames", |h, folder| {
            frames::write(h, &frames::read(h, frames::Subject::Bonds, 10, &[])?, folder, true)
        }),
        command("film", |h, folder| film::write(h, &mut film::read(h, frames::Subject::Bonds, None, 1)?, folder, true)),
        command("compare", |h, folder| compare::write(h, &compare::read(h, &History::open(good)?, 0.0)?, folder)),
        command("envelope", |h, folder| {
            let runs = [good.to_path_buf(), h.path().to_path_buf()];
            envelope::write(&envelope::read(&runs, strength::Measure::Broken, None)?, folder)
        }),
        command("view", |h, folder| view::write(h, &mut view::read(h, view::Format::Vtkhdf, true)?, folder, true)),
        command("view vtp", |h, folder| view::write(h, &mut view::read(h, view::Format::Vtp, true)?, folder, true)),
        command("view lammps", |h, folder| {
            view::write(h, &mut view::read(h, view::Format::Lammps, true)?, folder, true)
        }),
    ]
}

/// Names of the commands that reject the history when they read it or, if none does, when they
/// write their results.
fn tried(path: &Path, good: &Path, what: &str) -> Vec<&'static str> {
    let output = tempfile::tempdir().unwrap();
    let mut refused = vec![];
    let mut all = |commands: Vec<Command>| {
        for (name, command) in commands {
            let mut folder = Folder::create(output.path().join(name)).unwrap();
            let outcome = catch_unwind(AssertUnwindSafe(|| command(&History::open(path)?, &mut folder)));
            match outcome.unwrap_or_else(|_| panic!("{what}: {name} panics")) {
                Ok(()) => {}
                // runs without a difference have no varied field
                Err(PostError::Usage(_) | PostError::Lacking { .. }) if name == "strength" => {}
                Err(error) => {
                    let text = error.to_string();
                    assert_eq!(error.exit_code(), 4, "{what}: {name}: {text}");
                    assert!(
                        text.contains("is damaged at /") && text.contains("info --check"),
                        "{what}: {name}: {text}"
                    );
                    refused.push(name);
                }
            }
        }
        refused.clone()
    };
    let found = all(reads(good));
    if found.is_empty() { all(writes(good)) } else { found }
}

/// Datasets that no analysis reads, or in which any number is valid; any step is valid too.
const UNREAD: &[&str] = &[
    "particles/grains/id",
    "particles/grains/inertia",
    "particles/grains/angular_velocity",
    "particles/grains/orientation",
    "commit_rows/",
];

#[test]
fn no_spoilt_value_makes_an_analysis_panic_or_pass_unseen() {
    let (mut count, mut unseen) = (0, vec![]);
    for l in [layout(2), Layout { rotation: true, twist: true, ..layout(3) }] {
        let (folder, path) = sample(&l);
        let (good, sound, space) = (folder.path().join("good.h5"), folder.path().join("sound.h5"), l.dimension == 3);
        std::fs::copy(&path, &good).unwrap();
        std::fs::copy(&path, &sound).unwrap();
        assert_eq!(tried(&sound, &good, "a sound history"), Vec::<&str>::new());
        let file = File::open(&good).unwrap();
        let places = datasets(&file, &mut vec![]);
        let kind = |place: &str| file.dataset(place).unwrap().dtype().unwrap().to_descriptor().unwrap();
        let kinds: Vec<_> =
            places.iter().map(|place| (place, kind(place), file.dataset(place).unwrap().shape())).collect();
        drop(file);
        for (place, kind, shape) in kinds {
            for (k, (value, spoil)) in spoils(place, &kind).into_iter().enumerate() {
                // half of the values in 2D, the others in 3D; the last and the first number
                // alternate
                if place != "events/rupture" && (k % 2 == 1) != space {
                    continue;
                }
                // contacts are read at the last frame, not at the first
                let last = k % 4 < 2 || place.starts_with("contacts/");
                let index: Vec<usize> = shape.iter().map(|&n| if last { n - 1 } else { 0 }).collect();
                let what = format!("{}D, /{place} {index:?} = {value}", l.dimension);
                let copy = folder.path().join(format!("spoilt-{count}.h5"));
                std::fs::copy(&good, &copy).unwrap();
                let copy = damaged(&copy, |file| spoil(file, place, &index));
                let refused = tried(&copy, &good, &what);
                let found = History::open_as_is(&copy).map_err(PostError::from).and_then(|h| check::read(&h, true));
                let named = found.as_ref().map_or(true, |found| found.count() > 0);
                assert!(named || place == "particles/grains/id", "{what}: info --check finds nothing");
                if refused.is_empty()
                    && !place.ends_with("/step")
                    && !UNREAD.iter().any(|unread| place.starts_with(unread))
                {
                    unseen.push(what);
                }
                std::fs::remove_file(&copy).unwrap();
                count += 1;
            }
        }
    }
    assert!(unseen.is_empty(), "no analysis refuses\n{}", unseen.join("\n"));
    assert!(count > 150, "{count}");
}

/// A command, the words of its error, and the damage.
type Refused<'a> = (&'a str, &'a [&'a str], &'a dyn Fn(&File));

#[test]
fn a_command_names_file_dataset_and_row_of_what_is_wrong() {
    let spoilt: [Refused; 5] = [
        ("cracks", &["/events/rupture", "row 1", "100000000 is not one of the 4 bonds"], &|file| {
            put(file, "events/rupture", &[1], EventBond { bond: 100_000_000 });
        }),
        ("chains", &["/contacts/pair", "row 40", "9, 0 are not a pair of bodies"], &|file| {
            put(file, "contacts/pair", &[40, 0], 9i32);
        }),
        ("chains", &["/contacts/count", "row 10", "belong to the frame"], &|file| {
            put(file, "contacts/start", &[10], 20u64);
        }),
        ("velocities", &["/particles/grains/position/value", "row 10", "1e300"], &|file| {
            put(file, "particles/grains/position/value", &[10, 2, 1], 1e300);
        }),
        ("cracks", &["/particles/grains/position/time", "row 4", "does not come after"], &|file| {
            put(file, "particles/grains/position/time", &[4], 0.01);
        }),
    ];
    for (command, words, damage) in spoilt {
        let (_folder, path) = sample(&layout(2));
        let path = damaged(&path, damage);
        let words = [&["run.damaged.h5", "dem-post info --check"], words].concat();
        refused(&dem_post(&path, &[command]), 4, &words);
        assert_eq!(super::check::check(&path).0.status.code(), Some(4));
    }
}
