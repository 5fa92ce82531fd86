//! Cracks as surfaces, in 3D: facets of broken bonds, joined where they meet.
//!
//! All positions are those when the bonds formed: the crack is drawn in the cemented sample,
//! independent of the later motion of the fragments.
//!
//! * **Facet** of a broken bond: the common face of the cells of its two grains in the power
//!   diagram of all grains (the Voronoi diagram for equal grains), cut off at half the pair's mean
//!   diameter from the line of centres. The cut is needed at the edge of the sample and beside
//!   large voids, where cells are large or unbounded. Between touching equal spheres of diameter d
//!   the area of the face is d² on a cubic lattice, reduced by the cut to the polygon of 24 sides
//!   around a circle of diameter d, and d²/(2√2) in a close packing.
//! * **Crack**: facets that meet in a corner. A corner is a point of equal power to four grains: it
//!   lies in the void between them, as in 2D.
//! * **Normal**: the direction that is most perpendicular to the facets, weighted by area.
//!   **Flatness**: the area-weighted mean of cos² of the angle between this direction and the
//!   normals of the facets; 1 for a plane and 1/3 for a sphere.
//! * **Extent**: the greatest distance of two corners.
//!
//! Source of the diagram: F. Aurenhammer, *Power diagrams*, SIAM J. Comput. 16, 1987.

use std::collections::HashMap;

use dem_history::{Bonds, Rupture};
use nalgebra::Vector3;
use serde::Serialize;

use super::modes::Modes;
use super::parts::{Part, groups};
use crate::chains::stress::major;

/// Sides of the polygon that approximates a circle.
const SIDES: usize = 24;
/// Two corners closer than `ONE` mean diameters are always merged; two farther apart than `CELL`
/// never are. In between they are merged if they lie in the same cell of a grid.
const ONE: f64 = 1e-6;
const CELL: f64 = 1e-4;

type Point = Vector3<f64>;

/// A broken bond as a polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Its index in the list of ruptures.
    pub event: usize,
    /// The points that it may share with other facets.
    pub(super) nodes: Vec<usize>,
    /// Its corners, one after the other, m; none where the cells do not meet near the line of
    /// centres.
    pub corners: Vec<[f64; 3]>,
    /// Area, m².
    pub area: f64,
    /// Unit vector from its second grain to its first.
    pub normal: [f64; 3],
    /// Number of its crack, from 0.
    pub crack: usize,
}

/// A crack: facets that meet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Surface {
    /// Its number, from 1, the largest first.
    pub number: usize,
    /// Its bonds.
    pub bonds: usize,
    /// Area of all its facets, m².
    pub area: f64,
    /// Greatest distance of two corners, m.
    pub extent: f64,
    /// Unit normal; its last component is not negative.
    pub normal: [f64; 3],
    /// 1 for a plane, 1/3 for a sphere.
    pub flatness: f64,
    /// Time at which its first bond broke, s.
    pub first: f64,
    /// Time at which its last bond broke, s.
    pub last: f64,
    /// Number of its bonds by mode of rupture.
    pub modes: Modes,
}

/// The cracks of a sample, and their facets in the order in which they broke.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surfaces {
    /// The cracks, the largest first.
    pub cracks: Vec<Surface>,
    /// The facets, in the order of the ruptures.
    pub facets: Vec<Facet>,
}

impl Surfaces {
    /// Finds the cracks made by `ruptures` in a sample; `position` and `radius` are the centres and
    /// radii of its grains (m) at the formation of `bonds`.
    pub fn find(position: &[[f64; 3]], radius: &[f64], bonds: &Bonds, ruptures: &[Rupture]) -> Self {
        let mut facets = facets(position, radius, bonds, ruptures);
        let groups = groups(parts(&facets));
        let cracks = groups.iter().enumerate().map(|(k, group)| surface(k + 1, &facets, group, ruptures)).collect();
        for (number, group) in groups.iter().enumerate() {
            group.iter().for_each(|&k| facets[k].crack = number);
        }
        Self { cracks, facets }
    }

    /// The facets as parts of cracks.
    pub fn parts(&self) -> impl Iterator<Item = Part<'_>> + Clone {
        parts(&self.facets)
    }

    /// The facets that have an area.
    pub fn seen(&self) -> impl Iterator<Item = &Facet> {
        self.facets.iter().filter(|facet| facet.corners.len() > 2)
    }
}

fn parts(facets: &[Facet]) -> impl Iterator<Item = Part<'_>> + Clone {
    facets.iter().map(|facet| Part { event: facet.event, nodes: &facet.nodes, size: facet.area })
}

fn surface(number: usize, facets: &[Facet], group: &[usize], ruptures: &[Rupture]) -> Surface {
    let members = || group.iter().map(|&k| &facets[k]);
    let mut modes = Modes::default();
    let mut fabric = [[0.0; 3]; 3];
    for facet in members() {
        modes.add(ruptures[facet.event].mode);
        for (row, a) in fabric.iter_mut().zip(facet.normal) {
            row.iter_mut().zip(facet.normal).for_each(|(entry, b)| *entry += facet.area * a * b);
        }
    }
    let area: f64 = members().map(|facet| facet.area).sum();
    let (greatest, normal) = major(&fabric, 3);
    let corners: Vec<Point> = members().flat_map(|facet| facet.corners.iter().map(|x| Point::from(*x))).collect();
    let (first, last) = (&facets[group[0]], &facets[group[group.len() - 1]]);
    Surface {
        number,
        bonds: group.len(),
        area,
        extent: extent(corners),
        normal: if normal[2] < 0.0 { normal.map(|x| -x) } else { normal },
        flatness: if area > 0.0 { greatest / area } else { 1.0 },
        first: ruptures[first.event].time,
        last: ruptures[last.event].time,
        modes,
    }
}

/// The greatest distance of two points, m; 0 without points.
fn extent(points: Vec<Point>) -> f64 {
    let farthest = |from: Point| points.iter().copied().max_by(|a, b| (a - from).norm().total_cmp(&(b - from).norm()));
    let ends = points.first().and_then(|first| farthest(*first)).and_then(|end| Some((end, farthest(end)?)));
    let Some((a, b)) = ends else { return 0.0 };
    // the distance of two points is at most the sum of their distances from the middle
    let (middle, mut greatest) = (0.5 * (a + b), (a - b).norm());
    let mut outwards: Vec<(f64, Point)> = points.iter().map(|x| ((x - middle).norm(), *x)).collect();
    outwards.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (k, (far, x)) in outwards.iter().enumerate() {
        if far + outwards[0].0 <= greatest {
            break;
        }
        for (other, y) in &outwards[..k] {
            if far + other <= greatest {
                break;
            }
            greatest = greatest.max((x - y).norm());
        }
    }
    greatest
}

/// The grains, in the order of their first coordinates.
struct Neighbours {
    centre: Vec<Point>,
    radius: Vec<f64>,
    /// First coordinates and grains.
    along: Vec<(f64, usize)>,
    greatest: f64,
}

impl Neighbours {
    fn new(position: &[[f64; 3]], radius: &[f64]) -> Self {
        let mut along: Vec<(f64, usize)> = position.iter().enumerate().map(|(k, x)| (x[0], k)).collect();
        along.sort_by(|a, b| a.0.total_cmp(&b.0));
        let greatest = radius.iter().copied().fold(0.0, f64::max);
        Self { centre: position.iter().map(|x| Point::from(*x)).collect(), radius: radius.into(), along, greatest }
    }

    /// The grains whose centres are nearer to `point` than `reach`.
    fn near(&self, point: Point, reach: f64) -> impl Iterator<Item = usize> {
        let from = self.along.partition_point(|(x, _)| *x < point.x - reach);
        let candidates = self.along[from..].iter().take_while(move |(x, _)| *x <= point.x + reach);
        candidates.map(|(_, k)| *k).filter(move |k| (self.centre[*k] - point).norm() < reach)
    }

    /// The common face of two grains in the power diagram, cut off at the distance `reach` (m): the
    /// intersection of the line of centres with the plane of equal power, the normal of that plane,
    /// and the corners of the face relative to the intersection.
    fn face(&self, [i, j]: [usize; 2], reach: f64) -> (Point, Point, Vec<Point>) {
        let (a, b) = (self.centre[i], self.centre[j]);
        let way = a - b;
        let (length, normal) = (way.norm(), way.normalize());
        let share = 0.5 * (length + (self.radius[j].powi(2) - self.radius[i].powi(2)) / length);
        let middle = b + normal * share;
        let mut polygon = circle(normal, reach);
        // the power of a corner with respect to either grain is at most this, so a grain farther
        // away cannot cut the face
        let power = reach * reach / (std::f64::consts::PI / SIDES as f64).cos().powi(2) + (middle - a).norm_squared()
            - self.radius[i].powi(2);
        let far = 1.01 * reach + (power + self.greatest.powi(2)).max(0.0).sqrt();
        for k in self.near(middle, far).filter(|k| ![i, j].contains(k)) {
            let other = self.centre[k];
            // |x − a|² − r_i² ≤ |x − c|² − r_k², for x counted from the middle
            let limit = (other - middle).norm_squared() - (a - middle).norm_squared() - self.radius[k].powi(2)
                + self.radius[i].powi(2);
            clip(&mut polygon, 2.0 * (other - a), limit);
        }
        (middle, normal, polygon)
    }
}

/// A regular polygon around the circle of a radius, perpendicular to the unit vector `normal`,
/// around the origin.
fn circle(normal: Point, radius: f64) -> Vec<Point> {
    let least = normal.iamin();
    let first = normal.cross(&Point::ith(least, 1.0)).normalize();
    let second = normal.cross(&first);
    let half = std::f64::consts::PI / SIDES as f64;
    let corner = |k: usize| {
        let (sin, cos) = ((2 * k) as f64 * half).sin_cos();
        (first * cos + second * sin) * (radius / half.cos())
    };
    (0..SIDES).map(corner).collect()
}

/// Keeps the part of a convex polygon where x·direction ≤ limit.
fn clip(polygon: &mut Vec<Point>, direction: Point, limit: f64) {
    let beyond = |x: &Point| x.dot(&direction) - limit;
    if polygon.iter().all(|x| beyond(x) <= 0.0) {
        return;
    }
    let mut kept = vec![];
    for (k, x) in polygon.iter().enumerate() {
        let next = &polygon[(k + 1) % polygon.len()];
        let (here, there) = (beyond(x), beyond(next));
        if here <= 0.0 {
            kept.push(*x);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            kept.push(x + (next - x) * (here / (here - there)));
        }
    }
    *polygon = kept;
}

/// The area of a convex polygon.
fn area(polygon: &[Point]) -> f64 {
    let Some((first, rest)) = polygon.split_first() else { return 0.0 };
    0.5 * rest.windows(2).map(|pair| (pair[0] - first).cross(&(pair[1] - first)).norm()).sum::<f64>()
}

fn facets(position: &[[f64; 3]], radius: &[f64], bonds: &Bonds, ruptures: &[Rupture]) -> Vec<Facet> {
    let neighbours = Neighbours::new(position, radius);
    let diameter = 2.0 * radius.iter().sum::<f64>() / radius.len().max(1) as f64;
    let mut meetings: HashMap<[i64; 3], usize> = HashMap::new();
    let mut list = vec![];
    let mut count = 0;
    for (event, rupture) in ruptures.iter().enumerate() {
        let bond = rupture.bond as usize;
        let mean = bonds.mean_diameter[bond];
        let (middle, normal, mut polygon) = neighbours.face(bonds.pair[bond].map(|k| k as usize), mean);
        let mut nodes = vec![];
        // corners on the cut are not corners of the diagram
        for x in polygon.iter().filter(|x| x.norm() < mean) {
            for cell in cells(middle + x, diameter) {
                let next = count;
                let node = *meetings.entry(cell).or_insert(next);
                count += usize::from(node == next);
                nodes.push(node);
            }
        }
        if nodes.is_empty() {
            // the facet meets no other
            nodes.push(count);
            count += 1;
        }
        nodes.sort_unstable();
        nodes.dedup();
        for side in circle(normal, 0.5 * mean) {
            clip(&mut polygon, side, 0.5 * mean * side.norm());
        }
        list.push(Facet {
            event,
            nodes,
            area: area(&polygon),
            corners: polygon.iter().map(|x| (middle + x).into()).collect(),
            normal: normal.into(),
            crack: 0,
        });
    }
    list
}

/// The cells of the grid that meet the cube of half-width `ONE` mean diameters around a point.
fn cells(x: Point, diameter: f64) -> Vec<[i64; 3]> {
    let ends = |k: usize| [-ONE, ONE].map(|s| ((x[k] / diameter + s) / CELL).floor() as i64);
    let mut cells = vec![[0; 3]];
    for k in 0..3 {
        let [low, high] = ends(k);
        let with = |value: i64| {
            cells.iter().map(move |cell: &[i64; 3]| std::array::from_fn(|c| if c == k { value } else { cell[c] }))
        };
        cells = if low == high { with(low).collect() } else { with(low).chain(with(high)).collect() };
    }
    cells
}

#[cfg(test)]
mod tests;
