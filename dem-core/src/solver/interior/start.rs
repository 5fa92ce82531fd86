//! Start points of the central path, cold and warm.

use super::cones::least_product;
use super::coupling::Coupling;
use super::sites::Sites;
use super::state::{State, gap};
use crate::solver::tuning::start as tuning;

/// Cold start: reactions well inside their cones, or `far` inside, and velocities as large as the
/// free ones.
pub(super) fn cold(sites: &Sites, far: bool) -> State {
    // the largest reaction that stops the bodies of one contact: far larger than the unit where
    // masses differ
    let stopping = sites.list.iter().zip(&sites.normal).filter(|(_, normal)| **normal > 0.0).map(|(site, normal)| {
        let square = site.part(&sites.free).iter().map(|u| u * u).sum::<f64>();
        square.sqrt() / normal
    });
    let largest = sites.shift.iter().copied().chain(stopping).fold(1.0, f64::max);
    let inside = tuning::INSIDE * if far { tuning::FAR * largest } else { largest };
    let mut r = vec![0.0; sites.rows];
    for (site, shift) in sites.list.iter().zip(&sites.shift) {
        site.part_mut(&mut r)[0] = (inside - shift).max(0.0);
    }
    let speed = (0..sites.rows).map(|row| sites.asked(row)).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    State { x: sites.primal(&r), r, z: vec![[speed, 0.0, 0.0]; sites.cones.len()] }
}

/// Warm start: reactions moved inside their cones, and the velocities that they give likewise.
pub(super) fn warm(sites: &Sites, coupling: &Coupling, reactions: &[f64]) -> State {
    let count = sites.list.len() as f64;
    let mean = (reactions.iter().map(|r| r * r).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE);
    let mut r = reactions.to_vec();
    for (site, shift) in sites.list.iter().zip(&sites.shift) {
        let own = site.part_mut(&mut r);
        let needs = |c: usize| {
            let cone = &sites.cones[c];
            let x = cone.primal(own);
            x[1].hypot(x[2]) / cone.slope
        };
        let least = site.cones.clone().map(needs).fold(0.0, f64::max);
        own[0] = own[0].max(least - shift) + tuning::INSIDE * mean;
    }
    let moving = coupling.velocity(sites, &r);
    let mut z = vec![[0.0; 3]; sites.cones.len()];
    for site in &sites.list {
        let velocity: Vec<f64> = (site.at..site.at + site.rows).map(|k| sites.free[k] + moving[k]).collect();
        for c in site.cones.clone() {
            let cone = &sites.cones[c];
            z[c] = cone.primal(&velocity);
            z[c][0] =
                tuning::INSIDE * mean + if cone.tangents == 0 { z[c][0].max(0.0) } else { z[c][1].hypot(z[c][2]) };
        }
    }
    let mut at = State { x: sites.primal(&r), r, z };
    let least = tuning::INSIDE * gap(&at);
    for (x, z) in at.x.iter().zip(&mut at.z) {
        while least_product(x, z) < least {
            z[0] *= 2.0;
        }
    }
    at
}
