//! Quantities derived from a load curve: collapse load, peak, work.

use dem_history::History;
use dem_scene::failure::{PEAK_DROP, in_one_piece};
use serde_json::Value;

use crate::output::Result;

/// The kind of bonds of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bonding {
    /// No bonds.
    None,
    /// Elastic: they deform before they break.
    Elastic,
    /// Rigid: they do not deform.
    Rigid {
        /// Whether they joined all grains to one piece at the start.
        one_piece: bool,
    },
}

impl Bonding {
    /// The kind in a run.
    ///
    /// # Errors
    /// Those of reading the history.
    pub fn of(history: &History) -> Result<Self> {
        let bonds = history.bonds()?;
        if bonds.is_empty() {
            return Ok(Self::None);
        }
        let scene = serde_json::from_str::<Value>(&history.parameters()?.scene).unwrap_or_default();
        if !scene["bonds"]["stiffness"].is_null() {
            return Ok(Self::Elastic);
        }
        let grains = history.grains()?.radius.len();
        // a damaged file may name grains that do not exist
        let grain = |k: i32| u32::try_from(k).ok().filter(|&k| (k as usize) < grains);
        let pairs = bonds.pair.iter().filter_map(|[i, j]| Some([grain(*i)?, grain(*j)?]));
        Ok(Self::Rigid { one_piece: in_one_piece(grains, pairs) })
    }
}

/// The collapse of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collapse {
    /// The last step before the strain exceeds its limit; `None` if the strain never exceeds it or
    /// there is no collapse load.
    pub step: Option<usize>,
    /// Whether no rigid bond had broken by then.
    pub early: bool,
    /// A caveat on the load, or the reason why there is none; empty if the strain never exceeds its
    /// limit.
    pub note: &'static str,
}

impl Collapse {
    /// Finds the collapse from curves with one entry per step: `load` (N), `strain` (–), `broken`
    /// bonds; `limit` is the limit of the strain (–).
    pub fn read(load: &[f64], strain: &[f64], broken: &[f64], limit: f64, bonds: Bonding) -> Self {
        let Some(passed) = strain.iter().position(|e| e.abs() > limit) else {
            return Self { step: None, early: false, note: "" };
        };
        let step = passed.checked_sub(1).filter(|&step| load.get(step).is_some_and(|load| *load != 0.0));
        let whole = broken.get(passed).or(broken.last()).is_some_and(|&n| n == 0.0);
        let (step, early, note) = match bonds {
            Bonding::Elastic if whole => (None, false, "the sample strained elastically, before any bond broke"),
            Bonding::Rigid { one_piece } if whole && step.is_some() => match one_piece {
                true => (step, true, "before any bond broke: solver error, not strain of the sample"),
                false => (step, true, "before any bond broke: not all grains are bonded to one piece"),
            },
            _ if step.is_none() => (None, false, "no load acted in the step before"),
            _ => (step, false, ""),
        };
        Self { step, early, note }
    }
}

/// The step of the greatest load, if the load falls by at least 5 % afterwards.
pub fn peak(load: &[f64]) -> Option<usize> {
    let top = (0..load.len()).max_by(|&a, &b| load[a].total_cmp(&load[b]).then(b.cmp(&a)))?;
    let lowest = load[top..].iter().copied().fold(f64::INFINITY, f64::min);
    (load[top] > 0.0 && lowest < (1.0 - PEAK_DROP) * load[top]).then_some(top)
}

/// Work of a force along a displacement from zero (J): `force` is the mean over each step (N),
/// `way` the displacement at the end of the step (m). The energy balance of the run uses the same
/// sum.
pub fn work(force: &[f64], way: &[f64]) -> f64 {
    let from = [0.0].into_iter().chain(way.iter().copied());
    force.iter().zip(way).zip(from).map(|((force, to), from)| force * (to - from)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collapse_is_the_last_step_before_the_strain_exceeds_its_limit() {
        let (strain, load) = ([0.0, 5e-5, 1e-4, -2e-4, 0.0, 2e-3], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let step = |limit| Collapse::read(&load, &strain, &[0.0, 0.0, 1.0], limit, Bonding::None).step;
        assert_eq!([1e-4, 1e-3, 1.0].map(step), [Some(2), Some(4), None]);
    }

    #[test]
    fn there_is_no_collapse_load_before_a_load_or_by_elastic_strain() {
        let read =
            |load: f64, broken: f64, bonds| Collapse::read(&[load, 9.0], &[0.0, 2e-4], &[0.0, broken], 1e-4, bonds);
        let rigid = |one_piece| Bonding::Rigid { one_piece };
        // nothing comes before the first step
        assert_eq!(Collapse::read(&[5.0], &[1.0], &[0.0], 1e-4, rigid(true)).step, None);
        assert_eq!(read(-0.0, 1.0, rigid(true)).note, "no load acted in the step before");
        assert_eq!((read(5.0, 0.0, Bonding::Elastic).step, read(5.0, 1.0, Bonding::Elastic).step), (None, Some(0)));
        assert_eq!(read(5.0, 1.0, rigid(true)), Collapse { step: Some(0), early: false, note: "" });
        for (one_piece, told) in [(true, true), (false, false)] {
            let found = read(5.0, 0.0, rigid(one_piece));
            assert_eq!((found.step, found.early), (Some(0), true));
            assert_eq!(found.note.contains("solver error"), told, "{}", found.note);
        }
    }

    #[test]
    fn a_load_that_only_grows_has_no_peak() {
        assert_eq!(peak(&[0.0, 1.0, 2.0]), None);
        assert_eq!(peak(&[0.0, 2.0, 1.99]), None);
        assert_eq!(peak(&[0.0, 2.0, 1.0, 1.5]), Some(1));
        assert_eq!(peak(&[]), None);
    }

    #[test]
    fn work_is_force_times_the_way_of_its_step() {
        assert_eq!(work(&[1.0, 2.0, 2.0], &[1.0, 2.0, 4.0]), 1.0 + 2.0 + 4.0);
    }
}
