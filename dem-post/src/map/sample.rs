//! A sample in a map: its grains and walls, the viewpoint, and the part of the plane drawn.

use dem_history::{GrainState, Grains, History, Wall, WallState};

use super::boxes::{Box2, EMPTY, EVERYWHERE, around, union};
use super::eye::{Eye, Place};
use super::wall;
use crate::extent::range;
use crate::output::Result;

/// A part of the sample smaller than this share has a separate picture.
const SMALL: f64 = 0.25;
/// Drawings show a wider part where more than this share of the grains would be outside.
const OUTSIDE: f64 = 0.05;

/// The common data of all panels: the grains' sizes, the walls, and the viewpoint.
pub struct Sample {
    pub(super) radius: Vec<f64>,
    pub(super) walls: Vec<Wall>,
    pub(super) dimension: usize,
    pub(super) eye: Eye,
    /// Depth of the plane that cuts the spheres open, m, if any.
    slice: Option<f64>,
    /// Corners of the part drawn at most, m: the first frame with a margin of half its size, and
    /// the wider part where many grains leave that.
    limits: [Box2; 2],
}

/// The part of the plane that a drawing shows: two corners, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View(pub(super) Box2);

impl View {
    /// The empty part.
    pub const EMPTY: Self = Self(EMPTY);

    /// The smallest part that contains both.
    pub fn join(self, other: Self) -> Self {
        Self(union(self.0, other.0))
    }
}

impl Sample {
    /// Reads the common data of all panels.
    ///
    /// # Errors
    /// Those of [`History::grains`], [`History::walls`] and [`History::grain_state`].
    pub fn read(history: &History) -> Result<Self> {
        Self::seen(history, Eye::Along([0, history.dimension() - 1]))
    }

    /// As [`Sample::read`], of spheres seen from the side, against the first axis.
    ///
    /// # Errors
    /// As [`Sample::read`].
    pub fn from_the_side(history: &History) -> Result<Self> {
        Self::seen(history, Eye::Along([1, 2]))
    }

    /// As [`Sample::read`] of disks; spheres are seen in perspective, and farther spheres are
    /// paler.
    ///
    /// # Errors
    /// As [`Sample::read`].
    pub fn with_depth(history: &History) -> Result<Self> {
        if history.dimension() < 3 {
            return Self::read(history);
        }
        let [_, radius] = range(history.grains()?.radius);
        let first = history.grain_state(0)?;
        Self::seen(history, Eye::At(Place::of(first.position.chunks(3), radius)))
    }

    /// As [`Sample::read`], of spheres cut open by a plane: through the middle of their first
    /// positions or, where this plane cuts no grain, through the nearest grain.
    ///
    /// # Errors
    /// As [`Sample::read`].
    pub fn cut_open(history: &History) -> Result<Self> {
        let mut sample = Self::read(history)?;
        let first = history.grain_state(0)?;
        let depths = || first.position.chunks(sample.dimension).map(|x| sample.eye.depth(x));
        let [low, high] = range(depths());
        let middle = 0.5 * (low + high);
        let off = |depth: &f64| (depth - middle).abs();
        let cuts = depths().zip(&sample.radius).any(|(depth, radius)| off(&depth) < *radius);
        let nearest = depths().min_by(|a, b| off(a).total_cmp(&off(b)));
        sample.slice = if cuts { Some(middle) } else { nearest };
        Ok(sample)
    }

    fn seen(history: &History, eye: Eye) -> Result<Self> {
        let Grains { radius, .. } = history.grains()?;
        let (walls, dimension) = (history.walls()?, history.dimension());
        let mut sample = Self { radius, walls, dimension, eye, slice: None, limits: [EVERYWHERE; 2] };
        let first = history.grain_state(0)?;
        sample.limits = limits(sample.bounds(&first, EVERYWHERE));
        Ok(sample)
    }

    pub(super) fn flat(&self, point: &[f64]) -> [f64; 2] {
        self.eye.flat(point)
    }

    /// The radius at which a grain is drawn, m; none where the plane does not cut it.
    pub(super) fn seen_radius(&self, state: &GrainState, grain: usize) -> Option<f64> {
        let radius = self.radius[grain];
        let place = &state.position[grain * self.dimension..];
        let Some(plane) = self.slice else { return Some(radius * self.eye.magnified(place)) };
        let off = self.eye.depth(place) - plane;
        (off.abs() < radius).then(|| (radius * radius - off * off).sqrt())
    }

    pub(super) fn centre(&self, state: &GrainState, grain: usize) -> [f64; 2] {
        self.flat(&state.position[grain * self.dimension..(grain + 1) * self.dimension])
    }

    /// The box around the grains within `limits`, `[low, high]`, m.
    fn bounds(&self, state: &GrainState, limits: Box2) -> Box2 {
        let mut found = EMPTY;
        for (grain, &radius) in self.radius.iter().enumerate() {
            let centre = self.centre(state, grain);
            if (0..2).all(|k| (limits[0][k]..=limits[1][k]).contains(&centre[k])) {
                let larger = self.eye.magnified(&state.position[grain * self.dimension..]);
                found = union(found, around(centre, radius * larger));
            }
        }
        found
    }

    /// The part that contains all of `states`, for drawings on one scale.
    pub fn view<'a>(&self, states: impl Iterator<Item = (&'a GrainState, &'a WallState)>) -> View {
        View(states.fold(EMPTY, |all, (grains, walls)| union(all, self.extent(grains, walls))))
    }

    /// Number of grains of which nothing is in `view`.
    pub fn outside(&self, state: &GrainState, View([low, high]): View) -> usize {
        let off = |grain: &usize| {
            let place = &state.position[grain * self.dimension..];
            let [l, h] = around(self.flat(place), self.radius[*grain] * self.eye.magnified(place));
            // not a place at all if the run failed
            !(0..2).all(|k| h[k] >= low[k] && l[k] <= high[k])
        };
        (0..self.radius.len()).filter(off).count()
    }

    /// The part that contains `points` (m, D numbers each) with a margin, at least five mean
    /// diameters wide; `None` if this part is not small compared with the sample.
    pub fn near<'a>(&self, points: impl Iterator<Item = &'a [f64]>, all: View) -> Option<View> {
        let [low, high] = points.fold(EMPTY, |found, point| union(found, around(self.flat(point), 0.0)));
        let diameter = 2.0 * self.radius.iter().sum::<f64>() / self.radius.len() as f64;
        let margin = [0, 1].map(|k| (0.5 * (high[k] - low[k])).max(2.5 * diameter));
        let near = [[low[0] - margin[0], low[1] - margin[1]], [high[0] + margin[0], high[1] + margin[1]]];
        let size = |[low, high]: Box2| (high[0] - low[0]) * (high[1] - low[1]);
        (size(near) < SMALL * size(all.0)).then_some(View(near))
    }

    /// The box around the grains and the near parts of round walls.
    fn extent(&self, grains: &GrainState, walls: &WallState) -> Box2 {
        let outside = self.outside(grains, View(self.limits[0]));
        // a heap spreads and a silo empties; a few fragments that fly off would shrink the rest
        let limits = self.limits[usize::from(outside as f64 > OUTSIDE * self.radius.len() as f64)];
        let mut found = self.bounds(grains, limits);
        if found == EMPTY {
            // all grains have left, as a disk on an incline does
            found = self.bounds(grains, EVERYWHERE);
        }
        for (wall, position) in self.walls.iter().zip(walls.position.chunks(self.dimension)) {
            if let Some(shown) = wall::extent(&self.eye, wall, position, limits) {
                found = union(found, shown);
            }
        }
        found
    }
}

/// The parts drawn at most of a sample that is in this box at first.
fn limits([low, high]: Box2) -> [Box2; 2] {
    let size = [0, 1].map(|k| high[k] - low[k]);
    let widened = |by: [f64; 2]| [[0, 1].map(|k| low[k] - by[k]), [0, 1].map(|k| high[k] + by[k])];
    [widened(size.map(|size| 0.5 * size)), widened([1.5 * size[0].max(size[1]); 2])]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 20 disks of radius 1 in a row, the first of which has moved by `by`, the disks outside
    /// the picture and its right edge.
    fn moved(by: &[f64]) -> (usize, f64) {
        let position = |k: usize| [2.0 * k as f64 + by.get(k).unwrap_or(&0.0), 0.0];
        let state = GrainState { position: (0..20).flat_map(position).collect(), ..GrainState::default() };
        let sample = Sample {
            radius: vec![1.0; 20],
            walls: vec![],
            dimension: 2,
            eye: Eye::Along([0, 1]),
            slice: None,
            limits: limits([[-1.0, -1.0], [39.0, 1.0]]),
        };
        let view = sample.view(std::iter::once((&state, &WallState::default())));
        (sample.outside(&state, view), view.edges()[2])
    }

    #[test]
    fn a_heap_that_spreads_is_drawn_whole_and_fragments_are_counted() {
        assert_eq!(moved(&[]), (0, 39.0));
        assert_eq!(moved(&[50.0]), (0, 51.0));
        // a fragment far away would shrink the rest
        assert_eq!(moved(&[80.0]), (1, 39.0));
        assert_eq!(moved(&[80.0, 85.0]), (0, 88.0));
        assert_eq!(moved(&[80.0, 85.0, 2e3]), (1, 88.0));
        // all have left
        assert_eq!(moved(&[1e3; 20]), (0, 1039.0));
        assert_eq!(moved(&[f64::NAN]).0, 1);
    }
}
