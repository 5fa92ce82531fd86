//! A flexible membrane in 2D: a pressure on the free surface of the sample.
//!
//! The surface is found from the geometry of each step. A disk rolls on the sample from outside:
//! between two plates up each side, from the first plate to the second, else once around. The
//! grains that it touches in turn are those of the surface. So the surface follows the grains; the
//! disk does not enter gaps narrower than itself, and fragments further away than that are outside.
//!
//! Two consecutive grains of the surface carry the pressure on the line between their centres, one
//! half each, as in the stress-controlled boundaries of Bardet & Proubet (Géotechnique 41, 599,
//! 1991) and Kuhn (Eng. Comput. 12, 175, 1995). The first and the last grain at a plate carry that
//! on the perpendicular from their centre to the plate. The forces are thus −p ∂A/∂x of the area A
//! that the line encloses: on a closed line their sum and their torque vanish, and each side
//! between plates carries p times their distance.

use super::motion::Midpoint;
use super::{StepError, World};
use crate::body::{Grains, Schedule, Wall};
use crate::detection::Candidates;
use crate::dim::{Dim, Vect};
use std::f64::consts::{PI, TAU};

/// Displacement of a grain, over its radius, before the list of its neighbours is rebuilt.
const SPARE: f64 = 0.5;

/// Angle (rad) up to which two bodies count as touched at the same time: what rounding may leave.
const ROUNDING: f64 = 1e-12;

/// A pressure on the free surface of a sample in 2D.
#[derive(Clone)]
pub struct Membrane<D: Dim> {
    /// Pressure (Pa) over time (s).
    pub pressure: Schedule,
    /// Two walls, planes that face each other: the surface is free on both sides between them.
    /// Without them it goes all around the sample.
    pub between: Option<[usize; 2]>,
    /// Radius of the disk that rolls on the surface (m).
    pub disk: f64,
    /// Pressure in the last step (Pa), the mean over its parts.
    pub applied: f64,
    /// Area that the surface encloses (m²): that of the polygon through the centres of its grains,
    /// and between plates the plates.
    pub area: f64,
    /// The surface, grain by grain; a grain on both sides is listed twice.
    pushes: Vec<Push<D>>,
    near: Near<D>,
}

/// The pressure on a grain.
#[derive(Clone, Copy, Debug)]
struct Push<D: Dim> {
    grain: usize,
    /// Force over pressure and thickness (m), into the sample.
    length: D::Vector,
}

impl<D: Dim> Membrane<D> {
    /// A membrane whose surface is not found yet.
    pub fn new(pressure: Schedule, between: Option<[usize; 2]>, disk: f64) -> Self {
        let near = Near { candidates: Candidates::default(), first: Vec::new(), others: Vec::new() };
        Self { pressure, between, disk, applied: 0.0, area: 0.0, pushes: Vec::new(), near }
    }

    /// The same membrane on a sample whose grains have other numbers.
    #[must_use]
    pub fn unfound(&self) -> Self {
        Self::new(self.pressure.clone(), self.between, self.disk)
    }

    /// Forces over pressure and thickness (m) on the grains of the surface, in its order.
    pub fn pushes(&self) -> impl Iterator<Item = (usize, D::Vector)> {
        self.pushes.iter().map(|push| (push.grain, push.length))
    }

    /// Find the surface. If there is none, the last one remains.
    fn follow(&mut self, grains: &Grains<D>, walls: &[Wall<D>], mid: &Midpoint<D>) -> Option<()> {
        self.near.cover(grains, &mid.grains, self.disk);
        let mut pushes = Vec::new();
        let mut area = 0.0;
        for side in if self.between.is_some() { &[1.0, -1.0][..] } else { &[1.0] } {
            let rolling = Rolling::new(self, grains, walls, mid, *side)?;
            let stations = if self.between.is_some() { rolling.up_a_side()? } else { rolling.around_all()? };
            area += rolling.load(&stations, &mut pushes);
        }
        (self.pushes, self.area) = (pushes, area);
        Some(())
    }
}

impl<D: Dim> World<D> {
    /// Find the surface under the membrane, if there is one, with the bodies at their places.
    ///
    /// # Errors
    /// [`StepError::NoSurface`].
    pub fn find_surface(&mut self) -> Result<(), StepError> {
        self.follow_surface(&Midpoint::of(&self.grains, &self.walls))
    }

    /// The same at mid-step.
    pub(super) fn follow_surface(&mut self, mid: &Midpoint<D>) -> Result<(), StepError> {
        let Some(membrane) = &mut self.membrane else { return Ok(()) };
        let walls = membrane.between.map(|between| between.map(|wall| (self.grains.len() + wall) as u32));
        let (time, disk) = (self.time, membrane.disk);
        let found = membrane.follow(&self.grains, &self.walls, mid);
        found.ok_or(StepError::NoSurface { time, walls, disk })
    }

    /// Forces on the grains of the surface (N) under a pressure (Pa).
    pub(super) fn membrane_forces(&self, pressure: f64) -> impl Iterator<Item = (usize, D::Vector)> {
        let factor = pressure * self.settings.thickness;
        self.membrane.iter().flat_map(Membrane::pushes).map(move |(grain, length)| (grain, length * factor))
    }
}

/// Pairs of grains that the disk may touch at the same time.
#[derive(Clone)]
struct Near<D: Dim> {
    candidates: Candidates<D>,
    /// Where the neighbours of each grain begin in `others`.
    first: Vec<u32>,
    others: Vec<u32>,
}

impl<D: Dim> Near<D> {
    /// Make the list hold every pair with a gap of at most twice the radius of the disk.
    fn cover(&mut self, grains: &Grains<D>, position: &[D::Vector], disk: f64) {
        let spare = |k: usize| SPARE * grains.radius[k];
        if !self.candidates.cover(grains, position, &[], &[], |_| disk, spare) {
            return;
        }
        let pairs = &self.candidates.pairs;
        self.first = vec![0; grains.len() + 1];
        pairs.iter().flatten().for_each(|k| self.first[*k as usize + 1] += 1);
        for k in 0..grains.len() {
            self.first[k + 1] += self.first[k];
        }
        let mut next = self.first.clone();
        self.others = vec![0; 2 * pairs.len()];
        for [i, j] in pairs {
            for (k, other) in [(i, j), (j, i)] {
                self.others[next[*k as usize] as usize] = *other;
                next[*k as usize] += 1;
            }
        }
    }

    fn of(&self, grain: usize) -> impl Iterator<Item = usize> {
        let [from, to] = [grain, grain + 1].map(|k| self.first[k] as usize);
        self.others[from..to].iter().map(|k| *k as usize)
    }
}

/// What the disk touches.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Station {
    /// The first plate.
    First,
    Grain(usize),
    /// The second plate.
    Second,
}

/// A disk that rolls on a sample, which is on its right.
///
/// Its centre follows the outline of the grains enlarged by its radius. Coordinates: along the
/// plates, to the sample, and above the first plate.
struct Rolling<'a, D: Dim> {
    near: &'a Near<D>,
    position: &'a [D::Vector],
    radius: &'a [f64],
    disk: f64,
    /// Unit vectors along the two coordinates.
    axes: [D::Vector; 2],
    /// Position of the first plate along the second axis (m).
    base: f64,
    /// Distance of the plates (m).
    height: Option<f64>,
}

impl<'a, D: Dim> Rolling<'a, D> {
    /// A disk on one side, left (1) or right (−1); `None` if it does not fit between the plates.
    fn new(
        membrane: &'a Membrane<D>,
        grains: &'a Grains<D>,
        walls: &[Wall<D>],
        mid: &'a Midpoint<D>,
        side: f64,
    ) -> Option<Self> {
        let mut up = D::Vector::zero();
        up[1] = 1.0;
        let (mut base, mut height) = (0.0, None);
        if let Some([first, second]) = membrane.between {
            up = walls[first].shape.flat_normal()?;
            base = mid.walls[first].dot(&up);
            height = Some(mid.walls[second].dot(&up) - base);
        }
        let mut along = D::Vector::zero();
        (along[0], along[1]) = (side * up[1], -side * up[0]);
        let (near, disk) = (&membrane.near, membrane.disk);
        let fits = height.is_none_or(|height| height > 2.0 * disk);
        let (position, radius) = (&mid.grains, &grains.radius);
        fits.then_some(Self { near, position, radius, disk, axes: [along, up], base, height })
    }

    fn place(&self, grain: usize) -> [f64; 2] {
        let x = self.position[grain];
        [x.dot(&self.axes[0]), x.dot(&self.axes[1]) - self.base]
    }

    /// Distance of the centre of the disk from that of a grain that it touches (m).
    fn reach(&self, grain: usize) -> f64 {
        self.radius[grain] + self.disk
    }

    /// What the disk touches on its way up one side; `None` if it rolls past the sample.
    fn up_a_side(&self) -> Option<Vec<Station>> {
        let mut stations = vec![Station::First];
        let (mut before, mut here, mut place) = (None, Station::First, f64::NEG_INFINITY);
        // each enlarged grain has at most as many arcs on the outline as neighbours
        for _ in 0..=self.near.others.len() + 2 * self.radius.len() {
            let (next, arrived) = match here {
                Station::First => self.along_the_plate(place, before)?,
                Station::Grain(grain) => self.around(grain, place, before)?,
                Station::Second => return Some(stations),
            };
            stations.push(next);
            (before, here, place) = (Some(here), next, arrived);
        }
        None
    }

    /// The grains that the disk touches once around the sample, its largest part if it has several.
    fn around_all(&self) -> Option<Vec<Station>> {
        let start = self.outermost()?;
        let Some(first) = self.around(start, PI, None) else { return Some(Vec::new()) };
        let mut stations = Vec::new();
        let (mut before, (mut here, mut place)) = (Station::Grain(start), first);
        for _ in 0..=self.near.others.len() {
            stations.push(here);
            let Station::Grain(grain) = here else { return None };
            let (next, arrived) = self.around(grain, place, Some(before))?;
            if (here, next) == (Station::Grain(start), first.0) {
                return Some(stations);
            }
            (before, here, place) = (here, next, arrived);
        }
        None
    }

    /// The next grain of a disk on the first plate, from the place `from` of its centre on.
    fn along_the_plate(&self, from: f64, before: Option<Station>) -> Option<(Station, f64)> {
        let mut next: Option<(f64, f64, usize)> = None;
        for grain in 0..self.radius.len() {
            let ([s, h], reach) = (self.place(grain), self.reach(grain));
            let half = reach * reach - (h - self.disk).powi(2);
            if half <= 0.0 || before == Some(Station::Grain(grain)) {
                continue;
            }
            let (touch, rounding) = (s - half.sqrt(), ROUNDING * reach);
            // of two at the same time, the one nearer to the plate
            let first =
                |(least, low, _): (f64, f64, usize)| touch < least - rounding || touch <= least + rounding && h < low;
            if touch >= from - rounding && next.is_none_or(first) {
                next = Some((touch, h, grain));
            }
        }
        let (touch, _, grain) = next?;
        Some((Station::Grain(grain), self.angle_on(grain, [touch, self.disk])))
    }

    /// What a disk touches next that rolls clockwise around a grain, from the angle `from` on: the
    /// station, and the place on the plate or the angle on the grain.
    fn around(&self, grain: usize, from: f64, before: Option<Station>) -> Option<(Station, f64)> {
        let (centre, reach) = (self.place(grain), self.reach(grain));
        let mut next: Option<(f64, f64, f64, Station)> = None;
        let mut offer = |station: Station, distance: f64, angle: f64| {
            let mut way = (from - angle).rem_euclid(TAU);
            // what comes next at the same place is not behind; what the disk comes from is
            if way > TAU - ROUNDING && before != Some(station) {
                way = 0.0;
            }
            // of two at the same time, the nearer grain
            let first = |(least, nearest, ..): (f64, f64, f64, Station)| {
                way < least - ROUNDING || way <= least + ROUNDING && distance < nearest
            };
            if next.is_none_or(first) {
                next = Some((way, distance, angle, station));
            }
        };
        for other in self.near.of(grain) {
            let (place, its) = (self.place(other), self.reach(other));
            let apart = [place[0] - centre[0], place[1] - centre[1]];
            let distance = apart[0].hypot(apart[1]);
            let cosine = (distance * distance + reach * reach - its * its) / (2.0 * distance * reach);
            if distance < reach + its && cosine.abs() < 1.0 {
                offer(Station::Grain(other), distance, apart[1].atan2(apart[0]) + cosine.acos());
            }
        }
        if let Some(height) = self.height {
            let sine = |level: f64| Some((level - centre[1]) / reach).filter(|sine| sine.abs() <= 1.0);
            // down to the first plate on the right of the grain, up to the second on its left
            let plates = [(Station::First, self.disk), (Station::Second, height - self.disk)];
            for (station, level) in plates {
                let Some(angle) = sine(level).map(f64::asin) else { continue };
                offer(station, f64::INFINITY, if station == Station::First { angle } else { PI - angle });
            }
        }
        let (.., angle, station) = next?;
        let point = [centre[0] + reach * angle.cos(), centre[1] + reach * angle.sin()];
        let arrived = match station {
            Station::Grain(other) => self.angle_on(other, point),
            Station::First | Station::Second => point[0],
        };
        Some((station, arrived))
    }

    fn angle_on(&self, grain: usize, point: [f64; 2]) -> f64 {
        let centre = self.place(grain);
        (point[1] - centre[1]).atan2(point[0] - centre[0])
    }

    /// The outermost grain of the largest part of the sample: of that with the most grains between
    /// which the disk does not pass, and of those the first.
    fn outermost(&self) -> Option<usize> {
        let mut part: Vec<usize> = (0..self.radius.len()).collect();
        fn root(part: &mut [usize], mut k: usize) -> usize {
            while part[k] != k {
                part[k] = part[part[k]];
                k = part[k];
            }
            k
        }
        for k in 0..part.len() {
            for other in self.near.of(k).filter(|other| *other > k) {
                let apart = self.position[k] - self.position[other];
                if apart.norm() < self.reach(k) + self.reach(other) {
                    let [a, b] = [k, other].map(|k| root(&mut part, k));
                    part[a.max(b)] = a.min(b);
                }
            }
        }
        let roots: Vec<usize> = (0..part.len()).map(|k| root(&mut part, k)).collect();
        let mut sizes = vec![0; part.len()];
        roots.iter().for_each(|root| sizes[*root] += 1);
        let largest = (0..sizes.len()).rev().max_by_key(|root| sizes[*root])?;
        let left = |k: &usize| self.place(*k)[0] - self.radius[*k];
        (0..roots.len()).filter(|k| roots[*k] == largest).min_by(|a, b| left(a).total_cmp(&left(b)))
    }

    /// Adds the pressure on the grains of a path, and returns its part of the enclosed area (m²).
    /// A path from plate to plate begins and ends with a plate; another one is closed.
    fn load(&self, stations: &[Station], pushes: &mut Vec<Push<D>>) -> f64 {
        let mut area = 0.0;
        let count = stations.len();
        // a side of a station: its length into the sample, along both coordinates
        let side = |from: Station, to: Station| {
            let (a, b) = (self.foot(from, to), self.foot(to, from));
            let share = if matches!((from, to), (Station::Grain(_), Station::Grain(_))) { 0.5 } else { 1.0 };
            ([share * (b[1] - a[1]), share * (a[0] - b[0])], 0.5 * (a[0] + b[0]) * (b[1] - a[1]))
        };
        for (at, station) in stations.iter().enumerate() {
            let next = stations[(at + 1) % count];
            let Station::Grain(grain) = *station else {
                if at + 1 < count {
                    area -= side(*station, next).1;
                }
                continue;
            };
            let (after, strip) = side(*station, next);
            let (before, _) = side(stations[(at + count - 1) % count], *station);
            area -= strip;
            let length = self.axes[0] * (before[0] + after[0]) + self.axes[1] * (before[1] + after[1]);
            pushes.push(Push { grain, length });
        }
        area
    }

    /// The end of the line to a neighbouring station: the centre of a grain, the foot of the
    /// neighbour on a plate.
    fn foot(&self, station: Station, neighbour: Station) -> [f64; 2] {
        let beside = |level: f64| match neighbour {
            Station::Grain(grain) => [self.place(grain)[0], level],
            Station::First | Station::Second => [0.0, level],
        };
        match station {
            Station::Grain(grain) => self.place(grain),
            Station::First => beside(0.0),
            Station::Second => beside(self.height.unwrap_or_default()),
        }
    }
}
