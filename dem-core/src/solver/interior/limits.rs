//! The limits of the bonds that a point has reached.

use super::cones::eigenvalues;
use super::sites::{ROWS, Site, Sites};
use super::state::State;
use crate::contact::{Padded, Reached};
use crate::solver::tuning::selection as tuning;

/// Whether a reaction is at the apex of its cone, or on its side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limit {
    pub apex: bool,
    pub side: bool,
}

impl Sites {
    /// The limits that the reactions have reached. For each row z over the compliance is the
    /// distance beyond a limit; the reaction is at the limit if this exceeds x, the distance
    /// inside.
    pub(super) fn limits(&self, at: &State, compliance: &[f64]) -> Vec<Limit> {
        let mut limits = vec![Limit::default(); self.cones.len()];
        for site in &self.list {
            for c in site.cones.clone() {
                let (x, z) = (eigenvalues(&at.x[c]), eigenvalues(&at.z[c]));
                let soft = compliance[site.at + self.cones[c].rows[0]];
                limits[c] = Limit { apex: soft * x[0] < z[1], side: soft * x[1] < z[0] };
            }
        }
        limits
    }

    /// Which of the `known` limits of a cone are within the relative distance `most` of x.
    fn near(&self, at: &State, c: usize, shift: f64, known: &[Limit], most: f64) -> Limit {
        let (x, cone) = (eigenvalues(&at.x[c]), &self.cones[c]);
        let known = known.get(c).copied().unwrap_or_default();
        let apex = known.apex && cone.acts_on_normal && at.x[c][0] <= most * cone.slope * shift;
        Limit { apex, side: known.side && cone.tangents > 0 && x[1] <= most * x[0] }
    }

    /// For each contact, which part of the limits that r* has reached is next to x.
    pub(super) fn reached(&self, at: &State, known: &[Limit]) -> Vec<Option<Reached>> {
        let one = |(site, shift): (&Site, &f64)| {
            let near = |c: usize| self.near(at, c, *shift, known, tuning::REACHED);
            if site.cones.clone().any(|c| near(c).apex) {
                Some(Reached::Apex)
            } else {
                site.cones.clone().any(|c| near(c).side).then_some(Reached::Side)
            }
        };
        self.list.iter().zip(&self.shift).map(one).collect()
    }

    /// The reactions of the problem at a point, projected on a limit if x is nearer to it than z is
    /// to its own, or if the limit is `known` and next to x.
    pub(super) fn snapped(&self, at: &State, known: &[Limit]) -> Vec<Padded> {
        let limit = |c: usize, shift: f64| {
            let (x, z) = (eigenvalues(&at.x[c]), eigenvalues(&at.z[c]));
            let near = self.near(at, c, shift, known, tuning::BESIDE);
            Limit { apex: x[0] < z[1] || near.apex, side: x[1] < z[0] || near.side }
        };
        let one = |(site, shift): (&Site, &f64)| {
            let mut own = [0.0; ROWS];
            own[..site.rows].copy_from_slice(site.part(&at.r));
            if site.cones.clone().any(|c| self.cones[c].acts_on_normal && limit(c, *shift).apex) {
                // at the apex: the shifted reaction is zero
                own = [0.0; ROWS];
                own[0] = -shift;
            } else {
                for c in site.cones.clone().filter(|c| self.cones[*c].tangents > 0 && limit(*c, *shift).side) {
                    let cone = &self.cones[c];
                    let x = cone.primal(&own);
                    let length = x[1].hypot(x[2]);
                    let scale = if length > 0.0 { cone.slope * (own[0] + shift) / length } else { 1.0 };
                    cone.rows[..cone.tangents].iter().for_each(|row| own[*row] *= scale);
                }
            }
            self.padded(site, &own[..site.rows])
        };
        self.list.iter().zip(&self.shift).map(one).collect()
    }
}
