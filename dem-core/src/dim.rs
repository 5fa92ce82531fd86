//! The dimension of space as a type: one source for 2D and 3D.
//!
//! The rest of the crate is generic over [`Dim`]; [`D2`] and [`Space`] define vectors, spins,
//! contact frames and orientations. Outside tests and the prelude no other file of the
//! crate names a dimension.
//!
//! Symbols: n normal from body j to body i; t tangent(s), in 2D t = (−n_y, n_x), in 3D n = t₁ × t₂;
//! ω spin, counter-clockwise in 2D.

use nalgebra::SVector;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Index, IndexMut, Mul, Neg, Sub, SubAssign};

/// A small vector of f64 with a fixed number of components, possibly none.
pub trait Vect:
    Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
    + Index<usize, Output = f64>
    + IndexMut<usize>
{
    /// Number of components.
    const LEN: usize;
    /// All components zero.
    fn zero() -> Self;
    /// Scalar product.
    fn dot(&self, other: &Self) -> f64;
    /// The components in order.
    fn as_slice(&self) -> &[f64];
    /// A vector from its components; the slice must hold exactly [`Vect::LEN`] of them.
    fn from_slice(components: &[f64]) -> Self;

    /// Euclidean norm.
    #[inline(always)]
    fn norm(&self) -> f64 {
        // one component needs no square root and stays exact
        match Self::LEN {
            0 => 0.0,
            1 => self[0].abs(),
            _ => self.dot(self).sqrt(),
        }
    }

    /// The nearest vector of norm at most `limit` (projection on a ball; `limit` ≥ 0).
    #[inline(always)]
    fn clipped(self, limit: f64) -> Self {
        if Self::LEN < 2 {
            let norm = self.norm();
            return if norm <= limit { self } else { self * (limit / norm) };
        }
        // latency matters, as the next contact may depend on this one: no square root inside the
        // ball, nor for a limit of zero
        let square = self.dot(&self);
        if square <= limit * limit {
            self
        } else if limit == 0.0 {
            Self::zero()
        } else {
            self * (limit / square.sqrt())
        }
    }
}

impl<const N: usize> Vect for SVector<f64, N> {
    const LEN: usize = N;
    #[inline(always)]
    fn zero() -> Self {
        Self::zeros()
    }
    #[inline(always)]
    fn dot(&self, other: &Self) -> f64 {
        let mut sum = 0.0;
        for k in 0..N {
            sum += self[k] * other[k];
        }
        sum
    }
    fn as_slice(&self) -> &[f64] {
        self.data.as_slice()
    }
    fn from_slice(components: &[f64]) -> Self {
        Self::from_column_slice(components)
    }
}

/// A row group that a contact lacks: no storage, no instruction.
pub type V0 = SVector<f64, 0>;

/// One row.
pub type V1 = SVector<f64, 1>;

/// The moment rows of a contact: as many bending rows as tangential ones; the last of three rows is
/// the twist row.
///
/// Bending and twist have separate limits.
pub trait Moments: Vect {
    /// A number of the twist row; no storage where there is no twist row.
    type Twist: Vect;

    /// Whether the last row is the twist row.
    const TWISTS: bool = Self::Twist::LEN > 0;

    /// Norm of the bending rows.
    #[inline(always)]
    fn bending(&self) -> f64 {
        if Self::TWISTS { (self[0] * self[0] + self[1] * self[1]).sqrt() } else { self.norm() }
    }

    /// Absolute value of the twist row; zero where there is none.
    #[inline(always)]
    fn twist(&self) -> f64 {
        if Self::TWISTS { self[2].abs() } else { 0.0 }
    }

    /// The bending rows times one factor, the twist row times another.
    #[inline(always)]
    fn scaled(self, bending: f64, twist: f64) -> Self {
        let mut out = self * bending;
        if Self::TWISTS {
            out[2] = self[2] * twist;
        }
        out
    }

    /// The nearest rows whose bending and twist norms are at most these limits.
    #[inline(always)]
    fn within(self, bending: f64, twist: f64) -> Self {
        if !Self::TWISTS {
            return self.clipped(bending);
        }
        let norm = self.bending();
        let mut out = if norm <= bending { self } else { self * (bending / norm) };
        // not `clamp`, which panics where the limit is not a number
        out[2] = if self[2].abs() <= twist { self[2] } else { twist.copysign(self[2]) };
        out
    }
}

impl Moments for V0 {
    type Twist = V0;
}

impl Moments for V1 {
    type Twist = V0;
}

impl Moments for SVector<f64, 2> {
    type Twist = V0;
}

impl Moments for SVector<f64, 3> {
    type Twist = V1;
}

/// `rows` as a group of type `B`: surplus rows are dropped, missing ones are zero.
#[inline(always)]
pub fn resized<A: Vect, B: Vect>(rows: A) -> B {
    let mut out = B::zero();
    for k in 0..A::LEN.min(B::LEN) {
        out[k] = rows[k];
    }
    out
}

/// Whether `T` is a vector in the tangent plane ([`Dim::Slide`] in 3D) and not rows of a frame.
#[inline(always)]
pub(crate) fn is_vector<D: Dim, T: Vect>() -> bool {
    D::Slide::LEN != D::Tangent::LEN && T::LEN == D::Slide::LEN
}

/// Number of tangential rows, in a frame, of a law whose tangential part is a `T`.
#[inline(always)]
pub(crate) fn tangential_rows<D: Dim, T: Vect>() -> usize {
    if is_vector::<D, T>() { D::Tangent::LEN } else { T::LEN }
}

/// The tangential part `t` of a law as rows of the frame; `t` is such rows, a vector in the tangent
/// plane, or nothing.
#[inline(always)]
pub(crate) fn in_frame<D: Dim, T: Vect>(frame: &D::Frame, t: T) -> D::Tangent {
    if is_vector::<D, T>() { D::split(frame, resized(t)).1 } else { resized(t) }
}

/// The inverse of [`in_frame`].
#[inline(always)]
pub(crate) fn of_frame<D: Dim, T: Vect>(frame: &D::Frame, rows: D::Tangent) -> T {
    if is_vector::<D, T>() { resized(D::compose(frame, 0.0, rows)) } else { resized(rows) }
}

/// (1 − cos φ) / sin² φ for s = sin φ.
pub fn versine_share(s: f64) -> f64 {
    1.0 / (1.0 + (1.0 - s * s).max(0.0).sqrt())
}

/// The vector x rotated about s = `sine`, whose norm is the sine of the angle φ; it counts as one
/// where it is larger: x + s × x + (1 − cos φ) / sin² φ s × (s × x).
pub(crate) fn rotated<D: Dim>(x: D::Vector, sine: D::Spin) -> D::Vector {
    let size = sine.norm();
    let sine = sine * (1.0 / size.max(1.0));
    let across = D::velocity(sine, x);
    // of the norm as it was: near a right angle the share has the root of the round-off
    x + across + D::velocity(sine, across) * versine_share(size)
}

/// The axes that the rows of a contact need: the whole frame, or in 3D the normal alone if there is
/// no friction or if friction is a vector.
pub trait Axes<D: Dim>: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// The axes of this type from a frame.
    fn of(frame: D::Frame) -> Self;
    /// The normal.
    fn normal(&self) -> D::Vector;
    /// The frame; `None` if the normal alone is stored.
    fn frame(&self) -> Option<&D::Frame>;
}

/// A dimension of space: the types and maps that depend on it.
pub trait Dim: Copy + Debug + Default + Send + Sync + 'static {
    /// Number of space dimensions.
    const N: usize;
    /// Position, velocity, force.
    type Vector: Vect + Axes<Self>;
    /// Angular velocity, torque: one component in 2D, three in 3D.
    type Spin: Vect;
    /// Tangential rows of a contact in a frame.
    type Tangent: Vect;
    /// Moment rows of a bond.
    type Moment: Moments;
    /// Tangential part of a dry contact: in 2D the row of its frame, in 3D a vector in the tangent
    /// plane, which needs no tangents.
    type Slide: Vect;
    /// Orthonormal frame (n, t…) of a contact.
    type Frame: Axes<Self>;
    /// The tangents of a frame as numbers; none in 2D, where the normal determines them.
    type Tangents: Vect;
    /// Orientation of a body: an angle (rad) in 2D, a unit quaternion w, x, y, z in 3D.
    type Orientation: Vect;

    /// A frame with this unit normal.
    fn frame(normal: Self::Vector) -> Self::Frame;
    /// The frame with this unit normal that turned least from one with the first tangent `old`, so
    /// that tangential reactions keep their meaning from step to step.
    fn transported(old: Self::Vector, normal: Self::Vector) -> Self::Frame;
    /// The normal of a frame.
    #[inline(always)]
    fn normal(frame: &Self::Frame) -> Self::Vector {
        frame.normal()
    }
    /// First tangent of a frame.
    fn tangent(frame: &Self::Frame) -> Self::Vector;
    /// The tangents of a frame.
    fn tangents(frame: &Self::Frame) -> Self::Tangents;
    /// The frame of this normal and these tangents.
    fn with_tangents(normal: Self::Vector, tangents: &Self::Tangents) -> Self::Frame;
    /// Normal and tangential components of a vector.
    fn split(frame: &Self::Frame, vector: Self::Vector) -> (f64, Self::Tangent);
    /// The vector with the given normal and tangential components; transpose of [`Dim::split`].
    fn compose(frame: &Self::Frame, normal: f64, tangential: Self::Tangent) -> Self::Vector;
    /// Tangential components of ω × n. In 2D this is ω itself.
    fn spin_rows(frame: &Self::Frame, spin: Self::Spin) -> Self::Tangent;
    /// Transpose of [`Dim::spin_rows`]: the torque that does the work of tangential rows.
    fn spin_rows_transposed(frame: &Self::Frame, rows: Self::Tangent) -> Self::Spin;
    /// Moment rows of a relative spin ω: those of ω × n, and the component of ω along n where twist
    /// has a row.
    #[inline(always)]
    fn moment_rows(frame: &Self::Frame, spin: Self::Spin) -> Self::Moment {
        resized(Self::spin_rows(frame, spin))
    }
    /// The torque that does the work of tangential and moment rows: the transposes of
    /// [`Dim::spin_rows`] and [`Dim::moment_rows`].
    #[inline(always)]
    fn torque_of_rows(frame: &Self::Frame, tangential: Self::Tangent, moment: Self::Moment) -> Self::Spin {
        Self::spin_rows_transposed(frame, tangential + resized(moment))
    }
    /// Components of a torque about the tangents of a frame, and about its normal where twist has a
    /// row; in 2D the torque itself.
    fn about_axes(frame: &Self::Frame, torque: Self::Spin) -> Self::Moment;
    /// The torque x × f of a force with lever x.
    fn torque(lever: Self::Vector, force: Self::Vector) -> Self::Spin;
    /// The velocity ω × x of the point x of a rotating body.
    fn velocity(spin: Self::Spin, place: Self::Vector) -> Self::Vector;
    /// The orientation of a body before any rotation.
    fn unturned() -> Self::Orientation;
    /// The orientation after turning by the rotation vector `turn` (rad).
    fn turned(orientation: Self::Orientation, turn: Self::Spin) -> Self::Orientation;
    /// Area (2D) or volume (3D) of a disk or sphere, m² or m³.
    fn volume(radius: f64) -> f64;
    /// Moment of inertia over m R²: 1/2 for a disk, 2/5 for a sphere.
    const INERTIA_FACTOR: f64;
}

/// 2D: disks with one spin component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct D2;

/// 3D: spheres with three spin components, and bonds with `MOMENTS` moment rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Space<const MOMENTS: usize>;

/// 3D with bonds that resist bending but not twist about their normal.
pub type D3 = Space<2>;

/// 3D with bonds that resist bending and twist.
pub type D3Twist = Space<3>;

/// Frame of a contact in 3D: n = t₁ × t₂.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame3 {
    n: SVector<f64, 3>,
    t: [SVector<f64, 3>; 2],
}

impl Axes<D2> for SVector<f64, 2> {
    #[inline(always)]
    fn of(frame: Self) -> Self {
        frame
    }
    #[inline(always)]
    fn normal(&self) -> Self {
        *self
    }
    #[inline(always)]
    fn frame(&self) -> Option<&Self> {
        Some(self)
    }
}

impl<const MOMENTS: usize> Axes<Space<MOMENTS>> for SVector<f64, 3>
where
    SVector<f64, MOMENTS>: Moments,
{
    #[inline(always)]
    fn of(frame: Frame3) -> Self {
        frame.n
    }
    #[inline(always)]
    fn normal(&self) -> Self {
        *self
    }
    #[inline(always)]
    fn frame(&self) -> Option<&Frame3> {
        None
    }
}

impl<const MOMENTS: usize> Axes<Space<MOMENTS>> for Frame3
where
    SVector<f64, MOMENTS>: Moments,
{
    #[inline(always)]
    fn of(frame: Self) -> Self {
        frame
    }
    #[inline(always)]
    fn normal(&self) -> SVector<f64, 3> {
        self.n
    }
    #[inline(always)]
    fn frame(&self) -> Option<&Self> {
        Some(self)
    }
}

impl Dim for D2 {
    const N: usize = 2;
    const INERTIA_FACTOR: f64 = 0.5;
    type Vector = SVector<f64, 2>;
    type Spin = SVector<f64, 1>;
    type Tangent = SVector<f64, 1>;
    type Moment = SVector<f64, 1>;
    type Slide = SVector<f64, 1>;
    type Frame = SVector<f64, 2>;
    type Tangents = V0;
    type Orientation = SVector<f64, 1>;

    #[inline(always)]
    fn frame(normal: Self::Vector) -> Self::Frame {
        normal
    }
    #[inline(always)]
    fn transported(_: Self::Vector, normal: Self::Vector) -> Self::Frame {
        normal
    }
    #[inline(always)]
    fn tangent(n: &Self::Frame) -> Self::Vector {
        [-n[1], n[0]].into()
    }
    #[inline(always)]
    fn tangents(_: &Self::Frame) -> Self::Tangents {
        V0::zero()
    }
    #[inline(always)]
    fn with_tangents(normal: Self::Vector, _: &Self::Tangents) -> Self::Frame {
        normal
    }
    #[inline(always)]
    fn split(n: &Self::Frame, v: Self::Vector) -> (f64, Self::Tangent) {
        (n[0] * v[0] + n[1] * v[1], [n[0] * v[1] - n[1] * v[0]].into())
    }
    #[inline(always)]
    fn compose(n: &Self::Frame, normal: f64, t: Self::Tangent) -> Self::Vector {
        [normal * n[0] - t[0] * n[1], normal * n[1] + t[0] * n[0]].into()
    }
    #[inline(always)]
    fn spin_rows(_: &Self::Frame, spin: Self::Spin) -> Self::Tangent {
        spin
    }
    #[inline(always)]
    fn spin_rows_transposed(_: &Self::Frame, rows: Self::Tangent) -> Self::Spin {
        rows
    }
    fn about_axes(_: &Self::Frame, torque: Self::Spin) -> Self::Moment {
        torque
    }
    fn torque(x: Self::Vector, f: Self::Vector) -> Self::Spin {
        [x[0] * f[1] - x[1] * f[0]].into()
    }
    fn velocity(spin: Self::Spin, x: Self::Vector) -> Self::Vector {
        [-spin[0] * x[1], spin[0] * x[0]].into()
    }
    fn unturned() -> Self::Orientation {
        [0.0].into()
    }
    #[inline]
    fn turned(orientation: Self::Orientation, turn: Self::Spin) -> Self::Orientation {
        orientation + turn
    }
    fn volume(radius: f64) -> f64 {
        std::f64::consts::PI * radius * radius
    }
}

impl<const MOMENTS: usize> Dim for Space<MOMENTS>
where
    SVector<f64, MOMENTS>: Moments,
{
    const N: usize = 3;
    const INERTIA_FACTOR: f64 = 0.4;
    type Vector = SVector<f64, 3>;
    type Spin = SVector<f64, 3>;
    type Tangent = SVector<f64, 2>;
    type Moment = SVector<f64, MOMENTS>;
    type Slide = SVector<f64, 3>;
    type Frame = Frame3;
    type Tangents = SVector<f64, 6>;
    type Orientation = SVector<f64, 4>;

    /// Branch-light orthonormal basis: Duff et al., *Building an orthonormal basis, revisited*,
    /// JCGT 6(1), 2017.
    fn frame(n: Self::Vector) -> Self::Frame {
        let sign = 1.0f64.copysign(n[2]);
        let a = -1.0 / (sign + n[2]);
        let b = n[0] * n[1] * a;
        let t1: Self::Vector = [1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]].into();
        let t2: Self::Vector = [b, sign + n[1] * n[1] * a, -n[1]].into();
        Frame3 { n, t: [t1, t2] }
    }
    fn transported(old: Self::Vector, n: Self::Vector) -> Self::Frame {
        let flat = old - n * n.dot(&old);
        let norm = flat.norm();
        if norm < 0.5 {
            return Self::frame(n);
        }
        let t1 = flat / norm;
        Frame3 { n, t: [t1, n.cross(&t1)] }
    }
    #[inline(always)]
    fn tangent(frame: &Self::Frame) -> Self::Vector {
        frame.t[0]
    }
    fn tangents(f: &Self::Frame) -> Self::Tangents {
        let [a, b] = f.t;
        [a[0], a[1], a[2], b[0], b[1], b[2]].into()
    }
    fn with_tangents(n: Self::Vector, t: &Self::Tangents) -> Self::Frame {
        Frame3 { n, t: [[t[0], t[1], t[2]].into(), [t[3], t[4], t[5]].into()] }
    }
    #[inline(always)]
    fn split(f: &Self::Frame, v: Self::Vector) -> (f64, Self::Tangent) {
        (Vect::dot(&f.n, &v), [Vect::dot(&f.t[0], &v), Vect::dot(&f.t[1], &v)].into())
    }
    #[inline(always)]
    fn compose(f: &Self::Frame, normal: f64, t: Self::Tangent) -> Self::Vector {
        f.n * normal + f.t[0] * t[0] + f.t[1] * t[1]
    }
    // (ω × n)·t₁ = ω·(n × t₁) = ω·t₂ and (ω × n)·t₂ = ω·(n × t₂) = −ω·t₁
    #[inline(always)]
    fn spin_rows(f: &Self::Frame, spin: Self::Spin) -> Self::Tangent {
        [Vect::dot(&spin, &f.t[1]), -Vect::dot(&spin, &f.t[0])].into()
    }
    #[inline(always)]
    fn spin_rows_transposed(f: &Self::Frame, rows: Self::Tangent) -> Self::Spin {
        f.t[1] * rows[0] - f.t[0] * rows[1]
    }
    #[inline(always)]
    fn moment_rows(f: &Self::Frame, spin: Self::Spin) -> Self::Moment {
        let mut rows: Self::Moment = resized(Self::spin_rows(f, spin));
        if Self::Moment::TWISTS {
            rows[2] = Vect::dot(&f.n, &spin);
        }
        rows
    }
    #[inline(always)]
    fn torque_of_rows(f: &Self::Frame, tangential: Self::Tangent, moment: Self::Moment) -> Self::Spin {
        let turn = Self::spin_rows_transposed(f, tangential + resized::<_, Self::Tangent>(moment));
        if Self::Moment::TWISTS { turn + f.n * moment[2] } else { turn }
    }
    fn about_axes(f: &Self::Frame, torque: Self::Spin) -> Self::Moment {
        let mut about = Self::Moment::zeros();
        for (k, axis) in [f.t[0], f.t[1], f.n].iter().enumerate().take(MOMENTS) {
            about[k] = Vect::dot(axis, &torque);
        }
        about
    }
    #[inline(always)]
    fn torque(x: Self::Vector, f: Self::Vector) -> Self::Spin {
        x.cross(&f)
    }
    #[inline(always)]
    fn velocity(spin: Self::Spin, x: Self::Vector) -> Self::Vector {
        spin.cross(&x)
    }
    fn unturned() -> Self::Orientation {
        [1.0, 0.0, 0.0, 0.0].into()
    }
    fn turned(q: Self::Orientation, turn: Self::Spin) -> Self::Orientation {
        let angle = turn.norm();
        if angle == 0.0 {
            return q;
        }
        let (s, c) = (0.5 * angle).sin_cos();
        let p = turn * (s / angle);
        // product (c, p) ⊗ q, then back to unit length
        let v: Self::Vector = [q[1], q[2], q[3]].into();
        let w = c * q[0] - Vect::dot(&p, &v);
        let u = v * c + p * q[0] + p.cross(&v);
        let next: Self::Orientation = [w, u[0], u[1], u[2]].into();
        next / next.norm()
    }
    fn volume(radius: f64) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_turn_beyond_a_right_angle_counts_as_one() {
        for axis in [[1.0, 2.0, 3.0], [0.3, -0.1, 0.7], [-5.0, 1e-3, 2.0]] {
            let axis = Vector3::from(axis).normalize();
            let x = Vector3::new(0.2, -1.0, 0.5);
            let along = axis * axis.dot(&x);
            let wanted = along + axis.cross(&x);
            for size in [1.0 + 4.0 * f64::EPSILON, 3.0] {
                let off = (rotated::<D3>(x, axis * size) - wanted).norm();
                assert!(off < 1e-15, "{axis:?} {size} {off:e}");
            }
        }
    }
}
