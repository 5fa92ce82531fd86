//! The Delassus operator W = H̃ᵀ H̃, through the bodies or as a matrix, and the linear systems with
//! it.

use super::sites::{Site, Sites};
use crate::linear::{Factors, Tree};
use crate::problem::assembled::BlockMatrix;
use crate::solver::graph::Graph;
use crate::solver::rows::Rows;
use crate::solver::twofold::Twofold;

/// The Delassus operator over the rows of [`Sites`], in their units.
pub(super) enum Coupling<'a> {
    /// Through the unknowns of the bodies. The matrix of a step is 1 + Σ H̃ D⁻¹ H̃ᵀ, of the size of
    /// the bodies.
    Bodies {
        rows: &'a Rows,
        /// Ratio of the coefficients to those of `rows`.
        scale: f64,
        graph: &'a Graph,
    },
    /// W as a symmetric matrix over the contacts. The matrix of a step is 1 + W D⁻¹.
    Matrix {
        /// The upper triangle, block by block: an element of `tree` each.
        blocks: Vec<CouplingBlock>,
        /// Their values.
        values: Vec<f64>,
        tree: Tree,
    },
}

/// A block of W in the units of [`Sites`]: the rows of the first contact, one after the other, over
/// those of the second (the same contact for a diagonal block).
pub(super) struct CouplingBlock {
    contacts: [usize; 2],
    /// Start of its values.
    start: usize,
}

impl<'a> Coupling<'a> {
    /// By the matrix if the problem is given by one, else through the bodies; none if no
    /// elimination tree can be made.
    pub fn of(
        rows: &'a Rows,
        matrix: Option<&BlockMatrix>,
        graph: Option<&'a Graph>,
        sites: &Sites,
        speed_over_force: f64,
    ) -> Option<Self> {
        match matrix {
            Some(matrix) => Self::matrix(matrix, sites, speed_over_force),
            None => graph.map(|graph| Self::bodies(rows, speed_over_force, graph)),
        }
    }

    /// Through the bodies of `rows`.
    fn bodies(rows: &'a Rows, speed_over_force: f64, graph: &'a Graph) -> Self {
        Self::Bodies { rows, scale: 1.0 / speed_over_force.sqrt(), graph }
    }

    /// By a symmetric matrix, of which the upper triangle is read.
    fn matrix(matrix: &BlockMatrix, sites: &Sites, speed_over_force: f64) -> Option<Self> {
        let (scale, size) = (1.0 / speed_over_force, matrix.size());
        let (mut blocks, mut values) = (Vec::new(), Vec::new());
        for (c, site) in sites.list.iter().enumerate() {
            for (d, block) in matrix.row(c).filter(|(d, _)| *d >= c) {
                blocks.push(CouplingBlock { contacts: [c, d], start: values.len() });
                let other = &sites.list[d];
                for row in &site.of[..site.rows] {
                    values.extend(other.of[..other.rows].iter().map(|k| scale * block[row * size + k]));
                }
            }
        }
        let sizes = sites.list.iter().map(|site| site.rows).collect();
        let tree = Tree::new(sizes, blocks.iter().map(|block| block.contacts).collect())?;
        Some(Self::Matrix { blocks, values, tree })
    }

    fn tree(&self) -> &Tree {
        match self {
            Self::Bodies { graph, .. } => &graph.tree,
            Self::Matrix { tree, .. } => tree,
        }
    }

    /// q + W r. Through the bodies in twice the precision: the terms of sticking contacts cancel to
    /// 1/κ of their size.
    pub fn relative_velocity(&self, sites: &Sites, r: &[f64]) -> Vec<f64> {
        let Self::Bodies { rows, scale, .. } = self else {
            return sites.free.iter().zip(self.velocity(sites, r)).map(|(q, u)| q + u).collect();
        };
        let mut y = vec![Twofold::default(); rows.unknowns];
        for (site, row) in sites.list.iter().zip(&rows.list) {
            site.of.iter().zip(site.part(r)).for_each(|(k, r)| rows.push_twofold(row, *k, *r, &mut y));
        }
        let (mut u, square) = (sites.free.clone(), scale * scale);
        for (site, row) in sites.list.iter().zip(&rows.list) {
            for (k, u) in site.of.iter().zip(site.part_mut(&mut u)) {
                let mut sum = Twofold::from(*u);
                sum.add_scaled(square, rows.pulled_twofold(row, *k, &y));
                *u = sum.rounded();
            }
        }
        u
    }

    /// W r.
    pub fn velocity(&self, sites: &Sites, r: &[f64]) -> Vec<f64> {
        match self {
            Self::Bodies { rows, scale, .. } => sites.pulled(rows, *scale, &sites.pushed(rows, *scale, r)),
            Self::Matrix { blocks, values, .. } => {
                let mut u = vec![0.0; sites.rows];
                for block in blocks {
                    block.multiply(sites, values, r, &mut u);
                }
                u
            }
        }
    }

    /// Factorise the matrix of a step; D⁻¹ is in the upper left corners of the inverses of the
    /// local matrices. Returns the sign of the determinant; none if the matrix is singular.
    pub fn factorise(&self, sites: &Sites, inverses: &[f64], factors: &mut Factors) -> Option<f64> {
        match self {
            Self::Bodies { rows, scale, graph } => factors.factorise(self.tree(), |e, out| {
                let c = graph.contacts[e];
                let (row, site) = (&rows.list[c], &sites.list[c]);
                let (own, square) = (&inverses[site.matrix..], scale * scale);
                let entry = |i: usize, j: usize| square * own[i * site.order() + j];
                rows.add_element(row, &site.of[..site.rows], entry, out);
            }),
            Self::Matrix { blocks, values, tree } => {
                factors.factorise(tree, |e, out| blocks[e].add_element(sites, values, inverses, out))
            }
        }
    }

    /// The contact velocities (1 + W D⁻¹)⁻¹ W r: reactions `r` with the response of the contacts.
    pub fn yielded(&self, sites: &Sites, r: &[f64], factors: &Factors) -> Vec<f64> {
        match self {
            Self::Bodies { rows, scale, .. } => {
                let mut y = sites.pushed(rows, *scale, r);
                factors.solve(self.tree(), &mut y);
                sites.pulled(rows, *scale, &y)
            }
            Self::Matrix { .. } => {
                let mut u = self.velocity(sites, r);
                factors.solve(self.tree(), &mut u);
                u
            }
        }
    }
}

impl CouplingBlock {
    /// u += W r for this block and its transpose.
    fn multiply(&self, sites: &Sites, values: &[f64], r: &[f64], u: &mut [f64]) {
        let [site, other] = self.contacts.map(|c| &sites.list[c]);
        let block = values[self.start..].chunks_exact(other.rows).take(site.rows);
        for (i, line) in block.enumerate() {
            u[site.at + i] += line.iter().zip(other.part(r)).map(|(w, r)| w * r).sum::<f64>();
            if self.contacts[0] != self.contacts[1] {
                let own = r[site.at + i];
                other.part_mut(u).iter_mut().zip(line).for_each(|(u, w)| *u += w * own);
            }
        }
    }

    /// Add W D⁻¹ of this block and its transpose, over the rows of both contacts.
    fn add_element(&self, sites: &Sites, values: &[f64], inverses: &[f64], out: &mut [f64]) {
        let [site, other] = self.contacts.map(|c| &sites.list[c]);
        let apart = self.contacts[0] != self.contacts[1];
        let (first, width) = if apart { (site.rows, site.rows + other.rows) } else { (0, site.rows) };
        let line = |of: &Site, row: usize| &inverses[of.matrix + row * of.order()..][..of.rows];
        let block = values[self.start..].chunks_exact(other.rows).take(site.rows);
        for (i, values) in block.enumerate() {
            for (k, w) in values.iter().enumerate() {
                let right = &mut out[i * width + first..][..other.rows];
                right.iter_mut().zip(line(other, k)).for_each(|(out, d)| *out += w * d);
                if apart {
                    let left = &mut out[(first + k) * width..][..site.rows];
                    left.iter_mut().zip(line(site, i)).for_each(|(out, d)| *out += w * d);
                }
            }
        }
    }
}
