use dem_history::RuptureMode;

use petgraph::algo::floyd_warshall;
use petgraph::graph::UnGraph;

use super::super::front::{fronts, growth};
use super::*;

const D: f64 = 2e-3;

struct Lattice {
    position: Vec<[f64; 2]>,
    radius: Vec<f64>,
    bonds: Bonds,
}

/// Bonds between all disks of diameter D that touch.
fn lattice(position: Vec<[f64; 2]>) -> Lattice {
    let n = position.len();
    let touch = |i: usize, j: usize| distance(position[i], position[j]) < 1.001 * D;
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let pair: Vec<[i32; 2]> = pairs.filter(|&(i, j)| touch(i, j)).map(|(i, j)| [i as i32, j as i32]).collect();
    let b = pair.len();
    let bonds = Bonds { pair, rest_gap: vec![0.0; b], mean_diameter: vec![D; b], ..Bonds::default() };
    Lattice { radius: vec![0.5 * D; n], position, bonds }
}

fn square(columns: usize, rows: usize) -> Lattice {
    lattice((0..columns * rows).map(|k| [D * (k % columns) as f64, D * (k / columns) as f64]).collect())
}

fn hexagonal(columns: usize, rows: usize) -> Lattice {
    let place = |k: usize| {
        let (column, row) = ((k % columns) as f64, k / columns);
        [D * (column + 0.5 * (row % 2) as f64), D * 0.75f64.sqrt() * row as f64]
    };
    lattice((0..columns * rows).map(place).collect())
}

impl Lattice {
    fn point(&self, bond: usize) -> [f64; 2] {
        let [a, b] = self.bonds.pair[bond].map(|grain| self.position[grain as usize]);
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    }

    /// The bonds whose points of contact lie within a strip, in order of x.
    fn crossing(&self, x: std::ops::Range<f64>, y: std::ops::Range<f64>) -> Vec<usize> {
        let inside = |&b: &usize| x.contains(&self.point(b)[0]) && y.contains(&self.point(b)[1]);
        let mut found: Vec<usize> = (0..self.bonds.len()).filter(inside).collect();
        found.sort_by(|&a, &b| self.point(a)[0].total_cmp(&self.point(b)[0]));
        found
    }

    fn paths(&self, ruptures: &[Rupture]) -> Paths {
        Paths::find(&self.position, &self.radius, &self.bonds, ruptures)
    }
}

fn rupture(bond: usize, step: i64, round: i32) -> Rupture {
    Rupture {
        step,
        time: step as f64 * 1e-3,
        point: [0.0; 3],
        normal_force: 0.0,
        tangential_force: 0.0,
        moment: 0.0,
        twist: 0.0,
        energy: 0.0,
        round,
        bond: bond as i32,
        pair: [0, 1],
        mode: RuptureMode::Tension,
    }
}

fn one_a_step(bonds: &[usize]) -> Vec<Rupture> {
    bonds.iter().enumerate().map(|(k, &bond)| rupture(bond, k as i64, 0)).collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9 * b.abs().max(1e-6)
}

#[test]
fn a_row_of_upright_bonds_is_one_straight_crack() {
    let sample = square(8, 4);
    let bonds = sample.crossing(0.0..13e-3, 2.5e-3..3.5e-3);
    // seven bonds, the first at the edge of the sample: half a diameter outside, and a facet of one
    // diameter each
    assert_eq!(bonds.len(), 7);
    let paths = sample.paths(&one_a_step(&bonds));
    assert_eq!(paths.cracks.len(), 1);
    let crack = &paths.cracks[0];
    assert_eq!((crack.bonds, crack.path_bonds, crack.modes.tension), (7, 7, 7));
    assert!(close(crack.length, 7.0 * D) && close(crack.end_to_end, 7.0 * D), "{crack:?}");
    assert!(close(crack.tortuosity, 1.0));
    assert!(crack.orientation.abs() < 1e-9 || (crack.orientation - 180.0).abs() < 1e-9);
    assert_eq!((crack.first, crack.last), (0.0, 6e-3));
}

#[test]
fn a_crack_between_hexagonal_rows_is_a_zigzag() {
    let sample = hexagonal(9, 4);
    let half = 0.5 * 0.75f64.sqrt() * D;
    let bonds = sample.crossing(2e-3..14e-3, 2.9 * half..3.1 * half);
    let paths = sample.paths(&one_a_step(&bonds));
    assert_eq!((paths.cracks.len(), bonds.len() % 2), (1, 0));
    let crack = &paths.cracks[0];
    // the facet of a hexagon is d/√3 long, and inclined by 30°
    assert!(close(crack.length, bonds.len() as f64 * D / 3f64.sqrt()), "{crack:?}");
    assert!(close(crack.tortuosity, 2.0 / 3f64.sqrt()));
    assert!(close(crack.end_to_end, 0.5 * bonds.len() as f64 * D));
}

#[test]
fn bonds_join_only_through_a_void() {
    let sample = square(8, 4);
    let row = sample.crossing(0.0..13e-3, 2.5e-3..3.5e-3);
    // the third is intact, so its two neighbours share no void
    let paths = sample.paths(&one_a_step(&[row[1], row[3]]));
    assert_eq!(paths.cracks.len(), 2);
    // two bonds of one grain, upright and level, share the void in the corner between them
    let level = sample.crossing(2.5e-3..3.5e-3, 1.9e-3..2.1e-3)[0];
    let paths = sample.paths(&one_a_step(&[row[1], level]));
    assert_eq!(paths.cracks.len(), 1);
    assert!(close(paths.cracks[0].path_length, 2.0 * D));
    assert!(close(paths.cracks[0].tortuosity, 2f64.sqrt()), "a right angle");
    // two opposite bonds of one grain do not meet: its two others hold
    let across = sample.crossing(3.9e-3..4.1e-3, 0.0..4e-3);
    assert_eq!(across.len(), 2);
    assert_eq!(sample.paths(&one_a_step(&across)).cracks.len(), 2);
}

#[test]
fn a_branch_is_no_part_of_the_path() {
    let sample = square(8, 6);
    let mut bonds = sample.crossing(1e-3..15e-3, 4.5e-3..5.5e-3);
    let trunk = bonds.len();
    bonds.extend(sample.crossing(6.5e-3..7.5e-3, 5.9e-3..6.1e-3));
    let paths = sample.paths(&one_a_step(&bonds));
    let crack = &paths.cracks[0];
    assert_eq!((paths.cracks.len(), crack.bonds, crack.path_bonds), (1, trunk + 1, trunk));
    assert!(close(crack.length - crack.path_length, D));
    assert!(!paths.segments[trunk].on_path);
}

#[test]
fn the_only_bond_is_as_long_as_its_mean_diameter() {
    let pair = square(2, 1);
    let paths = pair.paths(&one_a_step(&[0]));
    assert!(close(paths.cracks[0].length, D));
    assert!(close(paths.cracks[0].orientation, 90.0));
}

#[test]
fn turning_the_sample_turns_the_crack() {
    let mut sample = hexagonal(9, 6);
    let bonds = sample.crossing(3e-3..11e-3, 3e-3..6e-3);
    let before = sample.paths(&one_a_step(&bonds));
    let (sin, cos) = 0.7f64.sin_cos();
    for [x, y] in &mut sample.position {
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
    let after = sample.paths(&one_a_step(&bonds));
    assert_eq!(before.cracks.len(), after.cracks.len());
    // where two paths are equally long, another may be chosen, but its length is the same
    for (before, after) in before.cracks.iter().zip(&after.cracks) {
        assert!(close(after.length, before.length) && close(after.path_length, before.path_length));
        assert_eq!(after.bonds, before.bonds);
    }
    let one = hexagonal(9, 4).paths(&one_a_step(&[3])).cracks[0].orientation;
    let mut tilted = hexagonal(9, 4);
    for [x, y] in &mut tilted.position {
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
    let turned = tilted.paths(&one_a_step(&[3])).cracks[0].orientation;
    assert!(
        ((turned - one - 0.7f64.to_degrees()).rem_euclid(180.0))
            .min((one + 0.7f64.to_degrees() - turned).rem_euclid(180.0))
            < 1e-9
    );
}

#[test]
fn the_front_runs_at_one_diameter_a_step() {
    let sample = square(8, 4);
    let bonds = sample.crossing(1e-3..13e-3, 2.5e-3..3.5e-3);
    let ruptures = one_a_step(&bonds);
    let front = fronts(&sample.paths(&ruptures), &ruptures);
    assert_eq!(front.len(), bonds.len());
    assert_eq!(front[0].front_speed, None);
    for (k, row) in front.iter().enumerate() {
        assert!(close(row.front, (k as f64 + 0.5) * D) && close(row.back, -0.5 * D), "{row:?}");
        assert!(k == 0 || close(row.front_speed.unwrap(), D / 1e-3));
        assert!(k == 0 || row.back_speed.unwrap().abs() < 1e-12);
    }
}

#[test]
fn rounds_of_one_step_are_rows_without_speed() {
    let sample = square(8, 4);
    let bonds = sample.crossing(1e-3..13e-3, 2.5e-3..3.5e-3);
    // the first alone, then two in one round, then one in the next round of the same step
    let ruptures = [rupture(bonds[0], 1, 0), rupture(bonds[1], 3, 0), rupture(bonds[2], 3, 0), rupture(bonds[3], 3, 1)];
    let front = fronts(&sample.paths(&ruptures), &ruptures);
    assert_eq!(front.iter().map(|row| row.bonds).collect::<Vec<_>>(), [1, 3, 4]);
    assert_eq!(front[1].front_speed, None);
    assert!(close(front[2].front_speed.unwrap(), 3.0 * D / 2e-3));
}

#[test]
fn cracks_that_meet_grow_by_each_other() {
    let sample = square(8, 4);
    let bonds = sample.crossing(1e-3..13e-3, 2.5e-3..3.5e-3);
    // two ends of a row, then what lies between them
    let ruptures = one_a_step(&[bonds[0], bonds[1], bonds[3], bonds[2]]);
    let growth = growth(sample.paths(&ruptures).parts(), &ruptures);
    assert_eq!(growth.iter().map(|row| row.cracks).collect::<Vec<_>>(), [1, 1, 2, 1]);
    for (row, (all, longest)) in growth.iter().zip([(1.0, 1.0), (2.0, 2.0), (3.0, 2.0), (4.0, 4.0)]) {
        assert!(close(row.size, all * D) && close(row.largest, longest * D), "{row:?}");
    }
}

#[test]
fn the_growth_ends_with_the_cracks_of_the_table() {
    let sample = hexagonal(12, 9);
    // every third bond, in an arbitrary order
    let count = sample.bonds.len();
    let bonds: Vec<usize> = (0..count / 3).map(|k| (k * 3 * 17) % count).collect();
    let mut seen = bonds.clone();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), bonds.len());
    let ruptures = one_a_step(&bonds);
    let paths = sample.paths(&ruptures);
    let end = *growth(paths.parts(), &ruptures).last().unwrap();
    assert_eq!((end.cracks, end.bonds), (paths.cracks.len(), bonds.len()));
    assert!(close(end.largest, paths.cracks[0].length));
    assert!(close(end.size, paths.cracks.iter().map(|crack| crack.length).sum()));
    // a path is no longer than its crack and no shorter than the distance of its ends
    for crack in &paths.cracks {
        assert!(crack.path_length <= crack.length * (1.0 + 1e-12) && crack.tortuosity >= 1.0 - 1e-12, "{crack:?}");
    }
}

#[test]
fn the_path_of_a_crack_with_loops_is_the_longest_of_all_pairs() {
    // five of six bonds, in two arbitrary orders: many loops
    for (lattice, factor) in [(hexagonal(14, 11), 17), (square(16, 13), 29)] {
        let count = lattice.bonds.len();
        let ruptures = one_a_step(&(0..5 * count / 6).map(|k| (k * factor) % count).collect::<Vec<_>>());
        let paths = lattice.paths(&ruptures);
        let crack = &paths.cracks[0];
        let members: Vec<&Segment> = paths.segments.iter().filter(|segment| segment.crack == 0).collect();
        let edges: Vec<_> = members.iter().map(|s| (s.nodes[0] as u32, s.nodes[1] as u32, s.length)).collect();
        let graph = UnGraph::<(), f64>::from_edges(&edges);
        let all = floyd_warshall(&graph, |edge| *edge.weight()).unwrap();
        // nodes of other cracks are never reached
        let reached = all.iter().filter(|(_, length)| **length < 1.0);
        let longest = reached.map(|(_, length)| *length).fold(0.0, f64::max);
        assert!(close(crack.path_length, longest), "{} in place of {longest}", crack.path_length);
        // the path is one line between two ends whose distance is the reported one
        let on_path: Vec<&&Segment> = members.iter().filter(|segment| segment.on_path).collect();
        assert!(close(on_path.iter().map(|segment| segment.length).sum(), longest));
        let mut ends: Vec<(usize, [f64; 2])> =
            on_path.iter().flat_map(|s| [(s.nodes[0], s.line[0]), (s.nodes[1], s.line[2])]).collect();
        ends.sort_by_key(|(node, _)| *node);
        let ends: Vec<_> = ends.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1).flatten().collect();
        assert!(ends.len() == 2 && close(distance(ends[0].1, ends[1].1), crack.end_to_end), "{ends:?}");
        let loops = members.len() + 1 - nodes_of(&members);
        assert!(loops > 20, "{loops} loops");
    }
}

fn nodes_of(segments: &[&Segment]) -> usize {
    let mut nodes: Vec<usize> = segments.iter().flat_map(|segment| segment.nodes).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes.len()
}
