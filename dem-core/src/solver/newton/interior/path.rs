//! A central path: its points, the step from one to the next, and the metric that hardens on the way.

use super::super::factor::Factor;
use super::super::guess::Guess;
use super::super::inner::distance;
use super::super::net_change;
use crate::solver::rows::{Row, Rows};
use super::{Aim, Site, yields};
use crate::contact::{Padded, Weights};

/// How much harder the metric is than Newton's where the path ends.
const HARDER: f64 = 10.0;
/// How much softer a metric must be for its reactions to be compared with those at the end, and the share by which one of those
/// that are kept is harder than the one before.
const SOFTER: f64 = 100.0;
const KEPT: f64 = 0.3;
/// How near the boundary a step may go.
const NEAR: f64 = 0.995;

/// A point on the way.
pub(super) struct Point<S: Site> {
    pub y: Vec<f64>,
    pub pairs: Vec<S::Pair>,
}

/// How far a point is from the equations: F of the momenta, and of each contact's z.
pub(super) struct Defect<S: Site> {
    pub momenta: Vec<f64>,
    pub slacks: Vec<S::Slack>,
}

impl<S: Site> Point<S> {
    /// Well inside, at the velocities of `y`: reactions of the size of `reaction` and the shift, z to match.
    fn inside(rows: &Rows, sites: &[S], y: Vec<f64>, reaction: f64) -> Self {
        let pair = |(row, site): (&Row, &S)| {
            site.inside(&row.form(&rows.velocity(row, &y)), row.shift + reaction, yields(row))
        };
        let pairs = rows.list.iter().zip(sites).map(pair).collect();
        Self { y, pairs }
    }

    /// F of the momenta.
    pub fn momenta(&self, rows: &Rows, sites: &[S]) -> Vec<f64> {
        let mut momenta: Vec<f64> = self.y.iter().zip(&rows.free).map(|(y, f)| y - f).collect();
        for ((row, site), pair) in rows.list.iter().zip(sites).zip(&self.pairs) {
            rows.apply(row, &(site.reaction(row, pair) * -1.0), &mut momenta);
        }
        momenta
    }

    /// How far each contact's z is from what the velocities and the reaction make it.
    pub fn slacks(&self, rows: &Rows, sites: &[S]) -> Vec<S::Slack> {
        let slack = |((row, site), pair): ((&Row, &S), &S::Pair)| {
            let z = row.form(&rows.velocity(row, &self.y)) + row.metric().times(&site.reaction(row, pair));
            site.defect(pair, &z)
        };
        rows.list.iter().zip(sites).zip(&self.pairs).map(slack).collect()
    }

    /// Mean of all products.
    pub fn gap(&self, sites: &[S]) -> f64 {
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
            count += site.add_scale(pair, yields(row), &mut sum);
        }
        sum / count as f64
    }

    pub fn moved(&self, step: &Self, length: f64) -> Self {
        Self {
            y: self.y.iter().zip(&step.y).map(|(y, d)| y + length * d).collect(),
            pairs: self.pairs.iter().zip(&step.pairs).map(|(at, step)| S::moved(at, step, length)).collect(),
        }
    }

    /// The longest part of a step that stays inside all cones.
    pub fn longest(&self, step: &Self, sites: &[S]) -> f64 {
        let all = self.pairs.iter().zip(&step.pairs).zip(sites);
        let longest = all.fold(1.0 / NEAR, |longest, ((at, step), site)| site.longest(at, step, longest));
        (NEAR * longest).min(1.0)
    }
}

/// The step for an aim of each contact.
pub(super) fn step<'a, S: Site>(
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

/// A central path, and where it has come to.
pub(super) struct Path<S: Site> {
    pub rows: Rows,
    pub sites: Vec<S>,
    pub at: Point<S>,
    /// 1/ρ of each contact where the path ends, and the greatest there over what the contact yields.
    hardest: Vec<Weights>,
    own: f64,
    /// How much softer the metric is, and the least that rounding allows.
    pub softness: f64,
    pub least: f64,
    /// The greatest scale of the gap so far (N s m/s): soft dry contacts bear nearly nothing, and their scale would shrink with
    /// the gap.
    scale: f64,
    /// Softnesses on the way, and the reactions there.
    pub softer: Vec<(f64, Vec<Padded>)>,
}

impl<S: Site> Path<S> {
    /// A path for these terms of dry friction, begun at the velocities that `reactions` give.
    pub fn new(base: &Rows, lags: &[f64], reactions: &[Padded]) -> Self {
        let mut rows = base.clone();
        rows.soften(1.0 / HARDER);
        rows.hold(lags);
        let hardest = rows.list.iter().map(|row| row.weights).collect();
        let own = rows.list.iter().map(|row| row.weights.n / yields(row)).fold(0.0, f64::max);
        let (sites, at) = Self::inside(&rows, reactions);
        Self { rows, sites, at, hardest, own, softness: f64::INFINITY, least: 1.0, scale: 0.0, softer: Vec::new() }
    }

    /// A point well inside, at the velocities that `reactions` give.
    fn inside(rows: &Rows, reactions: &[Padded]) -> (Vec<S>, Point<S>) {
        let mean = (reactions.iter().map(|r| r.dot(r)).sum::<f64>() / reactions.len() as f64).sqrt();
        let sites: Vec<S> = rows.list.iter().map(S::new).collect();
        let at = Point::inside(rows, &sites, rows.given_by(reactions), mean);
        (sites, at)
    }

    /// Begin anew, as softly as at first.
    pub fn begin_again(&mut self, reactions: &[Padded]) {
        (self.sites, self.at) = Self::inside(&self.rows, reactions);
        (self.softness, self.scale) = (f64::INFINITY, 0.0);
        self.softer.clear();
    }

    /// The gap over what the reactions and the velocities that they give multiply to.
    pub fn gap(&self) -> f64 {
        self.at.gap(&self.sites) / self.at.scale(&self.rows, &self.sites)
    }

    /// Make the metric as soft as the gap is wide.
    pub fn harden(&mut self) {
        self.scale = self.scale.max(self.at.scale(&self.rows, &self.sites));
        let gap = self.at.gap(&self.sites) / self.scale;
        let softness = (gap.min(1.0) / self.own).min(self.softness).max(self.least);
        if softness != self.softness {
            self.soften(softness);
        }
    }

    /// Make the metric so much softer than where the path ends.
    pub fn soften(&mut self, softness: f64) {
        self.softness = softness;
        for (row, w) in self.rows.list.iter_mut().zip(&self.hardest) {
            row.weights = *w * self.softness;
        }
        self.sites = self.rows.list.iter().map(S::new).collect();
    }

    /// The terms of dry friction.
    pub fn terms(&self) -> Vec<f64> {
        self.rows.list.iter().map(|row| row.lag.unwrap_or(0.0)).collect()
    }

    /// The change of momentum that the velocities of the point stand for.
    pub fn impulse(&self) -> f64 {
        distance(&self.at.y, &self.rows.free)
    }

    /// Go to the next point.
    pub fn advance(&mut self, next: Point<S>) {
        self.at = next;
        if self.softer.last().is_none_or(|(softness, _)| self.softness <= KEPT * softness) {
            let all = self.sites.iter().zip(&self.rows.list).zip(&self.at.pairs);
            self.softer.push((self.softness, all.map(|((site, row), pair)| site.reaction(row, pair)).collect()));
        }
    }

    /// The reactions at the point, each at the limits that it is nearer to than its z is to its own.
    pub fn snapped(&self) -> Guess {
        let all = self.rows.list.iter().zip(&self.sites).zip(&self.at.pairs);
        let (reactions, beyond) = all.map(|((row, site), pair)| site.snapped(row, pair)).unzip();
        Guess { beyond, ..Guess::of(reactions) }
    }

    /// How far the net impulses still are from those of a rigid metric: as far as the metric is soft. Infinite where no
    /// point was much softer.
    pub fn load_error(&self, reactions: &[Padded]) -> f64 {
        let softer = self.softer.iter().rfind(|(softness, _)| *softness >= SOFTER * self.softness);
        softer.map_or(f64::INFINITY, |(softness, softer)| {
            net_change(&self.rows, softer, reactions) / (softness / self.softness - 1.0)
        })
    }
}
