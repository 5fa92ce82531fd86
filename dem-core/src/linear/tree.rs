//! Symbolic factorisation: the fronts in which a matrix on a graph is factorised.
//!
//! Order: nested dissection (George, SIAM J. Numer. Anal. 10, 1973; Karypis & Kumar, SIAM J. Sci.
//! Comput. 20, 1998). Fronts: nodes of the elimination tree, merged with their parents if the extra
//! operations on zeros cost less than a separate front (Liu, SIAM Rev. 34, 1992).

use feral_metis::{CscPattern, metis_order};

/// Overhead of a front (floating-point operations): merging fronts pays if it adds less work.
/// Measured: the time of a front of one disk, 1 to 2 µs, at some 5 operations a nanosecond.
const WORK_OF_A_FRONT: f64 = 8e3;
/// Share by which merged fronts may take more operations than separate ones.
const MORE_WORK: f64 = 0.1;

/// Largest share of all operations in one part, so that many threads are busy to the end.
const SHARE_OF_A_PART: f64 = 1.0 / 32.0;
/// Operations of a part that are worth a task: some 4 ms.
const WORK_OF_A_PART: f64 = 2e7;

/// One element in a front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Number of the element.
    pub element: usize,
    /// Where the unknowns of its two nodes begin in the front.
    pub at: [usize; 2],
}

/// Unknowns that are eliminated together.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    /// The part that it belongs to, counted from level to level.
    pub part: usize,
    /// The unknowns that are eliminated here, then those that they are coupled to, as places among
    /// the unknowns of the part.
    pub unknowns: Vec<usize>,
    /// How many are eliminated.
    pub pivots: usize,
    /// The elements that are added here.
    pub elements: Vec<Place>,
    /// The front that receives the Schur complement, and the places of the border there.
    pub parent: Option<usize>,
    pub up: Vec<usize>,
    /// The fronts whose parent is this one.
    pub children: Vec<usize>,
}

impl Front {
    /// Number of unknowns left to later fronts.
    pub fn border(&self) -> usize {
        self.unknowns.len() - self.pivots
    }

    /// Floating-point operations of its factorisation.
    fn operations(&self) -> f64 {
        work(self.pivots as f64, self.border() as f64)
    }
}

/// Fronts that one task works on.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// The fronts, each after those below it.
    pub fronts: Vec<usize>,
    /// The unknowns that are eliminated in these fronts, then those that they are coupled to.
    pub unknowns: Vec<usize>,
    /// How many are eliminated.
    pub pivots: usize,
}

/// Nodes, elements, and the fronts made of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    /// Number of unknowns of each node.
    sizes: Vec<usize>,
    /// Nodes of each element; an element of one node names it twice.
    elements: Vec<[usize; 2]>,
    pub(super) fronts: Vec<Front>,
    /// The parts of a level are independent of each other and need those below it: first subtrees,
    /// then the fronts above them, each of them a part.
    pub(super) levels: Vec<Vec<Part>>,
    unknowns: usize,
}

impl Tree {
    /// The fronts for nodes with `sizes` unknowns each, numbered consecutively, and `elements`
    /// between them; an element of one node names it twice. None if no order is found.
    pub fn new(sizes: Vec<usize>, elements: Vec<[usize; 2]>) -> Option<Self> {
        let unknowns = sizes.iter().sum();
        let mut tree = Self { sizes, elements, fronts: Vec::new(), levels: Vec::new(), unknowns };
        let adjacency = tree.adjacency();
        let order = ordered(&adjacency)?;
        tree.fronts = tree.joined(&order, &adjacency);
        tree.divide();
        Some(tree)
    }

    /// Whether it is the tree of these nodes and elements.
    pub fn is_of(&self, sizes: &[usize], elements: &[[usize; 2]]) -> bool {
        self.sizes == sizes && self.elements == elements
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Floating-point operations of a factorisation.
    pub fn operations(&self) -> f64 {
        self.fronts.iter().map(Front::operations).sum()
    }

    /// Unknowns of an element.
    pub fn width(&self, element: usize) -> usize {
        self.widths(element).iter().sum()
    }

    /// Number of unknowns of each node, and the nodes of each element.
    pub fn nodes_and_elements(&self) -> (&[usize], &[[usize; 2]]) {
        (&self.sizes, &self.elements)
    }

    /// Numbers of unknowns of the two nodes of an element; zero if the second node is the first.
    pub(super) fn widths(&self, element: usize) -> [usize; 2] {
        let [a, b] = self.elements[element];
        [self.sizes[a], if a == b { 0 } else { self.sizes[b] }]
    }

    fn adjacency(&self) -> Vec<Vec<usize>> {
        let mut near = vec![Vec::new(); self.sizes.len()];
        for [a, b] in self.elements.iter().filter(|[a, b]| a != b) {
            near[*a].push(*b);
            near[*b].push(*a);
        }
        for list in &mut near {
            list.sort_unstable();
            list.dedup();
        }
        near
    }

    /// The fronts of an elimination order.
    fn joined(&self, order: &[usize], adjacency: &[Vec<usize>]) -> Vec<Front> {
        let n = order.len();
        let mut position = vec![0; n];
        order.iter().enumerate().for_each(|(k, node)| position[*node] = k);
        // for each position: the later nodes that it is coupled to at its elimination, and its
        // children in the tree
        let mut coupled: Vec<Vec<usize>> = Vec::with_capacity(n);
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); n];
        let mut seen = vec![usize::MAX; n];
        for k in 0..n {
            seen[k] = k;
            let mut list = Vec::new();
            let own = adjacency[order[k]].iter().map(|node| position[*node]).filter(|p| *p > k);
            let left = children[k].iter().flat_map(|child| coupled[*child].iter().copied());
            for p in own.chain(left) {
                if seen[p] != k {
                    seen[p] = k;
                    list.push(p);
                }
            }
            list.sort_unstable();
            if let Some(parent) = list.first() {
                children[*parent].push(k);
            }
            coupled.push(list);
        }
        // merge children where it pays; a group is identified by its last node
        let size = |k: usize| self.sizes[order[k]] as f64;
        let border: Vec<f64> = coupled.iter().map(|list| list.iter().map(|p| size(*p)).sum()).collect();
        let mut members: Vec<Vec<usize>> = (0..n).map(|k| vec![k]).collect();
        let mut pivots: Vec<f64> = (0..n).map(size).collect();
        for k in 0..n {
            let mut open = std::mem::take(&mut children[k]);
            open.sort_by(|a, b| border[*b].total_cmp(&border[*a]).then(a.cmp(b)));
            for child in open {
                let apart = work(pivots[child], border[child]) + work(pivots[k], border[k]);
                let together = work(pivots[child] + pivots[k], border[k]);
                if together <= (1.0 + MORE_WORK) * apart + WORK_OF_A_FRONT {
                    pivots[k] += pivots[child];
                    let of_child = std::mem::take(&mut members[child]);
                    members[k].extend(of_child);
                }
            }
        }
        let mut front_of = vec![0; n];
        let mut tops = Vec::new();
        for k in 0..n {
            for member in &members[k] {
                front_of[*member] = tops.len();
            }
            if !members[k].is_empty() {
                tops.push(k);
            }
        }
        let mut fronts: Vec<Front> = Vec::with_capacity(tops.len());
        let firsts = self.firsts();
        for top in &tops {
            let mut own = std::mem::take(&mut members[*top]);
            own.sort_unstable();
            let mut front = Front::default();
            for p in own.iter().chain(&coupled[*top]) {
                let node = order[*p];
                front.unknowns.extend(firsts[node]..firsts[node] + self.sizes[node]);
            }
            front.pivots = own.iter().map(|p| self.sizes[order[*p]]).sum();
            front.parent = coupled[*top].first().map(|p| front_of[*p]);
            fronts.push(front);
        }
        self.place(&mut fronts, &firsts, |node| front_of[position[node]]);
        fronts
    }

    /// Divide the fronts into parts and levels: subtrees that are at most a share of the work,
    /// several of them in a part if they are small, and the fronts above them.
    fn divide(&mut self) {
        let mut subtree: Vec<f64> = self.fronts.iter().map(Front::operations).collect();
        // the parents come after their children
        for (k, front) in self.fronts.iter().enumerate() {
            if let Some(parent) = front.parent {
                subtree[parent] += subtree[k];
            }
        }
        let most = (SHARE_OF_A_PART * self.operations()).max(WORK_OF_A_PART);
        let top: Vec<bool> = subtree.iter().map(|work| *work > most).collect();
        let (mut subtrees, mut filled) = (vec![Vec::new()], 0.0);
        let mut of_root = vec![0; self.fronts.len()];
        for k in (0..self.fronts.len()).rev().filter(|k| !top[*k]) {
            let inside = self.fronts[k].parent.filter(|parent| !top[*parent]);
            of_root[k] = match inside {
                Some(parent) => of_root[parent],
                None => {
                    if filled + subtree[k] > most && filled > 0.0 {
                        subtrees.push(Vec::new());
                        filled = 0.0;
                    }
                    filled += subtree[k];
                    subtrees.len() - 1
                }
            };
        }
        (0..self.fronts.len()).filter(|k| !top[*k]).for_each(|k| subtrees[of_root[k]].push(k));
        let mut levels = vec![subtrees];
        let mut above = vec![0; self.fronts.len()];
        for (k, front) in self.fronts.iter().enumerate() {
            let level = if top[k] { above[k].max(1) } else { 0 };
            if top[k] {
                levels.resize_with(levels.len().max(level + 1), Vec::new);
                levels[level].push(vec![k]);
            }
            if let Some(parent) = front.parent {
                above[parent] = above[parent].max(level + 1);
            }
        }
        let (mut at, mut made) = (vec![usize::MAX; self.unknowns], 0);
        for parts in levels {
            let numbers = made..made + parts.len();
            made = numbers.end;
            let parts = parts.into_iter().zip(numbers).map(|(fronts, number)| self.part(fronts, number, &mut at));
            let parts = parts.collect();
            self.levels.push(parts);
        }
    }

    /// The part of these fronts, with number `number`; `at` has no place for any unknown.
    fn part(&mut self, fronts: Vec<usize>, number: usize, at: &mut [usize]) -> Part {
        let pivots = |k: &usize| self.fronts[*k].unknowns[..self.fronts[*k].pivots].iter().copied();
        let mut unknowns: Vec<usize> = fronts.iter().flat_map(pivots).collect();
        let pivots = unknowns.len();
        unknowns.iter().enumerate().for_each(|(place, unknown)| at[*unknown] = place);
        for k in &fronts {
            let front = &mut self.fronts[*k];
            front.part = number;
            for unknown in &mut front.unknowns {
                if at[*unknown] == usize::MAX {
                    at[*unknown] = unknowns.len();
                    unknowns.push(*unknown);
                }
                *unknown = at[*unknown];
            }
        }
        unknowns.iter().for_each(|unknown| at[*unknown] = usize::MAX);
        Part { fronts, unknowns, pivots }
    }

    fn firsts(&self) -> Vec<usize> {
        let next = |at: &mut usize, size: &usize| {
            let first = *at;
            *at += size;
            Some(first)
        };
        self.sizes.iter().scan(0, next).collect()
    }

    /// Set the places of elements and borders in the fronts.
    fn place(&self, fronts: &mut [Front], firsts: &[usize], front_of: impl Fn(usize) -> usize) {
        let mut elements = vec![Vec::new(); fronts.len()];
        for (e, [a, b]) in self.elements.iter().enumerate() {
            elements[front_of(*a).min(front_of(*b))].push(e);
        }
        let mut children = vec![Vec::new(); fronts.len()];
        for (k, front) in fronts.iter().enumerate() {
            if let Some(parent) = front.parent {
                children[parent].push(k);
            }
        }
        let mut at = vec![usize::MAX; self.unknowns];
        for k in 0..fronts.len() {
            fronts[k].unknowns.iter().enumerate().for_each(|(place, unknown)| at[*unknown] = place);
            let places =
                |e: usize| self.elements[e].map(|node| if self.sizes[node] > 0 { at[firsts[node]] } else { 0 });
            fronts[k].elements = elements[k].iter().map(|e| Place { element: *e, at: places(*e) }).collect();
            for child in std::mem::take(&mut children[k]) {
                let border = &fronts[child].unknowns[fronts[child].pivots..];
                fronts[child].up = border.iter().map(|unknown| at[*unknown]).collect();
                fronts[k].children.push(child);
            }
        }
    }
}

/// Floating-point operations of a front.
fn work(pivots: f64, border: f64) -> f64 {
    2.0 * pivots * (pivots * pivots / 3.0 + pivots * border + border * border)
}

/// An elimination order of the nodes.
fn ordered(adjacency: &[Vec<usize>]) -> Option<Vec<usize>> {
    let n = adjacency.len();
    let mut starts: Vec<i32> = vec![0];
    let mut rows = Vec::new();
    for (k, near) in adjacency.iter().enumerate() {
        // with the diagonal, in ascending order
        let (before, after) = near.split_at(near.partition_point(|p| *p < k));
        rows.extend(before.iter().chain([&k]).chain(after).map(|p| *p as i32));
        starts.push(rows.len() as i32);
    }
    if n == 0 {
        return Some(Vec::new());
    }
    let order = metis_order(&CscPattern::new(n, &starts, &rows)?).ok()?;
    Some(order.iter().map(|k| *k as usize).collect())
}
