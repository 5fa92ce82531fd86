//! The factors of a matrix over the fronts of a [`Tree`].
//!
//! A front whose elements and those below it are all symmetric is factorised by Cholesky's method,
//! with half the operations and half the memory: the matrices of contacts have no negative
//! eigenvalue. Other fronts are factorised as L U, with pivoting within the front.
//!
//! The parts of a level of the tree are independent and are computed in parallel; the columns and
//! rows of a large front are shared among threads, too. The operations and their order depend on
//! the tree and on which elements are symmetric, so the result is the same for any number of
//! threads.

use super::front_factors::FrontFactors;
use super::front_values::{FrontValues, Kind, Schur};
use super::tree::{Front, Part, Tree};
use crate::threads::among_threads;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The factors of a matrix; the next factorisation reuses their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Factors {
    /// In the order of the tree's fronts.
    fronts: Vec<FrontFactors>,
}

impl Factors {
    /// Factorise 1 + Σ of all elements; `element` writes the matrix of an element, row by row, over
    /// the unknowns of its first node and then its second. Returns the sign of the determinant;
    /// none if a pivot is zero or not finite.
    pub fn factorise(&mut self, tree: &Tree, element: impl Fn(usize, &mut [f64]) + Sync) -> Option<f64> {
        among_threads(tree.levels.len() > 1, || {
            // symmetric fronts whose matrix is not positive definite are factorised as general ones
            let made = self.factorise_as(Kind::Symmetric, tree, &element);
            made.or_else(|failed| match failed {
                Kind::Symmetric => self.factorise_as(Kind::General, tree, &element),
                Kind::General => Err(failed),
            })
        })
        .ok()
    }

    /// Factorise each front as one of the kind `at_best`, if it is. The error is the kind of a
    /// front that failed.
    fn factorise_as(
        &mut self,
        at_best: Kind,
        tree: &Tree,
        element: &(impl Fn(usize, &mut [f64]) + Sync),
    ) -> Result<f64, Kind> {
        self.fronts.resize_with(tree.fronts.len(), FrontFactors::default);
        let mut lists: Vec<Vec<(usize, &mut FrontFactors)>> = Vec::new();
        lists.resize_with(tree.levels.iter().map(Vec::len).sum(), Vec::new);
        for (k, factors) in self.fronts.iter_mut().enumerate() {
            lists[tree.fronts[k].part].push((k, factors));
        }
        let mut lists = lists.into_iter();
        let waiting: Vec<Mutex<Schur>> = tree.fronts.iter().map(|_| Mutex::default()).collect();
        let mut sign = 1.0;
        for level in &tree.levels {
            let parts = lists.by_ref().take(level.len()).collect();
            let made = in_parallel(parts, |fronts| eliminate(at_best, tree, fronts, &waiting, element));
            for of_part in made {
                sign *= of_part?;
            }
        }
        Ok(sign)
    }

    /// x ← A⁻¹ x for the factorised matrix A.
    pub fn solve(&self, tree: &Tree, x: &mut [f64]) {
        among_threads(tree.levels.len() > 1, || self.solve_levels(tree, x));
    }

    fn solve_levels(&self, tree: &Tree, x: &mut [f64]) {
        let mut solved = Vec::with_capacity(tree.levels.len());
        for level in &tree.levels {
            let own = in_parallel(level.iter().collect(), |part| {
                let mut own: Vec<f64> = part.unknowns[..part.pivots].iter().map(|at| x[*at]).collect();
                own.resize(part.unknowns.len(), 0.0);
                self.forward(tree, part, &mut own);
                own
            });
            for (part, own) in level.iter().zip(&own) {
                part.unknowns.iter().zip(own).skip(part.pivots).for_each(|(at, change)| x[*at] += change);
            }
            solved.push(own);
        }
        for (level, mut solved) in tree.levels.iter().zip(solved).rev() {
            in_parallel(level.iter().zip(&mut solved).collect(), |(part, own)| {
                own.iter_mut().zip(&part.unknowns).skip(part.pivots).for_each(|(value, at)| *value = x[*at]);
                self.backward(tree, part, own);
            });
            for (part, own) in level.iter().zip(&solved) {
                part.unknowns[..part.pivots].iter().zip(own).for_each(|(at, value)| x[*at] = *value);
            }
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

/// Factorise the fronts of a part, each after those below it, whose Schur complements wait. Returns
/// the sign of the determinant of their pivots; the kind of a front that failed.
fn eliminate(
    at_best: Kind,
    tree: &Tree,
    fronts: Vec<(usize, &mut FrontFactors)>,
    waiting: &[Mutex<Schur>],
    element: &(impl Fn(usize, &mut [f64]) + Sync),
) -> Result<f64, Kind> {
    let waiting = |k: usize| waiting[k].lock().unwrap_or_else(PoisonError::into_inner);
    // memory of Schur complements that were taken over
    let mut spare: Vec<Vec<f64>> = Vec::new();
    let (mut sign, mut matrices) = (1.0, Vec::new());
    for (k, factors) in fronts {
        let front = &tree.fronts[k];
        let (n, p, b) = (front.unknowns.len(), front.pivots, front.border());
        let below = front.children.iter();
        let mut below: Vec<_> =
            below.map(|child| (std::mem::take(&mut *waiting(*child)), tree.fronts[*child].up.as_slice())).collect();
        let symmetric = elements(tree, front, element, &mut matrices);
        let symmetric = symmetric && below.iter().all(|(left, _)| left.kind == Kind::Symmetric);
        let kind = if symmetric { at_best } else { Kind::General };
        zeros(&mut factors.columns, n * p);
        zeros(&mut factors.across, if kind == Kind::Symmetric { 0 } else { p * b });
        let (columns, across) = (&mut factors.columns, &mut factors.across);
        let mut rest = spare.pop().unwrap_or_default();
        zeros(&mut rest, b * b);
        let mut values = FrontValues { kind, n, p, columns, across, rest };
        values.add_identity();
        let (mut matrices, mut places) = (matrices.as_slice(), Vec::new());
        for place in &front.elements {
            let [first, second] = tree.widths(place.element);
            places.clear();
            places.extend((place.at[0]..place.at[0] + first).chain(place.at[1]..place.at[1] + second));
            let (matrix, later) = matrices.split_at(places.len() * places.len());
            values.add(matrix, &places);
            matrices = later;
        }
        values.take_over(&mut below);
        spare.extend(below.into_iter().map(|(left, _)| left.values));
        let (of_front, order) = values.eliminate().ok_or(kind)?;
        sign *= of_front;
        *waiting(k) = Schur { kind, values: values.rest };
        (factors.kind, factors.rows) = (kind, order);
    }
    Ok(sign)
}

/// Write the matrices of the elements of a front, one after the other; whether all are symmetric.
fn elements(tree: &Tree, front: &Front, element: &impl Fn(usize, &mut [f64]), matrices: &mut Vec<f64>) -> bool {
    matrices.clear();
    let mut symmetric = true;
    for place in &front.elements {
        let (width, start) = (tree.width(place.element), matrices.len());
        matrices.resize(start + width * width, 0.0);
        let matrix = &mut matrices[start..];
        element(place.element, matrix);
        symmetric = symmetric && (0..width).all(|r| (0..r).all(|c| matrix[r * width + c] == matrix[c * width + r]));
    }
    symmetric
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

#[cfg(test)]
mod tests {
    use super::super::dense::Tiles;
    use super::super::front_factors::ROWS;
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

    /// Elements of a stiff lattice: three springs between the unknowns of two nodes, or between
    /// those of one and the ground.
    fn sticking(e: usize, m: &mut [f64]) {
        springs(m, 1e3 * (1.0 + (e % 7) as f64), 0.0);
    }

    /// The same with friction: not symmetric.
    fn slipping(e: usize, m: &mut [f64]) {
        springs(m, 1e3 * (1.0 + (e % 7) as f64), 0.3);
    }

    fn springs(m: &mut [f64], stiffness: f64, friction: f64) {
        let width = (m.len() as f64).sqrt() as usize;
        for (k, value) in m.iter_mut().enumerate() {
            let (r, c) = (k / width, k % width);
            let drag = if r % 3 == 1 { friction } else { 0.0 };
            let side = if (r < 3) == (c < 3) { 1.0 } else { -1.0 };
            *value = side * stiffness * (if r % 3 == c % 3 { 1.0 } else { drag });
        }
    }

    /// A third of the elements slips.
    fn mixed(e: usize, m: &mut [f64]) {
        if e.is_multiple_of(3) { slipping(e, m) } else { sticking(e, m) }
    }

    /// Not symmetric, and large off the diagonal, so that pivoting exchanges rows.
    fn skewed(e: usize, m: &mut [f64]) {
        let width = (m.len() as f64).sqrt() as usize;
        for (k, value) in m.iter_mut().enumerate() {
            let (r, c) = (k / width, k % width);
            *value =
                (1.0 + ((7 * e + 3 * r + 5 * c) % 11) as f64) * if (r + c + e).is_multiple_of(3) { -10.0 } else { 1.0 };
        }
    }

    /// Symmetric, but most eigenvalues are negative.
    fn repelling(e: usize, m: &mut [f64]) {
        springs(m, -10.0 - e as f64, 0.0);
    }

    /// (1 + Σ elements) x.
    fn times(tree: &Tree, element: impl Fn(usize, &mut [f64]), x: &[f64]) -> Vec<f64> {
        let (sizes, elements) = tree.nodes_and_elements();
        let first = |node: usize| sizes[..node].iter().sum::<usize>();
        let mut y = x.to_vec();
        for (e, [a, b]) in elements.iter().enumerate() {
            let mut places: Vec<usize> = (first(*a)..first(*a) + sizes[*a]).collect();
            if a != b {
                places.extend(first(*b)..first(*b) + sizes[*b]);
            }
            let mut m = vec![0.0; places.len() * places.len()];
            element(e, &mut m);
            for (row, line) in places.iter().zip(m.chunks_exact(places.len())) {
                y[*row] += line.iter().zip(&places).map(|(m, at)| m * x[*at]).sum::<f64>();
            }
        }
        y
    }

    fn numbers(count: usize) -> Vec<f64> {
        (0..count).map(|k| 1.0 + (k % 5) as f64).collect()
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn fronts_of(kind: Kind, factors: &Factors) -> usize {
        factors.fronts.iter().filter(|front| front.kind == kind).count()
    }

    #[test]
    fn factors_solve_what_elements_add_up_to() {
        let (sizes, elements) = lattice(12);
        let tree = Tree::new(sizes, elements).unwrap();
        let x = numbers(tree.unknowns());
        let check = |element: fn(usize, &mut [f64]), symmetric: &dyn Fn(usize) -> bool| {
            let mut factors = Factors::default();
            assert!(factors.factorise(&tree, element).is_some());
            assert!(symmetric(fronts_of(Kind::Symmetric, &factors)), "{:?}", fronts_of(Kind::Symmetric, &factors));
            let mut solved = times(&tree, element, &x);
            factors.solve(&tree, &mut solved);
            let off = largest_difference(&solved, &x);
            assert!(off < 1e-9, "{off:e}");
        };
        let all = tree.fronts.len();
        check(sticking, &|symmetric| symmetric == all);
        check(mixed, &|symmetric| 0 < symmetric && symmetric < all);
        // those without elements stay symmetric
        check(skewed, &|symmetric| symmetric < all / 2);
        // symmetric fronts fail, and the whole is factorised without them
        check(repelling, &|symmetric| symmetric == 0);
    }

    #[test]
    fn the_sign_is_that_of_the_determinant() {
        let tree = Tree::new(vec![2, 1], vec![[0, 0], [0, 1]]).unwrap();
        // 1 + diag(d) for the first node, the identity for the second
        let sign = |d: [f64; 2]| {
            Factors::default().factorise(&tree, |e, m| {
                if e == 0 {
                    m.copy_from_slice(&[d[0], 0.0, 0.0, d[1]]);
                }
            })
        };
        assert_eq!(sign([1.0, 1.0]), Some(1.0));
        assert_eq!(sign([-3.0, 1.0]), Some(-1.0));
        assert_eq!(sign([-3.0, -3.0]), Some(1.0));
        assert_eq!(sign([-1.0, 1.0]), None);
        assert_eq!(sign([f64::NAN, 1.0]), None);
        assert_eq!(sign([f64::INFINITY, 1.0]), None);
    }

    #[test]
    fn large_fronts_and_parts_solve_the_same_for_any_number_of_threads() {
        let (sizes, elements) = cube(14);
        let tree = Tree::new(sizes, elements).unwrap();
        assert!(tree.levels.len() > 2 && tree.levels.iter().filter(|level| level.len() > 1).count() > 1);
        // large fronts with a border
        let in_tiles =
            |front: &Front| Tiles::of(front.unknowns.len()).panel < front.pivots && front.border() > ROWS / 2;
        assert!(tree.fronts.iter().any(in_tiles));
        let wanted = numbers(tree.unknowns());
        for element in [sticking, mixed, slipping] {
            let right = times(&tree, element, &wanted);
            let solved = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let (mut factors, mut x) = (Factors::default(), right.clone());
                    assert!(factors.factorise(&tree, element).is_some());
                    factors.solve(&tree, &mut x);
                    x
                })
            };
            let one = solved(1);
            let off = largest_difference(&one, &wanted);
            assert!(off < 1e-9, "{off:e}");
            for threads in [2, 3] {
                assert!(one.iter().zip(solved(threads)).all(|(a, b)| a.to_bits() == b.to_bits()), "{threads} threads");
            }
        }
    }

    #[test]
    fn symmetric_factors_take_half_the_memory_and_are_those_of_the_next_matrix() {
        let (sizes, elements) = cube(8);
        let tree = Tree::new(sizes, elements).unwrap();
        let x = numbers(tree.unknowns());
        let mut factors = Factors::default();
        let mut stored = Vec::new();
        for element in [slipping, sticking, slipping, sticking] {
            assert!(factors.factorise(&tree, element).is_some());
            let mut solved = times(&tree, element, &x);
            factors.solve(&tree, &mut solved);
            assert!(largest_difference(&solved, &x) < 1e-9);
            stored.push(factors.fronts.iter().map(|front| front.columns.len() + front.across.len()).sum::<usize>());
        }
        assert_eq!(stored[0], stored[2]);
        assert_eq!(stored[1], stored[3]);
        assert!(stored[1] < stored[0] * 3 / 4, "{stored:?}");
    }
}
