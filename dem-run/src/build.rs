//! From a scene to a world: sample, walls, loads, bonds, settings.

use crate::error::RunError;
use crate::output::number;
use crate::packings;
use crate::prepare::{self, Ball, Watch};
use crate::sample_file;
use crate::scene::{self, Drive as SceneDrive, Place, Sample, Scene, SolverKind, WallMass};
use crate::tolerances::{DEEPEST, ROUNDED, TOUCHING};
use crate::warnings;
use dem_core::body::{Drive, Grain, Grains, Load, Schedule, Shape, Wall};
use dem_core::bond::{self, Bond, Rupture};
use dem_core::contact::{BondFlow, LocalSolve};
use dem_core::detection::pairs_within;
use dem_core::dim::{Dim, Vect};
use dem_core::saved::{Mismatch, Reader};
use dem_core::solver::{GaussSeidelSettings, SolverSettings, StagedSettings, Stages, Start, StiffnessRatio};
use dem_core::world::{Restitution, Settings, World};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

/// Stream of the random generator from which strengths of bonds are drawn.
const SCATTER_STREAM: u128 = 1;

/// A world at time zero, the solid fraction of its sample, and warnings.
pub struct Built<D: Dim> {
    /// The world.
    pub world: World<D>,
    /// Solid fraction of a random sample in its box (–).
    pub solid_fraction: Option<f64>,
    /// Warnings about probable mistakes in the scene.
    pub warnings: Vec<String>,
}

/// Grains and walls in their places.
pub struct Placed<D: Dim> {
    /// The grains.
    pub grains: Grains<D>,
    /// The walls, in the order of their names.
    pub walls: Vec<Wall<D>>,
    /// Solid fraction of a random sample in its box (–).
    pub solid_fraction: Option<f64>,
    /// Warnings about probable mistakes in the scene.
    pub warnings: Vec<String>,
}

/// Maximum number of grain pairs that are reported individually.
const MOST_TOLD: usize = 10;

/// Prepares the sample of a scene and assembles its world. A random sample is packed, or shared
/// with other runs by way of the folder `packings` ([`packings::obtain`]). `watch` receives the
/// progress of the preparation.
///
/// # Errors
/// [`RunError`], with all errors of the sample.
pub fn build<D: Dim>(scene: &Scene, packings: Option<&Path>, watch: Watch) -> Result<Built<D>, RunError> {
    let Placed { grains, walls, solid_fraction, warnings } = place::<D>(scene, packings, watch)?;
    let mut world = World::new(grains, walls, loads(scene), settings(scene));
    if let Some(bonds) = &scene.bonds {
        let strength = |mean_diameter| bonds.cohesion(scene.dimension, mean_diameter, scene.thickness());
        let friction = bonds.friction.unwrap_or(scene.materials.friction.grain_grain);
        world.form_bonds(bonds.gap_tolerance, strength, friction);
        for bond in &mut world.bonds {
            (bond.shear, bond.rolling) = (bonds.shear.unwrap_or(friction), bonds.rolling.unwrap_or(friction));
        }
        if let Some(scatter) = bonds.scatter {
            scatter_strengths(&mut world.bonds, scatter, scene.seed);
        }
        if let Some(twist) = bonds.twist {
            world.limit_twist(twist);
        }
        if let Some(stiffness) = bonds.stiffness {
            world.make_bonds_elastic(|a| bond_stiffness::<D>(stiffness, a, scene.thickness()));
        }
    }
    Ok(Built { world, solid_fraction, warnings })
}

/// Prepares the sample of a scene, as [`build`] does, and positions its walls.
///
/// # Errors
/// As [`build`].
pub fn place<D: Dim>(scene: &Scene, packings: Option<&Path>, watch: Watch) -> Result<Placed<D>, RunError> {
    let Sampled { mut grains, solid_fraction, unsettled } = grains::<D>(scene, packings, watch)?;
    refuse_other_units(&grains)?;
    let mut wrong = hold_fixed(scene, &mut grains);
    let loads = scene.grains.iter().flat_map(|g| &g.loads);
    let lost = loads.filter(|load| load.grain >= grains.len());
    wrong.extend(lost.map(|load| missing_grain("grains.loads", load.grain, grains.len())));
    let (deep, shallow) = overlapping(&grains);
    wrong.extend(deep);
    wrong.extend(unseated(scene, &grains));
    let walls = walls(scene, &grains);
    wrong.extend(buried(scene, &walls, &grains));
    if !wrong.is_empty() {
        return Err(RunError::Sample(wrong));
    }
    let mut warnings = warnings::of_scene(scene);
    warnings.extend(unsettled.map(warnings::of_packing));
    warnings.extend(shallow);
    warnings.extend(warnings::of_walls(scene, &walls, Some(&grains)));
    Ok(Placed { grains, walls, solid_fraction, warnings })
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
    World::restored(grains, walls, loads(scene), settings(scene), from)
}

/// The grains of a scene; the other fields as in [`prepare::Packing`], for a random sample.
struct Sampled<D: Dim> {
    grains: Grains<D>,
    solid_fraction: Option<f64>,
    unsettled: Option<f64>,
}

/// The sample of a scene.
fn grains<D: Dim>(scene: &Scene, packings: Option<&Path>, watch: Watch) -> Result<Sampled<D>, RunError> {
    let density = scene.materials.density * scene.thickness();
    let at_rest =
        |balls: Vec<Ball<D>>| balls.into_iter().map(|(x, r)| Grain::at_rest(x, r, density)).collect::<Grains<D>>();
    let grains = match &scene.sample {
        Sample::Random(random) => {
            let prepare::Packing { balls, solid_fraction, unsettled } = match packings {
                Some(folder) => packings::obtain::<D>(folder, random, scene.seed, watch)?,
                None => prepare::pack::<D>(random, scene.seed, watch)?,
            };
            return Ok(Sampled { grains: at_rest(balls), solid_fraction: Some(solid_fraction), unsettled });
        }
        Sample::Lattice(lattice) => at_rest(prepare::lattice::<D>(lattice)),
        Sample::File(file) => at_rest(sample_file::read::<D>(&file.path)?),
        Sample::Grains(list) => list.iter().map(|spec| listed(spec, scene)).collect(),
    };
    Ok(Sampled { grains, solid_fraction: None, unsettled: None })
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

fn listed<D: Dim>(spec: &scene::GrainSpec, scene: &Scene) -> Grain<D> {
    let density = spec.density.unwrap_or(scene.materials.density) * scene.thickness();
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
    scene.walls.values().map(|wall| build_wall(scene, wall, grains)).collect()
}

fn build_wall<D: Dim>(scene: &Scene, wall: &scene::Wall, grains: &Grains<D>) -> Wall<D> {
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
    };
    let friction = wall.friction.unwrap_or(scene.materials.friction.grain_wall);
    let mut built = Wall::fixed(shape, position, friction);
    let direction = wall.drive_direction().map_or(D::Vector::zero(), unit::<D>);
    built.drive = match wall.drive() {
        SceneDrive::Fixed => Drive::Fixed,
        SceneDrive::Velocity(speed) => {
            built.velocity = direction * speed.at(0.0);
            Drive::Velocity { direction, speed: schedule(speed) }
        }
        SceneDrive::Force(force) => {
            let mass = match wall.mass {
                Some(WallMass::Kg(mass)) => mass,
                _ => grains.mass.iter().sum(),
            };
            Drive::Force { direction, mass, force: schedule(force) }
        }
    };
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

/// Messages about seated round walls whose path meets no grain.
fn unseated<D: Dim>(scene: &Scene, grains: &Grains<D>) -> Vec<String> {
    let mut wrong = vec![];
    for (name, wall) in &scene.walls {
        let (scene::Shape::Circle(scene::Circle { center, .. }) | scene::Shape::Sphere(scene::Sphere { center, .. })) =
            &wall.shape
        else {
            continue;
        };
        if wall.shape.seat().is_some() && seat(&wall.shape, D::Vector::from_slice(center), grains).is_none() {
            let (low, high) = grains.bounds();
            let corner = |x: D::Vector| x.as_slice().iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
            wrong.push(format!(
                "walls.{name}: the seated wall meets no grain along its direction; move its centre, or turn its direction: \
                 the sample reaches from ({}) to ({}) m",
                corner(low),
                corner(high)
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
                "walls.{name}: the wall overlaps grain {} by {:.3e} m{more}; move the wall, or give a plane \"place\": \"seated\"",
                deepest.0, -deepest.1
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
        friction: scene.materials.friction.grain_grain,
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

/// Multiplies the strength of each bond by a random factor, in the order of the bonds' pairs.
fn scatter_strengths(bonds: &mut [Bond], scatter: scene::Scatter, seed: u64) {
    // a separate stream: the packing uses the default stream of the seed
    let mut rng = Pcg64::new(u128::from(seed), SCATTER_STREAM);
    let mut share = || loop {
        let share = rng.random::<f64>();
        if share > 0.0 {
            break share;
        }
    };
    for bond in bonds {
        bond.strength *= match scatter {
            scene::Scatter::Weibull { modulus } => (-share().ln()).powf(1.0 / modulus),
            scene::Scatter::Normal { deviation } => loop {
                // Box & Muller 1958
                let normal = (-2.0 * share().ln()).sqrt() * (2.0 * PI * share()).cos();
                let factor = 1.0 + deviation * normal;
                if factor > 0.0 {
                    break factor;
                }
            },
        };
    }
}

/// Stiffness of a bond of mean diameter `a` (m). A bar of length a and width a, either round or of
/// thickness t, has the axial stiffness E A/a, the shear stiffness G A/a and the bending stiffness
/// E I/a; a round bar has the twist stiffness G 2I/a.
fn bond_stiffness<D: Dim>(stiffness: scene::Stiffness, a: f64, thickness: f64) -> bond::Stiffness {
    match stiffness {
        scene::Stiffness::Springs(scene::Springs { normal, tangential, rolling, twist }) => {
            bond::Stiffness { normal, tangential, rolling, twist: twist.unwrap_or_default() }
        }
        scene::Stiffness::Young(scene::Young { modulus, poisson_ratio }) => {
            let (area, second_moment) = match D::N {
                2 => (a * thickness, thickness * a.powi(3) / 12.0),
                _ => (0.25 * PI * a * a, PI * a.powi(4) / 64.0),
            };
            let normal = modulus * area / a;
            let tangential = normal / (2.0 * (1.0 + poisson_ratio));
            let rolling = modulus * second_moment / a;
            bond::Stiffness { normal, tangential, rolling, twist: rolling / (1.0 + poisson_ratio) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem_core::dim::{D2, D3Twist};

    fn assert_near(found: bond::Stiffness, expected: [f64; 4]) {
        for (found, expected) in [found.normal, found.tangential, found.rolling, found.twist].into_iter().zip(expected)
        {
            assert!((found / expected - 1.0).abs() < 1e-14, "{found} against {expected}");
        }
    }

    fn scattered(scatter: scene::Scatter, count: u32, seed: u64) -> Vec<f64> {
        let grains = (0..count + 1).map(|k| Grain::<D2>::at_rest([f64::from(k), 0.0].into(), 0.5, 1.0)).collect();
        let mut world = World::new(grains, vec![], vec![], Settings::default());
        world.form_bonds(1e-6, |_| 10.0, 0.3);
        scatter_strengths(&mut world.bonds, scatter, seed);
        world.bonds.iter().map(|bond| bond.strength).collect()
    }

    /// The largest distance of an empirical distribution from a given one (Kolmogorov & Smirnov).
    fn distance(mut values: Vec<f64>, below: impl Fn(f64) -> f64) -> f64 {
        values.sort_by(f64::total_cmp);
        let count = values.len() as f64;
        let apart = |(k, value): (usize, &f64)| {
            let (low, high, exact) = (k as f64 / count, (k + 1) as f64 / count, below(*value));
            (exact - low).abs().max((high - exact).abs())
        };
        values.iter().enumerate().map(apart).fold(0.0, f64::max)
    }

    #[test]
    fn the_weakest_of_weibull_bonds_is_a_weibull_bond() {
        // 1,000 chains of 20 bonds: weakest links of scale σ₀ N^(−1/m)
        let (modulus, links, chains) = (5.0, 20, 1000);
        let weakest = |seed: u64| {
            let bonds = scattered(scene::Scatter::Weibull { modulus }, links, seed);
            bonds.into_iter().fold(f64::INFINITY, f64::min)
        };
        let scale = 10.0 * f64::from(links).powf(-1.0 / modulus);
        let off = distance((0..chains).map(weakest).collect(), |s| 1.0 - (-(s / scale).powf(modulus)).exp());
        // a sample of the distribution exceeds this distance with probability 1/1000
        assert!(off < 1.95 / (chains as f64).sqrt(), "{off}");
    }

    #[test]
    fn normal_strengths_have_their_mean_and_deviation() {
        let bonds = scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 3);
        let mean = bonds.iter().sum::<f64>() / bonds.len() as f64;
        let variance = bonds.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / bonds.len() as f64;
        assert!((mean - 10.0).abs() < 0.08 && (variance.sqrt() - 2.0).abs() < 0.06, "{mean} {variance}");
        assert!(bonds.iter().all(|s| *s > 0.0));
        // the same seed gives the same bonds, another seed others
        assert_eq!(bonds, scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 3));
        assert_ne!(bonds, scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 4));
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

    #[test]
    fn a_bond_is_as_stiff_as_a_bar_of_its_size() {
        let (young, poisson, a, thickness) = (2e9, 0.25, 4e-3, 0.01);
        let shear = young / (2.0 * (1.0 + poisson));
        let bar = scene::Stiffness::Young(scene::Young { modulus: young, poisson_ratio: poisson });
        // round: A = π a²/4, I = π a⁴/64 and the polar J = π a⁴/32
        let round =
            [young * PI * a / 4.0, shear * PI * a / 4.0, young * PI * a.powi(3) / 64.0, shear * PI * a.powi(3) / 32.0];
        assert_near(bond_stiffness::<D3Twist>(bar, a, 1.0), round);
        // a square plate: A = a t, I = t a³/12; no twist in 2D
        let plate = bond_stiffness::<D2>(bar, a, thickness);
        let expected = [young * thickness, shear * thickness, young * thickness * a * a / 12.0];
        assert_near(bond::Stiffness { twist: 1.0, ..plate }, [expected[0], expected[1], expected[2], 1.0]);
        // springs of the scene do not depend on the diameter
        let springs = scene::Springs { normal: 1.0, tangential: 2.0, rolling: 3.0, twist: Some(4.0) };
        assert_near(bond_stiffness::<D3Twist>(scene::Stiffness::Springs(springs), a, 1.0), [1.0, 2.0, 3.0, 4.0]);
    }
}
