//! The interior-point method, with Coulomb's law exact.
//!
//! Every contact is a list of cone pairs ([`sites`]): x = G r̂ ∈ Q ⊥ z ∈ Q with u + C (r − r₀) = Σ Bᵀ z and u = W r + q. Between the pairs the
//! method follows the path x ∘ z = barrier, linearised as it stands, slip speeds and all: the direction of Alizadeh, Haeberly
//! & Overton with Mehrotra's predictor–corrector and Gondzio's correctors, one factorisation an iteration.
//!
//! The metric 1/ρ is a compliance anchored at given reactions: among the many that balance a rigid network the path ends at those of least
//! Σ r²/ρ. See docs/theory/interior-point.md.
//!
//! Sources: Alizadeh, Haeberly & Overton, SIAM J. Optim. 8, 1998; Mehrotra, SIAM J. Optim. 2, 1992; Gondzio, Comput. Optim. Appl. 6,
//! 1996; for contact with friction Acary, Armand, Nguyen & Shpakovych, Optim. Methods Softw. 39, 2024.

mod cones;
mod coupling;
mod local;
mod sites;

use super::stall::Stall;
use crate::contact::Padded;
use crate::linear::Lu;
use crate::solver::graph::Graph;
use crate::solver::rows::Rows;
use crate::solver::solvable::Solvable;
use cones::{Point, correction, dot, moved, product, reach};
use coupling::Coupling;
use local::{State, follow, gap, invert, opened, solve, yield_to};
use sites::Sites;
use std::sync::Arc;

/// Stiffness of the metric over the inverse of the mean normal entry of W.
const KAPPA: f64 = 1e7;
/// The same where any reactions will do: its compliance is far below every tolerance.
const ANY: f64 = 1e12;
/// What the gaps of all pairs may be beside the energy of the metric for reactions to count as those of least energy.
const LEAST: f64 = 1e-3;
/// From how much more than that the path goes on with another anchor: nearer to the boundary steps would be short.
const BACK: f64 = 30.0;
/// Share of its compliance that a metric keeps for each round after the second.
const HARDER: f64 = 0.01;
/// Least centring, as a share of the gap.
const CENTRING: f64 = 0.1;
/// Most of Gondzio's correctors in an iteration, by how much a step is tried longer, the share by which it must grow, and how far products
/// may be from the barrier, as a factor.
const CORRECTORS: usize = 2;
const LONGER: f64 = 0.3;
const GROWN: f64 = 1.05;
const APART: f64 = 10.0;
/// A step shorter than this turns towards the middle, by these shares of the gap, where it grows by this factor.
const SHORT: f64 = 0.5;
const TO_THE_MIDDLE: [f64; 2] = [0.2, 0.7];
const WORTH: f64 = 1.5;
/// How near the boundary a step may go.
const NEAR: f64 = 0.99;
/// Iterations in which the residual or the gap must halve.
const PATIENCE: u64 = 8;
/// How far inside its cone a start is moved, over the mean reaction.
const INSIDE: f64 = 0.1;

/// What is asked of a solution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aims {
    /// Residual and load error (–).
    pub tolerance: f64,
    pub load_tolerance: f64,
    /// Whether of all reactions those of least energy in the metric are wanted.
    pub least: bool,
    /// Most iterations.
    pub most: u64,
}

/// What the path came to.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Reactions without the shift, in the unit of the rows.
    pub reactions: Vec<Padded>,
    /// Their residual (–), and their load error (–): how much the net impulses changed in the last iteration.
    pub residual: f64,
    pub load_error: f64,
    /// Iterations made.
    pub iterations: u64,
}

/// The method, and the room that it keeps from one solve to the next.
#[derive(Default)]
pub(super) struct Interior {
    lu: Lu,
    inverses: Vec<f64>,
    /// Factorisations so far.
    pub made: u64,
}

impl Interior {
    /// Follow the path from these reactions, moved inside their cones, or from a cold start, to a solution. With the compliance of a metric
    /// anchored at `anchor` the path ends at the reactions of least energy; anchored there it is followed again, to a solution next to them.
    /// `graph` is that of the last problem.
    pub fn solve(
        &mut self,
        problem: &mut impl Solvable,
        rows: &Rows,
        graph: &mut Option<Arc<Graph>>,
        anchor: &[Padded],
        start: Option<&[Padded]>,
        aims: Aims,
    ) -> Option<Found> {
        let sites = Sites::of(rows, start.unwrap_or(anchor));
        let ratio = sites.speed / sites.force;
        let matrix = problem.matrix().cloned();
        let graph = if matrix.is_none() { Graph::of(rows, graph) } else { None };
        let coupling = match (&matrix, &graph) {
            (Some(matrix), _) => Coupling::matrix(matrix, &sites, ratio)?,
            (None, Some(graph)) => Coupling::bodies(rows, ratio, graph),
            (None, None) => return None,
        };
        let kappa = if aims.least { KAPPA } else { ANY };
        let mut metric = Metric::new(&sites, sites.gathered(anchor), kappa);
        let mut at = match start {
            Some(reactions) => warm(&sites, &coupling, &sites.gathered(reactions)),
            None => cold(&sites),
        };
        let (mut best, mut turn): (Option<Found>, Option<State>) = (None, None);
        let (mut selects, mut limits, mut enough, mut rounds) = (aims.least, Vec::new(), f64::INFINITY, 0);
        let mut change = 1.0;
        let mut stall = Stall::after(PATIENCE, 0.5);
        for iterations in 0..=aims.most {
            let gaps = gap(&at) * at.x.len() as f64;
            let least = LEAST * metric.energy(&at.r);
            if selects && gaps <= least {
                (selects, limits, enough) = (false, sites.limits(&at, &metric.own), least);
            }
            let reactions = sites.snapped(&at, &limits);
            problem.write_back(&reactions);
            let residual = problem.residual();
            let solved = residual <= aims.tolerance && change <= aims.load_tolerance || residual == 0.0;
            let arrived = solved && !selects && gaps <= enough;
            if arrived || best.as_ref().is_none_or(|best| residual < best.residual) {
                best = Some(Found { reactions, residual, load_error: change, iterations });
            }
            let inside = gap(&at) > 0.0;
            if arrived || iterations == aims.most || !inside || stall.at(residual.min(gap(&at))) {
                break;
            }
            if gaps <= BACK * least && turn.is_none() {
                turn = Some(at.clone());
            }
            if gaps <= least
                && let Some(turn) = &turn
            {
                // the same metric once more, then harder ones
                let share = if rounds == 0 { 1.0 } else { HARDER };
                metric.anchor_at(std::mem::replace(&mut at, turn.clone()).r, share);
                (rounds, enough) = (rounds + 1, share * enough);
                stall = Stall::after(PATIENCE, 0.5);
            }
            let weight = coupling.velocity(&sites, &at.r);
            let right = lack(&sites, &weight, &at, &metric).into_iter().map(|x| -x).collect();
            if !invert(&sites, &at, &metric.compliance, &mut self.inverses) {
                break;
            }
            self.made += 1;
            if !coupling.factorise(&sites, &self.inverses, &mut self.lu) {
                break;
            }
            let (inverses, compliance) = (&self.inverses, &metric.compliance);
            let (sites, coupling, at_hand, lu) = (&sites, &coupling, &at, &self.lu);
            let system = System { sites, coupling, at: at_hand, right, compliance, inverses, lu };
            let (step, far) = direction(&system);
            let length = (NEAR * far).min(1.0);
            let moving = coupling.velocity(sites, &step.r);
            let square = |r: &[f64], u: &[f64]| r.iter().zip(u).map(|(r, u)| r * u).sum::<f64>().abs();
            change = length * (square(&step.r, &moving) / square(&at.r, &weight).max(f64::MIN_POSITIVE)).sqrt();
            advance(&mut at, length, &step);
        }
        best
    }
}

/// A compliance that draws reactions to given ones.
struct Metric {
    anchor: Vec<f64>,
    /// Of each row, and with that of elastic bonds.
    own: Vec<f64>,
    compliance: Vec<f64>,
}

impl Metric {
    fn new(sites: &Sites, anchor: Vec<f64>, kappa: f64) -> Self {
        let own: Vec<f64> = sites.metric.iter().map(|w| w / kappa).collect();
        let compliance = own.iter().zip(&sites.compliance).map(|(own, c)| own + c).collect();
        Self { anchor, own, compliance }
    }

    /// Draw to these reactions, by this share of the compliance.
    fn anchor_at(&mut self, anchor: Vec<f64>, share: f64) {
        self.anchor = anchor;
        for (c, own) in self.compliance.iter_mut().zip(&mut self.own) {
            *c += (share - 1.0) * *own;
            *own *= share;
        }
    }

    /// Σ (r − r₀)²/ρ.
    fn energy(&self, r: &[f64]) -> f64 {
        r.iter().zip(&self.anchor).zip(&self.own).map(|((r, r0), c)| c * (r - r0) * (r - r0)).sum()
    }
}

/// One linear system and the point that it belongs to.
struct System<'a> {
    sites: &'a Sites,
    coupling: &'a Coupling<'a>,
    at: &'a State,
    /// By how much the contacts' velocities must change to be what z makes them.
    right: Vec<f64>,
    compliance: &'a [f64],
    inverses: &'a [f64],
    lu: &'a Lu,
}

impl System<'_> {
    /// The step after which x ∘ z has changed by `by`, to first order.
    fn step(&self, by: &[Point]) -> State {
        self.solved(&self.right, by)
    }

    /// The same without what rounding has left.
    fn refined(&self, mut step: State, by: &[Point]) -> State {
        let (left, missing) = self.left(by, &step);
        let more = self.solved(&left, &missing);
        step.r.iter_mut().zip(&more.r).for_each(|(r, d)| *r += d);
        step.z.iter_mut().zip(&more.z).for_each(|(z, d)| *z = moved(z, 1.0, d));
        follow(self.sites, &mut step);
        step
    }

    fn solved(&self, right: &[f64], by: &[Point]) -> State {
        let mut step = solve(self.sites, self.at, self.inverses, right, by);
        let yielded = self.coupling.yielded(self.sites, &step.r, self.lu);
        yield_to(self.sites, self.inverses, &yielded, &mut step);
        follow(self.sites, &mut step);
        step
    }

    /// What a step leaves of the equations.
    fn left(&self, by: &[Point], step: &State) -> (Vec<f64>, Vec<Point>) {
        let moving = self.coupling.velocity(self.sites, &step.r);
        let opened = opened(self.sites, &step.z);
        let left = (0..self.sites.rows).map(|k| self.right[k] - moving[k] - self.compliance[k] * step.r[k] + opened[k]);
        let missing = |c: usize| {
            let (a, b) = (product(&self.at.z[c], &step.x[c]), product(&self.at.x[c], &step.z[c]));
            [by[c][0] - a[0] - b[0], by[c][1] - a[1] - b[1], by[c][2] - a[2] - b[2]]
        };
        (left.collect(), (0..by.len()).map(missing).collect())
    }

    /// How far one can go along a step.
    fn longest(&self, step: &State) -> f64 {
        let ends = self.at.x.iter().zip(&step.x).chain(self.at.z.iter().zip(&step.z)).map(|(x, d)| reach(x, d));
        ends.fold(f64::INFINITY, f64::min)
    }
}

/// The direction of an iteration, and how far one can go along it.
fn direction(system: &System) -> (State, f64) {
    let at = system.at;
    let products: Vec<Point> = at.x.iter().zip(&at.z).map(|(x, z)| product(x, z)).collect();
    let gap = gap(at);
    // predictor
    let to_the_end: Vec<Point> = products.iter().map(|p| [-p[0], -p[1], -p[2]]).collect();
    let predictor = system.step(&to_the_end);
    let length = system.longest(&predictor).min(1.0);
    let count = at.x.len() as f64;
    let aim = at.x.iter().zip(&at.z).zip(predictor.x.iter().zip(&predictor.z));
    let aim = aim.map(|((x, z), (dx, dz))| dot(&moved(x, length, dx), &moved(z, length, dz))).sum::<f64>() / count;
    let centring = (aim / gap).max(0.0).powi(3).clamp(CENTRING, 1.0);
    // corrector, of second order
    let barrier = centring * gap;
    let second = predictor.x.iter().zip(&predictor.z).map(|(dx, dz)| product(dx, dz));
    let mut by: Vec<Point> =
        products.iter().zip(second).map(|(p, s)| [barrier - p[0] - s[0], -p[1] - s[1], -p[2] - s[2]]).collect();
    let mut step = system.step(&by);
    let mut far = system.longest(&step);
    for _ in 0..CORRECTORS {
        let length = (far + LONGER).min(1.0);
        let trial = |c: usize| {
            let v = product(&moved(&at.x[c], length, &step.x[c]), &moved(&at.z[c], length, &step.z[c]));
            moved(&by[c], 1.0, &correction(&v, barrier / APART, barrier * APART))
        };
        let more: Vec<Point> = (0..by.len()).map(trial).collect();
        let other = system.step(&more);
        let reached = system.longest(&other);
        if reached <= GROWN * far {
            break;
        }
        (step, far, by) = (other, reached, more);
    }
    let mut chosen = by;
    if far < SHORT {
        // at the boundary: towards the middle instead, without the second order
        for share in TO_THE_MIDDLE {
            let barrier = share.max(centring) * gap;
            let by: Vec<Point> = products.iter().map(|p| [barrier - p[0], -p[1], -p[2]]).collect();
            let other = system.step(&by);
            let reached = system.longest(&other);
            if reached > WORTH * far {
                (step, far) = (other, reached);
                chosen = by;
            }
        }
    }
    let step = system.refined(step, &chosen);
    let far = system.longest(&step);
    (step, far)
}

/// u + C (r − r₀) − Σ Bᵀ z, with the metric among the compliances.
fn lack(sites: &Sites, weight: &[f64], at: &State, metric: &Metric) -> Vec<f64> {
    let opened = opened(sites, &at.z);
    let row = |k: usize| {
        let soft = sites.compliance[k] * (at.r[k] - sites.carried[k]) + metric.own[k] * (at.r[k] - metric.anchor[k]);
        sites.free[k] + weight[k] + soft - opened[k]
    };
    (0..sites.rows).map(row).collect()
}

fn advance(at: &mut State, length: f64, step: &State) {
    at.r.iter_mut().zip(&step.r).for_each(|(r, d)| *r += length * d);
    at.x.iter_mut().zip(&step.x).for_each(|(x, d)| *x = moved(x, length, d));
    at.z.iter_mut().zip(&step.z).for_each(|(z, d)| *z = moved(z, length, d));
}

/// x = G r̂ of all cones.
fn primal(sites: &Sites, r: &[f64]) -> Vec<Point> {
    let mut x = vec![[0.0; 3]; sites.cones.len()];
    for (site, shift) in sites.list.iter().zip(&sites.shift) {
        for c in site.cones.clone() {
            x[c] = sites.cones[c].primal(site.part(r));
            x[c][0] += sites.cones[c].slope * shift;
        }
    }
    x
}

/// Reactions well inside their cones, velocities as large as the free ones.
fn cold(sites: &Sites) -> State {
    let largest = sites.shift.iter().copied().fold(1.0, f64::max);
    let mut r = vec![0.0; sites.rows];
    for (site, shift) in sites.list.iter().zip(&sites.shift) {
        site.part_mut(&mut r)[0] = (INSIDE * largest - shift).max(0.0);
    }
    let speed = sites.free.iter().map(|u| u.abs()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    State { x: primal(sites, &r), r, z: vec![[speed, 0.0, 0.0]; sites.cones.len()] }
}

/// Reactions moved inside their cones, and the slips that they give likewise.
fn warm(sites: &Sites, coupling: &Coupling, reactions: &[f64]) -> State {
    let count = sites.list.len() as f64;
    let mean = (reactions.iter().map(|r| r * r).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE);
    let mut r = reactions.to_vec();
    for (site, shift) in sites.list.iter().zip(&sites.shift) {
        let own = site.part_mut(&mut r);
        let needs = |c: usize| {
            let cone = &sites.cones[c];
            let x = cone.primal(own);
            x[1].hypot(x[2]) / cone.slope
        };
        let least = site.cones.clone().map(needs).fold(0.0, f64::max);
        own[0] = own[0].max(least - shift) + INSIDE * mean;
    }
    let moving = coupling.velocity(sites, &r);
    let mut z = vec![[0.0; 3]; sites.cones.len()];
    for site in &sites.list {
        let velocity: Vec<f64> = (site.at..site.at + site.rows).map(|k| sites.free[k] + moving[k]).collect();
        for c in site.cones.clone() {
            let cone = &sites.cones[c];
            z[c] = cone.primal(&velocity);
            z[c][0] = INSIDE * mean + if cone.tangents == 0 { z[c][0].max(0.0) } else { z[c][1].hypot(z[c][2]) };
        }
    }
    State { x: primal(sites, &r), r, z }
}
