//! Cohesive bonds: their properties, their limits and their rupture criterion (Guessasma & Fortin
//! 2011, (4) and (5)). A broken bond never re-forms.

use crate::contact::{Cone, Local, Weights};
use crate::dim::{Moments, Vect};
use std::ops::{Deref, DerefMut};

/// Relative distance from the limit within which a bond counts as at its limit (–).
pub const LIMIT: f64 = 1e-7;

/// Whether a bond is intact, and if not, its failure mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BondStatus {
    /// Not broken.
    Intact,
    /// Broken: the shifted normal reaction vanished.
    Tension,
    /// Broken: the tangential reaction reached μ (r_n + r_coh).
    Shear,
    /// Broken: the moment reached μ a (r_n + r_coh).
    Rolling,
    /// Broken: the twisting moment reached ξ a (r_n + r_coh).
    Twist,
}

/// Stiffness of an elastic bond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// Normal (N/m).
    pub normal: f64,
    /// Tangential (N/m).
    pub tangential: f64,
    /// Bending (N m/rad).
    pub rolling: f64,
    /// Twist (N m/rad), where bonds resist it.
    pub twist: f64,
}

/// A bond between two grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// The two grains, the lower index first.
    pub pair: [u32; 2],
    /// Gap at which it formed (m).
    pub rest_gap: f64,
    /// Mean diameter of the pair, a_moy (m).
    pub mean_diameter: f64,
    /// Tensile strength r_coh (N).
    pub strength: f64,
    /// Coefficient μ of the shear limit (–).
    pub shear: f64,
    /// Coefficient ν of the rolling limit (–).
    pub rolling: f64,
    /// Coefficient ξ of the twisting moment, where bonds resist it (–).
    pub twist: f64,
    /// Stiffness; none for a rigid bond.
    pub stiffness: Option<Stiffness>,
    /// Whether it is intact.
    pub status: BondStatus,
}

/// Bonds sorted by pair, at most one per pair. A bond can be changed in place, except for its pair,
/// and cannot be removed: contacts and histories refer to bonds by index.
/// [`crate::world::World::add_bonds`] adds bonds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bonds(Vec<Bond>);

impl Bonds {
    /// Add bonds to pairs that have none; returns the new index of each earlier bond.
    pub(crate) fn merge(&mut self, bonds: Vec<Bond>) -> Vec<u32> {
        let earlier = self.0.len();
        let mut list: Vec<(usize, Bond)> = std::mem::take(&mut self.0).into_iter().chain(bonds).enumerate().collect();
        // a stable sort: the earlier bond of a pair comes first and is kept
        list.sort_by_key(|(_, bond)| bond.pair);
        list.dedup_by_key(|(_, bond)| bond.pair);
        let mut numbers = vec![0; earlier];
        for (now, (before, _)) in list.iter().enumerate() {
            if let Some(number) = numbers.get_mut(*before) {
                *number = now as u32;
            }
        }
        self.0 = list.into_iter().map(|(_, bond)| bond).collect();
        numbers
    }
}

impl From<Vec<Bond>> for Bonds {
    /// Sorts by pair and keeps the first of several bonds of one pair.
    fn from(list: Vec<Bond>) -> Self {
        let mut bonds = Self::default();
        bonds.merge(list);
        bonds
    }
}

impl Deref for Bonds {
    type Target = [Bond];
    fn deref(&self) -> &[Bond] {
        &self.0
    }
}

impl DerefMut for Bonds {
    fn deref_mut(&mut self) -> &mut [Bond] {
        &mut self.0
    }
}

impl<'a> IntoIterator for &'a Bonds {
    type Item = &'a Bond;
    type IntoIter = std::slice::Iter<'a, Bond>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a> IntoIterator for &'a mut Bonds {
    type Item = &'a mut Bond;
    type IntoIter = std::slice::IterMut<'a, Bond>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl Bond {
    /// The cone of its shifted reaction, with moments divided by the mean diameter.
    pub fn cone(&self) -> Cone {
        Cone { mu: self.shear, nu: self.rolling, xi: self.twist }
    }

    /// Compliance of its rows over an implicit step `h` (s), 1/(k h²) (1/kg); none for a rigid
    /// bond.
    pub fn compliance(&self, h: f64) -> Option<Weights> {
        let a = self.mean_diameter;
        self.stiffness.map(|k| Weights {
            n: 1.0 / (k.normal * h * h),
            t: 1.0 / (k.tangential * h * h),
            m: a * a / (k.rolling * h * h),
            w: a * a / (k.twist * h * h),
        })
    }
}

/// Which bonds at their limit break after an accepted solve, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Rupture {
    /// All break, and the same step is solved again, until none is at its limit.
    #[default]
    Cascade,
    /// The one that flows fastest breaks, and the same step is solved again, until none is at its
    /// limit.
    CascadeWorst,
    /// All break at the end of the step.
    EndOfStep,
    /// Quasi-static: each step raises or lowers the load to the value at which the next bond
    /// breaks ([`crate::world::World::load_time`]).
    NextEvent {
        /// Time of the last loads (s): the load functions are followed up to it.
        until: f64,
    },
}

/// The least strength at which a bond with this cone bears the reaction `r`, whose moments are
/// divided by the mean diameter; in the unit of `r`. It is negative inside the cone without
/// cohesion and positively homogeneous: a reaction twice as large needs twice the strength.
pub fn required_strength<T: Vect, B: Moments>(r: &Local<T, B>, cone: Cone) -> f64 {
    required_limits(r, cone).into_iter().fold(0.0, f64::max) - r.n
}

/// ‖t‖/μ, ‖m‖/ν and |τ|/ξ: the limit r_n + r_coh that shear, rolling and twist require; zero where
/// the coefficient is zero.
fn required_limits<T: Vect, B: Moments>(r: &Local<T, B>, cone: Cone) -> [f64; 3] {
    let over = |size: f64, coefficient: f64| if coefficient > 0.0 { size / coefficient } else { 0.0 };
    [over(r.t.norm(), cone.mu), over(r.m.bending(), cone.nu), over(r.m.twist(), cone.xi)]
}

/// Failure mode of a bond under the reaction `r`, with the shift s = r_coh in the unit of `r`;
/// `None` below the limit.
///
/// TENSION if r_n + s ≤ ε s; else SHEAR, ROLLING or TWIST, whichever of ‖t‖/μ, ‖m‖/ν and |τ|/ξ is
/// the largest (the first of those within ε of it), if it reaches (1 − ε) (r_n + s). Pure
/// compression never breaks a bond. A row group with coefficient zero never fails: a bond with
/// μ = ν = ξ = 0 fails in tension only.
pub fn failure<T: Vect, B: Moments>(r: &Local<T, B>, shift: f64, cone: Cone) -> Option<BondStatus> {
    let limit = r.n + shift;
    if limit <= LIMIT * shift {
        return Some(BondStatus::Tension);
    }
    let largest = required_limits(r, cone).into_iter().fold(0.0, f64::max);
    (largest >= (1.0 - LIMIT) * limit).then(|| mode(r, cone))
}

/// A reaction `shown` (N, N m) next to the limit of a bond, moved to the limit: to the apex of the
/// cone for TENSION, else by a factor on the rows of this mode. `r` is the same reaction in the
/// unit of the shift.
pub(crate) fn at_limit<T: Vect, B: Moments, M: Moments, S: Vect>(
    shown: &Local<S, M>,
    r: &Local<T, B>,
    shift: f64,
    cone: Cone,
    mode: BondStatus,
) -> Local<S, M> {
    let [shear, rolling, twist] = required_limits(r, cone).map(|required| (r.n + shift) / required);
    match mode {
        BondStatus::Intact => *shown,
        BondStatus::Tension => Local { n: -shift * shown.n / r.n, ..Local::zero() },
        BondStatus::Shear => Local { t: shown.t * shear, ..*shown },
        BondStatus::Rolling => Local { m: shown.m.scaled(rolling, 1.0), ..*shown },
        BondStatus::Twist => Local { m: shown.m.scaled(1.0, twist), ..*shown },
    }
}

/// SHEAR, ROLLING or TWIST, whichever of ‖t‖/μ, ‖m‖/ν and |τ|/ξ is the largest: the first of those
/// within ε of the largest, since a bond at several limits has them equal but for round-off.
pub(crate) fn mode<T: Vect, B: Moments>(r: &Local<T, B>, cone: Cone) -> BondStatus {
    let required = required_limits(r, cone);
    let least = (1.0 - LIMIT) * required.into_iter().fold(0.0, f64::max);
    let modes = [BondStatus::Shear, BondStatus::Rolling, BondStatus::Twist];
    modes.into_iter().zip(required).find(|(_, required)| *required >= least).map_or(BondStatus::Shear, |(mode, _)| mode)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Padded;

    #[test]
    fn rounding_does_not_decide_between_limits_that_are_met_at_once() {
        let (cone, shift) = (Cone { mu: 0.5, nu: 0.3, xi: 0.2 }, 10.0);
        let at = |shear: f64, rolling: f64, twist: f64| {
            let limit = 4.0 + shift;
            let (t, m, w) = (0.5 * limit * shear, 0.3 * limit * rolling, 0.2 * limit * twist);
            failure(&Padded::from_order(&[4.0, 0.6 * t, 0.8 * t, 0.8 * m, -0.6 * m, -w].into()), shift, cone)
        };
        for off in [-3.0, 0.0, 3.0] {
            let beside = 1.0 + off * f64::EPSILON;
            assert_eq!(at(1.0, beside, 0.3), Some(BondStatus::Shear));
            assert_eq!(at(0.9, 1.0, beside), Some(BondStatus::Rolling));
            assert_eq!(at(1.0, beside, 1.0 + 2.0 * off * f64::EPSILON), Some(BondStatus::Shear));
        }
        assert_eq!(at(1.0, 1.0 + 10.0 * LIMIT, 0.3), Some(BondStatus::Rolling));
        assert_eq!(at(1.0, 0.9, 1.0 + 10.0 * LIMIT), Some(BondStatus::Twist));
    }
}
