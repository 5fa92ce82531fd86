//! The matrix I + Σ H̃ A H̃ᵀ of a Newton step and its factors, kept while they serve.

use crate::contact::PADDED;
use crate::linear::{Lu, Tree};
use crate::saved::{Mismatch, Reader, Saved};
use crate::solver::graph::Graph;
use crate::solver::rows::{Operator, PAIR, Rows};
use std::sync::Arc;

/// Factors, and what they were made of.
#[derive(Default)]
pub(super) struct Factor {
    graph: Option<Arc<Graph>>,
    /// The matrices of all elements on end.
    elements: Vec<f64>,
    lu: Lu,
    /// Whether they must be made anew.
    pub stale: bool,
    /// Factorisations so far.
    pub made: u64,
}

impl Factor {
    /// Whether they can be tried for this many unknowns.
    pub fn serves(&self, unknowns: usize) -> bool {
        !self.stale && self.graph.as_ref().is_some_and(|graph| graph.tree.unknowns() == unknowns)
    }

    /// Factorise I + Σ H̃ A H̃ᵀ for these operators; false if it has no inverse to rounding.
    pub fn renew(&mut self, rows: &Rows, operators: &[Option<Operator>], graph: Arc<Graph>) -> bool {
        self.made += 1;
        self.elements.clear();
        for c in &graph.contacts {
            add_element(rows, *c, operators[*c].as_ref(), &mut self.elements);
        }
        self.graph = Some(graph);
        self.factorise()
    }

    fn factorise(&mut self) -> bool {
        let Some(graph) = &self.graph else { return false };
        let (elements, mut next) = (&self.elements, 0);
        // each element is asked for once, but in the order of the fronts
        let starts: Vec<usize> = (0..graph.contacts.len())
            .map(|e| {
                let width = graph.tree.width(e);
                next += width * width;
                next - width * width
            })
            .collect();
        let made = self.lu.factorise(&graph.tree, |e, out| {
            let n = out.len();
            out.copy_from_slice(&elements[starts[e]..][..n]);
        });
        self.stale = !made;
        made
    }

    /// x ← the inverse of the matrix times x.
    pub fn solve(&self, x: &mut [f64]) {
        if let Some(graph) = &self.graph {
            self.lu.solve(&graph.tree, x);
        }
    }

    /// Write what the factors were made of.
    pub fn save(&self, to: &mut Saved) {
        let kept = self.graph.as_ref().filter(|_| !self.stale);
        to.flag(kept.is_some());
        let Some(graph) = kept else { return };
        let (sizes, elements) = graph.tree.nodes_and_elements();
        to.count(sizes.len());
        sizes.iter().for_each(|size| to.count(*size));
        to.count(elements.len());
        elements.iter().flatten().chain(&graph.contacts).for_each(|n| to.count(*n));
        to.count(self.elements.len());
        to.reals.extend_from_slice(&self.elements);
    }

    /// The same factors, made anew of what [`Factor::save`] wrote.
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
        factor.elements = from.reals(values)?.to_vec();
        factor.graph = Some(Arc::new(Graph { tree, contacts }));
        if factor.factorise() { Ok(factor) } else { Err(Mismatch) }
    }
}

/// H̃ A H̃ᵀ of one contact, row by row over the unknowns of its pair.
fn add_element(rows: &Rows, c: usize, operator: Option<&Operator>, out: &mut Vec<f64>) {
    let row = &rows.list[c];
    let width = row.count[0] + row.count[1];
    let first = out.len();
    out.resize(first + width * width, 0.0);
    let Some(a) = operator else { return };
    let h = |k: usize| &rows.coefficients[row.start + k * width..][..width];
    // A H̃ᵀ
    let mut pulled = [[0.0; PAIR]; PADDED];
    for (k, place) in row.rows.iter().enumerate() {
        for (l, other) in row.rows.iter().enumerate() {
            let entry = a.entry(*place, *other);
            if entry != 0.0 {
                pulled[k].iter_mut().zip(h(l)).for_each(|(x, h)| *x += entry * h);
            }
        }
    }
    for (r, line) in out[first..].chunks_exact_mut(width.max(1)).enumerate() {
        for (k, pulled) in pulled.iter().enumerate().take(row.rows.len()) {
            let h = h(k)[r];
            line.iter_mut().zip(pulled).for_each(|(x, p)| *x += h * p);
        }
    }
}
