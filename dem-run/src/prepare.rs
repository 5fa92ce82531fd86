//! Sample preparation: initial positions of the grains.
//!
//! A random sample is packed without friction by steps from rest to rest. Each step solves min ½‖v
//! − h g‖²_M subject to gap + h Hᵀv ≥ 0 with the contact solver of the run, moves the grains by h v
//! and resets their velocity to zero. This sequence of linearised packings ends when no grain can
//! move. The thrust of the last steps is so small that the gaps of loaded contacts, walls included,
//! close to round-off. Time has no meaning here (h = 1), so the packing of a sample scales exactly
//! with its lengths.

use crate::scene::{Cut, Diameters, Lattice, Preparation, RandomSample, Section};
use dem_core::body::{Drive, Grain, Grains, Shape, Wall};
use dem_core::contact::LocalSolve;
use dem_core::dim::{Dim, Vect};
use dem_core::solver::{GaussSeidelSettings, SolverSettings};
use dem_core::world::{Settings, StepError, World};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;
use thiserror::Error;

/// A grain's centre and radius (m).
pub type Ball<D> = (<D as Dim>::Vector, f64);

/// Why a sample could not be prepared.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// The packing ended looser than the scene asks for.
    #[error(
        "sample.random.preparation: the densest of {MOST_PACKINGS} packings reached a solid fraction of {reached:.5}, the scene \
         asks for {wanted}: lower solid_fraction, or change seed, width or count"
    )]
    TooLoose {
        /// Solid fraction reached (–).
        reached: f64,
        /// Requested solid fraction (–).
        wanted: f64,
    },
    /// The box is too narrow.
    #[error("sample.random.width: the box ({width} m) is narrower than the largest grain ({diameter} m)")]
    TooNarrow {
        /// Width or depth of the box (m).
        width: f64,
        /// Largest diameter (m).
        diameter: f64,
    },
    /// The cut leaves nothing.
    #[error("sample.random.cut.circle: no grain lies within a circle of {diameter} m: make it wider than a grain")]
    NothingLeft {
        /// Diameter of the circle (m).
        diameter: f64,
    },
    /// A step of the packing was not solved.
    #[error("the packing of the sample failed: {0}")]
    Step(#[from] StepError),
    /// The caller requested an interruption.
    #[error("interrupted while the sample was packed")]
    Interrupted,
}

/// A prepared random packing.
#[derive(Clone, Debug)]
pub struct Packing<D: Dim> {
    /// The grains.
    pub balls: Vec<Ball<D>>,
    /// Volume of the grains over volume of the box between the walls (–).
    pub solid_fraction: f64,
    /// Displacement of the last step, in mean radii, if the packing did not come to rest within its
    /// steps.
    pub unsettled: Option<f64>,
}

/// Callback: receives the progress of the packing (0 to 1), returns false to stop the packing.
pub type Watch<'a> = &'a mut dyn FnMut(f64) -> bool;

/// Version of the packing method. It increases with every change that alters the bits of a packing,
/// also one of the contact solver: packings kept by an earlier version are then not used.
pub const METHOD: u32 = 1;
/// Maximum number of steps of one packing.
pub const MOST_STEPS: usize = 20_000;
/// Maximum number of packings, each from other initial positions; the first dense enough is used.
const MOST_PACKINGS: usize = 8;
/// First and last thrust: displacement of a free body in a step, in mean radii.
const THRUST: (f64, f64) = (0.5, 1e-11);
/// Solid fraction of a dense packing in 2D and 3D; the scale of progress.
const DENSE: [f64; 2] = [0.82, 0.62];

/// Grains on a regular lattice. The lowest corner of its box is the origin.
pub fn lattice<D: Dim>(lattice: &Lattice) -> Vec<Ball<D>> {
    let r = 0.5 * lattice.diameter();
    let mut balls = Vec::new();
    let mut add = |x: [f64; 3]| balls.push((D::Vector::from_slice(&x[..D::N]), r));
    match *lattice {
        Lattice::Hexagonal { rows, columns, layers, .. } => {
            for layer in 0..layers.unwrap_or(1) {
                for row in 0..rows {
                    let (short, deeper) = ((row + layer) % 2, (layer % 2) as f64 / 3.0);
                    for column in 0..columns - short {
                        let x = r * (1.0 + 2.0 * column as f64 + short as f64);
                        let y = r * (1.0 + 3f64.sqrt() * (row as f64 + deeper));
                        add([x, y, r * (1.0 + (8f64 / 3.0).sqrt() * layer as f64)]);
                    }
                }
            }
        }
        Lattice::Square { rows, columns, .. } => {
            for row in 0..rows {
                (0..columns)
                    .for_each(|column| add([r * (1.0 + 2.0 * column as f64), r * (1.0 + 2.0 * row as f64), 0.0]));
            }
        }
        Lattice::Cubic { counts: [nx, ny, nz], .. } => {
            let at = |k: usize| r * (1.0 + 2.0 * k as f64);
            for z in 0..nz {
                for y in 0..ny {
                    (0..nx).for_each(|x| add([at(x), at(y), at(z)]));
                }
            }
        }
    }
    balls
}

fn draw_radii(diameters: &Diameters, count: usize, rng: &mut Pcg64) -> Vec<f64> {
    let total: f64 = if let Diameters::Table(rows) = diameters { rows.iter().map(|r| r[1]).sum() } else { 0.0 };
    let mut draw = || match diameters {
        Diameters::Constant(d) => *d,
        Diameters::Uniform(range) => range.min + (range.max - range.min) * rng.random::<f64>(),
        Diameters::Table(rows) => {
            let mut left = total * rng.random::<f64>();
            let pick = rows.iter().find(|row| {
                left -= row[1];
                left < 0.0
            });
            pick.or(rows.last()).map_or(0.0, |row| row[0])
        }
    };
    (0..count).map(|_| 0.5 * draw()).collect()
}

/// The box of a packing, which starts at the origin; the last axis is up.
struct Container {
    section: Section,
    /// Width and depth (m).
    sides: [f64; 2],
}

impl Container {
    fn of(sample: &RandomSample) -> Self {
        let sides = [sample.width, sample.depth.unwrap_or(sample.width)];
        Self { section: sample.section, sides }
    }

    /// Area (m²) in 3D, width (m) in 2D.
    fn floor<D: Dim>(&self) -> f64 {
        match self.section {
            Section::Rectangle => self.sides[..D::N - 1].iter().product(),
            Section::Circle => std::f64::consts::PI * 0.25 * self.sides[0] * self.sides[0],
        }
    }

    /// Floor and sides, without friction.
    fn walls<D: Dim>(&self) -> Vec<Wall<D>> {
        let up = D::N - 1;
        let plane = |normal, place| Wall::fixed(Shape::Plane { normal }, place, 0.0);
        let mut walls = vec![plane(unit::<D>(up, 1.0), D::Vector::zero())];
        match self.section {
            Section::Rectangle => {
                for axis in 0..up {
                    walls.push(plane(unit::<D>(axis, 1.0), D::Vector::zero()));
                    walls.push(plane(unit::<D>(axis, -1.0), unit::<D>(axis, self.sides[axis])));
                }
            }
            Section::Circle => {
                let radius = 0.5 * self.sides[0];
                let axis = Some(unit::<D>(up, 1.0));
                let middle = unit::<D>(0, radius) + unit::<D>(1, radius);
                walls.push(Wall::fixed(Shape::Round { radius, inside: true, axis }, middle, 0.0));
            }
        }
        walls
    }

    /// The cells of a layer, at least `size` (m) wide: their lower corners and widths (m).
    fn cells<D: Dim>(&self, size: f64) -> (Vec<D::Vector>, [f64; 2]) {
        let mut number = [1; 2];
        let mut spacing = self.sides;
        for axis in 0..D::N - 1 {
            number[axis] = ((self.sides[axis] / size) as usize).max(1);
            spacing[axis] = self.sides[axis] / number[axis] as f64;
        }
        let corner = |k: usize| {
            unit::<D>(0, (k % number[0]) as f64 * spacing[0])
                + if D::N == 3 { unit::<D>(1, (k / number[0]) as f64 * spacing[1]) } else { D::Vector::zero() }
        };
        let corners = (0..number[0] * number[1]).map(corner);
        match self.section {
            Section::Rectangle => (corners.collect(), spacing),
            Section::Circle => {
                // cells with all corners in the circle; if there is none, one cell in the middle
                let radius = 0.5 * self.sides[0];
                let far = |x: f64| (x - radius).abs().max((x + spacing[0] - radius).abs());
                let inside: Vec<_> = corners.filter(|x| far(x[0]).hypot(far(x[1])) <= radius).collect();
                if inside.is_empty() {
                    let side = radius * std::f64::consts::SQRT_2;
                    let low = radius - 0.5 * side;
                    return (vec![unit::<D>(0, low) + unit::<D>(1, low)], [side; 2]);
                }
                (inside, spacing)
            }
        }
    }
}

fn unit<D: Dim>(axis: usize, length: f64) -> D::Vector {
    let mut e = D::Vector::zero();
    e[axis] = length;
    e
}

/// Radii of the grains of a random sample (m), before they are packed.
pub(crate) fn radii(sample: &RandomSample, seed: u64) -> Vec<f64> {
    draw_radii(&sample.diameter, sample.count, &mut Pcg64::seed_from_u64(seed))
}

/// Sides of the box of a random sample (m); its height follows from the requested solid fraction.
pub(crate) fn sides<D: Dim>(sample: &RandomSample, radii: &[f64]) -> Vec<f64> {
    let container = Container::of(sample);
    let volume: f64 = radii.iter().map(|r| D::volume(*r)).sum();
    let (fraction, _) = wanted(sample);
    let mut sides = container.sides[..D::N - 1].to_vec();
    sides.push(volume / (fraction * container.floor::<D>()));
    sides
}

/// The requested solid fraction of a sample (–), and whether a lid compacts it.
fn wanted(sample: &RandomSample) -> (f64, bool) {
    match &sample.preparation {
        Preparation::Compaction(c) => (c.solid_fraction, true),
        Preparation::Deposition(d) => (d.solid_fraction, false),
    }
}

/// A random packing.
pub fn pack<D: Dim>(sample: &RandomSample, seed: u64, watch: Watch) -> Result<Packing<D>, PrepareError> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut radii = draw_radii(&sample.diameter, sample.count, &mut rng);
    let largest = 2.0 * radii.iter().copied().fold(0.0, f64::max);
    let container = Container::of(sample);
    for side in &container.sides[..D::N - 1] {
        if *side < largest {
            return Err(PrepareError::TooNarrow { width: *side, diameter: largest });
        }
    }
    let (wanted, from_top) = wanted(sample);
    let mut reached = 0.0;
    for attempt in 0..MOST_PACKINGS {
        radii.shuffle(&mut rng);
        let (grains, top) = scatter::<D>(&radii, &container, &mut rng);
        let mut world = packing_world(grains, &container, top, from_top);
        let share = |done: f64| (attempt as f64 + done) / MOST_PACKINGS as f64;
        let mut watch = |done| watch(if attempt == 0 { done } else { share(done) });
        let unsettled = settle(&mut world, &container, from_top, MOST_STEPS, &mut watch)?;
        let mut packing = Packing { unsettled, ..measured(&world, &container) };
        if packing.solid_fraction >= wanted {
            if let Some(cut) = sample.cut {
                cut_out::<D>(&mut packing.balls, cut)?;
            }
            return Ok(packing);
        }
        reached = packing.solid_fraction.max(reached);
    }
    Err(PrepareError::TooLoose { reached, wanted })
}

/// The grains of a packing, and the solid fraction below the top of the highest grain.
fn measured<D: Dim>(world: &World<D>, container: &Container) -> Packing<D> {
    let balls: Vec<Ball<D>> = world.grains.position.iter().copied().zip(world.grains.radius.iter().copied()).collect();
    let height = balls.iter().map(|(x, r)| x[D::N - 1] + r).fold(0.0, f64::max);
    let volume = container.floor::<D>() * height;
    let solid_fraction = balls.iter().map(|(_, r)| D::volume(*r)).sum::<f64>() / volume;
    Packing { balls, solid_fraction, unsettled: None }
}

/// Removes the grains outside the shape, which is centred on the packing.
fn cut_out<D: Dim>(balls: &mut Vec<Ball<D>>, cut: Cut) -> Result<(), PrepareError> {
    let Cut::Circle(diameter) = cut;
    let middle = [0, D::N - 1].map(|axis| {
        let ends = balls.iter().map(|(x, r)| (x[axis] - r, x[axis] + r));
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
        0.5 * (low + high)
    });
    balls.retain(|(x, r)| (x[0] - middle[0]).hypot(x[D::N - 1] - middle[1]) + r <= 0.5 * diameter);
    if balls.is_empty() { Err(PrepareError::NothingLeft { diameter }) } else { Ok(()) }
}

/// Grains on a loose grid with random offsets, and the height of the grid.
fn scatter<D: Dim>(radii: &[f64], container: &Container, rng: &mut Pcg64) -> (Grains<D>, f64) {
    let rise = 1.05 * 2.0 * radii.iter().copied().fold(0.0, f64::max);
    let (cells, widths) = container.cells::<D>(rise);
    let place = |(k, r): (usize, &f64)| {
        let mut x = cells[k % cells.len()];
        for axis in 0..D::N - 1 {
            let slack = widths[axis] - 2.0 * r;
            let offset = slack * rng.random::<f64>();
            // in a narrow tube, a grain wider than its square is centred in it
            x[axis] = if slack >= 0.0 { x[axis] + r + offset } else { x[axis] + 0.5 * widths[axis] };
        }
        x[D::N - 1] = (k / cells.len()) as f64 * rise + r + (rise - 2.0 * r) * rng.random::<f64>();
        Grain::at_rest(x, *r, 1.0)
    };
    let grains: Grains<D> = radii.iter().enumerate().map(place).collect();
    let top = radii.len().div_ceil(cells.len()) as f64 * rise;
    (grains, top)
}

/// A frictionless box with fixed floor and sides, loaded by a lid or by gravity.
fn packing_world<D: Dim>(grains: Grains<D>, container: &Container, top: f64, from_top: bool) -> World<D> {
    let up = D::N - 1;
    let mut walls = container.walls();
    if from_top {
        walls.push(Wall::fixed(Shape::Plane { normal: unit::<D>(up, -1.0) }, unit::<D>(up, top), 0.0));
    }
    let settings =
        Settings { step: 1.0, solver: solver(), max_halvings: 0, expel_overlaps: true, ..Settings::default() };
    World::new(grains, walls, Vec::new(), settings)
}

fn solver() -> SolverSettings {
    // a step may miss its tolerance: the next step corrects the packing
    SolverSettings::GaussSeidel(GaussSeidelSettings {
        local: LocalSolve::Exact,
        tolerance: 1e-4,
        accept: f64::INFINITY,
        max_sweeps: 5_000,
        acceleration: 0,
    })
}

/// Sets the force of the lid, or gravity if there is no lid, such that a free body moves by
/// `travel` (m) in one step.
fn push<D: Dim>(world: &mut World<D>, from_top: bool, travel: f64) {
    let mut down = D::Vector::zero();
    down[D::N - 1] = -1.0;
    if from_top {
        // the lid has the mass of the sample
        let mass: f64 = world.grains.mass.iter().sum();
        let force = mass * travel;
        if let Some(lid) = world.walls.last_mut() {
            lid.drive = Drive::Force { direction: down, mass, force: Arc::new(move |_| force) };
        }
    } else {
        world.settings.gravity = Some(down * travel);
    }
}

/// Height of the lid (m); without a lid, twice the mean height of the grains.
fn height<D: Dim>(world: &World<D>, from_top: bool) -> f64 {
    let up = D::N - 1;
    if from_top {
        return world.walls.last().map_or(0.0, |lid| lid.position[up]);
    }
    2.0 * world.grains.position.iter().map(|x| x[up]).sum::<f64>() / world.grains.len() as f64
}

/// Makes at most `steps` steps from rest to rest, until no grain moves. Returns the displacement of
/// the last step, in mean radii, if the packing still moves.
///
/// The error of a step is proportional to its thrust. When the packing resists, the thrust is
/// reduced, finally to nearly zero: a packing that is jammed under one thrust is jammed under any,
/// and its gaps close to round-off.
fn settle<D: Dim>(
    world: &mut World<D>,
    container: &Container,
    from_top: bool,
    steps: usize,
    watch: Watch,
) -> Result<Option<f64>, PrepareError> {
    let mean = world.grains.radius.iter().sum::<f64>() / world.grains.len() as f64;
    let mut thrust = THRUST.0;
    let volume: f64 = world.grains.radius.iter().map(|r| D::volume(*r)).sum();
    let (begun, dense) = (height(world, from_top), volume / (DENSE[D::N - 2] * container.floor::<D>()));
    let mut last = 0.0;
    for _ in 0..steps {
        push(world, from_top, thrust * mean);
        world.stop_motion();
        world.step()?;
        // h = 1: the velocity is the displacement per step
        let moved = if from_top {
            world.walls.last().map_or(0.0, |lid| lid.velocity.norm())
        } else {
            world.grains.velocity.iter().map(Vect::norm).sum::<f64>() / world.grains.len() as f64
        };
        last = moved / mean;
        let share = last / thrust;
        thrust *= if share < 0.1 { 0.7 } else { 1.0 };
        if thrust < THRUST.1 {
            return Ok(None);
        }
        let fallen = ((begun - height(world, from_top)) / (begun - dense)).clamp(0.0, 1.0);
        let closed = (THRUST.0 / thrust).ln() / (THRUST.0 / THRUST.1).ln();
        if !watch(0.5 * (fallen + closed)) {
            return Err(PrepareError::Interrupted);
        }
    }
    Ok(Some(last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::hex;
    use crate::scene::{Compaction, UniformRange};
    use dem_core::dim::{D2, D3};
    use sha2::{Digest, Sha256};

    fn cylinder(count: usize, width: f64) -> RandomSample {
        RandomSample {
            count,
            diameter: Diameters::Constant(2e-3),
            section: Section::Circle,
            width,
            depth: None,
            preparation: Preparation::Compaction(Compaction { solid_fraction: 0.1 }),
            cut: None,
        }
    }

    /// Packings are kept by the version of the method, so bits may change only with it.
    #[test]
    fn a_packing_has_the_bits_of_its_method() {
        if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
            println!("skipped: the digest holds for x86_64 Linux");
            return;
        }
        let diameter = Diameters::Uniform(UniformRange { min: 1e-3, max: 3e-3 });
        let sample = RandomSample { diameter, section: Section::Rectangle, ..cylinder(60, 0.012) };
        let mut digest = Sha256::new();
        let mut add = |numbers: &[f64]| numbers.iter().for_each(|x| digest.update(x.to_bits().to_le_bytes()));
        let disks = pack::<D2>(&sample, 3, &mut |_| true).expect("a packing").balls;
        disks.iter().for_each(|(x, r)| add(&[x[0], x[1], *r]));
        let spheres = pack::<D3>(&sample, 3, &mut |_| true).expect("a packing").balls;
        spheres.iter().for_each(|(x, r)| add(&[x[0], x[1], x[2], *r]));
        let bits = (METHOD, hex(&digest.finalize()));
        assert_eq!(
            bits,
            (1, "b5081e8c6298d545a6e99d703f9e0dc01d3e90c56613cfac9cdb490b7f305ede".into()),
            "other bits: increase METHOD"
        );
    }

    #[test]
    fn a_packing_that_has_not_come_to_rest_says_how_far_it_moved() {
        let container = Container::of(&cylinder(50, 0.012));
        let mut rng = Pcg64::seed_from_u64(3);
        let (grains, top) = scatter::<D3>(&[1e-3; 50], &container, &mut rng);
        let mut world = packing_world(grains, &container, top, true);
        let after =
            |steps, world: &mut World<D3>| settle(world, &container, true, steps, &mut |_| true).expect("steps");
        let moved = after(2, &mut world).expect("a lid that is still on its way");
        assert!(moved > 0.01, "{moved}");
        assert_eq!(after(MOST_STEPS, &mut world), None);
    }

    #[test]
    fn a_cylinder_is_filled_to_its_wall_and_not_beyond() {
        let sample = cylinder(200, 0.012);
        let packing = pack::<D3>(&sample, 3, &mut |_| true).expect("a packing");
        assert!(packing.solid_fraction > 0.5, "{}", packing.solid_fraction);
        let reach = |(x, r): &Ball<D3>| (x[0] - 6e-3).hypot(x[1] - 6e-3) + r;
        let far = packing.balls.iter().map(reach).fold(0.0, f64::max);
        assert!((far - 6e-3).abs() < 1e-9, "the outermost grains touch the wall: {far}");
        assert!(packing.balls.iter().all(|(x, r)| x[2] >= r * (1.0 - 1e-9)));
    }

    #[test]
    fn a_disk_is_cut_out_of_the_middle_of_a_packing() {
        let whole = RandomSample { section: Section::Rectangle, ..cylinder(300, 0.04) };
        let cut = RandomSample { cut: Some(Cut::Circle(0.03)), ..whole.clone() };
        let [whole, cut] = [whole, cut].map(|s| pack::<D2>(&s, 3, &mut |_| true).expect("a packing").balls);
        let ends = |axis: usize, s: f64| whole.iter().map(|(x, r)| s * x[axis] + r).fold(f64::MIN, f64::max);
        let middle = [0, 1].map(|axis| 0.5 * (ends(axis, 1.0) - ends(axis, -1.0)));
        let within = |(x, r): &&Ball<D2>| (x[0] - middle[0]).hypot(x[1] - middle[1]) + r <= 0.015;
        assert_eq!(cut, whole.iter().filter(within).copied().collect::<Vec<_>>());
        assert!((100..290).contains(&cut.len()), "{}", cut.len());
        let nothing = RandomSample { cut: Some(Cut::Circle(1e-3)), section: Section::Rectangle, ..cylinder(30, 0.01) };
        assert!(matches!(pack::<D2>(&nothing, 3, &mut |_| true), Err(PrepareError::NothingLeft { .. })));
    }

    #[test]
    fn each_sphere_inside_a_close_packing_touches_twelve() {
        let lattice = Lattice::Hexagonal { diameter: 2.0, rows: 5, columns: 5, layers: Some(5) };
        let balls = super::lattice::<D3>(&lattice);
        assert_eq!(Some(balls.len()), lattice.count());
        let distance = |a: &Ball<D3>, b: &Ball<D3>| (a.0 - b.0).norm();
        let touching = |a: &Ball<D3>| balls.iter().filter(|b| (distance(a, b) - 2.0).abs() < 1e-12).count();
        assert_eq!(balls.iter().map(touching).max(), Some(12));
        let nearest = balls.iter().enumerate().flat_map(|(k, a)| balls[..k].iter().map(move |b| distance(a, b)));
        assert!(nearest.fold(f64::MAX, f64::min) > 2.0 - 1e-12, "none overlap");
        assert!(balls.iter().all(|(x, _)| (0..3).all(|axis| x[axis] >= 1.0)));
    }

    #[test]
    fn spheres_stack_in_a_tube_narrower_than_two() {
        let packing = pack::<D3>(&cylinder(5, 2.2e-3), 1, &mut |_| true).expect("a packing");
        let highest = packing.balls.iter().map(|(x, r)| x[2] + r).fold(0.0, f64::max);
        assert!((0.0095..0.0101).contains(&highest), "five spheres of 2 mm: {highest}");
    }
}
