//! Which bond is meant, and where it is in the history.

use std::str::FromStr;

use dem_history::{Bonds, History};

use crate::output::{PostError, Result};

/// A bond as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// By its number.
    Number(usize),
    /// By its two grains.
    Grains([usize; 2]),
}

impl FromStr for Which {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |text: &str| text.trim().parse::<usize>().ok();
        let found = match text.split_once(',') {
            None => number(text).map(Self::Number),
            Some((i, j)) => number(i).zip(number(j)).map(|(i, j)| Self::Grains([i, j])),
        };
        found.ok_or_else(|| {
            "give the number of a bond, as in 12, or its two grains, as in 3,17 (walls have no bonds)".into()
        })
    }
}

impl Which {
    /// The number of the bond in `bonds`.
    ///
    /// # Errors
    /// [`PostError::Lacking`] for a history without bonds, [`PostError::Usage`] for a bond that
    /// does not exist.
    pub(super) fn find(self, history: &History, bonds: &Bonds) -> Result<usize> {
        if bonds.is_empty() {
            let what = "it has no bonds, and `why` explains one: add `bonds` to the scene, or raise its \
                        bonds.gap_tolerance";
            return Err(PostError::Lacking { path: history.path().into(), what: what.into() });
        }
        let wrong = |why: String| Err(PostError::Usage(format!("{}: {why}", history.path().display())));
        match self {
            Self::Number(bond) if bond < bonds.len() => Ok(bond),
            Self::Number(bond) => wrong(format!(
                "there is no bond {bond}, its bonds are 0 to {}: `dem-post cracks` lists those that broke in \
                 ruptures.csv",
                bonds.len() - 1
            )),
            Self::Grains([i, j]) => {
                let grains = history.grains()?.radius.len();
                if let Some(grain) = [i, j].into_iter().find(|&grain| grain >= grains) {
                    return wrong(format!("there is no grain {grain}, its grains are 0 to {}", grains - 1));
                }
                let same = |pair: &[i32; 2]| {
                    let pair = pair.map(|grain| grain as usize);
                    pair == [i, j] || pair == [j, i]
                };
                match bonds.pair.iter().position(same) {
                    Some(bond) => Ok(bond),
                    None => wrong(format!(
                        "grains {i} and {j} have no bond: {}; {}",
                        partners(bonds, i),
                        partners(bonds, j)
                    )),
                }
            }
        }
    }
}

/// The grains to which a grain is bonded, in words.
fn partners(bonds: &Bonds, grain: usize) -> String {
    let bonded = bonds.pair.iter().enumerate().filter_map(|(bond, pair)| {
        let [i, j] = pair.map(|grain| grain as usize);
        let other = if i == grain { j } else { i };
        (i == grain || j == grain).then(|| format!("{other} (bond {bond})"))
    });
    let bonded: Vec<String> = bonded.collect();
    if bonded.is_empty() {
        format!("grain {grain} has no bonds")
    } else {
        format!("grain {grain} has bonds with {}", bonded.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bond_is_a_number_or_two_grains() {
        let read = |text: &str| text.parse::<Which>().ok();
        assert_eq!(read("12"), Some(Which::Number(12)));
        assert_eq!(read("3,17"), Some(Which::Grains([3, 17])));
        assert_eq!(read("3, 17"), Some(Which::Grains([3, 17])));
        for wrong in ["", "3,", "3,top", "-1", "1.5", "3-17", "1,2,3"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
