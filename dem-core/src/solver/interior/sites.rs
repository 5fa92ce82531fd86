//! The contacts of a problem as cone pairs, whatever their law.
//!
//! A contact has rows r (its reaction, without the shift s of the normal row) and a list of cones,
//! each with
//!
//! x = G r̂ = (slope · (r_n + s), r_t…) ∈ Q   ⊥   z ∈ Q,      u + C (r − r₀) = Σ Bᵀ z.
//!
//! An associated law has one cone for each group of rows, with B = G. Any other law has a ray for
//! Signorini's condition, and for each group a cone whose z₀ acts on no row: there B is G without
//! its normal column, and z₀ is the slip speed.

use super::cones::Point;
use crate::contact::{PADDED, Padded};
use crate::solver::rows::{Row, Rows, TWIST};
use std::ops::Range;

/// Most rows of a contact, and most unknowns of its cones.
pub(super) const ROWS: usize = PADDED;
pub(super) const CONES: usize = 9;

/// One cone of a contact.
#[derive(Clone, Debug)]
pub(in crate::solver) struct SecondOrderCone {
    /// Ratio of x₀ to the shifted normal reaction.
    pub slope: f64,
    /// The contact's rows for the components after x₀; `tangents` of them.
    pub rows: [usize; 2],
    pub tangents: usize,
    /// Whether z₀ acts on the normal row.
    pub acts_on_normal: bool,
}

/// One contact.
#[derive(Clone, Debug)]
pub(in crate::solver) struct Site {
    /// Places of its rows in a padded vector. A group with a limit of zero has no rows here.
    pub places: [usize; ROWS],
    /// Numbers of these rows among all rows of the contact.
    pub of: [usize; ROWS],
    pub rows: usize,
    /// Start of its rows in a list of all rows.
    pub at: usize,
    /// Its cones, and their number of unknowns.
    pub cones: Range<usize>,
    pub duals: usize,
    /// Start of its local matrix in a list of all.
    pub matrix: usize,
}

impl Site {
    /// Order of the local matrix.
    pub fn order(&self) -> usize {
        self.rows + self.duals
    }

    /// Its part of a list of all rows.
    #[inline]
    pub fn part<'a>(&self, list: &'a [f64]) -> &'a [f64] {
        &list[self.at..self.at + self.rows]
    }

    #[inline]
    pub fn part_mut<'a>(&self, list: &'a mut [f64]) -> &'a mut [f64] {
        &mut list[self.at..self.at + self.rows]
    }
}

impl SecondOrderCone {
    /// G r: the change of x with the reaction.
    #[inline]
    pub fn primal(&self, r: &[f64]) -> Point {
        let mut x = [self.slope * r[0], 0.0, 0.0];
        for k in 0..self.tangents {
            x[1 + k] = r[self.rows[k]];
        }
        x
    }

    /// u += Bᵀ z.
    #[inline]
    pub fn add_velocity(&self, z: &Point, u: &mut [f64]) {
        if self.acts_on_normal {
            u[0] += self.slope * z[0];
        }
        for k in 0..self.tangents {
            u[self.rows[k]] += z[1 + k];
        }
    }
}

/// The contacts of a problem, in units in which reactions and velocities are of order one.
#[derive(Clone, Debug, Default)]
pub(in crate::solver) struct Sites {
    pub list: Vec<Site>,
    pub cones: Vec<SecondOrderCone>,
    /// Number of all rows.
    pub rows: usize,
    /// Unit of reactions (N s, over the unit of mass), and of velocities (m/s).
    pub force: f64,
    pub speed: f64,
    /// For each contact: the shift of its normal reaction.
    pub shift: Vec<f64>,
    /// For each contact: the normal entry of W over the mean of all.
    pub normal: Vec<f64>,
    /// For each row: the velocity without reactions; the compliance of an elastic bond, and the
    /// reaction at which the bond is at rest; the compliance of the metric for κ = 1.
    pub free: Vec<f64>,
    pub compliance: Vec<f64>,
    pub carried: Vec<f64>,
    pub metric: Vec<f64>,
    /// Length of the list of local matrices.
    pub matrices: usize,
    /// Whether it is a problem of statics.
    is_static: bool,
}

impl Sites {
    /// The contacts of `rows`, in units that depend on the problem and on these reactions.
    pub fn of(rows: &Rows, reactions: &[Padded]) -> Self {
        let mut sites = Self { is_static: rows.is_static, ..Self::cones_of(rows) };
        let velocities: Vec<Padded> = rows.list.iter().map(|row| rows.velocity(row, &rows.free)).collect();
        let count = rows.list.len().max(1) as f64;
        let mean = |sum: f64| sum / count;
        let normal = mean(rows.list.iter().map(|row| row.normal).sum());
        // reactions that would stop the bodies, current reactions, or applied impulses
        let stopping = (mean(velocities.iter().map(|u| u.dot(u)).sum())).sqrt() / normal;
        let at_hand = mean(reactions.iter().map(|r| r.dot(r)).sum()).sqrt();
        sites.force = stopping.max(at_hand).max(rows.applied / count.sqrt());
        sites.speed = normal * sites.force;
        let metric = rows.list.iter().filter(|row| !row.is_elastic());
        let (soft, of) = metric.fold((0.0, 0.0), |(sum, count), row| (sum + row.weights.n, count + 1.0));
        let soft = if soft > 0.0 { soft / of } else { 1.0 };
        for ((site, row), u) in sites.list.iter().zip(&rows.list).zip(&velocities) {
            let (u, carried) = (u.in_order(), row.carried.in_order());
            let (weights, compliance) = (row.weights.in_order(), row.compliance.in_order());
            for place in &site.places[..site.rows] {
                sites.free.push(u[*place] / sites.speed);
                sites.compliance.push(compliance[*place] / normal);
                sites.carried.push(carried[*place] / sites.force);
                sites.metric.push(weights[*place] / soft);
            }
            sites.shift.push(row.shift / sites.force);
            sites.normal.push(row.normal / normal);
        }
        sites
    }

    /// The rows and cones alone.
    pub fn cones_of(rows: &Rows) -> Self {
        let mut sites = Self::default();
        rows.list.iter().for_each(|row| sites.add(row));
        sites
    }

    fn add(&mut self, row: &Row) {
        let (mu, nu, xi) = (row.cone.mu, row.cone.nu, row.cone.xi);
        let mut site = Site {
            places: [0; ROWS],
            of: [0; ROWS],
            rows: 0,
            at: self.rows,
            cones: self.cones.len()..0,
            duals: 0,
            matrix: self.matrices,
        };
        for (k, place) in row.rows.iter().enumerate().filter(|(_, place)| row.bears(**place)) {
            (site.places[site.rows], site.of[site.rows]) = (*place, k);
            site.rows += 1;
        }
        let own = |places: Range<usize>| {
            let mut rows = [0; 2];
            let mut count = 0;
            for (k, _) in site.places[..site.rows].iter().enumerate().filter(|(_, place)| places.contains(*place)) {
                rows[count] = k;
                count += 1;
            }
            (rows, count)
        };
        let groups = [(mu, 1..3), (nu, 3..TWIST), (xi, TWIST..TWIST + 1)].map(|(slope, places)| (slope, own(places)));
        let groups = groups.into_iter().filter(|(_, (_, count))| *count > 0);
        let before = self.cones.len();
        for (slope, (rows, tangents)) in groups {
            self.cones.push(SecondOrderCone { slope, rows, tangents, acts_on_normal: row.associated });
        }
        if !row.associated || self.cones.len() == before {
            self.cones.push(SecondOrderCone { slope: 1.0, rows: [0; 2], tangents: 0, acts_on_normal: true });
        }
        site.cones.end = self.cones.len();
        site.duals = self.cones[before..].iter().map(|cone| 1 + cone.tangents).sum();
        self.rows += site.rows;
        self.matrices += site.order() * site.order();
        self.list.push(site);
    }

    /// Size of the velocity of a row without reactions, with which an elastic bond returns to rest.
    pub fn asked(&self, row: usize) -> f64 {
        (self.free[row] - self.compliance[row] * self.carried[row]).abs()
    }

    /// The largest velocity without reactions, of bonds and of contacts that would close, if there
    /// are any: the scale of [`velocity_error`](crate::problem::residual::velocity_error). In
    /// statics, where no velocity counts, infinity.
    pub fn largest_free(&self) -> f64 {
        if self.is_static {
            return f64::INFINITY;
        }
        let asks = |k: usize| self.shift[k] > 0.0 || self.free[self.list[k].at] < 0.0;
        let any = (0..self.list.len()).any(asks);
        let asked = self.list.iter().enumerate().filter(|(k, _)| asks(*k) || !any);
        let rows = asked.flat_map(|(_, site)| site.at..site.at + site.rows);
        rows.map(|row| self.asked(row)).fold(0.0, f64::max)
    }

    /// Whether there are elastic bonds.
    pub fn has_elastic(&self) -> bool {
        self.compliance.iter().any(|c| *c > 0.0)
    }

    /// x = G r̂ of all cones.
    pub fn primal(&self, r: &[f64]) -> Vec<Point> {
        let mut x = self.change(r);
        for (site, shift) in self.list.iter().zip(&self.shift) {
            site.cones.clone().for_each(|c| x[c][0] += self.cones[c].slope * shift);
        }
        x
    }

    /// G r of all cones: the change of x with the reactions.
    pub fn change(&self, r: &[f64]) -> Vec<Point> {
        let mut x = Vec::with_capacity(self.cones.len());
        for site in &self.list {
            let own = site.part(r);
            x.extend(self.cones_at(site).iter().map(|cone| cone.primal(own)));
        }
        x
    }

    /// Σ Bᵀ z of all contacts.
    pub fn velocity(&self, z: &[Point]) -> Vec<f64> {
        let mut u = vec![0.0; self.rows];
        for site in &self.list {
            let own = site.part_mut(&mut u);
            site.cones.clone().for_each(|c| self.cones[c].add_velocity(&z[c], own));
        }
        u
    }

    /// `scale` H̃ r, over the unknowns of the bodies.
    pub fn pushed(&self, rows: &Rows, scale: f64, r: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; rows.unknowns];
        for (site, row) in self.list.iter().zip(&rows.list) {
            site.of.iter().zip(site.part(r)).for_each(|(k, r)| rows.push_by(row, *k, scale, *r, &mut y));
        }
        y
    }

    /// `scale` H̃ᵀ y.
    pub fn pulled(&self, rows: &Rows, scale: f64, y: &[f64]) -> Vec<f64> {
        let mut u = vec![0.0; self.rows];
        for (site, row) in self.list.iter().zip(&rows.list) {
            let own = site.of.iter().zip(site.part_mut(&mut u));
            own.for_each(|(k, u)| *u = scale * rows.pulled_by(row, *k, y));
        }
        u
    }

    /// The cones of a contact.
    pub fn cones_at(&self, site: &Site) -> &[SecondOrderCone] {
        &self.cones[site.cones.clone()]
    }

    /// Reactions of the problem as a list of all rows.
    pub fn gathered(&self, reactions: &[Padded]) -> Vec<f64> {
        let mut list = Vec::with_capacity(self.rows);
        for (site, r) in self.list.iter().zip(reactions) {
            let r = r.in_order();
            list.extend(site.places[..site.rows].iter().map(|place| r[*place] / self.force));
        }
        list
    }

    /// A list of all rows as reactions of the problem.
    pub fn scattered(&self, list: &[f64]) -> Vec<Padded> {
        self.list.iter().map(|site| self.padded(site, site.part(list))).collect()
    }

    /// The rows of one contact as its reaction.
    pub fn padded(&self, site: &Site, own: &[f64]) -> Padded {
        let mut r = [0.0; ROWS];
        site.places.iter().zip(own).for_each(|(place, value)| r[*place] = value * self.force);
        Padded::from_order(&r.into())
    }
}
