//! The section of the sample on which the stress of a wall acts, and the forces on walls that hold
//! grains.

use super::World;
use super::motion::Midpoint;
use crate::body::Shape;
use crate::dim::{Dim, Vect};
use crate::plate::Plate;

/// The only axis along which a vector has a component, if any.
fn only_axis<V: Vect>(vector: V) -> Option<usize> {
    let axis = (0..V::LEN).find(|k| vector[*k] != 0.0)?;
    (axis + 1..V::LEN).all(|k| vector[k] == 0.0).then_some(axis)
}

impl<D: Dim> World<D> {
    /// For each of the two nodes of a contact, the wall on which the forces on it act: the wall
    /// itself, or the wall that holds the grain.
    #[inline]
    pub(super) fn walls_of(&self, nodes: [u32; 2]) -> [Option<usize>; 2] {
        let [first, second] = nodes.map(|node| node as usize);
        let wall = second.checked_sub(self.grains.len());
        if self.held.is_empty() {
            return [None, wall];
        }
        let holder = |grain: usize| self.held[grain].map(|wall| wall as usize);
        [holder(first), wall.or_else(|| holder(second))]
    }

    /// Number of grains that a wall holds.
    pub fn grains_held_by(&self, wall: usize) -> usize {
        self.held.iter().filter(|held| **held == Some(wall as u32)).count()
    }

    /// Update the sections on which the stresses of walls act, from the positions at mid-step.
    pub(super) fn measure_sections(&mut self, mid: &Midpoint<D>) {
        for w in 0..self.walls.len() {
            if self.walls[w].per_area {
                self.walls[w].section = self.section(w, mid);
            }
        }
    }

    /// Section of the sample (m²) across the normal of a plane wall that is parallel to an axis; of
    /// a plate, whose sides are then parallel to axes too, the part of it that the plate covers.
    ///
    /// It is πR² inside a cylinder along this axis. Otherwise it is the product of the extents
    /// along the other axes, in 2D times the thickness. Where planes bound the sample on both
    /// sides, the extent is the distance of the innermost two, else that of the grains. What a
    /// plate covers is known only without a cylinder.
    fn section(&self, wall: usize, mid: &Midpoint<D>) -> f64 {
        let plate = match &self.walls[wall].shape {
            Shape::Plate(plate) => Some(plate),
            _ => None,
        };
        let normal = plate.map(Plate::normal).or(self.walls[wall].shape.flat_normal());
        let across = normal.and_then(only_axis);
        let around = self.walls.iter().find_map(|wall| match wall.shape {
            Shape::Round { radius, inside: true, axis: Some(axis) } if only_axis(axis) == across => Some(radius),
            _ => None,
        });
        if let (Some(radius), None) = (around, plate) {
            return std::f64::consts::PI * radius * radius;
        }
        let mut grains = None;
        let extent = |axis: usize| {
            let between = self.bounds_by_planes(axis, mid);
            let (low, high) = between.unwrap_or_else(|| {
                let (low, high) = *grains.get_or_insert_with(|| self.grains.bounds_at(&mid.grains));
                (low[axis], high[axis])
            });
            let Some(plate) = plate else { return (high - low).max(0.0) };
            let mut along = D::Vector::zero();
            along[axis] = 1.0;
            let (middle, reach) = (mid.walls[wall][axis], plate.reach(along));
            (high.min(middle + reach) - low.max(middle - reach)).max(0.0)
        };
        (0..D::N).filter(|axis| Some(*axis) != across).map(extent).product::<f64>() * self.settings.thickness
    }

    /// Positions along an axis (m) of the innermost planes that face each other along it.
    fn bounds_by_planes(&self, axis: usize, mid: &Midpoint<D>) -> Option<(f64, f64)> {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (wall, place) in self.walls.iter().zip(&mid.walls) {
            let Some(normal) = wall.shape.flat_normal().filter(|n| only_axis(*n) == Some(axis)) else { continue };
            if normal[axis] > 0.0 {
                low = low.max(place[axis]);
            } else {
                high = high.min(place[axis]);
            }
        }
        (low.is_finite() && high.is_finite()).then_some((low, high))
    }
}
