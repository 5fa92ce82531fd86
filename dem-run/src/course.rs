//! The course of a run: what is counted from step to step, and what ends it.

use crate::collapse::Collapse;
use crate::record::applied_force;
use crate::scene::{Scene, TravelFrom};
use crate::summary::Ending;
use dem_core::body::{Drive, Wall};
use dem_core::bond::BondStatus;
use dem_core::dim::{Dim, Vect};
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::solver::{SolveStatus, Work};
use dem_core::world::{StepReport, World};

/// Counts of a run, and its stop conditions.
pub struct Course<D: Dim> {
    /// Loads at failure.
    pub collapse: Collapse,
    /// The wall whose force loads the sample: the first that is driven.
    pub driven: Option<usize>,
    /// Bonds broken in tension, shear, rolling and twist.
    pub broken: [usize; 4],
    /// Largest residual of an accepted solve (–).
    pub worst_residual: f64,
    /// What all solves took.
    pub work: Work,
    /// Steps that were accepted and missed the tolerance.
    pub missed_tolerance: u64,
    /// Solves that were not accepted.
    pub rejected: u64,
    /// Deepest overlap (m).
    pub penetration: f64,
    stop: Option<TravelStop<D>>,
    /// Share of broken bonds (–) that ends the run.
    broken_limit: Option<f64>,
}

/// The travel of a wall that ends a run.
struct TravelStop<D: Dim> {
    wall: usize,
    direction: D::Vector,
    distance: f64,
    from: Option<D::Vector>,
}

impl<D: Dim> Course<D> {
    /// The course of a run that begins with `world`.
    pub fn new(scene: &Scene, world: &World<D>) -> Self {
        Self {
            collapse: Collapse::default(),
            driven: world.walls.iter().position(|w| drive_direction(w).is_some()),
            broken: [0; 4],
            worst_residual: 0.0,
            work: Work::default(),
            missed_tolerance: 0,
            rejected: 0,
            penetration: 0.0,
            stop: travel_stop(scene, world),
            broken_limit: scene.stop.as_ref().and_then(|s| s.broken_fraction),
        }
    }

    /// Write the course so far.
    pub fn save(&self, to: &mut Saved) {
        self.collapse.save(to);
        self.broken.into_iter().for_each(|broken| to.count(broken));
        to.reals.extend([self.worst_residual, self.penetration]);
        let Work { sweeps, newton, factorisations } = self.work;
        to.counts.extend([sweeps, newton, factorisations, self.missed_tolerance, self.rejected]);
        to.flag(self.stop.is_some());
        if let Some(stop) = &self.stop {
            to.real(stop.distance);
            to.flag(stop.from.is_some());
            to.vector(&stop.from.unwrap_or(D::Vector::zero()));
        }
    }

    /// The course that [`Course::save`] wrote, of a run of `scene` that goes on with `world`.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(scene: &Scene, world: &World<D>, from: &mut Reader) -> Result<Self, Mismatch> {
        let mut course = Self::new(scene, world);
        course.collapse = Collapse::restored(from)?;
        course.broken = [from.count()?, from.count()?, from.count()?, from.count()?];
        (course.worst_residual, course.penetration) = (from.real()?, from.real()?);
        let mut count = || from.count().map(|n| n as u64);
        course.work = Work { sweeps: count()?, newton: count()?, factorisations: count()? };
        (course.missed_tolerance, course.rejected) = (count()?, count()?);
        if from.flag()? {
            let (distance, begun, place) = (from.real()?, from.flag()?, from.vector()?);
            // a stop that the scene no longer has is forgotten
            if let Some(stop) = &mut course.stop {
                (stop.distance, stop.from) = (distance, begun.then_some(place));
            }
        }
        Ok(course)
    }

    /// Bonds broken so far.
    pub fn broken(&self) -> usize {
        self.broken.iter().sum()
    }

    /// The force that drives the sample (N), where a wall is driven.
    pub fn load(&self, world: &World<D>) -> Option<f64> {
        self.driven.map(|wall| applied_force(&world.walls[wall]))
    }

    /// Enter a step; `world` is the state after it.
    pub fn count(&mut self, world: &World<D>, report: &StepReport<D>) {
        for failed in &report.breaks {
            let mode = match failed.mode {
                BondStatus::Shear => 1,
                BondStatus::Rolling => 2,
                BondStatus::Twist => 3,
                _ => 0,
            };
            self.broken[mode] += 1;
        }
        self.worst_residual = self.worst_residual.max(report.residual);
        self.work = self.work + report.work;
        self.missed_tolerance += u64::from(report.status == SolveStatus::Accepted);
        self.rejected += u64::from(report.rejected);
        self.penetration = self.penetration.max(report.penetration);
        if let Some(wall) = self.driven {
            let wall = &world.walls[wall];
            let strain = axial(&world.strain(), drive_direction(wall).unwrap_or(D::Vector::zero()));
            self.collapse.push(applied_force(wall), strain, self.broken(), world.bonds.len());
        }
    }

    /// Whether a stop condition of the scene ends the run here, and which.
    pub fn ending(&mut self, world: &World<D>) -> Option<Ending> {
        let broken = self.broken();
        if let Some(stop) = &mut self.stop {
            let position = world.walls[stop.wall].position;
            if stop.from.is_none() && broken > 0 {
                stop.from = Some(position);
            }
            if stop.from.is_some_and(|from| (position - from).dot(&stop.direction).abs() >= stop.distance) {
                return Some(Ending::WallTravel);
            }
        }
        let bonds = world.bonds.len() as f64;
        let enough = |limit: f64| bonds > 0.0 && broken as f64 >= limit * bonds;
        self.broken_limit.is_some_and(enough).then_some(Ending::BrokenFraction)
    }
}

fn drive_direction<D: Dim>(wall: &Wall<D>) -> Option<D::Vector> {
    match wall.drive {
        Drive::Fixed => None,
        Drive::Velocity { direction, .. } | Drive::Force { direction, .. } => Some(direction),
    }
}

/// d·E d: the strain along a unit direction d.
fn axial<V: Vect>(strain: &[f64], d: V) -> f64 {
    let row = |r: usize| (0..V::LEN).map(|c| strain[r * V::LEN + c] * d[c]).sum::<f64>();
    (0..V::LEN).map(|r| d[r] * row(r)).sum()
}

fn travel_stop<D: Dim>(scene: &Scene, world: &World<D>) -> Option<TravelStop<D>> {
    let travel = scene.stop.as_ref()?.wall_travel.as_ref()?;
    let wall = scene.walls.keys().position(|name| *name == travel.wall)?;
    let direction = drive_direction(&world.walls[wall])?;
    let along = |sign: f64| {
        let reach = |(x, r): (&D::Vector, &f64)| sign * x.dot(&direction) + r;
        world.grains.position.iter().zip(&world.grains.radius).map(reach).fold(f64::NEG_INFINITY, f64::max)
    };
    let from = (travel.after == TravelFrom::Start).then(|| world.walls[wall].position);
    Some(TravelStop { wall, direction, distance: travel.fraction_of_height * (along(1.0) + along(-1.0)), from })
}
