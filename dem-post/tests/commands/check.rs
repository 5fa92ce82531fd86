//! `info --check`: sound histories pass, and every damage is reported with its place and row.

use hdf5::types::{EnumMember, EnumType, IntSize, TypeDescriptor, VarLenUnicode};
use hdf5::{File, H5Type, Hyperslab, SliceOrIndex};

use super::*;

/// A byte where one of an enumeration is expected: 0 for the states of bonds, 1 for contacts, 2 for
/// walls, 3 for drives, 4 for endings.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Code<const OF: usize>(pub u8);

// Sound: transparent over the integer that is the enumeration's base type.
unsafe impl<const OF: usize> H5Type for Code<OF> {
    fn type_descriptor() -> TypeDescriptor {
        let names: Vec<&str> = match OF {
            0 => BondStatus::ALL.iter().map(|status| status.label()).collect(),
            1 => ContactStatus::ALL.iter().map(|status| status.label()).collect(),
            2 => WallKind::ALL.iter().map(|kind| kind.label()).collect(),
            3 => WallDrive::ALL.iter().map(|drive| drive.label()).collect(),
            _ => Ending::ALL.iter().map(|ending| ending.label()).collect(),
        };
        let members = names.iter().zip(0..).map(|(name, value)| EnumMember { name: name.to_string(), value }).collect();
        TypeDescriptor::Enum(EnumType { size: IntSize::U1, signed: false, members })
    }
}

/// One member of a rupture; HDF5 leaves the others as they are.
macro_rules! member {
    ($name:ident, $member:ident, $kind:ty) => {
        #[derive(Clone, Copy, H5Type)]
        #[repr(C)]
        pub struct $name {
            pub $member: $kind,
        }
    };
}
pub(super) use member;
member!(EventStep, step, i64);
member!(EventTime, time, f64);
member!(EventRound, round, i32);
member!(EventForce, rn, f64);
member!(EventBond, bond, i32);
member!(EventGrain, i, i32);
member!(EventMode, mode, Mode);

#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Mode(pub i32);

// Sound: as above.
unsafe impl H5Type for Mode {
    fn type_descriptor() -> TypeDescriptor {
        let members = RuptureMode::ALL.iter().zip(1..);
        let members = members.map(|(mode, value)| EnumMember { name: mode.label().into(), value }).collect();
        TypeDescriptor::Enum(EnumType { size: IntSize::U4, signed: true, members })
    }
}

/// Writes `value` at `index` of a dataset.
pub fn put<T: H5Type>(file: &File, place: &str, index: &[usize], value: T) {
    let slices: Vec<SliceOrIndex> = index.iter().map(|&k| SliceOrIndex::from(k..k + 1)).collect();
    let one = ndarray::ArrayD::from_shape_vec(vec![1; index.len()], vec![value]).unwrap();
    file.dataset(place).unwrap().write_slice(one.view(), Hyperslab::from(slices)).unwrap();
}

/// Replaces a dataset.
fn replace<T: H5Type>(file: &File, place: &str, values: &[T], unit: &str) {
    file.unlink(place).unwrap();
    let dataset = file.new_dataset_builder().with_data(values).create(place).unwrap();
    if !unit.is_empty() {
        dataset.new_attr::<VarLenUnicode>().create("unit").unwrap().write_scalar(&text(unit)).unwrap();
    }
}

fn text(value: &str) -> VarLenUnicode {
    value.parse().unwrap()
}

/// Place, row and words of the violation that a damage causes, and the damage.
type Damage = (&'static str, Option<usize>, &'static str, fn(&File));

/// Frames are at steps 0, 10 … 100 with four contacts each: 3–0, 2–1, and 0 and 3 with walls. Bond
/// 0 (0–1) breaks in shear at step 30, bond 1 (1–2) in tension at step 60.
const DAMAGES: &[Damage] = &[
    // names, types, shapes, units
    ("particles/grains/mass", None, "is missing", |f| f.unlink("particles/grains/mass").unwrap()),
    ("walls/force/value", None, "is missing", |f| f.unlink("walls/force/value").unwrap()),
    ("observables/strain/time", None, "is missing", |f| f.unlink("observables/strain/time").unwrap()),
    ("bonds", None, "/events exists", |f| f.unlink("bonds").unwrap()),
    ("particles/grains/mass", None, "float32", |f| replace(f, "particles/grains/mass", &[1f32; 4], "kg")),
    ("bonds/strength", None, "shape [3] instead of [4]", |f| replace(f, "bonds/strength", &[10f64; 3], "N")),
    ("contacts/gap", None, "instead of [44]", |f| f.dataset("contacts/gap").unwrap().resize([43]).unwrap()),
    ("contacts/status", None, "enum of OPEN = 0", |f| replace(f, "contacts/status", &[1u8; 44], "")),
    ("events/rupture", None, "compound", |f| replace(f, "events/rupture", &[1f64; 2], "")),
    ("contacts/gap", None, "no attribute unit, but \"m\"", |f| {
        f.dataset("contacts/gap").unwrap().delete_attr("unit").unwrap();
    }),
    ("bonds/friction", None, "unit \"N\" instead of \"\"", |f| replace(f, "bonds/friction", &[0.3f64; 4], "N")),
    ("contacts/reaction@frame", None, "local", |f| {
        f.dataset("contacts/reaction").unwrap().delete_attr("frame").unwrap();
    }),
    ("parameters@host", None, "is missing", |f| f.group("parameters").unwrap().delete_attr("host").unwrap()),
    ("h5md@version", None, "[1, 1]", |f| f.group("h5md").unwrap().delete_attr("version").unwrap()),
    ("parameters/scene", None, "JSON", |f| f.dataset("parameters/scene").unwrap().write_scalar(&text("{")).unwrap()),
    ("particles/grains/box@boundary", None, "each of 2 axes", |f| {
        f.group("particles/grains/box").unwrap().delete_attr("boundary").unwrap();
    }),
    // order
    ("particles/grains/position/step", Some(4), "30 does not come after 30", |f| {
        put(f, "particles/grains/position/step", &[4], 30i64);
    }),
    ("particles/grains/position/time", Some(4), "does not come after", |f| {
        put(f, "particles/grains/position/time", &[4], 0.01);
    }),
    ("observables/step", Some(50), "49 does not come after 49", |f| put(f, "observables/step", &[50], 49i64)),
    ("contacts/step", Some(0), "differs", |f| replace(f, "contacts/step", &[7i64; 11], "")),
    ("commit_rows/steps", Some(5), "1 rows after 41", |f| put(f, "commit_rows/steps", &[5], 1u64)),
    ("contacts/count", Some(2), "ends at row 12, but 11 rows", |f| put(f, "commit_rows/contacts", &[2], 11u64)),
    ("contacts/start", Some(3), "13, but the frame before ends at 12", |f| put(f, "contacts/start", &[3], 13u64)),
    ("contacts/count", Some(3), "ends at row 14, but 16", |f| put(f, "contacts/count", &[3], 2u32)),
    ("events/rupture", Some(1), "is complete with frame 5", |f| put(f, "commit_rows/events", &[5], 2u64)),
    // numbers
    ("particles/grains/position/value", Some(7), "NaN", |f| {
        put(f, "particles/grains/position/value", &[7, 2, 1], f64::NAN);
    }),
    ("observables/stress/value", Some(33), "inf", |f| put(f, "observables/stress/value", &[33, 1, 1], f64::INFINITY)),
    ("contacts/reaction", Some(9), "NaN", |f| put(f, "contacts/reaction", &[9, 1], f64::NAN)),
    ("events/rupture", Some(1), "not a finite number", |f| put(f, "events/rupture", &[1], EventForce { rn: f64::NAN })),
    ("particles/grains/radius", Some(1), "not positive", |f| put(f, "particles/grains/radius", &[1], -1.0)),
    ("particles/grains/radius", Some(2), "half the grains have at most 1e-3", |f| {
        put(f, "particles/grains/radius", &[2], 2e3);
    }),
    ("particles/grains/mass", Some(0), "1e300 is not a plausible number", |f| {
        put(f, "particles/grains/mass", &[0], 1e300);
    }),
    ("particles/grains/inertia", Some(3), "-1 is negative", |f| put(f, "particles/grains/inertia", &[3], -1.0)),
    ("particles/grains/position/value", Some(7), "1e300 is not a plausible number", |f| {
        put(f, "particles/grains/position/value", &[7, 2, 1], 1e300);
    }),
    ("particles/grains/position/value", Some(0), "1e300 is not a plausible number", |f| {
        put(f, "particles/grains/position/value", &[0, 0, 0], 1e300);
    }),
    ("particles/grains/position/value", Some(9), "grain 3 is at [9000.0,", |f| {
        put(f, "particles/grains/position/value", &[9, 3, 0], 9e3);
    }),
    ("walls/normal", Some(1), "not a unit vector", |f| put(f, "walls/normal", &[1, 1], 0.0)),
    ("walls/direction", Some(1), "not a unit vector", |f| put(f, "walls/direction", &[1, 0], 1.0)),
    ("contacts/normal", Some(8), "not a unit vector", |f| put(f, "contacts/normal", &[8, 0], 0.5)),
    ("bonds/mean_diameter", Some(2), "not positive", |f| put(f, "bonds/mean_diameter", &[2], 0.0)),
    ("bonds/strength", Some(2), "-1 is negative", |f| put(f, "bonds/strength", &[2], -1.0)),
    ("events/rupture", Some(1), "1e300 is not a plausible number", |f| {
        put(f, "events/rupture", &[1], EventForce { rn: 1e300 });
    }),
    ("events/rupture", Some(1), "0.03 s is not the time of step 60", |f| {
        put(f, "events/rupture", &[1], EventTime { time: 0.03 });
    }),
    ("events/rupture", Some(0), "-1 is not a round", |f| put(f, "events/rupture", &[0], EventRound { round: -1 })),
    // enumerations
    ("walls/kind", Some(1), "unknown code 9", |f| put(f, "walls/kind", &[1], Code::<2>(9))),
    ("contacts/status", Some(6), "unknown code 9", |f| put(f, "contacts/status", &[6], Code::<1>(9))),
    ("bonds/status/value", Some(8), "bond 2: unknown code 9", |f| {
        put(f, "bonds/status/value", &[8, 2], Code::<0>(9));
    }),
    ("events/rupture", Some(0), "unknown mode 9", |f| put(f, "events/rupture", &[0], EventMode { mode: Mode(9) })),
    // bodies and bonds
    ("contacts/pair", Some(5), "9, 1 are not", |f| put(f, "contacts/pair", &[5, 0], 9i32)),
    ("contacts/pair", Some(5), "2, 2 are not", |f| put(f, "contacts/pair", &[5, 1], 2i32)),
    ("contacts/pair", Some(6), "2 walls", |f| put(f, "contacts/pair", &[6, 1], -3i32)),
    ("bonds/pair", Some(3), "3, 4 are not", |f| put(f, "bonds/pair", &[3, 1], 4i32)),
    ("contacts/bond", Some(4), "4 is not one of the 4 bonds", |f| put(f, "contacts/bond", &[4], 4i32)),
    ("contacts/bond", Some(4), "joins other grains, 2 and 3", |f| put(f, "contacts/bond", &[4], 2i32)),
    ("contacts/bond", Some(25), "bond 1 is broken at frame 6", |f| put(f, "contacts/bond", &[25], 1i32)),
    ("contacts/bond", Some(4), "the contact is BONDED", |f| put(f, "contacts/status", &[4], Code::<1>(3))),
    ("bonds/status/value", Some(7), "bond 0: 0 after 2", |f| put(f, "bonds/status/value", &[7, 0], Code::<0>(0))),
    ("bonds/status/value", Some(7), "bond 0: 1 after 2", |f| put(f, "bonds/status/value", &[7, 0], Code::<0>(1))),
    // ruptures
    ("bonds/status/value", Some(10), "bond 2 is broken, but", |f| {
        put(f, "bonds/status/value", &[10, 2], Code::<0>(1));
    }),
    ("events/rupture", Some(1), "bond 1 is intact until the end", |f| {
        (6..11).for_each(|frame| put(f, "bonds/status/value", &[frame, 1], Code::<0>(0)));
    }),
    ("events/rupture", Some(1), "bond 0 broke before, in row 0", |f| {
        put(f, "events/rupture", &[1], EventBond { bond: 0 });
    }),
    ("events/rupture", Some(1), "100000000 is not one of the 4 bonds", |f| {
        put(f, "events/rupture", &[1], EventBond { bond: 100_000_000 });
    }),
    ("events/rupture", Some(1), "5 is not one of the 4 bonds", |f| {
        put(f, "events/rupture", &[1], EventBond { bond: 5 })
    }),
    ("events/rupture", Some(0), "joins other grains, 0 and 1", |f| put(f, "events/rupture", &[0], EventGrain { i: 2 })),
    ("events/rupture", Some(0), "bond 0 broke by mode 1, but its state is 2", |f| {
        put(f, "events/rupture", &[0], EventMode { mode: Mode(1) });
    }),
    ("events/rupture", Some(1), "its state changes at frame 6", |f| {
        put(f, "events/rupture", &[1], EventStep { step: 45 });
    }),
    ("events/rupture", Some(1), "step 15 after step 30", |f| put(f, "events/rupture", &[1], EventStep { step: 15 })),
];

/// Damages a file and returns a copy: programs that other tests start in the meantime inherit the
/// original and HDF5's lock on it.
pub fn damaged(path: &Path, damage: impl Fn(&File)) -> PathBuf {
    damage(&File::open_rw(path).unwrap());
    let copy = path.with_extension("damaged.h5");
    std::fs::copy(path, &copy).unwrap();
    copy
}

pub fn check(path: &Path) -> (Output, serde_json::Value) {
    let output = dem_post(path, &["info", "--check", "--json"]);
    let found = serde_json::from_slice(&output.stdout);
    let found = found.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    (output, found)
}

#[test]
fn sound_histories_pass() {
    let loose = Layout { bonds: Bonds::default(), ..layout(2) };
    let smooth = Layout { friction: false, ..layout(3) };
    let free = Layout { walls: vec![], observables: vec![], ..layout(2) };
    for l in [layout(2), layout(3), Layout { rotation: true, ..layout(3) }, loose, smooth, free] {
        let (_folder, path) = sample(&l);
        let (output, found) = check(&path);
        assert_eq!(output.status.code(), Some(0), "{found:#}");
        assert!(found["violations"].as_array().unwrap().is_empty());
        assert!(found["numbers"].as_u64().unwrap() > 500);
        assert!(output.stderr.is_empty());
    }
}

#[test]
fn every_damage_is_named() {
    let (folder, path) = sample(&layout(2));
    for (k, (place, row, words, damage)) in DAMAGES.iter().enumerate() {
        let copy = folder.path().join(format!("{k}.h5"));
        std::fs::copy(&path, &copy).unwrap();
        let copy = damaged(&copy, damage);
        let (output, found) = check(&copy);
        assert_eq!(output.status.code(), Some(4), "{place}: {words}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("is damaged"));
        let named = found["violations"].as_array().unwrap().iter().any(|violation| {
            violation["place"] == *place
                && violation["row"] == serde_json::json!(row)
                && violation["what"].as_str().unwrap().contains(words)
        });
        assert!(named, "{place} {row:?} {words}: {:#}", found["violations"]);
    }
}

#[test]
fn a_flood_of_violations_is_bounded_and_counted() {
    let (_folder, path) = sample(&layout(2));
    let path = damaged(&path, |file| {
        file.dataset("contacts/gap").unwrap().write(&[f64::NAN; 44]).unwrap();
        put(file, "particles/grains/mass", &[3], f64::NAN);
    });
    let (_, found) = check(&path);
    assert_eq!(found["violations"].as_array().unwrap().len(), 11);
    assert_eq!(found["more"], serde_json::json!({"contacts/gap": 34}));
    let table = String::from_utf8(dem_post(&path, &["info", "--check"]).stdout).unwrap();
    for line in
        ["no, 45 violations", "/particles/grains/mass row 3: NaN is not a finite number", "/contacts/gap: 34 more"]
    {
        assert!(table.contains(line), "{table}");
    }
}

#[test]
fn an_open_history_is_checked_to_its_last_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.h5");
    let l = layout(2);
    let mut writer = Writer::create(&path, &l, false).unwrap();
    frame(&mut writer, &l, COURSE, 0, 4e-3);
    let copy = folder.path().join("copy.h5");
    std::fs::copy(&path, &copy).unwrap();
    let (output, found) = check(&copy);
    assert_eq!((output.status.code(), found["frames"].as_u64()), (Some(0), Some(1)), "{found:#}");
    drop(writer);
}
