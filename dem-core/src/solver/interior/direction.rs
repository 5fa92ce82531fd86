//! The direction of a predictor–corrector iteration.

use super::cones::{Point, correction, dot, least_product, moved};
use super::state::{State, gap};
use super::system::System;
use crate::solver::tuning::direction as tuning;

/// The direction of an iteration, and the longest multiple of it inside the cones. It is refined
/// twice. Those that it is chosen from are refined once if `rough`, that is if round-off shows in
/// the directions: where fragments move fast it is as large as the right side, and the length to
/// the boundary of the cones would be arbitrary.
pub(super) fn direction(system: &System, rough: &mut bool) -> (State, f64) {
    let refining = *rough;
    let towards = |by: &[Point]| system.step(by, refining);
    let at = system.at;
    let products = system.products(&at.x, &at.z);
    let gap = gap(at);
    // predictor
    let to_the_end: Vec<Point> = products.iter().map(|p| [-p[0], -p[1], -p[2]]).collect();
    let predictor = towards(&to_the_end);
    let length = system.longest(&predictor).min(1.0);
    let count = at.x.len() as f64;
    let aim = at.x.iter().zip(&at.z).zip(predictor.x.iter().zip(&predictor.z));
    let aim = aim.map(|((x, z), (dx, dz))| dot(&moved(x, length, dx), &moved(z, length, dz))).sum::<f64>() / count;
    let centring = (aim / gap).max(0.0).powi(3).clamp(tuning::CENTRING, 1.0);
    // second-order corrector
    let barrier = centring * gap;
    let second = system.products(&predictor.x, &predictor.z);
    let mut by: Vec<Point> =
        products.iter().zip(&second).map(|(p, s)| [barrier - p[0] - s[0], -p[1] - s[1], -p[2] - s[2]]).collect();
    let mut step = towards(&by);
    let mut far = system.longest(&step);
    for _ in 0..tuning::CORRECTORS {
        let length = (far + tuning::LONGER).min(1.0);
        let ends = |at: &[Point], step: &[Point]| -> Vec<Point> {
            at.iter().zip(step).map(|(x, d)| moved(x, length, d)).collect()
        };
        let products = system.products(&ends(&at.x, &step.x), &ends(&at.z, &step.z));
        let corrected = |(by, v): (&Point, &Point)| {
            moved(by, 1.0, &correction(v, barrier / tuning::APART, barrier * tuning::APART))
        };
        let more: Vec<Point> = by.iter().zip(&products).map(corrected).collect();
        let other = towards(&more);
        let reached = system.longest(&other);
        if reached <= tuning::GROWN * far {
            break;
        }
        (step, far, by) = (other, reached, more);
    }
    let mut chosen = by;
    if far < 0.5 {
        // a short step: try directions towards the central path, without the second-order term
        for share in tuning::TO_THE_MIDDLE {
            let barrier = share.max(centring) * gap;
            let by: Vec<Point> = products.iter().map(|p| [barrier - p[0], -p[1], -p[2]]).collect();
            let other = towards(&by);
            let reached = system.longest(&other);
            if reached > tuning::WORTH * far {
                (step, far) = (other, reached);
                chosen = by;
            }
        }
    }
    let more = system.refine(&mut step, &chosen);
    *rough = system.longest(&more) < 1.0 / tuning::ROUGH;
    if !refining {
        system.refine(&mut step, &chosen);
    }
    let far = system.longest(&step);
    (step, far)
}

/// Whether no product of a pair is far below the complementarity gap.
pub(super) fn is_central(at: &State) -> bool {
    let least = tuning::CENTRAL * gap(at);
    at.x.iter().zip(&at.z).all(|(x, z)| least_product(x, z) >= least)
}

/// Whether round-off hides if a point is [central](is_central).
pub(super) fn is_rounded(at: &State) -> bool {
    let largest = at.x.iter().zip(&at.z).map(|(x, z)| x[0] * z[0]).fold(0.0, f64::max);
    f64::EPSILON * largest > tuning::CENTRAL * gap(at)
}

/// Advance a point along a step.
pub(super) fn advance(at: &mut State, length: f64, step: &State) {
    at.r.iter_mut().zip(&step.r).for_each(|(r, d)| *r += length * d);
    at.x.iter_mut().zip(&step.x).for_each(|(x, d)| *x = moved(x, length, d));
    at.z.iter_mut().zip(&step.z).for_each(|(z, d)| *z = moved(z, length, d));
}
