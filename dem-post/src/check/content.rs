//! Checks the content of the datasets: numbers, order, and agreement between datasets.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use dem_history::sound::{Surroundings, is_huge, is_plausible, may_be_observed, median};
use dem_history::{BondStatus, NOT_FORMED, RuptureMode, SolverRoute, WallDrive, WallKind};
use hdf5::H5Type;

use super::checker::{Checker, Sizes};
use super::schema;

const STEP: &str = "particles/grains/position/step";
const TIME: &str = "particles/grains/position/time";
const POSITION: &str = "particles/grains/position/value";
const RADIUS: &str = "particles/grains/radius";
const STATUS: &str = "bonds/status/value";
const RUPTURE: &str = "events/rupture";
const ROUTE: &str = "observables/solver_route/value";
/// Codes of an intact bond and of a bonded contact.
const INTACT: u8 = 0;
const BONDED: u8 = 3;
/// Tolerance on the squared norm of a unit vector: round-off of single precision.
const UNIT: f64 = 1e-5;
/// Relative tolerance on the time of a rupture between its frames.
const SAME_TIME: f64 = 1e-9;

/// A rupture as the file stores it, with its mode as a number.
#[derive(Clone, Copy, H5Type)]
#[repr(C)]
struct StoredRupture {
    step: i64,
    time: f64,
    x: f64,
    y: f64,
    z: f64,
    rn: f64,
    rt: f64,
    m: f64,
    energy: f64,
    round: i32,
    bond: i32,
    i: i32,
    j: i32,
    mode: i32,
}

/// The twisting moment of a rupture; absent before version 3 of the layout.
#[derive(Clone, Copy, H5Type)]
#[repr(C)]
struct Twist {
    twist: f64,
}

/// For each broken bond: the first frame that does not show it intact, and its state there.
type Broken = BTreeMap<usize, (usize, u8)>;

/// Checks the content of all datasets of valid type and shape.
pub(super) fn check(c: &mut Checker) {
    let steps = order(c);
    let rows = committed(c);
    numbers(c);
    codes(c, "walls/kind", WallKind::ALL.len() as u8);
    codes(c, "walls/drive", WallDrive::ALL.len() as u8);
    codes(c, "particles/grains/material", c.sizes.k.min(255) as u8);
    codes(c, ROUTE, SolverRoute::ALL.len() as u8);
    signs(c);
    places(c);
    directions(c);
    let pairs = bond_pairs(c);
    before_the_bonds(c, &rows, &steps);
    let broken = states(c);
    let late = broke_at_the_end_of_a_frame(c, &steps);
    contacts(c, &rows, &pairs, &broken, &late);
    events(c, &steps, &pairs, &broken);
}

/// Checks that steps and times increase, and that those of every quantity equal those of the
/// frames. Returns the steps of the frames.
fn order(c: &mut Checker) -> Vec<i64> {
    for (step, time) in [(STEP, TIME), ("observables/step", "observables/time")] {
        grows::<i64>(c, step);
        grows::<f64>(c, time);
        keeps_time(c, step, time);
    }
    follow_each_other(c, "observables/step");
    let places: Vec<String> = c.sound.keys().cloned().collect();
    for place in places {
        let observed = place.starts_with("observables/");
        let [step, time] = if observed { ["observables/step", "observables/time"] } else { [STEP, TIME] };
        if place.ends_with("/step") && place != step {
            alike::<i64>(c, &place, step);
        } else if place.ends_with("/time") && place != time {
            alike::<f64>(c, &place, time);
        }
    }
    c.rows(STEP, 0..c.sizes.t).unwrap_or_default()
}

/// Checks that the time of a step is its number times the time step.
fn keeps_time(c: &mut Checker, step: &str, time: &str) {
    let Some(&[rows, _]) = c.sound.get(step) else { return };
    let steps = c.rows::<i64>(step, 0..rows).unwrap_or_default();
    let times = c.rows::<f64>(time, 0..rows).unwrap_or_default();
    let pairs = || steps.iter().map(|step| *step as f64).zip(times.iter().copied());
    let h = median(pairs().filter(|(step, _)| *step != 0.0).map(|(step, time)| time / step).collect());
    for (k, (number, at)) in pairs().enumerate() {
        if (at - h * number).abs() > SAME_TIME * (at.abs() + (h * number).abs()) {
            c.wrong(step, Some(k), format!("step {} at {at} s, but most steps take {h} s", steps[k]));
        }
    }
}

/// Checks that no step is missing.
fn follow_each_other(c: &mut Checker, place: &str) {
    let Some(&[rows, _]) = c.sound.get(place) else { return };
    let steps = c.rows::<i64>(place, 0..rows).unwrap_or_default();
    for (k, pair) in steps.windows(2).enumerate().filter(|(_, pair)| pair[1] > pair[0].saturating_add(1)) {
        c.wrong(place, Some(k + 1), format!("step {} follows step {}: steps are missing", pair[1], pair[0]));
    }
}

fn grows<T: H5Type + PartialOrd + Copy + std::fmt::Display>(c: &mut Checker, place: &str) {
    let mut last: Option<T> = None;
    c.blocks::<T>(place, |c, start, values| {
        for (k, value) in values.iter().enumerate() {
            if let Some(last) = last.filter(|last| value.partial_cmp(last) != Some(Ordering::Greater)) {
                c.wrong(place, Some(start + k), format!("{value} does not come after {last}"));
            }
            last = Some(*value);
        }
    });
}

/// Checks that `place` has the same values as `other`. Usually it is a hard link to `other`.
fn alike<T: H5Type + PartialEq>(c: &mut Checker, place: &str, other: &str) {
    let token = |c: &Checker, place: &str| c.file.loc_info_by_name(place).map(|info| info.token).ok();
    if token(c, place).is_some() && token(c, place) == token(c, other) {
        let [rows, width] = c.sound[place];
        c.bar.inc((rows * width) as u64);
        return;
    }
    c.blocks::<T>(place, |c, start, values| {
        let Some(others) = c.rows::<T>(other, start..start + values.len()) else { return };
        if let Some(k) = values.iter().zip(&others).position(|(a, b)| a != b) {
            c.wrong(place, Some(start + k), format!("differs from /{other}"));
        }
    });
}

/// Checks the rows complete at each frame: their number never decreases, and contacts follow each
/// other without gaps. Returns the first row and the number of the contacts of each frame, where
/// these are valid.
fn committed(c: &mut Checker) -> Vec<[u64; 2]> {
    let t = c.sizes.t;
    let mut committed = |name: &str| -> Vec<u64> {
        let place = format!("commit_rows/{name}");
        let rows = c.rows::<u64>(&place, 0..t).unwrap_or_default();
        for k in 1..rows.len() {
            if rows[k] < rows[k - 1] {
                c.wrong(&place, Some(k), format!("{} rows after {}", rows[k], rows[k - 1]));
            }
        }
        rows
    };
    committed("steps");
    committed("events");
    let complete = committed("contacts");
    let starts = c.rows::<u64>("contacts/start", 0..t).unwrap_or_default();
    let counts = c.rows::<u32>("contacts/count", 0..t).unwrap_or_default();
    let (mut next, mut found) = (0, vec![]);
    for (k, ((&start, &count), &complete)) in starts.iter().zip(&counts).zip(&complete).enumerate() {
        let end = start.saturating_add(count.into());
        if start != next {
            c.wrong("contacts/start", Some(k), format!("{start}, but the frame before ends at {next}"));
        }
        if end != complete {
            c.wrong("contacts/count", Some(k), format!("ends at row {end}, but {complete} rows are complete"));
        }
        found.push(if end <= c.sizes.m as u64 { [start, count.into()] } else { [0, 0] });
        next = end;
    }
    found
}

/// Checks that every number of every dataset of floats is finite and of a plausible magnitude.
fn numbers(c: &mut Checker) {
    let whole = |place: &str| {
        ["step", "start", "count", "pair", "id", "bond", "material", "formed"]
            .contains(&place.rsplit('/').next().unwrap_or(""))
    };
    let places: Vec<String> = c.sound.keys().cloned().collect();
    for place in places {
        let coded =
            [RUPTURE, STATUS, ROUTE].contains(&place.as_str()) || place.ends_with("/kind") || place.ends_with("/drive");
        if coded
            || whole(&place)
            || place == "contacts/status"
            || place.starts_with("commit_rows/")
            || place.starts_with("checkpoint/")
        {
            continue;
        }
        let width = c.sound[&place][1].max(1);
        let name = place.strip_prefix("observables/").and_then(|rest| rest.strip_suffix("/value")).unwrap_or("");
        c.blocks::<f64>(&place, |c, start, values| {
            for (k, value) in values.iter().enumerate().filter(|(_, value)| !may_be_observed(name, **value)) {
                c.wrong(&place, Some(start + k / width), no_number(*value));
            }
        });
    }
}

/// Checks that every code is one of the first `many`.
fn codes(c: &mut Checker, place: &str, many: u8) {
    c.blocks::<u8>(place, |c, start, values| {
        for (k, code) in values.iter().enumerate().filter(|(_, code)| **code >= many) {
            c.wrong(place, Some(start + k), format!("unknown code {code}"));
        }
    });
}

fn no_number(value: f64) -> String {
    if value.is_finite() {
        format!("{value:e} is not a plausible number")
    } else {
        format!("{value} is not a finite number")
    }
}

/// Checks that radii, masses and diameters are positive, that inertia and bond parameters are not
/// negative, and that no radius is far larger than the median.
fn signs(c: &mut Checker) {
    for place in [RADIUS, "particles/grains/mass", "bonds/mean_diameter"] {
        every(c, place, |value| (value <= 0.0).then(|| format!("{value} is not positive")));
    }
    for place in ["particles/grains/inertia", "bonds/strength", "bonds/friction", "bonds/rolling", "bonds/twist"] {
        every(c, place, |value| (value < 0.0).then(|| format!("{value} is negative")));
    }
    if c.sizes.n == 0 {
        c.wrong("particles/grains/id", None, "there is no grain");
    }
    let usual = median(c.rows::<f64>(RADIUS, 0..c.sizes.n).unwrap_or_default());
    let huge = |value| is_huge(value, usual) && is_plausible(value);
    every(c, RADIUS, |value| huge(value).then(|| format!("{value:e}, but half the grains have at most {usual:e}")));
}

/// Reports the rows of a list for which `wrong` returns a violation.
fn every(c: &mut Checker, place: &str, wrong: impl Fn(f64) -> Option<String>) {
    c.blocks::<f64>(place, |c, start, values| {
        for (k, what) in values.iter().enumerate().filter_map(|(k, value)| Some((k, wrong(*value)?))) {
            c.wrong(place, Some(start + k), what);
        }
    });
}

/// Checks that every grain is near the sample.
fn places(c: &mut Checker) {
    let Sizes { d, n, t, .. } = c.sizes;
    if !c.is_sound(&[POSITION, RADIUS]) || n == 0 || t == 0 {
        return;
    }
    let (Some(radius), Some(first)) = (c.rows(RADIUS, 0..n), c.rows(POSITION, 0..1)) else { return };
    let surroundings = Surroundings::of(&radius, &first, d);
    c.blocks::<f64>(POSITION, |c, start, values| {
        for (k, centre) in values.chunks_exact(d).enumerate() {
            // numbers that are not finite are reported by `numbers`
            if centre.iter().all(|x| is_plausible(*x)) && !surroundings.hold(centre) {
                let what = format!("grain {} is at {centre:?} m, far beyond a million sizes of the sample", k % n);
                c.wrong(POSITION, Some(start + k / n), what);
            }
        }
    });
}

/// Checks that the directions of contacts, of planes, plates and cylinders, and of drives are unit
/// vectors.
fn directions(c: &mut Checker) {
    let Sizes { d, w, .. } = c.sizes;
    let is_unit = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() <= UNIT;
    let finite = |v: &[f64]| v.iter().all(|x| is_plausible(*x));
    for place in ["contacts/normal", "contacts/tangent"] {
        c.blocks::<f64>(place, |c, start, values| {
            for (k, v) in values.chunks_exact(d).enumerate().filter(|(_, v)| finite(v) && !is_unit(v)) {
                c.wrong(place, Some(start + k), format!("{v:?} is not a unit vector"));
            }
        });
    }
    let has_normal = |kind: u8| WallKind::ALL.get(usize::from(kind)).is_some_and(|kind| kind.has_normal());
    let has_sides = |kind: u8| WallKind::ALL.get(usize::from(kind)) == Some(&WallKind::Plate);
    let is_driven = |drive: u8| WallDrive::ALL.get(usize::from(drive)).is_some_and(|drive| *drive != WallDrive::Fixed);
    let mut check = |place: &str, of: &str, has: &dyn Fn(u8) -> bool| {
        let vectors = c.rows::<f64>(place, 0..w).unwrap_or_default();
        let kinds = c.rows::<u8>(of, 0..w).unwrap_or_default();
        for (k, (v, kind)) in vectors.chunks_exact(d).zip(kinds).enumerate() {
            if has(kind) && finite(v) && !is_unit(v) {
                c.wrong(place, Some(k), format!("{v:?} is not a unit vector"));
            }
        }
    };
    check("walls/normal", "walls/kind", &has_normal);
    check("walls/side", "walls/kind", &has_sides);
    check("walls/direction", "walls/drive", &is_driven);
}

/// The grains of each bond.
fn bond_pairs(c: &mut Checker) -> Vec<[i32; 2]> {
    let Sizes { n, b, .. } = c.sizes;
    let pairs = c.rows::<i32>("bonds/pair", 0..b).unwrap_or_default().as_chunks().0.to_vec();
    for (k, [i, j]) in pairs.iter().enumerate() {
        if i == j || [i, j].iter().any(|grain| !(0..n as i32).contains(*grain)) {
            c.wrong("bonds/pair", Some(k), format!("{i}, {j} are not two different grains of {n}"));
        }
    }
    pairs
}

/// Checks the step after which a stage formed the bonds: there are bonds if it has come, and no
/// contact of an earlier frame has one.
fn before_the_bonds(c: &mut Checker, rows: &[[u64; 2]], steps: &[i64]) {
    const FORMED: &str = "bonds/formed";
    if !c.is_sound(&[FORMED]) {
        return;
    }
    let formed = c.rows::<i64>(FORMED, 0..1).and_then(|rows| rows.first().copied()).unwrap_or(NOT_FORMED);
    if formed < NOT_FORMED || (formed == NOT_FORMED) != (c.sizes.b == 0) {
        c.wrong(FORMED, None, format!("{formed}, with {} bonds", c.sizes.b));
    }
    for ([start, count], _) in rows.iter().zip(steps).filter(|(_, step)| **step < formed) {
        let (start, end) = (*start as usize, (start + count) as usize);
        let bonds = c.rows::<i32>("contacts/bond", start..end).unwrap_or_default();
        if let Some(k) = bonds.iter().position(|bond| *bond != -1) {
            c.wrong(
                "contacts/bond",
                Some(start + k),
                format!("{} before the bonds formed, at step {formed}", bonds[k]),
            );
        }
    }
}

/// Checks that a bond changes at most once, from intact to one mode of rupture.
fn states(c: &mut Checker) -> Broken {
    let b = c.sizes.b;
    let (mut last, mut broken) = (vec![INTACT; b], Broken::new());
    if b == 0 {
        return broken;
    }
    c.blocks::<u8>(STATUS, |c, start, values| {
        for (k, row) in values.chunks_exact(b.max(1)).enumerate() {
            for (bond, (&now, before)) in
                row.iter().zip(&mut last).enumerate().filter(|(_, (now, last))| *now != &**last)
            {
                let frame = start + k;
                if now as usize >= BondStatus::ALL.len() {
                    c.wrong(STATUS, Some(frame), format!("bond {bond}: unknown code {now}"));
                } else if *before != INTACT {
                    c.wrong(STATUS, Some(frame), format!("bond {bond}: {now} after {before}, which is irreversible"));
                } else {
                    broken.entry(bond).or_insert((frame, now));
                }
                *before = now;
            }
        }
    });
    broken
}

/// Bonds that broke in the step of a frame, where the scene breaks bonds at the end of a step: the
/// contacts of that frame still have them.
fn broke_at_the_end_of_a_frame(c: &mut Checker, steps: &[i64]) -> BTreeSet<usize> {
    let mut late = BTreeSet::new();
    let scene = schema::scene(c);
    let rule = scene.as_ref().and_then(|scene| scene["rupture"].as_str());
    if matches!(rule, Some("end_of_step" | "next_event")) && c.is_sound(&[RUPTURE]) {
        c.blocks::<StoredRupture>(RUPTURE, |_, _, events| {
            let of_a_frame = events.iter().filter(|event| steps.binary_search(&event.step).is_ok());
            late.extend(of_a_frame.filter_map(|event| usize::try_from(event.bond).ok()));
        });
    }
    late
}

/// Checks that contacts name existing bodies and bonds, and that a bonded contact has an intact
/// bond between its grains, or one that broke in the same step.
fn contacts(c: &mut Checker, rows: &[[u64; 2]], pairs: &[[i32; 2]], broken: &Broken, late: &BTreeSet<usize>) {
    let Sizes { n, w, .. } = c.sizes;
    for (frame, [start, count]) in rows.iter().enumerate() {
        let (start, end) = (*start as usize, (start + count) as usize);
        let bodies = c.rows::<i32>("contacts/pair", start..end).unwrap_or_default();
        let status = c.rows::<u8>("contacts/status", start..end).unwrap_or_default();
        let bonds = c.rows::<i32>("contacts/bond", start..end).unwrap_or_default();
        for (k, [i, j]) in bodies.as_chunks().0.iter().enumerate() {
            if i == j || !(0..n as i32).contains(i) || !(-(w as i32)..n as i32).contains(j) {
                let what = format!("{i}, {j} are not a pair of bodies: there are {n} grains and {w} walls");
                c.wrong("contacts/pair", Some(start + k), what);
            }
        }
        for (k, code) in status.iter().enumerate().filter(|(_, code)| **code > BONDED) {
            c.wrong("contacts/status", Some(start + k), format!("unknown code {code}"));
        }
        for (k, &bond) in bonds.iter().enumerate().filter(|_| !pairs.is_empty()) {
            let what = match usize::try_from(bond).ok().map(|bond| (bond, pairs.get(bond))) {
                None if bond == -1 => {
                    status.get(k).filter(|code| **code == BONDED).map(|_| "-1, but the contact is BONDED".into())
                }
                None | Some((_, None)) => Some(format!("{bond} is not one of the {} bonds", pairs.len())),
                Some((bond, Some(pair))) => {
                    let gone =
                        broken.get(&bond).is_some_and(|(at, _)| *at < frame || *at == frame && !late.contains(&bond));
                    let same = bodies
                        .get(2 * k..2 * k + 2)
                        .is_none_or(|bodies| bodies == pair || bodies == [pair[1], pair[0]]);
                    if gone {
                        Some(format!("bond {bond} is broken at frame {frame}"))
                    } else if !same {
                        Some(format!("bond {bond} joins other grains, {} and {}", pair[0], pair[1]))
                    } else {
                        None
                    }
                }
            };
            if let Some(what) = what {
                c.wrong("contacts/bond", Some(start + k), what);
            }
        }
    }
}

/// Checks that ruptures are in the order of their steps and complete at the right frames, and that
/// each broken bond has exactly one rupture, at the frame where its state changes.
fn events(c: &mut Checker, steps: &[i64], pairs: &[[i32; 2]], broken: &Broken) {
    let complete = c.rows::<u64>("commit_rows/events", 0..c.sizes.t).unwrap_or_default();
    let times = c.rows::<f64>(TIME, 0..c.sizes.t).unwrap_or_default();
    if !c.is_sound(&[RUPTURE, STEP, "bonds/pair", STATUS, "commit_rows/events"]) {
        return;
    }
    let (mut told, mut last): (BTreeMap<usize, usize>, _) = (BTreeMap::new(), i64::MIN);
    c.blocks::<StoredRupture>(RUPTURE, |c, start, events| {
        for (k, event) in events.iter().enumerate() {
            let row = start + k;
            if event.step < last {
                c.wrong(RUPTURE, Some(row), format!("step {} after step {last}", event.step));
            }
            last = event.step;
            let numbers = [event.time, event.x, event.y, event.z, event.rn, event.rt, event.m, event.energy];
            if numbers.iter().any(|value| !value.is_finite()) {
                c.wrong(RUPTURE, Some(row), "a member is not a finite number");
            } else if let Some(value) = numbers.iter().find(|value| !is_plausible(**value)) {
                c.wrong(RUPTURE, Some(row), no_number(*value));
            }
            if event.round < 0 {
                c.wrong(RUPTURE, Some(row), format!("{} is not a round of a cascade", event.round));
            }
            let frame = steps.partition_point(|step| *step < event.step);
            let seen = complete.partition_point(|rows| *rows <= row as u64);
            if frame != seen {
                c.wrong(RUPTURE, Some(row), format!("step {} is complete with frame {seen}", event.step));
            }
            let [after, until] = [frame.checked_sub(1), Some(frame)].map(|frame| times.get(frame?).copied());
            if after.is_some_and(|t| event.time < t * (1.0 - SAME_TIME))
                || until.is_some_and(|t| event.time > t * (1.0 + SAME_TIME))
            {
                c.wrong(RUPTURE, Some(row), format!("{} s is not the time of step {}", event.time, event.step));
            }
            if let Some(what) = disagreement(event, frame, pairs, broken, &mut told, row) {
                c.wrong(RUPTURE, Some(row), what);
            }
        }
    });
    if c.sound.get(RUPTURE).is_some_and(|[_, members]| *members == schema::RUPTURE.len()) {
        c.blocks::<Twist>(RUPTURE, |c, start, events| {
            // copies of histories without this moment have NaN
            let wrong = |event: &&Twist| !event.twist.is_nan() && !is_plausible(event.twist);
            for (k, event) in events.iter().enumerate().filter(|(_, event)| wrong(event)) {
                c.wrong(RUPTURE, Some(start + k), no_number(event.twist));
            }
        });
    }
    for (bond, (frame, _)) in broken.iter().filter(|(bond, _)| !told.contains_key(bond)) {
        c.wrong(STATUS, Some(*frame), format!("bond {bond} is broken, but /{RUPTURE} has no event of it"));
    }
}

/// The contradiction between an event and the states of its bond, if any.
fn disagreement(
    event: &StoredRupture,
    frame: usize,
    pairs: &[[i32; 2]],
    broken: &Broken,
    told: &mut BTreeMap<usize, usize>,
    row: usize,
) -> Option<String> {
    if !(1..=RuptureMode::ALL.len() as i32).contains(&event.mode) {
        return Some(format!("unknown mode {}", event.mode));
    }
    let Some((bond, pair)) = usize::try_from(event.bond).ok().and_then(|bond| Some((bond, pairs.get(bond)?))) else {
        return Some(format!("{} is not one of the {} bonds", event.bond, pairs.len()));
    };
    if let Some(first) = told.insert(bond, row) {
        return Some(format!("bond {bond} broke before, in row {first}"));
    }
    if [event.i, event.j] != *pair && [event.j, event.i] != *pair {
        return Some(format!("bond {bond} joins other grains, {} and {}", pair[0], pair[1]));
    }
    match broken.get(&bond) {
        None => Some(format!("bond {bond} is intact until the end")),
        Some((at, _)) if *at != frame => {
            Some(format!("bond {bond} breaks by frame {frame}, but its state changes at frame {at}"))
        }
        Some((_, mode)) if i32::from(*mode) != event.mode => {
            Some(format!("bond {bond} broke by mode {}, but its state is {mode}", event.mode))
        }
        Some(_) => None,
    }
}
