//! Every constant of the solvers: what it is, where it comes from, and what was measured of it.
//!
//! Constants have no unit unless one is given. "Ablation" is the table of
//! docs/decisions/0035-constants.md: ten unlike scenes, each heuristic left out in turn. Code of
//! the solvers has no other numbers than 0, ½, 1 and 2 (`scripts/check_constants`).

/// The stages of the default solver.
pub(super) mod stages {
    /// Penalty ρ of Newton's proximal iteration, over the inverse of the mean normal entry of W.
    /// With 1e6 a residual of 1e-10 was a load error of 3e-4 on a column of 2,000 disks, with 1e9
    /// of 3e-8 (decision 7).
    pub const KAPPA: f64 = 1e9;
    /// Most sweeps over dry contacts that aim at the tolerance. A dry step that converges takes
    /// some hundred (docs/cost.md).
    pub const FINE_SWEEPS: u64 = 2_000;
    /// Most sweeps over dry contacts after those, which aim at what is accepted.
    pub const COARSE_SWEEPS: u64 = 20_000;
    /// Most sweeps from where the interior-point method ended short of the tolerance.
    pub const LAST_SWEEPS: u64 = 2_000;
}

/// Gauss–Seidel, plain and accelerated (decision 9).
pub(super) mod gauss_seidel {
    /// Plain sweeps before the acceleration begins: easy problems need no more.
    pub const PLAIN: u64 = 32;
    /// Sweeps between two accelerated steps.
    pub const BURST: u64 = 4;
    /// Accelerated steps between two evaluations of the residual.
    pub const LOOK: u64 = 4;
    /// Anderson's acceleration starts over where a residual is larger than this many times the
    /// least one so far.
    pub const GROWTH: f64 = 2.0;
    /// Share of the trace that keeps Anderson's least-squares matrix positive definite where
    /// changes are alike: some thousand units of rounding.
    pub const RIDGE: f64 = 1e-12;
    /// Most repetitions of the predictor–corrector in one visit of a contact; the next sweep goes
    /// on.
    pub const ROUNDS: usize = 100;
    /// Square of the relative change of a reaction at which these repetitions end: some units of
    /// rounding.
    pub const UNCHANGED: f64 = 1e-30;
}

/// Newton's method from an active set (decision 7).
pub(super) mod newton {
    /// Sweeps of Gauss–Seidel that correct the active set of the last step, in 2D.
    pub const SWEEPS: usize = 5;
    /// Sweeps that look for a first active set where no reactions are known.
    pub const COLD_SWEEPS: usize = 100;
    /// Most factorisations of a solve: the interior-point method takes 8 to 20.
    pub const MOST_FACTORISATIONS: u64 = 8;
    /// Most iterations of one inner problem.
    pub const MOST_ITERATIONS: u64 = 30;
    /// Share of ‖F‖ that the step to the active set of the last solve may leave, where that is more
    /// than the contacts push. Where that active set holds but for a few contacts it leaves 1e-5 to
    /// 1e-10, else 1e-4 to 10: three failures of four end after one factorisation in place of four
    /// (ablation).
    pub const LEFT_BY_GUESS: f64 = 1e-3;
    /// An iteration makes progress where it brings ‖F‖ below this share of its value at the last
    /// progress; so many without progress end an inner problem. (For the line search of Coulomb's
    /// law, the share that a whole step must reach.)
    pub const PROGRESS: f64 = 0.9;
    pub const PATIENCE: u64 = 3;
    /// Growth of ‖F‖ over its least value at which an inner problem diverges.
    pub const DIVERGED: f64 = 1e6;
    /// Share of the tolerances of a solve that ‖F‖ may take.
    pub const SHARE: f64 = 0.1;
    /// Units of rounding of ρ u and of the reactions that ‖F‖ cannot fall below.
    pub const ROUNDING: f64 = 4.0 * f64::EPSILON;
    /// How often the penalty may be lowered in one solve, and by which factor: fast contacts are
    /// rounded by ρ u.
    pub const MOST_SOFTENED: u32 = 4;
    pub const SOFTENED: f64 = 100.0;
    /// Relative distance to a limit that counts as at it, where an active set is read off
    /// reactions.
    pub const BEYOND: f64 = 1e-9;
    /// What a linear solve may leave of its right side: the least, and the largest where it may be
    /// the last one and where another follows.
    pub const TIGHT: f64 = 1e-12;
    pub const FAIR: f64 = 1e-3;
    pub const LOOSE: f64 = 1e-2;
    /// What a linear solve with new factors may leave before its step counts as none.
    pub const LOST: f64 = 0.1;
    /// Most rounds of refinement of a linear solve, and the share to which each must bring what is
    /// left: else the factors are too old.
    pub const MOST_REFINED: usize = 8;
    pub const REFINED: f64 = 0.5;
    /// The line search of an associated problem ends where the slope has fallen to this share of
    /// its first value (regula falsi).
    pub const FLAT: f64 = 0.1;
}

/// Steps without a solve (decision 30).
pub(super) mod extrapolation {
    /// Consecutive steps that are extrapolated between two solves: at first, and at most.
    pub const FIRST: u64 = 4;
    pub const MOST: u64 = 32;
    /// Share of the tolerances that an extrapolated step may take, and how much more momentum it
    /// may leave than the solve before it.
    pub const SHARE: f64 = 1e-2;
    pub const MORE: f64 = 2.0;
    /// By how much a solve may differ from what was extrapolated: over what the reactions have
    /// grown by, and over the reactions.
    pub const SAME: f64 = 1e-6;
    pub const ROUNDING: f64 = 1e-12;
    /// Most solves for which an extrapolation that failed is not tried again.
    pub const LONGEST_REST: u64 = 64;
}

/// The reactions that those of a step are measured from.
pub(super) mod history {
    /// Size of H̃ ρ H̃ᵀ over the identity that is added to it, so that a body without a bond is no
    /// singularity. The square root of rounding; one round of refinement removes the effect of the
    /// identity.
    pub const STIFF: f64 = 1e8;
}

/// Where the interior-point method begins.
pub(super) mod start {
    /// How far inside its cone a start is moved, over the mean reaction, and the least x·z of a
    /// pair over the gap. A thousandth fails on some of thirty problems, a tenth on none.
    pub const INSIDE: f64 = 0.1;
}

/// The direction of a predictor–corrector iteration, and its length.
pub(super) mod direction {
    /// Least centring, as a share of the gap. With 0.01, or with the share that the predictor
    /// leaves, solves take as many iterations.
    pub const CENTRING: f64 = 0.1;
    /// Most of Gondzio's correctors in an iteration. They save most where a problem is hard (28 to
    /// 16 iterations); a third adds nothing.
    pub const CORRECTORS: usize = 2;
    /// By how much longer than possible a step is tried for a corrector, the share by which it must
    /// grow to be taken, and how far products may be from the barrier, as a factor (Gondzio 1996).
    pub const LONGER: f64 = 0.3;
    pub const GROWN: f64 = 1.05;
    pub const APART: f64 = 10.0;
    /// A step shorter than this turns towards the middle, by these shares of the gap, where it
    /// grows by this factor.
    pub const SHORT: f64 = 0.5;
    pub const TO_THE_MIDDLE: [f64; 2] = [0.2, 0.7];
    pub const WORTH: f64 = 1.5;
    /// Least product of a pair over the gap that a point may have: a wide neighbourhood of the
    /// central path.
    pub const CENTRAL: f64 = 1e-3;
    /// How near the boundary of the cones a step may go, over the way to it.
    pub const TO_THE_BOUNDARY: f64 = 0.99;
    /// By which factor a step is shortened until its end is central, and the shortest.
    pub const SHORTER: f64 = 0.8;
    pub const SHORTEST: f64 = 1e-3;
}

/// When the central path is followed by arc length (decision 33).
pub(super) mod follow {
    /// The path jams after so many steps in a row in which the gap has not fallen by this share.
    /// Two are too few, where a step goes towards the middle of the cones; with the length of steps
    /// in place of the gap, a path may go to and fro for 300 iterations.
    pub const PROGRESS: f64 = 0.1;
    pub const JAMMED: u32 = 3;
    /// By how much the barrier is above the gap of a jam where the path is looked for, and how
    /// often it is raised so.
    pub const RAISED: f64 = 10.0;
    pub const MOST_RAISED: i32 = 2;
    /// Relative change with θ up to which the path counts as straight; after each jam it is
    /// multiplied by the second.
    pub const STRAIGHT: f64 = 4.0;
    pub const STRAIGHTER: f64 = 0.5;
}

/// The continuation by arc length (decision 33: 193 to 245 factorisations for the folds of spheres
/// with every setting that was tried).
pub(super) mod continuation {
    /// Relative length of a Newton step up to which a point counts as on the path, and to which a
    /// longer one is shortened.
    pub const ON_PATH: f64 = 0.3;
    pub const LONGEST_CORRECTION: f64 = 5.0;
    /// Longest and shortest relative change in a step along the tangent, and the length of the next
    /// Newton step that it aims at.
    pub const LONGEST: f64 = 0.9;
    pub const SHORTEST: f64 = 1e-3;
    pub const AIM: f64 = 0.15;
    /// Share of the barrier that a step leaves at least.
    pub const STEEPEST: f64 = 1e-2;
    /// Relative change with θ of the fastest component up to which the barrier is the parameter.
    pub const SLOW: f64 = 0.2;
    /// Newton steps after which a step along the tangent is made again, shorter by this factor;
    /// Newton steps that look for a first point.
    pub const CORRECTIONS: u32 = 5;
    pub const FIRST_CORRECTIONS: u32 = 15;
    pub const SHORTER: f64 = 0.3;
}

/// Which of many reactions (decision 34).
pub(super) mod selection {
    /// Stiffness of the metric over the inverse of the mean normal entry of W. With 1e7 the
    /// reactions after an avalanche are 5e-5 from those of stiff contacts, which moves the load of
    /// one sample of ten by 20 %, and the compliance shows in three solves of four. With 1e8 and
    /// velocities in one precision rounding decides; with 1e9 and twice the precision loads agree
    /// to 1e-3 (decision 35).
    pub const KAPPA: f64 = 1e9;
    /// Share of the tolerance that the compliance may take: below 1e-8 the metric is stiffer. The
    /// stiffest: with no compliance the path wanders among the reactions that balance themselves.
    pub const SHARE: f64 = 0.1;
    pub const STIFFEST: f64 = 1e12;
    /// Gaps of all pairs over the energy of the metric at which the reactions of least energy are
    /// known, and the least energy that counts, over Σ r²/ρ. A thousandth left reactions 3 % from
    /// them.
    pub const LEAST: f64 = 1e-5;
    /// Gaps of all pairs over the energy of the metric at which the point is kept from which the
    /// path is followed again: with another anchor a path whose gaps are far smaller is another
    /// one.
    pub const BACK: f64 = 0.03;
    /// Share of its compliance that a metric keeps each time it is anchored again after the first,
    /// and how often that is done.
    pub const HARDER: f64 = 0.01;
    pub const MOST_ANCHORED: u32 = 5;
    /// Share of the tolerances that the compliance may take before the metric is anchored again.
    pub const SHOWS: f64 = 0.5;
    /// Gap, over the square of the unit of reactions, below which only rounding changes.
    pub const LEAST_GAP: f64 = 1e-26;
    /// How near a limit a reaction must be, over itself, to be at one that is known.
    pub const BESIDE: f64 = 1e-6;
}

/// The least violation of a problem without a solution (docs/theory/interior-point.md, "What has no
/// solution").
pub(super) mod violation {
    /// W over the compliance, and how often q is moved on: each time H̃ d falls by this factor,
    /// down to 1e-12 of d.
    pub const KAPPA: f64 = 1e8;
    pub const ROUNDS: usize = 3;
    /// Most iterations of a round, and the gap at which it ends, over the square of the unit of
    /// reactions.
    pub const MOST: usize = 100;
    pub const LEAST_GAP: f64 = 1e-18;
}

/// The check of what is proved of a problem.
pub(super) mod certificate {
    /// Largest net impulse of a certificate on a body, over its largest impulse, and least −q·d
    /// over the sizes of its summands. A solution would need velocities of the order of 1/`EXACT`
    /// times those at which the contacts close.
    pub const EXACT: f64 = 1e-10;
    /// How far inside K* velocities are asked to be, over the largest given velocity, and the share
    /// of it that counts as inside.
    pub const MARGIN: f64 = 1e-6;
    pub const INSIDE: f64 = 0.5;
    /// Share of the largest impulse from which a contact counts among those of a certificate.
    pub const CARRIES: f64 = 1e-3;
    /// Where an impulse is put on its cone it is put inside it by this, so that rounding does not
    /// put it outside.
    pub const ROUNDING: f64 = 4.0 * f64::EPSILON;
}
