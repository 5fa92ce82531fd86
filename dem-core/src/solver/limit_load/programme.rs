//! The programme: unknowns, cones, right sides, and the maps between them.

use crate::solver::graph::Graph;
use crate::solver::interior::sites::Sites;
use crate::solver::rows::{Row, Rows};
use std::sync::Arc;

/// What the largest load factor is.
#[derive(Clone, Debug, PartialEq)]
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
    /// The same: no chain of contacts joins these grains, which have weight, with a wall or a fixed
    /// grain.
    Unsupported {
        /// Their indices.
        grains: Vec<u32>,
    },
    /// The constant loads alone are not balanced; with a part of the growing loads they are.
    BrokenAtStart {
        /// Least factor that is balanced.
        least: f64,
        /// Largest one; none if there is no largest, or if it was not found.
        most: Option<f64>,
    },
    /// The method has not come to an end.
    Undecided,
}

pub(super) struct Programme {
    pub rows: Rows,
    pub graph: Arc<Graph>,
    /// Reactions and cones of the contacts.
    pub sites: Sites,
    /// Right side of the balance, and the growing load.
    pub b: Vec<f64>,
    pub load: Vec<f64>,
    /// −1 to maximise λ, 1 to minimise it, 0 to balance the constant loads at any λ.
    pub sense: f64,
    /// The factor that one unit of the unknown λ stands for.
    pub unit: f64,
    /// The reaction that one unit of the unknowns stands for, and the largest strength, to which
    /// larger ones were reduced.
    pub force: f64,
    pub cap: f64,
}

pub(super) fn most(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
}

pub(super) fn sum(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Programme {
    /// The programme of these rows and this growing load; or what is known without it.
    pub fn of(mut rows: Rows, mut load: Vec<f64>, cap: f64) -> Result<Self, LimitLoad> {
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
        // the limit load is that of associated contacts
        rows.list.iter_mut().for_each(|row| row.associated = true);
        let sites = Sites::cones_of(&rows);
        let mut b: Vec<f64> = constant.iter().map(|f| -f / force).collect();
        for row in rows.list.iter().filter(|row| row.shift > 0.0) {
            rows.push_by(row, 0, 1.0, row.shift / force, &mut b);
        }
        let unit = force / most(&load);
        load.iter_mut().for_each(|f| *f *= unit / force);
        let graph = Graph::of(&rows, &mut None).ok_or(LimitLoad::Undecided)?;
        Ok(Self { rows, graph, sites, b, load, sense: -1.0, unit, force, cap })
    }

    /// H r.
    pub fn pushed(&self, r: &[f64]) -> Vec<f64> {
        self.sites.pushed(&self.rows, 1.0, r)
    }

    /// Hᵀ y.
    pub fn pulled(&self, y: &[f64]) -> Vec<f64> {
        self.sites.pulled(&self.rows, 1.0, y)
    }
}

/// The unknowns of a contact's bodies, in the order of its coefficients.
pub(super) fn unknowns(row: &Row) -> impl Iterator<Item = usize> {
    (0..2).flat_map(|side| row.at[side]..row.at[side] + row.count[side])
}
