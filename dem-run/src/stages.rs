//! The stages of loading of a run: when each ends, and the drives that the next one brings.

use crate::bonds;
use crate::drive::set_drive;
use crate::error::RunError;
use crate::history::Ending;
use crate::load::drive_direction;
use crate::output::number;
use crate::scene::Scene;
use crate::stop::Stops;
use dem_core::dim::Dim;
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::world::World;
use std::sync::Arc;

/// The stages of a run, in progress.
pub struct Stages<D: Dim> {
    /// The step after which each stage began, up to the present one; empty without stages.
    began: Vec<u64>,
    /// Conditions of the present stage.
    until: Stops<D>,
}

impl<D: Dim> Stages<D> {
    /// The stages of a run that begins with `world`, whose walls have the drives of the first.
    pub fn new(scene: &Scene, world: &World<D>) -> Self {
        let first = scene.stages.first();
        Self {
            began: first.map(|_| 0).into_iter().collect(),
            until: Stops::new(first.and_then(|stage| stage.until.as_ref()), scene, world),
        }
    }

    /// Counts a step; `world` is the state after it, `broken` the number of bonds broken so far.
    pub fn count(&mut self, world: &World<D>, broken: usize) {
        self.until.count(world, broken);
    }

    /// The step after which the bonds formed, if a stage that cements has begun.
    pub fn cemented(&self, scene: &Scene) -> Option<u64> {
        self.began.get(scene.cement_stage()?).copied()
    }

    /// Ends the present stage if this step is its last, and begins the next one. Returns the end of
    /// the run, if that was the last stage.
    ///
    /// # Errors
    /// Those of [`bonds::of_sample`] where the next stage cements, and no grains that it bonds.
    pub fn advance(&mut self, scene: &Scene, world: &mut World<D>, broken: usize) -> Result<Option<Ending>, RunError> {
        let present = self.began.last().zip(scene.stages.get(self.began.len().saturating_sub(1)));
        let Some((&began, stage)) = present else { return Ok(None) };
        // a stage has at least one step
        if world.steps <= began {
            return Ok(None);
        }
        let over = stage.steps(scene.time.step).is_some_and(|steps| world.steps - began >= steps);
        if !over && self.until.ending(world, broken).is_none() {
            return Ok(None);
        }
        let Some(next) = scene.stages.get(self.began.len()) else { return Ok(Some(Ending::Stages)) };
        if next.cement {
            cement(scene, world, self.began.len())?;
        }
        self.began.push(world.steps);
        let before = world.kinetic_energy();
        set_drives(scene, world, self.began.len() - 1, world.steps);
        // a wall has kinetic energy only under a force: its new drive takes it, or gives it
        let change = world.kinetic_energy() - before;
        if change != 0.0 {
            world.ledger.kinetic += change;
            world.ledger.external_work += change;
        }
        self.until = Stops::new(next.until.as_ref(), scene, world);
        Ok(None)
    }

    /// Saves what changes from step to step.
    pub fn save(&self, to: &mut Saved) {
        to.count(self.began.len());
        to.counts.extend(&self.began);
        self.until.save(to);
    }

    /// Restores what [`Stages::save`] wrote, with the drives of the present stage.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(scene: &Scene, world: &mut World<D>, from: &mut Reader) -> Result<Self, Mismatch> {
        let begun = from.count()?;
        let known = if scene.stages.is_empty() { begun == 0 } else { (1..=scene.stages.len()).contains(&begun) };
        if !known {
            return Err(Mismatch);
        }
        let began: Vec<u64> = (0..begun).map(|_| Ok(from.count()? as u64)).collect::<Result<_, Mismatch>>()?;
        for (stage, start) in began.iter().enumerate().skip(1) {
            set_drives(scene, world, stage, *start);
        }
        let until = begun.checked_sub(1).and_then(|last| scene.stages[last].until.as_ref());
        let mut until = Stops::new(until, scene, world);
        until.restore(from)?;
        Ok(Self { began, until })
    }
}

/// Bonds the grains that are near each other now.
fn cement<D: Dim>(scene: &Scene, world: &mut World<D>, stage: usize) -> Result<(), RunError> {
    let formed = bonds::of_sample(scene, &world.grains)?;
    if formed.is_empty() {
        return Err(RunError::Sample(vec![format!(
            "stages.{stage}.cement: no two grains are near enough at t = {} s{}; make the stages before it press them \
             together, or bonds.gap_tolerance larger",
            number(world.time),
            bonds::EXCEPT
        )]));
    }
    world.add_bonds(formed);
    Ok(())
}

/// Gives the walls the drives of a stage that begins after the step `start`, and the membrane its
/// pressure.
fn set_drives<D: Dim>(scene: &Scene, world: &mut World<D>, stage: usize, start: u64) {
    let time = start as f64 * scene.time.step;
    if let (Some(pressure), Some(membrane)) = (scene.stages[stage].membrane_pressure.clone(), &mut world.membrane) {
        membrane.pressure = Arc::new(move |t| pressure.at(t - time));
    }
    for (name, change) in &scene.stages[stage].walls {
        let Some(index) = scene.wall_index(name) else { continue };
        let Some(direction) = drive_direction(&world.walls[index]) else { continue };
        set_drive(&mut world.walls[index], &scene.walls[name], change.drive(), direction, &world.grains.mass, time);
    }
}
