//! The longest of the shortest paths through a graph, over all pairs of nodes (its diameter).
//!
//! Dijkstra's search from every node finds it. Few nodes need to be searched. Let e(v), the
//! eccentricity of v, be the distance of the node farthest from v. For any other node w, max(d(v,
//! w), e(v) − d(v, w)) ≤ e(w) ≤ e(v) + d(v, w). A node whose upper bound is below the longest path
//! found so far is skipped. Searches start alternately at the node with the greatest upper bound,
//! which lengthens the longest path, and at the node with the least lower bound, in the middle of
//! the graph, which tightens the upper bounds of all.
//!
//! Source: F. W. Takes and W. A. Kosters, *Computing the eccentricity distribution of large
//! graphs*, Algorithms 6, 2013.

use petgraph::algo::{astar, dijkstra};
use petgraph::graph::{EdgeIndex, NodeIndex, UnGraph};
use petgraph::visit::EdgeRef;

/// Relative difference below which two lengths are equal: round-off of paths of equal length.
const EQUAL: f64 = 1e-9;

/// Nodes are points (m), edges have lengths (m).
pub(super) type Ways = UnGraph<[f64; 2], f64>;

/// Distance of two points, m.
pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Bounds on the eccentricity of a node, and whether it was searched.
#[derive(Clone, Copy)]
struct Bounds {
    least: f64,
    most: f64,
    searched: bool,
}

/// The longest of the shortest paths: its first node and its edges. The graph must be connected.
///
/// Among paths of equal length (to 1e-9) it is the one whose ends are farthest apart, and among
/// those (to 1e-9) the one with the lowest node indices. The path leads from the lower index to the
/// higher. `None` without an edge.
pub(super) fn longest(ways: &Ways) -> Option<(NodeIndex, Vec<EdgeIndex>)> {
    let pairs = farthest_pairs(ways);
    let apart = |&(a, b): &(NodeIndex, NodeIndex)| distance(ways[a], ways[b]);
    let greatest = pairs.iter().map(apart).fold(0.0, f64::max);
    let (start, end) = pairs.into_iter().filter(|pair| apart(pair) >= (1.0 - EQUAL) * greatest).min()?;
    let (_, nodes) = astar(ways, start, |node| node == end, |edge| *edge.weight(), |_| 0.0)?;
    let shortest = |step: &[NodeIndex]| {
        let edges = ways.edges_connecting(step[0], step[1]);
        edges.min_by(|a, b| a.weight().total_cmp(b.weight()).then(a.id().cmp(&b.id()))).map(|edge| edge.id())
    };
    let edges = nodes.windows(2).map(shortest).collect::<Option<Vec<_>>>()?;
    (!edges.is_empty()).then_some((start, edges))
}

/// The pairs of nodes, the lower index first, whose shortest paths are the longest.
fn farthest_pairs(ways: &Ways) -> Vec<(NodeIndex, NodeIndex)> {
    let mut bounds = vec![Bounds { least: 0.0, most: f64::INFINITY, searched: false }; ways.node_count()];
    let (mut pairs, mut longest) = (vec![], 0.0);
    for turn in 0.. {
        let left = bounds.iter().enumerate();
        let left = left.filter(|(_, b)| !b.searched && b.most >= (1.0 - EQUAL) * longest);
        // the first of equal ones
        let next = if turn % 2 == 0 {
            left.min_by(|(_, a), (_, b)| b.most.total_cmp(&a.most))
        } else {
            left.min_by(|(_, a), (_, b)| a.least.total_cmp(&b.least))
        };
        let Some((start, _)) = next else { break };
        let far = dijkstra(ways, NodeIndex::new(start), None, |edge| *edge.weight());
        let far: Vec<f64> = ways.node_indices().map(|node| far.get(&node).copied().unwrap_or(0.0)).collect();
        let reach = far.iter().copied().fold(0.0, f64::max);
        longest = reach.max(longest);
        for (node, (&far, bounds)) in far.iter().zip(&mut bounds).enumerate() {
            if node != start && far >= (1.0 - EQUAL) * longest {
                pairs.push((far, NodeIndex::new(start.min(node)), NodeIndex::new(start.max(node))));
            }
            bounds.most = bounds.most.min(reach + far);
            bounds.least = bounds.least.max(far).max(reach - far);
        }
        bounds[start].searched = true;
    }
    pairs.retain(|(far, ..)| *far >= (1.0 - EQUAL) * longest);
    pairs.into_iter().map(|(_, a, b)| (a, b)).collect()
}

#[cfg(test)]
mod tests {
    use petgraph::algo::floyd_warshall;

    use super::*;

    /// By Floyd and Warshall: the length of the longest of the shortest paths, and the length
    /// between two nodes.
    fn by_force(ways: &Ways) -> (f64, impl Fn(NodeIndex, NodeIndex) -> f64) {
        let all = floyd_warshall(ways, |edge| *edge.weight()).unwrap();
        (all.values().copied().fold(0.0, f64::max), move |a, b| all[&(a, b)])
    }

    fn check(ways: &Ways) {
        let (start, edges) = longest(ways).unwrap();
        let (expected, between) = by_force(ways);
        let length: f64 = edges.iter().map(|edge| ways[*edge]).sum();
        assert!((length - expected).abs() <= 1e-12 * expected, "{length} in place of {expected}");
        let end = edges.iter().fold(start, |at, edge| {
            let (a, b) = ways.edge_endpoints(*edge).unwrap();
            assert!(at == a || at == b, "the way is not one");
            if at == a { b } else { a }
        });
        assert!(start < end);
        // among paths of equal length: the one whose ends are farthest apart
        for a in ways.node_indices() {
            for b in ways.node_indices().filter(|&b| between(a, b) >= (1.0 - EQUAL) * expected) {
                assert!(distance(ways[a], ways[b]) <= (1.0 + 2.0 * EQUAL) * distance(ways[start], ways[end]));
            }
        }
    }

    /// Numbers from 0 to 1 that look random, the same each time (Numerical Recipes).
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// A tree of `nodes` random points with `more` extra edges; lengths are the distances, or all
    /// one.
    fn graph(seed: u64, nodes: usize, more: usize, equal: bool) -> Ways {
        let mut next = random(seed);
        let mut ways = Ways::default();
        for k in 0..nodes {
            ways.add_node([next(), next()]);
            let before = (next() * k as f64) as usize;
            if k > 0 {
                ways.add_edge(NodeIndex::new(before), NodeIndex::new(k), 1.0);
            }
        }
        for _ in 0..more {
            let [a, b] = [(); 2].map(|()| NodeIndex::new((next() * nodes as f64) as usize));
            if a != b {
                ways.add_edge(a, b, 1.0);
            }
        }
        for edge in ways.edge_indices() {
            let (a, b) = ways.edge_endpoints(edge).unwrap();
            ways[edge] = if equal { 1.0 } else { distance(ways[a], ways[b]) };
        }
        ways
    }

    #[test]
    fn of_random_graphs_it_is_that_of_floyd_and_warshall() {
        for seed in 0..300 {
            let nodes = 2 + (seed % 37) as usize;
            check(&graph(seed, nodes, (seed % 5) as usize * nodes / 4, seed % 3 == 0));
        }
    }

    #[test]
    fn two_searches_are_not_enough_where_there_are_loops() {
        // from any node to the farthest, and from there to the farthest: exact in trees only
        let twice = |ways: &Ways| {
            let far = |node| dijkstra(ways, node, None, |edge| *edge.weight());
            let last = |node| far(node).into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0))).unwrap();
            last(last(NodeIndex::new(0)).0).1
        };
        let short = |more: usize| {
            let graphs = (0..100).map(|seed| graph(seed, 30, more, false));
            graphs.filter(|ways| twice(ways) < (1.0 - EQUAL) * by_force(ways).0).count()
        };
        assert_eq!(short(0), 0);
        assert!(short(30) > 10, "{}", short(30));
    }

    #[test]
    fn of_equal_ways_that_with_the_ends_farthest_apart_is_taken() {
        // a ring of six equal edges, drawn as a flat hexagon: opposite corners are three edges
        // apart
        let mut ways = Ways::default();
        let at = [[-3.0, 0.0], [-1.0, 0.5], [1.0, 0.5], [3.0, 0.0], [1.0, -0.5], [-1.0, -0.5]];
        let nodes = at.map(|x| ways.add_node(x));
        (0..6).for_each(|k| {
            ways.add_edge(nodes[k], nodes[(k + 1) % 6], 1.0);
        });
        let (start, edges) = longest(&ways).unwrap();
        assert_eq!((start, edges.len()), (nodes[0], 3));
        check(&ways);
    }

    #[test]
    fn a_large_graph_needs_few_searches() {
        // 100 × 100 places with three quarters of the edges of a square lattice
        let (side, mut next) = (100, random(7));
        let mut ways = Ways::default();
        let nodes: Vec<NodeIndex> =
            (0..side * side).map(|k| ways.add_node([(k % side) as f64, (k / side) as f64])).collect();
        for k in 0..side * side {
            for other in [(k % side + 1 < side).then_some(k + 1), (k + side < side * side).then_some(k + side)] {
                let length = 0.5 + next();
                if let Some(other) = other.filter(|_| next() < 0.75) {
                    ways.add_edge(nodes[k], nodes[other], length);
                }
            }
        }
        let joined = petgraph::algo::kosaraju_scc(&ways).into_iter().max_by_key(Vec::len).unwrap();
        let ways = ways.filter_map(|node, at| joined.contains(&node).then_some(*at), |_, length| Some(*length));
        let began = std::time::Instant::now();
        let (_, edges) = longest(&ways).unwrap();
        eprintln!("{} nodes, {} edges in the path, {:?}", ways.node_count(), edges.len(), began.elapsed());
        // one start in 97 nodes
        let far = |node| dijkstra(&ways, node, None, |edge| *edge.weight()).into_values().fold(0.0, f64::max);
        let starts = ways.node_indices().step_by(97);
        assert!(
            starts.map(far).fold(0.0, f64::max) <= edges.iter().map(|edge| ways[*edge]).sum::<f64>() * (1.0 + 1e-12)
        );
    }
}
