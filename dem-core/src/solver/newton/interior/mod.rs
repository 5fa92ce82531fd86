//! The interior-point method, where no guess of the active set leads to a solution.
//!
//! With the metric 1/ρ + C of the corrector and its form q the inner problem is
//!
//! y − f = H̃ (r̂ − s n),   K ∋ r̂ ⊥ z = q(u) + (1/ρ + C) r ∈ K*,
//!
//! a monotone complementarity problem for associated laws. Mehrotra's predictor–corrector follows its central path from
//! anywhere in some twenty iterations, however large the plastic zone is, and the matrix of its steps, I + Σ H̃ D⁻¹ H̃ᵀ, has
//! the pattern of Newton's. What K is to the method stands in [`rays`] for the plane, in [`disks`] for space. At the end the
//! point tells which contacts are at which limit.
//!
//! The term μ‖u_t‖ of dry friction is held along the path: where nearly nothing slips it would else move the path faster
//! than the path closes in. Only where the term that was held turns out wrong, as at a collapse, does it follow the slips
//! from iteration to iteration, at once where the last solves came to that, and if it does not settle from path to path.
//!
//! The metric hardens as the gap closes. A hard one all along would lead to the middle of the many reactions that balance the
//! load, from where the least of them is a long way at a small gap: there, bonds stand that the stiff limit breaks. How hard
//! it may become rounding decides.
//!
//! Sources: Mehrotra, SIAM J. Optim. 2, 1992; Wright, Primal–dual interior-point methods, 1997; for contact with friction
//! Acary, Armand, Nguyen & Shpakovych, Optim. Methods Softw. 39, 2024.

mod disks;
mod path;
mod rays;

use super::guess::{Beyond, Slips};
use super::held::ABOUT;
use super::inner::norm2;
use super::patience::{Shrinking, Stall};
use crate::solver::rows::{Operator, Row, Rows};
use crate::solver::solvable::Solvable;
use super::{Found, Newton, SolveReport, SolveStatus, load_change, net_change};
use crate::contact::Padded;
pub(super) use disks::{Bending, Twisting};
use path::{Defect, Path, Point, step};
pub(super) use rays::Rays;

/// Most rounds of one solve, those that only bring the load error down, and most iterations of a round.
const ROUNDS: usize = 12;
const EXACT_ROUNDS: usize = 3;
const MOST: u64 = 100;
/// Iterations in which the gap must halve, or where the term of dry friction moves the residual.
const PATIENCE: u64 = 5;
const MOVING_PATIENCE: u64 = 45;
/// Where a path ends, as a gap over what the reactions and the velocities that they give multiply to; where in space Newton is
/// tried on the way; and where one ends that only serves the next term of dry friction.
const END: f64 = 1e-24;
const NEARLY: f64 = 1e-17;
const EARLY: f64 = 1e-14;
/// Share of the change of that term that is followed.
const SHARE: f64 = 0.5;
/// Residual at the end of a path beyond which its term of dry friction was wrong; and beyond which it moved in vain.
const WRONG: f64 = 1e-5;
const IN_VAIN: f64 = 1e-4;
/// Load error of reactions that were compared with none.
const UNKNOWN: f64 = 1.0;
/// Defect of the momenta, over their change, that rounding may leave: this, or a share of the tolerance of the residual.
const ROUNDING: f64 = 1e-12;
const ROUNDING_SHARE: f64 = 1e-3;

/// The cone of a contact, as the path knows it.
pub(super) trait Site: Sized {
    /// A point inside K × K*, or a step of it.
    type Pair: Clone;
    /// What z is off by.
    type Slack;
    /// D and what else a step needs at a point.
    type Scaling;
    /// What the local equations alone ask of a step.
    type Drive;
    fn new(row: &Row) -> Self;
    /// A point well inside: a reaction of at most `share` (N s), z larger than q and than `share` times `yields`, all
    /// products alike.
    fn inside(&self, q: &Padded, share: f64, yields: f64) -> Self::Pair;
    /// The reaction without the shift.
    fn reaction(&self, row: &Row, at: &Self::Pair) -> Padded;
    /// What the point's z is more than `z`.
    fn defect(&self, at: &Self::Pair, z: &Padded) -> Self::Slack;
    /// Add the products whose mean is the gap; returns their number.
    fn add_products(&self, at: &Self::Pair, sum: &mut f64) -> usize;
    /// The same where z is what `yields` to the reaction.
    fn add_scale(&self, at: &Self::Pair, yields: f64, sum: &mut f64) -> usize;
    fn scaling(&self, at: &Self::Pair) -> Self::Scaling;
    /// D⁻¹.
    fn operator(&self, scaling: &Self::Scaling) -> Operator;
    fn drive(&self, scaling: &Self::Scaling, at: &Self::Pair, off: &Self::Slack, aim: Aim<Self::Pair>) -> Self::Drive;
    /// The change of the reaction that the drive stands for.
    fn force(&self, drive: &Self::Drive) -> Padded;
    /// The step where the bodies' velocities change the contact's by `pulled`.
    fn step(
        &self,
        scaling: &Self::Scaling,
        at: &Self::Pair,
        drive: &Self::Drive,
        pulled: &Padded,
        aim: Aim<Self::Pair>,
    ) -> Self::Pair;
    fn moved(at: &Self::Pair, step: &Self::Pair, length: f64) -> Self::Pair;
    /// The longest part of a step that stays inside, if that is less than `longest`.
    fn longest(&self, at: &Self::Pair, step: &Self::Pair, longest: f64) -> f64;
    /// The reaction without the shift at the limits that it is nearer to than z is to its own, and how far it is beyond them.
    fn snapped(&self, row: &Row, at: &Self::Pair) -> (Padded, Beyond);
}

/// What the products of the next point should be.
pub(super) enum Aim<'a, P> {
    /// Zero.
    Boundary,
    /// This, but for what the step to the boundary leaves of second order.
    Middle(f64, &'a P),
}

impl<P> Clone for Aim<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Aim<'_, P> {}

/// What a path does with the term of dry friction.
#[derive(Clone, Copy)]
enum Term {
    /// Holds the one that was found last.
    Held,
    /// Lets it follow the slips from iteration to iteration.
    Moving,
    /// Holds the one that the path before left, with half its change; moves likewise where only the load error is left.
    Halved,
}

/// How much velocity a unit of reaction gives a contact, in the mean of its rows (1/kg).
fn yields(row: &Row) -> f64 {
    row.size / row.rows.len() as f64
}

impl Newton {
    /// What lies at the end of the central path: with the term of dry friction that was found last, then with one that
    /// follows the slips along the path, and while what that leads to is not accepted with those of the end before.
    pub(super) fn through_the_middle<S: Site>(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        swept: &[Padded],
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let mut path = Path::<S>::new(base, &self.slips.speeds(base), swept);
        let (mut best, mut shrinking): (Option<Found>, _) = (None, Shrinking::default());
        // whether the term of dry friction seems right, and whether Newton was tried from there
        let (mut right, mut tried) = (true, base.mostly_dry());
        let dry = path.rows.list.iter().any(|row| row.lag.is_some());
        // steps that are alike slip alike
        let mut moves_first = dry && !self.quiet.is_over();
        let mut term = if moves_first { Term::Moving } else { Term::Held };
        let (mut moved_in_vain, mut last) = (false, f64::INFINITY);
        for round in 0..ROUNDS {
            if round > 0 {
                path.begin_again(swept);
            }
            // what is accepted and has nothing yet to be compared with
            let alone = best.as_ref().is_some_and(|b| b.residual <= self.settings.accept && b.load_error >= UNKNOWN);
            match term {
                Term::Held => {
                    if base.in_space() || base.mostly_dry() {
                        self.follow_fixed(&mut path, NEARLY, iterations);
                        let exact = self.answer_within(problem, base, &path, iterations);
                        if exact.is_some() {
                            self.quiet.forget();
                            return exact;
                        }
                    }
                    self.follow_fixed(&mut path, END, iterations)
                }
                // once it moves it moves: what creeps would else be given other reactions
                Term::Halved if !right && !alone => self.follow_fixed(&mut path, EARLY, iterations),
                _ => self.follow_moving(&mut path, problem, iterations),
            }
            let mut guess = path.snapped();
            let mut reactions = guess.reactions.clone();
            // in the metric of the path: of what only creeps the slip is softer by as much, and its share beyond the limit stays
            self.slips = Slips::of_guess(&path.rows, &guess);
            problem.write_back(&reactions);
            let mut residual = problem.residual();
            let far = std::mem::take(&mut moves_first) && residual > IN_VAIN.max(self.settings.accept);
            let mut load_error = path.load_error(&reactions).min(shrinking.error(load_change(&path.rows, &reactions)));
            if let Some(found) = best.as_mut().filter(|_| right || alone) {
                // these are nearer to those of a rigid metric
                found.load_error = found.load_error.min(net_change(&path.rows, &found.reactions, &reactions));
            }
            let converged = self.report(*iterations, residual, load_error).status == SolveStatus::Converged;
            let near = match term {
                Term::Held => WRONG.max(self.settings.tolerance),
                // multipliers do not settle what a moving term leaves
                _ => self.settings.tolerance,
            };
            right = converged || round < EXACT_ROUNDS && (residual <= near || !dry);
            match term {
                _ if !dry => {}
                Term::Held if residual <= near => self.quiet.forget(),
                Term::Held => self.quiet.lengthen(),
                _ => {}
            }
            // where nothing moves many reactions balance the load: the term of what creeps chooses, and is Newton's to find
            if right && !self.astray && !std::mem::replace(&mut tried, true) {
                let exact = self.rounds(problem, &mut base.clone(), &mut guess, converged, iterations);
                if exact.is_some() {
                    return exact;
                }
                problem.write_back(&reactions);
                self.slips = Slips::of_guess(&path.rows, &path.snapped());
            }
            if converged {
                return Some(self.report(*iterations, residual, load_error));
            }
            let halved = matches!(term, Term::Halved);
            if right {
                path.rows.move_multipliers(&reactions);
            } else {
                // sweeps settle what single contacts disagree about; a term that was held moves next, which brings more than they do
                residual = self.settle(problem, base, !matches!(term, Term::Held));
                if far && residual > WRONG.max(self.settings.accept) {
                    path.rows.hold(&self.slips.speeds(base));
                    (term, moved_in_vain) = (Term::Held, true);
                    continue;
                }
                let settled = problem.swept(0);
                load_error += net_change(&path.rows, &reactions, &settled);
                reactions = settled;
                term = if matches!(term, Term::Held) && !moved_in_vain { Term::Moving } else { Term::Halved };
            }
            path.rows.follow_slips(&path.rows.given_by(&reactions), &reactions, SHARE);
            if residual.is_finite() && best.as_ref().is_none_or(|b| residual < b.residual) {
                best = Some(Found { reactions, residual, load_error });
            }
            // what is only accepted is taken once the term has moved, and the load error is known
            let accepted = best.as_ref().filter(|b| b.residual <= self.settings.accept);
            let known = accepted.is_some_and(|b| b.load_error < UNKNOWN);
            let small = accepted.is_some_and(|b| b.load_error <= self.settings.load_tolerance);
            if !right && (known && matches!(term, Term::Halved) || !dry) {
                break;
            }
            // the paths that are left shorten the residual as this one did
            let shrinkage = (residual / std::mem::replace(&mut last, residual)).min(1.0);
            let reached = |rounds: usize| residual * shrinkage.powi(rounds.saturating_sub(1 + round) as i32);
            if halved && accepted.is_none() && reached(ROUNDS) > self.settings.accept {
                break;
            }
            // what these terms of dry friction leave multipliers will not settle, and the load error is small enough
            if right && small && round > 0 && reached(EXACT_ROUNDS) > self.settings.tolerance {
                break;
            }
        }
        self.taken(problem, best?, *iterations)
    }

    /// Newton's own answer from a path on its way: the active set shows long before the end. None where the term of dry
    /// friction was wrong, or where Newton runs in circles.
    fn answer_within<S: Site>(
        &mut self,
        problem: &mut impl Solvable,
        base: &Rows,
        path: &Path<S>,
        iterations: &mut u64,
    ) -> Option<SolveReport> {
        let guess = path.snapped();
        self.slips = Slips::of_guess(&path.rows, &guess);
        problem.write_back(&guess.reactions);
        if problem.residual() > WRONG {
            return None;
        }
        if base.mostly_dry() {
            return self.rounds_of_held_terms(problem, base, &path.terms(), guess, iterations);
        }
        let mut guess = self.by_held_terms(base, guess, ABOUT, iterations)?;
        let exact = self.rounds(problem, &mut base.clone(), &mut guess, true, iterations)?;
        // the next active set is near this one
        self.rest.forget();
        Some(exact)
    }

    /// Follow the path of one term of dry friction to where the gap is as small as `end`.
    fn follow_fixed<S: Site>(&mut self, path: &mut Path<S>, end: f64, iterations: &mut u64) {
        let mut stall = Stall::after(PATIENCE, 0.5);
        self.follow(path, iterations, |path| {
            let gap = path.gap();
            path.softness == path.least && gap <= end || stall.at(gap)
        });
    }

    /// Follow the path while the term of dry friction follows the slips, to where the residual is small enough; else back to
    /// where it was least.
    fn follow_moving<S: Site>(&mut self, path: &mut Path<S>, problem: &mut impl Solvable, iterations: &mut u64) {
        let mut stall = Stall::after(MOVING_PATIENCE, 0.5);
        let tolerance = self.settings.tolerance;
        // the least residual so far, and the point that it belongs to with its softness and the number of softer ones before it
        let (mut least, mut best) = (f64::INFINITY, None);
        self.follow(path, iterations, |path| {
            let reactions = path.snapped().reactions;
            problem.write_back(&reactions);
            let residual = Some(problem.residual()).filter(|r| r.is_finite()).unwrap_or(f64::INFINITY);
            if best.is_none() || residual < least {
                let at = Point { y: path.at.y.clone(), pairs: path.at.pairs.clone() };
                (least, best) = (residual, Some((at, path.softness, path.softer.len())));
            }
            let arrived = residual <= tolerance || stall.at(residual);
            if !arrived {
                path.rows.follow_slips(&path.at.y, &reactions, 1.0);
            }
            arrived
        });
        if let Some((at, softness, softer)) = best {
            path.at = at;
            path.softer.truncate(softer);
            path.soften(softness);
        }
    }

    /// Follow the central path until `arrived`, or as far as the factor goes.
    fn follow<S: Site>(
        &mut self,
        path: &mut Path<S>,
        iterations: &mut u64,
        mut arrived: impl FnMut(&mut Path<S>) -> bool,
    ) {
        self.kept().renew = true;
        let mut last = f64::INFINITY;
        for _ in 0..MOST {
            *iterations += 1;
            // a step shortens the defect, unless rounding makes it grow: more so the harder the metric
            let momenta = path.at.momenta(&path.rows, &path.sites);
            let rounding = norm2(&momenta).sqrt();
            if rounding > last && rounding > ROUNDING.max(ROUNDING_SHARE * self.settings.tolerance) * path.impulse() {
                path.least = path.softness;
            }
            last = rounding;
            path.harden();
            let Path { rows, sites, at, .. } = &*path;
            let gap = at.gap(sites);
            let defect = Defect { momenta, slacks: at.slacks(rows, sites) };
            let scalings: Vec<_> = sites.iter().zip(&at.pairs).map(|(site, pair)| site.scaling(pair)).collect();
            let operators: Vec<_> =
                sites.iter().zip(&scalings).map(|(site, scaling)| Some(site.operator(scaling))).collect();
            if !self.kept().factor.renew(rows, &operators) {
                break;
            }
            let affine = step(rows, sites, &scalings, &self.kept().factor, at, &defect, |_| Aim::Boundary);
            let reach = at.longest(&affine, sites);
            let centring = (at.moved(&affine, reach).gap(sites) / gap).powi(3).min(1.0);
            let middle = |c: usize| Aim::Middle(centring * gap, &affine.pairs[c]);
            let direction = step(rows, sites, &scalings, &self.kept().factor, at, &defect, middle);
            let next = at.moved(&direction, at.longest(&direction, sites));
            if !next.gap(sites).is_finite() {
                break;
            }
            path.advance(next);
            if arrived(path) {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Drive, Grain, Shape, Wall};
    use crate::bond::Rupture;
    use crate::contact::BondFlow;
    use crate::dim::D3;
    use crate::problem::ContactProblem;
    use crate::solver::newton::{KAPPA, NewtonSettings, Start, StiffnessRatio};
    use crate::solver::{ContactSolver, SolverSettings};
    use crate::world::{Settings, World};
    use std::sync::Arc;

    /// A block of spheres on a floor under a lid, leaning; every third bond is missing, and contacts slip there.
    fn leaning_block(settings: NewtonSettings) -> ContactProblem<D3> {
        let (side, r) = (5, 0.01);
        let place = |k: usize| [k % side, k / side % side, k / (side * side)].map(|c| r * (2.0 * c as f64 + 1.0));
        let grains = (0..side * side * side).map(|k| Grain::<D3>::at_rest(place(k).into(), r, 2500.0)).collect();
        let plane = |normal: f64, at: f64| {
            Wall::<D3>::fixed(Shape::Plane { normal: [0.0, 0.0, normal].into() }, [0.0, 0.0, at].into(), 0.5)
        };
        let mut lid = plane(-1.0, 2.0 * r * side as f64);
        lid.drive = Drive::Force { direction: [0.0, 0.0, -1.0].into(), mass: 2.0, force: Arc::new(|_| 100.0) };
        let settings = Settings {
            step: 1e-4,
            gravity: Some([40.0, 13.0, -9.81].into()),
            friction: 0.3,
            restitution: None,
            bond_flow: BondFlow::Associated,
            rupture: Rupture::Cascade,
            solver: SolverSettings::Newton(settings),
            max_halvings: 0,
            thickness: 1.0,
            expel_overlaps: false,
        };
        let mut world = World::new(grains, vec![plane(1.0, 0.0), lid], Vec::new(), settings);
        world.form_bonds(1e-6, |_| 100.0, 0.3);
        let mut count = 0;
        world.bonds.retain(|_| {
            count += 1;
            count % 3 != 0
        });
        world.step().expect("an accepted step");
        world.contact_problem()
    }

    /// Where nothing moves, reactions of many sizes balance the load. The path alone would find others than Newton does: its
    /// term of dry friction is that of slips in another metric.
    #[test]
    fn what_slips_carries_the_same_with_and_without_a_guess() {
        let settings = NewtonSettings {
            tolerance: 1e-8,
            accept: 1e-6,
            load_tolerance: 1e-5,
            start: Start::StiffLimit,
            stiffness: StiffnessRatio { tangential: 1.0, rolling: 1.0 / 12.0 },
            max_iterations: 300,
        };
        let problem = leaning_block(settings);
        let (mut guessed, mut found) = (problem.clone(), problem);
        assert_eq!(Newton::new(settings).solve(&mut guessed).status, SolveStatus::Converged);

        let mut newton = Newton::new(settings);
        found.forget_reactions();
        let rows = found.rows(KAPPA, settings.stiffness);
        let swept = found.swept(50);
        let mut with_twist = found.clone();
        let report = newton.through_the_middle::<Bending>(&mut found, &newton.started(&rows), &swept, &mut 0).unwrap();
        assert_eq!(report.status, SolveStatus::Converged);
        // no bond here twists, and the cones for those that do have room for all others
        let mut newton = Newton::new(settings);
        let started = newton.started(&rows);
        newton.through_the_middle::<Twisting>(&mut with_twist, &started, &swept, &mut 0).unwrap();
        for (a, b) in found.dry.iter().zip(&with_twist.dry) {
            assert!((a.r.n - b.r.n).abs() <= 1e-9 * a.r.n.abs().max(1e-9), "{:?} {:?}", a.r, b.r);
        }

        let at_limit = guessed.dry.iter().filter(|c| c.r.n > 0.0 && c.r.t.norm() > 0.29 * c.r.n).count();
        assert!(at_limit > 10, "{at_limit} slip of {}", guessed.dry.len());
        let largest = guessed.dry.iter().map(|c| c.r.n).fold(0.0, f64::max);
        let apart = guessed.dry.iter().zip(&found.dry).map(|(a, b)| (a.r.n - b.r.n).abs()).fold(0.0, f64::max);
        assert!(apart <= 1e-6 * largest, "{:e}", apart / largest);
    }
}
