//! Warnings about probable mistakes in a valid scene, printed before the run with the field of the
//! scene and the remedy.

use crate::output::number;
use crate::prepare::MOST_STEPS;
use crate::scene::{Rupture, Sample, Scene};
use crate::tolerances::{PARALLEL, TOUCHING};
use crate::touching::seating;
use dem_core::body::{Drive, Grains, Wall};
use dem_core::dim::{Dim, Vect};
use dem_core::solver::SolverSettings;
use dem_core::world::World;

/// Maximum number of grains, or loads of one kind, that are reported individually.
const MOST_TOLD: usize = 5;
/// Load error of stiff elastic bonds, over the precision of the solver times k h²/m (measured: 2 to
/// 13 with three bonds in a row).
const ERROR_OF_STIFF: f64 = 10.0;
/// Load error (–) above which a warning is given.
const LARGE_LOAD_ERROR: f64 = 1e-3;
/// Number of times at which a drive is sampled.
const MOMENTS: usize = 1000;

/// Warnings that follow from the scene alone.
pub(crate) fn of_scene(scene: &Scene) -> Vec<String> {
    let mut told = vec![];
    let time = &scene.time;
    if !time.is_multiple() {
        let (last, next) = (time.last(), (time.steps() + 1) as f64 * time.step);
        told.push(format!(
            "time.end: {} s is not a multiple of time.step, {} s: the last step ends at {} s; {} s and {} s are multiples",
            time.end,
            time.step,
            number(last),
            number(last),
            number(next)
        ));
    }
    let longest: f64 = scene.stages.iter().filter_map(|stage| stage.duration).sum();
    if scene.stages.iter().all(|stage| stage.until.is_none()) && longest > time.last() + 0.5 * time.step {
        told.push(format!(
            "time.end: the run ends at {} s, before its stages, which last {} s: a later time.end lets them end",
            number(time.last()),
            number(longest)
        ));
    }
    let travels = scene.stop.as_ref().is_some_and(|stop| stop.wall_travel.is_some());
    if travels && scene.rupture == Rupture::NextEvent {
        told.push("stop.wall_travel: it has no effect with rupture next_event, where nothing moves".into());
    }
    let Some(held) = &scene.grains else { return told };
    if let Sample::Grains(list) = &scene.sample {
        let moves = |values: &Option<Vec<f64>>| values.iter().flatten().any(|value| *value != 0.0);
        let lines = held.fixed.iter().filter_map(|&k| {
            let grain = list.get(k).filter(|grain| moves(&grain.velocity) || moves(&grain.spin))?;
            let name = if moves(&grain.velocity) { "velocity" } else { "spin" };
            Some(format!(
                "sample.grains.{k}.{name}: it has no effect because grain {k} is in grains.fixed: remove the grain from \
                 grains.fixed, or its {name}"
            ))
        });
        told.extend(first_few(lines.collect(), "fixed grains have a velocity or a spin"));
    }
    let loads = held.loads.iter().enumerate().filter(|(_, load)| held.fixed.contains(&load.grain));
    let lines = loads.map(|(k, load)| {
        let grain = load.grain;
        format!(
            "grains.loads.{k}: it has no effect because grain {grain} is in grains.fixed: remove it from one of them"
        )
    });
    told.extend(first_few(lines.collect(), "loads are on fixed grains"));
    told
}

/// Warning about a packing that did not come to rest; `moved` is the displacement of its last step,
/// in mean radii.
pub(crate) fn of_packing(moved: f64) -> String {
    format!(
        "sample.random: the packing still moved by {moved:.1e} mean radii per step after {MOST_STEPS} steps: some grains may not touch \
         their neighbours; try another seed or a wider container, or look at it with `dem-post view`"
    )
}

/// Warning about elastic bonds that are so stiff for the step that the solver's precision does not
/// tell how they share a load.
pub(crate) fn of_stiff_bonds<D: Dim>(world: &World<D>) -> Option<String> {
    let settings = &world.settings;
    let (precision, remedy) = match settings.solver {
        SolverSettings::GaussSeidel(_) => {
            (settings.solver.tolerance(), "leave solver.kind to the default, or take a smaller time.step")
        }
        _ => (f64::EPSILON, "take a smaller time.step, or leave the bonds rigid"),
    };
    let grains = &world.grains;
    let ratio = world.bonds.iter().filter_map(|bond| {
        let stiffness = bond.stiffness?;
        let inverse_mass = |k: &u32| if grains.fixed[*k as usize] { 0.0 } else { 1.0 / grains.mass[*k as usize] };
        let inverse_mass: f64 = bond.pair.iter().map(inverse_mass).sum();
        Some(stiffness.normal.max(stiffness.tangential) * settings.step.powi(2) * inverse_mass)
    });
    let ratio = ratio.fold(0.0, f64::max);
    let error = ERROR_OF_STIFF * precision * ratio;
    (error > LARGE_LOAD_ERROR).then(|| {
        let error = if error < 1.0 { format!("about {error:.0e}") } else { "1 or more".into() };
        format!(
            "bonds.stiffness: bonds so stiff for time.step (k h²/m up to {ratio:.0e}) share a load with a relative error of \
             {error}, told by the load error of each step: {remedy}"
        )
    })
}

/// The first lines of one kind, and the number of the others.
fn first_few(mut lines: Vec<String>, what: &str) -> Vec<String> {
    let more = lines.len().saturating_sub(MOST_TOLD);
    lines.truncate(MOST_TOLD);
    lines.extend((more > 0).then(|| format!("{more} more {what}")));
    lines
}

/// Warnings about driven walls; `grains` if the sample is prepared.
pub(crate) fn of_walls<D: Dim>(scene: &Scene, walls: &[Wall<D>], grains: Option<&Grains<D>>) -> Vec<String> {
    let pushes: Vec<bool> =
        walls.iter().map(|wall| DriveMotion::of(wall, scene.time.end).is_some_and(|c| !c.along_surface)).collect();
    let mut told = vec![];
    for (k, (name, wall)) in scene.walls.keys().zip(walls).enumerate() {
        // the drive of the first stage is not all that moves such a wall
        if scene.stage_drives(name).next().is_some() {
            continue;
        }
        let Some(motion) = DriveMotion::of(wall, scene.time.end) else { continue };
        let alone = !others_push(scene) && !pushes.iter().enumerate().any(|(other, push)| *push && other != k);
        let word = match grains {
            _ if motion.along_surface && wall.grip.is_some() => None,
            _ if motion.along_surface => {
                let own = scene.walls[name].friction;
                let materials = 0..=scene.materials.named.len();
                along(materials.map(|k| scene.materials.wall_friction_of(k, own)).fold(0.0, f64::max), alone)
            }
            Some(grains) => {
                pulled(wall, &motion, grains).or_else(|| alone.then(|| apart(wall, &motion, grains)).flatten())
            }
            None => pulled(wall, &motion, &Grains::from_iter([])),
        };
        told.extend(word.map(|word| format!("walls.{name}: {word}")));
    }
    told.extend(grains.into_iter().flat_map(|grains| gripped_twice(scene, walls, grains)));
    told
}

/// Warnings about grains within the grip of several walls, one of which may move: the first wall
/// holds them.
fn gripped_twice<D: Dim>(scene: &Scene, walls: &[Wall<D>], grains: &Grains<D>) -> Vec<String> {
    let holds = |wall: &Wall<D>, k: usize| {
        wall.grip.is_some_and(|depth| wall.shape.gap(grains.position[k] - wall.position, grains.radius[k]).0 <= depth)
    };
    let driven = |name: &&String| !scene.drives(name, &scene.walls[*name]).is_empty();
    let lines = (0..grains.len()).filter(|k| !grains.fixed[*k]).filter_map(|k| {
        let holders: Vec<&String> =
            scene.walls.keys().zip(walls).filter(|(_, wall)| holds(wall, k)).map(|(name, _)| name).collect();
        let [first, others @ ..] = holders.as_slice() else { return None };
        (!others.is_empty() && holders.iter().any(driven)).then(|| {
            let others: Vec<String> = others.iter().map(|name| format!("walls.{name}")).collect();
            let others = others.join(" and ");
            format!(
                "walls.{first}.grip: it holds grain {k}, which is also within the grip of {others}: make one smaller"
            )
        })
    });
    first_few(lines.collect(), "grains are within the grip of several walls")
}

/// Whether something other than a wall may press grains together: gravity, a load, a membrane or a
/// moving grain.
fn others_push(scene: &Scene) -> bool {
    let nonzero = |values: &[f64]| values.iter().any(|value| *value != 0.0);
    let moving = |values: &Option<Vec<f64>>| values.as_deref().is_some_and(nonzero);
    scene.gravity.as_deref().is_some_and(nonzero)
        || scene.grains.as_ref().is_some_and(|grains| !grains.loads.is_empty())
        || scene.membrane.is_some()
        || matches!(&scene.sample, Sample::Grains(list) if list.iter().any(|g| moving(&g.velocity) || moving(&g.spin)))
}

/// Whether a wall is driven away from the grains at all times.
pub(crate) fn leaves<D: Dim>(wall: &Wall<D>, end: f64, grains: &Grains<D>) -> bool {
    let (Some(motion), Some(towards)) = (DriveMotion::of(wall, end), towards(wall, grains)) else { return false };
    let sign = motion.direction.dot(&towards);
    !motion.along_surface && motion.range.0 * sign <= 0.0 && motion.range.1 * sign <= 0.0
}

/// The motion of a wall under its drive alone.
struct DriveMotion<D: Dim> {
    /// Unit direction.
    direction: D::Vector,
    /// Whether the direction is parallel to the surface.
    along_surface: bool,
    /// Whether a force or a stress drives the wall.
    by_force: bool,
    /// What drives it, and its unit.
    drive: [&'static str; 2],
    /// Least and largest value of the drive (N or m/s).
    range: (f64, f64),
    /// Least and largest displacement along the direction until the end of the run (m).
    travel: (f64, f64),
}

impl<D: Dim> DriveMotion<D> {
    /// None if the wall never moves.
    fn of(wall: &Wall<D>, end: f64) -> Option<Self> {
        let (direction, mass, drive) = match &wall.drive {
            Drive::Fixed => return None,
            Drive::Velocity { direction, speed } => (*direction, None, speed),
            Drive::Force { direction, mass, force } => (*direction, Some(*mass), force),
        };
        let (mut range, mut travel, mut place, mut speed) = ((0.0, 0.0), (0.0, 0.0), 0.0, 0.0);
        let step = end / MOMENTS as f64;
        for k in 0..=MOMENTS {
            let value = drive(k as f64 * step);
            range = widened(range, value);
            speed = mass.map_or(value, |mass| speed + value / mass * step);
            travel = widened(travel, place);
            place += speed * step;
        }
        let along_surface = wall.shape.moves_across(direction) < PARALLEL;
        let drive = if wall.per_area { ["stress", "Pa"] } else { ["force", "N"] };
        (range != (0.0, 0.0)).then_some(Self {
            direction,
            along_surface,
            by_force: mass.is_some(),
            drive,
            range,
            travel,
        })
    }
}

fn widened((low, high): (f64, f64), value: f64) -> (f64, f64) {
    (value.min(low), value.max(high))
}

/// Warning about a wall that is driven along its own surface.
fn along(friction: f64, alone: bool) -> Option<String> {
    let way = "it is driven along its own surface";
    if friction == 0.0 {
        return Some(format!(
            "{way}, without friction, so it carries no load: give it friction, or a direction not perpendicular to its normal"
        ));
    }
    alone.then(|| {
        format!(
            "{way}, and nothing in this scene presses grains on it, so its friction carries no load: drive another wall \
             along its normal, or add gravity or a load"
        )
    })
}

/// Unit vector from a wall to its nearest grain, of a plane also without grains; none inside a
/// round wall.
fn towards<D: Dim>(wall: &Wall<D>, grains: &Grains<D>) -> Option<D::Vector> {
    if wall.shape.encloses() {
        return None;
    }
    wall.shape.flat_normal().or_else(|| nearest(wall, grains).map(|(_, normal)| normal))
}

/// Gap (m) of the grain nearest to a wall, and the unit normal towards it.
fn nearest<D: Dim>(wall: &Wall<D>, grains: &Grains<D>) -> Option<(f64, D::Vector)> {
    let gaps = grains.position.iter().zip(&grains.radius).map(|(x, r)| wall.shape.gap(*x - wall.position, *r));
    gaps.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Warning about a wall whose force always pulls it away from the grains: a confinement with the
/// wrong sign.
fn pulled<D: Dim>(wall: &Wall<D>, motion: &DriveMotion<D>, grains: &Grains<D>) -> Option<String> {
    let sign = motion.direction.dot(&towards(wall, grains)?);
    let (low, high) = motion.range;
    let away = motion.by_force && (if sign > 0.0 { high <= 0.0 } else { low >= 0.0 }) && sign != 0.0;
    let most = if sign > 0.0 { low } else { high };
    let [drive, unit] = motion.drive;
    away.then(|| {
        format!(
            "its {drive}, {} {unit}, pulls it away from the grains at all times, so it carries no load: change the sign of \
             the {drive}, or reverse the direction",
            number(most)
        )
    })
}

/// Warning about a wall that touches no grain and whose drive does not move it to one.
fn apart<D: Dim>(wall: &Wall<D>, motion: &DriveMotion<D>, grains: &Grains<D>) -> Option<String> {
    let (gap, _) = nearest(wall, grains)?;
    let mean = grains.radius.iter().sum::<f64>() / grains.len() as f64;
    let near = match wall.shape.flat_normal() {
        Some(normal) => {
            let sign = motion.direction.dot(&normal);
            (motion.travel.0 * sign).max(motion.travel.1 * sign)
        }
        // upper bound for either direction
        None => motion.travel.1.max(-motion.travel.0),
    };
    (gap > TOUCHING * mean && near < gap).then(|| {
        format!(
            "it touches nothing at the start: its nearest grain is {} m away, and its drive brings it at most {} m nearer by \
             time.end, so it carries no load: seat it ({}), or turn its direction",
            number(gap),
            number(near.max(0.0)),
            seating(wall)
        )
    })
}

#[cfg(test)]
mod tests {
    use crate::build::build;
    use crate::scene::from_text;
    use dem_core::dim::D2;

    /// The warnings for two grains on a floor below a lid, with one change.
    fn told(lid: &str, sets: &[&str]) -> Vec<String> {
        let text = format!(
            r#"{{ "dimension": 2,
                "sample": {{ "grains": [{{ "center": [0, 1], "radius": 1 }}, {{ "center": [2, 1], "radius": 1 }}] }},
                "materials": {{ "density": 1, "friction": {{ "grain_grain": 0.3, "grain_wall": 0.3 }} }},
                "grains": {{ "fixed": [], "loads": [] }},
                "walls": {{ "floor": {{ "shape": {{ "plane": {{ "normal": [0, 1], "place": "seated" }} }} }}, "lid": {lid} }},
                "time": {{ "step": 0.1, "end": 1 }}, "output": {{ "every_steps": 1 }} }}"#
        );
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let scene = from_text("test", &text, &sets).unwrap_or_else(|error| panic!("{error}"));
        build::<D2>(&scene, None, &mut |_| true).unwrap_or_else(|error| panic!("{error}")).warnings
    }

    fn lid(place: &str, drive: &str) -> String {
        format!(r#"{{ "shape": {{ "plane": {{ "normal": [0, -1], "place": {place} }} }}, {drive} }}"#)
    }

    /// The bonds of two grains of 3.14 kg have k h²/m up to 6e9, 6e3 and 6e13.
    #[test]
    fn bonds_too_stiff_for_the_precision_of_the_solver_are_told() {
        let bonded = |k: &str, kind: &str| {
            let springs =
                format!(r#""stiffness": {{ "springs": {{ "normal": {k}, "tangential": 1, "rolling": 1 }} }}"#);
            let bonds = format!(r#"bonds={{ "strength": 1, "gap_tolerance": 1e-3, "shear": 0.5, {springs} }}"#);
            let kind = format!("solver.kind={kind}");
            told(&lid(r#""seated""#, r#""velocity": { "constant": 1 }"#), &[&bonds, &kind])
        };
        let (auto, sweeps) = (r#"{ "auto": {} }"#, r#"{ "gauss_seidel": {} }"#);
        for (k, kind, expected) in [
            ("1e12", auto, None),
            ("1e6", sweeps, None),
            ("1e12", sweeps, Some("solver.kind")),
            ("1e16", auto, Some("rigid")),
        ] {
            let told = bonded(k, kind);
            assert_eq!(told.len(), usize::from(expected.is_some()), "{k}, {kind}: {told:?}");
            let fits =
                told.iter().all(|told| told.starts_with("bonds.stiffness: ") && told.contains(expected.unwrap()));
            assert!(fits, "{told:?}");
        }
    }

    #[test]
    fn a_wall_that_cannot_carry_anything_is_told() {
        let (seated, high) = (r#""seated""#, r#"{ "at": [0, 3] }"#);
        let pulled = r#""mass": "sample", "force": { "constant": -22 }"#;
        for (place, drive, parts) in [
            (
                seated,
                r#""direction": [1, 0], "velocity": { "constant": 1 }"#,
                &["along its own surface", "nothing in this scene"][..],
            ),
            (seated, r#""friction": 0, "direction": [1, 0], "velocity": { "constant": 1 }"#, &["without friction"]),
            (seated, pulled, &["-22 N, pulls it away", "change the sign"]),
            (seated, r#""mass": "sample", "direction": [0, 1], "force_rate": 3"#, &["3 N, pulls it away"]),
            (high, r#""velocity": { "constant": 0.5 }"#, &["touches nothing", "is 1 m away", "at most 0.5 m nearer"]),
            (high, r#""velocity": { "constant": -2 }"#, &["touches nothing", "at most 0 m nearer"]),
            (high, r#""mass": { "kg": 1 }, "force": { "constant": 1 }"#, &["touches nothing", "m nearer"]),
        ] {
            let told = told(&lid(place, drive), &[]);
            assert_eq!(told.len(), 1, "{drive}: {told:?}");
            for part in [&["walls.lid: "], parts].concat() {
                assert!(told[0].contains(part), "{part} is not in\n{}", told[0]);
            }
        }
        // no warning: the wall presses, moves to the grains or away from them, or moving grains may
        // reach it
        for (place, drive, sets) in [
            (seated, r#""velocity": { "constant": 1 }"#, &[][..]),
            (seated, r#""velocity": { "constant": -1 }"#, &[]),
            (seated, r#""mass": "sample", "force_rate": 3"#, &[]),
            (seated, r#""mass": "sample", "force": { "table": [[0, -1], [1, 1]] }"#, &[]),
            (high, r#""velocity": { "constant": 1.5 }"#, &[]),
            (high, r#""mass": { "kg": 1 }, "force": { "constant": 3 }"#, &[]),
            (seated, r#""direction": [1, 0], "velocity": { "constant": 1 }"#, &["gravity=[0, -9.81]"]),
            (high, r#""velocity": { "constant": 0.1 }"#, &["gravity=[0, 9.81]"]),
        ] {
            assert_eq!(told(&lid(place, drive), sets), [""; 0], "{drive}");
        }
    }

    #[test]
    fn grips_carry_along_a_surface_and_hold_a_grain_once() {
        let glued = r#""seated""#;
        let along = lid(glued, r#""grip": 0.1, "direction": [1, 0], "velocity": { "constant": 1 }"#);
        assert_eq!(told(&along, &[]), [""; 0]);
        let both = told(&along, &["walls.floor.grip=0.1"]);
        assert_eq!(both.len(), 2, "{both:?}");
        for (k, line) in both.iter().enumerate() {
            let expected = format!(
                "walls.floor.grip: it holds grain {k}, which is also within the grip of walls.lid: make one smaller"
            );
            assert_eq!(*line, expected);
        }
        // fixed walls hold it in the same place
        assert_eq!(told(&lid(glued, r#""grip": 0.1"#), &["walls.floor.grip=0.1"]), [""; 0]);
    }

    #[test]
    fn what_is_ignored_is_told() {
        let lid = lid(r#""seated""#, r#""velocity": { "constant": 1 }"#);
        for (sets, parts) in [
            (
                &["grains.fixed=[1]", "sample.grains.1.velocity=[0, 2]"][..],
                &["sample.grains.1.velocity: it has no effect because grain 1 is in grains.fixed"][..],
            ),
            (&["grains.fixed=[0]", "sample.grains.0.spin=[2]"], &["sample.grains.0.spin: it has no effect"]),
            (
                &["grains.fixed=[1]", r#"grains.loads=[{"grain": 1, "force": [1, 0]}]"#],
                &["grains.loads.0: it has no effect because grain 1 is in grains.fixed"],
            ),
            (
                &["time.end=1.05"],
                &["time.end: 1.05 s is not a multiple of time.step, 0.1 s", "ends at 1 s; 1 s and 1.1 s are multiples"],
            ),
        ] {
            let told = told(&lid, sets);
            assert_eq!(told.len(), 1, "{told:?}");
            parts.iter().for_each(|part| assert!(told[0].contains(part), "{part} is not in\n{}", told[0]));
        }
        assert_eq!(told(&lid, &["grains.fixed=[1]", "sample.grains.1.velocity=[0, 0]"]), [""; 0]);
    }
}
