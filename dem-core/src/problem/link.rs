//! One contact of the problem: its geometry, its law and its impulse. The geometry maps node
//! velocities to relative velocities.

use crate::bond::{BondStatus, failure, mode};
use crate::contact::{Arms, Law, Local, Padded, Reached};
use crate::dim::{Axes, Dim, Moments, Vect, in_frame, is_vector, of_frame, resized};
use std::marker::PhantomData;

/// Geometry of a contact between node i and node j: the linear map between node velocities and
/// relative velocity.
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
    /// Impulse of j on i (N s), in the frame of the contact; where its axes are a normal alone, the
    /// tangential part is a vector.
    pub r: Local<L::T, L::B>,
}

impl<D: Dim, A: Axes<D>> Link<D, A> {
    /// Between these nodes, with the axes of `frame` that are needed.
    pub fn new(nodes: [u32; 2], frame: D::Frame) -> Self {
        Self { nodes, axes: A::of(frame), dim: PhantomData }
    }

    /// The same link with a whole frame; if the axes are a normal alone, [`Dim::frame`] makes the
    /// frame.
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

    /// The reaction with its tangential vector projected on the tangent plane. Round-off of many
    /// sweeps adds a normal component to this vector; with fast grains and small reactions it would
    /// be an impulse outside any law.
    #[inline(always)]
    pub(super) fn without_drift<T: Vect, B: Moments>(&self, mut r: Local<T, B>) -> Local<T, B> {
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

    /// Relative velocity of body i with respect to body j at the contact point, from the velocity
    /// (m/s) and spin (rad/s) of each.
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

impl<D: Dim, L: Law> Contact<D, L> {
    /// Failure mode of a bond that is at its limit, by its impulse or by what the solver found;
    /// `None` for a bond below its limit and for a dry contact.
    pub(crate) fn failure(&self) -> Option<BondStatus> {
        let law = &self.law;
        if !law.breaks() {
            return None;
        }
        let next_to_limit = |part| match part {
            Reached::Apex => BondStatus::Tension,
            Reached::Side => mode(&self.r, law.cone()),
        };
        failure(&self.r, law.shift(), law.cone()).or_else(|| law.reached().map(next_to_limit))
    }
}

/// Contacts with the same rows, sorted by key; in a large problem, by the blocks of a sweep.
pub type Group<D, L> = Vec<Contact<D, L>>;
