//! LU factors over the fronts of a [`Tree`], with pivoting within each front.
//!
//! The parts of the tree are independent and are computed in parallel. The fronts above them follow
//! one after the other; the columns or rows of a large front are shared among threads. The
//! operations and their order depend on the tree alone, so the result is the same for any number of
//! threads.

use super::front_values::{FrontValues, Tiles, in_chunks};
use super::tree::{Front, Part, Tree};
use crate::threads::among_threads;
use rayon::prelude::*;

/// Rows of a large front that one task of a triangular solve updates.
const ROWS: usize = 512;

/// The factors of a matrix; the next factorisation reuses their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lu {
    /// In the order of the tree's fronts.
    fronts: Vec<Factors>,
}

/// The factors of a front with n unknowns, of which p are pivots.
#[derive(Clone, Debug, Default)]
struct Factors {
    /// Columns of the pivots (n each): L and U of the pivots, L of the border below.
    columns: Vec<f64>,
    /// U of the border: rows of the pivots in the columns of the border (p each).
    across: Vec<f64>,
    /// Rows of the front in the order in which they became pivots.
    rows: Vec<usize>,
}

/// Schur complements that wait for the front above, of the fronts from `first` on.
struct Waiting {
    first: usize,
    of: Vec<Vec<f64>>,
}

impl Waiting {
    fn between(first: usize, last: usize) -> Self {
        Self { first, of: vec![Vec::new(); last + 1 - first] }
    }

    fn of(&mut self, front: usize) -> &mut Vec<f64> {
        &mut self.of[front - self.first]
    }
}

impl Lu {
    /// Factorise 1 + Σ of all elements; `element` writes the matrix of an element, row by row, over
    /// the unknowns of its first node and then its second. Returns the sign of the determinant;
    /// none if a pivot is zero or not finite.
    pub fn factorise(&mut self, tree: &Tree, element: impl Fn(usize, &mut [f64]) + Send + Sync) -> Option<f64> {
        among_threads(tree.parts.len() > 1, || self.factorise_parts(tree, element))
    }

    fn factorise_parts(&mut self, tree: &Tree, element: impl Fn(usize, &mut [f64]) + Send + Sync) -> Option<f64> {
        self.fronts.resize_with(tree.fronts.len(), Factors::default);
        let mut lists: Vec<Vec<(usize, &mut Factors)>> = tree.parts.iter().map(|_| Vec::new()).collect();
        for (k, factors) in self.fronts.iter_mut().enumerate() {
            lists[tree.fronts[k].part].push((k, factors));
        }
        let top = lists.pop().unwrap_or_default();
        let below = in_parallel(lists, |list| {
            let ends = list.first().zip(list.last()).map_or([0; 2], |(first, last)| [first.0, last.0]);
            let mut waiting = Waiting::between(ends[0], ends[1]);
            let sign = eliminate(tree, list, &mut waiting, &element)?;
            Some((sign, waiting))
        });
        let mut waiting = Waiting::between(0, tree.fronts.len());
        let mut sign = 1.0;
        for part in below {
            let (of_part, left) = part?;
            sign *= of_part;
            for (k, rest) in (left.first..).zip(left.of).filter(|(_, rest)| !rest.is_empty()) {
                *waiting.of(k) = rest;
            }
        }
        Some(sign * eliminate(tree, top, &mut waiting, &element)?)
    }

    /// x ← (L U)⁻¹ x.
    pub fn solve(&self, tree: &Tree, x: &mut [f64]) {
        among_threads(tree.parts.len() > 1, || self.solve_parts(tree, x));
    }

    fn solve_parts(&self, tree: &Tree, x: &mut [f64]) {
        let Some((top, below)) = tree.parts.split_last() else { return };
        let mut solved = in_parallel(below.iter().collect(), |part| {
            let mut own: Vec<f64> = part.unknowns[..part.pivots].iter().map(|at| x[*at]).collect();
            own.resize(part.unknowns.len(), 0.0);
            self.forward(tree, part, &mut own);
            own
        });
        for (part, own) in below.iter().zip(&solved) {
            part.unknowns.iter().zip(own).skip(part.pivots).for_each(|(at, change)| x[*at] += change);
        }
        let mut own: Vec<f64> = top.unknowns.iter().map(|at| x[*at]).collect();
        self.forward(tree, top, &mut own);
        self.backward(tree, top, &mut own);
        top.unknowns.iter().zip(&own).for_each(|(at, value)| x[*at] = *value);
        in_parallel(below.iter().zip(&mut solved).collect(), |(part, own)| {
            own.iter_mut().zip(&part.unknowns).skip(part.pivots).for_each(|(value, at)| *value = x[*at]);
            self.backward(tree, part, own);
        });
        for (part, own) in below.iter().zip(&solved) {
            part.unknowns[..part.pivots].iter().zip(own).for_each(|(at, value)| x[*at] = *value);
        }
    }

    /// x ← L⁻¹ x in a part; changes the unknowns beyond its pivots by what it moves there.
    fn forward(&self, tree: &Tree, part: &Part, x: &mut [f64]) {
        let mut line = Vec::new();
        part.fronts.iter().for_each(|k| self.fronts[*k].forward(&tree.fronts[*k], x, &mut line));
    }

    /// x ← U⁻¹ x in a part, from the unknowns beyond its pivots.
    fn backward(&self, tree: &Tree, part: &Part, x: &mut [f64]) {
        let mut line = Vec::new();
        part.fronts.iter().rev().for_each(|k| self.fronts[*k].backward(&tree.fronts[*k], x, &mut line));
    }
}

/// `work` on each item, in parallel if there are several; results in the order of the items.
fn in_parallel<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
    match items.len() {
        0 | 1 => items.into_iter().map(work).collect(),
        _ => items.into_par_iter().map(work).collect(),
    }
}

/// Factorise fronts, each after those below it. Returns the sign of the determinant of their
/// pivots; none if one is zero or not finite.
fn eliminate(
    tree: &Tree,
    list: Vec<(usize, &mut Factors)>,
    waiting: &mut Waiting,
    element: &(impl Fn(usize, &mut [f64]) + Sync),
) -> Option<f64> {
    // memory of Schur complements that were taken over
    let mut spare: Vec<Vec<f64>> = Vec::new();
    let (mut sign, mut matrix) = (1.0, Vec::new());
    for (k, factors) in list {
        let front = &tree.fronts[k];
        let (n, p, b) = (front.unknowns.len(), front.pivots, front.border());
        zeros(&mut factors.columns, n * p);
        zeros(&mut factors.across, p * b);
        let (columns, across) = (&mut factors.columns, &mut factors.across);
        let mut rest = spare.pop().unwrap_or_default();
        zeros(&mut rest, b * b);
        let mut values = FrontValues { n, p, columns, across, rest };
        (0..p).for_each(|d| *values.at(d, d) = 1.0);
        for place in &front.elements {
            let [first, second] = tree.widths(place.element);
            let width = first + second;
            matrix.clear();
            matrix.resize(width * width, 0.0);
            element(place.element, &mut matrix);
            let at = |c: usize| if c < first { place.at[0] + c } else { place.at[1] + c - first };
            for (r, row) in matrix.chunks_exact(width.max(1)).enumerate() {
                for (c, entry) in row.iter().enumerate() {
                    *values.at(at(r), at(c)) += entry;
                }
            }
        }
        let below = front.children.iter();
        let below = below.map(|child| (std::mem::take(waiting.of(*child)), tree.fronts[*child].up.as_slice()));
        let below: Vec<_> = below.collect();
        values.take_over(&below);
        spare.extend(below.into_iter().map(|(left, _)| left));
        let (of_front, order) = values.eliminate()?;
        sign *= of_front;
        *waiting.of(k) = values.rest;
        factors.rows = order;
    }
    Some(sign)
}

/// Makes a list one of zeros. Its memory is reused unless it is much more than needed: as the graph
/// changes, the largest fronts get other numbers.
fn zeros(list: &mut Vec<f64>, length: usize) {
    if list.capacity() > 2 * length {
        *list = Vec::with_capacity(length);
    }
    list.clear();
    list.resize(length, 0.0);
}

impl Factors {
    /// x ← L⁻¹ x for the unknowns of a front.
    fn forward(&self, front: &Front, x: &mut [f64], line: &mut Vec<f64>) {
        let (n, p) = (front.unknowns.len(), front.pivots);
        line.clear();
        line.extend(self.rows.iter().map(|row| x[front.unknowns[*row]]));
        line.extend(front.unknowns[p..].iter().map(|at| x[*at]));
        let panel = Tiles::of(n).panel;
        for first in (0..p).step_by(panel) {
            let last = (first + panel).min(p);
            let columns = &self.columns[first * n..last * n];
            for (c, column) in (first..last).zip(columns.chunks_exact(n)) {
                let value = line[c];
                line[c + 1..last].iter_mut().zip(&column[c + 1..]).for_each(|(x, l)| *x -= l * value);
            }
            let (above, below) = line.split_at_mut(last);
            in_chunks(below, ROWS, |k, rows| {
                for (value, column) in above[first..].iter().zip(columns.chunks_exact(n)) {
                    rows.iter_mut().zip(&column[last + k * ROWS..]).for_each(|(x, l)| *x -= l * value);
                }
            });
        }
        front.unknowns.iter().zip(&*line).for_each(|(at, value)| x[*at] = *value);
    }

    /// x ← U⁻¹ x for the pivots of a front.
    fn backward(&self, front: &Front, x: &mut [f64], line: &mut Vec<f64>) {
        let (n, p) = (front.unknowns.len(), front.pivots);
        line.clear();
        line.extend(front.unknowns.iter().map(|at| x[*at]));
        let (own, border) = line.split_at_mut(p);
        let panel = Tiles::of(n).panel;
        in_chunks(own, ROWS, |k, rows| {
            for (value, column) in border.iter().zip(self.across.chunks_exact(p.max(1))) {
                rows.iter_mut().zip(&column[k * ROWS..]).for_each(|(x, u)| *x -= u * value);
            }
        });
        for first in (0..p).step_by(panel).rev() {
            let last = (first + panel).min(p);
            let columns = &self.columns[first * n..last * n];
            let (above, own) = own[..last].split_at_mut(first);
            for (c, column) in columns.chunks_exact(n).enumerate().rev() {
                let value = own[c] / column[first + c];
                own[c] = value;
                own[..c].iter_mut().zip(&column[first..]).for_each(|(x, u)| *x -= u * value);
            }
            in_chunks(above, ROWS, |k, rows| {
                for (value, column) in own.iter().zip(columns.chunks_exact(n)).rev() {
                    rows.iter_mut().zip(&column[k * ROWS..]).for_each(|(x, u)| *x -= u * value);
                }
            });
        }
        front.unknowns[..p].iter().zip(&*own).for_each(|(at, value)| x[*at] = *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice of nodes with 3 unknowns, a plate with one, and an isolated node: sizes and
    /// elements.
    fn lattice(side: usize) -> (Vec<usize>, Vec<[usize; 2]>) {
        let plate = side * side;
        let mut sizes = vec![3; plate];
        sizes.push(1);
        sizes.push(3);
        let mut elements = Vec::new();
        for x in 0..side {
            for y in 0..side {
                let at = x + side * y;
                elements.push([at, at]);
                if x + 1 < side {
                    elements.push([at + 1, at]);
                }
                if y + 1 < side {
                    elements.push([at, at + side]);
                } else {
                    elements.push([plate, at]);
                }
            }
        }
        (sizes, elements)
    }

    #[test]
    fn factors_solve_what_elements_add_up_to() {
        let (sizes, elements) = lattice(12);
        let tree = Tree::new(sizes.clone(), elements.clone()).unwrap();
        let fill = |e: usize, m: &mut [f64]| {
            let width = (m.len() as f64).sqrt() as usize;
            for (k, value) in m.iter_mut().enumerate() {
                let (r, c) = (k / width, k % width);
                // not symmetric, and large off the diagonal, so that pivoting exchanges rows
                *value = (1.0 + ((7 * e + 3 * r + 5 * c) % 11) as f64)
                    * if (r + c + e).is_multiple_of(3) { -10.0 } else { 1.0 };
            }
        };
        let mut lu = Lu::default();
        assert!(lu.factorise(&tree, fill).is_some());
        let n: usize = sizes.iter().sum();
        let firsts: Vec<usize> = sizes
            .iter()
            .scan(0, |at, s| {
                *at += s;
                Some(*at - s)
            })
            .collect();
        let mut dense = vec![vec![0.0; n]; n];
        (0..n).for_each(|k| dense[k][k] = 1.0);
        for (e, [a, b]) in elements.iter().enumerate() {
            let mut places: Vec<usize> = (firsts[*a]..firsts[*a] + sizes[*a]).collect();
            if a != b {
                places.extend(firsts[*b]..firsts[*b] + sizes[*b]);
            }
            let mut m = vec![0.0; places.len() * places.len()];
            fill(e, &mut m);
            for (r, pr) in places.iter().enumerate() {
                for (c, pc) in places.iter().enumerate() {
                    dense[*pr][*pc] += m[r * places.len() + c];
                }
            }
        }
        let wanted: Vec<f64> = (0..n).map(|k| 1.0 + (k % 5) as f64).collect();
        let mut x: Vec<f64> = dense.iter().map(|row| row.iter().zip(&wanted).map(|(a, x)| a * x).sum()).collect();
        lu.solve(&tree, &mut x);
        let off = x.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off:e}");
    }

    /// A cube of nodes with 3 unknowns each: sizes and elements.
    fn cube(side: usize) -> (Vec<usize>, Vec<[usize; 2]>) {
        let at = |x: usize, y: usize, z: usize| x + side * (y + side * z);
        let mut elements = Vec::new();
        for (x, y, z) in (0..side.pow(3)).map(|k| (k % side, k / side % side, k / side / side)) {
            let ends = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
            let inside = ends.iter().filter(|(x, y, z)| (x.max(y).max(z)) < &side);
            elements.extend(inside.map(|&(a, b, c)| [at(x, y, z), at(a, b, c)]));
        }
        (vec![3; side.pow(3)], elements)
    }

    /// Elements of a stiff lattice whose contacts slip: not symmetric.
    fn slipping(e: usize, m: &mut [f64]) {
        let width = (m.len() as f64).sqrt() as usize;
        for (k, value) in m.iter_mut().enumerate() {
            let (r, c) = (k / width, k % width);
            let drag = if r % 3 == 1 { 0.3 } else { 0.0 };
            let side = if (r < 3) == (c < 3) { 1.0 } else { -1.0 };
            *value = side * 1e3 * (if r % 3 == c % 3 { 1.0 } else { drag }) * (1.0 + (e % 7) as f64);
        }
    }

    #[test]
    fn large_fronts_and_parts_solve_the_same_for_any_number_of_threads() {
        let (sizes, elements) = cube(14);
        let tree = Tree::new(sizes, elements.clone()).unwrap();
        assert!(tree.parts.len() > 2, "{}", tree.parts.len());
        // large fronts with a border
        let in_tiles =
            |front: &Front| Tiles::of(front.unknowns.len()).panel < front.pivots && front.border() > ROWS / 4;
        assert!(tree.fronts.iter().any(in_tiles));
        let wanted: Vec<f64> = (0..tree.unknowns()).map(|k| 1.0 + (k % 5) as f64).collect();
        let mut right = wanted.clone();
        for (e, pair) in elements.iter().enumerate() {
            let places: Vec<usize> = pair.iter().flat_map(|node| 3 * node..3 * node + 3).collect();
            let mut m = [0.0; 36];
            slipping(e, &mut m);
            for (row, line) in places.iter().zip(m.chunks_exact(6)) {
                right[*row] += line.iter().zip(&places).map(|(m, at)| m * wanted[*at]).sum::<f64>();
            }
        }
        let solved = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (mut lu, mut x) = (Lu::default(), right.clone());
                assert!(lu.factorise(&tree, slipping).is_some());
                lu.solve(&tree, &mut x);
                x
            })
        };
        let one = solved(1);
        let off = one.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off:e}");
        for threads in [2, 3] {
            assert!(one.iter().zip(solved(threads)).all(|(a, b)| a.to_bits() == b.to_bits()), "{threads} threads");
        }
    }

    #[test]
    fn a_matrix_without_an_inverse_is_told() {
        let tree = Tree::new(vec![2], vec![[0, 0]]).unwrap();
        assert!(Lu::default().factorise(&tree, |_, m| m.copy_from_slice(&[-1.0, 1.0, 0.0, -1.0 + 0.0])).is_none());
    }
}
