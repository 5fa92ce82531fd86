//! The order in which a large problem is swept: blocks of grains, in parallel.
//!
//! A block is [`BLOCK`] consecutive grains. Contacts within a block come first, block by block: no
//! two blocks share a grain, so they are swept in parallel. Contacts between blocks and at walls
//! come last. Within each part, consecutive contacts share no grain where possible (a greedy
//! colouring), so that a processor need not wait for the previous contact. The order depends on the
//! problem alone: results are the same for any number of threads. A problem of less than two blocks
//! keeps the order of its keys.

use super::link::{Contact, Group};
use super::nodes::{Nodes, Span};
use crate::contact::Law;
use crate::dim::Dim;
use rayon::prelude::*;

/// Number of grains of a block: their velocities fit into a core's own cache.
const BLOCK: usize = 4096;

/// Whether a problem of this many grains is swept by several threads.
pub(crate) fn are_several(grains: usize) -> bool {
    blocks(grains) > 1
}

/// Number of blocks of this many grains; 1 means that contacts are swept in the order of their
/// keys.
fn blocks(grains: usize) -> usize {
    if grains < 2 * BLOCK { 1 } else { grains.div_ceil(BLOCK) }
}

/// The block that holds both bodies of a pair, or the number of blocks if none does.
fn block_of(pair: [u32; 2], grains: usize) -> usize {
    let [i, j] = pair.map(|k| k as usize);
    if j < grains && i / BLOCK == j / BLOCK { i / BLOCK } else { blocks(grains) }
}

/// The order in which the contacts of these sorted pairs are swept; `None` if it is that of the
/// list.
pub(crate) fn order(pairs: impl ExactSizeIterator<Item = [u32; 2]>, grains: usize) -> Option<Vec<u32>> {
    let blocks = blocks(grains);
    if blocks == 1 {
        return None;
    }
    const COLOURS: usize = 64;
    let mut taken = vec![0u64; grains];
    let mut colour = |pair: [u32; 2]| {
        let [i, j] = pair.map(|k| k as usize);
        let beside = taken.get(j).copied().unwrap_or(0);
        let colour = (taken[i] | beside).trailing_ones().min(COLOURS as u32 - 1);
        taken[i] |= 1 << colour;
        if let Some(other) = taken.get_mut(j) {
            *other |= 1 << colour;
        }
        colour as usize
    };
    let bins: Vec<u32> = pairs.map(|pair| (block_of(pair, grains) * COLOURS + colour(pair)) as u32).collect();
    // counting sort, in linear time
    let mut next = vec![0u32; (blocks + 1) * COLOURS + 1];
    bins.iter().for_each(|bin| next[*bin as usize + 1] += 1);
    for bin in 1..next.len() {
        next[bin] += next[bin - 1];
    }
    let mut order = vec![0; bins.len()];
    for (place, bin) in bins.iter().enumerate() {
        let next = &mut next[*bin as usize];
        order[*next as usize] = place as u32;
        *next += 1;
    }
    Some(order)
}

/// Visit every contact of a group, the blocks in parallel.
#[inline]
pub(crate) fn for_each<D: Dim, L: Law>(
    nodes: &mut Nodes<D>,
    group: &mut Group<D, L>,
    visit: impl Fn(&mut Span<D>, &mut Contact<D, L>) + Sync,
) {
    let grains = nodes.grains;
    let number = blocks(grains);
    let mut rest = group.as_mut_slice();
    if number > 1 && !rest.is_empty() {
        let mut parts = Vec::with_capacity(number);
        for (block, all) in nodes.all[..grains].chunks_mut(BLOCK).enumerate() {
            let end = rest.partition_point(|c| block_of(c.link.nodes, grains) <= block);
            let (contacts, others) = rest.split_at_mut(end);
            parts.push((Span { first: block * BLOCK, grains: all.len(), all, drives: &[] }, contacts));
            rest = others;
        }
        parts.into_par_iter().for_each(|(mut span, contacts)| contacts.iter_mut().for_each(|c| visit(&mut span, c)));
    }
    let mut span = nodes.span();
    rest.iter_mut().for_each(|c| visit(&mut span, c));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of a square lattice, sorted, and of each grain in its first row with a wall.
    fn pairs(side: u32) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for k in 0..side * side {
            if k % side + 1 < side {
                pairs.push([k, k + 1]);
            }
            if k / side + 1 < side {
                pairs.push([k, k + side]);
            }
            if k < side {
                pairs.push([k, side * side]);
            }
        }
        pairs
    }

    #[test]
    fn blocks_come_one_after_another_and_what_joins_them_last() {
        let (side, pairs) = (100, pairs(100));
        let grains = side * side;
        let order = order(pairs.iter().copied(), grains).expect("more than one block");
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..pairs.len() as u32), "a permutation");
        let blocks: Vec<usize> = order.iter().map(|k| block_of(pairs[*k as usize], grains)).collect();
        assert!(blocks.is_sorted());
        assert_eq!(blocks.last(), Some(&3));
        // a colour holds no body twice: each contact has the lowest colour that is free at both its
        // bodies
        let inside = order.iter().map(|k| pairs[*k as usize]).filter(|pair| block_of(*pair, grains) == 0);
        let (mut first, mut seen) = (0, std::collections::HashSet::new());
        for pair in inside {
            if !pair.iter().all(|body| seen.insert(*body)) {
                first += 1;
                seen = pair.into_iter().collect();
            }
        }
        assert_eq!(first + 1, 4, "a square lattice has four colours");
        let joining = |p: &&[u32; 2]| p[1] as usize == grains || p[0] as usize / BLOCK != p[1] as usize / BLOCK;
        assert_eq!(blocks.iter().filter(|b| **b == 3).count(), pairs.iter().filter(joining).count());
        // hardly any contact shares a body with the one before
        let shares = |k: &&[u32]| pairs[k[0] as usize].iter().any(|b| pairs[k[1] as usize].contains(b));
        assert!(order.windows(2).filter(shares).count() < pairs.len() / 50);
    }

    #[test]
    fn a_small_problem_keeps_its_order() {
        assert_eq!(order(pairs(90).into_iter(), 90 * 90), None);
    }
}
