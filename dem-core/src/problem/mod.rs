//! The contact problem of one step: u = Hᵀ v, v = v_f + M⁻¹ H r, and one law per contact.
//!
//! The problem consists of nodes (velocities and inverse masses) and contacts, without bodies,
//! bonds or detection. It is matrix-free: the Delassus operator W = Hᵀ M⁻¹ H acts through the
//! velocities of the nodes.

pub mod assembled;
mod block_matrix;
pub(crate) mod blocks;
pub mod global;
mod link;
mod nodes;
pub mod residual;

pub use link::{Contact, Group, Link};
pub use nodes::{Node, Nodes};

use crate::contact::{Bonded, Coulomb, Elastic, Frictionless, Law, Local, PADDED};
use crate::dim::{Dim, Vect};
use std::sync::Arc;

/// The law of a dry contact in dimension D.
pub type Dry<D> = Coulomb<<D as Dim>::Slide>;
/// The law of an intact rigid bond in dimension D.
pub type RigidBond<D> = Bonded<<D as Dim>::Tangent, <D as Dim>::Moment>;
/// The law of an intact elastic bond in dimension D.
pub type ElasticBond<D> = Elastic<<D as Dim>::Tangent, <D as Dim>::Moment>;

/// The kinds of contacts, each a group of the problem, in the order in which they are visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Intact rigid bonds.
    Bonded,
    /// Intact elastic bonds.
    Elastic,
    /// Dry contacts with friction.
    Dry,
    /// Contacts without friction.
    Frictionless,
}

/// Number of kinds of contacts.
pub const KINDS: usize = 4;

/// The contact problem of one step.
#[derive(Clone, Debug)]
pub struct ContactProblem<D: Dim> {
    /// The velocities that the contacts act on.
    pub nodes: Nodes<D>,
    /// Free velocities v_f (m/s) and spins (rad/s) of the nodes.
    pub free: Arc<[(D::Vector, D::Spin)]>,
    /// Intact rigid bonds.
    pub bonded: Group<D, RigidBond<D>>,
    /// Intact elastic bonds.
    pub elastic: Group<D, ElasticBond<D>>,
    /// Dry contacts with friction.
    pub dry: Group<D, Dry<D>>,
    /// Contacts without friction.
    pub frictionless: Group<D, Frictionless>,
    /// Radii of the grains (m) in 3D, where the stiffness of a contact depends on them; empty in
    /// 2D.
    pub radii: Vec<f64>,
    /// Euclidean norm of the applied impulses h F_ext (N s), one scale of the residual.
    pub applied: f64,
    /// Whether it is a problem of statics: its bodies stay at rest, and velocities, those of
    /// light bodies too, are errors of the balance alone.
    pub is_static: bool,
}

/// An operation on every contact of a problem, whatever its law.
pub trait Visitor<D: Dim> {
    /// Called once for each contact: rigid bonds, elastic bonds, dry contacts, frictionless ones,
    /// each in the order of its group.
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, contact: &Contact<D, L>);
}

/// An operation that changes every contact.
pub trait VisitorMut<D: Dim> {
    /// Called once for each contact, in the order of [`Visitor::visit`].
    fn visit<L: Law>(&mut self, contact: &mut Contact<D, L>);
}

/// An operation on every group of contacts, for loops over contacts of one law.
pub trait GroupVisitor<D: Dim> {
    /// Called once for each group.
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, group: &Group<D, L>);
}

/// An operation that changes the contacts of every group and the velocities of the nodes.
pub trait GroupVisitorMut<D: Dim> {
    /// Called once for each group.
    fn visit<L: Law>(&mut self, nodes: &mut Nodes<D>, group: &mut Group<D, L>);
}

struct EachContact<'a, V>(&'a mut V);

impl<D: Dim, V: Visitor<D>> GroupVisitor<D> for EachContact<'_, V> {
    #[inline]
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, group: &Group<D, L>) {
        group.iter().for_each(|c| self.0.visit(nodes, c));
    }
}

impl<D: Dim, V: VisitorMut<D>> GroupVisitorMut<D> for EachContact<'_, V> {
    #[inline]
    fn visit<L: Law>(&mut self, _: &mut Nodes<D>, group: &mut Group<D, L>) {
        group.iter_mut().for_each(|c| self.0.visit(c));
    }
}

impl<D: Dim> ContactProblem<D> {
    /// A problem without contacts.
    pub fn new(nodes: Nodes<D>, free: Arc<[(D::Vector, D::Spin)]>, applied: f64) -> Self {
        let (bonded, elastic, dry, frictionless) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { nodes, free, bonded, elastic, dry, frictionless, radii: Vec::new(), applied, is_static: false }
    }

    /// Visit every group.
    #[inline]
    pub fn visit_groups(&self, visitor: &mut impl GroupVisitor<D>) {
        visitor.visit(&self.nodes, &self.bonded);
        visitor.visit(&self.nodes, &self.elastic);
        visitor.visit(&self.nodes, &self.dry);
        visitor.visit(&self.nodes, &self.frictionless);
    }

    /// Visit every group, to change it.
    #[inline]
    pub fn visit_groups_mut(&mut self, visitor: &mut impl GroupVisitorMut<D>) {
        visitor.visit(&mut self.nodes, &mut self.bonded);
        visitor.visit(&mut self.nodes, &mut self.elastic);
        visitor.visit(&mut self.nodes, &mut self.dry);
        visitor.visit(&mut self.nodes, &mut self.frictionless);
    }

    /// Visit every contact.
    #[inline]
    pub fn visit(&self, visitor: &mut impl Visitor<D>) {
        self.visit_groups(&mut EachContact(visitor));
    }

    /// Visit every contact, to change it.
    #[inline]
    pub fn visit_mut(&mut self, visitor: &mut impl VisitorMut<D>) {
        self.visit_groups_mut(&mut EachContact(visitor));
    }

    /// Number of contacts of each kind.
    pub fn lengths(&self) -> [usize; KINDS] {
        [self.bonded.len(), self.elastic.len(), self.dry.len(), self.frictionless.len()]
    }

    /// Reserve memory for exactly this many contacts of each kind: lists that grow by doubling
    /// would take twice the memory of a large problem.
    pub(crate) fn reserve(&mut self, [bonded, elastic, dry, frictionless]: [usize; KINDS]) {
        self.bonded.reserve_exact(bonded);
        self.elastic.reserve_exact(elastic);
        self.dry.reserve_exact(dry);
        self.frictionless.reserve_exact(frictionless);
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.lengths().into_iter().sum()
    }

    /// Whether there is no contact at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Memory of the contacts (bytes).
    pub fn contact_bytes(&self) -> usize {
        struct Bytes(usize);
        impl<D: Dim> GroupVisitor<D> for Bytes {
            fn visit<L: Law>(&mut self, _: &Nodes<D>, group: &Group<D, L>) {
                self.0 += size_of_val(group.as_slice());
            }
        }
        let mut bytes = Bytes(0);
        self.visit_groups(&mut bytes);
        bytes.0
    }

    /// All impulses in one list, contact by contact in the order of [`Visitor::visit`] (N s).
    pub fn reactions(&self) -> Vec<f64> {
        struct Gather(Vec<f64>);
        impl<D: Dim> Visitor<D> for Gather {
            fn visit<L: Law>(&mut self, _: &Nodes<D>, contact: &Contact<D, L>) {
                self.0.push(contact.r.n);
                self.0.extend_from_slice(contact.r.t.as_slice());
                self.0.extend_from_slice(contact.r.m.as_slice());
            }
        }
        let mut list = Gather(Vec::with_capacity(self.len() * PADDED));
        self.visit(&mut list);
        list.0
    }

    /// Set all impulses from a list in the form of [`ContactProblem::reactions`].
    pub fn set_reactions(&mut self, list: &[f64]) {
        struct Scatter<'a>(&'a [f64]);
        impl<D: Dim> VisitorMut<D> for Scatter<'_> {
            fn visit<L: Law>(&mut self, contact: &mut Contact<D, L>) {
                let (own, rest) = self.0.split_at(1 + L::T::LEN + L::B::LEN);
                contact.r.n = own[0];
                contact.r.t = L::T::from_slice(&own[1..][..L::T::LEN]);
                contact.r.m = L::B::from_slice(&own[1 + L::T::LEN..]);
                self.0 = rest;
            }
        }
        self.visit_mut(&mut Scatter(list));
    }

    /// Whether a bond is at its limit.
    pub fn is_at_limit(&self) -> bool {
        struct AtLimit(bool);
        impl<D: Dim> Visitor<D> for AtLimit {
            fn visit<L: Law>(&mut self, _: &Nodes<D>, contact: &Contact<D, L>) {
                self.0 |= contact.failure().is_some();
            }
        }
        let mut found = AtLimit(false);
        self.visit(&mut found);
        found.0
    }

    /// Set all impulses to zero.
    pub fn forget_reactions(&mut self) {
        struct Forget;
        impl<D: Dim> VisitorMut<D> for Forget {
            fn visit<L: Law>(&mut self, contact: &mut Contact<D, L>) {
                contact.r = Local::zero();
            }
        }
        self.visit_mut(&mut Forget);
    }

    /// Set the node velocities to v_f + M⁻¹ H r. This removes the round-off that many increments
    /// leave in them and in tangential vectors.
    pub fn velocities_from_reactions(&mut self) {
        struct Push;
        impl<D: Dim> GroupVisitorMut<D> for Push {
            fn visit<L: Law>(&mut self, nodes: &mut Nodes<D>, group: &mut Group<D, L>) {
                blocks::for_each(nodes, group, |span, c| {
                    c.r = c.link.without_drift(c.r);
                    span.apply(&c.link, c.law.arms(), c.r);
                });
            }
        }
        for (node, free) in self.nodes.all.iter_mut().zip(self.free.iter()) {
            (node.velocity, node.spin) = *free;
        }
        self.visit_groups_mut(&mut Push);
    }
}
