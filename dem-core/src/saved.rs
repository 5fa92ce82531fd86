//! A saved state as plain numbers, from which a run continues bit for bit.
//!
//! Each type writes the numbers of its state in a fixed order and reads them back in the same
//! order. Integers and reals are stored separately, without rounding.

use crate::dim::Vect;
use thiserror::Error;

/// The numbers of a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Saved {
    /// Reals, in the order in which they were written.
    pub reals: Vec<f64>,
    /// Counts, indices and codes, in the order in which they were written.
    pub counts: Vec<u64>,
}

/// A saved state whose numbers do not match what the reader expects.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the saved state has another form: it belongs to another scene, or to another version of the program")]
pub struct Mismatch;

impl Saved {
    /// Writes a real.
    pub fn real(&mut self, x: f64) {
        self.reals.push(x);
    }

    /// Writes a count.
    pub fn count(&mut self, n: usize) {
        self.counts.push(n as u64);
    }

    /// Writes a flag.
    pub fn flag(&mut self, flag: bool) {
        self.counts.push(u64::from(flag));
    }

    /// Writes a vector.
    pub fn vector<V: Vect>(&mut self, v: &V) {
        self.reals.extend_from_slice(v.as_slice());
    }

    /// Writes vectors but not their number, which the reader must know.
    pub fn vectors<V: Vect>(&mut self, list: &[V]) {
        list.iter().for_each(|v| self.vector(v));
    }

    /// A reader at the first number.
    pub fn read(&self) -> Reader<'_> {
        Reader::new(&self.reals, &self.counts)
    }
}

/// Reads a [`Saved`] state from its first number to its last.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    reals: &'a [f64],
    counts: &'a [u64],
}

impl<'a> Reader<'a> {
    /// A reader of these saved reals and counts.
    pub fn new(reals: &'a [f64], counts: &'a [u64]) -> Self {
        Self { reals, counts }
    }

    /// The next real.
    ///
    /// # Errors
    /// [`Mismatch`] if no real is left.
    pub fn real(&mut self) -> Result<f64, Mismatch> {
        Ok(self.reals(1)?[0])
    }

    /// The next `n` reals.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn reals(&mut self, n: usize) -> Result<&'a [f64], Mismatch> {
        let (taken, rest) = self.reals.split_at_checked(n).ok_or(Mismatch)?;
        self.reals = rest;
        Ok(taken)
    }

    /// The next count.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn count(&mut self) -> Result<usize, Mismatch> {
        let (&first, rest) = self.counts.split_first().ok_or(Mismatch)?;
        self.counts = rest;
        usize::try_from(first).map_err(|_| Mismatch)
    }

    /// The next count, as the number of items that take at least one saved number each.
    ///
    /// # Errors
    /// [`Mismatch`] if fewer numbers than that are left: a corrupt count must not allocate memory.
    pub fn number_of(&mut self) -> Result<usize, Mismatch> {
        let n = self.count()?;
        if n <= self.reals.len() + self.counts.len() { Ok(n) } else { Err(Mismatch) }
    }

    /// The next flag.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn flag(&mut self) -> Result<bool, Mismatch> {
        match self.count()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Mismatch),
        }
    }

    /// The next vector.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn vector<V: Vect>(&mut self) -> Result<V, Mismatch> {
        Ok(V::from_slice(self.reals(V::LEN)?))
    }

    /// The next `n` vectors.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn vectors<V: Vect>(&mut self, n: usize) -> Result<Vec<V>, Mismatch> {
        let all = self.reals(n.checked_mul(V::LEN).ok_or(Mismatch)?)?;
        Ok(if V::LEN == 0 { vec![V::zero(); n] } else { all.chunks_exact(V::LEN).map(V::from_slice).collect() })
    }

    /// Checks that all numbers have been read.
    ///
    /// # Errors
    /// [`Mismatch`] if numbers are left.
    pub fn end(&self) -> Result<(), Mismatch> {
        if self.reals.is_empty() && self.counts.is_empty() { Ok(()) } else { Err(Mismatch) }
    }
}
