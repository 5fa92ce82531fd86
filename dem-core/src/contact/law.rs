//! Contact laws: frictionless (Signorini), dry (Signorini–Coulomb) and the intact bond, all as one
//! shifted cone.
//!
//! With r̂ = r + s n (s = h r_coh for a bond, 0 else), ũ = u + (μ‖u_t‖ + ν‖u_m‖ + ξ|u_τ|) n and the
//! cone K,
//!
//! K ∋ r̂ ⊥ ũ ∈ K*   ⇔   r̂ = P_K(r̂ − γ ũ) for any γ > 0:
//!
//! de Saxcé's bipotential, Guessasma & Fortin 2011, (3)–(5). A bond with associated flow has ũ = u.
//!
//! A law has two local solves, which improve one contact while the impulses of all others are
//! fixed. The *predictor–corrector* is one step of this fixed-point map with γ = 1 / (largest
//! diagonal entry of the local Delassus block W), which makes it a contraction where the flow is
//! associated; see docs/theory/contact-law.md. The *exact local solve* returns the r that satisfies
//! the law of this contact. Both have the same fixed points.

use super::cone::{Cone, Local, Weights, predict_correct};
use crate::dim::{Axes, Dim, Moments, V0, V1, Vect, resized};
use std::marker::PhantomData;

/// How one contact is improved within a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LocalSolve {
    /// The r that satisfies the law of this contact alone.
    #[default]
    Exact,
    /// One step of the bipotential's predictor–corrector, as the paper writes it.
    PredictorCorrector,
}

/// The local Delassus block of a contact: its relative velocity per unit impulse in each row group.
///
/// For disks and spheres every group is a multiple of the identity, and only t and bending are
/// coupled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Normal entry (1/kg).
    pub n: f64,
    /// Tangential entries (1/kg).
    pub t: f64,
    /// Bending entries, after scaling by the mean diameter (1/kg).
    pub m: f64,
    /// Twist entry, likewise (1/kg).
    pub w: f64,
    /// Coupling of t and m (1/kg).
    pub tm: f64,
}

/// Lever arms of the rows of a contact about the centres of its bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arms {
    /// Distances from the centres of i and j to the contact point along the normal (m).
    pub lever: [f64; 2],
    /// Length that scales moments and relative spins: the mean diameter of a bonded pair (m).
    pub bending: f64,
}

/// The law of one contact, with the constants that its local solve needs.
pub trait Law: Copy + Send + Sync + 'static {
    /// Tangential rows, or a vector in the tangent plane.
    type T: Vect;
    /// Moment rows.
    type B: Moments;
    /// The axes that these rows need.
    type Axes<D: Dim>: Axes<D>;

    /// The improved impulse (N s) of this contact, all others fixed, from its impulse `r` (N s) and
    /// relative velocity `u` (m/s).
    fn improve(
        &self,
        local: LocalSolve,
        r: Local<Self::T, Self::B>,
        u: Local<Self::T, Self::B>,
    ) -> Local<Self::T, Self::B>;

    /// Natural map r̂ − P_K(r̂ − ũ/D) of the contact, D the largest diagonal entry of its block:
    /// zero at a solution.
    fn natural_map(&self, r: Local<Self::T, Self::B>, u: Local<Self::T, Self::B>) -> Local<Self::T, Self::B>;

    /// 1/D: the inverse of the largest diagonal entry of the block (kg).
    fn gamma(&self) -> f64;

    /// The cone that holds the shifted reaction.
    fn cone(&self) -> Cone;

    /// The shift s of the normal reaction (N s).
    fn shift(&self) -> f64 {
        0.0
    }

    /// Whether the contact is a bond: it breaks for good where its shifted reaction is on the
    /// boundary of the cone.
    fn breaks(&self) -> bool {
        false
    }

    /// The part of its limit that a bond has reached in the reactions of least energy, if the
    /// solver has found one.
    fn reached(&self) -> Option<Reached> {
        None
    }

    /// Set [`Law::reached`]; ignored by a dry contact.
    fn set_reached(&mut self, _: Option<Reached>) {}

    /// Velocity that the law adds to u (m/s). [`Law::improve`] and [`Law::natural_map`] receive the
    /// relative velocity without it and add it themselves.
    fn bias(&self) -> Local<Self::T, Self::B> {
        Local::zero()
    }

    /// Whether the flow is normal to the cone, so that the law derives from a convex potential.
    fn associated(&self) -> bool {
        true
    }

    /// Lever arms of its rows; zero for rows that it lacks.
    fn arms(&self) -> Arms {
        Arms::default()
    }

    /// Compliance of the rows over the step (1/kg), zero for rigid rows.
    fn compliance(&self) -> Weights {
        Weights::default()
    }

    /// Impulse r₀ that a compliant contact carried at the start of the step (N s).
    fn carried(&self) -> Local<Self::T, Self::B> {
        Local::zero()
    }
}

/// Signorini's law without friction: one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frictionless {
    inverse: f64,
    bias: f64,
}

impl Frictionless {
    /// From the local block and the bias of the normal velocity (m/s).
    pub fn new(block: Block, bias: f64) -> Self {
        Self { inverse: 1.0 / block.n, bias }
    }
}

impl Law for Frictionless {
    type T = V0;
    type B = V0;
    type Axes<D: Dim> = D::Vector;

    // the projection on a half-line is exact: both local solves coincide
    #[inline(always)]
    fn improve(&self, _: LocalSolve, r: Local<V0, V0>, u: Local<V0, V0>) -> Local<V0, V0> {
        Local { n: (r.n - (u.n + self.bias) * self.inverse).max(0.0), ..Local::zero() }
    }

    #[inline(always)]
    fn natural_map(&self, r: Local<V0, V0>, u: Local<V0, V0>) -> Local<V0, V0> {
        r - self.improve(LocalSolve::Exact, r, u)
    }

    fn gamma(&self) -> f64 {
        self.inverse
    }

    fn bias(&self) -> Local<V0, V0> {
        Local { n: self.bias, ..Local::zero() }
    }

    fn cone(&self) -> Cone {
        Cone { mu: 0.0, nu: 0.0, xi: 0.0 }
    }
}

/// The law of Signorini and Coulomb: a normal row, and tangential rows or a tangential vector
/// (Coulomb's disk is isotropic, so a vector needs no tangents).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coulomb<T> {
    inverse_n: f64,
    inverse_t: f64,
    lever: [f64; 2],
    bias: f64,
    mu: f64,
    rows: PhantomData<T>,
}

impl<T: Vect> Coulomb<T> {
    /// From the local block, the levers (m), the friction coefficient and the bias of the normal
    /// velocity (m/s).
    pub fn new(block: Block, lever: [f64; 2], mu: f64, bias: f64) -> Self {
        Self { inverse_n: 1.0 / block.n, inverse_t: 1.0 / block.t, lever, bias, mu, rows: PhantomData }
    }

    fn predict_correct(&self, r: Local<T, V0>, u: Local<T, V0>) -> Local<T, V0> {
        predict_correct(Cone { mu: self.mu, nu: 0.0, xi: 0.0 }, 0.0, true, self.gamma(), r, u)
    }
}

impl<T: Vect> Law for Coulomb<T> {
    type T = T;
    type B = V0;
    // in 2D the normal determines the frame
    type Axes<D: Dim> = D::Vector;

    /// Exact: n and t are uncoupled, so Signorini's law gives r_n first, and r_t is then clipped to
    /// Coulomb's disk.
    #[inline(always)]
    fn improve(&self, local: LocalSolve, r: Local<T, V0>, mut u: Local<T, V0>) -> Local<T, V0> {
        u.n += self.bias;
        match local {
            LocalSolve::Exact => {
                let n = (r.n - u.n * self.inverse_n).max(0.0);
                Local { n, t: (r.t - u.t * self.inverse_t).clipped(self.mu * n), m: r.m }
            }
            LocalSolve::PredictorCorrector => r + self.predict_correct(r, u),
        }
    }

    #[inline(always)]
    fn natural_map(&self, r: Local<T, V0>, mut u: Local<T, V0>) -> Local<T, V0> {
        u.n += self.bias;
        self.predict_correct(r, u) * -1.0
    }

    #[inline(always)]
    fn gamma(&self) -> f64 {
        self.inverse_n.min(self.inverse_t)
    }

    fn bias(&self) -> Local<T, V0> {
        Local { n: self.bias, ..Local::zero() }
    }

    fn associated(&self) -> bool {
        false
    }

    #[inline(always)]
    fn cone(&self) -> Cone {
        Cone { mu: self.mu, nu: 0.0, xi: 0.0 }
    }

    #[inline(always)]
    fn arms(&self) -> Arms {
        Arms { lever: self.lever, bending: 0.0 }
    }
}

/// Flow rule of a bond at its limit during a solve; the bond breaks after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BondFlow {
    /// Flow normal to the cone; the problem of intact bonds is convex.
    #[default]
    Associated,
    /// The rule of the paper: slip and rolling without opening.
    Bipotential,
}

/// An intact cohesive bond: normal, tangential and moment rows, shifted by the cohesion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bonded<T, B: Moments> {
    inverse_n: f64,
    // inverse of the 2 × 2 block that couples t and m
    inverse_t: f64,
    inverse_m: f64,
    inverse_tm: f64,
    arms: Arms,
    shift: f64,
    mu: f64,
    nu: f64,
    // inverse entry and coefficient of the twist row
    inverse_w: B::Twist,
    xi: B::Twist,
    flow: BondFlow,
    reached: Option<Reached>,
    // of the normal and the tangential rows
    bias: (f64, T),
    rows: PhantomData<B>,
}

/// A part of the limit of a bond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// The apex of its cone: tension.
    Apex,
    /// The side of its cone: shear or a moment.
    Side,
}

/// A number that is stored for a twist row only.
fn only_twist<B: Moments>(x: f64) -> B::Twist {
    resized(V1::from([x]))
}

/// The number stored for the twist row; `other` where there is no twist row.
#[inline(always)]
fn of_twist<B: Moments>(x: B::Twist, other: f64) -> f64 {
    if B::TWISTS { x[0] } else { other }
}

impl<T: Vect, B: Moments> Bonded<T, B> {
    /// From the local block, the arms, the cohesion as an impulse h r_coh (N s), the cone and the
    /// flow rule.
    pub fn new(block: Block, arms: Arms, shift: f64, cone: Cone, flow: BondFlow) -> Self {
        let det = block.t * block.m - block.tm * block.tm;
        Self {
            inverse_n: 1.0 / block.n,
            inverse_t: block.m / det,
            inverse_m: block.t / det,
            inverse_tm: -block.tm / det,
            arms,
            shift,
            mu: cone.mu,
            nu: cone.nu,
            inverse_w: only_twist::<B>(1.0 / block.w),
            xi: only_twist::<B>(cone.xi),
            flow,
            reached: None,
            bias: (0.0, T::zero()),
            rows: PhantomData,
        }
    }

    /// The same bond with this bias of the normal and the tangential velocity (m/s).
    #[must_use]
    pub fn with_bias(self, n: f64, t: T) -> Self {
        Self { bias: (n, t), ..self }
    }

    /// The relative velocity `u` with the bias.
    #[inline(always)]
    fn biased(&self, u: Local<T, B>) -> Local<T, B> {
        Local { n: u.n + self.bias.0, t: u.t + self.bias.1, m: u.m }
    }

    /// The local block, recomputed from its inverse.
    fn block(&self) -> Block {
        let det = self.inverse_t * self.inverse_m - self.inverse_tm * self.inverse_tm;
        let (t, m) = (self.inverse_m / det, self.inverse_t / det);
        let w = if B::TWISTS { 1.0 / self.inverse_w[0] } else { m };
        Block { n: 1.0 / self.inverse_n, t, m, w, tm: -self.inverse_tm / det }
    }

    #[inline(always)]
    fn limits(&self) -> Cone {
        Cone { mu: self.mu, nu: self.nu, xi: of_twist::<B>(self.xi, 0.0) }
    }
}

impl<A: Vect, B: Moments> Law for Bonded<A, B> {
    type T = A;
    type B = B;
    type Axes<D: Dim> = D::Frame;

    #[inline(always)]
    fn improve(&self, local: LocalSolve, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        let u = self.biased(u);
        match local {
            LocalSolve::Exact => {
                let stuck = Local {
                    n: r.n - u.n * self.inverse_n,
                    t: r.t - u.t * self.inverse_t - resized::<B, A>(u.m) * self.inverse_tm,
                    m: r.m
                        - u.m.scaled(self.inverse_m, of_twist::<B>(self.inverse_w, 0.0))
                        - resized::<A, B>(u.t) * self.inverse_tm,
                };
                // nearly every bond sticks: no square root, no division
                if self.limits().contains(&Local { n: stuck.n + self.shift, ..stuck }) {
                    stuck
                } else {
                    self.at_limit(r, u)
                }
            }
            LocalSolve::PredictorCorrector => r + self.predict_correct(r, u),
        }
    }

    #[inline(always)]
    fn natural_map(&self, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        self.predict_correct(r, self.biased(u)) * -1.0
    }

    fn bias(&self) -> Local<A, B> {
        self.biased(Local::zero())
    }

    fn gamma(&self) -> f64 {
        let block = self.block();
        1.0 / block.n.max(block.t).max(block.m).max(block.w)
    }

    fn cone(&self) -> Cone {
        self.limits()
    }

    fn associated(&self) -> bool {
        self.flow == BondFlow::Associated
    }

    #[inline(always)]
    fn shift(&self) -> f64 {
        self.shift
    }

    fn breaks(&self) -> bool {
        true
    }

    fn reached(&self) -> Option<Reached> {
        self.reached
    }

    fn set_reached(&mut self, reached: Option<Reached>) {
        self.reached = reached;
    }

    #[inline(always)]
    fn arms(&self) -> Arms {
        self.arms
    }
}

impl<A: Vect, B: Moments> Bonded<A, B> {
    fn predict_correct(&self, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        predict_correct(self.limits(), self.shift, self.flow == BondFlow::Bipotential, self.gamma(), r, u)
    }

    /// Local solve on the boundary of the cone.
    ///
    /// An iteration with the splitting W = B + C, B = diag W: B is solved in closed form
    /// ([`Cone::minimise`]), and C, the coupling of t and m, is lagged. It converges because B − C
    /// is positive definite where W is. An iteration reduces the error by |w_tm| / √(w_t w_m): zero
    /// for grains of one size, 0.8 at a size ratio of four.
    #[cold]
    fn at_limit(&self, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        let (w, cone) = (self.block(), self.limits());
        let coupled = |t: A| resized::<A, B>(t) * w.tm;
        let mut x = r;
        x.n += self.shift;
        // u = W x + q
        let q = Local {
            n: u.n - w.n * x.n,
            t: u.t - x.t * w.t - resized::<B, A>(x.m) * w.tm,
            m: u.m - x.m.scaled(w.m, w.w) - coupled(x.t),
        };
        let weights = Weights { n: w.n, t: w.t, m: w.m, w: w.w };
        let rounds = if w.tm == 0.0 { 1 } else { 200 };
        for _ in 0..rounds {
            let lagged = Local { n: q.n, t: q.t + resized::<B, A>(x.m) * w.tm, m: q.m + coupled(x.t) };
            let next = match self.flow {
                BondFlow::Associated => cone.minimise(weights, lagged),
                BondFlow::Bipotential => {
                    let n = (-lagged.n / w.n).max(0.0);
                    Local {
                        n,
                        t: (lagged.t * (-1.0 / w.t)).clipped(cone.mu * n),
                        m: lagged.m.scaled(-1.0 / w.m, -1.0 / w.w).within(cone.nu * n, cone.xi * n),
                    }
                }
            };
            let change = next - x;
            x = next;
            if change.dot(&change) <= 1e-30 * x.dot(&x) {
                break;
            }
        }
        x.n -= self.shift;
        x
    }
}

/// An intact elastic bond: the law of the rigid bond with u + C (r − r₀) in place of u, C being the
/// compliance.
///
/// A row of stiffness k obeys f⁺ = f − k h u⁺ over an implicit step h. In impulses, C = 1/(k h²),
/// and r₀ = h f is the impulse that the bond carried at the start of the step; see
/// docs/theory/elastic-bonds.md.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elastic<T, B: Moments> {
    bond: Bonded<T, B>,
    // compliance of the rows n, t and m, and of the twist row
    soft: [f64; 3],
    soft_w: B::Twist,
    carried: Local<T, B>,
}

impl<T: Vect, B: Moments> Elastic<T, B> {
    /// From the local block of the rigid bond, its compliance (1/kg), the carried impulse r₀ (N s),
    /// and the arguments of [`Bonded::new`].
    pub fn new(
        block: Block,
        compliance: Weights,
        carried: Local<T, B>,
        arms: Arms,
        shift: f64,
        cone: Cone,
        flow: BondFlow,
    ) -> Self {
        let Weights { n, t, m, w } = compliance;
        let block = Block { n: block.n + n, t: block.t + t, m: block.m + m, w: block.w + w, ..block };
        let bond = Bonded::new(block, arms, shift, cone, flow);
        Self { bond, soft: [n, t, m], soft_w: only_twist::<B>(w), carried }
    }

    /// The same bond with this bias of the normal and the tangential velocity (m/s).
    #[must_use]
    pub fn with_bias(self, n: f64, t: T) -> Self {
        Self { bond: self.bond.with_bias(n, t), ..self }
    }
}

impl<A: Vect, B: Moments> Law for Elastic<A, B> {
    type T = A;
    type B = B;
    type Axes<D: Dim> = D::Frame;

    #[inline(always)]
    fn improve(&self, local: LocalSolve, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        self.bond.improve(local, r, u + self.compliance().times(&(r - self.carried)))
    }

    #[inline(always)]
    fn natural_map(&self, r: Local<A, B>, u: Local<A, B>) -> Local<A, B> {
        let u = u + self.compliance().times(&(r - self.carried));
        let step = self.bond.biased(u) * self.bond.gamma();
        let mut x = r - step;
        x.n += self.bond.shift;
        // inside the cone without the round-off of the shift, far above the forces of strong bonds
        if self.bond.limits().contains(&x) { step } else { self.bond.natural_map(r, u) }
    }

    fn bias(&self) -> Local<A, B> {
        self.bond.bias()
    }

    fn gamma(&self) -> f64 {
        self.bond.gamma()
    }

    fn cone(&self) -> Cone {
        self.bond.limits()
    }

    fn associated(&self) -> bool {
        self.bond.associated()
    }

    #[inline(always)]
    fn shift(&self) -> f64 {
        self.bond.shift
    }

    fn breaks(&self) -> bool {
        true
    }

    fn reached(&self) -> Option<Reached> {
        self.bond.reached
    }

    fn set_reached(&mut self, reached: Option<Reached>) {
        self.bond.reached = reached;
    }

    #[inline(always)]
    fn arms(&self) -> Arms {
        self.bond.arms
    }

    #[inline(always)]
    fn compliance(&self) -> Weights {
        let [n, t, m] = self.soft;
        Weights { n, t, m, w: of_twist::<B>(self.soft_w, 0.0) }
    }

    fn carried(&self) -> Local<A, B> {
        self.carried
    }
}
