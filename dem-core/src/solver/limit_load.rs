//! The limit load: the largest factor λ for which reactions inside all cones balance the constant
//! loads f₀ and λ times the growing loads f₁,
//!
//! maximise λ subject to H r + f₀ + λ f₁ = 0, r + r_coh n ∈ K.
//!
//! It is the static theorem of limit analysis (Drucker, Prager & Greenberg 1952; for assemblies
//! of rigid blocks Livesley 1978), a second-order cone programme. A bond that holds keeps its
//! reaction inside the cone, so that a load beyond λ breaks a bond, whatever the stiffness, the
//! time step and the solver.
//!
//! The method is the homogeneous self-dual embedding with the scaling of Nesterov & Todd and
//! Mehrotra's predictor–corrector (Andersen, Roos & Terlaky, Math. Program. 95, 2003). Where there
//! is no optimum it ends at a proof: reactions that balance f₁ alone inside the cones without
//! cohesion (the load is not bounded), or a mechanism that the loads drive at every λ (they are
//! balanced at none).
//!
//! With x = (r̂, λ), A = (H, f₁), s = L r̂ in a product of cones Q:
//!
//! minimise c·x subject to A x = b, s = L r̂ ∈ Q, b = −f₀ + H (r_coh n), c = (0, ∓1).
//!
//! Eliminating s and the dual z leaves S δr̂ + Hᵀδy = p with S = Lᵀ W⁻² L block by block, and with
//! that (H S⁻¹ Hᵀ) δy on the graph of the bodies, bordered by f₁.

use super::graph::Graph;
use super::interior::cones::{Point, Scaling, dot, eigenvalues, moved, product, reach};
use super::rows::{Row, Rows, StiffnessRatio, TWIST};
use super::tuning::limit_load as tuning;
use crate::contact::PADDED;
use crate::dim::{Dim, Vect};
use crate::linear::Lu;
use crate::problem::ContactProblem;
use std::sync::Arc;

/// What the largest load factor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimitLoad {
    /// The loads are balanced up to the factor `upper` at most (the dual value), and up to `lower`
    /// (the primal value); both are the same to the accuracy of the solution.
    Factor {
        /// Value of the reactions found.
        lower: f64,
        /// Value of the mechanism found.
        upper: f64,
    },
    /// No load is too large: reactions inside the cones without cohesion balance the growing loads
    /// alone (checked).
    Unbounded,
    /// The loads are balanced at no factor, or only at negative ones: the constant loads drive some
    /// mechanism.
    NeverBalanced,
    /// The constant loads alone are not balanced; they are from this factor on.
    BrokenAtStart {
        /// Least factor that is balanced.
        least: f64,
    },
    /// The method has not come to an end.
    Undecided,
}

/// The limit load of a problem over a step of 1 s. The free velocities of the problem are those
/// that the constant loads give, M⁻¹ f₀; `growing` are those of the growing loads, M⁻¹ f₁. All its
/// contacts take part; geometry, bias, compliance and flow do not matter.
pub fn limit_load<D: Dim>(problem: &ContactProblem<D>, growing: Arc<[(D::Vector, D::Spin)]>) -> LimitLoad {
    let constant = problem.free.iter().any(|(v, w)| v.norm() > 0.0 || w.norm() > 0.0);
    let rows = |free: Arc<[(D::Vector, D::Spin)]>| {
        let loaded = ContactProblem { free, ..problem.clone() };
        Rows::of(&loaded, 1.0, StiffnessRatio::default())
    };
    let load = rows(growing).free;
    let mut programme = match Programme::of(rows(Arc::clone(&problem.free)), load) {
        Ok(programme) => programme,
        Err(known) => return known,
    };
    if constant {
        // whether they are balanced at λ = 0: the least λ
        programme.sense = 1.0;
        match programme.solve() {
            LimitLoad::Unbounded => {}
            LimitLoad::Factor { lower, upper } => {
                let least = 0.5 * (lower + upper);
                if lower > tuning::ACCEPT.max((upper - lower).abs()) {
                    return LimitLoad::BrokenAtStart { least };
                }
            }
            other => return other,
        }
        programme.sense = -1.0;
    }
    match programme.solve() {
        LimitLoad::Factor { lower, upper } if upper < -tuning::ACCEPT.max((upper - lower).abs()) => {
            LimitLoad::NeverBalanced
        }
        found => found,
    }
}

/// A cone of a contact: s = (slope r_n, r_a, r_b).
struct Side {
    slope: f64,
    /// Places of the other components among the rows of the contact that take part.
    others: [Option<usize>; 2],
}

/// The unknown reactions of a contact: the rows that take part.
struct Site {
    /// Places among the rows of the contact; the first is the normal row.
    of: Vec<usize>,
    /// Start in a list of reactions.
    at: usize,
    /// Its cones in the list of all.
    cones: std::ops::Range<usize>,
}

struct Programme {
    rows: Rows,
    graph: Arc<Graph>,
    sites: Vec<Site>,
    sides: Vec<Side>,
    /// Number of reactions.
    size: usize,
    /// Right side of the balance, and the growing load.
    b: Vec<f64>,
    load: Vec<f64>,
    /// −1 to maximise λ, 1 to minimise it.
    sense: f64,
    /// The factor that one unit of the unknown λ stands for.
    unit: f64,
}

/// A point of the embedding, or a step: reactions r̂ and factor λ, velocities y of a mechanism, cone
/// pairs s and z, and the scale τ with its dual κ.
#[derive(Clone)]
struct Iterate {
    r: Vec<f64>,
    lambda: f64,
    y: Vec<f64>,
    s: Vec<Point>,
    z: Vec<Point>,
    tau: f64,
    kappa: f64,
}

/// Right sides, or a solution, of the linear system; z is scaled, W z.
struct Parts {
    r: Vec<f64>,
    lambda: f64,
    y: Vec<f64>,
    z: Vec<Point>,
}

/// Residuals at a point.
struct Residual {
    x: Vec<f64>,
    lambda: f64,
    y: Vec<f64>,
    z: Vec<Point>,
    tau: f64,
}

fn most(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
}

fn sum(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: &Point, b: &Point) -> Point {
    moved(a, -1.0, b)
}

/// x with λ ∘ x = v.
fn divided(v: &Point, by: &Point) -> Point {
    let [high, low] = eigenvalues(by);
    let first = (by[0] * v[0] - by[1] * v[1] - by[2] * v[2]) / (high * low);
    [first, (v[1] - first * by[1]) / by[0], (v[2] - first * by[2]) / by[0]]
}

/// The scaling of a pair: W = η B(w), W z = W⁻¹ s.
#[derive(Clone, Copy)]
struct Metric {
    scaling: Scaling,
    eta: f64,
}

impl Metric {
    fn of(s: &Point, z: &Point) -> Self {
        let size = |x: &Point| {
            let [high, low] = eigenvalues(x);
            high * low
        };
        Self { scaling: Scaling::of(s, z), eta: (size(s) / size(z)).sqrt().sqrt() }
    }

    /// W x.
    fn times(&self, x: &Point) -> Point {
        self.scaling.z(x).map(|x| x * self.eta)
    }

    /// W⁻¹ x.
    fn inverse(&self, x: &Point) -> Point {
        self.scaling.x(x).map(|x| x / self.eta)
    }
}

impl Programme {
    /// The programme of these rows and this growing load; or what is known without it.
    fn of(mut rows: Rows, mut load: Vec<f64>) -> Result<Self, LimitLoad> {
        let mut constant = std::mem::take(&mut rows.free);
        rows.list.retain(|row| row.width() > 0);
        // forces in place of scaled ones: the largest coefficient of each unknown becomes 1
        let largest = rows.largest();
        for row in &rows.list {
            let scales: Vec<f64> = unknowns(row).map(|unknown| largest[unknown]).collect();
            let own = &mut rows.coefficients[row.start..][..row.rows.len() * row.width()];
            own.chunks_exact_mut(row.width()).for_each(|line| line.iter_mut().zip(&scales).for_each(|(h, l)| *h /= l));
        }
        constant.iter_mut().zip(&largest).for_each(|(f, l)| *f /= l);
        load.iter_mut().zip(&largest).for_each(|(f, l)| *f /= l);
        if most(&load) == 0.0 {
            return Err(LimitLoad::Unbounded);
        }
        let shifts = rows.list.iter().map(|row| row.shift).fold(0.0, f64::max);
        let force = match shifts.max(most(&constant)) {
            0.0 => most(&load),
            force => force,
        };
        let (mut sites, mut sides, mut size) = (Vec::new(), Vec::new(), 0);
        for row in &rows.list {
            let site = site(row, &mut sides, size);
            size += site.of.len();
            sites.push(site);
        }
        let mut b: Vec<f64> = constant.iter().map(|f| -f / force).collect();
        for row in rows.list.iter().filter(|row| row.shift > 0.0) {
            rows.push_by(row, 0, 1.0, row.shift / force, &mut b);
        }
        let unit = force / most(&load);
        load.iter_mut().for_each(|f| *f *= unit / force);
        let graph = Graph::of(&rows, &mut None).ok_or(LimitLoad::Undecided)?;
        Ok(Self { rows, graph, sites, sides, size, b, load, sense: -1.0, unit })
    }

    /// H r.
    fn pushed(&self, r: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.rows.unknowns];
        for (site, row) in self.sites.iter().zip(&self.rows.list) {
            site.of.iter().zip(&r[site.at..]).for_each(|(k, r)| self.rows.push_by(row, *k, 1.0, *r, &mut y));
        }
        y
    }

    /// Hᵀ y.
    fn pulled(&self, y: &[f64]) -> Vec<f64> {
        let of_site = |(site, row)| {
            let site: &Site = site;
            site.of.iter().map(move |k| self.rows.pulled_by(row, *k, y))
        };
        self.sites.iter().zip(&self.rows.list).flat_map(of_site).collect()
    }

    /// L r.
    fn in_cones(&self, r: &[f64]) -> Vec<Point> {
        let mut s = Vec::with_capacity(self.sides.len());
        for site in &self.sites {
            let own = &r[site.at..];
            for side in &self.sides[site.cones.clone()] {
                let [a, b] = side.others.map(|place| place.map_or(0.0, |k| own[k]));
                s.push([side.slope * own[0], a, b]);
            }
        }
        s
    }

    /// Lᵀ z.
    fn of_cones(&self, z: &[Point]) -> Vec<f64> {
        let mut r = vec![0.0; self.size];
        for site in &self.sites {
            let own = &mut r[site.at..];
            for (side, z) in self.sides[site.cones.clone()].iter().zip(&z[site.cones.clone()]) {
                own[0] += side.slope * z[0];
                for (place, z) in side.others.iter().zip(&z[1..]) {
                    if let Some(k) = place {
                        own[*k] += z;
                    }
                }
            }
        }
        r
    }

    fn residual(&self, at: &Iterate) -> Residual {
        let (pulled, of_cones) = (self.pulled(&at.y), self.of_cones(&at.z));
        let pushed = self.pushed(&at.r);
        let balance = pushed.iter().zip(&self.load).zip(&self.b);
        let own = self.in_cones(&at.r);
        Residual {
            x: pulled.iter().zip(&of_cones).map(|(y, z)| y - z).collect(),
            lambda: sum(&self.load, &at.y) + self.sense * at.tau,
            y: balance.map(|((h, f), b)| b * at.tau - h - f * at.lambda).collect(),
            z: at.s.iter().zip(&own).map(|(s, own)| minus(s, own)).collect(),
            tau: at.kappa + self.sense * at.lambda + sum(&self.b, &at.y),
        }
    }

    /// The outcome at the end of the central path.
    fn solve(&self) -> LimitLoad {
        let cones = self.sides.len();
        let e = [1.0, 0.0, 0.0];
        let mut at = Iterate {
            r: vec![0.0; self.size],
            lambda: 0.0,
            y: vec![0.0; self.rows.unknowns],
            s: vec![e; cones],
            z: vec![e; cones],
            tau: 1.0,
            kappa: 1.0,
        };
        // the best score, its error and its factors
        let mut best = (f64::INFINITY, f64::INFINITY, LimitLoad::Undecided);
        let mut since = 0;
        for _ in 0..tuning::MOST {
            let residual = self.residual(&at);
            if let Some(proved) = self.proved(&at, &residual) {
                return proved;
            }
            let (error, apart, found) = self.error(&at, &residual);
            // the factor itself may be zero
            let score = error.max(apart.min(error.sqrt()));
            since += 1;
            if score < best.0 {
                (best, since) = ((score, error, found), 0);
            }
            let stalled = since > tuning::PATIENCE && best.1 <= tuning::ACCEPT;
            if stalled || error.max(apart) <= tuning::TOLERANCE {
                break;
            }
            let Some(next) = self.next(&at, &residual) else { break };
            at = next;
        }
        if best.1 <= tuning::ACCEPT { best.2 } else { LimitLoad::Undecided }
    }

    /// The error of a point as a solution, relative to the loads; the difference of its two factors
    /// relative to them; and the factors.
    fn error(&self, at: &Iterate, residual: &Residual) -> (f64, f64, LimitLoad) {
        let [primal, dual] = [self.sense * at.lambda, -sum(&self.b, &at.y)].map(|value| value / at.tau);
        let size = 1.0 + primal.abs();
        let balance = most(&residual.y) / at.tau / (1.0 + most(&self.b) + primal.abs());
        let cone = residual.z.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs())) / at.tau / size;
        let mechanism = most(&residual.x).max(residual.lambda.abs()) / at.tau;
        let apart = (primal - dual).abs();
        let error = balance.max(cone).max(mechanism).max(apart / size);
        // to maximise λ is to minimise −λ
        let [lower, upper] = if self.sense < 0.0 { [-primal, -dual] } else { [dual, primal] };
        let found = LimitLoad::Factor { lower: lower * self.unit, upper: upper * self.unit };
        if error.is_finite() {
            (error, apart / primal.abs(), found)
        } else {
            (f64::INFINITY, f64::INFINITY, LimitLoad::Undecided)
        }
    }

    /// A proof that there is no optimum.
    fn proved(&self, at: &Iterate, residual: &Residual) -> Option<LimitLoad> {
        // reactions in the cones that balance a growing load alone
        let gain = -self.sense * at.lambda;
        if gain > 0.0 {
            let net = self.pushed(&at.r).into_iter().zip(&self.load).map(|(h, f)| h + f * at.lambda);
            let outside = residual.z.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
            if net.fold(outside, |most, value| most.max(value.abs())) <= tuning::CERTIFICATE * gain {
                return Some(LimitLoad::Unbounded);
            }
        }
        // a mechanism, with its velocities y, on which the loads do work at every λ
        let work = -sum(&self.b, &at.y);
        let strain = most(&residual.x).max(sum(&self.load, &at.y).abs());
        (work > 0.0 && strain <= tuning::CERTIFICATE * work).then_some(LimitLoad::NeverBalanced)
    }

    /// The next point; none if no step can be computed.
    fn next(&self, at: &Iterate, residual: &Residual) -> Option<Iterate> {
        let system = System::of(self, at)?;
        let centre = at.s.iter().zip(&at.z).map(|(s, z)| dot(s, z)).sum::<f64>() + at.tau * at.kappa;
        let mu = centre / (self.sides.len() + 1) as f64;
        // predictor
        let scaled: Vec<Point> = system.metrics.iter().zip(&at.z).map(|(w, z)| w.times(z)).collect();
        let towards: Vec<Point> = scaled.iter().map(|x| x.map(|x| -x)).collect();
        let guess = system.step(at, residual, 1.0, &towards, -at.tau * at.kappa);
        let far = length(at, &guess);
        // corrector
        let sigma = (1.0 - far) * (1.0 - far) * (1.0 - far);
        let pairs = scaled.iter().zip(&system.metrics).zip(guess.s.iter().zip(&guess.z));
        let towards: Vec<Point> = pairs
            .map(|((x, w), (ds, dz))| {
                let second = product(&w.inverse(ds), &w.times(dz));
                let square = product(x, x);
                divided(&[sigma * mu - square[0] - second[0], -square[1] - second[1], -square[2] - second[2]], x)
            })
            .collect();
        let last = sigma * mu - at.tau * at.kappa - guess.tau * guess.kappa;
        let step = system.step(at, residual, 1.0 - sigma, &towards, last);
        let far = (tuning::TO_THE_BOUNDARY * length(at, &step)).min(1.0);
        let by = |x: &[f64], d: &[f64]| x.iter().zip(d).map(|(x, d)| x + far * d).collect();
        let cones = |x: &[Point], d: &[Point]| x.iter().zip(d).map(|(x, d)| moved(x, far, d)).collect();
        let next = Iterate {
            r: by(&at.r, &step.r),
            lambda: at.lambda + far * step.lambda,
            y: by(&at.y, &step.y),
            s: cones(&at.s, &step.s),
            z: cones(&at.z, &step.z),
            tau: at.tau + far * step.tau,
            kappa: at.kappa + far * step.kappa,
        };
        let inside = |x: &Point| eigenvalues(x)[1] > 0.0;
        let sound = next.tau > 0.0 && next.kappa > 0.0 && next.s.iter().chain(&next.z).all(inside);
        (sound && next.lambda.is_finite()).then_some(next)
    }
}

/// The longest step, at most 1, that stays inside.
fn length(at: &Iterate, step: &Iterate) -> f64 {
    let ray = |x: f64, d: f64| if d < 0.0 { -x / d } else { f64::INFINITY };
    let pairs = at.s.iter().zip(&step.s).chain(at.z.iter().zip(&step.z));
    let far = pairs.map(|(x, d)| reach(x, d)).fold(1.0, f64::min);
    far.min(ray(at.tau, step.tau)).min(ray(at.kappa, step.kappa))
}

/// The unknowns of a contact's bodies, in the order of its coefficients.
fn unknowns(row: &Row) -> impl Iterator<Item = usize> {
    (0..2).flat_map(|side| row.at[side]..row.at[side] + row.count[side])
}

/// The rows of a contact that take part, and its cones. Rows with a coefficient of zero are zero.
fn site(row: &Row, sides: &mut Vec<Side>, at: usize) -> Site {
    let (first, mut of) = (sides.len(), vec![0]);
    let groups: [(f64, &[usize]); 3] = [(row.cone.mu, &[1, 2]), (row.cone.nu, &[3, 4]), (row.cone.xi, &[TWIST])];
    for (slope, places) in groups {
        let mut others = [None; 2];
        let mut count = 0;
        for (k, _) in row.rows.iter().enumerate().filter(|(_, place)| slope > 0.0 && places.contains(place)) {
            others[count] = Some(of.len());
            count += 1;
            of.push(k);
        }
        if count > 0 {
            sides.push(Side { slope, others });
        }
    }
    if sides.len() == first {
        sides.push(Side { slope: 1.0, others: [None; 2] });
    }
    Site { of, at, cones: first..sides.len() }
}

/// Rows of a local matrix.
type Local = [[f64; PADDED]; PADDED];

/// The linear system at a point.
struct System<'a> {
    of: &'a Programme,
    metrics: Vec<Metric>,
    /// S⁻¹ of each contact.
    soft: Vec<Soft>,
    lu: Lu,
    /// Regularisation of the balance.
    ridge: f64,
    /// (H S⁻¹ Hᵀ)⁻¹ f₁, and f₁ · of it.
    border: Vec<f64>,
    pivot: f64,
    /// Solution for the right side (−c, b, 0), which a change of τ multiplies; its z is scaled.
    by_tau: Parts,
}

impl<'a> System<'a> {
    fn of(of: &'a Programme, at: &Iterate) -> Option<Self> {
        let metrics: Vec<Metric> = at.s.iter().zip(&at.z).map(|(s, z)| Metric::of(s, z)).collect();
        let soft: Option<Vec<Soft>> = of.sites.iter().map(|site| Soft::of(of, site, &metrics)).collect();
        let soft = soft?;
        let mut diagonal = vec![0.0; of.rows.unknowns];
        for ((site, row), soft) in of.sites.iter().zip(&of.rows.list).zip(&soft) {
            // the diagonal entries of S⁻¹ stand for all of it
            for (j, k) in site.of.iter().enumerate() {
                let line = &of.rows.coefficients[row.start + k * row.width()..][..row.width()];
                unknowns(row).zip(line).for_each(|(unknown, h)| diagonal[unknown] += h * h * soft.inverse[j][j]);
            }
        }
        let least = diagonal.into_iter().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
        let ridge = tuning::RIDGE * if least.is_finite() { least } else { 1.0 };
        let mut lu = Lu::default();
        lu.factorise(&of.graph.tree, |element, out| {
            let c = of.graph.contacts[element];
            let inverse = &soft[c].inverse;
            of.rows.add_element(&of.rows.list[c], &of.sites[c].of, |i, j| inverse[i][j] / ridge, out);
        })?;
        let none = Parts { r: vec![], lambda: 0.0, y: vec![], z: vec![] };
        let mut system = Self { of, metrics, soft, lu, ridge, border: vec![], pivot: 0.0, by_tau: none };
        system.border = system.inverted(&of.load);
        system.pivot = sum(&of.load, &system.border);
        let cones = vec![[0.0; 3]; of.sides.len()];
        system.by_tau = system.solve(&Parts { r: vec![0.0; of.size], lambda: -of.sense, y: of.b.clone(), z: cones });
        (system.pivot > 0.0).then_some(system)
    }

    /// (H S⁻¹ Hᵀ + ridge)⁻¹ x.
    fn inverted(&self, x: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = x.iter().map(|x| x / self.ridge).collect();
        self.lu.solve(&self.of.graph.tree, &mut y);
        y
    }

    /// S⁻¹ x.
    fn softened(&self, x: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(x.len());
        for (site, soft) in self.of.sites.iter().zip(&self.soft) {
            out.extend(soft.times(&x[site.at..], site.of.len()));
        }
        out
    }

    /// The solution of Hᵀy − LᵀW⁻¹z = r, f₁·y = λ, H r + f₁ λ = y, −W⁻¹L r − z = z. The scaled z has
    /// an error of rounding relative to itself, where W⁻²L r would lose all digits.
    fn solve(&self, right: &Parts) -> Parts {
        let of = self.of;
        let mut found = self.once(right);
        for _ in 0..tuning::REFINEMENTS {
            let (pulled, of_cones) = (of.pulled(&found.y), of.of_cones(&self.unscaled(&found.z)));
            let balance = of.pushed(&found.r).into_iter().zip(&of.load).zip(&right.y);
            let pairs = self.in_scaled_cones(&found.r).into_iter().zip(&found.z).zip(&right.z);
            let left = Parts {
                r: pulled.iter().zip(&of_cones).zip(&right.r).map(|((y, z), right)| right - y + z).collect(),
                lambda: right.lambda - sum(&of.load, &found.y),
                y: balance.map(|((h, f), right)| right - h - f * found.lambda).collect(),
                z: pairs.map(|((own, z), right)| moved(&moved(right, 1.0, &own), 1.0, z)).collect(),
            };
            let more = self.once(&left);
            found.r.iter_mut().zip(more.r).for_each(|(r, d)| *r += d);
            found.y.iter_mut().zip(more.y).for_each(|(y, d)| *y += d);
            found.z.iter_mut().zip(more.z).for_each(|(z, d)| *z = moved(z, 1.0, &d));
            found.lambda += more.lambda;
        }
        found
    }

    /// The same without refinement.
    fn once(&self, right: &Parts) -> Parts {
        let own = self.of.of_cones(&self.unscaled(&right.z));
        let p: Vec<f64> = right.r.iter().zip(own).map(|(r, z)| r - z).collect();
        let (r, lambda, y) = self.reduced(&p, right.lambda, &right.y);
        let pairs = self.in_scaled_cones(&r).into_iter().zip(&right.z);
        let z = pairs.map(|(own, z)| moved(&own, 1.0, z).map(|x| -x)).collect();
        Parts { r, lambda, y, z }
    }

    /// W⁻¹ z.
    fn unscaled(&self, z: &[Point]) -> Vec<Point> {
        self.metrics.iter().zip(z).map(|(w, z)| w.inverse(z)).collect()
    }

    /// W⁻¹ L r.
    fn in_scaled_cones(&self, r: &[f64]) -> Vec<Point> {
        self.unscaled(&self.of.in_cones(r))
    }

    /// The solution of S r + Hᵀy = p, f₁·y = `end`, H r + f₁ λ = q, but for the regularisation.
    fn reduced(&self, p: &[f64], end: f64, q: &[f64]) -> (Vec<f64>, f64, Vec<f64>) {
        let of = self.of;
        let pushed = of.pushed(&self.softened(p));
        let right: Vec<f64> = pushed.iter().zip(q).map(|(h, q)| h - q).collect();
        let mut y = self.inverted(&right);
        let lambda = (end - sum(&of.load, &y)) / self.pivot;
        y.iter_mut().zip(&self.border).for_each(|(y, border)| *y += lambda * border);
        let rest: Vec<f64> = p.iter().zip(of.pulled(&y)).map(|(p, h)| p - h).collect();
        (self.softened(&rest), lambda, y)
    }

    /// The step that reduces the residual by `share` and changes the scaled pairs by `towards`, τ κ
    /// by `last`, to first order.
    fn step(&self, at: &Iterate, residual: &Residual, share: f64, towards: &[Point], last: f64) -> Iterate {
        let of = self.of;
        let outside = self.unscaled(&residual.z);
        let right = Parts {
            r: residual.x.iter().map(|x| -share * x).collect(),
            lambda: -share * residual.lambda,
            y: residual.y.iter().map(|y| share * y).collect(),
            z: outside.iter().zip(towards).map(|(z, x)| moved(&x.map(|x| -x), -share, z)).collect(),
        };
        let own = self.solve(&right);
        let value = |x: &Parts| of.sense * x.lambda + sum(&of.b, &x.y);
        let tau = (-share * residual.tau - last / at.tau - value(&own)) / (value(&self.by_tau) - at.kappa / at.tau);
        let with = |own: &[f64], more: &[f64]| own.iter().zip(more).map(|(own, more)| own + tau * more).collect();
        let scaled: Vec<Point> = own.z.iter().zip(&self.by_tau.z).map(|(z, more)| moved(z, tau, more)).collect();
        let r: Vec<f64> = with(&own.r, &self.by_tau.r);
        let s = of.in_cones(&r).into_iter().zip(&residual.z).map(|(own, z)| moved(&own, -share, z)).collect();
        Iterate {
            r,
            lambda: own.lambda + tau * self.by_tau.lambda,
            y: with(&own.y, &self.by_tau.y),
            s,
            z: self.unscaled(&scaled),
            tau,
            kappa: (last - at.kappa * tau) / at.tau,
        }
    }
}

/// S⁻¹ of a contact, from S = RᵀR with R the triangular factor of W⁻¹L. Near the end of the path S
/// has stiff and soft directions twenty orders of magnitude apart, of which W⁻¹L keeps both.
#[derive(Clone, Copy)]
struct Soft {
    /// R⁻¹, upper triangular.
    root: Local,
    inverse: Local,
}

impl Soft {
    /// None if W⁻¹L is singular to rounding.
    fn of(of: &Programme, site: &Site, metrics: &[Metric]) -> Option<Self> {
        let n = site.of.len();
        let mut lines: Vec<[f64; PADDED]> = Vec::new();
        for (side, metric) in of.sides[site.cones.clone()].iter().zip(&metrics[site.cones.clone()]) {
            let mut block = [[0.0; PADDED]; 3];
            let parts = [(Some(0), side.slope), (side.others[0], 1.0), (side.others[1], 1.0)];
            for (component, (place, factor)) in parts.iter().enumerate() {
                let Some(place) = place else { continue };
                let mut unit = [0.0; 3];
                unit[component] = *factor;
                block.iter_mut().zip(metric.inverse(&unit)).for_each(|(line, value)| line[*place] += value);
            }
            lines.extend(block);
        }
        let r = triangular(lines, n);
        let mut root = [[0.0; PADDED]; PADDED];
        for column in 0..n {
            for i in (0..=column).rev() {
                let unit = if i == column { 1.0 } else { 0.0 };
                let left = unit - (i + 1..=column).map(|k| r[i][k] * root[k][column]).sum::<f64>();
                root[i][column] = left / r[i][i];
            }
        }
        let mut inverse = [[0.0; PADDED]; PADDED];
        for i in 0..n {
            for j in 0..n {
                inverse[i][j] = (i.max(j)..n).map(|k| root[i][k] * root[j][k]).sum();
            }
        }
        let sound = inverse.iter().flatten().all(|value| value.is_finite());
        sound.then_some(Self { root, inverse })
    }

    /// S⁻¹ x for the `n` rows of the contact.
    fn times(&self, x: &[f64], n: usize) -> impl Iterator<Item = f64> + use<> {
        let mut half = [0.0; PADDED];
        (0..n).for_each(|k| half[k] = (0..=k).map(|i| self.root[i][k] * x[i]).sum());
        let root = self.root;
        (0..n).map(move |i| (i..n).map(|k| root[i][k] * half[k]).sum())
    }
}

/// The triangular factor of a matrix of `n` columns, by Householder's reflections.
fn triangular(mut lines: Vec<[f64; PADDED]>, n: usize) -> Local {
    for column in 0..n {
        let norm = lines[column..].iter().map(|line| line[column] * line[column]).sum::<f64>().sqrt();
        let head = lines[column][column];
        let end = if head > 0.0 { -norm } else { norm };
        let mut mirror: Vec<f64> = lines[column..].iter().map(|line| line[column]).collect();
        mirror[0] -= end;
        let square = sum(&mirror, &mirror);
        for other in column..n {
            if square > 0.0 {
                let along = lines[column..].iter().zip(&mirror).map(|(line, m)| line[other] * m).sum::<f64>();
                let factor = 2.0 * along / square;
                lines[column..].iter_mut().zip(&mirror).for_each(|(line, m)| line[other] -= factor * m);
            }
        }
    }
    let mut r = [[0.0; PADDED]; PADDED];
    (0..n).for_each(|i| r[i][i..n].copy_from_slice(&lines[i][i..n]));
    r
}
