//! From a world to its history: the layout, the frames, the rupture events and the observables of
//! every step.

use crate::build::Built;
use crate::clock::cpu_time;
use crate::history::{
    self, Background, Batch, BondStatus, Checkpoint, ContactRows, ContactStatus, Ending, Frame, GrainState, History,
    Layout, Observable, Parameters, RowCounts, Rupture, RuptureMode, SolverRoute, WallDrive, WallKind, WallState,
    Writer,
};
use crate::load::{drive_direction, load};
use crate::scene::{self, Drive as SceneDrive, Precision, Scene, StageDrive};
use dem_core::body::{Drive, Shape, Wall};
use dem_core::bond;
use dem_core::dim::{Dim, Moments, Vect};
use dem_core::solver::Route;
use dem_core::world::{Break, StepReport, TouchStatus, World};
use std::path::Path;

/// The value of an observable after a step.
type Measure<D> = fn(&World<D>, &StepReport<D>, &mut Vec<f64>);

/// Writes a world to its history.
pub struct Recorder<D: Dim> {
    writer: Background,
    measures: Vec<Measure<D>>,
    rotation: bool,
    tangents: bool,
    bonded: bool,
    reactions: bool,
    /// Processor time of the run before it was resumed (s).
    cpu_before: f64,
    /// Rows for the writer, passed on with the next frame or after [`GATHERED`] steps.
    batch: Batch,
}

/// Maximum number of steps whose observables are batched for the writer.
const GATHERED: usize = 256;

/// What the file of a resumed run begins with.
pub struct Beginning<'a> {
    /// The rows of the old file that stay.
    pub kept: RowCounts,
    /// The state from which the run goes on.
    pub checkpoint: &'a Checkpoint,
    /// What it tells of the run.
    pub origin: Parameters,
}

impl<D: Dim> Recorder<D> {
    /// Create the history of a world at `path`.
    pub fn create(path: &Path, overwrite: bool, scene: &Scene, built: &Built<D>) -> history::Result<Self> {
        let observables = observables(scene, &built.world);
        let bonds = describe_bonds(scene, &built.world, scene.cement_stage().map(|_| history::NOT_FORMED));
        let parameters = parameters(scene, built.solid_fraction);
        let (layout, measures) = describe(scene, &built.world, bonds, observables, parameters);
        let writer = Writer::create(path, &layout, overwrite)?;
        Ok(Self::new(writer, &layout, measures, 0.0))
    }

    /// Continues `history` in a new file that replaces it. `cemented` is the step after which a
    /// stage formed the bonds of the world, if one did; `tell` receives the copied share of the
    /// history (0 to 1).
    pub fn go_on(
        history: &History,
        Beginning { kept, checkpoint, origin }: Beginning,
        scene: &Scene,
        world: &World<D>,
        cemented: Option<u64>,
        tell: &mut dyn FnMut(f64) -> bool,
    ) -> history::Result<Self> {
        // the layout of a history does not change: without friction at the start, none later; no
        // observable that the program which began it did not know
        let before = history.layout()?;
        let mut observables = observables(scene, world);
        observables.retain(|(observable, _)| before.observables.iter().any(|known| known.name == observable.name));
        let formed = match before.bonds.formed {
            // the rows of its frames have no bonds yet, or those after the checkpoint are dropped
            Some(formed) if formed == history::NOT_FORMED || cemented.is_none() => Some(history::NOT_FORMED),
            formed => formed,
        };
        let (layout, measures) = describe(scene, world, describe_bonds(scene, world, formed), observables, origin);
        let layout = Layout { friction: before.friction, ..layout };
        let last = kept.steps.checked_sub(1).map(|last| history.observed_in("cpu_time", last)).transpose()?;
        let cpu_before = last.flatten().unwrap_or(0.0);
        let writer = Writer::go_on(history.path(), &layout, history, kept, checkpoint, tell)?;
        let mut recorder = Self::new(writer, &layout, measures, cpu_before);
        if cemented.is_some() && formed == Some(history::NOT_FORMED) {
            recorder.bonds_formed(scene, world)?;
        }
        Ok(recorder)
    }

    fn new(writer: Writer, layout: &Layout, measures: Vec<Measure<D>>, cpu_before: f64) -> Self {
        Self {
            writer: Background::start(writer),
            measures,
            rotation: layout.rotation,
            tangents: layout.friction || layout.bonded(),
            bonded: layout.bonded(),
            reactions: !layout.without_reactions,
            cpu_before,
            batch: Batch::default(),
        }
    }

    /// Processor time of the whole run so far (s).
    pub fn cpu_time(&self) -> f64 {
        self.cpu_before + cpu_time()
    }

    /// Records the observables and broken bonds of a step.
    pub fn step(&mut self, world: &World<D>, report: &StepReport<D>) -> history::Result<()> {
        let mut row = Vec::new();
        for measure in &self.measures {
            measure(world, report, &mut row);
        }
        row.push(self.cpu_time());
        let step = world.steps as i64;
        self.batch.observations.push((step, report.time, row));
        self.batch.ruptures.extend(report.breaks.iter().map(|failed| rupture(failed, step, report.time)));
        if self.batch.observations.len() < GATHERED { Ok(()) } else { self.hand_over() }
    }

    /// Records the bonds that a stage formed after the present step.
    pub fn bonds_formed(&mut self, scene: &Scene, world: &World<D>) -> history::Result<()> {
        self.hand_over()?;
        self.batch.bonds = Some(describe_bonds(scene, world, Some(world.steps as i64)));
        self.hand_over()
    }

    /// Records the state as a frame, as a checkpoint to resume from, or as both.
    pub fn record(&mut self, world: &World<D>, frame: bool, checkpoint: Option<Checkpoint>) -> history::Result<()> {
        self.batch.frame = frame.then(|| self.frame(world));
        self.batch.checkpoint = checkpoint;
        self.hand_over()
    }

    /// The whole state.
    fn frame(&self, world: &World<D>) -> Frame {
        let flat = |vectors: &[D::Vector]| vectors.iter().flat_map(|v| v.as_slice()).copied().collect::<Vec<f64>>();
        let g = &world.grains;
        let turn = |rows: Vec<f64>| if self.rotation { rows } else { Vec::new() };
        let grains = GrainState {
            position: flat(&g.position),
            velocity: flat(&g.velocity),
            angular_velocity: turn(g.spin.iter().flat_map(|w| w.as_slice()).copied().collect()),
            orientation: turn(g.orientation.iter().flat_map(|q| q.as_slice()).copied().collect()),
        };
        let per_wall = |pick: fn(&Wall<D>) -> D::Vector| flat(&world.walls.iter().map(pick).collect::<Vec<_>>());
        let walls = WallState {
            position: per_wall(|w| w.position),
            velocity: per_wall(|w| w.velocity),
            force: per_wall(|w| w.reaction),
        };
        let contacts = self.contacts(world);
        let bonds = world.bonds.iter().map(|b| bond_status(b.status)).collect();
        Frame { step: world.steps as i64, time: world.time, grains, walls, contacts, bonds }
    }

    fn hand_over(&mut self) -> history::Result<()> {
        self.writer.write(std::mem::take(&mut self.batch))
    }

    /// Record why the run ended, and close the history.
    pub fn finish(mut self, ending: Ending) -> history::Result<()> {
        self.batch.ending = Some(ending);
        self.hand_over()?;
        self.writer.finish()
    }

    fn contacts(&self, world: &World<D>) -> ContactRows {
        let mut rows = ContactRows::default();
        let grains = world.grains.len() as i32;
        let bonded = self.bonded;
        for touch in world.touches() {
            let [i, j] = touch.pair.map(|k| k as i32);
            rows.pair.push([i, if j < grains { j } else { grains - 1 - j }]);
            rows.point.extend_from_slice(touch.point.as_slice());
            rows.normal.extend_from_slice(D::normal(&touch.frame).as_slice());
            if self.reactions {
                rows.reaction.push(touch.reaction.n);
                if self.tangents {
                    rows.reaction.extend_from_slice(touch.reaction.t.as_slice());
                    if D::N == 3 {
                        rows.tangent.extend_from_slice(D::tangent(&touch.frame).as_slice());
                    }
                }
            }
            if bonded && self.reactions {
                // the solver's bending rows are the components of m × n; the file's are moments
                // about the axes
                let moment = D::torque_of_rows(&touch.frame, D::Tangent::zero(), touch.reaction.m);
                rows.moment.extend(D::about_axes(&touch.frame, moment).as_slice());
            }
            if bonded {
                rows.bond.push(touch.bond.map_or(-1, |b| b as i32));
            }
            rows.gap.push(touch.gap);
            rows.status.push(match touch.status {
                TouchStatus::Open => ContactStatus::Open,
                TouchStatus::Stick => ContactStatus::Stick,
                TouchStatus::Slip => ContactStatus::Slip,
                TouchStatus::Bonded => ContactStatus::Bonded,
            });
        }
        rows
    }
}

/// The layout of the history of a world, and the functions that measure its observables except the
/// last, the processor time, which the recorder adds.
fn describe<D: Dim>(
    scene: &Scene,
    world: &World<D>,
    bonds: history::Bonds,
    observables: Vec<(Observable, Measure<D>)>,
    parameters: Parameters,
) -> (Layout, Vec<Measure<D>>) {
    let friction = world.has_friction();
    // without friction, bonds and torques, grains keep their spin
    let turning = world.grains.spin.iter().any(|w| w.norm() > 0.0) || world.loads.iter().any(|l| l.torque.norm() > 0.0);
    let (mut observables, measures): (Vec<_>, _) = observables.into_iter().unzip();
    observables.push(Observable::new("cpu_time", "s", &[]));
    let mut layout = Layout {
        dimension: D::N,
        rotation: friction || turning,
        friction,
        twist: scene.twists(),
        without_reactions: !scene.output.reactions,
        single: scene.output.precision == Precision::Single,
        grains: history::Grains {
            id: (0..world.grains.len() as i32).collect(),
            radius: world.grains.radius.clone(),
            mass: world.grains.mass.clone(),
            inertia: world.grains.inertia.clone(),
            material: world.grains.material.clone(),
        },
        walls: world.walls.iter().zip(&scene.walls).map(|(wall, named)| describe_wall(scene, wall, named)).collect(),
        bonds,
        materials: match world.grains.material.is_empty() {
            true => vec![],
            false => scene.materials.names().into_iter().map(String::from).collect(),
        },
        observables,
        parameters,
    };
    layout.rotation |= layout.bonded();
    (layout, measures)
}

fn bond_status(status: bond::BondStatus) -> BondStatus {
    match status {
        bond::BondStatus::Intact => BondStatus::Intact,
        bond::BondStatus::Tension => BondStatus::Tension,
        bond::BondStatus::Shear => BondStatus::Shear,
        bond::BondStatus::Rolling => BondStatus::Rolling,
        bond::BondStatus::Twist => BondStatus::Twist,
    }
}

fn solver_route(route: Route) -> SolverRoute {
    match route {
        Route::Extrapolation => SolverRoute::Extrapolation,
        Route::ActiveSet => SolverRoute::ActiveSet,
        Route::InteriorPoint => SolverRoute::InteriorPoint,
        Route::Sweeps => SolverRoute::Sweeps,
    }
}

fn rupture<D: Dim>(failed: &Break<D>, step: i64, time: f64) -> Rupture {
    Rupture {
        step,
        time,
        point: padded::<D>(failed.point),
        normal_force: failed.reaction.n,
        tangential_force: failed.reaction.t.norm(),
        moment: failed.reaction.m.bending(),
        twist: failed.reaction.m.twist(),
        energy: failed.energy,
        round: failed.round as i32,
        bond: failed.bond as i32,
        pair: failed.pair.map(|k| k as i32),
        mode: bond_status(failed.mode).mode().unwrap_or(RuptureMode::Tension),
    }
}

fn padded<D: Dim>(v: D::Vector) -> [f64; 3] {
    let mut out = [0.0; 3];
    out[..D::N].copy_from_slice(v.as_slice());
    out
}

/// Whether a wall is fixed, or its velocity or its force is prescribed.
fn wall_drive(drive: &SceneDrive) -> WallDrive {
    match drive {
        SceneDrive::Fixed => WallDrive::Fixed,
        SceneDrive::Velocity(_) => WallDrive::Velocity,
        SceneDrive::Force(_) | SceneDrive::Stress(_) => WallDrive::Force,
    }
}

/// Whether a wall has a prescribed velocity in some stages and a prescribed force in others.
fn drives_change(scene: &Scene) -> bool {
    scene.walls.iter().any(|(name, wall)| {
        let first = wall_drive(&scene.first_drive(name, wall));
        scene.stage_drives(name).map(StageDrive::drive).any(|drive| wall_drive(&drive) != first)
    })
}

/// The constant properties of a wall, with the drive that it has at the start of the run: the world
/// of a resumed run has that of a later stage.
fn describe_wall<D: Dim>(scene: &Scene, wall: &Wall<D>, (name, of_scene): (&String, &scene::Wall)) -> history::Wall {
    let zero = D::Vector::zero();
    let mut described = history::Wall { name: name.clone(), ..history::Wall::default() };
    let (kind, normal) = match wall.shape {
        Shape::Plane { normal } => (WallKind::Plane, normal),
        Shape::Round { radius, inside, axis } => {
            let kind = match axis {
                Some(_) => WallKind::Cylinder,
                None if D::N == 2 => WallKind::Circle,
                None => WallKind::Sphere,
            };
            described.radius = if inside { -radius } else { radius };
            (kind, axis.unwrap_or(zero))
        }
        Shape::Plate(plate) => {
            described.side = padded::<D>(plate.sides()[0]);
            [described.length, described.width] = plate.lengths();
            (WallKind::Plate, plate.normal())
        }
    };
    let drive = wall_drive(&scene.first_drive(name, of_scene));
    let direction = padded::<D>(drive_direction(wall).unwrap_or(zero));
    history::Wall { kind, normal: padded::<D>(normal), drive, direction, ..described }
}

/// The bonds of a world. `formed` is the step after which a stage formed them, or that none has;
/// nothing if they are there from the start.
fn describe_bonds<D: Dim>(scene: &Scene, world: &World<D>, formed: Option<i64>) -> history::Bonds {
    let bonds: &[bond::Bond] = if formed == Some(history::NOT_FORMED) { &[] } else { &world.bonds };
    history::Bonds {
        pair: bonds.iter().map(|b| b.pair.map(|k| k as i32)).collect(),
        rest_gap: bonds.iter().map(|b| b.rest_gap).collect(),
        strength: bonds.iter().map(|b| b.strength).collect(),
        friction: bonds.iter().map(|b| b.shear).collect(),
        // until bonds form it is not known whether the two differ
        rolling: match formed.is_none() && bonds.iter().all(|b| b.rolling == b.shear) {
            true => Vec::new(),
            false => bonds.iter().map(|b| b.rolling).collect(),
        },
        twist: scene.twists_by_pair().then(|| bonds.iter().map(|b| b.twist).collect()),
        formed,
        mean_diameter: bonds.iter().map(|b| b.mean_diameter).collect(),
    }
}

fn parameters(scene: &Scene, solid_fraction: Option<f64>) -> Parameters {
    Parameters {
        scene: scene.to_json().unwrap_or_default(),
        earlier_scenes: String::new(),
        seed: scene.seed,
        version: env!("CARGO_PKG_VERSION").into(),
        git_revision: option_env!("DEM_GIT_REVISION").unwrap_or_default().into(),
        build: env!("DEM_BUILD").into(),
        host: rustix::system::uname().nodename().to_string_lossy().into_owned(),
        start: humantime::format_rfc3339_seconds(std::time::SystemTime::now()).to_string(),
        solid_fraction,
    }
}

/// The force that drives a wall (N): the prescribed force, or the force that maintains the
/// prescribed velocity.
fn applied_force<D: Dim>(wall: &Wall<D>) -> f64 {
    match wall.drive {
        Drive::Fixed => 0.0,
        Drive::Velocity { direction, .. } => -direction.dot(&wall.reaction),
        Drive::Force { .. } => wall.applied,
    }
}

/// The observables of every step, in order. Observables of absent features are omitted.
fn observables<D: Dim>(scene: &Scene, world: &World<D>) -> Vec<(Observable, Measure<D>)> {
    let (d, spins) = (D::N, D::Spin::LEN);
    let scalar: &[usize] = &[];
    let mut list: Vec<(Observable, Measure<D>)> = Vec::new();
    let mut add = |name: &str, unit: &str, shape: &[usize], measure: Measure<D>| {
        list.push((Observable::new(name, unit, shape), measure));
    };
    add("kinetic_energy", "J", scalar, |w, _, out| out.push(w.ledger.kinetic));
    add("external_work", "J", scalar, |w, _, out| out.push(w.ledger.external_work));
    add("dissipation_impact", "J", scalar, |w, _, out| out.push(w.ledger.impact));
    add("dissipation_friction", "J", scalar, |w, _, out| out.push(w.ledger.friction));
    add("energy_remainder", "J", scalar, |w, _, out| out.push(w.ledger.remainder));
    add("momentum", "kg m s-1", &[d], |w, _, out| out.extend(w.momentum().linear.as_slice()));
    add("angular_momentum", "kg m2 s-1", &[spins], |w, _, out| out.extend(w.momentum().angular.as_slice()));
    add(history::FALSE_ACCELERATION, "", scalar, |_, r, out| out.push(r.false_acceleration));
    add("solver_residual", "", scalar, |_, r, out| out.push(r.residual));
    add(history::LOAD_ERROR, "", scalar, |_, r, out| out.push(r.load_error.unwrap_or(f64::NAN)));
    add("solver_iterations", "", scalar, |_, r, out| out.push(r.work.iterations() as f64));
    add("solver_newton_iterations", "", scalar, |_, r, out| out.push(r.work.newton as f64));
    add("solver_factorisations", "", scalar, |_, r, out| out.push(r.work.factorisations as f64));
    add("solver_rejected", "", scalar, |_, r, out| out.push(f64::from(r.rejected)));
    add("substeps", "", scalar, |_, r, out| out.push(f64::from(r.substeps)));
    add("penetration", "m", scalar, |_, r, out| out.push(r.penetration));
    add("stress", "Pa", &[d, d], |w, r, out| out.extend(r.stress(w)));
    add("strain", "", &[d, d], |w, _, out| out.extend(w.strain()));
    list.push((Observable::route(), |_, r, out| out.push(solver_route(r.route).number())));
    list.extend(of_bonds_and_walls(scene, world));
    if world.membrane.is_some() {
        list.push((Observable::new("membrane_pressure", "Pa", scalar), |w, _, out| {
            out.extend(w.membrane.as_ref().map(|membrane| membrane.applied));
        }));
        list.push((Observable::new("membrane_area", "m2", scalar), |w, _, out| {
            out.extend(w.membrane.as_ref().map(|membrane| membrane.area));
        }));
    }
    list
}

/// The observables of bonds and walls.
fn of_bonds_and_walls<D: Dim>(scene: &Scene, world: &World<D>) -> Vec<(Observable, Measure<D>)> {
    let (d, walls, scalar) = (D::N, world.walls.len(), &[][..]);
    let mut list: Vec<(Observable, Measure<D>)> = Vec::new();
    let mut add = |name: &str, unit: &str, shape: &[usize], measure: Measure<D>| {
        list.push((Observable::new(name, unit, shape), measure));
    };
    if !world.bonds.is_empty() || scene.cement_stage().is_some() {
        if scene.bonds.as_ref().is_some_and(|bonds| bonds.stiffness.is_some()) {
            add("elastic_energy", "J", scalar, |w, _, out| out.push(w.ledger.elastic));
            add("dissipation_damping", "J", scalar, |w, _, out| out.push(w.ledger.damping));
            add("fracture_energy", "J", scalar, |w, _, out| out.push(w.ledger.fracture));
        } else {
            add("bond_remainder", "J", scalar, |w, _, out| out.push(w.ledger.bonds));
        }
        add("bond_elongation", "m", scalar, |_, r, out| out.push(r.bond_elongation));
        if matches!(world.settings.rupture, bond::Rupture::NextEvent { .. }) {
            add("load_time", "s", scalar, |w, _, out| out.push(w.load_time));
        }
        add("bonds_broken", "", scalar, |w, _, out| out.push((w.bonds.len() - w.intact_bonds()) as f64));
    }
    if walls > 0 {
        add("wall_position", "m", &[walls, d], |w, _, out| {
            w.walls.iter().for_each(|x| out.extend(x.position.as_slice()))
        });
        add("wall_force", "N", &[walls, d], |w, _, out| w.walls.iter().for_each(|x| out.extend(x.reaction.as_slice())));
        add("wall_force_at_limit", "N", &[walls, d], |w, _, out| {
            w.walls.iter().for_each(|x| out.extend(x.reaction_at_limit.as_slice()))
        });
        add("applied_force", "N", &[walls], |w, _, out| out.extend(w.walls.iter().map(applied_force)));
        if drives_change(scene) {
            add("wall_load", "N", &[walls], |w, _, out| out.extend(w.walls.iter().map(load)));
        }
    }
    list
}
