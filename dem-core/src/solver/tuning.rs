//! All constants of the solvers, with their origin and the measurements behind them.
//!
//! Constants have no unit unless one is given. "Ablation" is the table of
//! docs/decisions/0035-constants.md: ten different scenes, each heuristic disabled in turn. Solver
//! code contains no numbers but 0, ½, 1 and 2 (`scripts/check_constants`).

/// Units of round-off: the lower bound of an error, and the distance by which a value that must not
/// be outside a cone is moved inside.
pub(super) const ROUND_OFF: f64 = 4.0 * f64::EPSILON;
/// Thousands of units of round-off: relative size below which a change or a regularisation does not
/// show.
pub(super) const INVISIBLE: f64 = 1e-12;
/// Inverse square root of round-off: the ratio of the sizes of two terms of which neither may take
/// the digits of the other.
pub(super) const STIFF: f64 = 1e8;
/// Penalty ρ of Newton's proximal iteration and stiffness of the metric of the stiff limit,
/// relative to 1/(mean normal entry of W). On a column of 2,000 disks a residual of 1e-10 meant a
/// load error of 3e-4 with 1e6, and of 3e-8 with 1e9 (decision 7). As the metric 1e7 left the
/// reactions after an avalanche 5e-5 from those of stiff contacts, which changes the load of one
/// sample of ten by 20 %, and the compliance shows in three solves of four. With 1e8 and velocities
/// in plain double precision round-off decides; with 1e9 and twice the precision loads agree to
/// 1e-3 (decision 35).
pub(super) const KAPPA: f64 = 1e9;
/// Share of a tolerance allowed for one of the errors of a solve; also the relative residual above
/// which a linear solve with new factors has failed.
pub(super) const SHARE: f64 = 0.1;
/// An iteration makes progress if it brings its error below this share of the error at the last
/// progress. A method ends, or changes, after `PATIENCE` iterations without progress. (Two steps
/// along the path are too few, since a step may go towards the middle of the cones.)
pub(super) const PROGRESS: f64 = 0.9;
pub(super) const PATIENCE: u64 = 3;
/// Longest step along the path, relative to the step to the boundary of the cones.
pub(super) const TO_THE_BOUNDARY: f64 = 0.99;
/// Shortest step along the path.
pub(super) const SHORTEST: f64 = 1e-3;

/// Defaults of the settings, those of a scene.
pub(super) mod defaults {
    /// Residual that a solver aims at, and the largest that is accepted.
    pub const TOLERANCE: f64 = 1e-8;
    pub const ACCEPT: f64 = 1e-6;
    /// Load error and velocity error that a solver aims at.
    pub const LOAD_TOLERANCE: f64 = 1e-5;
    /// Most iterations of Newton, and of the interior-point method.
    pub const MAX_ITERATIONS: u64 = 300;
    /// Most sweeps of Gauss–Seidel.
    pub const MAX_SWEEPS: u64 = 100_000;
    /// Bending stiffness over the normal one times the square of the mean diameter: a bar as wide
    /// as long has k_m = k_n a²/12.
    pub const ROLLING: f64 = 1.0 / 12.0;
}

/// The stages of the default solver.
pub(super) mod stages {
    /// Most sweeps over dry contacts towards the tolerance. A dry step that converges takes some
    /// hundred (docs/cost.md).
    pub const FINE_SWEEPS: u64 = 2_000;
    /// Most operations of a factorisation, for each contact, with which the direct solvers are
    /// tried where `FINE_SWEEPS` missed the tolerance over dry contacts. Dry packings of 200, 1,000
    /// and 5,000 disks take 2,000, 4,500 and 10,000, and a solve 0.1 to 4 times as long as the
    /// sweeps; flowing 2,000 spheres take 500,000, and a solve 9 to 360 times as long (decision
    /// 49).
    pub const CHEAP: f64 = 1e4;
    /// Most dry contacts for which these operations are counted. Counting takes memory, and larger
    /// plane packings take more than `CHEAP`.
    pub const MOST_FACTORISED: usize = 20_000;
    /// Most interior-point iterations there: most solves take 14 to 30.
    pub const MOST_SHORT: u64 = 50;
    /// Most further sweeps over dry contacts, towards the accepted residual.
    pub const COARSE_SWEEPS: u64 = 20_000;
    /// Visits of a contact in the sweeps from the best point of a path that missed the tolerance,
    /// about a second; at least `FINE_SWEEPS` and at most `COARSE_SWEEPS` sweeps. The residual of a
    /// bent hexagonal beam of 297 disks with friction 0.7 rises and falls for 20,000 sweeps before
    /// it converges.
    pub const LAST_VISITS: u64 = 20_000_000;
}

/// Gauss–Seidel, plain and accelerated (docs/theory/gauss-seidel.md).
pub(super) mod gauss_seidel {
    /// Plain sweeps before the acceleration begins: easy problems need no more.
    pub const PLAIN: u64 = 32;
    /// Sweeps between two accelerated steps, and accelerated steps between two evaluations of the
    /// residual.
    pub const BURST: u64 = 4;
    /// Most repetitions of the predictor–corrector in one visit of a contact; the next sweep
    /// continues.
    pub const ROUNDS: usize = 100;
}

/// Newton's method from an active set (decision 7).
pub(super) mod newton {
    /// Gauss–Seidel sweeps that correct the active set of the last step where it fails, in 2D.
    pub const SWEEPS: usize = 5;
    /// Gauss–Seidel sweeps that estimate the active set in a cold start.
    pub const COLD_SWEEPS: usize = 100;
    /// Most factorisations from one guess of the active set; the interior-point method takes 8 to
    /// 20.
    pub const MOST_FACTORISATIONS: u64 = 8;
    /// Most iterations of one inner problem.
    pub const MOST_ITERATIONS: u64 = 30;
    /// Newton gives up if the step to the active set of the last solve leaves more than this share
    /// of ‖F‖ and more than the load. An active set that is right but for a few contacts leaves
    /// 1e-5 to 1e-10, any other 1e-4 to 10. Three failures of four thus end after one factorisation
    /// instead of four (ablation).
    pub const LEFT_BY_GUESS: f64 = 1e-3;
    /// How often the penalty may be lowered in one solve, and by which factor: the round-off of ρ u
    /// is large for fast contacts.
    pub const MOST_SOFTENED: u32 = 4;
    pub const SOFTENED: f64 = 100.0;
    /// Relative distance to a limit within which a reaction counts as at the limit, when the active
    /// set is derived from reactions.
    pub const BEYOND: f64 = 1e-9;
    /// Largest relative residual allowed for a linear solve: `FAIR` in the first iteration, which
    /// may be the last, and `LOOSE` in later ones.
    pub const FAIR: f64 = 1e-3;
    pub const LOOSE: f64 = 1e-2;
    /// Most refinements of a linear solve.
    pub const MOST_REFINED: usize = 8;
    /// The line search of an associated problem ends where the slope has fallen to this share of
    /// its initial value (regula falsi).
    pub const FLAT: f64 = 0.1;
}

/// Steps without a solve (decision 30).
pub(super) mod extrapolation {
    /// Consecutive extrapolated steps between two solves: initially, and at most.
    pub const FIRST: u64 = 4;
    pub const MOST: u64 = 32;
    /// Share of the tolerances allowed for an extrapolated step.
    pub const SHARE: f64 = 1e-2;
    /// Allowed difference between a solve and its extrapolation, relative to the growth of the
    /// reactions.
    pub const SAME: f64 = 1e-6;
}

/// Start of the interior-point method.
pub(super) mod start {
    /// Distance by which a start is moved inside its cone, relative to the mean reaction; also the
    /// least product of a pair, relative to the complementarity gap. A thousandth fails on some of
    /// thirty problems, a tenth on none.
    pub const INSIDE: f64 = 0.1;
    /// Factor on that distance in a second path: a wall that moves slowly against rigid bonds gives
    /// reactions that are some 1e7 times those that stop the bodies.
    pub const FAR: f64 = 1e3;
}

/// The direction of a predictor–corrector iteration, and its length.
pub(super) mod direction {
    /// Least centring, relative to the complementarity gap. Solves take as many iterations with
    /// 0.01, or with the share that the predictor leaves.
    pub const CENTRING: f64 = 0.1;
    /// Most of Gondzio's correctors in an iteration. They save most in hard problems (16 iterations
    /// instead of 28); a third adds nothing.
    pub const CORRECTORS: usize = 2;
    /// Gondzio's correctors (1996): the trial step is by `LONGER` longer than the possible one; a
    /// corrector is accepted if the step grows by the factor `GROWN`; products may differ from the
    /// barrier parameter by the factor `APART`.
    pub const LONGER: f64 = 0.3;
    pub const GROWN: f64 = 1.05;
    pub const APART: f64 = 10.0;
    /// If less than half of the step is possible, a direction towards the central path is tried,
    /// with these shares of the complementarity gap as the barrier. It is taken if the step grows
    /// by the factor `WORTH`.
    pub const TO_THE_MIDDLE: [f64; 2] = [0.2, 0.7];
    pub const WORTH: f64 = 1.5;
    /// Least product of a pair relative to the complementarity gap: it defines a wide neighbourhood
    /// of the central path.
    pub const CENTRAL: f64 = 1e-3;
    /// Round-off shows in the directions if refinement adds more than this share of the way to the
    /// boundary of some cone. Refining all directions takes up to a sixth more time (decision 36).
    pub const ROUGH: f64 = 1e-6;
    /// Factor by which a step is shortened until its end is central.
    pub const SHORTER: f64 = 0.8;
}

/// When the central path is followed by arc length (decision 33).
pub(super) mod follow {
    /// Factor by which the barrier is raised above the complementarity gap of a jam to find the
    /// path, and how often.
    pub const RAISED: f64 = 10.0;
    pub const MOST_RAISED: i32 = 2;
    /// Relative change per unit of θ up to which the path counts as straight; halved by each jam.
    pub const STRAIGHT: f64 = 4.0;
}

/// The continuation by arc length (decision 33: 193 to 245 factorisations for the folds of spheres
/// with every setting tried).
pub(super) mod continuation {
    /// Relative length of a Newton step up to which a point counts as on the path, and the length
    /// to which a longer step is shortened.
    pub const ON_PATH: f64 = 0.3;
    pub const LONGEST_CORRECTION: f64 = 5.0;
    /// Longest relative change in a step along the tangent, and the target length of the Newton
    /// step after it.
    pub const LONGEST: f64 = 0.9;
    pub const AIM: f64 = 0.15;
    /// Least share of the barrier that remains after a step.
    pub const STEEPEST: f64 = 1e-2;
    /// Relative change of the fastest component per unit of θ, up to which the barrier is the
    /// parameter of the path.
    pub const SLOW: f64 = 0.2;
    /// Most Newton steps after a step along the tangent, which is then repeated, shorter by the
    /// factor `SHORTER`; most Newton steps to a first point of the path.
    pub const CORRECTIONS: u32 = 5;
    pub const FIRST_CORRECTIONS: u32 = 15;
    pub const SHORTER: f64 = 0.3;
}

/// Selection among many reactions (decision 34).
pub(super) mod selection {
    /// The stiffest metric, where any reactions will do and the compliance may take `SHARE` of the
    /// tolerance. A pressed hexagonal block of dry disks takes 82 factorisations to 1e-10 with
    /// `KAPPA`, and at most 30 so.
    pub const STIFFEST: f64 = 1e12;
    /// Sum of the complementarity gaps, relative to the energy of the metric, at which the
    /// minimum-energy reactions are known; also the least energy that counts, relative to Σ r²/ρ,
    /// and the most gaps and energy, relative to the same, with which a jammed path ends. A
    /// thousandth left reactions 3 % from them.
    pub const LEAST: f64 = 1e-5;
    /// The same ratio at which a point is stored, to follow the path again from it with another
    /// anchor. At far smaller gaps the paths of two anchors differ.
    pub const BACK: f64 = 0.03;
    /// Factor on the compliance of the metric at each new anchor (after the first, where the
    /// minimum-energy reactions are required), and the most new anchors.
    pub const HARDER: f64 = 0.01;
    pub const MOST_ANCHORED: u32 = 5;
    /// Complementarity gap, relative to the square of the unit of reactions, below which only
    /// round-off changes.
    pub const LEAST_GAP: f64 = 1e-26;
    /// Relative distance to a known limit within which a bond has reached it: in `compression` 369
    /// of 371 bonds that are at a limit of r* are within 1e-5 of it. Where the compliance leaves a
    /// residual of at most half the default tolerance in r*, the distance of r* counts, else that
    /// of the solution, which may be 5 % away (very unlike masses, random scene 2354).
    pub const REACHED: f64 = 1e-4;
    /// Relative distance to a known limit within which a reaction is put on it, where it meets the
    /// tolerance there.
    pub const BESIDE: f64 = 1e-6;
}

/// The least violation of a problem without a solution (docs/theory/interior-point.md, "What has no
/// solution").
pub(super) mod violation {
    /// Number of multiplier iterations. Each reduces H̃ d by the factor `STIFF`, the ratio of W to
    /// the compliance, down to 1e-12 of d.
    pub const ROUNDS: usize = 3;
    /// Complementarity gap at which each ends, relative to the square of the unit of reactions.
    pub const LEAST_GAP: f64 = 1e-18;
}

/// Check of the proofs about an unsolved problem.
pub(super) mod certificate {
    /// Largest net impulse of a certificate on a body, relative to the largest impulse of the
    /// certificate; and least −q·d, relative to the sum of the sizes of its terms. A solution would
    /// need velocities of the order of 1/`EXACT` times those at which the contacts close.
    pub const EXACT: f64 = 1e-10;
    /// Target distance of velocities inside K*, relative to the largest given velocity; half of it
    /// counts as inside.
    pub const MARGIN: f64 = 1e-6;
    /// Share of the largest impulse above which a contact belongs to a certificate.
    pub const CARRIES: f64 = 1e-3;
}

/// The limit load, a conic programme.
pub(super) mod limit_load {
    /// Error of the balance, of the mechanism and of the load at which the programme is solved, in
    /// its unit. Double precision reaches some 1e-11 on samples of 430 disks.
    pub const TOLERANCE: f64 = 1e-10;
    /// The largest such error that is accepted.
    pub const ACCEPT: f64 = 1e-7;
    /// Largest net force, or work on a contact, of a certificate, relative to its load.
    pub const CERTIFICATE: f64 = 1e-9;
    /// Largest ratio of two strengths in the first programme; larger strengths are reduced, and
    /// raised by the root of this factor where they matter. Of three disks with bonds of 100 N and
    /// 1e9 N the limit is 71 N without this, in place of 50 N (decision 55).
    pub const SPREAD: f64 = 1e4;
    /// Iterations without progress after which the best point is returned. Samples take 15 to 40
    /// in all.
    pub const PATIENCE: usize = 5;
    /// Number of refinements that remove the regularisation of the balance equations, which is
    /// `INVISIBLE` beside the diagonal entry of each. Samples of 900 spheres end at an error below
    /// 1e-10 with that and a tenth of it, at some 1e-9 with 1e-10; with 1e-14 two of 33 are not
    /// solved.
    pub const REFINEMENTS: usize = 3;
}
