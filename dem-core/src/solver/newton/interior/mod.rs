//! The interior-point method, where no guess of the active set leads to a solution.
//!
//! With the metric 1/ρ + C of the corrector and its form q the inner problem is
//!
//! y − f = H̃ (r̂ − s n),   K ∋ r̂ ⊥ z = q(u) + (1/ρ + C) r ∈ K*,
//!
//! a monotone complementarity problem for associated laws. Mehrotra's predictor–corrector follows its central path from
//! anywhere in some twenty iterations, however large the plastic zone is, and the matrix of its steps, I + Σ H̃ D⁻¹ H̃ᵀ, has
//! the pattern of Newton's. What K is to the method stands in [`rays`] for the plane, in [`disks`] for space. The term
//! μ‖u_t‖ of dry friction follows from iteration to iteration. At the end the point tells which contacts are at which limit.
//!
//! With the largest penalty 1/ρ would drown in the rounding of z, and the path would end in the middle of the many
//! reactions that balance the load: there, bonds stand that the stiff limit breaks. So the metric is softer, and
//! proximal rounds take away what that costs in balance.
//!
//! Sources: Mehrotra, SIAM J. Optim. 2, 1992; Wright, Primal–dual interior-point methods, 1997; for contact with friction
//! Acary, Armand, Nguyen & Shpakovych, Optim. Methods Softw. 39, 2024.

mod disks;
mod rays;

use super::factor::Factor;
use super::guess::Guess;
use super::rows::{Operator, Row, Rows};
use super::solvable::Solvable;
use super::{Found, Newton, SolveReport, net_change};
use crate::contact::Padded;
pub(super) use disks::Disks;
pub(super) use rays::Rays;

/// Proximal rounds of the softer metric.
const ROUNDS: u64 = 2;
/// Most iterations on one path; those in which the gap must halve with the softer metric, the residual without.
const MOST: u64 = 100;
const SOFT_PATIENCE: u64 = 5;
const PATIENCE: u64 = 15;
/// How near the boundary a step may go.
const NEAR: f64 = 0.995;

/// The cone of a contact, as the path knows it.
pub(super) trait Site: Sized {
    /// A point inside K × K*, or a step of it.
    type Pair: Clone;
    /// What z is off by.
    type Slack;
    /// D and what else a step needs at a point.
    type Scaling;
    /// What the local equations alone ask of a step.
    type Drive;
    /// Where the path ends: the gap over what the reactions and the velocities that they give multiply to.
    const END: f64;
    /// How much softer the metric is than that of the largest penalty, where reactions are not unique.
    const SOFT: f64;

    fn new(row: &Row) -> Self;
    /// A point well inside: a reaction of at most `share` (N s), z larger than q and than `share` times `yields`, all
    /// products alike.
    fn inside(&self, q: &Padded, share: f64, yields: f64) -> Self::Pair;
    /// The reaction without the shift.
    fn reaction(&self, row: &Row, at: &Self::Pair) -> Padded;
    /// What the point's z is more than `z`.
    fn defect(&self, at: &Self::Pair, z: &Padded) -> Self::Slack;
    /// Add the products whose mean is the gap; returns their number.
    fn add_products(&self, at: &Self::Pair, sum: &mut f64) -> usize;
    /// The same where z is what `yields` to the reaction.
    fn add_scale(&self, at: &Self::Pair, yields: f64, sum: &mut f64);
    fn scaling(&self, at: &Self::Pair) -> Self::Scaling;
    /// D⁻¹.
    fn operator(&self, scaling: &Self::Scaling) -> Operator;
    fn drive(&self, scaling: &Self::Scaling, at: &Self::Pair, off: &Self::Slack, aim: Aim<Self::Pair>) -> Self::Drive;
    /// The change of the reaction that the drive stands for.
    fn force(&self, drive: &Self::Drive) -> Padded;
    /// The step where the bodies' velocities change the contact's by `pulled`.
    fn step(
        &self,
        scaling: &Self::Scaling,
        at: &Self::Pair,
        drive: &Self::Drive,
        pulled: &Padded,
        aim: Aim<Self::Pair>,
    ) -> Self::Pair;
    fn moved(at: &Self::Pair, step: &Self::Pair, length: f64) -> Self::Pair;
    /// The longest part of a step that stays inside, if that is less than `longest`.
    fn longest(&self, at: &Self::Pair, step: &Self::Pair, longest: f64) -> f64;
    /// The reaction without the shift at the limits that it is nearer to than z is to its own, where a reaction counts as
    /// `measure` times a velocity, and how far the rows t and m are beyond their limits, over those.
    fn snapped(&self, row: &Row, at: &Self::Pair, measure: f64) -> (Padded, [f64; 2]);
    /// The measure that tells active sets best (1/kg).
    fn measure(row: &Row) -> f64;
}

/// What the products of the next point should be.
pub(super) enum Aim<'a, P> {
    /// Zero.
    Boundary,
    /// This, but for what the step to the boundary leaves of second order.
    Middle(f64, &'a P),
}

impl<P> Clone for Aim<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Aim<'_, P> {}

/// A point on the way.
struct Point<S: Site> {
    y: Vec<f64>,
    pairs: Vec<S::Pair>,
}

/// How far a point is from the equations: F of the momenta, and of each contact's z.
struct Defect<S: Site> {
    momenta: Vec<f64>,
    slacks: Vec<S::Slack>,
}

/// How much velocity a unit of reaction gives a contact, in the mean of its rows (1/kg).
fn yields(row: &Row) -> f64 {
    row.size / row.rows.len() as f64
}

/// The term μ‖u_t‖ + ν‖u_m‖ of dry friction at the velocities of `y`.
fn follow_slip(rows: &mut Rows, y: &[f64]) {
    for k in 0..rows.list.len() {
        let row = &rows.list[k];
        if !row.associated {
            let u = rows.velocity(row, y);
            rows.list[k].lag = Some(row.cone.mu * u.t.norm() + row.cone.nu * u.m.norm());
        }
    }
}

impl<S: Site> Point<S> {
    /// Well inside, at the velocities that `reactions` give.
    fn start(rows: &mut Rows, sites: &[S], reactions: &[Padded]) -> Self {
        let mean = (reactions.iter().map(|r| r.dot(r)).sum::<f64>() / reactions.len() as f64).sqrt();
        let mut y = rows.free.clone();
        rows.list.iter().zip(reactions).for_each(|(row, r)| rows.apply(row, r, &mut y));
        follow_slip(rows, &y);
        Self::inside(rows, sites, y, mean)
    }

    /// Well inside, at the velocities of `y`: reactions of the size of `reaction` and the shift, z to match.
    fn inside(rows: &Rows, sites: &[S], y: Vec<f64>, reaction: f64) -> Self {
        let pair = |(row, site): (&Row, &S)| {
            site.inside(&row.form(&rows.velocity(row, &y)), row.shift + reaction, yields(row))
        };
        let pairs = rows.list.iter().zip(sites).map(pair).collect();
        Self { y, pairs }
    }

    fn defect(&self, rows: &Rows, sites: &[S]) -> Defect<S> {
        let mut momenta: Vec<f64> = self.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
        let mut slacks = Vec::with_capacity(sites.len());
        for ((row, site), pair) in rows.list.iter().zip(sites).zip(&self.pairs) {
            let r = site.reaction(row, pair);
            rows.apply(row, &(r * -1.0), &mut momenta);
            let z = row.form(&rows.velocity(row, &self.y)) + row.metric().times(&r);
            slacks.push(site.defect(pair, &z));
        }
        Defect { momenta, slacks }
    }

    /// Mean of all products.
    fn gap(&self, sites: &[S]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (pair, site) in self.pairs.iter().zip(sites) {
            count += site.add_products(pair, &mut sum);
        }
        sum / count as f64
    }

    /// Mean of all products where z is the velocity that the reactions give.
    fn scale(&self, rows: &Rows, sites: &[S]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for ((pair, site), row) in self.pairs.iter().zip(sites).zip(&rows.list) {
            site.add_scale(pair, yields(row), &mut sum);
            count += site.add_products(pair, &mut 0.0);
        }
        sum / count as f64
    }

    fn moved(&self, step: &Self, length: f64) -> Self {
        Self {
            y: self.y.iter().zip(&step.y).map(|(y, d)| y + length * d).collect(),
            pairs: self.pairs.iter().zip(&step.pairs).map(|(at, step)| S::moved(at, step, length)).collect(),
        }
    }

    /// The longest part of a step that stays inside all cones.
    fn longest(&self, step: &Self, sites: &[S]) -> f64 {
        let all = self.pairs.iter().zip(&step.pairs).zip(sites);
        let longest = all.fold(1.0 / NEAR, |longest, ((at, step), site)| site.longest(at, step, longest));
        (NEAR * longest).min(1.0)
    }

    /// The reactions, each at the limits that it is nearer to than its z is to its own.
    fn snapped(&self, rows: &Rows, sites: &[S], measure: fn(&Row) -> f64) -> Guess {
        let all = rows.list.iter().zip(sites).zip(&self.pairs);
        let (reactions, beyond) = all.map(|((row, site), pair)| site.snapped(row, pair, measure(row))).unzip();
        Guess { reactions, beyond }
    }
}

/// The step for an aim of each contact.
fn step<'a, S: Site>(
    rows: &Rows,
    sites: &[S],
    scalings: &[S::Scaling],
    factor: &Factor,
    at: &Point<S>,
    defect: &Defect<S>,
    aim: impl Fn(usize) -> Aim<'a, S::Pair>,
) -> Point<S>
where
    S::Pair: 'a,
{
    let mut y: Vec<f64> = defect.momenta.iter().map(|f| -f).collect();
    let mut drives = Vec::with_capacity(sites.len());
    for (c, site) in sites.iter().enumerate() {
        let drive = site.drive(&scalings[c], &at.pairs[c], &defect.slacks[c], aim(c));
        rows.apply(&rows.list[c], &site.force(&drive), &mut y);
        drives.push(drive);
    }
    factor.solve(&mut y);
    let pairs = sites.iter().enumerate().map(|(c, site)| {
        let pulled = rows.pulled(&rows.list[c], &y);
        site.step(&scalings[c], &at.pairs[c], &drives[c], &pulled, aim(c))
    });
    let pairs = pairs.collect();
    Point { y, pairs }
}

/// Whether a quantity that should shrink no longer does.
struct Stall {
    mark: f64,
    since: u64,
    patience: u64,
}

impl Stall {
    fn after(patience: u64) -> Self {
        Self { mark: f64::INFINITY, since: 0, patience }
    }

    /// Enter the next value: whether it has not halved for too long, or is no number.
    fn at(&mut self, value: f64) -> bool {
        self.since += 1;
        if value < 0.5 * self.mark {
            (self.mark, self.since) = (value, 0);
        }
        self.since >= self.patience || !value.is_finite()
    }
}

impl Newton {
    /// The stiff limit, if the active set at the end of the softer path leads to it.
    pub(super) fn softly<S: Site>(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        swept: &[Padded],
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        if base.mostly_dry() || !self.soft_rest.is_over() {
            return None;
        }
        let report = self.soft_path::<S>(problem, base, swept, iterations);
        match report {
            Some(_) => self.soft_rest.forget(),
            None => self.soft_rest.lengthen(),
        }
        report
    }

    /// The solution at the end of the path, as it is.
    pub(super) fn through_the_middle<S: Site>(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        swept: Vec<Padded>,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let sites: Vec<S> = base.list.iter().map(S::new).collect();
        let mut rows = base.clone();
        let mut at = Point::start(&mut rows, &sites, &swept);
        let (mut best, mut stall): (Option<Found>, _) = (None, Stall::after(PATIENCE));
        let mut last = swept;
        let tolerance = self.settings.tolerance;
        self.follow_path(&mut rows, &sites, &mut at, iterations, |rows, at| {
            let reactions = at.snapped(rows, &sites, yields).reactions;
            problem.write_back(&reactions);
            problem.velocities_from_reactions();
            let residual = problem.residual();
            if best.as_ref().is_none_or(|b| residual < b.residual) {
                let load_error = net_change(rows, &last, &reactions);
                best = Some(Found { reactions: reactions.clone(), residual, load_error });
            }
            last = reactions;
            residual <= tolerance || stall.at(residual)
        });
        self.taken(problem, best?, *iterations)
    }

    /// Proximal rounds of a softer metric, each ended by rounds of the largest penalty on the active set that it found.
    fn soft_path<S: Site>(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        swept: &[Padded],
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let mut rows = base.clone();
        rows.soften(S::SOFT);
        let sites: Vec<S> = rows.list.iter().map(S::new).collect();
        let mut last = swept.to_vec();
        for _ in 0..ROUNDS {
            let mut at = Point::start(&mut rows, &sites, swept);
            let mut stall = Stall::after(SOFT_PATIENCE);
            self.follow_path(&mut rows, &sites, &mut at, iterations, |rows, at| {
                let gap = at.gap(&sites);
                gap <= S::END * at.scale(rows, &sites) || stall.at(gap)
            });
            // in the softer metric: of what only yields the slip is softer by as much, and its share beyond the limit stays
            let mut guess = at.snapped(&rows, &sites, S::measure);
            let reactions = guess.reactions.clone();
            problem.write_back(&reactions);
            problem.velocities_from_reactions();
            let (residual, load_error) = (problem.residual(), net_change(&rows, &last, &reactions));
            if let Some(report) = self.rounds(problem, &mut base.clone(), &mut guess, iterations) {
                return Some(report);
            }
            if residual <= self.settings.tolerance {
                return self.taken(problem, Found { reactions, residual, load_error }, *iterations);
            }
            rows.list.iter_mut().zip(&reactions).for_each(|(row, r)| row.multiplier = *r);
            last = reactions;
        }
        None
    }

    /// Follow the central path until `arrived`, or as far as the factor goes.
    fn follow_path<S: Site>(
        &mut self,
        rows: &mut Rows,
        sites: &[S],
        at: &mut Point<S>,
        iterations: &mut u64,
        mut arrived: impl FnMut(&Rows, &Point<S>) -> bool,
    ) {
        self.renew = true;
        for _ in 0..MOST {
            *iterations += 1;
            let gap = at.gap(sites);
            follow_slip(rows, &at.y);
            let defect = at.defect(rows, sites);
            let scalings: Vec<_> = sites.iter().zip(&at.pairs).map(|(site, pair)| site.scaling(pair)).collect();
            let operators: Vec<_> =
                sites.iter().zip(&scalings).map(|(site, scaling)| Some(site.operator(scaling))).collect();
            if !self.factor.renew(rows, &operators) {
                break;
            }
            let affine = step(rows, sites, &scalings, &self.factor, at, &defect, |_| Aim::Boundary);
            let reach = at.longest(&affine, sites);
            let centring = (at.moved(&affine, reach).gap(sites) / gap).powi(3).min(1.0);
            let middle = |c: usize| Aim::Middle(centring * gap, &affine.pairs[c]);
            let direction = step(rows, sites, &scalings, &self.factor, at, &defect, middle);
            let length = at.longest(&direction, sites);
            let next = at.moved(&direction, length);
            if !next.gap(sites).is_finite() {
                break;
            }
            *at = next;
            if arrived(rows, at) {
                break;
            }
        }
    }
}
