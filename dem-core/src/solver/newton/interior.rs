//! The interior-point method for contacts in the plane, where no guess of the active set leads to a solution.
//!
//! In the plane K is spanned by rays e = (1, ±μ, ±ν), four for a bond, two for a dry contact: r = Σ λ e − s n. With the
//! metric 1/ρ + C of the corrector and its form q the inner problem is
//!
//! y − f = H̃ r,   w = Eᵀ (q(u) + (1/ρ + C) r),   λ ≥ 0,   w ≥ 0,   λ w = 0,
//!
//! a monotone complementarity problem for associated laws. Mehrotra's predictor–corrector follows its central path from
//! anywhere in some twenty iterations, however large the plastic zone is, and the matrix of its steps,
//! I + Σ H̃ E D⁻¹ Eᵀ H̃ᵀ with D = w/λ + Eᵀ(1/ρ + C)E, has the pattern of Newton's. The term μ‖u_t‖ of dry friction
//! follows from iteration to iteration. At the end λ and w tell which rays are active.
//!
//! With the largest penalty 1/ρ would drown in the rounding of w, and the path would end in the middle of the many
//! reactions that balance the load: there, bonds stand that the stiff limit breaks. So the metric is softer, and
//! proximal rounds take away what that costs in balance.
//!
//! Sources: Mehrotra, SIAM J. Optim. 2, 1992; Wright, Primal–dual interior-point methods, 1997; for contact with friction
//! Acary, Armand, Nguyen & Shpakovych, Optim. Methods Softw. 39, 2024.

use super::factor::Factor;
use super::guess::Guess;
use super::rows::{Operator, Row, Rows};
use super::solvable::Solvable;
use super::{Found, Newton, STALL_SWEEPS, SolveReport, net_change};
use crate::contact::Padded;
use nalgebra::{SMatrix, SVector};

/// How much softer the metric is than that of the largest penalty: soft enough to tell between the reactions that rounding
/// leaves alike.
const SOFT: f64 = 1e3;
/// Proximal rounds of it.
const ROUNDS: u64 = 2;
/// Where the path ends: mean of λ w over what the reactions and the velocities that they give multiply to.
const END: f64 = 1e-18;
/// Most iterations on one path; those in which λ w must halve with the softer metric, the residual without.
const MOST: u64 = 100;
const SOFT_PATIENCE: u64 = 5;
const PATIENCE: u64 = 15;
/// How near the boundary a step may go.
const NEAR: f64 = 0.995;

type Rays = SVector<f64, 4>;

/// A contact: the rays of its cone, and how many it has.
struct Site {
    rays: SMatrix<f64, 5, 4>,
    count: usize,
    /// 1/ρ + C in order.
    metric: SVector<f64, 5>,
}

/// Multipliers of the rays (N s) and their slacks (m/s), one for each; ones beyond the last ray.
#[derive(Clone, Copy)]
struct Pair {
    lambda: Rays,
    slack: Rays,
}

impl Site {
    fn new(row: &Row) -> Self {
        let signs = |c: f64, there: bool| if there && c > 0.0 { &[1.0, -1.0][..] } else { &[0.0][..] };
        let mut rays = SMatrix::<f64, 5, 4>::zeros();
        let mut count = 0;
        for t in signs(row.cone.mu, row.rows.contains(&1)) {
            for m in signs(row.cone.nu, row.rows.contains(&3)) {
                rays.set_column(count, &SVector::from([1.0, t * row.cone.mu, 0.0, m * row.cone.nu, 0.0]));
                count += 1;
            }
        }
        let w = row.metric();
        Self { rays, count, metric: [w.n, w.t, w.t, w.m, w.m].into() }
    }

    /// The reaction without the shift.
    fn reaction(&self, row: &Row, lambda: &Rays) -> Padded {
        let mut used = *lambda;
        used.iter_mut().skip(self.count).for_each(|l| *l = 0.0);
        let mut r = Padded::from_order(&(self.rays * used));
        r.n -= row.shift;
        r
    }

    /// Eᵀ x on the rays that there are.
    fn along(&self, x: &Padded) -> Rays {
        self.rays.transpose() * x.in_order()
    }

    /// D⁻¹ at a point.
    fn inverse(&self, at: &Pair) -> SMatrix<f64, 4, 4> {
        let mut d = self.rays.transpose() * SMatrix::from_diagonal(&self.metric) * self.rays;
        for k in 0..4 {
            d[(k, k)] += if k < self.count { at.slack[k] / at.lambda[k] } else { 1.0 };
        }
        d.try_inverse().unwrap_or_else(SMatrix::zeros)
    }
}

/// A point on the way.
#[derive(Clone)]
struct Point {
    y: Vec<f64>,
    pairs: Vec<Pair>,
}

/// How far a point is from the equations: F of the momenta, and of each contact's slacks.
struct Defect {
    momenta: Vec<f64>,
    slacks: Vec<Rays>,
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

impl Point {
    /// Well inside, at the velocities that `reactions` give.
    fn start(rows: &mut Rows, sites: &[Site], reactions: &[Padded]) -> Self {
        let mean = (reactions.iter().map(|r| r.dot(r)).sum::<f64>() / reactions.len() as f64).sqrt();
        let mut y = rows.free.clone();
        rows.list.iter().zip(reactions).for_each(|(row, r)| rows.apply(row, r, &mut y));
        follow_slip(rows, &y);
        Self::inside(rows, sites, y, mean)
    }

    /// Well inside, at the velocities of `y`: multipliers of the size of `reaction` and the shift, slacks to match.
    fn inside(rows: &Rows, sites: &[Site], y: Vec<f64>, reaction: f64) -> Self {
        let pair = |(row, site): (&Row, &Site)| {
            let share = (row.shift + reaction) / site.count as f64;
            let yields = row.size / row.rows.len() as f64;
            let least = Rays::repeat(share * yields);
            let slack = site.along(&row.form(&rows.velocity(row, &y))).abs() + least;
            // all products alike: in the middle of the path
            Pair { lambda: least.component_div(&slack) * share, slack }
        };
        let pairs = rows.list.iter().zip(sites).map(pair).collect();
        Self { y, pairs }
    }

    fn defect(&self, rows: &Rows, sites: &[Site]) -> Defect {
        let mut momenta: Vec<f64> = self.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
        let mut slacks = Vec::with_capacity(sites.len());
        for ((row, site), pair) in rows.list.iter().zip(sites).zip(&self.pairs) {
            let r = site.reaction(row, &pair.lambda);
            rows.apply(row, &(r * -1.0), &mut momenta);
            let v = row.form(&rows.velocity(row, &self.y)) + row.metric().times(&r);
            let mut slack = pair.slack - site.along(&v);
            slack.iter_mut().skip(site.count).for_each(|w| *w = 0.0);
            slacks.push(slack);
        }
        Defect { momenta, slacks }
    }

    /// Mean of λ w over all rays.
    fn gap(&self, sites: &[Site]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (pair, site) in self.pairs.iter().zip(sites) {
            (0..site.count).for_each(|k| sum += pair.lambda[k] * pair.slack[k]);
            count += site.count;
        }
        sum / count as f64
    }

    /// Mean of λ w where the slacks are the velocities that the multipliers give.
    fn scale(&self, rows: &Rows, sites: &[Site]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for ((pair, site), row) in self.pairs.iter().zip(sites).zip(&rows.list) {
            let yields = row.size / row.rows.len() as f64;
            (0..site.count).for_each(|k| sum += yields * pair.lambda[k] * pair.lambda[k]);
            count += site.count;
        }
        sum / count as f64
    }

    fn moved(&self, step: &Self, length: f64) -> Self {
        let pair = |(at, step): (&Pair, &Pair)| Pair {
            lambda: at.lambda + step.lambda * length,
            slack: at.slack + step.slack * length,
        };
        Self {
            y: self.y.iter().zip(&step.y).map(|(y, d)| y + length * d).collect(),
            pairs: self.pairs.iter().zip(&step.pairs).map(pair).collect(),
        }
    }

    /// The longest part of a step that leaves all multipliers and slacks above zero.
    fn longest(&self, step: &Self, sites: &[Site]) -> f64 {
        let mut longest = 1.0f64 / NEAR;
        for ((at, step), site) in self.pairs.iter().zip(&step.pairs).zip(sites) {
            for k in 0..site.count {
                for (x, d) in [(at.lambda[k], step.lambda[k]), (at.slack[k], step.slack[k])] {
                    if d < 0.0 {
                        longest = longest.min(-x / d);
                    }
                }
            }
        }
        (NEAR * longest).min(1.0)
    }

    /// The reactions, with each ray either active or not, whichever it is nearer to.
    fn snapped(&self, rows: &Rows, sites: &[Site]) -> Vec<Padded> {
        let contact = |((row, site), pair): ((&Row, &Site), &Pair)| {
            let yields = row.size / row.rows.len() as f64;
            let mut lambda = pair.lambda;
            for k in 0..site.count {
                if lambda[k] * yields < pair.slack[k] {
                    lambda[k] = 0.0;
                }
            }
            site.reaction(row, &lambda)
        };
        rows.list.iter().zip(sites).zip(&self.pairs).map(contact).collect()
    }
}

/// The step for a target of λ w of each ray.
fn step(
    rows: &Rows,
    sites: &[Site],
    inverses: &[SMatrix<f64, 4, 4>],
    factor: &Factor,
    at: &Point,
    defect: &Defect,
    target: impl Fn(usize, usize) -> f64,
) -> Point {
    let mut y: Vec<f64> = defect.momenta.iter().map(|f| -f).collect();
    let mut local = Vec::with_capacity(sites.len());
    for (c, site) in sites.iter().enumerate() {
        let pair = &at.pairs[c];
        let mut right = Rays::zeros();
        for k in 0..site.count {
            right[k] = (target(c, k) - pair.lambda[k] * pair.slack[k]) / pair.lambda[k] + defect.slacks[c][k];
        }
        let drive = inverses[c] * right;
        rows.apply(&rows.list[c], &Padded::from_order(&(site.rays * drive)), &mut y);
        local.push(drive);
    }
    factor.solve(&mut y);
    let pairs = sites.iter().enumerate().map(|(c, site)| {
        let pair = &at.pairs[c];
        let pulled = site.along(&rows.pulled(&rows.list[c], &y));
        let mut lambda = local[c] - inverses[c] * pulled;
        let mut slack = Rays::zeros();
        for k in 0..4 {
            if k < site.count {
                slack[k] = (target(c, k) - pair.slack[k] * lambda[k]) / pair.lambda[k] - pair.slack[k];
            } else {
                lambda[k] = 0.0;
            }
        }
        Pair { lambda, slack }
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
    /// The solution by the path through the middle: the stiff limit if the active set leads to it, else as it is.
    pub(super) fn interior(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let sites: Vec<Site> = base.list.iter().map(Site::new).collect();
        let swept = problem.swept(STALL_SWEEPS);
        if !base.mostly_dry() && self.soft_rest.is_over() {
            if let Some(report) = self.soft_path(problem, base, &swept, iterations) {
                self.soft_rest.forget();
                return Some(report);
            }
            self.soft_rest.lengthen();
        }
        let mut rows = base.clone();
        let mut at = Point::start(&mut rows, &sites, &swept);
        let (mut best, mut stall): (Option<Found>, _) = (None, Stall::after(PATIENCE));
        let mut last = swept;
        let tolerance = self.settings.tolerance;
        self.follow_path(&mut rows, &sites, &mut at, iterations, |rows, at| {
            let reactions = at.snapped(rows, &sites);
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
    fn soft_path(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        swept: &[Padded],
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let mut rows = base.clone();
        rows.soften(SOFT);
        let sites: Vec<Site> = rows.list.iter().map(Site::new).collect();
        let mut last = swept.to_vec();
        for _ in 0..ROUNDS {
            let mut at = Point::start(&mut rows, &sites, swept);
            let mut stall = Stall::after(SOFT_PATIENCE);
            self.follow_path(&mut rows, &sites, &mut at, iterations, |rows, at| {
                let gap = at.gap(&sites);
                gap <= END * at.scale(rows, &sites) || stall.at(gap)
            });
            let reactions = at.snapped(&rows, &sites);
            problem.write_back(&reactions);
            problem.velocities_from_reactions();
            let (residual, load_error) = (problem.residual(), net_change(&rows, &last, &reactions));
            let mut guess = Guess::of(reactions.clone());
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
    fn follow_path(
        &mut self,
        rows: &mut Rows,
        sites: &[Site],
        at: &mut Point,
        iterations: &mut u64,
        mut arrived: impl FnMut(&Rows, &Point) -> bool,
    ) {
        self.renew = true;
        for _ in 0..MOST {
            *iterations += 1;
            let gap = at.gap(sites);
            follow_slip(rows, &at.y);
            let defect = at.defect(rows, sites);
            let inverses: Vec<_> = sites.iter().zip(&at.pairs).map(|(site, pair)| site.inverse(pair)).collect();
            let operators: Vec<_> = sites
                .iter()
                .zip(&inverses)
                .map(|(site, d)| Some(Operator::Full(site.rays * d * site.rays.transpose())))
                .collect();
            if !self.factor.renew(rows, &operators) {
                break;
            }
            let affine = step(rows, sites, &inverses, &self.factor, at, &defect, |_, _| 0.0);
            let reach = at.longest(&affine, sites);
            let centring = (at.moved(&affine, reach).gap(sites) / gap).powi(3).min(1.0);
            let second = |c: usize, k: usize| centring * gap - affine.pairs[c].lambda[k] * affine.pairs[c].slack[k];
            let direction = step(rows, sites, &inverses, &self.factor, at, &defect, second);
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
