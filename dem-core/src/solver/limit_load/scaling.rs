//! The scaling of cone pairs, and what it makes of the equations of one contact.

use crate::contact::PADDED;
use crate::solver::interior::cones::{Point, Scaling, eigenvalues};
use crate::solver::interior::sites::{Site, Sites};
use nalgebra::DMatrix;

/// Rows of a local matrix.
pub(super) type Local = [[f64; PADDED]; PADDED];

/// The scaling of a pair: W = η B(w), W z = W⁻¹ s.
#[derive(Clone, Copy)]
pub(super) struct Metric {
    pub scaling: Scaling,
    pub eta: f64,
}

impl Metric {
    pub fn of(s: &Point, z: &Point) -> Self {
        let size = |x: &Point| {
            let [high, low] = eigenvalues(x);
            high * low
        };
        Self { scaling: Scaling::of(s, z), eta: (size(s) / size(z)).sqrt().sqrt() }
    }

    /// W x.
    pub fn times(&self, x: &Point) -> Point {
        self.scaling.z(x).map(|x| x * self.eta)
    }

    /// W⁻¹ x.
    pub fn inverse(&self, x: &Point) -> Point {
        self.scaling.x(x).map(|x| x / self.eta)
    }
}

/// S⁻¹ of a contact, from S = RᵀR with R the triangular factor of W⁻¹L. Near the end of the path S
/// has stiff and soft directions twenty orders of magnitude apart, of which W⁻¹L keeps both.
#[derive(Clone, Copy)]
pub(super) struct Soft {
    /// R⁻¹, upper triangular.
    pub root: Local,
    pub inverse: Local,
}

impl Soft {
    /// None if W⁻¹L is singular to rounding.
    pub fn of(sites: &Sites, site: &Site, metrics: &[Metric]) -> Option<Self> {
        let n = site.rows;
        let mut lines: Vec<[f64; PADDED]> = Vec::new();
        for (cone, metric) in sites.cones_at(site).iter().zip(&metrics[site.cones.clone()]) {
            let mut block = [[0.0; PADDED]; 3];
            for row in std::iter::once(0).chain(cone.rows[..cone.tangents].iter().copied()) {
                let mut unit = [0.0; PADDED];
                unit[row] = 1.0;
                let column = metric.inverse(&cone.primal(&unit));
                block.iter_mut().zip(column).for_each(|(line, value)| line[row] += value);
            }
            lines.extend(block);
        }
        let r = DMatrix::from_fn(lines.len(), n, |i, j| lines[i][j]).qr().r();
        let inverted = r.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let filled = |of: &DMatrix<f64>| {
            let mut local = [[0.0; PADDED]; PADDED];
            (0..n).for_each(|i| (0..n).for_each(|j| local[i][j] = of[(i, j)]));
            local
        };
        let (root, inverse) = (filled(&inverted), filled(&(&inverted * inverted.transpose())));
        let sound = inverse.iter().flatten().all(|value| value.is_finite());
        sound.then_some(Self { root, inverse })
    }

    /// S⁻¹ x for the `n` rows of the contact.
    pub fn times(&self, x: &[f64], n: usize) -> impl Iterator<Item = f64> + use<> {
        let mut half = [0.0; PADDED];
        (0..n).for_each(|k| half[k] = (0..=k).map(|i| self.root[i][k] * x[i]).sum());
        let root = self.root;
        (0..n).map(move |i| (i..n).map(|k| root[i][k] * half[k]).sum())
    }
}
