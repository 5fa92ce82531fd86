//! The graph of bodies and contacts, and the elimination tree of matrices on it.

use super::rows::Rows;
use crate::linear::Tree;
use std::sync::Arc;

/// Bodies that can move, with their unknowns, and the contacts between them.
#[derive(Debug)]
pub(super) struct Graph {
    pub tree: Tree,
    /// The contact of each element of the tree.
    pub contacts: Vec<usize>,
}

impl Graph {
    /// The graph of these rows; `last` is reused if it is still valid.
    pub fn of(rows: &Rows, last: &mut Option<Arc<Self>>) -> Option<Arc<Self>> {
        let nodes = nodes(rows);
        let node = |first: usize| nodes.partition_point(|(start, _)| *start < first);
        let (mut elements, mut contacts) = (Vec::with_capacity(rows.list.len()), Vec::with_capacity(rows.list.len()));
        for (c, row) in rows.list.iter().enumerate() {
            let element = match row.count {
                [0, 0] => continue,
                [0, _] => [node(row.at[1]); 2],
                [_, 0] => [node(row.at[0]); 2],
                _ => row.at.map(node),
            };
            elements.push(element);
            contacts.push(c);
        }
        let sizes: Vec<usize> = nodes.into_iter().map(|(_, size)| size).collect();
        if !last.as_ref().is_some_and(|last| last.tree.is_of(&sizes, &elements)) {
            *last = Tree::new(sizes, elements).map(|tree| Arc::new(Self { tree, contacts }));
        }
        last.clone()
    }
}

/// First unknown and number of unknowns of each node, in ascending order. An unknown without a
/// contact is a node of its own.
fn nodes(rows: &Rows) -> Vec<(usize, usize)> {
    let mut counts = vec![1; rows.unknowns];
    for row in &rows.list {
        for side in (0..2).filter(|side| row.count[*side] > 0) {
            counts[row.at[side]] = row.count[side];
        }
    }
    let mut nodes = Vec::new();
    let mut next = 0;
    while next < rows.unknowns {
        nodes.push((next, counts[next]));
        next += counts[next];
    }
    nodes
}
