//! The utilisation of a bond: 0 without a load, 1 where it breaks.
//!
//! A bond of strength r_coh and mean diameter a holds while (docs/theory/contact-law.md)
//!
//! ```text
//! −r_n < r_coh,   ‖r_t‖ < μ (r_n + r_coh),   ‖m‖ < ν a (r_n + r_coh),   |m_τ| < ξ a (r_n + r_coh)
//! ```
//!
//! The utilisation of a mode is the left side over the right side (of TENSION, 0 where the bond is
//! compressed), each at the normal force of the same moment; that of the bond is the greatest of
//! its modes, and the mode with the greatest is the nearest one. A mode whose coefficient is zero
//! never breaks the bond and has none. Where tension leaves no more than [`LEFT`] of the strength,
//! the bond breaks in TENSION, and the other modes have none.
//!
//! The utilisation is no share of the load of the sample: forces of a bond need not grow in
//! proportion to it.

use dem_history::{Bonds, History, Rupture, RuptureMode};
use serde::Serialize;
use serde_json::Value;

use crate::output::Result;

/// Share of the strength, left by the tension, up to which a bond breaks in tension (the ε of the
/// contact law).
pub const LEFT: f64 = 1e-7;

/// The limit of the twisting moment of a bond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Twist {
    /// The bond does not resist twist.
    Free,
    /// The coefficient ξ of its limit.
    Coefficient(f64),
    /// The bond may resist twist, and the history does not hold the coefficient.
    Unknown,
}

/// What a bond bears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Strength r_coh, N.
    pub strength: f64,
    /// Coefficient μ of the shear limit.
    pub shear: f64,
    /// Coefficient ν of the rolling limit.
    pub rolling: f64,
    /// Coefficient ξ of the twist limit.
    pub twist: Twist,
    /// Mean diameter a, m.
    pub arm: f64,
}

/// The load of a bond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Load {
    /// Normal force, N; positive in compression.
    pub normal_force: f64,
    /// Magnitude of the tangential force, N.
    pub tangential_force: f64,
    /// Magnitude of the bending moment, N m; `None` where the history does not hold it.
    pub moment: Option<f64>,
    /// Magnitude of the twisting moment, N m; `None` for a bond that does not resist twist.
    pub twist: Option<f64>,
}

/// How near a bond is to breaking in one mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Part {
    /// The mode.
    pub mode: &'static str,
    /// The force (N) or moment (N m): of TENSION the normal force, positive in compression.
    pub value: Option<f64>,
    /// Its limit (N or N m): of TENSION the strength.
    pub limit: Option<f64>,
    /// Their ratio; `None` where there is none.
    pub utilisation: Option<f64>,
    /// Why there is none; empty where there is one.
    pub note: &'static str,
    /// Whether the history lacks what the ratio needs.
    #[serde(skip)]
    pub unknown: bool,
}

/// The greatest utilisation, and its mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Greatest {
    /// The utilisation.
    pub utilisation: f64,
    /// The mode that is nearest.
    pub mode: &'static str,
}

impl Limits {
    /// The limits of the bond `bond`. Where the history has no coefficients of twist, that of the
    /// scene holds for all.
    ///
    /// # Errors
    /// Those of reading the history.
    pub fn of(history: &History, bonds: &Bonds, bond: usize) -> Result<Self> {
        let friction = bonds.friction[bond];
        Ok(Self {
            strength: bonds.strength[bond],
            shear: friction,
            rolling: bonds.rolling.get(bond).copied().unwrap_or(friction),
            twist: match bonds.twist.as_ref().map(|twist| twist[bond]) {
                _ if history.dimension() < 3 => Twist::Free,
                Some(coefficient) if coefficient > 0.0 => Twist::Coefficient(coefficient),
                Some(_) => Twist::Free,
                None => twist(history)?,
            },
            arm: bonds.mean_diameter[bond],
        })
    }

    /// Every mode in which the bond may break, under `load`.
    pub fn parts(&self, load: &Load) -> Vec<Part> {
        let left = load.normal_force + self.strength;
        let tension = Part {
            mode: RuptureMode::Tension.label(),
            value: Some(load.normal_force),
            limit: Some(self.strength),
            utilisation: (self.strength > 0.0).then(|| (-load.normal_force).max(0.0) / self.strength),
            note: if self.strength > 0.0 { "" } else { "the strength is not positive" },
            unknown: self.strength <= 0.0,
        };
        let other = |mode: RuptureMode, value: Option<f64>, coefficient: Option<f64>, arm: f64| {
            let limit = coefficient.filter(|c| *c > 0.0).map(|c| c * arm * left.max(0.0));
            let unknown = value.is_none() || coefficient.is_none();
            let spent = left <= LEFT * self.strength;
            let note = match coefficient {
                Some(c) if c <= 0.0 => "its coefficient is zero: it never breaks the bond",
                None => "the coefficient is not recorded",
                _ if value.is_none() => "not recorded on its own",
                _ if spent => "the tension leaves no limit",
                _ => "",
            };
            let ratio = value.zip(limit).filter(|_| note.is_empty()).map(|(value, limit)| value / limit);
            Part { mode: mode.label(), value, limit, utilisation: ratio, note, unknown }
        };
        let mut parts = vec![
            tension,
            other(RuptureMode::Shear, Some(load.tangential_force), Some(self.shear), 1.0),
            other(RuptureMode::Rolling, load.moment, Some(self.rolling), self.arm),
        ];
        match self.twist {
            Twist::Free => {}
            Twist::Coefficient(c) => parts.push(other(RuptureMode::Twist, load.twist, Some(c), self.arm)),
            Twist::Unknown => parts.push(other(RuptureMode::Twist, load.twist, None, self.arm)),
        }
        parts
    }

    /// The load that the rupture records. In histories older than version 3 the norm of all moments
    /// is the bending moment only for bonds that do not resist twist.
    pub fn at(&self, rupture: &Rupture) -> Load {
        let resists = self.twist != Twist::Free;
        let apart = rupture.twist.is_finite();
        Load {
            normal_force: rupture.normal_force,
            tangential_force: rupture.tangential_force,
            moment: (apart || !resists).then_some(rupture.moment),
            twist: (apart && resists).then_some(rupture.twist),
        }
    }
}

/// The limit of twist in 3D.
fn twist(history: &History) -> Result<Twist> {
    let scene = serde_json::from_str::<Value>(&history.parameters()?.scene).unwrap_or_default();
    Ok(match scene.pointer("/bonds/twist").and_then(Value::as_f64) {
        Some(coefficient) => Twist::Coefficient(coefficient),
        // a scene that cannot be read may have it
        None if history.layout()?.twist || !scene.is_object() => Twist::Unknown,
        None => Twist::Free,
    })
}

/// The greatest of the modes, of equal ones the first; `None` where one of them is not known.
pub fn greatest(parts: &[Part]) -> Option<Greatest> {
    if parts.iter().any(|part| part.unknown) {
        return None;
    }
    let known = parts.iter().filter_map(|part| Some(Greatest { utilisation: part.utilisation?, mode: part.mode }));
    known.reduce(|most, next| if next.utilisation > most.utilisation { next } else { most })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strength 10 N, a = 4 mm.
    fn limits() -> Limits {
        Limits { strength: 10.0, shear: 0.3, rolling: 0.2, twist: Twist::Coefficient(0.5), arm: 4e-3 }
    }

    fn load(normal_force: f64, tangential_force: f64, moment: f64, twist: f64) -> Load {
        Load { normal_force, tangential_force, moment: Some(moment), twist: Some(twist) }
    }

    fn ratios(limits: &Limits, load: &Load) -> Vec<Option<f64>> {
        limits.parts(load).iter().map(|part| part.utilisation.map(|u| (1e9 * u).round() / 1e9)).collect()
    }

    fn nearest(limits: &Limits, load: &Load) -> Option<(f64, &'static str)> {
        greatest(&limits.parts(load)).map(|most| ((1e9 * most.utilisation).round() / 1e9, most.mode))
    }

    #[test]
    fn each_mode_is_a_force_over_its_limit() {
        // r_n + r_coh = 5 N: limits 1.5 N, 4e-3 N m, 1e-2 N m
        let pulled = load(-5.0, 0.3, 3e-3, 2e-3);
        assert_eq!(ratios(&limits(), &pulled), [0.5, 0.2, 0.75, 0.2].map(Some));
        assert_eq!(nearest(&limits(), &pulled), Some((0.75, "ROLLING")));
        // compression raises the limits and is none itself
        let pressed = load(10.0, 3.0, 0.0, 0.0);
        assert_eq!(ratios(&limits(), &pressed), [0.0, 0.5, 0.0, 0.0].map(Some));
        // of equal ones the first
        assert_eq!(nearest(&limits(), &load(-5.0, 0.75, 0.0, 0.0)), Some((0.5, "TENSION")));
    }

    #[test]
    fn at_its_strength_a_bond_has_no_other_limit() {
        let torn = load(-10.0, 0.0, 0.0, 0.0);
        assert_eq!(ratios(&limits(), &torn), [Some(1.0), None, None, None]);
        assert_eq!(nearest(&limits(), &torn), Some((1.0, "TENSION")));
    }

    #[test]
    fn a_coefficient_of_zero_is_no_limit() {
        let limits = Limits { shear: 0.0, rolling: 0.0, twist: Twist::Free, ..limits() };
        assert_eq!(ratios(&limits, &load(-2.5, 7.0, 1.0, 0.0)), [Some(0.25), None, None]);
        assert_eq!(nearest(&limits, &load(-2.5, 7.0, 1.0, 0.0)), Some((0.25, "TENSION")));
    }

    #[test]
    fn what_is_not_known_is_not_guessed() {
        let unknown = Limits { twist: Twist::Unknown, ..limits() };
        assert_eq!(nearest(&unknown, &load(-5.0, 0.3, 0.0, 0.0)), None);
        // an old rupture holds the norm of all moments
        let old = Rupture {
            step: 0,
            time: 0.0,
            point: [0.0; 3],
            normal_force: -5.0,
            tangential_force: 0.3,
            moment: 3e-3,
            twist: f64::NAN,
            energy: 0.0,
            round: 0,
            bond: 0,
            pair: [0, 1],
            mode: RuptureMode::Rolling,
        };
        assert_eq!((limits().at(&old).moment, limits().at(&old).twist), (None, None));
        assert_eq!(nearest(&limits(), &limits().at(&old)), None);
        let free = Limits { twist: Twist::Free, ..limits() };
        assert_eq!(nearest(&free, &free.at(&old)), Some((0.75, "ROLLING")));
    }
}
