//! The contact problem of one step: u = Hᵀ v, v = v_f + M⁻¹ H r, and one law per contact.
//!
//! It knows nodes (a velocity and inverse masses) and contacts, and no bodies, bonds or detection. It is
//! matrix-free: the Delassus operator W = Hᵀ M⁻¹ H acts through the velocities of the nodes.

pub mod assembled;
mod block_matrix;
pub(crate) mod blocks;
pub mod global;
pub mod residual;

use crate::contact::{Arms, Block, Bonded, Coulomb, Elastic, Frictionless, Law, Local, Padded};
use crate::dim::{Axes, Dim, Moments, Vect, in_frame, is_vector, of_frame, resized};
use std::marker::PhantomData;
use std::sync::Arc;

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
pub struct Link<D: Dim, A: Axes<D> = <D as Dim>::Frame> {
    /// Nodes i and j; the normal points from j to i. `j` may be a wall.
    pub nodes: [u32; 2],
    /// Axes: an orthonormal frame (n, t…), or n alone.
    pub axes: A,
    dim: PhantomData<D>,
}

/// One contact of the problem: its geometry, its law and its impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<D: Dim, L: Law> {
    /// Nodes and axes.
    pub link: Link<D, L::Axes<D>>,
    /// Law with the constants of the local solve.
    pub law: L,
    /// Impulse of j on i (N s), in the frame of the contact; where its axes are a normal alone, the tangential part is a vector.
    pub r: Local<L::T, L::B>,
}

impl<D: Dim, A: Axes<D>> Link<D, A> {
    /// Between these nodes, with the axes of `frame` that are needed.
    pub fn new(nodes: [u32; 2], frame: D::Frame) -> Self {
        Self { nodes, axes: A::of(frame), dim: PhantomData }
    }

    /// The same with a whole frame: where the axes are a normal alone, the one that [`Dim::frame`] makes of it.
    pub fn whole(&self) -> Link<D> {
        Link::new(self.nodes, self.frame())
    }

    fn frame(&self) -> D::Frame {
        self.axes.frame().copied().unwrap_or_else(|| D::frame(self.axes.normal()))
    }

    /// A reaction or a velocity of the contact as rows of its [whole](Link::whole) frame.
    #[inline]
    pub(crate) fn in_frame<T: Vect, B: Moments>(&self, r: &Local<T, B>) -> Padded {
        let t = in_frame::<D, T>(&self.frame(), r.t);
        Local { n: r.n, t: resized(t), m: resized(r.m) }
    }

    /// The inverse of [`Link::in_frame`].
    #[inline]
    pub(crate) fn of_frame<T: Vect, B: Moments>(&self, r: &Padded) -> Local<T, B> {
        Local { n: r.n, t: of_frame::<D, T>(&self.frame(), resized(r.t)), m: resized(r.m) }
    }

    /// This reaction without what the rounding of many sweeps has left of a tangential vector along the normal: where grains are fast and
    /// reactions small, it would be an impulse that no law knows of.
    #[inline(always)]
    fn without_drift<T: Vect, B: Moments>(&self, mut r: Local<T, B>) -> Local<T, B> {
        if is_vector::<D, T>() {
            let (normal, t) = (self.axes.normal(), resized::<T, D::Vector>(r.t));
            r.t = resized(t - normal * normal.dot(&t));
        }
        r
    }

    /// The impulse on node i as a vector.
    #[inline(always)]
    pub(crate) fn impulse<T: Vect, B: Moments>(&self, r: &Local<T, B>) -> D::Vector {
        match self.axes.frame() {
            Some(frame) if T::LEN > 0 => D::compose(frame, r.n, resized(r.t)),
            _ if is_vector::<D, T>() => self.axes.normal() * r.n + resized::<T, D::Vector>(r.t),
            _ => {
                debug_assert_eq!(T::LEN, 0, "tangential rows without a frame");
                self.axes.normal() * r.n
            }
        }
    }
}

impl<D: Dim> Link<D> {
    /// Local Delassus block for two nodes. `drive` is the direction of the one degree of freedom of a force-driven wall j, if
    /// it is one.
    pub fn block(&self, i: &Node<D>, j: &Node<D>, arms: Arms, drive: Option<D::Vector>) -> Block {
        let Arms { lever: [li, lj], bending: arm } = arms;
        let spin = i.inverse_inertia + j.inverse_inertia;
        let mut block = Block {
            n: i.inverse_mass + j.inverse_mass,
            t: i.inverse_mass + j.inverse_mass + li * li * i.inverse_inertia + lj * lj * j.inverse_inertia,
            m: arm * arm * spin,
            w: arm * arm * spin,
            tm: arm * (lj * j.inverse_inertia - li * i.inverse_inertia),
        };
        if let Some(d) = drive {
            // the wall yields along d alone: a diagonal that dominates (n·d)², (t·d)² and their coupling
            let (along, across) = D::split(&self.axes, d);
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

/// Contacts with the same rows, sorted by key; in a large problem, by the blocks in which they are swept.
pub type Group<D, L> = Vec<Contact<D, L>>;

/// The law of a dry contact in dimension D.
pub type Dry<D> = Coulomb<<D as Dim>::Slide>;
/// The law of an intact rigid bond in dimension D.
pub type Bond<D> = Bonded<<D as Dim>::Tangent, <D as Dim>::Moment>;
/// The law of an intact elastic bond in dimension D.
pub type ElasticBond<D> = Elastic<<D as Dim>::Tangent, <D as Dim>::Moment>;

/// The contact problem of one step.
#[derive(Clone, Debug)]
pub struct ContactProblem<D: Dim> {
    /// The velocities that the contacts act on.
    pub nodes: Nodes<D>,
    /// Free velocities v_f (m/s) and spins (rad/s) of the nodes.
    pub free: Arc<[(D::Vector, D::Spin)]>,
    /// Intact rigid bonds.
    pub bonded: Group<D, Bond<D>>,
    /// Intact elastic bonds.
    pub elastic: Group<D, ElasticBond<D>>,
    /// Dry contacts with friction.
    pub dry: Group<D, Dry<D>>,
    /// Contacts without friction.
    pub frictionless: Group<D, Frictionless>,
    /// Radii of the grains (m) where the stiffness of a contact follows them, in space; empty in the plane.
    pub radii: Vec<f64>,
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

/// Nodes that follow one another, and the walls where they are all of them.
pub(crate) struct Span<'a, D: Dim> {
    all: &'a mut [Node<D>],
    /// Number of the first.
    first: usize,
    /// How many are grains.
    grains: usize,
    drives: &'a [D::Vector],
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

    fn span(&mut self) -> Span<'_, D> {
        Span { first: 0, all: &mut self.all, grains: self.grains, drives: &self.drives }
    }
}

impl<D: Dim> Node<D> {
    #[inline(always)]
    fn motion(&self) -> (D::Vector, D::Spin) {
        (self.velocity, self.spin)
    }
}

impl<D: Dim, A: Axes<D>> Link<D, A> {
    /// Relative velocity of a body with this velocity and spin, i, with respect to another, j, at the contact point.
    #[inline(always)]
    pub(crate) fn relative_velocity<T: Vect, B: Moments>(
        &self,
        arms: Arms,
        (velocity_i, spin_i): (D::Vector, D::Spin),
        (velocity_j, spin_j): (D::Vector, D::Spin),
    ) -> Local<T, B> {
        let velocity = velocity_i - velocity_j;
        let Some(frame) = self.axes.frame() else {
            let normal = self.axes.normal();
            let n = normal.dot(&velocity);
            if !is_vector::<D, T>() {
                debug_assert_eq!(T::LEN, 0, "tangential rows without a frame");
                return Local { n, ..Local::zero() };
            }
            let turn = D::velocity(spin_i * arms.lever[0] + spin_j * arms.lever[1], normal);
            return Local { n, t: resized(velocity - normal * n - turn), ..Local::zero() };
        };
        let (n, t) = D::split(frame, velocity);
        if T::LEN == 0 {
            return Local { n, ..Local::zero() };
        }
        let turn = D::spin_rows(frame, spin_i * arms.lever[0] + spin_j * arms.lever[1]);
        let moment = |spin: D::Spin| resized(D::moment_rows(frame, spin * arms.bending));
        let m = if B::LEN == 0 { B::zero() } else { moment(spin_i - spin_j) };
        Local { n, t: resized(t - turn), m }
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
        // without moment rows both torques are multiples of one
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

/// A fold over all contacts of a problem, whatever their rows.
pub trait Visitor<D: Dim> {
    /// Called once for each contact: rigid bonds, elastic bonds, dry contacts, frictionless ones, each in the order of
    /// its group.
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

    /// Bytes that the contacts take.
    pub fn contact_bytes(&self) -> usize {
        size_of_val(self.bonded.as_slice())
            + size_of_val(self.elastic.as_slice())
            + size_of_val(self.dry.as_slice())
            + size_of_val(self.frictionless.as_slice())
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

    /// Set the node velocities to v_f + M⁻¹ H r, free of the rounding that a long series of increments leaves in them and in
    /// tangential vectors.
    pub fn velocities_from_reactions(&mut self) {
        for (node, free) in self.nodes.all.iter_mut().zip(self.free.iter()) {
            (node.velocity, node.spin) = *free;
        }
        fn group<D: Dim, L: Law>(nodes: &mut Nodes<D>, group: &mut Group<D, L>) {
            blocks::for_each(nodes, group, |span, c| {
                c.r = c.link.without_drift(c.r);
                span.apply(&c.link, c.law.arms(), c.r);
            });
        }
        group(&mut self.nodes, &mut self.bonded);
        group(&mut self.nodes, &mut self.elastic);
        group(&mut self.nodes, &mut self.dry);
        group(&mut self.nodes, &mut self.frictionless);
    }
}
