//! From a scene to a world: sample, walls, loads, bonds, settings.

use crate::bonds;
use crate::drive::set_drive;
use crate::error::RunError;
use crate::materials;
use crate::output::number;
use crate::packings;
use crate::prepare::{self, Watch};
use crate::sample_file::{self, Table};
use crate::scene::{self, Place, Sample, Scene, SolverKind};
use crate::tolerances::{DEEPEST, HIDDEN, ROUNDED, TOUCHING};
use crate::touching;
use crate::warnings;
use dem_core::body::{Drive, Grain, Grains, Load, Schedule, Shape, Slide, Wall};
use dem_core::bond::Rupture;
use dem_core::contact::{BondFlow, LocalSolve};
use dem_core::detection::pairs_within;
use dem_core::dim::{Dim, Vect};
use dem_core::plate::Plate;
use dem_core::saved::{Mismatch, Reader};
use dem_core::solver::{GaussSeidelSettings, SolverSettings, StagedSettings, Stages, Start, StiffnessRatio};
use dem_core::world::{Membrane, Restitution, Settings, StepError, World};
use std::path::Path;
use std::sync::Arc;

/// A world at time zero, the solid fraction of its sample, and warnings.
pub struct Built<D: Dim> {
    /// The world.
    pub world: World<D>,
    /// Solid fraction of a random sample in its box (–).
    pub solid_fraction: Option<f64>,
    /// Warnings about probable mistakes in the scene.
    pub warnings: Vec<String>,
}

/// Radius of the disk that rolls on the surface under a membrane, over the mean radius of the
/// grains. It spans the pits of lattices, and touches a row at a plate before the next one.
const DISK: f64 = 1.5;
/// Maximum number of grain pairs that are reported individually.
const MOST_TOLD: usize = 10;

/// Prepares the sample of a scene and assembles its world. A random sample is packed, or shared
/// with other runs by way of the folder `packings` ([`packings::obtain`]). `watch` receives the
/// progress of the preparation.
///
/// # Errors
/// [`RunError`], with all errors of the sample.
pub fn build<D: Dim>(scene: &Scene, packings: Option<&Path>, watch: Watch) -> Result<Built<D>, RunError> {
    let Sampled { mut grains, solid_fraction, unsettled } = grains::<D>(scene, packings, watch)?;
    refuse_other_units(&grains)?;
    refuse_far_away(&grains)?;
    let mut wrong = hold_fixed(scene, &mut grains);
    let lost = scene.grains.iter().flat_map(|g| &g.loads).filter(|load| load.grain >= grains.len());
    wrong.extend(lost.map(|load| missing_grain("grains.loads", load.grain, grains.len())));
    let (deep, shallow) = overlapping(&grains);
    wrong.extend(deep);
    wrong.extend(unseated(scene, &grains));
    let walls = walls(scene, &grains);
    wrong.extend(buried(scene, &walls, &grains));
    wrong.extend(touching::apart(scene, &walls, &grains));
    if !wrong.is_empty() {
        return Err(RunError::Sample(wrong));
    }
    let mut warnings = warnings::of_scene(scene);
    warnings.extend(unsettled.map(warnings::of_packing));
    warnings.extend(shallow);
    warnings.extend(warnings::of_walls(scene, &walls, Some(&grains)));
    let mut world = World::new(grains, walls, loads(scene), settings(scene));
    world.membrane = membrane(scene, &world.grains);
    world.load_knots = scene.load_knots();
    if let Err(error) = world.find_surface() {
        return Err(RunError::Sample(vec![no_surface(scene, &world, &error)]));
    }
    // the world knows which grains its walls hold: those get no bonds among each other
    if scene.cement_stage().is_none() {
        world.add_bonds(bonds::of_sample(scene, &world.grains)?);
        warnings.extend(warnings::of_stiff_bonds(&world));
    }
    Ok(Built { world, solid_fraction, warnings })
}

/// The world of a scene, restored from a saved state.
///
/// # Errors
/// [`Mismatch`] if the state belongs to another scene.
pub fn rebuild<D: Dim>(scene: &Scene, from: &mut Reader) -> Result<World<D>, Mismatch> {
    let grains = Grains::restored(from)?;
    if scene.grains.iter().flat_map(|g| &g.loads).any(|load| load.grain >= grains.len()) {
        return Err(Mismatch);
    }
    let walls = walls(scene, &grains);
    let mut world = World::restored(grains, walls, loads(scene), settings(scene), from)?;
    world.membrane = membrane(scene, &world.grains);
    world.load_knots = scene.load_knots();
    Ok(world)
}

/// The membrane of a scene, whose surface is not found yet.
fn membrane<D: Dim>(scene: &Scene, grains: &Grains<D>) -> Option<Membrane<D>> {
    let membrane = scene.membrane.as_ref()?;
    let index = |name: &String| scene.wall_index(name).unwrap_or_default();
    let between = membrane.between.as_ref().map(|between| [index(&between[0]), index(&between[1])]);
    let mean = grains.radius.iter().sum::<f64>() / grains.len() as f64;
    let disk = membrane.disk_radius.unwrap_or(DISK * mean);
    let pressure = scene.first_pressure()?.clone();
    Some(Membrane::new(schedule(pressure), between, disk))
}

/// The message about a membrane without a surface at the start.
fn no_surface<D: Dim>(scene: &Scene, world: &World<D>, error: &StepError) -> String {
    let name = |body: u32| scene.body_name(world.grains.len(), body as usize);
    format!(
        "membrane: {}; seat the plates at the sample (\"place\": \"seated\"), or give another membrane.disk_radius",
        error.message(&name)
    )
}

/// The grains of a scene; the other fields as in [`prepare::Packing`], for a random sample.
struct Sampled<D: Dim> {
    grains: Grains<D>,
    solid_fraction: Option<f64>,
    unsettled: Option<f64>,
}

/// The sample of a scene.
fn grains<D: Dim>(scene: &Scene, packings: Option<&Path>, watch: Watch) -> Result<Sampled<D>, RunError> {
    let names = scene.materials.names();
    let (mut solid_fraction, mut unsettled) = (None, None);
    let table = match &scene.sample {
        Sample::Random(random) => {
            let packing = match packings {
                Some(folder) => packings::obtain::<D>(folder, random, scene.seed, watch)?,
                None => prepare::pack::<D>(random, scene.seed, watch)?,
            };
            (solid_fraction, unsettled) = (Some(packing.solid_fraction), packing.unsettled);
            Table { balls: packing.balls, material: vec![] }
        }
        Sample::Lattice(lattice) => Table { balls: prepare::lattice::<D>(lattice), material: vec![] },
        Sample::File(file) => sample_file::read::<D>(&file.path, &names)?,
        Sample::Grains(list) => {
            // a name that is none was refused with the scene
            let place = |name: &str| names.iter().position(|known| *known == name).unwrap_or_default() as u8;
            Table {
                balls: list.iter().map(|spec| (D::Vector::from_slice(&spec.center), spec.radius)).collect(),
                material: list.iter().map(|spec| spec.material.as_deref().map_or(0, place)).collect(),
            }
        }
    };
    let material = materials::assign::<D>(scene, table.material, &table.balls).map_err(RunError::Sample)?;
    let density = |k: usize| scene.materials.density_of(material.get(k).copied().map_or(0, usize::from));
    let mut grains: Grains<D> = match &scene.sample {
        Sample::Grains(list) => list.iter().enumerate().map(|(k, spec)| listed(spec, density(k), scene)).collect(),
        _ => {
            let balls = table.balls.into_iter().enumerate();
            balls.map(|(k, (x, r))| Grain::at_rest(x, r, density(k) * scene.thickness())).collect()
        }
    };
    grains.material = material;
    Ok(Sampled { grains, solid_fraction, unsettled })
}

/// Fixes the grains of `grains.fixed`; returns messages about numbers without a grain.
fn hold_fixed<D: Dim>(scene: &Scene, grains: &mut Grains<D>) -> Vec<String> {
    let mut wrong = vec![];
    for &k in scene.grains.iter().flat_map(|g| &g.fixed) {
        if k >= grains.len() {
            wrong.push(missing_grain("grains.fixed", k, grains.len()));
            continue;
        }
        grains.fixed[k] = true;
        // overrides the velocity of the list
        grains.velocity[k] = D::Vector::zero();
        grains.spin[k] = D::Spin::zero();
    }
    wrong
}

fn missing_grain(place: &str, grain: usize, count: usize) -> String {
    format!("{place}: there is no grain {grain}; the sample has {count}, counted from 0")
}

/// A grain of a list, of a material of this density (kg/m³).
fn listed<D: Dim>(spec: &scene::GrainSpec, density: f64, scene: &Scene) -> Grain<D> {
    let density = spec.density.unwrap_or(density) * scene.thickness();
    let mut grain = Grain::<D>::at_rest(D::Vector::from_slice(&spec.center), spec.radius, density);
    if let Some(mass) = spec.mass {
        grain.mass = mass;
        grain.inertia = D::INERTIA_FACTOR * mass * spec.radius * spec.radius;
    }
    grain.inertia = spec.inertia.unwrap_or(grain.inertia);
    if let Some(velocity) = &spec.velocity {
        grain.velocity = D::Vector::from_slice(velocity);
    }
    if let Some(spin) = &spec.spin {
        grain.spin = D::Spin::from_slice(spin);
    }
    grain
}

/// Rejects radii in another unit than the centres: if all grains overlap each other, the list of
/// pairs does not fit in memory.
fn refuse_other_units<D: Dim>(grains: &Grains<D>) -> Result<(), RunError> {
    let (low, high) = grains.bounds();
    let space: f64 = (high - low).as_slice().iter().product();
    let solid: f64 = grains.radius.iter().map(|r| D::volume(*r)).sum();
    // at the largest accepted overlap, the volume of the grains is less than 1.4 times that of
    // their box
    if grains.len() < 1000 || solid <= 2.0 * space {
        return Ok(());
    }
    Err(RunError::Sample(vec![format!(
        "sample: the volume of the grains is {} times that of the box around them: are radii and centres in the same unit?",
        number(solid / space)
    )]))
}

/// Rejects grains so far from the origin that the round-off of their positions hides which of them
/// touch.
fn refuse_far_away<D: Dim>(grains: &Grains<D>) -> Result<(), RunError> {
    let off = |k: usize| f64::EPSILON * grains.position[k].norm();
    let Some(k) = (0..grains.len()).find(|&k| off(k) > HIDDEN * grains.radius[k]) else { return Ok(()) };
    Err(RunError::Sample(vec![format!(
        "sample: grain {k} is {} m from the origin, where positions are rounded by {:.1e} m, and its radius is {} m: \
         contacts would be lost; move the sample to the origin",
        number(grains.position[k].norm()),
        off(k),
        number(grains.radius[k])
    )]))
}

/// Messages about pairs of grains with too large an overlap, and one warning about overlaps above
/// the round-off of decimals.
///
/// Two grains at the same place have no contact normal, and rigid grains do not overlap.
fn overlapping<D: Dim>(grains: &Grains<D>) -> (Vec<String>, Option<String>) {
    let (mut wrong, mut deep) = (vec![], 0);
    let (mut shallow, mut deepest) = (0, ([0, 0], 0.0, 0.0));
    for [i, j] in pairs_within(grains, &grains.position, &vec![0.0; grains.len()]) {
        let apart = (grains.position[i as usize] - grains.position[j as usize]).norm();
        let smaller = grains.radius[i as usize].min(grains.radius[j as usize]);
        let overlap = grains.radius[i as usize] + grains.radius[j as usize] - apart;
        let coincide = apart <= TOUCHING * smaller;
        if coincide || overlap > DEEPEST * smaller {
            deep += 1;
            if deep > MOST_TOLD {
                continue;
            }
            wrong.push(if coincide {
                format!("sample: the centres of grains {i} and {j} coincide; move one of them")
            } else {
                format!(
                    "sample: grains {i} and {j} overlap by {overlap:.3e} m, more than a tenth of the smaller radius; rigid \
                     grains cannot: move one of them, or make it smaller"
                )
            });
        } else if overlap > ROUNDED * smaller {
            shallow += 1;
            if overlap / smaller > deepest.2 {
                deepest = ([i, j], overlap, overlap / smaller);
            }
        }
    }
    wrong.extend((deep > MOST_TOLD).then(|| format!("sample: {} more pairs of grains overlap", deep - MOST_TOLD)));
    let ([i, j], overlap, share) = deepest;
    let word = (shallow > 0).then(|| {
        let pairs = if shallow == 1 {
            "one pair of grains overlaps".into()
        } else {
            format!("{shallow} pairs of grains overlap")
        };
        format!(
            "sample: {pairs}, most of all {i} and {j}, by {overlap:.3e} m ({} % of the smaller radius); they are \
             not pushed apart: the gap of such a pair is measured from its initial overlap",
            number(100.0 * share)
        )
    });
    (wrong, word)
}

fn unit<D: Dim>(components: &[f64]) -> D::Vector {
    let v = D::Vector::from_slice(components);
    v * (1.0 / v.norm())
}

fn schedule(function: scene::Function) -> Schedule {
    Arc::new(move |t| function.at(t))
}

pub(crate) fn walls<D: Dim>(scene: &Scene, grains: &Grains<D>) -> Vec<Wall<D>> {
    scene.walls.iter().map(|(name, wall)| build_wall(scene, name, wall, grains)).collect()
}

fn build_wall<D: Dim>(scene: &Scene, name: &str, wall: &scene::Wall, grains: &Grains<D>) -> Wall<D> {
    let round = |radius: f64, inside: bool, axis: Option<D::Vector>| Shape::Round { radius, inside, axis };
    let (shape, position) = match &wall.shape {
        scene::Shape::Plane(plane) => {
            let normal = unit::<D>(&plane.normal);
            let position = match &plane.place {
                Place::At(point) => D::Vector::from_slice(point),
                Place::Seated => {
                    let lowest = |(x, r): (&D::Vector, &f64)| x.dot(&normal) - r;
                    normal * grains.position.iter().zip(&grains.radius).map(lowest).fold(f64::INFINITY, f64::min)
                }
            };
            (Shape::Plane { normal }, position)
        }
        scene::Shape::Circle(c) => (round(c.radius, c.inside, None), seated(&wall.shape, &c.center, grains)),
        scene::Shape::Sphere(s) => (round(s.radius, s.inside, None), seated(&wall.shape, &s.center, grains)),
        scene::Shape::Cylinder(c) => {
            (round(c.radius, c.inside, Some(unit::<D>(&c.axis))), D::Vector::from_slice(&c.center))
        }
        scene::Shape::Plate(p) => {
            let plate = plate::<D>(p);
            let ahead = if p.seated { seat_of_plate(&plate, &p.center, grains).unwrap_or(0.0) } else { 0.0 };
            (Shape::Plate(plate), D::Vector::from_slice(&p.center) + plate.normal() * ahead)
        }
    };
    let friction = wall.friction.unwrap_or(scene.materials.friction.grain_wall);
    let mut built = Wall::fixed(shape, position, friction);
    let direction = wall.drive_direction().map_or(D::Vector::zero(), unit::<D>);
    set_drive(&mut built, wall, scene.first_drive(name, wall), direction, &grains.mass, 0.0);
    if let Drive::Velocity { direction, speed } = &built.drive {
        built.velocity = *direction * speed(0.0);
    }
    built.grip = wall.grip;
    if let Some(scene::Slide { direction: across, velocity }) = &wall.slide {
        let across = unit::<D>(across);
        // perpendicular to the last digit
        let across = across - direction * direction.dot(&across);
        let across = across * (1.0 / across.norm());
        built.velocity += across * velocity.at(0.0);
        built.slide = Some(Slide { direction: across, speed: schedule(velocity.clone()) });
    }
    built
}

/// The centre of a round wall: the given one, or for a seated wall the one at its first contact
/// with a grain.
fn seated<D: Dim>(shape: &scene::Shape, center: &[f64], grains: &Grains<D>) -> D::Vector {
    let center = D::Vector::from_slice(center);
    let Some((direction, _)) = shape.seat() else { return center };
    center + unit::<D>(direction) * seat(shape, center, grains).unwrap_or(0.0)
}

/// The distance from `center` to the first contact of a seated round wall with a grain (m); none if
/// its path meets no grain.
fn seat<D: Dim>(shape: &scene::Shape, center: D::Vector, grains: &Grains<D>) -> Option<f64> {
    let (direction, radius) = shape.seat()?;
    let along = unit::<D>(direction);
    let touch = |(x, r): (&D::Vector, &f64)| {
        let apart = *x - center;
        let ahead = apart.dot(&along);
        let (aside, reach) = (apart - along * ahead, radius + r);
        let height = reach * reach - aside.dot(&aside);
        (height > 0.0 && ahead > 0.0).then(|| ahead - height.sqrt())
    };
    grains.position.iter().zip(&grains.radius).filter_map(touch).min_by(f64::total_cmp)
}

fn plate<D: Dim>(plate: &scene::Plate) -> Plate<D> {
    Plate::new(unit::<D>(&plate.normal), plate.side.as_deref().map(D::Vector::from_slice), &plate.size)
}

/// The distance from `center` along the normal to the first contact of a seated plate with a grain
/// (m); none if its path meets no grain.
fn seat_of_plate<D: Dim>(plate: &Plate<D>, center: &[f64], grains: &Grains<D>) -> Option<f64> {
    let center = D::Vector::from_slice(center);
    let touch = |(x, r): (&D::Vector, &f64)| {
        let apart = *x - center;
        let (ahead, [a, b]) = (apart.dot(&plate.normal()), plate.beyond(apart));
        let height = r * r - (a * a + b * b);
        (height > 0.0 && ahead > 0.0).then(|| if a == 0.0 && b == 0.0 { ahead - r } else { ahead - height.sqrt() })
    };
    grains.position.iter().zip(&grains.radius).filter_map(touch).min_by(f64::total_cmp)
}

/// Messages about seated round walls and plates whose path meets no grain.
fn unseated<D: Dim>(scene: &Scene, grains: &Grains<D>) -> Vec<String> {
    let mut wrong = vec![];
    for (name, wall) in &scene.walls {
        let lost = match &wall.shape {
            scene::Shape::Circle(scene::Circle { center, .. }) | scene::Shape::Sphere(scene::Sphere { center, .. }) => {
                wall.shape.seat().is_some() && seat(&wall.shape, D::Vector::from_slice(center), grains).is_none()
            }
            scene::Shape::Plate(p) => p.seated && seat_of_plate(&plate::<D>(p), &p.center, grains).is_none(),
            scene::Shape::Plane(_) | scene::Shape::Cylinder(_) => false,
        };
        if lost {
            let (low, high) = grains.bounds();
            wrong.push(format!(
                "walls.{name}: the seated wall meets no grain along its direction; move its centre, or turn its direction: \
                 the sample reaches {}",
                materials::extent::<D>([low, high].iter())
            ));
        }
    }
    wrong
}

/// Messages about walls that overlap grains, each with the grain of largest overlap.
fn buried<D: Dim>(scene: &Scene, walls: &[Wall<D>], grains: &Grains<D>) -> Vec<String> {
    let mut wrong = vec![];
    for (name, wall) in scene.walls.keys().zip(walls) {
        let gaps = grains.position.iter().zip(&grains.radius).map(|(x, r)| wall.shape.gap(*x - wall.position, *r).0);
        let within = gaps.enumerate().filter(|(k, gap)| *gap < -TOUCHING * grains.radius[*k]);
        let (mut count, mut deepest) = (0, (0, 0.0));
        for (k, gap) in within {
            count += 1;
            if gap < deepest.1 {
                deepest = (k, gap);
            }
        }
        if count > 0 {
            let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
            wrong.push(format!(
                "walls.{name}: the wall overlaps grain {} by {:.3e} m{more}; move the wall, or give a {} {}",
                deepest.0,
                -deepest.1,
                if matches!(wall.shape, Shape::Plate(_)) { "plate" } else { "plane" },
                touching::seating(wall)
            ));
        }
    }
    wrong
}

fn loads<D: Dim>(scene: &Scene) -> Vec<Load<D>> {
    let load = |load: &scene::Load| Load {
        grain: load.grain,
        force: load.force.as_deref().map_or(D::Vector::zero(), D::Vector::from_slice),
        torque: load.torque.as_deref().map_or(D::Spin::zero(), D::Spin::from_slice),
        factor: schedule(load.time.clone()),
    };
    scene.grains.iter().flat_map(|g| &g.loads).map(load).collect()
}

/// The settings of a run of `scene`.
pub fn settings<D: Dim>(scene: &Scene) -> Settings<D> {
    let restitution = &scene.materials.restitution;
    let bouncing = restitution.grain_grain > 0.0 || restitution.grain_wall > 0.0;
    Settings {
        step: scene.time.step,
        gravity: scene.gravity.as_deref().map(D::Vector::from_slice).filter(|g| g.norm() > 0.0),
        friction: scene.materials.friction_of(0, 0),
        material_friction: materials::friction(scene),
        restitution: bouncing.then_some(Restitution {
            grain_grain: restitution.grain_grain,
            grain_wall: restitution.grain_wall,
            threshold_speed: restitution.threshold_speed,
        }),
        bond_flow: match scene.bonds.as_ref().map(|b| b.flow) {
            Some(scene::Flow::Bipotential) => BondFlow::Bipotential,
            _ => BondFlow::Associated,
        },
        rupture: match scene.rupture {
            scene::Rupture::Cascade => Rupture::Cascade,
            scene::Rupture::CascadeWorst => Rupture::CascadeWorst,
            scene::Rupture::EndOfStep => Rupture::EndOfStep,
            scene::Rupture::NextEvent => Rupture::NextEvent { until: scene.time.end },
        },
        solver: solver(&scene.solver),
        max_halvings: scene.solver.max_step_halvings,
        thickness: if D::N == 2 { scene.thickness() } else { 1.0 },
        ..Settings::default()
    }
}

fn solver(solver: &scene::Solver) -> SolverSettings {
    let (tolerance, accept) = (solver.tolerance, solver.accept());
    match &solver.kind {
        SolverKind::GaussSeidel(gs) => SolverSettings::GaussSeidel(GaussSeidelSettings {
            local: match gs.local {
                scene::LocalSolve::Exact => LocalSolve::Exact,
                scene::LocalSolve::PredictorCorrector => LocalSolve::PredictorCorrector,
            },
            tolerance,
            accept,
            max_sweeps: gs.max_sweeps,
            acceleration: gs.acceleration,
        }),
        SolverKind::Auto(newton) => SolverSettings::Staged(staged(newton, Stages::All, tolerance, accept)),
        SolverKind::Newton(newton) => SolverSettings::Staged(staged(newton, Stages::Newton, tolerance, accept)),
        SolverKind::Interior(newton) => SolverSettings::Staged(staged(newton, Stages::Interior, tolerance, accept)),
    }
}

fn staged(newton: &scene::Newton, stages: Stages, tolerance: f64, accept: f64) -> StagedSettings {
    StagedSettings {
        stages,
        tolerance,
        accept,
        load_tolerance: newton.load_tolerance,
        start: match newton.start {
            scene::Start::StiffLimit => Start::StiffLimit,
            scene::Start::LastStep => Start::LastStep,
        },
        stiffness: StiffnessRatio { tangential: newton.tangential_stiffness, rolling: newton.rolling_stiffness },
        max_iterations: newton.max_iterations,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem_core::dim::D2;

    #[test]
    fn what_a_scene_with_one_material_says_of_its_pair_holds() {
        let text = include_str!("../../configs/two-grains.json");
        let friction = |sets: &[&str]| {
            let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
            settings::<D2>(&scene::from_text("test", text, &sets).expect("a scene")).friction
        };
        let pair = r#"materials.pairs=[{"between": ["base", "base"], "friction": 0.125}]"#;
        assert_eq!((friction(&[]) == 0.125, friction(&[pair])), (false, 0.125));
    }

    #[test]
    fn the_defaults_of_a_scene_are_those_of_the_library() {
        let scene = scene::Solver { accept: Some(StagedSettings::default().accept), ..scene::Solver::default() };
        assert_eq!(solver(&scene), SolverSettings::default());
        assert_eq!(scene.max_step_halvings, Settings::<D2>::default().max_halvings);
        let gauss_seidel = SolverKind::GaussSeidel(scene::GaussSeidel::default());
        let expected = SolverSettings::GaussSeidel(GaussSeidelSettings::default());
        assert_eq!(solver(&scene::Solver { kind: gauss_seidel, ..scene }), expected);
    }
}
