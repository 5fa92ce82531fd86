//! Reading the bonds of a history.

use std::ops::Range;

use super::{History, pairs};
use crate::codes::{BondCode, BondStatus};
use crate::error::Result;
use crate::model::{Bonds, NOT_FORMED};
use crate::schema::path;
use crate::sound;

impl History {
    /// The bonds as they were formed; empty for a scene without any.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`](crate::HistoryError::Damaged).
    pub fn bonds(&self) -> Result<Bonds> {
        if !self.source.has(path::BONDS) {
            return Ok(Bonds::default());
        }
        let place = |name: &str| format!("{}/{name}", path::BONDS);
        let pair = pairs(&self.source.whole::<i32>(&place("pair"), 2)?);
        let unknown = |pair: &[i32; 2]| pair.iter().any(|grain| !(0..self.grains as i32).contains(grain));
        if let Some(bond) = pair.iter().position(unknown) {
            return Err(sound::row(
                &self.source.path,
                &place("pair"),
                bond,
                "a bond refers to a grain that does not exist",
            ));
        }
        let column = |name: &str| self.source.column(&place(name), pair.len());
        let bonds = Bonds {
            rest_gap: column("rest_gap")?,
            strength: column("strength")?,
            friction: column("friction")?,
            rolling: if self.source.has(&place("rolling")) { column("rolling")? } else { Vec::new() },
            twist: if self.source.has(&place("twist")) { Some(column("twist")?) } else { None },
            mean_diameter: column("mean_diameter")?,
            formed: self.bonds_formed()?,
            pair,
        };
        sound::positive(&self.source.path, &place("mean_diameter"), &bonds.mean_diameter)?;
        Ok(bonds)
    }

    /// The step after which a stage formed the bonds, or [`NOT_FORMED`]; none if they are there
    /// from the start.
    ///
    /// # Errors
    /// [`HistoryError::Damaged`](crate::HistoryError::Damaged).
    pub fn bonds_formed(&self) -> Result<Option<i64>> {
        let place = format!("{}/formed", path::BONDS);
        if !self.source.has(&place) {
            return Ok(None);
        }
        match self.source.whole::<i64>(&place, 1)?[..] {
            [formed] if formed >= NOT_FORMED => Ok(Some(formed)),
            _ => Err(self.source.damaged(&place, "it is not one step")),
        }
    }

    /// The state of each bond at frame `frame`; empty for a scene without any, and for a frame
    /// before a stage forms them.
    ///
    /// # Errors
    /// [`HistoryError::NoFrame`](crate::HistoryError::NoFrame),
    /// [`HistoryError::Damaged`](crate::HistoryError::Damaged).
    pub fn bond_status(&self, frame: usize) -> Result<Vec<BondStatus>> {
        self.check_frame(frame)?;
        let place = format!("{}/status/value", path::BONDS);
        if !self.source.has(path::BONDS)
            || self.bonds_formed()?.is_some_and(|step| step == NOT_FORMED || self.steps[frame] <= step)
        {
            return Ok(vec![]);
        }
        let (_, codes) = self.source.read::<BondCode>(&place, frame..frame + 1)?;
        let bonds = self.source.count(&format!("{}/pair", path::BONDS))?;
        self.source.coded(&place, codes, bonds)
    }

    /// The bond of each contact; empty without bonds.
    pub(super) fn bonds_in(&self, range: Range<usize>) -> Result<Vec<i32>> {
        let place = format!("{}/bond", path::CONTACTS);
        if !self.source.has(&place) {
            return Ok(vec![]);
        }
        let bonds: Vec<i32> = self.source.read(&place, range.clone())?.1;
        let known = self.source.count(&format!("{}/pair", path::BONDS))? as i32;
        match bonds.iter().position(|bond| !(-1..known).contains(bond)) {
            Some(k) => {
                let why = format!("{} is not one of the {known} bonds", bonds[k]);
                Err(sound::row(&self.source.path, &place, range.start + k, why))
            }
            None => Ok(bonds),
        }
    }
}
