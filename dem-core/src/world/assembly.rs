//! From bodies to the contact problem and back: detection with warm start, assembly, reading of the
//! result.

use super::motion::{Midpoint, Motion, Turn};
use super::touch::{StoredTouch, Touch, TouchStatus};
use super::{MaterialFriction, World};
use crate::body::{Grains, Wall, direction, separation};
use crate::bond::{Bond, BondStatus};
use crate::contact::{Arms, Bonded, Coulomb, Elastic, Frictionless, Law, Local};
use crate::dim::{Axes, Dim, Moments, Vect, in_frame, of_frame, resized, rotated};
use crate::problem::{Contact, ContactProblem, KINDS, Kind, Link, Node, Nodes, Visitor, blocks};

/// Gap, over the smaller radius of a pair, up to which a contact touches; also the displacement in
/// a step up to which its bodies are at rest to each other. Otherwise the round-off of positions
/// would be a misfit, to which stiff contacts respond with forces; with restitution it would decide
/// which contacts act.
pub(super) const TOUCHING: f64 = 1e-9;

/// The same for a contact with a reaction in the previous step. It was closed then, and only solver
/// errors have opened it since; a stiff contact would lose its force to them at once. What they
/// opened up to its last reaction counts as closed also later.
pub(super) const CLOSED: f64 = 1e-6;

/// Gap, over the radius of the grain, below which a pair is part of the problem even if it does not
/// close.
const NEAR: f64 = 1e-3;

/// Displacement of a grain, over its radius, before the list of candidates is rebuilt.
const SPARE: f64 = 0.15;

/// State of the bonds at the start of a step, by bond index.
pub(super) struct Brought<D: Dim> {
    /// Reactions of elastic bonds (N, N m); empty if all bonds are rigid.
    pub carried: Vec<Local<D::Tangent, D::Moment>>,
    /// Corrections of bonds that turn.
    pub turns: Vec<Turn<D>>,
    /// Factor on the strengths (–): one, except in trials of next-event loading.
    pub strengthened: f64,
}

/// For each contact of the problem, by kind, its place among the contacts of the step.
#[derive(Default)]
pub(super) struct Places([Vec<u32>; KINDS]);

impl Places {
    /// Places of the contacts of one kind.
    pub fn of(&self, kind: Kind) -> &[u32] {
        &self.0[kind as usize]
    }

    /// All places, in the order in which a problem is visited.
    pub fn all(&self) -> impl Iterator<Item = usize> {
        self.0.iter().flatten().map(|place| *place as usize)
    }
}

impl<D: Dim> World<D> {
    /// Whether no impulse moves a node.
    fn immovable(&self, node: usize) -> bool {
        match node.checked_sub(self.grains.len()) {
            None => self.grains.fixed[node],
            Some(wall) => self.walls[wall].free_direction().is_none(),
        }
    }

    /// Gap, normal and contact point of a pair at mid-step; the point is mid-gap, the same for both
    /// bodies.
    pub(super) fn geometry(&self, mid: &Midpoint<D>, pair: [u32; 2]) -> (f64, D::Vector, D::Vector) {
        let [i, j] = pair.map(|k| k as usize);
        let (x, r) = (mid.grains[i], self.grains.radius[i]);
        let (gap, normal) = match j.checked_sub(self.grains.len()) {
            None => {
                let apart = separation::<D>(x, mid.grains[j]);
                let distance = apart.norm();
                (distance - r - self.grains.radius[j], direction::<D>(apart, distance))
            }
            Some(wall) => self.walls[wall].shape.gap(separation::<D>(x, mid.walls[wall]), r),
        };
        (gap, normal, x - normal * (r + 0.5 * gap))
    }

    /// A contact with its geometry at mid-step.
    pub(super) fn touch(&self, mid: &Midpoint<D>, stored: &StoredTouch<D>) -> Touch<D> {
        let (gap, normal, point) = self.geometry(mid, stored.pair);
        let frame = D::with_tangents(normal, &stored.tangents);
        Touch {
            pair: stored.pair,
            frame,
            point,
            gap,
            bond: stored.bond(),
            reaction: stored.reaction,
            status: stored.status,
        }
    }

    /// All contacts of the step, sorted by pair, with the reactions of the last step as warm start.
    pub(super) fn detect(&mut self, mid: &Midpoint<D>, motion: &Motion<D>, h: f64) -> Vec<StoredTouch<D>> {
        self.refresh_candidates(mid, motion, h);
        let mut touches: Vec<StoredTouch<D>> = Vec::with_capacity(self.stored.len() + self.stored.len() / 8 + 16);
        let intact = |b: &Bond| b.status == BondStatus::Intact;
        for (k, bond) in self.bonds.iter().enumerate().filter(|(_, b)| intact(b)) {
            touches.push(StoredTouch::new(bond.pair, Some(k as u32)));
        }
        let mut bonded = self.bonds.iter().filter(|b| intact(b)).map(|b| b.pair).peekable();
        for &pair in &self.candidates.pairs {
            while bonded.next_if(|p| *p < pair).is_some() {}
            if bonded.peek() == Some(&pair) || pair.iter().all(|k| self.immovable(*k as usize)) {
                continue;
            }
            let (gap, normal, _) = self.geometry(mid, pair);
            let approach = pair.map(|k| motion.free[k as usize].0);
            let closing = -(approach[0] - approach[1]).dot(&normal);
            let near = NEAR * self.grains.radius[pair[0] as usize];
            if gap <= near + 2.0 * h * closing.max(0.0) {
                // what the last step left, if the pair pushed in it
                let (wide, left) = (self.is_wide(pair, gap), gap as f32);
                touches.push(StoredTouch { wide, left, ..StoredTouch::new(pair, None) });
            }
        }
        touches.sort_by_key(|t| t.pair);
        self.recall(mid, &mut touches, motion, h);
        touches
    }

    /// Copy the reactions of the last step; the frame of each contact turns with its normal, that
    /// of a bond also about it, with its grains.
    fn recall(&self, mid: &Midpoint<D>, touches: &mut [StoredTouch<D>], motion: &Motion<D>, h: f64) {
        let span = 0.5 * (self.last_step(h) + h);
        let mut old = self.stored.iter().peekable();
        for touch in touches {
            while old.next_if(|o| o.pair < touch.pair).is_some() {}
            let last = old.peek().filter(|o| o.pair == touch.pair);
            touch.closed = last.is_some_and(|o| o.reaction.n > 0.0);
            if !touch.closed {
                touch.left = last.map_or(0.0, |o| o.left);
            }
            // a bond that formed since then takes over the reaction of the dry contact
            let same = last.filter(|o| o.bond() == touch.bond() || o.bond().is_none());
            if D::Tangents::LEN > 0 {
                let (gap, normal, _) = self.geometry(mid, touch.pair);
                let frame = same.map_or_else(
                    || D::frame(normal),
                    |o| {
                        let mut tangent = D::tangent(&D::with_tangents(normal, &o.tangents));
                        if o.bond().is_some() {
                            let spins = touch.pair.map(|k| motion.before[k as usize].1);
                            tangent = rotated::<D>(tangent, self.spin(touch.pair, gap, spins) * span);
                        }
                        D::transported(tangent, normal)
                    },
                );
                touch.tangents = D::tangents(&frame);
            }
            if let Some(o) = same {
                (touch.reaction, touch.yielded) = (o.reaction, o.yielded);
                touch.was_bonded = o.bond().is_some();
            }
        }
    }

    /// State of the bonds at the start of a step of length `h`.
    pub(super) fn brought(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        motion: &Motion<D>,
        h: f64,
    ) -> Brought<D> {
        Brought { carried: self.carried(touches), turns: self.turns(mid, touches, motion, h), strengthened: 1.0 }
    }

    /// Reactions (N, N m) of elastic bonds at the start of a step, by bond index; empty if all
    /// bonds are rigid.
    fn carried(&self, touches: &[StoredTouch<D>]) -> Vec<Local<D::Tangent, D::Moment>> {
        if self.bonds.iter().all(|b| b.stiffness.is_none()) {
            return Vec::new();
        }
        let mut carried = vec![Local::zero(); self.bonds.len()];
        for touch in touches {
            if let Some(bond) = touch.bond() {
                carried[bond as usize] = touch.reaction;
            }
        }
        carried
    }

    /// Make the list of candidates valid for this step.
    fn refresh_candidates(&mut self, mid: &Midpoint<D>, motion: &Motion<D>, h: f64) {
        let way = |k: usize| h * motion.free[k].0.norm().max(motion.before[k].0.norm());
        let reach = |k: usize| NEAR * radius_of(&self.grains, k) + 2.0 * way(k);
        // a share of its radius, or three steps at its speed
        let spare = |k: usize| (SPARE * radius_of(&self.grains, k)).max(3.0 * way(k));
        self.candidates.cover(&self.grains, &mid.grains, &self.walls, &mid.walls, reach, spare);
    }

    /// Pairs that the problem lacks and that its velocities would close. The step adds them and
    /// solves again.
    pub(super) fn missed(
        &mut self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        nodes: &Nodes<D>,
        h: f64,
    ) -> Vec<StoredTouch<D>> {
        let way = |k: usize| h * nodes.all[k].velocity.norm();
        // enough for the next step too
        let spare = |k: usize| (SPARE * radius_of(&self.grains, k)).max(0.5 * way(k));
        self.candidates.cover(&self.grains, &mid.grains, &self.walls, &mid.walls, way, spare);
        let mut present = touches.iter().peekable();
        let mut missed = Vec::new();
        for &pair in &self.candidates.pairs {
            while present.next_if(|t| t.pair < pair).is_some() {}
            if present.peek().is_some_and(|t| t.pair == pair) || pair.iter().all(|k| self.immovable(*k as usize)) {
                continue;
            }
            let (gap, normal, _) = self.geometry(mid, pair);
            let [i, j] = pair.map(|k| nodes.all[k as usize].velocity);
            if gap + h * (i - j).dot(&normal) < 0.0 && self.restitution_of(pair) == 0.0 {
                let (wide, tangents) = (self.is_wide(pair, gap), D::tangents(&D::frame(normal)));
                missed.push(StoredTouch { wide, tangents, ..StoredTouch::new(pair, None) });
            }
        }
        missed
    }

    /// Restitution coefficient of a pair (–).
    fn restitution_of(&self, pair: [u32; 2]) -> f64 {
        match &self.settings.restitution {
            None => 0.0,
            Some(e) if (pair[1] as usize) < self.grains.len() => e.grain_grain,
            Some(e) => e.grain_wall,
        }
    }

    /// Velocity that Signorini's law adds to the normal velocity of a dry contact (m/s); `None` if
    /// the contact cannot act in this step.
    fn bias(
        &self,
        mid: &Midpoint<D>,
        touch: &Touch<D>,
        stored: &StoredTouch<D>,
        motion: &Motion<D>,
        h: f64,
    ) -> Option<f64> {
        let e = self.restitution_of(touch.pair);
        let [none, most] = [TOUCHING, CLOSED].map(|share| share * self.smaller(touch.pair));
        let left = f64::from(stored.left);
        let none = if stored.closed {
            most
        } else if left <= most {
            none + left.max(0.0)
        } else {
            none
        };
        let touching = touch.gap <= none;
        let turn = || self.turn_around(mid, touch.pair, motion, h);
        if e == 0.0 {
            let apart = self.settings.expel_overlaps || !touching;
            return Some(if apart { touch.gap / h } else { turn().unwrap_or(0.0) });
        }
        let [i, j] = touch.pair.map(|k| motion.before[k as usize].0);
        let approach = (i - j).dot(&D::normal(&touch.frame));
        let threshold = self.settings.restitution.map_or(0.0, |r| r.threshold_speed);
        let at_rest = approach.abs() < threshold || h * approach.abs() <= none;
        let rebound = if at_rest { 0.0 } else { e * approach };
        touching.then(|| turn().map_or(rebound, |turn| rebound.min(turn)))
    }

    /// Friction coefficient of a dry contact (–).
    #[inline]
    fn friction_of(&self, pair: [u32; 2]) -> f64 {
        let wall = (pair[1] as usize).checked_sub(self.grains.len());
        match (&self.settings.material_friction, wall) {
            (Some(table), wall) => self.friction_of_materials(table, pair, wall),
            (None, None) => self.settings.friction,
            (None, Some(wall)) => self.walls[wall].friction,
        }
    }

    /// The same where there are several materials; `wall` if the second body is one.
    #[inline(never)]
    fn friction_of_materials(&self, table: &MaterialFriction, pair: [u32; 2], wall: Option<usize>) -> f64 {
        let material = |k: u32| self.grains.material_of(k as usize);
        match wall {
            None => table.grain_grain[material(pair[0]) * table.count + material(pair[1])],
            Some(wall) => table.grain_wall[material(pair[0]) * self.walls.len() + wall],
        }
    }

    /// Velocities of the walls across their drives at the end of a step of length `h` (m/s); empty
    /// if none is prescribed.
    fn slides(&self, h: f64) -> Vec<D::Vector> {
        if self.walls.iter().all(|wall| wall.slide.is_none()) {
            return Vec::new();
        }
        let slide = |wall: &Wall<D>| wall.slide_velocity(self.time + h).unwrap_or(D::Vector::zero());
        self.walls.iter().map(slide).collect()
    }

    /// The nodes of a step of length `h` at their free velocities.
    fn nodes(&self, motion: &Motion<D>, h: f64) -> Nodes<D> {
        let grains = self.grains.len();
        let node = |k: usize| {
            let (velocity, spin) = motion.free[k];
            let (inverse_mass, inverse_inertia) = match k.checked_sub(grains) {
                None => self.grains.inverse(k),
                Some(wall) => (self.walls[wall].free_direction().map_or(0.0, |(_, mass)| 1.0 / mass), 0.0),
            };
            Node { velocity, spin, inverse_mass, inverse_inertia }
        };
        Nodes {
            all: (0..grains + self.walls.len()).map(node).collect(),
            grains,
            drives: self.walls.iter().map(|w| w.free_direction().map_or(D::Vector::zero(), |(d, _)| d)).collect(),
            slides: self.slides(h),
        }
    }

    /// The contact problem of these contacts, with their reactions as warm start, and the place of
    /// each contact of the problem in `touches`.
    pub(super) fn assemble(
        &self,
        mid: &Midpoint<D>,
        touches: &[StoredTouch<D>],
        motion: &Motion<D>,
        brought: &Brought<D>,
        applied: f64,
        h: f64,
    ) -> (ContactProblem<D>, Places) {
        let mut problem = ContactProblem::new(self.nodes(motion, h), motion.free.clone(), applied);
        if D::N > 2 {
            problem.radii.clone_from(&self.grains.radius);
        }
        let mut counts = [0; KINDS];
        touches.iter().for_each(|touch| counts[self.kind(touch) as usize] += 1);
        problem.reserve(counts);
        let mut places = Places(counts.map(Vec::with_capacity));
        let order = blocks::order(touches.iter().map(|t| t.pair), self.grains.len());
        for k in 0..touches.len() {
            let place = order.as_ref().map_or(k, |order| order[k] as usize);
            let stored = &touches[place];
            let touch = &self.touch(mid, stored);
            let link = Link::<D>::new(touch.pair, touch.frame);
            let lever = self.levers(touch);
            let start = touch.reaction * h;
            let kind = self.kind(stored);
            let bias = match touch.bond {
                Some(_) => Some(0.0),
                None => self.bias(mid, touch, stored, motion, h),
            };
            // without a bias the contact cannot act in this step
            let Some(bias) = bias else { continue };
            match kind {
                Kind::Bonded | Kind::Elastic => {
                    let Some(number) = touch.bond.map(|bond| bond as usize) else { continue };
                    let bond = &self.bonds[number];
                    let (bias_n, bias_t) = D::split(&touch.frame, brought.turns[number].bias);
                    // in 2D no turn is oblique to the bond: what is there is round-off
                    let bias_t = if D::N > 2 { bias_t } else { D::Tangent::zero() };
                    let arm = bond.mean_diameter;
                    let arms = Arms { lever, bending: arm };
                    let (block, r) = (problem.nodes.block(&link, arms), over_arm(start, arm));
                    let (shift, cone, flow) =
                        (h * bond.strength * brought.strengthened, bond.cone(), self.settings.bond_flow);
                    if let Some(compliance) = bond.compliance(h) {
                        let carried = over_arm(brought.carried[number] * h, arm);
                        let law =
                            Elastic::new(block, compliance, carried, arms, shift, cone, flow).with_bias(bias_n, bias_t);
                        problem.elastic.push(Contact { link, law, r });
                    } else {
                        let law = Bonded::new(block, arms, shift, cone, flow).with_bias(bias_n, bias_t);
                        problem.bonded.push(Contact { link, law, r });
                    }
                }
                Kind::Dry => {
                    let block = problem.nodes.block(&link, Arms { lever, bending: 0.0 });
                    let t = of_frame::<D, _>(&link.axes, start.t);
                    problem.dry.push(Contact {
                        link: Link::new(link.nodes, link.axes),
                        law: Coulomb::new(block, lever, self.friction_of(touch.pair), bias),
                        r: Local { n: start.n, t, ..Local::zero() },
                    });
                }
                Kind::Frictionless => {
                    let block = problem.nodes.block(&link, Arms { lever, bending: 0.0 });
                    problem.frictionless.push(Contact {
                        link: Link::new(link.nodes, link.axes),
                        law: Frictionless::new(block, bias),
                        r: Local { n: start.n, ..Local::zero() },
                    });
                }
            }
            places.0[kind as usize].push(place as u32);
        }
        (problem, places)
    }

    /// The kind of a contact.
    fn kind(&self, stored: &StoredTouch<D>) -> Kind {
        match stored.bond() {
            Some(bond) if self.bonds[bond as usize].stiffness.is_some() => Kind::Elastic,
            Some(_) => Kind::Bonded,
            None if self.friction_of(stored.pair) > 0.0 => Kind::Dry,
            None => Kind::Frictionless,
        }
    }

    /// Distances from the centres to the contact point (m); zero for a wall.
    fn levers(&self, touch: &Touch<D>) -> [f64; 2] {
        touch.pair.map(|k| self.grains.radius.get(k as usize).map_or(0.0, |r| r + 0.5 * touch.gap))
    }
}

/// Radius of a grain (m); zero for a wall.
fn radius_of<D: Dim>(grains: &Grains<D>, body: usize) -> f64 {
    grains.radius.get(body).copied().unwrap_or(0.0)
}

/// A reaction with its moments divided by the mean diameter `arm`.
pub(super) fn over_arm<T: Vect, B: Moments>(r: Local<T, B>, arm: f64) -> Local<T, B> {
    Local { m: r.m * (1.0 / arm), ..r }
}

/// Write the impulses of a problem back to the contacts of the step, as forces.
#[inline]
pub(super) fn write_reactions<D: Dim>(
    touches: &mut [StoredTouch<D>],
    problem: &ContactProblem<D>,
    places: &Places,
    h: f64,
) {
    for touch in touches.iter_mut() {
        touch.reaction = Local::zero();
        touch.status = TouchStatus::Open;
    }
    problem.visit(&mut ReadBack { touches, places: places.all(), h });
}

/// Writes each contact to its place.
struct ReadBack<'a, D: Dim, P> {
    touches: &'a mut [StoredTouch<D>],
    places: P,
    h: f64,
}

impl<D: Dim, P: Iterator<Item = usize>> Visitor<D> for ReadBack<'_, D, P> {
    fn visit<L: Law>(&mut self, _: &Nodes<D>, contact: &Contact<D, L>) {
        let Some(place) = self.places.next() else { return };
        let (touch, h) = (&mut self.touches[place], self.h);
        let arm = contact.law.arms().bending;
        let frame = D::with_tangents(contact.link.axes.normal(), &touch.tangents);
        let (r, t) = (&contact.r, in_frame::<D, _>(&frame, contact.r.t));
        touch.reaction = Local { n: r.n / h, t: t * (1.0 / h), m: resized::<_, D::Moment>(r.m) * (arm / h) };
        touch.status = if touch.bond().is_some() {
            TouchStatus::Bonded
        } else if r.n == 0.0 {
            TouchStatus::Open
        } else if r.t.norm() >= (1.0 - 1e-9) * contact.law.cone().mu * r.n {
            TouchStatus::Slip
        } else {
            TouchStatus::Stick
        };
    }
}
