//! The stop conditions of a scene, followed from step to step.

use crate::history::Ending;
use crate::load::{drive_direction, load};
use crate::scene::{Scene, Stop, TravelFrom};
use dem_core::dim::{Dim, Vect};
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::world::World;
use serde::Serialize;

/// Number of consecutive steps whose load must be below the share of the peak. A grain that loses
/// its contact with the wall for a step, or an impact that ends, is no drop of the load.
pub const DROP_STEPS: usize = 10;

/// Name of the travel of a wall as a stop condition.
pub const TRAVEL: &str = "travel";

/// The stop conditions of a run.
pub struct Stops<D: Dim> {
    travel: Option<TravelStop<D>>,
    /// Share of broken bonds (–) that ends the run.
    broken_limit: Option<f64>,
    drop: Option<DropStop>,
}

/// How far the stop condition of a run is that is reached first, as it stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StopProgress {
    /// What ends the run: "travel" of a wall, or "broken" bonds.
    pub condition: &'static str,
    /// Fraction reached (0 to 1).
    pub reached: f64,
}

/// The travel of a wall that ends a run.
struct TravelStop<D: Dim> {
    wall: usize,
    direction: D::Vector,
    distance: f64,
    from: Option<D::Vector>,
}

impl<D: Dim> TravelStop<D> {
    /// Distance of the wall along its direction from a place (m).
    fn travelled(&self, world: &World<D>, from: D::Vector) -> f64 {
        (world.walls[self.wall].position - from).dot(&self.direction).abs()
    }
}

/// The drop of the load that ends a run.
struct DropStop {
    /// Index of the load wall.
    wall: usize,
    /// Share of the peak (–).
    share: f64,
    /// Greatest magnitude of the load since the first break of a bond, that step included (N).
    peak: f64,
    /// Consecutive steps below the share, up to the last.
    below: usize,
}

impl DropStop {
    /// Counts a step with this load (N).
    fn count(&mut self, load: f64, broken: usize) {
        if broken == 0 {
            return;
        }
        self.peak = self.peak.max(load.abs());
        self.below = if load.abs() < self.share * self.peak { self.below + 1 } else { 0 };
    }
}

impl<D: Dim> Stops<D> {
    /// The conditions of `stop`, with the travel of a wall measured from `world`.
    pub fn new(stop: Option<&Stop>, scene: &Scene, world: &World<D>) -> Self {
        let load_wall = scene.load_wall().and_then(|name| scene.wall_index(name));
        let drop = stop.and_then(|stop| stop.load_drop).zip(load_wall);
        Self {
            travel: stop.and_then(|stop| travel_stop(stop, scene, world)),
            broken_limit: stop.and_then(|stop| stop.broken_fraction),
            drop: drop.map(|(share, wall)| DropStop { wall, share, peak: 0.0, below: 0 }),
        }
    }

    /// Counts a step; `world` is the state after it, `broken` the number of bonds broken so far.
    pub fn count(&mut self, world: &World<D>, broken: usize) {
        if let Some(drop) = &mut self.drop {
            drop.count(load(&world.walls[drop.wall]), broken);
        }
    }

    /// How far the nearest condition is. A drop of the load has no measure of that.
    pub fn progress(&self, world: &World<D>, broken: usize) -> Option<StopProgress> {
        let travel = self.travel.as_ref().map(|stop| {
            let travelled = stop.from.map_or(0.0, |from| stop.travelled(world, from));
            StopProgress { condition: TRAVEL, reached: (travelled / stop.distance).min(1.0) }
        });
        let broken = self.broken_limit.map(|limit| {
            let reached = broken as f64 / (limit * world.bonds.len() as f64);
            StopProgress { condition: "broken", reached: if reached.is_finite() { reached.min(1.0) } else { 0.0 } }
        });
        travel.into_iter().chain(broken).max_by(|a, b| a.reached.total_cmp(&b.reached))
    }

    /// The condition that ends the run after this step, if any.
    pub fn ending(&mut self, world: &World<D>, broken: usize) -> Option<Ending> {
        if let Some(stop) = &mut self.travel {
            if stop.from.is_none() && broken > 0 {
                stop.from = Some(world.walls[stop.wall].position);
            }
            if stop.from.is_some_and(|from| stop.travelled(world, from) >= stop.distance) {
                return Some(Ending::WallTravel);
            }
        }
        let bonds = world.bonds.len() as f64;
        if self.broken_limit.is_some_and(|limit| bonds > 0.0 && broken as f64 >= limit * bonds) {
            return Some(Ending::BrokenFraction);
        }
        let dropped = self.drop.as_ref().is_some_and(|drop| drop.below >= DROP_STEPS);
        dropped.then_some(Ending::LoadDrop)
    }

    /// Saves what changes from step to step.
    pub fn save(&self, to: &mut Saved) {
        to.flag(self.travel.is_some());
        if let Some(stop) = &self.travel {
            to.real(stop.distance);
            to.flag(stop.from.is_some());
            to.vector(&stop.from.unwrap_or(D::Vector::zero()));
        }
        to.flag(self.drop.is_some());
        if let Some(drop) = &self.drop {
            to.real(drop.peak);
            to.count(drop.below);
        }
    }

    /// Restores what [`Stops::save`] wrote. A condition that the scene no longer has is dropped.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restore(&mut self, from: &mut Reader) -> Result<(), Mismatch> {
        if from.flag()? {
            let (distance, begun, place) = (from.real()?, from.flag()?, from.vector()?);
            if let Some(stop) = &mut self.travel {
                (stop.distance, stop.from) = (distance, begun.then_some(place));
            }
        }
        if from.flag()? {
            let (peak, below) = (from.real()?, from.count()?);
            if let Some(drop) = &mut self.drop {
                (drop.peak, drop.below) = (peak, below);
            }
        }
        Ok(())
    }
}

fn travel_stop<D: Dim>(stop: &Stop, scene: &Scene, world: &World<D>) -> Option<TravelStop<D>> {
    let travel = stop.wall_travel.as_ref()?;
    let wall = scene.wall_index(&travel.wall)?;
    let direction = drive_direction(&world.walls[wall])?;
    let along = |sign: f64| {
        let reach = |(x, r): (&D::Vector, &f64)| sign * x.dot(&direction) + r;
        world.grains.position.iter().zip(&world.grains.radius).map(reach).fold(f64::NEG_INFINITY, f64::max)
    };
    // the first break of the run may be in an earlier stage
    let begun = travel.after == TravelFrom::Start || world.intact_bonds() < world.bonds.len();
    let from = begun.then(|| world.walls[wall].position);
    Some(TravelStop { wall, direction, distance: travel.fraction_of_height * (along(1.0) + along(-1.0)), from })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::build;
    use crate::scene::from_text;
    use dem_core::bond::BondStatus;
    use dem_core::dim::D2;

    #[test]
    fn a_travel_begins_with_its_conditions_if_bonds_broke_before() {
        let text = r#"{ "dimension": 2,
            "sample": { "grains": [{ "center": [0, 1], "radius": 1 }, { "center": [2, 1], "radius": 1 }] },
            "materials": { "density": 1, "friction": { "grain_grain": 0.3, "grain_wall": 0.3 } },
            "bonds": { "strength": 1, "gap_tolerance": 1e-3 },
            "walls": { "lid": { "shape": { "plane": { "normal": [0, -1], "place": "seated" } },
                "velocity": { "constant": 1 } } },
            "stop": { "wall_travel": { "wall": "lid", "fraction_of_height": 0.5, "after": "first_break" } },
            "time": { "step": 0.1, "end": 1 }, "output": { "every_steps": 1 } }"#;
        let scene = from_text("test", text, &[]).expect("scene");
        let mut world = build::<D2>(&scene, None, &mut |_| true).expect("world").world;
        let from = |world: &World<D2>| {
            let stops = Stops::new(scene.stop.as_ref(), &scene, world);
            stops.travel.and_then(|travel| travel.from).map(|place| place[1])
        };
        assert_eq!(from(&world), None);
        world.bonds.iter_mut().for_each(|bond| bond.status = BondStatus::Tension);
        assert_eq!(from(&world), Some(2.0));
        // two grains are two metres high: half of that, exactly
        let mut stops = Stops::new(scene.stop.as_ref(), &scene, &world);
        world.walls[0].position = [0.0, 1.0].into();
        assert_eq!(stops.ending(&world, 1), Some(Ending::WallTravel));
    }

    #[test]
    fn a_load_drops_below_its_share_of_the_peak_in_ten_consecutive_steps_after_a_break() {
        let mut drop = DropStop { wall: 0, share: 0.5, peak: 0.0, below: 0 };
        // an impact before the first break is no peak
        drop.count(-500.0, 0);
        drop.count(10.0, 0);
        assert_eq!((drop.peak, drop.below), (0.0, 0));
        // the load of the first break, of either sign, and a greater one
        drop.count(-90.0, 1);
        drop.count(-100.0, 1);
        (1..DROP_STEPS).for_each(|_| drop.count(-49.0, 2));
        assert_eq!((drop.peak, drop.below), (100.0, DROP_STEPS - 1));
        // half the peak is not below it
        drop.count(50.0, 2);
        assert_eq!(drop.below, 0);
        (0..DROP_STEPS).for_each(|_| drop.count(0.0, 2));
        assert_eq!(drop.below, DROP_STEPS);
    }
}
