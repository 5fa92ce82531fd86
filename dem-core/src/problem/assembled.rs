//! The contact problem with its matrix: u = W r̂ + q, and a cone for each contact. This is the form
//! that other codes exchange and solve.
//!
//! K ∋ r̂ ⊥ ũ ∈ K*, with r̂ = r + s n: r̂ and q include the cohesive shift, so all cones have their
//! apex at the origin. All contacts have the same rows; rows that a law lacks are zero in W and q,
//! with zero coefficients. Moments are divided by the mean diameter of the pair and relative spins
//! multiplied by it, so that all rows share a unit (N s, m/s) and the coefficients of t and m are
//! plain numbers.
//!
//! W is built column by column from the maps H and Hᵀ of the matrix-free problem: the relative
//! velocities that a unit impulse causes. See docs/theory/fclib.md.

pub use super::block_matrix::{Asymmetry, BlockMatrix};
use super::residual::{self, relative};
use super::{Contact, ContactProblem, Link, Nodes, Visitor};
use crate::contact::cone::predict_correct;
use crate::contact::{Arms, Cone, Law, Local, PADDED, Padded, Weights};
use crate::dim::{Dim, Vect, tangential_rows};
use thiserror::Error;

/// Largest asymmetry of a matrix that counts as round-off, as [`Asymmetry`] measures it (–).
pub const ROUNDING: f64 = 1e-6;

/// The rows that every contact of an assembled problem has, in the order n, t…, m….
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContactRows {
    /// Tangential rows: 1 in 2D, 2 in 3D.
    pub tangents: usize,
    /// Moment rows: none; as many bending rows as tangential ones; or those and one twist row.
    pub moments: usize,
}

/// The data of an assembled problem. Lengths: C contacts of M rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// The rows of each contact.
    pub rows: ContactRows,
    /// W (1/kg), C × C blocks of M × M.
    pub matrix: BlockMatrix,
    /// q (m/s), C × M.
    pub q: Vec<f64>,
    /// Coefficients of the tangential rows (–), C.
    pub mu: Vec<f64>,
    /// Coefficients of the bending rows, moments being divided by the mean diameter (–), C.
    pub nu: Vec<f64>,
    /// Coefficients of the twist rows, likewise (–), C.
    pub xi: Vec<f64>,
    /// Whether the flow of a contact is normal to its cone, C.
    pub associated: Vec<bool>,
    /// Normal component of r̂ − r (N s), C; zero where unknown.
    pub shift: Vec<f64>,
    /// Euclidean norm of the applied impulses (N s), one scale of the residual; zero if unknown.
    pub applied: f64,
}

/// A contact problem with its matrix, and its shifted reactions.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembled {
    parts: Parts,
    /// Shifted reactions r̂ (N s), C × M.
    pub r: Vec<f64>,
}

/// Why [`Parts`] are not a valid problem.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AssemblyError {
    /// An array has another length.
    #[error("{array} has {found} values instead of {expected}")]
    Length {
        /// The array.
        array: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits W.
        expected: usize,
    },
    /// A number that is not finite, or a coefficient below zero.
    #[error("{array} is {value} at index {index}, it must be {allowed}")]
    Value {
        /// The array.
        array: &'static str,
        /// Index of the value.
        index: usize,
        /// The value.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// W is not symmetric.
    #[error("W is not symmetric: {entry:e} in row {row} and column {column}, {mirrored:e} in the place opposite")]
    Asymmetric {
        /// Row of the entry.
        row: usize,
        /// Its column.
        column: usize,
        /// The entry.
        entry: f64,
        /// The entry with row and column exchanged.
        mirrored: f64,
    },
}

impl ContactRows {
    /// How many rows a contact has: M.
    #[must_use]
    pub fn count(self) -> usize {
        1 + self.tangents + self.moments
    }

    /// The rows of one contact in a slice of M numbers.
    #[inline]
    pub(crate) fn padded(self, rows: &[f64]) -> Padded {
        let mut out = Padded { n: rows[0], ..Padded::zero() };
        for k in 0..self.tangents {
            out.t[k] = rows[1 + k];
        }
        for k in 0..self.moments {
            out.m[k] = rows[1 + self.tangents + k];
        }
        out
    }

    /// Write the rows of one contact to a slice of M numbers.
    #[inline]
    pub(crate) fn write(self, r: &Padded, rows: &mut [f64]) {
        rows[0] = r.n;
        rows[1..=self.tangents].copy_from_slice(&r.t.as_slice()[..self.tangents]);
        rows[1 + self.tangents..].copy_from_slice(&r.m.as_slice()[..self.moments]);
    }
}

impl Parts {
    fn check(&self) -> Result<(), AssemblyError> {
        let contacts = self.matrix.contacts();
        let length = |array, found, expected| match found == expected {
            true => Ok(()),
            false => Err(AssemblyError::Length { array, found, expected }),
        };
        length("block of W", self.matrix.size(), self.rows.count())?;
        length("q", self.q.len(), contacts * self.rows.count())?;
        length("mu", self.mu.len(), contacts)?;
        length("mu_r", self.nu.len(), contacts)?;
        length("mu_t", self.xi.len(), contacts)?;
        length("associated", self.associated.len(), contacts)?;
        length("shift", self.shift.len(), contacts)?;
        let values = |array, values: &[f64], least: f64, allowed| {
            let wrong = values.iter().position(|x| !x.is_finite() || *x < least);
            wrong.map_or(Ok(()), |index| Err(AssemblyError::Value { array, index, value: values[index], allowed }))
        };
        let (finite, coefficient) = ("finite", "finite and not below zero");
        values("W", self.matrix.values(), f64::NEG_INFINITY, finite)?;
        values("q", &self.q, f64::NEG_INFINITY, finite)?;
        values("mu", &self.mu, 0.0, coefficient)?;
        values("mu_r", &self.nu, 0.0, coefficient)?;
        values("mu_t", &self.xi, 0.0, coefficient)?;
        values("shift", &self.shift, 0.0, coefficient)?;
        values("applied", &[self.applied], 0.0, coefficient)?;
        match self.matrix.asymmetry() {
            Some(Asymmetry { relative, row, column, entry, mirrored }) if relative > ROUNDING => {
                Err(AssemblyError::Asymmetric { row, column, entry, mirrored })
            }
            _ => Ok(()),
        }
    }
}

impl Assembled {
    /// A problem from its parts, with zero reactions.
    ///
    /// # Errors
    /// [`AssemblyError`]: lengths that do not fit together, numbers that are not finite,
    /// coefficients below zero, a matrix that is not symmetric.
    pub fn new(parts: Parts) -> Result<Self, AssemblyError> {
        parts.check()?;
        Ok(Self { r: vec![0.0; parts.q.len()], parts })
    }

    /// The data of the problem.
    #[must_use]
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// Number of contacts C.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.mu.len()
    }

    /// Whether there is no contact at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The relative velocities u = W r̂ + q (m/s), C × M.
    #[must_use]
    pub fn velocities(&self) -> Vec<f64> {
        self.velocities_from(&self.r)
    }

    /// The relative velocities of all contacts under these shifted reactions.
    fn velocities_from(&self, r: &[f64]) -> Vec<f64> {
        let (mut u, size) = (self.parts.q.clone(), self.parts.rows.count());
        for (c, u) in u.chunks_exact_mut(size).enumerate() {
            self.parts.matrix.multiply_row(c, r, u);
        }
        u
    }

    /// The cone of a contact.
    #[must_use]
    pub fn cone(&self, contact: usize) -> Cone {
        Cone { mu: self.parts.mu[contact], nu: self.parts.nu[contact], xi: self.parts.xi[contact] }
    }

    /// The shifted reaction of a contact.
    #[inline]
    pub(crate) fn reaction(&self, contact: usize) -> Padded {
        let size = self.parts.rows.count();
        self.parts.rows.padded(&self.r[contact * size..(contact + 1) * size])
    }

    /// The relative velocity of a contact.
    #[inline]
    pub(crate) fn velocity(&self, contact: usize) -> Padded {
        let (rows, size) = (self.parts.rows, self.parts.rows.count());
        let mut u = [0.0; PADDED];
        u[..size].copy_from_slice(&self.parts.q[contact * size..(contact + 1) * size]);
        self.parts.matrix.multiply_row(contact, &self.r, &mut u[..size]);
        rows.padded(&u[..size])
    }

    /// D of each contact: the largest diagonal entry of its block (1/kg); if that is zero, the
    /// largest of all contacts.
    pub(crate) fn scales(&self) -> Vec<f64> {
        let size = self.parts.rows.count();
        let largest = |block: &[f64]| (0..size).map(|k| block[k * size + k]).fold(0.0, f64::max);
        let own: Vec<f64> = (0..self.len()).map(|c| largest(self.parts.matrix.diagonal(c))).collect();
        let most = own.iter().copied().fold(0.0, f64::max);
        let some = if most > 0.0 { most } else { 1.0 };
        own.into_iter().map(|d| if d > 0.0 { d } else { some }).collect()
    }

    /// Natural map P_K(r̂ − γ ũ) − r̂ of a contact.
    #[inline]
    pub(crate) fn correction(&self, contact: usize, gamma: f64, r: Padded, u: Padded) -> Padded {
        predict_correct(self.cone(contact), 0.0, !self.parts.associated[contact], gamma, r, u)
    }

    /// The residual of [`super::residual`], from the matrix (–).
    ///
    /// The denominator has the reactions without their shift, where the shift is known. NaN
    /// propagates.
    #[must_use]
    pub fn residual(&self) -> f64 {
        let (mut map, mut reaction, mut rounding) = (0.0f64, 0.0, 0.0f64);
        for (c, d) in self.scales().into_iter().enumerate() {
            let (r, u) = (self.reaction(c), self.velocity(c));
            let change = self.correction(c, 1.0 / d, r, u);
            let own = Local { n: r.n - self.parts.shift[c], ..r };
            map += change.dot(&change);
            reaction += own.dot(&own);
            rounding += self.summands(c, &self.r) / (d * d);
        }
        let scale = f64::sqrt(reaction).max(self.parts.applied);
        relative(map.sqrt(), rounding.sqrt(), scale)
    }

    /// The velocity error (–): the largest natural map of a contact as a velocity, over the largest
    /// velocity without cohesion and contact reactions, of associated contacts and of those that
    /// would close, if there are any; zero within the round-off of what cohesion gives. If
    /// reactions diverge because no solution exists, the velocity error stays near one while the
    /// residual vanishes.
    #[must_use]
    pub fn velocity_error(&self) -> f64 {
        let size = self.parts.rows.count();
        let mut none = vec![0.0; self.r.len()];
        self.parts.shift.iter().enumerate().for_each(|(c, shift)| none[c * size] = *shift);
        let free = self.velocities_from(&none);
        let asks = |c: usize, u: &[f64]| self.parts.shift[c] > 0.0 || self.parts.associated[c] || u[0] < 0.0;
        let contacts = || free.chunks_exact(size).enumerate();
        let any = contacts().any(|(c, u)| asks(c, u));
        let asked = contacts().filter(|(c, u)| asks(*c, u) || !any);
        let speed = asked.flat_map(|(_, u)| u).map(|u| u.abs()).fold(0.0, f64::max);
        let map = |(c, d): (usize, f64)| {
            let change = self.correction(c, 1.0 / d, self.reaction(c), self.velocity(c));
            let speed = d * change.dot(&change).sqrt();
            // cohesion alone gives velocities that cancel: reactions that diverge would hide it
            if speed <= residual::ROUNDING * self.summands(c, &none).sqrt() { 0.0 } else { speed }
        };
        let largest = self.scales().into_iter().enumerate().map(map).fold(0.0, f64::max);
        if largest == 0.0 { 0.0 } else { largest / speed }
    }

    /// Sum of the squares of the summands of a contact's velocity under these shifted reactions:
    /// the scale of its round-off.
    fn summands(&self, contact: usize, reactions: &[f64]) -> f64 {
        let size = self.parts.rows.count();
        let mut sum: f64 = self.parts.q[contact * size..(contact + 1) * size].iter().map(|q| q * q).sum();
        for (column, block) in self.parts.matrix.row(contact) {
            let r = &reactions[column * size..(column + 1) * size];
            for row in block.chunks_exact(size) {
                sum += row.iter().zip(r).map(|(w, r)| (w * r) * (w * r)).sum::<f64>();
            }
        }
        sum
    }

    /// The error as Siconos measures it, for comparison (–): the natural map with ρ = 1, over the
    /// largest of the norms of q, r̂ and u. It depends on the units.
    #[must_use]
    pub fn siconos_error(&self) -> f64 {
        let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut map = 0.0;
        for c in 0..self.len() {
            let change = self.correction(c, 1.0, self.reaction(c), self.velocity(c));
            map += change.dot(&change);
        }
        let scale = norm(&self.parts.q).max(norm(&self.r)).max(norm(&self.velocities()));
        if map == 0.0 { 0.0 } else { map.sqrt() / scale }
    }

    /// The problem `problem` with its matrix and its present reactions, shifted.
    #[must_use]
    pub fn of<D: Dim>(problem: &ContactProblem<D>) -> Self {
        let mut list = List(Vec::with_capacity(problem.len()));
        problem.visit(&mut list);
        let List(list) = list;
        let moments = if problem.bonded.is_empty() && problem.elastic.is_empty() { 0 } else { D::Moment::LEN };
        let rows = ContactRows { tangents: D::N - 1, moments };
        let matrix = delassus(&problem.nodes, &list, rows);
        let mut nodes = problem.nodes.clone();
        for (node, free) in nodes.all.iter_mut().zip(problem.free.iter()) {
            (node.velocity, node.spin) = *free;
        }
        let size = rows.count();
        let (mut q, mut r) = (vec![0.0; list.len() * size], vec![0.0; list.len() * size]);
        let mut shifts = vec![0.0; list.len() * size];
        for (c, item) in list.iter().enumerate() {
            let at = c * size..(c + 1) * size;
            // an elastic bond: u + C (r − r₀), with C in the matrix
            let u = item.velocity(&nodes) + item.bias - item.compliance.times(&item.carried);
            rows.write(&u, &mut q[at.clone()]);
            rows.write(&Local { n: item.r.n + item.shift, ..item.r }, &mut r[at]);
            shifts[c * size] = -item.shift;
        }
        // u = W (r̂ − s n) + q
        for (c, q) in q.chunks_exact_mut(size).enumerate() {
            matrix.multiply_row(c, &shifts, q);
        }
        let parts = Parts {
            rows,
            matrix,
            q,
            mu: list.iter().map(|item| item.cone.mu).collect(),
            nu: list.iter().map(|item| item.cone.nu).collect(),
            xi: list.iter().map(|item| item.cone.xi).collect(),
            associated: list.iter().map(|item| item.associated).collect(),
            shift: list.iter().map(|item| item.shift).collect(),
            applied: problem.applied,
        };
        Self { parts, r }
    }
}

/// A contact of any law.
struct Item<D: Dim> {
    link: Link<D>,
    arms: Arms,
    tangents: usize,
    moments: usize,
    cone: Cone,
    associated: bool,
    shift: f64,
    bias: Padded,
    compliance: Weights,
    carried: Padded,
    r: Padded,
}

struct List<D: Dim>(Vec<Item<D>>);

impl<D: Dim> Visitor<D> for List<D> {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
        self.0.push(Item {
            link: c.link.whole(),
            arms: c.law.arms(),
            tangents: tangential_rows::<D, L::T>(),
            moments: L::B::LEN,
            cone: c.law.cone(),
            associated: c.law.associated(),
            shift: c.law.shift(),
            bias: c.link.in_frame(&c.law.bias()),
            compliance: c.law.compliance(),
            carried: c.link.in_frame(&c.law.carried()),
            r: c.link.in_frame(&c.r),
        });
    }
}

impl<D: Dim> Item<D> {
    /// The relative velocity, zero in rows that the contact lacks.
    fn velocity(&self, nodes: &Nodes<D>) -> Padded {
        let u = nodes.relative_velocity::<D::Tangent, D::Moment>(&self.link, self.arms);
        let mut out = Padded { n: u.n, ..Padded::zero() };
        for k in 0..self.tangents {
            out.t[k] = u.t[k];
        }
        for k in 0..self.moments {
            out.m[k] = u.m[k];
        }
        out
    }
}

/// W = Hᵀ M⁻¹ H and the compliance of elastic bonds, column by column.
fn delassus<D: Dim>(nodes: &Nodes<D>, list: &[Item<D>], rows: ContactRows) -> BlockMatrix {
    let mut nodes = nodes.clone();
    for node in &mut nodes.all {
        (node.velocity, node.spin) = (D::Vector::zero(), D::Spin::zero());
    }
    let mut around = vec![Vec::new(); nodes.all.len()];
    for (c, item) in list.iter().enumerate() {
        item.link.nodes.iter().for_each(|k| around[*k as usize].push(c));
    }
    let yields: Vec<bool> = nodes.all.iter().map(|node| node.inverse_mass > 0.0).collect();
    let size = rows.count();
    let mut entries = Vec::new();
    for (c, item) in list.iter().enumerate() {
        let moving = item.link.nodes.iter().map(|k| *k as usize).filter(|k| yields[*k]);
        let mut near: Vec<usize> = moving.flat_map(|k| around[k].iter().copied()).collect();
        near.sort_unstable();
        near.dedup();
        for k in (0..1 + item.tangents).chain(1 + rows.tangents..1 + rows.tangents + item.moments) {
            let mut unit = [0.0; PADDED];
            unit[k] = 1.0;
            nodes.apply(&item.link, item.arms, rows.padded(&unit[..size]));
            for &d in &near {
                let mut u = [0.0; PADDED];
                let mut moved = list[d].velocity(&nodes);
                if d == c {
                    moved += item.compliance.times(&rows.padded(&unit[..size]));
                }
                rows.write(&moved, &mut u[..size]);
                let there = (0..size).filter(|row| u[*row] != 0.0);
                entries.extend(there.map(|row| (d * size + row, c * size + k, u[row])));
            }
            for node in item.link.nodes.map(|k| k as usize) {
                (nodes.all[node].velocity, nodes.all[node].spin) = (D::Vector::zero(), D::Spin::zero());
            }
        }
    }
    BlockMatrix::from_entries(list.len(), size, &entries)
}
