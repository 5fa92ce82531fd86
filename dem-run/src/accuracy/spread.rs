//! Differences of runs that should give the same results.

use super::trial::{Outcome, SolverName};
use serde::Serialize;

/// The runs of a solver with one variation on which the results should not depend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The solver.
    pub solver: SolverName,
    /// What was varied: the order of the contacts, or the starting reactions.
    pub varied: Varied,
    /// Completed runs.
    pub runs: usize,
    /// Runs in which a step was not solved. They are excluded from all other numbers.
    pub failed: usize,
    /// Applied force at the first break (N).
    pub first_break: Option<MinMeanMax>,
    /// Number of different bonds that broke first.
    pub first_bonds: usize,
    /// Collapse load (N) at each of [`crate::scene::failure::STRAINS`].
    pub collapse: [Option<MinMeanMax>; 2],
    /// Mean Jaccard index over all pairs of sets of broken bonds (–); none for fewer than two runs.
    pub jaccard: Option<f64>,
}

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Varied {
    /// The order of the contacts.
    Order,
    /// The reactions that the bonds start from.
    Start,
}

impl Varied {
    /// Variations of a bonded sample. Starting reactions of elastic bonds are not varied: they are
    /// spring forces, so other values would mean another, prestressed sample.
    #[must_use]
    pub fn of(elastic: bool) -> &'static [Self] {
        if elastic { &[Self::Order] } else { &[Self::Order, Self::Start] }
    }

    /// Name in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Order => "contact order",
            Self::Start => "starting reactions",
        }
    }
}

/// Least, mean and greatest value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MinMeanMax {
    /// Least.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Greatest.
    pub max: f64,
}

impl MinMeanMax {
    /// The range of the values; none if there are no values.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        (!values.is_empty()).then(|| Self {
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            mean: values.iter().sum::<f64>() / values.len() as f64,
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

impl Spread {
    /// The spread of these runs.
    #[must_use]
    pub fn of(solver: SolverName, varied: Varied, outcomes: &[&Outcome]) -> Self {
        let ended: Vec<&Outcome> = outcomes.iter().copied().filter(|o| o.error.is_none()).collect();
        let range = |value: &dyn Fn(&Outcome) -> Option<f64>| {
            MinMeanMax::of(&ended.iter().copied().filter_map(value).collect::<Vec<f64>>())
        };
        let mut first: Vec<u32> = ended.iter().filter_map(|o| Some(o.first_break.as_ref()?.bond)).collect();
        first.sort_unstable();
        first.dedup();
        let pairs: Vec<f64> = (0..ended.len())
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .map(|(a, b)| jaccard(&ended[a].broken, &ended[b].broken))
            .collect();
        Self {
            solver,
            varied,
            runs: ended.len(),
            failed: outcomes.len() - ended.len(),
            first_break: range(&|o| o.first_break.as_ref()?.load),
            first_bonds: first.len(),
            collapse: [range(&|o| o.failure.collapse[0]), range(&|o| o.failure.collapse[1])],
            jaccard: MinMeanMax::of(&pairs).map(|range| range.mean),
        }
    }
}

/// Jaccard index |A ∩ B| / |A ∪ B| of two sorted sets (–): 1 if equal, 0 if disjoint. Two empty
/// sets are equal.
#[must_use]
pub fn jaccard(a: &[u32], b: &[u32]) -> f64 {
    let common = a.iter().filter(|k| b.binary_search(k).is_ok()).count();
    match a.len() + b.len() - common {
        0 => 1.0,
        union => common as f64 / union as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jaccard_index_is_the_share_of_what_is_common() {
        assert_eq!(jaccard(&[1, 2, 3], &[1, 2, 3]), 1.0);
        assert_eq!(jaccard(&[1, 2, 3], &[2, 3, 4]), 0.5);
        assert_eq!(jaccard(&[1, 2], &[3]), 0.0);
        assert_eq!(jaccard(&[], &[3]), 0.0);
        assert_eq!(jaccard(&[], &[]), 1.0);
    }

    #[test]
    fn a_range_has_its_mean() {
        assert_eq!(MinMeanMax::of(&[3.0, 1.0, 5.0]), Some(MinMeanMax { min: 1.0, mean: 3.0, max: 5.0 }));
        assert_eq!(MinMeanMax::of(&[]), None);
    }
}
