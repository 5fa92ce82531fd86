//! The contact problem as rows over scaled unknowns, in one form for 2D and 3D.
//!
//! The unknowns are y = M^{1/2} v of the nodes that can move: the mass matrix becomes the identity,
//! so that heavy and light bodies are treated alike. Masses and impulses are relative to a unit of
//! mass of 1 or 2 kg ([`mass_unit`]), so that a scene whose masses are scaled by a power of two has
//! the same bits. Each contact stores the coefficients h of its rows, u = Hᵀ v = Σ h y + u₀, where
//! u₀ comes from nodes whose velocity is given.

use crate::contact::{Arms, Cone, Law, PADDED, Padded, Weights};
use crate::dim::{Dim, Vect, tangential_rows};
use crate::problem::{Contact, ContactProblem, Link, Nodes, Visitor};
use crate::solver::tuning::defaults;
use crate::solver::twofold::Twofold;
use nalgebra::SMatrix;

/// The derivative A of a corrector, over padded rows.
#[derive(Clone, Debug)]
pub(super) enum Operator {
    /// The groups of rows are uncoupled.
    Diagonal(Weights),
    /// In the order n, t, m.
    Full(Box<SMatrix<f64, PADDED, PADDED>>),
}

impl Operator {
    /// A x.
    #[inline]
    pub fn times(&self, x: &Padded) -> Padded {
        match self {
            Self::Diagonal(w) => w.times(x),
            Self::Full(a) => Padded::from_order(&(**a * x.in_order())),
        }
    }

    /// The entry in row `r` and column `c`, in the order n, t, m.
    #[inline]
    pub fn entry(&self, r: usize, c: usize) -> f64 {
        match self {
            Self::Diagonal(_) if r != c => 0.0,
            Self::Diagonal(w) => w.in_order()[r],
            Self::Full(a) => a[(r, c)],
        }
    }
}

/// Most unknowns of two bodies.
pub(super) const PAIR: usize = 12;

/// One contact.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// First unknown of each of the two nodes, and its number of unknowns (zero if it cannot move).
    pub at: [usize; 2],
    pub count: [usize; 2],
    /// Start of its coefficients; row by row, `count[0] + count[1]` each.
    pub start: usize,
    /// Places of the contact's rows in a padded vector.
    pub rows: &'static [usize],
    pub cone: Cone,
    pub associated: bool,
    /// Whether it is a bond.
    pub is_bond: bool,
    /// Shift of the normal reaction (N s).
    pub shift: f64,
    /// Relative velocity due to given velocities, with the bias (m/s).
    pub given: Padded,
    /// 1/ρ of each group; zero for an elastic bond.
    pub weights: Weights,
    /// The same that an elastic bond has once ρ is lowered.
    pub lowered: Weights,
    /// Multiplier: a reaction without the shift, which would cause round-off (N s).
    pub multiplier: Padded,
    /// Compliance of an elastic bond; zero for a rigid contact.
    pub compliance: Weights,
    /// Reaction that an elastic bond carried when the step began (N s).
    pub carried: Padded,
    /// Normal entry of W (1/kg).
    pub normal: f64,
    /// Σ h² over all coefficients: the trace of the contact's block of W (1/kg).
    pub size: f64,
}

impl Row {
    /// Number of unknowns of both nodes.
    #[inline]
    pub fn width(&self) -> usize {
        self.count[0] + self.count[1]
    }

    /// Whether the row at a place of a padded vector can carry a reaction.
    pub fn bears(&self, place: usize) -> bool {
        let Cone { mu, nu, xi } = self.cone;
        match place {
            0 => true,
            1 | 2 => mu > 0.0,
            TWIST => xi > 0.0,
            _ => nu > 0.0,
        }
    }

    /// Whether it is a bond without compliance.
    pub fn is_rigid_bond(&self) -> bool {
        self.is_bond && self.compliance.n == 0.0
    }

    /// Whether it is a bond with compliance.
    pub fn is_elastic(&self) -> bool {
        self.compliance.n > 0.0
    }

    /// Weights of the corrector's quadratic form, 1/ρ + C.
    #[inline]
    pub fn metric(&self) -> Weights {
        self.weights + self.compliance
    }

    /// q = u − r/ρ − C r₀, the linear form of the corrector for reactions without the shift at the
    /// velocity `u`.
    #[inline]
    pub fn form(&self, u: &Padded) -> Padded {
        *u - self.weights.times(&self.multiplier) - self.compliance.times(&self.carried)
    }
}

/// All contacts of a problem.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub list: Vec<Row>,
    pub coefficients: Vec<f64>,
    /// Number of unknowns.
    pub unknowns: usize,
    /// Free velocities in the scaled unknowns.
    pub free: Vec<f64>,
    /// Norm of the applied impulses (N s).
    pub applied: f64,
    /// See [`ContactProblem::is_static`].
    pub is_static: bool,
}

/// First unknown of each node.
struct Unknowns {
    first: Vec<usize>,
    total: usize,
    /// Unit of mass (kg).
    unit: f64,
}

/// Stiffness of the tangential and bending rows relative to the normal row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffnessRatio {
    /// Tangential stiffness over the normal one (–).
    pub tangential: f64,
    /// Bending stiffness over the normal one times the square of the mean diameter (–).
    pub rolling: f64,
}

impl Default for StiffnessRatio {
    /// A bar as wide as long: the bending stiffness over the normal one is a²/12.
    fn default() -> Self {
        Self { tangential: 1.0, rolling: defaults::ROLLING }
    }
}

impl StiffnessRatio {
    /// 1/ρ of each group, given that of the normal row. For twist the shear modulus of a bar
    /// applies and, as it is round, twice its second moment of area.
    pub(super) fn weights(&self, normal: f64) -> Weights {
        let (t, m) = (normal / self.tangential, normal / self.rolling);
        Weights { n: normal, t, m, w: 0.5 * m / self.tangential }
    }
}

struct Flatten<'a, D: Dim> {
    rows: Rows,
    unknowns: &'a Unknowns,
    ratio: StiffnessRatio,
    normal: Vec<f64>,
    problem: &'a ContactProblem<D>,
    /// The nodes with their given velocities; zero for nodes that can move.
    still: Nodes<D>,
}

const FRICTIONLESS: &[usize] = &[0];
const DRY_2D: &[usize] = &[0, 1];
const DRY_3D: &[usize] = &[0, 1, 2];
const BOND_2D: &[usize] = &[0, 1, 3];
const BOND_3D: &[usize] = &[0, 1, 2, 3, 4];
const BOND_3D_TWIST: &[usize] = &[0, 1, 2, 3, 4, TWIST];

/// Place of the twist row.
pub(super) const TWIST: usize = 5;

pub(super) fn places(tangents: usize, moments: usize) -> &'static [usize] {
    match (tangents, moments) {
        (0, _) => FRICTIONLESS,
        (1, 0) => DRY_2D,
        (_, 0) => DRY_3D,
        (1, _) => BOND_2D,
        (_, 2) => BOND_3D,
        _ => BOND_3D_TWIST,
    }
}

impl Unknowns {
    fn of<D: Dim>(nodes: &Nodes<D>) -> Self {
        let mut first = Vec::with_capacity(nodes.all.len());
        let mut total = 0;
        for (k, node) in nodes.all.iter().enumerate() {
            first.push(total);
            total += degrees(nodes, k, node.inverse_mass > 0.0);
        }
        Self { first, total, unit: mass_unit(nodes) }
    }

    /// Square root of an inverse mass or inertia, in the unit of mass: ratio of a velocity to its
    /// scaled unknown.
    fn root(&self, inverse: f64) -> f64 {
        (inverse * self.unit).sqrt()
    }
}

fn degrees<D: Dim>(nodes: &Nodes<D>, k: usize, moves: bool) -> usize {
    match (moves, k < nodes.grains) {
        (false, _) => 0,
        (true, true) => D::N + D::Spin::LEN,
        (true, false) => 1,
    }
}

impl Rows {
    /// Whether neither loads, velocities nor elastic bonds act: without reactions all bodies rest.
    pub fn nothing_acts(&self) -> bool {
        if self.is_static {
            // reactions of the last event do
            return false;
        }
        let rests = |row: &Row| row.given == Padded::zero() && row.carried == Padded::zero();
        self.free.iter().all(|y| *y == 0.0) && self.list.iter().all(rests)
    }

    /// The rows of a problem. Normal rows have ρ = κ / (mean normal entry of W), times the relative
    /// stiffness of the pair: in 3D that of a cylinder of the mean diameter, so that ρ grows with
    /// the diameter; in 2D all pairs are alike.
    pub fn of<D: Dim>(problem: &ContactProblem<D>, kappa: f64, ratio: StiffnessRatio) -> Self {
        let unknowns = Unknowns::of(&problem.nodes);
        let mut free = vec![0.0; unknowns.total];
        for (k, (v, w)) in problem.free.iter().enumerate() {
            write_scaled(&problem.nodes, &unknowns, k, v, w, &mut free);
        }
        let rows = Rows {
            unknowns: unknowns.total,
            free,
            applied: problem.applied / unknowns.unit,
            is_static: problem.is_static,
            ..Rows::default()
        };
        let mut still = problem.nodes.clone();
        for (node, free) in still.all.iter_mut().zip(problem.free.iter()) {
            let moves = node.inverse_mass > 0.0;
            (node.velocity, node.spin) = if moves { (D::Vector::zero(), D::Spin::zero()) } else { *free };
        }
        for (wall, slide) in problem.nodes.slides.iter().enumerate() {
            // the unknown of such a wall is its velocity along the drive alone
            if slide.norm() > 0.0 {
                still.all[problem.nodes.grains + wall].velocity = *slide;
            }
        }
        let mut flatten = Flatten { rows, unknowns: &unknowns, ratio, normal: Vec::new(), problem, still };
        problem.visit(&mut flatten);
        let Flatten { mut rows, normal, .. } = flatten;
        let mean = |sum: f64| sum / normal.len().max(1) as f64;
        let soft = mean(rows.list.iter().map(|r| r.weights.n).sum());
        let scale = mean(normal.iter().sum()) / (soft * kappa);
        rows.soften(scale);
        // their own compliance determines the reactions of elastic bonds
        let elastic = rows.list.iter_mut().filter(|row| row.is_elastic());
        elastic.for_each(|row| {
            row.lowered = std::mem::take(&mut row.weights);
            // a bond that does not resist twist has no compliance there, and 0/0 is no reaction
            if row.compliance.w == 0.0 {
                row.weights.w = std::mem::take(&mut row.lowered.w);
            }
        });
        rows
    }

    /// Whether the problem is in 3D: some contact has rows in two tangential directions.
    pub fn in_space(&self) -> bool {
        self.list.iter().any(|row| row.rows.contains(&2))
    }

    /// Divide ρ of all rows by `factor`.
    pub fn soften(&mut self, factor: f64) {
        for row in &mut self.list {
            row.weights = (row.weights + std::mem::take(&mut row.lowered)) * factor;
        }
    }

    /// Relative velocity of contact `row`, bias included.
    #[inline]
    pub fn velocity(&self, row: &Row, y: &[f64]) -> Padded {
        row.given + self.pulled(row, y)
    }

    /// The scaled velocities that these reactions give.
    pub fn given_by(&self, reactions: &[Padded]) -> Vec<f64> {
        let mut y = self.free.clone();
        self.list.iter().zip(reactions).for_each(|(row, r)| self.apply(row, r, &mut y));
        y
    }

    /// Set the multipliers of the next proximal iteration.
    pub fn move_multipliers(&mut self, reactions: &[Padded]) {
        self.list.iter_mut().zip(reactions).for_each(|(row, r)| row.multiplier = *r);
    }

    /// Coefficients of row `k` of a contact, over the unknowns of its first node and then its
    /// second.
    #[inline]
    fn coefficients(&self, row: &Row, k: usize) -> &[f64] {
        &self.coefficients[row.start + k * row.width()..][..row.width()]
    }

    /// Row `k` of H̃ᵀ y for one contact.
    #[inline]
    pub fn pulled_by(&self, row: &Row, k: usize, y: &[f64]) -> f64 {
        let (first, second) = self.coefficients(row, k).split_at(row.count[0]);
        let sum = |h: &[f64], y: &[f64]| h.iter().zip(y).map(|(h, y)| h * y).sum::<f64>();
        sum(first, &y[row.at[0]..]) + sum(second, &y[row.at[1]..])
    }

    /// y += H̃ r for row `k` of one contact, in twice the precision.
    pub fn push_twofold(&self, row: &Row, k: usize, r: f64, y: &mut [Twofold]) {
        let (first, second) = self.coefficients(row, k).split_at(row.count[0]);
        first.iter().zip(&mut y[row.at[0]..]).for_each(|(h, y)| y.add_product(*h, r));
        second.iter().zip(&mut y[row.at[1]..]).for_each(|(h, y)| y.add_product(*h, r));
    }

    /// Row `k` of H̃ᵀ y for one contact, in twice the precision.
    pub fn pulled_twofold(&self, row: &Row, k: usize, y: &[Twofold]) -> Twofold {
        let (first, second) = self.coefficients(row, k).split_at(row.count[0]);
        let mut sum = Twofold::default();
        first.iter().zip(&y[row.at[0]..]).for_each(|(h, y)| sum.add_scaled(*h, *y));
        second.iter().zip(&y[row.at[1]..]).for_each(|(h, y)| sum.add_scaled(*h, *y));
        sum
    }

    /// y += scale · H̃ r for row `k` of one contact.
    #[inline]
    pub fn push_by(&self, row: &Row, k: usize, scale: f64, r: f64, y: &mut [f64]) {
        let (first, second) = self.coefficients(row, k).split_at(row.count[0]);
        first.iter().zip(&mut y[row.at[0]..]).for_each(|(h, y)| *y += scale * h * r);
        second.iter().zip(&mut y[row.at[1]..]).for_each(|(h, y)| *y += scale * h * r);
    }

    /// H̃ᵀ y for one contact.
    #[inline]
    pub fn pulled(&self, row: &Row, y: &[f64]) -> Padded {
        let mut u = [0.0; PADDED];
        for (k, place) in row.rows.iter().enumerate() {
            u[*place] = self.pulled_by(row, k, y);
        }
        Padded::from_order(&u.into())
    }

    /// y += H̃ r for one contact.
    #[inline]
    pub fn apply(&self, row: &Row, r: &Padded, y: &mut [f64]) {
        let r = r.in_order();
        for (k, place) in row.rows.iter().enumerate() {
            self.push_by(row, k, 1.0, r[*place], y);
        }
    }

    /// H̃ r of all contacts.
    pub fn pushed(&self, reactions: &[Padded]) -> Vec<f64> {
        let mut y = vec![0.0; self.unknowns];
        self.list.iter().zip(reactions).for_each(|(row, r)| self.apply(row, r, &mut y));
        y
    }

    /// √(r·(W + C) r): for rigid contacts the norm of the net impulses on the bodies.
    pub fn load(&self, reactions: &[Padded]) -> f64 {
        let moving = self.pushed(reactions).iter().map(|y| y * y).sum::<f64>();
        (moving + self.elastic(reactions)).sqrt()
    }

    /// r·C r.
    pub fn elastic(&self, reactions: &[Padded]) -> f64 {
        self.list.iter().zip(reactions).map(|(row, r)| row.compliance.times(r).dot(r)).sum()
    }

    /// The error of the scaled velocities that may change the reactions of elastic bonds by as much
    /// as these are, in the norm of r·C r: |H̃ᵀ y|² ≤ size y². Infinite without elastic bonds.
    pub fn deforming(&self, reactions: &[Padded]) -> f64 {
        let elastic = self.list.iter().filter(|row| row.is_elastic());
        let most = elastic.map(|row| row.size / row.compliance.n).fold(0.0, f64::max);
        if most == 0.0 { f64::INFINITY } else { (self.elastic(reactions) / most).sqrt() }
    }

    /// The largest coefficient of each unknown; 1 for an unknown without coefficients.
    pub fn largest(&self) -> Vec<f64> {
        let mut most = vec![0.0f64; self.unknowns];
        for row in &self.list {
            for k in 0..row.rows.len() {
                let (first, second) = self.coefficients(row, k).split_at(row.count[0]);
                first.iter().zip(&mut most[row.at[0]..]).for_each(|(h, most)| *most = most.max(h.abs()));
                second.iter().zip(&mut most[row.at[1]..]).for_each(|(h, most)| *most = most.max(h.abs()));
            }
        }
        most.into_iter().map(|most| if most > 0.0 { most } else { 1.0 }).collect()
    }

    /// out ← out + H̃ A H̃ᵀ for some rows of one contact, row by row over the unknowns of its pair;
    /// `a` gives the entries of A over those rows. If A is symmetric, so is the result, to the last
    /// bit; `out` must be symmetric then.
    pub fn add_element(&self, row: &Row, of: &[usize], a: impl Fn(usize, usize) -> f64, out: &mut [f64]) {
        let width = row.width();
        let h = |k: usize| self.coefficients(row, of[k]);
        let symmetric = (0..of.len()).all(|i| (0..i).all(|j| a(i, j) == a(j, i)));
        for i in 0..of.len() {
            // A H̃ᵀ
            let mut line = [0.0; PAIR];
            for j in 0..of.len() {
                let entry = a(i, j);
                if entry != 0.0 {
                    line.iter_mut().zip(h(j)).for_each(|(x, h)| *x += entry * h);
                }
            }
            for (r, (out, h)) in out.chunks_exact_mut(width).zip(h(i)).enumerate() {
                let end = if symmetric { r + 1 } else { width };
                out[..end].iter_mut().zip(&line).for_each(|(out, x)| *out += h * x);
            }
        }
        if symmetric {
            // in a damaged state a contact may have one body twice, and fewer rows
            for r in 0..out.len() / width {
                (0..r).for_each(|c| out[c * width + r] = out[r * width + c]);
            }
        }
    }
}

/// Difference between two sets of reactions, relative to the second, in the norm of r·(W + C) r:
/// for rigid contacts that of the net impulses on the bodies.
pub(super) fn change(rows: &Rows, from: &[Padded], to: &[Padded]) -> f64 {
    let changes: Vec<Padded> = from.iter().zip(to).map(|(from, to)| *to - *from).collect();
    let change = rows.load(&changes);
    if change == 0.0 { 0.0 } else { change / rows.load(to) }
}

/// The unit of mass (kg), 1 or 2, chosen so that the heaviest grain has an even binary exponent.
/// Square roots of masses scaled by powers of two then differ by powers of two.
pub(super) fn mass_unit<D: Dim>(nodes: &Nodes<D>) -> f64 {
    let inverse = nodes.all[..nodes.grains].iter().map(|n| n.inverse_mass).filter(|m| *m > 0.0);
    let exponent = inverse.fold(f64::INFINITY, f64::min).to_bits() >> 52;
    // the stored exponent has an odd offset
    if exponent % 2 == 0 { 2.0 } else { 1.0 }
}

fn write_scaled<D: Dim>(nodes: &Nodes<D>, unknowns: &Unknowns, k: usize, v: &D::Vector, w: &D::Spin, out: &mut [f64]) {
    let node = &nodes.all[k];
    if node.inverse_mass == 0.0 {
        return;
    }
    let first = unknowns.first[k];
    let mass = 1.0 / unknowns.root(node.inverse_mass);
    if k >= nodes.grains {
        out[first] = mass * v.dot(&nodes.drives[k - nodes.grains]);
        return;
    }
    for axis in 0..D::N {
        out[first + axis] = mass * v[axis];
    }
    for axis in 0..D::Spin::LEN {
        out[first + D::N + axis] = w[axis] / unknowns.root(node.inverse_inertia);
    }
}

/// Coefficients of the rows of one contact, over the unknowns of its pair.
struct Table {
    rows: [[f64; PAIR]; PADDED],
    tangents: usize,
    moments: usize,
    /// Columns filled so far.
    width: usize,
}

impl Table {
    fn add<T: Vect, B: Vect>(&mut self, n: f64, t: T, m: B, scale: f64) {
        self.rows[0][self.width] = n * scale;
        for c in 0..self.tangents {
            self.rows[1 + c][self.width] = t[c] * scale;
        }
        for c in 0..self.moments {
            self.rows[1 + self.tangents + c][self.width] = m[c] * scale;
        }
        self.width += 1;
    }
}

impl<D: Dim> Flatten<'_, D> {
    /// Add the columns of one node's unknowns to the table of a contact; returns how many.
    fn node(&self, link: &Link<D>, arms: Arms, side: usize, table: &mut Table) -> usize {
        let k = link.nodes[side] as usize;
        let nodes = &self.problem.nodes;
        let node = &nodes.all[k];
        if node.inverse_mass == 0.0 {
            return 0;
        }
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let zero = D::Moment::zero();
        if k >= nodes.grains {
            let (n, t) = D::split(&link.axes, nodes.drives[k - nodes.grains] * sign);
            table.add(n, t, zero, self.unknowns.root(node.inverse_mass));
            return 1;
        }
        for axis in 0..D::N {
            let mut e = D::Vector::zero();
            e[axis] = sign;
            let (n, t) = D::split(&link.axes, e);
            table.add(n, t, zero, self.unknowns.root(node.inverse_mass));
        }
        for axis in 0..D::Spin::LEN {
            let mut e = D::Spin::zero();
            e[axis] = 1.0;
            let turn = D::spin_rows(&link.axes, e) * -arms.lever[side];
            let moment = D::moment_rows(&link.axes, e) * (sign * arms.bending);
            table.add(0.0, turn, moment, self.unknowns.root(node.inverse_inertia));
        }
        D::N + D::Spin::LEN
    }
}

impl<D: Dim> Visitor<D> for Flatten<'_, D> {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
        let tangents = tangential_rows::<D, L::T>();
        let rows = places(tangents, L::B::LEN);
        let (arms, unit) = (c.law.arms(), self.unknowns.unit);
        let mut table = Table { rows: [[0.0; PAIR]; PADDED], tangents, moments: L::B::LEN, width: 0 };
        let link = c.link.whole();
        let first = self.node(&link, arms, 0, &mut table);
        let second = self.node(&link, arms, 1, &mut table);
        let start = self.rows.coefficients.len();
        for row in &table.rows[..rows.len()] {
            self.rows.coefficients.extend_from_slice(&row[..table.width]);
        }
        // contribution of nodes with given velocities
        let still = self.still.relative_velocity::<L::T, L::B>(&c.link, arms);
        let given = c.link.in_frame(&(still + c.law.bias()));
        let normal: f64 = table.rows[0][..table.width].iter().map(|h| h * h).sum();
        self.normal.push(normal);
        let radius = |side: usize| self.problem.radii.get(c.link.nodes[side] as usize).copied();
        // two grains, or a grain at a wall; in 2D there are no radii: stiffness is independent of
        // size
        let soft = radius(0).map_or(1.0, |r| 1.0 / (r + radius(1).unwrap_or(r)));
        self.rows.list.push(Row {
            at: c.link.nodes.map(|k| self.unknowns.first[k as usize]),
            count: [first, second],
            start,
            rows,
            cone: c.law.cone(),
            associated: c.law.associated(),
            is_bond: c.law.breaks(),
            shift: c.law.shift() / unit,
            given,
            weights: self.ratio.weights(soft),
            lowered: Weights::default(),
            multiplier: c.link.in_frame(&c.r) * (1.0 / unit),
            compliance: c.law.compliance() * unit,
            carried: c.link.in_frame(&c.law.carried()) * (1.0 / unit),
            normal,
            size: table.rows[..rows.len()].iter().flat_map(|row| &row[..table.width]).map(|h| h * h).sum(),
        });
    }
}
