//! Checks names, types, shapes and units against the layout.

use dem_history::{
    BondStatus, ContactStatus, Ending, ROUTE, RuptureMode, SolverRoute, WallColumn, WallDrive, WallKind,
};
use hdf5::Attribute;
use hdf5::types::{CompoundField, EnumMember, EnumType, FloatSize, IntSize, TypeDescriptor, VarLenUnicode};

use super::checker::{Checker, Sizes};

const F32: TypeDescriptor = TypeDescriptor::Float(FloatSize::U4);
const F64: TypeDescriptor = TypeDescriptor::Float(FloatSize::U8);
const I32: TypeDescriptor = TypeDescriptor::Integer(IntSize::U4);
const I64: TypeDescriptor = TypeDescriptor::Integer(IntSize::U8);
const U32: TypeDescriptor = TypeDescriptor::Unsigned(IntSize::U4);
const U64: TypeDescriptor = TypeDescriptor::Unsigned(IntSize::U8);
const U8: TypeDescriptor = TypeDescriptor::Unsigned(IntSize::U1);
const TEXT: TypeDescriptor = TypeDescriptor::VarLenUnicode;

/// Members of a rupture: 64-bit integers and floats, then 32-bit integers. Layouts before version 3
/// have no `twist`.
pub(super) const RUPTURE: [&str; 16] =
    ["step", "time", "x", "y", "z", "rn", "rt", "m", "twist", "energy", "round", "bond", "i", "j", "mode", "pad"];

/// Checks names, types, shapes and units; datasets that conform are marked as sound, and their
/// content is checked afterwards.
pub(super) fn check(c: &mut Checker) {
    identity(c);
    commit(c);
    grains(c);
    if c.has("walls") {
        walls(c);
    }
    if c.has("bonds") {
        bonds(c);
    } else if let Some(place) =
        ["events", "commit_rows/events", "contacts/bond", "contacts/moment"].iter().find(|place| c.has(place))
    {
        c.wrong("bonds", None, format!("is missing, but /{place} exists"));
    }
    contacts(c);
    observables(c);
    checkpoint(c);
}

/// The type of the reals of frames (`output.precision`): all have the type of the positions.
fn reals(c: &Checker) -> TypeDescriptor {
    let positions = c.dataset("particles/grains/position/value");
    let found = positions.and_then(|positions| positions.dtype().and_then(|dtype| dtype.to_descriptor()).ok());
    found.filter(|found| *found == F32).unwrap_or(F64)
}

/// The datatype of an enumeration whose codes start at `first`.
fn codes(size: IntSize, signed: bool, first: u64, names: impl Iterator<Item = &'static str>) -> TypeDescriptor {
    let members = names.zip(first..).map(|(name, value)| EnumMember { name: name.into(), value }).collect();
    TypeDescriptor::Enum(EnumType { size, signed, members })
}

fn bytes(names: impl Iterator<Item = &'static str>) -> TypeDescriptor {
    codes(IntSize::U1, false, 0, names)
}

/// Whether a type of the file is read as this one: the same type, or an older enumeration without
/// its last members.
fn is_read_as(found: &TypeDescriptor, kind: &TypeDescriptor) -> bool {
    match (found, kind) {
        (TypeDescriptor::Enum(found), TypeDescriptor::Enum(kind)) => {
            let before = kind.members.iter().take(found.members.len()).cloned().collect();
            !found.members.is_empty() && *found == EnumType { members: before, ..kind.clone() }
        }
        _ => found == kind,
    }
}

/// A readable name of a type.
fn name(kind: &TypeDescriptor) -> String {
    match kind {
        TypeDescriptor::Enum(codes) => {
            let names: Vec<String> = codes.members.iter().map(|m| format!("{} = {}", m.name, m.value)).collect();
            format!("enum of {}", names.join(", "))
        }
        other => other.to_string(),
    }
}

impl Checker {
    /// Checks a dataset of `rows` complete rows (more may follow), each of shape `row`.
    fn table(&mut self, place: &str, kind: &TypeDescriptor, rows: usize, row: &[usize], unit: &str) {
        let Some(found) = self.typed(place, kind) else { return };
        let shape_fits = found.first().is_some_and(|&count| count >= rows) && found[1..] == *row;
        if !shape_fits {
            let expected: Vec<String> =
                std::iter::once(rows).chain(row.iter().copied()).map(|n| n.to_string()).collect();
            self.wrong(place, None, format!("has shape {found:?} instead of [{}]", expected.join(", ")));
        }
        self.unit(place, unit);
        if shape_fits {
            self.sound.insert(place.into(), [rows, row.iter().product()]);
        }
    }

    /// The shape of a dataset, if it exists and has this type.
    fn typed(&mut self, place: &str, kind: &TypeDescriptor) -> Option<Vec<usize>> {
        let Some(dataset) = self.dataset(place) else {
            self.wrong(place, None, "is missing");
            return None;
        };
        match dataset.dtype().and_then(|dtype| dtype.to_descriptor()) {
            Ok(found) if is_read_as(&found, kind) => Some(dataset.shape()),
            Ok(found) => {
                self.wrong(place, None, format!("is of type {} instead of {}", name(&found), name(kind)));
                None
            }
            Err(error) => {
                self.wrong(place, None, format!("has a type that cannot be read ({error})"));
                None
            }
        }
    }

    fn unit(&mut self, place: &str, expected: &str) {
        let Some(dataset) = self.dataset(place) else { return };
        let named = dataset.attr_names().is_ok_and(|names| names.iter().any(|name| name == "unit"));
        let found = if named { text(dataset.attr("unit")) } else { Some(String::new()) };
        let what = match found.as_deref() {
            Some(found) if found == expected => return,
            Some("") => format!("has no attribute unit, but {expected:?} is required"),
            Some(found) => format!("has the unit {found:?} instead of {expected:?}"),
            None => "has an attribute unit that is not a text".into(),
        };
        self.wrong(place, None, what);
    }

    /// Checks a quantity over time: its values, its steps and its times. The steps and times are
    /// those of the frames.
    fn element(&mut self, place: &str, kind: &TypeDescriptor, row: &[usize], unit: &str) {
        let t = self.sizes.t;
        self.table(&format!("{place}/value"), kind, t, row, unit);
        self.table(&format!("{place}/step"), &I64, t, &[], "");
        self.table(&format!("{place}/time"), &F64, t, &[], "s");
    }

    /// Complete rows according to the last frame.
    fn complete(&mut self, place: &str) -> usize {
        let Some(last) = self.sizes.t.checked_sub(1) else { return 0 };
        self.rows::<u64>(place, last..last + 1).and_then(|rows| rows.first().copied()).unwrap_or(0) as usize
    }

    /// The length of a list, known only from its own shape.
    fn count(&mut self, place: &str) -> usize {
        self.dataset(place).and_then(|dataset| dataset.shape().first().copied()).unwrap_or(0)
    }
}

fn text(attribute: hdf5::Result<Attribute>) -> Option<String> {
    attribute.and_then(|attribute| attribute.read_scalar::<VarLenUnicode>()).ok().map(|text| text.to_string())
}

fn identity(c: &mut Checker) {
    for (group, name) in [
        ("h5md/author", "name"),
        ("h5md/creator", "name"),
        ("h5md/creator", "version"),
        ("parameters", "version"),
        ("parameters", "git_revision"),
        ("parameters", "build"),
        ("parameters", "host"),
        ("parameters", "start"),
    ] {
        let found = if c.has(group) { c.file.group(group).and_then(|group| group.attr(name)) } else { Err("".into()) };
        if text(found).is_none() {
            c.wrong(&format!("{group}@{name}"), None, "is missing, or not a text");
        }
    }
    let number = |c: &Checker, group: &str, name: &str| c.file.group(group).and_then(|group| group.attr(name));
    if !number(c, "h5md", "version").is_ok_and(|version| version.read_raw::<i32>().is_ok_and(|v| v == [1, 1])) {
        c.wrong("h5md@version", None, "is not [1, 1]");
    }
    if !number(c, "parameters", "seed").is_ok_and(|seed| seed.read_scalar::<u64>().is_ok()) {
        c.wrong("parameters@seed", None, "is missing, or not a number");
    }
    json_text(c, "parameters/scene");
    if c.has("parameters/earlier_scenes") {
        json_text(c, "parameters/earlier_scenes");
    }
}

fn json_text(c: &mut Checker, place: &str) {
    if let Some(shape) = c.typed(place, &TEXT)
        && (!shape.is_empty() || json(c, place).is_none())
    {
        c.wrong(place, None, "is not a JSON text");
    }
}

/// The scene, if it is a JSON text.
pub(super) fn scene(c: &Checker) -> Option<serde_json::Value> {
    json(c, "parameters/scene")
}

fn json(c: &Checker, place: &str) -> Option<serde_json::Value> {
    let text = c.file.dataset(place).and_then(|dataset| dataset.read_scalar::<VarLenUnicode>());
    serde_json::from_str(&text.ok()?).ok()
}

fn commit(c: &mut Checker) {
    let t = c.sizes.t;
    if c.typed("commit", &U64).is_some_and(|shape| !shape.is_empty()) {
        c.wrong("commit", None, "is not a single number");
    }
    ending(c);
    for name in ["contacts", "steps"] {
        c.table(&format!("commit_rows/{name}"), &U64, t, &[], "");
    }
    if c.has("bonds") {
        c.table("commit_rows/events", &U64, t, &[], "");
        c.sizes.e = c.complete("commit_rows/events");
    }
    c.sizes.m = c.complete("commit_rows/contacts");
    c.sizes.s = c.complete("commit_rows/steps");
}

/// Why the run ended; files of earlier programs do not tell.
fn ending(c: &mut Checker) {
    let Some(dataset) = c.dataset("ending") else { return };
    let Some(shape) = c.typed("ending", &bytes(Ending::ALL.iter().map(|ending| ending.label()))) else { return };
    if !shape.is_empty() {
        c.wrong("ending", None, "is not a single value");
    } else if !dataset.read_scalar::<u8>().is_ok_and(|code| usize::from(code) < Ending::ALL.len()) {
        c.wrong("ending", None, "is an unknown code");
    }
}

fn grains(c: &mut Checker) {
    c.sizes.n = c.count("particles/grains/id");
    let Sizes { d, n, .. } = c.sizes;
    c.table("particles/grains/id", &I32, n, &[], "");
    for (name, unit) in [("radius", "m"), ("mass", "kg"), ("inertia", "kg m2")] {
        c.table(&format!("particles/grains/{name}"), &F64, n, &[], unit);
    }
    // both or neither
    if c.has("particles/grains/material") || c.has("materials/name") {
        let names = c.count("materials/name");
        c.sizes.k = names;
        c.table("materials/name", &TEXT, names, &[], "");
        // texts contain no numbers to check
        c.sound.remove("materials/name");
        c.table("particles/grains/material", &U8, n, &[], "");
    }
    let real = reals(c);
    c.element("particles/grains/position", &real, &[n, d], "m");
    c.element("particles/grains/velocity", &real, &[n, d], "m s-1");
    let (spin, angle) = ("particles/grains/angular_velocity", if d == 2 { "angle" } else { "orientation" });
    let angle = format!("particles/grains/{angle}");
    // both or neither
    if c.has(spin) || c.has(&angle) {
        let (spins, angles, unit): (&[usize], &[usize], _) =
            if d == 2 { (&[n], &[n], "rad") } else { (&[n, 3], &[n, 4], "") };
        c.element(spin, &real, spins, "rad s-1");
        c.element(&angle, &real, angles, unit);
    }
    let cell = c.file.group("particles/grains/box").and_then(|cell| cell.attr("boundary"));
    if cell.is_ok_and(|boundary| boundary.shape() == [d]) {
        return;
    }
    c.wrong("particles/grains/box@boundary", None, format!("is not a text for each of {d} axes"));
}

fn walls(c: &mut Checker) {
    c.sizes.w = c.count("walls/name");
    let Sizes { d, w, .. } = c.sizes;
    c.table("walls/name", &TEXT, w, &[], "");
    // texts contain no numbers to check
    c.sound.remove("walls/name");
    c.table("walls/kind", &bytes(WallKind::ALL.iter().map(|kind| kind.label())), w, &[], "");
    c.table("walls/drive", &bytes(WallDrive::ALL.iter().map(|drive| drive.label())), w, &[], "");
    for column in WallColumn::ALL {
        let place = format!("walls/{}", column.name);
        if column.always || c.has(&place) {
            c.table(&place, &F64, w, &column.row(d), column.unit);
        }
    }
    let reals = reals(c);
    for (name, unit) in [("position", "m"), ("velocity", "m s-1"), ("force", "N")] {
        c.element(&format!("walls/{name}"), &reals, &[w, d], unit);
    }
}

fn bonds(c: &mut Checker) {
    c.sizes.b = c.count("bonds/pair");
    let b = c.sizes.b;
    c.table("bonds/pair", &I32, b, &[2], "");
    for (name, unit) in [("rest_gap", "m"), ("strength", "N"), ("friction", ""), ("mean_diameter", "m")] {
        c.table(&format!("bonds/{name}"), &F64, b, &[], unit);
    }
    if c.has("bonds/rolling") {
        c.table("bonds/rolling", &F64, b, &[], "");
    }
    if c.has("bonds/twist") {
        c.table("bonds/twist", &F64, b, &[], "");
    }
    if c.has("bonds/formed") {
        c.table("bonds/formed", &I64, 1, &[], "");
    }
    c.element("bonds/status", &bytes(BondStatus::ALL.iter().map(|status| status.label())), &[b], "");
    events(c);
}

fn events(c: &mut Checker) {
    const PLACE: &str = "events/rupture";
    let Some(dataset) = c.dataset(PLACE) else {
        c.wrong(PLACE, None, "is missing");
        return;
    };
    let modes = codes(IntSize::U4, true, 1, RuptureMode::ALL.iter().map(|mode| mode.label()));
    let expected = RUPTURE.iter().enumerate().map(|(k, name)| match (k, *name) {
        (0, name) => (name, I64),
        (1..10, name) => (name, F64),
        (_, "mode") => ("mode", modes.clone()),
        (_, name) => (name, I32),
    });
    let expected: Vec<(&str, TypeDescriptor)> = expected.collect();
    let before: Vec<_> = expected.iter().filter(|(name, _)| *name != "twist").cloned().collect();
    let members = match dataset.dtype().and_then(|dtype| dtype.to_descriptor()) {
        Ok(TypeDescriptor::Compound(found)) => found.fields,
        _ => vec![],
    };
    let is = |known: &[(&str, TypeDescriptor)]| {
        let same = |(f, (name, kind)): (&CompoundField, &(&str, _))| f.name == *name && is_read_as(&f.ty, kind);
        members.len() == known.len() && members.iter().zip(known).all(same)
    };
    let shape = dataset.shape();
    if !is(&expected) && !is(&before) {
        c.wrong(PLACE, None, format!("is not a compound of {} with their types", RUPTURE.join(", ")));
    } else if shape.len() != 1 || shape[0] < c.sizes.e {
        c.wrong(PLACE, None, format!("has shape {shape:?} instead of [{}]", c.sizes.e));
    } else {
        c.sound.insert(PLACE.into(), [c.sizes.e, members.len()]);
    }
}

fn contacts(c: &mut Checker) {
    let Sizes { d, t, m, .. } = c.sizes;
    let (bonded, real) = (c.has("bonds"), reals(c));
    c.table("contacts/step", &I64, t, &[], "");
    c.table("contacts/time", &F64, t, &[], "s");
    c.table("contacts/start", &U64, t, &[], "");
    c.table("contacts/count", &U32, t, &[], "");
    c.table("contacts/pair", &I32, m, &[2], "");
    c.table("contacts/point", &real, m, &[d], "m");
    c.table("contacts/normal", &real, m, &[d], "");
    c.table("contacts/gap", &real, m, &[], "m");
    c.table("contacts/status", &bytes(ContactStatus::ALL.iter().map(|status| status.label())), m, &[], "");
    if bonded {
        c.table("contacts/bond", &I32, m, &[], "");
    }
    // reactions are optional (`output.reactions`): without them all their datasets are absent
    if ["reaction", "tangent", "moment"].iter().any(|name| c.has(&format!("contacts/{name}"))) {
        reactions(c, &real);
    }
}

fn reactions(c: &mut Checker, real: &TypeDescriptor) {
    let (Sizes { d, m, .. }, bonded) = (c.sizes, c.has("bonds"));
    let tangential = bonded
        || c.has("contacts/tangent")
        || c.dataset("contacts/reaction").is_some_and(|r| {
            // without bonds this depends on friction
            r.shape().get(1) != Some(&1)
        });
    c.table("contacts/reaction", real, m, &[if tangential { d } else { 1 }], "N");
    let frame = c.file.dataset("contacts/reaction").and_then(|reaction| reaction.attr("frame"));
    if text(frame).as_deref() != Some("local") {
        c.wrong("contacts/reaction@frame", None, "is not \"local\"");
    }
    if tangential && d == 3 {
        c.table("contacts/tangent", real, m, &[d], "");
    }
    if bonded {
        let twists = c.dataset("contacts/moment").is_some_and(|moment| moment.shape().get(1) == Some(&3));
        let row: &[usize] = match d {
            2 => &[],
            _ if twists => &[3],
            _ => &[2],
        };
        c.table("contacts/moment", real, m, row, "N m");
    }
}

fn observables(c: &mut Checker) {
    let s = c.sizes.s;
    c.table("observables/step", &I64, s, &[], "");
    c.table("observables/time", &F64, s, &[], "s");
    let names = c.file.group("observables").and_then(|group| group.member_names()).unwrap_or_default();
    for name in names.iter().filter(|name| *name != "step" && *name != "time") {
        let place = format!("observables/{name}/value");
        let routes = || bytes(SolverRoute::ALL.iter().map(|route| route.label()));
        let kind = if name == ROUTE { routes() } else { F64 };
        // each observable has its own shape and unit
        let Some(shape) = c.typed(&place, &kind) else { continue };
        if shape.first().is_none_or(|&rows| rows < s) {
            c.wrong(&place, None, format!("has shape {shape:?}, but {s} rows are required"));
        } else {
            c.sound.insert(place, [s, shape[1..].iter().product()]);
        }
        c.table(&format!("observables/{name}/step"), &I64, s, &[], "");
        c.table(&format!("observables/{name}/time"), &F64, s, &[], "s");
    }
}

/// The two slots of the state from which the run resumes. A checksum protects the content: one slot
/// may be incomplete, if the run was killed while writing it.
fn checkpoint(c: &mut Checker) {
    c.table("checkpoint/index", &U64, 2, &[4], "");
    for slot in 0..2 {
        for (name, kind) in [("reals", &F64), ("counts", &U64)] {
            let place = format!("checkpoint/{name}_{slot}");
            let rows = c.count(&place);
            c.table(&place, kind, rows, &[], "");
            // the checksum covers these numbers; they are not checked individually
            c.sound.remove(&place);
        }
    }
    let written = c.rows::<u64>("checkpoint/index", 0..2).unwrap_or_default().iter().any(|number| *number > 0);
    if written && !c.resumable {
        c.wrong("checkpoint", None, "holds no complete state to resume from");
    }
}
