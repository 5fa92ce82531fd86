//! The energy balance of a run, and the momentum.
//!
//! Contact work is r·(u⁺ + u⁻)/2, by row. The balance closes for any reactions, since kinetic
//! energy is quadratic in v: its remainder checks the implementation, not the accuracy.

use crate::contact::{Law, Local};
use crate::dim::{Dim, Vect};
use crate::problem::{ContactProblem, Group, GroupVisitor, KINDS, Nodes};

/// Energies since the start of a run (J).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    /// Kinetic energy of grains and force-driven walls.
    pub kinetic: f64,
    /// Work of gravity, prescribed forces, the pressure of a membrane and wall drives.
    pub external_work: f64,
    /// Energy lost by the normal rows of dry contacts.
    pub impact: f64,
    /// Energy lost by friction.
    pub friction: f64,
    /// Energy lost by intact rigid bonds; exact rigid bonds lose none, so it is a numerical
    /// remainder.
    pub bonds: f64,
    /// Energy stored in elastic bonds now, Σ ½ f²/k.
    pub elastic: f64,
    /// Energy of elastic bonds dissipated by the numerical damping of the implicit step.
    pub damping: f64,
    /// Elastic energy released by bonds that broke.
    pub fracture: f64,
    /// Work minus all other entries: round-off, if the balance is implemented correctly.
    pub remainder: f64,
}

/// Momentum of the grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum<D: Dim> {
    /// Σ m v (kg m/s).
    pub linear: D::Vector,
    /// Σ m x × v + I ω about the origin (kg m²/s).
    pub angular: D::Spin,
}

/// Elastic energy (J) of a contact under the impulse `r`: ½ r·C r, which is ½ f²/k.
pub(super) fn elastic_energy<L: Law>(law: &L, r: &Local<L::T, L::B>) -> f64 {
    0.5 * r.dot(&law.compliance().times(r))
}

/// Energy (J) that the rows of each kind of contact took from the bodies: −Σ r·(u⁺ + u⁻)/2 for n, t
/// and m.
pub(super) fn losses<D: Dim>(before: &[(D::Vector, D::Spin)], problem: &ContactProblem<D>) -> [[f64; 3]; KINDS] {
    let mut losses = Losses::<D> { before, kind: 0, sums: [[0.0; 3]; KINDS] };
    problem.visit_groups(&mut losses);
    losses.sums
}

struct Losses<'a, D: Dim> {
    before: &'a [(D::Vector, D::Spin)],
    kind: usize,
    sums: [[f64; 3]; KINDS],
}

impl<D: Dim> GroupVisitor<D> for Losses<'_, D> {
    fn visit<L: Law>(&mut self, after: &Nodes<D>, group: &Group<D, L>) {
        for c in group {
            let arms = c.law.arms();
            let [i, j] = c.link.nodes.map(|k| self.before[k as usize]);
            let u = (c.link.relative_velocity(arms, i, j) + after.relative_velocity(&c.link, arms)) * 0.5;
            let rows: [f64; 3] = [c.r.n * u.n, c.r.t.dot(&u.t), c.r.m.dot(&u.m)];
            for (sum, row) in self.sums[self.kind].iter_mut().zip(rows) {
                *sum -= row;
            }
        }
        self.kind += 1;
    }
}
