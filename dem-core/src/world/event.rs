//! Loading to the next event: the load at which the next bond breaks, in equilibrium.
//!
//! The load functions give the loads as a path, with their time τ as parameter. A step starts from
//! the reactions of the last event, without those of the bonds that broke in it, and finds the
//! equilibrium r(τ) of the bodies at rest, with bonds that cannot break. While τ grows it starts
//! anew from the reactions after the release, and from those where a load function turns: dry
//! contacts keep what they bear. At the τ of the last event the broken bonds have released their
//! forces to the others. If no other bond exceeds its strength there, τ grows until the first one
//! reaches it; else τ decreases until the last one meets it: the load of the next break. While no
//! contact changes its status r(τ) is affine in the loads; where the excess is affine, too (2D, one
//! bond governs), a secant finds that load with the third equilibrium.

use super::World;
use super::assembly::{CLOSED, Places, over_arm, write_reactions};
use super::motion::{Midpoint, Motion, Turn};
use super::report::{Solves, StepError, StepReport};
use super::touch::{Break, StoredTouch};
use crate::bond::{BondStatus, LIMIT, failure, required_strength};
use crate::dim::{Dim, Vect};
use crate::problem::{ContactProblem, Kind, Node};

/// The bodies at rest under the loads of one time, with bonds that cannot break.
struct Equilibrium<D: Dim> {
    /// Time of the loads (s).
    at: f64,
    mid: Midpoint<D>,
    motion: Motion<D>,
    turns: Vec<Turn<D>>,
    touches: Vec<StoredTouch<D>>,
    problem: ContactProblem<D>,
    /// The largest required strength of an intact bond over its strength, less one (–): zero if the
    /// first bond is at its limit. Infinite if the bodies do not stay at rest.
    excess: f64,
}

impl<D: Dim> Equilibrium<D> {
    /// Time of the loads (s), and the excess.
    fn place(&self) -> (f64, f64) {
        (self.at, self.excess)
    }
}

impl<D: Dim> World<D> {
    /// Raise or lower the load to that at which the next bonds break, and break them. Without such
    /// a load up to the time `until`, the loads of that time act and no bond breaks.
    pub(super) fn load_to_next_event(&mut self, until: f64) -> Result<StepReport<D>, StepError> {
        self.stop_motion();
        let start = self.midpoint(self.settings.step);
        self.measure_sections(&start);
        self.follow_surface(&start)?;
        let (mut done, begun) = (Solves::default(), self.stored.clone());
        let found = match self.next_event(until, &mut done) {
            Ok(found) if found.excess.is_finite() => found,
            outcome => {
                self.stored = begun;
                return Err(outcome.map_or_else(|error| error, |found| self.unbalanced(&found)));
            }
        };
        let breaks = self.breaks_of(&found);
        let Equilibrium { at, mid, motion, turns, touches, problem, .. } = found;
        let forces = self.wall_forces(&mid, &touches);
        for (wall, force) in self.walls.iter_mut().zip(forces) {
            wall.applied = wall.applied_force(at);
            (wall.reaction, wall.reaction_at_limit) = (force, force);
        }
        if let Some(membrane) = &mut self.membrane {
            membrane.applied = (membrane.pressure)(at);
        }
        breaks.iter().for_each(|failed| self.bonds[failed.bond as usize].status = failed.mode);
        (self.stored, self.mid, self.turns, self.last_part) = (touches, mid, turns, self.settings.step);
        self.load_time = at;
        Ok(self.report(self.settings.step, &motion, &problem, done, breaks))
    }

    /// The equilibrium in which the next bond is at its limit, or the last one on the way to it.
    fn next_event(&mut self, until: f64, done: &mut Solves) -> Result<Equilibrium<D>, StepError> {
        let held = self.equilibrium(self.load_time, done)?;
        // no lower load balances bodies that this one moves, where all loads grow in proportion
        if held.excess.abs() <= LIMIT || held.excess.is_infinite() {
            return Ok(held);
        }
        let rises = held.excess < 0.0;
        if rises {
            // the release comes before the growth of the loads, and each part of it before the next
            self.stored.clone_from(&held.touches);
        }
        let end = if rises { until } else { 0.0 };
        let mut last = held;
        let mut step = if rises { self.settings.step } else { -self.settings.step };
        let mut next = last.at + step;
        loop {
            let next_or_end = if rises { next.min(end) } else { next.max(end) };
            let to = up_to_knot(&self.load_knots, last.at, next_or_end);
            let trial = self.equilibrium(to, done)?;
            if trial.excess.abs() <= LIMIT {
                return Ok(trial);
            }
            if (trial.excess < 0.0) != rises {
                let [low, above] = if rises { [last, trial] } else { [trial, last] };
                return self.bisect(low.place(), above, done);
            }
            if to == end {
                return Ok(trial);
            }
            if rises && to != next_or_end {
                self.stored.clone_from(&trial.touches);
            }
            // no further than to where the secant meets the limit, else ever longer steps
            step *= 2.0;
            let meets = secant(last.place(), trial.place()).filter(|at| (*at > trial.at) == rises);
            next = meets.unwrap_or(trial.at + step);
            last = trial;
        }
    }

    /// The equilibrium at which the first bond is at its limit, between the time and the excess
    /// `low` and the equilibrium `above`; where the reactions jump, the first one beyond the limit.
    fn bisect(
        &mut self,
        mut low: (f64, f64),
        mut above: Equilibrium<D>,
        done: &mut Solves,
    ) -> Result<Equilibrium<D>, StepError> {
        let mut halve = false;
        let finest = f64::EPSILON * above.at.abs().max(low.0.abs());
        loop {
            let high = above.place();
            let width = high.0 - low.0;
            let inside = |at: &f64| !halve && *at > low.0 && *at < low.0 + width;
            let at = secant(low, high).filter(inside).unwrap_or(low.0 + 0.5 * width);
            if at <= low.0 || at >= high.0 || width.abs() <= finest {
                // round-off of the loads. Another solve at the same time may select other
                // reactions, so the equilibrium is kept
                return Ok(above);
            }
            let found = self.equilibrium(at, done)?;
            if found.excess.abs() <= LIMIT {
                return Ok(found);
            }
            if found.excess < 0.0 {
                low = found.place();
            } else {
                above = found;
            }
            halve = above.at - low.0 > 0.5 * width;
        }
    }

    /// The equilibrium under the loads of the time `at`.
    fn equilibrium(&mut self, at: f64, done: &mut Solves) -> Result<Equilibrium<D>, StepError> {
        let h = self.settings.step;
        let (mid, motion, applied) = (self.midpoint(h), self.free_motion(h, at), self.applied_impulse(h, at));
        let mut touches = self.detect(&mid, &motion, h);
        // bodies at rest close no gap, and what touches is closed
        touches.retain(|touch| {
            touch.bond().is_some() || self.geometry(&mid, touch.pair).0 <= CLOSED * self.smaller(touch.pair)
        });
        touches.iter_mut().for_each(|touch| touch.closed = true);
        let mut brought = self.brought(&mid, &touches, &motion, h);
        loop {
            // bonds above their limit would yield, and the reactions would not be affine
            brought.strengthened *= 2.0;
            let (mut problem, places) = self.assemble(&mid, &touches, &motion, &brought, applied, h);
            problem.is_static = true;
            // loads may vanish where reactions of the last event do not
            problem.applied = self.scale_of(applied);
            let solve = self.solver.solve(&mut problem);
            done.add(solve);
            self.refuse_unaccepted(solve, &problem, (at, 0.0), true)?;
            let excess = self.excess(&touches, &problem, &places);
            // stronger bonds may hold bodies that move where a bond yields
            let yields = 1.0 + excess >= (1.0 - LIMIT) * brought.strengthened;
            if !yields || brought.strengthened >= 1.0 / LIMIT {
                write_reactions(&mut touches, &problem, &places, h);
                let excess = if yields || !self.balances(&problem, applied) { f64::INFINITY } else { excess };
                return Ok(Equilibrium { at, mid, motion, turns: brought.turns, touches, problem, excess });
            }
        }
    }

    /// Whether the bodies stay at rest in a solved problem. Without loads nothing can move:
    /// contacts do no positive work on bodies at rest.
    fn balances(&self, problem: &ContactProblem<D>, applied: f64) -> bool {
        let tolerance = self.settings.solver.load_tolerance().unwrap_or(self.settings.solver.tolerance());
        applied == 0.0 || unbalanced_impulse(problem) <= tolerance * self.scale_of(applied)
    }

    /// The largest required strength of an intact bond over its strength, less one (–).
    fn excess(&self, touches: &[StoredTouch<D>], problem: &ContactProblem<D>, places: &Places) -> f64 {
        let h = self.settings.step;
        let bonds = problem.bonded.iter().zip(places.of(Kind::Bonded));
        let shares = bonds.filter_map(|(contact, place)| {
            let bond = &self.bonds[touches[*place as usize].bond()? as usize];
            Some(required_strength(&contact.r, bond.cone()) / (h * bond.strength) - 1.0)
        });
        shares.fold(-1.0, f64::max)
    }

    /// The larger of the norms of the loads and of the reactions in the last event (N s): without
    /// loads all reactions may vanish.
    fn scale_of(&self, applied: f64) -> f64 {
        let square = |touch: &StoredTouch<D>| touch.reaction.n.powi(2) + touch.reaction.t.dot(&touch.reaction.t);
        let reactions = self.stored.iter().map(square).sum::<f64>().sqrt();
        applied.max(self.settings.step * reactions)
    }

    /// The bonds at their limit in an equilibrium: those that break.
    fn breaks_of(&self, found: &Equilibrium<D>) -> Vec<Break<D>> {
        if found.excess < -LIMIT {
            return Vec::new();
        }
        let mut breaks = Vec::new();
        for stored in &found.touches {
            let Some(bond) = stored.bond() else { continue };
            let properties = &self.bonds[bond as usize];
            let reaction = over_arm(stored.reaction, properties.mean_diameter);
            let required = required_strength(&reaction, properties.cone());
            if required / properties.strength - 1.0 < found.excess - LIMIT {
                continue;
            }
            let mode = failure(&reaction, required, properties.cone()).unwrap_or(BondStatus::Tension);
            let touch = self.touch(&found.mid, stored);
            let (pair, point, reaction) = (touch.pair, touch.point, touch.reaction);
            breaks.push(Break { bond, pair, mode, round: 0, point, reaction, energy: 0.0 });
        }
        breaks
    }

    /// The error of bodies that do not stay at rest.
    fn unbalanced(&self, found: &Equilibrium<D>) -> StepError {
        let nodes = &found.problem.nodes.all;
        let fastest = (0..nodes.len()).max_by(|a, b| momentum(&nodes[*a]).total_cmp(&momentum(&nodes[*b])));
        StepError::Unbalanced { time: self.time, load_time: found.at, body: fastest.unwrap_or(0) as u32 }
    }
}

/// Norm of the impulses that contacts leave to the bodies of a problem (N s): zero if all stay at
/// rest.
fn unbalanced_impulse<D: Dim>(problem: &ContactProblem<D>) -> f64 {
    problem.nodes.all.iter().map(|node| momentum(node).powi(2)).sum::<f64>().sqrt()
}

/// Momentum of a body after the step (N s).
fn momentum<D: Dim>(node: &Node<D>) -> f64 {
    node.impulse(&node.velocity, &node.spin)
}

/// The first of the `knots` strictly between two times, on the way from one to the other; else the
/// other.
fn up_to_knot(knots: &[f64], from: f64, to: f64) -> f64 {
    let between = knots.iter().copied().filter(|knot| from.min(to) < *knot && *knot < from.max(to));
    if from < to { between.fold(to, f64::min) } else { between.fold(to, f64::max) }
}

/// Where the line through two points of time and excess meets zero.
fn secant(a: (f64, f64), b: (f64, f64)) -> Option<f64> {
    let at = b.0 - b.1 * (b.0 - a.0) / (b.1 - a.1);
    at.is_finite().then_some(at)
}
