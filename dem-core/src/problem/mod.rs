//! The contact problem of one step: u = Hᵀ v, v = v_f + M⁻¹ H r, and one law per contact.
//!
//! It knows nodes (a velocity and inverse masses) and contacts, and no bodies, bonds or detection. It is
//! matrix-free: the Delassus operator W = Hᵀ M⁻¹ H acts through the velocities of the nodes.

pub mod assembled;
pub mod residual;

use crate::contact::{Block, Bonded, Coulomb, Elastic, Frictionless, Law, Local};
use crate::dim::{Dim, Vect, resized};

/// The velocity unknowns of one body, and what an impulse does to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<D: Dim> {
    /// Velocity of the centre (m/s).
    pub velocity: D::Vector,
    /// Angular velocity (rad/s).
    pub spin: D::Spin,
    /// Inverse mass (1/kg), zero when the body does not yield.
    pub inverse_mass: f64,
    /// Inverse moment of inertia (1/(kg m²)), zero when the body does not turn.
    pub inverse_inertia: f64,
}

/// Geometry of a contact between node i and node j: the linear map between node velocities and relative velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<D: Dim> {
    /// Nodes i and j; the normal points from j to i. `j` may be a wall.
    pub nodes: [u32; 2],
    /// Orthonormal frame (n, t…).
    pub frame: D::Frame,
    /// Distances from the centres of i and j to the contact point along the normal (m).
    pub lever: [f64; 2],
}

/// One contact of the problem: its geometry, its law and its impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<D: Dim, L: Law> {
    /// Nodes, frame and levers.
    pub link: Link<D>,
    /// Law with the constants of the local solve.
    pub law: L,
    /// Impulse of j on i in the contact frame (N s).
    pub r: Local<L::T, L::B>,
}

impl<D: Dim> Link<D> {
    /// Local Delassus block for two nodes; `arm` is the mean diameter (m). `drive` is the direction of the one degree of freedom of
    /// a force-driven wall j, if it is one.
    pub fn block(&self, i: &Node<D>, j: &Node<D>, arm: f64, drive: Option<D::Vector>) -> Block {
        let [li, lj] = self.lever;
        let spin = i.inverse_inertia + j.inverse_inertia;
        let mut block = Block {
            n: i.inverse_mass + j.inverse_mass,
            t: i.inverse_mass + j.inverse_mass + li * li * i.inverse_inertia + lj * lj * j.inverse_inertia,
            m: arm * arm * spin,
            tm: arm * (lj * j.inverse_inertia - li * i.inverse_inertia),
        };
        if let Some(d) = drive {
            // the wall yields along d alone: a diagonal that dominates (n·d)², (t·d)² and their coupling
            let (along, across) = D::split(&self.frame, d);
            let across = across.norm();
            let coupling = (along * across).abs();
            block.n = i.inverse_mass + j.inverse_mass * (along * along + coupling);
            block.t = i.inverse_mass + li * li * i.inverse_inertia + j.inverse_mass * (across * across + coupling);
            // no impulse changes a row whose bodies do not yield along it: any positive entry serves
            let some = block.n.max(block.t);
            block.n = if block.n == 0.0 { some } else { block.n };
            block.t = if block.t == 0.0 { some } else { block.t };
        }
        block
    }
}

/// Contacts with the same rows, sorted by key.
pub type Group<D, L> = Vec<Contact<D, L>>;

/// The law of a dry contact in dimension D.
pub type Dry<D> = Coulomb<<D as Dim>::Tangent>;
/// The law of an intact rigid bond in dimension D.
pub type Bond<D> = Bonded<<D as Dim>::Tangent, <D as Dim>::Tangent>;
/// The law of an intact elastic bond in dimension D.
pub type ElasticBond<D> = Elastic<<D as Dim>::Tangent, <D as Dim>::Tangent>;

/// The contact problem of one step.
#[derive(Clone, Debug)]
pub struct ContactProblem<D: Dim> {
    /// The velocities that the contacts act on.
    pub nodes: Nodes<D>,
    /// Free velocities v_f (m/s) and spins (rad/s) of the nodes.
    pub free: Vec<(D::Vector, D::Spin)>,
    /// Intact rigid bonds.
    pub bonded: Group<D, Bond<D>>,
    /// Intact elastic bonds.
    pub elastic: Group<D, ElasticBond<D>>,
    /// Dry contacts with friction.
    pub dry: Group<D, Dry<D>>,
    /// Contacts without friction.
    pub frictionless: Group<D, Frictionless>,
    /// Euclidean norm of the applied impulses h F_ext (N s), one scale of the residual.
    pub applied: f64,
}

/// Node velocities: grains first, then walls.
#[derive(Clone, Debug)]
pub struct Nodes<D: Dim> {
    /// Grains, then walls.
    pub all: Vec<Node<D>>,
    /// Number of grains.
    pub grains: usize,
    /// Unit direction in which each wall yields to impulses; zero for a wall that does not.
    pub drives: Vec<D::Vector>,
}

impl<D: Dim> Nodes<D> {
    /// Relative velocity u = Hᵀ v of node i with respect to node j at the contact point.
    #[inline(always)]
    pub fn relative_velocity<T: Vect, B: Vect>(&self, link: &Link<D>, arm: f64) -> Local<T, B> {
        let [i, j] = link.nodes.map(|node| &self.all[node as usize]);
        let (n, t) = D::split(&link.frame, i.velocity - j.velocity);
        if T::LEN == 0 {
            return Local { n, ..Local::zero() };
        }
        let turn = D::spin_rows(&link.frame, i.spin * link.lever[0] + j.spin * link.lever[1]);
        let m = if B::LEN == 0 { B::zero() } else { resized(D::spin_rows(&link.frame, (i.spin - j.spin) * arm)) };
        Local { n, t: resized(t - turn), m }
    }

    /// Add the impulse r of node j on node i: v += M⁻¹ H r.
    #[inline(always)]
    pub fn apply<T: Vect, B: Vect>(&mut self, link: &Link<D>, arm: f64, r: Local<T, B>) {
        let [i, j] = link.nodes.map(|node| node as usize);
        let (t, m): (D::Tangent, D::Tangent) = (resized(r.t), resized(r.m));
        let impulse = D::compose(&link.frame, r.n, t);
        let node = &mut self.all[i];
        node.velocity += impulse * node.inverse_mass;
        if T::LEN > 0 {
            let turn = D::spin_rows_transposed(&link.frame, t * -link.lever[0] + m * arm);
            node.spin += turn * node.inverse_inertia;
        }
        let node = &mut self.all[j];
        if j >= self.grains {
            let drive = self.drives[j - self.grains];
            node.velocity -= drive * (drive.dot(&impulse) * node.inverse_mass);
            return;
        }
        node.velocity -= impulse * node.inverse_mass;
        if T::LEN > 0 {
            let turn = D::spin_rows_transposed(&link.frame, t * -link.lever[1] - m * arm);
            node.spin += turn * node.inverse_inertia;
        }
    }
}

/// A fold over all contacts of a problem, whatever their rows.
pub trait Visitor<D: Dim> {
    /// Called once for each contact: rigid bonds, elastic bonds, dry contacts, frictionless ones, each in the order of
    /// their keys.
    fn visit<L: Law>(&mut self, nodes: &Nodes<D>, contact: &Contact<D, L>);
}

impl<D: Dim> ContactProblem<D> {
    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.bonded.len() + self.elastic.len() + self.dry.len() + self.frictionless.len()
    }

    /// Whether there is no contact at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Visit every contact.
    pub fn visit(&self, visitor: &mut impl Visitor<D>) {
        self.bonded.iter().for_each(|c| visitor.visit(&self.nodes, c));
        self.elastic.iter().for_each(|c| visitor.visit(&self.nodes, c));
        self.dry.iter().for_each(|c| visitor.visit(&self.nodes, c));
        self.frictionless.iter().for_each(|c| visitor.visit(&self.nodes, c));
    }

    /// Set all impulses to zero.
    pub fn forget_reactions(&mut self) {
        self.bonded.iter_mut().for_each(|c| c.r = Local::zero());
        self.elastic.iter_mut().for_each(|c| c.r = Local::zero());
        self.dry.iter_mut().for_each(|c| c.r = Local::zero());
        self.frictionless.iter_mut().for_each(|c| c.r = Local::zero());
    }

    /// Set the node velocities to v_f + M⁻¹ H r, free of the rounding that a long series of increments leaves.
    pub fn velocities_from_reactions(&mut self) {
        for (node, free) in self.nodes.all.iter_mut().zip(&self.free) {
            (node.velocity, node.spin) = *free;
        }
        let nodes = &mut self.nodes;
        self.bonded.iter().for_each(|c| nodes.apply(&c.link, c.law.arm(), c.r));
        self.elastic.iter().for_each(|c| nodes.apply(&c.link, c.law.arm(), c.r));
        self.dry.iter().for_each(|c| nodes.apply(&c.link, c.law.arm(), c.r));
        self.frictionless.iter().for_each(|c| nodes.apply(&c.link, c.law.arm(), c.r));
    }
}
