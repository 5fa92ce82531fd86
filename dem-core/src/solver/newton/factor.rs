//! The matrix I + Σ H̃ A H̃ᵀ of a Newton step and its factors, which are kept while refinement with
//! them converges.

use crate::linear::{Factors, Tree};
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::graph::Graph;
use crate::solver::rows::{Operator, PAIR, Rows};
use std::sync::Arc;

/// Factors, and the matrices from which they were computed.
struct Cached {
    graph: Arc<Graph>,
    /// The matrices of all elements, one after the other.
    elements: Vec<f64>,
    factors: Factors,
}

/// The cached factors. A copy shares them until either copy renews its own.
#[derive(Clone, Default)]
pub(super) struct Factor {
    cached: Option<Arc<Cached>>,
    /// Whether the factors must be renewed.
    pub stale: bool,
    /// Factorisations so far.
    pub made: u64,
}

impl Factor {
    /// Whether the factors can be tried for this many unknowns.
    pub fn fits(&self, unknowns: usize) -> bool {
        !self.stale && self.cached.as_ref().is_some_and(|cached| cached.graph.tree.unknowns() == unknowns)
    }

    /// Factorise I + Σ H̃ A H̃ᵀ for these operators; false if the matrix is singular to round-off.
    pub fn renew(&mut self, rows: &Rows, operators: &[Option<Operator>], graph: Arc<Graph>) -> bool {
        self.made += 1;
        // reuse the memory of the old factors, unless a copy shares them
        let (mut elements, factors) = match self.cached.take().and_then(Arc::into_inner) {
            Some(old) => (old.elements, old.factors),
            None => (Vec::new(), Factors::default()),
        };
        elements.clear();
        for c in &graph.contacts {
            let (row, first) = (&rows.list[*c], elements.len());
            elements.resize(first + row.width() * row.width(), 0.0);
            if let Some(a) = &operators[*c] {
                let all: Vec<usize> = (0..row.rows.len()).collect();
                let entry = |i: usize, j: usize| a.entry(row.rows[i], row.rows[j]);
                rows.add_element(row, &all, entry, &mut elements[first..]);
            }
        }
        self.factorise(Cached { graph, elements, factors })
    }

    fn factorise(&mut self, mut cached: Cached) -> bool {
        let Cached { graph, elements, factors } = &mut cached;
        let mut next = 0;
        let starts: Vec<usize> = (0..graph.contacts.len())
            .map(|e| {
                let width = graph.tree.width(e);
                next += width * width;
                next - width * width
            })
            .collect();
        let made = factors.factorise(&graph.tree, |e, out| {
            let n = out.len();
            out.copy_from_slice(&elements[starts[e]..][..n]);
        });
        self.stale = made.is_none();
        self.cached = Some(Arc::new(cached));
        made.is_some()
    }

    /// x ← (I + Σ H̃ A H̃ᵀ)⁻¹ x, with the factors.
    pub fn solve(&self, x: &mut [f64]) {
        if let Some(cached) = &self.cached {
            cached.factors.solve(&cached.graph.tree, x);
        }
    }

    /// Write the matrices from which the factors were computed.
    pub fn save(&self, to: &mut Saved) {
        let kept = self.cached.as_ref().filter(|_| !self.stale);
        to.flag(kept.is_some());
        let Some(Cached { graph, elements: values, .. }) = kept.map(AsRef::as_ref) else { return };
        let (sizes, elements) = graph.tree.nodes_and_elements();
        to.count(sizes.len());
        sizes.iter().for_each(|size| to.count(*size));
        to.count(elements.len());
        elements.iter().flatten().chain(&graph.contacts).for_each(|n| to.count(*n));
        to.count(values.len());
        to.reals.extend_from_slice(values);
    }

    /// The same factors, recomputed from what [`Factor::save`] wrote.
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let mut factor = Self { stale: true, ..Self::default() };
        if !from.flag()? {
            return Ok(factor);
        }
        let nodes = from.number_of()?;
        let sizes = (0..nodes).map(|_| from.count()).collect::<Result<Vec<_>, _>>()?;
        let count = from.number_of()?;
        let mut elements = Vec::with_capacity(count);
        for _ in 0..count {
            elements.push([from.count()?, from.count()?]);
        }
        let contacts = (0..count).map(|_| from.count()).collect::<Result<Vec<_>, _>>()?;
        if sizes.iter().any(|size| *size > PAIR) || elements.iter().flatten().any(|node| *node >= nodes) {
            return Err(Mismatch);
        }
        let tree = Tree::new(sizes, elements).ok_or(Mismatch)?;
        let values = from.number_of()?;
        if (0..count).map(|e| tree.width(e).pow(2)).sum::<usize>() != values {
            return Err(Mismatch);
        }
        let elements = from.reals(values)?.to_vec();
        let graph = Arc::new(Graph { tree, contacts });
        let cached = Cached { graph, elements, factors: Factors::default() };
        if factor.factorise(cached) { Ok(factor) } else { Err(Mismatch) }
    }
}
