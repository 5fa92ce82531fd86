//! Cracks in 2D and in 3D: broken bonds are parts, and parts that share a point belong to one
//! crack.

use petgraph::unionfind::UnionFind;

/// A broken bond as part of a crack.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// Its place in the list of ruptures.
    pub event: usize,
    /// The points that it may share with other parts, at least one.
    pub nodes: &'a [usize],
    /// Its length (m) or area (m²).
    pub size: f64,
}

/// Number of points: one more than the greatest index of a point.
pub(super) fn nodes<'a>(parts: impl Iterator<Item = Part<'a>>) -> usize {
    parts.flat_map(|part| part.nodes.iter().copied()).max().map_or(0, |last| last + 1)
}

/// Joins all points of one part.
pub(super) fn join(points: &mut UnionFind<usize>, nodes: &[usize]) {
    nodes.windows(2).for_each(|pair| {
        points.union(pair[0], pair[1]);
    });
}

/// For each crack, the largest first: the indices of its parts in the list, in order.
pub(super) fn groups<'a>(parts: impl Iterator<Item = Part<'a>> + Clone) -> Vec<Vec<usize>> {
    let count = nodes(parts.clone());
    let mut joined = UnionFind::<usize>::new(count);
    parts.clone().for_each(|part| join(&mut joined, part.nodes));
    // in the order of their first bond, so that cracks of equal size also have a fixed order
    let mut groups: Vec<(f64, Vec<usize>)> = vec![];
    let mut group_of = vec![usize::MAX; count];
    for (k, part) in parts.enumerate() {
        let root = joined.find(part.nodes[0]);
        if group_of[root] == usize::MAX {
            group_of[root] = groups.len();
            groups.push((0.0, vec![]));
        }
        let (size, members) = &mut groups[group_of[root]];
        *size += part.size;
        members.push(k);
    }
    groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    groups.into_iter().map(|(_, members)| members).collect()
}
