//! How contacts move each other: W = H̃ᵀ H̃ through the bodies, or as a matrix, and the linear systems with it.

use super::sites::Sites;
use crate::linear::{Lu, Tree};
use crate::problem::assembled::BlockMatrix;
use crate::solver::graph::Graph;
use crate::solver::rows::Rows;

/// The Delassus operator over the rows of [`Sites`], in their units.
pub(super) enum Coupling<'a> {
    /// Through the unknowns of the bodies. The matrix of a step is 1 + Σ H̃ D⁻¹ H̃ᵀ, of the size of the bodies.
    Bodies {
        rows: &'a Rows,
        /// Coefficients over those of `rows`.
        scale: f64,
        graph: &'a Graph,
    },
    /// A matrix over the contacts. That of a step is 1 + W D⁻¹.
    Matrix {
        matrix: &'a BlockMatrix,
        scale: f64,
        /// The contacts of each element, one of them twice for a block of the diagonal.
        pairs: Vec<[usize; 2]>,
        tree: Tree,
    },
}

impl<'a> Coupling<'a> {
    /// Through the bodies of `rows`.
    pub fn bodies(rows: &'a Rows, speed_over_force: f64, graph: &'a Graph) -> Self {
        Self::Bodies { rows, scale: 1.0 / speed_over_force.sqrt(), graph }
    }

    /// By a matrix.
    pub fn matrix(matrix: &'a BlockMatrix, sites: &Sites, speed_over_force: f64) -> Option<Self> {
        let mut pairs = Vec::new();
        for c in 0..matrix.contacts() {
            pairs.extend(matrix.row(c).filter(|(d, _)| *d >= c).map(|(d, _)| [c, d]));
        }
        let tree = Tree::new(sites.list.iter().map(|site| site.rows).collect(), pairs.clone())?;
        Some(Self::Matrix { matrix, scale: 1.0 / speed_over_force, pairs, tree })
    }

    fn tree(&self) -> &Tree {
        match self {
            Self::Bodies { graph, .. } => &graph.tree,
            Self::Matrix { tree, .. } => tree,
        }
    }

    /// W r.
    pub fn velocity(&self, sites: &Sites, r: &[f64]) -> Vec<f64> {
        match self {
            Self::Bodies { .. } => self.pulled(sites, &self.pushed(sites, r)),
            Self::Matrix { matrix, scale, .. } => {
                let mut u = vec![0.0; sites.rows];
                for (c, site) in sites.list.iter().enumerate() {
                    for (d, block) in matrix.row(c) {
                        let other = &sites.list[d];
                        for i in 0..site.rows {
                            let line = &block[site.of[i] * matrix.size()..][..matrix.size()];
                            let own = other.of[..other.rows].iter().zip(other.part(r));
                            u[site.at + i] += scale * own.map(|(k, r)| line[*k] * r).sum::<f64>();
                        }
                    }
                }
                u
            }
        }
    }

    /// H̃ r, in the unknowns of the bodies.
    fn pushed(&self, sites: &Sites, r: &[f64]) -> Vec<f64> {
        let Self::Bodies { rows, scale, .. } = self else { return Vec::new() };
        let mut y = vec![0.0; rows.unknowns];
        for (site, row) in sites.list.iter().zip(&rows.list) {
            site.of.iter().zip(site.part(r)).for_each(|(k, r)| rows.push_by(row, *k, *scale, *r, &mut y));
        }
        y
    }

    /// H̃ᵀ y.
    fn pulled(&self, sites: &Sites, y: &[f64]) -> Vec<f64> {
        let Self::Bodies { rows, scale, .. } = self else { return Vec::new() };
        let mut u = vec![0.0; sites.rows];
        for (site, row) in sites.list.iter().zip(&rows.list) {
            let own = site.of.iter().zip(site.part_mut(&mut u));
            own.for_each(|(k, u)| *u = scale * rows.pulled_by(row, *k, y));
        }
        u
    }

    /// Factorise the matrix of a step, whose D⁻¹ stands in the upper left corners of the local matrices.
    pub fn factorise(&self, sites: &Sites, inverses: &[f64], lu: &mut Lu) -> bool {
        match self {
            Self::Bodies { rows, scale, graph } => lu.factorise(self.tree(), |e, out| {
                let c = graph.contacts[e];
                let (row, site) = (&rows.list[c], &sites.list[c]);
                let (own, square) = (&inverses[site.matrix..], scale * scale);
                let entry = |i: usize, j: usize| square * own[i * site.order() + j];
                rows.add_element(row, &site.of[..site.rows], entry, out);
            }),
            Self::Matrix { matrix, scale, pairs, tree } => lu.factorise(tree, |e, out| {
                let [c, d] = pairs[e];
                let first = sites.list[c].rows;
                let width = if c == d { first } else { first + sites.list[d].rows };
                let mut add = |c: usize, d: usize, row: usize, column: usize| {
                    let Some((_, block)) = matrix.row(c).find(|(k, _)| *k == d) else { return };
                    let (site, other) = (&sites.list[c], &sites.list[d]);
                    let own = &inverses[other.matrix..];
                    for i in 0..site.rows {
                        let line = &block[site.of[i] * matrix.size()..][..matrix.size()];
                        for k in 0..other.rows {
                            let w = scale * line[other.of[k]];
                            for j in 0..other.rows {
                                out[(row + i) * width + column + j] += w * own[k * other.order() + j];
                            }
                        }
                    }
                };
                add(c, d, 0, if c == d { 0 } else { first });
                if c != d {
                    add(d, c, first, 0);
                }
            }),
        }
    }

    /// The velocities that reactions `r` would give the contacts if these did not yield, as they are when they do.
    pub fn yielded(&self, sites: &Sites, r: &[f64], lu: &Lu) -> Vec<f64> {
        match self {
            Self::Bodies { .. } => {
                let mut y = self.pushed(sites, r);
                lu.solve(self.tree(), &mut y);
                self.pulled(sites, &y)
            }
            Self::Matrix { .. } => {
                let mut u = self.velocity(sites, r);
                lu.solve(self.tree(), &mut u);
                u
            }
        }
    }
}
