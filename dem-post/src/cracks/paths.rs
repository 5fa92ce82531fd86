//! Cracks as lines, in 2D: segments of broken bonds, joined through the voids between the grains.
//!
//! All positions are those when the bonds formed: the crack is drawn in the cemented sample,
//! independent of the later motion of the fragments.
//!
//! * **Segment** of a broken bond: from the middle of the void on one side through its point of
//!   contact to the middle of the void on the other side (the dual edge of the bond). Between equal
//!   disks on a lattice this is the common facet of their Voronoi cells: its length is the diameter
//!   on a square lattice and diameter/√3 on a hexagonal one. Where there is no void (at the edge of
//!   the sample), or where both sides are the same void, the segment is perpendicular to the bond
//!   and ends half the pair's mean diameter from the point of contact.
//! * **Crack**: segments that meet in a void. Two broken bonds of one grain that are separated on
//!   either side by an intact bond do not meet: the material between them is intact.
//! * **Path** of a crack: the longest of the shortest paths through it, over all pairs of its voids
//!   and free ends; among paths of equal length the one whose ends are farthest apart. Branches
//!   count in the length of the crack, not in that of its path.
//! * **Orientation**: of the line between the ends of the path, from 0° to 180°, counter-clockwise
//!   from the first axis. **Tortuosity**: length of the path over the distance of its ends, at
//!   least 1.

use dem_history::{Bonds, Rupture};
use petgraph::graph::NodeIndex;
use serde::Serialize;

use super::longest::{Ways, distance, longest};
use super::modes::Modes;
use super::parts::{Part, groups};
use super::voids::Voids;

/// A broken bond as a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Its index in the list of ruptures.
    pub event: usize,
    /// Its two nodes in the graph of cracks: voids, numbered first, or free ends.
    pub(super) nodes: [usize; 2],
    /// Its points from the left of the bond through the point of contact to the right, m.
    pub line: [[f64; 2]; 3],
    /// Length, m.
    pub length: f64,
    /// Number of its crack, from 0.
    pub crack: usize,
    /// Whether it lies on the path of its crack.
    pub on_path: bool,
}

/// A crack: broken bonds that meet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Crack {
    /// Its number, from 1, the longest first.
    pub number: usize,
    /// Its bonds.
    pub bonds: usize,
    /// Length of all its segments, m.
    pub length: f64,
    /// Bonds on its path.
    pub path_bonds: usize,
    /// Length along its path, m.
    pub path_length: f64,
    /// Distance of the ends of its path, m.
    pub end_to_end: f64,
    /// Direction from end to end, degrees from the first axis, 0 to 180.
    pub orientation: f64,
    /// Length along the path over the distance of its ends.
    pub tortuosity: f64,
    /// Time at which its first bond broke, s.
    pub first: f64,
    /// Time at which its last bond broke, s.
    pub last: f64,
    /// Number of its bonds by mode of rupture.
    pub modes: Modes,
    /// Where the first bond broke, m.
    pub origin: [f64; 2],
    /// Unit vector along the path, towards the end that broke later.
    pub direction: [f64; 2],
}

/// The cracks of a sample, and the segments in the order in which they broke.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paths {
    /// The cracks, the longest first.
    pub cracks: Vec<Crack>,
    /// The segments, in the order of the ruptures.
    pub segments: Vec<Segment>,
}

impl Paths {
    /// Finds the cracks made by `ruptures` in a sample; `position` and `radius` are the centres and
    /// radii of its grains (m) at the formation of `bonds`.
    pub fn find(position: &[[f64; 2]], radius: &[f64], bonds: &Bonds, ruptures: &[Rupture]) -> Self {
        let mut segments = segments(position, radius, bonds, ruptures);
        let groups = groups(parts(&segments));
        let mut cracks = vec![];
        for (number, group) in groups.iter().enumerate() {
            let path = longest_path(&segments, group);
            cracks.push(crack(number + 1, &segments, group, &path, ruptures));
            group.iter().for_each(|&k| segments[k].crack = number);
            path.iter().for_each(|&(k, _)| segments[k].on_path = true);
        }
        Self { cracks, segments }
    }

    /// The segments as parts of cracks.
    pub fn parts(&self) -> impl Iterator<Item = Part<'_>> + Clone {
        parts(&self.segments)
    }
}

fn parts(segments: &[Segment]) -> impl Iterator<Item = Part<'_>> + Clone {
    segments.iter().map(|segment| Part { event: segment.event, nodes: &segment.nodes, size: segment.length })
}

fn segments(position: &[[f64; 2]], radius: &[f64], bonds: &Bonds, ruptures: &[Rupture]) -> Vec<Segment> {
    let unit = |[i, j]: [i32; 2]| {
        let (a, b) = (position[i as usize], position[j as usize]);
        let way = [b[0] - a[0], b[1] - a[1]];
        let length = way[0].hypot(way[1]);
        [way[0] / length, way[1] / length]
    };
    let point = |(pair, gap): (&[i32; 2], &f64)| {
        let (e, at, reach) = (unit(*pair), position[pair[0] as usize], radius[pair[0] as usize] + 0.5 * gap);
        [at[0] + reach * e[0], at[1] + reach * e[1]]
    };
    let points: Vec<[f64; 2]> = bonds.pair.iter().zip(&bonds.rest_gap).map(point).collect();
    let voids = Voids::find(position, &bonds.pair, &points);
    let mut free = voids.centre.len();
    let mut segments = vec![];
    for (event, rupture) in ruptures.iter().enumerate() {
        let bond = rupture.bond as usize;
        let (e, at, [left, right]) = (unit(bonds.pair[bond]), points[bond], voids.beside[bond]);
        let mut end = |void: Option<usize>, side: f64| match void {
            Some(void) if left != right => (void, voids.centre[void]),
            _ => {
                let reach = 0.5 * side * bonds.mean_diameter[bond];
                free += 1;
                (free - 1, [at[0] - reach * e[1], at[1] + reach * e[0]])
            }
        };
        let (a, b) = (end(left, 1.0), end(right, -1.0));
        segments.push(Segment {
            event,
            nodes: [a.0, b.0],
            line: [a.1, at, b.1],
            length: distance(a.1, at) + distance(at, b.1),
            crack: 0,
            on_path: false,
        });
    }
    segments
}

/// The segments from one end of a crack to the other, each with whether it is passed from its first
/// node to its second.
fn longest_path(segments: &[Segment], group: &[usize]) -> Vec<(usize, bool)> {
    let mut nodes: Vec<usize> = group.iter().flat_map(|&k| segments[k].nodes).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let mut ways = Ways::default();
    nodes.iter().for_each(|_| {
        ways.add_node([0.0; 2]);
    });
    for segment in group.iter().map(|&k| &segments[k]) {
        let ends = segment.nodes.map(|node| NodeIndex::new(nodes.partition_point(|&other| other < node)));
        (ways[ends[0]], ways[ends[1]]) = (segment.line[0], segment.line[2]);
        ways.add_edge(ends[0], ends[1], segment.length);
    }
    let Some((start, edges)) = longest(&ways) else { return vec![] };
    let (mut node, mut path) = (nodes[start.index()], vec![]);
    for edge in edges {
        let segment = group[edge.index()];
        let [from, to] = segments[segment].nodes;
        path.push((segment, from == node));
        node = if from == node { to } else { from };
    }
    path
}

fn crack(number: usize, segments: &[Segment], group: &[usize], path: &[(usize, bool)], ruptures: &[Rupture]) -> Crack {
    let place =
        |&(k, forward): &(usize, bool), end: usize| segments[k].line[if forward { 2 * end } else { 2 - 2 * end }];
    let first = group[0];
    // a segment has two ends, so a path has at least one segment
    let alone = (first, true);
    let (head, tail) = (path.first().unwrap_or(&alone), path.last().unwrap_or(&alone));
    let (mut from, mut to) = (place(head, 0), place(tail, 1));
    if segments[head.0].event > segments[tail.0].event {
        std::mem::swap(&mut from, &mut to);
    }
    let end_to_end = distance(from, to);
    let way =
        if end_to_end > 0.0 { [(to[0] - from[0]) / end_to_end, (to[1] - from[1]) / end_to_end] } else { [1.0, 0.0] };
    let path_length = path.iter().map(|&(k, _)| segments[k].length).sum();
    let mut modes = Modes::default();
    group.iter().for_each(|&k| modes.add(ruptures[segments[k].event].mode));
    Crack {
        number,
        bonds: group.len(),
        length: group.iter().map(|&k| segments[k].length).sum(),
        path_bonds: path.len(),
        path_length,
        end_to_end,
        orientation: way[1].atan2(way[0]).to_degrees().rem_euclid(180.0),
        tortuosity: if end_to_end > 0.0 { path_length / end_to_end } else { 1.0 },
        first: ruptures[segments[first].event].time,
        last: ruptures[segments[group[group.len() - 1]].event].time,
        modes,
        origin: segments[first].line[1],
        direction: way,
    }
}

#[cfg(test)]
mod tests;
