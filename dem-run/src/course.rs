//! The course of a run: its counters, updated at every step, and its stop conditions.

use crate::collapse::{Collapse, LoadStep};
use crate::error::RunError;
use crate::history::Ending;
use crate::load::{drive_direction, load};
use crate::scene::Scene;
use crate::scene::failure::in_one_piece;
use crate::stages::Stages;
use crate::stop::{StopProgress, Stops};
use dem_core::bond::{BondStatus, Rupture};
use dem_core::dim::{Dim, Vect};
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::solver::{Route, Work};
use dem_core::world::{StepReport, World};

/// Counts of a run, and its stop conditions.
pub struct Course<D: Dim> {
    /// The driven walls with their loads, in the order of the walls.
    pub driven: Vec<Driven<D>>,
    /// Index in `driven` of the wall that loads the sample; none if the scene has no driven wall,
    /// or does not name the load wall.
    pub load_wall: Option<usize>,
    /// Lengths of the box around all grains at the start (m), one for each axis.
    pub extents: Vec<f64>,
    /// Whether all grains were bonded into one piece when the bonds formed.
    pub one_piece: bool,
    /// Bonds broken in tension, shear, rolling and twist.
    pub broken: [usize; 4],
    /// Largest residual of an accepted solve (–).
    pub worst_residual: f64,
    /// Largest load error of an accepted solve (–); none if no solve reported one.
    pub worst_load_error: Option<f64>,
    /// Work of all solves.
    pub work: Work,
    /// Steps with a solve: those that were not extrapolated.
    pub solved_steps: u64,
    /// Steps with an accepted solve whose residual exceeds the tolerance.
    pub missed_tolerance: u64,
    /// Steps with an accepted solve whose load error exceeds its tolerance.
    pub missed_load_tolerance: u64,
    /// Solves that were not accepted.
    pub rejected: u64,
    /// Deepest overlap (m).
    pub penetration: f64,
    /// Largest difference between the length of an intact bond and its length at rest (m).
    pub bond_elongation: f64,
    stops: Stops<D>,
    stages: Stages<D>,
}

/// A driven wall and its load.
pub struct Driven<D: Dim> {
    /// Its index among the walls.
    pub wall: usize,
    /// Loads at failure, and peak load.
    pub collapse: Collapse,
    /// Strain of the sample along its direction after the last step (–).
    pub strain: f64,
    /// Its initial position (m).
    start: D::Vector,
}

impl<D: Dim> Course<D> {
    /// The course of a run that begins with `world`.
    pub fn new(scene: &Scene, world: &World<D>) -> Self {
        let driven = world.walls.iter().enumerate().filter(|(_, w)| drive_direction(w).is_some());
        let driven: Vec<Driven<D>> = driven
            .map(|(wall, w)| Driven { wall, collapse: Collapse::default(), strain: 0.0, start: w.position })
            .collect();
        let number = scene.load_wall().and_then(|name| scene.wall_index(name));
        Self {
            load_wall: driven.iter().position(|at| Some(at.wall) == number),
            extents: extents(world),
            one_piece: one_piece(world),
            driven,
            broken: [0; 4],
            worst_residual: 0.0,
            worst_load_error: None,
            work: Work::default(),
            solved_steps: 0,
            missed_tolerance: 0,
            missed_load_tolerance: 0,
            rejected: 0,
            penetration: 0.0,
            bond_elongation: 0.0,
            stops: Stops::new(scene.stop.as_ref(), scene, world),
            stages: Stages::new(scene, world),
        }
    }

    /// Saves the course.
    pub fn save(&self, to: &mut Saved) {
        to.count(self.driven.len());
        for Driven { wall, collapse, start, .. } in &self.driven {
            to.count(*wall);
            to.vector(start);
            collapse.save(to);
        }
        to.reals.extend(&self.extents);
        self.broken.into_iter().for_each(|broken| to.count(broken));
        to.reals.extend([self.worst_residual, self.penetration, self.bond_elongation]);
        to.flag(self.worst_load_error.is_some());
        to.real(self.worst_load_error.unwrap_or(0.0));
        let Work { sweeps, newton, factorisations } = self.work;
        to.counts.extend([sweeps, newton, factorisations, self.solved_steps]);
        to.counts.extend([self.missed_tolerance, self.missed_load_tolerance, self.rejected]);
        self.stops.save(to);
        self.stages.save(to);
    }

    /// The course saved by [`Course::save`], for a run of `scene` that is resumed with `world`; its
    /// walls get the drives of the present stage.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(scene: &Scene, world: &mut World<D>, from: &mut Reader) -> Result<Self, Mismatch> {
        let mut course = Self::new(scene, world);
        for _ in 0..from.count()? {
            let (wall, start, collapse) = (from.count()?, from.vector()?, Collapse::restored(from)?);
            // a wall that is no longer driven is dropped
            if let Some(driven) = course.driven.iter_mut().find(|driven| driven.wall == wall) {
                *driven = Driven { wall, start, collapse, strain: 0.0 };
            }
        }
        course.extents = from.reals(D::N)?.to_vec();
        course.broken = [from.count()?, from.count()?, from.count()?, from.count()?];
        (course.worst_residual, course.penetration) = (from.real()?, from.real()?);
        course.bond_elongation = from.real()?;
        let (reported, worst) = (from.flag()?, from.real()?);
        course.worst_load_error = reported.then_some(worst);
        let mut count = || from.count().map(|n| n as u64);
        course.work = Work { sweeps: count()?, newton: count()?, factorisations: count()? };
        course.solved_steps = count()?;
        (course.missed_tolerance, course.missed_load_tolerance) = (count()?, count()?);
        course.rejected = count()?;
        course.stops.restore(from)?;
        course.stages = Stages::restored(scene, world, from)?;
        Ok(course)
    }

    /// Bonds broken so far.
    pub fn broken(&self) -> usize {
        self.broken.iter().sum()
    }

    /// The loads of the load wall, if the scene has one.
    pub fn loads(&self) -> Option<&Collapse> {
        Some(&self.driven[self.load_wall?].collapse)
    }

    /// The load of the last step on the load wall (N).
    pub fn load(&self, world: &World<D>) -> Option<f64> {
        Some(load(&world.walls[self.driven[self.load_wall?].wall]))
    }

    /// The strain of the sample along the direction of the load wall, if the scene has one (–).
    pub fn strain(&self) -> Option<f64> {
        Some(self.driven[self.load_wall?].strain)
    }

    /// How far the stop condition is, if the scene has one.
    pub fn stop_progress(&self, world: &World<D>) -> Option<StopProgress> {
        self.stops.progress(world, self.broken())
    }

    /// Counts a step; `world` is the state after the step.
    pub fn count(&mut self, world: &World<D>, report: &StepReport<D>) {
        for failed in &report.breaks {
            match failed.mode {
                BondStatus::Tension => self.broken[0] += 1,
                BondStatus::Shear => self.broken[1] += 1,
                BondStatus::Rolling => self.broken[2] += 1,
                BondStatus::Twist => self.broken[3] += 1,
                // an intact bond counts under no mode
                BondStatus::Intact => {}
            }
        }
        self.count_solves(world, report);
        self.penetration = self.penetration.max(report.penetration);
        self.bond_elongation = self.bond_elongation.max(report.bond_elongation);
        let broken = self.broken();
        self.stops.count(world, broken);
        self.stages.count(world, broken);
        if self.driven.is_empty() {
            return;
        }
        let (strain, broken, bonds) = (world.strain(), self.broken(), world.bonds.len());
        for Driven { wall, collapse, strain: along, start } in &mut self.driven {
            let wall = &world.walls[*wall];
            let direction = drive_direction(wall).unwrap_or(D::Vector::zero());
            let displacement = (wall.position - *start).dot(&direction);
            *along = axial(&strain, direction);
            collapse.push(LoadStep { load: load(wall), displacement, strain: *along, broken, bonds });
        }
    }

    /// Counts the solves of a step.
    fn count_solves(&mut self, world: &World<D>, report: &StepReport<D>) {
        let solver = &world.settings.solver;
        self.worst_residual = self.worst_residual.max(report.residual);
        self.worst_load_error = self.worst_load_error.into_iter().chain(report.load_error).reduce(f64::max);
        self.work = self.work + report.work;
        self.solved_steps += u64::from(report.route != Route::Extrapolation);
        self.missed_tolerance += u64::from(report.residual > solver.tolerance());
        let missed = report.load_error.zip(solver.load_tolerance()).is_some_and(|(error, most)| error > most);
        self.missed_load_tolerance += u64::from(missed);
        self.rejected += u64::from(report.rejected);
    }

    /// The step after which the bonds formed, if a stage that cements has begun.
    pub fn cemented(&self, scene: &Scene) -> Option<u64> {
        self.stages.cemented(scene)
    }

    /// Begins the next stage if this step ends one: the walls get its drives, and bonds form if it
    /// cements. Returns what ends the run of `scene` after this step, if anything: a stop
    /// condition, or the end of the last stage.
    ///
    /// # Errors
    /// [`RunError`] if the bonds of the next stage cannot form.
    pub fn advance(&mut self, scene: &Scene, world: &mut World<D>) -> Result<Option<Ending>, RunError> {
        let broken = self.broken();
        if matches!(world.settings.rupture, Rupture::NextEvent { until } if world.load_time >= until) {
            return Ok(Some(Ending::NoBreak));
        }
        if let Some(ending) = self.stops.ending(world, broken) {
            return Ok(Some(ending));
        }
        let ending = self.stages.advance(scene, world, broken)?;
        if self.cemented(scene) == Some(world.steps) {
            self.one_piece = one_piece(world);
        }
        Ok(ending)
    }
}

/// Whether the bonds of a world join all its grains.
fn one_piece<D: Dim>(world: &World<D>) -> bool {
    in_one_piece(world.grains.len(), world.bonds.iter().map(|bond| bond.pair))
}

/// Lengths of the box around all grains (m), one for each axis.
fn extents<D: Dim>(world: &World<D>) -> Vec<f64> {
    let reach = |axis: usize, sign: f64| {
        let places = world.grains.position.iter().zip(&world.grains.radius);
        places.map(|(x, r)| sign * x[axis] + r).fold(f64::NEG_INFINITY, f64::max)
    };
    (0..D::N).map(|axis| reach(axis, 1.0) + reach(axis, -1.0)).collect()
}

/// d·E d: the strain along a unit direction d.
fn axial<V: Vect>(strain: &[f64], d: V) -> f64 {
    let row = |r: usize| (0..V::LEN).map(|c| strain[r * V::LEN + c] * d[c]).sum::<f64>();
    (0..V::LEN).map(|r| d[r] * row(r)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::build;
    use dem_core::contact::Local;
    use dem_core::dim::D2;
    use dem_core::solver::SolveStatus;
    use dem_core::world::Break;

    const TWO_GRAINS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/two-grains.json");

    #[test]
    fn each_mode_of_rupture_is_counted_by_itself() {
        let scene = crate::scene::load(TWO_GRAINS.as_ref(), &[]).expect("scene");
        let mut world = build::<D2>(&scene, None, &mut |_| true).expect("world").world;
        let mut course = Course::new(&scene, &world);
        let mut report = world.step().expect("a step");
        use BondStatus::{Intact, Rolling, Shear, Tension, Twist};
        report.breaks = [Intact, Tension, Shear, Rolling, Twist, Intact]
            .map(|mode| {
                let (point, reaction) = (Vect::zero(), Local::zero());
                Break { bond: 0, pair: [0, 1], mode, round: 0, point, reaction, energy: 0.0 }
            })
            .into();
        course.count(&world, &report);
        // earlier, intact bonds counted as tension: 3
        assert_eq!(course.broken, [1, 1, 1, 1]);
    }

    /// Only steps whose residual exceeds the tolerance count as missing it. Steps whose load error
    /// exceeds the load tolerance are counted separately.
    #[test]
    fn a_step_that_misses_its_load_tolerance_alone_does_not_miss_the_tolerance() {
        let scene = crate::scene::load(TWO_GRAINS.as_ref(), &[]).expect("scene");
        let mut world = build::<D2>(&scene, None, &mut |_| true).expect("world").world;
        let solver = world.settings.solver;
        let (tolerance, load_tolerance) =
            (solver.tolerance(), solver.load_tolerance().expect("it reports a load error"));
        let mut course = Course::new(&scene, &world);
        let report = world.step().expect("a step");
        let mut enter = |residual, load_error, route, status| {
            course.count(&world, &StepReport { residual, load_error, route, status, ..report.clone() });
        };
        use SolveStatus::{Accepted, Converged};
        enter(tolerance, Some(load_tolerance), Route::Extrapolation, Converged);
        enter(0.5 * tolerance, Some(2.0 * load_tolerance), Route::ActiveSet, Accepted);
        enter(0.5 * tolerance, Some(3.0 * load_tolerance), Route::InteriorPoint, Accepted);
        enter(2.0 * tolerance, None, Route::Sweeps, Accepted);
        // sweeps with a stricter tolerance, which they met
        enter(0.5 * tolerance, None, Route::Sweeps, Accepted);
        assert_eq!((course.missed_tolerance, course.missed_load_tolerance), (1, 2));
        assert_eq!((course.solved_steps, course.worst_load_error), (4, Some(3.0 * load_tolerance)));
        // a resumed run keeps the counts
        let mut saved = Saved::default();
        course.save(&mut saved);
        let restored = Course::restored(&scene, &mut world, &mut Reader::new(&saved.reals, &saved.counts));
        let restored = restored.expect("what was saved");
        assert_eq!((restored.missed_tolerance, restored.missed_load_tolerance), (1, 2));
        assert_eq!((restored.solved_steps, restored.worst_load_error), (4, course.worst_load_error));
    }
}
