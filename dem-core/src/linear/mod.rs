//! Sparse factorisation of matrices on the graph of bodies.
//!
//! A matrix is a sum of small dense ones, one for each *element* (a contact) over the unknowns of
//! its *nodes* (its bodies), on top of the identity. It is not symmetric if contacts slip, but its
//! pattern is. The multifrontal method (Duff & Reid, ACM Trans. Math. Softw. 9, 1983) factorises it
//! along the elimination tree of the graph of nodes, in dense fronts. [`Tree`] is the symbolic
//! part, which depends on the graph alone, [`Factors`] the numeric part, shared among threads if
//! the matrix is large.

mod dense;
mod factors;
mod front_factors;
mod front_values;
mod tree;

pub(crate) use factors::Factors;
pub(crate) use tree::Tree;
