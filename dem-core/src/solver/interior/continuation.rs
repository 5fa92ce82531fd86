//! Arc-length continuation of the central path through its folds, by predictor and corrector.
//!
//! With θ = ln τ the points of the path are the zeros of
//!
//! ℓ = q + W r + C (r − r₀) + (r − r_a)/ρ − Σ Bᵀ z,     p = x − G r̂,     (x, z) = [`pair`]\(w, τ),
//!
//! in the unknowns r and w. The Newton step and the tangent are two right sides of one matrix
//! ([`System`]):
//!
//! (W + C + ρ⁻¹) dr − Σ Bᵀ dz = −ℓ,     Arw(z) G dr + Arw(x) dz = z ∘ p + τ e dθ,
//!
//! dw = G dr − p − dz.
//!
//! For Coulomb's law the path need not be monotone in the barrier (Acary, Armand, Nguyen &
//! Shpakovych 2024). At a fold the matrix is singular and its determinant changes sign. The sign
//! orients the path: the barrier falls if the sign is positive, and rises if it is negative. Near a
//! fold a few contacts change by large factors while the others hardly change. There the component
//! that changes fastest is the parameter of the path (Rheinboldt, SIAM J. Numer. Anal. 17, 1980);
//! elsewhere the barrier is.

use super::cones::{Point, dot, moved, product};
use super::pairs::{largest, pair};
use super::sites::Sites;
use super::state::State;
use super::system::System;
use crate::solver::tuning::{SHORTEST, continuation as tuning};

/// A point next to the path, or a change of it.
#[derive(Clone, Debug)]
struct PathPoint {
    /// Reactions without the shift, of all rows.
    r: Vec<f64>,
    /// x − z of all pairs.
    w: Vec<Point>,
    /// ln τ.
    theta: f64,
}

/// The component that the corrector keeps constant.
#[derive(Clone, Copy, Debug)]
enum Parameter {
    Barrier,
    /// A linear form of the change of one w.
    Component(usize, Point),
}

/// A step along the tangent at a point of the path.
#[derive(Clone, Debug)]
struct Predictor {
    from: PathPoint,
    tangent: PathPoint,
    /// Relative change of the barrier.
    length: f64,
}

/// Result of an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// The path continues.
    Path,
    /// The barrier falls below that of the start, and no component changes much faster than the
    /// barrier.
    Straight,
    /// No point of the path was found, or the steps have become too short.
    Lost,
}

/// The state of a continuation.
#[derive(Debug)]
pub(super) struct Continuation {
    at: PathPoint,
    parameter: Parameter,
    predictor: Option<Predictor>,
    /// Newton steps since the predictor, and the relative length of the first.
    corrections: u32,
    first_error: f64,
    /// Longest relative change in the next step along the tangent.
    length: f64,
    /// The path counts as straight below this ln τ, and up to this relative change per unit of θ.
    end: f64,
    straight: f64,
    /// Whether the start of the step along the tangent is corrected again, since the correction of
    /// its end failed.
    correct_start: bool,
}

impl PathPoint {
    fn advance(&mut self, length: f64, by: &Self) {
        self.r.iter_mut().zip(&by.r).for_each(|(r, d)| *r += length * d);
        self.w.iter_mut().zip(&by.w).for_each(|(w, d)| *w = moved(w, length, d));
        self.theta += length * by.theta;
    }

    /// The component of a change that is largest relative to this point, and its size.
    fn fastest(&self, change: &Self) -> (Parameter, f64) {
        let barrier = self.theta.exp();
        let mut found = (Parameter::Barrier, 0.0);
        for (c, (w, d)) in self.w.iter().zip(&change.w).enumerate() {
            let (form, size) = largest(w, barrier, d);
            if size > found.1 || size.is_nan() {
                found = (Parameter::Component(c, form), size);
            }
        }
        found
    }
}

impl Continuation {
    /// Start from a point next to the path, with `raised` times the complementarity gap as the
    /// barrier. The path counts as straight if the barrier is below half the gap and no component
    /// changes by more than `straight` per unit of θ.
    pub fn new(point: &State, gap: f64, raised: f64, straight: f64) -> Self {
        let w = point.x.iter().zip(&point.z).map(|(x, z)| moved(x, -1.0, z)).collect();
        Self {
            at: PathPoint { r: point.r.clone(), w, theta: (raised * gap).ln() },
            parameter: Parameter::Barrier,
            predictor: None,
            corrections: 0,
            first_error: 0.0,
            length: tuning::LONGEST,
            end: (0.5 * gap).ln(),
            straight,
            correct_start: false,
        }
    }

    /// The current pairs.
    pub fn state(&self) -> State {
        let barrier = self.at.theta.exp();
        let (x, z) = self.at.w.iter().map(|w| pair(w, barrier)).unzip();
        State { r: self.at.r.clone(), x, z }
    }

    /// Whether the current point is the end of a step along the tangent. Others are corrections,
    /// far from the path where it has been lost.
    pub fn is_on_path(&self) -> bool {
        self.predictor.is_some() && self.corrections == 0
    }

    /// One iteration, with the system at the current pairs: a Newton step and, if that is short, a
    /// step along the tangent.
    pub fn step(&mut self, system: &System, sites: &Sites) -> Progress {
        let (mut newton, tangent) = directions(system, sites, self.at.theta.exp());
        if let Parameter::Component(c, form) = self.parameter {
            let rise = -dot(&form, &newton.w[c]) / dot(&form, &tangent.w[c]);
            newton.advance(rise, &tangent);
        }
        let error = self.at.fastest(&newton).1.max(newton.theta.abs());
        if self.corrections == 0 {
            self.first_error = error;
        }
        if error > tuning::ON_PATH || error.is_nan() {
            return self.correct(error, &newton);
        }
        self.at.advance(1.0, &newton);
        self.predict(tangent, system.sign > 0.0)
    }

    /// A Newton step alone. Too many of them mean that the start of the step along the tangent is
    /// not on the path, or that this step is too long. The start is corrected again first; then the
    /// step is repeated, shorter.
    fn correct(&mut self, error: f64, newton: &PathPoint) -> Progress {
        self.corrections += 1;
        let most = if self.predictor.is_some() { tuning::CORRECTIONS } else { tuning::FIRST_CORRECTIONS };
        if self.corrections <= most && error.is_finite() {
            self.at.advance((tuning::LONGEST_CORRECTION / error).min(1.0), newton);
            return Progress::Path;
        }
        self.length *= tuning::SHORTER;
        self.corrections = 0;
        let Some(predictor) = self.predictor.as_mut().filter(|_| self.length >= SHORTEST) else {
            return Progress::Lost;
        };
        self.correct_start = !self.correct_start;
        if self.correct_start {
            self.at = predictor.from.clone();
            self.parameter = Parameter::Barrier;
        } else {
            predictor.length *= tuning::SHORTER;
            self.at = predictor.end();
        }
        Progress::Path
    }

    /// A step along the tangent, `to_lower_barrier` or to a higher one.
    fn predict(&mut self, tangent: PathPoint, to_lower_barrier: bool) -> Progress {
        // the error of a step grows with the square of its length
        if !std::mem::take(&mut self.correct_start) {
            let factor = (tuning::AIM / self.first_error).sqrt().clamp(tuning::SHORTER, 2.0);
            self.length = (factor * self.length).min(tuning::LONGEST);
        }
        self.corrections = 0;
        let (fastest, size) = self.at.fastest(&tangent);
        self.parameter = if to_lower_barrier && size <= tuning::SLOW { Parameter::Barrier } else { fastest };
        let length =
            if to_lower_barrier { -(self.length / size).min(1.0 - tuning::STEEPEST) } else { self.length / size };
        let predictor = Predictor { from: self.at.clone(), tangent, length };
        self.at = predictor.end();
        self.predictor = Some(predictor);
        if to_lower_barrier && size <= self.straight && self.at.theta < self.end {
            Progress::Straight
        } else {
            Progress::Path
        }
    }
}

impl Predictor {
    /// The end of the step; w is nearly linear in τ.
    fn end(&self) -> PathPoint {
        let mut at = self.from.clone();
        at.advance(self.length, &self.tangent);
        at.theta = self.from.theta + self.length.ln_1p();
        at
    }
}

/// The Newton step at fixed barrier, and the tangent for dθ = 1.
fn directions(system: &System, sites: &Sites, barrier: f64) -> (PathPoint, PathPoint) {
    let at = system.at;
    let misfit = misfit(sites, at);
    let by: Vec<Point> = at.z.iter().zip(&misfit).map(|(z, p)| product(z, p)).collect();
    let newton = system.solved(&system.right, &by);
    let tangent = system.solved(&vec![0.0; newton.r.len()], &vec![[barrier, 0.0, 0.0]; at.x.len()]);
    let w = |step: &State, c: usize| moved(&step.x[c], -1.0, &step.z[c]);
    let corrected = (0..misfit.len()).map(|c| moved(&w(&newton, c), -1.0, &misfit[c])).collect();
    let along = (0..misfit.len()).map(|c| w(&tangent, c)).collect();
    (PathPoint { r: newton.r, w: corrected, theta: 0.0 }, PathPoint { r: tangent.r, w: along, theta: 1.0 })
}

/// x − G r̂ of all pairs.
fn misfit(sites: &Sites, at: &State) -> Vec<Point> {
    let reached = sites.primal(&at.r);
    at.x.iter().zip(&reached).map(|(x, reached)| moved(x, -1.0, reached)).collect()
}
