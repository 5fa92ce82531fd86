//! W as sparse blocks: one M × M block for each pair of contacts that act on each other.

/// A matrix of square blocks, one row and one column of them for each contact. Diagonal blocks
/// always exist, and so does the mirror image of each block.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMatrix {
    size: usize,
    /// Index of the first block of each contact's row, and the number of blocks.
    start: Vec<usize>,
    /// The contact of each block's column, increasing within a row.
    column: Vec<usize>,
    /// The blocks, each row by row.
    value: Vec<f64>,
}

/// The entry that [`BlockMatrix::symmetrised`] changes most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asymmetry {
    /// The change, half the difference from the mirrored entry, over the largest entry of the
    /// matrix (–).
    pub relative: f64,
    /// Row of the entry.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// The entry.
    pub entry: f64,
    /// The entry with row and column exchanged.
    pub mirrored: f64,
}

impl BlockMatrix {
    /// Zeros of `contacts` × `contacts` blocks of `size` × `size`, which exist at these places
    /// (row, column), at the mirrored places and on the diagonal.
    ///
    /// # Panics
    /// A place lies outside the matrix.
    pub(super) fn zeros(contacts: usize, size: usize, mut places: Vec<(usize, usize)>) -> Self {
        assert!(places.iter().all(|p| p.0 < contacts && p.1 < contacts), "an entry outside of the matrix");
        places.sort_unstable();
        places.dedup();
        let mirrored: Vec<_> = places.iter().map(|(row, column)| (*column, *row)).collect();
        places.extend(mirrored);
        places.extend((0..contacts).map(|c| (c, c)));
        places.sort_unstable();
        places.dedup();
        let mut start = vec![0; contacts + 1];
        for place in &places {
            start[place.0 + 1] += 1;
        }
        for c in 0..contacts {
            start[c + 1] += start[c];
        }
        let column: Vec<usize> = places.into_iter().map(|p| p.1).collect();
        Self { size, value: vec![0.0; column.len() * size * size], start, column }
    }

    /// From entries of the full matrix, (row, column, value); those that share a place add up.
    ///
    /// # Panics
    /// An entry lies outside the `contacts` × `size` rows or columns.
    #[must_use]
    pub fn from_entries(contacts: usize, size: usize, entries: &[(usize, usize, f64)]) -> Self {
        let block = |entry: &(usize, usize, f64)| (entry.0 / size, entry.1 / size);
        // entries of a block often follow one another
        let mut places: Vec<(usize, usize)> = entries.iter().map(block).collect();
        places.dedup();
        let mut matrix = Self::zeros(contacts, size, places);
        for entry in entries {
            let (row, column) = block(entry);
            if let Some(at) = matrix.find(row, column) {
                matrix.value[at + (entry.0 % size) * size + entry.1 % size] += entry.2;
            }
        }
        matrix
    }

    /// Number of contacts.
    #[must_use]
    pub fn contacts(&self) -> usize {
        self.start.len() - 1
    }

    /// Rows of a block.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// All values, block by block.
    pub(super) fn values(&self) -> &[f64] {
        &self.value
    }

    /// Index of the first value of a block.
    fn find(&self, row: usize, column: usize) -> Option<usize> {
        let columns = &self.column[self.start[row]..self.start[row + 1]];
        let place = columns.binary_search(&column).ok()?;
        Some((self.start[row] + place) * self.size * self.size)
    }

    /// The values of a block, row by row, if it exists.
    #[must_use]
    pub fn block(&self, row: usize, column: usize) -> Option<&[f64]> {
        self.find(row, column).map(|at| &self.value[at..at + self.size * self.size])
    }

    /// The same, mutable.
    pub(super) fn block_mut(&mut self, row: usize, column: usize) -> Option<&mut [f64]> {
        self.find(row, column).map(|at| &mut self.value[at..at + self.size * self.size])
    }

    /// The blocks in the row of a contact: their columns' contacts, and their values row by row.
    pub fn row(&self, contact: usize) -> impl Iterator<Item = (usize, &[f64])> {
        let (range, area) = (self.start[contact]..self.start[contact + 1], self.size * self.size);
        range.map(move |k| (self.column[k], &self.value[k * area..(k + 1) * area]))
    }

    /// The diagonal block of a contact, row by row.
    #[must_use]
    pub fn diagonal(&self, contact: usize) -> &[f64] {
        self.block(contact, contact).unwrap_or_default()
    }

    /// Every entry that is not zero, (row, column, value), by row and column.
    #[must_use]
    pub fn entries(&self) -> Vec<(usize, usize, f64)> {
        let size = self.size;
        let mut entries = Vec::new();
        for row in 0..self.contacts() * size {
            for (column, block) in self.row(row / size) {
                let line = &block[(row % size) * size..][..size];
                let there = line.iter().enumerate().filter(|(_, w)| **w != 0.0);
                entries.extend(there.map(|(k, w)| (row, column * size + k, *w)));
            }
        }
        entries
    }

    /// Rows of one contact of the product with `x`, added to `out`.
    #[inline]
    pub(crate) fn multiply_row(&self, contact: usize, x: &[f64], out: &mut [f64]) {
        let size = self.size;
        for (column, block) in self.row(contact) {
            let x = &x[column * size..(column + 1) * size];
            for (out, row) in out.iter_mut().zip(block.chunks_exact(size)) {
                *out += row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
            }
        }
    }

    /// The largest difference from the transpose; `None` if the matrix is symmetric.
    #[must_use]
    pub fn asymmetry(&self) -> Option<Asymmetry> {
        let size = self.size;
        let largest = self.value.iter().fold(0.0, |most: f64, w| most.max(w.abs()));
        let mut worst: Option<Asymmetry> = None;
        for c in 0..self.contacts() {
            for (d, block) in self.row(c).filter(|(d, _)| *d >= c) {
                let Some(opposite) = self.block(d, c) else { continue };
                for (k, &entry) in block.iter().enumerate() {
                    let mirrored = opposite[(k % size) * size + k / size];
                    let relative = 0.5 * (entry - mirrored).abs() / largest;
                    if relative > worst.map_or(0.0, |worst| worst.relative) {
                        let (row, column) = (c * size + k / size, d * size + k % size);
                        worst = Some(Asymmetry { relative, row, column, entry, mirrored });
                    }
                }
            }
        }
        worst
    }

    /// The mean of the matrix and its transpose.
    #[must_use]
    pub fn symmetrised(&self) -> Self {
        let (size, mut mean) = (self.size, self.clone());
        for c in 0..self.contacts() {
            for (d, block) in self.row(c) {
                let (Some(opposite), Some(own)) = (self.block(d, c), mean.block_mut(c, d)) else { continue };
                for (k, (own, entry)) in own.iter_mut().zip(block).enumerate() {
                    *own = 0.5 * (entry + opposite[(k % size) * size + k / size]);
                }
            }
        }
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_with_the_transpose_is_symmetric() {
        // block (0, 1) alone is given: its mirror image is created
        let entries = [(0, 0, 4.0), (0, 1, 1.0), (1, 0, 1.5), (1, 1, 3.0), (1, 2, 0.5), (2, 2, 2.0), (3, 3, 2.0)];
        let matrix = BlockMatrix::from_entries(2, 2, &entries);
        assert_eq!(matrix.block(1, 0), Some(&[0.0; 4][..]));
        let worst = matrix.asymmetry().expect("not symmetric");
        assert_eq!((worst.relative, worst.row, worst.column), (0.0625, 0, 1));
        assert_eq!((worst.entry, worst.mirrored), (1.0, 1.5));
        let mean = matrix.symmetrised();
        assert_eq!(mean.asymmetry(), None);
        assert_eq!(mean.block(0, 0), Some(&[4.0, 1.25, 1.25, 3.0][..]));
        assert_eq!(mean.block(0, 1), Some(&[0.0, 0.0, 0.25, 0.0][..]));
        assert_eq!(mean.symmetrised(), mean);
    }
}
