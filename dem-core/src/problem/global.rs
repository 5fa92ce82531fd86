//! Problems over the velocities of the bodies, M v = H r + f and u = Hᵀ v + w, and the same over
//! the contacts alone: u = W r + q with W = Hᵀ M⁻¹ H and q = w + Hᵀ M⁻¹ f.
//!
//! M is block diagonal, one block for each body: the blocks are the connected components of its
//! pattern. With M = L Lᵀ of each block and H̃ = L⁻¹ H, which is sparse as H is, W = H̃ᵀ H̃. A
//! block of W exists where two contacts share a body, so a body with k contacts makes k² blocks:
//! cheap for grains, but a limit for a moving plate.

use super::block_matrix::BlockMatrix;
use petgraph::unionfind::UnionFind;
use thiserror::Error;

/// Largest number of unknowns of a body, whose block of M is factorised as a dense matrix.
const MOST_UNKNOWNS: usize = 1_000;
/// Largest number of values of W, 8 bytes each.
const MOST_VALUES: usize = 100_000_000;
/// Largest change of an entry of M that makes M symmetric, over the root of the product of its
/// diagonal entries (–). Siconos's chute with rolling friction needs 1e-3.
const MOST_ASYMMETRY: f64 = 1e-2;

/// A problem of N unknowns (velocities and spins of the bodies) and C contacts of S rows. Entries
/// of matrices are (row, column, value); those that share a place add up.
#[derive(Clone, Copy, Debug)]
pub struct Global<'a> {
    /// Rows of a contact, S.
    pub size: usize,
    /// M, N × N (kg; kg m² for spins): symmetric and positive definite.
    pub mass: &'a [(usize, usize, f64)],
    /// H, N × C·S: maps contact reactions to impulses on the bodies.
    pub directions: &'a [(usize, usize, f64)],
    /// f (N s), N.
    pub impulses: &'a [f64],
    /// w (m/s), C·S.
    pub given: &'a [f64],
}

/// The same problem over the contacts alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Condensed {
    /// W (1/kg), C × C blocks of S × S.
    pub matrix: BlockMatrix,
    /// q (m/s), C·S.
    pub q: Vec<f64>,
    /// Largest change of an entry that made M symmetric, over the root of the product of its
    /// diagonal entries (–).
    pub asymmetry: f64,
}

/// Why the bodies cannot be eliminated.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum GlobalError {
    /// M is not symmetric.
    #[error(
        "M is not symmetric: to be so the entry in row {row} and column {column} must change by {relative:.1e} of the \
             root of the product of the two diagonal entries; up to {MOST_ASYMMETRY:e} is made symmetric"
    )]
    Asymmetric {
        /// Row of the entry.
        row: usize,
        /// Its column.
        column: usize,
        /// The change (–).
        relative: f64,
    },
    /// The mass of a body is zero or negative in some direction.
    #[error(
        "M is not positive definite in the block of rows {first} to {last} ({unknowns} unknowns): the pivot of row {row} \
             is {pivot:e}"
    )]
    NotPositive {
        /// First row of the block.
        first: usize,
        /// Its last row.
        last: usize,
        /// How many rows it has.
        unknowns: usize,
        /// The row.
        row: usize,
        /// The pivot, what the factorisation leaves of its diagonal entry.
        pivot: f64,
    },
    /// M couples too many unknowns.
    #[error(
        "M couples {unknowns} unknowns from row {first} on; blocks of up to {MOST_UNKNOWNS}, as of rigid bodies, are read"
    )]
    Coupled {
        /// First row of the block.
        first: usize,
        /// How many rows it has.
        unknowns: usize,
    },
    /// W would be too large, as bodies have very many contacts.
    #[error(
        "W would have {values} values, {MOST_VALUES} at most: the body of row {first} alone has {contacts} contacts"
    )]
    Dense {
        /// Values of W.
        values: usize,
        /// First row of the body with most contacts.
        first: usize,
        /// Its contacts.
        contacts: usize,
    },
}

impl Global<'_> {
    /// The problem over the contacts alone.
    ///
    /// # Errors
    /// [`GlobalError`]: a block of M without a Cholesky factorisation, or sizes that would take too
    /// much memory.
    ///
    /// # Panics
    /// An entry lies outside its matrix, or `given` is no multiple of `size`.
    pub fn condensed(&self) -> Result<Condensed, GlobalError> {
        assert!(self.given.len().is_multiple_of(self.size), "some contacts lack rows");
        let mut bodies = self.bodies()?;
        let asymmetry = self.factorise(&mut bodies)?;
        self.attach(&mut bodies);
        self.check_size(&bodies)?;
        let pairs = |body: &Body| {
            let contacts: Vec<usize> = body.contacts.iter().map(|columns| columns.contact).collect();
            let row = |k: usize| contacts[k..].iter().map(|d| (contacts[k], *d)).collect::<Vec<_>>();
            (0..contacts.len()).flat_map(row).collect::<Vec<_>>()
        };
        let places = bodies.iter().flat_map(pairs).collect();
        let mut matrix = BlockMatrix::zeros(self.given.len() / self.size, self.size, places);
        let mut q = self.given.to_vec();
        for body in &bodies {
            body.add_to(self.size, &mut matrix, &mut q);
        }
        Ok(Condensed { matrix, q, asymmetry })
    }

    /// The bodies in the order of their first rows, with their applied impulses, but not yet with
    /// their blocks of M and their contacts.
    fn bodies(&self) -> Result<Vec<Body>, GlobalError> {
        let unknowns = self.impulses.len();
        let mut coupled = UnionFind::<usize>::new(unknowns);
        for (row, column, _) in self.mass.iter().filter(|(row, column, value)| row != column && *value != 0.0) {
            coupled.union(*row, *column);
        }
        let mut number = vec![usize::MAX; unknowns];
        let mut bodies: Vec<Body> = Vec::new();
        for row in 0..unknowns {
            let number = &mut number[coupled.find(row)];
            if *number == usize::MAX {
                *number = bodies.len();
                bodies.push(Body::default());
            }
            bodies[*number].rows.push(row);
        }
        for body in &mut bodies {
            let order = body.rows.len();
            if order > MOST_UNKNOWNS {
                return Err(GlobalError::Coupled { first: body.rows[0], unknowns: order });
            }
            body.applied = body.rows.iter().map(|row| self.impulses[*row]).collect();
        }
        Ok(bodies)
    }

    /// Factorise the blocks of M and multiply the applied impulses by L⁻¹; returns the largest
    /// asymmetry.
    fn factorise(&self, bodies: &mut [Body]) -> Result<f64, GlobalError> {
        let places = places(bodies, self.impulses.len());
        let mut entries = vec![Vec::new(); bodies.len()];
        for (row, column, value) in self.mass {
            let (body, row) = places[*row];
            // an explicit zero may lie between two bodies
            if places[*column].0 == body {
                entries[body].push((row, places[*column].1, *value));
            }
        }
        let mut asymmetry: f64 = 0.0;
        for (body, entries) in bodies.iter_mut().zip(&entries) {
            let order = body.rows.len();
            body.factor = vec![0.0; order * order];
            entries.iter().for_each(|(row, column, value)| body.factor[row * order + column] += value);
            asymmetry = asymmetry.max(body.symmetrise()?);
            body.cholesky()?;
            let mut applied = std::mem::take(&mut body.applied);
            body.divide(&mut applied);
            body.applied = applied;
        }
        Ok(asymmetry)
    }

    /// Compute the columns of H̃ = L⁻¹ H of each body.
    fn attach(&self, bodies: &mut [Body]) {
        let places = places(bodies, self.impulses.len());
        let mut order: Vec<usize> = (0..self.directions.len()).collect();
        // stable: entries that share a place add up in the order of the file
        order.sort_by_key(|k| (places[self.directions[*k].0].0, self.directions[*k].1));
        for k in order {
            let (row, column, value) = self.directions[k];
            let (contact, column) = (column / self.size, column % self.size);
            let (body, row) = places[row];
            let body = &mut bodies[body];
            let order = body.rows.len();
            if body.contacts.last().is_none_or(|last| last.contact != contact) {
                body.contacts.push(Columns { contact, values: vec![0.0; self.size * order] });
            }
            if let Some(last) = body.contacts.last_mut() {
                last.values[column * order + row] += value;
            }
        }
        for body in bodies {
            let mut contacts = std::mem::take(&mut body.contacts);
            let columns = contacts.iter_mut().flat_map(|columns| columns.values.chunks_exact_mut(body.rows.len()));
            columns.for_each(|column| body.divide(column));
            body.contacts = contacts;
        }
    }

    fn check_size(&self, bodies: &[Body]) -> Result<(), GlobalError> {
        let square = |body: &Body| body.contacts.len().saturating_mul(body.contacts.len());
        let blocks = bodies.iter().map(square).fold(0, usize::saturating_add);
        let values = blocks.saturating_mul(self.size * self.size);
        match bodies.iter().max_by_key(|body| body.contacts.len()) {
            Some(body) if values > MOST_VALUES => {
                Err(GlobalError::Dense { values, first: body.rows[0], contacts: body.contacts.len() })
            }
            _ => Ok(()),
        }
    }
}

/// One block of M, of order n, and the contacts that act on it.
#[derive(Clone, Debug, Default)]
struct Body {
    /// Its rows of M, ascending.
    rows: Vec<usize>,
    /// The block, then L in its lower triangle; n × n, row by row.
    factor: Vec<f64>,
    /// L⁻¹ f, n.
    applied: Vec<f64>,
    /// Its contacts, ascending.
    contacts: Vec<Columns>,
}

/// The columns of H̃ of one contact and one body: S of n values each.
#[derive(Clone, Debug)]
struct Columns {
    contact: usize,
    values: Vec<f64>,
}

impl Body {
    /// Replace the block by the mean with its transpose; returns the largest change (–).
    fn symmetrise(&mut self) -> Result<f64, GlobalError> {
        let n = self.rows.len();
        let mut worst: f64 = 0.0;
        for i in 0..n {
            for j in 0..i {
                let (below, above) = (self.factor[i * n + j], self.factor[j * n + i]);
                if below == above {
                    continue;
                }
                let relative = 0.5 * (below - above).abs() / (self.factor[i * n + i] * self.factor[j * n + j]).sqrt();
                if relative > MOST_ASYMMETRY {
                    return Err(GlobalError::Asymmetric { row: self.rows[i], column: self.rows[j], relative });
                }
                worst = worst.max(relative);
                let mean = 0.5 * (below + above);
                (self.factor[i * n + j], self.factor[j * n + i]) = (mean, mean);
            }
        }
        Ok(worst)
    }

    /// M = L Lᵀ.
    fn cholesky(&mut self) -> Result<(), GlobalError> {
        let n = self.rows.len();
        for i in 0..n {
            for j in 0..=i {
                let (above, own) = self.factor.split_at_mut(i * n);
                let row = if j < i { &above[j * n..j * n + j] } else { &[] };
                let sum: f64 = own.iter().zip(row).map(|(a, b)| a * b).sum();
                if j < i {
                    own[j] = (own[j] - sum) / above[j * n + j];
                    continue;
                }
                let pivot = own[i] - own[..i].iter().map(|l| l * l).sum::<f64>();
                // a pivot within the round-off of its diagonal entry is no mass
                let sound = pivot > n as f64 * f64::EPSILON * own[i] && pivot.is_finite();
                if !sound {
                    let (first, last) = (self.rows[0], self.rows[n - 1]);
                    return Err(GlobalError::NotPositive { first, last, unknowns: n, row: self.rows[i], pivot });
                }
                own[i] = pivot.sqrt();
            }
        }
        Ok(())
    }

    /// x ← L⁻¹ x.
    fn divide(&self, x: &mut [f64]) {
        let n = self.rows.len();
        for i in 0..n {
            let row = &self.factor[i * n..];
            let sum: f64 = row[..i].iter().zip(x.iter()).map(|(l, x)| l * x).sum();
            x[i] = (x[i] - sum) / row[i];
        }
    }

    /// Add the contribution of this body to W, and that of its applied impulses to q.
    fn add_to(&self, size: usize, matrix: &mut BlockMatrix, q: &mut [f64]) {
        let n = self.rows.len();
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (k, first) in self.contacts.iter().enumerate() {
            let c = first.contact;
            for (q, column) in q[c * size..].iter_mut().zip(first.values.chunks_exact(n)) {
                *q += product(column, &self.applied);
            }
            for second in &self.contacts[k..] {
                let d = second.contact;
                let entry = |place: usize| {
                    let (i, j) = (place / size, place % size);
                    product(&first.values[i * n..(i + 1) * n], &second.values[j * n..(j + 1) * n])
                };
                if let Some(block) = matrix.block_mut(c, d) {
                    block.iter_mut().enumerate().for_each(|(place, w)| *w += entry(place));
                }
                if let Some(block) = matrix.block_mut(d, c).filter(|_| c != d) {
                    let transposed = |place: usize| (place % size) * size + place / size;
                    block.iter_mut().enumerate().for_each(|(place, w)| *w += entry(transposed(place)));
                }
            }
        }
    }
}

/// The body of each unknown and its place there.
fn places(bodies: &[Body], unknowns: usize) -> Vec<(usize, usize)> {
    let mut places = vec![(0, 0); unknowns];
    for (b, body) in bodies.iter().enumerate() {
        body.rows.iter().enumerate().for_each(|(place, row)| places[*row] = (b, place));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bodies, of three unknowns (rows 0, 2, 3, coupled) and of two (1, 4); three contacts of
    /// two rows.
    const MASS: &[(usize, usize, f64)] = &[
        (0, 0, 2.0),
        (2, 2, 3.0),
        (3, 3, 1.0),
        (0, 2, 0.5),
        (2, 0, 0.5),
        // in two halves
        (2, 3, 0.1),
        (2, 3, 0.1),
        (3, 2, 0.2),
        (1, 1, 4.0),
        (4, 4, 0.5),
        (1, 4, 1.0),
        (4, 1, 1.0),
        // couples nothing
        (0, 1, 0.0),
    ];
    const DIRECTIONS: &[(usize, usize, f64)] = &[
        (0, 0, 1.0),
        (1, 0, -1.0),
        (2, 1, 1.0),
        (3, 1, 0.3),
        (4, 1, -1.0),
        (0, 2, 0.6),
        (2, 2, 0.8),
        (3, 3, -0.7),
        (1, 4, 1.0),
        (4, 5, 1.0),
    ];
    const IMPULSES: &[f64] = &[1.0, -2.0, 0.5, 0.0, 3.0];
    const GIVEN: &[f64] = &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6];

    fn problem(mass: &[(usize, usize, f64)]) -> Global<'_> {
        Global { size: 2, mass, directions: DIRECTIONS, impulses: IMPULSES, given: GIVEN }
    }

    fn dense(rows: usize, columns: usize, entries: &[(usize, usize, f64)]) -> nalgebra::DMatrix<f64> {
        let mut dense = nalgebra::DMatrix::zeros(rows, columns);
        entries.iter().for_each(|(row, column, value)| dense[(*row, *column)] += value);
        dense
    }

    #[test]
    fn blocks_give_what_full_matrices_give() {
        let condensed = problem(MASS).condensed().expect("condensed");
        let (mass, h) = (dense(5, 5, MASS), dense(5, 6, DIRECTIONS));
        let inverse = mass.try_inverse().expect("an inverse");
        let w = h.transpose() * &inverse * &h;
        let q = h.transpose() * inverse * nalgebra::DVector::from_row_slice(IMPULSES);
        let found = dense(6, 6, &condensed.matrix.entries());
        assert!((found - w).amax() < 1e-14);
        let off = (0..6).map(|k| (condensed.q[k] - GIVEN[k] - q[k]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-14, "{off:e}");
        assert_eq!((condensed.asymmetry, condensed.matrix.asymmetry()), (0.0, None));
        // contacts 1 and 2 share no body
        assert_eq!(condensed.matrix.block(1, 2), None);
        assert!(condensed.matrix.block(0, 2).is_some() && condensed.matrix.block(2, 0).is_some());
    }

    /// Masses s_i s_j min(i, j), i from one: L has s_i in all places of its row, and the inverse of
    /// min(i, j) is that of a chain of unit springs, 2 on the diagonal (1 at its end) and −1 beside
    /// it. Powers of two are exact.
    #[test]
    fn four_unknowns_that_are_all_coupled_have_the_inverse_of_their_mass() {
        let s = [2.0, 0.25, 8.0, 0.5];
        let (mut mass, mut inverse) = (Vec::new(), Vec::new());
        for i in 0..4usize {
            for j in 0..4 {
                mass.push((i, j, s[i] * s[j] * (i.min(j) + 1) as f64));
                let spring = [if i == 3 { 1.0 } else { 2.0 }, -1.0, 0.0, 0.0][i.abs_diff(j)];
                inverse.push((i, j, spring / (s[i] * s[j])));
            }
        }
        // one contact for each unknown: W = M⁻¹ and q = w + M⁻¹ f
        let directions: Vec<_> = (0..4).map(|k| (k, k, 1.0)).collect();
        let (impulses, given) = ([1.0, -2.0, 3.0, 4.0], [0.5, 0.0, -1.0, 2.0]);
        let global = Global { size: 1, mass: &mass, directions: &directions, impulses: &impulses, given: &given };
        let condensed = global.condensed().expect("condensed");
        let inverse = dense(4, 4, &inverse);
        assert_eq!(dense(4, 4, &condensed.matrix.entries()), inverse);
        let q = inverse * nalgebra::DVector::from_row_slice(&impulses) + nalgebra::DVector::from_row_slice(&given);
        assert_eq!(condensed.q, q.as_slice());
    }

    #[test]
    fn a_block_without_a_factorisation_is_named() {
        let error = |change: &[(usize, usize, f64)]| {
            problem(&[MASS, change].concat()).condensed().expect_err("refused").to_string()
        };
        let text = error(&[(3, 3, -1.0)]);
        assert!(text.contains("block of rows 0 to 3 (3 unknowns)") && text.contains("row 3"), "{text}");
        // singular: 4 · 0.25 = 1²
        let text = error(&[(4, 4, -0.25)]);
        assert!(text.contains("block of rows 1 to 4 (2 unknowns): the pivot of row 4 is 0e0"), "{text}");
        let text = error(&[(2, 0, 0.1)]);
        assert!(text.contains("row 2 and column 0 must change by 2.0e-2"), "{text}");
        let slightly = [MASS, &[(2, 0, 1e-4)]].concat();
        let condensed = problem(&slightly).condensed().expect("condensed");
        assert!((condensed.asymmetry - 0.5e-4 / 6.0f64.sqrt()).abs() < 1e-12, "{:e}", condensed.asymmetry);
        assert_eq!(condensed.matrix.asymmetry(), None);
    }

    #[test]
    fn sizes_beyond_memory_are_refused() {
        let chain: Vec<_> = (0..2_000).flat_map(|k| [(k, k, 2.0), (k, (k + 1) % 2_000, 0.1)]).collect();
        let impulses = vec![0.0; 2_000];
        let global = Global { size: 1, mass: &chain, directions: &[], impulses: &impulses, given: &[] };
        assert_eq!(global.condensed(), Err(GlobalError::Coupled { first: 0, unknowns: 2_000 }));
        let (directions, given): (Vec<_>, _) = ((0..20_000).map(|k| (0, k, 1.0)).collect(), vec![0.0; 20_000]);
        let (mass, impulses) = (&[(0, 0, 1.0)], &[0.0]);
        let global = Global { size: 1, mass, directions: &directions, impulses, given: &given };
        let error = global.condensed().expect_err("refused");
        assert_eq!(error, GlobalError::Dense { values: 400_000_000, first: 0, contacts: 20_000 });
    }
}
