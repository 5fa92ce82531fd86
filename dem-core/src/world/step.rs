//! One time step: the scheme of Moreau and Jean with θ = 1/2, and its rupture cascade.

use super::assembly::{Places, write_reactions};
use super::ledger::{elastic_energy, losses};
use super::motion::{Midpoint, Motion};
use super::report::{Solves, StepError, StepReport, Violation};
use super::touch::{Break, StoredTouch};
use super::{Counts, World};
use crate::body::Drive;
use crate::bond::{BondStatus, Rupture, at_limit, failure};
use crate::contact::Law;
use crate::dim::{Dim, Vect};
use crate::problem::residual::{furthest_from_law, velocity_error};
use crate::problem::{Contact, ContactProblem, Group, Kind, Nodes, Visitor};
use crate::solver::certificate::Verdict;
use crate::solver::{SolveReport, SolveStatus};

impl<D: Dim> World<D> {
    /// Advance the world by one time step. An error leaves the world and its solver unchanged.
    pub fn step(&mut self) -> Result<StepReport<D>, StepError> {
        self.step_watched(&mut |_| {})
    }

    /// As [`World::step`]; `watch` is called after each cascade round with the number of bonds
    /// broken so far in the step. If the step is repeated in halves, the count restarts.
    pub fn step_watched(&mut self, watch: &mut dyn FnMut(usize)) -> Result<StepReport<D>, StepError> {
        self.follow_settings();
        let solver = self.solver.snapshot();
        let outcome = match self.settings.rupture {
            Rupture::NextEvent { until } => self.load_to_next_event(until),
            _ => self.advance(self.settings.step, 0, 1, watch),
        };
        let mut report = match outcome {
            Ok(report) => report,
            Err(error) => {
                self.solver = solver;
                return Err(error);
            }
        };
        self.steps += 1;
        // a product, not a sum: the clock does not drift
        self.time = self.steps as f64 * self.settings.step;
        report.time = self.time;
        Ok(report)
    }

    /// One step of length `h`. An error leaves the world unchanged; that of the `last` attempt
    /// includes the verdict on its problem.
    pub(super) fn attempt(
        &mut self,
        h: f64,
        last_attempt: bool,
        watch: &mut dyn FnMut(usize),
    ) -> Result<StepReport<D>, StepError> {
        let mid = self.midpoint(h);
        self.measure_sections(&mid);
        self.follow_surface(&mid)?;
        let loaded_at = self.time + 0.5 * h;
        let motion = self.free_motion(h, loaded_at);
        let applied = self.applied_impulse(h, loaded_at);
        let mut touches = self.detect(&mid, &motion, h);
        // sample preparation pushes grains apart at speeds without physical meaning
        let limits_apply = !self.settings.expel_overlaps;
        if limits_apply {
            self.refuse_crossing(self.crossing(|k| self.place(k), |k| motion.before[k].0, 0.5 * h))?;
        }
        let brought = self.brought(&mid, &touches, &motion, h);
        let mut done = Solves::default();
        let mut breaks: Vec<Break<D>> = Vec::new();
        let mut walls_at_limit = None;
        let (problem, places) = loop {
            let (mut problem, places) = self.assemble(&mid, &touches, &motion, &brought, applied, h);
            let (solve, violation) = self.solve(&mut problem, limits_apply);
            done.add(solve);
            self.refuse_violation(violation, &problem, last_attempt)?;
            self.refuse_unaccepted(solve, &problem, (self.time, h), last_attempt)?;
            if limits_apply && self.large_load_error(solve, &problem).is_some() {
                return Err(self.not_accepted(solve, &problem, (self.time, h), last_attempt));
            }
            write_reactions(&mut touches, &problem, &places, h);
            let missed = self.missed(&mid, &touches, &problem.nodes, h);
            if !missed.is_empty() {
                touches.extend(missed);
                touches.sort_by_key(|t| t.pair);
                continue;
            }
            let failed = self.at_limit(&mid, &touches, &problem, &places, breaks.last().map_or(0, |b| b.round + 1));
            let again = !failed.is_empty() && self.settings.rupture != Rupture::EndOfStep;
            if again {
                walls_at_limit.get_or_insert_with(|| self.wall_forces(&mid, &touches));
                forget_bonds(&mut touches, &failed);
            }
            breaks.extend(failed);
            if !again {
                break (problem, places);
            }
            watch(breaks.len());
        };
        if limits_apply {
            let velocity = |k: usize| problem.nodes.all[k].velocity;
            self.refuse_crossing(self.pushes_at_a_distance(&mid, &touches, &problem.nodes, h))?;
            self.refuse_crossing(self.crossing(|k| mid.place(k), velocity, 0.5 * h))?;
            self.refuse_violation(self.accumulate(&mut touches, &problem, &places, h), &problem, last_attempt)?;
        }
        self.commit(h, mid, &motion, &problem, touches, &breaks);
        (self.turns, self.last_part) = (brought.turns, h);
        if let Some(forces) = walls_at_limit {
            self.walls.iter_mut().zip(forces).for_each(|(wall, force)| wall.reaction_at_limit = force);
        }
        Ok(self.report(h, &motion, &problem, done, breaks))
    }

    /// Solve a contact problem. If `limits_apply` and an accepted solution yields, solve again more
    /// finely, if the solver can. Returns also the violation that remains.
    fn solve(&mut self, problem: &mut ContactProblem<D>, limits_apply: bool) -> (SolveReport, Option<Violation>) {
        let solve = self.solver.solve(problem);
        let solve = self.judged(solve, problem);
        let violation = if limits_apply { self.yielding_of(solve, problem) } else { None };
        let Some(found) = violation.as_ref().filter(|_| solve.status != SolveStatus::Failed) else {
            return (solve, violation);
        };
        match self.solver.solve_finer(problem, solve, self.excess_of(found)) {
            Some(finer) => {
                let finer = self.judged(finer, problem);
                (SolveReport { work: solve.work + finer.work, ..finer }, self.yielding_of(finer, problem))
            }
            None => (solve, violation),
        }
    }

    /// The contact problem that the next step would start from, for export and for benchmarks. The
    /// world does not move. Where a membrane has no surface, the last one remains.
    pub fn contact_problem(&mut self) -> ContactProblem<D> {
        let h = self.settings.step;
        let loaded_at = self.time + 0.5 * h;
        let mid = self.midpoint(h);
        self.measure_sections(&mid);
        self.follow_surface(&mid).unwrap_or_default();
        let motion = self.free_motion(h, loaded_at);
        let touches = self.detect(&mid, &motion, h);
        let brought = self.brought(&mid, &touches, &motion, h);
        self.assemble(&mid, &touches, &motion, &brought, self.applied_impulse(h, loaded_at), h).0
    }

    /// Half a step in position at the old velocities.
    pub(super) fn midpoint(&self, h: f64) -> Midpoint<D> {
        let drift = |x: &D::Vector, v: &D::Vector| *x + *v * (0.5 * h);
        Midpoint {
            grains: self.grains.position.iter().zip(&self.grains.velocity).map(|(x, v)| drift(x, v)).collect(),
            walls: self.walls.iter().map(|w| drift(&w.position, &w.velocity)).collect(),
        }
    }

    /// Whether forces may act on grains that are not those of contacts.
    fn has_external_forces(&self) -> bool {
        self.settings.gravity.is_some() || !self.loads.is_empty() || self.membrane.is_some()
    }

    /// Prescribed force on each grain (N), and torque (N m), at the time `at`.
    fn external_forces(&self, at: f64) -> Vec<(D::Vector, D::Spin)> {
        let gravity = self.settings.gravity.unwrap_or(D::Vector::zero());
        let mut forces: Vec<_> = self.grains.mass.iter().map(|m| (gravity * *m, D::Spin::zero())).collect();
        for load in &self.loads {
            let factor = (load.factor)(at);
            forces[load.grain].0 += load.force * factor;
            forces[load.grain].1 += load.torque * factor;
        }
        if let Some(membrane) = &self.membrane {
            self.membrane_forces((membrane.pressure)(at)).for_each(|(grain, force)| forces[grain].0 += force);
        }
        forces
    }

    /// Velocities before the step and the free velocities v_f = v + h M⁻¹ F_ext, with the loads of
    /// the time `at`; walls follow the grains.
    pub(super) fn free_motion(&self, h: f64, at: f64) -> Motion<D> {
        let g = &self.grains;
        let mut before: Vec<_> = g.velocity.iter().copied().zip(g.spin.iter().copied()).collect();
        let mut free = before.clone();
        if self.has_external_forces() {
            for (k, (force, torque)) in self.external_forces(at).into_iter().enumerate() {
                let (inverse_mass, inverse_inertia) = g.inverse(k);
                free[k].0 += force * (h * inverse_mass);
                free[k].1 += torque * (h * inverse_inertia);
            }
        }
        for wall in &self.walls {
            let still = D::Spin::zero();
            before.push((wall.velocity, still));
            free.push(match &wall.drive {
                Drive::Fixed => (D::Vector::zero(), still),
                Drive::Velocity { direction, speed } => (*direction * speed(self.time + h), still),
                Drive::Force { direction, mass, .. } => {
                    let gain = *direction * (h * wall.applied_force(at) / mass);
                    let free = wall.driven_part(wall.velocity) + gain;
                    (wall.slide_velocity(self.time + h).map_or(free, |slide| free + slide), still)
                }
            });
        }
        for (k, wall) in self.held.iter().enumerate() {
            if let Some(wall) = wall {
                free[k] = free[g.len() + *wall as usize];
            }
        }
        Motion { before, free: free.into() }
    }

    /// ‖h F_ext‖ over all bodies that can move (N s), with the loads of the time `at`.
    pub(super) fn applied_impulse(&self, h: f64, at: f64) -> f64 {
        let mut sum = 0.0;
        if self.has_external_forces() {
            for (k, (force, _)) in self.external_forces(at).into_iter().enumerate() {
                if !self.grains.fixed[k] {
                    sum += force.dot(&force);
                }
            }
        }
        for wall in &self.walls {
            sum += wall.applied_force(at).powi(2);
        }
        h * f64::sqrt(sum)
    }

    /// Refuses a solve that failed, of a step from a time and of a length (s).
    pub(super) fn refuse_unaccepted(
        &self,
        solve: SolveReport,
        problem: &ContactProblem<D>,
        (time, h): (f64, f64),
        last_attempt: bool,
    ) -> Result<(), StepError> {
        let finite = |v: &[f64]| v.iter().all(|c| c.is_finite());
        if let Some(body) =
            problem.nodes.all.iter().position(|n| !(finite(n.velocity.as_slice()) && finite(n.spin.as_slice())))
        {
            return Err(StepError::NotFinite { time, body: body as u32 });
        }
        match solve.status {
            SolveStatus::Failed => Err(self.not_accepted(solve, problem, (time, h), last_attempt)),
            _ => Ok(()),
        }
    }

    /// The error of a solve that is not accepted, because it failed or by its load error.
    fn not_accepted(
        &self,
        solve: SolveReport,
        problem: &ContactProblem<D>,
        (time, h): (f64, f64),
        last_attempt: bool,
    ) -> StepError {
        let SolveReport { residual, work, .. } = solve;
        let load_error = self.large_load_error(solve, problem).filter(|_| solve.status != SolveStatus::Failed);
        let small = solve.status == SolveStatus::Failed && residual <= self.settings.solver.accept();
        let velocity_error = small.then(|| velocity_error(problem));
        let verdict = if last_attempt { self.verdict(problem) } else { Verdict::Undecided };
        let (iterations, pair) = (work.iterations(), furthest_from_law(problem));
        StepError::NotAccepted { time, step: h, residual, velocity_error, load_error, iterations, pair, verdict }
    }

    fn refuse_violation(
        &self,
        found: Option<Violation>,
        problem: &ContactProblem<D>,
        last_attempt: bool,
    ) -> Result<(), StepError> {
        let Some(violation) = found else { return Ok(()) };
        let last_attempt = last_attempt || !violation.is_of_the_solve();
        let verdict = if last_attempt { self.verdict(problem) } else { Verdict::Undecided };
        Err(StepError::Yielded { time: self.time, violation: Violation { verdict, ..violation } })
    }

    fn refuse_crossing(&self, found: Option<[u32; 2]>) -> Result<(), StepError> {
        found.map_or(Ok(()), |pair| Err(StepError::TooFast { time: self.time, pair }))
    }

    /// The bonds at their limit after an accepted solve, restricted to those that break in one
    /// cascade round.
    fn at_limit(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        problem: &ContactProblem<D>,
        places: &Places,
        round: u32,
    ) -> Vec<Break<D>> {
        let (rigid, elastic) = (places.of(Kind::Bonded), places.of(Kind::Elastic));
        let mut found = self.group_at_limit(mid, touches, &problem.nodes, &problem.bonded, rigid, round);
        found.extend(self.group_at_limit(mid, touches, &problem.nodes, &problem.elastic, elastic, round));
        if self.settings.rupture == Rupture::CascadeWorst {
            let worst = found.iter().map(|(flow, _)| *flow).fold(f64::NEG_INFINITY, f64::max);
            let first = found.iter().position(|(flow, _)| *flow == worst);
            return first.map(|k| found[k].1).into_iter().collect();
        }
        found.into_iter().map(|(_, failed)| failed).collect()
    }

    /// The bonds of a group that are at their limit, each with the square of its flow velocity.
    fn group_at_limit<L: Law<T = D::Tangent, B = D::Moment>>(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        nodes: &Nodes<D>,
        group: &Group<D, L>,
        places: &[u32],
        round: u32,
    ) -> Vec<(f64, Break<D>)> {
        let mut found = Vec::new();
        let late = self.settings.rupture == Rupture::EndOfStep;
        for (contact, place) in group.iter().zip(places) {
            let law = &contact.law;
            let (shift, cone) = (law.shift(), law.cone());
            let by_impulse = failure(&contact.r, shift, cone);
            // without another solve the impulses stay, and they alone decide
            let Some(mode) = (if late { by_impulse } else { contact.failure() }) else { continue };
            let touch = self.touch(mid, &touches[*place as usize]);
            let u = nodes.relative_velocity::<D::Tangent, D::Moment>(&contact.link, law.arms()) + law.bias();
            let flow = u + law.compliance().times(&(contact.r - law.carried()));
            let Some(bond) = touch.bond else { continue };
            // its entry in the energy balance: the value at the start of the step if the step is
            // solved again without the bond
            let stored = if late { contact.r } else { law.carried() };
            let energy = elastic_energy(law, &stored);
            let (pair, point) = (touch.pair, touch.point);
            let reaction = match by_impulse {
                Some(_) => touch.reaction,
                None => at_limit(&touch.reaction, &contact.r, shift, cone, mode),
            };
            found.push((flow.dot(&flow), Break { bond, pair, mode, round, point, reaction, energy }));
        }
        // a large problem is not ordered by pair
        found.sort_by_key(|(_, failed)| failed.pair);
        found
    }

    /// Apply the result: energy balance, velocities, second half of the positions, broken bonds,
    /// reactions.
    fn commit(
        &mut self,
        h: f64,
        mid: Midpoint<D>,
        motion: &Motion<D>,
        problem: &ContactProblem<D>,
        touches: Vec<StoredTouch<D>>,
        breaks: &[Break<D>],
    ) {
        self.book(h, motion, problem, breaks);
        let n = self.grains.len();
        for (k, node) in problem.nodes.all[..n].iter().enumerate() {
            let mean_spin = (self.grains.spin[k] + node.spin) * (0.5 * h);
            self.grains.position[k] = mid.grains[k] + node.velocity * (0.5 * h);
            self.grains.orientation[k] = D::turned(self.grains.orientation[k], mean_spin);
            self.grains.velocity[k] = node.velocity;
            self.grains.spin[k] = node.spin;
        }
        for (w, wall) in self.walls.iter_mut().enumerate() {
            wall.velocity = problem.nodes.all[n + w].velocity;
            wall.position = mid.walls[w] + wall.velocity * (0.5 * h);
            wall.applied = wall.applied_force(self.time + 0.5 * h);
        }
        if let Some(membrane) = &mut self.membrane {
            membrane.applied = (membrane.pressure)(self.time + 0.5 * h);
        }
        let forces = self.wall_forces(&mid, &touches);
        for (wall, force) in self.walls.iter_mut().zip(forces) {
            (wall.reaction, wall.reaction_at_limit) = (force, force);
        }
        for failed in breaks {
            self.bonds[failed.bond as usize].status = failed.mode;
        }
        (self.stored, self.mid) = (touches, mid);
        self.time += h;
    }

    /// Force of the grains on each wall (N).
    #[inline]
    pub(super) fn wall_forces(&self, mid: &Midpoint<D>, touches: &[StoredTouch<D>]) -> Vec<D::Vector> {
        let mut forces = vec![D::Vector::zero(); self.walls.len()];
        // where no wall holds grains only touches with a wall count, and most are between grains
        let first = if self.held.is_empty() { self.grains.len() as u32 } else { 0 };
        for stored in touches.iter().filter(|touch| touch.pair[1] >= first) {
            let [holder, wall] = self.walls_of(stored.pair);
            if holder.is_none() && wall.is_none() {
                continue;
            }
            let touch = self.touch(mid, stored);
            let force = D::compose(&touch.frame, touch.reaction.n, touch.reaction.t);
            if let Some(wall) = wall {
                forces[wall] -= force;
            }
            if let Some(holder) = holder {
                forces[holder] += force;
            }
        }
        forces
    }

    /// Enter the step in the energy ledger.
    fn book(&mut self, h: f64, motion: &Motion<D>, problem: &ContactProblem<D>, breaks: &[Break<D>]) {
        let before = &motion.before;
        let kinetic = self.kinetic_after(&problem.nodes);
        let external = self.external_work(h, motion, problem);
        let [bonds, elastic, dry, smooth] = losses(before, problem);
        let (bonds, elastic) = (bonds.iter().sum::<f64>(), elastic.iter().sum::<f64>());
        let stored: f64 = problem.elastic.iter().map(|c| elastic_energy(&c.law, &c.r)).sum();
        let released: f64 = breaks.iter().map(|b| b.energy).sum();
        // bonds that break at the end of the step are still included in `stored`
        let late = if self.settings.rupture == Rupture::EndOfStep { released } else { 0.0 };
        let ledger = &mut self.ledger;
        ledger.remainder += external - (kinetic - ledger.kinetic) - dry[0] - smooth[0] - dry[1] - bonds - elastic;
        ledger.damping += elastic - (stored - (ledger.elastic - (released - late)));
        ledger.elastic = stored - late;
        ledger.fracture += released;
        ledger.kinetic = kinetic;
        ledger.external_work += external;
        ledger.impact += dry[0] + smooth[0];
        ledger.friction += dry[1];
        ledger.bonds += bonds;
    }

    fn kinetic_after(&self, nodes: &Nodes<D>) -> f64 {
        let n = self.grains.len();
        let mut sum = 0.0;
        for (k, node) in nodes.all.iter().enumerate() {
            if node.inverse_mass > 0.0 {
                let (mass, inertia) =
                    if k < n { (self.grains.mass[k], self.grains.inertia[k]) } else { (1.0 / node.inverse_mass, 0.0) };
                let velocity = if k < n { node.velocity } else { self.walls[k - n].driven_part(node.velocity) };
                sum += mass * velocity.dot(&velocity) + inertia * node.spin.dot(&node.spin);
            }
        }
        0.5 * sum
    }

    /// Work of gravity, loads, membrane and drives in the step (J): force times mean velocity; a
    /// wall with prescribed velocity does the work of its reaction.
    fn external_work(&self, h: f64, motion: &Motion<D>, problem: &ContactProblem<D>) -> f64 {
        let mean = |k: usize| (motion.before[k].0 + problem.nodes.all[k].velocity) * 0.5;
        let mut work = 0.0;
        if self.has_external_forces() {
            for (k, (force, torque)) in self.external_forces(self.time + 0.5 * h).iter().enumerate() {
                if !self.grains.fixed[k] {
                    let spin = (motion.before[k].1 + problem.nodes.all[k].spin) * 0.5;
                    work += h * (force.dot(&mean(k)) + torque.dot(&spin));
                }
            }
        }
        let n = self.grains.len();
        let pushes = self.wall_impulses(problem);
        for (w, wall) in self.walls.iter().enumerate() {
            work += match &wall.drive {
                Drive::Fixed => 0.0,
                Drive::Velocity { .. } => -pushes[w].dot(&mean(n + w)),
                Drive::Force { direction, .. } => {
                    h * wall.applied_force(self.time + 0.5 * h) * direction.dot(&mean(n + w))
                }
            };
            if wall.slide.is_some() {
                let across = mean(n + w) - wall.driven_part(mean(n + w));
                work -= pushes[w].dot(&across);
            }
        }
        work
    }

    /// Impulse of the grains on each wall, and on the grains that it holds (N s).
    fn wall_impulses(&self, problem: &ContactProblem<D>) -> Vec<D::Vector> {
        struct Pushes<'a, D: Dim> {
            world: &'a World<D>,
            pushes: Vec<D::Vector>,
        }
        impl<D: Dim> Visitor<D> for Pushes<'_, D> {
            fn visit<L: Law>(&mut self, _: &Nodes<D>, c: &Contact<D, L>) {
                let [holder, wall] = self.world.walls_of(c.link.nodes);
                if let Some(wall) = wall {
                    self.pushes[wall] -= c.link.impulse(&c.r);
                }
                if let Some(holder) = holder {
                    self.pushes[holder] += c.link.impulse(&c.r);
                }
            }
        }
        let mut found = Pushes { world: self, pushes: vec![D::Vector::zero(); self.walls.len()] };
        problem.visit(&mut found);
        found.pushes
    }

    /// ‖M (v⁺ − v⁻)/h‖ over the grains that are free to move, over the norm of the forces on the
    /// sample (–), after a step of length `h`; zero without such forces.
    fn false_acceleration(&self, h: f64, motion: &Motion<D>, problem: &ContactProblem<D>) -> f64 {
        let mut change = 0.0;
        for (k, mass) in self.grains.mass.iter().enumerate().filter(|(k, _)| !self.grains.fixed[*k]) {
            let dv = (problem.nodes.all[k].velocity - motion.before[k].0) * *mass;
            change += dv.dot(&dv);
        }
        // prescribed forces, and those that keep walls at their prescribed velocity
        let mut applied = problem.applied * problem.applied;
        for wall in &self.walls {
            if let Drive::Velocity { direction, .. } = &wall.drive {
                applied += (h * direction.dot(&wall.reaction)).powi(2);
            }
            if let Some(slide) = &wall.slide {
                applied += (h * slide.direction.dot(&wall.reaction)).powi(2);
            }
        }
        if applied > 0.0 { change.sqrt() / applied.sqrt() } else { 0.0 }
    }

    /// The report of a step of length `h` that has been committed.
    #[inline]
    pub(super) fn report(
        &self,
        h: f64,
        motion: &Motion<D>,
        problem: &ContactProblem<D>,
        done: Solves,
        breaks: Vec<Break<D>>,
    ) -> StepReport<D> {
        let (mut penetration, mut bond_elongation) = (0.0, 0.0);
        for stored in &self.stored {
            let gap = self.geometry(&self.mid, stored.pair).0;
            match stored.bond().map(|bond| &self.bonds[bond as usize]) {
                None => penetration = f64::max(penetration, -gap),
                Some(bond) if bond.status == BondStatus::Intact => {
                    bond_elongation = f64::max(bond_elongation, (gap - bond.rest_gap).abs());
                }
                Some(_) => {}
            }
        }
        StepReport {
            time: self.time,
            status: done.status(),
            route: done.route,
            work: done.work,
            residual: done.residual,
            load_error: done.load_error,
            false_acceleration: self.false_acceleration(h, motion, problem),
            counts: Counts::of(self.stored.iter().map(|t| t.status)),
            breaks,
            penetration,
            bond_elongation,
            rejected: 0,
            substeps: 1,
            mean_stress: None,
        }
    }
}

/// Turn the contacts of broken bonds into dry ones that start without reaction.
fn forget_bonds<D: Dim>(touches: &mut [StoredTouch<D>], broken: &[Break<D>]) {
    for failed in broken {
        if let Ok(place) = touches.binary_search_by_key(&failed.pair, |t| t.pair) {
            let StoredTouch { tangents, wide, closed, left, .. } = touches[place];
            touches[place] = StoredTouch { tangents, wide, closed, left, ..StoredTouch::new(failed.pair, None) };
        }
    }
}
