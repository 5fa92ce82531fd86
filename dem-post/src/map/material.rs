//! Colours of the materials of grains, where a scene has several.

use dem_history::History;

use super::legend::Key;
use super::scale::{Colour, mixed};
use crate::output::Result;

/// Pale fills of the materials, in the order of their list; further ones have the last.
const FILLS: [&str; 6] = ["#f0f0f0", "#b9dcf2", "#f6d9a0", "#a9dfc8", "#ecc5db", "#f2eb9c"];
/// The same in the page of a report, whose style says them for a light and a dark screen.
const IN_PAGE: [&str; 6] =
    ["var(--grain)", "var(--grain-1)", "var(--grain-2)", "var(--grain-3)", "var(--grain-4)", "var(--grain-5)"];
/// Share of white in the fill of a grain that lost a bond.
const RELEASED: f64 = 0.7;

/// The materials of a sample with several.
pub struct Materials {
    /// The material of each grain.
    pub of: Vec<u8>,
    names: Vec<String>,
}

impl Materials {
    /// Those of a history; `None` for grains of one material.
    ///
    /// # Errors
    /// Those of reading the history.
    pub fn read(history: &History) -> Result<Option<Self>> {
        let (of, names) = (history.grains()?.material, history.materials()?);
        let several = of.iter().any(|material| *material != of[0]);
        Ok(several.then_some(Self { of, names }))
    }

    /// The fills of all grains: those of `materials`, or `plain` where there is one material.
    pub fn fills(materials: Option<&Self>, grains: usize, plain: &'static str) -> Vec<Colour> {
        (0..grains).map(|grain| materials.map_or(plain, |materials| materials.fill(grain)).into()).collect()
    }

    /// The fill of a grain.
    pub fn fill(&self, grain: usize) -> &'static str {
        fill(usize::from(self.of[grain]))
    }

    /// The fill of a grain that lost a bond.
    pub fn released(&self, grain: usize) -> Colour {
        mixed(self.fill(grain), RELEASED)
    }

    /// Number of the colour and name of each material that grains have; materials of one colour
    /// have one entry.
    pub fn named(&self) -> Vec<(usize, String)> {
        let mut found: Vec<(usize, String)> = vec![];
        let there = |material: &usize| self.of.iter().any(|of| usize::from(*of) == *material);
        for material in (0..self.names.len()).filter(there) {
            let (colour, name) = (material.min(FILLS.len() - 1), &self.names[material]);
            match found.iter_mut().find(|(other, _)| *other == colour) {
                Some((_, names)) => *names += &format!(", {name}"),
                None => found.push((colour, name.clone())),
            }
        }
        found
    }

    /// Number of the colour of each grain.
    pub fn colours(&self) -> Vec<u8> {
        self.of.iter().map(|material| (*material).min(FILLS.len() as u8 - 1)).collect()
    }

    /// The entries of the legend of the page: its colours and texts.
    pub fn in_page(&self) -> Vec<(&'static str, String)> {
        self.named().into_iter().map(|(colour, name)| (IN_PAGE[colour], name)).collect()
    }

    /// The entries of a legend, with this outline of the grains.
    pub fn keys(&self, outline: &'static str) -> Vec<Key> {
        self.named().into_iter().map(|(colour, name)| Key::Disk(FILLS[colour], outline, name)).collect()
    }
}

fn fill(material: usize) -> &'static str {
    FILLS[material.min(FILLS.len() - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_material_with_grains_has_a_colour_and_an_entry() {
        let names = ["base", "cement", "steel", "a", "b", "c", "d"].map(String::from).to_vec();
        let some = Materials { of: vec![2, 0, 2], names: names.clone() };
        assert_eq!([0, 1].map(|grain| some.fill(grain)), [FILLS[2], FILLS[0]]);
        assert_eq!(some.named(), [(0, "base".into()), (2, "steel".into())]);
        assert!(*some.released(0) > *some.fill(0));
        let all = Materials { of: (0..7).collect(), names };
        assert_eq!(all.named().last(), Some(&(5, "c, d".to_string())));
    }
}
