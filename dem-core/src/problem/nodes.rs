//! The velocities that contacts act on: v += M⁻¹ H r.

use super::link::Link;
use crate::contact::{Arms, Block, Local};
use crate::dim::{Axes, Dim, Moments, Vect, is_vector, resized};

/// The velocity unknowns of one body and its inverse masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<D: Dim> {
    /// Velocity of the centre (m/s).
    pub velocity: D::Vector,
    /// Angular velocity (rad/s).
    pub spin: D::Spin,
    /// Inverse mass (1/kg), zero if impulses do not move the body.
    pub inverse_mass: f64,
    /// Inverse moment of inertia (1/(kg m²)), zero if impulses do not turn the body.
    pub inverse_inertia: f64,
}

impl<D: Dim> Node<D> {
    /// Norm of the impulse that gives the body this velocity and spin (N s); the spin counts by the
    /// radius of gyration. Zero if impulses do not move it.
    pub fn impulse(&self, velocity: &D::Vector, spin: &D::Spin) -> f64 {
        let over = |size: f64, inverse: f64| if inverse > 0.0 { size / inverse } else { 0.0 };
        let turning = over(spin.norm(), (self.inverse_mass * self.inverse_inertia).sqrt());
        over(velocity.norm(), self.inverse_mass).hypot(turning)
    }
}

/// Node velocities: grains first, then walls.
#[derive(Clone, Debug)]
pub struct Nodes<D: Dim> {
    /// Grains, then walls.
    pub all: Vec<Node<D>>,
    /// Number of grains.
    pub grains: usize,
    /// Unit direction in which impulses move each wall; zero for a wall that they do not move.
    pub drives: Vec<D::Vector>,
    /// Prescribed velocity of each wall across its drive (m/s), which no impulse changes; empty if
    /// no wall has one.
    pub slides: Vec<D::Vector>,
}

/// Consecutive nodes: a block of grains, or all grains and walls.
pub(crate) struct Span<'a, D: Dim> {
    pub(super) all: &'a mut [Node<D>],
    /// Index of the first.
    pub(super) first: usize,
    /// Number of grains among them.
    pub(super) grains: usize,
    pub(super) drives: &'a [D::Vector],
}

impl<D: Dim> Nodes<D> {
    /// Relative velocity u = Hᵀ v of node i with respect to node j at the contact point.
    #[inline(always)]
    pub fn relative_velocity<T: Vect, B: Moments>(&self, link: &Link<D, impl Axes<D>>, arms: Arms) -> Local<T, B> {
        let [i, j] = link.nodes.map(|node| self.all[node as usize].motion());
        link.relative_velocity(arms, i, j)
    }

    /// Add the impulse r of node j on node i: v += M⁻¹ H r.
    #[inline(always)]
    pub fn apply<T: Vect, B: Moments>(&mut self, link: &Link<D, impl Axes<D>>, arms: Arms, r: Local<T, B>) {
        self.span().apply(link, arms, r);
    }

    /// Local Delassus block of a contact.
    #[inline(always)]
    pub fn block(&self, link: &Link<D>, arms: Arms) -> Block {
        let [i, j] = link.nodes.map(|k| &self.all[k as usize]);
        let Arms { lever: [li, lj], bending: arm } = arms;
        let spin = i.inverse_inertia + j.inverse_inertia;
        let mut block = Block {
            n: i.inverse_mass + j.inverse_mass,
            t: i.inverse_mass + j.inverse_mass + li * li * i.inverse_inertia + lj * lj * j.inverse_inertia,
            m: arm * arm * spin,
            w: arm * arm * spin,
            tm: arm * (lj * j.inverse_inertia - li * i.inverse_inertia),
        };
        let drive = (link.nodes[1] as usize).checked_sub(self.grains).map(|wall| self.drives[wall]);
        if let Some(d) = drive.filter(|_| j.inverse_mass > 0.0) {
            // the wall moves along d alone: the diagonal dominates (n·d)², (t·d)² and their
            // coupling
            let (along, across) = D::split(&link.axes, d);
            let across = across.norm();
            let coupling = (along * across).abs();
            block.n = i.inverse_mass + j.inverse_mass * (along * along + coupling);
            block.t = i.inverse_mass + li * li * i.inverse_inertia + j.inverse_mass * (across * across + coupling);
            // if no body moves along a row, impulses do not change it: any positive entry is valid
            let some = block.n.max(block.t);
            block.n = if block.n == 0.0 { some } else { block.n };
            block.t = if block.t == 0.0 { some } else { block.t };
        }
        block
    }

    pub(super) fn span(&mut self) -> Span<'_, D> {
        Span { first: 0, all: &mut self.all, grains: self.grains, drives: &self.drives }
    }
}

impl<D: Dim> Node<D> {
    #[inline(always)]
    fn motion(&self) -> (D::Vector, D::Spin) {
        (self.velocity, self.spin)
    }
}

impl<D: Dim> Span<'_, D> {
    /// As [`Nodes::relative_velocity`].
    #[inline(always)]
    pub fn relative_velocity<T: Vect, B: Moments>(&self, link: &Link<D, impl Axes<D>>, arms: Arms) -> Local<T, B> {
        let [i, j] = link.nodes.map(|node| self.all[node as usize - self.first].motion());
        link.relative_velocity(arms, i, j)
    }

    /// As [`Nodes::apply`].
    #[inline(always)]
    pub fn apply<T: Vect, B: Moments>(&mut self, link: &Link<D, impl Axes<D>>, arms: Arms, r: Local<T, B>) {
        let [i, j] = link.nodes.map(|node| node as usize - self.first);
        let impulse = link.impulse(&r);
        let (t, m): (D::Tangent, D::Moment) = (resized(r.t), resized(r.m));
        // without moment rows both torques are multiples of one vector
        let slide = match link.axes.frame() {
            Some(frame) if B::LEN == 0 => D::spin_rows_transposed(frame, t),
            None if is_vector::<D, T>() => D::torque(link.axes.normal(), resized(r.t)),
            _ => D::Spin::zero(),
        };
        let turn = |lever: f64, arm: f64, inverse: f64| match link.axes.frame() {
            Some(frame) if B::LEN > 0 => D::torque_of_rows(frame, t * -lever, m * arm) * inverse,
            Some(_) => slide * -lever * inverse,
            None => slide * (-lever * inverse),
        };
        let node = &mut self.all[i];
        node.velocity += impulse * node.inverse_mass;
        if T::LEN > 0 {
            node.spin += turn(arms.lever[0], arms.bending, node.inverse_inertia);
        }
        let node = &mut self.all[j];
        if j >= self.grains {
            let drive = self.drives[j - self.grains];
            node.velocity -= drive * (drive.dot(&impulse) * node.inverse_mass);
            return;
        }
        node.velocity -= impulse * node.inverse_mass;
        if T::LEN > 0 {
            node.spin += turn(arms.lever[1], -arms.bending, node.inverse_inertia);
        }
    }
}
