//! The world: grains, walls, bonds and time, and the time step that advances them.
//!
//! [`World::step`] follows the scheme of Moreau and Jean (Jean 1999): half a step in position,
//! detection, free velocity, contact problem with its rupture cascade, half a step.

mod assembly;
mod event;
mod grip;
mod ledger;
mod limit_load;
mod limits;
mod loads;
mod membrane;
mod motion;
mod observe;
mod parts;
mod report;
mod small_loads;
mod start;
mod state;
mod step;
mod touch;
mod turning;

pub use ledger::{Ledger, Momentum};
pub use membrane::Membrane;
pub use report::{StepError, StepReport, Violation};
pub use touch::{Break, Counts, Touch, TouchStatus};

use motion::{Midpoint, Turn};
use touch::StoredTouch;

use crate::body::{Grains, Load, Wall, separation};
use crate::bond::{Bond, BondStatus, Bonds, Rupture, Stiffness};
use crate::contact::BondFlow;
use crate::detection::{Candidates, pairs_within};
use crate::dim::{Dim, Vect};
use crate::solver::{ContactSolver, SolverSettings};

/// Restitution of the dry contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Restitution {
    /// Coefficient between grains (–), 0 to 1.
    pub grain_grain: f64,
    /// Coefficient between a grain and a wall (–), 0 to 1.
    pub grain_wall: f64,
    /// Normal speed (m/s) below which the coefficient is taken as zero.
    pub threshold_speed: f64,
}

/// Friction coefficients of several materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialFriction {
    /// Number of materials K.
    pub count: usize,
    /// Between grains of the materials a and b at a K + b (–), K × K and symmetric.
    pub grain_grain: Vec<f64>,
    /// Between a grain of material a and wall w of W at a W + w (–), K × W.
    pub grain_wall: Vec<f64>,
}

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Settings<D: Dim> {
    /// Time step h (s).
    pub step: f64,
    /// Acceleration of gravity (m/s²), if there is any.
    pub gravity: Option<D::Vector>,
    /// Friction coefficient between grains (–).
    pub friction: f64,
    /// Friction coefficients in place of `friction` and of those of the walls, if there are several
    /// materials.
    pub material_friction: Option<MaterialFriction>,
    /// Restitution, if there is any.
    pub restitution: Option<Restitution>,
    /// Flow rule of bonds at their limit.
    pub bond_flow: BondFlow,
    /// Which bonds at their limit break, and when.
    pub rupture: Rupture,
    /// Solver of the contact problem.
    pub solver: SolverSettings,
    /// Number of times that a step may be halved after a refused solve.
    pub max_halvings: u32,
    /// Thickness of the sample (m) in 2D, 1 in 3D; areas times this are volumes.
    pub thickness: f64,
    /// Remove overlaps within one step instead of only preventing their growth. This adds energy:
    /// for sample preparation alone, which discards velocities.
    pub expel_overlaps: bool,
}

/// Grains, walls, bonds and time.
pub struct World<D: Dim> {
    /// The grains.
    pub grains: Grains<D>,
    /// The walls.
    pub walls: Vec<Wall<D>>,
    /// All bonds that ever formed, sorted by pair; broken bonds stay in the list.
    pub bonds: Bonds,
    /// Prescribed forces and torques.
    pub loads: Vec<Load<D>>,
    /// The membrane on the free surface of the sample, if there is one (2D).
    pub membrane: Option<Membrane<D>>,
    /// Settings of the run.
    pub settings: Settings<D>,
    /// Time (s).
    pub time: f64,
    /// Number of accepted steps.
    pub steps: u64,
    /// With [`Rupture::NextEvent`], the time at which the load functions give the load of the last
    /// event (s). It decreases where the load must be lowered.
    pub load_time: f64,
    /// Times at which a load function turns, in increasing order (s): loading to the next event
    /// looks at each of them, and takes the loads to be affine in between.
    pub load_knots: Vec<f64>,
    /// Energy balance since the start.
    pub ledger: Ledger,
    /// Contacts of the last accepted step, or of the last part of it, sorted by pair, with their
    /// reactions.
    stored: Vec<StoredTouch<D>>,
    /// Positions at mid-step of that step, which determine the geometry of its contacts.
    mid: Midpoint<D>,
    /// Length of the last accepted step, or of the last part of it (s); zero before the first.
    last_part: f64,
    /// Corrections of the bonds in it, by bond index; empty before the first.
    turns: Vec<Turn<D>>,
    /// The wall that holds each grain; empty if no wall holds one.
    held: Vec<Option<u32>>,
    candidates: Candidates<D>,
    solver: Box<dyn ContactSolver<D>>,
    /// The settings that the solver was built from; `None` for a user-defined solver.
    built_with: Option<SolverSettings>,
    /// Positions of the grains at time zero (m).
    reference: Vec<D::Vector>,
    /// Volume of the box around them, over the thickness.
    reference_box: f64,
}

/// Everything that a step changes, saved while a step is attempted in halves.
struct Snapshot<D: Dim> {
    grains: Grains<D>,
    walls: Vec<Wall<D>>,
    membrane: Option<Membrane<D>>,
    bonds: Bonds,
    stored: Vec<StoredTouch<D>>,
    mid: Midpoint<D>,
    last_part: f64,
    turns: Vec<Turn<D>>,
    ledger: Ledger,
    time: f64,
}

impl<D: Dim> Default for Settings<D> {
    /// Steps of 10⁻⁴ s, no gravity, no friction, no restitution, and otherwise the defaults of a
    /// scene.
    fn default() -> Self {
        Self {
            step: 1e-4,
            gravity: None,
            friction: 0.0,
            material_friction: None,
            restitution: None,
            bond_flow: BondFlow::default(),
            rupture: Rupture::default(),
            solver: SolverSettings::default(),
            max_halvings: 4,
            thickness: 1.0,
            expel_overlaps: false,
        }
    }
}

impl<D: Dim> World<D> {
    /// A world at time zero, without bonds. Walls with a grip hold the grains near them.
    pub fn new(mut grains: Grains<D>, walls: Vec<Wall<D>>, loads: Vec<Load<D>>, settings: Settings<D>) -> Self {
        let held = grip::hold(&mut grains, &walls);
        Self::holding(held, grains, walls, loads, settings)
    }

    /// A world at time zero, without bonds, in which these walls hold the grains.
    fn holding(
        held: Vec<Option<u32>>,
        grains: Grains<D>,
        walls: Vec<Wall<D>>,
        loads: Vec<Load<D>>,
        settings: Settings<D>,
    ) -> Self {
        let mut world = Self {
            reference: Vec::new(),
            reference_box: 0.0,
            solver: settings.solver.build(),
            built_with: Some(settings.solver),
            candidates: Candidates::default(),
            stored: Vec::new(),
            mid: Midpoint::of(&grains, &walls),
            last_part: 0.0,
            turns: Vec::new(),
            held,
            bonds: Bonds::default(),
            ledger: Ledger::default(),
            time: 0.0,
            steps: 0,
            load_time: 0.0,
            load_knots: Vec::new(),
            grains,
            walls,
            loads,
            membrane: None,
            settings,
        };
        world.refer_to(world.grains.position.clone());
        world.ledger.kinetic = world.kinetic_energy();
        world
    }

    /// Bond every pair of grains whose gap is at most `gap_tolerance` (–) times its mean diameter,
    /// with friction `friction`; `strength` maps a mean diameter (m) to a tensile strength (N),
    /// where zero means no bond.
    ///
    /// Pairs of two fixed grains get no bond, since nothing can strain it, nor do pairs that
    /// already have one, intact or broken.
    pub fn form_bonds(&mut self, gap_tolerance: f64, strength: impl Fn(f64) -> f64, friction: f64) {
        self.add_bonds(close_pairs(&self.grains, gap_tolerance, |_, mean_diameter| strength(mean_diameter), friction));
    }

    /// Add bonds. A pair that already has a bond, intact or broken, keeps it. A bond between grains
    /// that press on each other takes over the reaction of their contact; if it is elastic, the
    /// energy that its springs have under this reaction counts as external work.
    pub fn add_bonds(&mut self, bonds: Vec<Bond>) {
        let numbers = self.bonds.merge(bonds);
        let brought: f64 = self.stored.iter().filter_map(|stored| self.brought_into_bond(stored)).sum();
        self.ledger.elastic += brought;
        self.ledger.external_work += brought;
        if !self.turns.is_empty() {
            let mut turns = vec![Turn::default(); self.bonds.len()];
            self.turns.iter().zip(&numbers).for_each(|(turn, number)| turns[*number as usize] = *turn);
            self.turns = turns;
        }
        for stored in &mut self.stored {
            let number = stored.bond().map(|bond| numbers[bond as usize]);
            stored.tie(number);
        }
    }

    /// Elastic energy (J) that a new bond has under the reaction of a dry contact, ½ f²/k.
    fn brought_into_bond(&self, stored: &StoredTouch<D>) -> Option<f64> {
        if stored.bond().is_some() {
            return None;
        }
        let number = self.bonds.binary_search_by_key(&stored.pair, |bond| bond.pair).ok()?;
        let stiffness = self.bonds[number].stiffness.filter(|_| self.bonds[number].status == BondStatus::Intact)?;
        let (n, t) = (stored.reaction.n, &stored.reaction.t);
        Some(0.5 * (n * n / stiffness.normal + t.dot(t) / stiffness.tangential))
    }

    /// Give the twisting moment of every bond the limit ξ a (r_n + r_coh) with this ξ (–), in 3D
    /// with twist rows. A bond without such a limit twists freely.
    pub fn limit_twist(&mut self, xi: f64) {
        self.bonds.iter_mut().for_each(|bond| bond.twist = xi);
    }

    /// Make every bond elastic; `stiffness` maps the mean diameter (m) of a bond to its stiffness.
    pub fn make_bonds_elastic(&mut self, stiffness: impl Fn(f64) -> Stiffness) {
        for bond in &mut self.bonds {
            bond.stiffness = Some(stiffness(bond.mean_diameter));
        }
    }

    /// Replace the solver from the next step on; the new one knows nothing of earlier solves.
    pub fn set_solver(&mut self, solver: SolverSettings) {
        self.settings.solver = solver;
        (self.solver, self.built_with) = (solver.build(), Some(solver));
    }

    /// Use a user-defined solver from the next step on. The tolerances of `settings.solver` still
    /// apply: they bound how far bodies may move beyond their contact laws.
    pub fn use_solver(&mut self, solver: Box<dyn ContactSolver<D>>) {
        (self.solver, self.built_with) = (solver, None);
    }

    /// Rebuild the solver if its settings have changed.
    fn follow_settings(&mut self) {
        if self.built_with.is_some_and(|built| built != self.settings.solver) {
            self.set_solver(self.settings.solver);
        }
    }

    /// A copy of everything that a step changes.
    fn snapshot(&self) -> Snapshot<D> {
        Snapshot {
            grains: self.grains.clone(),
            walls: self.walls.clone(),
            membrane: self.membrane.clone(),
            bonds: self.bonds.clone(),
            stored: self.stored.clone(),
            mid: self.mid.clone(),
            last_part: self.last_part,
            turns: self.turns.clone(),
            ledger: self.ledger,
            time: self.time,
        }
    }

    fn restore(&mut self, snapshot: Snapshot<D>) {
        self.grains = snapshot.grains;
        self.walls = snapshot.walls;
        self.membrane = snapshot.membrane;
        self.bonds = snapshot.bonds;
        self.stored = snapshot.stored;
        self.mid = snapshot.mid;
        (self.last_part, self.turns) = (snapshot.last_part, snapshot.turns);
        self.ledger = snapshot.ledger;
        self.time = snapshot.time;
    }

    /// Whether some dry contact may have friction.
    pub fn has_friction(&self) -> bool {
        match &self.settings.material_friction {
            Some(table) => table.grain_grain.iter().chain(&table.grain_wall).any(|mu| *mu > 0.0),
            None => self.settings.friction > 0.0 || self.walls.iter().any(|wall| wall.friction > 0.0),
        }
    }

    /// Number of intact bonds.
    pub fn intact_bonds(&self) -> usize {
        self.bonds.iter().filter(|b| b.status == BondStatus::Intact).count()
    }

    /// Volume of the box around the sample at time zero (m³), the reference of the stress.
    pub fn reference_volume(&self) -> f64 {
        self.reference_box * self.settings.thickness
    }

    /// Use these positions of the grains (m) as those at time zero.
    fn refer_to(&mut self, places: Vec<D::Vector>) {
        let (low, high) = self.grains.bounds_at(&places);
        self.reference_box = (0..D::N).map(|axis| high[axis] - low[axis]).product();
        self.reference = places;
    }

    /// Set all velocities and spins to zero and keep everything else: in quasi-static preparation
    /// each step begins at rest.
    pub fn stop_motion(&mut self) {
        self.grains.velocity.iter_mut().for_each(|v| *v = D::Vector::zero());
        self.grains.spin.iter_mut().for_each(|w| *w = D::Spin::zero());
        self.walls.iter_mut().for_each(|w| w.velocity = D::Vector::zero());
        self.ledger.kinetic = 0.0;
    }
}

/// The bonds that [`World::form_bonds`] would add, but with a strength that may depend on the
/// pair (the lower index first) and its mean diameter (m).
pub fn close_pairs<D: Dim>(
    grains: &Grains<D>,
    gap_tolerance: f64,
    strength: impl Fn([usize; 2], f64) -> f64,
    friction: f64,
) -> Vec<Bond> {
    // a superset of the pairs: the gap decides below
    let skin: Vec<f64> = grains.radius.iter().map(|r| 2.0 * gap_tolerance * r).collect();
    let mut bonds = Vec::new();
    for pair in pairs_within(grains, &grains.position, &skin) {
        let [i, j] = pair.map(|k| k as usize);
        let mean_diameter = grains.radius[i] + grains.radius[j];
        let apart = separation::<D>(grains.position[i], grains.position[j]);
        let rest_gap = apart.norm() - mean_diameter;
        let strength = strength([i, j], mean_diameter);
        let was_bonded = grains.fixed[i] && grains.fixed[j];
        if rest_gap <= gap_tolerance * mean_diameter && strength > 0.0 && !was_bonded {
            let status = BondStatus::Intact;
            let (shear, rolling, twist, stiffness) = (friction, friction, 0.0, None);
            bonds.push(Bond { pair, rest_gap, mean_diameter, strength, shear, rolling, twist, stiffness, status });
        }
    }
    bonds
}
